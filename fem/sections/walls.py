"""Thin walls: shear flow, shear areas, shear centre and Bredt's torsion of sections made of straight walls.

Stresses are constant across a wall, and the shear flow q [N/m] runs along its centre line. A shear force V_z
makes

    dq/ds = -t z V_z / Iy

along each wall, flows balance where walls meet, and of all flows that do, the true one has the least energy
∫ q²/t ds: around each closed cell ∮ q/t ds = 0, no twist (Megson, *Aircraft Structures*; Pilkey, *Analysis
and Design of Elastic Beams*, 2002). Then

    1 / (kz A) = ∫ (q/V_z)² / t ds

and the flow's moment about the centroid is V_z times the shear centre's y. This k is that of Cowper's
formulas for thin walls (J. Appl. Mech. 33, 1966, 335-340) at ν = 0.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import null_space

from fem.array_types import Floats


class WallConstants(NamedTuple):
    """Constants of a section by the theory of thin walls.

    Attributes
    ----------
    area_y, area_z : float
        Shear areas ky A and kz A [m²].
    shear_centre : ndarray (2,)
        y and z, as the points are given [m].
    J_cells : float
        Torsion constant of the closed cells, after Bredt; 0 without any [m⁴].
    """

    area_y: float
    area_z: float
    shear_centre: Floats
    J_cells: float


class Walls(NamedTuple):
    """The straight walls of a section.

    Attributes
    ----------
    points : ndarray (n, 2)
        Ends of centre lines, y and z in principal axes [m].
    pairs : tuple of (int, int)
        The two points of each wall.
    thickness : ndarray (n_walls,)
        Of each wall [m].
    """

    points: Floats
    pairs: tuple[tuple[int, int], ...]
    thickness: Floats


class WallFlows(NamedTuple):
    """Shear flows q = q0 + c1 s + c2 s² along walls, positive from their first points to their second.

    Attributes
    ----------
    first, along : ndarray (n_walls, 2)
        First points from the centroid of the walls [m], and directions [-].
    length, thickness : ndarray (n_walls,)
        [m].
    centroid : ndarray (2,)
        Of the walls, in the axes of their points [m].
    q0, c1, c2 : ndarray (2, n_walls)
        For unit forces along y and z that do not twist the section [1/m, 1/m², 1/m³].
    moment : ndarray (2,)
        Of these flows about the centroid [m].
    cells : ndarray (n_walls,)
        Flow around closed cells where G times the rate of twist is 1 [m²]; 0 in open walls.
    J_cells : float
        Torsion constant of the closed cells, after Bredt [m⁴].
    """

    first: Floats
    along: Floats
    length: Floats
    thickness: Floats
    centroid: Floats
    q0: Floats
    c1: Floats
    c2: Floats
    moment: Floats
    cells: Floats
    J_cells: float


def wall_constants(
    points: ArrayLike, walls: Sequence[tuple[int, int]], thickness: ArrayLike
) -> WallConstants:
    """Return shear areas, shear centre and Bredt's torsion constant.

    Parameters
    ----------
    points : array_like (n, 2)
        Ends of centre lines, y and z in the directions of principal axes [m].
    walls : sequence of (int, int)
        The two points of each wall.
    thickness : array_like (n_walls,)
        Of each wall [m].
    """
    flow = wall_flows(points, walls, thickness)
    L, q0, c1, c2 = flow.length, flow.q0, flow.c1, flow.c2
    square = (
        q0**2 * L + q0 * c1 * L**2 + (c1**2 + 2 * q0 * c2) * L**3 / 3 + c1 * c2 * L**4 / 2 + c2**2 * L**5 / 5
    )
    area_y, area_z = (1 / float(part) for part in (square / flow.thickness).sum(axis=1))
    shear_centre = flow.centroid + np.array([flow.moment[1], -flow.moment[0]])
    return WallConstants(area_y, area_z, shear_centre, flow.J_cells)


def wall_flows(points: ArrayLike, walls: Sequence[tuple[int, int]], thickness: ArrayLike) -> WallFlows:
    """Return the shear flows of unit forces and of a unit rate of twist; as :func:`wall_constants`."""
    ends = np.asarray(points, dtype=float)[np.array(walls)]  # (wall, end, yz)
    t = np.broadcast_to(np.asarray(thickness, dtype=float), (len(ends),))
    L = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    A = t @ L
    centroid = (t * L) @ ends.mean(axis=1) / A
    ends = ends - centroid
    along = (ends[:, 1] - ends[:, 0]) / L[:, None]
    arm = ends[:, 0, 0] * along[:, 1] - ends[:, 0, 1] * along[:, 0]  # of each wall about the centroid

    meeting = np.zeros((len(np.asarray(points)), len(ends)))  # flow that arrives at each point
    for k, (i, j) in enumerate(walls):
        meeting[i, k] -= 1.0
        meeting[j, k] += 1.0
    cells = null_space(meeting)
    flexibility = cells.T @ ((L / t)[:, None] * cells)
    twice_area = cells.T @ (arm * L)
    around, J_cells = np.zeros(len(L)), 0.0
    if cells.size:
        each = np.linalg.solve(flexibility, twice_area)
        around, J_cells = cells @ each, float(twice_area @ each)

    flows, moments = [], []
    first, difference = ends[:, 0], ends[:, 1] - ends[:, 0]
    second = np.einsum("k,kij->ij", t * L, _products(ends[:, 0], ends[:, 1]))
    for axis in (0, 1):
        # q(s) = q0 + c1 s + c2 s² for a unit force; the axes need not be quite principal
        bending = np.linalg.solve(second, np.eye(2)[axis])
        c1, c2 = -t * (first @ bending), -t * (difference @ bending) / (2 * L)
        gain = c1 * L + c2 * L**2
        q0 = np.linalg.lstsq(meeting, -np.maximum(meeting, 0.0) @ gain, rcond=None)[0]
        mean = q0 + c1 * L / 2 + c2 * L**2 / 3
        if cells.size:
            change = -cells @ np.linalg.solve(flexibility, cells.T @ (mean * L / t))
            q0, mean = q0 + change, mean + change
        flows.append((q0, c1, c2))
        moments.append(float((mean * L) @ arm))
    q0, c1, c2 = (np.array(part) for part in zip(*flows, strict=True))
    return WallFlows(first, along, L, t, centroid, q0, c1, c2, np.array(moments), around, J_cells)


def _products(a: Floats, b: Floats) -> Floats:
    """Return the mean of r rᵀ along lines from a to b, shape (n, 2, 2)."""
    ab = a[:, :, None] * b[:, None]
    return (a[:, :, None] * a[:, None] + b[:, :, None] * b[:, None]) / 3 + (ab + np.swapaxes(ab, 1, 2)) / 6
