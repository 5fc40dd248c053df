"""Pictures of an updating: convergence, and changes with their deviations."""

from collections.abc import Sequence
from itertools import cycle

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from fem.array_types import Floats
from updating.inference.updated import Updated
from viz import style
from viz.chart import Chart, Matrix, columns, rows
from viz.layout import shorten
from viz.still import draw


def plot_convergence(updated: Updated, names: Sequence[str] = ()) -> Figure:
    """Plot errors and parameters over the steps, stage by stage.

    Parameters
    ----------
    updated : Updated
    names : sequence of str
        Parameters to draw; the first seven, without damping ratios, unless given.

    Raises
    ------
    KeyError
        For a name that was not updated.
    """
    names = names or [p.name for p in updated.parameters if p.refs][:7]
    parameters = [updated[name] for name in names]
    rows = [updated.names.index(name) for name in names]
    steps = np.arange(len(updated.path))
    errors = {
        "frequencies [%]": 100 * np.array([s.errors.frequency for s in updated.path]),
        "1 - MAC [%]": 100 * (1 - np.array([s.errors.mac for s in updated.path])),
        "FRFs [dB]": np.array([s.errors.frf_db for s in updated.path]),
    }
    with style.look():
        figure = style.new_figure(height=4.6)
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=[1, 1.4])
        shown = {label: e for label, e in errors.items() if np.isfinite(e).any()}
        for (label, e), colour in zip(shown.items(), style.SERIES, strict=False):
            above.semilogy(steps, np.maximum(e, 1e-12), ".-", color=colour, label=label)
        above.set_ylabel("root mean square error")
        above.legend(loc="upper right")
        values = np.array([s.values for s in updated.path])[:, rows]
        start = np.array([p.start for p in parameters])
        change = 100 * np.where(start != 0, values / np.where(start != 0, start, 1.0) - 1, values)
        for k, (p, colour) in enumerate(zip(parameters, cycle(style.SERIES), strict=False)):
            unit = 100 / abs(p.start) if p.start else 100.0
            below.plot(steps, change[:, k], ".-", color=colour, label=shorten(p.name, 28))
            if np.isfinite(p.std):
                below.errorbar(
                    steps[-1] + 0.15, change[-1, k], yerr=1.96 * p.std * unit, color=colour, capsize=3
                )
        below.set_ylabel("change from the start [%]")
        below.set_xlabel("step")
        below.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        stages = [s.stage for s in updated.path]
        free = 0.0  # from here on there is room for a label
        for k in range(1, len(stages)):
            if stages[k] != stages[k - 1]:
                for ax in (above, below):
                    ax.axvline(k - 0.5, color=style.MUTED, linestyle=":", linewidth=0.8)
                if k < free:
                    continue
                free = k + 0.012 * len(stages) * (len(stages[k]) + 1)
                above.annotate(
                    stages[k],
                    (k - 0.4, 1.0),
                    xycoords=("data", "axes fraction"),
                    fontsize=7,
                    va="bottom",
                    color=style.MUTED,
                )
    return figure


