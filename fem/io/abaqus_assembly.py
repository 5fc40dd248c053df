"""Parts and instances of an Abaqus deck put together: one list of points, lines and sets."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Floats, Ints
from fem.io.abaqus_parts import AbaqusPart, AbaqusSetEntry, AbaqusTable, Resolver
from fem.io.deck import DeckBudget, named
from fem.io.faults import error_at
from fem.io.rawmesh import RawMesh
from fem.mesh import MeshError


@dataclass(slots=True)
class Instance:
    """A part at a place.

    Attributes
    ----------
    name, part : names of the instance and of the part
    place : where it begins in the deck
    turn, shift : points x of the part become turn @ x + shift
    extra : nodes, elements and sets that the instance has in addition to those of its part
    """

    name: str
    part: str
    place: str = ""
    turn: Floats = field(default_factory=lambda: np.eye(3))
    shift: Floats = field(default_factory=lambda: np.zeros(3))
    extra: AbaqusPart = field(default_factory=AbaqusPart)


class _Rows:
    """Rows of the mesh that an owner's numbers have."""

    def __init__(self, numbers: Ints, first: int, others: list[Ints]) -> None:
        order = np.argsort(numbers, kind="stable")
        self.sorted, self.order, self.first = numbers[order], order, first
        self.known = np.unique(np.concatenate([numbers, *others])) if others else self.sorted

    def of(self, numbers: Ints) -> Ints:
        """Return the rows of numbers, -1 for those without one."""
        if not len(self.sorted):
            return np.full(np.shape(numbers), -1)
        at = np.minimum(np.searchsorted(self.sorted, numbers), len(self.sorted) - 1)
        return np.where(self.sorted[at] == numbers, self.first + self.order[at], -1)

    def ranks(self) -> Ints:
        """Return the place of each row in the order of numbers, after all rows before these."""
        found = np.empty(len(self.order), dtype=np.int64)
        found[self.order] = self.first + np.arange(len(self.order))
        return found


