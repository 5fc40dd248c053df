"""Campbell diagrams of rotors, and their responses to unbalance."""

from collections.abc import Sequence
from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from fem.analysis.campbell import Campbell
from fem.analysis.complex_modes import whirl_name
from fem.analysis.unbalance import UnbalanceResponse
from viz import style
from viz.axes import legend_above
from viz.chart import Axis, Chart, Curve, Panel
from viz.curves import phase_axis
from viz.still import draw

_COLOURS = {
    "forward": style.VERMILION,
    "backward": style.BLUE,
    "planar": style.GREEN,
    "": style.GREY,
}
_WORDS = {
    "forward": "forward whirl",
    "backward": "backward whirl",
    "planar": "in a plane",
    "": "no rotor tilts",
}
RPM = 60 / (2 * np.pi)
"""1 rad/s in turns a minute."""


def plot_campbell(found: Campbell, orders: Sequence[float] = (1.0,), title: str = "") -> Figure:
    """Plot damped natural frequencies and damping ratios over speed, with orders and critical speeds.

    Parameters
    ----------
    found : Campbell
    orders : sequence of float
        Of excitations, drawn as lines from the origin [-].
    title : str
        Heading.
    """
    with style.look():
        figure = style.new_figure(height=5.6 + 0.25 * bool(title))
        grid = figure.add_gridspec(2, 1, height_ratios=[2.8, 1])
        top = figure.add_subplot(grid[0])
        low = figure.add_subplot(grid[1], sharex=top)
        rpm, frequency = found.speeds * RPM, found.frequency
        highest = 1.08 * float(np.nanmax(frequency, initial=1e-12))
        shown = set()
        for k in range(found.n_branches):
            word = whirl_name(found.turning(k))
            label = "_" if word in shown else _WORDS[word]
            shown.add(word)
            top.plot(rpm, frequency[:, k], color=_COLOURS[word], label=label, linewidth=1.2)
            low.plot(rpm, 100 * found.zeta[:, k], color=_COLOURS[word], linewidth=1.2)
        for order in orders:
            end = min(rpm[-1], 60 * highest / order)
            top.plot([0, end], [0, order * end / 60], color=style.MUTED, linestyle="--", linewidth=0.9)
            top.text(
                0.95 * end,
                0.95 * order * end / 60,
                f"{order:g}X",
                ha="center",
                va="center",
                color=style.MUTED,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5},
            )
        top.plot(
            [c.speed * RPM for c in found.critical],
            [c.pole.imag / (2 * np.pi) for c in found.critical],
            linestyle="none",
            marker="o",
            markersize=5,
            markerfacecolor="white",
            color=style.INK,
            label="critical speed",
            zorder=4,
        )
        top.set_ylim(0, highest)
        top.set_xlim(rpm[0], rpm[-1])
        top.tick_params(labelbottom=False)
        top.set_ylabel("damped natural frequency [Hz]")
        low.set_ylabel("damping ratio [%]")
        low.set_xlabel("speed [1/min]")
        low.axhline(0.0, color=style.MUTED, linewidth=0.7)
        legend_above(figure, title, top.get_legend_handles_labels()[0])
    return figure


def plot_unbalance(found: UnbalanceResponse, names: Sequence[str], title: str = "") -> Figure:
    """Plot amplitudes and phases of responses to unbalance over speed.

    Parameters
    ----------
    found : UnbalanceResponse
    names : sequence of str
        Of its outputs.
    title : str
        Heading.
    """
    rpm, u = found.speed * RPM, np.where(found.displacement == 0, np.nan, found.displacement)  # at rest
    sizes, phases = [], []
    for y, name, colour in zip(u.T, names, cycle(style.SERIES), strict=False):
        sizes.append(Curve(x=rpm, y=1e6 * np.abs(y), name=name, colour=colour, dash="-"))
        phases.append(Curve(x=rpm, y=np.degrees(np.angle(y)), colour=colour, dash="-"))
    x = Axis("speed [1/min]", (float(rpm[0]), float(rpm[-1])))
    below = [Panel(phases, phase_axis(), 0.42)]
    return draw(
        Chart(sizes, x, Axis("amplitude [µm]", log=True), title, size=(style.WIDTH, 5.2), below=below)
    )
