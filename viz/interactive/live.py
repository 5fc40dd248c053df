"""Descriptions of plane figures drawn by plotly."""

import re
from collections.abc import Sequence
from functools import singledispatch
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from plotly.graph_objects import Figure

from viz import style
from viz.chart import Axis, Band, Chart, ChartMark, Curve, Matrix, Panel, RowBars, Rule, Span, Values, decibel
from viz.interactive.theme import BAR, CELL, DASHES, axis, colour_scale, key, layout, plain, single

SYMBOLS = {
    "o": "circle",
    "s": "square",
    "D": "diamond",
    "P": "cross",
    "_": "line-ew-open",
    "^": "triangle-up",
}
"""Plotly's names of matplotlib's symbols."""
HATCH = {"fgcolor": style.INK, "fillmode": "overlay", "solidity": 0.12, "size": 7}
GAP = 0.05
"""Between panels, in parts of the height [-]."""
NOTE = {"showarrow": False, "yanchor": "bottom"}

Parts = dict[str, list[dict[str, Any]]]
"""Traces, keys that come last in the legend, shapes and notes of a mark."""


def draw(chart: Chart) -> Figure:
    """Return a description as a plotly figure."""
    panels = [Panel(chart.marks, chart.y, 1.0), *chart.below]
    rows, axes = _axes(panels)
    parts = [(row, _draw(mark)) for row, panel in zip(rows, panels, strict=True) for mark in panel.marks]
    traces = [{**trace, "yaxis": row} for row, some in parts for trace in some.get("traces", ())]
    keys, shapes, notes = (
        [one for _, some in parts for one in some.get(what, ())] for what in ("keys", "shapes", "notes")
    )
    marks = chart.marks
    x = _axis(chart.x, anchor=rows[-1])
    if chart.compares:
        x |= {"hoverformat": ".5~g", "unifiedhovertitle": {"text": "%{x:.5~g} Hz"}}
    meta, more = dict(chart.meta), {}
    if any(isinstance(mark, RowBars) for mark in marks):
        meta["short"] = axes["yaxis"]["ticktext"]  # of narrow pages, above the bars
        axes["yaxis"]["showline"], more["barmode"] = False, "overlay"
    if any(isinstance(mark, Matrix) for mark in marks):
        more["plot_bgcolor"] = CELL
    if chart.equal:
        axes["yaxis"]["scaleanchor"] = "x"
    legend = any(mark.name and mark.keyed for mark in marks)
    look = layout(
        chart.height,
        chart.title,
        legend=legend,
        showlegend=legend,
        hovermode="x unified" if chart.compares else "closest",
        shapes=shapes,
        annotations=notes,
        meta=meta,
        xaxis=x,
        **axes,
        **more,
    )
    look["margin"]["t"] += 24 * any(note["y"] == 1 for note in notes)  # room for notes above
    return Figure([*traces, *keys], look)


def _axes(panels: Sequence[Panel]) -> tuple[list[str], dict[str, Any]]:
    """Return the names of the axes of panels, and the axes, one below the other."""
    rows = [f"y{n or ''}" for n in (0, *range(2, len(panels) + 1))]
    share = (1 - GAP * (len(panels) - 1)) / sum(panel.part for panel in panels)
    out, top = {}, 1.0
    for row, panel in zip(rows, panels, strict=True):
        low = max(top - share * panel.part, 0.0)
        out[row.replace("y", "yaxis")] = _axis(panel.y, domain=[low, top])
        top = low - GAP
    return rows, out


def _axis(a: Axis, **more: Any) -> dict[str, Any]:
    out = axis(axis_title(a), showgrid=a.grid, **more)
    if a.limits:
        out["range"] = np.log10(a.limits).tolist() if a.log else list(a.limits)
    if a.log:
        out |= {"type": "log", "dtick": "D2"}
    else:
        out["exponentformat"] = "power"
    if a.ticks:
        names = [_plain(name) for name in a.ticks[1]]
        out |= {"tickvals": list(a.ticks[0]), "ticktext": names, "ticks": "", "autotickangles": [0, 90]}
        if any("<br>" in name for name in names):
            out["tickangle"] = 0
    return out


def axis_title(a: Axis) -> str:
    """Return an axis' label with its unit, as plotly reads it."""
    return _plain(a.label if a.decibels is None else f"{a.label}\n[{decibel(a.decibels)}]")


def _plain(text: str) -> str:
    return plain(text).replace("\n", "<br>")


@singledispatch
def _draw(mark: ChartMark) -> Parts:
    """Return the parts of a mark."""
    raise NotImplementedError(type(mark))


def _values(mark: Values) -> dict[str, Any]:
    name = plain(mark.name)
    out: dict[str, Any] = {"name": name, "legendgroup": name, "showlegend": bool(name) and mark.keyed}
    out |= {"meta": dict(mark.meta), "opacity": mark.opacity, "hoverinfo": "text" if mark.hover else "skip"}
    if isinstance(mark.hover, str) and mark.hover:
        out["hovertemplate"] = re.sub(r"{(\w)", r"%{\1", mark.hover)
    elif mark.hover:
        out["hovertext"] = _texts(mark.hover)
    out |= {"text": list(mark.text)} if mark.text else {}
    return out | ({"customdata": list(mark.data)} if len(mark.data) else {})


