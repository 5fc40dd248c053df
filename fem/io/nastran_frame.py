"""Frame models of Nastran decks: bars, bodies, springs, rigid elements and supports.

``docs/coming-from-nastran.md`` says what becomes of each card. Sources: the cards' descriptions in the quick
reference guides of MSC and Simcenter Nastran.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from fem.array_types import Floats
from fem.io.deck import named, words
from fem.io.deck_units import DeckUnits
from fem.io.faults import error_at
from fem.io.frame_deck import Body, Connection, FrameDeck, axes_along, entry, parallel
from fem.io.nastran_bars import RODS, bars_of
from fem.io.nastran_deck import Card, NastranDeck, open_deck
from fem.io.nastran_names import HARMLESS, READ
from fem.io.nastran_properties import BEAMS
from fem.io.nastran_rigid import constraints_of, fixed_of
from fem.model import DIRECTIONS, Damping, ModelError, skew

# Bodies, springs and dashpots of a Nastran deck -------------------------------------------------------------


SPRINGS = ("CELAS1", "CELAS2")
BODIES = ("CONM1", "CONM2", "CMASS2")

Fixed = dict[int, tuple[str, ...]]


def bodies_of(deck: NastranDeck, fixed: Fixed) -> list[Body]:
    """Return the rigid bodies at grid points; one in some directions needs the others fixed."""
    readers = {"CONM1": _conm1, "CONM2": _conm2}
    found = [readers[c.name](deck, c) for c in deck.by_number("CONM1", "CONM2").values()]
    return [*found, *_scalar_masses(deck, fixed)]


def _conm2(deck: NastranDeck, card: Card) -> Body:
    node, system, units = deck.node(card, 1), card.integer(2, 0), deck.units
    axes = deck.axes_of(card, system, node)
    arm = card.reals(4, 7) * units.length
    if system < 0:
        arm = arm - deck.points[node]
    I11, I21, I22, I31, I32, I33 = card.reals(8, 14)
    # the products are integrals of positive sign, which a tensor of inertia has negative
    inertia = np.array([[I11, -I21, -I31], [-I21, I22, -I32], [-I31, -I32, I33]])
    return _body(deck, card, node, card.real(3), arm @ axes, axes.T @ inertia @ axes)


def _body(deck: NastranDeck, card: Card, node: int, mass: float, arm: Floats, inertia: Floats) -> Body:
    """Return a body of a mass and inertia in the deck's units, and an arm in SI."""
    if mass < 0 or np.linalg.eigvalsh(inertia)[0] < -1e-6 * max(np.abs(inertia).max(), 1e-300):
        values = ", ".join(f"{v:g}" for v in np.linalg.eigvalsh(inertia))
        card.refuse(
            f"has the mass {mass:g} and an inertia of the principal values {values}; they cannot be negative"
        )
    factor, units = deck.mass_factor, deck.units
    return Body(
        name=str(card),
        node=node,
        mass=mass * factor * units.mass,
        inertia=inertia * factor * units.inertia,
        arm=arm,
    )


def _conm1(deck: NastranDeck, card: Card) -> Body:
    """Return the body of a 6 by 6 matrix, if it is one."""
    node, system = deck.node(card, 1), card.integer(2, 0)
    M = np.zeros((6, 6))
    M[np.tril_indices(6)] = card.reals(3, 24)
    M = M + np.tril(M, -1).T
    m = M[0, 0]
    arm = np.array([M[1, 5], M[2, 3], M[0, 4]]) / m if m else np.zeros(3)
    lever = skew(arm)
    built = np.block([[m * np.eye(3), -m * lever], [m * lever, M[3:, 3:]]])
    if not np.allclose(built, M, rtol=1e-6, atol=1e-9 * np.abs(M).max()):
        card.refuse("is no rigid body: its matrix is not that of one mass with an arm; CONM2 is read")
    axes = deck.axes_of(card, system, node)
    inertia = M[3:, 3:] + m * lever @ lever
    return _body(deck, card, node, m, arm @ axes * deck.units.length, axes.T @ inertia @ axes)


