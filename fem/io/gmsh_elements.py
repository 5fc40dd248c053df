"""Nodes, elements and entities of Gmsh files: one reader for each format, text and binary alike."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from fem.array_types import Floats, Ints
from fem.io.gmsh_sections import Bytes, MshFile, Words

_LINES = {1: 2, 8: 3, 26: 4, 27: 5, 28: 6, 62: 7, 63: 8, 64: 9, 65: 10, 66: 11}
"""Nodes of lines of order 1 to 10, by Gmsh's element type: the two ends, then those between in order."""

_POINT = 15

_OTHERS = {
    "triangles": {2: 3, 9: 6, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21},
    "quadrangles": {3: 4, 10: 9, 16: 8, 36: 16, 37: 25, 38: 36, 39: 12, 40: 16, 41: 20},
    "tetrahedra": {4: 4, 11: 10, 29: 20, 30: 35, 31: 56},
    "hexahedra": {5: 8, 12: 27, 17: 20, 92: 64, 93: 125},
    "prisms": {6: 6, 13: 18, 18: 15, 90: 40, 91: 75},
    "pyramids": {7: 5, 14: 14, 19: 13},
}
_NAMES = {kind: name for name, kinds in _OTHERS.items() for kind in kinds}
_NODES = {**_LINES, _POINT: 1, **{kind: n for kinds in _OTHERS.values() for kind, n in kinds.items()}}


@dataclass(slots=True)
class GmshNodes:
    """Nodes in the order of the file.

    Attributes
    ----------
    number : ndarray (n,)
    xyz : ndarray (n, 3)
    at : ndarray (n,), where each is in its section, for ``where``
    where : callable, gives the line or byte
    on_points : list of (tag, ndarray), numbers of the nodes on each point of the geometry, in format 4
    """

    number: Ints
    xyz: Floats
    at: Ints
    where: Callable[[int], str]
    on_points: list[tuple[int, Ints]] = field(default_factory=list)

    def place(self, row: int) -> str:
        """Return the line or byte of a node."""
        return self.where(int(self.at[row]))

    def keep(self, rows: Ints) -> "GmshNodes":
        """Return some of the nodes."""
        return GmshNodes(self.number[rows], self.xyz[rows], self.at[rows], self.where, self.on_points)

    def rows(self, numbers: Ints) -> Ints:
        """Return the rows of nodes by their numbers, -1 for numbers that are not there."""
        n = len(self.number)
        if not n:
            return np.full(numbers.shape, -1)
        if self.number[0] == 1 and (np.diff(self.number) == 1).all():
            return np.where((numbers > 0) & (numbers <= n), numbers - 1, -1)
        order = np.argsort(self.number, kind="stable")
        at = order[np.minimum(np.searchsorted(self.number, numbers, sorter=order), n - 1)]
        return np.where(self.number[at] == numbers, at, -1)


