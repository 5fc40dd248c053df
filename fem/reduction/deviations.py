"""Receptances of a reduced model with small deviations: shifted frequencies, and losses here and there."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Contribution
from fem.reduction.modal_solution import ModalSolution, lines_first, times
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.terms import Term

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Deviations:
    """What may deviate, each by a size x: stiffness along forces, losses along forces, losses of elements.

    Attributes
    ----------
    stiff : ndarray (n_dof, n)
        Forces s [N, N·m] that add x s sᵀ to K. With s = √λ Mφ of a mode its eigenvalue shifts by the share x.
    lossy : ndarray (n_dof, m)
        Forces s that add i x s sᵀ.
    elements : tuple of tuple of Contribution
        Each adds i x D.
    """

    stiff: Floats
    lossy: Floats
    elements: tuple[tuple[Contribution, ...], ...] = ()

    @property
    def n_losses(self) -> int:
        """Number of deviations of losses."""
        return self.lossy.shape[1] + len(self.elements)

    def __len__(self) -> int:
        """Return the number of all."""
        return self.stiff.shape[1] + self.n_losses


class DeviatingFRF(ParametricFRF):
    """Receptances as a function of parameter values and of the sizes of deviations, which stand behind them.

    Frequencies shift exactly. Losses change each mode exactly, and couple modes to first order.

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
        ends = np.cumsum([len(self.refs), self._stiff.shape[1], self._lossy.shape[1], len(self._elements)])
        self._own = [slice(first, last) for first, last in pairwise(ends)]
        self._dense: Floats | None = None
        self._constant: NDArray[np.float32] | None = None
        self.refs = (*self.refs, *(("deviations", str(k)) for k in range(len(deviations))))

    def matrices(self, values: Floats) -> tuple[dict[str, Any], list[Term]]:
        """Return the sums of all matrices but losses, and single terms."""
        total, alone = super().matrices(values)
        size = values[self._own[0]]
        if size.any():
            total["K"] = total["K"] + (self._stiff * size) @ self._stiff.T
        return total, alone

    def losses(self, values: Floats) -> Floats | None:
        """Return the sum of all losses, (r, r)."""
        _, along, elements = self._own
        if not values[along.start :].any():
            return None
        out = (self._lossy * values[along]) @ self._lossy.T
        if self._dense is None and self._elements:
            self._dense = np.stack([term.dense("D") for term in self._elements])
        return out if self._dense is None else out + np.tensordot(values[elements], self._dense, axes=1)

    def _derivatives(
        self, values: Floats, zeta: Floats, state: ModalSolution, Xi: Complexes, alone: Sequence[Term]
    ) -> tuple[Complexes, Complexes]:
        """Return dH by the parameters and deviations, and by ζ, in single precision.

        dH = -Hₒ dZ Hᵢ with all dZ as one stack of matrices on the basis: few large products cost less than
        many small ones at the places of the parameters.
        """
        Xo = state.solve(self.outputs, transposed=True)
        inputs, outputs = times(state.V, Xi), times(state.V, Xo)
        n, n_in, n_lines = Xi.shape
        rows, factors, stack = self._stacked(values, state, alone)
        flat = np.ascontiguousarray(inputs.reshape(n, -1), dtype=np.complex64).view(np.float32)
        forces = (stack.reshape(-1, n) @ flat).view(np.complex64).reshape(len(stack), n, n_in, n_lines)
        forces = forces.transpose(3, 1, 0, 2).reshape(n_lines, n, -1)
        outward = np.ascontiguousarray(outputs.transpose(2, 1, 0), dtype=np.complex64)
        moved = (outward @ forces).reshape(n_lines, -1, len(stack), n_in).transpose(2, 0, 1, 3)
        dH = np.zeros((len(self.refs), *moved.shape[1:]), dtype=np.complex64)
        for i, factor, part in zip(rows, factors, moved, strict=True):
            dH[i] -= factor[:, None, None] * part
        for own, S, factor in zip(self._own, (self._stiff, self._lossy), (state.stiffness, 1j), strict=False):
            if S.size:
                ui, uo = times(S.T, inputs), times(S.T, outputs)
                dH[own] = -np.einsum("mof,mif->mfoi", uo, factor * ui)
        of_damping = [2j * state.lam[:, None, None] * Xi]
        if zeta.ndim > 1:
            own = 0 * Xi
            if state.U is not None and state.own is not None:
                own = 2j * times(state.U @ state.own, times(state.U.T, Xi))
            of_damping = [of_damping[0] - own, own]
        by_zeta = np.stack([-lines_first(Xo.transpose(1, 0, 2)) @ lines_first(F) for F in of_damping])
        slopes: Any = dH
        return slopes, by_zeta if zeta.ndim > 1 else by_zeta[0]

    def _stacked(
        self, values: Floats, state: ModalSolution, alone: Sequence[Term]
    ) -> tuple[list[int], list[Any], NDArray[np.float32]]:
        """Return the parameters of m slopes of Z, their factors (n_freq,) and their matrices (m, n, n)."""
        by, n_linear = self.factors(state), len(self._linear)
        slopes = self.slopes(values, alone)
        constant = [*slopes[:n_linear], *enumerate(self._elements, self._own[2].start)]
        still = [(i, factor) for i, term in constant for factor, _ in term.parts(by, self.omega)]
        if self._constant is None:
            parts = [term.spread(X) for _, term in constant for _, X in term.parts(by, self.omega)]
            self._constant = np.array(parts, dtype=np.float32).reshape(-1, *2 * [self._n])
        # Moduli multiply the matrices of many effects alike.
        moving: dict[tuple[int, int], tuple[int, Any, Any]] = {}
        for i, term in slopes[n_linear:]:
            for factor, X in term.parts(by, self.omega):
                *_, before = moving.get((i, id(factor)), (0, 0, 0.0))
                moving[i, id(factor)] = i, factor, before + term.spread(X)
        changing = np.array([X for *_, X in moving.values()], dtype=np.float32)
        rows = [i for i, *_ in moving.values()] + [i for i, _ in still]
        factors = [f for _, f, _ in moving.values()] + [f for _, f in still]
        return rows, factors, np.concatenate([changing.reshape(-1, *2 * [self._n]), self._constant])

    def read(self, values: Floats, state: ModalSolution, Xi: Complexes) -> Complexes:
        """Return the receptances, with what losses between different modes add."""
        H, losses = super().read(values, state, Xi), self.losses(values)
        if losses is None:
            return H
        between = state.V.T @ losses @ state.V
        np.fill_diagonal(between, 0.0)
        return H - state.read(self.outputs, 1j * times(between, Xi), [])[0]
