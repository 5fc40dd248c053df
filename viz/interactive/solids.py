"""Surfaces, edges, arrows and marked places as traces of three-dimensional figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Bools, Floats, Ints
from fem.lengths import shown_length
from viz import style
from viz.interactive.theme import EDGE, VEIL, coordinates, plain
from viz.shapes import Arrows, arrow_triangles, view_axes
from viz.surfaces import Surface

FILLED, PROPORTION = 0.9, 1.3
"""The box of the axes fills this part of a scene with this width over height; narrower pages scale it."""
LIGHT = {"ambient": 0.78, "diffuse": 0.45, "specular": 0.05, "roughness": 0.9, "fresnel": 0.05}
SYMBOLS = {
    "circle": "circle",
    "cross": "x",
    "diamond": "diamond",
    "dot": "circle",
    "plus": "cross",
    "square": "square",
    "thin_diamond": "diamond-open",
    "triangle": "diamond",
    "triangle_down": "diamond",
}
"""Plotly's symbols in space by the shapes that effects name; it has no triangles there."""


@dataclass(frozen=True, slots=True, eq=False)
class MarkedPlace:
    """A place to mark on a structure.

    Attributes
    ----------
    point : ndarray (3,)
        [m].
    name : str
        The ``customdata`` of the mark, for clicks: ``joint J`` or a candidate's name.
    label : str
        Words for a reader; the name unless given.
    role : str
        ``"finding"`` and ``"fault"`` are named in the figure, ``"candidate"`` when one points at it.
    """

    point: Floats
    name: str
    label: str = ""
    role: str = "finding"


def solid(vertices: Floats, triangles: Ints, **look: Any) -> dict[str, Any]:
    """Return triangles as a trace."""
    return {
        "type": "mesh3d",
        **coordinates(vertices),
        **dict(zip("ijk", _smallest(triangles).T, strict=True)),
        "flatshading": True,
        "lighting": LIGHT,
        "lightposition": {"x": 3e4, "y": -6e4, "z": 1e5},
        **look,
    }


def _smallest(rows: Ints) -> NDArray[Any]:
    """Return indices in the smallest type that plotly's binary arrays hold."""
    top = int(rows.max(initial=0))
    return np.ascontiguousarray(rows.astype(np.uint16 if top < 2**16 else np.uint32))


def part_of(surface: Surface, chosen: Bools) -> tuple[Ints, Ints]:
    """Return the vertices that the chosen triangles of a surface use, and the triangles in their numbers."""
    triangles = surface.triangles[chosen]
    used, numbered = np.unique(triangles, return_inverse=True)
    return used, numbered.reshape(-1, 3)


def line_of_vertex(surface: Surface) -> Ints:
    """Return the line of the mesh that each vertex belongs to, shape (n,)."""
    out = np.zeros(len(surface.centre), dtype=np.int64)
    out[surface.triangles.ravel()] = np.repeat(surface.line, 3)
    return out


def edge_rows(edges: Ints) -> Ints:
    """Return the vertices of edges in the order in which a line passes them, -1 for each gap."""
    return np.column_stack([edges, np.full(len(edges), -1)]).ravel()


def along(vertices: Floats, rows: Ints) -> NDArray[np.float32]:
    """Return vertices in an order of :func:`edge_rows`, NaN at the gaps, shape (n, 3)."""
    return np.where(rows[:, None] < 0, np.nan, vertices[rows]).astype(np.float32)


def wires(vertices: Floats, edges: Ints, **look: Any) -> dict[str, Any]:
    """Return edges as a trace of lines that answers no pointing."""
    return {
        "type": "scatter3d",
        "mode": "lines",
        **coordinates(along(vertices, edge_rows(edges))),
        "hoverinfo": "skip",
        "showlegend": False,
        "line": {"color": EDGE, "width": 1.5},
        **look,
    }


def arrows_trace(pointers: Arrows, radius: float, colours: Sequence[str], **look: Any) -> dict[str, Any]:
    """Return arrows as a trace in one colour each."""
    vertices, triangles, arrow = arrow_triangles(pointers, radius, turns=8)
    return solid(
        vertices, triangles, facecolor=[colours[k] for k in arrow], hoverinfo="skip", showlegend=False, **look
    )


def points_trace(
    points: ArrayLike, names: Sequence[str], hover: Sequence[str], marker: dict[str, Any], **look: Any
) -> dict[str, Any]:
    """Return markers that show a text and hold names for clicks."""
    return {
        "type": "scatter3d",
        "mode": "markers",
        **coordinates(np.array(points, dtype=float).reshape(-1, 3)),
        "customdata": list(names),
        "hovertext": list(hover),
        "hoverinfo": "text",
        "marker": marker,
        **look,
    }


