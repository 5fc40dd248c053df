"""How probable the sizes of a candidate are before any data, and the evidence that follows from that."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.model import ParameterRef
from updating.forecast.grid import Little
from updating.inference.unknowns import EffectPrior, ScaledUnknown, effect_unknowns, prior_of


@dataclass(frozen=True, slots=True, eq=False)
class Sizes:
    """The prior of a candidate's size, on the multiples of what a little of it is.

    Attributes
    ----------
    little : Little
    unknown : ScaledUnknown
        The candidate's first parameter.
    prior : EffectPrior
    """

    little: Little
    unknown: ScaledUnknown
    prior: EffectPrior

    @classmethod
    def of(cls, problem: Any, little: Little) -> "Sizes":
        """Return the prior of the sizes that a problem's structure makes plausible."""
        effect = little.grid.effect
        unknown = effect_unknowns((effect,), (little.grid.points[0],))[0]
        return cls(little, unknown, prior_of(problem, effect, unknown))

    @property
    def ref(self) -> ParameterRef:
        """The first parameter."""
        return self.unknown.ref

    def log_share(self, k: int, factor: float, std: float) -> float:
        """Return ln of the share of the sizes that are as likely as the best, of a normal likelihood.

        At the k-th place the likelihood has its maximum at a multiple ``factor`` and the deviation ``std``.
        Its integral over its height is √(2π) deviations, but no more than all sizes that there are
        (MacKay, *Information Theory, Inference, and Learning Algorithms*, 2003, ch. 28).
        """
        half = np.sqrt(np.pi / 2) * std
        low, high = (self.x(k, factor + sign * half) for sign in (-1, 1))
        # Prior probabilities below this count as this: their logarithm stays finite [-]
        return float(np.log(max(self.prior.mass(low, high), 1e-300)))

    def x(self, k: int, factor: float) -> float:
        """Return the unknown at a multiple of the k-th place's little."""
        return self.unknown.to_x(self.little.values(k, factor)[self.ref[1]])

    def estimate(self, k: int, factor: float, std: float) -> tuple[dict[str, float], dict[str, float]]:
        """Return the values at a multiple of the k-th place's little, and their deviations.

        Of positions those of the grid. Where the data ask for none of it, the values are those of a little:
        nothing is known of the effect of a bound.
        """
        factor = factor or 1.0
        values = self.little.values(k, factor)
        x, *ends = (self.x(k, a) for a in (factor, factor - std, factor + std))
        width = min(self.prior.std, abs(ends[1] - ends[0]) / 2)
        deviations = {key: float(np.std([q[key] for q in self.little.grid.points])) for key in values}
        return values, deviations | {self.ref[1]: self.unknown.deviation(x, width)}
