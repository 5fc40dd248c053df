"""Sections and materials as decks have them: walls of unlike thickness, constants about any axes, any G.

Points are (y, z) in the axes of the deck's shape, from its lower left corner unless stated otherwise [m].
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats
from fem.materials import Material, PropertyError
from fem.sections.constants import LARGEST_SHEAR_COEFFICIENT
from fem.sections.outlines import Integrals, integrate, turned
from fem.sections.section import Section
from fem.sections.walls import Walls, wall_constants

Points = Sequence[tuple[float, float]]
Pairs = Sequence[tuple[int, int]]


def of_constants(
    label: str, A: float, moments: Sequence[float], J: float, k: Sequence[float], least: float = 0.0
) -> Section:
    """Return a section of A, (Iy, Iz, Iyz = ∫ y z dA), J and (ky, kz) in its principal axes [m², m⁴, -].

    Iy and Iz are at least ``least``.
    """
    about = Integrals(A, 0.0, 0.0, *moments)
    angle = about.principal_angle
    about = about.turned(angle)
    return Section(A, max(about.Iy, least), max(about.Iz, least), J, k[0], k[1], label=label, angle=angle)


def rod(A: float) -> Section:
    """Return a round section of an area [m²]; a bar without bending uses nothing else of it."""
    return Section.circle(2 * np.sqrt(max(A, 0.0) / np.pi))


def material_of(
    name: str, E: float, G: float, nu: float, rho: float, eta: float = 0.0
) -> tuple[Material, float]:
    """Return a material of E and G [Pa], and the factor of J, ky and kz that gives a G beyond its ratio."""
    ratio = E / (2 * G) - 1
    taken = ratio if -0.99 < ratio <= 0.5 else min(max(nu, 0.0), 0.5)
    material = Material(name, E, rho, taken, eta)
    return material, 1.0 if taken == ratio else G / material.G


def with_shear(section: Section, factor: float, k: Sequence[float] | None = None) -> Section:
    """Return a section with J and shear coefficients times a factor, or with other coefficients (ky, kz)."""
    if factor == 1.0 and k is None:
        return section
    found = (section.ky * factor, section.kz * factor) if k is None else k
    ky, kz = (float(value) if value <= LARGEST_SHEAR_COEFFICIENT else 0.0 for value in found)
    return replace(
        section, J=section.J * factor, ky=ky, kz=kz, shape="", dimensions={}, estimated_k=k is None
    )


def check_fit(fits: bool, reason: str) -> None:
    """Refuse dimensions that do not fit each other."""
    if not fits:
        raise PropertyError(reason)


# Walls ------------------------------------------------------------------------------------------------------


def with_walls(
    section: Section, points: ArrayLike, walls: Pairs, t: ArrayLike, J: float | None = None
) -> Section:
    """Return a section with J, k and shear centre of thin walls between points in its principal axes.

    J is that of closed cells after Bredt and Σ s t³/3 of the walls, unless given [m⁴].
    """
    ends, t, pairs = np.asarray(points, dtype=float), np.asarray(t, dtype=float), np.array(walls, dtype=int)
    flow = wall_constants(ends, walls, t)
    length = np.linalg.norm(ends[pairs[:, 1]] - ends[pairs[:, 0]], axis=1)
    y, z = flow.shear_centre
    return replace(
        section,
        J=flow.J_cells + float(length @ t**3) / 3 if J is None else J,
        ky=flow.area_y / section.A,
        kz=flow.area_z / section.A,
        shear_centre=(float(y), float(z)),
        walls=Walls(ends, tuple(walls), t),
        estimated_k=True,
    )


def walled(
    label: str,
    outlines: Sequence[ArrayLike],
    points: Points,
    walls: Pairs,
    thickness: Sequence[float],
    J: float | None = None,
) -> tuple[Section, Floats]:
    """Return a section of walls along centre lines, in principal axes, and its centroid [m]."""
    check_fit(min(thickness) > 0, f"{label} section: a wall is {min(thickness):g} m thick")
    section = Section.polygon(outlines[0], outlines[1:], J=1.0, label=label)
    centre = integrate(outlines).centroid
    return with_walls(section, turned(points, centre, section.angle), walls, thickness, J), centre


def rectangle(y1: float, y2: float, z1: float, z2: float) -> list[tuple[float, float]]:
    """Return the corners of a rectangle."""
    return [(y1, z1), (y2, z1), (y2, z2), (y1, z2)]


def box(
    b: float, h: float, walls: tuple[float, float, float, float], nu: float = 0.0, *, bredt: bool = False
) -> tuple[Section, Floats]:
    """Return a box with walls at the bottom, right, top and left, and its centroid.

    ``bredt`` leaves out Σ s t³/3 of its walls.
    """
    bottom, right, top, left = walls
    if len(set(walls)) == 1:
        return Section.hollow_rectangle(b, h, top, nu=nu), np.array([b, h]) / 2
    check_fit(top + bottom < h and right + left < b, "the walls of the box fill it")
    y1, y2, z1, z2 = left / 2, b - right / 2, bottom / 2, h - top / 2
    wide, high = y2 - y1, z2 - z1
    J = 4 * (wide * high) ** 2 / (wide / bottom + high / right + wide / top + high / left)
    outlines = [rectangle(0, b, 0, h), rectangle(left, b - right, bottom, h - top)]
    return walled(
        f"box {b:g} x {h:g} m",
        outlines,
        rectangle(y1, y2, z1, z2),
        [(0, 1), (1, 2), (2, 3), (3, 0)],
        walls,
        J if bredt else None,
    )


def angle(b: float, h: float, flat: float, upright: float) -> tuple[Section, Floats]:
    """Return an angle with legs of two thicknesses, its corner at the origin, and its centroid."""
    check_fit(flat < h and upright < b, "the legs are thicker than the angle is wide")
    outline = [(0, 0), (b, 0), (b, flat), (upright, flat), (upright, h), (0, h)]
    y, z = upright / 2, flat / 2
    return walled(
        f"angle {b:g} x {h:g} m", [outline], [(b, z), (y, z), (y, h)], [(0, 1), (1, 2)], [flat, upright]
    )
