"""Abaqus decks: a model, or keywords for one.

Rigid arms, releases and springs at ends of bars become nodes with equations and springs, which Abaqus and
CalculiX both know.
"""

from collections.abc import Iterator, Sequence
from itertools import count

import numpy as np

from fem.io.deck_nodes import (
    bar_axes,
    equation_cells,
    first_element,
    fixed_components,
    mean_section,
    notes_of,
    plain,
    solved_equations,
    text_of,
    with_nodes,
    wrapped,
)
from fem.io.deck_units import DeckUnits
from fem.io.frame_deck import BarProperty
from fem.io.frame_of_model import ModelDeck
from fem.model import DIRECTIONS

DOF = {d: i for i, d in enumerate(DIRECTIONS, 1)}


def abaqus_text(
    deck: ModelDeck, units: "str | DeckUnits" = "SI", heading: Sequence[str] = (), modes: int = 20
) -> str:
    """Return a deck of Abaqus: all of a model with a step for its modes, or keywords for one.

    Arguments are those of :func:`fem.io.nastran_write.nastran_text`.
    """
    u = DeckUnits.of(units)
    deck = with_ends(deck)
    lines = [] if deck.part else ["*HEADING", deck.file[:70]]
    lines += keywords(deck, u)
    if not deck.part:
        lines += ["*STEP", "*FREQUENCY", f"{modes},", *_damping(deck), "*END STEP"]
    return text_of("**", heading, [*lines, *notes_of("**", deck)])


def with_ends(deck: ModelDeck) -> ModelDeck:
    """Return a deck with nodes in place of what Abaqus and CalculiX have no common keyword for."""
    return with_nodes(deck, offsets=True, releases=True, arms=True, bodies=True, springs=plain)


def keywords(deck: ModelDeck, u: DeckUnits) -> list[str]:
    """Return the keywords of a deck of :func:`with_ends` without heading, steps and notes."""
    free = count(first_element(deck))
    return [
        *_nodes(deck, u),
        *_bars(deck, u),
        *_bodies(deck, u, free),
        *_springs(deck, u, free),
        *_equations(deck, u),
        *_supports(deck),
    ]


def row(*values: object) -> str:
    """Return a data line."""
    return ", ".join(repr(float(v)) if isinstance(v, float) else str(v) for v in values)


def _nodes(deck: ModelDeck, u: DeckUnits) -> Iterator[str]:
    new = [k for k in range(len(deck.nodes)) if k not in deck.known]
    if new:
        yield "*NODE"
    for k in new:
        yield row(deck.nodes[k], *map(float, deck.points[k] / u.length))


def _bars(deck: ModelDeck, u: DeckUnits) -> Iterator[str]:
    """Yield elements by property and axes, with their sections; n1 is local y, so that I11 is Iy."""
    axes, groups = bar_axes(deck), dict[tuple[int, tuple[float, ...]], list[int]]()
    for k, p in enumerate(deck.bars.properties):
        # Decimals to which bars of one section have the same axes
        y = np.round(axes[k, 1], 7) + 0.0
        groups.setdefault((int(p), tuple(y) if deck.properties[p].theory != "bar" else ()), []).append(k)
    materials = {p.material.name: p.material for p in deck.properties if p.theory == "bar"}
    first = deck.first.get("name", 1)
    for i, m in enumerate(materials.values(), first):
        yield from wrapped("**", m.name)
        yield from (f"*MATERIAL, NAME=MATERIAL{i}", "*ELASTIC", row(m.E / u.stress, m.nu))
        yield from ("*DENSITY", row(m.rho / u.density))
    for i, ((p, _), bars) in enumerate(groups.items(), first):
        of, name = deck.properties[p], f"BARS{i}"
        yield from wrapped("**", of.name)
        known = [deck.bars.numbers[k] for k in bars if k in deck.known_bars]
        new = [k for k in bars if k not in deck.known_bars]
        yield from (f"*ELSET, ELSET={name}", *(f"{n}," for n in known)) if known else ()
        yield from (f"*ELEMENT, TYPE={_type(of)}, ELSET={name}",) if new else ()
        for k in new:
            yield row(deck.bars.numbers[k], *deck.nodes[deck.bars.ends[k]])
        material = list(materials).index(of.material.name) + first if of.theory == "bar" else 0
        yield from section_keywords(of, name, axes[bars[0], 1], material, u)


def _type(p: BarProperty) -> str:
    return {"bar": "T3D2", "euler-bernoulli": "B33"}.get(p.theory, "B31")


