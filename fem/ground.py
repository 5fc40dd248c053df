"""Grounds that move: supports and springs to the ground resist the motion relative to a moving base.

An effect may have a coordinate w for each of some directions (`fem.declarations.Internal.ground`), and the
ground moves by d w along the direction d. Motions of the mesh stay absolute. A constraint Σ c u = 0 becomes
Σ c (u - d w) = 0, and element matrices of stiffness and damping act on u - d w; within the structure both
leave a translation out.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Floats, Ints

_ROUNDING = 1e-9
"""Forces below this part of the sum of their entries' absolute values are rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class MovingGround:
    """A ground that moves along some directions.

    Attributes
    ----------
    dofs : ndarray of int (k,)
        DOF numbers of its coordinates w.
    directions : ndarray (k, 3)
        How far it moves for w of 1 [m/m].
    n_mesh : int
        Number of DOFs of the mesh's points.
    """

    dofs: Ints
    directions: Floats
    n_mesh: int

    @classmethod
    def of(cls, model: Any) -> "MovingGround | None":
        """Return the moving ground of a model; None where it rests."""
        for effect in model.effects:
            directions = effect.internal.ground
            if len(directions):
                dofs = model.internal_dofs(effect.name)[: len(directions)]
                return cls(dofs, directions, 6 * model.mesh.n_points)
        return None

    def motions(self, dofs: Ints) -> Floats:
        """Return how far DOFs (…) move with the ground, shape (…, k)."""
        out = np.zeros((*dofs.shape, len(self.dofs)))
        translations = (dofs < self.n_mesh) & (dofs % 6 < 3)
        out[translations] = self.directions.T[dofs[translations] % 6]
        return out

    def translated(self, motions: Floats) -> Floats:
        """Return the coordinates w (k, n) of translations (3, n), as far as it moves along them."""
        return np.linalg.pinv(self.directions.T) @ motions

    def constrained(self, constraint: Any) -> Any:
        """Return a constraint on the motion relative to the ground."""
        moved = constraint.coefficients @ self.motions(constraint.dofs)
        if np.abs(moved).max() <= _ROUNDING * np.abs(constraint.coefficients).sum():
            return constraint
        dofs = np.concatenate([constraint.dofs, self.dofs])
        return replace(constraint, dofs=dofs, coefficients=np.concatenate([constraint.coefficients, -moved]))

    def resisted(self, part: Any) -> Any:
        """Return element matrices whose stiffness and damping act on the motion relative to the ground."""
        if part.lines is not None:  # a member does not resist its translation
            return part
        r = self.motions(part.dofs)
        if not any(_strained(X, r) for X in (part.K, part.C, part.D) if X is not None):
            return part
        b, m, k = r.shape
        apart = np.concatenate([np.broadcast_to(np.eye(m), (b, m, m)), -r], axis=2)
        K, C, D = (
            None if X is None else np.swapaxes(apart, 1, 2) @ X @ apart for X in (part.K, part.C, part.D)
        )
        M = None if part.M is None else np.pad(part.M, ((0, 0), (0, k), (0, k)))
        dofs = np.concatenate([part.dofs, np.broadcast_to(self.dofs, (b, k))], axis=1)
        return replace(part, dofs=dofs, K=K, M=M, C=C, D=D)


def _strained(X: NDArray[Any], r: Floats) -> bool:
    """Return whether elements resist motions r (b, m, k); a complex step counts by itself."""
    return any(
        bool((np.abs(part @ r) > _ROUNDING * (np.abs(part) @ np.abs(r))).any())
        for part in ((np.real(X), np.imag(X)) if np.iscomplexobj(X) else (X,))
    )
