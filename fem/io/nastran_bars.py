"""Bars of a Nastran deck: CBAR, CBEAM, CROD, CTUBE and CONROD with orientations, offsets and pin flags."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fem.array_types import Bools, Floats, Ints
from fem.elements.properties import STRAINS
from fem.io.frame_deck import BarProperty, Bars, Connection, axes_along, entry, parallel
from fem.io.nastran_deck import Card, NastranDeck
from fem.io.nastran_properties import BEAMS, Profile, Properties
from fem.model import DIRECTIONS

RODS = ("CROD", "CTUBE", "CONROD")

DEFAULTS = {"CBAR": "BAROR", "CBEAM": "BEAMOR"}


_NO_VECTOR: Floats = np.full(3, np.nan)
_NO_OFFSETS: Floats = np.zeros(6)
_RIGID: Floats = np.full((2, 6), np.inf)


class NastranBar(NamedTuple):
    """One bar as its card has it, and what its property gives.

    Attributes
    ----------
    card : Card
    ends : (int, int), rows of the grid points
    place : int, of its property in the list
    profile : Profile
    axes : str, OFFT
    up : ndarray (3,), X1 to X3, NaN where a grid point gives the orientation
    toward : int, row of that grid point, -1 without one
    offsets : ndarray (6,), W1A to W3B
    stiffness : ndarray (2, 6), infinite where rigid and zero where released, in axes of the section
    """

    card: Card
    ends: tuple[int, int]
    place: int
    profile: Profile
    axes: str = "GGG"
    up: Floats = _NO_VECTOR
    toward: int = -1
    offsets: Floats = _NO_OFFSETS
    stiffness: Floats = _RIGID


def bars_of(deck: NastranDeck) -> tuple[Bars, tuple[BarProperty, ...], list[Connection]]:
    """Return the bars, their properties, and the torsional stiffness of rods."""
    properties = Properties(deck)
    defaults = {name: next(deck.of(card), None) for name, card in DEFAULTS.items()}
    beams = [
        _beam(deck, properties, _with_defaults(card, defaults[card.name]))
        for card in deck.by_number(*BEAMS).values()
    ]
    rods = [_rod(deck, properties, card) for card in deck.by_number(*RODS).values()]
    _check_numbers(beams, rods)
    found = beams + rods
    ends = np.array([bar.ends for bar in found], dtype=np.int64).reshape(-1, 2)
    _check_lengths(deck, found, ends)
    height, offsets = np.full((len(found), 3), np.nan), np.zeros((len(found), 2, 3))
    if beams:
        n = len(beams)
        height[:n], offsets[:n] = _placed(deck, beams, ends[:n])
    on_beams = {row for bar in beams for row in bar.ends}
    twists = [t for rod in rods if (t := _twist(deck, properties, rod, on_beams)) is not None]
    deck.notes.plain.extend(properties.notes())
    places = _named_blocks(deck, properties, found)
    bars = Bars(
        numbers=np.array([bar.card.integer(0) for bar in found], dtype=np.int64),
        ends=ends,
        properties=np.array(places, dtype=np.int64),
        height=height,
        offsets=offsets,
        stiffness=np.array([bar.stiffness for bar in found]).reshape(-1, 2, 6),
    )
    return bars, tuple(properties.found), twists


def _named_blocks(deck: NastranDeck, properties: Properties, bars: list[NastranBar]) -> list[int]:
    """Return the place of each bar's property; blocks of one property have it under the block's name.

    A comment above all bars, or above bars of several properties, is no name of members.
    """
    blocks = [deck.names.blocks.get(bar.card.integer(0), "") for bar in bars]
    several: dict[str, set[int]] = {}
    for bar, block in zip(bars, blocks, strict=True):
        several.setdefault(block, set()).add(bar.place)
    names = {block for block, places in several.items() if block and len(places) == 1}
    if len(several) == 1:
        names = set()
    found = {block: len(properties.found) + k for k, block in enumerate(sorted(names, key=blocks.index))}
    for block in found:
        properties.found.append(replace(properties.found[next(iter(several[block]))], name=block))
    return [found.get(block, bar.place) for bar, block in zip(bars, blocks, strict=True)]


def _check_numbers(beams: list[NastranBar], rods: list[NastranBar]) -> None:
    numbers = {bar.card.integer(0): bar.card for bar in beams}
    for rod in rods:
        if rod.card.integer(0) in numbers:
            other = numbers[rod.card.integer(0)]
            rod.card.refuse(f"has the number of {other} at {other.place}; give one of them another number")


def _ends(deck: NastranDeck, card: Card, first: int) -> tuple[int, int]:
    return deck.node(card, first), deck.node(card, first + 1)


def _check_lengths(deck: NastranDeck, bars: list[NastranBar], ends: Ints) -> None:
    line = deck.points[ends[:, 1]] - deck.points[ends[:, 0]]
    k = _first(~(np.linalg.norm(line, axis=1) > 0))
    if k is not None:
        a, b = deck.grids.numbers[ends[k]]
        bars[k].card.refuse(f"has no length: grid points {a} and {b} are at one place")


def _first(bad: Bools) -> int | None:
    return int(np.argmax(bad)) if bad.any() else None


def _rod(deck: NastranDeck, properties: Properties, card: Card) -> NastranBar:
    prop = None if card.name == "CONROD" else card.integer(1, card.integer(0))
    ends = _ends(deck, card, 1 if card.name == "CONROD" else 2)
    return NastranBar(card, ends, *properties.of(card, prop))


def _twist(deck: NastranDeck, properties: Properties, rod: NastranBar, beams: set[int]) -> Connection | None:
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


def _beam(deck: NastranDeck, properties: Properties, card: Card) -> NastranBar:
    ends = _ends(deck, card, 2)
    place, profile = properties.of(card, card.integer(1, card.integer(0)))
    if card.name == "CBEAM" and not card.blank(16, 18) and card.reals(16, 18).any():
        deck.notes.add("SA and SB, the scalar points of warping, are left out", card)
    flags = card.text(7)
    flags = "GGG" if flags in ("", "1", "2") else flags  # 1 and 2: a vector or G0, of older programs
    if len(flags) != 3 or flags[0] not in "GB" or set(flags[1:]) - set("GO"):
        card.refuse(f"has OFFT = {flags[:8]}; GGG is read, with B in the first and O in the other places")
    up, toward = _NO_VECTOR, -1
    if card.text(4).isdigit() and card.blank(5, 7):
        toward = deck.node(card, 4)
    elif card.blank(4, 7):
        card.refuse("has no orientation: neither X1 to X3, G0 nor a default by BAROR or BEAMOR")
    else:
        up = card.reals(4, 7)
    stiffness = _RIGID
    if not card.blank(8, 10):
        stiffness = _turned(card, _needed(np.stack([_pins(card, 8), _pins(card, 9)])), profile)
    offsets = _NO_OFFSETS if card.blank(10, 16) else card.reals(10, 16)
    return NastranBar(card, ends, place, profile, flags, up, toward, offsets, stiffness)


def _with_defaults(card: Card, given: Card | None) -> Card:
    """Return a card with the blanks that BAROR or BEAMOR fills."""
    if given is None:
        return card
    fields = [card.text(k) for k in range(18)]
    if not fields[1]:
        fields[1] = given.text(1)
    if not any(fields[4:7]):
        fields[4:7] = [given.text(k) for k in (4, 5, 6)]
    if not fields[7]:
        fields[7] = given.text(7)
    return replace(card, fields=fields)


def _placed(deck: NastranDeck, beams: list[NastranBar], ends: Ints) -> tuple[Floats, Floats]:
    """Return the orientations (n, 3) and offsets (n, 2, 3) of bars in global axes."""
    start = deck.points[ends[:, 0]]
    plain = deck.points[ends[:, 1]] - start
    axes = np.array([bar.axes for bar in beams])
    up = np.array([bar.up for bar in beams])
    basic = axes.astype("U1") == "B"
    up = np.where(basic[:, None], up, np.einsum("ni,nij->nj", up, deck.axes(ends[:, 0])))
    toward = np.array([bar.toward for bar in beams])
    up = np.where(toward[:, None] < 0, up, deck.points[toward] - start)
    _check_orientations(beams, plain, up)

    offsets = np.array([bar.offsets for bar in beams]).reshape(-1, 2, 3) * deck.units.length
    local = np.array([[flag == "O" for flag in bar.axes[1:]] for bar in beams])
    R = np.where(local[..., None, None], axes_along(plain, up)[:, None], deck.axes(ends))
    offsets = np.einsum("nei,neij->nej", offsets, R)
    axis = plain + offsets[:, 1] - offsets[:, 0]
    k = _first(~(np.linalg.norm(axis, axis=1) > 0))
    if k is not None:
        beams[k].card.refuse("has no length between its offset ends")
    _check_orientations(beams, axis, up)

    places = np.array([bar.place for bar in beams])
    for place, profile in {bar.place: bar.profile for bar in beams}.items():
        if not profile.centroid.any():
            continue
        rows = np.flatnonzero(places == place)
        offsets[rows] += profile.centroid @ axes_along(axis[rows], up[rows])[:, 1:]
        for _ in rows:
            deck.notes.add(
                "the bar's axis is that of the centroids; coupling of bending and torsion by the shear "
                "centre, which is elsewhere, needs the effect of the shear centre",
                profile.card,
            )
    return up, offsets


def _check_orientations(beams: list[NastranBar], axis: Floats, up: Floats) -> None:
    k = _first(parallel(axis, up, 1e-6))
    if k is not None:
        beams[k].card.refuse("has its orientation vector along the bar; give one across it")


def _pins(card: Card, k: int) -> Floats:
    stiffness = np.full(6, np.inf)
    # Local direction of each of Nastran's pin flags 1 to 6: its y is local z, and its z is local -y
    stiffness[[(0, 2, 1, 3, 5, 4)[c] for c in card.directions(k)]] = 0.0
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
