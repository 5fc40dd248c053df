"""Sections of Nastran's property cards: constants of PBAR and PBEAM, shapes of PBARL and PBEAML.

Nastran's element axes are x along the bar, y in plane 1 and z. Local z of a member, the direction of its
section's height, is Nastran's y, and its local y is Nastran's -z: shapes look as the reference guide draws
them.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from fem.materials import Material, PropertyError
from fem.sections.constants import LARGEST_SHEAR_COEFFICIENT
from fem.sections.outlines import integrate, turned
from fem.sections.section import Section
from fem.sections.walls import Walls, wall_constants

NEGLIGIBLE: Final = 1e-6
"""A constant that a card has as zero, over the others: sections of beams need all of them."""


@dataclass(frozen=True, slots=True)
class Shear:
    """How a material resists shear.

    Attributes
    ----------
    factor : float
        Its G over that of the material's E and Poisson's ratio: factor of J, ky and kz [-].
    """

    factor: float = 1.0

    def applied(self, section: Section) -> Section:
        """Return the section with J, ky and kz that give the card's GJ and shear stiffness."""
        if self.factor == 1.0:
            return section
        k = [value * self.factor for value in (section.ky, section.kz)]
        ky, kz = (value if value <= LARGEST_SHEAR_COEFFICIENT else 0.0 for value in k)
        return Section(
            section.A, section.Iy, section.Iz, section.J * self.factor, ky, kz,
            outlines=section.outlines, label=section.label, Ip=section.Ip, angle=section.angle,
            shear_centre=section.shear_centre,
        )  # fmt: skip


def material_of(name: str, E: float, G: float, nu: float, rho: float, eta: float) -> tuple[Material, Shear]:
    """Return a material of E and G [Pa]; a G that no Poisson's ratio gives is a factor of the sections."""
    ratio = E / (2 * G) - 1
    taken = ratio if -0.99 < ratio <= 0.5 else min(max(nu, 0.0), 0.5)
    material = Material(name, E, rho, taken, eta)
    return material, Shear(1.0 if taken == ratio else G / material.G)


def section_of_constants(
    label: str, A: float, moments: tuple[float, float, float], J: float, k: tuple[float, float]
) -> Section:
    """Return a section of Nastran's A, (I1, I2, I12), J and (K1, K2), in principal axes.

    I1 is the second moment for bending in plane 1, local x-z. A product I12 = ∫ y z dA of Nastran's axes is
    -I12 in local ones.

    Raises
    ------
    PropertyError
        For constants that no section has.
    """
    I1, I2, I12 = moments
    least = NEGLIGIBLE * max(I1, I2)
    if I12**2 > I1 * I2:
        msg = f"section {label}: I12² = {I12**2:g} is above I1 I2 = {I1 * I2:g}"
        raise PropertyError(msg)
    angle = 0.5 * math.atan2(-2 * I12, I2 - I1) if I12 else 0.0
    if I12 and abs(angle) > math.pi / 4:  # the axis nearest to local y
        angle -= math.copysign(math.pi / 2, angle)
    c, s = math.cos(angle), math.sin(angle)
    Iz = c * c * I2 + s * s * I1 - 2 * s * c * I12
    Iy = I1 + I2 - Iz
    kz, ky = k
    return Section(
        A, max(Iy, least), max(Iz, least), max(J, NEGLIGIBLE * (I1 + I2)), ky, kz, label=label, angle=angle
    )


def rod_section(label: str, A: float) -> Section:
    """Return a section of a bar: a circle's moments, which nothing uses."""
    I = A**2 / (4 * math.pi)
    return Section(A, I, I, 2 * I, label=label)


def _walled(
    label: str,
    outlines: Sequence[ArrayLike],
    points: Sequence[tuple[float, float]],
    walls: Sequence[tuple[int, int]],
    thickness: Sequence[float],
    J: float,
) -> Section:
    """Return a section of walls along centre lines, in principal axes; J is that of thin walls."""
    figure = integrate(list(outlines))
    angle, centre = figure.principal_angle, figure.centroid
    about = figure.centred().turned(angle)
    flow = wall_constants(*Walls(turned(points, centre, angle), tuple(walls), np.array(thickness)))
    y, z = flow.shear_centre
    return Section(
        figure.A, about.Iy, about.Iz, J, flow.area_y / figure.A, flow.area_z / figure.A,
        tuple(turned(outline, centre, angle) for outline in outlines),
        label=label, angle=angle, shear_centre=(float(y), float(z)), estimated_k=True,
    )  # fmt: skip


