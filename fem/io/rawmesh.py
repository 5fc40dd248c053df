"""The common result of the mesh readers, and its conversion to a :class:`fem.mesh.Mesh`.

A reader gives points, lines and sets as the file has them. Joined here, for all formats alike: quadratic
lines, overlapping sets, points that nothing uses or that coincide. A mesh has up to millions of lines, so
that all of this works on arrays.
"""

import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fem.array_types import Bools, Floats, Ints
from fem.io.faults import error_at, refuse
from fem.mesh import FileNumbers, Mesh, MeshError, MeshWarning, free_name, merge_advice

# Sets of lines as mesh files have them: several, overlapping or empty; members as a model needs them --------


MOST_LISTED = 8
"""Names that a note lists; of more it gives the number."""


@dataclass(frozen=True, slots=True, eq=False)
class LineSets:
    """Sets of lines, one after the other: the number of the set and the line of each entry."""

    names: Sequence[str]
    number: Ints
    line: Ints

    @classmethod
    def of(cls, sets: Mapping[str, ArrayLike]) -> "LineSets":
        """Return the sets of a reader."""
        parts = [np.asarray(rows, dtype=np.int64).ravel() for rows in sets.values()]
        number = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
        line = np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64)
        return cls(list(sets), number, line)

    def over(self, first: Ints, count: Ints) -> "LineSets":
        """Return the sets after line i has become lines ``first[i]`` to ``first[i] + count[i] - 1``."""
        n = count[self.line]
        step = np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n)
        return LineSets(self.names, np.repeat(self.number, n), np.repeat(first[self.line], n) + step)

    def mapping(self) -> dict[str, Ints]:
        """Return the lines of each set by its name."""
        order = np.argsort(self.number, kind="stable")
        ends = np.cumsum(np.bincount(self.number, minlength=len(self.names))).tolist()
        rows = self.line[order]
        return {name: rows[i:j] for name, i, j in zip(self.names, [0, *ends], ends, strict=False)}

    def empty(self) -> list[str]:
        """Return the names of the sets without lines."""
        filled = np.bincount(self.number, minlength=len(self.names)) > 0
        return [name for name, some in zip(self.names, filled.tolist(), strict=True) if not some]

    def disjoint(self, n_lines: int) -> tuple[dict[str, Ints], dict[str, tuple[str, ...]], list[str]]:
        """Cut overlapping sets into parts that do not overlap.

        Returns the parts, the names of the parts of each set that is not a part itself, and the names of
        the parts that several sets share without one of them being the part. A part has the name of the set
        that it equals; ``A.rest`` are the lines in A and in no smaller set, ``A & B`` those in both.
        """
        if not self.line.size:
            return {}, {}, []
        pair = distinct(self.line * max(1, len(self.names)) + self.number)
        line, number = np.divmod(pair, max(1, len(self.names)))
        size = np.bincount(number, minlength=len(self.names))
        part = _parts(line, np.argsort(np.argsort(size, kind="stable"))[number], n_lines)
        used = np.flatnonzero(part >= 0)
        rows = np.split(used[np.argsort(part[used], kind="stable")], np.cumsum(np.bincount(part[used]))[:-1])
        holders = _holders(number, part[line], np.argsort(size, kind="stable"), len(rows))
        named = self._named(holders, [len(r) for r in rows], size)
        place = {name: k for k, name in enumerate(self.names)}
        parts = sorted(range(len(rows)), key=lambda k: place.get(named[k], len(place)))
        parts_of: dict[str, list[str]] = {}
        for k, keys in enumerate(holders):
            for key in keys:
                parts_of.setdefault(self.names[key], []).append(named[k])
        alone = set(named)
        groups = {n: tuple(parts_of[n]) for n in self.names if n in parts_of and n not in alone}
        shared = [named[k] for k in parts if len(holders[k]) > 1 and named[k] not in place]
        return {named[k]: rows[k] for k in parts}, groups, shared

    def _named(self, holders: list[list[int]], n: list[int], size: Ints) -> list[str]:
        taken = set(self.names)
        named: list[str] = []
        for keys, count in zip(holders, n, strict=True):
            equal = next((key for key in keys if size[key] == count), None)
            if equal is not None:
                named.append(self.names[equal])
                continue
            words = [self.names[key] for key in keys]
            word = f"{words[0]}.rest" if len(words) == 1 else " & ".join(words)
            named.append(free_name(word, word, taken))
            taken.add(named[-1])
        return named


