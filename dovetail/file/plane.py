"""Read ``plane`` of ``[mesh]``: a planar model, whose sensors and loads lie in its plane."""

from collections.abc import Iterable

import numpy as np

from dovetail.file.sensors import Channel
from dovetail.file.table import StudyTable
from fem.effects.plane import PLANES, Plane, plane_of, refusals
from fem.model import DIRECTIONS, Model

PLANE = "plane"
"""Name of the effect of a planar study."""

_VECTORS = ("force", "force_per_length", "force_per_length2", "gravity")


def read_plane(top: StudyTable, notes: list[str]) -> Plane | None:
    """Read the plane of a study's model, None for one in space."""
    plane = top.table("mesh").text("plane", None, tuple(PLANES))
    if plane is None:
        return None
    found = Plane(name=PLANE, plane=plane)
    notes.append(f"all points move in the plane {plane} alone: {', '.join(found.inside)}")
    return found


def refuse_space(top: StudyTable, model: Model) -> None:
    """Refuse parts of a model that do not fit into its plane."""
    plane = plane_of(model)
    for where, why in () if plane is None else refusals(model, plane.plane):
        top.table("mesh").refuse("plane", f"{where} does not fit into it: {why}")


def refuse_channels(plane: Plane | None, channels: Iterable[Channel]) -> None:
    """Refuse sensors and excitations that measure or push out of the plane."""
    if plane is None:
        return
    for channel in channels:
        if not plane.includes(channel.sensor.direction):
            key = "direction" if "direction" in channel.table.values else ""
            words = ", ".join(f"{v:.4g}" for v in channel.sensor.direction)
            channel.table.refuse(
                key,
                f"'{channel.sensor.name}' has the direction ({words}), out of the model's plane "
                f"{plane.plane}; allowed are directions in the plane",
            )


def refuse_loads(top: StudyTable, plane: Plane | None) -> None:
    """Refuse loads whose global components are out of the plane."""
    if plane is None:
        return
    normal = PLANES[plane.plane]
    for t in top.tables("loads"):
        if t.values.get("axes") != "local":
            for key in _VECTORS:
                if key in t.values and t.vector(key)[normal]:
                    t.refuse(key, f"its component {DIRECTIONS[normal]} is {_out_of(plane)}")
        if "moment" in t.values and np.delete(t.vector("moment"), normal).any():
            t.refuse("moment", f"a moment about an axis in the plane is {_out_of(plane)}")
        if "settlement" in t.values:
            inner = t.table("settlement")
            for direction in inner.values:
                if direction in plane.out:
                    inner.refuse(direction, f"it is {_out_of(plane)}")


def _out_of(plane: Plane) -> str:
    return f"out of the model's plane {plane.plane}; allowed are {', '.join(plane.inside)}"
