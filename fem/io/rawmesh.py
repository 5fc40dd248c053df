"""What mesh readers hand over, and how it becomes a :class:`fem.mesh.Mesh`.

A reader gives points, lines and sets as the file has them. Joined here, for all formats alike: quadratic
lines, overlapping sets, points that nothing uses or that coincide.
"""

import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fem.mesh import Mesh, MeshError

MOST_NAMED = 50
"""Point sets with more points than this give no point names."""


@dataclass(slots=True)
class RawMesh:
    """Lines of a mesh file.

    Attributes
    ----------
    points : list of coordinates, three each
    lines : list of point indices, two or three each
    sets, point_sets : name to indices of lines, of points
    left_out : count of what was not read, by type
    notes : what else there is to say
    """

    points: list[Sequence[float]] = field(default_factory=list)
    lines: list[tuple[int, ...]] = field(default_factory=list)
    sets: dict[str, list[int]] = field(default_factory=dict)
    point_sets: dict[str, list[int]] = field(default_factory=dict)
    left_out: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    def add_to_set(self, name: str, line: int) -> None:
        """Put a line into a set."""
        self.sets.setdefault(name, []).append(line)


def mesh_of(raw: RawMesh, file: str, scale: float, merge_tolerance: float | None) -> Mesh:
    """Make a mesh of what a file holds, and say in one warning what was left out or looks wrong.

    Raises
    ------
    MeshError
        If there are no lines, or they do not make a mesh.
    """
    if not raw.lines:
        found = (
            ", ".join([*(f"{n} {name}" for name, n in raw.left_out.items()), *raw.notes]) or "no cells at all"
        )
        msg = f"{file}: no lines; it has {found}, and a frame needs two-node or three-node lines"
        raise MeshError(msg)
    if not (np.isfinite(scale) and scale > 0):
        msg = f"the scale is {scale}; it must be positive (0.001 for a file in mm)"
        raise MeshError(msg)
    points = np.array(raw.points, dtype=float).reshape(-1, 3) * scale
    lines, origin = _two_node_lines(points, raw.lines, file)
    notes = [*raw.notes]
    notes += [f"{n} {name} left out (only lines are read)" for name, n in raw.left_out.items()]
    if len(lines) > len(raw.lines):
        notes.append(f"{len(lines) - len(raw.lines)} quadratic lines became two lines each")
    sets = {name: np.flatnonzero(np.isin(origin, rows)) for name, rows in raw.sets.items()}
    names = _point_names(raw.point_sets)
    if merge_tolerance is None:
        notes += _coincidences(points, lines)
    else:
        points, lines, names, kept = _merged(points, lines, names, merge_tolerance, notes)
        sets = {name: np.flatnonzero(np.isin(kept, rows)) for name, rows in sets.items()}
    points, lines, names = _used(points, lines, names, notes)
    notes += _doubles(lines)
    mesh = _built(points, lines, sets, names, file)
    if notes:
        warnings.warn(f"{file}: {'; '.join(notes)}", stacklevel=3)
    return mesh


