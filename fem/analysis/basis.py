"""Reduced bases: modes, and the static and dynamic responses to the forces that will act."""

from dataclasses import dataclass, replace

import numpy as np

from fem.analysis.modes import Eigenpairs, solve_eigenpairs
from fem.array_types import Bools, Floats
from fem.linalg.solvers import Factor, factorise
from fem.model import Constraint
from fem.system import System, particular, sum_contributions


@dataclass(frozen=True, slots=True, eq=False)
class Basis:
    """A reduced basis on all DOFs.

    Attributes
    ----------
    T : ndarray (n_dof, r + p)
        The first r columns meet all constraints and are M-orthonormal; each of the last p violates one
        releasable constraint by one unit.
    n_main : int
        r.
    keys : tuple of (str, str)
        Keys of the p releasable constraints, in order.
    n_modes : int
        How many of the first columns are modes.
    n_rigid : int
        How many of these are rigid-body modes.
    V : ndarray (n_free, r)
        The first r columns on the system's independent coordinates.
    factor : Factor
        Of K - σM.
    shift : float
        σ, a little below zero or between the modes [1/s²].
    """

    T: Floats
    n_main: int
    keys: tuple[tuple[str, str], ...]
    n_modes: int
    n_rigid: int
    V: Floats
    factor: Factor
    shift: float

    def extended(self, system: System, forces: Floats) -> "Basis":
        """Return the basis with the responses to more forces (n_dof, k), as far as it lacks them."""
        load = without_modes(system, self.V[:, : self.n_modes], np.asarray(system.Q.T @ forces))
        return self._with(system, self.factor.solve(load))

    def with_shapes(self, system: System, shapes: Floats, share: float = 0.0) -> "Basis":
        """Return the basis with more motions (n_dof, k), which may violate releasable constraints.

        Without what it lacks of them in directions that are less than a ``share`` of their sizes.
        """
        by_key = {c.key: c for c in system.model.constraints()}
        violated = [by_key[key] for key in self.keys]
        amount = np.array([c.coefficients @ shapes[c.dofs] for c in violated]).reshape(-1, shapes.shape[1])
        vectors = np.asarray(system.Q.T @ (shapes - self.T[:, self.n_main :] @ amount))
        if share:
            missing = vectors - self.V @ (self.V.T @ (system.M @ vectors))
            missing /= np.maximum(_sizes(system, vectors), 1e-300)
            squares, directions = np.linalg.eigh(missing.T @ (system.M @ missing))
            vectors = missing @ directions[:, squares > share**2]
        return self._with(system, vectors)

    def _with(self, system: System, vectors: Floats) -> "Basis":
        """Return the basis with more vectors (n_free, k) on the independent coordinates."""
        more = _without(system, self.V, vectors)
        if not more.shape[1]:
            return self
        V = _orthonormal(system, [self.V, more])
        added = np.asarray(system.Q @ V[:, self.n_main :])
        T = np.hstack([self.T[:, : self.n_main], added, self.T[:, self.n_main :]])
        return replace(self, T=T, n_main=V.shape[1], V=V)


def reduced_basis(
    system: System,
    forces: Floats,
    max_frequency: float,
    *,
    margin: float = 2.0,
    n_krylov: int = 2,
    release: tuple[Constraint, ...] = (),
) -> Basis:
    """Build a basis for responses up to a frequency.

    Modes up to ``margin · max_frequency`` and, for each force, the first vectors of the Krylov sequence
    (K - σM)⁻¹ b, (K - σM)⁻¹ M (K - σM)⁻¹ b, …, which carry the part of the modes left out. A releasable
    constraint gets the static response to a unit violation (Craig & Bampton's constraint modes), and the
    forces of that response's inertia join the others.

    Parameters
    ----------
    system : System
    forces : ndarray (n_dof, k)
        Directions in which forces act.
    max_frequency : float
        Highest frequency of interest [Hz].
    margin : float
        Modes are taken up to this multiple of it.
    n_krylov : int
        Vectors of the sequence for each force.
    release : tuple of Constraint
        Constraints of the model that effects may release later.
    """
    pairs = solve_eigenpairs(system, max_frequency=margin * max_frequency, unstable=True)
    pairs = _nearly_static(system, pairs)
    released, inertia = _constraint_modes(system, pairs, release)
    free: Bools = np.any(released, axis=0)  # not those that another constraint holds as well
    release, released, inertia = (
        tuple(c for c, yes in zip(release, free.tolist(), strict=True) if yes),
        released[:, free],
        inertia[:, free],
    )
    columns = [pairs.vectors]
    load = np.asarray(system.Q.T @ np.hstack([forces, inertia]))
    for _ in range(n_krylov):
        # Without the modes: each step amplifies the lowest, which would drown the remainder.
        response = pairs.factor.solve(without_modes(system, pairs.vectors, load))
        response = _without(system, pairs.vectors, response)
        if not response.shape[1]:
            break
        columns.append(response)
        load = system.M @ response
    V = _orthonormal(system, columns)
    T = np.hstack([system.Q @ V, released])
    keys = tuple(c.key for c in release)
    return Basis(T, V.shape[1], keys, pairs.vectors.shape[1], pairs.n_rigid, V, pairs.factor, pairs.shift)


