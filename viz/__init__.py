"""Pictures of structures and mode shapes (PyVista, off-screen) and curves (matplotlib figures)."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from viz.ambient import plot_ambient
    from viz.animation import animate_mode
    from viz.bands import plot_bands
    from viz.chart import Chart
    from viz.correlation import (
        band_error_map,
        plot_agreement,
        plot_coordinates,
        plot_fdac,
        plot_geometry_match,
        plot_mode_pairs,
        plot_orthogonality,
        plot_pretest,
        plot_signature,
        render_pretest,
    )
    from viz.curves import error_curves, frf, frf_errors, plot_frf
    from viz.frequencies import deviations, mac_map
    from viz.heat_maps import error_map
    from viz.history import plot_history
    from viz.indicators import cmif, frac, nyquist, sensitivity
    from viz.joints import plot_stiffness_entries, plot_stiffness_laws
    from viz.modal import plot_stabilisation, plot_synthesis
    from viz.models import displacement_at, member_families, model_surface
    from viz.plan import render_plan
    from viz.render import render_faults, render_misfit, render_mode, render_model
    from viz.search import error_bars, position, probability, ranking, staircase
    from viz.still import draw
    from viz.style import BLUE, GREEN, GREY, PURPLE, VERMILION, figure_png, look, new_figure, save
    from viz.updating import plot_bootstrap, plot_convergence, plot_correlation, plot_parameters
else:
    __getattr__, __dir__ = names_on_use(__name__)

__all__ = [
    "BLUE",
    "GREEN",
    "GREY",
    "PURPLE",
    "VERMILION",
    "Chart",
    "animate_mode",
    "band_error_map",
    "cmif",
    "deviations",
    "displacement_at",
    "draw",
    "error_bars",
    "error_curves",
    "error_map",
    "figure_png",
    "frac",
    "frf",
    "frf_errors",
    "look",
    "mac_map",
    "member_families",
    "model_surface",
    "new_figure",
    "nyquist",
    "plot_agreement",
    "plot_ambient",
    "plot_bands",
    "plot_bootstrap",
    "plot_convergence",
    "plot_coordinates",
    "plot_correlation",
    "plot_fdac",
    "plot_frf",
    "plot_geometry_match",
    "plot_history",
    "plot_mode_pairs",
    "plot_orthogonality",
    "plot_parameters",
    "plot_pretest",
    "plot_signature",
    "plot_stabilisation",
    "plot_stiffness_entries",
    "plot_stiffness_laws",
    "plot_synthesis",
    "position",
    "probability",
    "ranking",
    "render_faults",
    "render_misfit",
    "render_mode",
    "render_model",
    "render_plan",
    "render_pretest",
    "save",
    "sensitivity",
    "staircase",
]
