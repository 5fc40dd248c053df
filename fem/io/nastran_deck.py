"""A Nastran deck as cards with their places: what the readers of a frame's bars and connections share."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from fem.array_types import Floats, Ints
from fem.io.deck import integer
from fem.io.deck_units import DeckUnits
from fem.io.faults import error_at
from fem.io.nastran import Grids, read_grids
from fem.io.nastran_cards import BulkData, each_card, real
from fem.io.nastran_comments import Names, names_of
from fem.mesh import MeshError

_SETTING = re.compile(r"^\s*([A-Z0-9]+)\s*(?:\([^)]*\))?\s*(?:=|\s)\s*(\S+)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Card:
    """One card.

    Attributes
    ----------
    name : in capitals
    fields : texts after the name, counted from 0
    place : file and line
    """

    name: str
    fields: Sequence[str]
    place: str

    def refuse(self, reason: str) -> NoReturn:
        """Raise a MeshError that names the card."""
        raise error_at(self.place, f"{self} {reason}")

    def __str__(self) -> str:
        return f"{self.name} {self.text(0)}".strip()

    def text(self, k: int) -> str:
        """Return a field, empty if the card has none."""
        return self.fields[k].strip().upper() if k < len(self.fields) else ""

    def integer(self, k: int, default: int | None = None) -> int:
        """Return a whole number; a blank needs a default."""
        text = self.text(k)
        if not text and default is not None:
            return default
        try:
            return integer(text)
        except ValueError:
            self._unlike(k, "a whole number")

    def real(self, k: int, default: float = 0.0) -> float:
        """Return a number."""
        text = self.text(k)
        try:
            return real(text) if text else default
        except ValueError:
            self._unlike(k, "a number")

    def reals(self, start: int, stop: int) -> Floats:
        """Return several numbers, zero for blanks."""
        return np.array([self.real(k) for k in range(start, stop)])

    def blank(self, start: int, stop: int) -> bool:
        """Return whether all these fields are empty."""
        return not any(self.text(k) for k in range(start, stop))

    def directions(self, k: int) -> tuple[int, ...]:
        """Return the components 1 to 6 of a field as 0 to 5."""
        text = self.text(k).replace(" ", "")
        if text.strip("0123456"):
            self._unlike(k, "some of the components 1 to 6")
        return tuple(sorted({int(c) - 1 for c in text if c != "0"}))

    def _unlike(self, k: int, needed: str) -> NoReturn:
        self.refuse(f"has '{self.text(k)[:20]}' in its field {k + 2}; {needed} is needed there")


@dataclass(slots=True)
class Notes:
    """Sentences on cards that were left out or taken in part, each with its count and first card."""

    found: dict[str, list] = field(default_factory=dict)
    plain: list[str] = field(default_factory=list)

    def add(self, sentence: str, card: Card) -> None:
        """Count a card under a sentence."""
        entry = self.found.setdefault(sentence, [0, f"{card} at {card.place}"])
        entry[0] += 1

    def all(self) -> tuple[str, ...]:
        """Return the sentences."""
        counted = (
            f"{first}{f' and {n - 1} more' if n > 1 else ''}: {sentence}"
            for sentence, (n, first) in self.found.items()
        )
        return (*self.plain, *counted)


@dataclass(frozen=True, slots=True, eq=False)
class NastranDeck:
    """Cards, grid points and case control of a deck.

    Attributes
    ----------
    file : str, its name
    cards : mapping of str to list of Card, by name
    grids : Grids
    units : Units
    control : tuple of mapping, or None
        Settings of the subcases with those above them; None of a file without case control.
    notes : Notes
    points : ndarray (n, 3), of the grid points [m]
    rows : mapping of int to int, row of each grid point's number
    names : Names, that comments give
    """

    file: str
    cards: Mapping[str, list[Card]]
    grids: Grids
    units: DeckUnits
    control: tuple[Mapping[str, str], ...] | None
    notes: Notes
    points: Floats
    rows: Mapping[int, int]
    names: Names = field(default_factory=Names)

    def of(self, *names: str) -> Iterator[Card]:
        """Yield the cards of some names."""
        for name in names:
            yield from self.cards.get(name, ())

    def by_number(self, *names: str) -> dict[int, Card]:
        """Return the cards of some names by their numbers, which must differ."""
        found: dict[int, Card] = {}
        for card in self.of(*names):
            old = found.setdefault(card.integer(0), card)
            if old is not card and (old.name, list(old.fields)) != (card.name, list(card.fields)):
                card.refuse(f"is already defined, differently, at {old.place}; give one another number")
        return found

    def node(self, card: Card, k: int) -> int:
        """Return the row of the grid point in a field."""
        return self.row(card, card.integer(k))

    def row(self, card: Card, number: int) -> int:
        """Return the row of a grid point."""
        if number not in self.rows:
            scalar = next((one for one in self.of("SPOINT") if _lists(one, number)), None)
            if scalar is not None:
                card.refuse(
                    f"refers to the scalar point {number} of SPOINT at {scalar.place}; in a frame, cards "
                    "refer to grid points alone"
                )
            card.refuse(f"refers to grid point {number}, which the file does not have")
        return self.rows[number]

    def axes(self, rows: int | Ints) -> Floats:
        """Return the axes of grid points' motions, as rows (…, 3, 3)."""
        rows = np.asarray(rows)
        systems = self.grids.displacement[rows]
        axes = np.broadcast_to(np.eye(3), (*rows.shape, 3, 3)).copy()
        for at in np.argwhere(systems > 0).tolist():
            axes[*at] = self._axes_of_point(int(systems[*at]), int(rows[*at]))
        return axes

    def _axes_of_point(self, system: int, row: int) -> Floats:
        number = self.grids.numbers[row]
        if system in self.grids.systems.named:
            return self.system_axes(system, row, f"{self.file}: grid point {number}")
        # only the message needs the line, and a search of all cards costs
        place = next((c.place for c in self.of("GRID") if c.text(0) == str(number)), self.file)
        return self.system_axes(system, row, f"{place}: grid point {number}")

    def system_axes(self, system: int, row: int, place: str) -> Floats:
        """Return the axes of a coordinate system at a grid point."""
        return self.grids.systems.axes_at(system, self.grids.points[row], place)

    def axes_of(self, card: Card, system: int, row: int) -> Floats:
        """Return the axes of a system that a card names, at a grid point; below 1 those of the deck."""
        return np.eye(3) if system < 1 else self.system_axes(system, row, f"{card.place}: {card}")

    def setting(self, key: str) -> str | None:
        """Return what case control selects: the same in all subcases, or None."""
        values = {one.get(key) for one in self.control or ()}
        if len(values) > 1:
            msg = (
                f"{self.file}: the subcases select different sets by {key}: "
                f"{', '.join(sorted(v or 'none' for v in values))}; write a deck for each of them"
            )
            raise MeshError(msg)
        return values.pop() if values else None

    def parameter(self, name: str, default: float) -> float:
        """Return the number of a PARAM card; YES is 1 and NO is -1."""
        found = [card for card in self.of("PARAM") if card.text(0) == name]
        if not found:
            return default
        words = {"YES": 1.0, "Y": 1.0, "NO": -1.0, "N": -1.0}
        return words[found[-1].text(1)] if found[-1].text(1) in words else found[-1].real(1, default)

    @property
    def mass_factor(self) -> float:
        """Factor of all masses, PARAM WTMASS, in SI."""
        return self.parameter("WTMASS", 1.0)


