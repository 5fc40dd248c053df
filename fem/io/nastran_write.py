"""Nastran decks: a model, or cards for one, in large fields of 16 columns."""

import math
from collections.abc import Iterator, Sequence
from itertools import count
from typing import Any

import numpy as np

from fem.io.deck_nodes import (
    all_matrices,
    equation_cells,
    first_element,
    first_number,
    fixed_components,
    matrix_entries,
    notes_of,
    plain,
    solved_equations,
    text_of,
    with_nodes,
    wrapped,
)
from fem.io.deck_units import DeckUnits
from fem.io.faults import refuse
from fem.io.frame_deck import BarProperty, Body, Connection
from fem.io.frame_of_model import ModelDeck
from fem.mesh import MeshError
from fem.model import DIRECTIONS

COMPONENT = {d: str(i) for i, d in enumerate(DIRECTIONS, 1)}
PIN = dict(zip(("x", "z", "y", "rx", "rz", "ry"), "123456", strict=True))
"""Numbers of local directions: y of Nastran is along the height, local z, and z the other way round."""
WIDTH = 16
MATRICES = {"K": "K2GG", "M": "M2GG", "C": "B2GG", "D": "K42GG"}
"""Requests of the case control for matrices."""


def nastran_text(
    deck: ModelDeck, units: "str | DeckUnits" = "SI", heading: Sequence[str] = (), modes: int = 20
) -> str:
    """Return a deck of Nastran: all of a model with a solution for its modes, or cards for one.

    Parameters
    ----------
    deck : ModelDeck
    units : str or Units
        Of the numbers in it.
    heading : sequence of str
        Sentences of its first comment.
    modes : int
        Number of modes that the deck asks for.
    """
    u, deck = DeckUnits.of(units), with_nodes(deck, arms=None)
    bulk = [*nodes_and_supports(deck, u), *_bars(deck, u), *others(deck, u)]
    notes = notes_of("$", deck)
    used = [key for key in "KMCD" if any(getattr(m, key).any() for m in all_matrices(deck))]
    requests = [f"{MATRICES[key]} = {key}EFF" for key in used]
    if deck.part:
        ask = (
            [f"$ case control: {', '.join([*requests, *sets_of(deck)])}"] if requests or sets_of(deck) else []
        )
        return text_of("$", heading, [*ask, *bulk, *notes])
    control = ["SOL 103", "CEND", f"TITLE = {deck.file[:60]}", "SPC = 1", "MPC = 1", "METHOD = 1", *requests]
    damping, more = _damping(deck)
    coupled = any(p.theory != "bar" and p.mass != "lumped-slender" for p in deck.properties)
    solution = [
        *(["PARAM,COUPMASS,1"] if coupled else []),
        "PARAM,AUTOSPC,YES",
        *damping,
        *card("EIGRL", 1, None, None, modes),
    ]
    return text_of("$", heading, [*control, *more, "BEGIN BULK", *solution, *bulk, *notes, "ENDDATA"])


def sets_of(deck: ModelDeck) -> list[str]:
    """Return the requests of the case control for the sets of constraints that a deck has."""
    sets = {"SPC": bool(deck.supports), "MPC": bool(solved_equations(deck))}
    return [f"{key} = {first_number(deck, key)}" for key, used in sets.items() if used]


def number(value: float, letter: str = "") -> str:
    """Return a real number in at most 16 columns, with as many digits as fit: 10 or more.

    ``letter`` is that of the exponent; Nastran needs none.
    """
    if not math.isfinite(value):
        refuse(f"{value} is no number that a deck can have", MeshError)
    if not letter and (value == 0 or 1e-2 <= abs(value) < 1e7):
        point = f"{value:.0f}".lstrip("-")
        return f"{value:.{WIDTH - 2 - len(point)}f}".rstrip("0")
    for digits in range(15, 0, -1):
        mantissa, _, exponent = f"{value:.{digits}e}".partition("e")
        plain = f"{mantissa.rstrip('0')}{letter}{int(exponent):+d}"
        if len(plain) <= WIDTH:
            return plain
    refuse(f"{value} does not fit into {WIDTH} columns", MeshError)


def card(name: str, *fields: Any) -> list[str]:
    """Return the lines of a card in large field; None is a blank field."""
    text = ["" if f is None else number(f) if isinstance(f, float) else str(f) for f in fields]
    while text and not text[-1]:
        text.pop()
    text += [""] * (-len(text) % 8)
    out = []
    for i in range(0, len(text), 4):
        first = f"{name}*" if i == 0 else "*"
        out.append(f"{first:8}{''.join(f'{cell:>16}' for cell in text[i : i + 4])}".rstrip())
    return out


