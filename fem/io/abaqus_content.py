"""What an Abaqus or CalculiX deck has for a frame model: elements with their types, and keyword blocks."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fem.array_types import Floats, Ints
from fem.io import abaqus_keywords as known
from fem.io.abaqus import DeckReader
from fem.io.abaqus_assembly import Assembly, Instance
from fem.io.abaqus_deck import AbaqusBlock, AbaqusRows, cells_of, fault, name_of
from fem.io.abaqus_keywords import HARMLESS, READ, REFUSED, nodes_of
from fem.io.abaqus_parts import LARGEST as LARGEST_NUMBER
from fem.io.abaqus_parts import AbaqusPart
from fem.io.deck import integer, named, real
from fem.io.deck_units import DeckUnits
from fem.io.faults import error_at, refuse
from fem.io.rawmesh import RawMesh
from fem.mesh import MeshError

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
SAME_PLACE = 1e-9
"""Distance, relative to the size of the deck, within which nodes are at one place."""

LARGEST = 1e50
"""Numbers beyond this, whose powers overflow, are typing errors."""


class Kind(NamedTuple):
    """Type of an element, its node of orientation (0 without one), and file and line."""

    name: str
    extra: int
    place: str


@dataclass(slots=True)
class Placed:
    """A keyword block: its part, its step (0 is model data), and the blocks that belong to it."""

    block: AbaqusBlock
    part: AbaqusPart
    step: int
    subs: dict[str, AbaqusBlock] = field(default_factory=dict)

    @property
    def keyword(self) -> str:
        """Name without blanks."""
        return self.block.keyword


@dataclass(slots=True)
class FrameReader(DeckReader):
    """The state while a deck is read for a frame model: the mesh, types of elements, and other keywords."""

    step: int = 0
    procedures: dict[int, AbaqusBlock] = field(default_factory=dict)
    kinds: dict[int, dict[int, Kind]] = field(default_factory=dict)
    placed: list[Placed] = field(default_factory=list)
    stand_ins: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        DeckReader.__post_init__(self)
        for keyword in ("ELGEN", "ELCOPY"):
            self.handlers[keyword] = partial(self._generated, self.handlers[keyword])

    def _block(self, block: AbaqusBlock) -> None:
        key = block.keyword
        if key in READ or key in REFUSED:
            DeckReader._block(self, block)
        elif key in known.NOT_A_FRAME:
            raise fault(block, f"{known.NOT_A_FRAME[key]}")
        elif key == "STEP":
            self.step += 1
            self.placed.append(Placed(block, self.part, self.step))
        elif key in known.SUBS and not self.step:
            self._add_to_last(block)
        elif key in known.HANDLED:
            self.placed.append(Placed(block, self.part, self.step))
        elif key in known.LEFT_OUT:
            if key == "INITIALCONDITIONS" and block.options.get("TYPE", "STRESS") != "STRESS":
                return
            self._name(known.LEFT_OUT[key], f"*{block.name}", block.place)
        elif self.step and key in known.PROCEDURES:
            self.procedures.setdefault(self.step, block)
        elif key not in HARMLESS and key not in known.SUBS:
            self._refuse_short(block)
            self.unknown.setdefault(f"*{block.name[:40]}", []).append(f"line {block.line}")

    def _add_to_last(self, block: AbaqusBlock) -> None:
        last = self.placed[-1] if self.placed else None
        if last is None or last.keyword not in known.SUBS[block.keyword]:
            raise fault(block, f"follows none of {', '.join(sorted(known.SUBS[block.keyword]))}")
        subs = last.subs
        if block.keyword in subs:
            raise fault(block, f"comes a second time, after {subs[block.keyword].place}")
        subs[block.keyword] = block

    def _nodes(self, block: AbaqusBlock) -> None:
        for place, cells in block.rows():
            if len(cells) > 4 and any(cells[4:]):
                raise error_at(
                    place, "*NODE gives a normal, which turns sections; give n1 with *BEAM SECTION instead"
                )
        DeckReader._nodes(self, block)

    def parts_of(self, block: AbaqusBlock) -> list[AbaqusRows]:
        """Return the data lines of a block, with distinct numbers for the nodes of instances."""
        found = DeckReader.parts_of(self, block)
        if block.keyword == "ELEMENT" and self.part is self.outside:
            return [AbaqusRows(rows.file, [*map(self._numbered, rows.texts)], rows.lines) for rows in found]
        return found

    def _numbered(self, text: str) -> str:
        """Return a line of elements in which ``INSTANCE.NODE`` has a number: it stands in for that node."""
        if "." not in text:
            return text
        number, *nodes = cells_of(text)
        labels = [name_of(cell) for cell in nodes]
        for label in labels:
            if "." in label:
                self.stand_ins.setdefault(label, LARGEST_NUMBER - len(self.stand_ins))
        return ", ".join([number, *(str(self.stand_ins.get(label, label)) for label in labels)])

    def _node_count(self, kind: str, block: AbaqusBlock) -> tuple[int, int]:
        count, more = nodes_of(kind) if kind in known.LINES else (known.POINTS.get(kind, 0), 0)
        if not count:
            msg = (
                f"{block.place}: *ELEMENT has the type {kind[:40]}, which is no part of a frame; read are "
                f"beams (B31, B32, B33, B21, PIPE31), trusses (T3D2), {', '.join(known.POINTS)}"
            )
            raise MeshError(msg)
        return count, more

    def _keep_kind(self, kind: str, numbers: Ints, extra: Ints, lines: Ints, file: str) -> None:
        kinds = self.kinds.setdefault(id(self.part), {})
        for number, node, line in zip(numbers.tolist(), extra.tolist(), lines.tolist(), strict=True):
            kinds[number] = Kind(kind, max(node, 0), f"{file}: line {line}")

    def _generated(self, copy: Callable[[AbaqusBlock], None], block: AbaqusBlock) -> None:
        """Copy elements, which have the type of the part's elements before them."""
        kinds = self.kinds.setdefault(id(self.part), {})
        types = {kind.name for kind in kinds.values() if kind.name in known.LINES}
        if len(types) != 1 or any(kind.extra for kind in kinds.values()):
            raise fault(
                block,
                f"copies elements where the part has {named(sorted(types)) or 'none'}"
                " before it; it is read after lines of one type without nodes of orientation",
            )
        before = self.part.elements.size
        copy(block)
        for number in self.part.elements.numbers()[before:].tolist():
            kinds[number] = Kind(next(iter(types)), 0, block.place)