def _parts(line: Ints, rank: Ints, n_lines: int) -> Ints:
    """Return for each line which part it is in, by the sets that hold it; -1 for none.

    Parts are numbered in the order of their first lines. ``line`` is sorted.
    """
    count = np.bincount(line, minlength=n_lines)
    start = np.cumsum(count) - count
    code = np.full(n_lines, -1)
    used = 0
    n_sets = int(rank.max(initial=0)) + 1
    for n in np.flatnonzero(np.bincount(count)[1:]) + 1:
        here = np.flatnonzero(count == n)
        sets = np.sort(rank[start[here][:, None] + np.arange(n)], axis=1)
        label = np.zeros(len(here), dtype=np.int64)
        for column in sets.T:
            _, label = np.unique(label * n_sets + column, return_inverse=True)
        code[here] = used + label
        used += int(label.max()) + 1
    in_sets = np.flatnonzero(code >= 0)
    _, first, label = np.unique(code[in_sets], return_index=True, return_inverse=True)
    order = np.empty_like(first)
    order[np.argsort(first)] = np.arange(len(first))
    code[in_sets] = order[label]
    return code


def _holders(number: Ints, part: Ints, by_size: Ints, n_parts: int) -> list[list[int]]:
    """Return the numbers of the sets that hold each part, the smallest first."""
    rank = np.empty_like(by_size)
    rank[by_size] = np.arange(len(by_size))
    key = distinct(part * max(1, len(by_size)) + rank[number])
    of, which = np.divmod(key, max(1, len(by_size)))
    numbers, ends = by_size[which].tolist(), np.cumsum(np.bincount(of, minlength=n_parts)).tolist()
    return [numbers[i:j] for i, j in zip([0, *ends[:-1]], ends, strict=True)]


def distinct(values: Ints) -> Ints:
    """Return the different values in ascending order; sorting takes a tenth of `np.unique`'s hashing."""
    values = np.sort(values)
    return values[np.r_[True, values[1:] != values[:-1]]] if values.size else values


def listed(names: Sequence[str]) -> str:
    """Return names for a note: all of a few, else the first and how many there are."""
    shown = ", ".join(f"'{name}'" for name in names[:MOST_LISTED])
    return shown if len(names) <= MOST_LISTED else f"{shown} and {len(names) - MOST_LISTED} more"


# ------------------------------------------------------------------------------------------------------------


MOST_NAMED = 50
"""Point sets with more points than this give no point names."""

MOST_PAIRS = 20_000_000
"""Pairs of points within the merge tolerance beyond which it joins more than points at one place: 0.3 GB."""

OBLIQUE = np.sqrt([2.0, 3.0, 5.0]) / np.sqrt(10.0)
"""A unit vector along which the points of a frame, whose members are mostly along axes, differ."""


@dataclass(slots=True)
class RawMesh:
    """Lines of a mesh file.

    Attributes
    ----------
    points : (n_points, 3) array, or list of coordinates, three each
    lines : (n_lines, 2) array of point indices; (n_lines, 3), -1 in the last column of those with two; or a
        list of two or three each
    sets, point_sets : name to indices of lines, of points
    point_names : name to the index of a point
    left_out : count of elements that were not read, by type
    notes : further sentences for the warning
    point_numbers, line_numbers : numbers of nodes and elements in the file, for messages
    """

    points: Any = field(default_factory=list)
    lines: Any = field(default_factory=list)
    sets: dict[str, Any] = field(default_factory=dict)
    point_sets: dict[str, Any] = field(default_factory=dict)
    point_names: dict[str, int] = field(default_factory=dict)
    left_out: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)
    point_numbers: Sequence[int] | Ints | None = None
    line_numbers: Sequence[int] | Ints | None = None

    def point(self, row: int) -> str:
        """Return the name of a point in messages."""
        return f"point {row + 1}" if self.point_numbers is None else f"node {int(self.point_numbers[row])}"

    def line(self, row: int) -> str:
        """Return the name of a line in messages."""
        return f"line {row + 1}" if self.line_numbers is None else f"element {int(self.line_numbers[row])}"


