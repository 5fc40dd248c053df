"""Surfaces of frames and their deformation, as arrays: nothing here needs a screen.

Each line of a frame is drawn as its section swept along its axis. The axis of a vibrating line follows the
cubic Hermite polynomials of its end displacements and rotations, so that bending looks smooth with few
elements, and each cross-section moves as a rigid body.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.elements.frame import Frame
from fem.model import Model

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Outlines = Sequence[NDArray[np.float64]]
"""Closed polygons (n, 2) in a section's (y, z) plane, the outer first, then holes [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """The surface of a frame, at rest and moving.

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
        Index of the line that each triangle belongs to.
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


@dataclass(frozen=True, slots=True, eq=False)
class Arrows:
    """Arrows to draw, by their tails and tips.

    Attributes
    ----------
    tail, tip : ndarray (n, 3)
        Ends [m].
    """

    tail: Floats
    tip: Floats


def hermite(xi: ArrayLike, length: float, ends: ArrayLike, rotations: ArrayLike) -> tuple[Floats, Floats]:
    """Interpolate the motion of a line's axis between its ends, in local axes.

    Axial displacement and twist are linear. Deflections v and w are the cubics with the end values and the
    end slopes v' = θz and w' = -θy; the rotations in between are the slopes of the cubics.

    Parameters
    ----------
    xi : array_like (n,)
        Fractions of the length, 0 to 1 [-].
    length : float
        Length of the line [m].
    ends : array_like (2, 3)
        Displacements of the two ends along local x, y, z [m].
    rotations : array_like (2, 3)
        Rotations of the two ends about local x, y, z [rad].

    Returns
    -------
    displacement, rotation : ndarray (n, 3)
        In local axes [m, rad].
    """
    xi = np.asarray(xi, dtype=float)
    u, theta = np.asarray(ends, dtype=float), np.asarray(rotations, dtype=float)
    linear = np.stack([1 - xi, xi], axis=1)
    value = np.stack([1 - 3 * xi**2 + 2 * xi**3, 3 * xi**2 - 2 * xi**3], axis=1)
    slope = length * np.stack([xi - 2 * xi**2 + xi**3, xi**3 - xi**2], axis=1)
    d_value = np.stack([-6 * xi + 6 * xi**2, 6 * xi - 6 * xi**2], axis=1) / length
    d_slope = np.stack([1 - 4 * xi + 3 * xi**2, 3 * xi**2 - 2 * xi], axis=1)
    v, w = (value @ u[:, k] + sign * slope @ theta[:, r] for k, r, sign in ((1, 2, 1), (2, 1, -1)))
    dv, dw = (d_value @ u[:, k] + sign * d_slope @ theta[:, r] for k, r, sign in ((1, 2, 1), (2, 1, -1)))
    return np.stack([linear @ u[:, 0], v, w], axis=1), np.stack([linear @ theta[:, 0], -dw, dv], axis=1)


def circle_of_area(area: float, n: int = 20) -> Floats:
    """Return a circle of a given area as a polygon, for sections without an outline, shape (n, 2) [m]."""
    phi = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return np.sqrt(area / np.pi) * np.column_stack([np.cos(phi), np.sin(phi)])


