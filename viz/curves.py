"""FRFs over frequency as matplotlib figures; write them with :func:`viz.style.save`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import ArrayLike, NDArray

from fem.analysis.frf import FRF
from viz import style
from viz.axes import Band, curve_keys, legend_above, shade

_WIDEST_BAND = 20.0
"""Bands are drawn no wider than this, which is beyond all axes, either way [nepers]."""


def plot_frf(
    measured: FRF,
    models: Mapping[str, FRF] | None = None,
    pairs: Sequence[tuple[str, str]] | None = None,
    floor: ArrayLike | None = None,
    held_out: Sequence[Band] = (),
    title: str = "",
    deviations: Mapping[str, ArrayLike] | None = None,
    label: str = "measured",
    compared: ArrayLike | None = None,
) -> Figure:
    """Plot amplitude and phase of measured FRFs and of models; of amplitudes without phase these alone.

    Parameters
    ----------
    measured : FRF
        Drawn dark.
    models : mapping of str to FRF, optional
        By label, in the order nominal, fitted, with the effect; converted to the measured kind.
    pairs : sequence of (output, input), optional
        Pairs to plot, by label; the first four pairs unless given.
    floor : array_like, optional
        Standard deviation of the measured FRF, of the shape of ``measured.H`` or one that broadcasts to it
        [unit of ``measured``].
    held_out : sequence of (low, high)
        Bands that were kept from the fit, shaded [Hz].
    title : str
        Heading.
    deviations : mapping of str to array_like, optional
        Standard deviation of ln|H| of some models, by label, of the shape of their H [-]; their 95 %
        interval is shaded.
    label : str
        Of the dark curve: ``"computed"`` where nothing was measured.
    compared : array_like of bool, optional
        Which measured values errors are of, of the shape of ``measured.H``; the others are drawn pale.
    """
    counted = np.broadcast_to(True if compared is None else np.asarray(compared, bool), measured.H.shape)
    models = {name: model.as_kind(measured.kind) for name, model in (models or {}).items()}
    pairs = _pairs(measured, pairs, 4)
    sigma = None if floor is None else np.broadcast_to(np.asarray(floor, dtype=float), measured.H.shape)
    columns = 1 if len(pairs) == 1 else 2
    rows = -(-len(pairs) // columns)
    with style.look():
        figure = style.new_figure(
            height=(0.25 if title else 0) + 0.55 + (3.2 if columns == 1 else 2.75) * rows
        )
        parts = [2.6, 1.0] if measured.has_phase else [1.0]
        grid = figure.add_gridspec(len(parts) * rows, columns, height_ratios=parts * rows)
        for k, (output, input_) in enumerate(pairs):
            r, c = divmod(k, columns)
            top = figure.add_subplot(grid[len(parts) * r, c])
            low = figure.add_subplot(grid[2 * r + 1, c], sharex=top) if measured.has_phase else None
            i, j = measured.outputs.index(output), measured.inputs.index(input_)
            for ax in (top, low):
                if ax is not None:
                    shade(ax, held_out)
            if sigma is not None:
                _floor_curve(top, measured.frequency, sigma[:, i, j])
            h, known = measured.H[:, i, j], counted[:, i, j]
            dark = {"color": style.MEASURED, "linewidth": 2.1, "zorder": 2}
            seen = np.where(known, h, complex("nan"))
            _amplitude_phase(top, low, measured.frequency, seen, label, **dark)
            if not known.all():
                pale = {"color": style.NOT_COMPARED, "linewidth": 1.4, "zorder": 1.8}
                _amplitude_phase(top, low, measured.frequency, h, style.NOT_COMPARED_LABEL, **pale)
            for n, (name, model) in enumerate(models.items()):
                colour, line = style.model_style(name, n)
                part = model.select([output], [input_]).H[:, 0, 0]
                if deviations is not None and name in deviations:
                    o, p = model.outputs.index(output), model.inputs.index(input_)
                    spread = 1.96 * np.asarray(deviations[name], dtype=float)[:, o, p]
                    wide = np.exp(np.minimum(spread, _WIDEST_BAND))
                    size = np.abs(part)
                    top.fill_between(
                        model.frequency,
                        size / wide,
                        size * wide,
                        color=colour,
                        alpha=0.25,
                        linewidth=0,
                        zorder=1.5,
                        label=f"{name}, 95 %",
                    )
                _amplitude_phase(
                    top,
                    low,
                    model.frequency,
                    part,
                    name,
                    color=colour,
                    linestyle=line,
                    linewidth=1.2,
                    zorder=3,
                )
            first = c == 0 or bool(measured.strain)  # panels of one row may have different units
            _frf_axes(top, low, measured, h, (output, input_), first=first, last=k + columns >= len(pairs))
        legend_above(figure, title, curve_keys(figure.axes, held_out, floor=floor is not None))
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

    Strains count as much as motions: all values of either are divided by the root mean square over all lines.

    Parameters
    ----------
    measured : FRF
    models : mapping of str to FRF
        By label, on the measured lines.
    pairs : sequence of (output, input), optional
        Pairs to sum over; all unless given.
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
    errors, noise = frf_errors(measured, models, pairs, floor, smooth)
    with style.look():
        figure = style.new_figure(height=2.9)
        ax = figure.add_subplot()
        shade(ax, held_out)
        if noise is not None:
            ax.fill_between(measured.frequency, noise, -400, color=style.NOISE, linewidth=0, zorder=0.5)
        span = []
        for n, (label, error) in enumerate(errors.items()):
            colour, line = style.model_style(label, n)
            ax.plot(measured.frequency, error, color=colour, linestyle=line, label=label, linewidth=1.2)
            span += [np.nanpercentile(error, 1), np.nanmax(error)]
        low, high = (min(span), max(span)) if span else (-60.0, 0.0)
        if noise is not None:
            low = min(low, float(np.nanmedian(noise)) - 3)
        ax.set_ylim(low - 4, high + 4)
        ax.set_xlim(measured.frequency[0], measured.frequency[-1])
        ax.set_xlabel("frequency [Hz]")
        ax.set_ylabel("relative error [dB]")
        legend_above(figure, title, curve_keys([ax], held_out, floor=floor is not None))
    return figure


def frf_errors(
    measured: FRF,
    models: Mapping[str, FRF],
    pairs: Sequence[tuple[str, str]] | None = None,
    floor: ArrayLike | None = None,
    smooth: int = 1,
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.float64] | None]:
    """Return the errors that :func:`plot_frf_error` plots, by label, and the noise's, (n_freq,) each [dB].

    Parameters and errors as there. NaN where nothing was measured.
    """
    pairs = _pairs(measured, pairs, None)
    index = [(measured.outputs.index(o), measured.inputs.index(i)) for o, i in pairs]
    rows, cols = (np.array(k) for k in zip(*index, strict=True))
    H, size = measured.H[:, rows, cols], np.ones(rows.size)
    strain = measured.is_strain[rows]
    if strain.any() and not strain.all():
        for alike in (strain, ~strain):
            size[alike] = np.sqrt((np.abs(H[:, alike]) ** 2).mean()) or 1.0
    H = H / size
    power = _moving(np.sum(np.abs(H) ** 2, axis=1), smooth)
    power = np.where(power > 0, power, np.nan)
    noise = None
    if floor is not None:
        sigma = np.broadcast_to(np.asarray(floor, dtype=float), measured.H.shape)[:, rows, cols]
        noise = 10 * np.log10(_moving(np.sum((sigma / size) ** 2, axis=1), smooth) / power)
    out = {}
    for label, model in models.items():
        if model.n_freq != measured.n_freq or not np.allclose(model.frequency, measured.frequency):
            msg = f"model '{label}' has {model.n_freq} lines, not the {measured.n_freq} measured ones"
            raise ValueError(msg)
        part = model.as_kind(measured.kind)
        got = np.stack([part.select([o], [i]).H[:, 0, 0] for o, i in pairs], axis=1) / size
        error = _moving(np.sum(np.abs(got - H) ** 2, axis=1), smooth)
        out[label] = 10 * np.log10(np.maximum(error / power, 1e-30))
    return out, noise


def _pairs(frf: FRF, pairs: Sequence[tuple[str, str]] | None, at_most: int | None) -> list[tuple[str, str]]:
    """Return the pairs of output and input to plot, after a check."""
    if pairs is None:
        return [(o, i) for i in frf.inputs for o in frf.outputs][:at_most]
    for output, input_ in pairs:
        frf.select([output], [input_])
    return list(pairs)


def _amplitude_phase(
    top: Axes, low: Axes | None, f: NDArray[np.float64], h: NDArray[np.complex128], label: str, **look: Any
) -> None:
    """Draw amplitude and phase, the phase broken where it wraps."""
    top.semilogy(f, np.abs(h), label=label, **look)
    if low is None:
        return
    phase = np.rad2deg(np.angle(h))
    wraps = np.flatnonzero(np.abs(np.diff(phase)) > 180) + 1
    low.plot(np.insert(f, wraps, f[wraps]), np.insert(phase, wraps, np.nan), **look)


def _frf_axes(
    top: Axes,
    low: Axes | None,
    frf: FRF,
    h: NDArray[np.complex128],
    pair: tuple[str, str],
    *,
    first: bool,
    last: bool,
) -> None:
    """Set limits, ticks and labels of an amplitude and a phase."""
    top.set_title(f"{pair[0]} / {pair[1]}")
    size = np.abs(h[np.abs(h) > 0])
    if size.size:
        bottom, ceiling = np.log10([np.percentile(size, 0.3), size.max()])
        room = 0.12 * max(ceiling - bottom, 1)
        top.set_ylim(10 ** (bottom - room), 10 ** (ceiling + room))
    top.set_xlim(frf.frequency[0], frf.frequency[-1])
    if first:
        shown = frf.select([pair[0]], [pair[1]])
        top.set_ylabel(f"{shown.quantity} [{shown.unit}]")
    if last:
        (top if low is None else low).set_xlabel("frequency [Hz]")
    if low is None:
        return
    low.set_ylim(-190, 190)
    low.yaxis.set_major_locator(MultipleLocator(180))
    low.yaxis.set_minor_locator(MultipleLocator(90))
    top.tick_params(labelbottom=False)
    if first:
        low.set_ylabel("phase [°]")
    else:
        low.tick_params(labelleft=False)


def _floor_curve(ax: Axes, f: NDArray[np.float64], sigma: NDArray[np.float64]) -> None:
    """Shade the amplitudes below the noise."""
    ax.fill_between(f, np.maximum(sigma, 1e-300), 1e-300, color=style.NOISE, linewidth=0, zorder=0.5)


def _moving(values: NDArray[np.float64], lines: int) -> NDArray[np.float64]:
    """Return the moving average over a number of lines."""
    if lines <= 1:
        return values
    kernel = np.ones(min(lines, values.size))
    return np.convolve(values, kernel, "same") / np.convolve(np.ones(values.size), kernel, "same")