def mesh_of(
    raw: RawMesh, file: str, scale: float, merge_tolerance: float | None, free_points: bool = False
) -> Mesh:
    """Make a mesh of a file's content; one warning lists data that were left out or look wrong.

    Points on no line are left out; with ``free_points``, those that have a name are kept.

    The sentences of the warning are the mesh's ``notes``.
    """
    if not len(raw.lines):
        found = ", ".join([*(f"{n} {name}" for name, n in raw.left_out.items()), *raw.notes]) or "no elements"
        raise error_at(file, f"no lines; it has {found}, and a frame needs two-node or three-node lines")
    if not (np.isfinite(scale) and scale > 0):
        refuse(f"the scale is {scale}; it must be positive (0.001 for a file in mm)", MeshError)
    points = np.array(raw.points, dtype=float).reshape(-1, 3)
    chains = _rows_of_three(raw, len(points), file)
    points *= scale
    _check_coordinates(raw, points, chains, file)
    lines, origin = _two_node_lines(points, chains)
    numbers = _numbers_of(raw, points, lines, origin)
    notes = [*raw.notes]
    notes += [f"{n} {name} left out (only lines are read)" for name, n in raw.left_out.items()]
    if len(lines) > len(chains):
        notes.append(f"{len(lines) - len(chains)} quadratic line(s) became two lines each")
    sets = LineSets.of(raw.sets).over(*_first_and_count(origin, len(chains)))
    if empty := sets.empty():
        notes.append(f"sets without lines: {listed(empty)}")
    names = raw.point_names | _point_names(raw.point_sets, notes)
    if merge_tolerance is None:
        notes += coincidences(points, lines)
    else:
        points, lines, names, kept = _merged(points, lines, names, merge_tolerance, notes, file)
        sets = sets.over(*_first_and_count(kept, len(origin)))
        origin = origin[kept]
    _check_lengths(raw, points, lines, origin, file)
    free = list(names.values()) if free_points else []
    points, lines, names = _used(points, lines, names, notes, free)
    notes += _doubles(lines)
    mesh = replace(_built(points, lines, sets, names, file, notes), numbers=numbers)
    if notes:
        warnings.warn(f"{file}: {'; '.join(notes)}", MeshWarning, stacklevel=3)
    return mesh


def _first_and_count(origin: Ints, n: int) -> tuple[Ints, Ints]:
    """Return the first of the rows that come from each of n, and their number; ``origin`` is ascending."""
    count = np.bincount(origin, minlength=n)
    return np.cumsum(count) - count, count


def _numbers_of(raw: RawMesh, points: Floats, lines: Ints, origin: Ints) -> FileNumbers | None:
    """Return the numbers of a file's nodes and elements; None of a file without any."""
    if raw.point_numbers is None or raw.line_numbers is None:
        return None
    nodes, elements = (np.array(n, dtype=np.int64) for n in (raw.point_numbers, raw.line_numbers))
    return FileNumbers(nodes, points, elements[origin], lines)


def _rows_of_three(raw: RawMesh, n_points: int, file: str) -> Ints:
    """Return the points of each line, (n_lines, 3), with -1 for the third of those with two."""
    if isinstance(raw.lines, np.ndarray):
        given = np.asarray(raw.lines, dtype=np.int64)
        count = np.full(len(given), 2) if given.shape[1] == 2 else np.where(given[:, 2] < 0, 2, 3)
        given = given if given.shape[1] == 3 else np.column_stack([given, np.full(len(given), -1)])
    else:
        count = np.fromiter(map(len, raw.lines), dtype=np.int64, count=len(raw.lines))
        given = np.full((len(count), 3), -1)
        flat = np.fromiter(chain.from_iterable(raw.lines), dtype=np.int64, count=int(count.sum()))
        given[np.arange(3) < count[:, None]] = flat
    wrong = (given >= n_points) | (given < 0) & (np.arange(3) < count[:, None])
    if wrong.any():
        row = int(np.flatnonzero(wrong.any(axis=1))[0])
        msg = f"{file}: {raw.line(row)} refers to a point that is not among the {n_points} points of the file"
        raise MeshError(msg)
    return given


def _check_coordinates(raw: RawMesh, points: Floats, chains: Ints, file: str) -> None:
    """Refuse coordinates without a finite square; those of points on no line do not matter."""
    bad = np.flatnonzero(~_near(points))
    if not bad.size:
        return
    used = np.zeros(len(points), dtype=bool)
    used[chains[chains >= 0]] = True
    row = int(bad[used[bad]][0]) if used[bad].any() else int(bad[0])
    xyz = ", ".join(f"{x:g}" for x in points[row])
    if not used[row]:
        raw.notes.append(f"{raw.point(row)}, on no line, is at {xyz}")
    elif np.isfinite(points[row]).all():
        raise error_at(file, f"{raw.point(row)} is so far away, at {xyz} m, that lengths overflow")
    else:
        raise error_at(file, f"{raw.point(row)} has the coordinates {xyz}; they must be finite numbers")


def _near(points: Floats) -> Bools:
    """Tell which points have distances that are finite numbers."""
    return (np.abs(points) < np.sqrt(np.finfo(float).max) / 4).all(axis=1)


