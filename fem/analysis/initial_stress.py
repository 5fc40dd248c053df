"""Geometric stiffness of a static state: section forces along members, and forces on rigid arms."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from fem.analysis.line_loads import line_dofs
from fem.analysis.section_forces import LineEquilibrium, line_stiffness, section_forces
from fem.analysis.statics import StaticSolution
from fem.array_types import Floats, Ints
from fem.declarations import ArmForce, Role
from fem.effects.joint import PointPair
from fem.effects.prestress import LeverForces, Prestress
from fem.elements.geometric_stiffness import FORCE_NODES, SectionForces
from fem.model import Model, ModelError, dofs_of

_ROUNDING = 1e-13
"""Section forces below this, relative to the largest term of their sum, are rounding."""


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
    do not depend on the mesh; the effect also holds the forces on rigid arms of links, joints and added
    masses. Loads keep their directions, also those in local axes, and moments at points are semitangential:
    they do the work M·θ on a rotation vector θ. A moment about a fixed axis has no potential, and that of two
    forces on a rigid bar needs a model of the bar (`RigidLink`).

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
    state = StressedState(
        solution.model,
        solution.displacements[:, [column]],
        solution.equilibrium.case(column),
        {key: float(value[column]) for key, value in solution.reactions.items()},
    )
    effect = stress_effect(state, line_stiffness(solution.model), factor=factor, name=name)
    return model.with_effect(effect)


@dataclass(frozen=True, slots=True, eq=False)
class StressedState:
    """The static state under one load case.

    Attributes
    ----------
    model : Model
    displacements : ndarray (n_dof, 1)
        [m, rad].
    equilibrium : LineEquilibrium
        Of this load case alone.
    reactions : mapping of (str, str) to float
        [N, N·m].
    """

    model: Model
    displacements: Floats
    equilibrium: LineEquilibrium
    reactions: Mapping[tuple[str, str], float]


def stress_effect(
    state: StressedState, stiffness: Floats, *, factor: float = 1.0, name: str = "prestress"
) -> Prestress:
    """Return the geometric stiffness of a static state as an effect.

    ``stiffness`` of the lines (n_lines, 12, 12) gives the rounding of section forces.
    """
    forces = section_courses(state, _force_rounding(state, stiffness))
    return Prestress(name=name, forces=MappingProxyType(forces), levers=lever_forces(state), factor=factor)


def _force_rounding(state: StressedState, stiffness: Floats) -> Floats:
    """Return the rounding of each section force of the lines, shape (n_lines, 6)."""
    u = abs(state.displacements[line_dofs(state.model)])
    terms = (abs(stiffness) @ u)[:, :, 0]
    terms[:, :6] += abs(state.equilibrium.fixed[:, :6, 0])
    largest = terms.reshape(-1, 2, 2, 3).max(axis=(1, 3))
    return _ROUNDING * np.repeat(largest, 3, axis=1)


def section_courses(state: StressedState, rounding: Floats) -> dict[str, SectionForces]:
    """Return the section forces along each member, in stretches between loads that are cubic at most.

    Forces below ``rounding`` (n_lines, 6) are zero.
    """
    mesh, spread = state.model.mesh, state.equilibrium.loads
    every = np.arange(mesh.n_lines)
    breaks = np.concatenate([np.repeat([[0.0, 1.0]], mesh.n_lines, axis=0).ravel(), spread.xi.ravel()])
    line = np.concatenate([np.repeat(every, 2), np.repeat(spread.line, 2)])
    cuts = np.unique(np.stack([line, np.clip(breaks, 0, 1)], axis=1), axis=0)
    first = np.flatnonzero((cuts[1:, 0] == cuts[:-1, 0]) & (np.diff(cuts[:, 1]) > 1e-12))
    line, lo, hi = cuts[first, 0].astype(np.int64), cuts[first, 1], cuts[first + 1, 1]
    xi = lo[:, None] + (hi - lo)[:, None] * FORCE_NODES
    u, places = state.displacements, (np.repeat(line, 4), xi.ravel())
    values = section_forces(state.model, state.equilibrium, u, *places).reshape(-1, 4, 6)
    values = np.where(abs(values) > rounding[line][:, None], values, 0.0)
    ends, (chains, member) = mesh.arc_lengths()[line], mesh.chains()
    rank = np.empty(mesh.n_lines, dtype=np.int64)
    rank[chains] = np.arange(mesh.n_lines)
    order = np.lexsort((lo, rank[line]))
    length = ends[:, 1] - ends[:, 0]
    start, stop = (ends[:, 0] + x * length for x in (lo, hi))
    owner = np.empty(mesh.n_lines, dtype=np.int64)
    owner[chains] = member
    last = np.cumsum(np.bincount(owner[line], minlength=len(mesh.members))).tolist()
    start, stop, values = start[order], stop[order], values[order]
    parts = zip(mesh.members, [0, *last[:-1]], last, strict=True)
    return {name: SectionForces(start[i:j], stop[i:j], values[i:j]) for name, i, j in parts}


def lever_forces(static: StressedState) -> LeverForces:
    """Return the forces on rigid arms: of elements between points, of rigid links, and of bodies' weight."""
    model = static.model
    u, gravity = static.displacements[:, 0], static.equilibrium.gravity[:, 0]
    place = {
        tuple(effect.relative(model)[0].tolist()): effect.location for effect in model.of_kind(PointPair)
    }
    out: list[ArmForce] = []
    for effect in model.effects:
        if not effect.within_members and Role.INITIAL_STRESS not in effect.role:
            for c in effect.contribute(model):
                for dofs, K in zip(c.dofs, () if c.static is None else np.real(c.static), strict=False):
                    if (key := tuple(dofs.tolist())) in place and len(key) in (6, 12):
                        location = effect.location if isinstance(effect, PointPair) else place[key]
                        out += _forces_at(model, dofs, location, K @ u[dofs])
                if c.M is not None and not effect.reduced_part:
                    out += _weights_at_arms(model, c.dofs, np.real(c.M), gravity)
        for c in effect.constraints(model):
            if c.location is not None and c.key in static.reactions:
                force = -static.reactions[c.key] * c.coefficients
                out += _forces_at(model, c.dofs, c.location, force)
    out = [f for f in out if np.any(f.arm) and np.any(f.force)]
    return LeverForces(
        np.array([f.point for f in out], dtype=np.int64),
        np.array([f.arm for f in out], dtype=float).reshape(-1, 3),
        np.array([f.force for f in out], dtype=float).reshape(-1, 3),
    )


