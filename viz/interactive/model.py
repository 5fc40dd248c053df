"""The structure as a figure that turns: sections, sensors by their error, findings and candidates."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.colors import Normalize
from numpy.typing import NDArray
from plotly.graph_objects import Figure

from fem.array_types import Floats, Ints
from fem.declarations import SUPPORT_MARKER
from fem.model import Model
from updating.measurement.measurement import MOTION, Sensor
from viz import style
from viz.interactive.solids import (
    SYMBOLS,
    MarkedPlace,
    arrows_trace,
    line_of_vertex,
    part_of,
    place_traces,
    points_trace,
    scene,
    solid,
    wires,
)
from viz.interactive.theme import CELL, colour_bar, colour_scale, layout, plain, rgb_text, single
from viz.layout import in_order, merge_names, shorten
from viz.markers import COLOURS, support_axes
from viz.models import drawn_names, drawn_size, member_families, model_surface, surface_places
from viz.shapes import arrows, view_axes
from viz.surfaces import Surface

MOST_NAMED = 24
"""With more sensors and excitations their names show only where one points."""


def model_figure(
    model: Model,
    sensors: Sequence[Sensor] = (),
    excitations: Sequence[Sensor] = (),
    *,
    errors: Mapping[str, float] | None = None,
    limits: tuple[float, float] | None = None,
    places: Sequence[MarkedPlace] = (),
    members: Mapping[str, float] | None = None,
    joints: Sequence[tuple[MarkedPlace, float]] = (),
    members_label: str = "share of the misfit [%]",
    title: str = "",
    height: float = 520,
) -> Figure:
    """Return a structure to turn and zoom, with its members' sections extruded.

    ``customdata`` has the names of members, sensors, excitations and places for clicks. The traces'
    ``meta["role"]`` is ``member``, ``part``, ``sensor``, ``excitation``, ``effect``, or the role of a place.

    Parameters
    ----------
    model : Model
    sensors, excitations : sequence of Sensor
        Drawn as arrows in the sensors' positive directions, and as larger ones that push.
    errors : mapping of str to float, optional
        Error of sensors by name, which colours them [dB].
    limits : (float, float), optional
        Ends of the colours [dB]; from 0 unless given.
    places : sequence of Place
        Findings, faults and candidates.
    members : mapping of str to float, optional
        A value for members, which are then coloured by it.
    joints : sequence of (Place, float)
        Joints and supports with the same value, in the same colours.
    members_label : str
        Name of this value, with its unit.
    title : str
    height : float
        [pixel].

    Raises
    ------
    ValueError
        If the model has no frame with sections.
    """
    surface, size = model_surface(model, pieces=1), drawn_size(model)
    shares = [*(members or {}).values(), *(v for _, v in joints)]
    top = max((v for v in shares if np.isfinite(v)), default=0.0)
    traces = [
        *_member_traces(model, surface, members, members_label, top or 1.0),
        wires(surface.rest, surface.edges),
        *_valued_joints(joints, members_label, top or 1.0),
    ]
    bounds, names = [surface.rest], []
    eye = view_axes(surface.rest)[2]
    for group, word in ((sensors, "sensor"), (excitations, "excitation")):
        if group:
            drawn, ends = _instrument_traces(model, group, word, 0.06 * size, eye, errors, limits)
            traces += drawn
            bounds.append(ends)
            names += _instrument_names(group, ends, size, -12 if word == "excitation" else 11)
    traces += _effect_traces(model)
    marks, notes = place_traces(places)
    named = names if len(sensors) + len(excitations) <= MOST_NAMED else []
    look = layout(
        height,
        title,
        scene=scene(np.vstack(bounds), [*named, *notes]),
    )
    look["margin"] |= {"l": 0, "r": 0, "b": 0}
    look["legend"] |= {"itemsizing": "constant"}
    return Figure([*traces, *marks], look)


def _member_traces(
    model: Model, surface: Surface, values: Mapping[str, float] | None, label: str, top: float
) -> list[dict[str, Any]]:
    """Return the members by family, or all in the colours of their values."""
    owner = np.array(drawn_names(model))
    vertex = line_of_vertex(surface)
    if values:
        known = np.array([values.get(str(m), np.nan) for m in owner], dtype=float)
        return [_valued_members(surface, vertex, owner, known, label, top)]
    families = member_families(model)
    names = in_order(families)
    family = np.array([families[str(m)] for m in owner])
    out = []
    n_lines = model.mesh.n_lines
    for n, name in enumerate(names):
        used, triangles = part_of(surface, (family == name)[surface.line])
        members = owner[vertex[used]].tolist()
        role = "member" if (vertex[used] < n_lines).all() else "part"
        out.append(
            solid(
                surface.rest[used],
                triangles,
                color=style.MEMBERS[n % len(style.MEMBERS)],
                name=plain(shorten(name, 40)),
                showlegend=len(names) > 1,
                customdata=members,
                hoverinfo="text",
                hovertext=[f"{role} {plain(m)}" for m in members],
                meta={"role": role},
            )
        )
    return out


def _valued_members(
    surface: Surface, vertex: Ints, owner: NDArray[Any], values: Floats, label: str, top: float
) -> dict[str, Any]:
    at = owner[vertex].tolist()
    shown = values[vertex]
    return solid(
        surface.rest,
        surface.triangles,
        intensity=single(np.nan_to_num(shown)),
        cmin=0.0,
        cmax=top,
        colorscale=_share_scale(),
        colorbar=_bar(label, 0.0),
        customdata=at,
        hoverinfo="text",
        showlegend=False,
        hovertext=[
            f"member {plain(m)}" + (f"<br>{v:.3g}: {plain(label)}" if np.isfinite(v) else "")
            for m, v in zip(at, shown, strict=True)
        ],
        meta={"role": "member"},
    )


def _valued_joints(
    joints: Sequence[tuple[MarkedPlace, float]], label: str, top: float
) -> list[dict[str, Any]]:
    """Return joints and supports in the colours of members."""
    if not joints:
        return []
    marker = {
        "color": single([v for _, v in joints]),
        "cmin": 0.0,
        "cmax": top,
        "colorscale": _share_scale(),
        "symbol": "diamond",
        "size": 10,
        "line": {"color": style.INK, "width": 1},
    }
    hover = [f"{plain(p.label or p.name)}<br>{v:.3g}: {plain(label)}" for p, v in joints]
    places, names = [p.point for p, _ in joints], [p.name for p, _ in joints]
    return [points_trace(places, names, hover, marker, name="joint or support", meta={"role": "joint"})]


def _share_scale() -> list[tuple[float, str]]:
    return colour_scale(style.lighter(style.agreement_map(), 0.25))


def _bar(label: str, x: float) -> dict[str, Any]:
    return colour_bar(label, x=x, xanchor="right" if x > 0.5 else "left")


def _instrument_traces(
    model: Model,
    group: Sequence[Sensor],
    word: str,
    length: float,
    eye: Floats,
    errors: Mapping[str, float] | None,
    limits: tuple[float, float] | None,
) -> tuple[list[dict[str, Any]], Floats]:
    """Return arrows of sensors or excitations, markers that answer pointing, and the arrows' free ends."""
    force = word == "excitation"
    points, directions = (np.array([getattr(s, key) for s in group]) for key in ("point", "direction"))
    side = -1.0 if force else 1.0
    base = surface_places(model, points, side * directions, eye)
    pointers = arrows(base, directions, (1.8 if force else 1.0) * length, towards=force)
    known = np.array([np.nan if force or not errors else errors.get(s.name, np.nan) for s in group])
    marker: dict[str, Any] = {"size": 5, "line": {"color": style.INK, "width": 0.5}}
    if np.isfinite(known).any():
        low, high = limits or (0.0, float(np.nanmax(known)))
        norm = Normalize(low, high if high > low else low + 1)
        cmap = style.misfit_map()
        colours = [rgb_text(cmap(norm(e))) if np.isfinite(e) else CELL for e in known]
        marker |= {
            "color": single(np.nan_to_num(known, nan=low)),
            "cmin": norm.vmin,
            "cmax": norm.vmax,
            "colorscale": colour_scale(cmap),
            "colorbar": _bar("error of the sensor [dB]", 1.0),
        }
    else:
        colours = [style.GREEN if force else style.SENSOR] * len(group)
        marker |= {"color": colours[0]}
    hover = [
        f"{word} <b>{plain(s.name)}</b>, {_direction(s)}{'' if s.quantity == MOTION else f', {s.quantity}'}"
        + (f"<br>error {e:.2f} dB" if np.isfinite(e) else "")
        for s, e in zip(group, known, strict=True)
    ]
    free = pointers.tail if force else pointers.tip
    names = [s.name for s in group]
    radius = (0.045 if force else 0.07) * length * (1.8 if force else 1.0)
    meta = {"role": word}
    return [
        arrows_trace(pointers, radius, colours, meta=meta, legendgroup=word),
        points_trace(free, names, hover, marker, name=word, legendgroup=word, meta=meta),
    ], free


