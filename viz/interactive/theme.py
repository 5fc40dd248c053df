"""One look for interactive figures: text, colours by day and by night, axes, and line styles."""

import html
from base64 import b64encode
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from plotly.graph_objects import Figure

from viz import style

FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif'
DASHES = {"-": "solid", "--": "dash", "-.": "dashdot", ":": "dot"}
"""Plotly's names of matplotlib's line styles."""

CONFIG = {
    "displaylogo": False,
    "responsive": True,
    "showSendToCloud": False,
    "doubleClick": "reset+autosize",
    "modeBarButtonsToRemove": ["select2d", "lasso2d", "autoScale2d", "resetCameraLastSave3d"],
}
"""How pages draw the figures: ``figure.show(config=CONFIG)``. Plotly's own settings have a button that sends
the data to its makers' server."""

BAR = {"type": "bar", "orientation": "h", "textposition": "outside", "cliponaxis": False, "hoverinfo": "text"}
"""A trace of horizontal bars with texts at their ends and texts on hover."""

TOOL_BAR = 30
"""Height of plotly's tool bar at the upper edge; legends, bars and cells begin below it [pixel]."""
TITLE = 38
"""Height of a title at the upper edge [pixel]."""
LEGEND_ROW = 24
"""Height of a legend of one row; a figure makes room for more by itself [pixel]."""
CELL = "#f0f1f3"
"""A cell without a value."""
EDGE = "#4a525a"
"""Edges of surfaces."""
PAPER = "#ffffff"
"""The page."""
VEIL = "rgba(255,255,255,0.75)"
"""Behind texts that lie over something."""

NIGHT = {
    style.INK: "#e6edf3",
    style.MUTED: "#9aa4af",
    style.FAINT: "#3d444d",
    style.BLUE: "#56b4e9",
    style.VERMILION: "#ff8c42",
    style.HELD_OUT: "#3a3217",
    style.NOISE: "#2b3138",
    style.JOINT: "#c49bd9",
    style.HIGHLIGHT: "#ff6fae",
    style.AT_REST: "#6e7781",
    CELL: "#21262d",
    EDGE: "#aab4be",
    PAPER: "#0d1117",
    VEIL: "rgba(13,17,23,0.75)",
}
"""Colours on a dark page, by those on a white one; others stay."""


def plain(text: object) -> str:
    """Return a text that plotly shows as it is.

    Plotly reads tags and entities in texts, values in braces in hover templates, and formulas between dollars
    where MathJax is there; names may hold them.
    """
    safe = html.escape(str(text), quote=False)
    return safe.replace("{", "&#123;").replace("}", "&#125;").replace("$", "&#36;")


def at_night(figure: Figure) -> Figure:
    """Return a copy of a figure for a dark page."""
    parts = [_exchanged(trace.to_plotly_json()) for trace in figure.data]
    frames = [_exchanged(frame.to_plotly_json()) for frame in figure.frames]
    return Figure(parts, _exchanged(figure.layout.to_plotly_json()), frames)


def _exchanged(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _exchanged(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_exchanged(v) for v in value]
    return NIGHT.get(value, value) if isinstance(value, str) else value


def layout(height: float, title: str = "", *, legend: bool = True, **more: Any) -> dict[str, Any]:
    """Return the layout that figures share: transparent, wide, with room above for tool bar and legend."""
    head = TITLE if title else TOOL_BAR
    heading = {
        "text": f"<b>{plain(title)}</b>",
        "font": {"size": 14},
        "x": 0,
        "xref": "paper",
        "y": 1,
        "yref": "container",
        "yanchor": "top",
        "pad": {"t": 10},
    }
    return {
        "template": "none",
        "font": {"family": FONT, "size": 13, "color": style.INK},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "title": heading if title else None,
        "height": height,
        "autosize": True,
        "margin": {"l": 62, "r": 16, "t": head + LEGEND_ROW * legend, "b": 48},
        "legend": {
            "orientation": "h",
            "x": 0,
            "xanchor": "left",
            "y": 1 - head / height,
            "yref": "container",
            "yanchor": "top",
            "bgcolor": "rgba(0,0,0,0)",
            "font": {"size": 12},
            "traceorder": "normal",
        },
        "hoverlabel": {"font": {"family": FONT, "size": 12}, "align": "left"},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": style.MUTED, "activecolor": style.INK},
        "uirevision": "kept",
        **more,
    }


def axis(title: str = "", **more: Any) -> dict[str, Any]:
    """Return an axis of a plane figure; ``title`` is text as plotly reads it."""
    return {
        "title": {"text": title, "font": {"size": 12}, "standoff": 8},
        "gridcolor": style.FAINT,
        "gridwidth": 0.5,
        "zeroline": False,
        "showline": True,
        "linecolor": style.MUTED,
        "tickcolor": style.MUTED,
        "ticks": "outside",
        "ticklen": 4,
        "tickfont": {"size": 11},
        "automargin": True,
        **more,
    }


def key(name: str, colour: str) -> dict[str, Any]:
    """Return a trace that has no points and puts a coloured square into the legend."""
    return {
        "type": "scatter",
        "x": [None],
        "y": [None],
        "mode": "markers",
        "name": plain(name),
        "hoverinfo": "skip",
        "marker": {
            "symbol": "square",
            "size": 12,
            "color": colour,
            "line": {"color": style.MUTED, "width": 0.5},
        },
    }


def colour_scale(cmap: Any) -> list[tuple[float, str]]:
    """Return a matplotlib colour map as one of plotly's."""
    return [(float(t), rgb_text(cmap(float(t)))) for t in np.linspace(0, 1, 12)]


def colour_bar(
    title: str, size: int = 10, length: float = 0.6, side: str = "right", **more: Any
) -> dict[str, Any]:
    """Return a bar of colours; ``size`` is that of its numbers and its thickness, ``length`` a share."""
    return {
        "title": {"text": plain(title), "side": side, "font": {"size": size + 1}},
        "thickness": size,
        "len": length,
        "outlinewidth": 0,
        "tickfont": {"size": size},
        **more,
    }


def coordinates(points: NDArray[Any]) -> dict[str, Any]:
    """Return points (n, 3) as the x, y and z of a three-dimensional trace."""
    return dict(zip("xyz", single(points).T, strict=True))


def single(values: ArrayLike) -> NDArray[np.float32]:
    """Return values in single precision, which is finer than a screen and half as many bytes."""
    return np.asarray(values, dtype=np.float32)


def binary(values: NDArray[Any]) -> dict[str, Any]:
    """Return an array as plotly's pages read it, in base64; frames need it, where plotly writes digits."""
    flat = np.ascontiguousarray(values)
    return {"dtype": flat.dtype.str[1:], "bdata": b64encode(flat.tobytes()).decode("ascii")}


def rgb_text(rgba: Iterable[float]) -> str:
    """Return a colour from 0 to 1 as text."""
    r, g, b = (round(255 * float(c)) for c in list(rgba)[:3])
    return f"rgb({r},{g},{b})"
