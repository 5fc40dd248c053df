"""Pictures of structures and mode shapes (PyVista, off-screen) and curves (matplotlib figures)."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from viz.animation import animate_mode as animate_mode
    from viz.bands import plot_bands as plot_bands
    from viz.chart import Chart as Chart
    from viz.correlation import band_error_map as band_error_map
    from viz.correlation import plot_agreement as plot_agreement
    from viz.correlation import plot_coordinates as plot_coordinates
    from viz.correlation import plot_fdac as plot_fdac
    from viz.correlation import plot_geometry_match as plot_geometry_match
    from viz.correlation import plot_mode_pairs as plot_mode_pairs
    from viz.correlation import plot_orthogonality as plot_orthogonality
    from viz.correlation import plot_pretest as plot_pretest
    from viz.correlation import plot_signature as plot_signature
    from viz.correlation import render_pretest as render_pretest
    from viz.curves import error_curves as error_curves
    from viz.curves import frf as frf
    from viz.curves import frf_errors as frf_errors
    from viz.curves import plot_frf as plot_frf
    from viz.frequencies import deviations as deviations
    from viz.frequencies import mac_map as mac_map
    from viz.heat_maps import error_map as error_map
    from viz.history import plot_history as plot_history
    from viz.indicators import cmif as cmif
    from viz.indicators import frac as frac
    from viz.indicators import nyquist as nyquist
    from viz.indicators import sensitivity as sensitivity
    from viz.joints import plot_stiffness_entries as plot_stiffness_entries
    from viz.joints import plot_stiffness_laws as plot_stiffness_laws
    from viz.modal import plot_ambient as plot_ambient
    from viz.modal import plot_stabilisation as plot_stabilisation
    from viz.modal import plot_synthesis as plot_synthesis
    from viz.models import displacement_at as displacement_at
    from viz.models import member_families as member_families
    from viz.models import model_surface as model_surface
    from viz.plan import render_plan as render_plan
    from viz.render import render_faults as render_faults
    from viz.render import render_misfit as render_misfit
    from viz.render import render_mode as render_mode
    from viz.render import render_model as render_model
    from viz.search import error_bars as error_bars
    from viz.search import position as position
    from viz.search import probability as probability
    from viz.search import ranking as ranking
    from viz.search import staircase as staircase
    from viz.still import draw as draw
    from viz.style import BLUE as BLUE
    from viz.style import GREEN as GREEN
    from viz.style import GREY as GREY
    from viz.style import PURPLE as PURPLE
    from viz.style import VERMILION as VERMILION
    from viz.style import figure_png as figure_png
    from viz.style import look as look
    from viz.style import new_figure as new_figure
    from viz.style import save as save
    from viz.updating import plot_bootstrap as plot_bootstrap
    from viz.updating import plot_convergence as plot_convergence
    from viz.updating import plot_correlation as plot_correlation
    from viz.updating import plot_parameters as plot_parameters
else:
    __getattr__, __dir__ = names_on_use(__name__)
