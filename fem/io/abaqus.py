"""Abaqus and CalculiX input files (``.inp``): nodes, line elements and sets.

meshio 5.3.5 reads them too, but keeps the last of several ``*NODE`` blocks, mixes up element sets when
several ``*ELEMENT`` blocks share a name or some have none, takes B33 for a three-node element, refuses a file
for one element type that it does not know (MASS, for instance), and knows no parts and instances. So these
are read here. :mod:`fem.io.abaqus_keywords` lists the keywords that are read, refused, named and harmless.
"""

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fem.array_types import Floats, Ints
from fem.io import abaqus_generate as generate
from fem.io.abaqus_assembly import Assembly, Instance
from fem.io.abaqus_deck import (
    AbaqusBlock,
    AbaqusRows,
    Deck,
    cells_of,
    check_options,
    left_out_sentence,
    name_of,
    table_of,
)
from fem.io.abaqus_keywords import CENTRED, HARMLESS, NAMED, READ, REFUSED, SECTIONS, nodes_of
from fem.io.abaqus_parts import AbaqusPart, AbaqusSetEntry, Skipped
from fem.io.deck import DeckBudget, integer, real
from fem.io.faults import error_at, refuse
from fem.io.rawmesh import RawMesh
from fem.mesh import Mesh, MeshError


