"""Surfaces of structures and their deformation, as arrays: nothing here needs a screen.

Each line of a frame is drawn as its section swept along its axis. The axis of a vibrating line follows the
cubic Hermite polynomials of its end displacements and rotations, so that bending looks smooth with few
elements, and each cross-section moves as a rigid body.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats, Ints

# Outlines of sections, and their division into triangles ----------------------------------------------------


Outlines = Sequence[Floats]
"""Closed polygons (n, 2) in a section's (y, z) plane, the outer first, then holes [m]."""


def circle_of_area(area: float, n: int = 20) -> Floats:
    """Return a circle of a given area as a polygon, for sections without an outline, shape (n, 2) [m]."""
    phi = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return np.sqrt(area / np.pi) * np.column_stack([np.cos(phi), np.sin(phi)])


def triangulate(loops: Outlines) -> Ints:
    """Divide a polygon with holes into triangles, by cutting ears.

    Holes are joined to the outer polygon by the shortest bridge. Vertices are numbered through the loops as
    they are after the outer is turned anticlockwise and the holes clockwise.

    Returns
    -------
    ndarray of int (n_triangles, 3)
        Anticlockwise triangles.
    """
    turned = [anticlockwise(loop, hole=i > 0) for i, loop in enumerate(loops)]
    xy = np.vstack(turned)
    first = np.concatenate([[0], np.cumsum([len(loop) for loop in turned])])
    chain = list(range(first[1]))
    for h in range(1, len(turned)):
        hole = list(range(first[h], first[h + 1]))
        distance = np.linalg.norm(xy[chain][:, None] - xy[hole][None], axis=2)
        i, j = np.unravel_index(int(np.argmin(distance)), distance.shape)
        chain = [*chain[: i + 1], *hole[j:], *hole[: j + 1], *chain[i:]]
    triangles = []
    while len(chain) > 3:
        ear = _ear(xy, chain)
        triangles.append((chain[ear - 1], chain[ear], chain[(ear + 1) % len(chain)]))
        del chain[ear]
    triangles.append(tuple(chain))
    return np.array(triangles, dtype=np.int64)


def anticlockwise(loop: Floats, *, hole: bool) -> Floats:
    """Return an outer polygon anticlockwise, a hole clockwise."""
    loop = np.asarray(loop, dtype=float)
    y, z = loop[:, 0], loop[:, 1]
    area = float((y * np.roll(z, -1) - np.roll(y, -1) * z).sum()) / 2
    return loop[::-1] if (area < 0) != hole else loop


def _ear(xy: Floats, chain: list[int]) -> int:
    """Return the position in a simple anticlockwise polygon of a corner that can be cut off."""
    best, best_area = 0, -np.inf
    for i in range(len(chain)):
        a, b, c = xy[chain[i - 1]], xy[chain[i]], xy[chain[(i + 1) % len(chain)]]
        area = _cross(b - a, c - b)
        if area <= 0:
            continue
        # a corner that touches the ear blocks it, unless it is the ear's own, met again at a bridge
        others = xy[chain]
        corners = (np.abs(others[:, None] - np.stack([a, b, c])) == 0).all(axis=2).any(axis=1)
        inside = (
            (_cross(b - a, others - a) >= 0)
            & (_cross(c - b, others - b) >= 0)
            & (_cross(a - c, others - c) >= 0)
        )
        inside &= ~corners
        if not inside.any():
            return i
        if area > best_area:
            best, best_area = i, area
    return best


