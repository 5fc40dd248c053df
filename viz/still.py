"""Descriptions of plane figures drawn by matplotlib."""

from collections.abc import Sequence
from dataclasses import replace
from functools import singledispatch
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from viz import style
from viz.axes import heat_map, legend_above
from viz.chart import Axis, Band, Chart, ChartMark, Curve, Matrix, Panel, RowBars, Rule, Span

POINT = 0.75
"""A pixel of an interactive figure in a still one [pt]."""


def draw(charts: Chart | Sequence[Chart], title: str = "") -> Figure:
    """Return a description as a matplotlib figure, or several of one kind in two columns under a title."""
    shown = [charts] if isinstance(charts, Chart) else list(charts)
    title = title or shown[0].title * isinstance(charts, Chart)
    across, parts = min(len(shown), 2), [1.0, *(panel.part for panel in shown[0].below)]
    deep, (width, height) = -(-len(shown) // across), shown[0].size
    keys: dict[str, Any] = {}
    with style.look():
        figure = style.new_figure(width, height * (deep if deep == 1 else 0.8 * deep) + 0.25 * bool(title))
        grid = figure.add_gridspec(len(parts) * deep, across, height_ratios=parts * deep)
        for k, chart in enumerate(shown):
            spans = [mark for mark in chart.marks if isinstance(mark, Span)]
            below = [replace(panel, marks=[*spans, *panel.marks]) for panel in chart.below]
            panels = [Panel(chart.marks, chart.y, 1.0), *below]
            row, column = divmod(k, across)
            axes = [figure.add_subplot(grid[len(parts) * row + n, column]) for n in range(len(panels))]
            for n, (ax, panel) in enumerate(zip(axes, panels, strict=True)):
                keys |= _draw_panel(ax, panel, chart.x)
                if n + 1 < len(panels) or k + across < len(shown):
                    ax.set_xlabel("")
                    ax.tick_params(labelbottom=n + 1 == len(panels))
                left = figure.axes[-1 - len(panels)] if column else None
                if left is not None and left.get_ylabel() == ax.get_ylabel():  # units may differ
                    ax.set_ylabel("")
                    ax.tick_params(labelleft=n == 0)
            if chart.title != title:
                axes[0].set_title(chart.title)
            if chart.equal:
                axes[0].set_aspect("equal", adjustable="datalim")
        areas = {
            name: key for name, key in keys.items() if isinstance(key, Patch | Collection)
        }  # last in the legend
        keys = {name: key for name, key in keys.items() if name not in areas} | areas
        if keys:
            legend_above(figure, title, list(keys.values()))
        elif title:
            figure.axes[0].set_title(title)
    return figure


def _draw_panel(ax: Axes, panel: Panel, x: Axis) -> dict[str, Any]:
    """Draw the marks of a panel, and return its keys of the legend by name."""
    marks, y = panel.marks, panel.y
    if y.decibels is not None:
        limits = y.limits and tuple(_amplitude(y.limits))
        y = replace(y, label=f"{y.label} [{y.decibels}]", limits=limits, log=True)
        marks = [mark.mapped(_amplitude) for mark in marks]
    _set(ax, "x", x)
    _set(ax, "y", y)
    drawn = [(mark, _draw(mark, ax)) for mark in marks]
    return {mark.name: key for mark, key in drawn if mark.name and mark.keyed}


def _amplitude(level: Any) -> Any:
    return 10 ** (np.asarray(level, dtype=float) / 20)


def _set(ax: Axes, which: Literal["x", "y"], axis: Axis) -> None:
    drawn = ax.xaxis if which == "x" else ax.yaxis
    ax.set(**{f"{which}label": axis.label, f"{which}scale": "log" if axis.log else "linear"})
    if axis.limits:
        ax.set(**{f"{which}lim": axis.limits})
    if axis.ticks:
        places, names = axis.ticks
        longest = max((len(line) for name in names for line in name.split("\n")), default=0)
        tilted = which == "x" and longest * len(names) > 0.13 * ax.figure.bbox.width
        look: dict[str, Any] = {"rotation": 40, "ha": "right", "rotation_mode": "anchor"} if tilted else {}
        drawn.set_ticks(list(places), list(names), fontsize=7.5 if len(names) <= 40 else 6, **look)
        ax.tick_params(which, length=0)
    ax.grid(visible=axis.grid, axis=which)


@singledispatch
def _draw(mark: ChartMark, ax: Axes) -> Any:
    """Draw a mark and return its key of the legend."""
    raise NotImplementedError(type(mark))


@_draw.register
def _(mark: Curve, ax: Axes) -> Any:
    at: dict[str, Any] = {
        "color": mark.colour,
        "label": mark.name if mark.keyed else "_",
        "markersize": 5.5,
        "alpha": mark.opacity,
    }
    at |= {"linestyle": mark.dash or "none", "linewidth": POINT * mark.width, "marker": mark.symbol or None}
    if mark.spread is not None:
        at |= {"elinewidth": 1, "capsize": 3}
        return ax.errorbar(np.asarray(mark.x), np.asarray(mark.y), np.asarray(mark.spread), **at)
    (line,) = ax.plot(mark.x, mark.y, drawstyle="steps-mid" if mark.treads else "default", **at)
    for x, y, text, above in zip(mark.x, mark.y, mark.text, mark.above, strict=False):  # pyright: ignore[reportArgumentType]
        _note(ax, text, (x, y), (0, 5 if above else -5), color=mark.colour, weight="bold")
    return line


@_draw.register
def _(mark: RowBars, ax: Axes) -> Any:
    ends = np.asarray(mark.x, dtype=float)
    look: dict[str, Any] = {"facecolor": mark.colour, "edgecolor": "white", "linewidth": 0}
    at, hatch = np.asarray(mark.y, dtype=float), 4 * mark.hatch or None
    ax.barh(at, ends - mark.base, mark.thickness, left=mark.base, hatch=hatch, **look)
    for y, x, text in zip(at, ends, mark.text, strict=False):
        _note(ax, text, (x, y), (-4 if x < mark.base else 4, 0))
    return Patch(hatch=hatch, label=mark.name, **look)


@_draw.register
def _(mark: Matrix, ax: Axes) -> Any:
    cells, norm = np.asarray(mark.cells, dtype=float), Normalize(*mark.limits)
    heat_map(ax, cells, mark.colours, norm, mark.label, mark.digits)


@_draw.register
def _(mark: Band, ax: Axes) -> Any:
    look: dict[str, Any] = {"color": mark.colour, "alpha": mark.opacity, "linewidth": 0, "label": mark.name}
    return ax.fill_between(mark.x, mark.low, mark.high, zorder=0.5, **look)  # pyright: ignore[reportArgumentType]


@_draw.register
def _(mark: Span, ax: Axes) -> Any:
    span = ax.axvspan if mark.along == "x" else ax.axhspan
    span(mark.low, mark.high, color=mark.colour, linewidth=0, zorder=0)
    return Patch(facecolor=mark.colour, edgecolor="#e6d9a8", linewidth=0.5, label=mark.name)


@_draw.register
def _(mark: Rule, ax: Axes) -> Any:
    upright = mark.along == "x"
    rule = ax.axvline if upright else ax.axhline
    rule(mark.value, color=mark.colour, linewidth=0.9, linestyle=mark.dash, zorder=1)
    if mark.text:
        of_axes = ax.get_xaxis_transform() if upright else ax.get_yaxis_transform()
        at = (mark.value, 1) if upright else (0, mark.value)
        _note(ax, mark.text, at, (0 if upright else 3, 3), xycoords=of_axes, color=mark.colour)


def _note(ax: Axes, text: str, at: tuple[float, float], off: tuple[float, float], **look: Any) -> None:
    """Write a text beside a point, off by so many points of print."""
    ha = "left" if off[0] > 0 else "right" if off[0] < 0 else "center"
    va = "bottom" if off[1] > 0 else "top" if off[1] < 0 else "center"
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.75}
    ax.annotate(
        text, at, xytext=off, textcoords="offset points", ha=ha, va=va, fontsize=7.5, bbox=box, **look
    )
