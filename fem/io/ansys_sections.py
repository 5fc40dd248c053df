"""Sections of an ANSYS archive, by SECTYPE and SECDATA or by real constants, in SI units.

Element axes are those of Dovetail: x along the element, z in the plane of the orientation node, y = z × x.
The first dimension of a section is along y, and its height along z. SECOFFSET counts from the centroid of
RECT, CSOLID and CTUBE, the middle of the flange at -z of I and T, the corner at -y, -z of CHAN, L and HREC.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fem.io.ansys_content import AnsysDeck, AnsysElement, SectionCommand
from fem.io.deck_units import DeckUnits
from fem.io.faults import refuse
from fem.io.frame_sections import angle, box, of_constants, rod, walled, with_shear
from fem.materials import PropertyError
from fem.sections.section import Section

SHEAR_OF_ASEC = 5 / 6
"""Shear coefficient of sections given by their constants: that of a rectangle. SECCONTROL gives another."""


@dataclass(frozen=True, slots=True, eq=False)
class PlacedSection:
    """A section, and where its nodes and its added mass are.

    Attributes
    ----------
    section : Section
    from_node : tuple of float, y and z of the centroid from the node, in element axes [m]
    mass_per_length : float, added mass [kg/m]
    """

    section: Section
    from_node: tuple[float, float] = (0.0, 0.0)
    mass_per_length: float = 0.0


def placed_section(
    deck: AnsysDeck, number: int, user: AnsysElement, G: float, units: DeckUnits
) -> PlacedSection:
    """Return a section of SECTYPE for an element whose shear modulus is G [Pa]."""
    command = deck.sections.get(number)
    if command is None:
        text = f"element {user.number} has the section {number}, which no SECTYPE defines"
        raise deck.error(user.line, text)
    data = command.data[0] if command.data else []
    try:
        if command.kind == "PIPE":
            return _controlled(_pipe(data, units), command, G, units)
        if command.kind == "LINK" and data:
            return PlacedSection(rod(data[0] * units.area), (0.0, 0.0), _added(command, 0, units))
        if command.kind == "BEAM" and len(data) >= _NEEDED.get(command.subtype, 99):
            made = _asec(data, command, units) if command.subtype == "ASEC" else _shape(data, command, units)
            return _controlled(made, command, G, units)
    except (PropertyError, ArithmeticError) as reason:
        raise deck.error(command.line, f"SECTYPE {number}: {reason}") from reason
    needed = _NEEDED.get(command.subtype)
    if command.kind == "BEAM" and needed:
        text = f"SECDATA of {command.subtype} needs {needed} numbers, found {len(data)}"
    else:
        text = (
            f"a section {command.kind},{command.subtype} with {len(data)} data is not read; BEAM with "
            f"{', '.join(_NEEDED)}, PIPE, LINK and TAPER between those are; ASEC takes the constants that "
            "SLIST prints of any section"
        )
    raise deck.error(command.line, f"SECTYPE {number}: {text}")


def _pipe(data: list[float], units: DeckUnits) -> PlacedSection:
    d = data[0] * units.length if data else 0.0
    t = data[1] * units.length if len(data) > 1 else 0.0
    return PlacedSection(Section.tube(d, t) if 0 < t < d / 2 else Section.circle(d))


def _asec(data: list[float], command: SectionCommand, units: DeckUnits) -> PlacedSection:
    A, Iyy, Iyz, Izz, _, J, yc, zc, ys, zs = [*data, *[0.0] * 10][:10]
    Iy, Iz, product, J = np.array([Iyy, Izz, Iyz, J]) * units.second_moment
    k = (SHEAR_OF_ASEC, SHEAR_OF_ASEC)
    section = of_constants(command.name or "ASEC", A * units.area, (Iy, Iz, product), J, k)
    centre = np.array([yc, zc]) * units.length
    return _offset(section, command, centre, np.array([ys, zs]) * units.length - centre, units)


def _controlled(made: PlacedSection, command: SectionCommand, G: float, units: DeckUnits) -> PlacedSection:
    """Return a section with the shear stiffnesses and the added mass of SECCONTROL: TXZ, -, TXY, ADDMAS."""
    values = [*command.control, 0.0, 0.0, 0.0, 0.0]
    section, (xz, _, xy) = made.section, values[:3]
    if xz or xy:
        k = [
            T * units.force / (G * section.A) if T else old for T, old in ((xy, section.ky), (xz, section.kz))
        ]
        section = with_shear(section, 1.0, k)
    return replace(made, section=section, mass_per_length=_added(command, 3, units))


def _added(command: SectionCommand, k: int, units: DeckUnits) -> float:
    return command.control[k] * units.mass_per_length if len(command.control) > k else 0.0


def _shape(data: list[float], command: SectionCommand, units: DeckUnits) -> PlacedSection:
    d = [v * units.length for v in data[: _NEEDED[command.subtype]]]
    section, centre = _SHAPES[command.subtype][1](*d)
    c, s = np.cos(section.angle), np.sin(section.angle)
    y, z = section.shear_centre
    return _offset(section, command, centre, np.array([c * y - s * z, s * y + c * z]), units)


def _offset(
    section: Section, command: SectionCommand, centre: np.ndarray, shear: np.ndarray, units: DeckUnits
) -> PlacedSection:
    """Place a section by its centroid from the builder's origin, and its shear centre from that [m]."""
    where = (command.offset[0] if command.offset else "CENT").upper()[:4] or "CENT"
    if where in ("CENT", "SHRC"):
        y, z = -shear if where == "SHRC" else (0.0, 0.0)
    elif where in ("ORIG", "USER"):
        at = [float(f or 0) for f in [*command.offset[1:3], "", ""][:2]] if where == "USER" else [0.0, 0.0]
        y, z = centre - np.array(at) * units.length
    else:
        refuse(f"SECOFFSET {where} is none of CENT, SHRC, ORIGIN, USER", PropertyError)
    return PlacedSection(section, (float(y), float(z)))


