"""Which point of the mesh is which point of the test, by position, with units and axes found."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fem.array_types import Bools, Floats, Ints
from fem.mesh import Mesh
from fem.summary import fields_summary

SCALES: Mapping[str, float] = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 0.0254, "ft": 0.3048}
"""Metres in the units that test coordinates may have."""
PLAUSIBLE = (0.2, 2.0)
"""Size of the test's points over the mesh's that is taken for metres without question."""
FITTING = (0.2, 1.05)
"""The same for another unit to be taken instead."""
_COLLINEAR = 1e-3
_MOST_DISTANCES = 500_000
"""Distances of points from lines that are in memory at once."""
_DIGITS = 1e-5
"""Places so near are one, in parts of the size of the mesh [-]: files state five or more digits."""
_MOST_POINTS = 120
"""Points along the members from which placements are searched."""


class GeometryMatchError(ValueError):
    """Test points that cannot be placed on the mesh, or in several ways.

    Attributes
    ----------
    alternatives : tuple of GeometryMatch
        The placements that are as good as one another, upright ones and those that turn least first.
    """

    def __init__(self, message: str, alternatives: "tuple[GeometryMatch, ...]" = ()) -> None:
        super().__init__(message)
        self.alternatives = alternatives


@dataclass(frozen=True, slots=True, eq=False)
class GeometryMatch:
    """Test points on the points of a mesh, x_mesh = scale · R x_test + translation.

    Attributes
    ----------
    pairs : ndarray of int (n, 2)
        Test point and mesh point, by rising test point; each at most once.
    distance : ndarray (n,)
        Between the two after the transform [m].
    scale : float
        Metres in the test's unit of length.
    R : ndarray (3, 3)
        Proper rotation from the test's axes to the mesh's.
    translation : ndarray (3,)
        [m].
    unmatched : tuple of int
        Test points without a mesh point within the tolerance.
    points : ndarray (n_test, 3)
        All test points in the mesh's axes [m].
    """

    pairs: Ints
    distance: Floats
    scale: float
    R: Floats
    translation: Floats
    unmatched: tuple[int, ...]
    points: Floats

    __repr__ = fields_summary

    @property
    def rms(self) -> float:
        """Root mean square distance of the pairs [m]; NaN without any."""
        return float(np.sqrt((self.distance**2).mean())) if self.distance.size else float("nan")

    @property
    def turn(self) -> tuple[float, Floats]:
        """Angle [degrees] and axis (3,) of the rotation."""
        skew = np.array(
            [self.R[2, 1] - self.R[1, 2], self.R[0, 2] - self.R[2, 0], self.R[1, 0] - self.R[0, 1]]
        )
        angle = float(np.arctan2(np.linalg.norm(skew), np.trace(self.R) - 1))
        values, vectors = np.linalg.eigh((self.R + self.R.T) / 2)
        axis = vectors[:, np.argmax(values)]
        return np.rad2deg(angle), axis if skew @ axis >= 0 else -axis

    def directions(self, vectors: ArrayLike) -> Floats:
        """Turn directions (n, 3) of the test into the mesh's axes."""
        return np.asarray(vectors, dtype=float) @ self.R.T

    def describe(self) -> str:
        """Return rotation, translation and distances in one line."""
        angle, axis = self.turn
        about = ", ".join(f"{v:.2f}" for v in np.round(axis, 2) + 0.0)
        moved = ", ".join(f"{v:.4g}" for v in np.round(self.translation, 6) + 0.0)
        return (
            ("not turned" if angle < 0.05 else f"turned {angle:.1f}° about ({about})")
            + f", moved by ({moved}) m, {len(self.pairs)} of {len(self.points)} points matched, "
            f"rms {round(self.rms, 6):.2g} m"
        )


Placed = list[GeometryMatch]


