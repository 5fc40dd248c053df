"""Courses of section forces and forces on rigid arms of a static solution, for its geometric stiffness."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fem.effects.added_mass import AddedMass
from fem.effects.joint import PointPair
from fem.effects.preload import Preload
from fem.effects.prestress import LeverForces, Prestress
from fem.effects.rigid_link import RigidLink
from fem.elements.frame import Frame
from fem.elements.geometric_stiffness import FORCE_NODES, SectionForces
from fem.model import DIRECTIONS, Constraint

if TYPE_CHECKING:
    from fem.analysis.statics import StaticSolution


def section_courses(
    solution: "StaticSolution", column: int, rounding: NDArray[np.float64]
) -> dict[str, SectionForces]:
    """Return the section forces along each member, in stretches between loads that are cubic at most.

    What is less than ``rounding`` (n_lines, 6) is zero.
    """
    mesh, spread = solution.model.mesh, solution._spread
    every = np.arange(mesh.n_lines)
    breaks = np.concatenate([np.repeat([[0.0, 1.0]], mesh.n_lines, axis=0).ravel(), spread.xi.ravel()])
    line = np.concatenate([np.repeat(every, 2), np.repeat(spread.line, 2)])
    cuts = np.unique(np.stack([line, np.clip(breaks, 0, 1)], axis=1), axis=0)
    first = np.flatnonzero((cuts[1:, 0] == cuts[:-1, 0]) & (np.diff(cuts[:, 1]) > 1e-12))
    line, lo, hi = cuts[first, 0].astype(np.int64), cuts[first, 1], cuts[first + 1, 1]
    xi = lo[:, None] + (hi - lo)[:, None] * FORCE_NODES
    values = solution._cut(np.repeat(line, 4), xi.ravel())[:, :, column].reshape(-1, 4, 6)
    values = np.where(abs(values) > rounding[line][:, None], values, 0.0)
    out = {}
    for member, rows in mesh.members.items():
        s = mesh.member_positions(member)
        at = np.full(mesh.n_lines, -1)
        at[rows] = np.arange(len(rows))
        mine = np.flatnonzero(at[line] >= 0)
        mine = mine[np.lexsort((lo[mine], at[line[mine]]))]
        k = at[line[mine]]
        start, length = s[k], s[k + 1] - s[k]
        out[member] = SectionForces(start + lo[mine] * length, start + hi[mine] * length, values[mine])
    return out


def lever_forces(solution: "StaticSolution", column: int) -> LeverForces:
    """Return the forces on rigid arms: of elements between points, of rigid links, and of bodies' weight."""
    model, mesh = solution.model, solution.model.mesh
    u, gravity = solution.displacements[:, column], solution._gravity[:, column]
    reactions = {key: value[column] for key, value in solution.reactions.items()}
    constraints: dict[str, list[Constraint]] = {}
    for c in model.constraints():
        constraints.setdefault(c.key[0], []).append(c)
    place = {
        tuple(effect.relative(model)[0].tolist()): effect.location for effect in model.of_kind(PointPair)
    }
    out: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]] = []

    def carried(dofs: NDArray[np.int64], location: NDArray[np.float64], force: NDArray[np.float64]) -> None:
        for k in range(0, len(dofs), 6):
            point = int(dofs[k] // 6)
            out.append((point, location - mesh.points[point], force[k : k + 3]))

    for effect in model.effects:
        if isinstance(effect, AddedMass):
            out.append((effect.point, effect.arm, -np.real(effect.mass) * gravity))
        elif isinstance(effect, RigidLink):
            for c in constraints.get(effect.name, ()):
                point, _, direction = c.key[1].partition(" ")
                axis = DIRECTIONS.index(direction)
                if axis < 3:
                    arm = mesh.points[int(point)] - mesh.points[effect.point]
                    out.append((effect.point, arm, reactions[c.key] * np.eye(3)[axis]))
        elif not isinstance(effect, Frame | Preload | Prestress):
            for c in effect.contribute(model):
                for dofs, K in zip(c.dofs, () if c.static is None else np.real(c.static), strict=False):
                    if (key := tuple(dofs.tolist())) in place and len(key) in (6, 12):
                        own = effect.location if isinstance(effect, PointPair) else place[key]
                        carried(dofs, own, K @ u[dofs])
            if isinstance(effect, PointPair):
                dofs = effect.relative(model)[0]
                for c in constraints.get(effect.name, ()):
                    if len(dofs) in (6, 12):
                        carried(dofs, effect.location, -reactions[c.key] * c.coefficients)
    out = [(p, arm, force) for p, arm, force in out if np.any(arm) and np.any(force)]
    return LeverForces(
        np.array([p for p, _, _ in out], dtype=np.int64),
        np.array([arm for _, arm, _ in out], dtype=float).reshape(-1, 3),
        np.array([force for _, _, force in out], dtype=float).reshape(-1, 3),
    )
