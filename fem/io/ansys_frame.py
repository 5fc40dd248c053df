"""Frame models of ANSYS archive files (``.cdb``): beams, pipes, links, springs, masses, equations.

ANSYS' nodes have the degrees of freedom of their elements only; the others are fixed here. An element without
an orientation node has its y parallel to the global X-Y plane, or along global Y where it is along global Z.
[Mechanical APDL element reference: BEAM188, BEAM4, COMBIN14, MASS21; theory reference 13.21]
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fem.array_types import Floats
from fem.io.ansys_content import ON_AXIS, AnsysDeck, AnsysElement
from fem.io.ansys_deck import read_deck
from fem.io.ansys_sections import PlacedSection, placed_section
from fem.io.ansys_systems import rotation
from fem.io.deck import named
from fem.io.deck_units import DeckUnits
from fem.io.frame_deck import (
    BarProperty,
    Bars,
    Body,
    Connection,
    Equation,
    Found,
    FrameDeck,
    Link,
    along,
    axes_along,
    entry,
    supports_of,
    terms_of,
)
from fem.io.frame_sections import rod
from fem.materials import Material, PropertyError, negligible_density
from fem.model import DIRECTIONS, Damping
from fem.sections.section import Section

_LINKS = (1, 8, 10, 180)
_BEAMS = {kind: count for kind, count in ON_AXIS.items() if kind not in _LINKS}
"""Nodes of beams and pipes on their axis; another one orients them."""
BY_SECTION = (188, 189, 288, 289)
_NAMES = {
    **dict.fromkeys((3, 4, 44, 188, 189), "BEAM"),
    **dict.fromkeys(_LINKS, "LINK"),
    14: "COMBIN",
    16: "PIPE",
    21: "MASS",
    184: "MPC",
    288: "PIPE",
    289: "PIPE",
}
_UNITS = {
    "SI": (1.0, 1.0, 1.0),
    "MKS": (1.0, 1.0, 1.0),
    "CGS": (0.01, 1e-3, 1.0),
    "MPA": (1e-3, 1e3, 1.0),
    "UMKS": (1e-6, 1.0, 1.0),
    "BFT": (0.3048, 14.59390, 1.0),
    "BIN": (0.0254, 175.12683, 1.0),
}
_RELEASES = ((1, 5), (10, 4), (100, 3), (1000, 0))
"""Digits of BEAM44's KEYOPT(7) and (8), and the local directions that they release."""


def read_ansys_frame(path: Path, units: DeckUnits) -> FrameDeck:
    """Return the frame model of an ANSYS archive in SI units.

    Elements: BEAM3, 4, 44, 188, 189, PIPE16, 288, 289, LINK1, 8, 10, 180, COMBIN14, MASS21, MPC184 as rigid
    beam or link. Others are refused where they share nodes with these, and named in the notes where not.

    Parameters
    ----------
    path : path
    units : Units
        Of the archive's values.

    Raises
    ------
    MeshError
        With file, line and command for anything that cannot be read, or that would change the result unseen.
    """
    return _Frame(read_deck(path), DeckUnits.of(units)).deck()


