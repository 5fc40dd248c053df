"""Mode shapes in pictures: arrows, scales, phases, and the direction of view."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats, Ints
from viz.surfaces import Surface


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


def arrow_triangles(pointers: Arrows, radius: float, turns: int = 14) -> tuple[Floats, Ints, Ints]:
    """Return the surfaces of arrows: a round shaft with a cone at its tip.

    Parameters
    ----------
    pointers : Arrows
        Those without length are left out.
    radius : float
        Of the shafts [m].
    turns : int
        Number of corners of the round.

    Returns
    -------
    vertices : ndarray (n, 3)
        [m].
    triangles : ndarray of int (n_triangles, 3)
    arrow : ndarray of int (n_triangles,)
        Index of the arrow that each triangle belongs to.
    """
    phi = 2 * np.pi * np.arange(turns) / turns
    a = np.arange(turns)
    b = (a + 1) % turns
    vertices, triangles, arrow = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)], []
    start = 0
    for n, (tail, tip) in enumerate(zip(pointers.tail, pointers.tip, strict=True)):
        length = float(np.linalg.norm(tip - tail))
        if length == 0:
            continue
        x = (tip - tail) / length
        y = np.cross(x, np.eye(3)[int(np.argmin(np.abs(x)))])
        y /= np.linalg.norm(y)
        circle = np.cos(phi)[:, None] * y + np.sin(phi)[:, None] * np.cross(x, y)
        head = min(0.45 * length, 5 * radius)
        neck = length - head
        rings = ((0.0, 0.0), (0.0, radius), (neck, radius), (neck, 2.3 * radius), (length, 0.0))
        vertices.append(np.vstack([tail + s * x + r * circle for s, r in rings]))
        for k in range(len(rings) - 1):
            p, q = start + turns * k, start + turns * (k + 1)
            triangles += [np.stack([p + a, p + b, q + b], axis=1), np.stack([p + a, q + b, q + a], axis=1)]
        arrow += [n] * (2 * turns * (len(rings) - 1))
        start += turns * len(rings)
    return np.vstack(vertices), np.vstack(triangles), np.array(arrow, dtype=np.int64)


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
    """Group vectors that are components of one motion: at one place and at right angles.

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


def real_shape(shape: ArrayLike) -> Floats:
    """Return a complex shape at the phase at which most of it moves; a real one as it is.

    The phase maximises Σ Re(φ e^{-iα})², α = ½ arg Σ φ².
    """
    phi = np.asarray(shape)
    if not np.iscomplexobj(phi):
        return phi.astype(float)
    alpha = 0.5 * np.angle((phi**2).sum())
    return np.ascontiguousarray((phi * np.exp(-1j * alpha)).real)


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
