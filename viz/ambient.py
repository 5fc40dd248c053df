"""Picture of an ambient test: singular values of the spectra, and the poles of all orders with the modes."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from updating.ambient.ambient_modes import AmbientModes
from updating.ambient.clusters import determined
from viz import style
from viz.modal import Cloud, over_poles


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
