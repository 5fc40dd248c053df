"""Defects of a mesh or a model, with their points and lines.

A mesh from a drawing may look connected and be in pieces: lines that end near one another, cross without a
common point, or lie twice in the same place. :func:`check_mesh` finds these from the geometry;
:func:`check_model` also knows the connections of joints and other effects, and finds motions that nothing
opposes.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fem.analysis.modes import MechanismError, solve_modes
from fem.array_types import Bools, Floats, Ints
from fem.elements.frame import Frame
from fem.io.rawmesh import coincidences
from fem.lengths import coordinates_text, rough_length
from fem.mesh import Mesh, merge_advice, merge_names
from fem.model import Model, ModelError
from fem.plausibility import suspicions
from fem.system import assemble

MOST_PAIRS = 250_000
"""Pairs of points that are all measured; of more a tree finds the near ones, but takes long to import."""
SHORT = 1 / 100
"""A line shorter than this part of a neighbour is reported: it may be a gap that was closed by hand [-]."""

Pairs = Ints


@dataclass(frozen=True, slots=True, eq=False)
class Defect:
    """A probable mistake in a model.

    Attributes
    ----------
    kind : str
        ``"coincident points"``, ``"unconnected points"``, ``"unconnected crossing"``, ``"loose part"``,
        ``"unused point"``, ``"duplicate lines"``, ``"short line"``, ``"no properties"``, ``"mechanism"``,
        ``"implausible"`` or ``"model"``.
    message : str
        The defect, its place and its remedy.
    points, lines : ndarray of int
        Where it is.
    motions : ndarray (n_dof, k)
        Of a mechanism: motions that nothing opposes.
    """

    kind: str
    message: str
    points: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    lines: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    motions: Floats = field(default_factory=lambda: np.zeros((0, 0)))


def check_mesh(mesh: Mesh, tolerance: float | None = None) -> tuple[Defect, ...]:
    """Find defects of a mesh from its geometry, the gravest first.

    Parameters
    ----------
    mesh : Mesh
    tolerance : float, optional
        Points and lines nearer than this that are not connected are suspicious [m]. A thousandth of the
        mesh's size unless given, and at most a tenth of the shortest line.
    """
    return _geometry(mesh, tolerance, np.zeros((0, 2), dtype=np.int64))


def check_model(model: Model, tolerance: float | None = None) -> tuple[Defect, ...]:
    """Find defects of a model: mechanisms, those of its mesh, members without properties, implausible values.

    Points that a joint or another effect ties count as connected.

    Parameters
    ----------
    model : Model
    tolerance : float, optional
        See :func:`check_mesh`.
    """
    return (*_of_structure(model, tolerance), *implausible(model))


def with_ties_known(model: Model) -> Model:
    """Return a model whose mesh has no note on points at one place that joints or other effects connect.

    The reader of a mesh file knows of no effects, and notes all such points.
    """
    mesh = model.mesh
    unaware = coincidences(mesh.points, mesh.lines) if mesh.notes else []
    stale = {note: text for note in mesh.notes for text in unaware if note.endswith(text)}
    if not stale:
        return model
    aware = coincidences(mesh.points, mesh.lines, np.vstack([_constrained(model), _coupled(model)]))
    notes = [n for n in mesh.notes if n not in stale]
    notes += [note.removesuffix(text) + other for note, text in stale.items() for other in aware]
    return replace(model, mesh=replace(mesh, notes=tuple(notes)))


def implausible(model: Model) -> tuple[Defect, ...]:
    """Return the suspicions of :func:`fem.plausibility.suspicions` as defects."""
    mesh = model.mesh
    return tuple(
        Defect(
            "implausible", s.message, np.unique(mesh.lines[list(s.lines)]), np.array(s.lines, dtype=np.int64)
        )
        for s in suspicions(model)
    )


def _of_structure(model: Model, tolerance: float | None) -> tuple[Defect, ...]:
    mesh = model.mesh
    bare = _without_properties(model)
    if bare:
        return (*bare, *_geometry(mesh, tolerance, _constrained(model)))
    try:
        ties = np.vstack([_constrained(model), _coupled(model)])
    except ModelError as reason:
        return (Defect("model", str(reason)), *_geometry(mesh, tolerance, _constrained(model)))
    found = _geometry(mesh, tolerance, ties)
    if any(defect.kind in ("loose part", "unused point") for defect in found):
        return found  # each loose part is a mechanism, which would only say it again
    return (*_mechanism(model), *found)


# Geometry ---------------------------------------------------------------------------------------------------


def _geometry(mesh: Mesh, tolerance: float | None, ties: Pairs) -> tuple[Defect, ...]:
    length = mesh.lengths()
    near = (
        tolerance if tolerance is not None else min(1e-3 * mesh.size, 0.1 * float(length.min(initial=np.inf)))
    )
    part = _parts(mesh, ties)
    tied = _Linked(mesh, ties)
    return (
        *_loose(mesh, part, ties),
        *_near_points(mesh, near, _Linked(mesh, np.vstack([mesh.lines, ties]))),
        *_near_lines(mesh, near, tied),
        *_crossings(mesh, near, tied),
        *_duplicates(mesh),
        *_short(mesh, length),
    )


class _Linked:
    """Which pairs of points are connected directly."""

    def __init__(self, mesh: Mesh, pairs: Pairs) -> None:
        n = mesh.n_points
        pairs = np.sort(pairs, axis=1)
        self.n, self.codes = n, np.unique(pairs[:, 0] * n + pairs[:, 1])

    def any(self, first: Ints, second: Ints) -> Bools:
        """Return whether each pair of points is one point or directly connected."""
        code = np.minimum(first, second) * self.n + np.maximum(first, second)
        return (first == second) | np.isin(code, self.codes)


def _parts(mesh: Mesh, ties: Pairs) -> Ints:
    """Return the number of the part that each point is in."""
    pairs = np.vstack([mesh.lines, ties])
    graph = sp.coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(mesh.n_points,) * 2)
    return connected_components(graph, directed=False)[1]


def _loose(mesh: Mesh, part: Ints, ties: Pairs) -> Iterable[Defect]:
    used = np.union1d(mesh.lines, ties)
    unused = np.setdiff1d(np.arange(mesh.n_points), used)
    if unused.size:
        yield Defect(
            "unused point",
            f"{_points(unused)} {'is' if unused.size == 1 else 'are'} on no line and no joint; leave "
            f"{'it' if unused.size == 1 else 'them'} out",
            unused,
        )
    of_line = part[mesh.lines[:, 0]]
    numbers, count = np.unique(of_line, return_counts=True)
    for k in numbers[np.argsort(-count, kind="stable")][1:]:
        rows = np.flatnonzero(of_line == k)
        rest = np.isin(np.arange(mesh.n_points), mesh.lines[of_line != k])
        in_part = np.unique(mesh.lines[rows])
        gap, at = scipy.spatial.cKDTree(mesh.points[rest]).query(mesh.points[in_part])
        a, b = in_part[int(np.argmin(gap))], np.flatnonzero(rest)[at[int(np.argmin(gap))]]
        yield Defect(
            "loose part",
            f"{_lines(mesh, rows)} {'is' if rows.size == 1 else 'are'} connected to nothing else; the "
            f"nearest points are {a} and {b}, {rough_length(gap.min(), 3)} apart; add a joint, or points "
            "that the members share",
            in_part,
            rows,
        )


def _within(points: Floats, centres: Floats, radius: Floats) -> tuple[Ints, Ints]:
    """Return each centre and point that are no farther apart than the centre's radius (n_centres,)."""
    if len(points) * len(centres) <= MOST_PAIRS:
        pairs = np.argwhere(np.linalg.norm(centres[:, None] - points, axis=2) <= radius[:, None])
        return pairs[:, 0], pairs[:, 1]
    found = scipy.spatial.cKDTree(points).query_ball_point(centres, radius)
    of = np.repeat(np.arange(len(centres)), [len(f) for f in found])
    return of, np.concatenate([np.asarray(f, dtype=np.int64) for f in found])


