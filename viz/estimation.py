"""Picture of FRFs that were estimated from time data: amplitude, phase and coherence."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from updating.measurement.frf_estimation import EstimatedFRF
from viz.curves import frf, frf_pairs
from viz.still import draw


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
    sigma = estimate.std if np.isfinite(estimate.std).any() else None
    shown = {"floor": sigma, "coherence": estimate.coherence, "label": "estimated"}
    return draw([frf(estimate.frf, None, pair, **shown) for pair in frf_pairs(estimate.frf, pairs, 4)], title)