def _instrument_names(group: Sequence[Sensor], free: Floats, size: float, shift: int) -> list[dict[str, Any]]:
    """Return the names of sensors or excitations as texts at a free end, one for each place."""
    out = []
    for text, k in merge_names([s.name for s in group], [s.point for s in group], 1e-6 * size):
        x, y, z = free[k].tolist()
        out.append(
            {
                "x": x,
                "y": y,
                "z": z,
                "text": plain(text),
                "showarrow": False,
                "yshift": shift,
                "name": "instrument",
                "font": {"size": 10, "color": style.MUTED},
            }
        )
    return out


def _direction(sensor: Sensor) -> str:
    """Return a direction as a reader would say it: ``along +z``, or its components."""
    d = np.asarray(sensor.direction, dtype=float)
    k = int(np.argmax(np.abs(d)))
    if abs(d[k]) > 0.999:
        return f"along {'+' if d[k] > 0 else '−'}{'xyz'[k]}"
    return "along (" + ", ".join(f"{v:.2f}".replace("-", "−") for v in d) + ")"


def _effect_traces(model: Model) -> list[dict[str, Any]]:
    """Return the places of the model's effects, one trace for each kind."""
    by_kind: dict[str, list[tuple[Any, Floats]]] = {}
    for effect in (e for e in model.effects if e.is_marked and not e.is_form):
        for point in effect.locations(model):
            kind = effect.kind if support_axes(effect, model) is None else "support"
            by_kind.setdefault(kind, []).append((effect, point))
    out = []
    for kind, found in by_kind.items():
        declared = SUPPORT_MARKER if kind == "support" else found[0][0].marker
        colour = COLOURS[declared.colour] if declared else style.GREEN
        symbol = SYMBOLS.get(declared.shape, "square") if declared else "square"
        words = kind.replace("_", " ")
        out.append(
            points_trace(
                [point for _, point in found],
                [e.where for e, _ in found],
                [f"{plain(words)}<br>{plain(e.where)}" for e, _ in found],
                {"color": colour, "symbol": symbol, "size": 6, "line": {"color": "white", "width": 1}},
                name=plain(words),
                meta={"role": "effect", "kind": kind},
            )
        )
    return out
