"""What the error levels of groups of residuals cost: estimated noise, and what a model leaves beyond it."""

from dataclasses import dataclass

import numpy as np

from fem.array_types import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """The negative log likelihood of residuals by the mean square v of each group, up to a constant.

    ½ n ln(c + v - σ²) from the noise σ² on, and its tangent below. A discrepancy τ² that is common to blocks
    of N/n residuals leaves a block's mean with the variance σ² n/N + τ². With c = σ² n/N and v - σ² for τ²
    this is its likelihood. Near the noise it is that of N independent data, N v / 2σ²; far above it that of n
    data whose level is estimated.

    Attributes
    ----------
    n : ndarray (n_groups,)
        Independent data for which the discrepancy of each group stands.
    least : ndarray (n_groups,)
        c [unit of residuals²].
    noise : ndarray (n_groups,)
        σ² [unit of residuals²].
    """

    n: Floats
    least: Floats
    noise: Floats

    @property
    def believed(self) -> "Levels":
        """The same: no reading of an FRF is taken for a bad one."""
        return self

    def cost(self, v: Floats) -> float:
        """Return the negative log likelihood at mean squares (n_groups,)."""
        return float(self.costs(v))

    def costs(self, v: Floats) -> Floats:
        """Return the negative log likelihoods at several sets of mean squares, (..., n_groups)."""
        beyond = v - self.noise
        above, below = np.maximum(beyond, 0.0), np.minimum(beyond, 0.0)
        return 0.5 * ((np.log(self.least + above) + below / self.least) @ self.n)

    def weight(self, v: Floats) -> Floats:
        """Return twice its derivatives by the mean squares, (..., n_groups)."""
        return self.n / (self.least + np.maximum(v - self.noise, 0.0))

    def gain(self, v: Floats, least: Floats) -> float:
        """Return by how much the log likelihood would rise with mean squares no larger than the least."""
        return self.cost(v) - self.cost(np.minimum(v, least))

    def is_bad(self, v: Floats) -> Floats:
        """Return zeros: no reading of an FRF is taken for a bad one."""
        return np.zeros_like(v)