def _rectangle(y1: float, y2: float, z1: float, z2: float) -> list[tuple[float, float]]:
    return [(y1, z1), (y2, z1), (y2, z2), (y1, z2)]


def _box(b: float, h: float, top: float, bottom: float, right: float, left: float) -> Section:
    """Return a box with four walls; J after Bredt."""
    if top == bottom == right == left:
        return Section.hollow_rectangle(b, h, top)
    _check(top + bottom < h and right + left < b, "the walls of the box fill it")
    y1, y2, z1, z2 = left / 2, b - right / 2, bottom / 2, h - top / 2
    corners = _rectangle(y1, y2, z1, z2)
    width, height = y2 - y1, z2 - z1
    J = 4 * (width * height) ** 2 / (width / bottom + height / right + width / top + height / left)
    hole = _rectangle(left, b - right, bottom, h - top)
    return _walled(
        f"box {b:g} x {h:g} m",
        [_rectangle(0, b, 0, h), hole],
        corners,
        [(0, 1), (1, 2), (2, 3), (3, 0)],
        [bottom, right, top, left],
        J,
    )


def _angle(b: float, h: float, flat: float, upright: float) -> Section:
    if flat == upright:
        return Section.angle_section(b, h, flat)
    _check(flat < h and upright < b, "the legs are thicker than the angle is wide")
    outline = [(0, 0), (b, 0), (b, flat), (upright, flat), (upright, h), (0, h)]
    y, z = upright / 2, flat / 2
    J = ((b - y) * flat**3 + (h - z) * upright**3) / 3
    return _walled(f"angle {b:g} x {h:g} m", [outline], [(b, z), (y, z), (y, h)], [(0, 1), (1, 2)],
                   [flat, upright], J)  # fmt: skip


def _cross(arms: float, tw: float, h: float, th: float) -> Section:
    b = arms + tw
    if tw == th:
        return Section.cruciform(b, h, tw)
    _check(th < h, "the plates are thicker than the cross is high")
    w, t, y, z = tw / 2, th / 2, b / 2, h / 2
    quarter = [(w, -z), (w, -t), (y, -t)]
    right = [*quarter, *((p, -q) for p, q in reversed(quarter))]
    outline = [*right, *((-p, -q) for p, q in right)]
    points = [(0.0, 0.0), (-y, 0.0), (y, 0.0), (0.0, -z), (0.0, z)]
    J = (h * tw**3 + arms * th**3) / 3
    return _walled(f"cross {b:g} x {h:g} m", [outline], points, [(1, 0), (0, 2), (3, 0), (0, 4)],
                   [th, th, tw, tw], J)  # fmt: skip


def _zee(flange: float, web: float, inner: float, h: float) -> Section:
    """Return a Z: the upper flange towards -y, the lower one towards +y."""
    t = (h - inner) / 2
    _check(t > 0, "the inner height is above the outer one")
    w, y, z = web / 2, web / 2 + flange, h / 2
    half = [(w, -z + t), (w, z), (-y, z), (-y, z - t)]
    outline = [*half, *((-p, -q) for p, q in half)]
    points = [(y, -z + t / 2), (0.0, -z + t / 2), (0.0, z - t / 2), (-y, z - t / 2)]
    J = (2 * flange * t**3 + h * web**3) / 3
    return _walled(f"Z {h:g} m", [outline], points, [(0, 1), (1, 2), (2, 3)], [t, web, t], J)


