"""Natural frequencies and mode shapes."""

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from fem.analysis.refined_modes import refined, refined_lowest
from fem.array_types import Floats
from fem.lengths import coordinates_text
from fem.linalg.lanczos import RitzPairs, lowest_eigenpairs, merged
from fem.linalg.processes import is_chosen, late_factor, lowest_by_processes
from fem.linalg.solvers import SLEPC, Factor, SingularMatrixError, factorise, one_thread
from fem.model import DIRECTIONS, ModelError
from fem.summary import counted, summary
from fem.system import System, refuse_motionless, reproduced, resistance, rigid_motions, unopposed

MOST_VALUES = 250_000_000
"""Values of all mode shapes together that are asked for at once, or of a matrix solved densely: 2 GB."""

DENSE_LIMIT = 300
"""Systems of at most this many coordinates are solved densely."""

_ROUNDING = 1e-14
"""Negative stiffness of a motion up to this part of its elements' stiffness, or mass, is rounding [-]."""


class MechanismError(ModelError):
    """A structure with motions that nothing opposes besides its rigid-body motions.

    Attributes
    ----------
    motions : ndarray (n_dof, k)
        A basis of these motions, without their rigid-body part; the largest displacement, or rotation times
        the mesh's size, is 1.
    """

    def __init__(self, message: str, motions: Floats) -> None:
        super().__init__(message)
        self.motions = motions


class UnstableError(ModelError):
    """The requested result exists only for structures in stable equilibrium."""


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """Natural modes, mass-normalised: φᵀ M φ = I.

    Attributes
    ----------
    frequency : ndarray (n_modes,)
        Natural frequencies: rigid-body modes come first and are 0, the others rise. Motions that grow, as
        e^{2π|f|t}, have f = -√(-ω²)/2π below zero: those of a structure that more compression than it bears
        has made unstable [Hz].
    shapes : ndarray (n_dof, n_modes)
        Mode shapes; for computed modes all DOFs of the mesh, ``6 p + d``. NaN in measured ones is a gap: a
        place at which that mode was not measured [1/√kg, rad/(m √kg)].
    zeta : ndarray (n_modes,) or None
        Modal damping ratios [-].
    labels : tuple of str
        Labels of the rows where they are not the DOFs of a mesh (measured shapes).
    n_rigid : int
        Number of rigid-body modes among them.
    """

    frequency: Floats
    shapes: NDArray[np.floating] | NDArray[np.complexfloating]
    zeta: Floats | None = None
    labels: tuple[str, ...] = ()
    n_rigid: int = 0

    def __repr__(self) -> str:
        """Return the number of modes and their frequencies on one line."""
        n, rigid = len(self.frequency), self.n_rigid
        bodies = f", {rigid} of them of the rigid body" if rigid else ""
        first = ", ".join(f"{f:.4g}" for f in self.frequency[rigid : rigid + 6])
        more = " …" if n - rigid > 6 else ""
        return summary(self, f"{counted(n, 'mode')}{bodies}: {first}{more} Hz")

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return self.frequency.size

    @property
    def omega(self) -> Floats:
        """Natural angular frequencies, shape (n_modes,) [rad/s]."""
        return 2 * np.pi * self.frequency


@dataclass(frozen=True, slots=True, eq=False)
class Eigenpairs:
    """Modes on the independent coordinates, with the factor of K - σM that gave them.

    Attributes
    ----------
    eigenvalues : ndarray (n,)
        ω² [rad²/s²]: rigid-body modes come first and are exactly 0, the others rise, those of motions with a
        negative stiffness from below zero.
    vectors : ndarray (n_free, n)
        M-orthonormal.
    factor : Factor
        Of the shifted stiffness K - σM.
    shift : float
        σ, negative [rad²/s²].
    n_rigid : int
        Number of rigid-body modes.
    """

    eigenvalues: Floats
    vectors: Floats
    factor: Factor
    shift: float
    n_rigid: int

    @property
    def omega(self) -> Floats:
        """√ω², shape (n,), and -√(-ω²) of motions that grow [rad/s]."""
        return np.sign(self.eigenvalues) * np.sqrt(np.abs(self.eigenvalues))