def line_rotations(points: ArrayLike, lines: ArrayLike) -> Floats:
    """Return default local axes of lines: x along, z as upright as possible, shape (n_lines, 3, 3).

    Vertical lines take global y for their local y.
    """
    points, lines = np.asarray(points, dtype=float), np.asarray(lines, dtype=np.int64)
    x = points[lines[:, 1]] - points[lines[:, 0]]
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross([0.0, 0.0, 1.0], x)
    upright = np.linalg.norm(y, axis=1) < 1e-6
    y[upright] = [0.0, 1.0, 0.0]
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], axis=1)


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

    caps: dict[int, tuple[Outlines, Ints]] = {}
    parts: list[tuple[Any, ...]] = []
    start = 0
    for k, (a, b) in enumerate(lines):
        centre, moved, turned = _axis(points[[a, b]], motion[[a, b]], R[k], arms[k], rigid[k], pieces)
        loops = outlines[k]
        if id(loops) not in caps:
            caps[id(loops)] = (loops, triangulate(loops))
        ring = np.vstack([_anticlockwise(loop, hole=i > 0) for i, loop in enumerate(loops)])
        arm = ring @ R[k, 1:]
        m, stations = len(ring), len(centre)
        triangles, edges, rim = _sweep(loops, stations)
        cap, last = caps[id(loops)][1], m * (stations - 1)
        if closed[k, 0]:
            triangles, edges = np.vstack([triangles, cap[:, ::-1]]), np.vstack([edges, rim])
        if closed[k, 1]:
            triangles, edges = np.vstack([triangles, cap + last]), np.vstack([edges, rim + last])
        parts.append(
            (
                np.repeat(centre, m, axis=0),
                np.tile(arm, (stations, 1)),
                np.repeat(moved, m, axis=0),
                np.repeat(turned, m, axis=0),
                triangles + start,
                edges + start,
                np.full(len(triangles), k),
            )
        )
        start += m * stations
    return Surface(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def amplification(surface: Surface, size: float, fraction: float = 0.08, largest_turn: float = 0.7) -> float:
    """Choose the scale of a deformed picture.

    The largest displacement becomes a fraction of the structure's size, unless a cross-section then turned
    by more than ``largest_turn`` [rad], as a slender member in torsion would.

    Parameters
    ----------
    surface : Surface
    size : float
        Largest extent of the structure [m].
    fraction : float
        Largest displacement in the picture as a fraction of the size [-].
    largest_turn : float
        Largest rotation in the picture [rad].
    """
    moved = float(np.linalg.norm(surface.displacement, axis=1).max(initial=0.0))
    turned = float(np.linalg.norm(surface.rotation, axis=1).max(initial=0.0))
    if moved == 0:
        return 1.0
    scale = fraction * size / moved
    return min(scale, largest_turn / turned) if turned > 0 else scale


def match_scale(measured: ArrayLike, computed: ArrayLike) -> complex:
    """Return the factor that brings a measured shape nearest to a computed one.

    s = Σ conj(v)·u / Σ |v|², the modal scale factor, with the displacement vectors v measured and u computed
    at the same points. A measured vector has only the component along its sensor, so u counts only along v.

    Parameters
    ----------
    measured, computed : array_like (n, 3)
        Displacement vectors, real or complex.
    """
    v, u = np.asarray(measured), np.asarray(computed)
    return complex(np.vdot(v, u) / max(float(np.vdot(v, v).real), 1e-300))


def group_components(points: ArrayLike, vectors: ArrayLike, tolerance: float) -> list[list[int]]:
    """Return which vectors are components of one motion: at one place and at right angles.

    Parameters
    ----------
    points, vectors : array_like (n, 3)
    tolerance : float
        Largest distance of points that count as one [m].

    Returns
    -------
    list of list of int
        Indices of each group, in order.
    """
    points, vectors = np.array(points, dtype=float, ndmin=2), np.array(vectors, dtype=float, ndmin=2)
    size = np.linalg.norm(vectors, axis=1)
    groups: list[list[int]] = []
    for k, (point, vector) in enumerate(zip(points, vectors, strict=True)):
        for group in groups:
            near = np.linalg.norm(points[group[0]] - point) <= tolerance
            if near and (np.abs(vectors[group] @ vector) <= 0.1 * size[group] * size[k]).all():
                group.append(k)
                break
        else:
            groups.append([k])
    return groups


def arrows(points: ArrayLike, vectors: ArrayLike, length: float, *, towards: bool = False) -> Arrows:
    """Return arrows of one length that leave points along vectors, or point towards them.

    Parameters
    ----------
    points, vectors : array_like (n, 3)
        Coordinates [m] and directions of any length.
    length : float
        Length of the arrows [m].
    towards : bool
        True if the tips are at the points (forces).
    """
    p, d = np.array(points, dtype=float, ndmin=2), np.array(vectors, dtype=float, ndmin=2)
    d = length * d / np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-300)
    return Arrows(p - d, p) if towards else Arrows(p, p + d)


def real_shape(shape: ArrayLike) -> Floats:
    """Return a complex shape at the phase at which most of it moves; a real one as it is.

    The phase maximises Σ Re(φ e^{-iα})², α = ½ arg Σ φ².
    """
    phi = np.asarray(shape)
    if not np.iscomplexobj(phi):
        return phi.astype(float)
    alpha = 0.5 * np.angle((phi**2).sum())
    return np.ascontiguousarray((phi * np.exp(-1j * alpha)).real)


def triangulate(loops: Outlines) -> Ints:
    """Divide a polygon with holes into triangles, by cutting ears.

    Holes are joined to the outer polygon by the shortest bridge. Vertices are numbered through the loops as
    they are after the outer is turned anticlockwise and the holes clockwise.

    Returns
    -------
    ndarray of int (n_triangles, 3)
        Anticlockwise triangles.
    """
    turned = [_anticlockwise(loop, hole=i > 0) for i, loop in enumerate(loops)]
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


def frame_of(model: Model) -> Frame:
    """Return the model's frame, which has its members' sections.

    Raises
    ------
    ValueError
        If the model has none, or several.
    """
    frames = model.of_kind(Frame)
    if len(frames) != 1:
        msg = f"the model has {len(frames)} frames; a picture needs exactly one, with the members' sections"
        raise ValueError(msg)
    return frames[0]


