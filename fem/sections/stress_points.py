"""Stresses at points of a section from the section forces.

Solid sections have the flexure and torsion of St Venant's theory, walls those of thin walls. Points are
(y, z) in principal axes from the centroid [m]. Sources:

- normal stress: N/A + My z/Iy - Mz y/Iz;
- solid and hollow round sections: Love, *Treatise on the Mathematical Theory of Elasticity*, art. 229, with
  the flexure function χ = -k [(R² + r²) ρ + R² r²/ρ] cos θ + ρ³/4 cos 3θ and k = 3/4 + ν/2; T ρ/J;
- ellipse: Timoshenko & Goodier, *Theory of Elasticity*, art. 105 and 122;
- rectangle: the series of their art. 109 and 124, which is V Q/(I t) at ν = 0;
- walls: V Q/(I t) with the flow that does not twist the section; T/J times twice the distance from the centre
  line, and in closed cells Bredt's flow: T/(2 A t) where walls are thin (Megson, *Aircraft Structures*).

Warping torsion and the concentration of stresses at inner corners are left out.
"""

from typing import NamedTuple

import numpy as np

from fem.array_types import Floats
from fem.sections.constants import SectionConstants
from fem.sections.walls import Walls, wall_flows

N_ANGLES = 72
"""Points around round sections: a largest stress between two of them is missed by 0.1 % at most."""
_GRID = 13
_TERMS = 400
_ALONG = 32
"""Places along all walls of a section, at least; each wall has both ends."""


class StressPoints(NamedTuple):
    """Points of a section and what its forces do there.

    Attributes
    ----------
    points : ndarray (n, 2)
        y and z from the centroid [m].
    per_force : ndarray (n, 3, 6)
        σx, τxy and τxz on the positive face for unit N, Vy, Vz, T, My and Mz [1/m², 1/m³].
    """

    points: Floats
    per_force: Floats


def stress_points(section: SectionConstants, nu: float) -> StressPoints | None:
    """Return points of a section with stresses; None where no formula is known (`missing_formula`).

    Parameters
    ----------
    section : SectionConstants
    nu : float
        Poisson's ratio of the material [-].
    """
    size = section.dimensions
    if section.shape in ("circle", "tube"):
        outer = size["d"] / 2
        return _round(section, outer, outer - size["t"] if "t" in size else 0.0, nu)
    if section.shape == "ellipse":
        return _ellipse(section, size["b"] / 2, size["h"] / 2, nu)
    if section.shape == "rectangle":
        return _rectangle(section, size["b"], size["h"], nu)
    if section.walls is not None:
        return _of_walls(section, section.walls)
    return None


def missing_formula(section: SectionConstants) -> str:
    """Return why the stresses of shear and torsion of a section are not known; empty where they are."""
    if section.walls is not None or section.shape in ("circle", "tube", "ellipse", "rectangle"):
        return ""
    if section.outlines:
        return "no formula for shear and torsion of an outline"
    return "the outline of the section is not given"


def _with_normal(section: SectionConstants, points: Floats, shear: Floats) -> StressPoints:
    """Return points with shear stresses (n, 2, 3) for Vy, Vz and T, and the normal stress."""
    out = np.zeros((len(points), 3, 6))
    out[:, 0, 0] = 1 / section.A
    out[:, 0, 4], out[:, 0, 5] = points[:, 1] / section.Iy, -points[:, 0] / section.Iz
    out[:, 1:, 1:4] = shear
    return StressPoints(points, out)


def _round(section: SectionConstants, R: float, r: float, nu: float) -> StressPoints:
    """Return the points of a circle or a tube on circles from the inner to the outer radius."""
    phi = np.linspace(0, 2 * np.pi, N_ANGLES, endpoint=False)
    rho = np.linspace(r, R, 3)[:, None]
    y, z = (rho * np.cos(phi)).ravel(), (rho * np.sin(phi)).ravel()
    shear = np.zeros((len(y), 2, 3))
    k, about = 0.75 + nu / 2, section.Iy
    hole = (R * r / (y**2 + z**2)) ** 2 if r else np.zeros(len(y))
    for axis, along, across in ((0, y, z), (1, z, y)):
        scale = 1 / (2 * (1 + nu) * about)
        straight = k * (R**2 + r**2) + k * hole * (across**2 - along**2)
        shear[:, axis, axis] = scale * (straight - k * along**2 - (0.25 - nu / 2) * across**2)
        shear[:, 1 - axis, axis] = -scale * along * across * (2 * k * hole + 0.5 + nu)
    shear[:, 0, 2], shear[:, 1, 2] = -z / section.J, y / section.J
    return _with_normal(section, np.column_stack([y, z]), shear)


def _ellipse(section: SectionConstants, p: float, q: float, nu: float) -> StressPoints:
    """Return the points of an ellipse with half axes p along y and q along z."""
    phi = np.linspace(0, 2 * np.pi, N_ANGLES, endpoint=False)
    rho = np.array([0.0, 0.5, 1.0])[:, None]
    y, z = (rho * p * np.cos(phi)).ravel(), (rho * q * np.sin(phi)).ravel()
    shear = np.zeros((len(y), 2, 3))
    for axis, along, across, a, b, I in ((0, y, z, p, q, section.Iz), (1, z, y, q, p, section.Iy)):
        below = (1 + nu) * (3 * a**2 + b**2)
        top = 2 * (1 + nu) * a**2 + b**2
        inner = a**2 - along**2 - (1 - 2 * nu) * a**2 / top * across**2
        shear[:, axis, axis] = top / below / (2 * I) * inner
        shear[:, 1 - axis, axis] = -((1 + nu) * a**2 + nu * b**2) / below / I * along * across
    shear[:, 0, 2], shear[:, 1, 2] = -2 * z / (np.pi * p * q**3), 2 * y / (np.pi * p**3 * q)
    return _with_normal(section, np.column_stack([y, z]), shear)