@dataclass(slots=True)
class DeckReader:
    """The state while a deck is read."""

    path: Path
    deck: Deck = field(init=False)
    outside: AbaqusPart = field(default_factory=AbaqusPart)
    parts: dict[str, AbaqusPart] = field(default_factory=dict)
    instances: dict[str, Instance] = field(default_factory=dict)
    budget: DeckBudget = field(default_factory=DeckBudget)
    notes: list[str] = field(default_factory=list)
    named: dict[str, dict[str, list[str]]] = field(default_factory=dict)
    unknown: dict[str, list[str]] = field(default_factory=dict)
    part: AbaqusPart = field(init=False)
    handlers: dict[str, Callable[[AbaqusBlock], None]] = field(init=False)

    def __post_init__(self) -> None:
        self.deck = Deck(self.path)
        self.part = self.outside
        self.handlers = {
            "NODE": self._nodes,
            "ELEMENT": self._elements,
            "NSET": self._set,
            "ELSET": self._set,
            "SYSTEM": self._system,
            "NGEN": lambda block: generate.ngen(block, self.part, self.budget),
            "NFILL": lambda block: generate.nfill(block, self.part, self.budget, self.notes),
            "NCOPY": lambda block: generate.ncopy(block, self.part, self.budget),
            "ELGEN": lambda block: generate.elgen(block, self.part, self.budget),
            "ELCOPY": lambda block: generate.elcopy(block, self.part, self.budget),
            "PART": self._begin_part,
            "INSTANCE": self._begin_instance,
            **dict.fromkeys(("ENDPART", "ASSEMBLY", "ENDASSEMBLY", "ENDINSTANCE"), self._end),
        }

    def read(self) -> Assembly:
        """Read the deck and return its parts and instances."""
        with np.errstate(over="ignore", invalid="ignore"):  # Mesh names values that are not finite
            for block in self.deck.blocks():
                self._block(block)
        if self.deck.loose:
            self.notes.append(f"{self.deck.loose} lines before the first keyword are left out")
        for remedy, found in self.named.items():
            self.notes += [f"{words}; {remedy}" for words in left_out_sentence("left out", found)]
        self.notes += left_out_sentence("left out, because their meaning is not known", self.unknown)
        return Assembly(self.path.name, self.outside, self.parts, self.instances, self.notes, self.budget)

    def _block(self, block: AbaqusBlock) -> None:
        if block.keyword in READ:
            if not (block.keyword == "ELEMENT" and not nodes_of(block.options.get("TYPE", "").upper())[0]):
                check_options(block)
            try:
                self.handlers[block.keyword](block)
            except MeshError:
                raise
            except (ValueError, IndexError) as reason:
                raise error_at(block.place, f"*{block.name} cannot be read: {reason}") from reason
        elif block.keyword in REFUSED:
            msg = (
                f"{block.place}: *{block.name} {REFUSED[block.keyword]}, which is not supported; write the "
                "nodes and elements of the final mesh into this file, and delete the keyword"
            )
            raise MeshError(msg)
        elif block.keyword in SECTIONS:
            self._section(block)
        elif block.keyword in NAMED:
            self._name(NAMED[block.keyword], f"*{block.name}", block.place)
        elif block.keyword not in HARMLESS:
            self._refuse_short(block)
            self.unknown.setdefault(f"*{block.name[:40]}", []).append(f"line {block.line}")

    def _name(self, remedy: str, what: str, place: str) -> None:
        self.named.setdefault(remedy, {}).setdefault(what, []).append(_short(place, self.path.name))

    def _refuse_short(self, block: AbaqusBlock) -> None:
        """Refuse a keyword that may be the short form of one that is read."""
        found = [word for word in READ if len(block.keyword) > 2 and word.startswith(block.keyword)]
        if found:
            msg = f"{block.place}: *{block.name} may be *{' or *'.join(found)}; write the keyword in full"
            raise MeshError(msg)

    # Parts --------------------------------------------------------------------------------------------------

    def _begin_part(self, block: AbaqusBlock) -> None:
        name = block.option("NAME", "NAME=")
        if name in self.parts:
            msg = (
                f"{block.place}: the part {name} is defined a second time, after {self.parts[name].place}; "
                "give it another name"
            )
            raise MeshError(msg)
        self.part = self.parts[name] = AbaqusPart(name, block.place)

    def _begin_instance(self, block: AbaqusBlock) -> None:
        name = block.option("NAME", "NAME=")
        if name in self.instances:
            before = self.instances[name].place
            raise error_at(
                block.place,
                f"the instance {name} is defined a second time, after {before}; give it another name",
            )
        data = [[real(c) for c in cells] for _, cells in block.rows()]
        turn, shift = generate.shift_and_turn(data)
        instance = Instance(name, block.option("PART", "PART="), block.place, turn, shift)
        self.instances[name] = instance
        self.part = instance.extra

    def _end(self, block: AbaqusBlock) -> None:
        self.part = self.outside

    def _system(self, block: AbaqusBlock) -> None:
        self.part.system = generate.system_of(block)

    # Nodes and elements -------------------------------------------------------------------------------------

    def parts_of(self, block: AbaqusBlock) -> list[AbaqusRows]:
        """Return the data lines of a block, with those of its INPUT file before them."""
        return [self.deck.data_file(block), *block.parts] if "INPUT" in block.options else block.parts

    def _nodes(self, block: AbaqusBlock) -> None:
        name, system = block.options.get("NSET"), block.options.get("SYSTEM", "")
        if "SPHERICAL".startswith(system or "?"):
            place = _short(block.place, self.path.name)
            self.notes.append(
                f"spherical coordinates ({place}): φ is measured from the x-y plane, not from z"
            )
        for rows in self.parts_of(block):
            table = table_of(rows.texts, float, 4, 4)
            if table is None:
                numbers, xyz = _node_rows(rows, block)
            else:
                numbers, xyz = table[:, 0].astype(np.int64), table[:, 1:]
                if (numbers != table[:, 0]).any():
                    numbers, xyz = _node_rows(rows, block)
            xyz = generate.to_global(self.part, generate.from_polar(system, xyz))
            self.part.nodes.add(numbers, xyz, np.asarray(rows.lines), rows.file)
            if name:
                self.part.sets["NSET"].add(name, AbaqusSetEntry(block.place, numbers=numbers))

    def _elements(self, block: AbaqusBlock) -> None:
        kind = block.option("TYPE", "TYPE=").upper()
        name = block.options.get("ELSET")
        count, more = self._node_count(kind, block)
        for rows in self.parts_of(block):
            if not count:
                numbers, lines = _first_cells(rows, block)
                self.part.skipped.append(Skipped(kind[:40], numbers, rows.file, lines))
            else:
                numbers, nodes, extra, lines = element_rows(rows, block, kind, count, more)
                self.part.elements.add(numbers, nodes, lines, rows.file)
                self._keep_kind(kind, numbers, extra, lines, rows.file)
            if name:
                self.part.sets["ELSET"].add(name, AbaqusSetEntry(block.place, numbers=numbers))

    def _node_count(self, kind: str, block: AbaqusBlock) -> tuple[int, int]:
        """Return the number of nodes of a type, 0 if it is not read, and of those that may follow."""
        return nodes_of(kind)

    def _keep_kind(self, kind: str, numbers: Ints, extra: Ints, lines: Ints, file: str) -> None:
        """Do nothing; :mod:`fem.io.abaqus_content` keeps the type and the node of orientation."""

    # Sets ---------------------------------------------------------------------------------------------------

    def _set(self, block: AbaqusBlock) -> None:
        sets = self.part.sets[block.keyword]
        name = block.option(block.keyword, f"{block.keyword}=")
        opened = sets.open(name)
        opened.internal |= "INTERNAL" in block.options
        opened.unsorted |= "UNSORTED" in block.options
        instance = block.options.get("INSTANCE", "")
        if block.keyword == "NSET" and "ELSET" in block.options:
            entry = AbaqusSetEntry(
                block.place, name=block.options["ELSET"], instance=instance, of_elements=True
            )
            sets.add(name, entry)
        for rows in self.parts_of(block):
            if "GENERATE" in block.options:
                for k, text in enumerate(rows.texts):
                    span = _span(cells_of(text), rows.place(k))
                    sets.add(name, AbaqusSetEntry(rows.place(k), span=span, instance=instance))
            else:
                self._members(block, name, instance, rows)

    def _members(self, block: AbaqusBlock, name: str, instance: str, rows: AbaqusRows) -> None:
        sets = self.part.sets[block.keyword]
        joined = ",".join(rows.texts)
        if joined.isascii() and joined.replace(",", "").replace(" ", "").isdigit():
            numbers = [int(cell) for cell in joined.split(",") if cell and not cell.isspace()]
            if max(numbers, default=0) < 2**63:
                sets.add(name, AbaqusSetEntry(rows.place(0), numbers=np.array(numbers), instance=instance))
                return
        for k, text in enumerate(rows.texts):
            numbers = []
            for cell in cells_of(text):
                if cell.isascii() and cell.isdigit():
                    numbers.append(integer(cell))
                elif cell and (instance or not sets.take_in(name, name_of(cell), rows.place(k))):
                    sets.add(name, AbaqusSetEntry(rows.place(k), name=name_of(cell), instance=instance))
            if numbers:
                sets.add(name, AbaqusSetEntry(rows.place(k), numbers=np.array(numbers), instance=instance))

    # Sections -----------------------------------------------------------------------------------------------

    def _section(self, block: AbaqusBlock) -> None:
        """Name sections whose axis is not at the nodes."""
        shift = [
            f"{k}={v}" for k, v in block.options.items() if k.startswith("OFFSET") and v not in ("0", "0.0")
        ]
        shape = block.options.get("SECTION", "")
        first = next((cells for _, cells in block.rows()), [])
        if shift or (shape and shape not in CENTRED and not _is_symmetric(shape, first)):
            what = f"*{block.name} with {', '.join(shift) or f'SECTION={shape[:40]}'}"
            self._name(
                "the axis may not go through the nodes, so give offset1 and offset2 in the study file",
                what,
                block.place,
            )