def model_surface(model: Model, motion: ArrayLike | None = None, pieces: int = 6) -> Surface:
    """Sweep the sections of a model's members along their axes, with offsets and rigid end zones.

    Where members end at one point at an angle they are drawn longer, to the outside of the corner.

    Parameters
    ----------
    model : Model
    motion : array_like (n_dof,) or (n_points, 6), optional
        Displacements and rotations of all points [m, rad], then coordinates of effects, which are not
        drawn; at rest unless given.
    pieces : int
        Number of straight pieces that a line is drawn with.

    Raises
    ------
    ValueError
        If the model has no frame.
    """
    frame, mesh = frame_of(model), model.mesh
    arms, rigid = np.zeros((mesh.n_lines, 2, 3)), np.zeros((mesh.n_lines, 2))
    closed = np.zeros((mesh.n_lines, 2), dtype=bool)
    outlines: list[Outlines] = [()] * mesh.n_lines
    for name, chain in mesh.members.items():
        p = frame.members[name]
        s = mesh.member_positions(name)
        at = p.offset1 + (s / s[-1])[:, None] * (p.offset2 - p.offset1)
        arms[chain, 0], arms[chain, 1] = at[:-1], at[1:]
        rigid[chain[0], 0], rigid[chain[-1], 1] = p.rigid1, p.rigid2
        closed[chain[0], 0] = closed[chain[-1], 1] = True
        loops = p.section.outlines or (circle_of_area(p.section.A),)
        for row in chain:
            outlines[row] = loops
    R = frame.rotations(mesh)
    fill = _corner_lengths(model, R)
    arms += np.array([-1.0, 1.0])[:, None] * fill[:, :, None] * R[:, :1]
    rigid += fill
    if motion is not None:
        motion = np.asarray(motion, dtype=float).ravel()[: 6 * mesh.n_points].reshape(mesh.n_points, 6)
    return extrude(
        mesh.points, mesh.lines, R, outlines, motion, arms=arms, rigid=rigid, closed=closed, pieces=pieces
    )


def surface_places(model: Model, points: ArrayLike, directions: ArrayLike, eye: ArrayLike) -> Floats:
    """Return where arrows from places on members' axes leave the surface, shape (n, 3) [m].

    Parameters
    ----------
    model : Model
    points, directions : array_like (n, 3)
        Places on the axis [m] and directions of the arrows.
    eye : array_like (3,)
        Direction to the viewer: arrows along a member lie on the side that is seen.
    """
    frame, mesh = frame_of(model), model.mesh
    R = frame.rotations(mesh)
    out = np.array(points, dtype=float, ndmin=2)
    for k, direction in enumerate(np.array(directions, dtype=float, ndmin=2)):
        member, position, _ = mesh.nearest_on_members(out[k])
        axes = R[mesh.locate(member, position).line]
        section = frame.members[member].section
        ring = (section.outlines or (circle_of_area(section.A),))[0]
        way = direction / np.linalg.norm(direction)
        if abs(way @ axes[0]) > 0.7:
            way = np.asarray(eye, dtype=float)
            way = way - (way @ axes[0]) * axes[0]
            way /= max(float(np.linalg.norm(way)), 1e-300)
        out[k] += max(float((ring @ (axes[1:] @ way)).max()), 0.0) * way
    return out


def displacement_at(model: Model, motion: ArrayLike, points: ArrayLike) -> NDArray[Any]:
    """Return the displacement vectors of a model at places on or beside its members, shape (n, 3) [m].

    A place beside a member moves with the member's nearest cross-section.

    Parameters
    ----------
    model : Model
    motion : array_like (n_dof,)
        Displacements and rotations of all points, real or complex [m, rad].
    points : array_like (n, 3)
        Coordinates [m].
    """
    mesh, points, motion = model.mesh, np.array(points, dtype=float, ndmin=2), np.asarray(motion).reshape(-1)
    if not len(points):
        return np.empty((0, 3), dtype=motion.dtype)
    where = [mesh.locate(member, position) for member, position, _ in map(mesh.nearest_on_members, points)]
    dofs, N = frame_of(model).interpolate(mesh, where)
    u = np.einsum("nij,nj->ni", N, motion[dofs])
    arm = points - np.array([mesh.point_at(location) for location in where])
    return u[:, :3] + np.cross(u[:, 3:], arm)


