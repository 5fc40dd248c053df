"""Lowest eigenpairs of K φ = λ M φ by block Lanczos, with K - σM factorised."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

TOLERANCE = 1e-9
"""Largest residual of a converged pair, relative to its ν = 1/(λ - σ)."""

EQUAL = 1e-8
"""Values of ν closer than this, relatively, count as one repeated value."""


@dataclass(frozen=True, slots=True, eq=False)
class RitzPairs:
    """Approximations of the lowest eigenpairs.

    Attributes
    ----------
    eigenvalues : ndarray (n,)
        λ, rising.
    vectors : ndarray (n_free, n)
        M-orthonormal.
    residual : ndarray (n,)
        ‖(K - σM)⁻¹M φ - ν φ‖ in the norm of M, relative to ν = 1/(λ - σ). An eigenvalue lies within it:
        |Δλ| ≤ residual · (λ - σ), and within residual²/gap where the next other one is a relative gap away.
    following : float
        The next eigenvalue after these as far as it is known; infinite if there is none.
    """

    eigenvalues: NDArray[np.float64]
    vectors: NDArray[np.float64]
    residual: NDArray[np.float64]
    following: float


def lowest_eigenpairs(
    solve: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    M: Any,
    shift: float,
    n: int,
    limit: float = -np.inf,
    known: NDArray[np.float64] | None = None,
    block: int | None = None,
    seed: int = 0,
) -> RitzPairs:
    """Compute the n lowest eigenpairs and all up to a limit.

    Block Lanczos on (K - σM)⁻¹M with full M-orthogonalisation (Grimes, Lewis and Simon, *SIAM J. Matrix
    Anal. Appl.* 15, 1994, 228-272), without restart, until the residuals of all wanted pairs are below
    `TOLERANCE`. Of a repeated eigenvalue, a block of b vectors shows up to b eigenvectors; where as many are
    found, another start looks for more beside them. Eigenvalues that are close but not equal are told apart
    by the residuals, which stay large until each has its own vector.

    Parameters
    ----------
    solve : callable
        (K - σM)⁻¹ times a block, shape (n_free, k).
    M : sparse (n_free, n_free)
        Symmetric and positive semidefinite.
    shift : float
        σ, below all eigenvalues.
    n : int
        Number of eigenpairs, those known left out.
    limit : float
        All eigenpairs up to this eigenvalue are computed as well.
    known : ndarray (n_free, k), optional
        M-orthonormal eigenvectors that are left out.
    block : int, optional
        Number of starting vectors; a quarter of n between 8 and 16 unless given.
    seed : int
        Of the random starting vectors.
    """
    n_free = M.shape[0]
    fixed = np.zeros((n_free, 0)) if known is None else known
    r = fixed.shape[1]
    n = min(n, n_free - r)
    block = min(max(n // 4, 8), 16) if block is None else block
    random = np.random.default_rng(seed)
    basis = np.empty((n_free, min(r + 4 * n + 6 * block, n_free)))
    basis[:, :r] = fixed
    T = np.zeros((0, 0))
    current = solve(M @ random.standard_normal((n_free, min(block, n_free - r))))
    before = _norms(M, current)
    current = _normalised(M, _orthogonal(M, basis[:, :r], current)[0], before)
    size, look = r, 0
    while True:
        first, size = size, size + current.shape[1]
        if size > basis.shape[1]:
            wider = np.empty((n_free, min(max(size, int(1.5 * basis.shape[1])), n_free)))
            wider[:, :first] = basis[:, :first]
            basis = wider
        basis[:, first:size] = current
        W = solve(M @ current)
        before = _norms(M, W)
        W, part = _orthogonal(M, basis[:, :size], W)
        T = _bordered(T, part[r:])
        current = _normalised(M, W, before)[:, : n_free - size]
        ended = current.shape[1] == 0
        if len(T) < look and not ended:
            continue
        look = max(n, int(1.05 * len(T)))
        nu, S = (x[..., ::-1] for x in np.linalg.eigh(T))
        nu = nu[nu > 1e-14 * nu[:1]]  # directions without mass have none
        S = S[:, : len(nu)]
        carried = current.T @ (M @ W) @ S[first - r :]
        residual = np.sqrt(np.einsum("ij,ij->j", carried, carried)) / nu
        eigenvalues = 1 / nu + shift
        want = max(n, int((eigenvalues <= limit).sum()) + 1)
        if ended or (len(nu) >= want and bool((residual[:want] < TOLERANCE).all())):
            break
    want = min(want, len(nu))
    # The part outside the basis sharpens the vectors and takes out what has no mass (Ericsson and Ruhe).
    vectors = basis[:, r:size] @ S[:, :want] + current @ (carried[:, :want] / nu[:want])
    vectors /= _norms(M, vectors)
    following = float(eigenvalues[want]) if len(nu) > want else np.inf
    pairs = RitzPairs(eigenvalues[:want], vectors, residual[:want], following)
    if want and size < n_free and (_largest_set(nu[:want]) >= block or ended):
        return _completed(pairs, solve, M, shift, n, limit, fixed, block, seed + 1)
    return pairs


def _completed(
    pairs: RitzPairs,
    solve: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    M: Any,
    shift: float,
    n: int,
    limit: float,
    fixed: NDArray[np.float64],
    block: int,
    seed: int,
) -> RitzPairs:
    """Return the pairs together with those that another start finds beside them."""
    short = n - len(pairs.eigenvalues)
    below = limit if short > 0 else max(limit, float(pairs.eigenvalues[-1]) * (1 + EQUAL))
    known = np.hstack([fixed, pairs.vectors])
    more = lowest_eigenpairs(solve, M, shift, max(short, 1), below, known, block, seed)
    eigenvalues = np.concatenate([pairs.eigenvalues, more.eigenvalues])
    order = np.argsort(eigenvalues, kind="stable")
    vectors, residual = (
        np.hstack([pairs.vectors, more.vectors]),
        np.concatenate([pairs.residual, more.residual]),
    )
    want = max(n, int((eigenvalues <= limit).sum()) + 1)
    keep = order[:want]
    following = min([pairs.following, more.following, *eigenvalues[order[want:]].tolist()])
    return RitzPairs(eigenvalues[keep], vectors[:, keep], residual[keep], following)


def _norms(M: Any, X: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the norms √(xᵀ M x) of columns."""
    return np.sqrt(np.maximum(np.einsum("ij,ij->j", X, M @ X), 0.0))


