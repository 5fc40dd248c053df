"""Initial motions of a structure from those of some of its points."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.statics import factor_stiffness
from fem.array_types import Floats
from fem.model import DIRECTIONS, ModelError, lever_matrix
from fem.system import System


def deflected(system: System, displacements: Mapping[tuple[int, str], float]) -> Floats:
    """Return the displacements in equilibrium of a structure with prescribed ones at points, (n_dof,).

    u = K⁻¹ Bᵀ (B K⁻¹ Bᵀ)⁻¹ d with the displacements d = B u, so that forces act on these points alone.

    Parameters
    ----------
    system : System
        Fixed by supports.
    displacements : mapping of (int, str) to float
        By point and direction, such as ``{(3, "x"): 0.01}`` [m, rad].

    Raises
    ------
    ModelError
        For a structure that is free to move, and displacements that its supports do not allow or that one
        another contradict.
    """
    if not displacements:
        return np.zeros(system.model.n_dof)
    dofs = [6 * point + DIRECTIONS.index(direction) for point, direction in displacements]
    B = np.asarray(system.Q[dofs].todense())
    X = factor_stiffness(system).solve(B.T)
    flexibility = B @ X
    size = np.sqrt(np.maximum(np.diagonal(flexibility), np.finfo(float).tiny))
    scaled = flexibility / np.outer(size, size)
    if np.linalg.matrix_rank(scaled, tol=1e-9, hermitian=True) < len(dofs):
        words = ", ".join(f"point {point} in {direction}" for point, direction in displacements)
        msg = f"supports or joints do not allow the displacements of {words} independently of one another"
        raise ModelError(msg)
    forces = np.linalg.solve(scaled, np.array([*displacements.values()]) / size) / size
    return np.asarray(system.Q @ (X @ forces))


def moving_as_one(
    system: System, points: ArrayLike, velocity: ArrayLike, about: ArrayLike = (0.0, 0.0, 0.0)
) -> Floats:
    """Return velocities of points that move as one rigid body, all others being at rest, (n_dof,).

    Directions of them that supports hold stay at rest.

    Parameters
    ----------
    system : System
    points : array_like of int
    velocity : array_like (6,)
        Translation and rotation of the body [m/s, rad/s].
    about : array_like (3,)
        Point about which it turns [m].

    Raises
    ------
    ModelError
        If supports hold all of its points in a direction in which it moves.
    """
    model, at, v = system.model, np.asarray(points, dtype=int), np.asarray(velocity, dtype=float)
    motion = np.zeros((model.mesh.n_points, 6))
    motion[at] = lever_matrix(model.mesh.points[at] - np.asarray(about, dtype=float)) @ v
    free = (abs(system.Q[: motion.size]).sum(axis=1) > 0).reshape(motion.shape)
    for direction, speed, moves in zip(DIRECTIONS, v, free[at].any(axis=0), strict=True):
        if speed and not moves:
            msg = f"nothing moves in {direction}, in which an initial velocity is given: supports hold it"
            raise ModelError(msg)
    out = np.zeros(model.n_dof)
    out[: motion.size] = np.where(free, motion, 0.0).ravel()
    return out
