"""The units of a fleet by their distance from the population, as a matplotlib figure."""

import numpy as np
from matplotlib.figure import Figure

from fem.array_types import Floats
from viz import style
from viz.axes import legend_above


def plot_fleet(distance: Floats, rest: Floats, probability: Floats, n: int, title: str = "") -> Figure:
    """Plot the rest of each unit over its distance in the parameters, outliers apart from the others.

    Parameters
    ----------
    distance : ndarray (n_units,)
        In the parameters, in standard deviations of the population [-].
    rest : ndarray (n_units,)
        In units of the population's spread [-].
    probability : ndarray (n_units,)
        That a unit is an outlier [-].
    n : int
        Number of parameters, whose root is the expected distance.
    title : str
        Heading.
    """
    likely = probability > 0.5
    with style.look():
        figure = style.new_figure(height=4.2)
        ax = figure.add_subplot()
        groups = (
            (~likely, style.BLUE, "o", "more probably regular"),
            (likely, style.VERMILION, "D", "more probably an outlier"),
        )
        for those, colour, marker, label in groups:
            ax.loglog(
                distance[those],
                rest[those],
                marker,
                color=colour,
                markersize=4,
                alpha=0.7,
                label=label,
                markeredgewidth=0,
            )
        ax.axvline(np.sqrt(n), color=style.MUTED, linewidth=0.8, linestyle=":", label="expected distance")
        ax.set_xlabel("distance in the parameters [standard deviations of the population]")
        ax.set_ylabel("rest [spread of the population]")
        legend_above(figure, title, ax.get_legend_handles_labels()[0])
    return figure
