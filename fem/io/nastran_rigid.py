"""Supports, rigid elements and equations of a Nastran deck: SPC, RBE2, RBAR, RROD, RBE3 and MPC."""

from collections.abc import Iterator

from fem.io.frame_deck import Connection, Constraints, Motion, along, supports_of
from fem.io.nastran_deck import Card, NastranDeck

ALL = (0, 1, 2, 3, 4, 5)

# Sets -------------------------------------------------------------------------------------------------------


def selected(deck: NastranDeck, key: str, names: tuple[str, ...], adding: str) -> list[Card]:
    """Return the cards of the set that case control selects, or of the only one if there is none."""
    cards, sums = list(deck.of(*names)), deck.by_number(adding)
    if not cards:
        return []
    numbers = {card.integer(0) for card in cards}
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
        chosen = int(setting) if setting.isdecimal() and len(setting) < 20 else 0
    if chosen not in numbers | set(sums):
        cards[0].refuse(
            f"is in a set that is not selected: case control has {key} = {chosen}, which the file lacks"
        )
    wanted = set(_members(sums[chosen])) | {chosen} if chosen in sums else {chosen}
    return [card for card in cards if card.integer(0) in wanted]


def _members(card: Card) -> Iterator[int]:
    yield from (card.integer(k) for k in range(1, len(card.fields)) if card.text(k))


# Supports ---------------------------------------------------------------------------------------------------


def fixed_of(deck: NastranDeck) -> tuple[dict[int, tuple[str, ...]], tuple[Connection, ...]]:
    """Return fixed global directions by row of the grid points, and skew supports."""
    fixed: dict[int, set[int]] = {}
    given = next(deck.of("GRDSET"), None)
    for card in deck.of("GRID"):
        at = card if card.text(6) or given is None else given
        if components := at.directions(6):
            fixed.setdefault(deck.rows[card.integer(0)], set()).update(components)
    for card in selected(deck, "SPC", ("SPC", "SPC1"), "SPCADD"):
        for row, components in (_spc if card.name == "SPC" else _spc1)(deck, card):
            fixed.setdefault(row, set()).update(components)
    return supports_of(fixed, deck.axes, lambda row: f"skew support of {deck.grids.numbers[row]}")


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
            first, last = card.integer(k), card.integer(k + 2)
            if last - first > 10**7 or last < first:
                card.refuse(f"has the range {first} THRU {last}; it must rise, by at most 10000000")
            yield from ((n, False) for n in range(first, last + 1))
            k += 3
        else:
            yield card.integer(k), True
            k += 1


# Rigid elements and equations -------------------------------------------------------------------------------


def constraints_of(deck: NastranDeck) -> Constraints:
    """Return the rigid elements and the equations of the selected set."""
    out = Constraints(deck.points, deck.axes)
    for name, read in (("RBE2", _rbe2), ("RBAR", _rbar), ("RROD", _rrod), ("RBE3", _rbe3)):
        for card in deck.by_number(name).values():
            read(deck, card, out)
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
    out.follow(str(card), lead, dependents, components)


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
    if not (deck.points[b] - deck.points[a]).any():
        card.refuse("has no length")
    out.keep_distance(str(card), a, b)


def _rbe3(deck: NastranDeck, card: Card, out: Constraints) -> None:
    lead, components = deck.node(card, 2), card.directions(3)
    members = [(row, c, w) for row, cs, w in _weighted(deck, card) for c in cs]
    if not members or not components:
        card.refuse("has no grid points or components")
    if lead in {row for row, _, _ in members}:
        card.refuse(f"joins grid point {deck.grids.numbers[lead]} with itself")
    lost = out.average(str(card), lead, components, members)
    if lost is not None:
        card.refuse(f"does not determine its component {lost + 1} by the motions of its grid points")


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


def _mpc(deck: NastranDeck, card: Card) -> list[Motion]:
    """Return the motions of an MPC: two on a line, the others indented by one field."""
    motions: list[Motion] = []
    for k in (start + part for start in range(0, len(card.fields), 8) for part in (1, 4)):
        if card.text(k):
            components, factor = card.directions(k + 1), card.real(k + 2)
            if len(components) != 1:
                card.refuse(
                    f"has the component '{card.text(k + 1)}' in its field {k + 3}; one of 1 to 6 is needed"
                )
            row = deck.node(card, k)
            axis = along(components[0], deck.axes(row))
            motions.append((row, factor * deck.units.of_motions * axis))
    if not motions:
        card.refuse("has no terms")
    return motions
