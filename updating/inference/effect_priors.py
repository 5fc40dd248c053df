"""Priors of the parameters of effects."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy

from fem.model import Effect, parameter_values
from updating.inference.unknowns import ScaledUnknown, effect_unknowns

DECADE = 10.0
"""An unknown whose plausible sizes span more than this factor may be of any order of magnitude [-]."""


class Surrounded(Protocol):
    """A problem that knows how stiff the structure is around a constraint."""

    def surroundings(self, key: tuple[str, str]) -> float:
        """Return the median impedance to motion along a released constraint [N/m, N·m/rad]."""
        ...


@dataclass(frozen=True, slots=True)
class EffectPrior:
    """The prior of an unknown of an effect.

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
        """Return the probability of values between two, of which there may be more than are plausible."""
        x = np.array([low, high])
        if not self.range:
            F = scipy.special.ndtr((x - self.mean) / self.std)
        else:
            size = np.abs(x) / self.least
            F = np.sign(x) * np.where(size < 1, size, 1 + np.log(np.maximum(size, 1.0))) / self.range
        return min(abs(float(F[1] - F[0])), 1.0)


def prior_of(problem: Surrounded, effect: Effect, variable: ScaledUnknown) -> EffectPrior:
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


def log_occam_factor(problem: Surrounded, effect: Effect, n_deviations: float, n_positions: int) -> float:
    """Return ln of the share of an effect's sizes and positions that are as likely as its best one.

    A size of so many of its standard deviations is known to 1 / ``n_deviations`` of itself, and one of
    ``n_positions`` is the best: the factor by which the evidence of the effect is less than its likelihood
    (MacKay, *Information Theory, Inference, and Learning Algorithms*, 2003, ch. 28).
    """
    variables = effect_unknowns((effect,), (parameter_values(effect),))
    first = effect.name, effect.parameters()[0].name
    span = next((prior_of(problem, effect, v).range for v in variables if v.ref == first), 0.0)
    return -float(np.log(max(span, 1.0) * n_deviations / np.sqrt(2 * np.pi)) + np.log(max(n_positions, 1)))