def _scalar_masses(deck: NastranDeck, fixed: Fixed) -> list[Body]:
    """Return CMASS1 and CMASS2 that act at one grid point alike in all directions which are free."""
    by_node: dict[int, dict[int, float]] = {}
    cards: dict[int, Card] = {}
    for card in deck.by_number("CMASS1", "CMASS2").values():
        if card.text(4) not in ("", "0"):
            card.refuse("couples two grid points by a mass; a mass at one grid point is read")
        value = card.real(1) if card.name == "CMASS2" else _property(deck, card, "PMASS").real(1)
        node = deck.node(card, 2)
        at = by_node.setdefault(node, {})
        at[card.integer(3) - 1] = at.get(card.integer(3) - 1, 0.0) + value
        cards.setdefault(node, card)
    return [_scalar_body(deck, cards[node], node, at, fixed.get(node, ())) for node, at in by_node.items()]


def _scalar_body(
    deck: NastranDeck, card: Card, node: int, at: dict[int, float], fixed: tuple[str, ...]
) -> Body:
    axes = deck.axes(node)
    values = {at.get(k, 0.0) for k in range(3) if DIRECTIONS[k] not in fixed or not _global(axes)}
    if len(values) > 1:
        card.refuse(
            "is a mass in some directions only, and the grid point is free in others; a body has the same "
            "mass in all of them"
        )
    turning = np.diag([at.get(k, 0.0) for k in (3, 4, 5)])
    return _body(deck, card, node, values.pop() if values else 0.0, np.zeros(3), axes.T @ turning @ axes)


def _global(axes: Floats) -> bool:
    return bool(np.allclose(axes, np.eye(3)))


def connections_of(deck: NastranDeck, fixed: Fixed) -> list[Connection]:
    """Return springs and dashpots: CELAS, CDAMP, CVISC, CBUSH and CBUSH1D."""
    found: list[Connection] = []
    for names, reader in (
        (SPRINGS, _spring),
        (("CDAMP1", "CDAMP2"), _damper),
        (("CVISC",), _viscous),
        (("CBUSH",), _bush),
        (("CBUSH1D",), _bush1d),
    ):
        found += [reader(deck, card, fixed) for card in deck.by_number(*names).values()]
    return [c for c in found if c.K.any() or c.C.any() or c.D.any()]


def _property(deck: NastranDeck, card: Card, name: str) -> Card:
    number, cards = card.integer(1, card.integer(0)), deck.by_number(name)
    if number not in cards:
        card.refuse(f"refers to property {number}, but the file has no {name} {number}")
    return cards[number]


def _spring(deck: NastranDeck, card: Card, fixed: Fixed) -> Connection:
    source, at = (card, (1, 6)) if card.name == "CELAS2" else (_property(deck, card, "PELAS"), (1, 2))
    return _scalar(deck, card, fixed, K=source.real(at[0]), eta=source.real(at[1]))


def _damper(deck: NastranDeck, card: Card, fixed: Fixed) -> Connection:
    source = card if card.name == "CDAMP2" else _property(deck, card, "PDAMP")
    return _scalar(deck, card, fixed, C=source.real(1))


def _scalar(
    deck: NastranDeck, card: Card, fixed: Fixed, K: float = 0.0, C: float = 0.0, eta: float = 0.0
) -> Connection:
    """Return a spring or dashpot between one component of two grid points, or of one and the ground."""
    sides = [(deck.node(card, k), card.integer(k + 1) - 1) for k in (2, 4) if card.text(k) not in ("", "0")]
    if not sides:
        card.refuse("has no grid point")
    if any(not 0 <= component < 6 for _, component in sides):
        card.refuse("has a component that is not 1 to 6")
    node, k = sides[0]
    if len(sides) > 1:
        _check_scalar(deck, card, sides, fixed)
    spring = entry(k, K * deck.units.stiffness[k])
    return Connection(
        name=str(card),
        nodes=(node, sides[1][0] if len(sides) > 1 else None),
        axes=deck.axes(node),
        K=spring,
        C=entry(k, C * deck.units.damping[k]),
        D=eta * spring,
    )


