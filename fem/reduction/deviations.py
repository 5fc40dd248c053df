"""Receptances of a reduced model with small deviations: shifted frequencies, and losses here and there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Contribution
from fem.reduction.frf_slopes import FrfSlopes
from fem.reduction.modal_solution import ModalSolution, times
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.terms import ReducedTerm

TINY = 1e-12
"""Smaller parts of the largest entry do not count in single precision: three of them are not subnormal."""

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class EndChanges:
    """Combinations of DOFs that outputs, or inputs, may read besides the stated ones, each by a size x.

    Attributes
    ----------
    of : ndarray of int (k,)
        The output or input that reads it.
    along : ndarray (r + p, k)
        What it reads for x = 1, as combinations of the basis's columns.
    """

    of: NDArray[np.int64]
    along: Floats

    def added_to(self, ends: Floats, sizes: Floats) -> Floats:
        """Return outputs or inputs (r, n) with the changes of some sizes (k,)."""
        if not sizes.any():
            return ends
        read_by = self.of[:, None] == np.arange(ends.shape[1])
        return ends + (self.along * sizes) @ read_by


NO_ENDS = EndChanges(np.zeros(0, dtype=np.int64), np.zeros((0, 0)))


@dataclass(frozen=True, slots=True, eq=False)
class Deviations:
    """What may deviate, each by a size x: stiffness, losses, losses of elements, and what ends read.

    Attributes
    ----------
    stiff : ndarray (n_dof, n)
        Forces s [N, N·m] that add x s sᵀ to K. With s = √λ Mφ of a mode its eigenvalue shifts by the share x.
    lossy : ndarray (n_dof, m)
        Forces s that add i x s sᵀ.
    elements : tuple of tuple of Contribution
        Each adds i x D.
    outputs, inputs : EndChanges
    """

    stiff: Floats
    lossy: Floats
    elements: tuple[tuple[Contribution, ...], ...] = ()
    outputs: EndChanges = NO_ENDS
    inputs: EndChanges = NO_ENDS

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of deviations of each sort, in their order."""
        counts = self.stiff.shape[1], self.lossy.shape[1], len(self.elements)
        return (*counts, len(self.outputs.of), len(self.inputs.of))

    def __len__(self) -> int:
        """Return the number of all."""
        return sum(self.sizes)


