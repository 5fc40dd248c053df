"""Receptances of a reduced model with small deviations: shifted frequencies, and losses here and there."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Contribution
from fem.reduction.modal_solution import ModalSolution, times
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.terms import Term

Floats = NDArray[np.float64]


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
        stiff, lossy = ((T.T @ s)[self.active].T for s in (deviations.stiff, deviations.lossy))
        self._first_loss = len(self.refs) + len(stiff)
        alone = [_of_one(len(stiff), r) for r in range(len(stiff))]
        self._linear += [
            (len(self.refs) + r, 0.0, Term(stiff, K, None, None, None)) for r, K in enumerate(alone)
        ]
        self._together = self._linear_together()
        along = [Term(lossy, None, None, None, _of_one(len(lossy), r)) for r in range(len(lossy))]
        self._losses = [*along, *(self.restrict(project(parts)) for parts in deviations.elements)]
        self._dense: Floats | None = None
        self.refs = (*self.refs, *(("deviations", str(k)) for k in range(len(deviations))))

    def losses(self, values: Floats) -> Floats | None:
        """Return the sum of all losses, (r, r)."""
        sizes = values[self._first_loss :]
        if not sizes.any():
            return None
        if self._dense is None:
            self._dense = np.stack([term.dense("D") for term in self._losses])
        return np.tensordot(sizes, self._dense, axes=1)

    def slopes(self, values: Floats, alone: Sequence[Term]) -> list[tuple[int, Term]]:
        """Return the derivatives of the matrices, those by losses too."""
        return [*super().slopes(values, alone), *enumerate(self._losses, self._first_loss)]

    def read(
        self, values: Floats, state: ModalSolution, Xi: NDArray[np.complex128]
    ) -> NDArray[np.complex128]:
        """Return the receptances, with what losses between different modes add."""
        H, losses = super().read(values, state, Xi), self.losses(values)
        if losses is None:
            return H
        between = state.V.T @ losses @ state.V
        np.fill_diagonal(between, 0.0)
        return H - state.read(self.outputs, 1j * times(between, Xi), [])[0]


def _of_one(n: int, r: int) -> Floats:
    """Return a matrix (n, n) that is 1 at (r, r) and 0 elsewhere."""
    X = np.zeros((n, n))
    X[r, r] = 1.0
    return X