def _cross(a: Floats, b: Floats) -> Any:
    """Return the z component of the cross product of vectors in a plane."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


# ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """The surface of a structure, at rest and moving.

    Attributes
    ----------
    centre : ndarray (n, 3)
        Point of the axis at the cross-section of each vertex [m].
    arm : ndarray (n, 3)
        Vertex minus centre, at rest [m].
    translation, rotation : ndarray (n, 3)
        Motion of the cross-section of each vertex [m, rad].
    triangles : ndarray of int (n_triangles, 3)
        Vertices of each triangle, anticlockwise seen from outside.
    edges : ndarray of int (n_edges, 2)
        Vertices of the sharp edges, to be drawn as lines.
    line : ndarray of int (n_triangles,)
        Index of the line that each triangle belongs to; parts are numbered after the lines.
    """

    centre: Floats
    arm: Floats
    translation: Floats
    rotation: Floats
    triangles: Ints
    edges: Ints
    line: Ints

    @property
    def rest(self) -> Floats:
        """Vertices at rest, shape (n, 3) [m]."""
        return self.centre + self.arm

    @property
    def displacement(self) -> Floats:
        """Displacement of the vertices to first order, u + θ × arm, shape (n, 3) [m]."""
        return self.translation + np.cross(self.rotation, self.arm)

    def deformed(self, scale: float = 1.0) -> Floats:
        """Return the vertices with the motion multiplied by a scale, shape (n, 3) [m].

        Cross-sections turn by the angle atan |scale θ| about θ, so that they keep their dimensions however
        large the scale is and stay at right angles to the bent axis.
        """
        theta = scale * self.rotation
        size = np.linalg.norm(theta, axis=1, keepdims=True)
        axis = np.divide(theta, size, out=np.zeros_like(theta), where=size > 0)
        cosine = 1 / np.sqrt(1 + size**2)
        along = np.einsum("ij,ij->i", axis, self.arm)[:, None] * axis
        turned = cosine * self.arm + size * cosine * np.cross(axis, self.arm) + (1 - cosine) * along
        return self.centre + scale * self.translation + turned

    def with_motion(self, translation: Floats, rotation: Floats) -> "Surface":
        """Return the surface with another motion."""
        return replace(self, translation=translation, rotation=rotation)


def joined(surfaces: Sequence[Surface]) -> Surface:
    """Return several surfaces as one."""
    start = np.cumsum([0, *(len(s.centre) for s in surfaces)])
    moved = [
        replace(s, triangles=s.triangles + first, edges=s.edges + first)
        for s, first in zip(surfaces, start[:-1], strict=True)
    ]
    return Surface(*(np.concatenate([getattr(s, f.name) for s in moved]) for f in fields(Surface)))


def hermite(xi: ArrayLike, length: ArrayLike, ends: ArrayLike, rotations: ArrayLike) -> tuple[Floats, Floats]:
    """Interpolate the motion of lines' axes between their ends, in local axes.

    Axial displacement and twist are linear. Deflections v and w are the cubics with the end values and the
    end slopes v' = θz and w' = -θy; the rotations in between are the slopes of the cubics.

    Parameters
    ----------
    xi : array_like (n,)
        Fractions of the length, 0 to 1 [-].
    length : array_like (...,)
        Length of each line [m].
    ends : array_like (..., 2, 3)
        Displacements of the two ends along local x, y, z [m].
    rotations : array_like (..., 2, 3)
        Rotations of the two ends about local x, y, z [rad].

    Returns
    -------
    displacement, rotation : ndarray (..., n, 3)
        In local axes [m, rad].
    """
    xi, L = np.asarray(xi, dtype=float), np.asarray(length, dtype=float)[..., None]
    u, theta = np.asarray(ends, dtype=float), np.asarray(rotations, dtype=float)
    linear = np.stack([1 - xi, xi], axis=1)
    value = np.stack([1 - 3 * xi**2 + 2 * xi**3, 3 * xi**2 - 2 * xi**3], axis=1) @ u
    slope = np.stack([xi - 2 * xi**2 + xi**3, xi**3 - xi**2], axis=1) @ theta
    d_value = np.stack([-6 * xi + 6 * xi**2, 6 * xi - 6 * xi**2], axis=1) @ u
    d_slope = np.stack([1 - 4 * xi + 3 * xi**2, 3 * xi**2 - 2 * xi], axis=1) @ theta
    v, w = value[..., 1] + L * slope[..., 2], value[..., 2] - L * slope[..., 1]
    dv, dw = d_value[..., 1] / L + d_slope[..., 2], d_value[..., 2] / L - d_slope[..., 1]
    axial, twist = (linear @ u)[..., 0], (linear @ theta)[..., 0]
    return np.stack([axial, v, w], axis=-1), np.stack([twist, -dw, dv], axis=-1)


def extrude(
    points: ArrayLike,
    lines: ArrayLike,
    rotations: ArrayLike,
    outlines: Sequence[Outlines],
    motion: ArrayLike | None = None,
    *,
    arms: ArrayLike | None = None,
    rigid: ArrayLike | None = None,
    closed: ArrayLike | None = None,
    pieces: int = 6,
) -> Surface:
    """Sweep each line's section along its axis.

    Parameters
    ----------
    points : array_like (n_points, 3)
        Coordinates [m].
    lines : array_like of int (n_lines, 2)
        Point indices.
    rotations : array_like (n_lines, 3, 3)
        Local x, y, z axes of each line as rows, in global coordinates.
    outlines : sequence of sequence of ndarray (n, 2)
        Outlines of each line's section in (y, z) [m].
    motion : array_like (n_points, 6), optional
        Displacements and rotations of the points [m, rad]; at rest unless given.
    arms : array_like (n_lines, 2, 3), optional
        From each end's point to the end of the axis, rigid, in global coordinates [m].
    rigid : array_like (n_lines, 2), optional
        Lengths at the ends of the axis that do not bend [m].
    closed : array_like of bool (n_lines, 2), optional
        Ends that have an end face; all unless given. Between the lines of a member there need be none.
    pieces : int
        Number of straight pieces that a line is drawn with.

    Raises
    ------
    ValueError
        If an array does not have one row for each point or line.
    """
    points, lines = np.asarray(points, dtype=float), np.asarray(lines, dtype=np.int64)
    R = np.asarray(rotations, dtype=float)
    motion = np.zeros((len(points), 6)) if motion is None else np.asarray(motion, dtype=float)
    arms = np.zeros((len(lines), 2, 3)) if arms is None else np.asarray(arms, dtype=float)
    rigid = np.zeros((len(lines), 2)) if rigid is None else np.asarray(rigid, dtype=float)
    closed = np.ones((len(lines), 2), dtype=bool) if closed is None else np.asarray(closed, dtype=bool)
    n = len(lines)
    for name, have, want in (
        ("motion", motion.shape, (len(points), 6)),
        ("rotations", R.shape, (n, 3, 3)),
        ("outlines", (len(outlines),), (n,)),
        ("arms", arms.shape, (n, 2, 3)),
        ("rigid", rigid.shape, (n, 2)),
        ("closed", closed.shape, (n, 2)),
    ):
        if have != want:
            msg = f"{name} has shape {have}; {want} is expected for {len(points)} points and {n} lines"
            raise ValueError(msg)

    every = _axes(points[lines], motion[lines], R, arms, rigid, pieces)
    swept: dict[tuple[int, int], tuple[Floats, Ints, Ints, Ints, Ints]] = {}
    parts: list[tuple[Any, ...]] = []
    start = 0
    for k, loops in enumerate(outlines):
        along = slice(None) if rigid[k].any() else slice(1, -1)
        centre, moved, turned = (part[k, along] for part in every)
        stations = len(centre)
        if (id(loops), stations) not in swept:
            ring = np.vstack([anticlockwise(loop, hole=i > 0) for i, loop in enumerate(loops)])
            swept[id(loops), stations] = (ring, *_sweep(loops, stations), triangulate(loops))
        ring, triangles, edges, rim, cap = swept[id(loops), stations]
        m = len(ring)
        last = m * (stations - 1)
        if closed[k, 0]:
            triangles, edges = np.vstack([triangles, cap[:, ::-1]]), np.vstack([edges, rim])
        if closed[k, 1]:
            triangles, edges = np.vstack([triangles, cap + last]), np.vstack([edges, rim + last])
        parts.append(
            (
                np.repeat(centre, m, axis=0),
                np.tile(ring @ R[k, 1:], (stations, 1)),
                np.repeat(moved, m, axis=0),
                np.repeat(turned, m, axis=0),
                triangles + start,
                edges + start,
                np.full(len(triangles), k),
            )
        )
        start += m * stations
    return Surface(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _axes(
    ends: Floats, motion: Floats, R: Floats, arms: Floats, rigid: Floats, pieces: int
) -> tuple[Floats, Floats, Floats]:
    """Return centres, displacements and rotations of stations along lines' axes, (n_lines, pieces + 3, 3).

    The first and the last station are the outer ends of the rigid lengths.
    """
    outer = ends + arms
    inner = outer + np.array([1.0, -1.0])[:, None] * rigid[:, :, None] * R[:, :1]
    length = np.linalg.norm(inner[:, 1] - inner[:, 0], axis=1)
    turn, to_local = motion[..., 3:], R.transpose(0, 2, 1)

    def rigid_to(places: Floats) -> Floats:
        return motion[..., :3] + np.cross(turn, places - ends)

    xi = np.linspace(0, 1, pieces + 1)
    local_u, local_theta = hermite(xi, length, rigid_to(inner) @ to_local, turn @ to_local)
    centre = inner[:, :1] + xi[:, None] * (inner[:, 1:] - inner[:, :1])
    of_outer = outer, rigid_to(outer), turn
    between = centre, local_u @ R, local_theta @ R
    centre, moved, turned = (
        np.concatenate([a[:, :1], b, a[:, 1:]], axis=1) for a, b in zip(of_outer, between, strict=True)
    )
    return centre, moved, turned


def _sweep(loops: Outlines, stations: int) -> tuple[Ints, Ints, Ints]:
    """Return side triangles, sharp edges and the first rim of a section swept over stations.

    Vertices run station by station.
    """
    m = sum(len(loop) for loop in loops)
    triangles, edges, rim = [], [np.empty((0, 2), dtype=np.int64)], []
    first = 0
    for i, loop in enumerate(loops):
        loop = anticlockwise(loop, hole=i > 0)
        n = len(loop)
        a = first + np.arange(n)
        b = first + (np.arange(n) + 1) % n
        step = m * np.arange(stations - 1)[:, None]
        a0, b0 = (a + step).ravel(), (b + step).ravel()
        triangles += [np.stack([a0, b0, b0 + m], axis=1), np.stack([a0, b0 + m, a0 + m], axis=1)]
        if i == 0:
            side = np.roll(loop, -1, axis=0) - loop
            before = np.roll(side, 1, axis=0)
            turn = np.arctan2(
                before[:, 0] * side[:, 1] - before[:, 1] * side[:, 0], np.einsum("ij,ij->i", before, side)
            )
            corner = a[np.abs(turn) > np.deg2rad(30)]
            along = (corner + step).ravel()
            edges.append(np.stack([along, along + m], axis=1))
        rim.append(np.stack([a, b], axis=1))
        first += n
    return np.vstack(triangles), np.vstack(edges), np.vstack(rim)
