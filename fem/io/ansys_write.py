"""ANSYS commands: a model, or commands for one."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fem.array_types import Floats
from fem.io.deck_nodes import (
    FIRST_OF_PART,
    Term,
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
from fem.io.frame_deck import BarProperty, Body, Connection
from fem.io.frame_of_model import ModelDeck, NodeMatrices
from fem.materials import Material
from fem.model import DIRECTIONS

LABEL: dict[str, str] = dict(zip(DIRECTIONS, ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ"), strict=True))
Equations = list[tuple[str, tuple[Term, ...]]]
Attributes = tuple[Mapping[str, int], tuple[int, ...]]
"""Numbers of TYPE, MAT, REAL and SECNUM of a bar, and the nodes that orient it."""
PART = 9001
"""First number of types, materials, sections and real constants of commands for a model that has others."""


class _Numbers:
    """Numbers of nodes, elements and tables that are given out in their order."""

    def __init__(self, deck: ModelDeck) -> None:
        free = {"node": FIRST_OF_PART, "table": PART} if deck.part else {"node": 1, "table": 1}
        free |= deck.first
        self.node = max(int(deck.nodes.max(initial=0)), free["node"] - 1)
        self.element = first_element(deck) - 1
        self.table = free["table"] - 1

    def next(self, of: str) -> int:
        """Return the next number of nodes, elements or tables."""
        setattr(self, of, getattr(self, of) + 1)
        return int(getattr(self, of))


def ansys_text(
    deck: ModelDeck, units: "str | DeckUnits" = "SI", heading: Sequence[str] = (), modes: int = 20
) -> str:
    """Return ANSYS commands: all of a model with a solution for its modes, or commands for one.

    Arguments are those of :func:`fem.io.nastran_write.nastran_text`.
    """
    return text_of("!", heading, [*commands(deck, DeckUnits.of(units), modes), *notes_of("!", deck)])


def commands(
    deck: ModelDeck, u: DeckUnits, modes: int = 20, attributes: Mapping[int, Attributes] | None = None
) -> list[str]:
    """Return the commands of a deck without heading and notes.

    ``attributes`` are those of bars, by row, that the other model's tables serve.
    """
    deck = with_nodes(deck, bodies=True)
    deck = replace(
        deck,
        matrices=(*deck.matrices, *(_inertia_of(b) for b in deck.bodies if _skew(b.inertia))),
        bodies=tuple(replace(b, inertia=np.zeros((3, 3))) if _skew(b.inertia) else b for b in deck.bodies),
    )
    deck = with_nodes(
        deck,
        offsets=True,
        releases=True,
        arms=True,
        springs=lambda c: _springy(c) and not deck.axes.keys() & set(c.nodes),
    )
    numbers, ground = _Numbers(deck), []
    lines = ["/PREP7", *([] if deck.part else [f"/TITLE,{deck.file[:60]}"])]
    lines += [
        command("N", deck.nodes[k], *map(float, deck.points[k] / u.length))
        for k in range(len(deck.nodes))
        if k not in deck.known
    ]
    lines += [*_bars(deck, u, numbers, attributes or {}), *_bodies(deck, u, numbers)]
    lines += _springs(deck, u, numbers, ground)
    equations = solved_equations(deck, links=True)
    lines += [*_bare_nodes(deck, equations, numbers), *_equations(deck, equations, u)]
    for k, along in fixed_components(deck, "its rotated axes"):
        lines += [command("D", deck.nodes[k], LABEL[DIRECTIONS[i]], 0) for i in along]
    lines += [command("D", n, "ALL", 0) for n in ground]
    if not deck.part:
        lines += [
            *_damping(deck),
            "FINISH",
            "/SOLU",
            "ANTYPE,MODAL",
            f"MODOPT,LANB,{modes}",
            f"MXPAND,{modes}",
            "SOLVE",
            "FINISH",
        ]
    return lines


def command(name: str, *values: object) -> str:
    """Return a command with its fields."""
    return ",".join([name, *(repr(float(v)) if isinstance(v, float) else str(v) for v in values)])


def _material(m: Material, n: int, u: DeckUnits) -> Iterator[str]:
    yield from wrapped("!", m.name)
    values = {"EX": m.E / u.stress, "PRXY": m.nu, "DENS": m.rho / u.density, "DMPS": m.loss_factor}
    yield from (
        f"MPDATA,{key},{n},1,{float(value)!r}" for key, value in values.items() if value or key != "DMPS"
    )


def _bars(
    deck: ModelDeck, u: DeckUnits, numbers: _Numbers, attributes: Mapping[int, Attributes]
) -> Iterator[str]:
    """Yield materials, sections and bars: LINK180, and cubic BEAM188 with a node towards the height."""
    for k, (tables, toward) in attributes.items():
        yield from (f"{name},{n}" for name, n in tables.items())
        yield command("EN", deck.bars.numbers[k], *deck.nodes[deck.bars.ends[k]], *toward)
    if len(attributes) == len(deck.bars.numbers):
        return
    beam, rod = numbers.next("table"), numbers.next("table")
    yield from (f"ET,{beam},BEAM188", f"KEYOPT,{beam},3,3", f"ET,{rod},LINK180")
    material, section = dict[Material, int](), list[int]()
    needed = {deck.bars.properties[k] for k in range(len(deck.bars.numbers)) if k not in attributes}
    for m in dict.fromkeys(p.material for i, p in enumerate(deck.properties) if i in needed):
        material[m] = numbers.next("table")
        yield from _material(m, material[m], u)
    for i, p in enumerate(deck.properties):
        section.append(numbers.next("table"))
        if i not in needed:
            continue
        yield from wrapped("!", p.name)
        yield from section_commands(p, section[-1], u)
    height = bar_axes(deck)[:, 2]
    size = np.linalg.norm(np.diff(deck.points[deck.bars.ends], axis=1)[:, 0], axis=1)
    for k, n in enumerate(deck.bars.numbers):
        if k in deck.known_bars or k in attributes:
            continue
        of, ends = deck.properties[deck.bars.properties[k]], deck.nodes[deck.bars.ends[k]]
        up: list[int] = []
        if of.theory != "bar":
            up = [numbers.next("node")]
            place = deck.points[deck.bars.ends[k, 0]] + size[k] * height[k]
            yield command("N", up[0], *map(float, place / u.length))
        yield f"TYPE,{rod if of.theory == 'bar' else beam}"
        yield from (f"MAT,{material[of.material]}", f"SECNUM,{section[deck.bars.properties[k]]}")
        yield command("EN", n, *ends, *up)


def section_commands(p: BarProperty, n: int, u: DeckUnits) -> Iterator[str]:
    """Yield the section of bars, by its constants."""
    s, line = p.section, float(p.mass_per_length / u.mass_per_length)
    if p.theory == "bar":
        area = command("SECDATA", float(s.A / u.area))
        yield from (f"SECTYPE,{n},LINK", area, command("SECCONTROL", 0, line))
        return
    s, comment = mean_section(p, "!")
    yield from comment
    I = [float(x / u.second_moment) for x in (s.Iy, 0.0, s.Iz, 0.0, s.J)]
    yield from (f"SECTYPE,{n},BEAM,ASEC", command("SECDATA", float(s.A / u.area), *I, 0.0, 0.0, 0.0, 0.0))
    # no shear deformation: a thousand times as stiff as the area
    if p.theory == "euler-bernoulli":
        yield from wrapped("!", f"{p.name} has no rotary inertia in the study; BEAM188 has it")
    slender = p.theory != "timoshenko"
    xz, xy = (float((1e3 if slender or not k else k) * s.A * p.material.G / u.force) for k in (s.kz, s.ky))
    yield command("SECCONTROL", xz, 0, xy, line)


def _bodies(deck: ModelDeck, u: DeckUnits, numbers: _Numbers) -> Iterator[str]:
    """Yield MASS21, which has no products of inertia."""
    for b in deck.bodies:
        t, e = numbers.next("table"), numbers.next("element")
        yield from wrapped("!", b.name)
        values = [float(b.mass / u.mass)] * 3 + [float(x / u.inertia) for x in np.diag(b.inertia)]
        yield from (f"ET,{t},MASS21", command("R", t, *values), f"TYPE,{t}", f"REAL,{t}")
        yield command("EN", e, deck.nodes[b.node])


def _skew(inertia: Floats) -> bool:
    return bool((inertia - np.diag(np.diag(inertia))).any())


def _inertia_of(b: Body) -> NodeMatrices:
    """Return the inertia of a body about its centre, as matrices of its node."""
    M, zero = np.zeros((6, 6)), np.zeros((6, 6))
    M[3:, 3:] = b.inertia
    return NodeMatrices(name=b.name, nodes=(b.node,), K=zero, M=M, C=zero, D=zero)


def _springy(c: Connection) -> bool:
    """Whether COMBIN14 stands for a connection: it acts along the axes of nodes, without a loss factor."""
    return plain(c) and not c.D.any() and np.array_equal(c.axes, np.eye(3))


def _springs(deck: ModelDeck, u: DeckUnits, numbers: _Numbers, ground: list[int]) -> Iterator[str]:
    for c in deck.connections:
        yield from wrapped("!", c.name)
        if not (c.K.any() or c.C.any()):
            continue
        one, two = c.nodes
        if two is None:  # a fixed node at the place of the other
            ground.append(numbers.next("node"))
            yield command("N", ground[-1], *map(float, deck.points[one] / u.length))
        second = ground[-1] if two is None else deck.nodes[two]
        K, C = np.diag(c.K) / u.stiffness, np.diag(c.C) / u.damping
        for j in np.flatnonzero((K != 0) | (C != 0)):
            t = numbers.next("table")
            yield from (f"ET,{t},COMBIN14", f"KEYOPT,{t},2,{j + 1}")
            yield from (command("R", t, float(K[j]), float(C[j])), f"TYPE,{t}", f"REAL,{t}")
            yield command("EN", numbers.next("element"), deck.nodes[one], second)


def _bare_nodes(deck: ModelDeck, equations: Equations, numbers: _Numbers) -> Iterator[str]:
    """Yield masses of 0 at nodes of equations without beams and bodies: others have no DOFs in ANSYS."""
    rods = np.array([p.theory == "bar" for p in deck.properties], dtype=bool)
    beams = deck.bars.ends[~rods[deck.bars.properties]]
    there = {*beams.ravel().tolist(), *(b.node for b in deck.bodies)}
    bare = sorted({n for _, terms in equations for n, _, _ in terms} - there - deck.known)
    if bare:
        t = numbers.next("table")
        yield from (f"ET,{t},MASS21", command("R", t, *[0.0] * 6), f"TYPE,{t}", f"REAL,{t}")
        yield from (command("EN", numbers.next("element"), deck.nodes[n]) for n in bare)


def _equations(deck: ModelDeck, equations: Equations, u: DeckUnits) -> Iterator[str]:
    cells = equation_cells(deck, equations, LABEL, u, "!")
    for number, (comment, row) in enumerate(cells, deck.first.get("equation", PART if deck.part else 1)):
        yield from comment
        for i in range(0, len(row), 3):
            yield command("CE", "HIGH" if i else number, 0, *(x for cell in row[i : i + 3] for x in cell))


def _damping(deck: ModelDeck) -> Iterator[str]:
    d = deck.damping
    if d is None:
        return
    values = {"ALPHAD": d.alpha, "BETAD": d.beta, "DMPSTR": d.loss_factor}
    yield from (command(key, float(v)) for key, v in values.items() if v)
    if d.ratio.any():
        yield command("DMPRAT", float(d.ratio[0]))
        if len(d.ratio) > 1:
            yield from wrapped(
                "!", f"DMPRAT is the damping ratio at {d.frequency[0]:g} Hz; the study has more"
            )