def align_points(points: ArrayLike, onto: ArrayLike) -> tuple[Floats, Floats]:
    """Compute the rotation and translation that bring points nearest to others, pair by pair.

    Kabsch, Acta Cryst. A32, 1976, 922-923: R = U diag(1, 1, det UVᵀ) Vᵀ of the cross-covariance, proper also
    for points in a plane; for points on a line the turn about it is arbitrary.

    Parameters
    ----------
    points, onto : array_like (n, 3)

    Returns
    -------
    R : ndarray (3, 3)
    translation : ndarray (3,)
        R p + translation is nearest to the others.

    Raises
    ------
    ValueError
        If the shapes are not (n, 3) and the same.
    """
    a, b = np.asarray(points, dtype=float), np.asarray(onto, dtype=float)
    if a.shape != b.shape or a.ndim != 2 or a.shape[1] != 3 or not len(a):
        msg = f"the points have shapes {a.shape} and {b.shape}; both must be (n, 3)"
        raise ValueError(msg)
    centre_a, centre_b = a.mean(axis=0), b.mean(axis=0)
    U, _, Vt = np.linalg.svd((b - centre_b).T @ (a - centre_a))
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U) * np.linalg.det(Vt)]) @ Vt
    return R, centre_b - R @ centre_a


def match_geometry(
    test_points: ArrayLike,
    mesh_points: ArrayLike,
    tolerance: float,
    axes: str = "any",
    labels: Mapping[int, int] | None = None,
    unit: str | None = None,
    alternative: int | None = None,
) -> GeometryMatch:
    """Place test points on the points of a mesh.

    *Units*: metres, unless the size of the test does not fit the mesh and that in another unit does; this is
    warned of. *Axes*: for any axes three test points that span much are laid on all triangles of mesh points
    with the same sides, each placement is improved by matching nearest points and :func:`align_points` in
    turns (Besl and McKay, IEEE Trans. PAMI 14, 1992, 239-256), and the one with most pairs, then least
    distances, is taken. This is exhaustive, unlike ICP from a few starts, for test points within the
    tolerance of mesh points. Reflections are not tried.

    Parameters
    ----------
    test_points : array_like (n_test, 3)
        In any unit of ``SCALES``.
    mesh_points : array_like (n_mesh, 3)
        [m]; leave out those where no sensor can be, as they only make ambiguity.
    tolerance : float
        Largest distance of a pair [m].
    axes : str
        ``"same"``: the test has the mesh's axes and origin. ``"any"``: both are unknown.
    labels : mapping of int to int, optional
        Mesh points of some test points: three that are not on a line settle the axes, fewer choose among
        alternatives.
    unit : str, optional
        Unit of the test's coordinates; found unless given.
    alternative : int, optional
        Which of the alternatives that an earlier call named is right.

    Raises
    ------
    GeometryMatchError
        If nothing fits, or several placements are as good: a symmetric structure. It names them.
    ValueError
        If arguments are not as told.
    """
    test, mesh = _points("test", test_points), _points("mesh", mesh_points)
    labels = dict(labels or {})
    _check_options(tolerance, axes)
    for i, j in labels.items():
        if not (0 <= i < len(test) and 0 <= j < len(mesh)):
            msg = f"label {i} → {j} is not among {len(test)} test and {len(mesh)} mesh points, counted from 0"
            raise ValueError(msg)
    scale = _scale(test, mesh, unit)
    scaled = scale * test
    tree = scipy.spatial.cKDTree(mesh)
    if axes == "same":
        return _finish(test, mesh, tree, tolerance, scale, np.eye(3), np.zeros(3), labels)
    if len(labels) >= 3 and _spread(scaled[list(labels)]) > _COLLINEAR:
        R, t = align_points(scaled[list(labels)], mesh[list(labels.values())])
        off = np.linalg.norm(scaled[list(labels)] @ R.T + t - mesh[list(labels.values())], axis=1)
        if off.max() > tolerance:
            worst = list(labels)[int(np.argmax(off))]
            msg = (
                f"labelled test point {worst} lies {off.max():.3g} m from mesh point {labels[worst]} after "
                f"the best rotation; the tolerance is {tolerance:g} m"
            )
            raise GeometryMatchError(msg)
        return _finish(test, mesh, tree, tolerance, scale, R, t, labels)
    if _spread(scaled) <= _COLLINEAR:
        msg = (
            f"the {len(test)} test points lie on a line or are fewer than three, so the turn about it cannot "
            "be found; give axes='same' or points off the line"
        )
        raise GeometryMatchError(msg)
    found = _search(test, scaled, mesh, tree, tolerance, scale, labels)
    return _chosen(found, tolerance, alternative, len(test))


