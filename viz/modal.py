"""Pictures of an identification of modes: stabilisation diagram, and synthesised over measured FRFs."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from fem.analysis.frf import FRF
from updating.modal.identified_modes import IdentifiedModes
from viz import style
from viz.axes import legend_above
from viz.curves import plot_frf

__all__ = ["plot_stabilisation", "plot_synthesis"]


def plot_stabilisation(measured: FRF, identified: IdentifiedModes, title: str = "") -> Figure:
    """Plot the poles of all orders over frequency, the modes that were taken, and the FRFs' level.

    Parameters
    ----------
    measured : FRF
        The FRFs from which the modes were identified.
    identified : IdentifiedModes
    title : str
        Heading.
    """
    s = identified.stabilisation
    low, high = identified.synthesised.frequency[[0, -1]]
    with style.look():
        figure = style.new_figure(height=4.2 + 0.25 * bool(title))
        ax = figure.add_subplot()
        level = ax.twinx()
        size = np.sqrt((np.abs(measured.H) ** 2).mean(axis=(1, 2)))
        inside = (measured.frequency >= low) & (measured.frequency <= high) & (size > 0)
        level.semilogy(measured.frequency[inside], size[inside], color=style.GREY, alpha=0.7, linewidth=1.0)
        level.set_ylabel(f"root mean square {measured.quantity} [{measured.unit}]")
        level.grid(visible=False)
        level.spines["right"].set_visible(True)
        ax.set_zorder(level.get_zorder() + 1)
        ax.patch.set_visible(False)
        partly = s.stable_frequency & ~s.stable
        for rows, label, marker, colour, face in (
            (~s.stable_frequency, "new", "x", style.GREY, style.GREY),
            (partly, "frequency stable", "o", style.ORANGE, "none"),
            (s.stable, "frequency, damping and participation stable", "o", style.BLUE, style.BLUE),
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
        for k, f in enumerate(identified.modes.frequency):
            ax.axvline(f, color=style.VERMILION, linewidth=0.9, label="mode" if k == 0 else "_", zorder=0.5)
        ax.set_xlim(low, high)
        ax.set_ylim(s.orders[0] - 1, s.orders[-1] + 1)
        ax.set_xlabel("frequency [Hz]")
        ax.set_ylabel("order of the denominator")
        legend_above(figure, title, ax.get_legend_handles_labels()[0])
    return figure


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
    figure = plot_frf(data, {"fitted modes and residuals": fit}, pairs, floor=identified.noise, title=title)
    for ax in figure.axes[::2]:
        output, force = ax.get_title(loc="left").split(" / ")
        error = identified.error[fit.outputs.index(output), fit.inputs.index(force)]
        title = f"{output} / {force}: error {100 * error:.2g} %"
        ax.set_title(title, loc="left", fontsize=9.5, fontweight="bold")
    return figure
