"""Results of a search for the missing effect: ranking, steps, hypotheses, and place along a member."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from fem.lengths import shown_length
from fem.summary import percent
from viz import style
from viz.axes import number
from viz.chart import Axis, Chart, ChartMark, Curve, RowBars, Rule, Span, broken, columns, rows
from viz.layout import shorten

TWIN, OTHER = "#f2bf9b", "#b9c3cd"
"""Colours of the bars of candidates."""


def ranking(
    labels: Sequence[str],
    levels_db: ArrayLike,
    baseline_db: float,
    *,
    names: Sequence[str] | None = None,
    twins: Collection[int] = (),
    accepted: int | None = None,
    floor_db: float | None = None,
    title: str = "",
    xlabel: str = "error with the candidate [dB]",
    at_most: int = 20,
) -> Chart:
    """Describe the error that each candidate leaves as bars in the given order; a bar's length is its gain.

    The first is on top. Errors alone do not rank: what contains a candidate always leaves less. The axis
    begins at 0, so that a small gain looks small.

    Parameters
    ----------
    labels : sequence of str
        The most probable first.
    levels_db : array_like (n,)
        Error with each of them [dB].
    baseline_db : float
        Error without any of them [dB].
    names : sequence of str, optional
        The bars' ``data``, for clicks; the labels unless given.
    twins : collection of int
        Rows that these measurements cannot tell from the accepted one.
    accepted : int, optional
        Row of the candidate that was accepted.
    floor_db : float, optional
        Error that measurement noise alone would leave [dB].
    title, xlabel : str
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
    hidden, order = max(len(levels) - at_most, 0), list(range(len(levels)))[:at_most]
    ends = [*levels[order].tolist(), baseline_db, 0.0, *([] if floor_db is None else [floor_db])]
    pad = 0.08 * max(max(ends) - min(ends), 1e-3)
    low, high = min(ends) - pad, max(ends) + pad
    groups = {
        "accepted": (style.VERMILION, [k for k in order if k == accepted]),
        "indistinguishable from it": (TWIN, [k for k in order if k in twins and k != accepted]),
        "other": (OTHER, [k for k in order if k not in twins and k != accepted]),
    }
    marks: list[ChartMark] = [] if floor_db is None else _floor(floor_db, low, "x", "dB", 2)
    marks += [
        RowBars(
            y=[order.index(k) for k in some],
            x=levels[some],
            base=baseline_db,
            name=word,
            colour=colour,
            hatch="/" if colour == TWIN else "",
            text=[number(float(levels[k]), 2) for k in some],
            hover=[f"{labels[k]}\n{levels[k]:.3f} dB, {word}" for k in some],
            data=[names[k] for k in some],
        )
        for word, (colour, some) in groups.items()
        if some
    ]
    marks.append(Rule(value=baseline_db, text=f"without: {number(baseline_db, 2)} dB"))
    more = f"; {hidden} further ones are not shown" if hidden else ""
    words = [broken(shorten(str(labels[k]), 96), 50) for k in order]
    tallest = max((text.count("\n") for text in words), default=0)
    size = style.WIDTH, 1.25 + (0.3 + 0.06 * tallest) * len(order)
    height = 130 + (30 + 12 * tallest) * len(order)
    return Chart(marks, Axis(xlabel + more, (low, high)), rows(words), title, height, size)


def _floor(level: float, low: float, along: str, unit: str, digits: int) -> list[ChartMark]:
    """Return the noise floor, shaded from the beginning of the axis."""
    line = Rule(
        value=level,
        along=along,
        dash=":",
        colour=style.MUTED,
        text=f"noise floor {number(level, digits)} {unit}",
    )
    return [Span(low=low, high=level, along=along, colour=style.NOISE), line]


