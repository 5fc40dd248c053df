"""What a calibrated model misses of one state's modes, carried to another state as a change of its matrices.

With modes φ_r of the calibrated model, φᵀMφ = 1, the measured modes of that state are the model's with

    K + Σ_r Δ_r Mφ_r φ_rᵀM,   D + Σ_r ε_r Mφ_r φ_rᵀM,   y = Cx + Σ_r d_r φ_rᵀM x:

eigenvalues λ_r + Δ_r, losses 2 ζ_r λ_r + ε_r, and shapes Cφ_r + d_r at the sensors. In another state each
mode is a mixture of these, and takes as much of each deviation as it has of the mode.

Where the calibrated parameters vary, the model misses otherwise: by so much Δ_r varies with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem.array_types import Floats, Ints
from fem.model import ParameterRef
from fem.reduction.reduced_model import ReducedModel
from fem.reduction.terms import ReducedTerm
from updating.inference.calibrated_errors import CalibratedErrors


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
    errors : CalibratedErrors, optional
        Those of the calibrated parameters.
    by_errors : ndarray (n, n_errors), optional
        Derivatives of Δ_r by errors of ln θ, or of θ.
    """

    forces: Floats
    stiffness: Floats
    loss: Floats
    shapes: Floats
    errors: CalibratedErrors | None = None
    by_errors: Floats | None = None

    def terms(self, reduced: ReducedModel, refs: Sequence[ParameterRef]) -> CarriedTerms:
        """Return the changes of the matrices of a reduced model as a function of parameters."""
        rows = {} if self.errors is None else {ref: k for k, ref in enumerate(self.errors.refs)}
        there = [(i, rows[ref]) for i, ref in enumerate(refs) if ref in rows]
        at, of = np.array(there, dtype=np.int64).reshape(-1, 2).T
        return CarriedTerms(self, self._along(reduced).T, at, of)

    def outputs(self, reduced: ReducedModel) -> Floats:
        """Return what the sensors read besides, as combinations of the basis's columns (r + p, n_out)."""
        return self._along(reduced) @ self.shapes.T

    def _along(self, reduced: ReducedModel) -> Floats:
        return reduced.projected(self, lambda: self.forces)[1]


@dataclass(frozen=True, slots=True, eq=False)
class CarriedTerms:
    """Changes of the matrices of a reduced model as a function of parameters.

    Attributes
    ----------
    carried : CarriedModes
    along : ndarray (n, r)
        φ_rᵀM on the basis's columns.
    at, of : ndarray of int (k,)
        Which of the parameters are calibrated ones, and which of these.
    """

    carried: CarriedModes
    along: Floats
    at: Ints
    of: Ints

    def term(self, values: Floats) -> ReducedTerm:
        """Return them at values of all parameters."""
        c, stiffness = self.carried, self.carried.stiffness
        if len(self.at) and c.errors is not None and c.by_errors is not None:
            moved = c.errors.some(self.of).moved(values[self.at])
            stiffness = stiffness + c.by_errors[:, self.of] @ moved
        return ReducedTerm(self.along, np.diag(stiffness), None, None, np.diag(c.loss))

    def slopes(self, values: Floats) -> list[tuple[int, ReducedTerm]]:
        """Return their derivatives by those parameters that matter, with the numbers of these."""
        c = self.carried
        if not len(self.at) or c.errors is None or c.by_errors is None:
            return []
        by = c.by_errors[:, self.of] / np.where(c.errors.log[self.of], values[self.at], 1.0)
        each = zip(self.at.tolist(), by.T, strict=True)
        return [(i, ReducedTerm(self.along, np.diag(d), None, None, None)) for i, d in each]
