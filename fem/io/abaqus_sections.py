"""Sections of Abaqus' and CalculiX' beams: shapes of their library, thin walls and given constants.

Abaqus' local axes 1 (n1) and 2 (n2 = t x n1) are y and z here: I11, bending about 1, is Iy, and b is along 2.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from fem.io.faults import refuse
from fem.io.frame_sections import angle, box, of_constants, with_walls
from fem.materials import PropertyError
from fem.sections.outlines import turned
from fem.sections.section import Section

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
