"""Points, elements, trace lines and groups of a universal file as lines of a mesh."""

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from fem.array_types import Ints
from fem.io.faults import error_at
from fem.io.rawmesh import RawMesh
from fem.io.uff_elements import BEAMS, ENTITIES, Elements, UffGroup
from fem.io.uff_format import UffError
from fem.io.uff_types import Points, TraceLine

_FAMILIES: tuple[tuple[range, str], ...] = (
    (range(41, 90), "plane elements"),
    (range(90, 100), "shell elements"),
    (range(101, 120), "solid elements"),
    (range(121, 123), "rigid elements"),
    (range(136, 142), "springs and dampers"),
    (range(161, 162), "lumped masses"),
)
"""Descriptors of dataset 2412 that are no lines, in words."""


def raw_mesh_of(
    file: str,
    points: Points | None,
    elements: Elements,
    trace_lines: Sequence[TraceLine],
    groups: Sequence[UffGroup],
    notes: Sequence[str] = (),
) -> RawMesh:
    """Return rods and beams, or else trace lines, with the sets of trace lines, groups and properties."""
    if points is None:
        raise error_at(file, "no points (dataset 15, 781 or 2411)", UffError)
    raw = RawMesh(notes=list(notes))
    beams = np.flatnonzero(np.isin(elements.descriptor, BEAMS))
    for descriptor, n in zip(
        *np.unique(np.delete(elements.descriptor, beams), return_counts=True), strict=True
    ):
        family = next((word for known, word in _FAMILIES if descriptor in known), "elements")
        raw.left_out[f"{family} of type {descriptor}"] = int(n)
    trace_lines = tuple(named_apart(trace_lines))
    traced = [pair for t in trace_lines for s in t.strokes for pair in pairwise(s)]
    if beams.size:
        ends, owner = _chains_of(elements, beams)
        rows = _rows_of(file, points, ends, elements.number[owner], elements.line[owner])
        number = elements.number[owner]
    elif traced:
        first: dict[tuple[int, int], tuple[int, int]] = {}
        for a, b in traced:
            first.setdefault((min(a, b), max(a, b)), (a, b))
        ends = np.array([(a, b, -1) for a, b in first.values()], dtype=np.int64)
        rows = _rows_of(file, points, ends, None, None)
        number = owner = np.full(len(ends), -1)
    else:
        msg = f"{file}: no lines; none of its {len(elements)} elements is a beam and there are no trace lines"
        raise UffError(msg)
    lines = _Lines(rows, owner, number, points.labels.size)
    _add_sets(raw, points, elements, lines, trace_lines, groups, bool(beams.size))
    _add_points(raw, points, rows)
    return raw


def _add_points(raw: RawMesh, points: Points, rows: Ints) -> None:
    """Add lines, and the points that are on one or in a group; those of a test's sensors may be on none."""
    used = np.zeros(points.labels.size, dtype=bool)
    used[rows[rows >= 0]] = True
    kept = used.copy()
    for members in raw.point_sets.values():
        kept[members] = True
    to = np.where(kept, np.cumsum(kept) - 1, -1)
    coordinates: Any = points.coordinates[kept]
    raw.points = coordinates
    raw.lines = np.where(rows >= 0, to[rows], -1)
    labels = points.labels[used]
    raw.point_names = dict(zip(map(str, labels.tolist()), to[used].tolist(), strict=True))
    raw.point_sets = {name: to[members] for name, members in raw.point_sets.items()}
    raw.point_numbers = points.labels[kept]


