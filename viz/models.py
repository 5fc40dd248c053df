"""Models as surfaces: sections with offsets and corners, parts, places on them, and colours of members."""

import re
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Floats, Ints
from fem.effects.superelement import Superelement
from fem.elements.frame import Frame
from fem.elements.part_faces import PartFaces
from fem.model import Model
from fem.sections.dimensions import shape_label
from fem.sections.section import Section
from viz.surfaces import Outlines, Surface, circle_of_area, extrude, joined


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


def drawn_parts(model: Model) -> tuple[tuple[Superelement, PartFaces], ...]:
    """Return the model's imported parts that have a surface to draw, with this surface."""
    return tuple((part, part.faces) for part in model.of_kind(Superelement) if part.faces is not None)


def drawn_names(model: Model) -> list[str]:
    """Return the member of each line, and after the lines the name of each drawn part.

    A triangle of :func:`model_surface` has its place in this list as ``line``.
    """
    return [*map(str, model.mesh.member_of_line()), *(part.name for part, _ in drawn_parts(model))]


def drawn_size(model: Model) -> float:
    """Return the largest extent of members and drawn parts along a coordinate axis [m]."""
    places = [model.mesh.points, *(faces.points for _, faces in drawn_parts(model))]
    return float(np.ptp(np.concatenate(places), axis=0).max())


def model_surface(model: Model, motion: ArrayLike | None = None, pieces: int = 6) -> Surface:
    """Sweep the sections of a model's members along their axes, and add the surfaces of imported parts.

    Members have their offsets and rigid end zones. Where they end at one point at an angle they are drawn
    longer, to the outside of the corner.

    Parameters
    ----------
    model : Model
    motion : array_like (n,) or (n_points, 6), optional
        Displacements and rotations of all points [m, rad], then the internal coordinates of effects, of which
        parts have some; at rest unless given.
    pieces : int
        Number of straight pieces that a line is drawn with.

    Raises
    ------
    ValueError
        If the model has neither a frame nor a part with a surface.
    """
    parts, mesh = drawn_parts(model), model.mesh
    if not parts and not mesh.n_lines and model.of_kind(Superelement):
        msg = "there is nothing to draw: the model has no members, and its parts have no mesh (mesh = ... in "
        msg += "[[superelements]], faces= in Python)"
        raise ValueError(msg)
    full = np.zeros(model.n_dof)
    if motion is not None:
        given = np.asarray(motion, dtype=float).ravel()
        full[: given.size] = given
    surfaces = [_frame_surface(model, full, pieces)] if mesh.n_lines or not parts else []
    for k, (part, faces) in enumerate(parts):
        moved = faces.motion(part.part, part.motion(model, full))
        none = np.zeros_like(faces.points)
        number = np.full(len(faces.triangles), mesh.n_lines + k)
        surfaces.append(Surface(faces.points, none, moved, none, faces.triangles, faces.edges, number))
    return joined(surfaces)


def _frame_surface(model: Model, motion: Floats, pieces: int) -> Surface:
    """Sweep the sections of a model's members, moved by all coordinates of the model."""
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
    at_points = motion[: 6 * mesh.n_points].reshape(mesh.n_points, 6)
    return extrude(
        mesh.points, mesh.lines, R, outlines, at_points, arms=arms, rigid=rigid, closed=closed, pieces=pieces
    )


def surface_places(model: Model, points: ArrayLike, directions: ArrayLike, eye: ArrayLike) -> Floats:
    """Return the places where arrows from members' axes leave the surface, shape (n, 3) [m].

    Points of imported parts are on the surface already.

    Parameters
    ----------
    model : Model
    points, directions : array_like (n, 3)
        Places on the axis [m] and directions of the arrows.
    eye : array_like (3,)
        Direction to the viewer: arrows along a member lie on the visible side.
    """
    out = np.array(points, dtype=float, ndmin=2)
    on_parts, mesh = _points_of_parts(model, out) >= 0, model.mesh
    if on_parts.all():
        return out
    frame = frame_of(model)
    R = frame.rotations(mesh)
    for k, direction in enumerate(np.array(directions, dtype=float, ndmin=2)):
        if on_parts[k]:
            continue
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

    A place beside a member moves with the member's nearest cross-section, a point of a part by itself.

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
    at = _points_of_parts(model, points)
    out = np.zeros((len(points), 3), dtype=np.result_type(motion, float))
    out[at >= 0] = motion[6 * at[at >= 0][:, None] + np.arange(3)]
    others = points[at < 0]
    if len(others):
        where = [mesh.locate(member, s) for member, s, _ in map(mesh.nearest_on_members, others)]
        dofs, N = frame_of(model).interpolate(mesh, where)
        u = np.einsum("nij,nj->ni", N, motion[dofs])
        arm = others - np.array([mesh.point_at(location) for location in where])
        out[at < 0] = u[:, :3] + np.cross(u[:, 3:], arm)
    return out


def _points_of_parts(model: Model, places: Floats) -> Ints:
    """Return the points of the mesh that belong to no member and lie at places, -1 where there is none."""
    out, mesh = np.full(len(places), -1), model.mesh
    free = np.setdiff1d(np.arange(mesh.n_points), mesh.lines)
    if not free.size:
        return out
    away = np.linalg.norm(places[:, None] - mesh.points[free], axis=2)
    near = away.argmin(axis=1)
    found = away[np.arange(len(places)), near] <= 1e-9 * max(drawn_size(model), 1e-300)
    out[found] = free[near[found]]
    return out


def member_families(model: Model) -> dict[str, str]:
    """Return the family that each member and drawn part is coloured by.

    A part is a family of its own. A member's is its group or name, else its name without number, else its
    section: the first with at most eight families. Members split from one set always share a colour.
    """
    mesh = model.mesh
    family = {name: name for name in mesh.members}
    for group, names in mesh.groups.items():
        family.update(dict.fromkeys(names, group))
    stems = {name: re.sub(r"[\s_.:-]*\d+[a-zA-Z]?$", "", group) or group for name, group in family.items()}
    parts = {part.name: f"part {part.name}" for part, _ in drawn_parts(model)}
    chosen = next((f for f in (family, stems) if len(set(f.values())) <= 8), None)
    if chosen is None:
        frame = frame_of(model)
        chosen = {n: _section_name(frame.members[n].section) for n in mesh.members}
    return chosen | parts


def _section_name(section: Section) -> str:
    """Return a section's name, dimensions in the unit that texts have."""
    if section.shape:
        return shape_label(section.shape, section.dimensions)
    return section.label or "section by its constants"


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
