"""Parameters fitted to measurements: unknowns, residuals, least squares and uncertainty."""

from typing import TYPE_CHECKING

from fem.lazy import names_on_use

if TYPE_CHECKING:
    from updating.inference.bases import BASIS_SHARE
    from updating.inference.belief import (
        EFFECT_ODDS,
        FAR_STD,
        FORM_CLAMP,
        FORM_CORNER,
        FORM_DAMPING,
        FORM_JOINT,
        FORM_MODES,
        FORM_SECTION,
        LIGHT,
        MISSING,
        STATED_MASS,
        TWIN_NATS,
        UNSTATED,
    )
    from updating.inference.damped import LEAST_INSIDE, Continuation
    from updating.inference.fit_data import MODEL_ERROR, FitData, prepare, sensor_vectors
    from updating.inference.fit_function import ROBUST
    from updating.inference.fitting import FULL_LINES, fit_given
    from updating.inference.form import form_of
    from updating.inference.formed import formed_mode_problem, formed_problem
    from updating.inference.joint_fit import JointFunction, with_modes
    from updating.inference.marginal import Quadratic, by_size, log_evidence
    from updating.inference.mode_fit import ModeProblem, n_below
    from updating.inference.mode_preparation import fine_enough
    from updating.inference.mode_targets import match
    from updating.inference.patches import PATCH_ELEMENTS, PATCH_REACH, TWIST_STD, refined_at, with_turning
    from updating.inference.preparation import (
        direct_responses,
        discretisation_error,
        fitted_model,
        with_higher_mass,
    )
    from updating.inference.sampling import sample
    from updating.inference.scatter import channel_scatter, form_scatter, scatter_of
    from updating.inference.solve import Prior, Solution, solve_robust
    from updating.inference.unknowns import EffectPrior, ScaledUnknown, effect_unknowns, log_occam_factor
    from updating.inference.workers import ALONE, Workers, cores
else:
    __getattr__, __dir__ = names_on_use(__name__)