def _is_symmetric(shape: str, cells: list[str]) -> bool:
    """Return whether the node of an I or T section is at its centroid."""
    if shape != "I" or len(cells) < 7:
        return False
    try:
        node, h, b1, b2, t1, t2, t3 = (real(cell) for cell in cells[:7])
    except ValueError:
        return False
    web = (h - t1 - t2) * t3
    area = b1 * t1 + b2 * t2 + web
    centroid = (
        (b1 * t1 * t1 / 2 + b2 * t2 * (h - t2 / 2) + web * (t1 + h - t2) / 2) / area if area > 0 else -1.0
    )
    return abs(centroid - node) <= 1e-3 * h


def _short(place: str, file: str) -> str:
    return place.removeprefix(f"{file}: ")


def _node_rows(rows: AbaqusRows, block: AbaqusBlock) -> tuple[Ints, Floats]:
    """Read nodes line by line: up to three coordinates, and a normal that is left to the study file."""
    numbers, xyz = np.empty(len(rows.texts), dtype=np.int64), np.zeros((len(rows.texts), 3))
    for k, text in enumerate(rows.texts):
        cells = cells_of(text)
        try:
            numbers[k] = integer(cells[0])
            values = [real(cell) for cell in cells[1:4]]
            if len(cells) > 7:
                refuse(f"this line has {len(cells)} numbers")
            xyz[k, : len(values)] = values
        except ValueError as reason:
            msg = f"{rows.place(k)}: *{block.name} takes a number and up to three coordinates, but {reason}"
            raise MeshError(msg) from reason
    return numbers, xyz


