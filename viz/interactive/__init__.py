"""Figures that turn, zoom and show values: plotly figures made from plain values, for pages and notebooks."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from viz.interactive.live import draw
    from viz.interactive.model import model_figure
    from viz.interactive.modes import modes_figure
else:
    __getattr__, __dir__ = names_on_use(__name__)