def _two_node_lines(
    points: NDArray[np.float64], lines: Sequence[tuple[int, ...]], file: str
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return two-node lines and the line of the file that each comes from.

    Of three nodes, the one that is not an end of the longest distance is the middle one, whatever the
    format's order.
    """
    out: list[tuple[int, int]] = []
    origin: list[int] = []
    for row, nodes in enumerate(lines):
        if not all(0 <= node < len(points) for node in nodes):
            msg = (
                f"{file}: line {row} refers to a point that is not among the {len(points)} points of the file"
            )
            raise MeshError(msg)
        chain = nodes
        if len(nodes) == 3:
            a, b, c = points[list(nodes)]
            apart = [np.linalg.norm(b - c), np.linalg.norm(c - a), np.linalg.norm(a - b)]
            middle = int(np.argmax(apart))
            first, last = (n for k, n in enumerate(nodes) if k != middle)
            chain = (first, nodes[middle], last)
        for pair in pairwise(chain):
            out.append(pair)
            origin.append(row)
    return np.array(out, dtype=np.int64), np.array(origin, dtype=np.int64)


def _point_names(sets: Mapping[str, Sequence[int]]) -> dict[str, int]:
    """Name points by their sets: ``base`` for a single one, ``base.1``, ``base.2``, … for several."""
    names: dict[str, int] = {}
    for name, members in sets.items():
        indices = list(dict.fromkeys(int(k) for k in members))
        if len(indices) == 1:
            names[name] = indices[0]
        elif len(indices) <= MOST_NAMED:
            names.update({f"{name}.{k}": index for k, index in enumerate(indices, start=1)})
    return names


def _coincidences(points: NDArray[np.float64], lines: NDArray[np.int64]) -> list[str]:
    used = points[np.unique(lines)]
    reach = 1e-6 * float(np.ptp(used, axis=0).max())
    pairs = cKDTree(used).query_pairs(reach, output_type="ndarray")
    if not len(pairs):
        return []
    n = np.unique(pairs[:, 1]).size
    return [
        f"{n} point{'s lie' if n > 1 else ' lies'} at the place of another, so that the lines there "
        "are not connected; "
        f"if they should be, give merge_tolerance, such as {max(reach, 1e-12):.1g} [m]"
    ]


def _merged(
    points: NDArray[np.float64],
    lines: NDArray[np.int64],
    names: dict[str, int],
    tolerance: float,
    notes: list[str],
) -> tuple[NDArray[np.float64], NDArray[np.int64], dict[str, int], NDArray[np.int64]]:
    """Join points nearer than a tolerance; return also which lines are left."""
    if not (np.isfinite(tolerance) and tolerance >= 0):
        msg = f"the merge tolerance is {tolerance}; it must be a length that is not negative [m]"
        raise MeshError(msg)
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    n = len(points)
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, cluster = connected_components(links, directed=False)
    _, first, which = np.unique(cluster, return_index=True, return_inverse=True)
    to = first[which]
    if (to != np.arange(n)).any():
        notes.append(f"{int((to != np.arange(n)).sum())} points merged with others within {tolerance:g} m")
    lines = to[lines]
    kept = np.flatnonzero(lines[:, 0] != lines[:, 1])
    if kept.size < len(lines):
        notes.append(f"{len(lines) - kept.size} lines shorter than the merge tolerance left out")
    return points, lines[kept], {name: int(to[k]) for name, k in names.items()}, kept


def _used(
    points: NDArray[np.float64], lines: NDArray[np.int64], names: dict[str, int], notes: list[str]
) -> tuple[NDArray[np.float64], NDArray[np.int64], dict[str, int]]:
    """Leave out points on no line; the others keep their order."""
    used = np.unique(lines)
    to = np.full(len(points), -1)
    to[used] = np.arange(used.size)
    lost = [name for name, k in names.items() if to[k] < 0]
    if used.size < len(points):
        named = f", the named {', '.join(lost)} among them" if lost else ""
        notes.append(
            f"{len(points) - used.size} points on no line left out and the others renumbered in their "
            f"order{named}"
        )
    return points[used], to[lines], {name: int(to[k]) for name, k in names.items() if to[k] >= 0}


def _doubles(lines: NDArray[np.int64]) -> list[str]:
    n = len(lines) - len(np.unique(np.sort(lines, axis=1), axis=0))
    return [f"{n} lines join the same two points as another line"] if n else []


def _built(
    points: NDArray[np.float64],
    lines: NDArray[np.int64],
    sets: Mapping[str, NDArray[np.int64]],
    names: Mapping[str, int],
    file: str,
) -> Mesh:
    cells, parts_of = _disjoint({name: rows for name, rows in sets.items() if rows.size})
    try:
        mesh = Mesh.from_lines(points, lines, cells, names)
    except MeshError as reason:
        msg = f"{file}: {reason}"
        raise MeshError(msg) from reason
    groups = dict(mesh.groups)
    for name, parts in parts_of.items():
        groups[name] = tuple(member for part in parts for member in mesh.members_of(part))
    return replace(mesh, groups=MappingProxyType(groups))


def _disjoint(
    sets: Mapping[str, NDArray[np.int64]],
) -> tuple[dict[str, list[int]], dict[str, tuple[str, ...]]]:
    """Cut overlapping sets into parts that do not overlap.

    Returns the parts, and for each set that is not a part itself the parts it consists of. A part has the
    name of the set that it equals; ``A.rest`` is what only A has beside smaller sets, and ``A & B`` is what
    both have.
    """
    holders: dict[int, list[str]] = {}
    by_size = sorted(sets, key=lambda name: len(sets[name]))
    for name in by_size:
        for row in sets[name]:
            holders.setdefault(int(row), []).append(name)
    parts: dict[tuple[str, ...], list[int]] = {}
    for row in sorted(holders):
        parts.setdefault(tuple(holders[row]), []).append(row)
    named: dict[tuple[str, ...], str] = {}
    taken: set[str] = set()
    for key, rows in parts.items():
        equal = [name for name in key if len(sets[name]) == len(rows)]
        if equal:
            named[key] = equal[0]
        else:
            named[key] = f"{key[0]}.rest" if len(key) == 1 else " & ".join(key)
        taken.add(named[key])
    whole = {name: tuple(named[key] for key in parts if name in key) for name in sets if name not in taken}
    order = {name: k for k, name in enumerate(sets)}
    ordered = sorted(parts, key=lambda key: order.get(named[key], len(order)))
    return {named[key]: parts[key] for key in ordered}, whole