def match_members(
    test_points: ArrayLike,
    mesh: Mesh,
    tolerance: float,
    axes: str = "any",
    unit: str | None = None,
    alternative: int | None = None,
) -> tuple[GeometryMatch, Mesh]:
    """Place test points anywhere on the members of a mesh, and put points of the mesh there.

    Three test points are laid on all triangles of points along the members, as in :func:`match_geometry`.
    Each placement is improved with the nearest places on the members' lines and :func:`align_points` in
    turns. Placements are counted by points within the tolerance of a line.

    Parameters
    ----------
    test_points : array_like (n_test, 3)
        In any unit of ``SCALES``.
    mesh : Mesh
    tolerance : float
        Largest distance of a test point from a member's line [m].
    axes, unit, alternative
        As in :func:`match_geometry`.

    Returns
    -------
    GeometryMatch
        Its pairs have the points of the returned mesh.
    Mesh
        The mesh with a point where each test point is; the points that it had keep their indices.

    Raises
    ------
    GeometryMatchError
        If nothing fits, or several placements are as good.
    ValueError
        If arguments are not as told.
    """
    test = _points("test", test_points)
    _check_options(tolerance, axes)
    scale = _scale(test, mesh.points[np.unique(mesh.lines)], unit)
    scaled = scale * test
    ends = _straight(mesh)
    if axes == "same":
        best = _on_members(scaled, ends, tolerance, scale, np.eye(3), np.zeros(3))
    elif _spread(scaled) <= _COLLINEAR:
        msg = (
            f"the {len(test)} test points lie on a line or are fewer than three, so the turn about it "
            "cannot be found; give axes='same' or points off the line"
        )
        raise GeometryMatchError(msg)
    else:
        coarse, spacing = _along(mesh)
        wide = tolerance + spacing / 2
        found: Placed = []
        for k, base in enumerate(_bases(scaled), 1):
            try:
                corners = coarse[_triangles(scaled[base], coarse, 2 * wide)]
            except GeometryMatchError:
                if not found:
                    raise
                continue
            R, t = _aligned(scaled[base], corners, np.ones(corners.shape[:2], dtype=bool))
            found = _distinct(found + _polished(scaled, ends, R, t, tolerance, scale), tolerance)
            # No base shares a point with another, so a placement that none has found misses a point of each.
            if found and len(found[0].pairs) > len(test) - k:
                break
        best = _chosen(found, tolerance, alternative, len(test))
    return put_on_members(best, mesh)


def put_on_members(match: GeometryMatch, mesh: Mesh) -> tuple[GeometryMatch, Mesh]:
    """Return a placement on members, such as an error's alternative, and the mesh with points there.

    Both are as :func:`match_members` returns them.
    """
    pairs = match.pairs.copy()
    for k, i in enumerate(match.pairs[:, 0]):
        member, position, _ = mesh.nearest_on_members(match.points[i])
        place = mesh.point_at(mesh.locate(member, position))
        if mesh.nearest_point(place)[1] > _DIGITS * mesh.size:
            mesh = mesh.with_point_on(member, position)
        pairs[k, 1] = mesh.nearest_point(place)[0]
    return replace(match, pairs=pairs), mesh


def _check_options(tolerance: float, axes: str) -> None:
    if not tolerance > 0:
        msg = f"the tolerance is {tolerance:g} m; it must be positive"
        raise ValueError(msg)
    if axes not in ("same", "any"):
        msg = f"the axes are '{axes}'; allowed are same, any"
        raise ValueError(msg)


