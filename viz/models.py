"""Models as surfaces: sections with offsets and corners, places on them, and colours of members."""

import re
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.elements.frame import Frame
from fem.model import Model
from viz.surfaces import Surface, extrude
from viz.triangles import Floats, Outlines, circle_of_area


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
    """Return the places where arrows from members' axes leave the surface, shape (n, 3) [m].

    Parameters
    ----------
    model : Model
    points, directions : array_like (n, 3)
        Places on the axis [m] and directions of the arrows.
    eye : array_like (3,)
        Direction to the viewer: arrows along a member lie on the visible side.
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
    """Return the lengths by which ends of lines are drawn longer to fill corners, shape (n_lines, 2) [m]."""
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