def solve_modes(
    system: System, n: int | None = None, max_frequency: float | None = None, *, check: bool = False
) -> Modes:
    """Compute natural modes of the undamped system, K φ = ω² M φ.

    Small systems are solved densely, larger ones by block Lanczos until the residual of each mode is below
    1e-9 (:func:`fem.linalg.lanczos.lowest_eigenpairs`), which leaves 1e-18 of ω² over the relative distance
    to other modes. Repeated modes are all found. That none is missed has a probability of one, not a proof;
    for that, ask for the check.

    Parameters
    ----------
    system : System
    n : int, optional
        Number of modes, rigid-body modes included; 20 unless ``max_frequency`` is given.
    max_frequency : float, optional
        All modes up to this frequency [Hz].
    check : bool
        Whether to count the modes below the highest of them by the signs of the pivots of K - μM (Sylvester),
        at the price of one more factorisation, and to search for those that were missed.

    Returns
    -------
    Modes
        Mass-normalised, with the damping ratio that the model's damping gives each, 0 for motions that grow.

    Raises
    ------
    MechanismError
        For a motion without stiffness that is not a rigid-body motion of the structure.
    ModelError
        If the check counts other than were found, and a second search does not find them, or if a motion
        without mass has a negative stiffness.
    """
    pairs = solve_eigenpairs(system, n, max_frequency, check=check, unstable=True)
    omega = pairs.omega
    frequency = omega / (2 * np.pi)
    damping = system.model.damping
    rayleigh = (
        np.divide(damping.alpha, omega, out=np.zeros_like(omega), where=omega > 0) + damping.beta * omega
    )
    zeta = np.where(omega < 0, 0.0, damping.ratio_at(frequency) + (rayleigh + damping.loss_factor) / 2)
    return Modes(frequency, system.Q @ pairs.vectors, zeta, n_rigid=pairs.n_rigid)


def first_modes(system: System, n: int) -> Modes:
    """Return the rigid-body modes and the first ``n`` elastic modes of the undamped system."""
    found = solve_modes(system, n=n + 6)
    keep = min(found.n_modes, found.n_rigid + n)
    zeta = None if found.zeta is None else found.zeta[:keep]
    return Modes(found.frequency[:keep], found.shapes[:, :keep], zeta, n_rigid=found.n_rigid)


def solve_eigenpairs(
    system: System,
    n: int | None = None,
    max_frequency: float | None = None,
    *,
    check: bool = False,
    unstable: bool = False,
) -> Eigenpairs:
    """Compute modes on the independent coordinates; see :func:`solve_modes`.

    Raises
    ------
    MechanismError, ModelError
        As :func:`solve_modes`.
    UnstableError
        If any motion has a negative stiffness, unless ``unstable`` allows that.
    """
    refuse_motionless(system)
    if n is not None and n < 1:
        msg = f"{n} modes are asked for; at least 1 is needed"
        raise ModelError(msg)
    with one_thread():
        return _eigenpairs(system, n, max_frequency, check, unstable)