def _along(mesh: Mesh) -> tuple[Floats, float]:
    """Return points along all members, few enough to be searched, and the largest distance of neighbours."""
    lengths = {name: mesh.member_length(name) for name in mesh.members}
    spacing = sum(lengths.values()) / max(_MOST_POINTS - 2 * len(lengths), len(lengths))
    out: list[Floats] = []
    for name, length in lengths.items():
        for position in np.linspace(0, length, int(np.ceil(length / spacing)) + 1):
            out.append(np.asarray(mesh.point_at(mesh.locate(name, float(position)))))
    points = np.array(out)
    keep = [k for k, p in enumerate(points) if not (np.linalg.norm(points[:k] - p, axis=1) < 1e-9).any()]
    return points[keep], spacing


def _straight(mesh: Mesh) -> Floats:
    """Return the ends (n, 2, 3) of straight pieces of the members: lines that go on straight are one."""
    out: list[list[Floats]] = []
    for lines in mesh.members.values():
        last = -1
        for a, b in mesh.lines[np.asarray(lines, dtype=np.int64)].tolist():
            start, stop = mesh.points[a], mesh.points[b]
            if a == last:
                before, now = out[-1][1] - out[-1][0], stop - start
                if np.linalg.norm(np.cross(before, now)) <= 1e-9 * np.linalg.norm(before) * np.linalg.norm(
                    now
                ) and (before @ now > 0):
                    out[-1][1], last = stop, b
                    continue
            out.append([start, stop])
            last = b
    return np.array(out)


