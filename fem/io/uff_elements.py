"""Datasets 780 and 2412 (elements), 82 (trace lines) and those of permanent groups."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import overload

import numpy as np

from fem.array_types import Bools, Ints
from fem.io.faults import refuse
from fem.io.uff_format import UffBlock
from fem.io.uff_numbers import Tokens, integer, integer_of, text_at, tokens
from fem.io.uff_types import TraceLine, UffElement

HEADS: dict[int, tuple[int, tuple[int, ...]]] = {780: (8, (0, 1, 3, 5, 7)), 2412: (6, (0, 1, 2, 3, 5))}
"""Numbers on an element's first line, and which of them are label, descriptor, property, material, nodes."""

BEAMS = (11, 21, 22, 23, 24, 31, 32)
"""Descriptors of rods, beams and pipes, which have a line on their orientation before their nodes."""

ENTITIES = {7: "nodes", 8: "elements", 27: "trace lines"}
"""Entities of groups that are used, by their codes."""

GROUP_COLUMNS: dict[int, int] = {
    752: 2,
    2417: 2,
    2429: 2,
    2430: 2,
    2432: 2,
    2435: 4,
    2452: 4,
    2467: 4,
    2477: 4,
}
"""Numbers for each entity of a group: its code and its label; in the newer datasets two more."""


@dataclass(frozen=True, slots=True, eq=False)
class Elements(Sequence[UffElement]):
    """Elements as arrays.

    Attributes
    ----------
    number, descriptor, property, material : ndarray of int (n,)
    nodes : ndarray of int, of all elements one after the other
    first : ndarray of int (n + 1,), where each one's nodes begin
    line : ndarray of int (n,), lines of the file
    """

    number: Ints
    descriptor: Ints
    property: Ints
    material: Ints
    nodes: Ints
    first: Ints
    line: Ints

    @classmethod
    def joined(cls, parts: Iterable["Elements"]) -> "Elements":
        """Return the elements of several datasets as one."""
        none = np.zeros(0, dtype=np.int64)
        found = [cls(none, none, none, none, none, np.zeros(1, dtype=np.int64), none), *parts]
        columns = ("number", "descriptor", "property", "material", "nodes", "line")
        joined = {name: np.concatenate([getattr(p, name) for p in found]) for name in columns}
        counts = np.concatenate([np.diff(p.first) for p in found])
        return cls(first=np.concatenate([[0], np.cumsum(counts)]), **joined)

    def __len__(self) -> int:
        """Return the number of elements."""
        return self.number.size

    @overload
    def __getitem__(self, index: int) -> UffElement: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[UffElement, ...]: ...
    def __getitem__(self, index: int | slice) -> UffElement | tuple[UffElement, ...]:
        """Return an element, or several."""
        if isinstance(index, slice):
            return tuple(self[k] for k in range(*index.indices(len(self))))
        k = range(len(self))[index]
        return UffElement(
            int(self.number[k]),
            int(self.descriptor[k]),
            int(self.property[k]),
            int(self.material[k]),
            tuple(self.nodes[self.first[k] : self.first[k + 1]].tolist()),
        )

    def __eq__(self, other: object) -> bool:
        """Tell whether another sequence has the same elements."""
        return isinstance(other, Sequence) and len(self) == len(other) and tuple(self) == tuple(other)

    __hash__ = None  # type: ignore[assignment]

    def without_copies(self) -> "Elements":
        """Return each element once.

        Raises
        ------
        ValueError
            If a number stands for two different elements.
        """
        order = np.argsort(self.number, kind="stable")
        same = np.flatnonzero(self.number[order[1:]] == self.number[order[:-1]])
        if not same.size:
            return self
        kept = np.ones(len(self), dtype=bool)
        for k in same.tolist():
            a, b = self[int(order[k])], self[int(order[k + 1])]
            if replace(a, property=0, material=0) != replace(b, property=0, material=0) or a != b:
                one, two = sorted((int(self.line[order[k]]), int(self.line[order[k + 1]])))
                refuse(
                    f"element {a.number} is defined at line {one} and again, with other nodes or type, at "
                    f"line {two}; each element needs another number"
                )
            kept[order[k + 1]] = False
        return self._chosen(kept)

    def _chosen(self, kept: Bools) -> "Elements":
        counts = np.diff(self.first)
        return Elements(
            self.number[kept],
            self.descriptor[kept],
            self.property[kept],
            self.material[kept],
            self.nodes[np.repeat(kept, counts)],
            np.concatenate([[0], np.cumsum(counts[kept])]),
            self.line[kept],
        )


