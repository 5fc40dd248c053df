"""The cost of residuals with known noise and a discrepancy of unknown size, over all its sizes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class ModeLevels:
    """The negative log likelihood of residuals by the mean square v of each group, up to a constant.

    -ln Σ_k p_k σ_k⁻ⁿ exp(-N v / 2σ_k²), with σ_k² = σ² + τ_k²: noise of known size and a discrepancy
    whose size τ_k has the prior probability p_k. Where n values are independent of N residuals, as one
    component of a shape is lost to its scale, n stands in the first place alone.

    Attributes
    ----------
    n : ndarray (n_groups,)
        Independent data of each group.
    size : ndarray (n_groups,)
        Residuals of each group, N.
    variance : ndarray (n_groups,)
        σ² of one of the data.
    discrepancy : ndarray (n_groups, n_sizes)
        τ², each as probable as the others.
    """

    n: Floats
    size: Floats
    variance: Floats
    discrepancy: Floats

    @classmethod
    def up_to(cls, n: Floats, size: Floats, variance: Floats, largest: Floats) -> "ModeLevels":
        """Return levels whose discrepancy may be of any order of magnitude up to the largest."""
        share = np.append(0.0, np.geomspace(0.02, 1.0, 12))
        return cls(n, size, variance, np.square(np.outer(largest, share)))

    @property
    def noise(self) -> Floats:
        """Mean squares that noise leaves, (n_groups,)."""
        return self.n * self.variance / self.size

    def _parts(self, v: Floats) -> tuple[Floats, Floats]:
        total = self.variance[:, None] + self.discrepancy
        each = -0.5 * self.n[:, None] * np.log(total) - 0.5 * (self.size * v)[..., None] / total
        return total, each

    def cost(self, v: Floats) -> float:
        """Return the negative log likelihood at mean squares (n_groups,)."""
        return float(self.costs(v))

    def costs(self, v: Floats) -> Floats:
        """Return the negative log likelihoods at several sets of mean squares, (..., n_groups)."""
        _, each = self._parts(v)
        return -(np.logaddexp.reduce(each, axis=-1) - np.log(each.shape[-1])).sum(axis=-1)

    def weight(self, v: Floats) -> Floats:
        """Return twice its derivatives by the mean squares, (..., n_groups)."""
        total, each = self._parts(v)
        share = np.exp(each - np.logaddexp.reduce(each, axis=-1)[..., None])
        return self.size * (share / total).sum(axis=-1)

    def discrepancy_share(self, v: Floats) -> Floats:
        """Return the share of the residuals that is discrepancy, E[τ² / (σ² + τ²)], (n_groups,) [-]."""
        total, each = self._parts(v)
        share = np.exp(each - np.logaddexp.reduce(each, axis=-1)[..., None])
        return (share * self.discrepancy / total).sum(axis=-1)
