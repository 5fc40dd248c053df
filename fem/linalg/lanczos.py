"""Lowest eigenpairs of K φ = λ M φ by block Lanczos, with K - σM factorised."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.array_types import Floats

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

    eigenvalues: Floats
    vectors: Floats
    residual: Floats
    following: float

    def head(self, n: int) -> "RitzPairs":
        """Return the n lowest; the rest is forgotten."""
        return RitzPairs(self.eigenvalues[:n], self.vectors[:, :n], self.residual[:n], self.following)


def lowest_eigenpairs(
    solve: Callable[[Floats], Floats],
    M: Any,
    shift: float,
    n: int,
    limit: float = -np.inf,
    known: Floats | None = None,
    block: int | None = None,
    seed: int = 0,
) -> RitzPairs:
    """Compute the n lowest eigenpairs and all up to a limit.

    Block Lanczos on (K - σM)⁻¹M with full M-orthogonalisation (Grimes, Lewis and Simon, *SIAM J. Matrix
    Anal. Appl.* 15, 1994, 228-272), without restart, until the residuals of all wanted pairs are below
    `TOLERANCE`. Of a repeated eigenvalue, a block of b vectors shows up to b eigenvectors; where as many are
    found, another start looks for more. Eigenvalues that are close but not equal are separated
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
        All eigenpairs up to this eigenvalue are computed as well, and one more.
    known : ndarray (n_free, k), optional
        M-orthonormal eigenvectors that are left out.
    block : int, optional
        Number of starting vectors; a quarter of n between 8 and 16 unless given.
    seed : int
        Of the random starting vectors.
    """
    fixed = np.zeros((M.shape[0], 0)) if known is None else known
    n = min(n, M.shape[0] - fixed.shape[1])
    block = min(max(n // 4, 8), 16) if block is None else block
    pairs, ended = _search(solve, M, shift, n, limit, fixed, block, seed)
    new = pairs
    while new.eigenvalues.size and fixed.shape[1] + pairs.vectors.shape[1] < M.shape[0]:
        short = n - len(pairs.eigenvalues)
        top = np.inf if short > 0 else max(limit, _above(pairs.eigenvalues[n - 1]) if n else limit)
        full = _largest_set(1 / (new.eigenvalues[new.eigenvalues <= top] - shift)) >= block
        if not (full or ended):
            break
        seed += 1
        found = np.hstack([fixed, pairs.vectors])
        new, ended = _search(solve, M, shift, max(short, 0), limit if short > 0 else top, found, block, seed)
        pairs = merged(pairs, new, len(pairs.eigenvalues) + len(new.eigenvalues))
    want = max(n, int((pairs.eigenvalues <= limit).sum()) + 1)
    return pairs if new is pairs else merged(pairs, pairs.head(0), want)


def _above(eigenvalue: float) -> float:
    """Return up to where others are equal to an eigenvalue."""
    return eigenvalue + EQUAL * abs(eigenvalue)


def _search(
    solve: Callable[[Floats], Floats],
    M: Any,
    shift: float,
    n: int,
    limit: float,
    fixed: Floats,
    block: int,
    seed: int,
) -> tuple[RitzPairs, bool]:
    """Return the n lowest eigenpairs, those up to a limit and one more, and whether no step was left.

    Of a repeated eigenvalue there are no more than the block has vectors.
    """
    n_free, r = fixed.shape
    random = np.random.default_rng(seed)
    basis = np.empty((n_free, min(r + 4 * n + 6 * block, n_free)))
    basis[:, :r] = fixed
    T = np.zeros((0, 0))
    W = solve(M @ random.standard_normal((n_free, min(block, n_free - r))))
    current, carried, _ = _next_block(M, basis[:, :r], W, 0)
    size, previous, look = r, r, 0
    while True:
        first, size = size, size + current.X.shape[1]
        if size > basis.shape[1]:
            wider = np.empty((n_free, min(max(size, int(1.5 * basis.shape[1])), n_free)))
            wider[:, :first] = basis[:, :first]
            basis = wider
        basis[:, first:size] = current.X
        # But for rounding a new block has a part in the last two alone, and none in known vectors.
        local, previous = 0 if r else previous, first
        current, carried, part = _next_block(M, basis[:, :size], solve(current.MX), local)
        T = _bordered(T, part[r:])
        current = current.head(n_free - size)
        ended = current.X.shape[1] == 0
        if len(T) < look and not ended:
            continue
        look = max(n, int(1.05 * len(T)))
        nu, S = (x[..., ::-1] for x in np.linalg.eigh(T))
        nu = nu[nu > 1e-14 * nu[:1]]  # directions without mass have none
        S = S[:, : len(nu)]
        carried = carried[: current.X.shape[1]] @ S[first - r :]
        residual = np.sqrt(np.einsum("ij,ij->j", carried, carried)) / nu
        eigenvalues = 1 / nu + shift
        want = max(n, int((eigenvalues <= limit).sum()) + 1)
        if ended or (len(nu) >= want and bool((residual[:want] < TOLERANCE).all())):
            break
    want = min(want, len(nu))
    # The part outside the basis sharpens the vectors and removes massless motions (Ericsson and Ruhe).
    vectors = basis[:, r:size] @ S[:, :want] + current.X @ (carried[:, :want] / nu[:want])
    vectors /= _norms(M, vectors)
    following = float(eigenvalues[want]) if len(nu) > want else np.inf
    pairs = RitzPairs(eigenvalues[:want], vectors, residual[:want], following)
    return pairs, ended


def merged(one: RitzPairs, two: RitzPairs, n: int) -> RitzPairs:
    """Return the n lowest of two sets of pairs that are M-orthogonal to each other."""
    eigenvalues = np.concatenate([one.eigenvalues, two.eigenvalues])
    order = np.argsort(eigenvalues, kind="stable")
    keep, dropped = order[:n], order[n:]
    vectors, residual = np.hstack([one.vectors, two.vectors]), np.concatenate([one.residual, two.residual])
    following = min([one.following, two.following, *eigenvalues[dropped].tolist()])
    return RitzPairs(eigenvalues[keep], vectors[:, keep], residual[keep], following)


def _norms(M: Any, X: Floats) -> Floats:
    """Return the norms √(xᵀ M x) of columns."""
    return np.sqrt(np.maximum(np.einsum("ij,ij->j", X, M @ X), 0.0))


@dataclass(frozen=True, slots=True, eq=False)
class _Block:
    """M-orthonormal vectors X, and M X."""

    X: Floats
    MX: Floats

    def head(self, n: int) -> "_Block":
        """Return the first n of them."""
        return _Block(self.X[:, :n], self.MX[:, :n])


def _next_block(M: Any, V: Floats, W: Floats, local: int) -> tuple[_Block, Floats, Floats]:
    """Split W into its part in M-orthonormal V and an M-orthonormal block.

    The columns of V from a given one on are taken out twice and the others once, which is enough where W has
    nothing but rounding in these.

    Returns
    -------
    block : _Block
        X; directions that are lost in rounding are left out.
    carried : ndarray
        R of W = V part + X R.
    part : ndarray
        Vᵀ M W.
    """
    MW = M @ W
    before = np.sqrt(np.maximum(np.einsum("ij,ij->j", W, MW), 0.0))
    part = np.zeros((V.shape[1], W.shape[1]))
    for begin in (local, 0):
        h = V[:, begin:].T @ MW
        W = W - V[:, begin:] @ h
        part[begin:] += h
        MW = M @ W
    X, MX = W / np.maximum(before, 1e-300), MW / np.maximum(before, 1e-300)
    least = 1e-12
    while X.shape[1]:
        # Directions that all but vanish are rounding; as long as there are some, V has a part in them again.
        rotation = np.linalg.eigh(X.T @ MX)[1][:, ::-1]
        X = X @ rotation
        MX = M @ X
        size = np.sqrt(np.maximum(np.einsum("ij,ij->j", X, MX), 0.0))
        keep = size > least
        X, MX = X[:, keep] / size[keep], MX[:, keep] / size[keep]
        if (size > 0.5).all():
            break
        if size.min() < 1e-3:
            X = X - V @ (V.T @ MX)
            MX = M @ X
        least = 1e-6
    return _Block(X, MX), MX.T @ W, part


def _bordered(T: Floats, part: Floats) -> Floats:
    """Return T with the columns of its next block, whose rows are those of all blocks."""
    m, e = len(T), len(part)
    out = np.zeros((e, e))
    out[:m, :m] = T
    out[:, m:] = part
    out[m:, :m] = part[:m].T
    out[m:, m:] = (part[m:] + part[m:].T) / 2
    return out


def _largest_set(nu: Floats) -> int:
    """Return how many values the largest set of equal ones has."""
    if not nu.size:
        return 0
    ends = np.flatnonzero(np.concatenate([nu[1:] < nu[:-1] * (1 - EQUAL), [True]]))
    return int(np.diff(ends, prepend=-1).max())