def _eigenpairs(
    system: System, n: int | None, max_frequency: float | None, check: bool, unstable: bool
) -> Eigenpairs:
    n_free = system.n_free
    elsewhere = is_chosen() and n_free > DENSE_LIMIT
    rigid = rigid_body_motions(system)
    shift, factor, reference, n_below = _shifted_elsewhere(system, rigid) if elsewhere else _shifted(system)
    want = min(n_free, max(n if n is not None else 20, rigid.shape[1] + n_below + 1))
    limit = -np.inf if n is not None or max_frequency is None else (2 * np.pi * max_frequency) ** 2
    if limit > 0 and n_free**2 > MOST_VALUES:
        _refuse_too_many(n_free, _count_below(system, limit, factor), dense=False)
    while True:
        eigenvalues, vectors = _lowest(system, factor, shift, want, limit, rigid, check)
        if len(eigenvalues) == n_free or eigenvalues[-1] > limit:
            break
        want = min(n_free, 2 * want)
    size = np.abs(eigenvalues)
    if reference is None:
        reference = max(float(size[0]), 1e-12 * _highest(system))
    zero = size < max(1e-7 * reference, 1e-14 * _highest(system))
    if zero.sum() > rigid.shape[1]:
        _check_mechanism(system, vectors[:, zero], rigid)
    n_rigid = min(rigid.shape[1], len(eigenvalues))
    # rigid-body motions first: they are the smallest in size, and not always the lowest
    first = np.sort(np.argsort(size, kind="stable")[:n_rigid])
    order = np.concatenate([first, np.setdiff1d(np.arange(len(size)), first)])
    eigenvalues, vectors = eigenvalues[order], vectors[:, order]
    eigenvalues[:n_rigid] = 0.0
    # eigenvalues that are negative by rounding of K become 0
    below = eigenvalues < 0
    slack = _rounding(system, vectors[:, below])
    eigenvalues[below] = np.where(eigenvalues[below] < -slack, eigenvalues[below], 0.0)
    if not unstable and (eigenvalues < 0).any():
        raise UnstableError(_describe_unstable(system, vectors[:, eigenvalues < 0]))
    eigenvalues, vectors = eigenvalues[:n], vectors[:, :n]
    if max_frequency is not None and n is None:
        keep = max(1, int((eigenvalues <= limit).sum()))
        eigenvalues, vectors = eigenvalues[:keep], vectors[:, :keep]
    return Eigenpairs(eigenvalues, vectors, factor, shift, min(n_rigid, len(eigenvalues)))


