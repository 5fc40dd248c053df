"""Results of a search for the missing effect: ranking, steps, and place along a member."""

import textwrap
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from viz import style
from viz.axes import curve_keys, digits_for, legend_above, number
from viz.layout import shorten


def plot_ranking(
    labels: Sequence[str],
    error_db: ArrayLike,
    baseline: float,
    floor: float | None = None,
    twins: Collection[str] = (),
    accepted: str | None = None,
    title: str = "",
    xlabel: str = "error after fitting the effect [dB]",
    at_most: int = 20,
) -> Figure:
    """Plot the error that each candidate effect leaves, the best on top; a bar's length is its gain.

    Parameters
    ----------
    labels : sequence of str
        Names of the candidates; they must differ.
    error_db : array_like (n,)
        Error with each of them [dB].
    baseline : float
        Error without any of them [dB].
    floor : float, optional
        Error that measurement noise alone would leave [dB].
    twins : collection of str
        Candidates that these measurements cannot tell from the accepted one.
    accepted : str, optional
        The candidate that was accepted.
    title, xlabel : str
        Heading and axis label.
    at_most : int
        Number of candidates shown.
    """
    error = np.asarray(error_db, dtype=float)
    if len(labels) != error.size:
        msg = f"{len(labels)} labels are given for {error.size} errors"
        raise ValueError(msg)
    order = np.argsort(error, kind="stable")
    left_out = max(order.size - at_most, 0)
    order = order[:at_most]
    n = order.size
    with style.look():
        figure = style.new_figure(height=1.25 + 0.25 * n + (0.2 if title else 0))
        ax = figure.add_subplot()
        ends = [*error[order], baseline] + ([floor] if floor is not None else [])
        low, high = float(min(*ends, 0.0)), float(max(*ends, 0.0))  # from 0: a small gain looks small
        pad = 0.08 * max(high - low, 1e-3)
        if floor is not None:
            ax.axvspan(low - pad, floor, color=style.NOISE, linewidth=0, zorder=0)
            ax.axvline(floor, color=style.MUTED, linewidth=0.9, linestyle=":", zorder=1)
        digits = digits_for(high - low)
        for y, k in enumerate(order):
            name = labels[k]
            colour = style.EFFECT if name == accepted else "#f2bf9b" if name in twins else "#b9c3cd"
            hatch = "////" if name in twins and name != accepted else None
            ax.barh(
                y,
                error[k] - baseline,
                left=baseline,
                height=0.66,
                color=colour,
                hatch=hatch,
                edgecolor="white" if hatch else colour,
                linewidth=0,
            )
            gains = error[k] <= baseline
            ax.annotate(
                number(float(error[k]), digits),
                (error[k], y),
                xytext=(-4 if gains else 4, 0),
                textcoords="offset points",
                ha="right" if gains else "left",
                va="center",
                fontsize=7.5,
                weight="bold" if name == accepted else "normal",
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.75},
            )
        ax.axvline(baseline, color=style.INK, linewidth=1)
        ax.set_xlim(low - pad, high + pad)
        ax.set_ylim(n - 0.4, -0.6)
        ax.set_yticks(range(n), [shorten(str(labels[k]), 52) for k in order])
        for tick, k in zip(ax.get_yticklabels(), order, strict=True):
            tick.set_fontweight("bold" if labels[k] == accepted else "normal")
        ax.grid(visible=False, axis="y")
        ax.tick_params(axis="y", length=0)
        ax.spines["left"].set_visible(False)
        ax.set_xlabel(xlabel + (f"; {left_out} worse candidates not shown" if left_out else ""))
        keys: list[Any] = []
        if accepted in labels:
            keys.append(Patch(color=style.EFFECT, label="accepted"))
        if twins:
            keys.append(
                Patch(
                    facecolor="#f2bf9b",
                    hatch="////",
                    edgecolor="white",
                    linewidth=0,
                    label="indistinguishable from it",
                )
            )
        keys.append(Patch(color="#b9c3cd", label="other candidates"))
        keys.append(
            ax.plot([], [], color=style.INK, linewidth=1, label=f"without: {number(baseline, digits)} dB")[0]
        )
        if floor is not None:
            keys.append(
                Patch(
                    facecolor=style.NOISE,
                    edgecolor=style.MUTED,
                    linestyle=":",
                    label=f"noise floor: {number(floor, digits)} dB",
                )
            )
        legend_above(figure, title, keys)
    return figure


