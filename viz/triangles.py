"""Outlines of sections, and their division into triangles."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fem.array_types import Floats, Ints

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
