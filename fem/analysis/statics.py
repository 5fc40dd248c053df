"""Static responses: displacements, reactions and internal forces under loads that do not change with time.

    System ─ loads → solve_static → StaticSolution ─ prestressed → Model with geometric stiffness

K u = f with the constraints met exactly: u = Q q + u_p, where u_p carries prescribed motions of supports.
Internal forces follow from the equilibrium of the part of an element before a cut, so that they are exact
wherever the element is: a distributed load bends N, V and M between the nodes as it does in the beam.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.analysis.initial_stress import lever_forces, section_courses
from fem.analysis.modes import n_negative, solve_eigenpairs
from fem.effects.added_mass import PointMass
from fem.effects.member_change import MemberDensity, MemberStiffness
from fem.effects.preload import Preload
from fem.effects.prestress import Prestress
from fem.effects.stiffness_loss import StiffnessLoss
from fem.elements import tapered
from fem.elements.frame import Frame
from fem.linalg.solvers import Factor, SingularMatrixError, factorise
from fem.mesh import Location, Mesh
from fem.model import DIRECTIONS, Constraint, Model, ModelError, lever_matrix
from fem.system import System, constraint_groups, particular, rigid_motions, sum_contributions

SECTION_FORCES = ("N", "Vy", "Vz", "T", "My", "Mz")
"""Forces [N] and moments [N·m] on the positive face of a section, in the member's axes."""

_SINGULAR = 1e-15
"""Where inverse iteration finds less than this of a motion's resistance, entry by entry, K is singular."""

_ROUNDING = 1e-13
"""Section forces below this of the terms that they are a sum of are rounding."""
_STRETCHES = 32
"""Stretches of a tapered line along which its own weight is taken to be linear."""

Key = tuple[str, str]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LineLoad:
    """A force per length on a member's axis, constant or linear between two places.

    Attributes
    ----------
    member : str
    force1 : ndarray (3,)
        At ``start`` [N/m of the axis].
    force2 : ndarray (3,) or None
        At ``stop``; as ``force1`` unless given.
    axes : str
        ``"global"`` or ``"local"``: the axes of the components.
    start, stop : float
        Arc lengths from the member's first end [m]; the whole member unless given.
    """

    member: str
    force1: ArrayLike
    force2: ArrayLike | None = None
    axes: str = "global"
    start: float = 0.0
    stop: float | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MemberForce:
    """A force on a member's axis at an arc length from its first end.

    Attributes
    ----------
    member : str
    position : float
        Arc length [m].
    force : ndarray (3,)
        [N].
    axes : str
        ``"global"`` or ``"local"``.
    """

    member: str
    position: float
    force: ArrayLike
    axes: str = "global"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class InitialStrain:
    """A strain that a member would take if nothing held it: heat, shrinkage, a bar made too short.

    Attributes
    ----------
    member : str
    axial : float
        Elongation [-]; -P/EA pulls a member between rigid ends with P.
    curvature_y, curvature_z : float
        Derivatives of the rotations about local y and z by x [1/m].
    """

    member: str
    axial: float = 0.0
    curvature_y: float = 0.0
    curvature_z: float = 0.0

    @classmethod
    def thermal(
        cls, member: str, expansion: float, change: float, gradient_y: float = 0.0, gradient_z: float = 0.0
    ) -> "InitialStrain":
        """Return the strain of a change of temperature, α (T + y T_y + z T_z).

        Parameters
        ----------
        member : str
        expansion : float
            Coefficient of thermal expansion α [1/K].
        change : float
            T on the axis [K].
        gradient_y, gradient_z : float
            T_y and T_z, along the local axes [K/m].
        """
        return cls(
            member=member,
            axial=expansion * change,
            curvature_y=expansion * gradient_z,
            curvature_z=-expansion * gradient_y,
        )