@dataclass(slots=True)
class Assembly:
    """Parts, instances and sets of a deck.

    Attributes
    ----------
    file : name for messages
    outside : nodes, elements and sets outside of parts, or in the assembly
    parts, instances : by name
    notes : sentences on the data left out so far
    """

    file: str
    outside: AbaqusPart
    parts: dict[str, AbaqusPart]
    instances: dict[str, Instance]
    notes: list[str]
    budget: DeckBudget
    _placed: set[str] = field(default_factory=set)
    _counts: tuple[int, int] = (0, 0)
    _points: list[Floats] = field(default_factory=list)
    _lines: list[Ints] = field(default_factory=list)
    _numbers: tuple[list[Ints], list[Ints]] = field(default_factory=lambda: ([], []))
    _rows: dict[str, dict[str, _Rows]] = field(default_factory=lambda: {"NSET": {}, "ELSET": {}})
    _owned: dict[str, tuple[Instance, list[AbaqusPart]]] = field(default_factory=dict)
    _resolvers: dict[str, Resolver] = field(default_factory=dict)

    def mesh(self) -> RawMesh:
        """Return all parts at their places.

        Raises
        ------
        MeshError
            For parts and nodes that are not there.
        """
        owners = self._owned = self._owners()
        redefined: list[str] = []
        with np.errstate(over="ignore", invalid="ignore"):
            for owner, (instance, parts) in owners.items():
                self._place(owner, instance, parts, redefined)
        raw = RawMesh(
            _joined(self._points, (0, 3), float),
            _joined(self._lines, (0, 3), np.int64),
            point_numbers=_joined(self._numbers[0], (0,), np.int64),
            line_numbers=_joined(self._numbers[1], (0,), np.int64),
        )
        if (raw.lines[:, 2] < 0).all():
            raw.lines = raw.lines[:, :2].copy()
        for _, parts in owners.values():
            for part in parts:
                raw.left_out += part.count_skipped()
        self._name_sets(raw, owners)
        raw.notes += [*dict.fromkeys(redefined), *self.notes]
        raw.notes = [note.replace(f"{self.file}: line ", "line ") for note in raw.notes]
        return raw

    def owners_of(self, part: AbaqusPart) -> list[Instance]:
        """Return the instances of a part, after :meth:`mesh`; that without a name is the deck's outside."""
        return [instance for instance, parts in self._owned.values() if any(p is part for p in parts)]

    def elements_of_owners(self) -> Iterator[tuple[str, list[int], list[AbaqusPart]]]:
        """Give owners, the numbers of their elements in the order of the mesh's rows, and their parts."""
        for (owner, (_, parts)), numbers in zip(self._owned.items(), self._numbers[1], strict=True):
            yield owner, numbers.tolist(), parts

    def rows_of(self, keyword: str, owner: str, label: str) -> Ints | None:
        """Return the mesh's rows of a number or a set as an owner names it, after :meth:`mesh`.

        None for a label that the deck does not have; ``keyword`` is ``"NSET"`` or ``"ELSET"``.
        """
        if label.isascii() and label.isdigit() and len(label) < 19:
            rows = self._rows[keyword][owner].of(np.array([int(label)]))
            return rows if rows[0] >= 0 else None
        resolver = self._resolvers[keyword]
        found = resolver.owner_of(owner, AbaqusSetEntry(self.file, name=label))
        if found is None:
            return None
        if isinstance(found[1], int):
            return self.rows_of(keyword, found[0], str(found[1]))
        return resolver.members(found[0], found[1])

    def node_sets(self) -> tuple[dict[str, Ints], list[str]]:
        """Return the node numbers of the sets outside of parts, and notes on missing nodes that they name."""
        numbers, _ = self.outside.nodes.unique([])
        owners = {"": (Instance("", ""), [self.outside])}
        self._rows["NSET"][""] = _Rows(numbers, 0, [])
        element_numbers, rows = self.outside.elements.unique([])
        nodes = self._rows["NSET"][""].of(self.outside.elements.values(rows))
        self._lines = [np.where(self.outside.elements.values(rows) < 0, -1, nodes)]
        self._rows["ELSET"][""] = _Rows(element_numbers, 0, [s.numbers for s in self.outside.skipped])
        elements = self._resolver("ELSET", owners, np.empty((0, 3), dtype=np.int64))
        found = self._resolver("NSET", owners, self._lines[0], elements)
        sets = {
            name: numbers[found.members("", name)]
            for name, one in self.outside.sets["NSET"].named.items()
            if not one.internal
        }
        return sets, _unknown(found.unknown)

    def _owners(self) -> dict[str, tuple[Instance, list[AbaqusPart]]]:
        """Return the instances, or the parts where there are none, each with its parts."""
        owners: dict[str, tuple[Instance, list[AbaqusPart]]] = {}
        for name, instance in self.instances.items():
            part = self.parts.get(instance.part)
            if part is None:
                raise error_at(
                    instance.place, f"instance {name} refers to part {instance.part}, which the file lacks"
                )
            owners[name] = (instance, [instance.extra, part])
        used = {instance.part for instance in self.instances.values()}
        if not self.instances:
            owners |= {name: (Instance(name, name), [part]) for name, part in self.parts.items()}
            if self.parts:
                self.notes.append("the file has no *INSTANCE, so each part is read once, at its coordinates")
        elif lost := [name for name, part in self.parts.items() if name not in used and not part.empty()]:
            self.notes.append(f"parts without an instance left out: {named(lost)}")
        owners[""] = (Instance("", ""), [self.outside])
        return owners

    def _place(self, owner: str, instance: Instance, parts: list[AbaqusPart], redefined: list[str]) -> None:
        """Add a part to the mesh, turned and moved to its place."""
        filled = [part for part in reversed(parts) if not part.empty()]
        nodes = _merged("node", float, [p.nodes for p in filled], redefined)
        elements = _merged("element", np.int64, [p.elements for p in filled], redefined)
        if instance.part in self._placed:
            self.budget.take(len(nodes[0]) + len(elements[0]), instance.place, "*INSTANCE")
        self._placed.add(instance.part)
        first = self._counts
        self._counts = (first[0] + len(nodes[0]), first[1] + len(elements[0]))
        rows = self._rows["NSET"][owner] = _Rows(nodes[0], first[0], [])
        skipped = [s.numbers for part in parts for s in part.skipped]
        self._rows["ELSET"][owner] = _Rows(elements[0], first[1], skipped)
        redefined += _lines_and_others(elements[0], elements[2], parts)
        chains = rows.of(elements[1])
        absent = (chains < 0) & (elements[1] >= 0)
        lost = np.flatnonzero(absent.any(axis=1))
        if lost.size:
            row = int(lost[0])
            node = elements[1][row][absent[row]][0]
            msg = (
                f"{elements[2](row)}: element {elements[0][row]} refers to node {node}, which the "
                f"{'instance' if instance.place else 'file'} does not have"
            )
            raise MeshError(msg)
        same = (chains[:, 0] == chains[:, 1]) | (chains[:, 2] >= 0) & (
            (chains[:, 2] == chains[:, 0]) | (chains[:, 2] == chains[:, 1])
        )
        if same.any():
            row = int(np.flatnonzero(same)[0])
            raise error_at(
                elements[2](row), f"element {elements[0][row]} joins a node with itself; give it two nodes"
            )
        self._points.append(nodes[1] @ instance.turn.T + instance.shift if instance.place else nodes[1])
        self._lines.append(chains)
        self._numbers[0].append(nodes[0])
        self._numbers[1].append(elements[0])

    def _name_sets(self, raw: RawMesh, owners: dict[str, tuple[Instance, list[AbaqusPart]]]) -> None:
        elements = self._resolver("ELSET", owners, raw.lines)
        nodes = self._resolver("NSET", owners, raw.lines, elements)
        self._resolvers = {"ELSET": elements, "NSET": nodes}
        several = len(self.instances) > 1
        for resolver, keyword, target in ((elements, "ELSET", raw.sets), (nodes, "NSET", raw.point_sets)):
            for owner, (_, parts) in owners.items():
                prefix = f"{owner}." if several and owner else ""
                shown = dict.fromkeys(
                    name
                    for part in reversed(parts)
                    for name, one in part.sets[keyword].named.items()
                    if not one.internal
                )
                for name in shown:
                    rows, key = resolver.members(owner, name), prefix + name
                    target[key] = np.concatenate([target[key], rows]) if key in target else rows
        raw.notes += _unknown({**elements.unknown, **nodes.unknown})

    def _resolver(
        self,
        keyword: str,
        owners: dict[str, tuple[Instance, list[AbaqusPart]]],
        lines: Ints,
        elements: Resolver | None = None,
    ) -> Resolver:
        rows = self._rows[keyword]
        # Abaqus sorts node sets, instance by instance; the order of elements in a set has no meaning
        ranks = None if elements is None else np.concatenate([rows[owner].ranks() for owner in owners])

        def nodes_of_elements(owner: str, name: str) -> Ints | None:
            if elements is None or not any(s.get(name) for s in elements.sets.get(owner, [])):
                return None
            known = next(n for s in elements.sets[owner] for n in (name, name.upper()) if n in s.named)
            found = np.unique(lines[elements.members(owner, known)])
            return found[found >= 0]

        return Resolver(
            self.file,
            "element" if keyword == "ELSET" else "node",
            {owner: [part.sets[keyword] for part in parts] for owner, (_, parts) in owners.items()},
            lambda owner, numbers: rows[owner].of(numbers),
            lambda owner: rows[owner].known,
            nodes_of_elements,
            ranks,
        )


