"""Static responses: displacements and reactions under loads that do not change with time.

    System ─ loads → solve_static → StaticSolution ─ prestressed → Model with geometric stiffness

K u = f with the constraints met exactly: u = Q q + u_p, where u_p carries prescribed motions of supports.
Loads are in `fem.analysis.loads`, internal forces in `fem.analysis.section_forces`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.sparse.linalg import LinearOperator, onenormest

from fem.analysis.line_loads import (
    LineAxes,
    SpreadLoads,
    line_axes,
    line_dofs,
    loads_on_members,
    nodal_loads,
    nodal_weights,
    with_weights,
)
from fem.analysis.loads import Key, LoadCase, PointLoads, as_cases, checked_vector, point_forces
from fem.analysis.modes import n_negative, solve_eigenpairs
from fem.analysis.planar import refuse_out_of_plane
from fem.analysis.section_forces import (
    LineEquilibrium,
    initial_forces,
    line_stiffness,
    motion_between_nodes,
    section_forces,
)
from fem.array_types import Floats, Ints
from fem.elements.frame import Frame
from fem.linalg.solvers import Factor, SingularMatrixError, factorise
from fem.model import DIRECTIONS, Constraint, Model, ModelError, lever_matrix
from fem.recent import Recent
from fem.summary import fields_summary
from fem.system import System, assemble, constraint_groups, full_matrices, particular, rigid_motions


@dataclass(frozen=True, slots=True, eq=False)
class StaticSolution:
    """Responses to load cases, one column each.

    Attributes
    ----------
    model : Model
    cases : tuple of str
        Names of the load cases.
    displacements : ndarray (n_dof, n_cases)
        [m, rad].
    reactions : mapping of (str, str) to ndarray (n_cases,)
        Forces of constraints on the structure by their key: of a support in a direction, or of a rigid
        direction of a joint on its first side, with the opposite on its second [N, N·m].
    springs : mapping of (str, str) to ndarray (n_cases,)
        Forces of elastic elements to the ground on the structure, by effect and global direction, moments
        about the effect's place; elements of one effect at several points have keys such as ``"4 rz"``, with
        moments about the point [N, N·m].
    line_forces : ndarray (n_lines, 2, 6, n_cases)
        N, Vy, Vz, T, My, Mz on the positive faces of both ends of each line, in the member's axes [N, N·m].
    residual : ndarray (n_cases,)
        Largest force that remains out of balance, relative to the largest that acts; moments are divided by
        the structure's size [-].
    equilibrium : LineEquilibrium
        Forces on the lines, from which :meth:`internal_forces` follow between the nodes.
    """

    model: Model
    cases: tuple[str, ...]
    displacements: Floats
    reactions: Mapping[Key, Floats]
    springs: Mapping[Key, Floats]
    line_forces: Floats
    residual: Floats
    equilibrium: LineEquilibrium
    _kept: Recent = field(default_factory=lambda: Recent(1), init=False, repr=False)

    __repr__ = fields_summary

    @property
    def rounding(self) -> Floats:
        """Forces [N] and moments [N·m], of members and reactions, that rounding may make; (2, n_cases).

        See :func:`fem.analysis.statics.force_rounding`. Computed when first asked for, with a
        separate factorisation.
        """
        value: Floats = self._kept.get("rounding", self._rounding)
        return value

    def _rounding(self) -> Floats:
        system = assemble(self.model, reciprocal=False)
        factor = factor_stiffness(system) if system.n_free else None
        return force_rounding(system, factor, self.equilibrium, self.displacements)

    @property
    def n_cases(self) -> int:
        """Number of load cases."""
        return len(self.cases)

    def internal_forces(self, member: str, positions: ArrayLike) -> Floats:
        """Return N, Vy, Vz, T, My and Mz at places along a member.

        They act on the positive face of the section, in the member's axes, so that N is positive in tension,
        Vy = -dMz/dx and Vz = dMy/dx. At a concentrated force they are those just before it; between two lines
        those of the second.

        Parameters
        ----------
        member : str
        positions : array_like (n,)
            Arc lengths from the member's first end [m].

        Returns
        -------
        ndarray (n, 6, n_cases)
            [N, N·m].
        """
        at = [self.model.mesh.locate(member, s) for s in np.array(positions, dtype=float, ndmin=1)]
        lines, xi = np.array([a.line for a in at]), np.array([a.xi for a in at])
        return section_forces(self.model, self.equilibrium, self.displacements, lines, xi)

    def displacements_along(self, member: str, positions: ArrayLike) -> Floats:
        """Return displacements and rotations of places along a member's line, global.

        The motion of the nodes, and that of the loads between them while these rest: the strains beyond those
        of the shape functions, integrated twice. Ends that slip in releases and springs move with the member,
        as places next to them do; rigid zones and their ends move with the node.

        Parameters
        ----------
        member : str
        positions : array_like (n,)
            Arc lengths from the member's first end [m].

        Returns
        -------
        ndarray (n, 6, n_cases)
            [m, rad].
        """
        mesh, state = self.model.mesh, self.equilibrium
        at = [mesh.locate(member, s) for s in np.array(positions, dtype=float, ndmin=1)]
        lines, xi = np.array([a.line for a in at], dtype=np.int64), np.array([a.xi for a in at])
        (frame,) = self.model.of_kind(Frame)
        dofs, N = frame.motions_at(mesh, lines, xi, slipped=True)
        u = np.einsum("bij,bjc->bic", np.real(N), self.displacements[dofs])
        zone = state.loads.axes.zone[lines]
        in_zones = (zone > 0) & (np.column_stack([xi, 1 - xi]) < zone + 1e-9)
        loaded = np.unique(np.concatenate([state.loads.line, np.flatnonzero(state.strain.any((1, 2)))]))
        for line in np.intersect1d(loaded, lines):
            here = np.flatnonzero((lines == line) & ~in_zones.any(axis=1))
            u[here] += motion_between_nodes(self.model, state, self.displacements, int(line), xi[here])
        return u

    def case(self, name: str) -> int:
        """Return the column of a load case.

        Raises
        ------
        ModelError
            If there is none of this name.
        """
        if name not in self.cases:
            msg = f"there is no load case '{name}'; the solution has {', '.join(self.cases)}"
            raise ModelError(msg)
        return self.cases.index(name)


def solve_static(
    system: System, loads: LoadCase | Sequence[LoadCase] | PointLoads | None = None
) -> StaticSolution:
    """Solve K u = f for one or several load cases.

    Parameters
    ----------
    system : System
    loads : LoadCase, sequence of LoadCase, array_like, or mapping
        An array (n_dof,) or (n_dof, n_cases), or a mapping such as ``{(3, "z"): -100.0}``, are forces and
        moments at points [N, N·m].

    Returns
    -------
    StaticSolution

    Raises
    ------
    ModelError
        For a structure that is free to move, a mechanism or unstable, loads on points, directions, members or
        supports that the model does not have, values that are not finite, or loads that nothing can take.
    """
    loading = Loading.of(system.model, loads)
    K = full_matrices(system.model)["K"]
    q = _solve(system, loading.on_coordinates(system, K))
    return loading.response(system.model, K, loading.motion(system, q))


@dataclass(frozen=True, slots=True, eq=False)
class Loading:
    """Load cases on a structure, with all that its stiffness does not change.

    Attributes
    ----------
    cases : tuple of LoadCase
    axes : LineAxes
    spread : SpreadLoads
        Loads between the ends of lines, without the lines' weight.
    strain : ndarray (n_lines, 6, n_cases)
        Initial strains.
    gravity : ndarray (3, n_cases)
        [m/s²].
    on_lines, weights : ndarray (n_lines, 12, n_cases)
        Nodal forces of the loads on lines, and of the lines' weight [N, N·m].
    f : ndarray (n_dof, n_cases)
        Forces on all DOFs [N, N·m].
    constraints : tuple of Constraint
    prescribed : ndarray (n_dof, n_cases)
        Motions that violate the constraints as prescribed [m, rad].
    """

    cases: tuple[LoadCase, ...]
    axes: LineAxes
    spread: SpreadLoads
    strain: Floats
    gravity: Floats
    on_lines: Floats
    weights: Floats
    f: Floats
    constraints: tuple[Constraint, ...]
    prescribed: Floats

    @classmethod
    def of(cls, model: Model, loads: LoadCase | Sequence[LoadCase] | PointLoads | None) -> "Loading":
        """Return the loads on a model; raises errors as :func:`solve_static`."""
        cases = as_cases(model, loads)
        axes = line_axes(model)
        spread, strain = loads_on_members(model, axes, cases)
        on_lines = nodal_loads(model, axes, spread, strain, cases)
        gravity = _gravity(cases)
        f = _at_points(model, cases, gravity)
        np.add.at(f, line_dofs(model), on_lines)
        refuse_out_of_plane(model, cases, f)
        constraints = model.constraints()
        return cls(
            tuple(cases),
            axes,
            spread,
            strain,
            gravity,
            on_lines,
            nodal_weights(model, gravity),
            f,
            constraints,
            _prescribed(constraints, cases, model.n_dof),
        )

    def on_coordinates(self, system: System, K: Any) -> Floats:
        """Return the right-hand side Qᵀ(f - K u_p) with the stiffness of all DOFs, (n_free, n_cases)."""
        _check_loaded_dofs(system, self.constraints, self.f)
        return np.asarray(system.Q.T @ (self.f - K @ self.prescribed))

    def motion(self, system: System, q: Floats) -> Floats:
        """Return the motion of all DOFs, (n_dof, n_cases)."""
        return np.asarray(system.Q @ q) + self.prescribed

    def equilibrium(self, model: Model, stiffness: Floats, u: Floats) -> LineEquilibrium:
        """Return the forces on lines of a stiffness (n_lines, 12, 12) in a motion (n_dof, n_cases)."""
        ends = stiffness @ u[line_dofs(model)] - self.on_lines - self.weights
        initial = initial_forces(model, self.axes, stiffness)
        spread = with_weights(model, self.axes, self.spread, self.gravity, self.weights)
        fixed = -(self.on_lines + self.weights)
        return LineEquilibrium(ends[:, :6], fixed, initial, spread, self.strain, self.gravity)

    def reactions(self, force: Floats) -> dict[Key, Floats]:
        """Return the forces of constraints of which the forces out of balance (n_dof, n_cases) are made.

        They are taken from these.
        """
        reactions = constraint_forces(self.constraints, force)
        if self.constraints:
            exerted = [c.coefficients[:, None] * reactions[c.key] for c in self.constraints]
            np.subtract.at(force, np.concatenate([c.dofs for c in self.constraints]), np.concatenate(exerted))
        return {c.key: reactions[c.key] for c in self.constraints if not c.everywhere}

    def response(self, model: Model, K: Any, u: Floats, stiffness: Floats | None = None) -> StaticSolution:
        """Return the response with displacements (n_dof, n_cases) under the stiffness K of all DOFs.

        The model has the loads' lines, masses and constraints; its stiffness may be another. That of its
        lines (n_lines, 12, 12) is formed unless given.
        """
        resisted = K @ u
        out_of_balance = resisted - self.f
        reactions = self.reactions(out_of_balance)
        state = self.equilibrium(model, line_stiffness(model) if stiffness is None else stiffness, u)
        n = np.arange(model.mesh.n_lines)
        forces = np.stack([section_forces(model, state, u, n, np.full(n.size, x)) for x in (0.0, 1.0)], 1)
        scale = _force_scale(model)
        sizes = [abs(scale * X).max(axis=0) for X in (self.f, resisted, K @ self.prescribed)]
        return StaticSolution(
            model,
            tuple(c.name for c in self.cases),
            u,
            MappingProxyType(reactions),
            MappingProxyType(_ground_springs(model, u)),
            forces,
            abs(scale * out_of_balance).max(axis=0) / np.maximum(np.max(sizes, axis=0), 1e-300),
            state,
        )


def load_vectors(model: Model, loads: LoadCase | Sequence[LoadCase] | PointLoads) -> Floats:
    """Return the forces on all DOFs that do the work of load cases, shape (n_dof, n_cases) [N, N·m].

    Parameters
    ----------
    model : Model
    loads : as of :func:`solve_static`

    Raises
    ------
    ModelError
        As :func:`solve_static`, and for a load case that moves supports, which no force does.
    """
    cases = as_cases(model, loads)
    for case in cases:
        if any(case.displacements.values()):
            msg = f"load case '{case.name}' moves supports; only forces have a history in time"
            raise ModelError(msg)
    axes = line_axes(model)
    spread, strain = loads_on_members(model, axes, cases)
    f = _at_points(model, cases, _gravity(cases))
    np.add.at(f, line_dofs(model), nodal_loads(model, axes, spread, strain, cases))
    refuse_out_of_plane(model, cases, f)
    return f


def _gravity(cases: Sequence[LoadCase]) -> Floats:
    """Return the accelerations of gravity, shape (3, n_cases)."""
    return np.array([checked_vector(c.gravity, f"gravity of load case '{c.name}'") for c in cases]).T


def _at_points(model: Model, cases: Sequence[LoadCase], gravity: Floats) -> Floats:
    """Return the forces of loads at points and of gravity on all mass, shape (n_dof, n_cases)."""
    f = np.column_stack([point_forces(model, c) for c in cases])
    if gravity.any():
        f = f + full_matrices(model)["M"] @ (rigid_motions(model)[:, :3] @ gravity)
    return f


def _prescribed(constraints: tuple[Constraint, ...], cases: Sequence[LoadCase], n_dof: int) -> Floats:
    """Return motions that violate each constraint as prescribed, shape (n_dof, n_cases)."""
    u = np.zeros((n_dof, len(cases)))
    by_key = {c.key: c for c in constraints}
    units: dict[Key, Floats] = {}
    for column, case in enumerate(cases):
        for key, value in case.displacements.items():
            if key not in by_key:
                known = ", ".join(f"({a}, {b})" for a, b in by_key) or "none"
                msg = (
                    f"load case '{case.name}' moves ({', '.join(map(str, key))}), which the model does not "
                    f"hold; it holds {known}"
                )
                raise ModelError(msg)
            if not np.isfinite(value):
                msg = f"load case '{case.name}': the displacement of {key} is {value}"
                raise ModelError(msg)
            if key not in units:
                units[key] = particular(tuple(c for c in constraints if c.key != key), by_key[key], n_dof)
            if value and not units[key].any():
                msg = (
                    f"load case '{case.name}' moves ({', '.join(key)}), but other constraints hold the same "
                    "motion; leave out those or move them alike"
                )
                raise ModelError(msg)
            u[:, column] += value * units[key]
    return u


def _check_loaded_dofs(system: System, constraints: tuple[Constraint, ...], f: Floats) -> None:
    """Raise an error for a load where there is neither stiffness nor mass."""
    missed = np.abs(f - system.Q @ (system.Q.T @ f)) > 1e-9 * np.abs(f).max(axis=0)
    fixed = np.zeros(len(f), dtype=bool)
    for c in constraints:
        fixed[c.dofs] = True
    lost = np.flatnonzero(~fixed & missed.any(axis=1))
    if lost.size:
        dof = int(lost[0])
        msg = (
            f"a load acts on point {dof // 6} {DIRECTIONS[dof % 6]}, where nothing has stiffness (bars, "
            "cables or released ends alone meet there)"
        )
        raise ModelError(msg)


def _solve(system: System, b: Floats) -> Floats:
    """Solve K q = b, with one step of refinement; q is empty where every point is fixed."""
    if not system.n_free:
        return b
    factor = factor_stiffness(system)
    q = factor.solve(b)
    return q + factor.solve(b - system.K @ q)


def factor_stiffness(system: System) -> Factor:
    """Factorise the stiffness of a supported structure.

    Raises
    ------
    ModelError
        For a structure that is free to move, a mechanism, or one that is unstable.
    """
    if system.rigid.shape[1]:
        raise ModelError(_describe_free(system))
    K = system.K
    factor = None
    try:
        factor = factorise(K)
        x = factor.solve(factor.solve(np.random.default_rng(0).standard_normal(system.n_free)))
    except SingularMatrixError:
        x = np.full(system.n_free, np.nan)
    with np.errstate(invalid="ignore", over="ignore"):
        opposed = x @ (K @ x) / max(x @ (K.diagonal() * x), 1e-300)
    # K is singular where inverse iteration finds less resistance than this, relative to entries one by one
    if factor is None or not np.isfinite(opposed) or opposed < 1e-15 or n_negative(K, factor):
        solve_eigenpairs(system, 1)  # raises the error that names the mechanism or instability
        if factor is None or not np.isfinite(opposed):
            msg = "the stiffness matrix is singular; a motion meets no resistance"
            raise ModelError(msg)
    return factor


def _describe_free(system: System) -> str:
    """Return the message on a structure that is free to move."""
    motions = rigid_motions(system.model)[:, :6]
    allowed, _ = np.linalg.qr(system.rigid)
    on_q = np.asarray(system.Q.T @ motions)
    share = np.linalg.norm(allowed.T @ on_q, axis=0) / np.maximum(np.linalg.norm(motions, axis=0), 1e-300)
    free = [d for d, s in zip(DIRECTIONS, share, strict=True) if s > 0.999]
    n = system.rigid.shape[1]
    words = f" ({', '.join(free)})" if len(free) == n else ""
    return (
        f"nothing holds the structure in {n} rigid-body motion{'s' if n > 1 else ''}{words}; a static "
        "response needs supports or springs against each"
    )


def constraint_forces(constraints: tuple[Constraint, ...], force: Floats) -> dict[Key, Floats]:
    """Return the force of each constraint, from the forces (n_dof, n_cases) of all of them together.

    Redundant constraints share equally (least squares of least norm).
    """
    out: dict[Key, Floats] = {}
    for group in constraint_groups(constraints):
        if len(group) == 1 and len(group[0].dofs) == 1:  # thousands of a planar model
            out[group[0].key] = force[group[0].dofs[0]] / group[0].coefficients[0]
            continue
        dofs = np.unique(np.concatenate([c.dofs for c in group]))
        B = np.zeros((len(group), len(dofs)))
        for i, c in enumerate(group):
            np.add.at(B[i], np.searchsorted(dofs, c.dofs), c.coefficients)
        size = np.linalg.norm(B, axis=1, keepdims=True)
        exerted = np.linalg.lstsq((B / size).T, force[dofs], rcond=1e-12)[0] / size
        out.update({c.key: row for c, row in zip(group, exerted, strict=True)})
    return out


def _force_scale(model: Model) -> Floats:
    """Return factors (n_dof, 1) that make moments forces, by the structure's size."""
    scale = np.ones((model.n_dof, 1))
    scale[: 6 * model.mesh.n_points].reshape(-1, 6)[:, 3:] = 1 / model.mesh.size
    return scale


