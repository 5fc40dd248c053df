"""Bars of a Nastran deck: CBAR, CBEAM, CROD, CTUBE and CONROD with orientations, offsets and pin flags."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fem.elements.properties import STRAINS
from fem.io.array_types import Floats
from fem.io.frame_deck import BarProperty, Bars, Connection
from fem.io.frame_parts import axes_along, entry, parallel
from fem.io.nastran_deck import Card, NastranDeck
from fem.io.nastran_properties import BEAMS, Profile, Properties
from fem.model import DIRECTIONS

RODS = ("CROD", "CTUBE", "CONROD")

_DEFAULTS = {"CBAR": "BAROR", "CBEAM": "BEAMOR"}

_PINS = (0, 2, 1, 3, 5, 4)
"""Local direction of each of Nastran's pin flags 1 to 6: its y is local z, and its z is local -y."""


class Bar(NamedTuple):
    """One bar: its card, as :class:`Bars`, and what its property gives."""

    card: Card
    ends: tuple[int, int]
    place: int
    profile: Profile
    height: Floats
    offsets: Floats
    stiffness: Floats


def bars_of(deck: NastranDeck) -> tuple[Bars, tuple[BarProperty, ...], list[Connection]]:
    """Return the bars, their properties, and the torsional stiffness of rods."""
    properties = Properties(deck)
    found = [_beam(deck, properties, card) for card in deck.by_number(*BEAMS).values()]
    beams = {row for b in found for row in b.ends}
    rods = [_rod(deck, properties, card) for card in deck.by_number(*RODS).values()]
    _check_numbers(found, rods)
    twists = [t for rod in rods if (t := _twist(deck, properties, rod, beams)) is not None]
    found += rods
    deck.notes.plain.extend(properties.notes())
    rows = [(b.card.integer(0), b.ends, b.place, b.height, b.offsets, b.stiffness) for b in found]
    return Bars.of(rows), tuple(properties.found), twists


def _check_numbers(beams: list[Bar], rods: list[Bar]) -> None:
    numbers = {bar.card.integer(0): bar.card for bar in beams}
    for rod in rods:
        if rod.card.integer(0) in numbers:
            other = numbers[rod.card.integer(0)]
            rod.card.refuse(f"has the number of {other} at {other.place}; give one of them another number")


def _ends(deck: NastranDeck, card: Card, first: int) -> tuple[int, int]:
    a, b = deck.node(card, first), deck.node(card, first + 1)
    if a == b or not np.linalg.norm(deck.points[b] - deck.points[a]) > 0:
        card.refuse(
            f"has no length: grid points {card.text(first)} and {card.text(first + 1)} are at one place"
        )
    return a, b


def _rod(deck: NastranDeck, properties: Properties, card: Card) -> Bar:
    prop = None if card.name == "CONROD" else card.integer(1, card.integer(0))
    ends = _ends(deck, card, 1 if card.name == "CONROD" else 2)
    place, profile = properties.of(card, prop)
    return Bar(card, ends, place, profile, np.full(3, np.nan), np.zeros((2, 3)), np.full((2, 6), np.inf))


def _twist(deck: NastranDeck, properties: Properties, rod: Bar, beams: set[int]) -> Connection | None:
    """Return GJ/L of a rod as a spring between its ends, where both are on beams."""
    J = rod.profile.torsion
    if not J or not set(rod.ends) <= beams:
        if J:
            deck.notes.add(
                "stiffness of rods in torsion is taken only between grid points on beams", rod.profile.card
            )
        return None
    material = properties.found[rod.place].material
    line = deck.points[rod.ends[1]] - deck.points[rod.ends[0]]
    K = entry(3, material.G * J / float(np.linalg.norm(line)))
    return Connection(
        name=f"{rod.card} torsion", nodes=rod.ends, K=K, D=material.loss_factor * K, axes=axes_along(line)
    )


