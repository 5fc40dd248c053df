"""Measured and computed natural frequencies compared."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from viz import style
from viz.axes import legend_above

MARKERS = ("o", "s", "D", "P")
"""Of models in the order nominal, fitted, with the effect, others."""


def plot_deviations(
    measured: ArrayLike,
    std: ArrayLike,
    computed: Mapping[str, ArrayLike],
    held_out: ArrayLike | None = None,
    title: str = "",
) -> Figure:
    """Plot how far computed natural frequencies are from measured ones, mode by mode.

    Bars around zero are two standard deviations of the measurement.

    Parameters
    ----------
    measured : array_like (n,)
        Natural frequencies [Hz].
    std : array_like (n,)
        Relative standard deviations [-].
    computed : mapping of str to array_like (n,)
        Frequencies by the model's label, in the order nominal, fitted, with the effect; NaN where a mode has
        none [Hz].
    held_out : array_like of bool (n,), optional
        Modes that no fit has seen, which are shaded.
    title : str
        Heading.
    """
    f, spread = np.asarray(measured, dtype=float), 200 * np.asarray(std, dtype=float)
    at = np.arange(f.size)
    predicted = np.zeros(f.size, bool) if held_out is None else np.asarray(held_out, dtype=bool)
    with style.look():
        figure = style.new_figure(height=3.4 + 0.25 * bool(title))
        ax = figure.add_subplot()
        for k in np.flatnonzero(predicted):
            ax.axvspan(k - 0.4, k + 0.6, color=style.HELD_OUT, linewidth=0, zorder=0)
        ax.axhline(0, color=style.MUTED, linewidth=0.8, zorder=1)
        ax.errorbar(
            at,
            np.zeros(f.size),
            spread,
            fmt="_",
            color=style.MEASURED,
            capsize=3,
            markersize=9,
            linewidth=1,
            label="measured ± 2 std",
        )
        for n, (label, values) in enumerate(computed.items()):
            off = 100 * (np.asarray(values, dtype=float) / f - 1)
            ax.plot(
                at + 0.12 * (n + 1),
                off,
                MARKERS[n % len(MARKERS)],
                color=style.model_style(label, n)[0],
                markersize=5.5,
                label=label,
            )
        step = -(-f.size // 20)
        ax.set_xticks(at[::step], [f"{x:.4g}" for x in f[::step]])
        ax.set_xlim(-0.6, f.size - 0.2)
        ax.grid(visible=False, axis="x")
        ax.set_xlabel("measured natural frequency [Hz]")
        ax.set_ylabel("computed less measured [%]")
        *models, bars = ax.get_legend_handles_labels()[0]  # bars of errors come last
        keys = [bars, *models]
        if predicted.any():
            keys.append(Patch(facecolor=style.HELD_OUT, edgecolor="#e6d9a8", label="predicted, not fitted"))
        legend_above(figure, title, keys)
    return figure