def without_modes(system: System, modes: Floats, loads: Floats) -> Floats:
    """Return loads (n_free, k) without the part that moves the modes.

    Their response then has no part in the modes either. Taken away from a response instead, that part would
    leave its rounding behind: on soft cords a structure moves 1e8 times as far as it is bent.
    """
    return loads - system.M @ (modes @ (modes.T @ loads))


def _nearly_static(system: System, pairs: Eigenpairs) -> Eigenpairs:
    """Return the modes with a factor whose shift lies below the first elastic one.

    The shift that was good enough for the modes may lie far above it; responses to it die away within a
    fraction of the structure and complete the modes badly.
    """
    elastic = pairs.eigenvalues[pairs.eigenvalues > 0]
    shift = -max(0.1 * float(elastic[0]), 1e-8 * abs(pairs.shift)) if elastic.size else pairs.shift
    if abs(pairs.shift) < 10 * abs(shift):
        return pairs
    return replace(pairs, factor=factorise(system.K - shift * system.M), shift=shift)


def _without(system: System, V: Floats, block: Floats) -> Floats:
    """Return columns of M-norm 1 without their part in M-orthonormal V.

    Those that V contains but for rounding are dropped.
    """
    before = _sizes(system, block)
    for _ in range(2):
        block = block - V @ (V.T @ (system.M @ block))
    after = _sizes(system, block)
    keep = after > 1e-9 * before
    return block[:, keep] / after[keep]


def _sizes(system: System, X: Floats) -> Floats:
    """Return the M-norms of columns."""
    return np.sqrt(np.maximum(np.einsum("ij,ij->j", X, system.M @ X), 0.0))


def _orthonormal(system: System, columns: list[Floats]) -> Floats:
    """Return M-orthonormal columns that span the given ones; modes come first and stay as they are."""
    V = columns[0]
    for block in columns[1:]:
        block = _without(system, V, block)[:, : system.n_free - V.shape[1]]
        if not block.shape[1]:
            continue
        eigenvalues, vectors = np.linalg.eigh(block.T @ (system.M @ block))
        keep = eigenvalues > 1e-10 * eigenvalues[-1]
        block = block @ (vectors[:, keep] / np.sqrt(eigenvalues[keep]))
        block = block - V @ (V.T @ (system.M @ block))
        L = np.linalg.cholesky(block.T @ (system.M @ block))
        V = np.hstack([V, np.linalg.solve(L, block.T).T])
    return V


def _constraint_modes(
    system: System, pairs: Eigenpairs, release: tuple[Constraint, ...]
) -> tuple[Floats, Floats]:
    """Return the responses to unit violations of constraints, and M times them, both (n_dof, p)."""
    n_dof = system.model.n_dof
    if not release:
        return np.zeros((n_dof, 0)), np.zeros((n_dof, 0))
    K, M, _, _ = sum_contributions(system.model.contributions(), n_dof)
    shifted = K - pairs.shift * M
    constraints = system.model.constraints()
    out = []
    for constraint in release:
        others = tuple(c for c in constraints if c.key != constraint.key)
        u = particular(others, constraint, n_dof)
        if not u.any():
            out.append(u)
            continue
        q = pairs.factor.solve(-np.asarray(system.Q.T @ (shifted @ u)))
        out.append(u + system.Q @ q)
    modes = np.column_stack(out)
    return modes, np.asarray(M @ modes)