def probability(
    hypotheses: Sequence[tuple[str, float]], *, title: str = "", at_most: int = 12, accepted: int = 0
) -> Chart:
    """Describe the probabilities of hypotheses as bars, in the order in which they are given.

    Parameters
    ----------
    hypotheses : sequence of (label, probability)
        The label is the bar's ``data``, for clicks.
    title : str
    at_most : int
        Number of hypotheses shown.
    accepted : int
        The one that is reported, in another colour.
    """
    shown = list(enumerate(hypotheses))[:at_most]
    groups = [[one for one in shown if one[0] == accepted], [one for one in shown if one[0] != accepted]]
    bars = [
        RowBars(
            y=[k for k, _ in some],
            x=[float(p) for _, (_, p) in some],
            colour=colour,
            text=[percent(p) for _, (_, p) in some],
            hover=[f"{s}: {percent(p)}" for _, (s, p) in some],
            data=[s for _, (s, _) in some],
        )
        for some, colour in zip(groups, (style.VERMILION, OTHER), strict=True)
        if some
    ]
    hidden = len(hypotheses) - len(shown)
    more = f"; {hidden} less probable ones are not shown" if hidden else ""
    ticks = np.linspace(0, 1, 6).tolist()
    scale = Axis(f"probability{more}", (0, 1.25), (ticks, [f"{100 * t:.0f} %" for t in ticks]))
    named = rows([broken(shorten(s, 96), 50) for _, (s, _) in shown])
    return Chart(bars, scale, named, title, 80 + 30 * len(shown), (style.WIDTH, 0.9 + 0.3 * len(shown)))