@dataclass(slots=True)
class GmshLines:
    """Elements that are lines, in the order of the file.

    Attributes
    ----------
    number : ndarray (n,)
    nodes : ndarray (n, k), node numbers along the line, -1 beyond its last
    entity, group : ndarray (n,), tag of the curve, and in formats 1 and 2 the physical tag, 0 for none
    at : ndarray (n,), where each is in its section, for ``where``
    where : callable, gives the line or byte
    points : list of (tag, ndarray)
        Node numbers of point elements, by physical tag in formats 1 and 2, by entity in format 4.
    """

    number: Ints
    nodes: Ints
    entity: Ints
    group: Ints
    at: Ints
    where: Callable[[int], str]
    points: list[tuple[int, Ints]] = field(default_factory=list)

    @classmethod
    def of(cls, parts: "list[_Part]", where: Callable[[int], str]) -> "GmshLines":
        """Return the lines and points of all parts in the order of the file."""
        lines = [part for part in parts if part.kind in _LINES]
        k = max((part.nodes.shape[1] for part in lines), default=2)
        nodes = [_along(part.nodes, k) for part in lines] or [np.zeros((0, 2), dtype=np.int64)]
        none = [np.zeros(0, dtype=np.int64)]
        columns = [
            np.concatenate([getattr(part, name) for part in lines] or none)
            for name in ("number", "entity", "group", "at")
        ]
        order = np.argsort(columns[-1], kind="stable")
        number, entity, group, at = (column[order] for column in columns)
        points: list[tuple[int, Ints]] = []
        for part in parts:
            if part.kind == _POINT:
                tag = part.group if part.by_group else part.entity
                points += [(int(t), part.nodes[tag == t, 0]) for t in np.unique(tag)]
        return cls(number, np.concatenate(nodes)[order], entity, group, at, where, points)

    def place(self, row: int) -> str:
        """Return the line or byte of an element."""
        return self.where(int(self.at[row]))

    def reverse(self, rows: Ints) -> None:
        """Turn lines round."""
        count = (self.nodes[rows] >= 0).sum(axis=1)
        for n in np.unique(count).tolist():
            some = rows[count == n]
            self.nodes[some, :n] = self.nodes[some, :n][:, ::-1]

    def keep(self, rows: Ints) -> Ints:
        """Keep some of the lines; return the new row of each old one."""
        to = np.full(len(self.number), -1)
        to[rows] = np.arange(len(rows))
        for name in ("number", "nodes", "entity", "group", "at"):
            setattr(self, name, getattr(self, name)[rows])
        return to

    def first_of_each(self) -> Ints:
        """Return for each element the first that has its nodes, and its curve or its number."""
        first = np.arange(len(self.number))
        code = row_codes(np.sort(self.nodes, axis=1))
        if code.max(initial=-1) + 1 == len(code):
            return first
        for tag in (self.entity, self.number):
            pair = row_codes(np.column_stack([code, tag]))
            _, at = np.unique(pair, return_index=True)
            first = np.minimum(first, first[at[pair]])
        return first[first]


def row_codes(rows: Ints) -> Ints:
    """Return a number for each row, from 0, the same for equal rows."""
    order = np.lexsort(rows.T)
    new = np.r_[False, (rows[order][1:] != rows[order][:-1]).any(axis=1)]
    code = np.empty(len(rows), dtype=np.int64)
    code[order] = np.cumsum(new[: len(rows)])
    return code


def _along(nodes: Ints, k: int) -> Ints:
    """Return nodes in order along the line, in k columns."""
    out = np.full((len(nodes), k), -1)
    out[:, : nodes.shape[1]] = nodes[:, [0, *range(2, nodes.shape[1]), 1]]
    return out


@dataclass(slots=True)
class _Part:
    """Elements of one type."""

    kind: int
    number: Ints
    nodes: Ints
    entity: Ints
    group: Ints
    at: Ints
    by_group: bool


def _count_others(left_out: Counter[str], kind: int, n: int) -> None:
    if n:
        left_out[_NAMES.get(kind, f"elements of type {kind}")] += n


# Formats 1 and 2 --------------------------------------------------------------------------------------------


def read_nodes_1_and_2(file: MshFile) -> GmshNodes:
    """Read one node a line; those with parameters on a curve or surface have more numbers."""
    names = ("NOD", "ParametricNodes") if file.version == "1" else ("Nodes", "ParametricNodes")
    section = next(s for name in names if (s := file.section(name)))
    if file.binary:
        source = Bytes(file, section)
        if section.name == "ParametricNodes":
            source.refuse("in binary form it is not read; save the file as text or in format 4.1")
        n = source.text_count()
        at = source.at + 28 * np.arange(min(n, len(file.data)))
        found = source.take([("number", f"{file.order}i4"), ("xyz", f"{file.order}f8", 3)], n)
        source.finish()
        return GmshNodes(found["number"].astype(np.int64), found["xyz"].astype(float), at, source.place)
    words = Words(file, section)
    first, count = _records(words, "nodes")
    wrong = count < 4 if section.name == "ParametricNodes" else count != 4
    if wrong.any():
        k = int(np.argmax(wrong))
        words.refuse(f"{count[k]} numbers, where a node has its number, x, y, z", int(first[k]))
    words.at = 0
    number = words.integers(first)
    return GmshNodes(number, words.values[first[:, None] + [1, 2, 3]], first, words.place)


def _records(words: Words, what: str) -> tuple[Ints, Ints]:
    """Return the first number of each line after that with the count, and how many numbers it has."""
    line = words.line
    start = np.flatnonzero(np.diff(line, prepend=-1))
    count = np.diff(np.append(start, len(line)))
    if not len(start) or count[0] != 1:
        words.refuse(f"the number of {what} is expected alone on the first line", 0)
    n = int(words.integers(start[:1])[0])
    if n != len(start) - 1:
        words.refuse(f"{n} {what} are announced, and {len(start) - 1} are there", 0)
    return start[1:], count[1:]


