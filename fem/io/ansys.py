"""ANSYS decks as line meshes: nodes, line elements, components."""

from pathlib import Path
from typing import Any

import numpy as np

from fem.io.ansys_content import ON_AXIS
from fem.io.ansys_deck import read_deck
from fem.io.ansys_systems import rotation
from fem.io.rawmesh import RawMesh


def read_ansys(path: Path) -> RawMesh:
    """Return the line elements of an archive, in its units.

    Components of elements are sets of lines, those of nodes sets of points; lines in no component are in sets
    by section (``section 3``) or real constants (``real 3``).

    Raises
    ------
    MeshError
        As :func:`fem.io.ansys_deck.read_deck`, and for elements of an unknown type or node.
    """
    deck = read_deck(path)
    rows = {number: k for k, number in enumerate(deck.nodes)}
    raw = RawMesh([row[:3] for row in deck.nodes.values()], point_numbers=list(rows))
    lines: dict[int, int] = {}
    numbers: list[int] = []
    sets: dict[str, list[int]] = {}
    inside = {n for kind, items in deck.components.values() if kind == "ELEM" for n in items}
    for e in deck.elements.values():
        kind = deck.kind(e)
        deck.check_nodes(e)
        count = ON_AXIS.get(kind, 0)
        if not count or len(e.nodes) < count:
            raw.left_out[f"elements of type {kind}"] += 1
            continue
        lines[e.number] = len(raw.lines)
        numbers.append(e.number)
        raw.lines.append([rows[n] for n in e.nodes[:count]])
        if e.number not in inside:
            by_section = e.section in deck.sections and kind >= 180
            name = f"section {e.section}" if by_section else f"real {e.real}"
            sets.setdefault(name, []).append(lines[e.number])
    for name, (kind, items) in deck.components.items():
        if kind == "ELEM":
            sets[name] = [lines[n] for n in items if n in lines]
        else:
            raw.point_sets[name] = [rows[n] for n in items if n in rows]
    raw.sets, raw.line_numbers = sets, numbers
    raw.notes += deck.notes
    return raw


def ansys_places(path: Path) -> dict[str, Any]:
    """Return ``nodes``, ``points`` and, of rotated nodes, ``axes`` (rows are unit vectors) of a deck."""
    nodes = read_deck(path).nodes
    return {
        "nodes": np.array(list(nodes), dtype=np.int64),
        "points": np.array([row[:3] for row in nodes.values()]).reshape(-1, 3),
        "axes": {n: rotation(*row[3:]) for n, row in nodes.items() if any(row[3:])},
    }
