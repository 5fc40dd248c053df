"""Figures that turn, zoom and show values: plotly figures made from plain values, for pages and notebooks."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from viz.interactive.error import (
        error_bars_figure,
        error_map_figure,
        probability_figure,
        ranking_figure,
        staircase_figure,
    )
    from viz.interactive.frequencies import deviations_figure, mac_figure
    from viz.interactive.frf import frf_error_figure, frf_figure
    from viz.interactive.model import model_figure
    from viz.interactive.modes import modes_figure
else:
    __getattr__, __dir__ = names_on_use(__name__)

__all__ = [
    "deviations_figure",
    "error_bars_figure",
    "error_map_figure",
    "frf_error_figure",
    "frf_figure",
    "mac_figure",
    "model_figure",
    "modes_figure",
    "probability_figure",
    "ranking_figure",
    "staircase_figure",
]
