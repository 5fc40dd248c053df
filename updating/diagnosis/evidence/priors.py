"""Priors: all constants that decide whether an effect is named, and what its parameters may be."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from fem.model import Effect
from updating.inference.fit import FitProblem
from updating.inference.unknowns import ScaledUnknown

DATA_PER_MODE = 4.0
"""Independent data that each mode of the band stands for: frequency, damping and a few of the shape [-]."""
FORM_SECTION = {"A": 0.01, "Iy": 0.02, "Iz": 0.02, "J": 0.05, "shear": 0.5}
"""Standard deviations of mass, bending and torsional stiffness, and shear flexibility of members that are
alike, relative [-]."""
FORM_ZONE = {"u": 1.0, "plane": 0.4, "mass": 0.4}
"""Of what lies inside of a connection: of the logarithm of its stiffness, of that of bending in its plane
besides, and of its mass, relative [-]."""
FORM_DAMPING = 0.1
"""Relative standard deviation of each mode's damping ratio and of each member's loss factor [-]. That of
joints is as uncertain as the study's damping."""
FORM_MODES = 0.0005, 0.008
"""Least and largest standard deviation of the relative shift of each mode's eigenvalue that frame theory
leaves: of any order between them, as the data say [-]."""
EFFECT_ODDS = np.log(10.0)
"""Prior odds, as a logarithm, against one more change: each parameter of an effect but its position."""
UNKNOWN_ODDS = np.log(1e4)
"""Prior odds, as a logarithm, against what is missing being nothing that the library has."""
TWIN_NATS = 3.0
"""Hypotheses within so much of the best one's score are its twins."""
FORM_LEFT = 0.5
"""Level that a right model of beams may leave beyond noise, in parts of the study's ``model_error`` [-]."""


FORM_LEAST = 0.05
"""Level that beams leave of any structure in any case, in parts of the study's ``model_error`` [-]."""


DECADE = 10.0
"""An unknown whose plausible sizes span more than this factor may be of any order of magnitude [-]."""


@dataclass(frozen=True, slots=True)
class EffectPrior:
    """What is known beforehand of an unknown of an effect.

    Attributes
    ----------
    mean, std : float
        Of a normal density.
    least, range : float
        Of a size that may be of any order of magnitude, ``range`` is the logarithm of how much larger the
        largest plausible one is than the ``least``, twice that where it has either sign: its density is
        1 / (|x| range). 0 for others.
    """

    mean: float
    std: float
    least: float = 0.0
    range: float = 0.0

    def width_at(self, x: float) -> float:
        """Return the standard deviation of a normal density that is as high at its mean as this is at x."""
        return max(abs(x), self.least) * self.range / float(np.sqrt(2 * np.pi))

    def mass(self, low: float, high: float) -> float:
        """Return the probability of values between two."""
        x = np.array([low, high])
        if not self.range:
            F = ndtr((x - self.mean) / self.std)
        else:
            size = np.abs(x) / self.least
            F = np.sign(x) * np.where(size < 1, size, 1 + np.log(np.maximum(size, 1.0))) / self.range
        return abs(float(F[1] - F[0]))


def prior_of(problem: FitProblem, effect: Effect, variable: ScaledUnknown) -> EffectPrior:
    """Return what is known beforehand of an unknown of an effect.

    As wide as the grid from which the effect asks to be started, on the scale of the unknown: it spans what
    is plausible, decades of a stiffness, a member's length, or a fifth of its mass. An unknown with one value
    on it has the width of its bounds.
    """
    name = variable.ref[1]
    grid = effect.starts(problem.surroundings)
    x = np.array([variable.to_x(point[name]) for point in grid if name in point])
    size = np.abs(x)
    p = next(q for q in effect.parameters() if q.name == name)
    sized = len(x) > 0 and not p.log and p.absent == 0 and size.min() > 0
    if sized and size.max() > DECADE * size.min():
        signs = 2 if x.min() < 0 < x.max() else 1
        return EffectPrior(0.0, float(size.max()), float(size.min()), signs * np.log(size.max() / size.min()))
    if len(x) and np.ptp(x) > 0:
        return EffectPrior(float(x.mean()), float(x.std()))
    lo, hi = variable.bounds()
    width = hi - lo if np.isfinite(hi - lo) else 6.0
    centre = float(x.mean()) if len(x) else (lo + hi) / 2
    return EffectPrior(centre, float(min(width / 12**0.5, 10.0)))
