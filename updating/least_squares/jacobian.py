"""Derivatives of residuals as the least-squares loop needs them: in sums of their products."""

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from scipy.linalg.blas import dsyrk

from fem.array_types import Complexes, Floats, Ints


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
