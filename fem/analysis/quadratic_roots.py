"""Roots and vectors of small dense quadratic problems (K + sC + s²M) x = 0."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from fem.array_types import Complexes, Floats
from fem.model import Law
from fem.system import law_change

Laws = Sequence[tuple[Law, Floats]]


class Root(NamedTuple):
    """A root with (K + sC + s²M) x = 0 and yᵀ(K + sC + s²M) = 0.

    ``left`` is ``right`` itself where all matrices are symmetric.
    """

    s: complex
    right: Complexes
    left: Complexes


class QuadraticPencil(NamedTuple):
    """Matrices (m, m) of a problem, with frequency-dependent elements at rest and their laws."""

    K: NDArray[Any]
    C: NDArray[Any]
    M: NDArray[Any]
    laws: Laws
    symmetric: bool


def all_roots(problem: QuadraticPencil, omega: float = 0.0) -> list[Root]:
    """Return all finite roots, with laws at one frequency [rad/s], the slowest first.

    With s = σ + 1/μ, σ > 0 no root: (μ²P₀ + μP₁ + M) x = 0, P₀ = K + σC + σ²M, P₁ = C + 2σM. μ = 0 are the
    infinite roots of directions without mass. K should be about the unit matrix.
    """
    K, C, M, laws, symmetric = problem
    for law, X in laws:
        K = K + law_change(law, np.array([omega]))[0] * X
    m = len(K)
    size = float(np.trace(M)) / m
    shift = 0.3 / np.sqrt(max(size, 1e-300))  # K is about 1, and M about 1/ω²
    P0, P1 = K + shift * C + shift**2 * M, C + 2 * shift * M
    top = -np.linalg.solve(P0, np.hstack([P1, M / shift]))
    # companion matrix of shift·μ, so that both halves of the vectors are of one size
    A = np.block([[top[:, :m] * shift, top[:, m:] * shift**3], [np.eye(m), np.zeros((m, m))]])
    if symmetric:
        mu, vectors = np.linalg.eig(A)
        rows = vectors
    else:
        # wᴴA = μwᴴ: the first half of w is P₀ᵀ times the left vector
        mu, other, vectors = sla.eig(A, left=True, right=True)
        rows = np.linalg.solve(P0.T, other[:m].conj())
    finite = np.flatnonzero(np.abs(mu) > 1e-13 * np.abs(mu).max())
    s = (shift + shift / mu[finite]).astype(complex)
    s.imag[np.abs(s.imag) < 1e-8 * np.abs(s) + 1e-10 * shift] = 0.0  # real but for rounding
    X = _unit(vectors[:m, finite])
    Y = X if symmetric else _unit(rows[:, finite])
    order = np.argsort(np.abs(s), kind="stable")
    return [Root(complex(s[k]), X[:, k], X[:, k] if symmetric else Y[:, k]) for k in order]


def _unit(X: NDArray[Any]) -> Complexes:
    return X.astype(complex) / np.linalg.norm(X, axis=0)


def with_laws(problem: QuadraticPencil, root: Root) -> Root:
    """Iterate a root until the laws are those of its damped frequency."""
    M = problem.M
    for _ in range(60):
        above = [r for r in all_roots(problem, abs(root.s.imag)) if r.s.imag >= 0]
        # the same mode: most alike by mass, not farther than it must be
        X = np.column_stack([r.right for r in above])
        like = np.abs(X.conj().T @ (M @ root.right)) ** 2
        like /= np.maximum(np.real(np.einsum("ij,ij->j", X.conj(), M @ X)), 1e-300)
        far = np.abs(np.array([r.s for r in above]) - root.s) / abs(root.s)
        best = above[int(np.argmax(like / (1 + far)))]
        done = abs(best.s - root.s) < 1e-12 * abs(root.s)
        root = best
        if done:
            break
    return root


def different(roots: Sequence[Root], M: NDArray[Any]) -> list[Root]:
    """Return roots without those that came twice."""
    out: list[Root] = []
    for root in roots:
        mass = np.sqrt(np.real(np.vdot(root.right, M @ root.right)))
        twice = any(
            # Relative distance below which two roots with equal vectors are one
            abs(root.s - known.s) < 1e-9 * abs(root.s)
            and abs(np.vdot(root.right, M @ known.right))
            > 0.99 * mass * np.sqrt(np.real(np.vdot(known.right, M @ known.right)))
            for known in out
        )
        if not twice:
            out.append(root)
    return out