def place_traces(places: Sequence[MarkedPlace]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return traces of marked places, and the texts beside findings and faults."""
    looks = {
        "finding": ("found effect", style.HIGHLIGHT, "circle-open", 16),
        "fault": ("fault of the measurement", style.VERMILION, "x", 9),
        "candidate": ("candidates", style.ORANGE, "diamond-open", 8),
    }
    traces, notes = [], []
    for role in dict.fromkeys(p.role for p in places):
        word, colour, symbol, size = looks.get(role, (role, style.GREEN, "square-open", 9))
        chosen = [p for p in places if p.role == role]
        words = [_lines(p.label or p.name) for p in chosen]
        marker = {"color": colour, "symbol": symbol, "size": size, "line": {"color": colour, "width": 3}}
        points, names = [p.point for p in chosen], [p.name for p in chosen]
        traces.append(points_trace(points, names, words, marker, name=plain(word), meta={"role": role}))
        if role in ("finding", "fault"):
            notes += [_note(p.point, p.label or p.name, colour, k) for k, p in enumerate(chosen)]
    return traces, notes


def _lines(text: str) -> str:
    return "<br>".join(map(plain, text.split("\n")))


def _note(point: Floats, text: str, colour: str, k: int) -> dict[str, Any]:
    return {
        **dict(zip("xyz", map(float, point), strict=True)),
        "text": f"<b>{_lines(text)}</b>",
        "font": {"color": colour, "size": 13},
        "arrowcolor": colour,
        "arrowwidth": 1.5,
        "arrowhead": 0,
        "ax": 64,
        "ay": 72 + 22 * (k % 4),
        "bgcolor": VEIL,
        "borderpad": 2,
        "xanchor": "left",
    }


def _inwards(note: Mapping[str, Any], right: Floats, centre: Floats) -> dict[str, Any]:
    """Return a text with an arrow on the side of its place that is nearer to the middle."""
    beyond = right @ (np.array([note[x] for x in "xyz"]) - centre) > 0
    if not note.get("ax") or not beyond:
        return dict(note)
    return {**note, "ax": -note["ax"], "xanchor": "right"}


def _ticks(low: float, high: float, number: float, share: float) -> dict[str, Any]:
    """Return ticks between two coordinates [m], with their values times a number as texts.

    Five at most, and one where the range is so small a share of the largest that their texts would overlap.
    """
    most = max(round(4 * share), 1)
    values = np.asarray(MaxNLocator(most, steps=[1, 2, 5, 10]).tick_values(number * low, number * high))
    some = [float(v) for v in values if number * low - 1e-9 <= v <= number * high + 1e-9] or [number * low]
    some = some if most > 1 else some[len(some) // 2 :][:1]
    return {"tickvals": [v / number for v in some], "ticktext": [f"{v + 0.0:.6g}" for v in some]}


def scene(points: Floats, notes: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
    """Return a scene in true proportions, seen as the still pictures are."""
    right, up, eye = view_axes(points)
    notes = [_inwards(note, right, points.mean(axis=0)) for note in notes]
    ends = np.stack([points.min(axis=0), points.max(axis=0)])
    room = 0.04 * max(float(np.ptp(ends, axis=0).max()), 1e-9)
    half = np.ptp(ends, axis=0) / 2 + room
    wide, tall = np.abs(np.stack([right, up])) @ half  # of the box of the axes, seen from the eye
    scale = FILLED * min(PROPORTION / wide, 1 / tall)
    aspect = 2 * half * scale
    number, unit = shown_length(1.0)
    share = np.ptp(ends, axis=0) / max(float(np.ptp(ends, axis=0).max()), 1e-9)
    axes = {
        f"{name}axis": {
            "title": {"text": f"{name} [{unit}]", "font": {"size": 12, "color": style.MUTED}},
            "range": [float(ends[0, k] - room), float(ends[1, k] + room)],
            "showbackground": False,
            "gridcolor": style.FAINT,
            "zeroline": False,
            "showspikes": False,
            **_ticks(float(ends[0, k]), float(ends[1, k]), number, float(share[k])),
            "linecolor": style.MUTED,
            "tickfont": {"size": 11, "color": style.MUTED},
        }
        for k, name in enumerate("xyz")
    }
    place = dict(zip("xyz", (1.5 * eye).tolist(), strict=True))
    return {
        **axes,
        "aspectmode": "manual",
        "aspectratio": dict(zip("xyz", aspect.tolist(), strict=True)),
        "camera": {"eye": place, "projection": {"type": "orthographic"}},
        "dragmode": "turntable",
        "annotations": list(notes),
        "uirevision": "kept",
    }