def _refuse_too_many(n_free: int, n: int, dense: bool) -> None:
    """Raise a ModelError for more modes than memory holds."""
    if n_free * (n_free if dense else n) > MOST_VALUES:
        most = min(n_free // 3, MOST_VALUES // n_free)
        msg = (
            f"{n} modes of a model of {n_free} coordinates are asked for; at most {most} are computed: ask "
            "for fewer modes or a lower frequency, or make larger elements"
        )
        raise ModelError(msg)


def _count_below(system: System, limit: float, like: Factor) -> int:
    """Return the number of modes below a limit [rad²/s²] by Sylvester's law, 0 where rounding hides it."""
    try:
        return factorise(system.K - limit * system.M, like).count_negative()
    except ValueError:  # the limit is an eigenvalue, or pivots left the diagonal
        return 0


def _lowest(
    system: System, factor: Factor, shift: float, n: int, limit: float, rigid: Floats, check: bool
) -> tuple[Floats, Floats]:
    n_free = system.n_free
    dense = n_free <= DENSE_LIMIT or n > n_free // 3
    _refuse_too_many(n_free, n, dense)
    if dense:
        # The shifted flexibility is small where the stiffness is large: low modes keep their digits.
        # Coordinates of metres and
        # radians are scaled alike; directions without mass have none, and no mode.
        shifted = (system.K - shift * system.M).toarray()
        scale = 1 / np.sqrt(shifted.diagonal())
        outer = np.outer(scale, scale)
        try:
            nu, vectors = sla.eigh(
                outer * system.M.toarray(), outer * shifted, subset_by_index=(n_free - n, n_free - 1)
            )
        except np.linalg.LinAlgError as reason:
            msg = (
                "the stiffnesses differ by so many orders of magnitude that the modes cannot be computed; "
                "look for a length, section, modulus or joint stiffness far from the others"
            )
            raise ModelError(msg) from reason
        order = np.argsort(-nu)
        order = order[nu[order] > 1e-15 * nu[-1]]
        nu, phi = nu[order], scale[:, None] * vectors[:, order]
        phi /= np.sqrt(np.einsum("ij,ij->j", phi, system.M @ phi))
        # High modes keep theirs in Rayleigh's quotient.
        lam = np.where(nu > 1e-8 * nu[0], 1 / nu + shift, np.einsum("ij,ij->j", phi, system.K @ phi))
        pairs = RitzPairs(lam, phi, 0 * lam, np.inf)
        return refined_lowest(system, pairs, rigid[:, :0], factor, -shift, n_rigid=rigid.shape[1])
    rigid = rigid[:, :n]
    zeros = np.zeros(rigid.shape[1])
    if n == len(zeros):
        return zeros, rigid
    if factor.backend == SLEPC:
        pairs = _by_processes(system, shift, n - len(zeros), rigid)
        return np.concatenate([zeros, pairs.eigenvalues]), np.hstack([rigid, pairs.vectors])
    pairs = lowest_eigenpairs(factor.solve, system.M.tocsr(), shift, n - len(zeros), limit, rigid)
    if check:
        pairs = _counted(system, factor, shift, pairs, rigid)
    pairs = refined(system, pairs, rigid, factor)
    # the Ritz matrix is rounded by its largest entries
    lam, phi = refined_lowest(system, pairs, rigid, factor, float(pairs.eigenvalues[-1]))
    return np.concatenate([zeros, lam]), np.hstack([rigid, phi])


def _counted(system: System, factor: Factor, shift: float, pairs: RitzPairs, rigid: Floats) -> RitzPairs:
    """Return the pairs with those that were missed, if the inertia of K - μM counts more of them below μ."""
    last = float(pairs.eigenvalues[-1])
    lam = np.append(pairs.eigenvalues, min(pairs.following, last + abs(last)))
    # μ lies just above the highest pair that is not one of a set with the next: later pairs are not exact.
    k = int(np.flatnonzero(lam[1:] > lam[:-1] + 1e-6 * np.abs(lam[:-1])).max(initial=-1)) + 1
    if k == 0:
        return pairs
    mu = float(lam[k - 1] + 0.1 * (lam[k] - lam[k - 1]))
    n_rigid = rigid.shape[1] if mu > 0 else 0  # those that lie below
    count = factorise(system.K - mu * system.M, factor).count_negative() - n_rigid
    want = len(pairs.eigenvalues)
    if count > k:
        known = np.hstack([rigid, pairs.vectors])
        more = lowest_eigenpairs(factor.solve, system.M.tocsr(), shift, count - k, -np.inf, known, seed=1)
        pairs = merged(pairs, more, want + len(more.eigenvalues))
    found = int((pairs.eigenvalues < mu).sum())
    if found != count:
        top = np.sign(mu) * np.sqrt(abs(mu)) / (2 * np.pi)
        msg = (
            f"{found + n_rigid} modes were found below {top:.6g} Hz, but K - ω²M has "
            f"{count + n_rigid} negative eigenvalues there; rounding hides modes below "
            f"{np.sqrt(1e-16 * _highest(system)) / (2 * np.pi):.2g} Hz"
        )
        raise ModelError(msg)
    return pairs.head(want)


def _by_processes(system: System, shift: float, n: int, rigid: Floats) -> RitzPairs:
    """Return the n lowest eigenpairs besides rigid-body motions by SLEPc, which counts them as well."""
    found = lowest_by_processes(system.K, system.M, shift, n, rigid)
    if found.n_below:
        msg = (
            f"the structure is unstable, or nearly so: {found.n_below} eigenvalues of ω² lie below "
            f"{shift:.3g} rad²/s². Modes of such structures are computed without DOVETAIL_SOLVER={SLEPC}"
        )
        raise UnstableError(msg)
    return refined(system, found.pairs, rigid)


def _shifted_elsewhere(system: System, rigid: Floats) -> tuple[float, Factor, float | None, int]:
    """Choose the shift as :func:`_shifted` does, and leave factorising to other processes."""
    shift = _small_shift(system, fixed=rigid.shape[1] == 0)
    reference = None
    if rigid.shape[1]:
        first = _by_processes(system, shift, 1, rigid)
        reference = float(first.eigenvalues[0])
        shift = -0.1 * reference
    return shift, late_factor(system.K - shift * system.M), reference, 0


def _small_shift(system: System, fixed: bool) -> float:
    """Return a shift σ so small that rounding just allows it."""
    n_lines = max(system.model.mesh.n_lines, 1)
    return -_highest(system) * max((1e-4 / n_lines) ** 2, 1e-14 if fixed else 1e-12)


def _highest(system: System) -> float:
    """Return the order of the highest eigenvalues [rad²/s²]; 1 where nothing is stiff."""
    return float(system.K.diagonal().sum() / max(system.M.diagonal().sum(), 1e-300)) or 1.0


def _shifted(system: System) -> tuple[float, Factor, float | None, int]:
    """Choose the shift σ, below the first elastic eigenvalue, and factorise K - σM.

    Constraints that leave no rigid-body motion make K positive definite, unless compression does away with
    that, and σ as small as rounding allows is good. Else σ is a tenth of the first elastic eigenvalue, which
    three steps of subspace iteration estimate. They start from the rigid-body motions that the constraints
    allow and random loads. As many of the lowest values as there are such motions are left out, also where
    springs resist these: were the shift as small as the eigenvalues on soft springs, K - σM would be singular
    but for rounding.

    Under more compression than a structure bears K has negative eigenvalues: the pivots' signs count them,
    and σ is multiplied by ten until it lies below all.

    Returns
    -------
    shift : float
    factor : Factor
    reference : float or None
        The estimate [rad²/s²], where there is one.
    n_below : int
        How many eigenvalues are negative, and not by rounding.
    """
    K, M, Q, model = system.K, system.M, system.Q, system.model
    q = Q.T @ rigid_motions(model) @ reproduced(model, Q, model.constraints())
    fixed, reference = q.shape[1] == 0, None
    shift = _small_shift(system, fixed)
    try:
        factor = factorise(K - shift * M)
        n_below = n_negative(K - shift * M, factor)
    except SingularMatrixError:  # by rounding, as M has no negative masses
        n_below = 1
        shift, factor = _below_all(system, 10 * shift)
    if not fixed:
        X = np.hstack([q, np.random.default_rng(1).standard_normal((system.n_free, 3 + n_below))])
        for _ in range(3):
            X = factor.solve(np.asarray(M @ X))
            X = X / np.maximum(np.linalg.norm(X, axis=0), 1e-300)
            X = np.linalg.qr(X)[0]
        mass, vectors = np.linalg.eigh(X.T @ (M @ X))
        if (mass <= _ROUNDING * mass[-1]).any():  # motions of hardly any mass: a thin bar about its axis
            X = X / np.sqrt(np.maximum(np.einsum("ij,ij->j", X, M @ X), 1e-300))
            mass, vectors = np.linalg.eigh(X.T @ (M @ X))
        X = X @ (vectors[:, mass > _ROUNDING * mass[-1]] / np.sqrt(mass[mass > _ROUNDING * mass[-1]]))
        ritz = np.linalg.eigvalsh(X.T @ (K @ X))
        reference = float(max(ritz[min(q.shape[1] + n_below, len(ritz) - 1)], 1e-12 * _highest(system)))
        shift = -0.1 * reference
        factor = factorise(K - shift * M, factor)
    if n_below and n_negative(K - shift * M, factor):
        shift, factor = _below_all(system, 10 * shift, factor)
    return shift, factor, reference, n_below


def _below_all(system: System, shift: float, like: Factor | None = None) -> tuple[float, Factor]:
    """Return a shift, multiplied by ten until it lies below all eigenvalues, and the factor of K - σM."""
    # The shift goes no deeper than this multiple of the order of the highest eigenvalues [-]
    while -shift <= 1e3 * _highest(system):
        shifted = system.K - shift * system.M
        with suppress(SingularMatrixError):
            like = factorise(shifted, like)
            if not n_negative(shifted, like):
                return shift, like
        shift *= 10
    msg = (
        "a motion without mass has a negative stiffness: an element is under more compression than "
        "it bears by itself; cut it into shorter ones, or give it another mass than a lumped one"
    )
    raise ModelError(msg)


def _rounding(system: System, vectors: Floats) -> Floats:
    """Return how much rounding of K may change the eigenvalues of M-orthonormal vectors [rad²/s²]."""
    return _ROUNDING * np.einsum("ij,ij,i->j", vectors, vectors, system.K.diagonal())


def n_negative(A: Any, factor: Factor) -> int:
    """Return how many eigenvalues a factorised matrix has below zero."""
    try:
        return factor.count_negative()
    except ValueError:  # SuperLU left the diagonal
        return factorise(A, backend="multifrontal").count_negative()


def n_unstable(system: System) -> int:
    """Return how many motions have a negative stiffness, by the signs of pivots, but for rounding."""
    return _shifted(system)[3]


def rigid_body_motions(system: System) -> Floats:
    """Return an M-orthonormal basis of the structure's rigid-body motions.

    They are those that its constraints and springs allow.

    Returns
    -------
    ndarray (n_free, n_rigid)

    Raises
    ------
    MechanismError
        If one of them has no mass, as the turning about its axis of a straight frame of lumped masses.
    """
    allowed = system.rigid
    if allowed.shape[1] == 0:
        return np.zeros((system.n_free, 0))
    mass = allowed.T @ (system.M @ allowed)
    size = np.sqrt(np.maximum(np.diag(mass), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(mass / np.outer(size, size))  # however little mass a motion has
    if values[0] <= _ROUNDING:
        motion = np.asarray(system.Q @ (allowed @ (vectors[:, :1] / size[:, None])))
        raise MechanismError(_describe_massless(system, motion[:, 0]), motion / np.abs(motion).max())
    L = np.linalg.cholesky(mass)
    return np.linalg.solve(L, allowed.T).T


def _describe_massless(system: System, motion: Floats) -> str:
    """Say that a rigid-body motion (n_dof,) has no mass."""
    mesh = system.model.mesh
    parts = np.linalg.lstsq(rigid_motions(system.model), motion, rcond=None)[0]
    moved, turned = parts[:3], parts[3:] / (mesh.size or 1.0)
    along, how = moved, "moves along"
    if np.linalg.norm(turned) * mesh.size > 1e-6 * np.linalg.norm(moved):
        centre = mesh.points.mean(axis=0) + np.cross(turned, moved) / (turned @ turned)
        along, how = turned, f"turns about the line through {coordinates_text(centre)} along"
    along = along / np.linalg.norm(along)
    along = along * np.sign(along[np.argmax(abs(along))])
    return (
        f"the structure {how} ({', '.join(f'{x:.3g}' for x in along + 0.0)}) without any resistance and "
        "without any mass, so it has no modes: give it inertia about that line, or hold it. Bars with lumped "
        "mass, such as those of a Nastran deck without PARAM,COUPMASS, have no inertia of torsion"
    )


def _describe_unstable(system: System, vectors: Floats) -> str:
    """Say that motions (n_free, k) have a negative stiffness, and which effects give it to them."""
    u, model = np.asarray(system.Q @ vectors), system.model
    work = {}
    for effect in model.effects:
        parts = [(u[c.dofs], c.static) for c in effect.contribute(model) if c.static is not None]
        work[effect.name] = min(
            (float(np.einsum("bik,bij,bjk->k", v, K, v).min()) for v, K in parts), default=0.0
        )
    least = min(work.values())
    names = [f"'{name}'" for name, w in work.items() if w < 0.1 * least < 0]
    moved = np.abs(u[: 6 * model.mesh.n_points, 0]).reshape(-1, 6)[:, :3]
    point, axis = np.unravel_index(np.argmax(moved), moved.shape)
    of = f", by {', '.join(names)}" if names else ""
    return (
        f"the structure is unstable: {vectors.shape[1]} motion(s) have a negative stiffness{of}; the first "
        f"moves point {point} {DIRECTIONS[axis]} most. Only its undamped modes (solve_modes) and its FRFs "
        "(compute_frf) are available: less compression is needed"
    )


def _check_mechanism(system: System, vectors: Floats, rigid: Floats) -> None:
    """Raise an error if more motions than the rigid-body ones meet no resistance.

    Motions on soft springs meet some, and are no error.
    """
    size = system.model.mesh.size
    motions = np.asarray(system.Q @ vectors)
    reach = np.abs(motions[: 6 * system.model.mesh.n_points]).reshape(-1, 6, vectors.shape[1]).max(axis=0)
    vectors = vectors / np.maximum(reach[:3].max(axis=0), size * reach[3:].max(axis=0))
    # An element of a member that bends with wave number k opposes (kh)³ of its entries' sum.
    loose = unopposed(resistance(system.model.batches(), np.asarray(system.Q @ vectors), size, 1e-11), 1e-10)
    if loose.shape[1] > rigid.shape[1]:
        vectors = vectors @ loose
        raise MechanismError(_describe_mechanism(system, vectors, rigid), _motions(system, vectors, rigid))


def _motions(system: System, vectors: Floats, rigid: Floats) -> Floats:
    """Return the motions (n_dof, k) that M-orthogonal rigid-body motions leave of vectors (n_free, n)."""
    n, size = vectors.shape[1] - rigid.shape[1], system.model.mesh.size
    u = np.asarray(system.Q @ (vectors - rigid @ (rigid.T @ (system.M @ vectors))))
    reach = np.ones(len(u))
    at = reach[: 6 * system.model.mesh.n_points].reshape(-1, 6)
    at[:, 3:] = size
    U, _, _ = np.linalg.svd(reach[:, None] * u, full_matrices=False)
    u = U[:, :n] / reach[:, None]
    return u / np.abs(reach[:, None] * u).max(axis=0)


def _describe_mechanism(system: System, vectors: Floats, rigid: Floats) -> str:
    mesh = system.model.mesh
    stiffness = system.Q @ abs(system.K) @ system.Q.T
    n = mesh.n_points
    node = np.concatenate([np.repeat(np.arange(n), 6), np.arange(n, n + system.model.n_dof - 6 * n)])
    coo = sp.coo_array(stiffness)
    keep = coo.data > 0
    # a line ties its ends, also where a support has taken all of an end's motion
    rows = np.concatenate([node[coo.row[keep]], mesh.lines[:, 0]])
    cols = np.concatenate([node[coo.col[keep]], mesh.lines[:, 1]])
    graph = sp.coo_array((np.ones(rows.size), (rows, cols)), shape=(node[-1] + 1,) * 2)
    n_parts, label = connected_components(graph, directed=False)
    label = label[:n]
    attached = np.isin(np.arange(mesh.n_points), mesh.lines)
    parts = [k for k in range(n_parts) if attached[label == k].any()]
    if len(parts) > 1:
        names = mesh.member_of_line()
        words = [
            "/".join(
                sorted({str(m) for m in names[np.isin(mesh.lines, np.flatnonzero(label == k)).any(axis=1)]})
            )
            for k in parts[:4]
        ]
        return (
            f"the structure is in {len(parts)} parts that nothing connects "
            f"({'; '.join(words)}{' …' if len(parts) > 4 else ''}); "
            "add joints, or points that the members share"
        )
    extra = vectors - rigid @ (rigid.T @ (system.M @ vectors)) if rigid.shape[1] else vectors
    u = np.abs(system.Q @ extra).max(axis=1)[: 6 * n]
    worst = np.argsort(-u)[:4]
    words = [f"point {d // 6} {DIRECTIONS[d % 6]}" for d in worst if u[d] > 0.3 * u[worst[0]]]
    n = vectors.shape[1] - rigid.shape[1]
    return (
        f"the structure is a mechanism: {n} motion(s) have no stiffness besides {rigid.shape[1]} "
        f"rigid-body motion(s); most free: {', '.join(words)}"
    )
