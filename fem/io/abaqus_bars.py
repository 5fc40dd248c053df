"""Bars of Abaqus' and CalculiX' decks: sections, orientation, offsets, releases and non-structural mass."""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem.io import abaqus_frame_keywords as known
from fem.io.abaqus_assembly import Instance
from fem.io.abaqus_content import Content, Placed, check, lines_of, numbers_of, whole
from fem.io.abaqus_deck import Block, name_of
from fem.io.abaqus_materials import Materials, material
from fem.io.abaqus_sections import ABAQUS_K, DIMENSIONS, SHAPES, Shape, arbitrary, general
from fem.io.deck import real
from fem.io.frame_deck import BarProperty, Bars
from fem.materials import Material, PropertyError
from fem.mesh import MeshError
from fem.sections.section import Section

Floats = NDArray[np.float64]

PARALLEL = 1e-6
"""Sine of the angle between n1 and the axis below which the section has no direction."""


class Beam(NamedTuple):
    """What a section keyword gives: shape, material, n1 in the axes of its part, and n1's place."""

    placed: Placed
    shape: Shape
    material: Material
    n1: Floats | None
    offset: tuple[float, float]


@dataclass(slots=True)
class BarBuilder:
    """The bars of a deck as they are read.

    Attributes
    ----------
    sections : list of (Beam, Instance) or None
        Of each row of the mesh's lines.
    added : ndarray
        Non-structural mass of each row [kg/m].
    free : dict of (int, int) to tuple of int
        Directions that are released at the first (0) or last (1) end of a row.
    """

    content: Content
    materials: Materials
    sections: list[tuple[Beam, Instance] | None] = field(init=False)
    added: Floats = field(init=False)
    free: dict[tuple[int, int], tuple[int, ...]] = field(default_factory=dict)
    shear: dict[str, Block] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.sections = [None] * len(self.content.kinds)
        self.added = np.zeros(len(self.content.kinds))

    def build(self) -> tuple[Bars, tuple[BarProperty, ...]]:
        """Return the bars and their properties.

        Raises
        ------
        MeshError
            For elements without a section or with two, and data that cannot be read.
        """
        found: dict[int, Beam] = {}
        for placed, instance in self.content.model_data("BEAMSECTION", "BEAMGENERALSECTION", "SOLIDSECTION"):
            key = id(placed)
            if key not in found:
                found[key] = self._truss(placed) if placed.keyword == "SOLIDSECTION" else self._beam(placed)
            types = known.TRUSSES if placed.keyword == "SOLIDSECTION" else known.LINES - known.TRUSSES
            for row in self.content.elements(placed, instance.name, types):
                self._assign(row, found[key], instance)
        for placed, instance in self.content.model_data("NONSTRUCTURALMASS"):
            self._non_structural(placed, instance)
        for placed, instance in self.content.model_data("RELEASE"):
            self._release(placed, instance)
        self._note_shear()
        return self._bars()

    def _assign(self, row: int, beam: Beam, instance: Instance) -> None:
        before = self.sections[row]
        if before is not None:
            block, old = beam.placed.block, before[0].placed.block
            msg = (
                f"{block.place}: *{block.name} gives element {self.content.number(row)} a second section, after "
                f"*{old.name} at {old.place}; take it out of one of the sets"
            )
            raise MeshError(msg)
        self.sections[row] = (beam, instance)

    # Sections -----------------------------------------------------------------------------------------------

    def _truss(self, placed: Placed) -> Beam:
        block = placed.block
        check(block, "ELSET", "MATERIAL", "ORIENTATION")
        rows = lines_of(block)
        if not rows:
            msg = f"{block.place}: *{block.name} of a truss needs its area on the next line"
            raise MeshError(msg)
        area = numbers_of(block, rows[0][0], rows[0][1][:1], 1, 1, "an area")[0] * self.content.units.area
        if not area > 0:
            msg = f"{rows[0][0]}: *{block.name} has the area {area:g} m²; it must be positive"
            raise MeshError(msg)
        mat = self.materials.find(block.option("MATERIAL", "MATERIAL="), block)
        return Beam(placed, Shape(Section.circle(d=2 * np.sqrt(area / np.pi))), mat, None, (0.0, 0.0))

    def _beam(self, placed: Placed) -> Beam:
        block, integrated = placed.block, placed.keyword == "BEAMSECTION"
        check(
            block, "ELSET", "SECTION", "MATERIAL", "OFFSET1", "OFFSET2", "POISSON", "TEMPERATURE", "LUMPED",
            "ROTARYINERTIA", "DENSITY", "ZERO", "ORIENTATION",
        )  # fmt: skip
        kind = "".join(block.option("SECTION", "SECTION=").upper().split())
        if block.options.get("ROTARYINERTIA", "EXACT") != "EXACT":
            self.content.notes.append(
                f"*{block.name} at line {block.line}: rotary inertia is that of the section, not isotropic"
            )
        rows = lines_of(block)
        count = self._count_of_section_lines(block, kind, rows)
        n1, more = self._n1(block, rows[count : count + 1]), rows[count + 1 :]
        mat = None if integrated else self._given(block, more)
        if mat is None:
            density = self._density(block) if "DENSITY" in block.options else None
            mat = self.materials.find(block.option("MATERIAL", "MATERIAL="), block, density)
        scaled, mat = (1.0, mat) if isinstance(mat, Material) else mat
        shape = self._shape(block, kind, rows[:count], mat.nu)
        if scaled != 1.0:
            s = shape.section
            shape = shape._replace(
                section=replace(
                    s, J=s.J * scaled, ky=s.ky * scaled, kz=s.kz * scaled, shape="", dimensions={}
                )
            )
        shape = self._with_stiffness(placed, shape, mat)
        self.shear.setdefault(kind, block)
        return Beam(placed, self._centred(placed, shape), mat, n1, self._offset(block, kind, rows, shape))

    def _count_of_section_lines(self, block: Block, kind: str, rows: list[tuple[str, list[str]]]) -> int:
        if not rows:
            msg = f"{block.place}: *{block.name} has no data line with the dimensions of its section"
            raise MeshError(msg)
        if kind == "ARBITRARY":
            count = whole(block, rows[0][0], rows[0][1][0], "the number of segments")
            if not 2 <= count <= len(rows):
                msg = f"{rows[0][0]}: *{block.name} has {count} segments, and {len(rows)} lines after it"
                raise MeshError(msg)
            return count
        if kind != "GENERAL" and kind not in SHAPES:
            allowed = ", ".join([*DIMENSIONS, "ARBITRARY", "GENERAL"])
            msg = (
                f"{block.place}: *{block.name} has SECTION={kind[:40]}, which is not read; read are {allowed}"
            )
            raise MeshError(msg)
        return 1

    def _shape(self, block: Block, kind: str, rows: list[tuple[str, list[str]]], nu: float) -> Shape:
        units = self.content.units
        place, cells = rows[0]
        try:
            if kind == "GENERAL":
                v = numbers_of(block, place, cells, 5, 7, "A, I11, I12, I22, J")
                constants = (v[0] * units.area, *(x * units.second_moment for x in v[1:5]))
                return Shape(general(*constants))
            if kind == "ARBITRARY":
                first = numbers_of(block, place, cells[1:], 5, 5, "ends of a segment and its thickness")
                others = [numbers_of(block, p, c, 3, 3, "an end and a thickness") for p, c in rows[1:]]
                return arbitrary([[x * units.length for x in row] for row in (first, *others)])
            least, most, what = DIMENSIONS[kind]
            given = numbers_of(block, place, cells, least, most, what)
            if kind == "CIRC" and len(given) == 1 and self.content.calculix:
                given *= 2  # CalculiX takes thicknesses, Abaqus a radius
            return SHAPES[kind]([x * units.length for x in given], max(nu, 0.0))
        except PropertyError as reason:
            msg = f"{place}: *{block.name}: {reason}"
            raise MeshError(msg) from reason

    def _n1(self, block: Block, rows: list[tuple[str, list[str]]]) -> Floats | None:
        if not rows:
            return None
        place, cells = rows[0]
        n1 = np.array([*numbers_of(block, place, cells, 1, 3, "the direction n1"), 0.0, 0.0][:3])
        if not n1.any():
            msg = f"{place}: *{block.name} has the direction n1 = 0, 0, 0; give a vector, or no line at all"
            raise MeshError(msg)
        return n1

    def _density(self, block: Block) -> float:
        try:
            return real(block.options["DENSITY"]) * self.content.units.density
        except ValueError as reason:
            msg = f"{block.place}: *{block.name}: the density cannot be read: {reason}"
            raise MeshError(msg) from reason

    def _given(self, block: Block, rows: list[tuple[str, list[str]]]) -> tuple[float, Material] | None:
        """Return E and G on the third line as a factor of G and a material; None where a material is named.

        A material has a Poisson's ratio of at most 0.5; J and k take what G has beyond.
        """
        if block.options.get("MATERIAL"):
            return None
        if not rows:
            msg = f"{block.place}: *{block.name} has neither a material nor E and G on its third line"
            raise MeshError(msg)
        E, G = numbers_of(block, rows[0][0], rows[0][1][:2], 2, 2, "E and G")
        if not (E > 0 and G > 0):
            msg = f"{rows[0][0]}: *{block.name} has E = {E:g} and G = {G:g}; both must be positive"
            raise MeshError(msg)
        if "DENSITY" not in block.options:
            msg = (
                f"{block.place}: *{block.name} has no density, which natural frequencies need; write DENSITY="
            )
            raise MeshError(msg)
        nu = E / (2 * G) - 1
        inside = float(np.clip(nu, -0.9, 0.5))
        factor = (1 + inside) / (1 + nu)
        name = block.options["ELSET"]
        stress = self.content.units.stress
        return factor, material(block, name, E * stress, self._density(block), inside)

    def _with_stiffness(self, placed: Placed, shape: Shape, mat: Material) -> Shape:
        block = placed.subs.get("TRANSVERSESHEARSTIFFNESS")
        if block is None:
            return shape
        rows = lines_of(block)
        cells = rows[0][1][:2] if rows else []
        place = rows[0][0] if rows else block.place
        K23, K13 = [*numbers_of(block, place, cells, 1, 2, "K23 and K13"), 0.0][:2]
        GA = mat.G * shape.section.A
        ky, kz = ((K or K23) * self.content.units.force / GA for K in (K13, K23))
        if shape.section.angle and ky != kz:
            msg = f"{block.place}: *{block.name} differs along 1 and 2, which are no principal axes of the section"
            raise MeshError(msg)
        try:
            section = replace(shape.section, ky=ky, kz=kz, shape="", dimensions={}, estimated_k=False)
        except PropertyError as reason:
            msg = f"{place}: *{block.name}: {reason}"
            raise MeshError(msg) from reason
        return shape._replace(section=section)

    def _centred(self, placed: Placed, shape: Shape) -> Shape:
        """Return a shape with the centroid of *CENTROID, and a note on its shear centre."""
        for keyword, block in placed.subs.items():
            if keyword in ("CENTROID", "BEAMSECTIONOFFSET"):
                rows = lines_of(block) or [(block.place, ["0"])]
                values = [*numbers_of(block, *rows[0], 1, 2, "two coordinates"), 0.0]
                sign = 1.0 if keyword == "CENTROID" else -1.0
                given = [sign * v * self.content.units.length for v in values[:2]]
                if keyword == "BEAMSECTIONOFFSET":
                    msg = (
                        f"{block.place}: *{block.name} is not read; give the offset in the study file instead"
                    )
                    raise MeshError(msg)
                shape = shape._replace(centroid=(given[0], given[1]))
        centre = placed.subs.get("SHEARCENTER")
        if centre is not None or np.hypot(*shape.section.shear_centre) > 1e-3 * np.sqrt(shape.section.A):
            where = centre if centre is not None else placed.block
            self.content.notes.append(
                f"*{where.name} at line {where.line}: the shear centre is not at the centroid; bars bend and twist "
                "about their centroid, so that modes of torsion with bending come out higher"
            )
        return shape

    def _offset(
        self, block: Block, kind: str, rows: list[tuple[str, list[str]]], shape: Shape
    ) -> tuple[float, float]:
        """Return CalculiX' offsets: the node from the axis, in thicknesses along 1 and 2."""
        given = [block.options.get(key, "") for key in ("OFFSET1", "OFFSET2")]
        try:
            values = [real(text) for text in given]
        except ValueError as reason:
            msg = f"{block.place}: *{block.name}: an offset cannot be read: {reason}"
            raise MeshError(msg) from reason
        if any(values) and kind not in ("RECT", "BOX", "CIRC", "PIPE"):
            msg = f"{block.place}: *{block.name} has offsets with SECTION={kind}; they are read for RECT, BOX, CIRC, PIPE"
            raise MeshError(msg)
        sizes = [real(c) * self.content.units.length for c in rows[0][1][:2]] if any(values) else [0.0]
        a, b = (2 * sizes[0],) * 2 if kind == "PIPE" else (sizes[0], sizes[-1])
        return -values[0] * a, -values[1] * b

    def _note_shear(self) -> None:
        notes = [
            f"{kind} {ABAQUS_K[kind]:g}"
            for kind, block in self.shear.items()
            if kind in ABAQUS_K and kind != "GENERAL"
        ]
        if notes:
            self.content.notes.append(
                "shear coefficients are those of elasticity for the shape; Abaqus takes "
                f"{', '.join(notes)}, which matters where bars are short"
            )
        if "CIRC" in self.shear and not self.content.calculix and self._one_number("CIRC"):
            self.content.notes.append(
                "SECTION=CIRC: the number is the radius, as in Abaqus; CalculiX takes it as the diameter"
            )
        if "L" in self.shear:
            self.content.notes.append(
                "SECTION=L: the nodes are taken to be where the middle lines of the legs meet"
            )
        if "TRAPEZOID" in self.shear:
            self.content.notes.append("SECTION=TRAPEZOID: J and k are those of a rectangle of the mean width")

    def _one_number(self, kind: str) -> bool:
        rows = lines_of(self.shear[kind])
        return bool(rows) and len(rows[0][1]) == 1

    # Mass and releases --------------------------------------------------------------------------------------

    def _non_structural(self, placed: Placed, instance: Instance) -> None:
        block, units = placed.block, self.content.units
        check(block, "ELSET", "UNITS", "DISTRIBUTION")
        rows = lines_of(block)
        if not rows:
            msg = f"{block.place}: *{block.name} has no data line with a mass"
            raise MeshError(msg)
        value = numbers_of(block, rows[0][0], rows[0][1], 1, 1, "a mass")[0]
        elements = self.content.elements(placed, instance.name, known.LINES)
        beams = [self._section_of(row)[0] for row in elements]
        area = np.array([beam.shape.section.A for beam in beams])
        kind = "".join(block.option("UNITS", "UNITS=").upper().split())
        if kind == "TOTALMASS":
            volume = "VOLUME" in block.options.get("DISTRIBUTION", "MASS PROPORTIONAL")
            weight = area * (1.0 if volume else np.array([beam.material.rho for beam in beams]))
            length = np.array([self._length(row) for row in elements])
            self.added[elements] += value * units.mass * weight / float(weight @ length)
        elif kind == "MASSPERLENGTH":
            self.added[elements] += value * units.mass_per_length
        elif kind == "MASSPERVOLUME":
            self.added[elements] += value * units.density * area
        else:
            msg = f"{block.place}: *{block.name} has UNITS={kind[:40]}; read are TOTAL MASS, MASS PER LENGTH, MASS PER VOLUME"
            raise MeshError(msg)
        if value < 0:
            msg = f"{rows[0][0]}: *{block.name} has the mass {value:g}; it cannot be negative"
            raise MeshError(msg)

    def _length(self, row: int) -> float:
        points = self.content.points[self.content.nodes_of(row)]
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())

    def _release(self, placed: Placed, instance: Instance) -> None:
        block = placed.block
        directions = {"M1": (4,), "M2": (5,), "T": (3,), "ALLM": (3, 4, 5)}
        for place, cells in lines_of(block):
            end = cells[1].upper() if len(cells) == 3 else ""
            words = "".join(cells[2].upper().split()).split("-") if len(cells) == 3 else [""]
            if end not in ("S1", "S2") or any(word not in directions for word in words):
                msg = (
                    f"{place}: *RELEASE takes an element, S1 or S2, and M1, M2, T or ALLM, but found "
                    f"{', '.join(cells)[:60]}"
                )
                raise MeshError(msg)
            free = {d for word in words for d in directions[word]}
            for row in self.content.rows("ELSET", name_of(cells[0]), instance.name, f"{place}: *RELEASE"):
                self._section_of(row)
                key = (row, int(end == "S2"))
                self.free[key] = tuple(sorted(free | set(self.free.get(key, ()))))
                section = self._section_of(row)[0].shape.section
                if section.angle and len({4, 5} & set(self.free[key])) == 1:
                    msg = f"{place}: *RELEASE of M1 or M2 alone, which are no principal axes of the section"
                    raise MeshError(msg)

    # Bars ---------------------------------------------------------------------------------------------------

    def _section_of(self, row: int) -> tuple[Beam, Instance]:
        found, kind = self.sections[row], self.content.kinds[row]
        if found is None:
            keyword = "*SOLID SECTION" if kind.name in known.TRUSSES else "*BEAM SECTION"
            msg = f"{kind.place}: *ELEMENT {self.content.number(row)} of type {kind.name} has no {keyword}"
            raise MeshError(msg)
        return found

    def _bars(self) -> tuple[Bars, tuple[BarProperty, ...]]:
        properties: dict[tuple[int, str, float], BarProperty] = {}
        bars: list[tuple[int, int, int, int]] = []
        height, offsets, ends = [], [], []
        for row, kind in enumerate(self.content.kinds):
            if kind.name not in known.LINES:
                continue
            beam, instance = self._section_of(row)
            theory = _theory(kind.name)
            key = (id(beam.placed), theory, float(self.added[row]))
            if key not in properties:
                properties[key] = self._property(beam, theory, key[2], properties)
            index = list(properties).index(key)
            nodes = self.content.nodes_of(row)
            for k, (a, b) in enumerate(zip(nodes[:-1], nodes[1:], strict=True)):
                bars.append((self.content.number(row), a, b, index))
                n1, n2 = self._axes(row, beam, instance, a, b)
                height.append(-n2 if beam.shape.flipped else n2)
                c1, c2 = beam.shape.centroid[0] + beam.offset[0], beam.shape.centroid[1] + beam.offset[1]
                shift = c1 * n1 + c2 * n2 if c1 or c2 else np.zeros(3)
                offsets.append([shift, shift])
                ends.append(self._ends(row, k == 0, k == len(nodes) - 2))
        table = np.array(bars, dtype=np.int64).reshape(-1, 4)
        return Bars(
            numbers=table[:, 0],
            ends=table[:, 1:3],
            properties=table[:, 3],
            height=np.array(height, dtype=float).reshape(-1, 3),
            offsets=np.array(offsets, dtype=float).reshape(-1, 2, 3),
            stiffness=np.array(ends, dtype=float).reshape(-1, 2, 6),
        ), tuple(properties.values())

    def _property(
        self, beam: Beam, theory: str, mass: float, others: dict[tuple[int, str, float], BarProperty]
    ) -> BarProperty:
        name = beam.placed.block.options["ELSET"]
        used = {p.name for p in others.values()}
        name = next(n for n in (name, *(f"{name} {k}" for k in range(2, len(used) + 3))) if n not in used)
        return BarProperty(
            name=name, material=beam.material, section=beam.shape.section, theory=theory, mass_per_length=mass
        )

    def _axes(self, row: int, beam: Beam, instance: Instance, a: int, b: int) -> tuple[Floats, Floats]:
        """Return n1 and n2 = t x n1; a further node of the element comes before the section's n1."""
        kind = self.content.kinds[row]
        tangent = self.content.points[b] - self.content.points[a]
        length = float(np.linalg.norm(tangent))
        if not length > 1e-9 * self.content.size:
            msg = f"{kind.place}: *ELEMENT {self.content.number(row)} has no length; delete it"
            raise MeshError(msg)
        if kind.name in known.TRUSSES:
            return np.zeros(3), np.full(3, np.nan)
        first = np.array([0.0, 0.0, -1.0])
        if kind.name in known.PLANAR:
            pass
        elif kind.extra:
            node = self.content.node(str(kind.extra), self.content.owners[row], f"{kind.place}: *ELEMENT")
            first = self.content.points[node] - self.content.points[self.content.nodes_of(row)[0]]
        elif beam.n1 is not None:
            first = instance.turn @ beam.n1
        n2 = np.cross(tangent / length, first)
        size = float(np.linalg.norm(n2))
        if size <= PARALLEL * float(np.linalg.norm(first)):
            if beam.shape.section.Iy == beam.shape.section.Iz and not any(
                (*beam.shape.centroid, *beam.offset)
            ):
                return np.zeros(3), np.full(3, np.nan)
            block = beam.placed.block
            msg = (
                f"{block.place}: *{block.name}: n1 is along element {self.content.number(row)}, so that its "
                "section has no direction; give n1 on the line after the dimensions (0, 0, -1 without one)"
            )
            raise MeshError(msg)
        n2 /= size
        return np.cross(n2, tangent / length), n2

    def _ends(self, row: int, first: bool, last: bool) -> Floats:
        stiffness = np.full((2, 6), np.inf)
        for end, here in enumerate((first, last)):
            if here:
                stiffness[end, list(self.free.get((row, end), ()))] = 0.0
        return stiffness


def _theory(kind: str) -> str:
    if kind in known.TRUSSES:
        return "bar"
    return "euler-bernoulli" if kind in known.SLENDER else "timoshenko"
