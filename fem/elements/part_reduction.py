"""Reduction of a part to its points and to modes with these points fixed (Craig & Bampton 1968)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp

from fem.array_types import Floats
from fem.elements.part_ties import FREE_RESISTANCE
from fem.linalg.lanczos import lowest_eigenpairs
from fem.linalg.solvers import Factor, SingularMatrixError, factorise
from fem.mesh import Mesh
from fem.model import ModelError, lever_matrix

DENSE = 600
"""Parts with at most this many coordinates inside are solved densely."""


def reduce_inside(
    K: sp.csc_array,
    M: sp.csc_array,
    n_b: int,
    n_modes: int | None,
    max_frequency: float | None,
    where: str,
    residual: bool = False,
    places: Floats | None = None,
) -> tuple[Floats, Floats, Floats, Floats, float]:
    """Reduce the inside to constraint modes and fixed-interface modes.

    With ``residual`` the static response X = K⁻¹ P to the inertia P of the constraint modes, as far as the
    modes that are kept do not have it, joins them as further modes: the terms in λ and λ² of what was left
    out are then exact (Dickens, Nakagawa, Wittbrodt, Computers & Structures 62, 1997, 985-998).

    ``places`` (n_z, 3) are those of the coordinates inside [m], for a faster factorisation.

    Returns
    -------
    psi : ndarray (n_z, n_b)
        Constraint modes.
    modes : ndarray (n_z, k)
        Fixed-interface modes, M-normalised.
    omega2 : ndarray (k,)
        Their ω² [rad²/s²].
    rest : ndarray (n_b, n_b)
        Σ p pᵀ/ω² of those that were left out; with ``residual`` what is missing of Σ p pᵀ/ω⁶.
    following : float
        The lowest ω² left out.
    """
    n_z = K.shape[0] - n_b
    if n_z == 0:
        nothing = np.zeros((0, 0))
        return np.zeros((0, n_b)), nothing, np.zeros(0), np.zeros((n_b, n_b)), np.inf
    Kzz, Kzb = sp.csc_array(K[n_b:, n_b:]), K[n_b:, :n_b].toarray()
    Mzz, Mzb = sp.csc_array(M[n_b:, n_b:]), M[n_b:, :n_b].toarray()
    if Kzz.diagonal().min() <= 0:
        msg = f"{where}: K is not that of a part: it has {Kzz.diagonal().min():.3g} on its diagonal"
        raise ModelError(msg)
    scale = 1 / np.sqrt(Kzz.diagonal())
    S = sp.diags_array(scale)
    try:
        factor = factorise(S @ Kzz @ S, places=places)
    except SingularMatrixError as reason:
        raise ModelError(_mechanism(where)) from reason
    _check_fixed_inside(S @ Kzz @ S, factor, where)

    def solve(b: Floats) -> Floats:
        by_row = scale.reshape(-1, *([1] * (b.ndim - 1)))
        return by_row * factor.solve(by_row * b)

    psi = -solve(Kzb)
    if Mzz.diagonal().min() < 0:
        msg = f"{where}: M is not positive semidefinite: it has {Mzz.diagonal().min():.3g} on its diagonal"
        raise ModelError(msg)
    modes, omega2 = _fixed_modes(Kzz, Mzz, solve, n_modes, max_frequency)
    keep = len(omega2) - 1
    if max_frequency is not None and n_modes is None:
        keep = int((omega2 <= (2 * np.pi * max_frequency) ** 2).sum())
    elif n_modes is not None:
        keep = min(n_modes, len(omega2))
    following = float(omega2[keep]) if keep < len(omega2) else np.inf
    modes, omega2 = modes[:, :keep], omega2[:keep]
    P = Mzz @ psi + Mzb
    p = modes.T @ P
    if not np.isfinite(following):
        return psi, modes, omega2, np.zeros((n_b, n_b)), following
    static = solve(P)
    rest = symmetrised(P.T @ static - (p.T / omega2) @ p)
    if residual:
        more, higher = _residual_modes(static - modes @ (p / omega2[:, None]), rest, Mzz)
        inertia = Mzz @ (more @ ((more.T @ P) / higher[:, None]))
        W = solve(inertia) - more @ ((more.T @ inertia) / higher[:, None])
        rest = symmetrised(W.T @ (Kzz @ W))
        modes, omega2 = np.hstack([modes, more]), np.concatenate([omega2, higher])
    return psi, modes, omega2, rest, following


def _residual_modes(X: Floats, K: Floats, M: sp.csc_array) -> tuple[Floats, Floats]:
    """Return M-normalised combinations of vectors X (n_z, n_b) that do not couple, and their ω².

    ``K`` (n_b, n_b) is their stiffness.
    """
    there = K.diagonal() > 1e-12 * K.diagonal().max(initial=0.0)
    scale = 1 / np.sqrt(K.diagonal()[there])
    X, K = X[:, there] * scale, np.outer(scale, scale) * K[np.ix_(there, there)]
    strength, V = np.linalg.eigh(K)
    strong = strength > 1e-9 * strength.max(initial=0.0)
    V = V[:, strong] / np.sqrt(strength[strong])
    X = X @ V  # of unit stiffness now, so that the eigenvalues of M are 1/ω²
    nu, V = np.linalg.eigh(symmetrised(X.T @ (M @ X)))
    keep = np.flatnonzero(nu > 1e-9 * nu.max(initial=0.0))[::-1]
    return X @ V[:, keep] / np.sqrt(nu[keep]), 1 / nu[keep]


def _fixed_modes(
    K: sp.csc_array, M: sp.csc_array, solve: Any, n_modes: int | None, max_frequency: float | None
) -> tuple[Floats, Floats]:
    """Return the lowest modes with fixed points, M-normalised; one more than is asked for if there is one.

    M may have no mass in some directions, which then have no mode.
    """
    n = K.shape[0]
    limit = -np.inf if max_frequency is None else (2 * np.pi * max_frequency) ** 2
    want = n_modes + 1 if n_modes is not None else 1
    if n > DENSE and want <= n // 3:
        pairs = lowest_eigenpairs(solve, M, 0.0, want, limit)
        return pairs.vectors, pairs.eigenvalues
    scale = 1 / np.sqrt(K.diagonal())
    outer = np.outer(scale, scale)
    nu, vectors = sla.eigh(outer * M.toarray(), outer * K.toarray())
    order = np.argsort(-nu)
    order = order[nu[order] > 1e-13 * max(nu[-1], 0.0)]
    modes = scale[:, None] * vectors[:, order]
    return modes / np.sqrt(np.maximum(np.einsum("ij,ij->j", modes, M @ modes), 1e-300)), 1 / nu[order]


def _mechanism(where: str) -> str:
    return f"{where}: with its points fixed, the part still has motions without stiffness; it is a mechanism"


def _check_fixed_inside(A: Any, factor: Factor, where: str) -> None:
    """Raise an error if the stiffness inside, scaled to a unit diagonal, is singular but for rounding."""
    x = np.random.default_rng(0).standard_normal(A.shape[0])
    for _ in range(3):
        x = factor.solve(x / np.linalg.norm(x))
    lowest = float(x @ (A @ x) / (x @ x)) if np.isfinite(x).all() else 0.0
    if abs(lowest) < 1e-14:
        raise ModelError(_mechanism(where))
    if lowest < 0 or (factor.backend == "multifrontal" and factor.count_negative()):
        msg = f"{where}: K is not positive semidefinite: with the points fixed it has negative eigenvalues"
        raise ModelError(msg)


def without_rigid_resistance(K: Floats, before: Floats, mesh: Mesh, points: Sequence[int]) -> Floats:
    """Return K of the points without the resistance to rigid-body motions that rounding in the file leaves.

    ``before`` is the diagonal of K before the inside followed the points: it scales metres and radians alike.
    """
    if len(points) == 1:
        return np.zeros_like(K)
    places = mesh.points[list(points)]
    R = lever_matrix(places - places.mean(axis=0)).reshape(-1, 6)
    there = before > 0  # a point that is tied to a single node turns freely
    weight = np.sqrt(before[there])
    Q, _ = np.linalg.qr(weight[:, None] * R[there])
    P = np.eye(len(weight)) - Q @ Q.T
    out, inner = np.zeros_like(K), np.ix_(there, there)
    out[inner] = symmetrised(weight[:, None] * (P @ (K[inner] / np.outer(weight, weight)) @ P) * weight)
    return out


def check_definite(X: Floats, diagonal: Floats, name: str, where: str) -> None:
    """Raise an error if a reduced matrix, scaled by a diagonal, has eigenvalues below 0 beyond rounding."""
    scale = np.sqrt(np.maximum(diagonal, 1e-14 * np.abs(diagonal).max(initial=1e-300)))
    lowest = float(np.linalg.eigvalsh(X / np.outer(scale, scale))[0])
    if diagonal.min(initial=0.0) < 0 or lowest < -FREE_RESISTANCE:
        msg = (
            f"{where}: {name} is not positive semidefinite: reduced and scaled to a unit diagonal it has the "
            f"eigenvalue {lowest:.3g}"
        )
        raise ModelError(msg)


def symmetrised(X: Floats) -> Floats:
    """Return the symmetric part of a matrix."""
    return (X + X.T) / 2