def plot_staircase(
    steps: Sequence[tuple[str, float, float | None]],
    floor_db: float | None = None,
    title: str = "",
    ylabel: str = "relative error [dB]",
    *,
    unit: str = "dB",
    digits: int = 1,
    names: tuple[str, str] = ("on the lines of the fit", "on held-out lines"),
) -> Figure:
    """Plot the error of the nominal model, of the fitted one, and after each added effect.

    Parameters
    ----------
    steps : sequence of (label, fit_db, held_out_db or None)
        Error on the lines of the fit and on held-out ones after each step [dB, or ``unit``].
    floor_db : float, optional
        Error that measurement noise alone would leave [dB, or ``unit``].
    title, ylabel : str
        Heading and axis label.
    unit : str
        Of other errors.
    digits : int
        After the point.
    names : (str, str)
        Of what was fitted and what was held out.
    """
    fit = np.array([step[1] for step in steps], dtype=float)
    held_out = np.array([np.nan if step[2] is None else step[2] for step in steps], dtype=float)
    n = len(steps)
    values = np.concatenate([fit, held_out[np.isfinite(held_out)], [] if floor_db is None else [floor_db]])
    low, high = float(values.min()), float(values.max())
    pad = 0.16 * max(high - low, 10.0 ** (1 - digits))
    with style.look():
        figure = style.new_figure(min(style.WIDTH, 2.6 + 1.15 * n), 3.4)
        ax = figure.add_subplot()
        if floor_db is not None:
            ax.axhspan(low - 10 * pad, floor_db, color=style.NOISE, linewidth=0, zorder=0)
            ax.axhline(floor_db, color=style.MUTED, linewidth=0.9, linestyle=":", zorder=1)
            ax.annotate(
                f"noise floor {number(floor_db, digits)} {unit}",
                (-0.5, floor_db),
                xytext=(3, -3),
                textcoords="offset points",
                ha="left",
                va="top",
                fontsize=7.5,
                color=style.MUTED,
            )
        series = [(fit, style.FITTED, "-", names[0], 1)]
        if np.isfinite(held_out).any():
            series.append((held_out, style.VERMILION, "--", names[1], -1))
        for data, colour, line, name, _ in series:
            for k in range(n):
                ax.plot(
                    [k - 0.36, k + 0.36],
                    [data[k]] * 2,
                    color=colour,
                    linewidth=2.6,
                    solid_capstyle="butt",
                    zorder=3,
                    label=name if k == 0 else None,
                )
                if k + 1 < n and np.isfinite(data[k : k + 2]).all():
                    ax.plot(
                        [k + 0.36, k + 0.64],
                        data[k : k + 2],
                        color=colour,
                        linewidth=1,
                        linestyle=line,
                        zorder=2,
                    )
        for k in range(n):
            both = np.isfinite(held_out[k])
            fit_above = not both or fit[k] > held_out[k]
            for data, colour, above in (
                (fit, style.FITTED, fit_above),
                (held_out, style.VERMILION, not fit_above),
            ):
                if np.isfinite(data[k]):
                    ax.annotate(
                        number(data[k], digits),
                        (k, data[k]),
                        xytext=(0, 4 if above else -4),
                        textcoords="offset points",
                        ha="center",
                        va="bottom" if above else "top",
                        fontsize=8,
                        color=colour,
                        weight="bold",
                        zorder=4,
                        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.8},
                    )
        ax.set_ylim(low - pad, high + pad)
        ax.set_xlim(-0.5, n - 0.5)
        wide = max(9, int(70 / max(n, 1)))
        ax.set_xticks(range(n), ["\n".join(textwrap.wrap(step[0], wide)) for step in steps])
        ax.tick_params(axis="x", length=0)
        ax.grid(visible=False, axis="x")
        ax.set_ylabel(ylabel)
        if len(series) > 1:
            ax.legend(loc="upper right")
        if title:
            ax.set_title(title)
    return figure


def plot_position(
    positions: ArrayLike,
    error_db: ArrayLike,
    best: float | None = None,
    interval: tuple[float, float] | None = None,
    sensors: ArrayLike = (),
    baseline: float | None = None,
    floor: float | None = None,
    member: str = "",
    title: str = "",
) -> Figure:
    """Plot the error over the place of an effect along a member.

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
    s, error = np.asarray(positions, dtype=float), np.asarray(error_db, dtype=float)
    best = float(s[np.argmin(error)]) if best is None else best
    at_best = float(np.interp(best, s, error))
    with style.look():
        figure = style.new_figure(5.6, 2.9)
        ax = figure.add_subplot()
        levels = [value for value in (baseline, floor) if value is not None]
        low, high = min([error.min(), at_best, *levels]), max([error.max(), *levels])
        pad = 0.14 * max(high - low, 1e-3)
        if floor is not None:
            ax.axhspan(low - 10 * pad, floor, color=style.NOISE, linewidth=0, zorder=0, label="noise floor")
        if interval is not None:
            ax.axvspan(*interval, color=style.EFFECT, alpha=0.14, linewidth=0, label="confidence interval")
        if baseline is not None:
            ax.axhline(baseline, color=style.INK, linewidth=0.9, linestyle="--", label="without the effect")
        ax.plot(s, error, color=style.FITTED, label="with the effect")
        ax.plot(
            best,
            at_best,
            "o",
            color=style.EFFECT,
            markersize=6,
            markeredgecolor="white",
            zorder=4,
            label=f"best at {best:.4g} m",
        )
        places = np.asarray(sensors, dtype=float)
        if places.size:
            ax.plot(
                places,
                np.full(places.size, 0.025),
                "^",
                transform=ax.get_xaxis_transform(),
                color=style.SENSOR,
                markersize=4,
                label="sensors",
                clip_on=False,
            )
        ax.set_xlim(s[0], s[-1])
        ax.set_ylim(low - pad, high + pad)
        ax.set_xlabel(f"place along {member} [m]" if member else "place along the member [m]")
        ax.set_ylabel("error [dB]")
        legend_above(figure, title, curve_keys([ax]))
    return figure
