"""What a fit needs of the cost of its residuals."""

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from scipy.linalg.blas import dsyrk

from fem.array_types import Complexes, Floats, Ints


class Costs(Protocol):
    """A negative log likelihood by the mean squares of groups of residuals."""

    @property
    def noise(self) -> Floats:
        """Mean squares that noise leaves, (n_groups,)."""
        ...

    @property
    def believed(self) -> Self:
        """The same where every reading belongs to the structure's model."""
        ...

    def cost(self, v: Floats) -> float:
        """Return the negative log likelihood at mean squares (n_groups,)."""
        ...

    def costs(self, v: Floats) -> Floats:
        """Return the negative log likelihoods at several sets of mean squares, (..., n_groups)."""
        ...

    def weight(self, v: Floats) -> Floats:
        """Return twice its derivatives by the mean squares, (..., n_groups)."""
        ...

    def gain(self, v: Floats, least: Floats) -> float:
        """Return by how much the log likelihood would rise with mean squares no larger than the least."""
        ...

    def is_bad(self, v: Floats) -> Floats:
        """Return the probability that the readings of each group are bad ones, (..., n_groups)."""
        ...


# The robust loss of residuals: pseudo-Huber, and the weights that make least squares follow it --------------


Residuals = Floats | Complexes


def pseudo_huber(r: Residuals, turn: float) -> Floats:
    """Return ρ = 2c² (√(1 + |r|²/c²) - 1), the loss of each residual, of the shape of r.

    |r|² for |r| ≪ c, and 2c|r| for |r| ≫ c (Charbonnier, Blanc-Féraud, Aubert and Barlaud, *IEEE Trans. Image
    Process.* 6, 1997, 298): a resonance in the wrong place leaves residuals of several nepers at a few lines,
    and their squares would outweigh all others.

    Parameters
    ----------
    r : ndarray
        Residuals, real or complex.
    turn : float
        c, where the loss turns from quadratic to linear [unit of r].
    """
    return 2 * turn**2 * (_root(r, turn) - 1)


def pseudo_huber_weight(r: Residuals, turn: float) -> Floats:
    """Return dρ/d|r|² = 1/√(1 + |r|²/c²), the weight of |r|² in iteratively reweighted least squares [-]."""
    return 1 / _root(r, turn)


def _root(r: Residuals, turn: float) -> Any:
    return np.sqrt(1 + np.abs(r) ** 2 / turn**2)


# What the error levels of groups of residuals cost: estimated noise, and what a model leaves beyond it


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


# Derivatives of residuals as the least-squares loop needs them: in sums of their products -------------------


class Jacobian(Protocol):
    """Derivatives of m complex residuals by n unknowns.

    Attributes
    ----------
    most_used : int
        Number of points in a row that may share them: 1 where they cost hardly more than residuals.
    """

    most_used: ClassVar[int]

    def products(self, r: Complexes, weight: Floats, member: Ints | None = None) -> tuple[Floats, Floats]:
        """Return Σ w J r, (n_groups, n), and Σ w J Jᵀ, (n_groups, n, n), of real and imaginary parts.

        Parameters
        ----------
        r : ndarray (m,)
            Residuals.
        weight : ndarray (m,)
            w of each residual.
        member : ndarray of int (m,), optional
            Number of its group; all are in one unless given.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class DenseJacobian:
    """A Jacobian (n, m) as it is."""

    J: Complexes
    most_used: ClassVar[int] = 1

    def products(self, r: Complexes, weight: Floats, member: Ints | None = None) -> tuple[Floats, Floats]:
        """Return the sums of :meth:`Jacobian.products`."""
        root = np.sqrt(weight)
        slopes, curvatures = [], []
        for here in [slice(None)] if member is None else member == np.arange(member.max() + 1)[:, None]:
            J, weighted = self.J[:, here], root[here] * r[here]
            parts = np.hstack([J.real * root[here], J.imag * root[here]])
            A = dsyrk(1.0, parts.T, trans=1)  # the upper half of a symmetric product
            slopes.append(parts @ np.concatenate([weighted.real, weighted.imag]))
            curvatures.append(A + np.triu(A, 1).T)
        return np.array(slopes), np.array(curvatures)