def element_rows(
    rows: AbaqusRows, block: AbaqusBlock, kind: str, count: int, more: int
) -> tuple[Ints, Ints, Ints, Ints]:
    """Return numbers, nodes (n, 3), nodes of orientation and lines of elements.

    An element goes on while nodes are missing; a node that an element does not have is -1.
    """
    table = table_of(rows.texts, np.int64, count + 1, count + 1 + more)
    if table is not None:
        nodes = np.full((len(table), 3), -1, dtype=np.int64)
        nodes[:, :count] = table[:, 1 : count + 1]
        extra = table[:, count + 1] if table.shape[1] > count + 1 else np.full(len(table), -1)
        return table[:, 0], _positive(nodes, count, rows, range(len(table))), extra, np.asarray(rows.lines)
    found: list[list[int]] = []
    at: list[int] = []
    for k, text in enumerate(rows.texts):
        try:
            values = [integer(cell) for cell in cells_of(text) if cell]
        except ValueError as reason:
            raise error_at(rows.place(k), f"*{block.name} takes whole numbers, but {reason}") from reason
        goes_on = bool(found) and len(found[-1]) <= count and rows.texts[k - 1].rstrip().endswith(",")
        if goes_on:
            found[-1] += values
        else:
            found.append(values)
            at.append(k)
    nodes = np.full((len(found), 3), -1, dtype=np.int64)
    extra = np.full(len(found), -1, dtype=np.int64)
    for row, values in enumerate(found):
        if not count < len(values) <= count + 1 + more:
            more_words = ", or one more for its orientation" if more else ""
            msg = (
                f"{rows.place(at[row])}: element {values[0] if values else '?'} of type {kind} has "
                f"{max(len(values) - 1, 0)} node(s); {count} are expected{more_words}"
            )
            raise MeshError(msg)
        nodes[row, :count] = values[1 : count + 1]
        extra[row] = values[count + 1] if len(values) > count + 1 else -1
    numbers = np.array([values[0] for values in found], dtype=np.int64)
    return numbers, _positive(nodes, count, rows, at), extra, np.asarray(rows.lines)[at]


def _positive(nodes: Ints, count: int, rows: AbaqusRows, at: Sequence[int]) -> Ints:
    bad = np.flatnonzero((nodes[:, :count] < 1).any(axis=1))
    if bad.size:
        least = nodes[bad[0], :count].min()
        msg = f"{rows.place(at[bad[0]])}: an element refers to node {least}; node numbers begin with 1"
        raise MeshError(msg)
    return nodes


def _first_cells(rows: AbaqusRows, block: AbaqusBlock) -> tuple[Ints, Ints]:
    """Return numbers and lines of elements that are no lines; a line that ends in a comma goes on."""
    ends = [text.rstrip().endswith(",") for text in rows.texts]
    begins = range(len(ends)) if all(ends) else [k for k in range(len(ends)) if k == 0 or not ends[k - 1]]
    numbers = []
    for k in begins:
        try:
            numbers.append(integer(rows.texts[k].split(",", 1)[0]))
        except ValueError as reason:
            raise error_at(rows.place(k), f"*{block.name} takes whole numbers, but {reason}") from reason
    return np.array(numbers, dtype=np.int64), np.asarray(rows.lines)[list(begins)]


def _span(cells: list[str], place: str) -> tuple[int, int, int]:
    try:
        first, last, step = (integer(cell) for cell in [*cells, "1"][:3])
    except ValueError as reason:
        raise error_at(place, f"first, last and step of a range are expected ({reason})") from reason
    if last < first or step < 1:
        raise error_at(place, f"the range {first} to {last} in steps of {step} is empty")
    return first, last, step


def read_abaqus(path: Path) -> RawMesh:
    """Read the lines of an Abaqus or CalculiX input file.

    Set names come out in capitals, as Abaqus does not tell case apart. Sets of instances are named
    ``INSTANCE.SET`` where there are several instances.

    Raises
    ------
    MeshError
        For a block that is not numbers, a keyword or parameter that changes the mesh and is not read, or
        elements that refer to nodes which are not there.
    """
    return DeckReader(path).read().mesh()


