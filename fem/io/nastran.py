"""Nastran bulk data (``.bdf``, ``.nas``, ``.fem``, ``.dat``): grid points and line elements.

meshio 5.3.5 reads them too, but wants ``BEGIN BULK`` and ``ENDDATA``, leaves elements in large-field format
out without a word, stops at elements without a property and takes coordinates in local systems for global
ones. So these are read here. :mod:`fem.io.nastran_names` lists the cards that are read, refused, named and
harmless.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Floats, Ints
from fem.io.deck import DeckBudget, integer, named
from fem.io.faults import error_at, refuse
from fem.io.nastran_cards import BulkData, Replicator, Run, columns_of, fields_of, real, runs_of
from fem.io.nastran_names import DEFAULTS, HARMLESS, LINES, NAMED, READ, REFUSED, SYSTEMS
from fem.io.nastran_systems import NastranSystems
from fem.io.rawmesh import RawMesh
from fem.mesh import MeshError

_BLANK = -(2**40)
"""Stands for an empty field of numbers that has a default."""

_PLOTEL, _CONROD, _CBEAM3 = (LINES.index(name) for name in ("PLOTEL", "CONROD", "CBEAM3"))
_BARS = ("CBAR", "CBEAM")

_REMEDIES = {
    "offsets": "give the members offset1 and offset2 in the study file",
    "pin flags": "give the members release1 or release2 in the study file (flags 1 to 6 are x y z rx ry rz "
    "of Nastran's axes, whose y is the study's z where the orientations are the same)",
    "displacement systems": "CD turns the directions of loads and results; positions stay",
    "permanent constraints": "give [[supports]] in the study file",
    "curved elements": "they are read as straight lines between their ends",
}


class _Columns:
    """Arrays that grow: in bulk, or row by row."""

    def __init__(self, n_integer: int, n_real: int) -> None:
        self.parts: tuple[list[Ints], list[Floats]] = ([], [])
        self.rows: tuple[list[list[int]], list[list[float]]] = ([], [])
        self.widths = (n_integer, n_real)

    def extend(self, integers: Ints, reals: Floats | None = None) -> None:
        """Append arrays (n, n_integer) and (n, n_real)."""
        self._flush()
        self.parts[0].append(integers)
        self.parts[1].append(np.empty((len(integers), 0)) if reals is None else reals)

    def append(self, integers: list[int], reals: list[float]) -> None:
        """Append a row."""
        self.rows[0].append(integers)
        self.rows[1].append(reals)

    def _flush(self) -> None:
        if self.rows[0]:
            self.parts[0].append(
                np.array(self.rows[0], dtype=np.int64).reshape(len(self.rows[0]), self.widths[0])
            )
            self.parts[1].append(
                np.array(self.rows[1], dtype=float).reshape(len(self.rows[0]), self.widths[1])
            )
            self.rows = ([], [])

    def all(self) -> tuple[Ints, Floats]:
        """Return all rows."""
        self._flush()
        integers = np.concatenate([np.empty((0, self.widths[0]), dtype=np.int64), *self.parts[0]])
        return integers, np.concatenate([np.empty((0, self.widths[1])), *self.parts[1]])


@dataclass(slots=True)
class _NastranReader:
    """The state while a deck is read.

    Rows of grid points are number, system, displacement system, line of the bulk data, with the local
    coordinates; those of elements are number, kind, property, three grid points with -1 for a third that is
    not there, line.
    """

    path: Path
    bulk: BulkData
    grids: _Columns = field(default_factory=lambda: _Columns(4, 3))
    elements: _Columns = field(default_factory=lambda: _Columns(7, 0))
    systems: NastranSystems = field(init=False)
    defaults: dict[str, tuple[list[str], str]] = field(default_factory=dict)
    counted: dict[str, tuple[int, str]] = field(default_factory=dict)
    others: dict[str, list[int]] = field(default_factory=dict)
    replicator: Replicator = field(default_factory=lambda: Replicator(DeckBudget()))
    skipping: bool = False
    _index: dict[int, tuple[int, Floats]] | None = None

    def __post_init__(self) -> None:
        self.systems = NastranSystems(self._grid)

    def read(self) -> RawMesh:
        """Return points, lines and sets."""
        for run in runs_of(self.bulk):
            self._run(run)
        with np.errstate(over="ignore", invalid="ignore"):  # Mesh names values that are not finite
            numbers, points = self._points()
        raw = RawMesh(points, notes=[*self.bulk.notes], point_numbers=numbers)
        self._lines(raw, numbers)
        self._name_others(raw)
        for what, (count, first) in self.counted.items():
            raw.notes.append(
                f"{count} card{'s' if count > 1 else ''} with {what} (first: {first}); {_REMEDIES[what]}"
            )
        raw.notes = [note.replace(f"{self.path.name}: line ", "line ") for note in raw.notes]
        return raw

    def _add(self, what: str, count: int, first: Callable[[], str]) -> None:
        if count:
            before = self.counted.get(what)
            self.counted[what] = (before[0] + count, before[1]) if before else (count, first())

    # Cards --------------------------------------------------------------------------------------------------

    def _run(self, run: Run) -> None:
        if run.name in REFUSED:
            msg = (
                f"{self.bulk.place(run.first)}: {run.name} ({REFUSED[run.name]}) is not supported; write the "
                "grid points and elements without it"
            )
            raise MeshError(msg)
        if run.name not in READ and not (run.name == "=" and not self.skipping):
            self.skipping = True
            rows = self.others.setdefault(run.name or "?", [0, run.first])
            rows[0] += run.count
            if run.name == "DTI":
                self._units(run)
            return
        self.skipping = False
        # the last card may be repeated by the next line, so that it is read by itself
        done = run.count - 1 if self._in_bulk(run) else 0
        for k in range(done, run.count):
            self._one(run.first + k * run.length, run.length)

    def _one(self, first: int, length: int) -> None:
        """Read one card, or the cards that it repeats."""
        name, fields = fields_of(self.bulk, first, length)
        for one, values in self.replicator.cards(name, fields, length, lambda: self.bulk.place(first)):
            self._card(one, values, first)

    def _units(self, run: Run) -> None:
        for first in range(run.first, run.first + run.count * run.length, run.length):
            name, fields = fields_of(self.bulk, first, run.length)
            if name == "DTI" and fields[0].upper() == "UNITS":
                words = " ".join(f for f in fields[2:] if f)
                self.bulk.notes.append(
                    f"{self.bulk.place(first)}: DTI,UNITS says {words[:60]}; coordinates are taken as they "
                    "are; give [mesh] scale if they are not in metres"
                )

    def _card(self, name: str, fields: list[str], row: int) -> None:
        fields = [*fields, *[""] * 24]
        try:
            if name == "GRID":
                self._grid_card(fields, row)
            elif name in SYSTEMS:
                self.systems.add(name, fields, self.bulk.place(row))
            elif name in DEFAULTS:
                self._default(name, fields, row)
            else:
                self._line_card(name, fields, row)
        except MeshError:
            raise
        except ValueError as reason:
            shown = ", ".join(fields[:6]).rstrip(", ")
            raise error_at(self.bulk.place(row), f"{name} {shown[:60]} cannot be read: {reason}") from reason

    def _default(self, name: str, fields: list[str], row: int) -> None:
        place = self.bulk.place(row)
        before = self.defaults.setdefault(name, (fields, place))
        if before[0] != fields:
            raise error_at(
                place, f"{name} gives other defaults than the one at {before[1]}; only one {name} is allowed"
            )

    def _grid_card(self, fields: list[str], row: int) -> None:
        cp, cd = (integer(f) if f else _BLANK for f in (fields[1], fields[5]))
        number = _number(fields[0])
        if any(fields[8:]):
            refuse(f"it has {next(f for f in fields[8:] if f)[:20]} after its eight fields")
        self.grids.append([number, cp, cd, row], [real(f) for f in fields[2:5]])
        if fields[6].strip("0"):
            self._add("permanent constraints", 1, lambda: f"GRID {number} at {self.bulk.place(row)}")

    def _line_card(self, name: str, fields: list[str], row: int) -> None:
        if name == "PLOTEL":
            for number, *ends in (fields[0:3], fields[4:7]):
                if number or any(ends):
                    self._line([_number(number), _PLOTEL, 0, *(_number(f) for f in ends), -1, row])
            return
        number, third = _number(fields[0]), -1
        prop = (integer(fields[1]) if fields[1] else _BLANK) if name != "CONROD" else 0
        ends = fields[1:3] if name == "CONROD" else fields[2:4]
        if name == "CBEAM3" and fields[4] and integer(fields[4]):
            third = _number(fields[4])
        self._line([number, LINES.index(name), prop, *(_number(f) for f in ends), third, row])

        def first() -> str:
            return f"{name} {number} at {self.bulk.place(row)}"

        if name in _BARS:
            pins, offsets = fields[8:10], fields[10:16]
            ends_free = [
                f"{end} = {pin}" for end, pin in zip(("PA", "PB"), pins, strict=True) if pin.strip("0")
            ]
            self._add("pin flags", int(bool(ends_free)), lambda: f"{first()}, {', '.join(ends_free)}")
            self._offset(offsets, first)
        elif name == "CBEAM3":
            self._offset(fields[8:17], first)
        elif name == "CBEND":
            self._add("curved elements", 1, first)

    def _offset(self, fields: list[str], first: Callable[[], str]) -> None:
        values = [real(f) for f in fields]
        words = "; ".join(
            f"W{end} = {x:g}, {y:g}, {z:g}"
            for end, (x, y, z) in zip("ABC", zip(*[iter(values)] * 3, strict=True), strict=False)
            if x or y or z
        )
        self._add("offsets", int(bool(words)), lambda: f"{first()}, {words}")

    def _line(self, values: list[int]) -> None:
        self.elements.append(values, [])

    # Many cards of one form at once -------------------------------------------------------------------------

    def _in_bulk(self, run: Run) -> bool:
        """Read all but the last card of a run; return False if the run needs reading card by card."""
        if run.count < 8 or run.name not in ("GRID", *_BARS, "CROD", "CTUBE", "CONROD"):
            return False
        columns = columns_of(self.bulk, run, range(8) if run.name == "GRID" else (*range(4), *range(8, 16)))
        if columns is None:
            return False
        columns = {k: column[:-1] for k, column in columns.items()}
        rows = run.first + run.length * np.arange(run.count - 1)
        try:
            read = self._grids_in_bulk if run.name == "GRID" else self._bars_in_bulk
            return read(run.name, columns, rows)
        except (ValueError, OverflowError):  # reading card by card names the fault
            return False

    def _grids_in_bulk(self, _: str, columns: dict[int, list[str]], rows: Ints) -> bool:
        n = len(rows)
        if not _empty(columns[6]) or not _empty(columns[7]):
            return False
        number, cp, cd = _ints(columns[0], n), _ints(columns[1], n, _BLANK), _ints(columns[5], n, _BLANK)
        xyz = np.column_stack([_reals(columns[k], n) for k in (2, 3, 4)])
        if number.min() < 1 or not np.isfinite(xyz).all():
            return False
        self.grids.extend(np.column_stack([number, cp, cd, rows]), xyz)
        return True

    def _bars_in_bulk(self, name: str, columns: dict[int, list[str]], rows: Ints) -> bool:
        n = len(rows)
        if not all(_empty(columns[k]) for k in range(8, 16)):
            return False
        number, zero = _ints(columns[0], n), np.zeros(n, dtype=np.int64)
        prop = zero if name == "CONROD" else _ints(columns[1], n, _BLANK)
        a, b = (_ints(columns[k], n) for k in ((1, 2) if name == "CONROD" else (2, 3)))
        if min(number.min(), a.min(), b.min()) < 1:
            return False
        kind = zero + LINES.index(name)
        self.elements.extend(np.column_stack([number, kind, prop, a, b, zero - 1, rows]))
        return True

    # Points -------------------------------------------------------------------------------------------------

    def _default_of(self, name: str, column: int) -> int:
        fields, place = self.defaults.get(name, ([""] * 8, ""))
        try:
            return integer(fields[column] or "0")
        except ValueError as reason:
            msg = f"{place}: {name} {', '.join(fields[:8]).rstrip(', ')} cannot be read: {reason}"
            raise MeshError(msg) from reason

    def _grid(self, number: int) -> tuple[int, Floats] | None:
        """Return the system and the local coordinates of a grid point."""
        if self._index is None:
            grids, xyz = self.grids.all()
            default = self._default_of("GRDSET", 1)
            cps = np.where(grids[:, 1] == _BLANK, default, grids[:, 1]).tolist()
            self._index = dict(zip(grids[:, 0].tolist(), zip(cps, xyz, strict=True), strict=True))
        return self._index.get(number)

    def _points(self) -> tuple[Ints, Floats]:
        """Return numbers and basic coordinates of the grid points."""
        grids, xyz = self.placed_grids()
        return grids[:, 0], xyz

    def placed_grids(self) -> tuple[Ints, Floats]:
        """Return number, system, displacement system and row of the grid points, and basic coordinates."""
        grids, xyz = self.grids.all()
        grids = grids.copy()
        for column, field_of_default in ((1, 1), (2, 5)):
            blank = grids[:, column] == _BLANK
            grids[blank, column] = self._default_of("GRDSET", field_of_default)
        kept = self._once("grid point", grids[:, 0], np.column_stack([grids[:, 1:3], xyz]), grids[:, 3])
        grids, xyz = grids[kept], xyz[kept].copy()
        turned = np.flatnonzero(grids[:, 2] != 0)
        self._add("displacement systems", len(turned), lambda: self._grid_place(grids[turned[0]]))
        if self.defaults.get("GRDSET", ([""] * 8, ""))[0][6].strip("0"):
            self._add("permanent constraints", len(grids), lambda: f"GRDSET at {self.defaults['GRDSET'][1]}")
        if grids[:, 1].any():
            order = np.argsort(grids[:, 1], kind="stable")
            cps, starts = np.unique(grids[order, 1], return_index=True)
            for cp, rows in zip(cps.tolist(), np.split(order, starts[1:]), strict=True):
                row = grids[rows[0]]
                place = f"{self.bulk.place(row[3])}: grid point {row[0]}"
                xyz[rows] = self.systems.to_basic(cp, xyz[rows], place)
        return grids, xyz

    def _grid_place(self, row: Ints) -> str:
        return f"GRID {row[0]} at {self.bulk.place(row[3])}"

    def _once(self, what: str, numbers: Ints, values: NDArray, rows: Ints) -> Ints:
        """Return the places of the first of equal numbers, whose values must be equal, too."""
        if (numbers[1:] > numbers[:-1]).all():
            return np.arange(len(numbers))
        order = np.argsort(numbers, kind="stable")
        new = np.concatenate([[True], numbers[order][1:] != numbers[order][:-1]])
        first = order[np.flatnonzero(new)[np.cumsum(new) - 1]]
        differ = (values[order] != values[first]).any(axis=1)
        if differ.any():
            k = np.flatnonzero(differ)[np.argmin(order[differ])]
            before, here = (self.bulk.place(int(rows[row])) for row in (first[k], order[k]))
            msg = (
                f"{here}: {what} {numbers[order[k]]} is already defined, differently, at {before}; "
                "give one of them another number"
            )
            raise MeshError(msg)
        return np.sort(order[new])

    # Lines --------------------------------------------------------------------------------------------------

    def _lines(self, raw: RawMesh, numbers: Ints) -> None:
        cards, _ = self.elements.all()
        plotted = cards[:, 1] == _PLOTEL
        if plotted.any() and not plotted.all():
            first = self.bulk.place(int(cards[plotted][0, 6]))
            raw.notes.append(
                f"{int(plotted.sum())} PLOTEL lines left out (first at {first}): they carry nothing, and the "
                "file has other elements"
            )
            cards = cards[~plotted]
        elif plotted.any():
            raw.notes.append(
                "all lines are PLOTEL cards, which carry nothing in Nastran; they are read as members"
            )
        cards = cards[self._once("element", cards[:, 0], cards[:, :6], cards[:, 6])]
        order = np.argsort(numbers)
        ordered, ends = numbers[order], cards[:, 3:6]
        at = np.minimum(np.searchsorted(ordered, ends), max(len(ordered) - 1, 0))
        there = ordered[at] == ends if len(ordered) else np.zeros_like(ends, dtype=bool)
        lost = (ends >= 0) & ~there
        if lost.any():
            row = int(np.flatnonzero(lost.any(axis=1))[0])
            point = ends[row][lost[row]][0]
            what = self._element_place(cards[row])
            refuse(f"{what} refers to grid point {point}, which the file does not have", MeshError)
        raw.lines = np.where(there, order[at], -1) if len(ordered) else ends
        same = (ends[:, 0] == ends[:, 1]) | (ends[:, 2] >= 0) & (ends[:, :2] == ends[:, 2:]).any(axis=1)
        if same.any():
            msg = f"{self._element_place(cards[np.flatnonzero(same)[0]])} joins a grid point with itself"
            raise MeshError(msg)
        if (raw.lines[:, 2] < 0).all():
            raw.lines = raw.lines[:, :2].copy()
        raw.line_numbers = cards[:, 0]
        self._properties(raw, cards)

    def _element_place(self, row: Ints) -> str:
        return f"{self.bulk.place(int(row[6]))}: {LINES[row[1]]} {row[0]}"

    def _properties(self, raw: RawMesh, cards: Ints) -> None:
        """Make a set of each property number, and of the cards that have none."""
        prop = cards[:, 2].copy()
        for name, default in (("CBAR", "BAROR"), ("CBEAM", "BEAMOR")):
            if default in self.defaults and (value := self._default_of(default, 1)):
                prop[(prop == _BLANK) & (cards[:, 1] == LINES.index(name))] = value
        prop = np.where(prop == _BLANK, cards[:, 0], prop)
        without = {_CONROD: "CONROD", _PLOTEL: "PLOTEL"}
        key = np.where(np.isin(cards[:, 1], list(without)), -1 - cards[:, 1], prop)
        order = np.argsort(key, kind="stable")
        keys, starts = np.unique(key[order], return_index=True)
        rows = np.split(order, starts[1:])
        for k in np.argsort([r[0] for r in rows] if len(keys) else []):
            name = without.get(-1 - int(keys[k])) or f"property {keys[k]}"
            raw.sets[name] = rows[k]

    # Other cards --------------------------------------------------------------------------------------------

    def _name_others(self, raw: RawMesh) -> None:
        """Count the cards left out: elements by type, cards that matter with a remedy, and unknown ones."""
        found: dict[str, list[str]] = {}
        for name, (count, row) in self.others.items():
            if name in HARMLESS or name == "=":
                continue
            if name[0] == "C" and name not in NAMED:
                raw.left_out[f"{name} cards"] += count
                continue
            words = "lines that are no cards" if name == "?" else name
            at = self.bulk.place(row)
            text = f"{words} ({count}, first at {at})" if count > 1 else f"{words} ({at})"
            found.setdefault(NAMED.get(name, ""), []).append(text)
        for remedy, texts in found.items():
            raw.notes.append(
                f"left out: {named(texts)}; {remedy}"
                if remedy
                else f"left out, because their meaning is not known: {named(texts)}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Grids:
    """The grid points of a deck.

    Attributes
    ----------
    numbers, displacement, rows : ndarray of int (n,)
        Their numbers, the systems of their motions, and the rows of their cards.
    points : ndarray (n, 3), basic coordinates
    systems : Systems
    """

    numbers: Ints
    displacement: Ints
    rows: Ints
    points: Floats
    systems: NastranSystems

    @property
    def axes(self) -> dict[int, Floats]:
        """Directions of motions (3, 3) by the numbers of points where they are not basic.

        Raises
        ------
        MeshError
            For fluid points, which no structure has.
        """
        out = {}
        for k in np.flatnonzero(self.displacement).tolist():
            number, system = int(self.numbers[k]), int(self.displacement[k])
            if system < 0:
                msg = f"grid point {number} is a fluid point (CD {system}), which no part of a structure has"
                raise MeshError(msg)
            out[number] = self.systems.axes_at(system, self.points[k], f"grid point {number}")
        return out


def read_grids(bulk: BulkData, path: Path | None = None) -> Grids:
    """Return the grid points and coordinate systems of bulk data; other cards count with a path only.

    Raises
    ------
    MeshError
        As :func:`read_nastran`.
    """
    reader = _NastranReader(path or Path(), bulk)
    for run in runs_of(bulk):
        if path is not None or run.name in ("GRID", "GRDSET", *SYSTEMS):
            reader._run(run)
    with np.errstate(over="ignore", invalid="ignore"):
        grids, points = reader.placed_grids()
    return Grids(grids[:, 0], grids[:, 2], grids[:, 3], points, reader.systems)


def _number(text: str) -> int:
    number = integer(text)
    if number < 1:
        refuse(f"'{text[:20]}' is not allowed; a number of at least 1 is needed")
    return number


def _empty(column: list[str]) -> bool:
    return not any(text.strip() for text in set(column))


def _ints(column: list[str], n: int, blank: int | None = None) -> Ints:
    """Return a column of whole numbers; empty fields are only allowed where they have a meaning."""
    if not column and blank is not None:
        return np.full(n, blank)
    joined = "".join(column)
    if "_" in joined or not joined.isascii():
        raise ValueError(joined[:0])
    if blank is None:
        return np.array(list(map(int, column)), dtype=np.int64)
    few = {text: int(text) if text.strip() else blank for text in set(column)}
    return np.array([few[text] for text in column], dtype=np.int64)


def _reals(column: list[str], n: int) -> Floats:
    if not column:
        return np.zeros(n)
    joined = "".join(column)
    if "_" in joined or not joined.isascii():
        raise ValueError(joined[:0])
    try:
        return np.array(list(map(float, column)))
    except ValueError:
        return np.array(list(map(real, column)))


def read_nastran(path: Path) -> RawMesh:
    """Read the lines of a Nastran file; each property number is a set, ``"property 3"``.

    Raises
    ------
    MeshError
        For cards that are not numbers, coordinate systems or grid points that are not there, numbers used
        twice for different things, and cards that change the mesh and are not read.
    """
    return _NastranReader(path, BulkData.of(path)).read()
