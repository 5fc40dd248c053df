"""Natural frequencies and mode shapes."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, eigsh

from fem.model import DIRECTIONS, ModelError, lever_matrix
from fem.solvers import Factor, factorise
from fem.system import System

DENSE_LIMIT = 300
"""Systems of at most this many coordinates are solved densely."""


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """Natural modes, mass-normalised: φᵀ M φ = I.

    Attributes
    ----------
    frequency : ndarray (n_modes,)
        Natural frequencies, rising; rigid-body modes are 0 [Hz].
    shapes : ndarray (n_dof, n_modes)
        Mode shapes; for computed modes all DOFs of the mesh, ``6 p + d`` [1/√kg, rad/(m √kg)].
    zeta : ndarray (n_modes,) or None
        Modal damping ratios [-].
    labels : tuple of str
        Labels of the rows where they are not the DOFs of a mesh (measured shapes).
    n_rigid : int
        Number of rigid-body modes among them.
    """

    frequency: NDArray[np.float64]
    shapes: NDArray[np.floating] | NDArray[np.complexfloating]
    zeta: NDArray[np.float64] | None = None
    labels: tuple[str, ...] = ()
    n_rigid: int = 0

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return self.frequency.size

    @property
    def omega(self) -> NDArray[np.float64]:
        """Natural angular frequencies, shape (n_modes,) [rad/s]."""
        return 2 * np.pi * self.frequency


@dataclass(frozen=True, slots=True, eq=False)
class Eigenpairs:
    """Modes on the independent coordinates, with the factor of K - σM that gave them.

    Attributes
    ----------
    eigenvalues : ndarray (n,)
        ω² [rad²/s²]; rigid-body modes are exactly 0.
    vectors : ndarray (n_free, n)
        M-orthonormal.
    factor : Factor
        Of the shifted stiffness K - σM.
    shift : float
        σ, negative [rad²/s²].
    n_rigid : int
        Number of rigid-body modes.
    """

    eigenvalues: NDArray[np.float64]
    vectors: NDArray[np.float64]
    factor: Factor
    shift: float
    n_rigid: int


def solve_modes(system: System, n: int | None = None, max_frequency: float | None = None) -> Modes:
    """Compute natural modes of the undamped system, K φ = ω² M φ.

    Parameters
    ----------
    system : System
    n : int, optional
        Number of modes, rigid-body modes included; 20 unless ``max_frequency`` is given.
    max_frequency : float, optional
        All modes up to this frequency [Hz].

    Returns
    -------
    Modes
        Mass-normalised, with the damping ratio that the model's damping gives each.

    Raises
    ------
    ModelError
        For a mechanism: a motion without stiffness that is not a rigid-body motion of the whole structure.
    """
    pairs = solve_eigenpairs(system, n, max_frequency)
    frequency = np.sqrt(pairs.eigenvalues) / (2 * np.pi)
    damping = system.model.damping
    omega = 2 * np.pi * frequency
    rayleigh = np.divide(damping.alpha, omega, out=np.zeros_like(omega), where=omega > 0) + damping.beta * omega
    zeta = damping.ratio_at(frequency) + (rayleigh + damping.loss_factor) / 2
    return Modes(frequency, system.Q @ pairs.vectors, zeta, n_rigid=pairs.n_rigid)


def solve_eigenpairs(system: System, n: int | None = None, max_frequency: float | None = None) -> Eigenpairs:
    """Compute modes on the independent coordinates; see :func:`solve_modes`."""
    if n is not None and n < 1:
        msg = f"{n} modes are asked for; at least 1 is needed"
        raise ModelError(msg)
    n_free = system.n_free
    reference = _reference_eigenvalue(system)
    shift = -0.1 * reference
    factor = factorise(system.K - shift * system.M)
    rigid = rigid_body_motions(system)
    want = min(n_free, n if n is not None else 20)
    limit = np.inf if max_frequency is None else (2 * np.pi * max_frequency) ** 2
    while True:
        eigenvalues, vectors = _lowest(system, factor, shift, want)
        if len(eigenvalues) == n_free or n is not None or max_frequency is None or eigenvalues[-1] > limit:
            break
        want = min(n_free, 2 * want)
    elastic = eigenvalues[rigid.shape[1] : rigid.shape[1] + 1]
    # A motion without stiffness has an eigenvalue of rounding size; elastic ones are far above it.
    floor = 1e-6 * (max(float(elastic[0]), reference * 1e-3) if elastic.size else reference)
    n_zero = int((eigenvalues < min(floor, 1e-7 * reference)).sum())
    if n_zero > rigid.shape[1]:
        raise ModelError(_describe_mechanism(system, vectors[:, :n_zero], rigid))
    eigenvalues[: rigid.shape[1]] = 0.0
    n_rigid = min(rigid.shape[1], len(eigenvalues))
    if max_frequency is not None and n is None:
        keep = max(1, int((eigenvalues <= limit).sum()))
        eigenvalues, vectors = eigenvalues[:keep], vectors[:, :keep]
    return Eigenpairs(np.maximum(eigenvalues, 0.0), vectors, factor, shift, min(n_rigid, len(eigenvalues)))


def _lowest(system: System, factor: Factor, shift: float, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    n_free = system.n_free
    if n_free <= DENSE_LIMIT or n > n_free // 3:
        # The shifted flexibility is small where the stiffness is large: low modes keep their digits.
        M = system.M.toarray()
        S = factor.solve(M)
        nu, vectors = sla.eigh(_symmetric(M @ S), M, subset_by_index=(n_free - n, n_free - 1))
        order = np.argsort(-nu)
        return 1 / nu[order] + shift, vectors[:, order]
    operator = LinearOperator(system.M.shape, matvec=factor.solve, dtype=float)
    start = np.random.default_rng(0).standard_normal(n_free)
    eigenvalues, vectors = eigsh(system.K, k=n, M=system.M, sigma=shift, OPinv=operator, v0=start, tol=1e-12)
    order = np.argsort(eigenvalues)
    return eigenvalues[order], vectors[:, order]


def _symmetric(A: NDArray[np.float64]) -> NDArray[np.float64]:
    return (A + A.T) / 2


def _reference_eigenvalue(system: System) -> float:
    """Estimate the order of the first elastic eigenvalue [rad²/s²]: three steps of inverse iteration on random loads."""
    K, M = system.K, system.M
    upper = float(K.diagonal().sum() / max(M.diagonal().sum(), 1e-300))
    lower = upper * (1e-4 / max(system.model.mesh.n_lines, 1)) ** 2
    shift = -max(lower, 1e-12 * upper)
    factor = factorise(K - shift * M)
    rigid = rigid_body_motions(system)
    X = np.random.default_rng(1).standard_normal((system.n_free, 3))
    for _ in range(3):
        if rigid.shape[1]:
            X = X - rigid @ (rigid.T @ (M @ X))
        X = factor.solve(M @ X)
        X = X / np.linalg.norm(X, axis=0)
    if rigid.shape[1]:
        X = X - rigid @ (rigid.T @ (M @ X))
    ratio = np.einsum("ij,ij->j", X, K @ X) / np.einsum("ij,ij->j", X, M @ X)
    return float(max(ratio.min(), 1e-3 * -shift))


def rigid_body_motions(system: System) -> NDArray[np.float64]:
    """Return an M-orthonormal basis of the structure's rigid-body motions that its constraints and springs allow.

    Returns
    -------
    ndarray (n_free, n_rigid)
    """
    points = system.model.mesh.points
    centre = points.mean(axis=0)
    size = max(system.model.mesh.size, 1e-300)
    motions = np.vstack([lever_matrix(p - centre) for p in points])
    motions[:, 3:] /= size
    q = system.Q.T @ motions
    # A motion is allowed where Q reproduces it and no spring to ground resists it.
    missed = motions - system.Q @ q
    weight = np.linalg.norm(motions, axis=0)
    energy = q.T @ (system.K @ q)
    stiff = abs(system.K).sum() / system.n_free
    resist = missed.T @ missed / np.outer(weight, weight) + energy / (stiff * np.outer(weight, weight))
    eigenvalues, vectors = np.linalg.eigh(_symmetric(resist * np.outer(weight, weight) / (weight @ weight)))
    allowed = q @ vectors[:, eigenvalues < 1e-14]
    if allowed.shape[1] == 0:
        return np.zeros((system.n_free, 0))
    L = np.linalg.cholesky(allowed.T @ (system.M @ allowed))
    return np.linalg.solve(L, allowed.T).T


def _describe_mechanism(system: System, vectors: NDArray[np.float64], rigid: NDArray[np.float64]) -> str:
    mesh = system.model.mesh
    stiffness = system.Q @ abs(system.K) @ system.Q.T
    node = np.arange(system.model.n_dof) // 6
    coo = sp.coo_array(stiffness)
    keep = coo.data > 0
    # a line ties its ends, also where a support has taken all of an end's motion
    rows = np.concatenate([node[coo.row[keep]], mesh.lines[:, 0]])
    cols = np.concatenate([node[coo.col[keep]], mesh.lines[:, 1]])
    graph = sp.coo_array((np.ones(rows.size), (rows, cols)), shape=(mesh.n_points,) * 2)
    n_parts, label = connected_components(graph, directed=False)
    attached = np.isin(np.arange(mesh.n_points), mesh.lines)
    parts = [k for k in range(n_parts) if attached[label == k].any()]
    if len(parts) > 1:
        names = mesh.member_of_line()
        words = [
            "/".join(sorted({str(m) for m in names[np.isin(mesh.lines, np.flatnonzero(label == k)).any(axis=1)]}))
            for k in parts[:4]
        ]
        return (
            f"the structure is in {len(parts)} parts that nothing connects ({'; '.join(words)}{' …' if len(parts) > 4 else ''}); "
            "add joints, or points that the members share"
        )
    extra = vectors - rigid @ (rigid.T @ (system.M @ vectors)) if rigid.shape[1] else vectors
    u = np.abs(system.Q @ extra).max(axis=1)
    worst = np.argsort(-u)[:4]
    words = [f"point {d // 6} {DIRECTIONS[d % 6]}" for d in worst if u[d] > 0.3 * u[worst[0]]]
    n = vectors.shape[1] - rigid.shape[1]
    return (
        f"the structure is a mechanism: {n} motion(s) have no stiffness besides {rigid.shape[1]} rigid-body motion(s) of the whole; "
        f"most free: {', '.join(words)}"
    )