@dataclass(frozen=True, slots=True)
class UffGroup:
    """A permanent group: a name for nodes, elements and trace lines.

    Attributes
    ----------
    number : int
    name : str
    members : mapping of int to tuple of int
        Labels by the code of the entity: 7 nodes, 8 elements, 27 trace lines; others have no meaning here.
    place : str
    """

    number: int
    name: str
    members: dict[int, tuple[int, ...]]
    place: str


def elements_of(block: UffBlock) -> Elements:
    """Return the elements of a dataset 780 or 2412.

    Raises
    ------
    ValueError
        With the line of the file, where a number is missing or is none.
    """
    found = tokens(block)
    got = None if found is None else _walked(block, found)
    if got is None:  # numbers touch, or a column is empty
        found = tokens(_respaced(block))
        got = None if found is None else _walked(block, found)
    if got is None or found is None:
        raise ValueError(_damage(block))
    return got


def _walked(block: UffBlock, found: Tokens) -> Elements | None:
    """Return the elements if all lines have the numbers that their first line announces."""
    n_head, columns = HEADS[block.kind]
    values, n_lines = found.values, found.count.size
    none = np.zeros(0, dtype=np.int64)
    if not n_lines:
        return Elements(none, none, none, none, none, np.zeros(1, dtype=np.int64), none)
    if not (
        np.isfinite(values).all() and (values == np.floor(values)).all() and np.abs(values).max() < 2**53
    ):
        return None
    last = values.size - 1
    descriptor, n = (values[np.minimum(found.start + columns[k], last)].astype(np.int64) for k in (1, 4))
    after = np.append(found.count[1:], 0)
    # the line on the orientation has 3 numbers; only of elements with 3 nodes the descriptor must tell
    oriented = np.where(n == 3, np.isin(descriptor, BEAMS), after != np.minimum(n, 8))
    step = 1 + oriented + -(-n // 8)
    heads = _heads(step.tolist(), n_lines)
    if heads is None:
        return None
    n, oriented = n[heads], oriented[heads]
    of_nodes = heads + 1 + oriented
    end = np.append(found.start, values.size)[heads + step[heads]]
    good = (
        (found.count[heads] == n_head).all()
        and (n >= 1).all()
        and (found.count[(heads + 1)[oriented]] == 3).all()
        and (of_nodes < n_lines).all()
        and (end - found.start[np.minimum(of_nodes, n_lines - 1)] == n).all()
    )
    if not good:
        return None
    first = np.concatenate([[0], np.cumsum(n)])
    at = np.repeat(found.start[of_nodes] - first[:-1], n) + np.arange(first[-1])
    head = [values[found.start[heads] + c].astype(np.int64) for c in columns[:4]]
    number, descriptor, physical, material = head
    line = block.line + 1 + found.record[heads]
    return Elements(number, descriptor, physical, material, values[at].astype(np.int64), first, line)


def _heads(step: list[int], n_lines: int) -> Ints | None:
    """Return the first lines of elements, by their numbers of lines."""
    heads: list[int] = []
    k = 0
    while k < n_lines:
        heads.append(k)
        if step[k] < 2:
            return None
        k += step[k]
    return np.array(heads, dtype=np.int64) if k == n_lines else None


def _respaced(block: UffBlock) -> UffBlock:
    """Put a blank between columns of ten; empty columns before others become 0."""
    lines = []
    for line in block.lines[1:]:
        text = line.rstrip()
        columns = [text[k : k + 10].strip() or "0" for k in range(0, len(text), 10)]
        lines.append(" ".join(columns))
    return replace(block, body="\n".join(lines).encode() + b"\n")


def _damage(block: UffBlock) -> str:
    """Find the line of a damaged dataset of elements."""
    n_head, columns = HEADS[block.kind]
    record = 1
    while record < block.n_lines:
        head = _integer_line(block, record)
        if isinstance(head, str) or len(head) != n_head or head[columns[4]] < 1:
            return (
                head
                if isinstance(head, str)
                else (
                    f"{block.at(record)} has {len(head)} numbers where the {n_head} of an element are "
                    "expected, its number of nodes the last"
                )
            )
        n, label = head[columns[4]], head[0]
        record += 1
        got = 0
        if record < block.n_lines:
            row = _integer_line(block, record)
            if (not isinstance(row, str) and len(row) != min(n, 8) and len(row) == 3) or (
                n == 3 and head[columns[1]] in BEAMS
            ):
                record += 1
        while got < n and record < block.n_lines:
            row = _integer_line(block, record)
            if isinstance(row, str):
                return row
            if not row or len(row) != min(n - got, 8):
                break
            got += len(row)
            record += 1
        if got != n:
            return (
                f"element {label} announces {n} node(s), but {got} come before "
                f"{block.at(min(record, block.n_lines - 1))}, which has no more of them"
            )
    return "its lines do not have the form of elements"


def _integer_line(block: UffBlock, record: int) -> list[int] | str:
    row: list[int] = []
    for word in block.lines[record].split():
        value = integer_of(word)
        if value is None:
            return f"{block.at(record)} has {word[:20]!r} where a whole number is expected"
        row.append(value)
    return row


def trace_line_of(block: UffBlock) -> TraceLine:
    """Return the trace line of a dataset 82."""
    head = text_at(block, 1)
    words = head.split()
    number, count = (
        integer(block, 1, word) for word in (words[:2] if len(words) >= 3 else (head[:10], head[10:20]))
    )
    name = text_at(block, 2).strip()
    nodes: list[int] = []
    for record in range(3, block.n_lines):
        nodes += _integer_row(block, record)
    if len(nodes) < count:
        refuse(f"trace line {number} announces {count} nodes and has {len(nodes)}")
    strokes: list[list[int]] = [[]]
    for node in nodes[:count]:
        if node == 0:
            strokes.append([])
        elif not strokes[-1] or strokes[-1][-1] != node:
            strokes[-1].append(node)
    known = "" if name.upper() == "NONE" else name
    return TraceLine(number, known or f"line {number}", tuple(tuple(s) for s in strokes if len(s) > 1))


def _columns_of_ten(line: str) -> list[str]:
    words = line.split()
    if all(len(word) <= 10 for word in words):
        return words
    return [line[k : k + 10] for k in range(0, len(line.rstrip()), 10)]


def _integer_row(block: UffBlock, record: int) -> list[int]:
    line = text_at(block, record)
    words = line.split()
    if all(len(word) <= 10 for word in words) and line.isascii() and "".join(words).isdigit():
        return list(map(int, words))
    return [integer(block, record, word) for word in _columns_of_ten(line)]


def _by_code(codes: Sequence[int], labels: Sequence[int]) -> dict[int, list[int]]:
    members: dict[int, list[int]] = {}
    for code, label in zip(codes, labels, strict=True):
        members.setdefault(code, []).append(label)
    return members


def _entities(
    block: UffBlock, record: int, count: int, per_entity: int, group: str
) -> tuple[dict[int, list[int]], int]:
    """Read the entities of a group line by line; return also the line after them."""
    flat: list[int] = []
    while len(flat) < count * per_entity:
        row = _integer_row(block, record)
        if not row or len(row) % per_entity:
            refuse(
                f"{block.at(record)} has {len(row)} numbers where {per_entity} for each entity of {group} "
                "are expected"
            )
        flat += row
        record += 1
    if len(flat) != count * per_entity:
        refuse(f"{group} announces {count} entities and has {len(flat) // per_entity}")
    return _by_code(flat[::per_entity], flat[1::per_entity]), record


def groups_of(block: UffBlock) -> Iterator[UffGroup]:
    """Return the permanent groups of a dataset."""
    per_entity = GROUP_COLUMNS[block.kind]
    record = 1
    while record < block.n_lines:
        if not block.lines[record].strip():
            record += 1
            continue
        head = _columns_of_ten(block.lines[record])
        if not 6 <= len(head) <= 8:
            refuse(f"{block.at(record)} has {len(head)} numbers where the 8 of a group are expected")
        number, count = integer(block, record, head[0]), integer(block, record, head[-1])
        name = text_at(block, record + 1).strip()
        place = f"dataset {block.kind}, {block.at(record)}"
        record += 2
        end = min(record + -(-count // (8 // per_entity)), block.n_lines)
        words = " ".join(block.lines[record:end]).split()
        plain = len(words) == count * per_entity and all(len(w) <= 10 and w.isdecimal() for w in words)
        if plain:  # as many numbers as announced, eight to a line
            row, record = list(map(int, words)), end
            members = _by_code(row[::per_entity], row[1::per_entity])
        else:
            members, record = _entities(block, record, count, per_entity, f"group '{name}' ({place})")
        yield UffGroup(
            number,
            name or f"group {number}",
            {code: tuple(labels) for code, labels in members.items()},
            place,
        )