def _forces_at(model: Model, dofs: Ints, location: Floats, force: Floats) -> Iterator[ArmForce]:
    """Yield forces on DOFs of points as such at a place that rigid arms lead to."""
    for point in dict.fromkeys((dofs // 6).tolist()):
        there = (dofs // 6 == point) & (dofs % 6 < 3)
        f = np.zeros(3)
        f[dofs[there] % 6] = force[there]
        yield ArmForce(point, location - model.mesh.points[point], f)


def _weights_at_arms(model: Model, dofs: Ints, M: Floats, gravity: Floats) -> Iterator[ArmForce]:
    """Yield the weights of rigid bodies that single points carry, by their mass matrices (b, m, m).

    With the arm r from the point to the centre the block of translations by rotations is -m S(r), where
    S(r) w = r × w.
    """
    n = 6 * model.mesh.n_points
    for at, X in zip(dofs, M, strict=True):
        if len(at) >= 6 and (at[:6] == dofs_of(at[0] // 6)).all() and (at[6:] >= n).all():
            mass, moment = np.diag(X)[[1, 2, 0]], np.array([X[1, 5], X[2, 3], X[0, 4]])
            arm = np.divide(moment, mass, out=np.zeros(3), where=mass > 0)
            yield ArmForce(int(at[0] // 6), arm, -X[:3, :3] @ gravity)
