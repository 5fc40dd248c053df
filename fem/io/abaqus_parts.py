"""Nodes and elements of an Abaqus part, by number, with the lines that define them."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Bools, Floats, Ints
from fem.io.abaqus_sets import Sets
from fem.io.faults import error_at
from fem.mesh import MeshError

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