def read_elements_1_and_2(file: MshFile, left_out: Counter[str]) -> GmshLines:
    """Read one element a line, or blocks of a type in binary form."""
    section = file.section("ELM" if file.version == "1" else "Elements")
    assert section is not None
    if file.binary:
        return _binary_elements_2(Bytes(file, section), left_out)
    words = Words(file, section, np.int64)
    first, count = _records(words, "elements")
    short = count < (5 if file.version == "1" else 3)
    if short.any():
        words.refuse(
            f"{count[np.argmax(short)]} number(s) are too few for an element", int(first[np.argmax(short)])
        )
    v, kind = words.values, words.values[first + 1]
    if file.version == "1":
        group, entity, skip = v[first + 2], v[first + 3], np.full(len(first), 5)
    else:
        n_tags = v[first + 2]
        skip = 3 + n_tags
        wrong = (n_tags < 0) | (skip > count)
        if wrong.any():
            k = int(np.argmax(wrong))
            words.refuse(
                f"{n_tags[k]} tags are announced, and {count[k] - 3} numbers are left", int(first[k])
            )
        group = np.where(n_tags > 0, v[np.minimum(first + 3, len(v) - 1)], 0)
        entity = np.where(n_tags > 1, v[np.minimum(first + 4, len(v) - 1)], 0)
    parts: list[_Part] = []
    for k in np.unique(kind).tolist():
        rows = np.flatnonzero(kind == k)
        n = _NODES.get(k)
        wrong = (count - skip)[rows] != n
        if n is not None and wrong.any():
            row = int(rows[np.argmax(wrong)])
            reason = (
                f"element {v[first[row]]} of type {k} has {count[row] - skip[row]} nodes; {n} are expected"
            )
            words.refuse(reason, int(first[row]))
        if k not in _LINES and k != _POINT:
            _count_others(left_out, k, len(rows))
            continue
        nodes = v[(first + skip)[rows][:, None] + np.arange(n or 0)]
        parts.append(_Part(k, v[first[rows]], nodes, entity[rows], group[rows], first[rows], True))
    return GmshLines.of(parts, words.place)


def _binary_elements_2(source: Bytes, left_out: Counter[str]) -> GmshLines:
    announced, read = source.text_count(), 0
    parts: list[_Part] = []
    while read < announced:
        kind, n, n_tags = source.ints(3).tolist()
        if kind not in _NODES:
            source.refuse(f"elements of type {kind}, whose length is not known; save the file as text")
        if n < 1 or n_tags < 0:
            source.refuse(f"{n} elements with {n_tags} tags are announced")
        width, begin = 1 + n_tags + _NODES[kind], source.at
        rows = source.ints(n * width).reshape(n, width)
        read += n
        if kind not in _LINES and kind != _POINT:
            _count_others(left_out, kind, n)
            continue
        none = np.zeros(n, dtype=np.int64)
        parts.append(
            _Part(
                kind,
                rows[:, 0],
                rows[:, 1 + n_tags :],
                rows[:, 2] if n_tags > 1 else none,
                rows[:, 1] if n_tags else none,
                begin + 4 * width * np.arange(n),
                True,
            )
        )
    if read != announced:
        source.refuse(f"{announced} elements are announced, and {read} are there")
    source.finish()
    return GmshLines.of(parts, source.place)


# Format 4 ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Entity:
    """A point or curve of the geometry: the tag of the curve that it is a part of, and its groups."""

    curve: int
    groups: tuple[int, ...]


def _source(file: MshFile, name: str, integers: bool = False) -> Words | Bytes | None:
    section = file.section(name)
    if section is None:
        return None
    return Bytes(file, section) if file.binary else Words(file, section, np.int64 if integers else float)


def read_entities(file: MshFile) -> dict[tuple[int, int], Entity]:
    """Read the physical groups of points and curves, by dimension and tag; a part has those of its parent."""
    found: dict[tuple[int, int], Entity] = {}
    source = _source(file, "Entities")
    if source is not None:
        _entities(source, file.version, found, False)
    source = _source(file, "PartitionedEntities")
    if source is not None:
        source.sizes(1)
        source.ints(2 * int(source.sizes(1)[0]))  # ghosts: parts of other partitions, kept twice
        _entities(source, file.version, found, True)
    return found


