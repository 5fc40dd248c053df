"""Errors: a map of sensors and bands, the staircase of the steps, and bars of candidates and hypotheses."""

import textwrap
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from plotly.graph_objects import Figure

from fem.summary import percent
from viz import style
from viz.axes import digits_for, number
from viz.interactive.theme import BAR, CELL, axis, heat_map, layout, named_axis, plain, rows_axis, single
from viz.layout import shorten

MOST_LINES = 6
"""Lines of a name beside an axis [-]."""
MOST_NUMBERS = (40, 12)
"""Largest map, rows and columns, whose cells show their numbers."""


def error_map_figure(
    values_db: ArrayLike,
    sensors: Sequence[str],
    bands: Sequence[tuple[float, float]],
    *,
    limits: tuple[float, float] | None = None,
    title: str = "",
) -> Figure:
    """Return the error of each sensor in each band as a map.

    A cell's ``customdata`` is ``[sensor, low, high]`` with the ends of the band in hertz, for clicks.

    Parameters
    ----------
    values_db : array_like (n_sensors, n_bands)
        [dB]; NaN where nothing can be compared.
    sensors : sequence of str
    bands : sequence of (low, high)
        [Hz].
    limits : (float, float), optional
        Ends of the colours [dB]; give the same for maps that will be compared.
    title : str

    Raises
    ------
    ValueError
        If the values' shape is not that of sensors and bands.
    """
    values = np.array(values_db, dtype=float, ndmin=2)
    n, m = values.shape
    if (n, m) != (len(sensors), len(bands)):
        msg = f"the errors have shape {values.shape} for {len(sensors)} sensors and {len(bands)} bands"
        raise ValueError(msg)
    low, high = limits or _span(values)
    digits = digits_for(high - low)
    words = [f"{a:.4g}–{b:.4g}" for a, b in bands]
    hover = [
        [
            f"<b>{plain(s)}</b>, {words[j]} Hz: " + (f"{v:.2f} dB" if np.isfinite(v) else "nothing compared")
            for j, v in enumerate(row)
        ]
        for s, row in zip(sensors, values, strict=True)
    ]
    trace = heat_map(values, "error [dB]", style.misfit_map(), low, high if high > low else low + 1)
    points = [[[s, float(a), float(b)] for a, b in bands] for s in sensors]
    trace |= {"hoverongaps": True, "hovertext": hover, "customdata": points}
    if n <= MOST_NUMBERS[0] and m <= MOST_NUMBERS[1]:
        trace |= {"texttemplate": f"%{{z:.{digits}f}}", "textfont": {"size": 11}}
    look = layout(
        104 + 21 * n if n <= 60 else 1400,
        title,
        legend=False,
        plot_bgcolor=CELL,
        xaxis=named_axis(words, "band [Hz]"),
        yaxis=rows_axis([plain(shorten(s, 24)) for s in sensors]),
    )
    return Figure([trace], look)


def _span(values: Any) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)


def staircase_figure(
    steps: Sequence[tuple[str, float, float | None]],
    floor_db: float | None = None,
    *,
    title: str = "",
    height: float = 340,
    ylabel: str = "error of the amplitude [dB]",
    unit: str = "dB",
    digits: int = 2,
    names: tuple[str, str] = ("on the lines of the fit", "on held-out lines"),
) -> Figure:
    """Return the error of the nominal model, of the fitted one, and after each added effect.

    Parameters
    ----------
    steps : sequence of (label, fit_db, held_out_db or None)
        Error on the lines of the fit and on held-out ones after each step [dB, or ``unit``].
    floor_db : float, optional
        Error that measurement noise alone would leave, drawn as a line [dB, or ``unit``].
    title : str
    height : float
        [pixel].
    ylabel, unit : str
        Of other errors.
    digits : int
        After the point.
    names : (str, str)
        Of what was fitted and what was held out.
    """
    n = len(steps)
    fit = np.array([step[1] for step in steps], dtype=float)
    held_out = np.array([np.nan if step[2] is None else step[2] for step in steps], dtype=float)
    series = [(names[0], fit, style.FITTED, "solid", "circle")]
    if np.isfinite(held_out).any():
        series.append((names[1], held_out, style.VERMILION, "dash", "diamond"))
    above = [fit >= np.where(np.isfinite(held_out), held_out, -np.inf)]
    above.append(~above[0])
    labels = [plain(step[0]) for step in steps]
    words = [_broken(step[0], 18 if n <= 3 else 12) for step in steps]
    traces = [
        {
            "type": "scatter",
            "mode": "lines+markers+text",
            "x": list(range(n)),
            "y": values.tolist(),
            "name": name,
            "line": {"color": colour, "dash": dash, "shape": "hvh", "width": 2.4},
            "marker": {"color": colour, "symbol": symbol, "size": 9},
            "text": [number(v, digits) if np.isfinite(v) else "" for v in values],
            "textposition": ["top center" if up else "bottom center" for up in over],
            "textfont": {"color": style.INK, "size": 13},
            "cliponaxis": False,
            "hoverinfo": "text",
            "hovertext": [
                f"{label}<br>{number(v, digits)} {unit} {name}"
                for label, v in zip(labels, values, strict=True)
            ],
            "customdata": [step[0] for step in steps],
        }
        for (name, values, colour, dash, symbol), over in zip(series, above, strict=False)
    ]
    every = np.concatenate([fit, held_out[np.isfinite(held_out)], [0.0]])
    top = float(np.nanmax(every)) if np.isfinite(every).any() else 1.0
    shapes, notes = _floor_line(floor_db, unit, digits)
    look = layout(
        height,
        title,
        shapes=shapes,
        annotations=notes,
        xaxis=named_axis(words, ticks="outside", range=[-0.5, n - 0.5], tickangle=0),
        yaxis=axis(plain(ylabel), range=[0, 1.18 * top], rangemode="tozero"),
    )
    return Figure(traces, look)


