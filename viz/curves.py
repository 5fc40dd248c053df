"""Curves, heat maps and bars as matplotlib figures; write them with :func:`viz.style.save`."""

import textwrap
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, MultipleLocator
from numpy.typing import ArrayLike, NDArray

from fem.analysis.frf import FRF
from viz import style
from viz.layout import shorten
from viz.style import figure_png, save

__all__ = [
    "figure_png",
    "plot_chance",
    "plot_frf",
    "plot_frf_error",
    "plot_joint_stiffness",
    "plot_mac",
    "plot_misfit_matrix",
    "plot_position",
    "plot_ranking",
    "plot_staircase",
    "save",
]

Band = tuple[float, float]

_WIDEST = 20.0
"""Bands are drawn no wider than this, which is beyond all axes, either way [nepers]."""


def plot_frf(
    measured: FRF,
    models: Mapping[str, FRF] | None = None,
    pairs: Sequence[tuple[str, str]] | None = None,
    floor: ArrayLike | None = None,
    held_out: Sequence[Band] = (),
    title: str = "",
    deviations: Mapping[str, ArrayLike] | None = None,
) -> Figure:
    """Plot amplitude and phase of measured FRFs and of models.

    Parameters
    ----------
    measured : FRF
        Drawn dark.
    models : mapping of str to FRF, optional
        By label, in the order nominal, fitted, with the effect; converted to the measured kind.
    pairs : sequence of (output, input), optional
        What to plot, by label; the first four pairs unless given.
    floor : array_like, optional
        Standard deviation of the measured FRF, of the shape of ``measured.H`` or one that broadcasts to it
        [unit of ``measured``].
    held_out : sequence of (low, high)
        Bands that were kept from the fit, shaded [Hz].
    title : str
        Heading.
    deviations : mapping of str to array_like, optional
        Standard deviation of ln|H| of some models, by label, of the shape of their H [-]; 95 % of what they
        allow is shaded.
    """
    models = {label: model.as_kind(measured.kind) for label, model in (models or {}).items()}
    pairs = _pairs(measured, pairs, 4)
    sigma = None if floor is None else np.broadcast_to(np.asarray(floor, dtype=float), measured.H.shape)
    columns = 1 if len(pairs) == 1 else 2
    rows = -(-len(pairs) // columns)
    with style.look():
        figure = style.new_figure(
            height=(0.25 if title else 0) + 0.55 + (3.2 if columns == 1 else 2.75) * rows
        )
        grid = figure.add_gridspec(2 * rows, columns, height_ratios=[2.6, 1] * rows)
        for k, (output, input_) in enumerate(pairs):
            r, c = divmod(k, columns)
            top = figure.add_subplot(grid[2 * r, c])
            low = figure.add_subplot(grid[2 * r + 1, c], sharex=top)
            i, j = measured.outputs.index(output), measured.inputs.index(input_)
            _shade(top, held_out)
            _shade(low, held_out)
            if sigma is not None:
                _floor_curve(top, measured.frequency, sigma[:, i, j])
            h = measured.H[:, i, j]
            _amplitude_phase(
                top, low, measured.frequency, h, "measured", color=style.MEASURED, linewidth=2.1, zorder=2
            )
            for n, (label, model) in enumerate(models.items()):
                colour, line = style.model_style(label, n)
                part = model.select([output], [input_]).H[:, 0, 0]
                if deviations is not None and label in deviations:
                    o, p = model.outputs.index(output), model.inputs.index(input_)
                    spread = 1.96 * np.asarray(deviations[label], dtype=float)[:, o, p]
                    wide = np.exp(np.minimum(spread, _WIDEST))
                    size = np.abs(part)
                    top.fill_between(
                        model.frequency,
                        size / wide,
                        size * wide,
                        color=colour,
                        alpha=0.25,
                        linewidth=0,
                        zorder=1.5,
                        label=f"{label}, 95 %",
                    )
                _amplitude_phase(
                    top,
                    low,
                    model.frequency,
                    part,
                    label,
                    color=colour,
                    linestyle=line,
                    linewidth=1.2,
                    zorder=3,
                )
            _frf_axes(top, low, measured, h, (output, input_), first=c == 0, last=k + columns >= len(pairs))
        legend_above(figure, title, _curve_keys(figure.axes[0], held_out, floor=floor is not None))
    return figure


def plot_frf_error(
    measured: FRF,
    models: Mapping[str, FRF],
    pairs: Sequence[tuple[str, str]] | None = None,
    floor: ArrayLike | None = None,
    held_out: Sequence[Band] = (),
    smooth: int = 1,
    title: str = "",
) -> Figure:
    """Plot the error of models over frequency, 10 lg (Σ |H_model - H|² / Σ |H|²), summed over pairs.

    Parameters
    ----------
    measured : FRF
    models : mapping of str to FRF
        By label, on the measured lines.
    pairs : sequence of (output, input), optional
        What to sum over; all unless given.
    floor : array_like, optional
        Standard deviation of the measured FRF, of the shape of ``measured.H`` or one that broadcasts to it.
    held_out : sequence of (low, high)
        Bands that were kept from the fit, shaded [Hz].
    smooth : int
        Number of lines over which both sums run, to calm noisy curves.
    title : str
        Heading.

    Raises
    ------
    ValueError
        If a model is not on the measured lines.
    """
    pairs = _pairs(measured, pairs, None)
    index = [(measured.outputs.index(o), measured.inputs.index(i)) for o, i in pairs]
    rows, cols = (np.array(k) for k in zip(*index, strict=True))
    H = measured.H[:, rows, cols]
    power = _moving(np.sum(np.abs(H) ** 2, axis=1), smooth)
    power = np.where(power > 0, power, np.nan)  # no curve where nothing was measured
    with style.look():
        figure = style.new_figure(height=2.9)
        ax = figure.add_subplot()
        _shade(ax, held_out)
        noise = np.zeros(measured.n_freq)
        if floor is not None:
            sigma = np.broadcast_to(np.asarray(floor, dtype=float), measured.H.shape)[:, rows, cols]
            noise = 10 * np.log10(_moving(np.sum(sigma**2, axis=1), smooth) / power)
            ax.fill_between(measured.frequency, noise, -400, color=style.NOISE, linewidth=0, zorder=0.5)
        span = []
        for n, (label, model) in enumerate(models.items()):
            if model.n_freq != measured.n_freq or not np.allclose(model.frequency, measured.frequency):
                msg = f"model '{label}' has {model.n_freq} lines, not the {measured.n_freq} measured ones"
                raise ValueError(msg)
            part = model.as_kind(measured.kind)
            got = np.stack([part.select([o], [i]).H[:, 0, 0] for o, i in pairs], axis=1)
            error = 10 * np.log10(
                np.maximum(_moving(np.sum(np.abs(got - H) ** 2, axis=1), smooth) / power, 1e-30)
            )
            colour, line = style.model_style(label, n)
            ax.plot(measured.frequency, error, color=colour, linestyle=line, label=label, linewidth=1.2)
            span += [np.nanpercentile(error, 1), np.nanmax(error)]
        low, high = (min(span), max(span)) if span else (-60.0, 0.0)
        if floor is not None:
            low = min(low, float(np.nanmedian(noise)) - 3)
        ax.set_ylim(low - 4, high + 4)
        ax.set_xlim(measured.frequency[0], measured.frequency[-1])
        ax.set_xlabel("frequency [Hz]")
        ax.set_ylabel("relative error [dB]")
        legend_above(figure, title, _curve_keys(ax, held_out, floor=floor is not None))
    return figure


def plot_misfit_matrix(
    values: ArrayLike,
    outputs: Sequence[str],
    bands: Sequence[Band | str],
    label: str = "misfit [dB]",
    limits: tuple[float, float] | None = None,
    title: str = "",
) -> Figure:
    """Plot the misfit of each sensor in each band as a heat map, with its numbers while they fit.

    Parameters
    ----------
    values : array_like (n_outputs, n_bands)
        Misfit [dB]; NaN where there is none.
    outputs : sequence of str
        Names of the sensors.
    bands : sequence of (low, high) or str
        Frequency bands [Hz] or names.
    label : str
        What the colours show, with unit.
    limits : (float, float), optional
        Ends of the colour bar.
    title : str
        Heading.
    """
    values = np.array(values, dtype=float, ndmin=2)
    words = [band if isinstance(band, str) else f"{band[0]:.4g}–{band[1]:.4g}" for band in bands]
    if values.shape != (len(outputs), len(words)):
        msg = f"values have shape {values.shape} for {len(outputs)} outputs and {len(words)} bands"
        raise ValueError(msg)
    n, m = values.shape
    row = 0.19 if n <= 40 else 0.135
    with style.look():
        width = float(np.clip(2.0 + 0.62 * m, 4.0, style.WIDTH))
        figure = style.new_figure(width, 0.95 + 0.2 * bool(title) + max(row * n, 1.2))
        ax = figure.add_subplot()
        lo, hi = limits if limits else (np.nanmin(values), np.nanmax(values))
        norm = Normalize(lo, hi if hi > lo else lo + 1)
        image = _heat(ax, values, style.misfit_map(), norm, _digits(hi - lo), numbers=m <= 12 and n <= 40)
        size = 7.5 if n <= 40 else 6
        ax.set_yticks(range(n), outputs, fontsize=size)
        tilted = m > 8 or max(map(len, words)) > 9
        ax.set_xticks(
            range(m), words, fontsize=7.5, rotation=40 if tilted else 0, ha="right" if tilted else "center"
        )
        ax.set_xlabel("band [Hz]" if not all(isinstance(band, str) for band in bands) else "band")
        ax.set_ylabel("sensor")
        if title:
            ax.set_title(title)
        bar = figure.colorbar(image, ax=ax, fraction=0.05, pad=0.02, aspect=30)
        bar.set_label(label)
        bar.outline.set_visible(False)
    return figure


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
    """Plot the error that each candidate effect leaves, the best on top; a bar's length is what it gains.

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
        low, high = float(min(ends)), float(max(ends))
        pad = 0.14 * max(high - low, 1e-3)
        if floor is not None:
            ax.axvspan(low - 10 * pad, floor, color=style.NOISE, linewidth=0, zorder=0)
            ax.axvline(floor, color=style.MUTED, linewidth=0.9, linestyle=":", zorder=1)
        digits = _digits(high - low)
        for y, k in enumerate(order):
            name = labels[k]
            colour = style.EFFECT if name == accepted else "#f2bf9b" if name in twins else "#b9c3cd"
            hatch = "////" if name in twins and name != accepted else None
            ax.barh(y, error[k] - baseline, left=baseline, height=0.66, color=colour, hatch=hatch,
                    edgecolor="white" if hatch else colour, linewidth=0)  # fmt: skip
            gains = error[k] <= baseline
            ax.annotate(
                _number(float(error[k]), digits), (error[k], y), xytext=(-4 if gains else 4, 0),
                textcoords="offset points", ha="right" if gains else "left", va="center", fontsize=7.5,
                weight="bold" if name == accepted else "normal",
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.75},
            )  # fmt: skip
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
                    label="cannot be told from it",
                )
            )
        keys.append(Patch(color="#b9c3cd", label="other candidates"))
        keys.append(
            ax.plot([], [], color=style.INK, linewidth=1, label=f"without: {_number(baseline, digits)} dB")[0]
        )
        if floor is not None:
            keys.append(
                Patch(
                    facecolor=style.NOISE,
                    edgecolor=style.MUTED,
                    linestyle=":",
                    label=f"noise floor: {_number(floor, digits)} dB",
                )
            )
        legend_above(figure, title, keys)
    return figure


def plot_chance(
    by_chance: ArrayLike,
    found: float | None = None,
    label: str = "",
    title: str = "",
    xlabel: str = "factor by which the residual level falls [-]",
) -> Figure:
    """Plot what the best candidate gains in simulated measurements without an effect, and what it gains.

    Parameters
    ----------
    by_chance : array_like (n,)
        Gains in the simulated measurements, factors [-].
    found : float, optional
        Gain of the effect in the measurement [-].
    label : str
        What the effect is.
    title, xlabel : str
        Heading and axis label.
    """
    gains = np.sort(np.asarray(by_chance, dtype=float))
    every = gains if found is None else np.append(gains, found)
    wide = every.max() > 3 * max(gains.max(), 1.0)
    with style.look():
        figure = style.new_figure(5.6, 2.2 + (0.2 if title else 0))
        ax = figure.add_subplot()
        if wide:
            ax.set_xscale("log")
        low, high = float(min(every.min(), 1.0)), float(max(every.max(), 1.0 + 1e-3))
        pad = 0.06
        ends = (low / (high / low) ** pad, high * (high / low) ** pad) if wide else (
            low - pad * (high - low), high + pad * (high - low)
        )  # fmt: skip
        ax.set_xlim(*ends)
        at = np.log(gains / ends[0]) / np.log(ends[1] / ends[0]) if wide else (gains - ends[0]) / np.ptp(ends)
        height = np.zeros(gains.size)
        for k in range(gains.size):  # dots that would lie on one another are stacked
            near = height[:k][at[k] - at[:k] < 0.018]
            height[k] = min(set(range(k + 1)) - set(near))
        ax.plot(gains, height + 0.5, "o", color=style.FITTED, markersize=5, markeredgecolor="white",
                linewidth=0, label=f"simulated without it ({gains.size})")  # fmt: skip
        if found is not None:
            ax.axvline(found, color=style.EFFECT, linewidth=1.6, label=shorten(label, 60) or "measured")
        ax.axvline(1.0, color=style.INK, linewidth=0.8, linestyle=":")
        ax.set_ylim(0, max(float(height.max(initial=0)) + 1.5, 4))
        ax.set_yticks([])
        ax.spines["left"].set_visible(False)
        ax.grid(visible=False, axis="y")
        if wide:
            ax.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
            ax.xaxis.set_minor_formatter(lambda x, _: f"{x:g}" if high < 20 * low else "")
        ax.set_xlabel(xlabel)
        legend_above(figure, title, _curve_keys(ax))
    return figure


def plot_staircase(
    steps: Sequence[tuple[str, float, float | None]],
    floor_db: float | None = None,
    title: str = "",
    ylabel: str = "relative error [dB]",
) -> Figure:
    """Plot how the error falls from the nominal model over the fitted one to each added effect.

    Parameters
    ----------
    steps : sequence of (label, fit_db, held_out_db or None)
        Error on the lines of the fit and on held-out ones after each step [dB].
    floor_db : float, optional
        Error that measurement noise alone would leave [dB].
    title, ylabel : str
        Heading and axis label.
    """
    fit = np.array([step[1] for step in steps], dtype=float)
    held = np.array([np.nan if step[2] is None else step[2] for step in steps], dtype=float)
    n = len(steps)
    values = np.concatenate([fit, held[np.isfinite(held)], [] if floor_db is None else [floor_db]])
    low, high = float(values.min()), float(values.max())
    pad = 0.16 * max(high - low, 1.0)
    with style.look():
        figure = style.new_figure(min(style.WIDTH, 2.6 + 1.15 * n), 3.4)
        ax = figure.add_subplot()
        if floor_db is not None:
            ax.axhspan(low - 10 * pad, floor_db, color=style.NOISE, linewidth=0, zorder=0)
            ax.axhline(floor_db, color=style.MUTED, linewidth=0.9, linestyle=":", zorder=1)
            ax.annotate(
                f"noise floor {_number(floor_db, 1)} dB", (-0.5, floor_db), xytext=(3, -3),
                textcoords="offset points", ha="left", va="top", fontsize=7.5, color=style.MUTED,
            )  # fmt: skip
        series = [(fit, style.FITTED, "-", "on the lines of the fit", 1)]
        if np.isfinite(held).any():
            series.append((held, style.VERMILION, "--", "on held-out lines", -1))
        for data, colour, line, name, _ in series:
            for k in range(n):
                ax.plot([k - 0.36, k + 0.36], [data[k]] * 2, color=colour, linewidth=2.6,
                        solid_capstyle="butt", zorder=3, label=name if k == 0 else None)  # fmt: skip
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
            both = np.isfinite(held[k])
            fit_above = not both or fit[k] > held[k]
            for data, colour, above in (
                (fit, style.FITTED, fit_above),
                (held, style.VERMILION, not fit_above),
            ):
                if np.isfinite(data[k]):
                    ax.annotate(
                        _number(data[k], 1), (k, data[k]), xytext=(0, 4 if above else -4),
                        textcoords="offset points", ha="center", va="bottom" if above else "top",
                        fontsize=8, color=colour, weight="bold", zorder=4,
                        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.8},
                    )  # fmt: skip
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


def plot_mac(
    mac: ArrayLike,
    labels: tuple[Sequence[str], Sequence[str]],
    names: tuple[str, str] = ("measured", "computed"),
    title: str = "",
) -> Figure:
    """Plot a matrix of modal assurance criteria.

    Parameters
    ----------
    mac : array_like (n_a, n_b)
        Values from 0 to 1 [-].
    labels : (sequence of n_a str, sequence of n_b str)
        Names of the modes, such as their frequencies with unit.
    names : (str, str)
        What the rows and the columns are.
    title : str
        Heading.
    """
    mac = np.array(mac, dtype=float, ndmin=2)
    n, m = mac.shape
    if (len(labels[0]), len(labels[1])) != (n, m):
        msg = f"the MAC has shape {mac.shape} for {len(labels[0])} and {len(labels[1])} labels"
        raise ValueError(msg)
    cell = 0.42 if max(n, m) <= 12 else 0.24
    with style.look():
        figure = style.new_figure(
            float(np.clip(1.9 + cell * m, 3.4, style.WIDTH)),
            float(np.clip(1.3 + cell * n, 2.6, 9)) + 0.2 * bool(title),
        )
        ax = figure.add_subplot()
        image = _heat(ax, mac, style.agreement_map(), Normalize(0, 1), 2, numbers=max(n, m) <= 12)
        ax.set_aspect("equal")
        figure.set_layout_engine("compressed")
        ax.set_yticks(range(n), labels[0], fontsize=7.5)
        ax.set_xticks(range(m), labels[1], fontsize=7.5, rotation=40, ha="right", rotation_mode="anchor")
        ax.set_ylabel(names[0])
        ax.set_xlabel(names[1])
        if title:
            ax.set_title(title)
        bar = figure.colorbar(image, ax=ax, fraction=0.05, pad=0.03, aspect=25)
        bar.set_label("MAC [-]")
        bar.outline.set_visible(False)
    return figure


def plot_joint_stiffness(
    frequency: ArrayLike,
    Z: ArrayLike,
    names: Sequence[str],
    models: Mapping[str, ArrayLike] | None = None,
    held_out: Sequence[Band] = (),
    title: str = "",
) -> Figure:
    """Plot real and imaginary part of the diagonal of a joint's dynamic stiffness Z_j(ω).

    Parameters
    ----------
    frequency : array_like (n_freq,)
        Frequencies [Hz].
    Z : array_like (n_freq, n, n) or (n_freq, n)
        Identified dynamic stiffness, or its diagonal [N/m or N·m/rad]; NaN where it was not identified.
    names : sequence of str
        Directions, such as ``"z"`` or ``"U11:rz"``; those that end in rx, ry, rz have the unit N·m/rad.
    models : mapping of str to array_like, optional
        Fitted models of the joint, of the shape of ``Z``, by label.
    held_out : sequence of (low, high)
        Bands that were kept from the fit, shaded [Hz].
    title : str
        Heading.
    """
    f = np.asarray(frequency, dtype=float)

    def diagonal(values: ArrayLike) -> NDArray[Any]:
        array = np.asarray(values)
        array = np.einsum("fii->fi", array) if array.ndim == 3 else array
        if array.shape != (f.size, len(names)):
            msg = f"diag Z has shape {array.shape} for {f.size} frequencies and {len(names)} directions"
            raise ValueError(msg)
        return array

    data = diagonal(Z)
    curves = {label: diagonal(values) for label, values in (models or {}).items()}
    n = len(names)
    with style.look():
        figure = style.new_figure(height=0.75 + (0.2 if title else 0) + max(1.45 * n, 1.9))
        axes = figure.subplots(n, 2, sharex=True, squeeze=False)
        for i, name in enumerate(names):
            subscript = name.replace("_", r"\_").replace(" ", r"\ ")
            unit = "N·m/rad" if name.lower()[-2:] in ("rx", "ry", "rz") else "N/m"
            for ax, part, word in zip(axes[i], (np.real, np.imag), ("Re", "Im"), strict=True):
                values = part(data[:, i])
                fitted = [part(curve[:, i]) for curve in curves.values()]
                factor, prefix = _prefix(
                    np.concatenate([values, *fitted]) if not fitted else np.concatenate(fitted)
                )
                _shade(ax, held_out)
                ax.axhline(0, color=style.MUTED, linewidth=0.6)
                ax.plot(
                    f,
                    values / factor,
                    ".",
                    color=style.MEASURED,
                    markersize=2.2,
                    label="identified",
                    zorder=2,
                )
                for k, (label, curve) in enumerate(zip(curves, fitted, strict=True)):
                    colour, line = style.model_style(label, k + 2)
                    ax.plot(
                        f, curve / factor, color=colour, linestyle=line, linewidth=1.5, label=label, zorder=3
                    )
                _robust_limits(ax, values / factor, [curve / factor for curve in fitted])
                ax.set_ylabel(f"{word} $Z_{{\\mathrm{{{subscript}}}}}$ [{prefix}{unit}]")
                ax.set_xlim(f[0], f[-1])
        for ax in axes[-1]:
            ax.set_xlabel("frequency [Hz]")
        figure.align_ylabels()
        legend_above(figure, title, _curve_keys(axes[0, 0], held_out))
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
        Error without the effect, and what noise alone would leave [dB].
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
        ax.plot(best, at_best, "o", color=style.EFFECT, markersize=6, markeredgecolor="white", zorder=4,
                label=f"best at {best:.4g} m")  # fmt: skip
        places = np.asarray(sensors, dtype=float)
        if places.size:
            ax.plot(places, np.full(places.size, 0.025), "^", transform=ax.get_xaxis_transform(),
                    color=style.SENSOR, markersize=4, label="sensors", clip_on=False)  # fmt: skip
        ax.set_xlim(s[0], s[-1])
        ax.set_ylim(low - pad, high + pad)
        ax.set_xlabel(f"place along {member} [m]" if member else "place along the member [m]")
        ax.set_ylabel("error [dB]")
        legend_above(figure, title, _curve_keys(ax))
    return figure


def _pairs(frf: FRF, pairs: Sequence[tuple[str, str]] | None, at_most: int | None) -> list[tuple[str, str]]:
    if pairs is None:
        return [(o, i) for i in frf.inputs for o in frf.outputs][:at_most]
    for output, input_ in pairs:
        frf.select([output], [input_])
    return list(pairs)


def _amplitude_phase(
    top: Axes, low: Axes, f: NDArray[np.float64], h: NDArray[np.complex128], label: str, **look: Any
) -> None:
    top.semilogy(f, np.abs(h), label=label, **look)
    phase = np.rad2deg(np.angle(h))
    wraps = np.flatnonzero(np.abs(np.diff(phase)) > 180) + 1
    low.plot(np.insert(f, wraps, f[wraps]), np.insert(phase, wraps, np.nan), **look)


def _frf_axes(
    top: Axes,
    low: Axes,
    frf: FRF,
    h: NDArray[np.complex128],
    pair: tuple[str, str],
    *,
    first: bool,
    last: bool,
) -> None:
    top.set_title(f"{pair[0]} / {pair[1]}")
    size = np.abs(h[np.abs(h) > 0])
    if size.size:
        bottom, ceiling = np.log10([np.percentile(size, 0.3), size.max()])
        room = 0.12 * max(ceiling - bottom, 1)
        top.set_ylim(10 ** (bottom - room), 10 ** (ceiling + room))
    top.set_xlim(frf.frequency[0], frf.frequency[-1])
    low.set_ylim(-190, 190)
    low.yaxis.set_major_locator(MultipleLocator(180))
    low.yaxis.set_minor_locator(MultipleLocator(90))
    top.tick_params(labelbottom=False)
    if first:
        top.set_ylabel(f"{frf.kind} [{frf.kind.unit}]")
        low.set_ylabel("phase [°]")
    else:
        low.tick_params(labelleft=False)
    if last:
        low.set_xlabel("frequency [Hz]")


def _shade(ax: Axes, bands: Sequence[Band]) -> None:
    for low, high in bands:
        ax.axvspan(low, high, color=style.HELD_OUT, linewidth=0, zorder=0)


def _floor_curve(ax: Axes, f: NDArray[np.float64], sigma: NDArray[np.float64]) -> None:
    ax.fill_between(f, np.maximum(sigma, 1e-300), 1e-300, color=style.NOISE, linewidth=0, zorder=0.5)


def _curve_keys(ax: Axes, held_out: Sequence[Band] = (), *, floor: bool = False) -> list[Any]:
    keys: list[Any] = list(ax.get_legend_handles_labels()[0])
    if held_out:
        keys.append(
            Patch(facecolor=style.HELD_OUT, edgecolor="#e6d9a8", linewidth=0.5, label="held out from the fit")
        )
    if floor:
        keys.append(Patch(color=style.NOISE, label="below the noise, 1 σ"))
    return keys


def legend_above(figure: Figure, title: str, keys: Sequence[Any]) -> None:
    """Set the heading and the legend above the axes, in as many columns as the width allows."""
    longest = max((len(str(key.get_label())) for key in keys), default=1)
    columns = max(1, int(figure.get_figwidth() / (0.6 + 0.066 * longest)))
    legend = figure.legend(
        handles=keys,
        loc="outside upper left",
        ncols=min(columns, len(keys)),
        columnspacing=1.4,
        title=title or None,
    )
    legend.set_alignment("left")
    legend.get_title().set(fontsize=9.5, fontweight="bold")


def _heat(
    ax: Axes, values: NDArray[np.float64], cmap: Any, norm: Normalize, digits: int, *, numbers: bool
) -> Any:
    """Draw a matrix as coloured cells with white seams and, if wanted, its numbers."""
    n, m = values.shape
    cmap = cmap.with_extremes(bad="#f0f1f3")
    image = ax.imshow(values, cmap=cmap, norm=norm, aspect="auto", interpolation="nearest")
    ax.grid(visible=False)
    ax.set_xticks(np.arange(m + 1) - 0.5, minor=True)
    ax.set_yticks(np.arange(n + 1) - 0.5, minor=True)
    ax.grid(visible=True, which="minor", color="white", linewidth=0.8, alpha=1)
    ax.tick_params(which="both", length=0)
    for spine in ax.spines.values():
        spine.set_visible(False)
    if numbers:
        for (i, j), value in np.ndenumerate(values):
            if np.isfinite(value):
                ink = style.ink_on(cmap(norm(value)))
                ax.text(j, i, _number(value, digits), ha="center", va="center", fontsize=6.8, color=ink)
    return image


def _robust_limits(ax: Axes, data: NDArray[np.float64], fitted: Sequence[NDArray[np.float64]]) -> None:
    """Show the fitted curves and the bulk of the identified values, but not every outlier."""
    finite = data[np.isfinite(data)]
    bulk = np.percentile(finite, [4, 96]) if finite.size else np.array([0.0, 1.0])
    low = min([float(bulk[0]), 0.0, *(float(np.nanmin(c)) for c in fitted)])
    high = max([float(bulk[1]), 0.0, *(float(np.nanmax(c)) for c in fitted)])
    pad = 0.15 * max(high - low, 1e-12)
    ax.set_ylim(low - pad, high + pad)
    ax.yaxis.set_major_locator(MaxNLocator(4))


def _prefix(values: NDArray[np.float64]) -> tuple[float, str]:
    finite = np.abs(values[np.isfinite(values)])
    size = float(np.percentile(finite, 90)) if finite.size else 1.0
    for factor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if size >= factor:
            return factor, prefix
    return 1.0, ""


def _moving(values: NDArray[np.float64], lines: int) -> NDArray[np.float64]:
    if lines <= 1:
        return values
    kernel = np.ones(min(lines, values.size))
    return np.convolve(values, kernel, "same") / np.convolve(np.ones(values.size), kernel, "same")


def _number(value: float, digits: int) -> str:
    """Return a number with a proper minus sign."""
    return f"{value:.{digits}f}".replace("-", "−")


def _digits(span: float) -> int:
    return 1 if span >= 2 else 2
