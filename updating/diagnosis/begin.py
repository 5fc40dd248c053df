"""What a diagnosis begins with: data, and a reduced model on a mesh that is fine enough for them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Unpack

import numpy as np

from fem.model import Model
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.fitting import FULL_LINES, null_fit, scattered, with_form_of_damping
from updating.inference.formed import builder, refined
from updating.inference.parameters import Nuisance
from updating.inference.preparation import FitOptions, build_fine
from updating.measurement.measurement import Measurement
from updating.quality.faults import Fault, find_faults


def begin(
    model: Model,
    measurement: Measurement,
    nuisances: Sequence[Nuisance] = (),
    *,
    model_error: float = EXPLAINED_LEVEL,
    **settings: Unpack[FitOptions],
) -> FitProblem:
    """Return the problem that a diagnosis begins with, but for the form of the frame.

    Parameters as of :func:`updating.diagnosis.diagnose.diagnose`.
    """
    build = builder(measurement, nuisances, model_error=model_error, **settings)
    return build_fine(build, refined(model, model_error), model_error)[0]


def begin_fitted(
    problem: FitProblem, *, choose_damping: bool = True
) -> tuple[FitProblem, FitResult, tuple[Fault, ...]]:
    """Return a problem with faults of the measurement set right, its complete fit, and these faults."""
    right, result, faults = calibrated(problem, choose_damping=choose_damping)
    return right, right.assessed(replace(scattered(right, result), level=np.nan)), faults


def calibrated(
    problem: FitProblem, *, n_lines: int = FULL_LINES, checked: bool = True, choose_damping: bool = True
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
    choose_damping : bool
        Whether the form of damping between resonances is the more probable one, rather than the problem's.
    """
    null = null_fit(problem, n_lines=n_lines)
    if choose_damping:
        problem, null = with_form_of_damping(problem, null, n_lines=n_lines)
    right, result, faults = problem, null, ()
    if checked:
        right, result, faults = find_faults(problem, problem.assessed(null))
    return right.with_seen_noise(null), result, faults