@dataclass(frozen=True, slots=True, eq=False)
class Complement:
    """Responses to forces beyond the modes: block-Krylov vectors, and the error of an approximation in them.

    With A = K - σM and forces b without their part in the modes, the vectors Q span A⁻¹b, A⁻¹M A⁻¹b, … and
    are A-orthonormal.

    Attributes
    ----------
    Q : ndarray (n_free, p)
        The vectors.
    response : ndarray (n_free, k)
        A⁻¹M times the vectors of the last step: where the next come from.
    M : ndarray (p, p)
        QᵀMQ; QᵀAQ is the identity.
    B : ndarray (p, n)
        Qᵀb.
    BB : ndarray (n, n)
        bᵀA⁻¹b.
    lost : ndarray (l, n + p)
        Coordinates of the parts of A⁻¹b and A⁻¹MQ that were too small to become vectors.
    """

    Q: Floats
    response: Floats
    M: Floats
    B: Floats
    BB: Floats
    lost: Floats

    @property
    def complete(self) -> bool:
        """Whether there is no further vector."""
        return self.response.shape[1] == 0

    def outside(self, system: System, shift: float) -> Floats:
        """Return coordinates (q, n + p), orthonormal in A, of the parts of A⁻¹b and A⁻¹MQ outside Q.

        By construction only the last block has any that is not tiny.
        """
        k = self.response.shape[1]
        R = self.response - self.Q @ self.M[:, len(self.M) - k :]
        rows = np.zeros((k, self.lost.shape[1]))
        rows[:, self.lost.shape[1] - k :] = root_of(R.T @ _shifted(system, shift, R))
        return np.vstack([rows, self.lost])


def root_of(G: Floats) -> Floats:
    """Return R with RᵀR = G, which is symmetric and not negative but for rounding."""
    eigenvalues, vectors = np.linalg.eigh((G + G.T) / 2)
    return np.sqrt(np.abs(eigenvalues))[:, None] * vectors.T


def complement(system: System, pairs: Eigenpairs, loads: Floats) -> Complement:
    """Return the complement of modes for forces (n_free, n), with the first block of vectors."""
    n_free, n = loads.shape
    b = without_modes(system, pairs.vectors, loads)
    static = _clear(system, pairs, pairs.factor.solve(b))
    none = np.zeros((n_free, 0))
    start = Complement(none, static, np.zeros((0, 0)), np.zeros((0, n)), b.T @ static, np.zeros((0, n)))
    return extended(system, pairs, start, loads)


def extended(system: System, pairs: Eigenpairs, old: Complement, loads: Floats) -> Complement:
    """Return a complement with one more block of vectors for the same forces."""
    new, lost = _new_block(system, pairs, old)
    k, before = new.shape[1], old.lost.shape[1]
    rows = np.zeros((len(old.lost) + len(lost), before + k))
    rows[: len(old.lost), :before] = old.lost
    rows[len(old.lost) :, before - lost.shape[1] : before] = lost
    Q, MX = np.hstack([old.Q, new]), np.asarray(system.M @ new)
    p = old.Q.shape[1]
    M = np.empty((p + k, p + k))
    M[:p, :p] = old.M
    M[:, p:] = Q.T @ MX
    M[p:, :p] = M[:p, p:].T
    response = _clear(system, pairs, pairs.factor.solve(MX)) if k else new
    return Complement(Q, response, M, np.vstack([old.B, new.T @ loads]), old.BB, rows)


def _shifted(system: System, shift: float, X: Floats) -> Floats:
    """Return (K - σM) X."""
    return np.asarray(system.K @ X - shift * (system.M @ X))


def _clear(system: System, pairs: Eigenpairs, X: Floats) -> Floats:
    """Return columns without their part in the modes."""
    return X - pairs.vectors @ (pairs.vectors.T @ (system.M @ X))


def _new_block(system: System, pairs: Eigenpairs, old: Complement) -> tuple[Floats, Floats]:
    """Return A-orthonormal vectors for the part of the last response outside the vectors so far.

    And coordinates of the part of it that they leave out.
    """
    X, lost = old.response, np.zeros((0, old.response.shape[1]))
    room = system.n_free - pairs.vectors.shape[1] - old.Q.shape[1]
    before = np.einsum("ij,ij->j", X, _shifted(system, pairs.shift, X))
    for attempt in range(2):
        X = X - old.Q @ (old.Q.T @ _shifted(system, pairs.shift, X))
        if attempt:
            X = _clear(system, pairs, X)
        G = X.T @ _shifted(system, pairs.shift, X)
        scale = 1 / np.sqrt(np.maximum(G.diagonal(), np.maximum(1e-24 * before, 1e-300)))
        eigenvalues, vectors = np.linalg.eigh(G * np.outer(scale, scale))
        good = eigenvalues > (1e-13 if attempt == 0 else 0.5) * max(float(eigenvalues.max(initial=0.0)), 0.1)
        good[: max(len(good) - room, 0)] = False
        if attempt == 0:
            lost = np.sqrt(np.abs(eigenvalues[~good]))[:, None] * vectors[:, ~good].T / scale
        X = X @ (scale[:, None] * vectors[:, good] / np.sqrt(eigenvalues[good]))
        before = np.ones(X.shape[1])
    return X, lost