def _texts(hover: Any) -> Any:
    return _plain(hover) if isinstance(hover, str) else [_texts(part) for part in hover]


@_draw.register
def _(mark: Curve) -> Parts:
    modes = {"lines": mark.dash, "markers": mark.symbol, "text": mark.text}
    out = {"type": "scatter", "mode": "+".join(m for m, known in modes.items() if known), **_values(mark)}
    out |= {"x": single(mark.x), "y": single(mark.y), "cliponaxis": not mark.symbol}
    if mark.dash:
        out["line"] = {"color": mark.colour, "dash": DASHES[mark.dash], "width": mark.width}
        out["line"] |= {"shape": "hvh"} if mark.treads else {}
    if mark.symbol:
        out["marker"] = {"color": mark.colour, "symbol": SYMBOLS[mark.symbol], "size": 9}
    if mark.spread is not None:
        out["error_y"] = {"array": single(mark.spread), "color": mark.colour, "thickness": 1.2}
    if mark.text:
        out["textposition"] = ["top center" if up else "bottom center" for up in mark.above]
        out["textfont"] = {"color": style.INK, "size": 13}
    return {"traces": [out]}


@_draw.register
def _(mark: RowBars) -> Parts:
    lengths = np.asarray(mark.x, dtype=float) - mark.base
    bars = {"y": list(mark.y), "x": lengths.tolist(), "base": [mark.base] * lengths.size}  # pyright: ignore[reportArgumentType]
    bars["width"] = mark.thickness
    look = {"color": mark.colour, "pattern": {"shape": mark.hatch, **HATCH}}
    return {"traces": [{**BAR, **_values(mark), **bars, "marker": look}]}


@_draw.register
def _(mark: Matrix) -> Parts:
    cells = single(mark.cells)
    out = {"type": "heatmap", "z": cells, "zmin": mark.limits[0], "zmax": mark.limits[1], **_values(mark)}
    out |= {"x": list(range(cells.shape[1])), "y": list(range(cells.shape[0])), "xgap": 1, "ygap": 1}
    out |= {"hoverongaps": True, "colorscale": colour_scale(mark.colours)}
    out["colorbar"] = {"title": {"text": plain(mark.label), "side": "right"}, "thickness": 12}
    out["colorbar"] |= {"outlinewidth": 0}
    if mark.digits is not None:
        out |= {"texttemplate": f"%{{z:.{mark.digits}f}}", "textfont": {"size": 11}}
    return {"traces": [out]}


@_draw.register
def _(mark: Band) -> Parts:
    r, g, b = (round(255 * c) for c in to_rgb(mark.colour))
    colour = mark.colour if mark.opacity == 1 else f"rgba({r},{g},{b},{mark.opacity})"
    both = {"type": "scatter", "mode": "lines", "x": single(mark.x), "line": {"width": 0}}
    both |= {"hoverinfo": "skip", "legendgroup": plain(mark.name), "connectgaps": False}
    top = {"fill": "tonexty", "fillcolor": colour, "name": plain(mark.name), "showlegend": mark.keyed}
    ends = []
    for y, quantity in ((mark.low, "low"), (mark.high, "high")):
        meta = {**mark.meta, "quantity": quantity} if mark.meta else None
        ends.append({**both, "y": single(np.broadcast_to(y, np.shape(mark.x))), "meta": meta})
    return {"traces": [{**ends[0], "showlegend": False}, {**ends[1], **top}]}


@_draw.register
def _(mark: Span) -> Parts:
    shape = _across(mark.along, mark.low, mark.high)
    shape |= {"type": "rect", "fillcolor": mark.colour, "line": {"width": 0}}
    return {"shapes": [shape], "keys": [key(mark.name, mark.colour)] if mark.name else []}


@_draw.register
def _(mark: Rule) -> Parts:
    line = {"color": mark.colour, "dash": DASHES[mark.dash], "width": 1.2}
    shape = {**_across(mark.along, mark.value, mark.value), "type": "line", "line": line}
    upright = mark.along == "x"
    note = {"xref": "x" if upright else "paper", "yref": "paper" if upright else "y", **NOTE}
    note |= {"x": mark.value, "y": 1, "xanchor": "right"} if upright else {"x": 0, "y": mark.value}
    note |= {"text": plain(mark.text), "font": {"size": 11, "color": mark.colour}}
    note |= {} if upright else {"xanchor": "left"}
    return {"shapes": [shape], "notes": [note] if mark.text else []}


def _across(along: str, low: float, high: float) -> dict[str, Any]:
    """Return the ends of a shape from ``low`` to ``high`` along one axis and over all of the other."""
    other = "y" if along == "x" else "x"
    ends = {f"{along}0": low, f"{along}1": high, f"{other}0": 0, f"{other}1": 1}
    return {**ends, f"{other}ref": "paper", "layer": "below"}
