"""Bands of natural frequencies and FRFs of an ensemble, as a matplotlib figure."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fem.array_types import Floats
from viz import style
from viz.axes import legend_above


def plot_bands(
    frequency: Floats,
    bands: Sequence[tuple[str, Floats, Floats | None]],
    modes: Floats,
    unit: str,
    title: str = "",
) -> Figure:
    """Plot bands of amplitudes over frequency, and those of natural frequencies relative to their medians.

    Parameters
    ----------
    frequency : ndarray (n_freq,)
        Lines [Hz].
    bands : sequence of (str, ndarray (3, n_freq), ndarray (n_freq,) or None)
        Name of an FRF, its 5 %, 50 % and 95 % quantiles, and the measured amplitude.
    modes : ndarray (3, n_modes)
        The same quantiles of the natural frequencies [Hz].
    unit : str
        Of the amplitudes, such as ``"accelerance [m/s²/N]"``.
    title : str
        Heading.
    """
    n = len(bands) + 1
    with style.look():
        figure = style.new_figure(height=(0.25 if title else 0) + 0.9 + 1.9 * n)
        handles: list[object] = []
        for k, (name, band, measured) in enumerate(bands):
            ax = figure.add_subplot(n, 1, k + 1)
            ax.fill_between(frequency, band[0], band[2], color=style.SKY, alpha=0.5, lw=0, label="5 to 95 %")
            ax.semilogy(frequency, band[1], color=style.BLUE, label="median")
            if measured is not None:
                ax.semilogy(frequency, measured, color=style.MEASURED, linewidth=0.9, label="measured")
            ax.set_title(name)
            ax.set_ylabel(unit)
            ax.set_xlim(frequency[0], frequency[-1])
            if len(ax.get_legend_handles_labels()[0]) > len(handles):
                handles = list(ax.get_legend_handles_labels()[0])
        if bands:
            figure.axes[-1].set_xlabel("frequency [Hz]")
        ax = figure.add_subplot(n, 1, n)
        share = 100 * (modes / modes[1] - 1)
        at = np.arange(1, modes.shape[1] + 1)
        ax.vlines(at, share[0], share[2], color=style.SKY, linewidth=5, alpha=0.6, label="5 to 95 %")
        ax.plot(at, share[1], "_", color=style.BLUE, markersize=9, label="median")
        ax.set_title("natural frequencies")
        ax.set_xlabel("elastic mode")
        ax.set_ylabel("from the median [%]")
        ax.set_xlim(0.4, modes.shape[1] + 0.6)
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        legend_above(figure, title, handles or ax.get_legend_handles_labels()[0])
    return figure
