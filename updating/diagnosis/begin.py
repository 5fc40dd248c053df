"""What a diagnosis begins with: data, and a reduced model on a mesh that is fine enough for them."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fem.model import Model
from updating.diagnosis.patches import refined_on_patches, with_turning
from updating.inference.fit import EXPLAINED_LEVEL, FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.fitting import FULL_LINES, QUICK_LINES, fit, scattered, with_seen_noise
from updating.inference.parameters import Nuisance
from updating.inference.preparation import N_FIT_LINES, build_fine, build_problem, with_higher_mass
from updating.measurement.measurement import Measurement
from updating.quality.faults import Fault, find_faults

Build = Callable[..., FitProblem]
"""Makes the problem of a model, with its uncertain parameters unless ``nuisances`` are given."""


def builder(
    measurement: Measurement,
    nuisances: Sequence[Nuisance] = (),
    *,
    damping_std: float = 0.5,
    band: tuple[float, float] | None = None,
    n_lines: int = N_FIT_LINES,
    model_error: float = EXPLAINED_LEVEL,
) -> Build:
    """Return what makes the fits' problem of a model; parameters as of a diagnosis."""

    def build(model: Model, nuisances: Sequence[Nuisance] = nuisances) -> FitProblem:
        return build_problem(
            model, measurement, with_turning(nuisances, model), damping_std=damping_std, band=band,
            n_lines=n_lines, connections=True, model_error=model_error,
        )  # fmt: skip

    return build


def refined(model: Model, model_error: float) -> Model:
    """Return a model with mass of higher order, and with short elements on the joints' patches."""
    model = with_higher_mass(model)
    return refined_on_patches(model) if model_error > 0 else model


def begin(
    model: Model,
    measurement: Measurement,
    nuisances: Sequence[Nuisance] = (),
    *,
    damping_std: float = 0.5,
    band: tuple[float, float] | None = None,
    n_lines: int = N_FIT_LINES,
    model_error: float = EXPLAINED_LEVEL,
) -> FitProblem:
    """Return the problem that a diagnosis begins with, but for the form of the frame.

    Parameters as of :func:`updating.diagnosis.diagnose.diagnose`.
    """
    build = builder(
        measurement, nuisances, damping_std=damping_std, band=band, n_lines=n_lines, model_error=model_error
    )
    return build_fine(build, refined(model, model_error), model_error)[0]


def begin_fitted(problem: FitProblem) -> tuple[FitProblem, FitResult, tuple[Fault, ...]]:
    """Return a problem with faults of the measurement set right, its complete fit, and these faults."""
    right, result, faults = calibrated(problem)
    return right, right.assessed(replace(scattered(right, result), level=np.nan)), faults


def calibrated(
    problem: FitProblem, *, n_lines: int = FULL_LINES, checked: bool = True
) -> tuple[FitProblem, FitResult, tuple[Fault, ...]]:
    """Return a problem with faults of the measurement set right, its fit, and these faults.

    Everything that is uncertain is fitted, and every sensor is compared with the others. Noise is no more
    than neighbouring lines differ by.

    Parameters
    ----------
    problem : FitProblem
    n_lines : int
    checked : bool
        Whether faults are looked for.
    """
    banded = fit(problem, n_lines=QUICK_LINES, counted_as=0)
    ways = banded, problem.with_even_damping(banded)
    nulls = [fit(problem, stages=problem.stages[-1:], x_from=near, n_lines=n_lines) for near in ways]
    null = max(nulls, key=lambda r: r.log_evidence)
    right, result, faults = problem, null, ()
    if checked:
        right, result, faults = find_faults(problem, problem.assessed(null))
    return with_seen_noise(right, null), result, faults
