"""Whether the places of sensors can be meant: coordinates in another unit, or with a unit applied twice."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.file.sensor_table import UNIT_OF_HEADING
from dovetail.file.table import StudyTable
from fem.mesh import Mesh
from updating.measurement.matching import FITTING, SCALES

OFF_AXIS = 0.02
"""Largest distance of a place from the axis of a member, as part of the structure's size [-]."""

CLUSTERED = 0.01
"""Extent of all places, as part of the structure's size, below which another unit is looked for [-]."""

TWICE = 0.026
"""The same where the structure has all places without the unit of the heading: 1 inch is 0.0254 m [-]."""


_LEAST_PLACES = 3
_FACTORS = tuple({a / b for a in SCALES.values() for b in SCALES.values()} - {1.0})
_NEAR = 1e-6


def refuse_or_suspect_places(
    tables: Sequence[StudyTable], what: str, mesh: Mesh, nodes: Mapping[int, NDArray[np.float64]]
) -> list[str]:
    """Return suspicions about the coordinates of sensors, one sentence each.

    Parameters
    ----------
    tables : sequence of Table
        Of all sensors, or all excitations; places by name are those of the mesh.
    what : str
        "sensors" or "excitations".
    mesh : Mesh
    nodes : mapping of int to ndarray (3,)
        Of the measured files, by which tables may give places [m].

    Raises
    ------
    StudyError
        For places off the structure which are on it in another unit.
    """
    stated = [(t, xyz) for t in tables for xyz in _coordinates(t, nodes)]
    if not stated:
        return []
    places = np.array([xyz for _, xyz in stated])
    distinct = np.unique(np.round(places / (_NEAR * mesh.size)), axis=0)
    distance = _distances(places, mesh)
    extent = float(np.ptp(places, axis=0).max())
    off = distance > OFF_AXIS * mesh.size
    several, mostly_off = len(distinct) >= _LEAST_PLACES, len(distinct) > 1 and off.mean() > 0.5
    table = stated[0][0]
    looked_for = mostly_off or (several and extent < TWICE * mesh.size)
    factor = _fitting_factor(places, mesh, table) if looked_for else None
    twice = factor is not None and abs(factor * SCALES.get(_unit(table), 0.0) - 1) < _NEAR
    clustered = several and extent < (TWICE if twice else CLUSTERED) * mesh.size
    far = mostly_off and (distance.max() > mesh.size or (several and factor is not None))
    far = far or (clustered and twice and off.any())
    if not (clustered or far):
        return []
    every = f"the {len(places)} {what}"
    remedy = "" if factor is None else f"; times {factor:.6g} they are on it: {_remedy(table, factor)}"
    if far:
        if remedy:
            text = (
                f"the coordinates of {every} are up to {distance.max():.3g} m off the structure, which is "
                f"{mesh.size:.3g} m in size{remedy}"
            )
            raise table.error("point" if "x" not in _columns(table) else "x", text)
        return []
    # Extent below which places are suspicious in any unit: several sensors have no room there [-]
    if not remedy and extent > 2e-3 * mesh.size:
        return []
    remedy = remedy or ": they show the motion of one place; look at their coordinates and their unit"
    text = (
        f"{every} lie within {1e3 * extent:.3g} mm{_by_name(places, mesh)}, and the structure is "
        f"{mesh.size:.3g} m in size{remedy}"
    )
    return [str(table.error("", text))]


def _columns(t: StudyTable) -> Mapping[str, str]:
    return getattr(t.source, "columns", {})


def _coordinates(t: StudyTable, nodes: Mapping[int, NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """Return the places that a table gives by coordinates, or by nodes of the measured files [m]."""
    point, points, node = (t.values.get(key) for key in ("point", "points", "node"))
    given = [point, *(points if isinstance(points, list) else [])]
    lists = [p for p in given if isinstance(p, list) and len(p) == 3]
    found = [np.array(p, float) for p in lists if all(type(x) in (int, float) for x in p)]
    if point is None and "member" not in t.values and isinstance(node, int) and node in nodes:
        found.append(nodes[node])
    return [p for p in found if np.isfinite(p).all()]


def _distances(places: NDArray[np.float64], mesh: Mesh) -> NDArray[np.float64]:
    """Return distances from the members, or from the points of a mesh without members, (n,) [m]."""
    if mesh.members:
        return np.array([mesh.nearest_on_members(p)[2] for p in places])
    return np.array([mesh.nearest_point(p)[1] for p in places])


def _fitting_factor(places: NDArray[np.float64], mesh: Mesh, table: StudyTable) -> float | None:
    """Return the factor between units by which all places are on the structure; None without any.

    That of a unit in the heading is tried first. Of others, places along one axis fit several: the largest
    extent is taken.
    """
    extent = float(np.ptp(places, axis=0).max()) / mesh.size
    unit = _unit(table)
    first = 1 / SCALES[unit] if unit in SCALES else 1.0
    for factor in sorted(_FACTORS, key=lambda f: (abs(f / first - 1) > _NEAR, -f)):
        if (
            FITTING[0] <= factor * extent <= FITTING[1]
            and (_distances(factor * places, mesh) <= OFF_AXIS * mesh.size).all()
        ):
            return factor
    return None


def _unit(t: StudyTable) -> str:
    """Return the unit in the heading of a table's coordinates."""
    found = UNIT_OF_HEADING.search(_columns(t).get("x", ""))
    return found[1] if found else ""


def _remedy(t: StudyTable, factor: float) -> str:
    """Return in which unit the numbers look to be, and where to write it."""
    given = _unit(t) or "m"
    size = factor * SCALES.get(given, 1.0)
    looks = next((u for u, one in SCALES.items() if abs(one / size - 1) < _NEAR), None)
    if looks is None or "point" not in t.values:
        return "look at their unit and at that of the mesh"
    if not _columns(t):
        return f"they look like {looks}; write them in m"
    heading = f", and the heading says {given}" if _unit(t) else ""
    return f"the numbers look like {looks}{heading}; write the heading as x [{looks}]"


def _by_name(places: NDArray[np.float64], mesh: Mesh) -> str:
    """Return the named point of the mesh that is nearest to all places."""
    named = {n: mesh.points[k] for n, k in mesh.point_names.items()}
    if not named:
        return ""
    distance = {n: float(np.linalg.norm(places - at, axis=1).max()) for n, at in named.items()}
    nearest = min(distance, key=lambda n: distance[n])
    return f" of point '{nearest}'" if distance[nearest] < CLUSTERED * mesh.size else ""