# Shapes, and their centroids from the origin of the builder [m] -------------------------------------

Made = tuple[Section, np.ndarray]


def _from_corner(section: Section) -> Made:
    """Return a section whose principal axes are y and z with its centroid from the lower left corner."""
    return section, -section.outlines[0].min(axis=0)


def _on_axis(section: Section) -> Made:
    """Return a section that is symmetric about z with its centroid from the middle of its lower edge."""
    return section, np.array([0.0, -section.outlines[0][:, 1].min()])


def _i(b1: float, b2: float, h: float, t1: float, t2: float, tw: float) -> Made:
    if (b1, t1) == (b2, t2):
        return _on_axis(Section.i_section(b1, h, t1, tw))
    return _on_axis(Section.unequal_i_section(b1, b2, h, t1, t2, tw))


def _t(b: float, h: float, tf: float, tw: float) -> Made:
    section = Section.t_section(b, h, tf, tw)
    centre = np.array([0.0, section.outlines[0][:, 1].max()])
    return replace(section, angle=section.angle + np.pi), centre  # its flange is at -z


def _chan(b1: float, b2: float, h: float, t1: float, t2: float, tw: float) -> Made:
    if (b1, t1) == (b2, t2):
        return _from_corner(Section.channel(b1, h, t1, tw))
    outline = np.array([(0, 0), (b1, 0), (b1, t1), (tw, t1), (tw, h - t2), (b2, h - t2), (b2, h), (0, h)])
    m = tw / 2
    points = [(b1, t1 / 2), (m, t1 / 2), (m, h - t2 / 2), (b2, h - t2 / 2)]
    return walled("CHAN", [outline], points, [(0, 1), (1, 2), (2, 3)], [t1, tw, t2])


def _l(b: float, h: float, t1: float, t2: float) -> Made:
    section, centre = angle(b, h, t1, t2)
    return (Section.angle_section(b, h, t1) if t1 == t2 else section), centre


_SHAPES: dict[str, tuple[int, Callable[..., Made]]] = {
    "RECT": (2, lambda b, h: (Section.rectangle(b, h), np.zeros(2))),
    "CSOLID": (1, lambda r: (Section.circle(2 * r), np.zeros(2))),
    "CTUBE": (2, lambda ri, ro: (Section.tube(2 * ro, ro - ri), np.zeros(2))),
    "I": (6, _i),
    "T": (4, _t),
    "CHAN": (6, _chan),
    "L": (4, _l),
    "HREC": (6, lambda b, h, left, right, low, top: box(b, h, (low, right, top, left))),
}
"""The number of dimensions of each shape, and its section."""

_NEEDED = {**{name: row[0] for name, row in _SHAPES.items()}, "ASEC": 6}