def _orthogonal(
    M: Any, V: NDArray[np.float64], W: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return W without its part in M-orthonormal V, and that part Vᵀ M W; twice, which is enough."""
    part = V.T @ (M @ W)
    W = W - V @ part
    rest = V.T @ (M @ W)
    return W - V @ rest, part + rest


def _normalised(M: Any, W: NDArray[np.float64], before: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return M-orthonormal columns that span W, without those that were lost beside their former norms."""
    for accuracy in (1e-12, 1e-4):  # the second time nothing but rounding is left to take out
        scale = _norms(M, W)
        keep = scale > accuracy * before
        W, scale = W[:, keep], scale[keep]
        if not W.shape[1]:
            return W
        W = W / scale
        gram, rotation = np.linalg.eigh(W.T @ (M @ W))
        keep = gram > 1e-20
        W = W @ (rotation[:, keep] / np.sqrt(gram[keep]))
        before = np.ones(W.shape[1])
    return W


def _bordered(T: NDArray[np.float64], part: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return T with the columns of its next block, whose rows are those of all blocks."""
    m, e = len(T), len(part)
    out = np.zeros((e, e))
    out[:m, :m] = T
    out[:, m:] = part
    out[m:, :m] = part[:m].T
    out[m:, m:] = (part[m:] + part[m:].T) / 2
    return out


def _largest_set(nu: NDArray[np.float64]) -> int:
    """Return how many values the largest set of equal ones has."""
    ends = np.flatnonzero(np.concatenate([nu[1:] < nu[:-1] * (1 - EQUAL), [True]]))
    return int(np.diff(ends, prepend=-1).max())
