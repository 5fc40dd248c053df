"""Modes of slender structures, whose lowest eigenvalues rounding of the assembled stiffness would hide.

The eigenvalues of a chain of N elements span N⁴: entries of K that are rounded by ε leave an error of up to
ε N⁴ of the lowest. Elements' deformations keep their digits: the rigid-body motion of an element is
subtracted first, and only the rest is multiplied by its stiffness.
"""

from typing import Any

import numpy as np
import scipy.linalg as sla

from fem.array_types import Floats
from fem.linalg.lanczos import TOLERANCE, RitzPairs
from fem.linalg.solvers import Factor
from fem.mesh import Mesh
from fem.model import lever_matrix
from fem.system import System

HIDDEN = 1e-6
"""Eigenvalues of small systems are corrected where rounding may change them by more than this part [-]."""


def refined(system: System, pairs: RitzPairs, rigid: Floats, factor: Factor | None = None) -> RitzPairs:
    """Return eigenpairs without the rounding of the assembled K, where that may exceed the tolerance.

    Rounding changes λ by no more than about ε φᵀ diag(K) φ, φᵀMφ = 1. Where that matters, the vectors are
    corrected by one step of inverse iteration with the residual that the elements' deformations give, and
    combined by Rayleigh and Ritz. An eigenvalue then has the error of its vector squared.

    Parameters
    ----------
    system : System
    pairs : RitzPairs
    rigid : ndarray (n_free, n_rigid)
        M-orthonormal rigid-body motions, to which the pairs are orthogonal.
    factor : Factor, optional
        Of K - σM; without it, vectors are combined only.
    """
    X, lam = pairs.vectors, pairs.eigenvalues
    rounding = np.finfo(float).eps * np.einsum("ij,ij,i->j", X, X, system.K.diagonal())
    if (rounding <= TOLERANCE * np.abs(lam)).all():
        return pairs
    KX = stiffness_times(system, X)
    if factor is not None:
        X = X - factor.solve(KX - (system.M @ X) * np.einsum("ij,ij->j", X, KX))
        X = X - rigid @ (rigid.T @ (system.M @ X))
        KX = stiffness_times(system, X)
    lam, S = sla.eigh(X.T @ KX, X.T @ (system.M @ X))
    return RitzPairs(lam, X @ S, pairs.residual, pairs.following)


def refined_lowest(
    system: System, pairs: RitzPairs, rigid: Floats, factor: Factor, size: float, n_rigid: int = 0
) -> tuple[Floats, Floats]:
    """Return eigenpairs with the lowest corrected as by :func:`refined`, where rounding hides these.

    They are combined by themselves: high modes would round them off in the Ritz matrix. Rounding of these is
    small next to their eigenvalues, so that they are made orthogonal to the lowest, and not the reverse.

    Parameters
    ----------
    system, pairs, rigid, factor
        As of :func:`refined`.
    size : float
        Size of the numbers from which the eigenvalues were computed [rad²/s²].
    n_rigid : int
        How many of the pairs are rigid-body motions: rounding of these matters where others are smaller.
    """
    lam, X = pairs.eigenvalues, pairs.vectors
    rounding = np.finfo(float).eps * (np.einsum("ij,ij,i->j", X, X, system.K.diagonal()) + size)
    hidden = rounding > HIDDEN * np.abs(lam)
    if not hidden[np.argsort(np.abs(lam))[n_rigid:]].any():
        return lam, X
    X, high = X[:, hidden], X[:, ~hidden]
    for _ in range(2):
        KX = stiffness_times(system, X)
        X = X - factor.solve(KX - (system.M @ X) * np.einsum("ij,ij->j", X, KX))
        X = X - rigid @ (rigid.T @ (system.M @ X))
        X = X / np.sqrt(np.einsum("ij,ij->j", X, system.M @ X))
    low, S = sla.eigh(X.T @ stiffness_times(system, X), X.T @ (system.M @ X))
    X = X @ S
    high = high - X @ (X.T @ (system.M @ high))
    lam = np.concatenate([low, lam[~hidden]])
    order = np.argsort(lam, kind="stable")
    return lam[order], np.hstack([X, high])[:, order]


def stiffness_times(system: System, X: Floats) -> Floats:
    """Return K X, (n_free, k), by the deformations of the elements."""
    model = system.model
    u = np.asarray(system.Q @ X)
    force = np.zeros_like(u)
    for part in model.batches():
        K = part.static
        if K is None:
            continue
        at = u[part.dofs]
        if part.lines is not None:
            at = _without_rigid(model.mesh, part.lines, K, at)
        np.add.at(force, part.dofs, K @ at)
    return np.asarray(system.Q.T @ force)


def _without_rigid(mesh: Mesh, lines: Any, K: Floats, u: Floats) -> Floats:
    """Return motions (b, 12, k) of elements on lines without the rigid-body motion of their first ends.

    Those of elements to which it is no rigid-body motion, as under compression, stay.
    """
    first, second = mesh.points[mesh.lines[lines]].transpose(1, 0, 2)
    lever = lever_matrix(second - first)
    moved = np.concatenate([np.broadcast_to(np.eye(6), lever.shape), lever], axis=1)
    size = np.abs(K) @ np.abs(moved)
    # Forces of a rigid-body motion up to this part of the elements' stiffness are rounding [-]
    free = (np.abs(K @ moved) <= 1e-12 * size.max(axis=1, keepdims=True)).all(axis=(1, 2))
    out = u.copy()
    out[free, :6] = 0.0
    out[free, 6:] -= (lever @ u[:, :6])[free]
    return out
