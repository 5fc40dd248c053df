"""Mode shapes that move, any of them by choice, with the measured shape beside."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from plotly.graph_objects import Figure

from fem.analysis.modes import Modes
from fem.array_types import Floats
from fem.model import Model
from viz import style
from viz.interactive.solids import edge_rows, scene, solid, wires
from viz.interactive.theme import binary, colour_bar, colour_scale, coordinates, layout, plain, single
from viz.models import displacement_at, drawn_size, model_surface
from viz.shapes import amplification, match_scale, real_shape
from viz.surfaces import Surface

PHASES = 7
"""Pictures of half a period: a real shape comes back the same way."""
PERIODS = 4
"""Number of periods that a figure with frames plays at a time."""

MOST_FRAMED = 12
"""Number of modes of a figure with frames unless they are named; each takes a sixth of a megabyte."""

MeasuredShape = tuple[ArrayLike, ArrayLike]
"""Places (n, 3) [m] and displacement vectors (n, 3) of any scale, one for each sensor."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A mode as it is drawn.

    Attributes
    ----------
    label : str
    surface : ndarray (n_vertices, 3)
        Displacement of the surface's vertices at the largest deflection, amplified [m].
    tails, measured, computed : ndarray (n_sensors, 3)
        Places of the sensors, and how far the measured and the computed shape move them [m].
    """

    label: str
    surface: Floats
    tails: Floats
    measured: Floats
    computed: Floats


def mode_label(modes: Modes, index: int) -> str:
    """Return number, frequency and damping of a mode, elastic modes counted from 1."""
    if index < modes.n_rigid:
        return f"rigid-body mode {index + 1}"
    f = float(modes.frequency[index])
    text = f"mode {index - modes.n_rigid + 1}: {f:.4g} Hz".replace("-", "−")
    if f < 0:
        return f"{text}, a motion that grows"
    return text if modes.zeta is None else f"{text}, damping {100 * float(modes.zeta[index]):.2g} %"


def modes_figure(
    model: Model,
    modes: Modes,
    indices: Sequence[int] | None = None,
    *,
    measured: Mapping[int, MeasuredShape] | None = None,
    labels: Mapping[int, str] | None = None,
    frames: bool = True,
    title: str = "",
    height: float = 520,
) -> Figure:
    """Return mode shapes of which one is chosen and moves.

    With ``frames`` a list in the figure chooses the mode and plays it. Without them the page moves it, which
    takes a fraction of the bytes: ``layout.meta["modes"]`` has for each mode its ``label`` and the largest
    displacements [m] of the traces by their ``meta["moves"]`` (``surface``, ``measured``, ``computed``), and
    ``layout.meta["edges"]`` the rows of the surface that the trace ``edges`` passes, -1 at its gaps. The
    traces themselves then show the structure at rest.

    Parameters
    ----------
    model : Model
    modes : Modes
        With a row for every DOF of the model's mesh; complex shapes are drawn at the phase at which most of
        them moves.
    indices : sequence of int, optional
        Modes from 0; unless given all but rigid-body modes, with ``frames`` the first ``MOST_FRAMED``.
    measured : mapping of int to (points, vectors), optional
        Measured shapes by the mode that they belong to, scaled to it.
    labels : mapping of int to str, optional
        Number, frequency and damping unless given.
    frames : bool
    title : str
    height : float
        [pixel].

    Raises
    ------
    ValueError
        If there is no mode to draw.
    """
    elastic = range(modes.n_rigid, modes.n_modes)
    chosen = list(elastic[: MOST_FRAMED if frames else None] if indices is None else indices)
    if not chosen:
        msg = f"none of {modes.n_modes} modes is to be drawn; give at least one"
        raise ValueError(msg)
    rest = model_surface(model, pieces=_pieces(model))
    motions = [
        mode_motion(model, modes, k, (measured or {}).get(k), (labels or {}).get(k, "")) for k in chosen
    ]
    traces, moving = _traces(rest, motions, edges=not frames)
    look = layout(height, title, scene=scene(rest.rest))
    look["margin"] |= {"l": 0, "r": 0, "b": 0}
    look["legend"] |= {"itemsizing": "constant"}
    if not frames:
        look["meta"] = {
            "modes": [{"label": m.label, **_displacements(m)} for m in motions],
            "edges": edge_rows(rest.edges).astype(np.int32),
        }
        return Figure(traces, look)
    # Height of the list of modes and the stop button [pixel]
    look["margin"]["t"] += 36
    look["legend"] |= {"y": 1.0, "yref": "paper", "yanchor": "bottom"}  # below the menus
    figure = Figure(traces, {**look, "updatemenus": _menus(motions)})
    figure.frames = _frames(rest, motions, traces, moving)
    figure.update(
        data=[{} if k not in moving else _moved(rest, motions[0], traces[k], 1.0) for k in range(len(traces))]
    )
    return figure


def mode_motion(
    model: Model,
    modes: Modes,
    index: int,
    measured: MeasuredShape | None = None,
    label: str = "",
) -> Motion:
    """Return a mode's motion, amplified to be seen, and that of the sensors of a measured shape."""
    shape = modes.shapes[:, index]
    motion = real_shape(shape)
    surface = model_surface(model, motion, pieces=_pieces(model))
    scale = amplification(surface, drawn_size(model))
    tails = moved = expected = np.empty((0, 3))
    if measured is not None:
        points, vectors = np.array(measured[0], dtype=float, ndmin=2), np.array(measured[1], ndmin=2)
        known = ~np.isnan(vectors).any(axis=1)
        tails, vectors = points[known], vectors[known]
        computed = displacement_at(model, motion, tails)
        moved = scale * np.real(match_scale(vectors, computed) * vectors)
        size = np.maximum(np.linalg.norm(moved, axis=1, keepdims=True), 1e-300)
        expected = scale * np.einsum("ij,ij->i", computed, moved / size)[:, None] * moved / size
    return Motion(label or mode_label(modes, index), scale * surface.displacement, tails, moved, expected)