def staircase(
    steps: Sequence[tuple[str, float, float | None]],
    floor_db: float | None = None,
    *,
    title: str = "",
    height: float = 340,
    ylabel: str = "error of the amplitude [dB]",
    unit: str = "dB",
    digits: int = 2,
    names: tuple[str, str] = ("on the lines of the fit", "on held-out lines"),
) -> Chart:
    """Describe the error of the nominal model, of the fitted one, and after each added effect.

    Parameters
    ----------
    steps : sequence of (label, fit_db, held_out_db or None)
        Error on the lines of the fit and on held-out ones after each step [dB, or ``unit``].
    floor_db : float, optional
        Error that measurement noise alone would leave [dB, or ``unit``].
    title : str
    height : float
        Of an interactive figure [pixel].
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
    higher = fit >= np.where(np.isfinite(held_out), held_out, -np.inf)
    series = [(fit, higher, style.FITTED, "-", "o"), (held_out, ~higher, style.VERMILION, "--", "D")]
    known = np.concatenate([fit, held_out, [0.0]])
    known = known[np.isfinite(known)]
    low, high = (known.min(), known.max()) if known.any() else (0.0, 1.0)
    room = 0.18 * (high - low)
    below = np.minimum(np.where(higher, np.inf, fit), np.where(higher, held_out, np.inf))
    if low >= 0 and (below < 0.6 * room).any():
        low -= 0.6 * room  # for the number below a point near the axis
    elif low < 0:
        low -= room
    low = float(low)
    marks = [] if floor_db is None or not np.isfinite(floor_db) else _floor(floor_db, low, "y", unit, digits)
    marks += [
        Curve(
            x=np.arange(n),
            y=values,
            name=name,
            colour=colour,
            dash=dash,
            width=2.4,
            symbol=symbol,
            treads=True,
            text=[number(v, digits) if np.isfinite(v) else "" for v in values],
            above=above.tolist(),
            hover=[
                f"{label}\n{number(v, digits)} {unit} {name}"
                for (label, *_), v in zip(steps, values, strict=True)
            ],
            data=[step[0] for step in steps],
        )
        for name, (values, above, colour, dash, symbol) in zip(names, series, strict=True)
        if np.isfinite(values).any()
    ]
    x = columns([broken(step[0], 18 if n <= 3 else 12) for step in steps])
    size = min(style.WIDTH, 2.6 + 1.15 * n), 3.4
    return Chart(marks, x, Axis(ylabel, (low, float(high + room))), title, height, size)


def error_bars(
    names: Sequence[str],
    errors: Mapping[str, ArrayLike],
    *,
    floor_db: float | None = None,
    title: str = "",
    label: str = "error [dB]",
) -> Chart:
    """Describe errors by sensor or by band as groups of bars, one colour for each model.

    Parameters
    ----------
    names : sequence of str
        Of the sensors or bands; each bar's ``data``, for clicks.
    errors : mapping of str to array_like (n,)
        By the model's label, in the order nominal, fitted, with the effect [dB].
    floor_db : float, optional
        Error that measurement noise alone would leave [dB].
    title, label : str
    """
    thickness = 0.75 / max(len(errors), 1)
    marks: list[ChartMark] = [] if floor_db is None else _floor(floor_db, 0.0, "x", "dB", 2)
    for n, (model, values) in enumerate(errors.items()):
        known = np.asarray(values, dtype=float)
        marks.append(
            RowBars(
                y=np.arange(known.size) + (n - (len(errors) - 1) / 2) * thickness,
                x=known,
                thickness=thickness,
                name=model,
                colour=style.model_style(model, n)[0],
                hatch=("", "/", "x")[n % 3],
                hover=[f"{s}\n{v:.2f} dB, {model}" for s, v in zip(names, known, strict=True)],
                data=names,
            )
        )
    row = 24 * max(len(errors), 1)
    named, size = rows([shorten(s, 16) for s in names]), (style.WIDTH, 1.1 + row * len(names) / 120)
    return Chart(marks, Axis(label), named, title, 110 + row * len(names), size)


def position(
    positions: ArrayLike,
    error_db: ArrayLike,
    best: float | None = None,
    interval: tuple[float, float] | None = None,
    sensors: ArrayLike = (),
    baseline: float | None = None,
    floor: float | None = None,
    member: str = "",
    title: str = "",
) -> Chart:
    """Describe the error over the place of an effect along a member.

    Parameters
    ----------
    positions : array_like (n,)
        Places, from the member's first end [m].
    error_db : array_like (n,)
        Error with the effect at each of them [dB].
    best : float, optional
        Estimated place [m]; that of the least error unless given.
    interval : (float, float), optional
        Confidence interval of the place [m].
    sensors : array_like
        Places of the sensors on the member, drawn as ticks [m].
    baseline, floor : float, optional
        Error without the effect, and that of noise alone [dB].
    member, title : str
        Name of the member, heading.
    """
    size, unit = shown_length(1.0)
    s, error = size * np.asarray(positions, dtype=float), np.asarray(error_db, dtype=float)
    best = float(s[np.argmin(error)]) if best is None else size * best
    at_best = float(np.interp(best, s, error))
    levels = [value for value in (baseline, floor) if value is not None]
    low, high = min([error.min(), at_best, *levels]), max([error.max(), *levels])
    pad = 0.14 * max(high - low, 1e-3)
    low, high = float(low - pad), float(high + pad)
    marks: list[ChartMark] = [] if floor is None else _floor(floor, low, "y", "dB", 1)
    if interval is not None:
        marks.append(
            Span(
                low=size * interval[0],
                high=size * interval[1],
                colour=style.HELD_OUT,
                name="confidence interval",
            )
        )
    if baseline is not None:
        without = f"without the effect {number(baseline, 1)} dB"
        marks.append(Rule(value=baseline, along="y", dash="--", text=without))
    marks += [
        Curve(x=s, y=error, dash="-", colour=style.FITTED, name="with the effect", hover="{y:.2f} dB"),
        Curve(x=[best], y=[at_best], symbol="o", colour=style.EFFECT, name=f"best at {best:.4g} {unit}"),
    ]
    places = size * np.asarray(sensors, dtype=float)
    if places.size:
        at = np.full(places.size, low + 0.03 * (high - low))
        marks.append(Curve(x=places, y=at, symbol="^", colour=style.SENSOR, name="sensors"))
    x = Axis(f"place along {member or 'the member'} [{unit}]", (float(s[0]), float(s[-1])))
    return Chart(marks, x, Axis("error [dB]", (low, high)), title, 290, (5.6, 2.9))