def _near_points(mesh: Mesh, near: float, tied: _Linked) -> Iterable[Defect]:
    pairs = np.stack(_within(mesh.points, mesh.points, np.full(mesh.n_points, near)), axis=1)
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    on = np.isin(pairs, mesh.lines).all(axis=1)
    pairs = pairs[on & ~tied.any(pairs[:, 0], pairs[:, 1])] if len(pairs) else pairs
    gap = np.linalg.norm(mesh.points[pairs[:, 0]] - mesh.points[pairs[:, 1]], axis=1)
    for (a, b), d in sorted(zip(pairs.tolist(), gap.tolist(), strict=True)):
        same = d <= 1e-9 * mesh.size
        what = "lie at the same place" if same else f"are {rough_length(d)} apart"
        yield Defect(
            "coincident points" if same else "unconnected points",
            f"points {a} ({_members_at(mesh, a)}) and {b} ({_members_at(mesh, b)}) {what} and are not "
            f"connected; {merge_advice(max(d, 1e-6 * mesh.size))}",
            np.array([a, b]),
        )


def _near_lines(mesh: Mesh, near: float, tied: _Linked) -> Iterable[Defect]:
    """Points near the inner part of a line."""
    ends = mesh.points[mesh.lines]
    p, row = _candidates(mesh, near)
    a, t = ends[row, 0], ends[row, 1] - ends[row, 0]
    xi = np.einsum("ij,ij->i", mesh.points[p] - a, t) / np.einsum("ij,ij->i", t, t)
    gap = np.linalg.norm(a + xi[:, None] * t - mesh.points[p], axis=1)
    margin = near / np.linalg.norm(t, axis=1)  # nearer to an end, the two points are another defect
    hit = (gap <= near) & (xi > margin) & (xi < 1 - margin) & np.isin(p, mesh.lines)
    hit &= ~tied.any(p, mesh.lines[row, 0]) & ~tied.any(p, mesh.lines[row, 1])
    for k in np.flatnonzero(hit):
        what = "on it" if gap[k] <= 1e-9 * mesh.size else f"{rough_length(gap[k])} beside it"
        yield Defect(
            "unconnected crossing",
            f"point {p[k]} ({_members_at(mesh, int(p[k]))}) is not connected to line {row[k]} of member "
            f"'{mesh.member_of_line()[row[k]]}', and lies {what} at "
            f"{coordinates_text(mesh.points[p[k]])}; divide the line there, or add a joint",
            np.array([p[k]]),
            np.array([row[k]]),
        )