def _ground_springs(model: Model, u: Floats) -> dict[Key, Floats]:
    """Return the forces of elastic elements that resist the motion of a rigid body."""
    motions = rigid_motions(model)
    out: dict[Key, Floats] = {}
    n = 6 * model.mesh.n_points
    for effect in model.effects:
        if effect.within_members:
            continue
        elements = [
            (dofs, np.real(K))
            for c in effect.contribute(model)
            if c.static is not None and c.dofs.shape[1] <= 12
            for dofs, K in zip(c.dofs, c.static, strict=True)
            if dofs.max() < n
            and np.abs(K @ motions[dofs]).max() > 1e-9 * (np.abs(K) @ np.abs(motions[dofs])).max()
        ]
        for dofs, K in elements:
            point = int(dofs[0] // 6)
            places = effect.locations(model)
            place = places[0] if len(elements) == 1 and len(places) else model.mesh.points[point]
            force = -K @ u[dofs]
            total = np.zeros((6, u.shape[1]))
            for row, dof in zip(force, dofs, strict=True):
                e = np.zeros(6)
                e[dof % 6] = 1.0
                # carried to the place: the moment of a force about it
                total += np.outer(lever_matrix(model.mesh.points[dof // 6] - place).T @ e, row)
            for d, row in zip(DIRECTIONS, total, strict=True):
                if np.abs(row).max() > 0:
                    key = (effect.name, d if len(elements) == 1 else f"{point} {d}")
                    out[key] = out.get(key, 0) + row
    return out


# How much of the forces of a static response is rounding ----------------------------------------------------
# A frame that is free to expand holds no force under heat: the difference of K u and the fixed-end forces is
# rounding. It follows from the size of both, the number of operations, and the influence of nodal forces on
# section forces and reactions.


_OPERATIONS = 36
"""Operations by which an entry of a line's stiffness comes from E, the section and both nodes.

Twelve of its formula, twelve of the local axes, and six of each turn from local to global axes.
"""
_SIGNS = 8
"""Sets of signs: the standard deviation of their mean is half of it where one displacement decides."""


def force_rounding(system: System, factor: Factor | None, equilibrium: LineEquilibrium, u: Floats) -> Floats:
    """Return a bound of the rounding in section forces and reactions, shape (2, n_cases) [N, N·m].

    With m operations for each entry of K u and unit roundoff ε, refined displacements solve a system whose
    right-hand side is wrong by g = m ε (Σ |K_line| |u| + |f_fixed|) at most (Higham, Accuracy and Stability
    of Numerical Algorithms, 2nd ed., chapter 12). A force B f of nodal forces f is then wrong by |B| g. Its
    largest value is the 1-norm of (B diag g)ᵀ; Hager's estimate of it takes a few solutions.

    Parameters
    ----------
    system : System
    factor : Factor or None
        Of the system's stiffness; None where every point is fixed.
    equilibrium : LineEquilibrium
    u : ndarray (n_dof, n_cases)
        [m, rad].
    """
    dofs, on_lines = line_dofs(system.model), line_stiffness(system.model)
    K = sp.csr_array(full_matrices(system.model)["K"])
    lines, nodes = residual_rounding(K, on_lines, dofs, equilibrium, u)
    ends = lines.reshape(-1, 2, 2, 3, u.shape[1])
    ends[:, :, 1] += equilibrium.loads.axes.span[:, None, None, None] * ends[:, :, 0]  # moments at a cut
    fixed = np.setdiff1d(np.arange(len(u)), sp.csr_array(system.Q).nonzero()[0])
    direct = np.stack([ends[:, :, k].max(axis=(0, 1, 2), initial=0.0) for k in (0, 1)])
    for k in (0, 1):
        chosen = fixed[fixed % 6 // 3 == k]
        direct[k] = np.maximum(direct[k], nodes[chosen].max(axis=0, initial=0.0))
    if factor is not None:
        direct += _influence(system, factor, K, on_lines, dofs, nodes)
    return np.sqrt(3) * direct  # in any direction


def residual_rounding(
    K: Any, on_lines: Floats, dofs: Ints, equilibrium: LineEquilibrium, u: Floats
) -> tuple[Floats, Floats]:
    """Return bounds of the rounding in forces on lines and in those out of balance on all DOFs.

    The bound g of :func:`force_rounding`, for the stiffness K of all DOFs and that of lines
    (n_lines, 12, 12).

    Returns
    -------
    lines : ndarray (n_lines, 12, n_cases)
        [N, N·m].
    nodes : ndarray (n_dof, n_cases)
        [N, N·m].
    """
    K = sp.csr_array(K)
    unit = (_OPERATIONS + int(np.diff(K.indptr).max(initial=0))) * np.finfo(float).eps / 2
    lines = unit * (abs(on_lines) @ abs(u)[dofs] + abs(equilibrium.fixed))
    nodes = unit * (abs(K) @ abs(u))
    np.add.at(nodes, dofs, lines)
    return lines, nodes


def energy_rounding(system: System, factor: Factor, nodes: Floats) -> float:
    """Return the size √(eᵀ K e) of displacements e that rounding of nodal forces within ±g makes [√J].

    The root mean square over independent signs, tr(G A⁻¹ K A⁻¹ G)^½ with G = diag(Qᵀ g), from a few of them
    (Hutchinson, Communications in Statistics 18, 1989, 1059-1076). Signs of the worst case would give a size
    larger by up to the square root of the number of coordinates, which rounding does not reach.

    Parameters
    ----------
    system : System
        Its stiffness is K, which measures the displacements.
    factor : Factor
        Of the stiffness A that resists the forces.
    nodes : ndarray (n_dof,)
        g [N, N·m].
    """
    g = (abs(system.Q).T @ nodes)[:, None]
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (len(g), _SIGNS))
    e = factor.solve(g * signs)
    return float(np.sqrt((e * (system.K @ e)).sum() / _SIGNS))


def beyond_rounding(forces: Floats, rounding: Floats) -> Floats:
    """Return section forces (..., 6, n_cases), 0 where they are not above the bound (2, n_cases)."""
    return np.where(abs(forces) > np.repeat(rounding, 3, axis=0), forces, 0.0)


def _influence(system: System, factor: Factor, K: Any, on_lines: Floats, dofs: Ints, nodes: Floats) -> Floats:
    """Return the largest force and moment, (2, n_cases), of nodal forces up to ``nodes`` (n_dof, n_cases).

    One estimate serves all cases: that of the largest nodal forces of the cases relative to their size.
    """
    n = len(nodes)
    kind = np.arange(n) % 6 // 3
    kind[6 * system.model.mesh.n_points :] = 0
    size = np.where(kind[:, None], nodes / system.model.mesh.size, nodes).max(axis=0)
    shape = (nodes / np.where(size > 0, size, 1.0)).max(axis=1)[:, None]
    row = np.repeat(np.arange(dofs.size).reshape(dofs.shape)[:, :, None], 12, axis=2)
    column = np.repeat(dofs[:, None, :], 12, axis=1)
    forces = sp.csr_array((on_lines.ravel(), (row.ravel(), column.ravel())), shape=(dofs.size, n))
    constrained = np.unique(np.concatenate([c.dofs for c in system.model.constraints()] or [np.arange(0)]))
    outputs = sp.vstack([forces, K[constrained]], format="csr")
    kinds = np.concatenate([dofs.ravel() % 6 // 3, kind[constrained]])
    found = []
    for k in (0, 1):
        some = outputs[kinds == k]
        order = max(n, some.shape[0])

        def apply(f: Floats, some: Any = some, order: int = order) -> Floats:
            q = factor.solve(system.Q.T @ (shape * f.reshape(order, -1)[:n]))
            return _padded(some @ (system.Q @ q), order)

        def transposed(y: Floats, some: Any = some, order: int = order) -> Floats:
            q = factor.solve(system.Q.T @ (some.T @ y.reshape(order, -1)[: some.shape[0]]))
            return _padded(shape * (system.Q @ q), order)

        influence = LinearOperator(
            (order, order), matvec=transposed, matmat=transposed, rmatvec=apply, rmatmat=apply, dtype=float
        )
        found.append(onenormest(influence, t=1))  # of one column, without random ones
    return np.multiply.outer(found, size)


def _padded(x: Floats, order: int) -> Floats:
    """Return rows with rows of zeros up to an order: the estimate is of square matrices."""
    return np.pad(x, ((0, order - len(x)), (0, 0)))
