"""Pictures of structures and mode shapes (PyVista, off-screen) and curves (matplotlib figures)."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from viz.ambient import plot_ambient
    from viz.animation import animate_mode
    from viz.bands import plot_bands
    from viz.correlation import (
        plot_agreement,
        plot_band_error,
        plot_coordinates,
        plot_fdac,
        plot_geometry_match,
        plot_mode_pairs,
        plot_orthogonality,
        plot_pretest,
        plot_signature,
        render_pretest,
    )
    from viz.curves import frf_errors, plot_frf, plot_frf_error
    from viz.frequencies import plot_deviations
    from viz.heat_maps import plot_mac, plot_misfit_matrix
    from viz.history import plot_history
    from viz.joints import plot_joint_stiffness, plot_stiffness_entries, plot_stiffness_laws
    from viz.modal import plot_stabilisation, plot_synthesis
    from viz.models import displacement_at, member_families, model_surface
    from viz.plan import render_plan
    from viz.render import render_faults, render_misfit, render_mode, render_model
    from viz.search import plot_position, plot_ranking, plot_staircase
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
    "animate_mode",
    "displacement_at",
    "figure_png",
    "frf_errors",
    "look",
    "member_families",
    "model_surface",
    "new_figure",
    "plot_agreement",
    "plot_ambient",
    "plot_band_error",
    "plot_bands",
    "plot_bootstrap",
    "plot_convergence",
    "plot_coordinates",
    "plot_correlation",
    "plot_deviations",
    "plot_fdac",
    "plot_frf",
    "plot_frf_error",
    "plot_geometry_match",
    "plot_history",
    "plot_joint_stiffness",
    "plot_mac",
    "plot_misfit_matrix",
    "plot_mode_pairs",
    "plot_orthogonality",
    "plot_parameters",
    "plot_position",
    "plot_pretest",
    "plot_ranking",
    "plot_signature",
    "plot_stabilisation",
    "plot_staircase",
    "plot_stiffness_entries",
    "plot_stiffness_laws",
    "plot_synthesis",
    "render_faults",
    "render_misfit",
    "render_mode",
    "render_model",
    "render_plan",
    "render_pretest",
    "save",
]
