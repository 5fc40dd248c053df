"""Several states of one structure: shifts of natural frequencies, and which change each state has."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from viz import style
from viz.axes import legend_above

MOST_MODES = 12
"""Modes that are drawn, the lowest."""


def plot_history(
    names: Sequence[str],
    frequency: ArrayLike,
    shift: ArrayLike,
    std: ArrayLike,
    changes: Sequence[Sequence[tuple[str, float]]],
) -> Figure:
    """Plot shifts of natural frequencies over the states, and below them the changes that explain each.

    Parameters
    ----------
    names : sequence of str (n_states,)
        The baseline is drawn before them.
    frequency : array_like (n_modes,)
        Natural frequencies of the baseline [Hz].
    shift, std : array_like (n_states, n_modes)
        ln(f / f of the baseline) and its standard deviation; NaN where a state lacks a mode [-].
    changes : sequence of sequence of (str, float), (n_states,)
        For each state the changes since the baseline in words, with their probability [-].
    """
    f, y, s = (np.asarray(a, dtype=float) for a in (frequency, shift, std))
    rows = list(dict.fromkeys(label for each in changes for label, _ in each))
    at = np.arange(len(names) + 1)
    with style.look():
        figure = style.new_figure(height=3.4 + 0.3 * max(1, len(rows)))
        grid = figure.add_gridspec(2, 1, height_ratios=[3.0, 0.35 * max(1, len(rows)) + 0.2])
        top = figure.add_subplot(grid[0])
        low = figure.add_subplot(grid[1], sharex=top)
        top.axhline(0, color=style.MUTED, linewidth=0.8)
        n = min(len(f), MOST_MODES)
        for k in range(n):
            label = f"{f[k]:.4g} Hz"
            value, error = 100 * np.append(0.0, y[:, k]), 200 * np.append(0.0, s[:, k])
            colour, dash = style.MODELS[k % len(style.MODELS)]
            mark = "os"[k // len(style.MODELS) % 2]
            top.errorbar(
                at + 0.16 * (k / max(1, n - 1) - 0.5),
                value,
                error,
                fmt=mark,
                linestyle=dash,
                markersize=4,
                color=colour,
                linewidth=1.0,
                capsize=2,
                label=label,
            )
        top.set_ylabel("shift of frequency [%]\n± 2 std")
        top.tick_params(labelbottom=False)
        for k, each in enumerate(changes, 1):
            for label, probability in each:
                low.plot(
                    k,
                    rows.index(label),
                    "o",
                    markersize=8,
                    color=style.EFFECT,
                    # Probability of a change from which its mark is filled [-]
                    markerfacecolor=style.EFFECT if probability >= 0.5 else "none",
                )
        low.set_yticks(range(len(rows)), rows)
        low.set_ylim(len(rows) - 0.4 if rows else 0.5, -0.6)
        low.set_xticks(at, ["baseline", *names])
        low.set_xlim(-0.4, len(names) + 0.4)
        legend_above(figure, "", top.get_legend_handles_labels()[0])
    return figure