@dataclass(slots=True)
class _Frame(Found):
    source: AnsysDeck
    units: DeckUnits
    rows: dict[int, int] = field(default_factory=dict)
    dofs: dict[int, set[int]] = field(default_factory=lambda: defaultdict(set))
    bars: list[tuple] = field(default_factory=list)
    properties: list[BarProperty] = field(default_factory=list)
    known: dict[tuple, int] = field(default_factory=dict)
    rigid: list[AnsysElement] = field(default_factory=list)
    fixed: set[tuple[int, int]] = field(default_factory=set)
    materials: dict[int, Material] = field(default_factory=dict)

    def deck(self) -> FrameDeck:
        """Return the frame."""
        self._check_units()
        self.fixed = set(self.source.supports)
        elements = self._frame_elements()
        for e in elements:
            for node, ks in self._dofs_of(e):
                self.dofs[node].update(ks)
        for _, terms, _, _ in self._source_equations():
            for node, _, _ in terms:
                self.dofs[node] |= set()  # a node of an equation alone is a node of the model
        numbers = [n for n in self.source.nodes if n in self.dofs]
        self.rows = {n: k for k, n in enumerate(numbers)}
        names = self._component_names()
        for e in elements:
            self._one(e, names.get(e.number, ""))
        points = np.array([self.source.nodes[n][:3] for n in numbers]).reshape(-1, 3) * self.units.length
        supports = self._supports()
        links = self._links()
        self._constraints()
        bars = Bars.of([(n, [self.rows[k] for k in ends], *rest) for n, ends, *rest in self.bars])
        return FrameDeck(
            file=self.source.file,
            nodes=np.array(numbers, dtype=np.int64),
            points=points,
            bars=bars,
            properties=tuple(self.properties),
            supports=supports,
            bodies=tuple(self.bodies),
            connections=tuple(self.connections),
            links=links,
            equations=tuple(self.equations),
            damping=self._damping(),
            notes=self._all_notes(elements),
        )

    def _check_units(self) -> None:
        if self.source.units is None:
            return
        name, line = self.source.units
        given = (self.units.length, self.units.mass, self.units.time)
        if name in _UNITS and not np.allclose(given, _UNITS[name], rtol=1e-4):
            text = (
                f"/UNITS,{name} is {_UNITS[name]} m, kg, s; the units given are {given}: correct one of them"
            )
            raise self.source.error(line, text)
        self.notes.append(
            f"line {line}: /UNITS,{name} agrees with the units given, or has none; values are in those"
        )

    # Elements ----------------------------------------------------------------------------------------------

    def _frame_elements(self) -> list[AnsysElement]:
        """Return the elements that are read; refuse others that share nodes with them."""
        mine = [e for e in self.source.elements.values() if self.source.kind(e) in _NAMES]
        if not any(_NAMES[self.source.kind(e)] in ("BEAM", "PIPE", "LINK") for e in mine):
            kinds = sorted({str(self.source.kind(e)) for e in self.source.elements.values()})
            text = f"no beams, pipes or links; it has elements of the types {named(kinds) or 'none'}"
            raise self.source.error(len(kinds) and next(iter(self.source.elements.values())).line, text)
        used = {n for e in mine for n in e.nodes}
        counts: dict[int, list[AnsysElement]] = defaultdict(list)
        for e in self.source.elements.values():
            if (kind := self.source.kind(e)) not in _NAMES and kind != 200:  # MESH200
                counts[kind].append(e)
        for kind, others in counts.items():
            touching = next((e for e in others if used & set(e.nodes)), None)
            if touching is not None:
                text = (
                    f"element {touching.number} of type {kind} shares nodes with the frame; {len(others)} of "
                    "these are not read, and the frame would lack their stiffness and mass"
                )
                raise self.source.error(touching.line, text)
            self.notes.append(
                f"{len(others)} elements of type {kind} left out: they share no node with the frame"
            )
        return mine

    def _ends(self, e: AnsysElement, count: int) -> tuple[int, ...]:
        self.source.check_nodes(e)
        if len(e.nodes) < count:
            text = f"element {e.number} has {len(e.nodes)} nodes and needs {count}"
            raise self.source.error(e.line, text)
        return e.nodes[:count]

    def _dofs_of(self, e: AnsysElement) -> Iterable[tuple[int, Iterable[int]]]:
        kind, key = self.source.kind(e), lambda k: self.source.keyopt(e.type, k)
        plane = {3: (0, 1, 5), 1: (0, 1)}
        if kind in _BEAMS:
            nodes, dofs = self._ends(e, _BEAMS[kind]), plane.get(kind, range(6))
        elif kind in _LINKS:
            nodes, dofs = self._ends(e, 2), plane.get(kind, range(3))
        elif kind == 21:
            nodes, dofs = self._ends(e, 1), {2: range(3), 3: (0, 1, 5), 4: (0, 1)}.get(key(3), range(6))
        elif kind == 14:
            one = key(2)
            nodes = self._ends(e, 2)
            dofs = (one - 1,) if one else {1: (3, 4, 5), 2: (0, 1)}.get(key(3), range(3))
        else:
            nodes, dofs = self._ends(e, 2), range(6 if key(1) == 1 else 3)
        return [(n, dofs) for n in nodes]

    def _one(self, e: AnsysElement, component: str) -> None:
        kind = self.source.kind(e)
        if kind in _BEAMS or kind in _LINKS:
            self._bar(e, kind, component)
        elif kind == 21:
            self._mass(e)
        elif kind == 14:
            self._spring(e)
        elif self.source.keyopt(e.type, 1) == 1:
            self.rigid.append(e)
        elif self.source.keyopt(e.type, 1) == 0:
            i, j = e.nodes[:2]
            n = self._point(j) - self._point(i)
            terms = [(i, k, -n[k]) for k in range(3)] + [(j, k, n[k]) for k in range(3)]
            self.equations.append(self._equation(f"MPC184 {e.number}", terms, rotated=False))
        else:
            text = f"MPC184 with KEYOPT(1) = {self.source.keyopt(e.type, 1)} is not read; 0 and 1 are"
            raise self.source.error(e.line, f"element {e.number}: {text}")

    def _point(self, node: int) -> Floats:
        return np.array(self.source.nodes[node][:3])

    def _axes(self, node: int) -> Floats:
        """Return a node's axes as rows."""
        return rotation(*self.source.nodes[node][3:])

    # Bars --------------------------------------------------------------------------------------------------

    def _bar(self, e: AnsysElement, kind: int, component: str) -> None:
        count = _BEAMS.get(kind, 2)
        ends = e.nodes[:count]
        chain = [(ends[0], ends[2]), (ends[2], ends[1])] if count == 3 else [(ends[0], ends[1])]
        for i, j in chain:
            x = self._point(j) - self._point(i)
            if not np.linalg.norm(x):
                raise self.source.error(e.line, f"element {e.number} has no length")
            z = self._height(e, x, count)
            y = np.cross(z, x) / np.linalg.norm(x)
            prop, first, second = self._property(e, kind, component, (i, j))
            if kind in (44,):
                first, second = first + self._dx(e, 13), second + self._dx(e, 16)
            u = x / np.linalg.norm(x)
            offsets = [o @ np.array([u, y, z]) for o in (first, second)]
            self.bars.append((e.number, (i, j), prop, z, offsets, self._stiffness(e, kind)))

    def _height(self, e: AnsysElement, x: Floats, count: int) -> Floats:
        """Return the unit vector of local z."""
        x = x / np.linalg.norm(x)
        third = e.nodes[count:]
        if third and self.source.kind(e) in (4, 44, 188, 189, 288, 289):
            v = self._point(third[0]) - self._point(e.nodes[0])
            v = v - x * (v @ x)
            if np.linalg.norm(v) <= 1e-9 * max(1.0, np.linalg.norm(self._point(third[0]))):
                text = f"the orientation node {third[0]} of element {e.number} lies on its axis"
                raise self.source.error(e.line, text)
            return v / np.linalg.norm(v)
        y = np.array([0.0, 1.0, 0.0]) if np.hypot(x[0], x[1]) <= 1e-4 else np.array([-x[1], x[0], 0.0])
        z = np.cross(x, y / np.linalg.norm(y))
        theta = np.deg2rad(self._real(e, 6)) if self.source.kind(e) == 4 else 0.0
        z /= np.linalg.norm(z)
        return np.cos(theta) * z + np.sin(theta) * np.cross(x, z)

    def _dx(self, e: AnsysElement, start: int) -> Floats:
        return np.array([self._real(e, k) for k in range(start, start + 3)]) * self.units.length

    def _stiffness(self, e: AnsysElement, kind: int) -> Floats:
        out = np.full((2, 6), np.inf)
        for end, k in enumerate((7, 8)) if kind == 44 else ():
            for digit, direction in _RELEASES:
                if self.source.keyopt(e.type, k) // digit % 10:
                    out[end, direction] = 0.0
        return out

    def _real(self, e: AnsysElement, k: int) -> float:
        return self.source.reals.get(e.real, {}).get(k, 0.0)

    def _needs_reals(self, e: AnsysElement) -> None:
        if e.real not in self.source.reals:
            text = f"element {e.number} has the real constants {e.real}, which no R or RLBLOCK defines"
            raise self.source.error(e.line, text)

    def _property(
        self, e: AnsysElement, kind: int, component: str, ends: tuple[int, int]
    ) -> tuple[int, Floats, Floats]:
        """Return the number of a bar's property, and its offsets in element axes [m]."""
        tapered = kind in BY_SECTION and getattr(self.source.sections.get(e.section), "kind", "") == "TAPER"
        key = (kind, e.mat, e.real, e.section, component, *(ends if tapered else ()))
        material = self._material(e)
        try:
            if tapered:
                first, second = self._taper(e, ends, material)
            else:
                first, second = self._placed(e, kind, material)
        except PropertyError as reason:
            raise self.source.error(e.line, f"element {e.number}: {reason}") from reason
        if key not in self.known:
            by_section = kind in BY_SECTION or (kind == 180 and e.section in self.source.sections)
            name = component or (f"section {e.section}" if by_section else f"real {e.real}")
            self.known[key] = len(self.properties)
            self.properties.append(
                BarProperty(
                    name=self._unique(name, e),
                    material=material,
                    section=first.section,
                    section2=second.section if second is not first else None,
                    theory="bar" if kind in _LINKS else "timoshenko",
                    mass_per_length=first.mass_per_length,
                )
            )
        pair = [np.array([0.0, *p.from_node]) for p in (first, second)]
        return self.known[key], pair[0], pair[1]

    def _unique(self, name: str, e: AnsysElement) -> str:
        taken = {p.name for p in self.properties}
        wanted = name if name not in taken else f"{name} material {e.mat}"
        return wanted if wanted not in taken else f"{name} part {len(taken) + 1}"

    def _material(self, e: AnsysElement) -> Material:
        if e.mat in self.materials:
            return self.materials[e.mat]
        values = self.source.materials.get(e.mat, {})
        E = values.get("EX", 0.0)
        if not E:
            what = "has no EX" if values else "is not defined"
            raise self.source.error(e.line, f"element {e.number}: its material {e.mat} {what} (MP, MPDATA)")
        nu = values.get("PRXY", values.get("NUXY", np.nan))
        if values.get("GXY"):
            nu = E / (2 * values["GXY"]) - 1
        elif np.isnan(nu):
            nu = 0.3
            self.notes.append(
                f"material {e.mat} has neither PRXY, NUXY nor GXY: Poisson's ratio 0.3 is taken"
            )
        rho = values.get("DENS", 0.0) * self.units.density
        if not rho:
            rho = negligible_density(E * self.units.stress)
            self.notes.append(f"material {e.mat} has no density (DENS); a negligible one is taken")
        for label in sorted({"DAMP", "ALPD", "BETD", "SDAMP", "DMPS"} & set(values)):
            self.notes.append(f"MP,{label} of material {e.mat} is left out: its damping is not in the model")
        loss = 2 * values.get("DMPR", 0.0)
        try:
            made = Material(f"material {e.mat}", E * self.units.stress, rho, nu, loss)
        except PropertyError as reason:
            raise self.source.error(e.line, f"element {e.number}: {reason}") from reason
        self.materials[e.mat] = made
        return made

    def _placed(self, e: AnsysElement, kind: int, material: Material) -> tuple[PlacedSection, PlacedSection]:
        r, u = lambda k: self._real(e, k), self.units
        if kind in BY_SECTION or (kind == 180 and e.section in self.source.sections):
            one = placed_section(self.source, e.section, e, material.G, u)
            return one, one
        self._needs_reals(e)
        if kind == 44 and r(7):
            return self._constants(e, 1, 19), self._constants(e, 7, 19)
        if kind in _LINKS:
            added = r(2) * u.mass_per_length if kind == 180 else 0.0
            one = PlacedSection(rod(r(1) * u.area), (0.0, 0.0), added)
        elif kind == 16:
            one = PlacedSection(Section.tube(r(1) * u.length, r(2) * u.length))
        elif kind == 44:
            one = self._constants(e, 1, 19)
        elif kind == 3:
            one = self._by_constants(r(1), r(2), r(2), 0.0, r(4), 0.0, r(6))
        else:
            one = self._by_constants(r(1), r(3), r(2), r(8), r(9), r(10), r(12))
        return one, one

    def _constants(self, e: AnsysElement, start: int, shear: int) -> PlacedSection:
        A, Iz, Iy, _, _, J = (self._real(e, start + k) for k in range(6))
        return self._by_constants(A, Iy, Iz, J, self._real(e, shear), self._real(e, shear + 1), 0.0)

    def _by_constants(
        self, A: float, Iy: float, Iz: float, J: float, fz: float, fy: float, added: float
    ) -> PlacedSection:
        """Return a section of real constants; SHEARZ goes with IZZ, and its inverse is ky."""
        a, i = self.units.area, self.units.second_moment
        ky, kz = (1 / f if f else 0.0 for f in (fz, fy))
        section = Section(A * a, Iy * i, Iz * i, (J or Iy + Iz) * i, ky, kz, label="constants")
        return PlacedSection(section, (0.0, 0.0), added * self.units.mass_per_length)

    def _taper(
        self, e: AnsysElement, ends: tuple[int, int], material: Material
    ) -> tuple[PlacedSection, PlacedSection]:
        """Return the sections at the ends of an element between two stations: SECDATA,section,x,y,z."""
        command = self.source.sections[e.section]
        if len(command.data) != 2 or any(len(row) < 4 for row in command.data):
            text = f"SECTYPE {e.section}, TAPER needs two SECDATA with a section and x, y, z"
            raise self.source.error(command.line, text)
        made = [placed_section(self.source, int(row[0]), e, material.G, self.units) for row in command.data]
        start, end = (np.array(row[1:4]) for row in command.data)
        axis = end - start
        fraction = [float((self._point(n) - start) @ axis / (axis @ axis)) for n in ends]
        if min(fraction) < -1e-6 or max(fraction) > 1 + 1e-6:
            text = f"element {e.number} lies outside the stations of its TAPER section {e.section}"
            raise self.source.error(e.line, text)
        out = []
        for f in np.clip(fraction, 0, 1):
            y, z = (1 - f) * np.array(made[0].from_node) + f * np.array(made[1].from_node)
            section = Section.between(made[0].section, made[1].section, f)
            out.append(PlacedSection(section, (float(y), float(z)), made[0].mass_per_length))
        return out[0], out[1]

    def _component_names(self) -> dict[int, str]:
        names: dict[int, str] = {}
        for name, (kind, items) in self.source.components.items():
            for number in items if kind == "ELEM" else ():
                names.setdefault(number, name)
        return names

    # Springs and masses ------------------------------------------------------------------------------------

    def _spring(self, e: AnsysElement) -> None:
        self._needs_reals(e)
        i, j = e.nodes[:2]
        one, form = self.source.keyopt(e.type, 2), self.source.keyopt(e.type, 3)
        if one > 6 or self.source.keyopt(e.type, 1) or self._real(e, 3):
            text = f"element {e.number}: COMBIN14 with KEYOPT(1), KEYOPT(2) above 6 or CV2 is not linear"
            raise self.source.error(e.line, text)
        axes, x = self._axes(i), self._point(j) - self._point(i)
        if one:
            k = one - 1
            if k < 3 and np.linalg.norm(np.cross(x, axes[k])) > 1e-9 * max(1.0, np.linalg.norm(x)):
                self.notes.append(
                    f"COMBIN14 {e.number} acts across the line between its nodes; here rigid arms carry its "
                    "moment, in ANSYS nothing does"
                )
        else:
            if not x.any():
                raise self.source.error(
                    e.line, f"element {e.number}: COMBIN14 has no length, so no direction"
                )
            axes, k = axes_along(x), 3 if form == 1 else 0
        K = entry(k, self._real(e, 1) * self.units.stiffness[k])
        C = entry(k, self._real(e, 2) * self.units.damping[k])
        nodes = (self.rows[i], self.rows[j])
        self.connections.append(Connection(name=f"COMBIN14 {e.number}", nodes=nodes, K=K, C=C, axes=axes))

    def _mass(self, e: AnsysElement) -> None:
        self._needs_reals(e)
        node, form = e.nodes[0], self.source.keyopt(e.type, 3)
        r, u = lambda k: self._real(e, k), self.units
        if form == 0:
            m, inertia = [r(1), r(2), r(3)], np.diag([r(4), r(5), r(6)])
        else:
            m, inertia = [r(1)] * 3, np.diag([0.0, 0.0, r(2) if form == 3 else 0.0])
        free = [m[k] for k in range(3) if k in self.dofs[node] and (node, k) not in self.fixed]
        if len(set(free)) > 1:
            text = f"element {e.number}: MASS21 has the masses {m}; those of free directions must be equal"
            raise self.source.error(e.line, text)
        if self.source.keyopt(e.type, 2):
            inertia = self._axes(node).T @ inertia @ self._axes(node)
        mass = (free[0] if free else 0.0) * u.mass
        if mass or inertia.any():
            body = Body(
                name=f"MASS21 {e.number}", node=self.rows[node], mass=mass, inertia=inertia * u.inertia
            )
            self.bodies.append(body)

    # Supports, links and equations -------------------------------------------------------------------------

    def _supports(self) -> dict[int, tuple[str, ...]]:
        """Return fixed global directions; those of rotated nodes that are not global become connections."""
        fixed: dict[int, set[int]] = defaultdict(set)
        moved: dict[tuple[int, float | str], list[int]] = {}
        undefined: dict[int, int] = {}
        for (n, k), (value, line) in self.source.supports.items():
            if n in self.rows:
                fixed[n].add(k)
            if value:
                moved.setdefault((line, "a table" if np.isnan(value) else value), []).append(n)
            if n not in self.source.nodes:
                undefined.setdefault(n, line)
        for (line, by), numbers in moved.items():
            shown = f"{by:g}" if isinstance(by, float) else by
            others = len(set(numbers)) - 1
            more = f" and {others} more" if others else ""
            self.notes.append(
                f"line {line}: D of node {numbers[0]}{more} moves it by {shown}; it is fixed here"
            )
        self.notes += [f"line {line}: D of node {n}, which is not defined" for n, line in undefined.items()]
        lacking = 0
        for n in self.rows:
            missing = set(range(6)) - self.dofs[n] if self.dofs[n] else set()
            lacking += bool(missing)
            fixed[n] |= missing
        if lacking:
            self.notes.append(f"{lacking} nodes lack degrees of freedom in ANSYS; these are fixed here")
        nodes = list(self.rows)
        by_row = {self.rows[n]: ks for n, ks in fixed.items()}
        supports, skew = supports_of(
            by_row, lambda row: self._axes(nodes[row]), lambda row: f"D {nodes[row]}"
        )
        self.connections += skew
        return supports

    def _links(self) -> tuple[Link, ...]:
        """Return one rigid body for each set of connected rigid beams."""
        groups: list[list[int]] = []
        for e in self.rigid:
            touching = [g for g in groups if set(g) & set(e.nodes[:2])]
            merged = list(dict.fromkeys([n for g in touching for n in g] + list(e.nodes[:2])))
            groups = [g for g in groups if g not in touching] + [merged]
        return tuple(
            Link(
                name=f"MPC184 {g[0]}",
                node=self.rows[g[0]],
                dependents=tuple(self.rows[n] for n in g[1:]),
                directions=DIRECTIONS,
            )
            for g in groups
        )

    def _equation(self, name: str, terms: list[tuple[int, int, float]], rotated: bool = True) -> Equation:
        """Return an equation in global directions; factors of rotations next to translations are lengths."""
        scale = self.units.of_motions if any(k < 3 for _, k, _ in terms) else np.ones(6)
        motions = [
            (self.rows[n], c * scale * along(k, self._axes(n) if rotated else np.eye(3))) for n, k, c in terms
        ]
        return Equation(name=name, terms=terms_of(motions))

    def _source_equations(self) -> Iterator[tuple[str, list[tuple[int, int, float]], float, int]]:
        """Yield name, terms, constant and line of the equations, and of the pairs of coupled sets."""
        for number, e in self.source.equations.items():
            yield f"CE {number}", [(n, k, c) for (n, k), c in e.terms.items()], e.constant, e.line
        for coupled in self.source.coupled.values():
            for first, node in zip(coupled.nodes[:1] * len(coupled.nodes), coupled.nodes[1:], strict=False):
                terms = [(first, coupled.label, 1.0), (node, coupled.label, -1.0)]
                yield f"CP {first} {node}", terms, 0.0, coupled.line

    def _constraints(self) -> None:
        for name, terms, constant, line in self._source_equations():
            missing = [n for n, _, _ in terms if n not in self.source.nodes]
            if missing or not terms:
                what = f"refers to node {missing[0]}, which is not defined" if missing else "has no terms"
                raise self.source.error(line, f"{name} {what}")
            if constant:
                self.notes.append(f"line {line}: the constant {constant:g} of {name} is left out (a preload)")
            self.equations.append(self._equation(name, terms))

    def _damping(self) -> Damping | None:
        d, t = self.source.damping, self.units.time
        ratio = d.get("DMPRAT", 0.0)
        made = Damping.modal(ratio) if ratio else Damping()
        alpha, beta = d.get("ALPHAD", 0.0) / t, d.get("BETAD", 0.0) * t
        full = Damping(made.frequency, made.ratio, alpha, beta, d.get("DMPSTR", 0.0))
        return full if any(d.values()) else None

    def _all_notes(self, elements: list[AnsysElement]) -> tuple[str, ...]:
        kinds = {(self.source.kind(e), e.type) for e in elements}
        if any(k in (188, 288) and not self.source.keyopt(t, 3) for k, t in kinds):
            self.notes.append(
                "BEAM188 or PIPE288 with KEYOPT(3) = 0 interpolate linearly: in ANSYS a cantilever of n "
                "elements is stiffer by about 1/(4 n²) under a load at its tip; here it is not"
            )
        if any(k in (188, 189) and self.source.keyopt(t, 1) for k, t in kinds):
            self.notes.append("KEYOPT(1) = 1, warping of open sections, is left out")
        if any(k == 10 for k, _ in kinds):
            self.notes.append("LINK10 carries tension and compression here")
        return tuple(dict.fromkeys([*self.source.notes, *self.notes]))
