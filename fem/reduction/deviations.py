"""Receptances of a reduced model with small deviations: shifted frequencies, and losses here and there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Complexes, Floats, Ints
from fem.model import Contribution
from fem.reduction.frf_slopes import FrfSlopes
from fem.reduction.modal_solution import ModalSolution, times
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.slopes_together import TINY, Ranges, SlopePart, SlopesTogether, together
from fem.reduction.terms import ReducedTerm


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

    of: Ints
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
        self._ranges: Ranges = {}
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

        dH = -Hₒ dZ Hᵢ. Slopes dZ at the same DOFs are evaluated together, on the motions that they resist.
        """
        n_lines, n_in, n_out = len(self.omega), self.inputs.shape[1], self.outputs.shape[1]
        inward, of_inward = _real_and_imaginary(times(state.V, Xi))
        outputs, _ = self.ends(values)
        outward, of_outward = _real_and_imaginary(times(state.V, state.solve(outputs, transposed=True)))
        size = -of_inward * of_outward
        of_outputs, n_zeta = self._rows[3], 2 if zeta.ndim > 1 else 1
        units = np.append(units, np.ones(n_zeta))
        first, n_of_outputs = of_outputs.start, of_outputs.stop - of_outputs.start
        dH = np.zeros((len(units) - n_of_outputs, n_out, n_lines, n_in), dtype=np.complex64)
        # Of few inputs the forces dZ Hᵢ are formed, of few outputs Hₒ dZ: a roving hammer has one output.
        few, many, forward = (inward, outward, True) if n_in <= n_out else (outward, inward, False)
        by = self.factors(state)
        changing = self._changing(values, state, total, alone, connections=n_zeta > 1)
        parts = (*self._constant_slopes, *changing)
        everywhere, places = _by_cost(parts, few.shape[1], many.shape[1], many.shape[3])
        motions = [_complex(many), *_at_places(many, places)]
        for group, answering in zip([everywhere, *([p] for p in places)], motions, strict=True):
            on_basis = group is everywhere
            every = _products([_forces(few, p, forward=forward, on_basis=on_basis) for p in group], answering)
            for part, products in zip(group, every, strict=True):
                factors = (
                    np.array([by[f] if isinstance(f, str) else f for f in part.factors]).T * size[:, None]
                )
                products *= (factors * part.sizes * units[part.rows]).astype(np.complex64)[:, None, :, None]
                by_row = products.transpose(2, 3, 0, 1) if forward else products.transpose(2, 1, 0, 3)
                rows = np.where(part.rows < first, part.rows, part.rows - n_of_outputs)
                for row, product in zip(rows, by_row, strict=True):
                    dH[row] += product
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

    def _changing(
        self,
        values: Floats,
        state: ModalSolution,
        total: Mapping[str, Any],
        alone: Sequence[ReducedTerm],
        *,
        connections: bool,
    ) -> list[SlopesTogether]:
        """Return the slopes of Z that depend on values.

        Behind the rows of parameters and deviations is that of ζ, and that of the ζ of ``connections`` if
        they have a separate one.
        """
        by_zeta = [total["K"], total["connections"]][: 2 if connections else 1]
        their = [np.full(len(self.omega), 2j)] * len(by_zeta)
        if self.viscous:
            MV = total["M"] @ state.V
            by_zeta[0], their[0] = (MV * np.sqrt(np.maximum(state.lam, 0.0))) @ MV.T, 2j * self.omega
        parts = self._parts_of(self.moving_slopes(values, alone))
        n_refs = len(self.refs)
        parts += [(n_refs + k, f, None, X) for k, (f, X) in enumerate(zip(their, by_zeta, strict=True))]
        return together(parts, self._ranges)

    @cached_property
    def _constant_slopes(self) -> list[SlopesTogether]:
        """The slopes of Z that do not depend on values."""
        slopes = [*((i, t) for i, _, t in self._linear), *enumerate(self._elements, self._rows[2].start)]
        return together(self._parts_of(slopes), self._ranges)

    def _parts_of(self, slopes: Sequence[tuple[int, ReducedTerm]]) -> list[SlopePart]:
        """Return rows, factors or their keys, the places and the matrices of some slopes."""
        names: Any = {key: key for key in ("K", "connections", "M", "C", "D")}
        return [(i, f, term, X) for i, term in slopes for f, X in term.parts(names, self.omega)]

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

    In parts of the largest entry of each line, in single precision.
    """
    size = np.maximum(np.abs(X.real).max(axis=(0, 1)), np.abs(X.imag).max(axis=(0, 1)))
    size = np.maximum(size, 1e-300)
    out = np.empty((X.shape[2], X.shape[1], 2, len(X)), dtype=np.float32)
    out[:, :, 0], out[:, :, 1] = ((part / size).astype(np.float32).T for part in (X.real, X.imag))
    out[np.abs(out) < TINY] = 0.0
    return out, size


def _moved(X: NDArray[np.float32], along: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what combinations (k, n) of the last axis of an array are, (..., k), by one product."""
    return (X.reshape(-1, X.shape[-1]) @ along.T).reshape(*X.shape[:-1], len(along))