class _Lines:
    """Lines by the rows of their points (n, 3), and the rows and numbers of their elements."""

    def __init__(self, rows: Ints, owner: Ints, number: Ints, n_points: int) -> None:
        self.rows, self.owner, self.number, self.n_points = rows, owner, number, n_points
        steps = [rows[:, :2], *([rows[rows[:, 2] >= 0][:, 1:]] if (rows[:, 2] >= 0).any() else [])]
        of = [np.arange(len(rows)), *([np.flatnonzero(rows[:, 2] >= 0)] if len(steps) > 1 else [])]
        key = np.concatenate([self._keys(step) for step in steps])
        order = np.argsort(key, kind="stable")
        self._key, self._line = key[order], np.concatenate(of)[order]

    def _keys(self, pairs: Ints) -> Ints:
        return pairs.min(axis=1) * self.n_points + pairs.max(axis=1)

    def joining(self, pairs: Ints) -> Ints:
        """Return the lines that join the same points as pairs of rows (n, 2), in the order of the pairs."""
        if not len(pairs):
            return np.zeros(0, dtype=np.int64)
        key = self._keys(pairs)
        start, end = (np.searchsorted(self._key, key, side=side) for side in ("left", "right"))
        n = end - start
        at = np.repeat(start - (np.cumsum(n) - n), n) + np.arange(n.sum())
        return np.array(list(dict.fromkeys(self._line[at].tolist())), dtype=np.int64)


def _chains_of(elements: Elements, beams: Ints) -> tuple[Ints, Ints]:
    """Return lines of two or three nodes, (n, 3) with -1 for none, and the row of the element of each."""
    count = np.diff(elements.first)[beams]
    first = elements.first[beams]
    few = count <= 3
    ends = np.full((int(few.sum()), 3), -1)
    for k in range(3):
        has = count[few] > k
        ends[has, k] = elements.nodes[first[few][has] + k]
    many = [
        (pair, row)
        for row, a, n in zip(beams[~few].tolist(), first[~few].tolist(), count[~few].tolist(), strict=True)
        for pair in pairwise(elements.nodes[a : a + n].tolist())
    ]
    extra = np.array([(*pair, -1) for pair, _ in many], dtype=np.int64).reshape(-1, 3)
    owner = np.concatenate([beams[few], np.array([row for _, row in many], dtype=np.int64)])
    order = np.argsort(owner, kind="stable")
    return np.concatenate([ends, extra])[order], owner[order]


def _rows_of(file: str, points: Points, ends: Ints, number: Ints | None, line: Ints | None) -> Ints:
    """Return the rows of the points of lines; -1 stays."""
    at, there = points.rows_of(ends)
    given = np.ones_like(ends, dtype=bool)
    given[:, 2] = ends[:, 2] != -1
    lost = given & ~there
    if lost.any():
        k, column = (int(i) for i in np.argwhere(lost)[0])
        what = "a trace line" if number is None or line is None else f"element {number[k]} at line {line[k]}"
        node = int(ends[k, column])
        found = "has one node only" if node == -1 else f"refers to node {node}"
        msg = f"{file}: {what} {found}, which is not among the {points.labels.size} points of the file"
        raise UffError(msg)
    return np.where(given, at, -1)


def _add_sets(
    raw: RawMesh,
    points: Points,
    elements: Elements,
    lines: _Lines,
    trace_lines: Sequence[TraceLine],
    groups: Sequence[UffGroup],
    from_elements: bool,
) -> None:
    """Add the sets of lines and of points: of trace lines, of groups, and of properties for the rest."""
    sets: dict[str, Ints] = {}
    free = np.ones(len(lines.rows), dtype=bool)
    by_number: dict[int, Ints] = {}
    for trace, pairs in zip(trace_lines, _pairs_of(trace_lines, points, raw), strict=True):
        found = lines.joining(pairs)
        by_number[trace.number] = found
        free_lines = found[free[found]]
        if free_lines.size:
            sets[trace.name] = free_lines
            free[free_lines] = False
    for group in groups:
        rows = _lines_of(group, elements, lines, by_number, raw)
        nodes = _nodes_of(group, points, raw)
        if rows.size:
            sets[_free_name(group, sets, rows, raw)] = rows
            free[rows] = False
        if len(nodes):
            name = group.name
            while name in raw.point_sets or _is_node(name, points):
                name = f"group {name}" if name == group.name else f"{name}'"
            if name != group.name:
                raw.notes.append(
                    f"group '{group.name}' ({group.place}) has the name of a node or of another group of "
                    f"nodes: its points are named '{name}'"
                )
            raw.point_sets[name] = nodes.tolist()
        if not rows.size and not len(nodes):
            raw.notes.append(f"group '{group.name}' ({group.place}) has no lines and no points")
    if from_elements:
        rest = np.flatnonzero(free)
        table = elements.property[lines.owner[rest]]
        for number in np.unique(table).tolist():
            name = f"property {number}"
            sets[name if name not in sets else f"{name} (rest)"] = rest[table == number]
    raw.sets = {name: rows.tolist() for name, rows in sets.items() if rows.size}


