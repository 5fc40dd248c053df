"""Priors of effects' parameters, as wide as the values that an effect itself tries."""

import numpy as np

from fem.model import Effect
from updating.inference.fit import FitProblem
from updating.inference.unknowns import ScaledUnknown


def prior_of(problem: FitProblem, effect: Effect, variable: ScaledUnknown) -> tuple[float, float]:
    """Return mean and standard deviation of an unknown of an effect.

    Those of the grid from which the effect asks to be started, on the scale of the unknown: it spans what is
    plausible, decades of a stiffness, a member's length, or a fifth of its mass. An unknown with one value on
    it has the width of its bounds.
    """
    name = variable.ref[1]
    grid = effect.starts(problem.surroundings)
    x = np.array([variable.to_x(point[name]) for point in grid if name in point])
    if len(x) and np.ptp(x) > 0:
        return float(x.mean()), float(x.std())
    lo, hi = variable.bounds()
    width = hi - lo if np.isfinite(hi - lo) else 6.0
    centre = float(x.mean()) if len(x) else (lo + hi) / 2
    return centre, float(min(width / 12**0.5, 10.0))