def section_keywords(p: BarProperty, name: str, y: np.ndarray, material: int, u: DeckUnits) -> Iterator[str]:
    """Yield the section of an element set, by its constants."""
    m, (s, comment) = p.material, mean_section(p, "**")
    yield from comment
    if p.theory == "bar":
        yield from (f"*SOLID SECTION, ELSET={name}, MATERIAL=MATERIAL{material}", row(s.A / u.area))
        return
    yield (
        f"*BEAM GENERAL SECTION, ELSET={name}, SECTION=GENERAL, DENSITY={row(m.rho / u.density)}, "
        f"POISSON={row(m.nu)}"
    )
    moments = (s.Iy, 0.0, s.Iz, s.J)
    yield row(s.A / u.area, *(float(x / u.second_moment) for x in moments))
    yield row(*map(float, y))
    yield row(m.E / u.stress, m.G / u.stress)
    if p.theory == "timoshenko":
        # no shear deformation: a thousand times as stiff as the area
        kz, ky = (float((k or 1e3) * s.A * m.G / u.force) for k in (s.kz, s.ky))
        yield from ("*TRANSVERSE SHEAR STIFFNESS", row(kz, ky))
    if p.mass_per_length:
        yield from (
            f"*NONSTRUCTURAL MASS, ELSET={name}, UNITS=MASS PER LENGTH",
            row(p.mass_per_length / u.mass_per_length),
        )
    if m.loss_factor:
        yield from wrapped("**", f"loss factor of {m.name}: {m.loss_factor:g}")


def _bodies(deck: ModelDeck, u: DeckUnits, free: Iterator[int]) -> Iterator[str]:
    for k, b in enumerate(deck.bodies, deck.first.get("name", 1)):
        yield from wrapped("**", b.name)
        if b.mass:
            yield from (f"*ELEMENT, TYPE=MASS, ELSET=MASS{k}", row(next(free), deck.nodes[b.node]))
            yield from (f"*MASS, ELSET=MASS{k}", row(float(b.mass / u.mass)))
        if b.inertia.any():
            I = b.inertia / u.inertia
            yield from (f"*ELEMENT, TYPE=ROTARYI, ELSET=INERTIA{k}", row(next(free), deck.nodes[b.node]))
            yield f"*ROTARY INERTIA, ELSET=INERTIA{k}"
            yield row(*(float(I[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))))


def _springs(deck: ModelDeck, u: DeckUnits, free: Iterator[int]) -> Iterator[str]:
    """Yield springs and dashpots between coincident nodes, or to the ground."""
    for k, c in enumerate(deck.connections, deck.first.get("name", 1)):
        yield from wrapped("**", c.name)
        if c.D.any():
            loss = max(d / k for d, k in zip(np.diag(c.D), np.diag(c.K), strict=True) if k)
            yield from wrapped("**", f"not in this file: its loss factor, {loss:.4g}")
        turn = ""
        if not np.array_equal(c.axes, np.eye(3)):
            yield from (f"*ORIENTATION, NAME=AXES{k}", row(*map(float, c.axes[:2].ravel())))
            turn = f", ORIENTATION=AXES{k}"
        nodes = [deck.nodes[i] for i in c.nodes if i is not None]
        for X, kind in ((np.diag(c.K) / u.stiffness, "SPRING"), (np.diag(c.C) / u.damping, "DASHPOT")):
            for j in np.flatnonzero(X):
                name = f"{kind}{k}{DIRECTIONS[j].upper()}"
                yield from (f"*ELEMENT, TYPE={kind}{len(nodes)}, ELSET={name}", row(next(free), *nodes))
                yield from (f"*{kind}, ELSET={name}{turn}", row(*[j + 1] * len(nodes)), row(float(X[j])))


def _equations(deck: ModelDeck, u: DeckUnits) -> Iterator[str]:
    for comment, cells in equation_cells(deck, solved_equations(deck, links=True), DOF, u, "**"):
        yield from (*comment, "*EQUATION", str(len(cells)))
        for i in range(0, len(cells), 4):
            yield row(*(x for cell in cells[i : i + 4] for x in cell))


def _supports(deck: ModelDeck) -> Iterator[str]:
    if deck.supports:
        yield "*BOUNDARY"
    for k, along in fixed_components(deck, "its *TRANSFORM"):
        yield from (row(deck.nodes[k], i + 1, i + 1) for i in along)


def _damping(deck: ModelDeck) -> Iterator[str]:
    d = deck.damping
    if d is None:
        return
    values = {"ALPHA": d.alpha, "BETA": d.beta, "STRUCTURAL": d.loss_factor}
    if any(values.values()):
        yield "*GLOBAL DAMPING, " + ", ".join(f"{key}={v!r}" for key, v in values.items() if v)
    for f, ratio in zip(d.frequency, d.ratio, strict=True):
        if ratio:
            yield from wrapped("**", f"damping ratio from {f:g} Hz on: {ratio:.6g}; *MODAL DAMPING takes it")