def _pairs_of(traces: Sequence[TraceLine], points: Points, raw: RawMesh) -> list[Ints]:
    """Return the rows of the points of each trace line's steps (n, 2), those of nodes that are there."""
    pairs = [[pair for s in t.strokes for pair in pairwise(s)] for t in traces]
    ends = np.array([pair for one in pairs for pair in one], dtype=np.int64).reshape(-1, 2)
    at, there = points.rows_of(ends)
    out: list[Ints] = []
    start = 0
    for trace, one in zip(traces, pairs, strict=True):
        part = slice(start, start + len(one))
        start += len(one)
        if not there[part].all():
            raw.notes.append(
                f"trace line '{trace.name}' goes through node {ends[part][~there[part]][0]}, which the file "
                "does not have"
            )
        out.append(at[part][there[part].all(axis=1)])
    return out


def _is_node(name: str, points: Points) -> bool:
    """Tell whether a name is the number of a node."""
    return name.isascii() and name.isdigit() and len(name) <= 18 and bool((points.labels == int(name)).any())


def _nodes_of(group: UffGroup, points: Points, raw: RawMesh) -> Ints:
    """Return the rows of the nodes of a group."""
    wanted = np.array(group.members.get(7, ()), dtype=np.int64)
    if not wanted.size:
        return wanted
    at, there = points.rows_of(wanted)
    if not there.all():
        raw.notes.append(
            f"group '{group.name}' ({group.place}) names {np.count_nonzero(~there)} node(s) that the file "
            f"does not have, the first {wanted[~there][0]}"
        )
    return at[there]


def _lines_of(
    group: UffGroup, elements: Elements, lines: _Lines, by_number: Mapping[int, Ints], raw: RawMesh
) -> Ints:
    """Return the lines of a group."""
    wanted = np.array(sorted(set(group.members.get(8, ()))), dtype=np.int64)
    rows = np.flatnonzero(np.isin(lines.number, wanted)) if wanted.size else np.zeros(0, dtype=np.int64)
    unknown = wanted[~np.isin(wanted, elements.number)]
    if unknown.size:
        raw.notes.append(
            f"group '{group.name}' ({group.place}) names {unknown.size} element(s) that the file does not "
            f"have, the first {unknown[0]}"
        )
    others = wanted.size - unknown.size - np.isin(wanted, lines.number).sum()
    if others and rows.size:
        raw.notes.append(f"group '{group.name}' ({group.place}): {others} of its elements are no lines")
    traces = [by_number[n] for n in group.members.get(27, ()) if n in by_number]
    foreign = {code: len(labels) for code, labels in group.members.items() if code not in ENTITIES}
    if foreign:
        words = ", ".join(f"{n} of type {code}" for code, n in sorted(foreign.items()))
        raw.notes.append(
            f"group '{group.name}' ({group.place}): entities other than nodes, elements and trace lines are "
            f"left out: {words}"
        )
    return np.unique(np.concatenate([rows, *traces])) if traces else rows


def _free_name(group: UffGroup, sets: Mapping[str, Ints], rows: Ints, raw: RawMesh) -> str:
    """Return the group's name, with its number where another set of other lines has the name."""
    name = group.name or f"group {group.number}"
    if name not in sets or np.array_equal(np.sort(sets[name]), rows):
        return name
    other = f"{name} {group.number}"
    while other in sets:
        other += "'"
    raw.notes.append(
        f"group '{name}' ({group.place}) has the name of another set of other lines: it is named '{other}'"
    )
    return other


def named_apart(traces: Sequence[TraceLine]) -> list[TraceLine]:
    """Tell trace lines of the same name apart by their numbers."""
    names = Counter(t.name for t in traces)
    return [
        t if names[t.name] == 1 else TraceLine(t.number, f"{t.name} {t.number}", t.strokes) for t in traces
    ]
