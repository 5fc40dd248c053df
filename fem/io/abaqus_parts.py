"""Nodes and elements of an Abaqus part, by number, with the lines that define them."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Bools, Floats, Ints
from fem.io.faults import error_at
from fem.mesh import MeshError

# Sets of an Abaqus deck: numbers, ranges, other sets, and those of instances --------------------------------


MOST_ENTRIES = 2_000_000
"""Lines of sets that sets may take over from others in one deck."""

MOST_MEMBERS = 50_000_000
"""Members of all sets together: 0.4 GB."""


@dataclass(frozen=True, slots=True, eq=False)
class AbaqusSetEntry:
    """Members that one line or block adds to a set.

    Attributes
    ----------
    place : file and line
    numbers : explicit members, or None
    span : first, last and step of a range, or None
    name : another set that is not known where it is used, or a label of an instance
    instance : the instance that numbers, range and name belong to
    of_elements : whether the nodes of an element set are meant
    taken : a sorted set as it was when an unsorted one took it in, or None
    """

    place: str
    numbers: Ints | None = None
    span: tuple[int, int, int] | None = None
    name: str = ""
    instance: str = ""
    of_elements: bool = False
    taken: "NamedSet | None" = None


@dataclass(slots=True)
class NamedSet:
    """A set: its entries, each once, whether it is shown, and whether it keeps its order.

    Sorted sets have no entries of sets that were taken in, but the entries of these.
    """

    entries: dict[int, AbaqusSetEntry] = field(default_factory=dict)
    internal: bool = False
    unsorted: bool = False


@dataclass(slots=True)
class Sets:
    """Element or node sets by name; a set that takes in another gets the members that it has by then."""

    word: str
    named: dict[str, NamedSet] = field(default_factory=dict)
    copied: int = 0

    def get(self, name: str) -> NamedSet | None:
        """Return a set by its name, in capitals where it is not there as written."""
        return self.named.get(name) or self.named.get(name.upper())

    def open(self, name: str) -> NamedSet:
        """Return a set to add to."""
        return self.named.setdefault(name, NamedSet())

    def add(self, name: str, entry: AbaqusSetEntry) -> None:
        """Add to a set."""
        self.open(name).entries[id(entry)] = entry

    def take_in(self, name: str, other: str, place: str) -> bool:
        """Add the members of another set; return False if that set is not known yet."""
        found = self.get(other)
        if found is None:
            return False
        self.copied += len(found.entries)
        if self.copied > MOST_ENTRIES:
            msg = f"{place}: sets include more than {MOST_ENTRIES} lines of other sets; nest fewer of them"
            raise MeshError(msg)
        mine = self.open(name)
        if mine.unsorted and not found.unsorted:
            self.add(name, AbaqusSetEntry(place, taken=NamedSet(dict(found.entries))))
        elif mine.unsorted:
            mine.entries.update(found.entries)
        else:
            mine.entries.update((id(entry), entry) for entry in flat(found.entries.values()))
        return True


def flat(entries: Iterable[AbaqusSetEntry]) -> Iterator[AbaqusSetEntry]:
    """Yield entries, those of sets that were taken in instead of these."""
    for entry in entries:
        yield from (entry,) if entry.taken is None else entry.taken.entries.values()


@dataclass(slots=True)
class Resolver:
    """Members of sets, as rows of the mesh.

    Attributes
    ----------
    file, word : the deck, and the kind of the sets' members, for messages
    sets : the sets of a part with those of its instance, nearest first, by owner
    rows : rows of the mesh of some numbers of an owner, -1 where the element or node is none
    known : the numbers of an owner, ascending, those of elements that are no lines included
    ranks : of the rows, by which the members of a set are ordered unless it is unsorted; None keeps the order
    unknown : set and place to the numbers or names that nothing in the deck has
    """

    file: str
    word: str
    sets: dict[str, list[Sets]]
    rows: Callable[[str, Ints], Ints]
    known: Callable[[str], Ints]
    nodes_of_elements: Callable[[str, str], Ints | None]
    ranks: Ints | None = None
    unknown: dict[str, dict[str, None]] = field(default_factory=dict)
    _members: dict[tuple[str, int], Ints] = field(default_factory=dict)
    _done: dict[tuple[str, str], Ints] = field(default_factory=dict)
    _total: int = 0

    def members(self, owner: str, name: str) -> Ints:
        """Return the rows of a set, each once: ascending numbers, or the order of the file."""
        waiting, under_way = [(owner, name)], {}
        while waiting:
            key = waiting[-1]
            if key in self._done:
                under_way.pop(waiting.pop(), None)
                continue
            needed = [(o, n, e) for o, n, e in self._needed(*key) if (o, n) not in self._done]
            if not needed:
                self._done[key] = self._built(*key)
                continue
            under_way[key] = None
            loop = next((n for n in needed if n[:2] in under_way), None)
            if loop is not None:
                names = " and ".join(dict.fromkeys([key[1], loop[1]]))
                msg = (
                    (
                        f"{loop[2].place}: the {self.word} set {names} refers to itself, directly or through "
                        "other sets"
                    )
                    if key[1] == loop[1]
                    else (f"{loop[2].place}: the {self.word} sets {names} refer to each other")
                )
                raise MeshError(msg)
            waiting += [(o, n) for o, n, _ in needed]
        return self._done[owner, name]

    def _entries(self, owner: str, name: str) -> Iterator[AbaqusSetEntry]:
        for sets in reversed(self.sets.get(owner, [])):
            found = sets.named.get(name)
            if found is not None:
                yield from found.entries.values()

    def _needed(self, owner: str, name: str) -> Iterator[tuple[str, str, AbaqusSetEntry]]:
        for entry in flat(self._entries(owner, name)):
            if entry.name and not entry.of_elements:
                found = self.owner_of(owner, entry)
                if found is not None and not isinstance(found[1], int):
                    yield found[0], found[1], entry

    def owner_of(self, owner: str, entry: AbaqusSetEntry) -> tuple[str, str | int] | None:
        """Return the instance and the set, or the number, that a name stands for; None if nothing has it."""
        if entry.instance:
            places = [(entry.instance, entry.name)]
        else:
            places = [(owner, entry.name)]
            parts = entry.name.split(".")
            places += [(".".join(parts[:k]), ".".join(parts[k:])) for k in range(1, min(len(parts), 8))]
        for instance, rest in places:
            instance, rest = instance.strip('"'), rest.strip('"')
            if instance != owner and instance not in self.sets:
                instance = instance.upper()
            if instance != owner and instance not in self.sets:
                continue
            if instance != owner and rest.isdigit() and rest.isascii() and len(rest) < 19:
                return instance, int(rest)
            for sets in self.sets.get(instance, []):
                for word in (rest, rest.upper()):
                    if word in sets.named:
                        return instance, word
        return None

    def _built(self, owner: str, name: str) -> Ints:
        found = [sets.named[name] for sets in self.sets.get(owner, []) if name in sets.named]
        rows = self._gathered(owner, name, self._entries(owner, name), any(one.unsorted for one in found))
        self._count(len(rows))
        return rows

    def _gathered(self, owner: str, name: str, entries: Iterable[AbaqusSetEntry], unsorted: bool) -> Ints:
        """Return the rows of entries, each once, in the order of a set."""
        found = [self._rows_of(owner, name, entry) for entry in entries]
        rows = found[0] if len(found) == 1 else np.concatenate([np.empty(0, dtype=np.int64), *found])
        rows = rows[rows >= 0] if rows.size and rows.min() < 0 else rows
        if self.ranks is not None and not unsorted:
            ranks = self.ranks[rows]
            return rows if (ranks[1:] > ranks[:-1]).all() else rows[np.unique(ranks, return_index=True)[1]]
        if not (rows[1:] > rows[:-1]).all():
            _, first = np.unique(rows, return_index=True)
            rows = rows[np.sort(first)]
        return rows

    def _count(self, n: int) -> None:
        self._total += n
        if self._total > MOST_MEMBERS:
            raise error_at(
                self.file, f"the sets have more than {MOST_MEMBERS} members in all; leave some of them out"
            )

    def _rows_of(self, owner: str, name: str, entry: AbaqusSetEntry) -> Ints:
        key = (owner, id(entry))
        if key not in self._members:
            self._members[key] = self._looked_up(owner, name, entry)
            self._count(len(self._members[key]))
        return self._members[key]

    def _looked_up(self, owner: str, name: str, entry: AbaqusSetEntry) -> Ints:
        if entry.taken is not None:
            return self._gathered(owner, name, entry.taken.entries.values(), False)
        place = f"{self.word} set {name[:60]} ({entry.place})"
        if entry.of_elements:
            found = self.nodes_of_elements(entry.instance or owner, entry.name)
            if found is None:
                self._miss(place, f"element set {entry.name}")
            return np.empty(0, dtype=np.int64) if found is None else found
        if entry.name:
            target = self.owner_of(owner, entry)
            if target is None:
                self._miss(place, entry.name)
                return np.empty(0, dtype=np.int64)
            if not isinstance(target[1], int):
                return self._done[target[0], target[1]]
            return self._existing(place, target[0], np.array([target[1]]), f"{target[0]}.")
        holder = entry.instance or owner
        if entry.instance and entry.instance not in self.sets:
            self._miss(place, f"instance {entry.instance}")
            return np.empty(0, dtype=np.int64)
        if entry.numbers is not None:
            return self._existing(place, holder, entry.numbers)
        first, last, step = entry.span or (1, 0, 1)
        known = self.known(holder)
        low, high = np.searchsorted(known, [max(first, 0), min(last, 2**62) + 1])
        found = known[low:high]
        found = found[(found - first) % step == 0] if abs(first) < 2**62 else found[:0]
        asked = (last - first) // step + 1
        if asked > len(found):
            self._miss(place, f"{asked - len(found)} of the {asked} numbers {first} to {last}")
        return self.rows(holder, found)

    def _existing(self, place: str, owner: str, numbers: Ints, prefix: str = "") -> Ints:
        known = self.known(owner)
        at = np.minimum(np.searchsorted(known, numbers), max(len(known) - 1, 0))
        there = known[at] == numbers if len(known) else np.zeros(len(numbers), dtype=bool)
        for number in numbers[~there][:21].tolist():
            self._miss(place, f"{prefix}{number}")
        return self.rows(owner, numbers[there])

    def _miss(self, place: str, what: str) -> None:
        self.unknown.setdefault(place, {})[what[:60]] = None


# ------------------------------------------------------------------------------------------------------------


LARGEST = 2**31 - 1
"""Largest number of a node or element: that of CalculiX; Abaqus has nine digits."""


class AbaqusTable:
    """Numbered rows in the order of the file; a number that comes again stands for its last row.

    Parameters
    ----------
    word : str
        ``"node"`` or ``"element"``.
    dtype : type
        Of the values, three to a row: coordinates, or node numbers with -1 for a third that is not there.
    """

    def __init__(self, word: str, dtype: type) -> None:
        self.word = word
        self.size = 0
        self._numbers: Ints = np.empty(0, dtype=np.int64)
        self._values = np.empty((0, 3), dtype=dtype)
        self._lines = np.empty(0, dtype=np.int64)
        self._files = np.empty(0, dtype=np.int32)
        self._row_of: dict[int, int] = {}
        self._indexed = 0
        self.file_names: list[str] = []

    def add(self, numbers: ArrayLike, values: ArrayLike, lines: ArrayLike, file: str) -> None:
        """Append rows."""
        numbers = np.atleast_1d(np.asarray(numbers, dtype=np.int64))
        n, stop = len(numbers), self.size + len(numbers)
        lines = np.broadcast_to(np.asarray(lines, dtype=np.int64), (n,))
        bad = np.flatnonzero((numbers < 1) | (numbers > LARGEST))
        if bad.size:
            msg = (
                f"{file}: line {lines[bad[0]]}: {self.word} number {numbers[bad[0]]} is not allowed; "
                f"numbers run from 1 to {LARGEST}"
            )
            raise MeshError(msg)
        if stop > len(self._numbers):
            more = max(stop, 2 * self.size) if self.size else stop
            for name in ("_numbers", "_values", "_lines", "_files"):
                old = getattr(self, name)[: self.size]
                room = np.empty((more - self.size, *old.shape[1:]), dtype=old.dtype)
                setattr(self, name, np.concatenate([old, room]))
        if not self.file_names or self.file_names[-1] != file:
            self.file_names.append(file)
        new = slice(self.size, stop)
        self._numbers[new], self._values[new], self._lines[new] = numbers, values, lines
        self._files[new] = len(self.file_names) - 1
        self.size = stop

    def extend(self, other: "AbaqusTable") -> None:
        """Append the rows of another table."""
        for k, file in enumerate(other.file_names):
            rows = np.flatnonzero(other._files[: other.size] == k)
            self.add(other._numbers[rows], other._values[rows], other._lines[rows], file)

    def find(self, number: int) -> int | None:
        """Return the row of a number so far, None if there is none."""
        if self._indexed < self.size:
            new = self._numbers[self._indexed : self.size].tolist()
            self._row_of.update(zip(new, range(self._indexed, self.size), strict=True))
            self._indexed = self.size
        return self._row_of.get(number)

    def values(self, row: int | Ints) -> NDArray:
        """Return the values of a row, or of several."""
        return self._values[row]

    def numbers(self) -> Ints:
        """Return the numbers of all rows, with those that come again."""
        return self._numbers[: self.size]

    def place(self, row: int) -> str:
        """Return file and line of a row."""
        return f"{self.file_names[self._files[row]]}: line {self._lines[row]}"

    def unique(self, notes: list[str]) -> tuple[Ints, Ints]:
        """Return numbers, each once, and the row that each stands for; differing rows are named.

        Abaqus takes the last definition of a node or an element that is defined again.
        """
        numbers: Ints = self.numbers()
        if bool((numbers[1:] > numbers[:-1]).all()):
            return numbers, np.arange(self.size, dtype=np.int64)
        order = np.argsort(numbers, kind="stable")
        ordered = numbers[order]
        new = np.concatenate([[True], ordered[1:] != ordered[:-1]])
        start = np.flatnonzero(new)
        last = order[np.append(start[1:], len(order)) - 1]
        self._name_redefined(order, new, notes)
        by_place = np.argsort(order[start], kind="stable")
        return ordered[start][by_place], last[by_place]

    def _name_redefined(self, order: Ints, new: Bools, notes: list[str]) -> None:
        values = self._values[: self.size]
        slack = 1e-9 * float(np.ptp(values, axis=0).max()) if values.dtype == float else 0.0
        a, b = order[:-1][~new[1:]], order[1:][~new[1:]]
        differ = np.flatnonzero((np.abs(values[a] - values[b]) > slack).any(axis=1))
        if not differ.size:
            return
        k = differ[np.argmin(b[differ])]
        other = "coordinates" if self.word == "node" else "nodes"
        count = np.unique(self._numbers[b[differ]]).size
        more = f"; {count - 1} more {self.word}s likewise" if count > 1 else ""
        notes.append(
            f"{self.word} {self._numbers[b[k]]} is defined at {self.place(int(a[k]))} and with other {other} "
            f"at {self.place(int(b[k]))}; the last definition is taken, as Abaqus does{more}"
        )


@dataclass(slots=True)
class Skipped:
    """Elements that are no lines: their type, numbers, and where they are."""

    kind: str
    numbers: Ints
    file: str
    lines: Ints


@dataclass(slots=True)
class AbaqusPart:
    """Nodes, elements and sets of a part, an instance or the deck outside of parts.

    Attributes
    ----------
    name : as in the deck, empty outside of parts
    place : where it begins
    nodes, elements : tables by number
    skipped : elements that are no lines
    sets : element sets and node sets
    system : axes (3, 3) and origin (3,) of ``*SYSTEM``, None for the global ones
    """

    name: str = ""
    place: str = ""
    nodes: AbaqusTable = field(default_factory=lambda: AbaqusTable("node", float))
    elements: AbaqusTable = field(default_factory=lambda: AbaqusTable("element", np.int64))
    skipped: list[Skipped] = field(default_factory=list)
    sets: dict[str, Sets] = field(default_factory=lambda: {"ELSET": Sets("element"), "NSET": Sets("node")})
    system: tuple[Floats, Floats] | None = None
    _kinds: dict[int, str] = field(default_factory=dict)
    _indexed: int = 0

    def empty(self) -> bool:
        """Return whether nothing is defined."""
        return not (self.nodes.size or self.elements.size or self.skipped)

    def coordinates(self, number: int, place: str) -> Floats:
        """Return where a node that was defined before is, shape (3,)."""
        row = self.nodes.find(number)
        if row is None:
            raise error_at(place, f"node {number} is not defined before this line")
        return self.nodes.values(row)

    def kind_of_skipped(self, number: int) -> str | None:
        """Return the type of an element that is no line, None if it is not defined."""
        for skipped in self.skipped[self._indexed :]:
            self._kinds.update(dict.fromkeys(skipped.numbers.tolist(), skipped.kind))
        self._indexed = len(self.skipped)
        return self._kinds.get(number)

    def count_skipped(self) -> Counter[str]:
        """Return how many elements of each type are no lines."""
        found: Counter[str] = Counter()
        for skipped in self.skipped:
            found[f"{skipped.kind} elements"] += len(skipped.numbers)
        return found
