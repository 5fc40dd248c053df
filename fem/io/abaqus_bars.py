"""Bars of Abaqus' and CalculiX' decks: each with a section, orientation, offsets, releases and added mass."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from fem.array_types import Floats, Ints
from fem.io import abaqus_keywords as known
from fem.io.abaqus_assembly import Instance
from fem.io.abaqus_beams import Beam, BeamReader
from fem.io.abaqus_content import SAME_PLACE, Content, Placed, check, data, lines_of
from fem.io.abaqus_deck import fault, name_of
from fem.io.frame_deck import BarProperty, Bars
from fem.mesh import MeshError

PARALLEL = 1e-6
"""Sine of the angle between n1 and the axis below which a section has no direction."""

DEFAULT_N1 = np.array([0.0, 0.0, -1.0])
"""n1 without a direction, and always that of planar elements."""

RELEASED = {"M1": (4,), "M2": (5,), "T": (3,), "ALLM": (3, 4, 5)}
"""Directions x y z rx ry rz that *RELEASE frees, counted from 0."""


@dataclass(slots=True)
class BarBuilder:
    """The bars of a deck as they are read.

    Attributes
    ----------
    sections : list of (Beam, Instance) or None, of each row of the mesh's lines
    added : ndarray, non-structural mass of each row [kg/m]
    free : dict of (int, int) to set of int
        Directions that are released at the first (0) or last (1) end of a row.
    """

    content: Content
    reader: BeamReader
    sections: list[tuple[Beam, Instance] | None] = field(init=False)
    added: Floats = field(init=False)
    free: dict[tuple[int, int], set[int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.sections = [None] * len(self.content.kinds)
        self.added = np.zeros(len(self.content.kinds))

    def build(self) -> tuple[Bars, tuple[BarProperty, ...]]:
        """Return the bars and their properties."""
        found: dict[int, Beam] = {}
        for placed, instance in self.content.model_data("BEAMSECTION", "BEAMGENERALSECTION", "SOLIDSECTION"):
            truss = placed.keyword == "SOLIDSECTION"
            if id(placed) not in found:
                found[id(placed)] = self.reader.truss(placed) if truss else self.reader.beam(placed)
            types = known.TRUSSES if truss else known.LINES - known.TRUSSES
            for row in self.content.elements(placed, instance.name, types):
                self._assign(row, found[id(placed)], instance)
        for placed, instance in self.content.model_data("NONSTRUCTURALMASS"):
            self._non_structural(placed, instance)
        for placed, instance in self.content.model_data("RELEASE"):
            self._release(placed, instance)
        return self._bars()

    def _assign(self, row: int, beam: Beam, instance: Instance) -> None:
        before = self.sections[row]
        if before is not None:
            old = before[0].block
            words = (
                f"gives element {self.content.number(row)} another section than *{old.name} at {old.place}; "
                "take it out of one of the sets"
            )
            raise fault(beam.block, words)
        self.sections[row] = (beam, instance)

    def _section_of(self, row: int) -> tuple[Beam, Instance]:
        found, kind = self.sections[row], self.content.kinds[row]
        if found is None:
            keyword = "*SOLID SECTION" if kind.name in known.TRUSSES else "*BEAM SECTION"
            msg = f"{kind.place}: *ELEMENT {self.content.number(row)} of type {kind.name} has no {keyword}"
            raise MeshError(msg)
        return found

    def _non_structural(self, placed: Placed, instance: Instance) -> None:
        block, units = placed.block, self.content.units
        check(block, "ELSET", "UNITS", "DISTRIBUTION")
        value = data(block, 0, 1, 1, "a mass")[0]
        if value < 0:
            raise fault(block, f"has the mass {value:g}; it cannot be negative")
        elements = self.content.elements(placed, instance.name, known.LINES)
        beams = [self._section_of(row)[0] for row in elements]
        area = np.array([beam.shape.section.A for beam in beams])
        kind = "".join(block.option("UNITS", "UNITS=").upper().split())
        if kind == "TOTALMASS":
            by_volume = "VOLUME" in block.options.get("DISTRIBUTION", "").upper()
            weight = area * (1.0 if by_volume else np.array([beam.material.rho for beam in beams]))
            length = np.array([self._length(row) for row in elements])
            self.added[elements] += value * units.mass * weight / float(weight @ length)
        elif kind == "MASSPERLENGTH":
            self.added[elements] += value * units.mass_per_length
        elif kind == "MASSPERVOLUME":
            self.added[elements] += value * units.density * area
        else:
            raise fault(block, f"has UNITS={kind[:40]}; read are TOTAL MASS, MASS PER LENGTH and PER VOLUME")

    def _length(self, row: int) -> float:
        points = self.content.points[self.content.nodes_of(row)]
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())

    def _release(self, placed: Placed, instance: Instance) -> None:
        block = placed.block
        for place, cells in lines_of(block):
            label, end, words = [*cells, "", ""][:3]
            freed = "".join(words.upper().split()).split("-")
            if end.upper() not in ("S1", "S2") or any(word not in RELEASED for word in freed):
                words = f"takes an element, S1 or S2, and M1, M2, T or ALLM, not {', '.join(cells)[:60]}"
                raise fault(block, words, place)
            for row in self.content.rows("ELSET", name_of(label), instance.name, f"{place}: *{block.name}"):
                free = self.free.setdefault((row, int(end.upper() == "S2")), set())
                free |= {d for word in freed for d in RELEASED[word]}
                if self._section_of(row)[0].shape.section.angle and len({4, 5} & free) == 1:
                    raise fault(block, "frees M1 or M2 alone, no principal axes of the section", place)

    # Bars ---------------------------------------------------------------------------------------------------

    def _bars(self) -> tuple[Bars, tuple[BarProperty, ...]]:
        properties: dict[tuple[int, str, float], BarProperty] = {}
        index: dict[tuple[int, str, float], int] = {}
        bars: list[tuple[int, int, int, int, int]] = []
        beams: list[Beam] = []
        given: list[Floats] = []
        free: dict[int, set[int]] = {}
        for row, kind in enumerate(self.content.kinds):
            if kind.name not in known.LINES:
                continue
            beam, instance = self._section_of(row)
            key = (id(beam.block), _theory(kind.name), float(self.added[row]))
            if key not in properties:
                index[key] = len(properties)
                properties[key] = _property(beam, *key[1:], {p.name for p in properties.values()})
            first = len(bars)
            for a, b in pairwise(self.content.nodes_of(row)):
                bars.append((self.content.number(row), a, b, index[key], row))
                beams.append(beam)
                given.append(self._n1(row, beam, instance))
            for end, bar in ((0, first), (1, len(bars) - 1)):
                if (row, end) in self.free:
                    free[2 * bar + end] = self.free[row, end]
        table = np.array(bars, dtype=np.int64).reshape(-1, 5)
        n1, n2 = self._axes(table, beams, np.array(given).reshape(-1, 3))
        offset = np.array([beam.offset for beam in beams]).reshape(-1, 2)
        shift = np.where(
            (offset != 0).any(axis=1, keepdims=True), offset[:, :1] * n1 + offset[:, 1:] * n2, 0.0
        )
        ends = np.full((2 * len(bars), 6), np.inf)
        for end, directions in free.items():
            ends[end, sorted(directions)] = 0.0
        flip = np.array([-1.0 if beam.shape.flipped else 1.0 for beam in beams])
        return Bars(
            numbers=table[:, 0],
            ends=table[:, 1:3],
            properties=table[:, 3],
            height=n2 * flip[:, None],
            offsets=np.repeat(shift[:, None], 2, axis=1),
            stiffness=ends.reshape(-1, 2, 6),
        ), tuple(properties.values())

    def _n1(self, row: int, beam: Beam, instance: Instance) -> Floats:
        """Return the direction that is given for n1; a further node of the element comes first."""
        kind = self.content.kinds[row]
        if kind.extra:
            node = self.content.node(str(kind.extra), self.content.owners[row], f"{kind.place}: *ELEMENT")
            return self.content.points[node] - self.content.points[self.content.nodes_of(row)[0]]
        if beam.n1 is None or kind.name in known.PLANAR:
            return DEFAULT_N1
        return instance.turn @ beam.n1

    def _axes(self, table: Ints, beams: list[Beam], given: Floats) -> tuple[Floats, Floats]:
        """Return n1 and n2 = t x n1 of bars; NaN for sections that are the same in all directions."""
        points = self.content.points
        along = points[table[:, 2]] - points[table[:, 1]]
        length = np.linalg.norm(along, axis=1)
        for bar in np.flatnonzero(length <= SAME_PLACE * self.content.size).tolist():
            kind = self.content.kinds[table[bar, 4]]
            msg = f"{kind.place}: *ELEMENT {table[bar, 0]} of type {kind.name} has no length; delete it"
            raise MeshError(msg)
        tangent = along / length[:, None]
        n2 = np.cross(tangent, given)
        size = np.linalg.norm(n2, axis=1)
        parallel = size <= PARALLEL * np.linalg.norm(given, axis=1)
        for bar in np.flatnonzero(parallel).tolist():
            section = beams[bar].shape.section
            if section.Iy != section.Iz or any(beams[bar].offset):
                words = (
                    f": n1 is along element {table[bar, 0]}, so its section has no direction; give n1 on the "
                    "line after the dimensions (without it n1 is 0, 0, -1)"
                )
                raise fault(beams[bar].block, words)
        n2 = np.where(parallel[:, None], np.nan, n2 / np.where(parallel, 1.0, size)[:, None])
        return np.cross(n2, tangent), n2


def _property(beam: Beam, theory: str, mass: float, used: set[str]) -> BarProperty:
    """Return a property under the name of its element set, with a number where another has this name."""
    given = beam.block.options["ELSET"]
    name = next(n for n in (given, *(f"{given} {k}" for k in range(2, len(used) + 3))) if n not in used)
    return BarProperty(
        name=name, material=beam.material, section=beam.shape.section, theory=theory, mass_per_length=mass
    )


def _theory(kind: str) -> str:
    if kind in known.TRUSSES:
        return "bar"
    return "euler-bernoulli" if kind in known.SLENDER else "timoshenko"
