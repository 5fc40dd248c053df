"""Places of labels in a picture: beside their objects, clear of each other and of the structure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Bools, Floats


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Places of labels.

    Attributes
    ----------
    centre : ndarray (n, 2)
        Centres of the labels [pixel].
    shown : ndarray of bool (n,)
        False for a label for which there was no room.
    """

    centre: Floats
    shown: Bools


def place_labels(
    anchors: ArrayLike,
    sizes: ArrayLike,
    occupied: Bools,
    taken: Sequence[tuple[float, float, float, float]] = (),
) -> Placement:
    """Place labels around their anchors, one after the other, the first being the most important.

    Every label tries places on rings around its anchor and takes the one with the least overlap
    and the shortest way to its anchor; it never overlaps another label. One that finds no such place
    is not shown.

    Parameters
    ----------
    anchors : array_like (n, 2)
        Points to be named [pixel], from the top left corner.
    sizes : array_like (n, 2)
        Widths and heights of the labels [pixel].
    occupied : ndarray of bool (height, width)
        True where the picture already shows something.
    taken : sequence of (left, top, right, bottom)
        Rectangles that must stay free [pixel].
    """
    anchors, sizes = np.array(anchors, float).reshape(-1, 2), np.array(sizes, float).reshape(-1, 2)
    height, width = occupied.shape
    total = np.zeros((height + 1, width + 1))
    total[1:, 1:] = np.cumsum(np.cumsum(occupied, axis=0), axis=1)
    boxes = [tuple(map(float, box)) for box in taken]
    centre, shown = anchors.copy(), np.zeros(len(anchors), dtype=bool)
    angle = np.deg2rad([45, 135, 315, 225, 90, 270, 0, 180, 20, 160, 340, 200, 70, 110, 250, 290])
    rings = np.geomspace(0.45, 9.0, 14)  # radii in heights of the label
    for k, (anchor, (w, h)) in enumerate(zip(anchors, sizes, strict=True)):
        out = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
        gap = h * rings[:, None, None] * out
        half = np.array([w / 2, h / 2]) * np.clip(1.6 * out, -1, 1)
        places = (anchor + half + gap).reshape(-1, 2)
        box = np.array([w, h]) / 2
        low, high = places - box, places + box
        fits = (low >= 1).all(axis=1) & (high[:, 0] < width - 1) & (high[:, 1] < height - 1)
        for left, top, right, bottom in boxes:
            fits &= (high[:, 0] < left) | (low[:, 0] > right) | (high[:, 1] < top) | (low[:, 1] > bottom)
        near = np.abs(anchors[None] - places[:, None])
        covers_anchor = (near <= [w / 2 + 2, h / 2 + 2]).all(axis=2).sum(axis=1)
        if not fits.any():
            continue
        x0, y0 = np.clip(low, 0, [width, height]).astype(int).T
        x1, y1 = np.clip(high, 0, [width, height]).astype(int).T
        covered = (total[y1, x1] - total[y0, x1] - total[y1, x0] + total[y0, x0]) / (w * h)
        cost = 9 * covered + 3 * covers_anchor + np.repeat(rings, len(angle)) / 2
        cost[~fits] = np.inf
        best = int(np.argmin(cost))
        centre[k], shown[k] = places[best], True
        boxes.append((*(low[best] - 2), *(high[best] + 2)))
    return Placement(centre, shown)


def merge_names(names: Sequence[str], points: ArrayLike, tolerance: float) -> list[tuple[str, int]]:
    """Return one label for each place, merging ``P1x`` and ``P1y`` at one place into ``P1x,y``.

    Returns
    -------
    list of (label, index)
        With the index of the first name at the place.
    """
    points = np.array(points, dtype=float).reshape(-1, 3)
    places: dict[int, list[int]] = {}
    for k, point in enumerate(points):
        near = [first for first in places if np.linalg.norm(points[first] - point) <= tolerance]
        places.setdefault(near[0] if near else k, []).append(k)
    out = []
    for first, rows in places.items():
        words = [names[r] for r in rows]
        stem = words[0] if len(words) > 1 else ""
        while not all(word.startswith(stem) for word in words):
            stem = stem[:-1]
        ends = sorted(word.removeprefix(stem) for word in words)
        whole = stem[-1:].isdigit() and any(end[:1].isdigit() for end in ends)  # P1x and P10x
        if stem and all(ends) and not whole:
            out.append((stem + ",".join(ends), first))
        else:
            out.append((", ".join(words), first))
    return out


def shorten(text: str, length: int) -> str:
    """Return a text cut to a length with an ellipsis."""
    return text if len(text) <= length else text[: max(length - 1, 1)].rstrip() + "…"


def in_order(items: Mapping[str, str]) -> list[str]:
    """Return the distinct values of a mapping in the order in which they first occur."""
    return list(dict.fromkeys(items.values()))
