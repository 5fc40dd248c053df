"""Receptances of a reduced model with small deviations: shifted frequencies, and losses here and there."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Contribution
from fem.reduction.modal_solution import ModalSolution, times
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

    def slopes(self, values: Floats, alone: Sequence[Term]) -> list[tuple[int, Term]]:
        """Return the derivatives of the matrices, those by losses of elements too."""
        return [*super().slopes(values, alone), *enumerate(self._elements, self._own[2].start)]

    def _derivatives(
        self, values: Floats, zeta: Floats, state: ModalSolution, Xi: Complexes, alone: Sequence[Term]
    ) -> tuple[Complexes, Complexes]:
        """Return dH by the parameters and deviations, and by ζ."""
        dH, by_zeta = super()._derivatives(values, zeta, state, Xi, alone)
        for own, S, factor in zip(self._own, (self._stiff, self._lossy), (state.stiffness, 1j), strict=False):
            if S.size:
                P = state.V.T @ S
                _, (Ho,) = state.read(self.outputs, Xi[:, :0], [P])
                dH[own] = -np.einsum("fom,mif->mfoi", Ho, factor * times(P.T, Xi))
        return dH, by_zeta

    def read(self, values: Floats, state: ModalSolution, Xi: Complexes) -> Complexes:
        """Return the receptances, with what losses between different modes add."""
        H, losses = super().read(values, state, Xi), self.losses(values)
        if losses is None:
            return H
        between = state.V.T @ losses @ state.V
        np.fill_diagonal(between, 0.0)
        return H - state.read(self.outputs, 1j * times(between, Xi), [])[0]
