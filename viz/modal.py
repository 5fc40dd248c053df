"""Pictures of an identification of modes: indicators over the poles, and synthesised over measured FRFs."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fem.analysis.frf import FRF
from fem.array_types import Bools, Complexes, Floats
from updating.ambient.ambient_modes import AmbientModes
from updating.ambient.clusters import determined
from updating.modal.identified_modes import IdentifiedModes
from updating.modal.peaks import mode_indicator
from viz import style
from viz.axes import keys_of, legend_above
from viz.curves import frf, frf_pairs
from viz.still import draw

Cloud = tuple[Bools, str, str, str, str]


def plot_stabilisation(measured: FRF, identified: IdentifiedModes, title: str = "") -> Figure:
    """Plot mode indicators, measured, fitted and of the residual, and below them the poles of all orders.

    The indicator is the sum of |H|² over all FRFs, each over its mean square, so that 0 dB is the mean.

    Parameters
    ----------
    measured : FRF
        The FRFs from which the modes were identified.
    identified : IdentifiedModes
    title : str
        Heading.
    """
    s = identified.stabilisation
    clouds: list[Cloud] = [
        (~s.stable_frequency, "new", "x", style.GREY, style.GREY),
        (s.stable_frequency & ~s.stable, "frequency stable", "o", style.ORANGE, "none"),
        (s.stable, "frequency, damping and participation stable", "o", style.BLUE, style.BLUE),
    ]
    low, high = identified.synthesised.frequency[[0, -1]]

    def draw_above(top: Axes, below: Axes) -> None:
        _indicators(top, measured, identified)
        below.set_ylabel("order of the denominator")

    return over_poles(draw_above, s, clouds, identified.modes.frequency, (low, high), title)


def over_poles(
    draw_above: Callable[[Axes, Axes], None],
    s: Any,
    clouds: Sequence[Cloud],
    modes: Floats,
    limits: tuple[float, float],
    title: str,
) -> Figure:
    """Plot what identifies modes over frequency, and below it the poles of all orders, both with the modes.

    Parameters
    ----------
    draw_above : callable
        Draws on the upper axes, and what the lower ones have beside poles.
    s : Stabilisation or SubspacePoles
        The poles: their ``frequency`` [Hz] and ``order``, and all ``orders``.
    clouds : sequence of Cloud
        Poles that are drawn alike: which, name, symbol, colour, and colour within the symbol.
    modes : ndarray (n_modes,)
        Natural frequencies [Hz].
    limits : (float, float)
        Of the frequencies [Hz].
    title : str
        Heading.
    """
    with style.look():
        figure = style.new_figure(height=5.8 + 0.25 * bool(title))
        top, below = figure.subplots(2, 1, sharex=True)
        draw_above(top, below)
        for rows, label, marker, colour, face in clouds:
            look = {"color": colour, "markerfacecolor": face, "markersize": 3, "label": label}
            below.plot(s.frequency[rows], s.order[rows], linestyle="none", marker=marker, **look)
        for ax in (top, below):
            for k, f in enumerate(modes):
                label = "mode" if k == 0 else "_"
                ax.axvline(f, color=style.VERMILION, linewidth=0.9, label=label, zorder=0.5)
        top.set_xlim(limits)
        below.set_ylim(s.orders[0] - 1, s.orders[-1] + 1)
        below.set_xlabel("frequency [Hz]")
        legend_above(figure, title, keys_of(top, below))
    return figure


def _indicators(ax: Axes, measured: FRF, identified: IdentifiedModes) -> None:
    """Draw the mode indicators, and peaks without a mode."""
    fit = identified.synthesised
    data = measured.select(lines=np.isin(measured.frequency, fit.frequency))
    size = np.sqrt((np.abs(data.H) ** 2).mean(axis=0))
    pairs = max(int((size > 0).sum()), 1)

    def level(H: Complexes) -> Floats:
        return 10 * np.log10(np.maximum(mode_indicator(H, size) / pairs, 1e-300))

    of_data, residual = level(data.H), level(data.H - fit.H)
    ax.plot(fit.frequency, of_data, color=style.MEASURED, linewidth=1.8, label="measured")
    ax.plot(
        fit.frequency,
        level(fit.H),
        color=style.SKY,
        linewidth=1.1,
        linestyle="-.",
        label="fitted modes and residuals",
    )
    ax.plot(fit.frequency, residual, color=style.GREY, linewidth=0.8, label="residual", zorder=1.5)
    at = [int(np.argmin(np.abs(fit.frequency - p.frequency))) for p in identified.unexplained]
    if at:
        ax.plot(
            fit.frequency[at],
            of_data[at],
            linestyle="none",
            marker="v",
            color=style.PURPLE,
            label="peak without a mode",
        )
    floor = float(np.percentile(np.minimum(residual, of_data), 1))
    # Range of the mode indicator that is drawn: the residual of exact data is rounding [dB]
    ax.set_ylim(max(floor, float(of_data.max()) - 120.0) - 3, float(of_data.max()) + 4)
    ax.set_ylabel("mode indicator [dB]")


def plot_synthesis(
    measured: FRF,
    identified: IdentifiedModes,
    pairs: Sequence[tuple[str, str]] | None = None,
    title: str = "",
) -> Figure:
    """Plot synthesised over measured FRFs on the lines of the fit, with the errors and the noise assumed.

    Parameters
    ----------
    measured : FRF
        The FRFs from which the modes were identified.
    identified : IdentifiedModes
    pairs : sequence of (output, input), optional
        FRFs to plot, by label; the first four unless given.
    title : str
        Heading.
    """
    fit = identified.synthesised
    data = measured.select(lines=np.isin(measured.frequency, fit.frequency))
    pictures = []
    for output, force in frf_pairs(data, pairs, 4):
        error = identified.error[fit.outputs.index(output), fit.inputs.index(force)]
        words = f"{output} / {force}: error {100 * error:.2g} %"
        models = {"fitted modes and residuals": fit}
        pictures.append(frf(data, models, (output, force), floor=identified.noise, title=words))
    return draw(pictures, title)


# Picture of an ambient test: singular values of the spectra, and the poles of all orders with the modes


def plot_ambient(found: AmbientModes, title: str = "") -> Figure:
    """Plot singular values of the spectra, and below them the poles of all orders, with the modes.

    Parameters
    ----------
    found : AmbientModes
    title : str
        Heading.
    """
    s, taken = found.stabilisation, np.zeros(len(found.stabilisation.order), dtype=bool)
    taken[[int(k) for group in found.members for k in group]] = True
    known = determined(s)
    clouds: list[Cloud] = [
        (~known, "pole less known than its half-power width", "x", style.GREY, style.GREY),
        (known & ~taken, "well known pole", "o", style.ORANGE, "none"),
        (taken, "pole of a mode", "o", style.BLUE, style.BLUE),
    ]

    def draw_above(top: Axes, below: Axes) -> None:
        _spectra(top, found)
        look = {"color": style.MUTED, "linewidth": 0.8, "linestyle": "--"}
        below.axhline(found.order - 1, label="order of the record", **look)
        below.yaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 4, 10]))
        below.set_ylabel("order of the model")

    return over_poles(draw_above, s, clouds, found.modes.frequency, found.band, title)


def _spectra(ax: Axes, found: AmbientModes) -> None:
    """Draw singular values, and peaks without a mode."""
    s = found.spectra
    inside = (s.frequency >= found.band[0]) & (s.frequency <= found.band[1])
    # Singular values that are drawn
    for k in range(min(4, s.values.shape[1])):
        first = k == 0
        ax.plot(
            s.frequency[inside],
            10 * np.log10(np.maximum(s.values[inside, k], 1e-300)),
            color=style.MEASURED if first else style.GREY,
            linewidth=1.1 if first else 0.7,
            label="largest singular value" if first else "next singular values" if k == 1 else "_",
            zorder=2 - 0.1 * k,
        )
    level = s.values[:, 0]
    at = [int(np.argmin(np.abs(s.frequency - p.frequency))) for p in found.unexplained]
    if at:
        ax.plot(
            s.frequency[at],
            10 * np.log10(level[at]),
            linestyle="none",
            marker="v",
            color=style.PURPLE,
            label="peak without a mode",
        )
    ax.set_ylabel("singular values [dB re 1/Hz]")
