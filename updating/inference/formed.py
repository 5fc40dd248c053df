"""Problems of fits to models on fine enough meshes, the form of their frames among what is uncertain."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Unpack

from fem.model import Model
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.fit import FitProblem
from updating.inference.form import form_of
from updating.inference.mode_fit import ModeProblem
from updating.inference.mode_preparation import build_mode_problem, fine_enough
from updating.inference.mode_targets import ModeTargets
from updating.inference.parameters import Nuisance
from updating.inference.patches import refined_on_patches, with_turning
from updating.inference.preparation import (
    FitOptions,
    ProblemOptions,
    build_fine,
    build_problem,
    with_higher_mass,
)
from updating.inference.scatter import channel_scatter
from updating.inference.unknowns import Uncertain
from updating.measurement.measurement import Measurement

Build = Callable[..., FitProblem]
"""Makes the problem of a model, with its uncertain parameters unless ``nuisances`` are given."""


@dataclass(frozen=True, slots=True, eq=False)
class Formed:
    """A model that is fine enough for the data, and its uncertain form.

    Attributes
    ----------
    model : Model
        Without the effects of the form.
    formed : Model
        With them.
    form : tuple of Nuisance
        Their parameters.
    mesh_db : float
        Error of the mesh [dB].
    n_cut : int
        Number of pieces into which each element was cut.
    uncut_db : float
        Error of the mesh before [dB].
    """

    model: Model
    formed: Model
    form: tuple[Nuisance, ...]
    mesh_db: float = 0.0
    n_cut: int = 1
    uncut_db: float = 0.0


def builder(
    measurement: Measurement, nuisances: Sequence[Uncertain] = (), **settings: Unpack[ProblemOptions]
) -> Build:
    """Return what makes the fits' problem of a model; settings as of a diagnosis."""

    def build(model: Model, nuisances: Sequence[Uncertain] = nuisances) -> FitProblem:
        uncertain = with_turning(nuisances, model)
        return build_problem(model, measurement, uncertain, connections=True, **settings)

    return build


def refined(model: Model, model_error: float) -> Model:
    """Return a model with mass of higher order, and with short elements on the joints' patches."""
    model = with_higher_mass(model)
    return refined_on_patches(model) if model_error > 0 else model


def formed_problem(
    model: Model,
    measurement: Measurement,
    nuisances: Sequence[Uncertain] = (),
    *,
    model_error: float = EXPLAINED_LEVEL,
    **settings: Unpack[FitOptions],
) -> tuple[FitProblem, Formed]:
    """Return the problem of a model on a mesh that is fine enough, its form among the uncertain parameters.

    Parameters and settings as of :func:`updating.inference.preparation.build_problem`.
    """
    build = builder(measurement, nuisances, model_error=model_error, **settings)
    problem, model, n, mesh_error, before = build_fine(build, refined(model, model_error), model_error)
    form, std = form_of(model, measurement) if model_error > 0 else ((), ())
    formed = model.with_effect(*form)
    every = (*problem.nuisances, *std)
    reduced = build(formed, every).reduced
    problem = replace(problem, reduced=reduced, nuisances=every, mesh_level=mesh_error[1])
    if model_error > 0:  # damped or not, near or far: channels err in every fit
        problem = replace(problem, scatter=channel_scatter(problem))
    return problem, Formed(model, formed, std, mesh_error[0], n, before)


def formed_mode_problem(
    model: Model,
    targets: ModeTargets,
    nuisances: Sequence[Uncertain] = (),
    *,
    damping_std: float = 0.5,
    model_error: float = EXPLAINED_LEVEL,
) -> tuple[ModeProblem, Formed]:
    """Return the same for fits to measured modes."""
    model, mesh = fine_enough(with_higher_mass(model), targets)
    form, std = form_of(model) if model_error > 0 else ((), ())
    formed = model.with_effect(*form)
    problem = build_mode_problem(
        formed, targets, (*nuisances, *std), damping_std=damping_std, model_error=model_error, mesh_level=mesh
    )
    return problem, Formed(model, formed, std)