def _check_lengths(raw: RawMesh, points: Floats, lines: Ints, origin: Ints, file: str) -> None:
    """Refuse lines without length by their numbers in the file, before points are renumbered."""
    length = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
    size = float(np.ptp(points[distinct(lines.ravel())], axis=0).max())
    short = np.flatnonzero(length <= 1e-9 * size)
    if short.size:
        row = int(short[0])
        a, b = (raw.point(int(k)) for k in lines[row])
        others = f", as have {short.size - 1} more" if short.size > 1 else ""
        msg = (
            f"{file}: {raw.line(int(origin[row]))}, from {a} to {b}, has no length{others}; delete it, or "
            f"give merge_tolerance, such as {max(1e-6 * size, 1e-12):.1g} [m], which leaves such lines out"
        )
        raise MeshError(msg)


def _two_node_lines(points: Floats, chains: Ints) -> tuple[Ints, Ints]:
    """Return two-node lines and the line of the file that each comes from.

    Of three nodes, the one that is not an end of the longest distance is the middle one, whatever the
    format's order.
    """
    three = np.flatnonzero(chains[:, 2] >= 0)
    if not three.size:
        return chains[:, :2].copy(), np.arange(len(chains))
    nodes = chains[three]
    a, b, c = (points[nodes[:, k]] for k in range(3))
    apart = [np.linalg.norm(v, axis=1) for v in (b - c, c - a, a - b)]
    middle = np.argmax(apart, axis=0)
    first, last = np.where(middle == 0, 1, 0), np.where(middle == 2, 1, 2)
    row = np.arange(len(three))
    first, middle, last = nodes[row, first], nodes[row, middle], nodes[row, last]
    origin = np.repeat(np.arange(len(chains)), np.where(chains[:, 2] >= 0, 2, 1))
    lines = chains[origin][:, :2]
    start = np.searchsorted(origin, three)
    lines[start] = np.column_stack([first, middle])
    lines[start + 1] = np.column_stack([middle, last])
    return lines, origin


def _point_names(sets: Mapping[str, ArrayLike], notes: list[str]) -> dict[str, int]:
    """Name points by their sets: ``base`` for a single one, ``base.1``, ``base.2``, … for several."""
    members = {name: _distinct(rows) for name, rows in sets.items()}
    names = {name: rows[0] for name, rows in members.items() if len(rows) == 1}
    lost = [name for name, rows in members.items() if len(rows) > MOST_NAMED]
    empty = [name for name, rows in members.items() if not rows]
    twice: list[str] = []
    for name, rows in members.items():
        if 1 < len(rows) <= MOST_NAMED:
            parts = {f"{name}.{k}": index for k, index in enumerate(rows, start=1)}
            twice += parts.keys() & names.keys()
            names = parts | names  # a set's own name is kept
    if lost:
        notes.append(f"point sets of more than {MOST_NAMED} points give no names: {listed(lost)}")
    if empty:
        notes.append(f"point sets without points: {listed(empty)}")
    if twice:
        notes.append(f"two point sets give these names, which the first keeps: {listed(sorted(twice))}")
    return names


def _distinct(rows: ArrayLike) -> list[int]:
    """Return each index once, in the order of the set."""
    rows = np.asarray(rows, dtype=np.int64).ravel()
    _, first = np.unique(rows, return_index=True)
    return rows[np.sort(first)].tolist()


def _pairs(points: Floats, reach: float) -> Ints | None:
    """Return the pairs of points within a distance, (n_pairs, 2); None for more than ``MOST_PAIRS``."""
    some = np.flatnonzero(_near(points))
    # along an oblique line few points of a frame are as near as that, and mostly none
    along = points[some] @ OBLIQUE
    order = np.argsort(along)
    close = np.diff(along[order]) <= reach + 1e-12 * np.abs(along).max(initial=0.0)  # rounding of sums
    some = np.sort(some[order[np.append(close, False) | np.append(False, close)]])
    if not some.size:
        return np.zeros((0, 2), dtype=np.int64)
    tree = scipy.spatial.cKDTree(points[some], balanced_tree=False, compact_nodes=False)
    if tree.count_neighbors(tree, reach) - some.size > 2 * MOST_PAIRS:
        return None
    return some[tree.query_pairs(reach, output_type="ndarray")]


