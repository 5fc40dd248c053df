"""Frame models of Nastran decks: bars, bodies, springs, rigid elements and supports.

``docs/coming-from-nastran.md`` says what becomes of each card. Sources: the cards' descriptions in the quick
reference guides of MSC and Simcenter Nastran.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from fem.io.deck import named, words
from fem.io.deck_units import DeckUnits
from fem.io.faults import error_at
from fem.io.frame_deck import FrameDeck
from fem.io.nastran_bars import RODS, bars_of
from fem.io.nastran_connections import BODIES, bodies_of, connections_of
from fem.io.nastran_deck import Card, NastranDeck, open_deck
from fem.io.nastran_names import HARMLESS, READ
from fem.io.nastran_properties import BEAMS
from fem.io.nastran_rigid import constraints_of, fixed_of
from fem.model import Damping, ModelError

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