def _pieces(model: Model) -> int:
    """Return the number of straight pieces of a line: many where lines are few, one where they are many."""
    # Straight pieces of all members together, about
    return int(np.clip(round(200 / max(model.mesh.n_lines, 1)), 1, 6))


def _traces(
    rest: Surface, motions: Sequence[Motion], *, edges: bool
) -> tuple[list[dict[str, Any]], list[int]]:
    """Return the traces, and which of them move."""
    ghost = wires(
        rest.rest, rest.edges, name="at rest", showlegend=True, line={"color": style.AT_REST, "width": 1.5}
    )
    moving = solid(
        rest.rest,
        rest.triangles,
        intensity=_relative(motions[0]),
        cmin=0,
        cmax=1,
        name="computed",
        colorscale=colour_scale(style.displacement_map()),
        showscale=True,
        hoverinfo="skip",
        colorbar=colour_bar("relative displacement [-]"),
        meta={"moves": "surface"},
    )
    traces = [ghost, moving]
    if edges:
        traces.append(wires(rest.rest, rest.edges, meta={"moves": "edges"}))
    if any(len(m.tails) for m in motions):
        traces += [_tips(motions[0], "measured", style.EXCITATION), _tips(motions[0], "computed", style.INK)]
    return traces, list(range(1, len(traces)))


def _relative(motion: Motion) -> NDArray[np.float32]:
    """Return the displacements of the surface's vertices over the largest, (n_vertices,) [-]."""
    size = np.linalg.norm(motion.surface, axis=1)
    return single(size / max(float(size.max(initial=0.0)), 1e-300))


def _tips(motion: Motion, which: str, colour: str) -> dict[str, Any]:
    measured = which == "measured"
    return {
        "type": "scatter3d",
        "mode": "lines+markers" if measured else "markers",
        **coordinates(_tip_rows(motion.tails, np.zeros_like(motion.tails), which)),
        "name": "measured, scaled to the mode" if measured else "computed at the sensors",
        "line": {"color": colour, "width": 5},
        "hoverinfo": "skip",
        "marker": {
            "color": colour,
            "size": 3 if measured else 5,
            "symbol": "circle" if measured else "circle-open",
        },
        "meta": {"moves": which},
    }


def _tip_rows(tails: Floats, moved: Floats, which: str) -> Floats:
    """Return tail, tip and a gap for each sensor, shape (3 n, 3); of the computed shape the tips alone."""
    gap = np.full_like(tails, np.nan)
    first = tails if which == "measured" else gap
    return np.stack([first, tails + moved, gap], axis=1).reshape(-1, 3)


def _displacements(motion: Motion) -> dict[str, NDArray[np.float32]]:
    """Return the largest displacements of the traces that move, three numbers for each of their points."""
    zero = np.zeros_like(motion.tails)
    out = {"surface": single(motion.surface).ravel()}
    if len(motion.tails):
        for key, moved in (("measured", motion.measured), ("computed", motion.computed)):
            out[key] = single(_tip_rows(zero, moved, key)).ravel()
    return out


def _moved(rest: Surface, motion: Motion, trace: Mapping[str, Any], factor: float) -> dict[str, Any]:
    """Return the coordinates of a trace at a part of a mode's largest deflection."""
    which = trace["meta"]["moves"]
    if which == "surface":
        at = rest.rest + factor * motion.surface
    else:
        at = _tip_rows(motion.tails, factor * getattr(motion, which), which)
    x, y, z = single(at).T
    out: dict[str, Any] = {"x": x, "y": y, "z": z}
    # the colours stay while the mode moves
    return out | {"intensity": _relative(motion)} if which == "surface" and factor == 1 else out


def _frames(
    rest: Surface, motions: Sequence[Motion], traces: Sequence[dict[str, Any]], moving: Sequence[int]
) -> list[dict[str, Any]]:
    out = []
    for n, motion in enumerate(motions):
        for p in range(PHASES):
            factor = float(np.cos(np.pi * p / (PHASES - 1)))
            data = [
                {"type": traces[k]["type"]}
                | {key: binary(v) for key, v in _moved(rest, motion, traces[k], factor).items()}
                for k in moving
            ]
            out.append({"name": f"{n}-{p}", "data": data, "traces": list(moving)})
    return out


def _menus(motions: Sequence[Motion]) -> list[dict[str, Any]]:
    """Return the list that chooses a mode and plays it, and the button that stops it."""
    there = list(range(PHASES))
    period = [*there, *there[-2:0:-1]]
    how = {
        # Time from one picture to the next [ms]
        "frame": {"duration": 60, "redraw": True},
        "transition": {"duration": 0},
        "mode": "immediate",
    }
    choices = [
        {
            "label": plain(m.label),
            "method": "animate",
            "args": [[f"{n}-{p}" for p in [*period * PERIODS, 0]], how],
        }
        for n, m in enumerate(motions)
    ]
    stop = {"label": "stop", "method": "animate", "args": [[None], {**how, "frame": {"duration": 0}}]}
    common = {"showactive": False, "y": 1.02, "yanchor": "bottom", "pad": {"b": 26}, "font": {"size": 12}}
    return [
        {**common, "type": "dropdown", "buttons": choices, "x": 0, "xanchor": "left", "showactive": True},
        {**common, "type": "buttons", "buttons": [stop], "x": 1, "xanchor": "right"},
    ]