def _candidates(mesh: Mesh, near: float) -> tuple[Ints, Ints]:
    """Return points and lines whose enclosing balls meet, without the lines' ends."""
    middle, radius = mesh.points[mesh.lines].mean(axis=1), mesh.lengths() / 2 + near
    if not mesh.n_lines:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    row, p = _within(mesh.points, middle, radius)
    keep = (p != mesh.lines[row, 0]) & (p != mesh.lines[row, 1])
    return p[keep], row[keep]


def _crossings(mesh: Mesh, near: float, tied: _Linked) -> Iterable[Defect]:
    """Two lines that pass each other between their ends."""
    middle, half = mesh.points[mesh.lines].mean(axis=1), mesh.lengths() / 2
    if not mesh.n_lines:
        return
    order = np.argsort(-half)  # each line looks for those that are not longer
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    first, second = _within(middle, middle, 2 * half + near)
    keep = rank[first] < rank[second]
    first, second = first[keep], second[keep]
    for i in range(2):
        for j in range(2):
            keep = ~tied.any(mesh.lines[first, i], mesh.lines[second, j])
            first, second = first[keep], second[keep]
    p, u = mesh.points[mesh.lines[first, 0]], np.diff(mesh.points[mesh.lines[first]], axis=1)[:, 0]
    q, v = mesh.points[mesh.lines[second, 0]], np.diff(mesh.points[mesh.lines[second]], axis=1)[:, 0]
    # nearest points p + s u and q + t v of the infinite lines: normal equations of both
    uu, vv, uv = (np.einsum("ij,ij->i", x, y) for x, y in ((u, u), (v, v), (u, v)))
    w = p - q
    det = uu * vv - uv**2
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (uv * np.einsum("ij,ij->i", v, w) - vv * np.einsum("ij,ij->i", u, w)) / det
        t = (uu * np.einsum("ij,ij->i", v, w) - uv * np.einsum("ij,ij->i", u, w)) / det
        gap = np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=1)
    inside = (det > 1e-6 * uu * vv) & (gap <= near)
    for x, size in ((s, np.sqrt(uu)), (t, np.sqrt(vv))):
        inside &= (x * size > near) & ((1 - x) * size > near)
    names = mesh.member_of_line()
    for k in np.flatnonzero(inside):
        where = p[k] + s[k] * u[k]
        gap_text = "" if gap[k] <= 1e-9 * mesh.size else f", {rough_length(gap[k])} apart"
        yield Defect(
            "unconnected crossing",
            f"line {first[k]} of member '{names[first[k]]}' and line {second[k]} of member "
            f"'{names[second[k]]}' cross at {coordinates_text(where)}{gap_text}, and are not connected; "
            "divide both there, or add a joint",
            np.zeros(0, dtype=np.int64),
            np.array([first[k], second[k]]),
        )