def _beam(deck: NastranDeck, properties: Properties, card: Card) -> Bar:
    card = _with_defaults(deck, card)
    ends = _ends(deck, card, 2)
    place, profile = properties.of(card, card.integer(1, card.integer(0)))
    if card.name == "CBEAM" and not card.blank(16, 18) and card.reals(16, 18).any():
        deck.notes.add("SA and SB, the scalar points of warping, are left out", card)
    flags = card.text(7)
    flags = "GGG" if flags in ("", "1", "2") else flags  # 1 and 2: a vector or G0, of older programs
    if len(flags) != 3 or flags[0] not in "GB" or set(flags[1:]) - set("GO"):
        card.refuse(f"has OFFT = {flags[:8]}; GGG is read, with B in the first and O in the other places")
    up = _orientation(deck, card, ends, flags[0])
    plain = deck.points[ends[1]] - deck.points[ends[0]]
    _check_orientation(card, plain, up)
    offsets = np.stack([_offset(deck, card, end, ends, flags[1 + end], plain, up) for end in (0, 1)])
    axis = plain + offsets[1] - offsets[0]
    if not np.linalg.norm(axis) > 0:
        card.refuse("has no length between its offset ends")
    _check_orientation(card, axis, up)
    offsets = offsets + profile.centroid @ axes_along(axis, up)[1:]
    if profile.centroid.any():
        deck.notes.add(
            "the bar's axis is that of the centroids; coupling of bending and torsion by the shear centre, "
            "which is elsewhere, needs the effect of the shear centre", profile.card)  # fmt: skip
    stiffness = np.stack([_pins(card, 8 + end) for end in (0, 1)])
    return Bar(card, ends, place, profile, up, offsets, _turned(card, _needed(stiffness), profile))


def _with_defaults(deck: NastranDeck, card: Card) -> Card:
    """Return a card with the blanks that BAROR or BEAMOR fills."""
    given = next(deck.of(_DEFAULTS[card.name]), None)
    fields = [card.text(k) for k in range(18)]
    if given is not None:
        if not fields[1]:
            fields[1] = given.text(1)
        if not any(fields[4:7]):
            fields[4:7] = [given.text(k) for k in (4, 5, 6)]
        if not fields[7]:
            fields[7] = given.text(7)
    return replace(card, fields=fields)


def _orientation(deck: NastranDeck, card: Card, ends: tuple[int, int], flag: str) -> Floats:
    """Return Nastran's y axis, roughly: a vector, or towards a grid point."""
    text = card.text(4)
    if text.isdigit() and card.blank(5, 7):
        return deck.points[deck.node(card, 4)] - deck.points[ends[0]]
    if card.blank(4, 7):
        card.refuse("has no orientation: neither X1 to X3, G0 nor a default by BAROR or BEAMOR")
    vector = card.reals(4, 7)
    return vector if flag == "B" else vector @ deck.axes(ends[0])


def _check_orientation(card: Card, axis: Floats, up: Floats) -> None:
    if parallel(axis, up, 1e-6):
        card.refuse("has its orientation vector along the bar; give one across it")


def _offset(
    deck: NastranDeck, card: Card, end: int, ends: tuple[int, int], flag: str, axis: Floats, up: Floats
) -> Floats:
    """Return an offset in global axes [m]; O has it in axes of the bar without offsets."""
    start = 10 + 3 * end
    offset = card.reals(start, start + 3) * deck.units.length
    return offset @ (axes_along(axis, up) if flag == "O" else deck.axes(ends[end]))


def _pins(card: Card, k: int) -> Floats:
    stiffness = np.full(6, np.inf)
    stiffness[[_PINS[c] for c in card.directions(k)]] = 0.0
    return stiffness


def _needed(stiffness: Floats) -> Floats:
    """Return pins without those that release what is free already: Nastran passes over them."""
    out = stiffness.copy()
    for (first, *others), most in STRAINS.values():
        count = 0
        for direction in (*others, first):
            column = DIRECTIONS.index(direction)
            for end in (0, 1):
                if out[end, column] == 0:
                    both = direction == first and end == 1 and out[0, column] == 0
                    out[end, column] = np.inf if count == most or both else 0.0
                    count += out[end, column] == 0
    return out


def _turned(card: Card, stiffness: Floats, profile: Profile) -> Floats:
    """Return pins in the axes of the section, which may be turned by an angle."""
    sections = [s for s in (profile.section, profile.section2) if s is not None]
    for pair in ((1, 2), (4, 5)):
        if (stiffness[:, pair[0]] == stiffness[:, pair[1]]).all():
            continue
        for section in sections:
            quarters = section.angle / (math.pi / 2)
            if abs(quarters - round(quarters)) > 1e-6:
                card.refuse(
                    "has a pin in one plane, but the principal axes of its section are turned "
                    f"by {math.degrees(section.angle):.1f} degrees (I12); pin both planes or none"
                )
        if round(sections[0].angle / (math.pi / 2)) % 2:
            stiffness = stiffness.copy()
            stiffness[:, list(pair)] = stiffness[:, list(reversed(pair))]
    return stiffness
