"""Sections of an ANSYS archive, by SECTYPE and SECDATA or by real constants, in SI units.

Element axes are those of Dovetail: x along the element, z in the plane of the orientation node, y = z × x.
The first dimension of a section is along y, and its height along z. SECOFFSET counts from the centroid of
RECT, CSOLID and CTUBE, the middle of the flange at -z of I and T, the corner at -y, -z of CHAN, L and HREC.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fem.io.ansys_deck import AnsysDeck, Element, SectionCommand
from fem.io.deck_units import Units
from fem.materials import PropertyError
from fem.sections.constants import LARGEST_SHEAR_COEFFICIENT
from fem.sections.outlines import Integrals, box, integrate, turned
from fem.sections.section import Section
from fem.sections.walls import wall_constants

SHEAR_OF_ASEC = 5 / 6
"""Shear coefficient of sections given by their constants: that of a rectangle. SECCONTROL gives another."""

_NEEDED = {"RECT": 2, "CSOLID": 1, "CTUBE": 2, "I": 6, "T": 4, "CHAN": 6, "L": 4, "HREC": 6, "ASEC": 6}


@dataclass(frozen=True, slots=True, eq=False)
class PlacedSection:
    """A section, and where its nodes and its added mass are.

    Attributes
    ----------
    section : Section
    from_node : tuple of float
        y and z of the centroid from the node, in element axes [m].
    mass_per_length : float
        Added mass [kg/m].
    """

    section: Section
    from_node: tuple[float, float] = (0.0, 0.0)
    mass_per_length: float = 0.0


def placed_section(deck: AnsysDeck, number: int, user: Element, G: float, units: Units) -> PlacedSection:
    """Return a section of SECTYPE for an element whose shear modulus is G [Pa].

    Raises
    ------
    MeshError
        With file, line and command if there is none, it is of another kind, or its data are incomplete.
    """
    command = deck.sections.get(number)
    if command is None:
        text = f"element {user.number} has the section {number}, which no SECTYPE defines"
        raise deck.error(user.line, text)
    data = command.data[0] if command.data else []
    try:
        if command.kind == "PIPE":
            return _controlled(_pipe(data, units), command, G, units)
        if command.kind == "LINK" and data:
            return PlacedSection(round_of_area(data[0] * units.area), (0.0, 0.0), _added(command, 0, units))
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


def round_of_area(A: float) -> Section:
    """Return a round bar of an area [m²]."""
    return Section.circle(2 * np.sqrt(max(A, 0.0) / np.pi))


def section_of_constants(
    A: float, Iy: float, Iz: float, J: float, ky: float = 0.0, kz: float = 0.0, label: str = "constants"
) -> Section:
    """Return a section by its constants [m², m⁴, -]."""
    return Section(A, Iy, Iz, J, ky, kz, label=label)


def _pipe(data: list[float], units: Units) -> PlacedSection:
    d = data[0] * units.length if data else 0.0
    t = data[1] * units.length if len(data) > 1 else 0.0
    return PlacedSection(Section.tube(d, t) if 0 < t < d / 2 else Section.circle(d))


def _asec(data: list[float], command: SectionCommand, units: Units) -> PlacedSection:
    A, Iyy, Iyz, Izz, _, J, yc, zc, ys, zs = [*data, *[0.0] * 10][:10]
    about = Integrals(A, 0.0, 0.0, Iyy, Izz, Iyz)
    angle = about.principal_angle if Iyz else 0.0
    about = about.turned(angle)
    a, i = units.area, units.second_moment
    k = SHEAR_OF_ASEC
    section = Section(
        A * a, about.Iy * i, about.Iz * i, J * i, k, k, label=command.name or "ASEC", angle=angle
    )
    centre = np.array([yc, zc]) * units.length
    return _offset(section, command, centre, np.array([ys, zs]) * units.length - centre, units)


def _controlled(made: PlacedSection, command: SectionCommand, G: float, units: Units) -> PlacedSection:
    """Return a section with the shear stiffnesses and the added mass of SECCONTROL: TXZ, -, TXY, ADDMAS."""
    values = [*command.control, 0.0, 0.0, 0.0, 0.0]
    section = made.section
    for key, T in (("kz", values[0]), ("ky", values[2])):
        if T:
            k = T * units.force / (G * section.A)
            section = replace(section, **{key: k if k <= LARGEST_SHEAR_COEFFICIENT else 0.0})
    return replace(made, section=section, mass_per_length=_added(command, 3, units))


def _added(command: SectionCommand, k: int, units: Units) -> float:
    return command.control[k] * units.mass_per_length if len(command.control) > k else 0.0


def _shape(data: list[float], command: SectionCommand, units: Units) -> PlacedSection:
    d = [v * units.length for v in data[: _NEEDED[command.subtype]]]
    section, centre = _SHAPES[command.subtype](d)
    c, s = np.cos(section.angle), np.sin(section.angle)
    y, z = section.shear_centre
    return _offset(section, command, centre, np.array([c * y - s * z, s * y + c * z]), units)


def _offset(
    section: Section, command: SectionCommand, centre: np.ndarray, shear: np.ndarray, units: Units
) -> PlacedSection:
    """Place a section by its centroid from the builder's origin, and its shear centre from that [m]."""
    where = (command.offset[0] if command.offset else "CENT").upper()[:4] or "CENT"
    if where in ("CENT", "SHRC"):
        y, z = -shear if where == "SHRC" else (0.0, 0.0)
    elif where in ("ORIG", "USER"):
        at = [float(f or 0) for f in [*command.offset[1:3], "", ""][:2]] if where == "USER" else [0.0, 0.0]
        y, z = centre - np.array(at) * units.length
    else:
        msg = f"SECOFFSET {where} is none of CENT, SHRC, ORIGIN, USER"
        raise PropertyError(msg)
    return PlacedSection(section, (float(y), float(z)))