def _check_scalar(deck: NastranDeck, card: Card, sides: list[tuple[int, int]], fixed: Fixed) -> None:
    (a, component), (b, second) = sides
    axis = deck.axes(a)[component % 3]
    if a == b or component // 3 != second // 3 or not np.allclose(axis, deck.axes(b)[second % 3]):
        card.refuse(
            "couples different directions of motion; a spring between two grid points along one is read"
        )
    arm = deck.points[b] - deck.points[a]
    turning = [n for n in (a, b) if not set(DIRECTIONS[3:]) <= set(fixed.get(n, ()))]
    if component < 3 and turning and np.linalg.norm(np.cross(axis, arm)) > 1e-6 * np.linalg.norm(arm):
        deck.notes.add(
            "it acts across the line between its grid points, where Nastran leaves the moments unbalanced; "
            "here rigid arms from the middle balance them",
            card,
        )


def _viscous(deck: NastranDeck, card: Card, fixed: Fixed) -> Connection:
    """Return a dashpot along and about the line between two grid points."""
    source = _property(deck, card, "PVISC")
    ends = (deck.node(card, 2), deck.node(card, 3))
    C = np.diag([source.real(1), 0, 0, source.real(2), 0, 0]) * deck.units.damping
    return Connection(name=str(card), nodes=ends, C=C, axes=_line_axes(deck, card, ends))


def _line_axes(deck: NastranDeck, card: Card, ends: tuple[int, int]) -> Floats:
    if not np.linalg.norm(deck.points[ends[1]] - deck.points[ends[0]]) > 0:
        card.refuse("has no direction: its grid points are at one place, and no coordinate system is given")
    return axes_along(deck.points[ends[1]] - deck.points[ends[0]])


def _bush1d(deck: NastranDeck, card: Card, fixed: Fixed) -> Connection:
    source = _property(deck, card, "PBUSH1D")
    ends, u = (deck.node(card, 2), deck.node(card, 3)), deck.units
    if source.real(3):
        deck.notes.add("the mass of PBUSH1D is left out", card)
    system = card.integer(4, -1)
    axes = deck.axes_of(card, system, ends[0]) if system >= 0 else _line_axes(deck, card, ends)
    return Connection(
        name=str(card),
        nodes=ends,
        axes=axes,
        K=entry(0, source.real(1) * u.stiffness[0]),
        C=entry(0, source.real(2) * u.damping[0]),
    )


def _bush(deck: NastranDeck, card: Card, fixed: Fixed) -> Connection:
    values = _bush_values(_property(deck, card, "PBUSH"))
    a = deck.node(card, 2)
    b = deck.node(card, 3) if card.text(3) not in ("", "0") else None
    K = np.diag(values["K"] * deck.units.stiffness)
    return Connection(
        name=str(card),
        nodes=(a, b),
        K=K,
        C=np.diag(values["B"] * deck.units.damping),
        D=np.diag(values["GE"]) @ K,
        axes=_bush_axes(deck, card, a, b, values["K"]),
        place=_bush_place(deck, card, a, b),
    )


def _bush_values(card: Card) -> dict[str, Floats]:
    """Return K, B and GE of a PBUSH; GE1 alone holds for all directions."""
    values = {key: np.zeros(6) for key in ("K", "B", "GE")}
    k = 1
    while k < len(card.fields):
        key = card.text(k)
        if key in values:
            values[key] = card.reals(k + 1, k + 7)
            if key == "GE" and card.blank(k + 2, k + 7):
                values[key] = np.full(6, card.real(k + 1))
        elif key not in ("", "RCV", "M", "T", "D"):
            card.refuse(f"has '{key[:20]}' in its field {k + 2}; K, B, GE, M and RCV are known")
        k += 8
    return values


def _bush_axes(deck: NastranDeck, card: Card, a: int, b: int | None, K: Floats) -> Floats:
    """Return the axes of a CBUSH: its system CID, or along the line with an orientation, or motions of GA."""
    if card.text(7):
        system = card.integer(7)
        return deck.axes_of(card, system, a)
    if b is None or not np.linalg.norm(deck.points[b] - deck.points[a]) > 0:
        if not card.blank(4, 7):
            card.refuse("has an orientation, but its grid points are at one place; give it a CID")
        return deck.axes(a)
    line = deck.points[b] - deck.points[a]
    if card.blank(4, 7):
        if K[[1, 2, 4, 5]].any() and len(set(K[1:3])) + len(set(K[4:6])) > 2:
            card.refuse(
                "has no orientation and different stiffnesses across its axis; give X1 to X3, G0 or CID"
            )
        return axes_along(line)
    toward = card.text(4).isdigit() and card.blank(5, 7)
    up = deck.points[deck.node(card, 4)] - deck.points[a] if toward else card.reals(4, 7) @ deck.axes(a)
    if parallel(line, up):
        card.refuse("has its orientation vector along its axis; give one across it")
    return axes_along(line, up)


