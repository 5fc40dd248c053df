"""Linear buckling: by which factor may a static load grow before a structure gives way.

(K + λ K_G) φ = 0 with K_G the geometric stiffness of the load's section forces. Linear means that these grow
with the load and that the structure hardly moves before it buckles.
"""

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from fem.analysis.initial_stress import prestressed
from fem.analysis.modes import DENSE_LIMIT
from fem.analysis.statics import StaticSolution, factor_stiffness, solve_static
from fem.analysis.warping import ACCURACY, line_work, warping_gains
from fem.array_types import Floats, Ints
from fem.effects.prestress import Prestress
from fem.effects.shear_centre import ShearCentre
from fem.elements.frame import Frame
from fem.linalg.solvers import Factor
from fem.model import Contribution, Model, ModelError
from fem.summary import fields_summary
from fem.system import System, assemble, sum_contributions

SIGNS = ("positive", "negative", "both")

ROUNDING = 1e-10
"""Eigenvalues μ up to this part of the largest of either sign are rounding [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class BucklingModes:
    """Load factors and buckling shapes.

    Attributes
    ----------
    factors : ndarray (n,)
        λ: the load times λ makes the structure buckle; the smallest in size come first [-].
    shapes : ndarray (n_dof, n)
        φ, with a largest displacement of 1, rotations in rad per that; with a largest rotation of 1 where
        members only twist.
    model : Model
        With the geometric stiffness at λ = 1, the effect ``"prestress"``.
    """

    factors: Floats
    shapes: Floats
    model: Model

    __repr__ = fields_summary

    def loaded(self, factor: float) -> Model:
        """Return the model under the load times a factor: its modes reach 0 Hz at a load factor."""
        return self.model.with_values({("prestress", "factor"): factor})

    @property
    def moving_members(self) -> list[str]:
        """The member of each shape with the line whose ends move most."""
        mesh = self.model.mesh
        size = np.linalg.norm(self.shapes[: 6 * mesh.n_points].reshape(mesh.n_points, 6, -1)[:, :3], axis=1)
        names = mesh.member_of_line()
        return [str(names[int(k)]) for k in size[mesh.lines].sum(axis=1).argmax(axis=0)]


def solve_buckling(
    model: Model | System,
    loads: StaticSolution | Any,
    n: int = 5,
    *,
    case: int | str = 0,
    sign: str = "positive",
) -> BucklingModes:
    """Compute load factors and buckling shapes.

    -K_G φ = μ K φ with μ = 1/λ, so that the factors nearest to 0 are the largest eigenvalues. A factor that
    comes several times is found as often. Loads keep their directions; moments at points are semitangential
    (see :func:`fem.analysis.initial_stress.prestressed`).

    Warns where something that is left out may change the lowest factor by more than 1 %: a shear centre off
    the centroid, warping stiffness, displacements before buckling, reduced parts.

    Parameters
    ----------
    model : Model or System
    loads : StaticSolution, or loads as of `solve_static`
        The load that grows.
    n : int
        Number of factors.
    case : int or str
        Load case of it.
    sign : str
        ``"positive"`` for the load as it is, ``"negative"`` for the opposite, or ``"both"``.

    Returns
    -------
    BucklingModes
        Fewer than n, or none, where the load pulls more than it pushes.

    Raises
    ------
    ModelError
        For a structure that is not supported, a load without section forces that act on its motions, or an
        unknown sign.
    """
    if sign not in SIGNS:
        msg = f"the sign is '{sign}'; allowed are {', '.join(SIGNS)}"
        raise ModelError(msg)
    if n < 1:
        msg = f"{n} load factors are asked for; at least 1 is needed"
        raise ModelError(msg)
    system = model if isinstance(model, System) else assemble(model)
    solution = loads if isinstance(loads, StaticSolution) else solve_static(system, loads)
    loaded, K_G = _geometric(system, solution, case)
    if not K_G.count_nonzero():
        msg = "the load gives no member a section force that works on a motion it can make: nothing buckles"
        raise ModelError(msg)
    mu, vectors = _largest(system, -K_G, n, sign)
    shapes = np.asarray(system.Q @ vectors)
    points = shapes[: 6 * loaded.mesh.n_points].reshape(loaded.mesh.n_points, 6, len(mu))
    moved, turned = (abs(points[:, dofs]).max(axis=(0, 1)) for dofs in (slice(3), slice(3, 6)))
    twists = moved < ROUNDING * turned * loaded.mesh.size
    modes = BucklingModes(1 / mu, shapes / np.where(twists, turned, moved), loaded)
    if mu.size:
        column = solution.case(case) if isinstance(case, str) else case
        for message in limits(loaded, solution, column, float(modes.factors[0]), modes.shapes[:, 0]):
            warnings.warn(message, stacklevel=2)
    return modes


def lowest_factor(system: System, solution: StaticSolution) -> float:
    """Return the lowest positive factor of the first load; infinite where the structure does not buckle."""
    K_G = _geometric(system, solution, 0)[1]
    if not K_G.count_nonzero():
        return np.inf
    mu = _largest(system, -K_G, 1, "positive", repeated=False)[0]
    return float(1 / mu[0]) if mu.size else np.inf


def _geometric(system: System, solution: StaticSolution, case: int | str) -> tuple[Model, sp.csc_array]:
    """Return the model under a static load, and its geometric stiffness on the independent coordinates."""
    loaded = prestressed(system.model, solution, case)
    full = sum_contributions(loaded.effect("prestress").contribute(loaded), loaded.n_dof)[0]
    return loaded, sp.csc_array(system.Q.T @ full @ system.Q)


def _largest(
    system: System, A: sp.csc_array, n: int, sign: str, *, repeated: bool = True
) -> tuple[Floats, Floats]:
    """Return the eigenvalues of A x = μ K x of a sign that are largest in size, and their vectors.

    Unless ``repeated``, one of each set of equal eigenvalues may be all that is found of it.
    """
    n_free = system.n_free
    if n_free <= DENSE_LIMIT or 2 * n > n_free // 3:
        K = system.K.toarray()
        scale = 1 / np.sqrt(K.diagonal())
        outer = np.outer(scale, scale)
        mu, vectors = sla.eigh(outer * A.toarray(), outer * K)
        return _sorted(mu, scale[:, None] * vectors, n, sign)
    factor = factor_stiffness(system)
    loaded = np.flatnonzero(abs(A).sum(axis=0))
    if loaded.size <= DENSE_LIMIT or 2 * n > loaded.size // 3:
        return _sorted(*_dense(A, loaded, factor), n, sign)
    try:
        return _by_lanczos(system, A, n, sign, factor, repeated=repeated)
    except ArpackNoConvergence:
        # asked for more factors than the load has: Lanczos would have to separate rounding from rounding
        return _sorted(*_dense(A, loaded, factor), n, sign)


def _dense(A: sp.csc_array, loaded: Ints, factor: Factor) -> tuple[Floats, Floats]:
    """Return all eigenpairs that are not 0 of A x = μ K x, where A acts on few coordinates.

    A = S B Sᵀ, F = Sᵀ K⁻¹ S = L Lᵀ: Lᵀ B L w = μ w and x = K⁻¹ S B L w / μ. L comes from eigenvalues,
    as rounding of F may make the smallest negative.
    """
    S = sp.csc_array(
        (np.ones(loaded.size), (loaded, np.arange(loaded.size))), shape=(A.shape[0], loaded.size)
    )
    response = factor.solve(S.toarray())
    F = response[loaded]
    scale = np.sqrt(F.diagonal())
    values, V = np.linalg.eigh((F + F.T) / 2 / np.outer(scale, scale))
    L = scale[:, None] * V * np.sqrt(np.maximum(values, 0.0))
    BL = A[loaded][:, loaded] @ L
    mu, W = np.linalg.eigh(L.T @ BL)
    keep = abs(mu) > ROUNDING * abs(mu).max()
    return mu[keep], response @ (BL @ (W[:, keep] / mu[keep]))


def _by_lanczos(
    system: System, A: sp.csc_array, n: int, sign: str, factor: Factor, *, repeated: bool
) -> tuple[Floats, Floats]:
    n_free = system.n_free
    which = {"positive": "LA", "negative": "SA", "both": "LM"}[sign]
    random = np.random.default_rng(0)
    mu, vectors = np.zeros(0), np.zeros((n_free, 0))
    flexibility = LinearOperator(A.shape, matvec=factor.solve, dtype=float)
    start = random.standard_normal(n_free)
    largest = eigsh(
        A, 1, system.K, Minv=flexibility, which="LM", v0=start, tol=1e-3, return_eigenvectors=False
    )
    floor = ROUNDING * float(abs(largest[0]))
    while True:
        # Lanczos sees one of each set of equal factors. With those found taken out, ask again for the rest.
        taken = np.asarray(system.K @ vectors)

        def deflated(x: Floats, taken: Floats = taken, mu: Floats = mu) -> Floats:
            return A @ x - taken @ (mu * (taken.T @ x))

        more, found = eigsh(
            LinearOperator(A.shape, matvec=deflated, dtype=float),
            k=n if not mu.size else min(n, 2),
            M=system.K,
            Minv=flexibility,
            which=which,
            v0=random.standard_normal(n_free),
            tol=1e-12,
            # Restarts of Lanczos, which needs fewer than 20 unless it is asked to converge on rounding
            maxiter=200,
        )
        more, found = _sorted(more, found, n_free, sign, floor)
        if not repeated:
            return more[:n], found[:, :n]
        known = _sorted(mu, vectors, n, sign)[0]
        if not more.size or (known.size == n and abs(more[0]) < abs(known[-1]) * (1 - 1e-9)):
            return _sorted(mu, vectors, n, sign)
        mu, vectors = np.concatenate([mu, more]), np.hstack([vectors, found])


def _sorted(mu: Floats, vectors: Floats, n: int, sign: str, floor: float = 0.0) -> tuple[Floats, Floats]:
    """Return the n largest in size that have the sign and are more than rounding, or than a floor."""
    if not mu.size:
        return mu, vectors
    wanted = {"positive": mu > 0, "negative": mu < 0, "both": mu != 0}[sign]
    order = np.argsort(-abs(mu), kind="stable")
    order = order[wanted[order] & (abs(mu[order]) > max(floor, ROUNDING * abs(mu).max()))][:n]
    return mu[order], vectors[:, order]


# Influences on a load factor that linear buckling with these elements neglects ------------------------------


def limits(
    loaded: Model, solution: "StaticSolution", column: int, factor: float, shape: Floats
) -> tuple[str, ...]:
    """Return a sentence on each thing left out that may change a load factor by more than `ACCURACY`.

    Parameters
    ----------
    loaded : Model
        With the effect ``"prestress"`` of the static solution's column.
    solution : StaticSolution
    column : int
    factor : float
        Load factor [-].
    shape : ndarray (n_dof,)
        Buckling shape.
    """
    stress = loaded.effect("prestress")
    (frame,) = loaded.of_kind(Frame)
    assert isinstance(stress, Prestress)
    work = _line_work(loaded, stress.contribute(loaded), shape)
    alone = _line_work(loaded, stress.axial().contribute(loaded), shape)
    total = max(abs(work).sum(), 1e-300)
    share = {m: abs(work[rows]).sum() / total for m, rows in loaded.mesh.members.items()}
    bent = abs(work - alone).sum() / max((abs(work - alone) + abs(alone)).sum(), 1e-300)
    return (
        *_of_shear_centres(loaded, frame, share),
        *_of_warping(loaded, frame, shape),
        *_of_displacements(solution, column, factor, bent),
        *_of_parts(solution, column),
    )


def _line_work(model: Model, parts: tuple[Contribution, ...], shape: Floats) -> Floats:
    """Return xᵀ K x of each line on a shape x, (n_lines,)."""
    return line_work(model, parts, shape[:, None])[:, 0]


def _of_shear_centres(model: Model, frame: Frame, share: Mapping[str, float]) -> Iterator[str]:
    coupled = {e.member for e in model.of_kind(ShearCentre)}
    for member, part in share.items():
        section = frame.members[member].section
        away = float(np.hypot(*section.shear_centre))
        if part > ACCURACY and away > ACCURACY * np.sqrt(section.A):
            missing = (
                "Wagner's terms are"
                if member in coupled
                else ("Wagner's terms and the coupling of torsion with bending are")
            )
            yield (
                f"member '{member}' ({section.label}) has its shear centre {away:.3g} m from its centroid: "
                f"{missing} left out, and the load factor may be too high or too low"
            )


def _of_warping(model: Model, frame: Frame, shape: Floats) -> Iterator[str]:
    for member, k, gains in warping_gains(model, shape[:, None]):
        if gains[0] > ACCURACY:
            yield (
                f"member '{member}' ({frame.members[member].section.label}) resists warping (k = {k:.2g} for "
                "its length), which St Venant's torsion leaves out: this mode's load factor is too low by up "
                f"to {100 * gains[0]:.0f} %, and one with less twist may come first"
            )


def _of_displacements(solution: "StaticSolution", column: int, factor: float, bent: float) -> Iterator[str]:
    """Bending beforehand changes lateral buckling in its first order, axial forces' in its second."""
    mesh = solution.model.mesh
    points = mesh.points[mesh.lines]
    along = points[:, 1] - points[:, 0]
    u = solution.displacements[: 6 * mesh.n_points, column].reshape(-1, 6)[:, :3][mesh.lines]
    length = np.linalg.norm(along, axis=1)
    turn = np.linalg.norm(np.cross(along, u[:, 1] - u[:, 0]), axis=1) / length**2
    rotation = abs(factor) * float(turn.max())
    error = bent * rotation + rotation**2
    if error > ACCURACY:
        member = mesh.member_of_line()[int(turn.argmax())]
        yield (
            f"at the load factor {factor:.4g} the load alone has turned member '{member}' by "
            f"{rotation:.2g} rad; linear buckling leaves out displacements before it, so that the factor is "
            f"uncertain by about {min(100 * error, 100):.0f} %"
        )


def _of_parts(solution: "StaticSolution", column: int) -> Iterator[str]:
    u = solution.displacements[:, column]
    for part in (e for e in solution.model.effects if e.reduced_part):
        strained = any(
            c.static is not None and _strained(np.real(c.static), u[c.dofs])
            for c in part.contribute(solution.model)
        )
        if strained:
            yield (
                f"the reduced part '{part.name}' carries load, but its matrices say nothing about its "
                "geometric stiffness, which is left out"
            )


def _strained(K: Floats, u: Floats) -> bool:
    """Tell whether motions (b, m) strain matrices (b, m, m) by more than the rounding of uᵀKu."""
    energy = np.einsum("bi,bij,bj->b", u, K, u)
    rounding = K.shape[1] * np.finfo(float).eps * np.einsum("bi,bij,bj->b", abs(u), abs(K), abs(u))
    return bool((energy > rounding).any())
