"""Derivatives of weighted log ratios of FRFs, whose normal equations have the form of an arrow."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.reduction.frf_slopes import FrfSlopes


@dataclass(frozen=True, slots=True, eq=False)
class FrfJacobian:
    """Derivatives of w ln(H / measured) by variables, damping and small deviations.

    Errors of a sensor change the residuals of that sensor alone: half of the unknowns have diagonal blocks in
    the normal equations. Products are of single precision, as the derivatives are, and their sums over
    sensors of double precision.

    Attributes
    ----------
    slopes : FrfSlopes
        dH by the refs of the variables, by deviations and by ζ, each in units of its unknown.
    first_refs : ndarray of int (n_variables,)
        Number of the first of the refs of each variable.
    n_refs : int
        Number of refs of variables.
    by_damping : ndarray (n_zeta, n_damping, n_freq)
        Slopes of ζ by the unknowns of the damping curve.
    per : ndarray (n_freq, n_out, n_in)
        w / H; 0 where a value does not count.
    keep : ndarray of bool (n_freq, n_out, n_in)
        Values that are residuals.
    phase : bool
        Whether residuals have imaginary parts.
    """

    slopes: FrfSlopes
    first_refs: Ints
    n_refs: int
    by_damping: NDArray[np.float32]
    per: Complexes
    keep: Bools
    phase: bool = True
    most_used: ClassVar[int] = 3

    @property
    def _counts(self) -> tuple[int, int, int, int]:
        """Numbers of variables, unknowns of damping, deviations before errors of sensors, and these."""
        n_variables, n_damping = len(self.first_refs), self.by_damping.shape[1]
        return n_variables, n_damping, self.slopes.first - self.n_refs, len(self.slopes.of)

    @property
    def rows(self) -> tuple[Ints, Ints]:
        """Numbers of the unknowns that change any residual, and of errors of sensors."""
        n_variables, n_damping, n_before, n_single = self._counts
        n_deviations = len(self.slopes.common) - self.n_refs - len(self.by_damping) + n_single
        first = n_variables + n_damping + n_before
        every = np.arange(n_variables + n_damping + n_deviations)
        return np.delete(every, slice(first, first + n_single)), every[first : first + n_single]

    def products(self, r: Complexes, weight: Floats, member: Ints | None = None) -> tuple[Floats, Floats]:
        """Return the sums of :meth:`updating.least_squares.jacobian.Jacobian.products`.

        Groups are of whole lines that follow one another.
        """
        root = np.sqrt(weight)
        common, single = self._weighted(root)
        weighted = np.zeros(self.keep.shape, dtype=np.complex64)
        weighted[self.keep] = root * r
        residuals = np.ascontiguousarray(weighted.swapaxes(0, 1))
        line = np.broadcast_to(np.arange(len(self.keep))[:, None, None], self.keep.shape)[self.keep]
        ends = [0, len(self.keep)]
        if member is not None:
            ends = [0, *(line[np.flatnonzero(np.diff(member)) + 1]).tolist(), len(self.keep)]
        parts = [
            self._products(common[:, :, a:b], single[:, a:b], residuals[:, a:b]) for a, b in pairwise(ends)
        ]
        g, A = (np.array(each) for each in zip(*parts, strict=True))
        return g, A

    def _products(
        self, common: NDArray[np.complex64], single: NDArray[np.complex64], r: NDArray[np.complex64]
    ) -> tuple[Floats, Floats]:
        """Return Σ J r and Σ J Jᵀ of weighted derivatives and residuals at some lines."""
        n, m = len(common), len(single)
        g, A = np.zeros(n + m), np.zeros((n + m, n + m))
        of = n + np.searchsorted(self.slopes.of, np.arange(len(r) + 1))
        for k, (first, last) in enumerate(pairwise(of)):
            J, S, q = _real(common[:, k]), _real(single[first - n : last - n]), _real(r[None, k])[0]
            g[:n] += J @ q
            A[:n, :n] += J @ J.T
            g[first:last], A[:n, first:last], A[first:last, first:last] = S @ q, J @ S.T, S @ S.T
        A[n:, :n] = A[:n, n:].T
        order = np.argsort(np.concatenate(self.rows))
        return g[order], A[np.ix_(order, order)]

    def _weighted(self, root: Floats | float) -> tuple[NDArray[np.complex64], NDArray[np.complex64]]:
        """Return derivatives of residuals times their factors (m,).

        By unknowns that change any residual, (n, n_out, n_freq, n_in), and by errors of sensors, (k, n_freq,
        n_in).
        """
        factor = np.zeros(self.keep.shape)
        factor[self.keep] = root
        per = np.ascontiguousarray((self.per * factor).astype(np.complex64).swapaxes(0, 1))
        dH, n_zeta = self.slopes.common, len(self.by_damping)
        n_variables, n_damping, *_ = self._counts
        n = n_variables + n_damping
        out = np.empty((n + len(dH) - self.n_refs - n_zeta, *dH.shape[1:]), dtype=np.complex64)
        if n_variables < self.n_refs:
            np.multiply(
                np.add.reduceat(dH[: self.n_refs], self.first_refs, axis=0), per, out=out[:n_variables]
            )
        else:
            np.multiply(dH[: self.n_refs], per, out=out[:n_variables])
        for k in range(n_damping):
            by = self.by_damping[:, k, None, :, None]
            np.multiply((by * dH[len(dH) - n_zeta :]).sum(axis=0), per, out=out[n_variables + k])
        np.multiply(dH[self.n_refs : len(dH) - n_zeta], per, out=out[n:])
        single = self.slopes.single * per[self.slopes.of]
        if not self.phase:
            out.imag, single.imag = 0.0, 0.0
        return out, single

    def dense(self) -> Complexes:
        """Return all derivatives, (n, m)."""
        common, single = self._weighted(1.0)
        (every, own), of = self.rows, self.slopes.of
        out = np.zeros((len(every) + len(own), int(self.keep.sum())), dtype=complex)
        out[every] = common.swapaxes(1, 2)[:, self.keep]
        output = np.nonzero(self.keep)[1]
        for row, k, J in zip(own, of, single, strict=True):
            out[row, output == k] = J[self.keep[:, k]]
        return out


def _real(X: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Return complex arrays (n, ...) as rows of their real and imaginary parts, (n, m)."""
    return X.reshape(len(X), math.prod(X.shape[1:])).view(np.float32)