class DeviatingFRF(ParametricFRF):
    """Receptances as a function of parameter values and of the sizes of deviations, which stand behind them.

    Frequencies shift and ends change exactly. Losses change each mode exactly, and couple modes to first
    order.

    Parameters
    ----------
    deviations : Deviations
        All others are as of :class:`~fem.reduction.parametric_frf.ParametricFRF`.
    """

    def __init__(self, deviations: Deviations, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        T, project = self.reduced.basis.T, self.reduced.project
        self._stiff, self._lossy = ((T.T @ s)[self.active] for s in (deviations.stiff, deviations.lossy))
        self._elements = [self.restrict(project(parts)) for parts in deviations.elements]
        bounds = np.cumsum([len(self.refs), *deviations.sizes])
        self._rows = [slice(first, last) for first, last in pairwise(bounds)]
        self._changes = [
            EndChanges(e.of, e.along[self.active] if len(e.of) else np.zeros((len(self.active), 0)))
            for e in (deviations.outputs, deviations.inputs)
        ]
        self._dense: Floats | None = None
        self._constant: tuple[list[int], list[Any], NDArray[np.float32], Floats] | None = None
        self.refs = (*self.refs, *(("deviations", str(k)) for k in range(len(deviations))))

    def matrices(self, values: Floats) -> tuple[dict[str, Any], list[ReducedTerm]]:
        """Return the sums of all matrices but losses, and single terms."""
        total, alone = super().matrices(values)
        size = values[self._rows[0]]
        if size.any():
            total["K"] = total["K"] + (self._stiff * size) @ self._stiff.T
        return total, alone

    def losses(self, values: Floats) -> Floats | None:
        """Return the sum of all losses, (r, r)."""
        _, along, elements, *_ = self._rows
        if not values[along.start : elements.stop].any():
            return None
        out = (self._lossy * values[along]) @ self._lossy.T
        if self._dense is None and self._elements:
            self._dense = np.stack([term.dense("D") for term in self._elements])
        return out if self._dense is None else out + np.tensordot(values[elements], self._dense, axes=1)

    def ends(self, values: Floats) -> tuple[Floats, Floats]:
        """Return outputs and inputs with their changes."""
        both = zip(self._changes, super().ends(values), self._rows[3:], strict=True)
        outputs, inputs = (change.added_to(ends, values[at]) for change, ends, at in both)
        return outputs, inputs

    def slopes_of(self, values: Floats, zeta: Floats, units: Floats) -> tuple[Complexes, FrfSlopes]:
        """Return the receptances and their derivatives, those by what outputs read at these outputs alone."""
        if self.references is not None:
            return super().slopes_of(values, zeta, units)
        H, _, _ = self.evaluate(values, zeta, gradient=False)
        assert self._last is not None
        _, state, Xi, total, alone, _ = self._last
        return H, self._slopes(values, zeta, units, state, Xi, total, alone)

    def _derivatives(
        self,
        values: Floats,
        zeta: Floats,
        state: ModalSolution,
        Xi: Complexes,
        total: Mapping[str, Any],
        alone: Sequence[ReducedTerm],
    ) -> tuple[Complexes, Complexes]:
        """Return dH by the parameters and deviations, and by ζ, in single precision."""
        units, n_refs = np.ones(len(self.refs)), len(self.refs)
        every: Any = self._slopes(values, zeta, units, state, Xi, total, alone).dense()
        return every[:n_refs], every[n_refs:] if zeta.ndim > 1 else every[n_refs]

    def _slopes(
        self,
        values: Floats,
        zeta: Floats,
        units: Floats,
        state: ModalSolution,
        Xi: Complexes,
        total: Mapping[str, Any],
        alone: Sequence[ReducedTerm],
    ) -> FrfSlopes:
        """Return the derivatives of receptances from the results of :meth:`solve`.

        dH = -Hₒ dZ Hᵢ with all dZ as one stack of matrices on the basis: few large products cost less than
        many small ones at the places of the parameters.
        """
        n_lines, n_in, n_out = len(self.omega), self.inputs.shape[1], self.outputs.shape[1]
        inward, of_inward = _real_and_imaginary(times(state.V, Xi))
        outputs, _ = self.ends(values)
        outward, of_outward = _real_and_imaginary(times(state.V, state.solve(outputs, transposed=True)))
        size = -of_inward * of_outward
        rows, factors, stack = self._stacked(values, state, total, alone, connections=zeta.ndim > 1)
        of_outputs, n_zeta = self._rows[3], 2 if zeta.ndim > 1 else 1
        units = np.append(units, np.ones(n_zeta))
        factors = (factors * size * units[rows][:, None]).astype(np.complex64)
        # Of few inputs the forces dZ Hᵢ are formed, of few outputs Hₒ dZ: a roving hammer has one output.
        if n_in <= n_out:
            products = _products(inward, stack, outward).transpose(2, 3, 0, 1)
        else:
            products = _products(outward, stack.transpose(0, 2, 1), inward).transpose(2, 1, 0, 3)
        first, n_of_outputs = of_outputs.start, of_outputs.stop - of_outputs.start
        dH = np.zeros((len(units) - n_of_outputs, n_out, n_lines, n_in), dtype=np.complex64)
        known = np.zeros(len(dH), dtype=bool)
        rows = np.where(np.array(rows) < first, rows, np.array(rows) - n_of_outputs)
        for row, product, factor in zip(rows, products, factors[:, None, :, None], strict=True):
            if known[row]:
                dH[row] += product * factor
            else:
                np.multiply(product, factor, out=dH[row])
                known[row] = True
        for at, S, factor in zip(self._rows, (self._stiff, self._lossy), (state.stiffness, 1j), strict=False):
            if S.size:
                ui, uo = (_along(X, S) for X in (inward, outward))
                ui *= (size * factor * units[at, None]).astype(np.complex64)[:, :, None]
                np.multiply(uo.transpose(0, 2, 1)[..., None], ui[:, None], out=dH[at])
        of, along = self._changes[1].of, self._changes[1].along
        read = _along(outward, along * units[self._rows[4]]) * of_outward.astype(np.float32)[:, None]
        dH[first + np.arange(len(of)), :, :, of] = read.transpose(0, 2, 1)
        of, along = self._changes[0].of, self._changes[0].along
        single = _along(inward, along * units[of_outputs]) * of_inward.astype(np.float32)[:, None]
        if n_zeta > 1:
            dH[-2] -= dH[-1]  # all but the connections are damped as members
        return FrfSlopes(dH, first, of, single)

    def _stacked(
        self,
        values: Floats,
        state: ModalSolution,
        total: Mapping[str, Any],
        alone: Sequence[ReducedTerm],
        *,
        connections: bool,
    ) -> tuple[list[int], Complexes, NDArray[np.float32]]:
        """Return the rows of m slopes of Z, their factors (m, n_freq) and their matrices (m, n, n).

        Behind the rows of parameters and deviations is that of ζ, and that of the ζ of ``connections`` if
        they have a separate one. The matrices are valid until the next call.
        """
        by = self.factors(state)
        # Moduli multiply the matrices of many effects alike.
        moving: dict[tuple[int, int], tuple[int, Any, Any]] = {}
        for i, term in self.moving_slopes(values, alone):
            for factor, X in term.parts(by, self.omega):
                *_, before = moving.get((i, id(factor)), (0, 0, 0.0))
                moving[i, id(factor)] = i, factor, before + term.spread(X)
        by_zeta = [total["K"], total["connections"]][: 2 if connections else 1]
        their = [np.full(len(self.omega), 2j)] * len(by_zeta)
        if self.viscous:
            MV = total["M"] @ state.V
            by_zeta[0], their[0] = (MV * np.sqrt(np.maximum(state.lam, 0.0))) @ MV.T, 2j * self.omega
        changing = [X for *_, X in moving.values()] + by_zeta
        rows = [i for i, *_ in moving.values()] + [len(self.refs) + k for k in range(len(by_zeta))]
        n = len(changing)
        if self._constant is None or len(self._constant[2]) != n + len(self._constant[0]):
            self._constant = self._constant_slopes(n)
        constant_rows, keys, stack, sizes = self._constant
        stack[:n], sizes[:n] = _single(np.array(changing))
        constant = [by[key] if isinstance(key, str) else key for key in keys]
        factors: Complexes = np.array([*(f for _, f, _ in moving.values()), *their, *constant], dtype=complex)
        return rows + constant_rows, factors * sizes[:, None], stack

    def _constant_slopes(self, n_before: int) -> tuple[list[int], list[Any], NDArray[np.float32], Floats]:
        """Return rows, factors or their keys, matrices and sizes of the slopes that do not depend on values.

        Matrices and sizes stand behind ``n_before`` empty ones.
        """
        names: Any = {key: key for key in ("K", "connections", "M", "C", "D")}
        slopes = [*((i, t) for i, _, t in self._linear), *enumerate(self._elements, self._rows[2].start)]
        parts = [(i, key, term.spread(X)) for i, term in slopes for key, X in term.parts(names, self.omega)]
        stack, sizes = _single(np.array([X for *_, X in parts]).reshape(-1, self._n, self._n))
        empty = np.zeros((n_before, self._n, self._n), dtype=np.float32)
        every = np.concatenate([empty, stack]), np.append(np.zeros(n_before), sizes)
        return [i for i, *_ in parts], [key for _, key, _ in parts], *every

    def read(self, values: Floats, state: ModalSolution, Xi: Complexes) -> Complexes:
        """Return the receptances, with what losses between different modes add."""
        H, losses = super().read(values, state, Xi), self.losses(values)
        if losses is None:
            return H
        between = state.V.T @ losses @ state.V
        np.fill_diagonal(between, 0.0)
        return H - state.read(self.ends(values)[0], 1j * times(between, Xi), [])[0]


def _real_and_imaginary(X: Complexes) -> tuple[NDArray[np.float32], Floats]:
    """Return an array (n, m, n_freq) as (n_freq, m, 2, n) of real and imaginary parts, and its sizes.

    As of :func:`_single`.
    """
    size = np.maximum(np.abs(X.real).max(axis=(0, 1)), np.abs(X.imag).max(axis=(0, 1)))
    size = np.maximum(size, 1e-300)
    out = np.empty((X.shape[2], X.shape[1], 2, len(X)), dtype=np.float32)
    out[:, :, 0], out[:, :, 1] = ((part / size).astype(np.float32).T for part in (X.real, X.imag))
    out[np.abs(out) < TINY] = 0.0
    return out, size


def _single(X: Floats) -> tuple[NDArray[np.float32], Floats]:
    """Return arrays in parts of their largest entries, in single precision, and these.

    Of less than ``TINY`` nothing is left: products of subnormal numbers take many times as long.
    """
    size = np.abs(X).max(axis=tuple(range(1, X.ndim)), initial=1e-300)
    out = (X / size.reshape(-1, *[1] * (X.ndim - 1))).astype(np.float32)
    out[np.abs(out) < TINY] = 0.0
    return out, size


def _along(X: NDArray[np.float32], S: Floats) -> NDArray[np.complex64]:
    """Return what directions S (n, k) have of complex motions (n_freq, m, 2, n), (k, n_freq, m)."""
    real, imaginary = (X @ S.astype(np.float32)).transpose(2, 3, 0, 1)
    out = np.empty(real.shape, dtype=np.complex64)
    out.real, out.imag = real, imaginary
    return out


def _products(
    A: NDArray[np.float32], stack: NDArray[np.float32], B: NDArray[np.float32]
) -> NDArray[np.complex64]:
    """Return bᵀ X a for complex motions A (n_freq, i, 2, n) and B (n_freq, j, 2, n) and matrices X (m, n, n).

    Returns
    -------
    ndarray (n_freq, i, m, j)
    """
    (n_lines, n_a, _, n), n_b, m = A.shape, B.shape[1], len(stack)
    forces = (A.reshape(-1, n) @ stack.reshape(-1, n).T).reshape(n_lines, n_a, 2, m, n)
    # Both parts of b, and of i b, beside each other: products are complex numbers in memory.
    both = np.empty((2, n_lines, n, n_b, 2), dtype=np.float32)
    both[0] = B.transpose(0, 3, 1, 2)
    both[1, ..., 0], both[1, ..., 1] = -both[0, ..., 1], both[0, ..., 0]
    both = both.reshape(2, n_lines, n, 2 * n_b)
    out = np.empty((n_lines, n_a, m, 2 * n_b), dtype=np.float32)
    for k in range(n_a):
        np.matmul(forces[:, k, 0], both[0], out=out[:, k])
        out[:, k] += forces[:, k, 1] @ both[1]
    return out.view(np.complex64)