MemberLoad = LineLoad | MemberForce | InitialStrain
PointLoads = ArrayLike | Mapping[tuple[int, str], float]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadCase:
    """Loads that act together.

    Attributes
    ----------
    name : str
    points : array_like (n_dof,) or mapping of (int, str) to float
        Forces and moments at points, global: on all DOFs, or such as ``{(3, "z"): -100.0}`` [N, N·m].
    members : tuple of LineLoad, MemberForce and InitialStrain
        Loads on members.
    gravity : ndarray (3,)
        Acceleration of gravity, which acts on all mass, such as (0, 0, -9.81) [m/s²].
    displacements : mapping of (str, str) to float
        Prescribed motions of constraints by their key, such as ``{("foot", "z"): -0.002}``: of a support in a
        direction, or of the first side of a joint relative to its second in a rigid direction [m, rad].
    """

    name: str = "load"
    points: PointLoads = field(default_factory=dict)
    members: tuple[MemberLoad, ...] = ()
    gravity: ArrayLike = (0.0, 0.0, 0.0)
    displacements: Mapping[Key, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class _Axes:
    """Where the axes of the lines run, and their local axes."""

    offset: NDArray[np.float64]  # (n_lines, 2, 3): from the nodes to the ends of the axis
    zone: NDArray[np.float64]  # (n_lines, 2): rigid zones, fractions of the axis
    span: NDArray[np.float64]  # (n_lines,): length of the axis
    R: NDArray[np.float64]  # (n_lines, 3, 3)

    def offset_at(self, lines: NDArray[np.int64], xi: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the offsets at fractions of lines, shape (n, 3)."""
        o = self.offset[lines]
        return o[:, 0] + xi[:, None] * (o[:, 1] - o[:, 0])


@dataclass(frozen=True, slots=True, eq=False)
class _Spread:
    """Loads between the ends of lines: distributed ones, and concentrated ones where both xi are equal."""

    line: NDArray[np.int64]  # (m,), rising
    case: NDArray[np.int64]  # (m,)
    xi: NDArray[np.float64]  # (m, 2)
    force: NDArray[np.float64]  # (m, 2, 3): global, per length or, concentrated, as it is


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
    """

    model: Model
    cases: tuple[str, ...]
    displacements: NDArray[np.float64]
    reactions: Mapping[Key, NDArray[np.float64]]
    springs: Mapping[Key, NDArray[np.float64]]
    line_forces: NDArray[np.float64]
    residual: NDArray[np.float64]
    _ends: NDArray[np.float64]  # (n_lines, 6, n_cases): force of the first node on the line, global
    _fixed: NDArray[np.float64]  # the same while all nodes rest
    _initial: NDArray[np.float64]  # (n_lines, 2, 2, 3): forces of geometric stiffness at the nodes
    _spread: _Spread
    _strain: NDArray[np.float64]  # (n_lines, 6, n_cases): initial strains
    _gravity: NDArray[np.float64]  # (3, n_cases)

    @property
    def n_cases(self) -> int:
        """Number of load cases."""
        return len(self.cases)

    def internal_forces(self, member: str, positions: ArrayLike) -> NDArray[np.float64]:
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
        return self._cut(lines, xi)

    def displacements_along(self, member: str, positions: ArrayLike) -> NDArray[np.float64]:
        """Return displacements and rotations of places along a member's line, global.

        The motion of the nodes, and what the loads between them add while these rest: strains of the forces
        that the shape functions do not give, integrated twice. At a released end and in rigid
        zones it is the node's.

        Parameters
        ----------
        member : str
        positions : array_like (n,)
            Arc lengths from the member's first end [m].

        Returns
        -------
        ndarray (n, 6, n_cases)
            [m, rad].

        Raises
        ------
        ModelError
            Where a loaded member is released in a translation at an end: the loads then move that end.
        """
        mesh = self.model.mesh
        at = [mesh.locate(member, s) for s in np.array(positions, dtype=float, ndmin=1)]
        (frame,) = self.model.of_kind(Frame)
        dofs, N = frame.interpolate(mesh, at)
        u = np.einsum("bij,bjc->bic", N, self.displacements[dofs])
        zone = _axes(self.model).zone
        for line in np.unique(np.concatenate([self._spread.line, np.flatnonzero(self._strain.any((1, 2)))])):
            first, last = zone[line, 0], 1 - zone[line, 1]
            here = np.flatnonzero([a.line == line and first < a.xi < last for a in at])
            if here.size:
                properties = frame.members[member]
                for free in (getattr(properties, "release1", ()), getattr(properties, "release2", ())):
                    if set(free) & {"x", "y", "z"}:
                        msg = (
                            f"member '{member}' is released in {', '.join(free)}: displacements between its "
                            "nodes are not computed under loads; add points where they are needed"
                        )
                        raise ModelError(msg)
                u[here] += _between(self, int(line), np.array([at[k].xi for k in here]))
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

    def _cut(self, lines: NDArray[np.int64], xi: NDArray[np.float64]) -> NDArray[np.float64]:
        return _section_forces(
            self.model, lines, xi, self._ends, self._spread, self._initial, self.displacements
        )


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
    model = system.model
    cases = _as_cases(model, loads)
    axes = _axes(model)
    contributions = model.contributions()
    K, M, _, _ = sum_contributions(contributions, model.n_dof)
    spread, strain = _on_members(model, axes, cases)
    on_lines = _line_loads(model, axes, spread, strain, cases)
    f = np.column_stack([_point_forces(model, c) for c in cases])
    gravity = np.array([_vector(c.gravity, f"gravity of load case '{c.name}'") for c in cases]).T
    f = f + M @ (rigid_motions(model)[:, :3] @ gravity)
    weights = _line_weights(model, gravity)
    np.add.at(f, _line_dofs(model), on_lines)
    constraints = model.constraints()
    prescribed = _prescribed(constraints, cases, model.n_dof)
    _check_idle(system, constraints, f)
    q = _solve(system, np.asarray(system.Q.T @ (f - K @ prescribed)))
    u = np.asarray(system.Q @ q) + prescribed
    out_of_balance = K @ u - f
    reactions = _reactions(constraints, out_of_balance)
    for c in constraints:
        np.subtract.at(out_of_balance, c.dofs, c.coefficients[:, None] * reactions[c.key])
    stiffness = _line_stiffness(model)
    ends = np.einsum("bij,bjc->bic", stiffness, u[_line_dofs(model)]) - on_lines - weights
    initial = _initial_forces(model, axes, stiffness)
    spread = _with_weights(model, axes, spread, gravity, weights)
    n = np.arange(model.mesh.n_lines)
    args = (ends[:, :6], spread, initial, u)
    forces = np.stack([_section_forces(model, n, np.full(n.size, x), *args) for x in (0.0, 1.0)], axis=1)
    scale = _force_scale(model)
    largest = np.max([*(abs(scale * X).max(axis=0) for X in (f, K @ u, K @ prescribed))], axis=0)
    return StaticSolution(
        model,
        tuple(c.name for c in cases),
        u,
        MappingProxyType(reactions),
        MappingProxyType(_ground_springs(model, u)),
        forces,
        abs(scale * out_of_balance).max(axis=0) / np.maximum(largest, 1e-300),
        ends[:, :6],
        -(on_lines + weights)[:, :6],
        initial,
        spread,
        strain,
        gravity,
    )


def prestressed(
    model: Model,
    solution: StaticSolution,
    case: int | str = 0,
    *,
    factor: float = 1.0,
    name: str = "prestress",
) -> Model:
    """Return a model with the geometric stiffness of a static state.

    The section forces of the solution's members, as functions of arc length, go into one effect, so that they
    stay where they are when the mesh is refined; with them the forces on rigid arms of links, joints and
    added masses. Loads keep their directions, also those in local axes, and moments at points are
    semitangential: they do the work M·θ on a rotation vector θ. A moment about a fixed axis has no potential,
    and that of two forces on a rigid bar is had by modelling the bar (`RigidLink`).

    Parameters
    ----------
    model : Model
        With the members of the solution's model, on the same or another mesh.
    solution : StaticSolution
    case : int or str
        Load case, by its column or name.
    factor : float
        Load factor, the effect's parameter [-].
    name : str
        Name of the effect.

    Raises
    ------
    ModelError
        If the load case does not exist, or a member of the solution is not in the model.
    """
    column = solution.case(case) if isinstance(case, str) else case
    if not -solution.n_cases <= column < solution.n_cases:
        msg = f"there is no load case {column}; the solution has {solution.n_cases}, counted from 0"
        raise ModelError(msg)
    mesh = solution.model.mesh
    for member in mesh.members:
        if member not in model.mesh.members:
            known = ", ".join(model.mesh.members)
            msg = f"the solution's member '{member}' is not in the model; it has {known}"
            raise ModelError(msg)
    forces = MappingProxyType(section_courses(solution, column, _force_rounding(solution, column)))
    levers = lever_forces(solution, column)
    return model.with_effect(Prestress(name=name, forces=forces, levers=levers, factor=factor))


def _force_rounding(solution: StaticSolution, column: int) -> NDArray[np.float64]:
    """Return what rounding makes of each section force of the lines, shape (n_lines, 6)."""
    model = solution.model
    u = abs(solution.displacements[_line_dofs(model), column])
    terms = np.einsum("bij,bj->bi", abs(_line_stiffness(model)), u)
    terms[:, :6] += abs(solution._fixed[:, :, column])
    largest = terms.reshape(-1, 2, 2, 3).max(axis=(1, 3))
    return _ROUNDING * np.repeat(largest, 3, axis=1)


# ------------------------------------------------------------------------------------------------ loads


def _as_cases(model: Model, loads: Any) -> tuple[LoadCase, ...]:
    if loads is None:
        msg = "there are no loads; give a LoadCase, forces (n_dof,), or a mapping such as {(3, 'z'): -100.0}"
        raise ModelError(msg)
    if isinstance(loads, LoadCase):
        return (loads,)
    if isinstance(loads, Mapping):
        return (LoadCase(points=loads),)
    if isinstance(loads, Sequence) and any(isinstance(c, LoadCase) for c in loads):
        if not all(isinstance(c, LoadCase) for c in loads):
            msg = "load cases and other loads are mixed; give one LoadCase for each case"
            raise ModelError(msg)
        names = [c.name for c in loads]
        if len(set(names)) == len(names):
            return tuple(loads)
        if set(names) == {"load"}:
            return tuple(replace(c, name=f"load{k + 1}") for k, c in enumerate(loads))
        twice = next(n for n in names if names.count(n) > 1)
        msg = f"two load cases have the name '{twice}'; names must differ"
        raise ModelError(msg)
    f = np.asarray(loads, dtype=float)
    if f.ndim not in (1, 2) or f.shape[0] != model.n_dof:
        msg = f"the loads have shape {f.shape}; ({model.n_dof},) or ({model.n_dof}, n_cases) is expected"
        raise ModelError(msg)
    if f.ndim == 1:
        return (LoadCase(points=f),)
    return tuple(LoadCase(name=f"load{k + 1}", points=f[:, k]) for k in range(f.shape[1]))


def _point_forces(model: Model, case: LoadCase) -> NDArray[np.float64]:
    f = np.zeros(model.n_dof)
    if isinstance(case.points, Mapping):
        for (point, direction), value in case.points.items():
            if not 0 <= point < model.mesh.n_points:
                msg = (
                    f"load case '{case.name}' has a load at point {point}, but the mesh has "
                    f"{model.mesh.n_points} points, counted from 0"
                )
                raise ModelError(msg)
            if direction not in DIRECTIONS:
                msg = (
                    f"load case '{case.name}': '{direction}' at point {point} is not a direction; allowed "
                    f"are {', '.join(DIRECTIONS)}"
                )
                raise ModelError(msg)
            f[6 * point + DIRECTIONS.index(direction)] += value
    else:
        f = np.array(case.points, dtype=float)
        if f.shape != (model.n_dof,):
            msg = f"load case '{case.name}': the forces have shape {f.shape}; ({model.n_dof},) is expected"
            raise ModelError(msg)
    if not np.isfinite(f).all():
        dof = int(np.flatnonzero(~np.isfinite(f))[0])
        msg = f"load case '{case.name}': the load on point {dof // 6} {DIRECTIONS[dof % 6]} is {f[dof]}"
        raise ModelError(msg)
    return f


def _vector(value: ArrayLike, what: str) -> NDArray[np.float64]:
    v = np.asarray(value, dtype=float)
    if v.shape != (3,) or not np.isfinite(v).all():
        msg = f"the {what} is {np.asarray(value).tolist()}; three finite components are expected"
        raise ModelError(msg)
    return v


def _on_members(model: Model, axes: _Axes, cases: Sequence[LoadCase]) -> tuple[_Spread, NDArray[np.float64]]:
    """Return the loads between the ends of lines, and initial strains (n_lines, 6, n_cases)."""
    mesh = model.mesh
    strain = np.zeros((mesh.n_lines, 6, len(cases)))
    rows: list[tuple[int, int, float, float, NDArray[np.float64], NDArray[np.float64]]] = []
    for column, case in enumerate(cases):
        for load in case.members:
            for member in mesh.members_of(load.member):
                if isinstance(load, InitialStrain):
                    e0 = np.array([load.axial, 0, 0, 0, load.curvature_y, load.curvature_z], dtype=float)
                    if not np.isfinite(e0).all():
                        msg = f"load case '{case.name}': an initial strain of member '{member}' is not finite"
                        raise ModelError(msg)
                    strain[mesh.members[member], :, column] += e0
                else:
                    rows += [(r[0], column, *r[1:]) for r in _pieces(model, axes, member, load)]
    return _spread(rows), strain


def _spread(rows: Sequence[tuple[Any, ...]]) -> _Spread:
    rows = sorted(rows, key=lambda r: r[0])
    return _Spread(
        np.array([r[0] for r in rows], dtype=np.int64),
        np.array([r[1] for r in rows], dtype=np.int64),
        np.array([r[2:4] for r in rows], dtype=float).reshape(-1, 2),
        np.array([r[4:6] for r in rows], dtype=float).reshape(-1, 2, 3),
    )


def _pieces(
    model: Model, axes: _Axes, member: str, load: LineLoad | MemberForce
) -> list[tuple[int, float, float, NDArray[np.float64], NDArray[np.float64]]]:
    """Return line, range of fractions and forces at its ends for each line that a load touches."""
    mesh = model.mesh
    if load.axes not in ("global", "local"):
        msg = f"a load on member '{member}' is in '{load.axes}' axes; allowed are global, local"
        raise ModelError(msg)

    def turned(force: NDArray[np.float64], line: int) -> NDArray[np.float64]:
        return force if load.axes == "global" else axes.R[line].T @ force

    if isinstance(load, MemberForce):
        at = mesh.locate(member, load.position)
        force = turned(_vector(load.force, f"force on member '{member}'"), at.line)
        return [(at.line, at.xi, at.xi, force, force)]
    s = mesh.member_positions(member)
    stop = float(s[-1]) if load.stop is None else float(load.stop)
    slack = 1e-9 * s[-1]
    if not -slack <= load.start < stop <= s[-1] + slack:
        msg = (
            f"a line load on member '{member}' goes from {load.start:g} to {stop:g} m; it must rise within "
            f"0 to {s[-1]:g} m"
        )
        raise ModelError(msg)
    first = _vector(load.force1, f"line load on member '{member}'")
    last = first if load.force2 is None else _vector(load.force2, f"line load on member '{member}'")
    out = []
    for line, a, b in zip(mesh.members[member].tolist(), s[:-1], s[1:], strict=True):
        lo, hi = max(a, load.start), min(b, stop)
        if hi <= lo:
            continue
        at = [first + (x - load.start) / (stop - load.start) * (last - first) for x in (lo, hi)]
        xi = (lo - a) / (b - a), (hi - a) / (b - a)
        out.append((line, *xi, *(turned(q, line) for q in at)))
    return out


def _axes(model: Model) -> _Axes:
    (frame,) = model.of_kind(Frame)
    return _axes_of(frame, model.mesh)


@lru_cache(maxsize=8)
def _axes_of(frame: Frame, mesh: Mesh) -> _Axes:
    """Return the axes of the lines, kept for the last few frames and meshes."""
    offset, zone = np.zeros((mesh.n_lines, 2, 3)), np.zeros((mesh.n_lines, 2))
    for member, rows in mesh.members.items():
        p, s = frame.members[member], mesh.member_positions(member)
        at = p.offset1 + (s / s[-1])[:, None] * (p.offset2 - p.offset1)
        offset[rows, 0], offset[rows, 1] = at[:-1], at[1:]
        zone[rows[0], 0], zone[rows[-1], 1] = p.rigid1, p.rigid2
    ends = mesh.points[mesh.lines] + offset
    span = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    return _Axes(offset, zone / span[:, None], span, frame.rotations(mesh))


def _axis_motion(
    model: Model, axes: _Axes, lines: NDArray[np.int64], xi: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the motion of places on the lines' axes from the lines' DOFs, global, shape (n, 6, 12)."""
    (frame,) = model.of_kind(Frame)
    at = [Location(int(line), float(x)) for line, x in zip(lines, xi, strict=True)]
    N = np.real(frame.interpolate(model.mesh, at)[1]).copy()
    N[:, :3] += np.cross(N[:, 3:], axes.offset_at(lines, xi)[:, :, None], axis=1)
    return N


def _line_dofs(model: Model) -> NDArray[np.int64]:
    return (6 * model.mesh.lines[:, :, None] + np.arange(6)).reshape(-1, 12)


def _line_loads(
    model: Model, axes: _Axes, spread: _Spread, strain: NDArray[np.float64], cases: Sequence[LoadCase]
) -> NDArray[np.float64]:
    """Return the nodal forces that do the work of the loads on lines, shape (n_lines, 12, n_cases).

    f = ∫ Nᵀ q dx + ∫ Bᵀ (EA ε₀ …) dx. The shape functions of prismatic lines are cubic and the loads linear,
    on the flexible part and on each rigid zone: three Gauss points on each are exact.
    """
    (frame,) = model.of_kind(Frame)
    out = np.zeros((model.mesh.n_lines, 12, len(cases)))
    zone = axes.zone[spread.line]
    point = spread.xi[:, 0] == spread.xi[:, 1]
    parts = ((0 * zone[:, 0], zone[:, 0]), (zone[:, 0], 1 - zone[:, 1]), (1 - zone[:, 1], 1 + 0 * zone[:, 1]))
    for first, last in parts:
        lo, hi = np.maximum(spread.xi[:, 0], first), np.minimum(spread.xi[:, 1], last)
        k = np.flatnonzero((hi > lo) & ~point)
        for x, w in zip(*_gauss(tapered.N_STATIONS if frame.has_tapers else 3), strict=True):
            xi = lo[k] + x * (hi[k] - lo[k])
            q = _force_at(spread, k, xi) * (w * (hi - lo)[k] * axes.span[spread.line[k]])[:, None]
            _add_work(out, model, axes, spread, k, xi, q)
    k = np.flatnonzero(point)
    _add_work(out, model, axes, spread, k, spread.xi[k, 0], spread.force[k, 0])
    rows = np.flatnonzero(strain.any(axis=(1, 2)))
    if rows.size:
        out[rows] += np.real(frame.forces_of_strains(model.mesh, rows, strain[rows]))
    return out


def _add_work(
    out: NDArray[np.float64],
    model: Model,
    axes: _Axes,
    spread: _Spread,
    k: NDArray[np.int64],
    xi: NDArray[np.float64],
    force: NDArray[np.float64],
) -> None:
    if k.size:
        N = _axis_motion(model, axes, spread.line[k], xi)[:, :3]
        np.add.at(np.moveaxis(out, 1, 2), (spread.line[k], spread.case[k]), np.einsum("bki,bk->bi", N, force))


def _force_at(spread: _Spread, k: NDArray[np.int64], xi: NDArray[np.float64]) -> NDArray[np.float64]:
    x0, x1 = spread.xi[k].T
    share = np.divide(xi - x0, x1 - x0, out=np.zeros_like(xi), where=x1 > x0)
    return spread.force[k, 0] + share[:, None] * (spread.force[k, 1] - spread.force[k, 0])


def _rigidity(model: Model, line: int, xi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return EA, ky GA, kz GA, GJ, EIy and EIz at fractions of a line, (n, 6); 0 where shear strains not."""
    (frame,) = model.of_kind(Frame)
    return np.real(frame.rigidity(model.mesh, [Location(line, float(x)) for x in xi]))


def _line_weights(model: Model, gravity: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what gravity does to the nodes by the lines' own mass, shape (n_lines, 12, n_cases)."""
    mesh = model.mesh
    out = np.zeros((mesh.n_lines, 12, gravity.shape[1]))
    if not gravity.any():
        return out
    field = np.tile(np.vstack([np.eye(3), np.zeros((3, 3))]), (2, 1)) @ gravity
    for effect in model.effects:
        if isinstance(effect, Frame):
            parts = [(np.arange(mesh.n_lines), effect.contribution_of(model, np.arange(mesh.n_lines)))]
        elif isinstance(effect, MemberDensity | PointMass):
            parts = [(mesh.members[effect.member], effect.contribute(model))]
        else:
            continue
        for rows, contributions in parts:
            for c in contributions:
                if c.M is not None and c.dofs.shape[1] == 12:
                    np.add.at(out, _rows_of(model, rows, c.dofs), np.real(c.M) @ field)
    return out


def _rows_of(model: Model, rows: NDArray[np.int64], dofs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return which of some lines elements of 12 DOFs lie on."""
    if len(rows) == len(dofs) and (_line_dofs(model)[rows] == dofs).all():
        return rows  # also where two lines join the same points
    first = model.mesh.lines[rows, 0]
    order = np.argsort(first)
    return rows[order[np.searchsorted(first[order], dofs[:, 0] // 6)]]


_EVEN = np.array([0.0, 1.0]), np.ones(2)


def _course_of_mass(
    model: Model, line: int, first: float, last: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return places on a tapered line and its mass per length there, in parts of the mean, linear between."""
    x = np.linspace(0, 1, _STRETCHES + 1)
    area = _rigidity(model, line, first + x * (last - first))[:, 0]
    return x, area / np.trapezoid(area, x)


def _with_weights(
    model: Model,
    axes: _Axes,
    spread: _Spread,
    gravity: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> _Spread:
    """Return loads between the ends of lines with the lines' own weight and that of masses on members."""
    if not gravity.any():
        return spread
    mesh, (frame,) = model.mesh, model.of_kind(Frame)
    force = weights[:, :3] + weights[:, 6:9]
    rows: list[tuple[Any, ...]] = list(
        zip(spread.line, spread.case, *spread.xi.T, spread.force[:, 0], spread.force[:, 1], strict=True)
    )
    for effect in model.of_kind(PointMass):
        at = mesh.locate(effect.member, float(np.real(effect.position)))
        for c in np.flatnonzero(gravity.any(axis=0)):
            weight = np.real(effect.mass) * gravity[:, c]
            force[at.line, :, c] -= weight
            rows.append((at.line, int(c), at.xi, at.xi, weight, weight))
    lumped = np.zeros(mesh.n_lines, dtype=bool)
    for member, chain in mesh.members.items():
        lumped[chain] = getattr(frame.members[member], "mass", "consistent") == "lumped"
    a, b = axes.zone[:, 0], 1 - axes.zone[:, 1]
    per_length = force / ((b - a) * axes.span)[:, None, None]
    courses = {
        line: _course_of_mass(model, line, float(a[line]), float(b[line]))
        for line in frame.tapered_lines(mesh)
    }
    for c in np.flatnonzero(gravity.any(axis=0)):
        for line in np.flatnonzero(~lumped):
            x, share = courses.get(int(line), _EVEN)
            at, q = a[line] + x * (b[line] - a[line]), share[:, None] * per_length[line, :, c]
            rows += [(line, int(c), *at[i : i + 2], *q[i : i + 2]) for i in range(len(x) - 1)]
    return _spread(rows)


# ------------------------------------------------------------------------------------------- the solution


def _prescribed(
    constraints: tuple[Constraint, ...], cases: Sequence[LoadCase], n_dof: int
) -> NDArray[np.float64]:
    """Return motions that violate each constraint as prescribed, shape (n_dof, n_cases)."""
    u = np.zeros((n_dof, len(cases)))
    by_key = {c.key: c for c in constraints}
    units: dict[Key, NDArray[np.float64]] = {}
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


def _check_idle(system: System, constraints: tuple[Constraint, ...], f: NDArray[np.float64]) -> None:
    """Raise an error for a load where there is neither stiffness nor mass."""
    missed = np.abs(f - system.Q @ (system.Q.T @ f)) > 1e-9 * np.abs(f).max(axis=0)
    held = np.zeros(len(f), dtype=bool)
    for c in constraints:
        held[c.dofs] = True
    lost = np.flatnonzero(~held & missed.any(axis=1))
    if lost.size:
        dof = int(lost[0])
        msg = (
            f"a load acts on point {dof // 6} {DIRECTIONS[dof % 6]}, where nothing has stiffness (bars, "
            "cables or released ends alone meet there)"
        )
        raise ModelError(msg)


def _solve(system: System, b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve K q = b, with one step of refinement; q is empty where every point is held."""
    if not system.n_free:
        return b
    factor = factor_held(system)
    q = factor.solve(b)
    return q + factor.solve(b - system.K @ q)


def factor_held(system: System) -> Factor:
    """Factorise the stiffness of a structure that is held.

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
    if factor is None or not np.isfinite(opposed) or opposed < _SINGULAR or n_negative(K, factor):
        solve_eigenpairs(system, 1)  # names the mechanism, or what makes the structure unstable
        if factor is None or not np.isfinite(opposed):
            msg = "the stiffness matrix is singular; a motion meets no resistance"
            raise ModelError(msg)
    return factor


def _describe_free(system: System) -> str:
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


def _reactions(
    constraints: tuple[Constraint, ...], force: NDArray[np.float64]
) -> dict[Key, NDArray[np.float64]]:
    """Return what each constraint exerts, from forces (n_dof, n_cases) that all of them together exert.

    Constraints that say the same share alike (least squares of least norm).
    """
    out: dict[Key, NDArray[np.float64]] = {}
    for group in constraint_groups(constraints):
        dofs = np.unique(np.concatenate([c.dofs for c in group]))
        B = np.zeros((len(group), len(dofs)))
        for i, c in enumerate(group):
            np.add.at(B[i], np.searchsorted(dofs, c.dofs), c.coefficients)
        size = np.linalg.norm(B, axis=1, keepdims=True)
        exerted = np.linalg.lstsq((B / size).T, force[dofs], rcond=1e-12)[0] / size
        out.update({c.key: row for c, row in zip(group, exerted, strict=True)})
    return out


def _force_scale(model: Model) -> NDArray[np.float64]:
    """Return factors (n_dof, 1) that make moments forces, by the structure's size."""
    scale = np.ones((model.n_dof, 1))
    scale[: 6 * model.mesh.n_points].reshape(-1, 6)[:, 3:] = 1 / model.mesh.size
    return scale


def _ground_springs(model: Model, u: NDArray[np.float64]) -> dict[Key, NDArray[np.float64]]:
    """Return the forces of elastic elements that resist the motion of a rigid body."""
    motions = rigid_motions(model)
    out: dict[Key, NDArray[np.float64]] = {}
    n = 6 * model.mesh.n_points
    for effect in model.effects:
        if isinstance(effect, Frame | Preload | Prestress | MemberStiffness | StiffnessLoss):
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


# ----------------------------------------------------------------------------------------- internal forces


def _line_stiffness(model: Model) -> NDArray[np.float64]:
    """Return the stiffness of each line with all effects that change it, shape (n_lines, 12, 12)."""
    mesh = model.mesh
    every = np.arange(mesh.n_lines)
    out = np.zeros((mesh.n_lines, 12, 12))
    for effect in model.effects:
        if isinstance(effect, Frame):
            pulled = {m: getattr(effect.members[m], "pretension", 0.0) for m in mesh.members}
            parts = [(every, c) for c in effect.contribution_of(model, every)]
            parts += [
                (mesh.members[m], effect.geometric_stiffness(model, m, N)) for m, N in pulled.items() if N
            ]
        elif isinstance(effect, MemberStiffness | StiffnessLoss | Preload):
            parts = [(mesh.members[effect.member], c) for c in effect.contribute(model)]
        elif isinstance(effect, Prestress):
            parts = [(c.lines, c) for c in effect.contribute(model) if c.lines is not None]
        else:
            continue
        for rows, c in parts:
            if c.K is not None and c.dofs.shape[1] == 12:
                np.add.at(out, _rows_of(model, rows, c.dofs), np.real(c.K))
    return out


def _initial_forces(model: Model, axes: _Axes, K: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the forces of the nodes on the lines whose geometric stiffness is in the lines' stiffness.

    A rotation θ of a line meets no other resistance, and turns these: K r = (θ × f, θ × m / 2) at each node,
    the moment being semitangential. Where rounding is larger, 0.

    Returns
    -------
    ndarray (n_lines, 2, 2, 3)
        Forces and moments at both nodes, global [N, N·m].
    """
    points = model.mesh.points[model.mesh.lines]
    arm = points - points.mean(axis=1, keepdims=True)
    out = np.zeros((len(K), 2, 2, 3))
    largest = np.zeros(len(K))
    for axis in np.eye(3):
        r = np.zeros((len(K), 2, 2, 3))
        r[:, :, 0], r[:, :, 1] = np.cross(axis, arm), axis
        r = r.reshape(-1, 12)
        out -= np.cross(axis, np.einsum("bij,bj->bi", K, r).reshape(-1, 2, 2, 3)) * [[0.5], [1.0]]
        largest = np.maximum(largest, np.einsum("bi,bij,bj->b", abs(r), abs(K), abs(r)))
    rounding = (
        1e-12
        * largest[:, None, None, None]
        * np.stack([1 / axes.span, 0 * axes.span + 1], axis=1)[:, None, :, None]
    )
    return np.where(abs(out) > rounding, out, 0.0)


def _section_forces(
    model: Model,
    lines: NDArray[np.int64],
    xi: NDArray[np.float64],
    ends: NDArray[np.float64],
    spread: _Spread,
    initial: NDArray[np.float64],
    u: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the section forces at fractions of lines, shape (n, 6, n_cases).

    They hold the part before the cut in equilibrium with its node's force and its loads. Under geometric
    stiffness that part is displaced, and the initial forces on it add moments; axes stay as they were.
    """
    axes = _axes(model)
    a, b = np.moveaxis(model.mesh.points[model.mesh.lines[lines]] + axes.offset[lines], 1, 0)
    place = a + xi[:, None] * (b - a)
    node = model.mesh.points[model.mesh.lines[lines, 0]]
    force = -ends[lines, :3]
    moment = -ends[lines, 3:] - np.cross((node - place)[:, :, None], ends[lines, :3], axis=1)
    # pairs of a cut and a load on its line
    first, last = (np.searchsorted(spread.line, lines, side=side) for side in ("left", "right"))
    count = last - first
    cut = np.repeat(np.arange(lines.size), count)
    load = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
    lo, hi = spread.xi[load, 0], np.minimum(spread.xi[load, 1], xi[cut])
    point = spread.xi[load, 0] == spread.xi[load, 1]
    for x, w in zip(*_gauss(2), strict=True):
        at = lo + x * (hi - lo)
        length = np.where(hi > lo, w * (hi - lo) * axes.span[lines[cut]], 0.0)
        length = np.where(point, 0.5 * (lo < xi[cut]), length)
        q = _force_at(spread, load, at) * length[:, None]
        at = np.where(point, lo, at)
        arm = a[cut] + at[:, None] * (b - a)[cut] - place[cut]
        np.subtract.at(np.moveaxis(force, 1, 2), (cut, spread.case[load]), q)
        np.subtract.at(np.moveaxis(moment, 1, 2), (cut, spread.case[load]), np.cross(arm, q))
    loaded = np.flatnonzero(initial[lines].any(axis=(1, 2, 3)))
    if loaded.size:
        moment[loaded] -= _moments_of_displacement(model, axes, lines[loaded], xi[loaded], initial, u)
    R = axes.R[lines]
    return np.concatenate([R @ force, R @ moment], axis=1)


def _moments_of_displacement(
    model: Model,
    axes: _Axes,
    lines: NDArray[np.int64],
    xi: NDArray[np.float64],
    initial: NDArray[np.float64],
    u: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the moments about displaced places of the initial forces before them, shape (n, 3, n_cases).

    The node's force f and a uniform load that closes the line's equilibrium act at displaced places; the
    node's moment m is turned, by θ × m/2 beyond what its work on the rotation vector says.
    """
    dofs = _line_dofs(model)[lines]
    f, m = initial[lines, 0, 0], initial[lines, 0, 1]
    per_axis = -(initial[lines, 0, 0] + initial[lines, 1, 0])

    def moved(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.einsum("bij,bjc->bic", _axis_motion(model, axes, lines, x), u[dofs])[:, :3]

    here, node = moved(xi), u[dofs[:, :3]]
    out: NDArray[Any] = np.cross(node - here, f[:, :, None], axis=1)
    out += 0.5 * np.cross(u[dofs[:, 3:6]], m[:, :, None], axis=1)
    for x, w in zip(*_gauss(3), strict=True):
        out += np.cross(moved(x * xi) - here, (w * xi)[:, None, None] * per_axis[:, :, None], axis=1)
    return out


def _between(solution: StaticSolution, line: int, xi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what the loads on a line add to its motion between the nodes, shape (n, 6, n_cases).

    With the strains ε, γ and κ of the section forces that hold the loads while the nodes rest, v = ∫ γ ds +
    ∫ (x - s) κ ds. Ends that are free to turn add a rotation that returns the second end to its place.
    """
    model, axes = solution.model, _axes(solution.model)
    a, b = axes.zone[line, 0], 1 - axes.zone[line, 1]
    at_rest = (solution._fixed, solution._spread, 0 * solution._initial, solution.displacements)
    breaks = np.unique(np.clip([a, b, *solution._spread.xi[solution._spread.line == line].ravel()], a, b))

    n_points = tapered.N_STATIONS if model.of_kind(Frame)[0].has_tapers else 4

    def strains(at: NDArray[np.float64]) -> NDArray[np.float64]:
        lines = np.full(at.size, line)
        extra = _section_forces(model, lines, at, *at_rest)
        rigidity = np.broadcast_to(_rigidity(model, line, at)[:, :, None], extra.shape)
        e = np.divide(extra, rigidity, out=np.zeros_like(extra), where=rigidity > 0)
        return e + solution._strain[line]

    def integrated(x: float) -> NDArray[np.float64]:
        total = np.zeros((6, solution.n_cases))
        for lo, hi in zip(breaks[:-1], np.minimum(breaks[1:], x), strict=True):
            if hi <= lo:
                continue
            t, w = _gauss(n_points)
            at = lo + t * (hi - lo)
            # section forces are those just before a place; within a stretch they are smooth
            e = strains(at) * (w * (hi - lo) * axes.span[line])[:, None, None]
            arm = ((x - at) * axes.span[line])[:, None]
            total[[0, 3, 4, 5]] += e[:, [0, 3, 4, 5]].sum(axis=0)
            total[1] += (e[:, 1] + arm * e[:, 5]).sum(axis=0)
            total[2] += (e[:, 2] - arm * e[:, 4]).sum(axis=0)
        return total

    end = integrated(b)
    out = []
    for x in np.clip(xi, a, b):
        here = integrated(float(x))
        share = (x - a) / (b - a)
        here[:3] -= share * end[:3]
        here[5] -= end[1] / ((b - a) * axes.span[line])
        here[4] += end[2] / ((b - a) * axes.span[line])
        out.append(here)
    R = axes.R[line]
    local = np.array(out)
    motion = np.concatenate([R.T @ local[:, :3], R.T @ local[:, 3:]], axis=1)
    arm = -axes.offset_at(np.full(xi.size, line), xi)  # from the axis to the line
    motion[:, :3] += np.cross(motion[:, 3:], arm[:, :, None], axis=1)
    return motion


def _gauss(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x, w = np.polynomial.legendre.leggauss(n)
    return (x + 1) / 2, w / 2