def abaqus_text(mesh: Mesh) -> str:
    """Return a mesh as an input file: B31 elements, a set for each member, group and named point.

    Nodes and elements have the numbers of the mesh's file where its lines are those of the file, else 1 to n.
    """
    nodes, elements = (n.tolist() for n in _numbered(mesh))
    rows = ["*NODE"]
    rows += [f"{n}, {x!r}, {y!r}, {z!r}" for n, (x, y, z) in zip(nodes, mesh.points.tolist(), strict=True)]
    rows.append("*ELEMENT, TYPE=B31")
    ends = zip(elements, mesh.lines.tolist(), strict=True)
    rows += [f"{n}, {nodes[a]}, {nodes[b]}" for n, (a, b) in ends]
    for name, members in (*((m, (m,)) for m in mesh.members), *mesh.groups.items()):
        numbers = [elements[row] for member in members for row in mesh.members[member]]
        rows.append(f'*ELSET, ELSET="{name}"')
        rows += [", ".join(str(n) for n in numbers[k : k + 16]) for k in range(0, len(numbers), 16)]
    for name, point in mesh.point_names.items():
        rows += [f'*NSET, NSET="{name}"', str(nodes[point])]
    return "\n".join([*rows, ""])


def _numbered(mesh: Mesh) -> tuple[Ints, Ints]:
    """Return the numbers of a mesh's points and lines in a file."""
    known, plain = mesh.numbers, (np.arange(mesh.n_points) + 1, np.arange(mesh.n_lines) + 1)
    if known is None or len(known.ends) != mesh.n_lines:
        return plain
    of_file, here = known.points[known.ends], mesh.points[mesh.lines]
    same, turned = ((ends == here).all(axis=(1, 2)) for ends in (of_file, of_file[:, ::-1]))
    nodes = np.zeros(mesh.n_points, dtype=np.int64)
    nodes[mesh.lines] = known.nodes[np.where(same[:, None], known.ends, known.ends[:, ::-1])]
    free = nodes == 0
    nodes[free] = known.nodes.max(initial=0) + 1 + np.arange(free.sum())
    unique = len(np.unique(nodes)) == len(nodes) and len(np.unique(known.elements)) == mesh.n_lines
    return (nodes, known.elements) if unique and (same | turned).all() else plain


def read_abaqus_nodes(path: Path) -> tuple[Ints, Floats]:
    """Return the numbers (n,) and coordinates (n, 3) of a deck's nodes, in the deck's unit.

    Nodes are those outside parts; of a deck that has none there, those of its only instance, as Abaqus/CAE
    writes them.
    """
    assembly = DeckReader(path).read()
    notes: list[str] = []
    if _in_one_instance(assembly):
        raw = assembly.mesh()
        return np.asarray(raw.point_numbers, dtype=np.int64), raw.points
    nodes = assembly.outside.nodes
    numbers, rows = nodes.unique(notes)
    _warn(path, notes)
    return numbers, nodes.values(rows)


def read_node_sets(path: str | os.PathLike[str]) -> dict[str, tuple[int, ...]]:
    """Return the node sets of an Abaqus or CalculiX deck by their names in capitals.

    Nodes are those of :func:`read_abaqus_nodes`.
    """
    assembly = DeckReader(Path(path)).read()
    if _in_one_instance(assembly):
        raw = assembly.mesh()
        of_row = np.asarray(raw.point_numbers, dtype=np.int64)
        return {name: tuple(of_row[rows].tolist()) for name, rows in raw.point_sets.items()}
    sets, notes = assembly.node_sets()
    _warn(Path(path), notes)
    return {name: tuple(numbers.tolist()) for name, numbers in sets.items()}


def _in_one_instance(assembly: Assembly) -> bool:
    """Return whether all nodes of a deck belong to one instance."""
    return len(assembly.instances) == 1 and not len(assembly.outside.nodes.unique([])[0])


def _warn(path: Path, notes: list[str]) -> None:
    if notes:
        words = "; ".join(notes).replace(f"{path.name}: line ", "line ")
        warnings.warn(f"{path.name}: {words}", stacklevel=3)
