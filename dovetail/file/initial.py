"""Read ``[[initial]]``: motions of points and members at the first sample of a response in time."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from dovetail.file.geometry import Geometry
from dovetail.file.table import StudyTable
from fem.analysis.initial import deflected, moving_as_one
from fem.array_types import Floats
from fem.model import DIRECTIONS, ModelError
from fem.system import System


@dataclass(frozen=True, slots=True, eq=False)
class InitialMotion:
    """A motion of a point, or of members as one rigid body, at the first sample.

    Attributes
    ----------
    point : int or None
        None for members.
    members : tuple of str
    displacement : mapping of str to float
        Of the point by direction: it is held there until the first sample [m, rad].
    velocity : mapping of str to float
        By direction [m/s, rad/s].
    about : ndarray (3,)
        Point about which members turn [m].
    """

    point: int | None = None
    members: tuple[str, ...] = ()
    displacement: Mapping[str, float] = field(default_factory=dict)
    velocity: Mapping[str, float] = field(default_factory=dict)
    about: Floats = field(default_factory=lambda: np.zeros(3))


def read_initial(top: StudyTable, geometry: Geometry) -> tuple[InitialMotion, ...]:
    """Read the initial motions of a study."""
    out = []
    for t in top.tables("initial"):
        displacement, velocity = _by_direction(t, "displacement"), _by_direction(t, "velocity")
        if not (displacement or velocity):
            text = "give displacement, velocity or both, such as velocity = { x = 1.5 }"
            t.refuse_without("velocity", text, {"x": 1.5})
        if "point" in t:
            point = geometry.point(t)
            out.append(InitialMotion(point=point, displacement=displacement, velocity=velocity))
        else:
            members = geometry.members(t, default=tuple(geometry.mesh.members))
            if displacement:
                t.refuse("displacement", "it is that of a point, which is held there and let go; give point")
            about = t.vector("about", np.zeros(3))
            out.append(InitialMotion(members=members, velocity=velocity, about=about))
        t.finish()
    return tuple(out)


def start_of(system: System, motions: tuple[InitialMotion, ...]) -> tuple[Floats, Floats] | None:
    """Return the displacements and velocities of all DOFs at the first sample, None where it is at rest.

    Later motions of a point and direction replace former ones.

    Raises
    ------
    ModelError
        For motions that supports do not allow.
    """
    if not motions:
        return None
    mesh = system.model.mesh
    names = {point: f"'{name}'" for name, point in mesh.point_names.items()}
    displaced: dict[tuple[int, str], float] = {}
    velocity = np.zeros(system.model.n_dof)
    for each in motions:
        v = np.array([each.velocity.get(d, 0.0) for d in DIRECTIONS])
        if each.point is None:
            points = np.unique(np.concatenate([mesh.lines[mesh.members[m]].ravel() for m in each.members]))
            moved = moving_as_one(system, points, v, each.about)
            velocity[moved != 0] = moved[moved != 0]
            continue
        for direction in (*each.displacement, *each.velocity):
            dof = 6 * each.point + DIRECTIONS.index(direction)
            if not abs(system.Q[[dof]]).sum():
                place = names.get(each.point, f"the point at {mesh.points[each.point]} m")
                msg = f"{place} has an initial motion in {direction}, in which it is held"
                raise ModelError(msg)
        displaced |= {(each.point, d): u for d, u in each.displacement.items()}
        for direction, speed in each.velocity.items():
            velocity[6 * each.point + DIRECTIONS.index(direction)] = speed
    return deflected(system, displaced), velocity


def _by_direction(t: StudyTable, key: str) -> dict[str, float]:
    """Return values by direction, such as ``{ x = 0.01 }``."""
    inner = t.table(key)
    units = ("m", "rad") if key == "displacement" else ("m/s", "rad/s")
    values = {d: inner.number(d, None, unit=units[d[0] == "r"]) for d in DIRECTIONS}
    inner.finish()
    return {d: v for d, v in values.items() if v is not None}