def _lists(card: Card, number: int) -> bool:
    """Return whether an SPOINT has a number, by itself or in a range with THRU."""
    if card.text(1) == "THRU":
        return card.integer(0) <= number <= card.integer(2)
    return str(number) in (card.text(k) for k in range(len(card.fields)))


def open_deck(path: Path, units: DeckUnits) -> NastranDeck:
    """Read the cards, the grid points and the case control of a deck."""
    bulk = BulkData.of(path)
    cards: dict[str, list[Card]] = {}
    order: list[tuple[int, str, str]] = []
    for name, fields, row in each_card(bulk):
        cards.setdefault(name, []).append(Card(name, fields, bulk.place(row)))
        order.append((row, name, fields[0]))
    grids = read_grids(bulk, path)
    return NastranDeck(
        file=path.name,
        cards=cards,
        grids=grids,
        units=units,
        control=None if bulk.control is None else tuple(_subcases(bulk.control)),
        notes=Notes(plain=list(bulk.notes)),
        points=grids.points * units.length,
        rows={n: k for k, n in enumerate(grids.numbers.tolist())},
        names=names_of(bulk.comments, order),
    )


def _subcases(lines: Sequence[str]) -> list[dict[str, str]]:
    """Return the settings of the subcases that ask for modes, or of all, or those above them."""
    above: dict[str, str] = {}
    subcases: list[dict[str, str]] = []
    for line in lines:
        match = _SETTING.match(line.split("$")[0])
        if match is None:
            continue
        key, value = match.group(1).upper(), match.group(2)
        if key == "SUBCASE":
            subcases.append(dict(above))
        else:
            (subcases[-1] if subcases else above)[key] = value
    with_modes = [one for one in subcases if "METHOD" in one]
    return with_modes or subcases or [above]