@dataclass(slots=True)
class Content:
    """A deck: its mesh, the type of each element, and its keyword blocks.

    Attributes
    ----------
    points : ndarray (n, 3) [m]
    kinds : list of Kind, of the rows of ``mesh.lines``
    owners : list of str, the instances that these belong to
    size : float, of the deck [m]
    """

    file: str
    units: DeckUnits
    assembly: Assembly
    mesh: RawMesh
    placed: list[Placed]
    procedures: dict[int, AbaqusBlock]
    points: Floats
    kinds: list[Kind]
    owners: list[str]
    notes: list[str] = field(default_factory=list)
    stand_ins: dict[int, int] = field(default_factory=dict)
    size: float = field(init=False)

    def __post_init__(self) -> None:
        self.size = float(np.ptp(self.points, axis=0).max())

    @property
    def calculix(self) -> bool:
        """Whether the deck has what CalculiX alone knows."""
        sections = (p.block.options for p in self.placed if p.keyword == "BEAMSECTION")
        return any(kind.name in known.CALCULIX for kind in self.kinds) or any(
            key.startswith("OFFSET") for options in sections for key in options
        )

    def model_data(self, *keywords: str) -> Iterator[tuple[Placed, Instance]]:
        """Give the blocks of some keywords before the first step, with each instance of their part."""
        for placed in self.placed:
            if placed.keyword in keywords and not placed.step:
                for instance in self.assembly.owners_of(placed.part):
                    yield placed, instance

    def rows(self, keyword: str, label: str, owner: str, place: str) -> list[int]:
        """Return the rows of a node or an element, or of a set."""
        found = self.assembly.rows_of(keyword, owner, label) if label else None
        if found is None:
            word = "node" if keyword == "NSET" else "element"
            what = f"{word} {label}" if label.isdigit() else f"{word} set {label[:60] or '(no name)'}"
            msg = f"{place} refers to the {what}, which the {'part' if owner else 'file'} does not have"
            raise MeshError(msg)
        rows: list[int] = found.tolist()
        return rows if keyword == "ELSET" else [self.stand_ins.get(row, row) for row in rows]

    def node(self, label: str, owner: str, place: str) -> int:
        """Return the row of one node, or of a set of one."""
        found = self.rows("NSET", label, owner, place)
        if len(found) != 1:
            refuse(f"{place} needs one node, but the set {label[:60]} has {len(found)}", MeshError)
        return found[0]

    def elements(self, placed: Placed, owner: str, types: frozenset[str] | None = None) -> list[int]:
        """Return the rows of the block's ELSET, which must be of some types."""
        block = placed.block
        label = block.option("ELSET", "ELSET=")
        found = self.rows("ELSET", label, owner, f"{block.place}: *{block.name}")
        for row in found if types is not None else []:
            if types is not None and self.kinds[row].name not in types:
                raise fault(
                    block,
                    f"is given for the element {self.number(row)} of type "
                    f"{self.kinds[row].name}; allowed are {', '.join(sorted(types))}",
                )
        return found

    def number(self, row: int) -> int:
        """Return the number of an element in the deck."""
        return int(np.asarray(self.mesh.line_numbers)[row])

    def nodes_of(self, row: int) -> list[int]:
        """Return the rows of an element's nodes."""
        return [int(node) for node in self.mesh.lines[row] if node >= 0]

    def near(self, a: int, b: int) -> bool:
        """Return whether two nodes are at one place."""
        return bool(np.linalg.norm(self.points[a] - self.points[b]) <= SAME_PLACE * self.size)


