"""Text and markers over a picture, drawn by matplotlib: labels, marks, colour bars and the triad of axes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.markers import MarkerStyle
from matplotlib.patheffects import withStroke
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Bools, Floats
from viz import style
from viz.layout import place_labels
from viz.shapes import Arrows
from viz.stage import View


class Mark(NamedTuple):
    """A mark at a place.

    Attributes
    ----------
    place : ndarray (3,)
        [m].
    shape : str
        A marker of matplotlib, or ``"ring"`` for an open circle.
    colour : str
    size : float
        [pt].
    axes : ndarray (3, 3), optional
        The mark is turned as these axes, rows in global components, are from the global ones.
    """

    place: Floats
    shape: str
    colour: str
    size: float
    axes: Floats | None = None

    def turn(self, view: View) -> float:
        """Return the angle by which it is turned in the picture, anticlockwise [rad]."""
        if self.axes is None:
            return 0.0
        x, y = view.axes[:2] @ (self.axes.T @ view.axes[1])
        # Part of a direction that must lie in the picture's plane to be recognised [-]
        return float(np.arctan2(-x, y)) if np.hypot(x, y) > 0.1 else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """A name at a place."""

    point: Floats
    text: str
    colour: str
    size: float
    bold: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Bar:
    """A colour bar."""

    cmap: Colormap
    norm: Normalize
    label: str

    def colours(self, values: ArrayLike) -> Floats:
        """Return the colours of values, RGB from 0 to 1, shape (…, 3)."""
        return np.asarray(self.cmap(self.norm(np.asarray(values, dtype=float))))[..., :3]


def draw_comparison(ax: Any, view: View, measured: Arrows, computed: Floats, dpi: int) -> None:
    """Draw measured arrows, and rings where the model puts their tips."""
    ends = view.project(computed)
    ax.plot(
        *ends.T,
        "o",
        markersize=4.5,
        markerfacecolor="white",
        markeredgecolor=style.INK,
        markeredgewidth=0.8,
    )
    for tail, tip in zip(view.project(measured.tail), view.project(measured.tip), strict=True):
        ax.plot(*tail, "o", markersize=1.8, color=style.EXCITATION)
        if np.linalg.norm(tip - tail) < 0.02 * dpi:
            continue
        head = float(np.clip(72 / dpi * np.linalg.norm(tip - tail) / 2, 2.5, 7))
        for colour, width, arrow in (("white", 2.6, "-"), (style.EXCITATION, 1.4, "-|>")):
            look = {"arrowstyle": arrow, "color": colour, "lw": width, "mutation_scale": head}
            ax.annotate("", xy=tip, xytext=tail, arrowprops={**look, "shrinkA": 0, "shrinkB": 0})


def draw_marks(ax: Any, view: View, marks: Sequence[Mark], dpi: int) -> None:
    """Draw markers, unlike ones at one place next to each other, and rings."""
    drawn: list[tuple[float, float, str]] = []
    for mark in marks:
        place, shape, colour, size, _ = mark
        x, y = (float(v) for v in view.project(place)[0])
        if shape == "ring":
            for edge, width in (("white", 3.4), (colour, 1.8)):
                look = {"markeredgecolor": edge, "markeredgewidth": width}
                ax.plot(x, y, "o", markersize=size, markerfacecolor="none", **look)
            continue
        step = size * dpi / 72
        turn = mark.turn(view)
        if shape in "^v":  # the tip of a support is at its point
            x, y = x + step / 2 * np.sin(turn), y + step / 2 * np.cos(turn)
        look = shape + colour
        others = [(u, v) for u, v, other in drawn if other != look]  # one that is alike may be covered
        while any(abs(x - u) < 0.8 * step and abs(y - v) < 0.8 * step for u, v in others):
            x += step
        drawn.append((x, y, look))
        if turn:  # a triangle alone would look alike after a third of a turn
            across, down = np.array([np.cos(turn), -np.sin(turn)]), np.array([np.sin(turn), np.cos(turn)])
            ground = np.array([x, y]) + 0.62 * step * down + np.outer([-0.8, 0.8], step * across)
            ax.plot(*ground.T, color=colour, linewidth=1.3, solid_capstyle="butt")
        form = MarkerStyle(shape).rotated(rad=turn)
        edge = {"markeredgecolor": "white", "markeredgewidth": 0.7}
        ax.plot(x, y, marker=form, color=colour, markersize=size, **edge)


def draw_triad(ax: Any, view: View, dpi: int) -> tuple[float, float, float, float]:
    """Draw the global axes in the lower left corner; return the box that they take, in pixels."""
    length = 0.26 * dpi
    ends = {k: length * np.array([view.axes[0, k], -view.axes[1, k]]) for k in range(3)}
    reach = np.array(list(ends.values()))
    pad = 0.16 * dpi
    x0 = pad - min(reach[:, 0].min(), 0)
    y0 = view.pixels[1] - pad - max(reach[:, 1].max(), 0)
    for k, end in ends.items():
        ax.annotate(
            "",
            xy=(x0 + end[0], y0 + end[1]),
            xytext=(x0, y0),
            arrowprops={
                "arrowstyle": "-|>",
                "color": style.INK,
                "lw": 0.9,
                "mutation_scale": 6,
                "shrinkA": 0,
                "shrinkB": 0,
            },
        )
        far = end * (1 + 0.1 * dpi / max(float(np.linalg.norm(end)), 1.0))
        ax.text(x0 + far[0], y0 + far[1], "xyz"[k], fontsize=7.5, style="italic", ha="center", va="center")
    low, high = reach.min(axis=0), reach.max(axis=0)
    return (
        x0 + min(low[0], 0) - pad,
        y0 + min(low[1], 0) - pad,
        x0 + max(high[0], 0) + pad,
        float(view.pixels[1]),
    )


def occupied_pixels(picture: NDArray[np.uint8], view: View, marks: Sequence[Mark], dpi: int) -> Bools:
    """Return the pixels of a picture that labels must not cover: of the structure and of markers."""
    occupied = np.asarray(np.min(picture, axis=2) < 245)
    for mark in marks:
        x, y = view.project(mark.place)[0]
        r = mark.size * dpi / 72 / 2
        occupied[max(int(y - r), 0) : int(y + 2 * r), max(int(x - r), 0) : int(x + r)] = True
    return occupied


def draw_labels(
    ax: Any,
    canvas: FigureCanvasAgg,
    view: View,
    labels: Sequence[Label],
    occupied: Bools,
    taken: list[tuple[float, float, float, float]],
    dpi: int,
) -> None:
    """Draw names beside their places where pixels are free, with leaders; others are left out."""
    renderer = canvas.get_renderer()
    anchors = view.project(np.array([label.point for label in labels]))
    texts = [
        ax.text(
            *anchor,
            label.text,
            fontsize=label.size,
            color=label.colour,
            ha="center",
            va="center",
            weight="bold" if label.bold else "normal",
            path_effects=[withStroke(linewidth=1.8, foreground="white", alpha=0.85)],
        )
        for anchor, label in zip(anchors, labels, strict=True)
    ]
    boxes = [text.get_window_extent(renderer) for text in texts]
    sizes = np.array([[box.width + 3, box.height + 1] for box in boxes])
    spots = place_labels(anchors, sizes, occupied, taken)
    for text, anchor, centre, box, shown in zip(
        texts, anchors, spots.centre, boxes, spots.shown, strict=True
    ):
        text.set_visible(bool(shown))
        text.set_position((float(centre[0]), float(centre[1])))
        if not shown:
            continue
        half = np.array([box.width, box.height]) / 2
        near = np.clip(anchor, centre - half, centre + half)
        if np.linalg.norm(near - anchor) > 0.09 * dpi:
            ax.plot(
                *zip(near, anchor, strict=True),
                color=text.get_color(),
                linewidth=0.5,
                alpha=0.6,
                zorder=1,
            )


def draw_bars(
    figure: Figure, bars: Sequence[Bar], left: float, bottom: float, height: float, share: float
) -> None:
    """Draw colour bars beside the picture, each in a share of the figure's width."""
    for k, bar in enumerate(bars):
        cax = figure.add_axes(
            (left + (k + 0.16) * share, bottom + 0.12 * height, 0.16 * share, 0.76 * height)
        )
        scale = figure.colorbar(ScalarMappable(bar.norm, bar.cmap), cax=cax)
        scale.set_label(bar.label, fontsize=8)
        scale.outline.set_linewidth(0.5)
        cax.tick_params(labelsize=7.5)


def arrow_key(colour: str, label: str) -> Line2D:
    """Return the legend's key of arrows."""
    return Line2D([], [], color=colour, linewidth=1.6, marker=">", markevery=[1], markersize=4.5, label=label)


def blend(page: NDArray[np.uint8], overlay: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a page under a transparent overlay."""
    alpha = overlay[..., 3:].astype(np.float32) / 255
    return (page * (1 - alpha) + overlay[..., :3] * alpha + 0.5).astype(np.uint8)