def _duplicates(mesh: Mesh) -> Iterable[Defect]:
    pairs, index = np.unique(np.sort(mesh.lines, axis=1), axis=0, return_inverse=True)
    count = np.bincount(index.ravel())
    for k in np.flatnonzero(count > 1):
        rows = np.flatnonzero(index.ravel() == k)
        yield Defect(
            "duplicate lines",
            f"{_lines(mesh, rows)} join the same points {pairs[k, 0]} and {pairs[k, 1]}: their stiffness and "
            "mass count twice; leave one out",
            pairs[k],
            rows,
        )


def _short(mesh: Mesh, length: Floats) -> Iterable[Defect]:
    longest = np.zeros(mesh.n_points)
    for end in range(2):
        np.maximum.at(longest, mesh.lines[:, end], length)
    neighbour = longest[mesh.lines].max(axis=1)
    for row in np.flatnonzero(length < SHORT * neighbour):
        yield Defect(
            "short line",
            f"line {row} of member '{mesh.member_of_line()[row]}' is {rough_length(length[row])} long next "
            f"to one of {rough_length(neighbour[row])}; is this intended, or should points "
            f"{mesh.lines[row, 0]} and {mesh.lines[row, 1]} be one point?",
            mesh.lines[row].copy(),
            np.array([row]),
        )


# The model --------------------------------------------------------------------------------------------------


def _without_properties(model: Model) -> tuple[Defect, ...]:
    frames = model.of_kind(Frame)
    if not frames:
        return ()
    have = {name for frame in frames for name in frame.members}
    out = []
    for name, rows in model.mesh.members.items():
        if name not in have:
            msg = (
                f"member '{name}' has no material and section; given are {', '.join(sorted(have)) or 'none'}"
            )
            out.append(Defect("no properties", msg, np.unique(model.mesh.lines[rows]), np.array(rows)))
    return tuple(out)


def _constrained(model: Model) -> Pairs:
    """Return pairs of points that constraints tie."""
    return _pairs(model, [c.dofs for c in model.constraints()])


def _coupled(model: Model) -> Pairs:
    """Return pairs of points that stiffness ties."""
    dofs = [
        row[np.abs(K).max(axis=0) > 0]
        for effect in model.effects
        if not isinstance(effect, Frame)
        for part in effect.contribute(model)
        if part.K is not None
        for row, K in zip(part.dofs, part.K, strict=True)
    ]
    return _pairs(model, dofs)


def _pairs(model: Model, groups: Iterable[Ints]) -> Pairs:
    pairs = [np.zeros((0, 2), dtype=np.int64)]
    for dofs in groups:
        points = np.unique(dofs[dofs < 6 * model.mesh.n_points] // 6)
        if points.size > 1:
            pairs.append(np.column_stack([np.full(points.size - 1, points[0]), points[1:]]))
        elif points.size:
            pairs.append(np.column_stack([points, points]))
    return np.vstack(pairs)


def _mechanism(model: Model) -> tuple[Defect, ...]:
    n, mesh = 1, model.mesh
    try:
        system = assemble(model)
        while True:
            try:
                solve_modes(system, n=n)
            except MechanismError as reason:
                motions = reason.motions
                if motions.shape[1] + system.rigid.shape[1] >= n < system.n_free:
                    n = max(20, 2 * n)  # there may be more
                    continue
                at = motions[: 6 * mesh.n_points].reshape(-1, 6, motions.shape[1])
                turned = mesh.size * np.abs(at[:, 3:]).max(axis=(1, 2))
                reach = np.maximum(np.abs(at[:, :3]).max(axis=(1, 2)), turned)
                free = np.flatnonzero(reach > 0.3 * reach.max())
                return (Defect("mechanism", str(reason), free, motions=motions),)
            return ()
    except ModelError as reason:
        return (Defect("model", str(reason)),)


# Words ------------------------------------------------------------------------------------------------------


def _members_at(mesh: Mesh, point: int) -> str:
    rows = np.flatnonzero((mesh.lines == point).any(axis=1))
    names = list(dict.fromkeys(str(n) for n in mesh.member_of_line()[rows]))
    return f"member {merge_names([repr(n) for n in names])}" if names else "on no line"


def _lines(mesh: Mesh, rows: Ints) -> str:
    names = list(dict.fromkeys(str(n) for n in mesh.member_of_line()[rows]))
    shown = merge_names([f"'{n}'" for n in names[:4]]) + (" …" if len(names) > 4 else "")
    what = f"line {rows[0]}" if rows.size == 1 else f"{rows.size} lines"
    return f"{what} of member{'s' * (len(names) > 1)} {shown}"


def _points(points: Ints) -> str:
    shown = ", ".join(str(p) for p in points[:6]) + (", …" if points.size > 6 else "")
    return f"point {shown}" if points.size == 1 else f"{points.size} points ({shown})"
