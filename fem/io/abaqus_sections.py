"""Sections of Abaqus' and CalculiX' beams: shapes of their library, thin walls and given constants.

Abaqus' local axes 1 (n1) and 2 (n2 = t x n1) are y and z here: I11, bending about 1, is Iy, and b is along 2.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem.materials import PropertyError
from fem.sections.outlines import integrate, turned
from fem.sections.section import Section
from fem.sections.walls import Walls, wall_constants

ABAQUS_K: Final = {
    "RECT": 0.85, "CIRC": 0.89, "PIPE": 0.53, "THICKPIPE": 0.89, "BOX": 0.44, "I": 0.44, "L": 1.0,
    "HEX": 0.53, "TRAPEZOID": 0.822, "ARBITRARY": 1.0, "GENERAL": 1.0,
}  # fmt: skip
"""Shear coefficients of Abaqus, the same in both directions (Abaqus Analysis User's Guide, "Choosing a beam
element"); a thick pipe has 0.53 to 0.89."""


class Shape(NamedTuple):
    """A section with the place of its centroid from the node, along 1 and 2 [m], and whether 2 is -z."""

    section: Section
    centroid: tuple[float, float] = (0.0, 0.0)
    flipped: bool = False


DIMENSIONS: Final[dict[str, tuple[int, int, str]]] = {
    "RECT": (2, 2, "a, b"),
    "CIRC": (1, 2, "a radius, or the two thicknesses of CalculiX"),
    "PIPE": (2, 2, "outer radius and wall thickness"),
    "THICKPIPE": (2, 2, "outer radius and wall thickness"),
    "BOX": (6, 6, "a, b, t1, t2, t3, t4"),
    "I": (7, 7, "l, h, b1, b2, t1, t2, t3"),
    "L": (4, 4, "a, b, t1, t2"),
    "HEX": (2, 2, "circumscribed radius and wall thickness"),
    "TRAPEZOID": (4, 4, "a, b, c, d"),
}
"""Least and greatest count of dimensions, and what they are."""


def _circle(d: list[float], nu: float) -> Shape:
    if len(d) == 2 and d[0] != d[1]:
        return Shape(Section.ellipse(b=d[0], h=d[1], nu=nu))
    return Shape(Section.circle(d=d[0] if len(d) == 2 else 2 * d[0], nu=nu))


def _box(d: list[float], nu: float) -> Shape:
    a, b, right, top, left, bottom = d
    if right == left == top == bottom:
        return Shape(Section.hollow_rectangle(b=a, h=b, t=top, nu=nu))
    corners = [(0.0, 0.0), (a, 0.0), (a, b), (0.0, b)]
    hole = [(left, bottom), (a - right, bottom), (a - right, b - top), (left, b - top)]
    y1, y2, z1, z2 = left / 2, a - right / 2, bottom / 2, b - top / 2
    points = [(y1, z1), (y2, z1), (y2, z2), (y1, z2)]
    walls = [(0, 1), (1, 2), (2, 3), (3, 0)]
    section, centroid = _walled(corners, [hole], points, walls, [bottom, right, top, left], "box")
    return Shape(section, (centroid[0] - a / 2, centroid[1] - b / 2))


def _i(d: list[float], nu: float) -> Shape:
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
    return Shape(section, (0.0, height - node), flipped)


def _l(d: list[float], nu: float) -> Shape:
    a, b, t1, t2 = d
    corners = [(0.0, 0.0), (a, 0.0), (a, t1), (t2, t1), (t2, b), (0.0, b)]
    points = [(a, t1 / 2), (t2 / 2, t1 / 2), (t2 / 2, b)]
    section, centroid = _walled(corners, [], points, [(0, 1), (1, 2)], [t1, t2], "L")
    return Shape(section, (centroid[0] - t2 / 2, centroid[1] - t1 / 2))


def _trapezoid(d: list[float], nu: float) -> Shape:
    a, b, c, node = d
    mean = Section.rectangle(b=(a + c) / 2, h=b, nu=nu)
    corners = np.array([(-a / 2, 0.0), (a / 2, 0.0), (c / 2, b), (-c / 2, b)])
    if c == 0.0:
        corners = corners[:3]
    section = Section.polygon(corners, J=mean.J, ky=mean.ky, kz=mean.kz, label="trapezoid")
    return Shape(section, (0.0, b * (a + 2 * c) / (3 * (a + c)) - node))


SHAPES: Final[dict[str, Callable[[list[float], float], Shape]]] = {
    "RECT": lambda d, nu: Shape(Section.rectangle(b=d[0], h=d[1], nu=nu)),
    "CIRC": _circle,
    "PIPE": lambda d, nu: Shape(Section.tube(d=2 * d[0], t=d[1], nu=nu)),
    "THICKPIPE": lambda d, nu: Shape(Section.tube(d=2 * d[0], t=d[1], nu=nu)),
    "BOX": _box,
    "I": _i,
    "L": _l,
    "HEX": lambda d, nu: Shape(Section.hollow_polygon(n=6, d=np.sqrt(3.0) * d[0], t=d[1])),
    "TRAPEZOID": _trapezoid,
}


def _walled(
    corners: Sequence[tuple[float, float]],
    holes: Sequence[Sequence[tuple[float, float]]],
    points: Sequence[tuple[float, float]],
    walls: Sequence[tuple[int, int]],
    thickness: Sequence[float],
    label: str,
) -> tuple[Section, NDArray[np.float64]]:
    """Return a section of straight walls with an outline, and its centroid in the axes of the corners."""
    if not min(thickness) > 0:
        msg = f"{label} section: a wall is {min(thickness):g} m thick; walls must be positive"
        raise PropertyError(msg)
    outline, ends = np.array(corners), np.array(points)
    flat = Section.polygon(outline, [np.array(hole) for hole in holes], J=1.0)
    centroid = integrate([outline, *(np.array(hole) for hole in holes)]).centroid
    section = _with_walls(flat, turned(ends, centroid, flat.angle), walls, np.array(thickness))
    return replace(section, label=label), centroid


def _with_walls(
    section: Section, points: NDArray[np.float64], pairs: Sequence[tuple[int, int]], t: NDArray[np.float64]
) -> Section:
    """Return a section with J, k and shear centre of thin walls, open or closed (`fem.sections.walls`)."""
    flow = wall_constants(points, pairs, t)
    length = np.array([np.linalg.norm(points[b] - points[a]) for a, b in pairs])
    return replace(
        section,
        J=flow.J_cells + float((length * t**3).sum()) / 3,
        ky=flow.area_y / section.A,
        kz=flow.area_z / section.A,
        shear_centre=(float(flow.shear_centre[0]), float(flow.shear_centre[1])),
        walls=Walls(points, tuple(pairs), t),
    )


def arbitrary(rows: list[list[float]]) -> Shape:
    """Return a section of thin segments: the first with both its ends, the others with their second ones.

    Segments have no stiffness of bending about their own line, as in Abaqus.
    """
    ends = [tuple(rows[0][:2]), tuple(rows[0][2:4]), *(tuple(row[:2]) for row in rows[1:])]
    t = np.array([rows[0][4], *(row[2] for row in rows[1:])])
    places = list(dict.fromkeys(ends))
    pairs = [(places.index(a), places.index(b)) for a, b in pairwise(ends)]
    points = np.array(places)
    a, b = points[[p for p, _ in pairs]], points[[q for _, q in pairs]]
    area = np.linalg.norm(b - a, axis=1) * t
    if not ((t > 0) & (area > 0)).all():
        msg = "an ARBITRARY section has a segment without length or thickness"
        raise PropertyError(msg)
    centroid = (area[:, None] * (a + b) / 2).sum(axis=0) / area.sum()
    a, b = a - centroid, b - centroid
    # ∫ s sᵀ dA along a straight segment from a to b is A (a aᵀ + b bᵀ + (a bᵀ + b aᵀ)/2) / 3
    second = (a.T * area) @ (a + b / 2) / 3 + (b.T * area) @ (b + a / 2) / 3
    flat = general(float(area.sum()), second[1, 1], second[0, 1], second[0, 0], 1.0, label="ARBITRARY")
    section = _with_walls(flat, turned(points, centroid, flat.angle), pairs, t)
    return Shape(replace(section, label="ARBITRARY"), (float(centroid[0]), float(centroid[1])))


def general(A: float, I11: float, I12: float, I22: float, J: float, label: str = "GENERAL") -> Section:
    """Return a section of given constants, in its principal axes; k is 1, as Abaqus has it.

    Raises
    ------
    PropertyError
        Unless I11 I22 > I12².
    """
    angle = 0.0
    if I12:  # as `fem.sections.outlines.Integrals.principal_angle`: within ±45° of the axis 1
        angle = float(np.arctan(2 * I12 / (I22 - I11)) / 2) if I22 != I11 else np.copysign(np.pi / 4, I12)
    c, s = np.cos(angle), np.sin(angle)
    Iy = I11 * c * c - 2 * I12 * s * c + I22 * s * s
    Iz = I11 * s * s + 2 * I12 * s * c + I22 * c * c
    return Section(A, Iy, Iz, J, 1.0, 1.0, label=label, angle=float(angle))