def nodes_and_supports(deck: ModelDeck, u: DeckUnits) -> Iterator[str]:
    """Yield the nodes that the other model does not have, and the supports."""
    for row, (n, place) in enumerate(zip(deck.nodes, deck.points, strict=True)):
        if row not in deck.known:
            # a source deck may have defaults of the systems (GRDSET)
            basic = 0 if deck.first else None
            yield from card("GRID", n, basic, *(float(x) / u.length for x in place), basic)
    by_components: dict[str, list[int]] = {}
    for row, along in fixed_components(deck, "its axes (CD)"):
        by_components.setdefault("".join(str(k + 1) for k in along), []).append(int(deck.nodes[row]))
    for components, nodes in by_components.items():
        yield from card("SPC1", first_number(deck, "SPC"), components, *nodes)


def _bars(deck: ModelDeck, u: DeckUnits) -> Iterator[str]:
    """Yield materials, properties and bars; a property has the number of its place, from the first one."""
    materials = list(dict.fromkeys(p.material for p in deck.properties))
    first, first_property = first_number(deck, "material"), first_number(deck, "property")
    for i, m in enumerate(materials, first):
        yield from wrapped("$", m.name)
        loss = m.loss_factor or None
        yield from card(
            "MAT1", i, float(m.E / u.stress), None, float(m.nu), float(m.rho / u.density), None, None, loss
        )
    for i, p in enumerate(deck.properties):
        known = [
            str(deck.bars.numbers[k])
            for k in np.flatnonzero(deck.bars.properties == i)
            if k in deck.known_bars
        ]
        yield from wrapped("$", f"{p.name}: of bars {', '.join(known)}" if known else p.name)
        yield from property_card(p, first_property + i, materials.index(p.material) + first, u)
    b = deck.bars
    for k, n in enumerate(b.numbers):
        if k in deck.known_bars:
            continue
        p, (one, two) = deck.properties[b.properties[k]], deck.nodes[b.ends[k]]
        head = n, b.properties[k] + first_property, one, two
        if p.theory == "bar":
            yield from card("CROD", *head)
            continue
        free = [
            "".join(sorted(PIN[d] for d, value in zip(DIRECTIONS, row, strict=True) if value == 0)) or None
            for row in b.stiffness[k]
        ]
        arms = [float(x) / u.length if b.offsets[k].any() else None for x in b.offsets[k].ravel()]
        yield from card(bar_card(p), *head, *map(float, b.height[k]), None, *free, *arms)


def bar_card(p: BarProperty) -> str:
    """Return the name of the card of bars with a property."""
    return "CBAR" if p.theory == "euler-bernoulli" and p.section2 is None else "CBEAM"


def property_card(p: BarProperty, i: int, material: int, u: DeckUnits) -> Iterator[str]:
    """Yield the property of bars; plane 1 has the height, so that I1 is Iy and K1 is kz."""
    s, line = p.section, p.mass_per_length / u.mass_per_length
    if p.theory == "bar":
        yield from card("PROD", i, material, float(s.A / u.area), None, None, float(line))
        return

    def constants(of: Any, *product: float) -> list[float]:
        I = (of.Iy / u.second_moment, of.Iz / u.second_moment, *product, of.J / u.second_moment)
        return [float(x) for x in (of.A / u.area, *I, line)]

    blank = [None] * 8
    if bar_card(p) == "CBAR":
        yield from card("PBAR", i, material, *constants(s), None, *blank)
        return
    more = [] if p.section2 is None else ["YES", 1.0, *constants(p.section2, 0.0), *blank]
    ends = [of.Ip - of.Iy - of.Iz for of in (s, p.section2 or s)]
    turning = [
        float(p.material.rho * x / (u.mass_per_length * u.area)) if abs(x) > 1e-9 * s.Ip else None
        for x in ends
    ]
    shear = [float(s.kz), float(s.ky)] if p.theory == "timoshenko" else [0.0, 0.0]
    yield from card("PBEAM", i, material, *constants(s, 0.0), *blank, *more, *shear, None, None, *turning)


