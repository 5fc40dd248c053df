"""Linear buckling: by which factor may a static load grow before a structure gives way.

(K + λ K_G) φ = 0 with K_G the geometric stiffness of the load's section forces. Linear means that these grow
with the load and that the structure hardly moves before it buckles.
"""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from fem.analysis.buckling_limits import limits
from fem.analysis.initial_stress import prestressed
from fem.analysis.modes import DENSE_LIMIT
from fem.analysis.statics import StaticSolution, factor_stiffness, solve_static
from fem.array_types import Floats, Ints
from fem.linalg.solvers import Factor
from fem.model import Model, ModelError
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
