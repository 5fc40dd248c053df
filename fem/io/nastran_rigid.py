"""Supports, rigid elements and equations of a Nastran deck: SPC, RBE2, RBAR, RROD, RBE3 and MPC."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from fem.io.frame_deck import Connection, Equation, Link
from fem.io.nastran_deck import Card, Floats, NastranDeck
from fem.model import DIRECTIONS, lever_matrix

Terms = list[tuple[int, str, float]]

ALL = (0, 1, 2, 3, 4, 5)


@dataclass(slots=True)
class Constraints:
    """What the cards give.

    Attributes
    ----------
    links : list of Link
    equations : list of Equation
    """

    links: list[Link] = field(default_factory=list)
    equations: list[Equation] = field(default_factory=list)

    def equate(self, name: str, terms: Iterable[tuple[int, str, float]]) -> None:
        """Add an equation; terms of one degree of freedom are added up."""
        total: dict[tuple[int, str], float] = {}
        for row, direction, value in terms:
            total[row, direction] = total.get((row, direction), 0.0) + value
        largest = max(map(abs, total.values()), default=0.0)
        kept = tuple((r, d, v) for (r, d), v in total.items() if abs(v) > 1e-12 * largest)
        if kept:
            self.equations.append(Equation(name=name, terms=kept))


# Sets -------------------------------------------------------------------------------------------------------


def selected(deck: NastranDeck, key: str, names: tuple[str, ...], adding: str) -> list[Card]:
    """Return the cards of the set that case control selects, or of the only one if there is none.

    Raises
    ------
    MeshError
        Without case control and with several sets, and for sets that the file does not have.
    """
    cards, sums = list(deck.of(*names)), deck.by_number(adding)
    if not cards:
        return []
    numbers = {card.whole(0) for card in cards}
    if deck.control is None:
        added = {n for card in sums.values() for n in _members(card)}
        roots = sorted(set(sums) or numbers - added)
        if len(roots) > 1:
            cards[0].refuse(
                f"is in one of the sets {', '.join(map(str, roots))}, and there is no case control that "
                f"selects one; write {key} = {roots[0]} and BEGIN BULK before the cards, or delete the others"
            )
        chosen = roots[0]
        deck.notes.plain.append(f"there is no case control; {key} set {chosen} is taken")
    else:
        setting = deck.setting(key)
        if setting is None:
            deck.notes.add(f"left out, because case control has no {key}", cards[0])
            return []
        chosen = int(setting) if setting.isdigit() else 0
    if chosen not in numbers | set(sums):
        cards[0].refuse(
            f"is in a set that is not selected: case control has {key} = {chosen}, which the file lacks"
        )
    wanted = set(_members(sums[chosen])) | {chosen} if chosen in sums else {chosen}
    return [card for card in cards if card.whole(0) in wanted]


def _members(card: Card) -> Iterator[int]:
    yield from (card.whole(k) for k in range(1, len(card.fields)) if card.text(k))


# Supports ---------------------------------------------------------------------------------------------------


def supports_of(deck: NastranDeck) -> tuple[dict[int, tuple[str, ...]], list[Connection]]:
    """Return fixed global directions by row of the grid points, and skew supports.

    Raises
    ------
    MeshError
        For unknown grid points and components, and sets that are not clear.
    """
    fixed: dict[int, set[int]] = {}
    given = next(deck.of("GRDSET"), None)
    for card in deck.of("GRID"):
        at = card if card.text(6) or given is None else given
        if components := at.directions(6):
            fixed.setdefault(deck.rows[card.whole(0)], set()).update(components)
    for card in selected(deck, "SPC", ("SPC", "SPC1"), "SPCADD"):
        for row, components in (_spc if card.name == "SPC" else _spc1)(deck, card):
            fixed.setdefault(row, set()).update(components)
    supports: dict[int, tuple[str, ...]] = {}
    skew: list[Connection] = []
    for row, components in fixed.items():
        _support(deck, row, components, supports, skew)
    return supports, skew


def _spc(deck: NastranDeck, card: Card) -> Iterator[tuple[int, tuple[int, ...]]]:
    for k in (1, 4):
        if card.text(k):
            if card.real(k + 2):
                deck.notes.add("the enforced motion is left out; the direction is fixed", card)
            yield deck.node(card, k), card.directions(k + 1)


def _spc1(deck: NastranDeck, card: Card) -> Iterator[tuple[int, tuple[int, ...]]]:
    components = card.directions(1)
    for number, sure in _listed(card, 2):
        if sure or number in deck.rows:
            yield deck.row(card, number), components


def _listed(card: Card, start: int) -> Iterator[tuple[int, bool]]:
    """Yield numbers of a list with THRU, and whether they are named rather than within a range."""
    k = start
    while k < len(card.fields):
        if not card.text(k):
            k += 1
        elif card.text(k + 1) == "THRU":
            first, last = card.whole(k), card.whole(k + 2)
            if last - first > 10**7 or last < first:
                card.refuse(f"has the range {first} THRU {last}; it must rise, by at most 10000000")
            yield from ((n, False) for n in range(first, last + 1))
            k += 3
        else:
            yield card.whole(k), True
            k += 1


def _support(
    deck: NastranDeck,
    row: int,
    components: set[int],
    supports: dict[int, tuple[str, ...]],
    skew: list[Connection],
) -> None:
    """Sort the fixed components of one grid point into global directions and those of a skew support."""
    axes = deck.axes(row)
    plain: list[str] = []
    rigid: list[str] = []
    for turn in (0, 3):
        part = sorted(c - turn for c in components if turn <= c < turn + 3)
        along = [int(np.argmax(np.abs(axes[c]))) for c in part]
        if len(part) == 3:
            along = [0, 1, 2]
        elif any(abs(abs(axes[c, k]) - 1) > 1e-12 for c, k in zip(part, along, strict=True)):
            rigid += [DIRECTIONS[turn + c] for c in part]
            continue
        plain += [DIRECTIONS[turn + k] for k in along]
    if plain:
        supports[row] = tuple(sorted(plain, key=DIRECTIONS.index))
    if rigid:
        name = f"skew support of {deck.grids.numbers[row]}"
        skew.append(Connection(name=name, nodes=(row, None), rigid=tuple(rigid), axes=axes))


# Rigid elements and equations -------------------------------------------------------------------------------


def constraints_of(deck: NastranDeck) -> Constraints:
    """Return the rigid elements and the equations of the selected set.

    Raises
    ------
    MeshError
        For elements that join a grid point with itself, or are not determined.
    """
    out = Constraints()
    for card in deck.by_number("RBE2").values():
        _rbe2(deck, card, out)
    for card in deck.by_number("RBAR").values():
        _rbar(deck, card, out)
    for card in deck.by_number("RROD").values():
        _rrod(deck, card, out)
    for card in deck.by_number("RBE3").values():
        _rbe3(deck, card, out)
    for k, card in enumerate(selected(deck, "MPC", ("MPC",), "MPCADD"), start=1):
        out.equate(f"MPC {card.text(0)} ({k})", _mpc(deck, card))
    return out


def _rbe2(deck: NastranDeck, card: Card, out: Constraints) -> None:
    lead, components = deck.node(card, 1), card.directions(2)
    last = len(card.fields)
    while last > 3 and (not card.text(last - 1) or "." in card.text(last - 1)):
        last -= 1  # the coefficient of thermal expansion
    short = Card(card.name, card.fields[:last], card.place)
    numbers = [deck.row(card, n) for n, sure in _listed(short, 3) if sure or n in deck.rows]
    if not numbers or not components:
        card.refuse("has no dependent grid points or components")
    _rigid(deck, card, lead, tuple(dict.fromkeys(numbers)), components, out)


def _rigid(
    deck: NastranDeck,
    card: Card,
    lead: int,
    dependents: tuple[int, ...],
    components: tuple[int, ...],
    out: Constraints,
) -> None:
    """Let some components of grid points follow another one."""
    if lead in dependents:
        card.refuse(f"joins grid point {deck.grids.numbers[lead]} with itself")
    plain = [
        row for row in dependents
        if all(len([c for c in components if t <= c < t + 3]) in (0, 3) for t in (0, 3))
        or np.allclose(deck.axes(row), np.eye(3))
    ]  # fmt: skip
    if plain:
        directions = tuple(DIRECTIONS[c] for c in components)
        out.links.append(Link(name=str(card), node=lead, dependents=tuple(plain), directions=directions))
    for row in (r for r in dependents if r not in plain):
        lever = lever_matrix(deck.points[row] - deck.points[lead])
        for c in components:
            axis = np.zeros(6)
            axis[3 * (c // 3) : 3 * (c // 3) + 3] = deck.axes(row)[c % 3]
            out.equate(f"{card} at {deck.grids.numbers[row]}, {c + 1}", [
                *_terms(row, axis), *_terms(lead, -axis @ lever),
            ])  # fmt: skip


def _terms(row: int, coefficients: Floats) -> Terms:
    return [(row, d, float(c)) for d, c in zip(DIRECTIONS, coefficients, strict=True) if c]


def _rbar(deck: NastranDeck, card: Card, out: Constraints) -> None:
    a, b = deck.node(card, 1), deck.node(card, 2)
    free_a, free_b, bound_a, bound_b = (card.directions(k) for k in (3, 4, 5, 6))
    if len(free_a) + len(free_b) != 6:
        card.refuse(
            f"has CNA = {card.text(3)} and CNB = {card.text(4)}; they need six independent components in all"
        )
    if (not bound_a and not bound_b) or len(bound_a) + len(bound_b) == 6:
        # all six relations of a rigid body, whichever of its motions are called independent
        _rigid(deck, card, a, (b,), ALL, out)
    elif free_a == ALL and not bound_a:
        _rigid(deck, card, a, (b,), bound_b, out)
    elif free_b == ALL and not bound_b:
        _rigid(deck, card, b, (a,), bound_a, out)
    else:
        card.refuse(
            "has independent components at both ends and only some dependent ones; write it as RBE2 or MPC"
        )


def _rrod(deck: NastranDeck, card: Card, out: Constraints) -> None:
    """Keep the distance of two grid points."""
    a, b = deck.node(card, 1), deck.node(card, 2)
    line = deck.points[b] - deck.points[a]
    if not np.linalg.norm(line) > 0:
        card.refuse("has no length")
    axis = np.append(line / np.linalg.norm(line), np.zeros(3))
    out.equate(str(card), [*_terms(b, axis), *_terms(a, -axis)])


def _rbe3(deck: NastranDeck, card: Card, out: Constraints) -> None:
    """Let a grid point follow the rigid motion that fits those of others best, in weighted least squares.

    Rotations weigh by the square of the mean distance of the others from it.
    """
    lead, components = deck.node(card, 2), card.directions(3)
    rows = [(row, c, w) for row, cs, w in _weighted(deck, card) for c in cs]
    if not rows or not components:
        card.refuse("has no grid points or components")
    if lead in {row for row, _, _ in rows}:
        card.refuse(f"joins grid point {deck.grids.numbers[lead]} with itself")
    others = list(dict.fromkeys(row for row, _, _ in rows))
    length = float(np.linalg.norm(deck.points[others] - deck.points[lead], axis=1).mean()) or 1.0
    S = np.array(
        [_moved(deck, row, c) @ lever_matrix(deck.points[row] - deck.points[lead]) for row, c, _ in rows]
    )
    W = np.array([w * (length**2 if c >= 3 else 1.0) for _, c, w in rows])
    scale = np.repeat([1.0, 1 / length], 3)  # so that translations and rotations compare
    normal = (S * scale).T * W @ (S * scale)
    fit = scale[:, None] * np.linalg.pinv(normal, rcond=1e-10) @ ((S * scale).T * W)
    for c in components:
        axis = _moved(deck, lead, c)
        if np.linalg.norm(axis @ fit @ S - axis) > 1e-6 * np.abs(axis).max() * max(1.0, length, 1 / length):
            card.refuse(f"does not determine its component {c + 1} by the motions of its grid points")
        terms = [
            (row, d, -float(f) * a)
            for (row, one, _), f in zip(rows, axis @ fit, strict=True)
            for _, d, a in deck.directed(row, one)
        ]
        out.equate(f"{card}, {c + 1}", [*_terms(lead, axis), *terms])


def _moved(deck: NastranDeck, row: int, component: int) -> Floats:
    """Return a component of a grid point's motion as factors of its six global motions."""
    axis = np.zeros(6)
    turn = 3 * (component // 3)
    axis[turn : turn + 3] = deck.axes(row)[component % 3]
    return axis


def _weighted(deck: NastranDeck, card: Card) -> Iterator[tuple[int, tuple[int, ...], float]]:
    """Yield row, components and weight of the grid points of an RBE3."""
    k, n = 4, len(card.fields)
    while k < n and card.text(k) not in ("UM", "ALPHA"):
        if not card.text(k):
            k += 1
            continue
        weight, components = card.real(k), card.directions(k + 1)
        if not weight > 0:
            card.refuse(f"has the weight {weight:g}; it must be positive")
        k += 2
        while k < n and card.text(k) not in ("UM", "ALPHA") and "." not in card.text(k):
            if card.text(k):
                yield deck.node(card, k), components, weight
            k += 1
    if any(card.text(j) == "UM" for j in range(k, n)):
        card.refuse("has dependent components by UM; it is read with those of the reference point alone")


def _mpc(deck: NastranDeck, card: Card) -> Terms:
    """Return the terms of an MPC: two on a line, the others indented by one field."""
    terms: Terms = []
    for k in (start + part for start in range(0, len(card.fields), 8) for part in (1, 4)):
        if card.text(k):
            components, factor = card.directions(k + 1), card.real(k + 2)
            if len(components) != 1:
                card.refuse(
                    f"has the component '{card.text(k + 1)}' in its field {k + 3}; one of 1 to 6 is needed"
                )
            terms += [
                (r, d, factor * a * _length(deck, d))
                for r, d, a in deck.directed(deck.node(card, k), components[0])
            ]
    if not terms:
        card.refuse("has no terms")
    return terms


def _length(deck: NastranDeck, direction: str) -> float:
    """Return the factor of a coefficient from the deck's units: those of rotations have a length."""
    return deck.units.length if direction.startswith("r") else 1.0