def _lines_and_others(numbers: Ints, place: Callable[[int], str], parts: list[AbaqusPart]) -> list[str]:
    """Return sentences on numbers that a line and an element of another type have."""
    notes: list[str] = []
    for skipped in (skipped for part in parts for skipped in part.skipped):
        both, row, other = np.intersect1d(numbers, skipped.numbers, return_indices=True)
        if both.size:
            more = f"; {both.size - 1} more likewise" if both.size > 1 else ""
            notes.append(
                f"element {both[0]} is a line at {place(int(row[0]))} and of type {skipped.kind} at "
                f"{skipped.file}: line {skipped.lines[other[0]]}; the line is read{more}"
            )
    return notes


def _merged(
    word: str, dtype: type, tables: list[AbaqusTable], notes: list[str]
) -> tuple[Ints, NDArray, Callable[[int], str]]:
    """Return numbers, values and a function for the place of a row, of tables whose last one counts."""
    table = tables[0] if len(tables) == 1 else AbaqusTable(word, dtype)
    for one in tables if len(tables) > 1 else ():
        table.extend(one)
    numbers, rows = table.unique(notes)
    return numbers, table.values(rows), lambda row: table.place(int(rows[row]))


def _joined(parts: list[NDArray], shape: tuple[int, ...], dtype: type) -> NDArray:
    return np.concatenate(parts) if parts else np.empty(shape, dtype=dtype)


def _unknown(unknown: dict[str, dict[str, None]]) -> list[str]:
    """Return one sentence of the members that sets name and that nothing has."""
    if not unknown:
        return []
    # Lines of sets that one sentence lists
    found = [f"{place} names {named(list(what))}" for place, what in list(unknown.items())[:5]]
    more = len(unknown) - len(found)
    rest = f"; {more} more lines of sets likewise" if more else ""
    return [f"sets name members that the file does not have, which are ignored: {'; '.join(found)}{rest}"]
