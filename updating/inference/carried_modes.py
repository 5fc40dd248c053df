"""What a calibrated model misses of one state's modes, carried to another state as a change of its matrices.

With modes φ_r of the calibrated model, φᵀMφ = 1, the measured modes of that state are the model's with

    K + Σ_r Δ_r Mφ_r φ_rᵀM,   D + Σ_r ε_r Mφ_r φ_rᵀM,   y = Cx + Σ_r d_r φ_rᵀM x:

eigenvalues λ_r + Δ_r, losses 2 ζ_r λ_r + ε_r, and shapes Cφ_r + d_r at the sensors. In another state each
mode is a mixture of these, and takes as much of each deviation as it has of the mode.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.array_types import Floats
from fem.reduction.reduced_model import ReducedModel
from fem.reduction.terms import ReducedTerm


@dataclass(frozen=True, slots=True, eq=False)
class CarriedModes:
    """Deviations of modes, as changes of matrices and of what sensors read.

    Attributes
    ----------
    forces : ndarray (n_dof, n)
        Mφ_r of each mode [kg^½].
    stiffness : ndarray (n,)
        Δ_r [rad²/s²].
    loss : ndarray (n,)
        ε_r [rad²/s²].
    shapes : ndarray (n_out, n)
        d_r [kg^-½]; no rows where the sensors are others.
    """

    forces: Floats
    stiffness: Floats
    loss: Floats
    shapes: Floats

    def term(self, reduced: ReducedModel) -> ReducedTerm:
        """Return the changes of the matrices of a reduced model."""
        K, D = np.diag(self.stiffness), np.diag(self.loss)
        return ReducedTerm(self._along(reduced).T, K, None, None, D)

    def outputs(self, reduced: ReducedModel) -> Floats:
        """Return what the sensors read besides, as combinations of the basis's columns (r + p, n_out)."""
        return self._along(reduced) @ self.shapes.T

    def _along(self, reduced: ReducedModel) -> Floats:
        return reduced.projected(self, lambda: self.forces)[1]
