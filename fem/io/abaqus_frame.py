"""Frame models of Abaqus and CalculiX input files: beams, trusses, masses, springs, supports, constraints.

The mesh is read by :mod:`fem.io.abaqus`. Abaqus' B31 and B32 have shear deformation and rotary inertia, and
so have bars here; B33 has neither. Abaqus lumps the masses of B31, which are consistent here: frequencies
differ by the square of the element's length, and not at all in the limit of short elements.
"""

from pathlib import Path

import numpy as np

from fem.io import abaqus_frame_keywords as known
from fem.io.abaqus import read_abaqus
from fem.io.abaqus_bars import BarBuilder
from fem.io.abaqus_beams import BeamReader
from fem.io.abaqus_constraints import ConstraintBuilder
from fem.io.abaqus_content import Content, read_content
from fem.io.abaqus_deck import AbaqusBlock, Deck
from fem.io.abaqus_materials import Materials
from fem.io.abaqus_points import PointBuilder
from fem.io.abaqus_supports import fixed_of
from fem.io.abaqus_systems import AbaqusSystems
from fem.io.deck_units import DeckUnits
from fem.io.frame_deck import Bars, FrameDeck
from fem.io.frame_parts import supports_of
from fem.mesh import MeshError


def read_abaqus_frame(path: Path, units: DeckUnits) -> FrameDeck:
    """Read the frame model of an Abaqus or CalculiX input file.

    Supports are those of the model data, and of the steps up to the first one that asks for natural
    frequencies or a harmonic response; loads are not read. A deck that gives no section to any line is a
    mesh: its bars have no properties.

    Parameters
    ----------
    path : Path
    units : Units
        The deck's units of length, mass and time.

    Raises
    ------
    MeshError
        For data that cannot be read, elements that no frame has, and keywords that would change the natural
        frequencies and cannot be expressed; file, line and keyword are named.
    """
    if not _has_sections(path):
        return _mesh_alone(path, units)
    content = read_content(path, units)
    systems, materials = AbaqusSystems(content), Materials(content)
    bars, properties = BarBuilder(content, BeamReader(content, materials)).build()
    points = PointBuilder(content, systems)
    links, equations = ConstraintBuilder(content, systems).build()
    fixed = fixed_of(content)
    _fix_plane(content, fixed)
    numbers = np.asarray(content.mesh.point_numbers, dtype=np.int64)
    ordered = dict(sorted(fixed.items()))
    supports, skew = supports_of(ordered, systems.axes, lambda row: f"BOUNDARY at node {numbers[row]}")
    return FrameDeck(
        file=content.file,
        nodes=numbers,
        points=content.points,
        bars=bars,
        properties=properties,
        supports=supports,
        bodies=points.bodies(),
        connections=(*points.connections(), *skew),
        links=(*points.connectors(), *links),
        equations=equations,
        damping=materials.of_structure(),
        notes=tuple(content.notes),
    )


def _has_sections(path: Path) -> bool:
    """Return whether a deck has beam sections, or trusses with a *SOLID SECTION."""
    solid = truss = False
    for block in Deck(path).blocks():
        if block.keyword in ("BEAMSECTION", "BEAMGENERALSECTION"):
            return True
        solid |= block.keyword == "SOLIDSECTION"
        truss |= block.keyword == "ELEMENT" and block.options.get("TYPE", "").upper() in known.TRUSSES
    return solid and truss


def _mesh_alone(path: Path, units: DeckUnits) -> FrameDeck:
    raw = read_abaqus(path)
    ends = np.asarray(raw.lines, dtype=np.int64)[:, :2]
    n = len(ends)
    return FrameDeck(
        file=path.name,
        nodes=np.asarray(raw.point_numbers, dtype=np.int64),
        points=np.asarray(raw.points, dtype=float).reshape(-1, 3) * units.length,
        bars=Bars(
            numbers=np.asarray(raw.line_numbers, dtype=np.int64),
            ends=ends,
            properties=np.zeros(n, dtype=np.int64),
            height=np.full((n, 3), np.nan),
            offsets=np.zeros((n, 2, 3)),
            stiffness=np.full((n, 2, 6), np.inf),
        ),
        properties=(),
        notes=tuple(raw.notes),
    )


def _fix_plane(content: Content, fixed: dict[int, dict[int, AbaqusBlock]]) -> None:
    """Fix z, rx and ry of all nodes where the elements are planar."""
    lines = [kind for kind in content.kinds if kind.name in known.LINES]
    planar = [kind for kind in lines if kind.name in known.PLANAR]
    if not planar:
        return
    if len(planar) < len(lines):
        other = next(kind for kind in lines if kind.name not in known.PLANAR)
        msg = (
            f"{other.place}: *ELEMENT of type {other.name} is in space, those of type {planar[0].name} are "
            "in the plane; give all elements one or the other"
        )
        raise MeshError(msg)
    for row in range(len(content.points)):
        for dof in (2, 3, 4):
            fixed.setdefault(row, {})[dof] = content.placed[0].block
    content.notes.append("elements are planar: all nodes are fixed in z, rx and ry")