def _entities(source: Words | Bytes, version: str, found: dict[tuple[int, int], Entity], parts: bool) -> None:
    counts = source.sizes(4).tolist()
    for dimension, count in enumerate(counts):
        for _ in range(count):
            tag = int(source.ints(1)[0])
            parent = source.ints(2).tolist() if parts else [-1, 0]
            if parts:
                source.ints(int(source.sizes(1)[0]))
            source.reals(3 if dimension == 0 and version == "4.1" else 6)
            tags = source.ints(int(source.sizes(1)[0])).tolist()
            if dimension:
                source.ints(int(source.sizes(1)[0]))
            origin = found.get((dimension, parent[1])) if parent[0] == dimension else None
            groups = tuple(dict.fromkeys([*tags, *(origin.groups if origin else ())]))
            if dimension < 2:
                name = parent[1] if parent[0] == dimension and parent[1] > 0 else tag
                found[dimension, tag] = Entity(origin.curve if origin else name, groups)
    source.finish()


def _header(source: Words | Bytes, file: MshFile) -> tuple[int, int]:
    """Return the number of blocks and of their entries."""
    n_blocks, n, *_ = source.sizes(2 if file.version in ("4", "4.0") else 4).tolist()
    return n_blocks, n


def _block(source: Words | Bytes, file: MshFile) -> tuple[int, int, int, int]:
    """Return the dimension and tag of a block's entity, its type or whether parametric, and its length."""
    dimension, tag, kind = source.ints(3).tolist()
    if file.version in ("4", "4.0"):
        dimension, tag = tag, dimension
    return dimension, tag, kind, int(source.sizes(1)[0])


def read_nodes_4(file: MshFile) -> GmshNodes:
    """Read blocks of nodes: numbers, then coordinates; in format 4.0 both in one line."""
    source = _source(file, "Nodes")
    assert source is not None
    n_blocks, announced = _header(source, file)
    none = np.zeros(0, dtype=np.int64)
    numbers, xyz, at = [none], [np.zeros((0, 3))], [none]
    on_points: list[tuple[int, Ints]] = []
    for _ in range(n_blocks):
        dimension, tag, parametric, n = _block(source, file)
        if not 0 <= dimension <= 3:
            source.refuse(f"a block of nodes has the dimension {dimension}; 0 to 3 are allowed")
        width = 3 + (dimension if parametric else 0)
        if file.version == "4.1":
            numbers.append(source.sizes(n))
            begin = source.at
            _, rows = source.rows(n, 0, width)
        else:
            begin, (tags, rows) = source.at, source.rows(n, 1, width)
            numbers.append(tags[:, 0])
        at.append(begin + (source.at - begin) // max(n, 1) * np.arange(n))
        xyz.append(rows[:, :3])
        if dimension == 0:
            on_points.append((tag, numbers[-1]))
    found = np.concatenate(numbers)
    _check_total(source, announced, len(found), "nodes")
    return GmshNodes(found, np.concatenate(xyz), np.concatenate(at), source.place, on_points)


def _check_total(source: Words | Bytes, announced: int, n: int, what: str) -> None:
    source.finish()
    if n != announced:
        source.refuse(f"{announced} {what} are announced, and its blocks have {n}")


def read_elements_4(file: MshFile, left_out: Counter[str]) -> GmshLines:
    """Read blocks of elements of one type and entity."""
    source = _source(file, "Elements", integers=True)
    assert source is not None
    n_blocks, announced = _header(source, file)
    parts: list[_Part] = []
    read = 0
    for _ in range(n_blocks):
        _, entity, kind, n = _block(source, file)
        if kind not in _NODES:
            source.refuse(f"elements of type {kind} are not known; leave them out of the file")
        width, begin = 1 + _NODES[kind], source.at
        rows, _ = source.rows(n, width)
        read += n
        if kind not in _LINES and kind != _POINT:
            _count_others(left_out, kind, n)
            continue
        of = np.full(n, entity)
        at = begin + (source.at - begin) // max(n, 1) * np.arange(n)
        parts.append(_Part(kind, rows[:, 0], rows[:, 1:], of, np.zeros(n, dtype=np.int64), at, False))
    _check_total(source, announced, read, "elements")
    return GmshLines.of(parts, source.place)