def member_families(model: Model) -> dict[str, str]:
    """Return the family that each member is coloured by.

    Its group or own name, else its name without number, else its section: the first with at most eight
    families. Members split from one set always share a colour.
    """
    mesh = model.mesh
    family = {name: name for name in mesh.members}
    for group, names in mesh.groups.items():
        family.update(dict.fromkeys(names, group))
    stems = {name: re.sub(r"[\s_.:-]*\d+[a-zA-Z]?$", "", group) or group for name, group in family.items()}
    frame = frame_of(model)
    labels = {name: frame.members[name].section.label or "section by its constants" for name in mesh.members}
    return next((f for f in (family, stems) if len(set(f.values())) <= 8), labels)


def _corner_lengths(model: Model, R: Floats) -> Floats:
    """Return by how much each end of each line is drawn longer to fill a corner, shape (n_lines, 2) [m]."""
    frame, mesh = frame_of(model), model.mesh
    at: dict[int, list[tuple[int, int, str]]] = {}
    for name, chain in mesh.members.items():
        for line, end in ((chain[0], 0), (chain[-1], 1)):
            at.setdefault(int(mesh.lines[line, end]), []).append((int(line), end, name))
    out = np.zeros((mesh.n_lines, 2))
    for members in at.values():
        for line, end, name in members:
            x = (2 * end - 1) * R[line, 0]
            for other, _, named in members:
                if named == name or abs(R[other, 0] @ x) > 0.8:
                    continue
                section = frame.members[named].section
                ring = (section.outlines or (circle_of_area(section.A),))[0]
                out[line, end] = max(out[line, end], 0.97 * float((ring @ (R[other, 1:] @ x)).max()))
    return out


def _axis(
    ends: Floats, motion: Floats, R: Floats, arms: Floats, rigid: Floats, pieces: int
) -> tuple[Floats, Floats, Floats]:
    """Return centres, displacements and rotations of stations along a line's axis, (n_stations, 3)."""
    outer = ends + arms
    inner = outer + np.outer([1.0, -1.0], R[0]) * rigid[:, None]
    length = float(np.linalg.norm(inner[1] - inner[0]))
    turn = motion[:, 3:]

    def rigid_to(places: Floats) -> Floats:
        return motion[:, :3] + np.cross(turn, places - ends)

    xi = np.linspace(0, 1, pieces + 1)
    local_u, local_theta = hermite(xi, length, rigid_to(inner) @ R.T, turn @ R.T)
    centre = inner[0] + xi[:, None] * (inner[1] - inner[0])
    moved, turned = local_u @ R, local_theta @ R
    if rigid.any():
        moved_ends = rigid_to(outer)
        centre = np.vstack([outer[:1], centre, outer[1:]])
        moved = np.vstack([moved_ends[:1], moved, moved_ends[1:]])
        turned = np.vstack([turn[:1], turned, turn[1:]])
    return centre, moved, turned


def _sweep(loops: Outlines, stations: int) -> tuple[Ints, Ints, Ints]:
    """Return side triangles, sharp edges and the first rim of a section swept over stations.

    Vertices run station by station.
    """
    m = sum(len(loop) for loop in loops)
    triangles, edges, rim = [], [np.empty((0, 2), dtype=np.int64)], []
    first = 0
    for i, loop in enumerate(loops):
        loop = _anticlockwise(loop, hole=i > 0)
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


def _anticlockwise(loop: NDArray[np.float64], *, hole: bool) -> Floats:
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
        own = (np.abs(others[:, None] - np.stack([a, b, c])) == 0).all(axis=2).any(axis=1)
        inside = (
            (_cross(b - a, others - a) >= 0)
            & (_cross(c - b, others - b) >= 0)
            & (_cross(a - c, others - c) >= 0)
        )
        inside &= ~own
        if not inside.any():
            return i
        if area > best_area:
            best, best_area = i, area
    return best


def _cross(a: Floats, b: Floats) -> Any:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def view_axes(points: Floats) -> Floats:
    """Return the axes of the picture (right, up, towards the eye) as rows, from the structure's proportions.

    Three-dimensional and horizontal structures are seen from the front, the right and above; a structure in
    one vertical plane from the front of its plane, turned a little; a single straight member at right
    angles, a little from above.
    """
    extent = np.ptp(points, axis=0)
    order = np.argsort(extent)
    small = extent < 0.2 * extent.max()
    azimuth, elevation = -62.0, 26.0
    if small.sum() == 2:
        azimuth, elevation = {0: (-75.0, 20.0), 1: (-15.0, 20.0), 2: (-70.0, 12.0)}[int(order[2])]
    elif small.sum() == 1:
        azimuth, elevation = {0: (-22.0, 18.0), 1: (-68.0, 18.0), 2: (-62.0, 34.0)}[int(order[0])]
    a, e = np.deg2rad([azimuth, elevation])
    eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.stack([right, np.cross(eye, right), eye])