def coincidences(points: Floats, lines: Ints, ties: Ints | None = None) -> list[str]:
    """Return a note with the number of points that lie at the place of others.

    Parameters
    ----------
    points : ndarray (n_points, 3)
    lines : ndarray (n_lines, 2)
    ties : ndarray (n_ties, 2), optional
        Pairs of points that are connected otherwise than by lines, and do not count.
    """
    numbers = distinct(lines.ravel())
    used = points[numbers]
    reach = 1e-6 * float(np.ptp(used, axis=0).max(initial=0.0))
    if not reach:
        return []
    pairs = _pairs(used, reach)
    if pairs is None:
        return [
            f"more than {MOST_PAIRS // 10**6} million pairs of points lie within {reach:.2g} m of "
            "each other, which is 1e-6 of the mesh's size; is a point far off, or do many lie at one place?"
        ]
    if ties is not None:
        weights = np.array([len(points), 1])
        ends, known = (np.sort(each, axis=1) @ weights for each in (numbers[pairs], ties))
        pairs = pairs[~np.isin(ends, known)]
    n = distinct(pairs[:, 1]).size
    if not n:
        return []
    return [
        f"{n} point{'s lie' if n > 1 else ' lies'} at the place of another and {'are' if n > 1 else 'is'} "
        f"not connected with it; {merge_advice(reach)}"
    ]


def _merged(
    points: Floats, lines: Ints, names: dict[str, int], tolerance: float, notes: list[str], file: str
) -> tuple[Floats, Ints, dict[str, int], Ints]:
    """Join points nearer than a tolerance; return also which lines are left."""
    if not (np.isfinite(tolerance) and tolerance >= 0):
        refuse(f"the merge tolerance is {tolerance}; it must be a length that is not negative [m]", MeshError)
    pairs, n = _pairs(points, tolerance), len(points)
    if pairs is None:
        msg = (
            f"{file}: the merge tolerance of {tolerance:g} m would join more than {MOST_PAIRS // 10**6} "
            "million pairs of points; give one that is shorter than every line"
        )
        raise MeshError(msg)
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, cluster = connected_components(links, directed=False)
    _, first, which = np.unique(cluster, return_index=True, return_inverse=True)
    to = first[which]
    if (to != np.arange(n)).any():
        notes.append(f"{int((to != np.arange(n)).sum())} points merged with others within {tolerance:g} m")
    lines = to[lines]
    kept = np.flatnonzero(lines[:, 0] != lines[:, 1])
    if not kept.size:
        msg = f"{file}: the merge tolerance of {tolerance:g} m is longer than every line; give a shorter one"
        raise MeshError(msg)
    if kept.size < len(lines):
        notes.append(f"{len(lines) - kept.size} lines shorter than the merge tolerance left out")
    return points, lines[kept], {name: int(to[k]) for name, k in names.items()}, kept


def _used(
    points: Floats, lines: Ints, names: dict[str, int], notes: list[str], free: Sequence[int]
) -> tuple[Floats, Ints, dict[str, int]]:
    """Leave out points on no line but for some that are free; the others keep their order."""
    used = distinct(np.append(lines.ravel(), np.array(free, dtype=np.int64)))
    to = np.full(len(points), -1)
    to[used] = np.arange(used.size)
    lost = [name for name, k in names.items() if to[k] < 0]
    if used.size < len(points):
        n = len(points) - used.size
        count = f"{n} points on no line are" if n > 1 else "1 point on no line is"
        named = f"; left out with {'their names' if n > 1 else 'its name'}: {listed(lost)}" if lost else ""
        notes.append(f"{count} left out, and the others are renumbered in their order{named}")
    return points[used], to[lines], {name: int(to[k]) for name, k in names.items() if to[k] >= 0}


def _doubles(lines: Ints) -> list[str]:
    ends = np.sort(lines, axis=1)
    n = len(lines) - len(distinct(ends[:, 0] * (int(lines.max()) + 1) + ends[:, 1]))
    return [f"{n} lines join the same two points as another line"] if n else []


def _built(
    points: Floats, lines: Ints, sets: LineSets, names: Mapping[str, int], file: str, notes: list[str]
) -> Mesh:
    cells, parts_of, shared = sets.disjoint(len(lines))
    if shared:
        notes.append(f"sets overlap; lines that several share are separate members: {listed(shared)}")
    try:
        mesh = Mesh.from_lines(points, lines, cells, names, [f"{file}: {note}" for note in notes])
    except MeshError as reason:
        raise error_at(file, f"{reason}") from reason
    if not parts_of:
        return mesh
    groups = dict(mesh.groups)
    for name, parts in parts_of.items():
        groups[name] = tuple(member for part in parts for member in mesh.members_of(part))
    return replace(mesh, groups=MappingProxyType(groups))
