"""Sections of Abaqus' and CalculiX' decks: *BEAM SECTION, *BEAM GENERAL SECTION and *SOLID SECTION."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from fem.array_types import Floats
from fem.io.abaqus_content import Content, Placed, check, data, lines_of, numbers_of, read_integer
from fem.io.abaqus_deck import AbaqusBlock, fault
from fem.io.abaqus_materials import Materials
from fem.io.deck import real
from fem.io.faults import refuse
from fem.io.frame_sections import angle, box, material_of, of_constants, rod, with_shear, with_walls
from fem.materials import Material, PropertyError
from fem.sections.outlines import turned
from fem.sections.section import Section

# Sections of Abaqus' and CalculiX' beams: shapes of their library, thin walls and given constants -----------
# Abaqus' local axes 1 (n1) and 2 (n2 = t x n1) are y and z here: I11, bending about 1, is Iy, and b is
# along 2.


ABAQUS_K: Final = {
    "RECT": 0.85,
    "CIRC": 0.89,
    "PIPE": 0.53,
    "THICKPIPE": 0.89,
    "BOX": 0.44,
    "I": 0.44,
    "L": 1.0,
    "HEX": 0.53,
    "TRAPEZOID": 0.822,
    "ARBITRARY": 1.0,
    "GENERAL": 1.0,
}
"""Shear coefficients of Abaqus, the same in both directions (Abaqus Analysis User's Guide, "Choosing a beam
element"); a thick pipe has 0.53 to 0.89."""


class AbaqusShape(NamedTuple):
    """A section with the place of its centroid from the node, along 1 and 2 [m], and whether 2 is -z."""

    section: Section
    centroid: tuple[float, float] = (0.0, 0.0)
    flipped: bool = False


def _circle(d: list[float], nu: float) -> AbaqusShape:
    if len(d) == 2 and d[0] != d[1]:
        return AbaqusShape(Section.ellipse(b=d[0], h=d[1], nu=nu))
    return AbaqusShape(Section.circle(d=d[0] if len(d) == 2 else 2 * d[0], nu=nu))


def _box(d: list[float], nu: float) -> AbaqusShape:
    a, b, right, top, left, bottom = d
    section, centroid = box(a, b, (bottom, right, top, left), nu)
    return AbaqusShape(section, (centroid[0] - a / 2, centroid[1] - b / 2))


def _i(d: list[float], nu: float) -> AbaqusShape:
    node, h, b1, b2, t1, t2, t3 = d
    flipped = b2 * t2 == 0.0
    if flipped or b1 * t1 == 0.0:
        section = Section.t_section(b=b1 if flipped else b2, h=h, tf=t1 if flipped else t2, tw=t3)
    elif (b1, t1) == (b2, t2):
        section = Section.i_section(b=b1, h=h, tf=t1, tw=t3, nu=nu)
    else:
        section = Section.unequal_i_section(b1=b1, b2=b2, h=h, tf1=t1, tf2=t2, tw=t3)
    z = section.outlines[0][:, 1]
    height = float(z.max() if flipped else -z.min())  # of the centroid above the bottom
    return AbaqusShape(section, (0.0, height - node), flipped)


def _l(d: list[float], nu: float) -> AbaqusShape:
    a, b, t1, t2 = d
    section, centroid = angle(a, b, t1, t2)
    return AbaqusShape(section, (centroid[0] - t2 / 2, centroid[1] - t1 / 2))


def _trapezoid(d: list[float], nu: float) -> AbaqusShape:
    a, b, c, node = d
    mean = Section.rectangle(b=(a + c) / 2, h=b, nu=nu)
    corners = np.array([(-a / 2, 0.0), (a / 2, 0.0), (c / 2, b), (-c / 2, b)])
    if c == 0.0:
        corners = corners[:3]
    section = Section.polygon(corners, J=mean.J, ky=mean.ky, kz=mean.kz, label="trapezoid")
    return AbaqusShape(section, (0.0, b * (a + 2 * c) / (3 * (a + c)) - node))


Row = tuple[int, int, str, Callable[[list[float], float], AbaqusShape]]
_TUBE: Row = (
    2,
    2,
    "outer radius and wall thickness",
    lambda d, nu: AbaqusShape(Section.tube(2 * d[0], d[1], nu)),
)

SHAPES: Final[dict[str, Row]] = {
    "RECT": (2, 2, "a, b", lambda d, nu: AbaqusShape(Section.rectangle(*d, nu=nu))),
    "CIRC": (1, 2, "a radius, or the two thicknesses of CalculiX", _circle),
    "PIPE": _TUBE,
    "THICKPIPE": _TUBE,
    "BOX": (6, 6, "a, b, t1, t2, t3, t4", _box),
    "I": (7, 7, "l, h, b1, b2, t1, t2, t3", _i),
    "L": (4, 4, "a, b, t1, t2", _l),
    "HEX": (
        2,
        2,
        "circumscribed radius and wall thickness",
        lambda d, nu: AbaqusShape(Section.hollow_polygon(n=6, d=np.sqrt(3.0) * d[0], t=d[1])),
    ),
    "TRAPEZOID": (4, 4, "a, b, c, d", _trapezoid),
}
"""Least and greatest count of dimensions, what they are, and the section of them [m] and Poisson's ratio."""


def arbitrary(rows: list[list[float]]) -> AbaqusShape:
    """Return a section of thin segments: the first with both its ends, the others with their second ones.

    Segments have no stiffness of bending about their line, as in Abaqus.
    """
    ends = [tuple(rows[0][:2]), tuple(rows[0][2:4]), *(tuple(row[:2]) for row in rows[1:])]
    t = np.array([rows[0][4], *(row[2] for row in rows[1:])])
    places = list(dict.fromkeys(ends))
    pairs = [(places.index(a), places.index(b)) for a, b in pairwise(ends)]
    points = np.array(places)
    a, b = points[[p for p, _ in pairs]], points[[q for _, q in pairs]]
    area = np.linalg.norm(b - a, axis=1) * t
    if not ((t > 0) & (area > 0)).all():
        refuse("an ARBITRARY section has a segment without length or thickness", PropertyError)
    centroid = (area[:, None] * (a + b) / 2).sum(axis=0) / area.sum()
    a, b = a - centroid, b - centroid
    # ∫ s sᵀ dA along a straight segment from a to b is A (a aᵀ + b bᵀ + (a bᵀ + b aᵀ)/2) / 3
    second = (a.T * area) @ (a + b / 2) / 3 + (b.T * area) @ (b + a / 2) / 3
    moments = (second[1, 1], second[0, 0], second[0, 1])
    flat = of_constants("ARBITRARY", float(area.sum()), moments, 1.0, (1.0, 1.0))
    section = with_walls(flat, turned(points, centroid, flat.angle), pairs, t)
    return AbaqusShape(section, (float(centroid[0]), float(centroid[1])))


# ------------------------------------------------------------------------------------------------------------


Lines = list[tuple[str, list[str]]]

OFFSETS = ("RECT", "BOX", "CIRC", "PIPE")
"""Sections that CalculiX can move off the nodes."""


class Beam(NamedTuple):
    """Data of a section keyword.

    Attributes
    ----------
    n1 : ndarray (3,) or None, in the axes of its part; None takes the default
    offset : (float, float), from the nodes to the centroid, along 1 and 2 [m]
    """

    block: AbaqusBlock
    shape: AbaqusShape
    material: Material
    n1: Floats | None = None
    offset: tuple[float, float] = (0.0, 0.0)


def _direction_and_rest(placed: Placed, n: int, rows: Lines) -> tuple[Lines, Lines]:
    """Return the line of n1, none where a blank line stands for it, and the lines after it.

    n is the number of lines with dimensions. After a blank line, *BEAM SECTION has numbers of integration
    points; any others are n1 after a line that CalculiX passes over.
    """
    every = list(placed.block.rows())
    after = every.index(rows[n - 1]) + 1
    rest = rows[n:]
    if after == len(every) or any(every[after][1]):
        return rest[:1], rest[1:]
    if placed.keyword == "BEAMSECTION" and rest and not all(map(_is_count, rest[0][1])):
        return rest[:1], rest[1:]
    return [], rest


def _is_count(cell: str) -> bool:
    return cell.isascii() and cell.isdigit() and bool(cell.strip("0"))


@dataclass(frozen=True, slots=True)
class BeamReader:
    """Reads section keywords."""

    content: Content
    materials: Materials

    def truss(self, placed: Placed) -> Beam:
        """Return the section of trusses: a circle of their area."""
        block = placed.block
        check(block, "ELSET", "MATERIAL", "ORIENTATION")
        area = data(block, 0, 1, 1, "an area", 1)[0] * self.content.units.area
        if not area > 0:
            raise fault(block, f"has the area {area:g} m²; it must be positive")
        return Beam(
            block, AbaqusShape(rod(area)), self.materials.find(block.option("MATERIAL", "MATERIAL="), block)
        )

    def beam(self, placed: Placed) -> Beam:
        """Return the section of beams."""
        block = placed.block
        check(
            block,
            "ELSET",
            "SECTION",
            "MATERIAL",
            "OFFSET1",
            "OFFSET2",
            "POISSON",
            "TEMPERATURE",
            "LUMPED",
            "ROTARYINERTIA",
            "DENSITY",
            "ZERO",
            "ORIENTATION",
        )
        kind = "".join(block.option("SECTION", "SECTION=").upper().split())
        kind = {"RECTANGULAR": "RECT", "CIRCULAR": "CIRC"}.get(kind, kind)  # CalculiX compares four letters
        if block.options.get("ROTARYINERTIA", "EXACT") != "EXACT":
            self.content.notes.append(f"*{block.name} at line {block.line}: rotary inertia is not isotropic")
        rows = lines_of(block)
        n = self._section_lines(block, kind, rows)
        n1, rest = _direction_and_rest(placed, n, rows)
        factor, mat = self._material(placed, rest)
        shape = self._shape(block, kind, rows[:n], mat.nu)
        shape = shape._replace(section=self._with_shear(placed, shape.section, mat, factor))
        self._note(placed, kind, shape.section)
        return Beam(block, shape, mat, self._n1(block, n1), self._offset(placed, kind, shape))

    def _section_lines(self, block: AbaqusBlock, kind: str, rows: Lines) -> int:
        """Return the number of lines with dimensions."""
        if kind not in ("GENERAL", "ARBITRARY", *SHAPES):
            allowed = ", ".join([*SHAPES, "ARBITRARY", "GENERAL"])
            raise fault(block, f"has SECTION={kind[:40]}, which is not read; read are {allowed}")
        if not rows:
            raise fault(block, "has no data line with the dimensions of its section")
        if kind != "ARBITRARY":
            return 1
        count = read_integer(block, rows[0][0], rows[0][1][0], "the number of segments")
        if not 2 <= count <= len(rows):
            raise fault(block, f"has {count} segments and {len(rows)} data lines", rows[0][0])
        return count

    def _shape(self, block: AbaqusBlock, kind: str, rows: Lines, nu: float) -> AbaqusShape:
        units = self.content.units
        place, cells = rows[0]
        try:
            if kind == "GENERAL":
                v = numbers_of(block, place, cells, 5, 7, "A, I11, I12, I22, J")
                I11, I12, I22, J = np.array(v[1:5]) * units.second_moment
                return AbaqusShape(of_constants("GENERAL", v[0] * units.area, (I11, I22, I12), J, (1.0, 1.0)))
            if kind == "ARBITRARY":
                first = numbers_of(block, place, cells[1:], 5, 5, "the ends of a segment and its thickness")
                others = [numbers_of(block, p, c, 3, 3, "an end and a thickness") for p, c in rows[1:]]
                return arbitrary([[x * units.length for x in row] for row in (first, *others)])
            least, most, what, section = SHAPES[kind]
            given = numbers_of(block, place, cells, least, most, what)
            if kind == "CIRC" and len(given) == 1 and self.content.calculix:
                given *= 2  # CalculiX takes thicknesses, Abaqus a radius
            return section([x * units.length for x in given], max(nu, 0.0))
        except PropertyError as reason:
            raise fault(block, f": {reason}", place) from reason

    def _n1(self, block: AbaqusBlock, rows: Lines) -> Floats | None:
        if not rows:
            return None
        place, cells = rows[0]
        n1 = np.array([*numbers_of(block, place, cells, 1, 3, "the direction n1"), 0.0, 0.0][:3])
        if not n1.any():
            raise fault(block, "has the direction n1 = 0, 0, 0; give a vector, or no line", place)
        return n1

    def _material(self, placed: Placed, rows: Lines) -> tuple[float, Material]:
        """Return a factor of G and the material, named or by E and G on the third line.

        Poisson's ratio is at most 0.5; J and the shear coefficients take what G has beyond.
        """
        block, units = placed.block, self.content.units
        density = None
        if "DENSITY" in block.options:
            try:
                density = real(block.options["DENSITY"]) * units.density
            except ValueError as reason:
                raise fault(block, f": the density cannot be read: {reason}") from reason
        if placed.keyword == "BEAMSECTION" or block.options.get("MATERIAL"):
            return 1.0, self.materials.find(block.option("MATERIAL", "MATERIAL="), block, density)
        if not rows:
            raise fault(block, "has neither a material nor E and G on its third line")
        E, G = numbers_of(block, rows[0][0], rows[0][1][:2], 2, 2, "E and G")
        if not (E > 0 and G > 0):
            raise fault(block, f"has E = {E:g} and G = {G:g}; both must be positive", rows[0][0])
        density = density or self.materials.negligible(f"*{block.name} ({block.place})", E * units.stress)
        name = block.option("ELSET", "ELSET=")
        try:
            material, factor = material_of(name, E * units.stress, G * units.stress, E / (2 * G) - 1, density)
        except PropertyError as reason:
            raise fault(block, f": {reason}") from reason
        return factor, material

    def _with_shear(self, placed: Placed, section: Section, mat: Material, factor: float) -> Section:
        """Return a section with another G, by a factor, and the areas of *TRANSVERSE SHEAR STIFFNESS."""
        block = placed.subs.get("TRANSVERSESHEARSTIFFNESS")
        if block is None:
            return with_shear(section, factor)
        K23, K13 = [*data(block, 0, 1, 2, "K23 and K13", 2), 0.0][:2]
        ky, kz = (K * self.content.units.force / (mat.G * section.A) for K in (K13 or K23, K23))
        if section.angle and ky != kz:
            raise fault(block, "differs along 1 and 2, which are no principal axes of the section")
        if min(ky, kz) < 0:
            raise fault(block, "is negative")
        return with_shear(section, factor, (ky, kz))

    def _offset(self, placed: Placed, kind: str, shape: AbaqusShape) -> tuple[float, float]:
        """Return the centroid of the shape or of *CENTROID, and what OFFSET1 and OFFSET2 of CalculiX add.

        These are the place of the nodes from the axis, in thicknesses (seen with ccx 2.20).
        """
        block, length = placed.block, self.content.units.length
        c1, c2 = shape.centroid
        if "CENTROID" in placed.subs:
            c1, c2 = (
                v * length for v in [*data(placed.subs["CENTROID"], 0, 1, 2, "two coordinates"), 0.0][:2]
            )
        if "BEAMSECTIONOFFSET" in placed.subs:
            raise fault(placed.subs["BEAMSECTIONOFFSET"], "is not read; give the offset in the study file")
        try:
            o1, o2 = (real(block.options.get(key, "")) for key in ("OFFSET1", "OFFSET2"))
        except ValueError as reason:
            raise fault(block, f": an offset cannot be read: {reason}") from reason
        if not (o1 or o2):
            return c1, c2
        if kind not in OFFSETS:
            raise fault(block, f"has an offset and SECTION={kind}; offsets go with {', '.join(OFFSETS)}")
        sizes = [real(cell) * length for cell in lines_of(block)[0][1][:2]]
        a, b = (2 * sizes[0],) * 2 if kind == "PIPE" else (sizes[0], sizes[-1])
        return c1 - o1 * a, c2 - o2 * b

    def _note(self, placed: Placed, kind: str, section: Section) -> None:
        """Say how a section differs from that of Abaqus."""
        block, notes = placed.block, self.content.notes
        centre = placed.subs.get("SHEARCENTER")
        if centre is not None or np.hypot(*section.shear_centre) > 1e-3 * np.sqrt(section.A):
            where = block if centre is None else centre
            notes.append(
                f"*{where.name} at line {where.line}: the shear centre is not at the centroid, about which "
                "bars bend and twist here; modes of torsion with bending are higher"
            )
        words = {
            "L": "the nodes are taken to be where the middle lines of the legs meet",
            "TRAPEZOID": "J and k are those of a rectangle of the mean width",
            "CIRC": "the number is the radius, as in Abaqus; CalculiX takes it as the diameter",
        }
        one = len(lines_of(block)[0][1]) == 1 and not self.content.calculix
        if kind in words and (kind != "CIRC" or one):
            notes.append(f"*{block.name} at line {block.line}: {words[kind]}")
        if kind != "GENERAL" and "TRANSVERSESHEARSTIFFNESS" not in placed.subs and section.ky:
            notes.append(
                f"*{block.name} at line {block.line}: shear coefficients are {section.ky:.3g} and "
                f"{section.kz:.3g} along 1 and 2; Abaqus takes {ABAQUS_K[kind]:g}, which counts in short bars"
            )