def _along(X: NDArray[np.float32], S: Floats) -> NDArray[np.complex64]:
    """Return what directions S (n, k) have of complex motions (n_freq, m, 2, n), (k, n_freq, m)."""
    return np.ascontiguousarray(_complex(_moved(X, S.T.astype(np.float32))).transpose(2, 0, 1))


def _complex(X: NDArray[np.float32]) -> NDArray[np.complex64]:
    """Return complex arrays of real and imaginary parts (n_freq, m, 2, ...)."""
    out = np.empty((*X.shape[:2], *X.shape[3:]), dtype=np.complex64)
    out.real, out.imag = X[:, :, 0], X[:, :, 1]
    return out


def _at_places(X: NDArray[np.float32], places: Sequence[SlopesTogether]) -> list[NDArray[np.complex64]]:
    """Return the motions of some places (n_freq, m, k) each, by one product for all."""
    along = [p.along for p in places if p.along is not None]
    if not along:
        return []
    ends = np.cumsum([len(Z) for Z in along])[:-1]
    return np.split(_complex(_moved(X, np.concatenate(along))), ends, axis=2)


def _by_cost(
    parts: Sequence[SlopesTogether], n_few: int, n_many: int, n: int
) -> tuple[list[SlopesTogether], list[SlopesTogether]]:
    """Return the slopes whose forces are taken to the coordinates of a basis, and those that stay at places.

    The motions of the many ends are taken to each place of the second sort, which pays where it has many
    slopes: the loss of a whole member has one.
    """
    out: tuple[list[SlopesTogether], list[SlopesTogether]] = [], []
    for part in parts:
        m, k = part.matrices.shape[:2]
        stays = n_few * m * n * (k + 2 * n_many) > n_many * k * (n + 2 * n_few * m)
        out[part.along is not None and stays].append(part)
    return out


def _forces(
    X: NDArray[np.float32], part: SlopesTogether, *, forward: bool, on_basis: bool
) -> NDArray[np.complex64]:
    """Return the forces of slopes, or of their transposes, against complex motions (n_freq, i, 2, n).

    Returns
    -------
    ndarray (n_freq, i, m, n) on the basis, or (n_freq, i, m, k) on the motions of the place
    """
    stack = part.matrices if forward else part.matrices.transpose(0, 2, 1)
    m, n = stack.shape[:2]
    motions = X if part.along is None else _moved(X, part.along)
    forces = motions.reshape(-1, n) @ stack.reshape(-1, n).T
    if on_basis and part.along is not None:
        forces, n = forces.reshape(-1, n) @ part.along, X.shape[3]
    return _complex(forces.reshape(*X.shape[:3], m, n))


def _products(
    forces: Sequence[NDArray[np.complex64]], motions: NDArray[np.complex64]
) -> list[NDArray[np.complex64]]:
    """Return fᵀ u, (n_freq, i, m, j) each, for forces (n_freq, i, m, k) and motions (n_freq, j, k)."""
    if not forces:
        return []
    every = np.concatenate(forces, axis=2) if len(forces) > 1 else forces[0]
    out = every.reshape(len(every), -1, every.shape[3]) @ motions.swapaxes(1, 2)
    ends = np.cumsum([f.shape[2] for f in forces])[:-1]
    return np.split(out.reshape(*every.shape[:3], -1), ends, axis=2)
