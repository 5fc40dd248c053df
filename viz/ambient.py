"""Picture of an ambient test: singular values of the spectra, and the poles of all orders with the modes."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from updating.ambient.ambient_modes import AmbientModes
from updating.ambient.clusters import determined
from viz import style
from viz.axes import keys_of, legend_above

__all__ = ["plot_ambient"]


def plot_ambient(found: AmbientModes, title: str = "") -> Figure:
    """Plot singular values of the spectra, and below them the poles of all orders, with the modes.

    Parameters
    ----------
    found : AmbientModes
    title : str
        Heading.
    """
    with style.look():
        figure = style.new_figure(height=5.8 + 0.25 * bool(title))
        grid = figure.add_gridspec(2, 1, height_ratios=[1.1, 1])
        top = figure.add_subplot(grid[0])
        low = figure.add_subplot(grid[1], sharex=top)
        _spectra(top, found)
        _poles(low, found)
        for ax in (top, low):
            for k, f in enumerate(found.modes.frequency):
                label = "mode" if k == 0 else "_"
                ax.axvline(f, color=style.VERMILION, linewidth=0.9, label=label, zorder=0.5)
        top.set_xlim(found.band)
        top.tick_params(labelbottom=False)
        low.set_xlabel("frequency [Hz]")
        legend_above(figure, title, keys_of(top, low))
    return figure


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


def _poles(ax: Axes, found: AmbientModes) -> None:
    """Draw the poles of all orders, those of the modes with two standard deviations."""
    s = found.stabilisation
    known = determined(s)
    taken = np.zeros(len(s.order), dtype=bool)
    taken[[int(k) for group in found.members for k in group]] = True
    for rows, label, marker, colour, face in (
        (~known, "pole less known than its half-power width", "x", style.GREY, style.GREY),
        (known & ~taken, "well known pole", "o", style.ORANGE, "none"),
        (taken, "pole of a mode", "o", style.BLUE, style.BLUE),
    ):
        ax.plot(
            s.frequency[rows],
            s.order[rows],
            linestyle="none",
            marker=marker,
            markersize=3,
            color=colour,
            markerfacecolor=face,
            label=label,
        )
    ax.axhline(found.order - 1, color=style.MUTED, linewidth=0.8, linestyle="--", label="order of the record")
    ax.set_ylim(s.orders[0] - 1, s.orders[-1] + 1)
    ax.yaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 4, 10]))
    ax.set_ylabel("order of the model")
