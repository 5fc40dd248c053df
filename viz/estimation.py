"""Picture of FRFs that were estimated from time data: amplitude, phase and coherence."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from updating.measurement.frf_estimation import EstimatedFRF
from viz import style
from viz.axes import legend_above

__all__ = ["plot_estimate"]


def plot_estimate(
    estimate: EstimatedFRF, pairs: Sequence[tuple[str, str]] | None = None, title: str = ""
) -> Figure:
    """Plot estimated FRFs with their standard deviation, and the coherence below each.

    Parameters
    ----------
    estimate : EstimatedFRF
    pairs : sequence of (output, input), optional
        FRFs to plot, by label; the first four unless given.
    title : str
        Heading.
    """
    frf = estimate.frf
    pairs = list(pairs or [(o, i) for i in frf.inputs for o in frf.outputs][:4])
    columns = 1 if len(pairs) == 1 else 2
    rows = -(-len(pairs) // columns)
    with style.look():
        figure = style.new_figure(height=0.8 + 3.3 * rows)
        grid = figure.add_gridspec(3 * rows, columns, height_ratios=[2.4, 1, 1] * rows)
        for k, (output, force) in enumerate(pairs):
            r, c = divmod(k, columns)
            i, j = frf.outputs.index(output), frf.inputs.index(force)
            top, middle, low = (figure.add_subplot(grid[3 * r + n, c]) for n in range(3))
            f, h, sigma = frf.frequency, frf.H[:, i, j], estimate.std[:, i, j]
            size = np.abs(h)
            top.semilogy(f, size, color=style.MEASURED, linewidth=1.1)
            if np.isfinite(sigma).any():
                least = size[size > 0].min(initial=1.0) / 10
                top.fill_between(
                    f, np.maximum(size - sigma, least), size + sigma, color=style.BLUE, alpha=0.3, linewidth=0
                )
                top.set_ylim(size[size > 0].min(initial=1.0) / 2, 2 * size.max())
            middle.plot(f, np.rad2deg(np.angle(h)), ".", color=style.MEASURED, markersize=1)
            low.plot(f, estimate.coherence[:, i, j], color=style.GREEN, linewidth=0.9)
            top.set_title(f"{output} / {force}")
            middle.set_ylim(-190, 190)
            middle.set_yticks([-180, 0, 180])
            low.set_ylim(0, 1.05)
            for ax in (top, middle, low):
                ax.set_xlim(f[0], f[-1])
                ax.tick_params(labelbottom=ax is low and k + columns >= len(pairs))
            if c == 0:
                top.set_ylabel(f"{frf.kind} [{frf.kind.unit}]")
                middle.set_ylabel("phase [°]")
                low.set_ylabel("coherence")
            if k + columns >= len(pairs):
                low.set_xlabel("frequency [Hz]")
        keys = [
            Patch(color=style.MEASURED, label="estimated"),
            Patch(color=style.BLUE, alpha=0.3, label="± 1 σ"),
            Patch(color=style.GREEN, label="coherence"),
        ]
        legend_above(figure, title, keys)
    return figure
