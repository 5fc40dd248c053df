"""Sections of Nastran's property cards: constants of PBAR and PBEAM, shapes of PBARL and PBEAML.

Nastran's element axes are x along the bar, y in plane 1 and z. Local z of a member, the direction of its
section's height, is Nastran's y, and its local y is Nastran's -z: shapes look as the reference guide draws
them.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

from fem.io.faults import refuse
from fem.io.frame_sections import angle, box, check_fit, of_constants, walled
from fem.materials import PropertyError
from fem.sections.profiles import cross_of_plates
from fem.sections.section import Section

NEGLIGIBLE: Final = 1e-6
"""Stand-in for a constant that a card gives as zero, relative to the others: beams need all [-]."""


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
        refuse(f"section {label}: I12² = {I12**2:g} is above I1 I2 = {I1 * I2:g}", PropertyError)
    return of_constants(label, A, (I1, I2, -I12), max(J, NEGLIGIBLE * (I1 + I2)), k[::-1], least)


def _cross(arms: float, tw: float, h: float, th: float) -> Section:
    b = arms + tw
    if tw == th:
        return Section.cruciform(b, h, tw)
    check_fit(th < h, "the plates are thicker than the cross is high")
    outline, points, walls = cross_of_plates(b, h, tw, th)
    J = (h * tw**3 + arms * th**3) / 3
    return walled(f"cross {b:g} x {h:g} m", [outline], points, walls, [th, th, tw, tw], J)[0]


def _zee(flange: float, web: float, inner: float, h: float) -> Section:
    """Return a Z: the upper flange towards -y, the lower one towards +y."""
    t = (h - inner) / 2
    check_fit(t > 0, "the inner height is above the outer one")
    w, y, z = web / 2, web / 2 + flange, h / 2
    half = [(w, -z + t), (w, z), (-y, z), (-y, z - t)]
    outline = [*half, *((-p, -q) for p, q in half)]
    points = [(y, -z + t / 2), (0.0, -z + t / 2), (0.0, z - t / 2), (-y, z - t / 2)]
    J = (2 * flange * t**3 + h * web**3) / 3
    return walled(f"Z {h:g} m", [outline], points, [(0, 1), (1, 2), (2, 3)], [t, web, t], J)[0]


def _hat(h: float, t: float, top: float, brim: float) -> Section:
    """Return a hat of one thickness, its brims at the bottom."""
    check_fit(2 * t < min(h, top), "the walls of the hat fill it")
    y, b = top / 2, top / 2 + brim
    right = [(y - t, 0), (b, 0), (b, t), (y, t), (y, h)]
    inner = [(-(y - t), h - t), (y - t, h - t)]
    outline = [*inner, *right, *((-p, q) for p, q in reversed(right))]
    m, low, high = y - t / 2, t / 2, h - t / 2
    points = [(b, low), (m, low), (m, high), (-m, high), (-m, low), (-b, low)]
    return walled(f"hat {h:g} m", [outline], points, [(k, k + 1) for k in range(5)], [t] * 5)[0]


def _turn(section: Section, quarters: int) -> Section:
    return replace(section, angle=section.angle + quarters * math.pi / 2)


def _i(h: float, b1: float, b2: float, tw: float, t1: float, t2: float) -> Section:
    if b1 == b2 and t1 == t2:
        return Section.i_section(b1, h, t1, tw)
    return Section.unequal_i_section(b1, b2, h, t1, t2, tw)


def _circle(r: float) -> Section:
    """Return a circle with the shear coefficient that MSC Nastran lists for ROD, 0.9 for any material."""
    circle = Section.circle(2 * r)
    return Section(circle.A, circle.Iy, circle.Iz, circle.J, 0.9, 0.9, circle.outlines, label=circle.label)


SHAPES: Final[dict[str, tuple[int, Callable[..., Section]]]] = {
    "ROD": (1, _circle),
    "TUBE": (2, lambda r, ri: Section.tube(2 * r, r - ri) if ri else Section.circle(2 * r)),
    "TUBE2": (2, lambda r, t: Section.tube(2 * r, t)),
    "BAR": (2, Section.rectangle),
    "BOX": (4, lambda b, h, flat, side: box(b, h, (flat, side, flat, side), bredt=True)[0]),
    "BOX1": (6, lambda b, h, top, low, right, left: box(b, h, (low, right, top, left), bredt=True)[0]),
    "I": (6, _i),
    "I1": (4, lambda b, tw, inner, h: Section.i_section(b + tw, h, (h - inner) / 2, tw)),
    "H": (4, lambda gap, t2, h, tw: _turn(Section.i_section(h, gap + t2, t2 / 2, tw), 1)),
    "T": (4, Section.t_section),
    "T1": (4, lambda b, stem, tf, tw: _turn(Section.t_section(b, stem + tf, tf, tw), -1)),
    "T2": (4, lambda b, h, tf, tw: _turn(Section.t_section(b, h, tf, tw), 2)),
    "CHAN": (4, lambda b, h, tw, tf: Section.channel(b, h, tf, tw)),
    "CHAN1": (4, lambda b, tw, inner, h: Section.channel(b + tw, h, (h - inner) / 2, tw)),
    "CHAN2": (4, lambda tf, tw, b, h: _turn(Section.channel(b, h, tf, tw), 1)),
    "L": (4, lambda b, h, t, u: Section.angle_section(b, h, t) if t == u else angle(b, h, t, u)[0]),
    "CROSS": (4, _cross),
    "Z": (4, _zee),
    "HAT": (4, _hat),
}
"""Shapes of PBARL and PBEAML: the number of their dimensions, and the section of them."""


def section_of_shape(shape: str, dimensions: Sequence[float], nu: float) -> Section:
    """Return the section of a Nastran shape with its dimensions [m].

    Shear coefficients are those for Poisson's ratio nu; Nastran's are 0.9 for ROD and 5/6 for BAR.

    Raises
    ------
    PropertyError
        For shapes that are not in :data:`SHAPES`, and dimensions that do not fit.
    """
    if shape not in SHAPES:
        refuse(f"there is no section for the shape {shape}; there are {', '.join(SHAPES)}", PropertyError)
    if any(not d > 0 for d in dimensions) and shape != "TUBE":
        msg = f"the dimensions are {', '.join(f'{d:g}' for d in dimensions)}; they must be positive"
        raise PropertyError(msg)
    section = SHAPES[shape][1](*dimensions)
    if 0 < nu <= 0.5 and "nu" in section.dimensions and shape != "BAR":
        section = replace(
            Section.of_shape(section.shape, **{**section.dimensions, "nu": nu}), angle=section.angle
        )
    return section