def _bush_place(deck: NastranDeck, card: Card, a: int, b: int | None) -> Floats:
    """Return where a CBUSH acts: S of the way to GB, or an offset from GA in the system OCID."""
    system = card.integer(9, -1)
    if system >= 0:
        axes = deck.axes_of(card, system, a)
        return deck.points[a] + card.reals(10, 13) * deck.units.length @ axes
    if b is None:
        return deck.points[a]
    return deck.points[a] + card.real(8, 0.5) * (deck.points[b] - deck.points[a])


# ------------------------------------------------------------------------------------------------------------


APPLIED: Final = (
    READ
    | frozenset(BEAMS + RODS + BODIES)
    | words(
        """PBAR PBARL PBEAM PBEAML PROD PTUBE MAT1 CMASS1 PMASS CELAS1 CELAS2 PELAS CDAMP1 CDAMP2 PDAMP CVISC
        PVISC CBUSH PBUSH CBUSH1D PBUSH1D RBE2 RBE3 RBAR RROD MPC MPCADD SPC SPC1 SPCADD PARAM TABDMP1"""
    )
)
"""Cards that are applied, besides those that nothing in a frame model refers to."""

_MEANING: Final = {
    "NSM NSM1 NSML NSML1 NSMADD": "its non-structural mass is left out: frequencies are too high",
    "DMIG DMIJ": "the matrix is left out",
    "ASET ASET1 OMIT OMIT1": (
        "the model is not reduced: Nastran's reduced frequencies lie above those of all coordinates"
    ),
    "MATT1 TEMP TEMPD TEMPRB": "temperatures and what depends on them are left out",
    "PBUSHT PELAST PDAMPT": "values that vary with frequency or deflection are left out",
    "DEFORM": "initial deformations are left out",
    "SPOINT": "scalar points that no card of the frame refers to are left out",
}
LEFT_OUT: Final = {name: meaning for names, meaning in _MEANING.items() for name in names.split()}
"""Cards that are left out, and what that means."""

REFUSED: Final = words(
    "CBEND CBEAM3 RBE1 RBAR1 RTRPLT RSPLINE RSSCON RJOINT GENEL EPOINT CORD3G CMASS3 CMASS4 CELAS3 "
    "CELAS4 CDAMP3 CDAMP4 CDAMP5"
)
"""Cards that change the stiffness or the mass, besides other elements, whose names begin with C."""

_SELECTED: Final = {
    "STATSUB": "prestress by loads",
    **dict.fromkeys(("K2GG", "K2PP"), "a stiffness matrix"),
    **dict.fromkeys(("M2GG", "M2PP"), "a mass matrix"),
    **dict.fromkeys(("B2GG", "B2PP"), "a damping matrix"),
    "NSM": "a set of non-structural mass",
}
"""Commands of case control that change the model, and what they select."""

_SILENT: Final = words("CAERO1 CSET CSET1 CSSCHD SUPORT SUPORT1 EIGRL EIGR EIGC EIGB ENDDATA")