def _project(points: Floats, ends: Floats) -> tuple[Floats, Floats]:
    """Return the nearest places (n, 3) on lines with ends (n_lines, 2, 3), and the distances (n,)."""
    if len(points) * len(ends) > _MOST_DISTANCES and len(points) > 1:
        parts = np.array_split(points, -(-len(points) * len(ends) // _MOST_DISTANCES))
        found = [_project(part, ends) for part in parts if len(part)]
        return np.concatenate([f[0] for f in found]), np.concatenate([f[1] for f in found])
    a, t = ends[:, 0], ends[:, 1] - ends[:, 0]
    tt, along = np.einsum("lj,lj->l", t, t), points @ t.T - np.einsum("lj,lj->l", a, t)
    xi = np.clip(along / tt, 0.0, 1.0)
    # squares without those of the points, which all lines have in common: no array of all places is needed
    square = np.einsum("lj,lj->l", a, a) - 2 * points @ a.T + xi * (xi * tt - 2 * along)
    near = np.argmin(square, axis=1)
    places = a[near] + xi[np.arange(len(points)), near][:, None] * t[near]
    return places, np.linalg.norm(places - points, axis=1)


def _on_members(
    scaled: Floats, ends: Floats, tolerance: float, scale: float, R: Floats, t: Floats
) -> GeometryMatch:
    """Return a placement, with pairs of test points and themselves."""
    placed = scaled @ R.T + t
    _, distance = _project(placed, ends)
    near = np.flatnonzero(distance <= tolerance)
    far = np.flatnonzero(distance > tolerance)
    return GeometryMatch(
        np.column_stack([near, near]), distance[near], scale, R, t, tuple(far.tolist()), placed
    )


def _polished(scaled: Floats, ends: Floats, R: Floats, t: Floats, tolerance: float, scale: float) -> Placed:
    """Move placements R (k, 3, 3), t (k, 3) until points are nearest to the lines; return the best ones.

    These have most pairs, and the same ones that come out count once, those of least distances first.
    """
    if not len(R):
        return []
    R, t = R.copy(), t.copy()
    placed = scaled @ R.transpose(0, 2, 1) + t[:, None]
    moving, alive = np.arange(len(R)), np.ones(len(R), dtype=bool)
    for step in range(100):  # all at once: there may be thousands
        # placements that have come within the tolerance of one another go on as one
        if step in (3, 8, 20, 50):
            cells = np.round(placed[moving] / tolerance).reshape(len(moving), -1).astype(np.int64)
            alive[moving] = False
            moving = moving[np.unique(cells, axis=0, return_index=True)[1]]
            alive[moving] = True
        places, distance = _project(placed[moving].reshape(-1, 3), ends)
        places, distance = places.reshape(-1, *scaled.shape), distance.reshape(-1, len(scaled))
        kept = distance <= np.maximum(tolerance, 3 * np.median(distance, axis=1))[:, None]
        enough = kept.sum(axis=1) >= 3
        moving, places, kept = moving[enough], places[enough], kept[enough]
        if not moving.size:
            break
        R[moving], t[moving] = _aligned(scaled, places, kept)
        moved = scaled @ R[moving].transpose(0, 2, 1) + t[moving, None]
        done = np.abs(moved - placed[moving]).max(axis=(1, 2)) < 1e-4 * tolerance
        placed[moving] = moved
        moving = moving[~done]
        if not moving.size:
            break
    R, t, placed = R[alive], t[alive], placed[alive]
    near = _project(placed.reshape(-1, 3), ends)[1].reshape(len(R), -1) <= tolerance
    n_pairs = near.sum(axis=1)
    if n_pairs.max() < 3:
        return []
    out = [
        _on_members(scaled, ends, tolerance, scale, R[k], t[k])
        for k in np.flatnonzero(n_pairs == n_pairs.max())
    ]
    return _distinct(out, tolerance)


def _distinct(found: Placed, tolerance: float) -> Placed:
    """Return placements with most pairs first, then least distances, each of them once."""
    out: Placed = []
    for match in sorted(found, key=lambda m: (-len(m.pairs), m.rms)):
        if out:
            apart = np.linalg.norm(match.points - np.stack([m.points for m in out]), axis=2).max(axis=1)
            if (apart < tolerance).any():
                continue
        out.append(match)
    return out


def _aligned(points: Floats, onto: Floats, kept: Bools) -> tuple[Floats, Floats]:
    """Return what :func:`align_points` returns for each of many targets (k, n, 3), of the kept points."""
    weight = kept / kept.sum(axis=1, keepdims=True)
    a, b = weight @ points, np.einsum("kn,kni->ki", weight, onto)
    U, _, Vt = np.linalg.svd(
        np.einsum("kn,kni,knj->kij", weight, onto - b[:, None], points - a[:, None], optimize=True)
    )
    U[:, :, 2] *= (np.linalg.det(U) * np.linalg.det(Vt))[:, None]
    R = U @ Vt
    return R, b - np.einsum("kij,kj->ki", R, a)


def _chosen(
    found: list[GeometryMatch], tolerance: float, alternative: int | None, n_test: int
) -> GeometryMatch:
    if not found:
        msg = (
            f"no placement brings more than two of the {n_test} test points within {tolerance:g} m of mesh "
            "points; look at units, tolerance, and whether the mesh has points where the test has"
        )
        raise GeometryMatchError(msg)
    best = found[0]
    # Alternatives whose root mean square distance is below this times the best one's are as good as it
    limit = 2.0 * max(best.rms, tolerance / 10)
    alike = [m for m in found if len(m.pairs) == len(best.pairs) and m.rms <= limit]
    same = tuple(sorted(alike, key=_uprightness))
    if alternative is not None:
        if not 0 <= alternative < len(same):
            msg = f"alternative {alternative} is asked for; there are {len(same)}, counted from 0"
            raise ValueError(msg)
        return same[alternative]
    if len(same) > 1:
        lines = [f"{k}: {m.describe()}" for k, m in enumerate(same[:8])]
        more = f"\n  and {len(same) - 8} more" if len(same) > 8 else ""
        msg = (
            f"the test points fit the mesh in {len(same)} ways, as a symmetric or regular structure's do; "
            "give labels of a few points, axes='same' (--same-axes), or the right one, alternative=K "
            "(--alternative K):\n  " + "\n  ".join(lines) + more
        )
        raise GeometryMatchError(msg, same)
    return best


def _uprightness(match: GeometryMatch) -> tuple[float, float, float]:
    """Return by what angles a placement tilts the vertical and turns [degrees], and how far it moves [m].

    Tests are mostly drawn with z upwards, as models are, and often in the model's axes.
    """
    tilt = float(np.rad2deg(np.arccos(np.clip(match.R[2, 2], -1.0, 1.0))))
    return round(tilt, 1), round(match.turn[0], 1), float(np.linalg.norm(match.translation))


def _points(word: str, points: ArrayLike) -> Floats:
    p = np.array(points, dtype=float)
    if p.ndim != 2 or p.shape[1] != 3 or not len(p) or not np.isfinite(p).all():
        msg = f"the {word} points have shape {p.shape}; finite numbers (n, 3) are expected"
        raise ValueError(msg)
    return p


def _size(points: Floats) -> float:
    """Return the largest distance of two points; of many points a lower bound that is near it."""
    if len(points) <= 500:
        return float(np.linalg.norm(points[:, None] - points[None], axis=2).max())
    at, size = points.mean(axis=0), 0.0
    for _ in range(4):
        distance = np.linalg.norm(points - at, axis=1)
        at, size = points[np.argmax(distance)], float(distance.max())
    return size


def _spread(points: Floats) -> float:
    """Return the second singular value over the first: 0 for points on a line."""
    if len(points) < 3:
        return 0.0
    s = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(s[1] / s[0]) if s[0] > 0 else 0.0


def _scale(test: Floats, mesh: Floats, unit: str | None) -> float:
    if unit is not None:
        if unit not in SCALES:
            msg = f"the unit is '{unit}'; allowed are {', '.join(SCALES)}"
            raise ValueError(msg)
        return SCALES[unit]
    if len(test) < 2:
        return 1.0
    ratio = _size(test) / _size(mesh)
    if PLAUSIBLE[0] <= ratio <= PLAUSIBLE[1]:
        return 1.0
    fits = [u for u, s in SCALES.items() if FITTING[0] <= s * ratio <= FITTING[1]]
    if not fits and ratio <= PLAUSIBLE[1]:
        return 1.0  # a test of a small part
    if len(fits) != 1:
        what = f"would fit in {' or '.join(fits)}" if fits else "fits in no unit"
        msg = (
            f"the test points are {ratio:.3g} times as large as the mesh, which {what}; give the unit, one "
            f"of {', '.join(SCALES)}"
        )
        raise GeometryMatchError(msg)
    warnings.warn(
        f"the test points are {ratio:.3g} times as large as the mesh: their coordinates look like {fits[0]} "
        f"and are multiplied by {SCALES[fits[0]]:g}; give unit='{fits[0]}' to say so, or unit='m' if not",
        stacklevel=3,
    )
    return SCALES[fits[0]]


def _assign(
    points: Floats, mesh: Floats, tree: "scipy.spatial.cKDTree", tolerance: float
) -> tuple[Ints, Floats]:
    """Return mesh points of test points (-1 for none), each once, and the distances; most pairs first."""
    distance, nearest = tree.query(points, distance_upper_bound=tolerance)
    near = np.isfinite(distance)
    mine = nearest[near]
    if len(set(mine.tolist())) == len(mine):
        return np.where(near, nearest, -1).astype(np.int64), distance
    rows = np.flatnonzero(near)
    columns = np.unique(np.concatenate(tree.query_ball_point(points[rows], tolerance)).astype(np.int64))
    d = np.linalg.norm(points[rows][:, None] - mesh[columns][None], axis=2)
    cost = np.where(d <= tolerance, d, 1e3 * tolerance * len(rows))
    index, distance = np.full(len(points), -1, dtype=np.int64), np.full(len(points), np.inf)
    for a, b in zip(*scipy.optimize.linear_sum_assignment(cost), strict=True):
        if d[a, b] <= tolerance:
            index[rows[a]], distance[rows[a]] = columns[b], d[a, b]
    return index, distance


def _finish(
    test: Floats,
    mesh: Floats,
    tree: "scipy.spatial.cKDTree",
    tolerance: float,
    scale: float,
    R: Floats,
    t: Floats,
    labels: Mapping[int, int],
) -> GeometryMatch:
    placed = scale * test @ R.T + t
    index, distance = _assign(placed, mesh, tree, tolerance)
    for i, j in labels.items():
        if index[i] != j:
            index[index == j] = -1
            index[i], distance[i] = j, np.linalg.norm(placed[i] - mesh[j])
    rows = np.flatnonzero(index >= 0)
    return GeometryMatch(
        np.column_stack([rows, index[rows]]),
        distance[rows],
        scale,
        R,
        t,
        tuple(int(i) for i in np.flatnonzero(index < 0)),
        placed,
    )


def _search(
    test: Floats,
    scaled: Floats,
    mesh: Floats,
    tree: "scipy.spatial.cKDTree",
    tolerance: float,
    scale: float,
    labels: Mapping[int, int],
) -> list[GeometryMatch]:
    """Return placements with at least three pairs, most pairs first, then least distances."""
    found: dict[bytes, GeometryMatch] = {}
    for base in _bases(scaled):
        for corners in _triangles(scaled[base], mesh, 2 * tolerance):
            R, t = align_points(scaled[base], mesh[corners])
            index, distance = _assign(scaled @ R.T + t, mesh, tree, 2 * tolerance)
            for _ in range(20):
                rows = np.flatnonzero(index >= 0)
                if rows.size < 3:
                    break
                R, t = align_points(scaled[rows], mesh[index[rows]])
                again, distance = _assign(scaled @ R.T + t, mesh, tree, tolerance)
                if np.array_equal(again, index):
                    break
                index = again
            kept = index[np.isfinite(distance) & (index >= 0)]
            if kept.size < 3 or any(index[i] != j for i, j in labels.items()):
                continue
            key = index.tobytes()
            if key not in found:
                found[key] = _finish(test, mesh, tree, tolerance, scale, R, t, labels)
        best = max((len(m.pairs) for m in found.values()), default=0)
        if best == len(test):
            break
    return sorted(found.values(), key=lambda m: (-len(m.pairs), m.rms))


def _bases(points: Floats) -> list[Ints]:
    """Return a few triples of points that span much and share as little as possible."""
    n = len(points)
    remaining = list(range(n))
    bases = []
    while len(remaining) >= 3 and len(bases) < 4:
        part = points[remaining]
        far = part - part.mean(axis=0)
        a = int(np.argmax(np.linalg.norm(far, axis=1)))
        b = int(np.argmax(np.linalg.norm(part - part[a], axis=1)))
        line = part[b] - part[a]
        area = np.linalg.norm(np.cross(part - part[a], line), axis=1)
        c = int(np.argmax(area))
        if area[c] <= _COLLINEAR * float(line @ line):
            break
        bases.append(np.array([remaining[a], remaining[b], remaining[c]], dtype=np.int64))
        remaining = [k for i, k in enumerate(remaining) if i not in (a, b, c)]
    if not bases:  # the first point, and whatever spans most with it
        line = points - points[0]
        b = int(np.argmax(np.linalg.norm(line, axis=1)))
        c = int(np.argmax(np.linalg.norm(np.cross(line, line[b]), axis=1)))
        bases.append(np.array([0, b, c], dtype=np.int64))
    return bases


def _triangles(corners: Floats, mesh: Floats, tolerance: float) -> Ints:
    """Return the mesh points (k, 3) that lie to one another as the corners do, the nearest in shape first."""
    d = np.linalg.norm(mesh[:, None] - mesh[None], axis=2)
    ab, bc, ca = (float(np.linalg.norm(corners[i] - corners[(i + 1) % 3])) for i in range(3))
    near_ab, near_bc, near_ca = (np.abs(d - side) <= tolerance for side in (ab, bc, ca))
    places, errors = [], []
    for a, b in np.argwhere(near_ab):
        third = np.flatnonzero(near_bc[b] & near_ca[a])
        third = third[(third != a) & (third != b)]
        for c in third if a != b else ():
            places.append((a, b, c))
            errors.append(abs(d[a, b] - ab) + abs(d[b, c] - bc) + abs(d[c, a] - ca))
    # Placements of three points that are tried for each base
    if len(places) > 20_000:
        msg = (
            f"{len(places)} triangles of mesh points are similar within {tolerance / 2:g} m; give fewer mesh "
            "points, a smaller tolerance, labels of three points or axes='same'"
        )
        raise GeometryMatchError(msg)
    order = np.argsort(errors, kind="stable")
    return np.array(places, dtype=np.int64).reshape(-1, 3)[order]
