"""Matrices as heat maps: MAC, and misfits of sensors by band."""

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from viz import style
from viz.axes import Band, digits_for, heat_map


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
        Label of the colour bar, with unit.
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
        image = heat_map(
            ax, values, style.misfit_map(), norm, digits_for(hi - lo), numbers=m <= 12 and n <= 40
        )
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
        Labels of rows and columns.
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
        image = heat_map(ax, mac, style.agreement_map(), Normalize(0, 1), 2, numbers=max(n, m) <= 12)
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
