"""Frame models of Abaqus and CalculiX input files: beams, trusses, masses, springs, supports, constraints.

The mesh is read by :mod:`fem.io.abaqus`. Abaqus' B31 and B32 have shear deformation and rotary inertia, and
so have bars here; B33 has neither. Abaqus lumps the masses of B31, which are consistent here: frequencies
differ by the square of the element's length, and not at all in the limit of short elements.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fem.array_types import Floats
from fem.io import abaqus_keywords as known
from fem.io.abaqus import read_abaqus
from fem.io.abaqus_assembly import Instance
from fem.io.abaqus_bars import BarBuilder
from fem.io.abaqus_beams import BeamReader
from fem.io.abaqus_constraints import ConstraintBuilder
from fem.io.abaqus_content import DIRECTIONS, Content, Placed, check, data, lines_of, read_content
from fem.io.abaqus_deck import AbaqusBlock, Deck, fault
from fem.io.abaqus_materials import Materials
from fem.io.abaqus_supports import fixed_of
from fem.io.abaqus_systems import AbaqusSystems
from fem.io.deck_units import DeckUnits
from fem.io.faults import error_at
from fem.io.frame_deck import Bars, Body, Connection, FrameDeck, Link, axes_along, entry, supports_of
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


# Masses, springs, dashpots and connectors of Abaqus' and CalculiX' decks ------------------------------------


@dataclass(frozen=True, slots=True)
class PointBuilder:
    """Reads elements at one or two nodes."""

    content: Content
    systems: AbaqusSystems

    def bodies(self) -> tuple[Body, ...]:
        """Return the point masses and rotary inertias."""
        found: list[Body] = []
        seen: set[int] = set()
        for placed, instance in self.content.model_data("MASS", "ROTARYINERTIA"):
            block = placed.block
            check(block, "ELSET", "ORIENTATION", "ALPHA", "COMPOSITE", "TYPE")
            types = frozenset({"MASS"} if placed.keyword == "MASS" else {"ROTARYI"})
            if block.options.get("TYPE", "ISOTROPIC") != "ISOTROPIC":
                raise fault(block, f"is of type {block.options['TYPE']}; only ISOTROPIC is read")
            if "ALPHA" in block.options or "COMPOSITE" in block.options:
                self.content.notes.append(f"*{block.name} at line {block.line}: its damping is left out")
            mass, inertia = self._of_body(placed, instance)
            for row in self.content.elements(placed, instance.name, types):
                name = f"{self.content.kinds[row].name} {self.content.number(row)}"
                found.append(Body(name=name, node=self.content.nodes_of(row)[0], mass=mass, inertia=inertia))
                seen.add(row)
        self._all_seen(seen, {"MASS": "*MASS", "ROTARYI": "*ROTARY INERTIA"})
        return tuple(found)

    def _of_body(self, placed: Placed, instance: Instance) -> tuple[float, Floats]:
        block, units = placed.block, self.content.units
        if placed.keyword == "MASS":
            mass = data(block, 0, 1, 1, "a mass")[0] * units.mass
            if mass < 0:
                raise fault(block, f"is {mass:g} kg; it cannot be negative")
            return mass, np.zeros((3, 3))
        v = [*data(block, 0, 1, 6, "I11, I22, I33, I12, I13, I23"), *[0.0] * 5]
        local = np.array([[v[0], v[3], v[4]], [v[3], v[1], v[5]], [v[4], v[5], v[2]]]) * units.inertia
        if np.linalg.eigvalsh(local)[0] < -1e-9 * np.abs(local).max():
            raise fault(block, "has a negative principal moment of inertia; check its products")
        axes = self.systems.orientation(placed, instance)
        return 0.0, axes.T @ local @ axes

    def connections(self) -> tuple[Connection, ...]:
        """Return springs and dashpots."""
        found: list[Connection] = []
        seen: set[int] = set()
        for placed, instance in self.content.model_data("SPRING", "DASHPOT"):
            block = placed.block
            check(block, "ELSET", "ORIENTATION", "RTOL", "DEPENDENCIES")
            types = frozenset(f"{placed.keyword}{end}" for end in "12A")
            for row in self.content.elements(placed, instance.name, types):
                found.append(self._connection(row, placed, instance))
                seen.add(row)
        self._all_seen(seen, {f"{k}{end}": f"*{k}" for k in ("SPRING", "DASHPOT") for end in "12A"})
        return tuple(found)

    def _connection(self, row: int, placed: Placed, instance: Instance) -> Connection:
        kind, block, units = self.content.kinds[row].name, placed.block, self.content.units
        nodes = self.content.nodes_of(row)
        axial = kind[-1] == "A"
        if axial:
            d, axes = 0, self._along(row, nodes)
        else:
            d = self._direction(block, kind)
            for node in nodes:
                if node in self.systems.nodal and "ORIENTATION" not in block.options:
                    raise fault(block, "is at a node with *TRANSFORM; give it an ORIENTATION")
            axes = self.systems.orientation(placed, instance)
        line = 0 if axial else 1
        value = data(block, line, 1, 1, "a constant", 1)[0]
        if axial and len(lines_of(block)) > 1:
            raise fault(block, f"of {kind} takes an empty line and then one line with its constant")
        if len(lines_of(block)) > line + 1 or any(lines_of(block)[line][1][1:]):
            self.content.notes.append(
                f"*{block.name} at line {block.line} has several values; the first one is taken"
            )
        if len(nodes) == 2 and d < 3 and not axial:
            self._check_arm(row, block, nodes, axes[d])
        matrices: Any = (
            {"K": entry(d, value * units.stiffness[d])}
            if placed.keyword == "SPRING"
            else {"C": entry(d, value * units.damping[d])}
        )
        ends = (nodes[0], nodes[1] if len(nodes) == 2 else None)
        return Connection(name=f"{kind} {self.content.number(row)}", nodes=ends, axes=axes, **matrices)

    def _along(self, row: int, nodes: list[int]) -> Floats:
        x = self.content.points[nodes[1]] - self.content.points[nodes[0]]
        if self.content.near(*nodes):
            kind = self.content.kinds[row]
            msg = f"{kind.place}: *ELEMENT {self.content.number(row)} of type {kind.name} has no length"
            raise MeshError(msg)
        return axes_along(x)

    def _direction(self, block: AbaqusBlock, kind: str) -> int:
        """Return the direction of a spring, counted from 0."""
        found = data(block, 0, int(kind[-1]), int(kind[-1]), f"the degrees of freedom of {kind}")
        if found[0] not in range(1, 7) or len(set(found)) > 1:
            raise fault(
                block, f"acts on {found}; read is one degree of freedom of 1 to 6, the same at both nodes"
            )
        return int(found[0]) - 1

    def _check_arm(self, row: int, block: AbaqusBlock, nodes: list[int], axis: Floats) -> None:
        """Refuse a spring across a distance: it would make moments that no arm takes up."""
        arm = self.content.points[nodes[1]] - self.content.points[nodes[0]]
        across = float(np.linalg.norm(np.cross(arm, axis)))
        if across > 1e-6 * self.content.size:
            raise fault(
                block,
                f": element {self.content.number(row)} acts along a direction across which "
                f"its nodes are {across:.3g} m apart; move the nodes to one line or place",
            )

    def _all_seen(self, seen: set[int], keywords: dict[str, str]) -> None:
        for row, kind in enumerate(self.content.kinds):
            if kind.name in keywords and row not in seen:
                number, keyword = self.content.number(row), keywords[kind.name]
                raise error_at(kind.place, f"*ELEMENT {number} of type {kind.name} has no {keyword}")

    def connectors(self) -> tuple[Link, ...]:
        """Return rigid connectors: BEAM, WELD and, between nodes at one place, JOIN."""
        found: list[Link] = []
        seen: set[int] = set()
        for placed, instance in self.content.model_data("CONNECTORSECTION"):
            block = placed.block
            rows = lines_of(block)
            kinds = [cell.upper() for cell in rows[0][1] if cell] if rows else []
            directions = {"BEAM": DIRECTIONS, "WELD": DIRECTIONS, "JOIN": DIRECTIONS[:3]}
            if len(kinds) != 1 or kinds[0] not in directions:
                raise fault(
                    block,
                    f"is {', '.join(kinds)[:60] or 'empty'}; read are BEAM, WELD and "
                    "JOIN; write *SPRING for others",
                )
            for row in self.content.elements(placed, instance.name, frozenset({"CONN3D2"})):
                a, b = self.content.nodes_of(row)
                if kinds != ["BEAM"] and not self.content.near(a, b):
                    raise fault(block, f"{kinds[0]} joins nodes at different places; write BEAM")
                name = f"CONN3D2 {self.content.number(row)}"
                found.append(Link(name=name, node=a, dependents=(b,), directions=directions[kinds[0]]))
                seen.add(row)
        self._all_seen(seen, {"CONN3D2": "*CONNECTOR SECTION"})
        return tuple(found)
