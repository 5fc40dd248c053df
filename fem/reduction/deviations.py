"""Receptances of a reduced model with small deviations: shifted frequencies, and losses here and there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Contribution
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
        out = ends.copy()
        np.add.at(out.T, self.of, (self.along * sizes).T)
        return out


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
        self._constant: tuple[NDArray[np.float32], Floats] | None = None
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

    def _derivatives(
        self,
        values: Floats,
        zeta: Floats,
        state: ModalSolution,
        Xi: Complexes,
        total: Mapping[str, Any],
        alone: Sequence[ReducedTerm],
    ) -> tuple[Complexes, Complexes]:
        """Return dH by the parameters and deviations, and by ζ, in single precision.

        dH = -Hₒ dZ Hᵢ with all dZ as one stack of matrices on the basis: few large products cost less than
        many small ones at the places of the parameters.
        """
        n_lines, n_in, n_out = len(self.omega), self.inputs.shape[1], self.outputs.shape[1]
        inward, of_inward = _real_and_imaginary(times(state.V, Xi))
        outputs, _ = self.ends(values)
        outward, of_outward = _real_and_imaginary(times(state.V, state.solve(outputs, transposed=True)))
        size = -of_inward * of_outward
        rows, factors, stack = self._stacked(values, state, total, alone, connections=zeta.ndim > 1)
        n = stack.shape[1]
        # Of few inputs the forces dZ Hᵢ are formed, of few outputs Hₒ dZ: a roving hammer has one output.
        if n_in <= n_out:
            forces = inward.reshape(-1, n) @ stack.reshape(-1, n).T
            products = forces.reshape(n_lines, -1, n) @ outward.reshape(n_lines, -1, n).transpose(0, 2, 1)
            parts = products.reshape(n_lines, n_in, 2, -1, n_out, 2).transpose(2, 5, 3, 0, 4, 1)
        else:
            forces = outward.reshape(-1, n) @ stack.transpose(0, 2, 1).reshape(-1, n).T
            products = forces.reshape(n_lines, -1, n) @ inward.reshape(n_lines, -1, n).transpose(0, 2, 1)
            parts = products.reshape(n_lines, n_out, 2, -1, n_in, 2).transpose(5, 2, 3, 0, 1, 4)
        (rr, ri), (ir, ii) = parts
        moved = _complex(rr - ii, ri + ir)
        moved *= (size * np.array(factors)).astype(np.complex64)[:, :, None, None]
        n_refs = len(self.refs)
        dH = np.zeros((n_refs + (2 if zeta.ndim > 1 else 1), n_lines, n_out, n_in), dtype=np.complex64)
        once, first = np.unique(rows, return_index=True)
        dH[once] = moved[first]
        for k in np.setdiff1d(np.arange(len(rows)), first):
            dH[rows[k]] += moved[k]
        for at, S, factor in zip(self._rows, (self._stiff, self._lossy), (state.stiffness, 1j), strict=False):
            if S.size:
                along = S.astype(np.float32)
                ui, uo = (_complex(*(X @ along).transpose(2, 3, 0, 1)) for X in (inward, outward))
                ui *= (size * factor).astype(np.complex64)[:, None]
                dH[at] = uo[:, :, :, None] * ui[:, :, None, :]
        sides = (inward, of_inward), (outward, of_outward)
        for k, (change, (moved, scale)) in enumerate(zip(self._changes, sides, strict=True)):
            if not change.of.size:
                continue
            read = _complex(*(moved @ change.along.astype(np.float32)).transpose(2, 3, 0, 1))
            read *= scale.astype(np.complex64)[:, None]
            row, part = np.arange(len(change.of)), dH[self._rows[3 + k]]
            if k == 0:
                part[row, :, change.of] = read
            else:
                part[row, :, :, change.of] = read
        slopes: Any = dH
        if zeta.ndim > 1:
            slopes[n_refs] -= slopes[n_refs + 1]  # all but the connections are damped as members
            return slopes[:n_refs], slopes[n_refs:]
        return slopes[:n_refs], slopes[n_refs]

    def _stacked(
        self,
        values: Floats,
        state: ModalSolution,
        total: Mapping[str, Any],
        alone: Sequence[ReducedTerm],
        *,
        connections: bool,
    ) -> tuple[list[int], list[Any], NDArray[np.float32]]:
        """Return the rows of m slopes of Z, their factors (n_freq,) and their matrices (m, n, n).

        Behind the rows of parameters and deviations is that of ζ, and that of the ζ of ``connections`` if
        they have a separate one.
        """
        by, n_linear = self.factors(state), len(self._linear)
        slopes = self.slopes(values, alone)
        constant = [*slopes[:n_linear], *enumerate(self._elements, self._rows[2].start)]
        still = [(i, factor) for i, term in constant for factor, _ in term.parts(by, self.omega)]
        if self._constant is None:
            parts = [term.spread(X) for _, term in constant for _, X in term.parts(by, self.omega)]
            self._constant = _single(np.array(parts).reshape(-1, *2 * [self._n]))
        # Moduli multiply the matrices of many effects alike.
        moving: dict[tuple[int, int], tuple[int, Any, Any]] = {}
        for i, term in slopes[n_linear:]:
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
        factors = [f for _, f, _ in moving.values()] + their
        (first, sizes), (others, theirs) = _single(np.array(changing)), self._constant
        rows, factors = rows + [i for i, _ in still], factors + [f for _, f in still]
        sizes = np.append(sizes, theirs)
        return rows, [f * s for f, s in zip(factors, sizes, strict=True)], np.concatenate([first, others])

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
    out = np.empty((X.shape[2], X.shape[1], 2, len(X)))
    out[:, :, 0], out[:, :, 1] = X.real.T, X.imag.T
    return _single(out)


def _single(X: Floats) -> tuple[NDArray[np.float32], Floats]:
    """Return arrays in parts of their largest entries, in single precision, and these.

    Of less than ``TINY`` nothing is left: products of subnormal numbers take many times as long.
    """
    size = np.abs(X).max(axis=tuple(range(1, X.ndim)), initial=1e-300)
    out = (X / size.reshape(-1, *[1] * (X.ndim - 1))).astype(np.float32)
    out[np.abs(out) < TINY] = 0.0
    return out, size


def _complex(real: NDArray[np.float32], imaginary: NDArray[np.float32]) -> NDArray[np.complex64]:
    out = np.empty(real.shape, dtype=np.complex64)
    out.real, out.imag = real, imaginary
    return out