def others(deck: ModelDeck, u: DeckUnits) -> Iterator[str]:
    """Yield bodies, connections, links, equations and matrices; elements are numbered behind the bars."""
    free = count(first_element(deck))

    def number_of(name: str) -> int:
        return deck.numbers[name] if name in deck.numbers else next(free)

    for b in deck.bodies:
        yield from wrapped("$", b.name)
        yield from _body(deck, b, number_of(b.name), u)
    tables = count(max(first_number(deck, "property"), first_number(deck, "system")) + len(deck.properties))
    for c in deck.connections:
        if plain(c) and any(X.any() for X in (c.K, c.C, c.D)):
            yield from wrapped("$", c.name)
            element = number_of(c.name)
            free_table = next(tables) if deck.part else element
            table = deck.numbers.get(f"{c.name}: property", free_table)
            yield from _bush(deck, c, element, table, free_table, u)
    for link in deck.links:
        yield from wrapped("$", link.name)
        led = [deck.nodes[n] for n in link.dependents]
        components = "".join(COMPONENT[d] for d in link.directions)
        yield from card("RBE2", number_of(link.name), deck.nodes[link.node], components, *led)
    for comment, cells in equation_cells(deck, solved_equations(deck), COMPONENT, u, "$"):
        yield from comment
        fields: list[Any] = [first_number(deck, "MPC")]
        for j, cell in enumerate(cells):
            fields += [*([None, None] if j and j % 2 == 0 else []), *cell]
        yield from card("MPC", *fields)
    yield from _dmig(deck, u)


def _body(deck: ModelDeck, b: Body, number: int, u: DeckUnits) -> list[str]:
    I = b.inertia / u.inertia
    inertia = [float(x) + 0.0 for x in (I[0, 0], -I[1, 0], I[1, 1], -I[2, 0], -I[2, 1], I[2, 2])]
    arm = [float(x) for x in b.arm / u.length]
    return card("CONM2", number, deck.nodes[b.node], 0, float(b.mass / u.mass), *arm, None, *inertia)


def _bush(
    deck: ModelDeck, c: Connection, element: int, n: int, free_system: int, u: DeckUnits
) -> Iterator[str]:
    """Yield a CBUSH with its PBUSH, which has the number n, and its axes."""
    one, two = c.nodes
    system = 0 if np.array_equal(c.axes, np.eye(3)) else free_system
    if system:
        yield from card("CORD2R", system, 0, 0.0, 0.0, 0.0, *map(float, c.axes[2]), *map(float, c.axes[0]))
    nodes = deck.nodes[one], None if two is None else deck.nodes[two]
    yield from card("CBUSH", element, n, *nodes, None, None, None, system)
    K, C, D = (np.diag(X) for X in (c.K, c.C, c.D))
    fields = [n, "K", *map(float, K / u.stiffness)]
    if C.any():
        fields += [None, "B", *map(float, C / u.damping)]
    if D.any():
        fields += [None, "GE", *(float(d / k) if k else 0.0 for d, k in zip(D, K, strict=True))]
    yield from card("PBUSH", *fields)


def _dmig(deck: ModelDeck, u: DeckUnits) -> Iterator[str]:
    """Yield the sum of all matrices as DMIG of double precision, lower triangles by columns."""
    for key in "KMCD":
        columns = matrix_entries(deck, key, u, all_matrices(deck))
        if columns:
            names = dict.fromkeys(m.name for m in all_matrices(deck) if getattr(m, key).any())
            yield from wrapped("$", ", ".join(names))
            yield from card("DMIG", f"{key}EFF", 0, 6, 2, 2)
        for (n, d), column in columns.items():
            cells = [x for (i, e), value in column.items() for x in (i, e, number(value, "D"), None)]
            yield from card("DMIG", f"{key}EFF", n, d, None, *cells)


def _damping(deck: ModelDeck) -> tuple[list[str], list[str]]:
    """Return the damping of the structure as cards, and as requests of the case control."""
    d = deck.damping
    if d is None:
        return [], []
    out = [f"PARAM,G,{number(d.loss_factor)}"] if d.loss_factor else []
    out += [f"PARAM,ALPHA1,{number(d.alpha)}", f"PARAM,ALPHA2,{number(d.beta)}"] if d.alpha or d.beta else []
    if not d.ratio.any():
        return out, []
    at = d.frequency if len(d.frequency) > 1 else np.array([0.0, 1e6])
    pairs = [float(x) for f in at for x in (f, d.ratio_at(f))]
    return [*out, *card("TABDMP1", 1, "CRIT", *[None] * 6, *pairs, "ENDT")], ["SDAMPING = 1"]