def read_content(path: Path, units: DeckUnits) -> Content:
    """Read a deck."""
    reader = FrameReader(path)
    assembly = reader.read()
    labels = list(reader.stand_ins)
    if labels:  # behind all other nodes, so that they can be cut off
        numbers = list(reader.stand_ins.values())
        reader.outside.nodes.add(numbers, np.zeros((len(labels), 3)), 0, path.name)
    mesh = assembly.mesh()
    stand_ins = _resolved(assembly, mesh, labels)
    kinds: list[Kind] = []
    owners: list[str] = []
    if not len(mesh.lines):
        raise error_at(path.name, "the deck has no elements; a frame needs beams or trusses")
    for owner, numbers, parts in assembly.elements_of_owners():
        types: dict[int, Kind] = {}
        for part in reversed(parts):
            types |= reader.kinds.get(id(part), {})
        kinds += [types[number] for number in numbers]
        owners += [owner] * len(numbers)
    points = np.asarray(mesh.points, dtype=float).reshape(-1, 3) * units.length
    bad = np.flatnonzero(~(np.abs(points) < LARGEST).all(axis=1))
    if bad.size:
        raise error_at(path.name, f"{mesh.point(int(bad[0]))} is out of range, at {points[bad[0]]} m")
    return Content(
        path.name,
        units,
        assembly,
        mesh,
        reader.placed,
        reader.procedures,
        points,
        kinds,
        owners,
        mesh.notes,
        stand_ins,
    )


def _resolved(assembly: Assembly, mesh: RawMesh, labels: list[str]) -> dict[int, int]:
    """Put the nodes of instances in the place of those that stand in for them; return their rows by these."""
    n = len(mesh.points) - len(labels)
    found: dict[int, int] = {}
    for k, label in enumerate(labels):
        rows = assembly.rows_of("NSET", "", label)
        if rows is None or len(rows) != 1:
            msg = f"{assembly.file}: *ELEMENT refers to the node {label[:60]}, which the file does not have"
            raise MeshError(msg)
        found[n + k] = int(rows[0])
        mesh.lines[mesh.lines == n + k] = rows[0]
    mesh.points, mesh.point_numbers = mesh.points[:n], np.asarray(mesh.point_numbers)[:n]
    return found


def numbers_of(
    block: AbaqusBlock, place: str, cells: list[str], least: int, most: int, what: str
) -> list[float]:
    """Return the numbers of a data line."""
    if not least <= len(cells) <= most:
        count = f"{least}" if least == most else f"{least} to {most}"
        raise fault(block, f"has {len(cells)} numbers on this line; {count} are expected: {what}", place)
    try:
        values = [real(cell) for cell in cells]
    except ValueError as reason:
        raise fault(block, f"takes {what}, but {reason}", place) from reason
    strange = [v for v in values if v and not 1 / LARGEST < abs(v) < LARGEST]
    if strange:
        raise fault(block, f"takes {what}, but {strange[0]:g} is out of range", place)
    return values


def data(
    block: AbaqusBlock, k: int, least: int, most: int, what: str, taken: int | None = None
) -> list[float]:
    """Return the numbers of the k-th data line that is not empty, or the first ones of them."""
    rows = lines_of(block)
    if len(rows) <= k:
        raise fault(block, f"has {len(rows)} data line(s); {k + 1} are expected, the last with {what}")
    place, cells = rows[k]
    return numbers_of(block, place, cells[:taken], least, most, what)


def read_integer(block: AbaqusBlock, place: str, cell: str, what: str) -> int:
    """Return a whole number."""
    try:
        return integer(cell)
    except ValueError as reason:
        raise fault(block, f"takes {what}, but {reason}", place) from reason


def dofs_of(block: AbaqusBlock, place: str, cells: list[str]) -> range:
    """Return the degrees of freedom from a first to a last one, counted from 0; all without any.

    Those from 7 on (warping, temperature) are left out.
    """
    given = [read_integer(block, place, cell, "degrees of freedom") for cell in cells[:2] if cell]
    first, last = (given[0], given[-1]) if given else (1, 6)
    if not 1 <= first <= last:
        raise fault(block, f"has the degrees of freedom {first} to {last}; they run from 1 to 6", place)
    return range(first - 1, min(last, 6))


def check(block: AbaqusBlock, *allowed: str) -> None:
    """Refuse the parameters of a keyword that are not read."""
    for key in block.options:
        if key not in allowed:
            raise fault(
                block, f"has the parameter {key[:40]}, which is not read; read are {', '.join(allowed)}"
            )


def lines_of(block: AbaqusBlock) -> list[tuple[str, list[str]]]:
    """Return place and cells of the data lines that are not empty."""
    return [(place, cells) for place, cells in block.rows() if any(cells)]