def _floor_line(
    floor_db: float | None, unit: str = "dB", digits: int = 2
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    if floor_db is None or not np.isfinite(floor_db):
        return [], []
    common = {"xref": "paper", "x0": 0, "x1": 1, "y1": floor_db, "layer": "below"}
    dotted = {"color": style.MUTED, "dash": "dot", "width": 1.5}
    shapes = [
        {**common, "type": "rect", "y0": 0, "fillcolor": style.NOISE, "line": {"width": 0}},
        {**common, "type": "line", "y0": floor_db, "line": dotted},
    ]
    note = {
        "xref": "paper",
        "x": 0,
        "xanchor": "left",
        "y": floor_db,
        "yanchor": "bottom",
        "showarrow": False,
        "text": f"noise floor {number(floor_db, digits)} {unit}",
        "font": {"size": 11, "color": style.MUTED},
    }
    return shapes, [note]


def _broken(text: str, width: int) -> str:
    """Return a text with line breaks between words, made plain: lines of even length, cut where many."""

    def wrapped(w: int) -> list[str]:
        return textwrap.wrap(text, w, break_long_words=False, break_on_hyphens=False)

    n = len(wrapped(width))
    even = next(w for w in range(max(width // 2, 1), width + 1) if len(wrapped(w)) <= n)
    lines = wrapped(even)
    more = " …" if len(lines) > MOST_LINES else ""
    return "<br>".join(plain(line) for line in lines[:MOST_LINES]) + more or " "


def ranking_figure(
    labels: Sequence[str],
    levels_db: ArrayLike,
    baseline_db: float,
    *,
    names: Sequence[str] | None = None,
    twins: Collection[int] = (),
    accepted: int | None = None,
    xlabel: str = "residual level with the candidate [dB]",
    at_most: int = 20,
) -> Figure:
    """Return the error that each candidate leaves as bars, the best on top; a bar's length is its gain.

    The axis begins at 0, so that a small gain looks small.

    Parameters
    ----------
    labels : sequence of str
    levels_db : array_like (n,)
        Error with each of them [dB].
    baseline_db : float
        Error without any of them [dB].
    names : sequence of str, optional
        The bars' ``customdata``, for clicks; the labels unless given.
    twins : collection of int
        Rows that these measurements cannot tell from the accepted one.
    accepted : int, optional
        Row of the candidate that was accepted.
    xlabel : str
    at_most : int
        Number of candidates shown.

    Raises
    ------
    ValueError
        If there is not one label for each error.
    """
    levels = np.asarray(levels_db, dtype=float)
    names = labels if names is None else names
    if not len(labels) == len(names) == levels.size:
        msg = f"{len(labels)} labels and {len(names)} names are given for {levels.size} errors"
        raise ValueError(msg)
    order = np.argsort(levels, kind="stable")
    hidden = max(order.size - at_most, 0)
    order = order[:at_most]
    words = [_candidate_word(int(k), accepted, twins) for k in order]
    traces = []
    for word, (colour, pattern) in _CANDIDATES.items():
        rows = [y for y, w in enumerate(words) if w == word]
        if not rows:
            continue
        picked = [int(order[y]) for y in rows]
        traces.append(
            {
                **BAR,
                "y": rows,
                "base": [baseline_db] * len(rows),
                "x": [float(levels[k] - baseline_db) for k in picked],
                "name": word,
                "marker": {"color": colour, "pattern": _hatch(pattern)},
                "text": [number(float(levels[k]), 2) for k in picked],
                "hovertext": [f"{plain(labels[k])}<br>{levels[k]:.3f} dB, {word}" for k in picked],
                "customdata": [names[k] for k in picked],
            }
        )
    ends = [*levels[order].tolist(), baseline_db]
    low, high = float(min(*ends, 0.0)), float(max(*ends, 0.0))
    pad = 0.08 * max(high - low, 1e-3)
    line, note = _upright(baseline_db, f"without: {number(baseline_db, 2)} dB", style.INK)
    more = f"; {hidden} worse ones are not shown" if hidden else ""
    short = _short(str(labels[k]) for k in order)
    look = layout(
        110 + 30 * len(order),
        barmode="overlay",
        bargap=0.3,
        shapes=[line],
        annotations=[note],
        meta={"short": short},
        xaxis=axis(f"{plain(xlabel)}{more}", range=[low - pad, high + pad]),
        yaxis=rows_axis(short, showline=False),
    )
    look["margin"]["t"] += 24  # for the note above the bars
    return Figure(traces, look)


_CANDIDATES = {
    "accepted": (style.VERMILION, ""),
    "indistinguishable from it": ("#f2bf9b", "/"),
    "other": ("#b9c3cd", ""),
}
"""Colour and pattern of the bars of candidates."""


def _upright(x: float, text: str, colour: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return a line over the full height, and its name above it on the left."""
    line = {
        "type": "line",
        "yref": "paper",
        "y0": 0,
        "y1": 1,
        "x0": x,
        "x1": x,
        "line": {"color": colour, "width": 1.2, "dash": "solid"},
    }
    note = {
        "yref": "paper",
        "y": 1,
        "yanchor": "bottom",
        "x": x,
        "xanchor": "right",
        "showarrow": False,
        "text": plain(text),
        "font": {"size": 11, "color": colour},
    }
    return line, note


def _short(labels: Iterable[str]) -> list[str]:
    """Return names for a narrow page, of two lines, which lie above the bars."""
    return [_broken(shorten(s, 96), 50) for s in labels]


def _hatch(shape: str) -> dict[str, Any]:
    return {"shape": shape, "fgcolor": style.INK, "fillmode": "overlay", "solidity": 0.12, "size": 7}


def _candidate_word(k: int, accepted: int | None, twins: Collection[int]) -> str:
    accepted_, twin, other = _CANDIDATES
    return accepted_ if k == accepted else twin if k in twins else other


def probability_figure(
    hypotheses: Sequence[tuple[str, float]], *, title: str = "", at_most: int = 12, accepted: int = 0
) -> Figure:
    """Return the probabilities of hypotheses as bars, in the order in which they are given.

    Parameters
    ----------
    hypotheses : sequence of (label, probability)
        The label is the bar's ``customdata``, for clicks.
    title : str
    at_most : int
        Number of hypotheses shown.
    accepted : int
        The one that is reported, in another colour.
    """
    shown = list(hypotheses)[:at_most]
    values, short = [float(p) for _, p in shown], _short(s for s, _ in shown)
    trace = {
        **BAR,
        "y": list(range(len(shown))),
        "x": values,
        "marker": {"color": [style.VERMILION if k == accepted else "#b9c3cd" for k in range(len(shown))]},
        "text": [percent(p) for p in values],
        "hovertext": [f"{plain(s)}: {percent(p)}" for s, p in shown],
        "customdata": [s for s, _ in shown],
    }
    hidden = len(hypotheses) - len(shown)
    more = f"; {hidden} less probable ones are not shown" if hidden else ""
    look = layout(
        80 + 30 * len(shown),
        title,
        legend=False,
        bargap=0.35,
        showlegend=False,
        meta={"short": short},
        xaxis=axis(
            f"probability{more}", range=[0, 1.25], tickvals=np.linspace(0, 1, 6).tolist(), tickformat=".0%"
        ),
        yaxis=rows_axis(short, showline=False),
    )
    return Figure([trace], look)


def error_bars_figure(
    names: Sequence[str],
    errors: Mapping[str, ArrayLike],
    *,
    floor_db: float | None = None,
    title: str = "",
    ylabel: str = "error [dB]",
    height: float = 320,
) -> Figure:
    """Return errors by sensor or by band as groups of bars, one colour for each model.

    Parameters
    ----------
    names : sequence of str
        Of the sensors or bands; each bar's ``customdata``, for clicks.
    errors : mapping of str to array_like (n,)
        By the model's label, in the order nominal, fitted, with the effect [dB].
    floor_db : float, optional
        Error that measurement noise alone would leave, drawn as a line [dB].
    title, ylabel : str
    height : float
        [pixel].
    """
    traces = []
    for n, (label, values) in enumerate(errors.items()):
        known = np.asarray(values, dtype=float)
        colour, pattern = style.model_style(label, n)[0], _hatch(("", "/", "x", ".")[n % 4])
        traces.append(
            {
                "type": "bar",
                "name": plain(label),
                "x": list(range(len(names))),
                "y": single(known),
                "marker": {"color": colour, "pattern": pattern},
                "hoverinfo": "text",
                "customdata": list(names),
                "hovertext": [
                    f"{plain(s)}<br>{v:.2f} dB, {plain(label)}" for s, v in zip(names, known, strict=True)
                ],
            }
        )
    shapes, notes = _floor_line(floor_db)
    words = [plain(shorten(s, 16)) for s in names]
    look = layout(
        height,
        title,
        barmode="group",
        bargap=0.25,
        shapes=shapes,
        annotations=notes,
        xaxis=named_axis(words, ticks="outside"),
        yaxis=axis(plain(ylabel), rangemode="tozero"),
    )
    return Figure(traces, look)