def _hat(h: float, t: float, top: float, brim: float) -> Section:
    """Return a hat of one thickness, its brims at the bottom."""
    _check(2 * t < min(h, top), "the walls of the hat fill it")
    y, b = top / 2, top / 2 + brim
    right = [(y - t, 0), (b, 0), (b, t), (y, t), (y, h)]
    inner = [(-(y - t), h - t), (y - t, h - t)]
    outline = [*inner, *right, *((-p, q) for p, q in reversed(right))]
    m, low, high = y - t / 2, t / 2, h - t / 2
    points = [(b, low), (m, low), (m, high), (-m, high), (-m, low), (-b, low)]
    length = 2 * (b - m) + 2 * (high - low) + 2 * m
    return _walled(f"hat {h:g} m", [outline], points, [(k, k + 1) for k in range(5)], [t] * 5,
                   length * t**3 / 3)  # fmt: skip


def _turn(section: Section, quarters: int) -> Section:
    return replace(section, angle=section.angle + quarters * math.pi / 2)


def _i(h: float, b1: float, b2: float, tw: float, t1: float, t2: float) -> Section:
    if b1 == b2 and t1 == t2:
        return Section.i_section(b1, h, t1, tw)
    return Section.unequal_i_section(b1, b2, h, t1, t2, tw)


def _check(fits: bool, reason: str) -> None:
    if not fits:
        raise PropertyError(reason)


def _circle(r: float) -> Section:
    """Return a circle with the shear coefficient that MSC Nastran lists for ROD, 0.9 for any material."""
    circle = Section.circle(2 * r)
    return Section(circle.A, circle.Iy, circle.Iz, circle.J, 0.9, 0.9, circle.outlines, label=circle.label)


SHAPES: Final[dict[str, tuple[int, Callable[..., Section]]]] = {
    "ROD": (1, _circle),
    "TUBE": (2, lambda r, ri: Section.tube(2 * r, r - ri) if ri else Section.circle(2 * r)),
    "TUBE2": (2, lambda r, t: Section.tube(2 * r, t)),
    "BAR": (2, Section.rectangle),
    "BOX": (4, lambda b, h, flat, side: _box(b, h, flat, flat, side, side)),
    "BOX1": (6, _box),
    "I": (6, _i),
    "I1": (4, lambda b, tw, inner, h: Section.i_section(b + tw, h, (h - inner) / 2, tw)),
    "H": (4, lambda gap, t2, h, tw: _turn(Section.i_section(h, gap + t2, t2 / 2, tw), 1)),
    "T": (4, Section.t_section),
    "T1": (4, lambda b, stem, tf, tw: _turn(Section.t_section(b, stem + tf, tf, tw), -1)),
    "T2": (4, lambda b, h, tf, tw: _turn(Section.t_section(b, h, tf, tw), 2)),
    "CHAN": (4, lambda b, h, tw, tf: Section.channel(b, h, tf, tw)),
    "CHAN1": (4, lambda b, tw, inner, h: Section.channel(b + tw, h, (h - inner) / 2, tw)),
    "CHAN2": (4, lambda tf, tw, b, h: _turn(Section.channel(b, h, tf, tw), 1)),
    "L": (4, _angle),
    "CROSS": (4, _cross),
    "Z": (4, _zee),
    "HAT": (4, _hat),
}
"""Shapes of PBARL and PBEAML: the number of their dimensions, and the section of them."""


def section_of_shape(shape: str, dimensions: Sequence[float], nu: float) -> Section:
    """Return the section of a Nastran shape with its dimensions [m].

    Solid and hollow shapes have shear coefficients for Poisson's ratio nu.

    Raises
    ------
    PropertyError
        For shapes that are not in :data:`SHAPES`, and dimensions that do not fit.
    """
    if shape not in SHAPES:
        msg = f"there is no section for the shape {shape}; there are {', '.join(SHAPES)}"
        raise PropertyError(msg)
    if any(not d > 0 for d in dimensions) and shape != "TUBE":
        msg = f"the dimensions are {', '.join(f'{d:g}' for d in dimensions)}; they must be positive"
        raise PropertyError(msg)
    section = SHAPES[shape][1](*dimensions)
    if 0 < nu <= 0.5 and "nu" in section.dimensions:
        section = replace(
            Section.of_shape(section.shape, **{**section.dimensions, "nu": nu}), angle=section.angle
        )
    return section