def _rectangle(section: SectionConstants, b: float, h: float, nu: float) -> StressPoints:
    """Return a grid of points of a rectangle, its edges and corners among them."""
    y, z = (g.ravel() for g in np.meshgrid(*(np.linspace(-s / 2, s / 2, _GRID) for s in (b, h))))
    shear = np.zeros((len(y), 2, 3))
    ways = ((0, y, z, b / 2, h / 2, section.Iz), (1, z, y, h / 2, b / 2, section.Iy))
    for axis, along, across, a, width, I in ways:
        along_shear, other = _flexure(along, across, a, width, nu / (1 + nu) / I)
        shear[:, axis, axis] = (a**2 - along**2) / (2 * I) + along_shear
        shear[:, 1 - axis, axis] = other
    if b <= h:
        shear[:, 0, 2], shear[:, 1, 2] = _torsion(y, z, b / 2, h / 2, section.J)
    else:  # turned by a right angle: y' = z, z' = -y
        along, across = _torsion(z, -y, h / 2, b / 2, section.J)
        shear[:, 0, 2], shear[:, 1, 2] = -across, along
    return _with_normal(section, np.column_stack([y, z]), shear)


def _ratios(x: Floats, n: Floats, a: float, width: float) -> tuple[Floats, Floats]:
    """Return cosh(n π x/width) and sinh of it over cosh(n π a/width), without overflow, (n_points, n)."""
    k = n * np.pi / width
    near, far = np.exp(k * (abs(x)[:, None] - a)), np.exp(-k * (abs(x)[:, None] + a))
    below = 1 + np.exp(-2 * k * a)
    return (near + far) / below, np.sign(x)[:, None] * (near - far) / below


def _flexure(x: Floats, y: Floats, a: float, b: float, g: float) -> tuple[Floats, Floats]:
    """Return the stresses along x and y that Poisson's ratio adds under a unit force along x.

    ∂ψ/∂y and -∂ψ/∂x with ∇²ψ = g y, ψ = 0 on the edges x = ±a and y = ±b.
    """
    n = np.arange(1.0, _TERMS)
    cosh, sinh = _ratios(x, n, a, b)
    factor = 2 * b**2 * (-1) ** n / (n * np.pi) ** 2
    angle = n * np.pi / b * y[:, None]
    return (
        g * ((3 * y**2 - b**2) / 6 - (factor * cosh * np.cos(angle)).sum(axis=1)),
        g * (factor * sinh * np.sin(angle)).sum(axis=1),
    )


def _torsion(y: Floats, z: Floats, a: float, c: float, J: float) -> tuple[Floats, Floats]:
    """Return τxy and τxz under a unit torque with the half sides a along y, not above c along z."""
    n = np.arange(1.0, 2 * _TERMS, 2)
    cosh, sinh = _ratios(z, n, c, 2 * a)
    factor = 16 * a / np.pi**2 * (-1) ** ((n - 1) / 2) / n**2
    angle = n * np.pi / (2 * a) * y[:, None]
    across = -(factor * sinh * np.cos(angle)).sum(axis=1)
    along = 2 * y - (factor * cosh * np.sin(angle)).sum(axis=1)
    return across / J, along / J


def _of_walls(section: SectionConstants, walls: Walls) -> StressPoints:
    """Return the corners of the outlines, and points on both faces along the walls."""
    flow = wall_flows(*walls)
    on, place, offset = [], [], []
    for k, (L, t) in enumerate(zip(flow.length, flow.thickness, strict=True)):
        s = np.linspace(0, L, max(2, int(np.ceil(_ALONG * L / flow.length.sum())) + 1))
        for side in (-1, 1):
            on.append(np.full(s.size, k))
            place.append(s)
            offset.append(np.full(s.size, side * t / 2))
    # a corner of the outline has the stresses of the nearest place on a wall, and bending at the corner
    corners = np.concatenate(section.outlines)
    r = (corners - flow.centroid)[:, None] - flow.first
    normal = np.column_stack([flow.along[:, 1], -flow.along[:, 0]])
    s = np.clip((r * flow.along).sum(axis=2), 0, flow.length)
    nearest = np.linalg.norm(r - s[:, :, None] * flow.along, axis=2) - flow.thickness / 2
    k = np.round(nearest, 12).argmin(axis=1)
    n, rows = (r * normal).sum(axis=2), np.arange(len(corners))
    half = flow.thickness[k] / 2
    on.append(k)
    place.append(s[rows, k])
    offset.append(np.clip(n[rows, k], -half, half))
    wall, s, n = (np.concatenate(part) for part in (on, place, offset))
    points = flow.centroid + flow.first[wall] + s[:, None] * flow.along[wall] + n[:, None] * normal[wall]
    points[-len(corners) :] = corners
    t = flow.thickness[wall]
    twist = (flow.cells[wall] / t + 2 * n) / section.J
    along = np.stack(
        [
            *((flow.q0[i, wall] + flow.c1[i, wall] * s + flow.c2[i, wall] * s**2) / t for i in range(2)),
            twist,
        ],
        axis=1,
    )
    y, z = flow.centroid
    # section forces act at the centroid of the section, where these flows have a moment
    along[:, :2] -= np.multiply.outer(twist, flow.moment + np.array([-z, y]))
    return _with_normal(section, points, flow.along[wall][:, :, None] * along[:, None, :])