def plot_parameters(updated: Updated, title: str = "") -> Figure:
    """Draw each parameter's change with its 95 % interval, prior and bounds, as a table with a picture.

    Changes are relative to the start; of parameters that start at zero, to one of their unit.

    Parameters
    ----------
    updated : Updated
    title : str
        Heading.
    """
    n = len(updated.parameters)
    with style.look():
        figure = style.new_figure(height=1.3 + 0.27 * n)
        ax = figure.add_subplot()
        for y, p in enumerate(updated.parameters):
            scale = 100 / abs(p.start) if p.start else 100.0
            offset = p.start if p.start else 0.0
            if p.prior_std is not None and p.refs:
                half = 1.96 * p.prior_std * (100 if p.log and p.start else scale)
                ax.barh(y, 2 * half, left=-half, height=0.62, color=style.NOISE, linewidth=0, zorder=1)
            colour = style.VERMILION if p.at_bound else style.BLUE if p.determined else style.GREY
            ax.plot((p.value - offset) * scale, y, "o", color=colour, markersize=5, zorder=3)
            if np.isfinite(p.std):
                low, high = ((v - offset) * scale for v in p.interval(0.95))
                ax.plot([low, high], [y, y], color=colour, linewidth=2, zorder=2)
            words = (
                f"{p.value:.5g} ± {p.std:.2g} {p.unit}" if np.isfinite(p.std) else f"{p.value:.5g} {p.unit}"
            )
            ax.annotate(
                words,
                (1.02, y),
                xycoords=("axes fraction", "data"),
                va="center",
                fontsize=7.5,
                annotation_clip=False,
            )
        ax.axvline(0, color=style.MUTED, linewidth=0.8, linestyle=":")
        ax.set_yticks(range(n), [shorten(p.name, 36) for p in updated.parameters])
        ax.set_ylim(n - 0.4, -0.6)
        ax.set_xlabel("change from the start, with the 95 % interval [%]")
        keys = [
            Line2D([], [], color=style.BLUE, marker="o", label="determined by the data"),
            Line2D([], [], color=style.GREY, marker="o", label="not determined"),
            Line2D([], [], color=style.VERMILION, marker="o", label="at a bound"),
            Line2D([], [], color=style.NOISE, linewidth=6, label="prior, 95 %"),
        ]
        legend = figure.legend(handles=keys, loc="outside upper left", ncols=4, title=title or None)
        legend.set_alignment("left")
    return figure


def plot_correlation(updated: Updated) -> Figure:
    """Draw the correlations of the estimates: near ±1 only a combination is known.

    Parameters
    ----------
    updated : Updated
    """
    names = [shorten(name, 24) for name in updated.names]
    cells, size = np.asarray(updated.correlation), 1.8 + 0.28 * len(names)
    colours = colormaps["RdBu_r"]
    marks = [Matrix(cells=cells, colours=colours, limits=(-1.0, 1.0), label="correlation [-]")]
    return draw(Chart(marks, columns(names), rows(names), size=(size + 1.2, size)))


def plot_bootstrap(updated: Updated, values: Floats) -> Figure:
    """Draw the 5 to 95 % range of refits of each parameter with the linearised interval.

    Both are relative to the fitted value; of parameters fitted to zero, in their unit.

    Parameters
    ----------
    updated : Updated
    values : ndarray (n, n_par)
        Of all parameters, of each refit [units].
    """
    parameters = updated.parameters
    with style.look():
        figure = style.new_figure(height=1.3 + 0.32 * len(parameters))
        ax = figure.add_subplot()
        for y, (p, column) in enumerate(zip(parameters, values.T, strict=True)):
            scale = 100 / abs(p.value) if p.value else 1.0
            low, middle, high = (np.quantile(column, (0.05, 0.5, 0.95)) - p.value) * scale
            ax.plot([low, high], [y - 0.14, y - 0.14], color=style.VERMILION, linewidth=2.5)
            ax.plot(middle, y - 0.14, "o", color=style.VERMILION, markersize=5)
            if np.isfinite(p.std):
                first, last = ((v - p.value) * scale for v in p.interval(0.9))
                ax.plot([first, last], [y + 0.14, y + 0.14], color=style.BLUE, linewidth=2.5)
        ax.axvline(0.0, color=style.MUTED, linewidth=0.8, linestyle=":")
        ax.set_yticks(range(len(parameters)), [shorten(p.name, 28) for p in parameters])
        ax.set_ylim(len(parameters) - 0.5, -0.5)
        ax.set_xlabel("from the fitted value [%]")
        handles = [
            Line2D([], [], color=colour, linewidth=2.5, label=label)
            for colour, label in ((style.BLUE, "linearised, 90 %"), (style.VERMILION, "refits, 5 to 95 %"))
        ]
        ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return figure