def read_nastran_frame(path: Path, units: DeckUnits) -> FrameDeck:
    """Read the frame model of a Nastran deck.

    Parameters
    ----------
    path : Path
        Bulk data, with executive and case control or without.
    units : Units
        Of the deck, which does not say them.

    Raises
    ------
    MeshError
        For cards that are wrong, refer to what is not there, or have what a frame model cannot have; the
        message names file, line and card.
    """
    deck = open_deck(path, units)
    _check(deck)
    supports, skew = fixed_of(deck)
    bars, properties, twists = bars_of(deck)
    bodies = bodies_of(deck, supports)
    connections = [*connections_of(deck, supports), *twists]
    constraints = constraints_of(deck)
    damping = _damping(deck)
    _name_others(deck)
    used = {*bars.ends.ravel().tolist(), *(b.node for b in bodies), *_nodes(connections, constraints)}
    return FrameDeck(
        file=path.name,
        nodes=deck.grids.numbers.copy(),
        points=deck.points,
        bars=bars,
        properties=properties,
        supports={row: fixed for row, fixed in supports.items() if row in used},
        bodies=tuple(bodies),
        connections=(*connections, *(c for c in skew if c.nodes[0] in used)),
        links=tuple(constraints.links),
        equations=tuple(constraints.equations),
        damping=damping,
        notes=deck.notes.all(),
    )


def _nodes(connections: list, constraints) -> Iterator[int]:
    for c in connections:
        yield from (row for row in c.nodes if row is not None)
    for link in constraints.links:
        yield from (link.node, *link.dependents)
    for equation in constraints.equations:
        yield from (row for row, _, _ in equation.terms)


def _check(deck: NastranDeck) -> None:
    """Refuse elements that a frame model cannot have: the frequencies of the rest would mean nothing."""
    lost: dict[str, list[Card]] = {
        name: cards
        for name, cards in deck.cards.items()
        if name in REFUSED or (name[:1] == "C" and name not in APPLIED | _SILENT | HARMLESS)
    }
    if not lost:
        return
    first = next(iter(lost.values()))[0]
    counts = named([f"{len(cards)} {name}" for name, cards in lost.items()])
    first.refuse(
        "has no place in a frame model, and the frequencies would be wrong without it (the file has "
        f"{counts}); delete these cards to read the bars alone, or write them with the cards that are read"
    )


def _damping(deck: NastranDeck) -> Damping | None:
    """Return the damping of PARAM G, ALPHA1 and ALPHA2, and of the table that SDAMPING selects."""
    eta, alpha, beta = (deck.parameter(name, 0.0) for name in ("G", "ALPHA1", "ALPHA2"))
    frequency, ratio = np.zeros(1), np.zeros(1)
    chosen = deck.setting("SDAMPING") or deck.setting("SDAMP")
    table = next((card for card in deck.of("TABDMP1") if card.text(0) == chosen), None)
    if table is not None:
        frequency, ratio = _table(table)
    if not (eta or alpha or beta or ratio.any()):
        return None
    time = deck.units.time
    try:
        return Damping(
            frequency=frequency, ratio=ratio, alpha=alpha / time, beta=beta * time, loss_factor=eta
        )
    except ModelError as reason:
        raise error_at(deck.file, f"PARAM G, ALPHA1, ALPHA2 or TABDMP1: {reason}") from reason


def _table(card: Card) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies [Hz] and damping ratios of a TABDMP1."""
    kind = card.text(1) or "G"
    values: list[float] = []
    for k in range(8, len(card.fields)):
        if card.text(k) == "ENDT":
            break
        if card.text(k):
            values.append(card.real(k))
    if len(values) < 2 or len(values) % 2 or kind not in ("G", "CRIT", "Q"):
        card.refuse("is not a table of pairs of frequency and damping of the kind G, CRIT or Q")
    f, value = np.array(values[0::2]), np.array(values[1::2])
    order = np.argsort(f, kind="stable")
    ratio = {"G": value / 2, "CRIT": value, "Q": 1 / (2 * np.where(value, value, np.inf))}[kind]
    return f[order], ratio[order]


def _name_others(deck: NastranDeck) -> None:
    """Note the cards that are left out."""
    unknown: list[str] = []
    for name, cards in deck.cards.items():
        if name in LEFT_OUT:
            for card in cards:
                deck.notes.add(LEFT_OUT[name], card)
        elif name not in APPLIED | HARMLESS | _SILENT and not name.startswith("="):
            unknown.append(f"{name or 'lines that are no cards'} ({len(cards)}, first at {cards[0].place})")
    if unknown:
        deck.notes.plain.append(f"left out, because their meaning is not known: {named(unknown)}")
    for key, meaning in _SELECTED.items():
        if any(key in one for one in deck.control or ()):
            deck.notes.plain.append(f"case control selects {key}: {meaning}, which is left out")