# Shapes, and their centroids from the origin of the builder [m] -------------------------------------

Made = tuple[Section, np.ndarray]


def _i(d: list[float]) -> Made:
    b1, b2, h, t1, t2, tw = d
    if (b1, t1) == (b2, t2):
        return Section.i_section(b1, h, t1, tw), np.array([0.0, h / 2])
    outline = [(-b1 / 2, 0), (b1 / 2, 0), (b1 / 2, t1), (tw / 2, t1), (tw / 2, h - t2), (b2 / 2, h - t2),
               (b2 / 2, h), (-b2 / 2, h), (-b2 / 2, h - t2), (-tw / 2, h - t2), (-tw / 2, t1),
               (-b1 / 2, t1)]  # fmt: skip
    return Section.unequal_i_section(b1, b2, h, t1, t2, tw), integrate([outline]).centroid


def _t(d: list[float]) -> Made:
    b, h, tf, tw = d
    section = Section.t_section(b, h, tf, tw)
    A1, A2 = b * tf, tw * (h - tf)
    z = (A1 * tf / 2 + A2 * (tf + h) / 2) / (A1 + A2)
    return replace(section, angle=section.angle + np.pi), np.array([0.0, z])  # its flange is at -z


def _chan(d: list[float]) -> Made:
    b1, b2, h, t1, t2, tw = d
    outline = np.array([(0, 0), (b1, 0), (b1, t1), (tw, t1), (tw, h - t2), (b2, h - t2), (b2, h), (0, h)])
    centre = integrate([outline]).centroid
    if (b1, t1) == (b2, t2):
        return Section.channel(b1, h, t1, tw), centre
    m = tw / 2
    points = [(b1, t1 / 2), (m, t1 / 2), (m, h - t2 / 2), (b2, h - t2 / 2)]
    return _walled(outline, points, [(0, 1), (1, 2), (2, 3)], [t1, tw, t2], "CHAN"), centre


def _l(d: list[float]) -> Made:
    b, h, t1, t2 = d
    outline = np.array([(0, 0), (b, 0), (b, t1), (t2, t1), (t2, h), (0, h)])
    centre = integrate([outline]).centroid
    if t1 == t2:
        return Section.angle_section(b, h, t1), centre
    points = [(b, t1 / 2), (t2 / 2, t1 / 2), (t2 / 2, h)]
    return _walled(outline, points, [(0, 1), (1, 2)], [t1, t2], "L"), centre


def _hrec(d: list[float]) -> Made:
    b, h, left, right, low, top = d
    if left == right == low == top:
        return Section.hollow_rectangle(b, h, left), np.array([b, h]) / 2
    hole = np.array([(left, low), (b - right, low), (b - right, h - top), (left, h - top)])
    outline = box(b, h) + np.array([b, h]) / 2
    centre = integrate([outline, hole]).centroid
    y1, y2, z1, z2 = left / 2, b - right / 2, low / 2, h - top / 2
    points = [(y1, z1), (y2, z1), (y2, z2), (y1, z2)]
    pairs, t = [(0, 1), (1, 2), (2, 3), (3, 0)], [low, right, top, left]
    return _walled(outline, points, pairs, t, "HREC", [hole]), centre


def _walled(
    outline: np.ndarray,
    points: list[tuple[float, float]],
    pairs: list[tuple[int, int]],
    t: list[float],
    label: str,
    holes: "list[np.ndarray] | tuple[()]" = (),
) -> Section:
    """Return a profile of unlike walls: A and I of its outline, J and k of thin walls."""
    section = Section.polygon(outline, holes, J=1.0, label=label)
    centre = integrate([outline, *holes]).centroid
    flow = wall_constants(turned(points, centre, section.angle), pairs, np.array(t))
    ends = np.array(points)
    length = [float(np.linalg.norm(ends[j] - ends[i])) for i, j in pairs]
    J = flow.J_cells + sum(s * w**3 for s, w in zip(length, t, strict=True)) / 3
    return replace(section, J=J, ky=flow.area_y / section.A, kz=flow.area_z / section.A)


_SHAPES: dict[str, Callable[[list[float]], Made]] = {
    "RECT": lambda d: (Section.rectangle(d[0], d[1]), np.zeros(2)),
    "CSOLID": lambda d: (Section.circle(2 * d[0]), np.zeros(2)),
    "CTUBE": lambda d: (Section.tube(2 * d[1], d[1] - d[0]), np.zeros(2)),
    "I": _i,
    "T": _t,
    "CHAN": _chan,
    "L": _l,
    "HREC": _hrec,
}
