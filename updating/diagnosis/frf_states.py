"""What has changed between two states of one structure, by the FRFs of both.

The model is calibrated on the first state. What it leaves there, ln(computed / measured) line by line, is the
error of its form: it is common to both states and is taken off the second one's FRFs. Then only the
difference is left to explain.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Unpack

import numpy as np

from fem.analysis.modes import solve_eigenpairs
from fem.array_types import Floats
from fem.model import Effect, Model
from fem.system import assemble
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.carried import Between, CalibratedFrfs, carried_over
from updating.diagnosis.evidence.budget import NORMAL, Budget
from updating.diagnosis.evidence.diagnosis import Searched, search_of_problem
from updating.diagnosis.evidence.ranking import Ranking
from updating.inference.bases import N_BASES
from updating.inference.belief import UNKNOWN_ODDS
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.fit import FitProblem
from updating.inference.fitting import FULL_LINES, fit, with_form_of_damping
from updating.inference.formed import Formed, formed_problem
from updating.inference.heartbeat import Progress
from updating.inference.parameters import DampingCurve, Nuisance
from updating.inference.preparation import FitOptions, ProblemOptions, build_problem, fitted_model
from updating.inference.workers import ALONE, Workers
from updating.measurement.measurement import Measurement
from updating.quality.faults import corrected, find_faults

ONE_STRUCTURE = Between()
"""Two states of one structure differ by effects, damping, and a small share of the form's error."""
HIGHEST = 1.5
"""Modes up to this multiple of the highest frequency [-]."""


def calibrate_frfs(
    model: Model,
    before: Measurement,
    nuisances: Sequence[Nuisance] = (),
    **settings: Unpack[ProblemOptions],
) -> CalibratedFrfs:
    """Fit uncertain parameters, and the form's, to the FRFs of the first state, and set faults right.

    Settings as of :func:`updating.inference.preparation.build_problem`.
    """
    problem, formed = formed_problem(model, before, nuisances, **settings)
    problem, null = with_form_of_damping(problem, fit(problem, n_lines=FULL_LINES))
    problem, result, faults = find_faults(problem, problem.assessed(null))
    for _ in range(N_BASES):
        problem = _with_modes_of(fitted_model(formed.formed, result), problem)
        result = fit(problem, n_lines=FULL_LINES, stages=problem.stages[-1:], x_from=result)
    model = fitted_model(formed.formed, result)
    alone = build_problem(model, before, (), connections=True, **settings)
    without_nuisances = replace(alone, data=problem.data, damping=_at_its_fit(problem.damping, result.zeta))
    return CalibratedFrfs(model, problem, problem.assessed(result), faults, formed.mesh_db, without_nuisances)


def _with_modes_of(model: Model, problem: FitProblem) -> FitProblem:
    """Return a problem whose basis has the modes of a fitted model, too: its form has moved far together."""
    system = assemble(model, reciprocal=False)
    pairs = solve_eigenpairs(system, max_frequency=HIGHEST * float(problem.data.frequency[-1]))
    return replace(problem, reduced=problem.reduced.with_shapes(np.asarray(system.Q @ pairs.vectors)))


def _at_its_fit(curve: DampingCurve, zeta: Floats) -> DampingCurve:
    """Return a fitted curve of damping as a nominal one."""
    ratio = partial(curve.ratio, unknowns=zeta)
    return replace(curve, nominal=np.atleast_2d(ratio(curve.knots))[0], base=ratio)


def changed_frf_problem(
    model: Model,
    before: Measurement | CalibratedFrfs,
    after: Measurement,
    nuisances: Sequence[Nuisance] = (),
    *,
    changes: Sequence[Effect] = (),
    between: Between = ONE_STRUCTURE,
    model_error: float = EXPLAINED_LEVEL,
    **settings: Unpack[FitOptions],
) -> tuple[CalibratedFrfs, Model, FitProblem]:
    """Return the calibration on the first state, and model and problem of the second one.

    Uncertain parameters have one value in both states of one structure. To the first order they do not matter
    to the difference, so that they stay where the first state has put them. ``between`` names those that
    differ, as between units of a fleet.

    Parameters
    ----------
    model : Model
        In the first state.
    before : Measurement or CalibratedFrfs
        Of the first state, or the calibration on it.
    after : Measurement
    nuisances, model_error, settings
        As of :func:`updating.inference.preparation.build_problem`.
    changes : sequence of Effect
        Effects that are known to have come since the first state.
    between : Between
    """
    first = before
    if isinstance(first, Measurement):
        first = calibrate_frfs(model, first, nuisances, model_error=model_error, **settings)
    changed = first.model.in_environment(*model.environment).with_effect(*changes)
    problem = build_problem(
        changed,
        after,
        between.nuisances,
        connections=True,
        model_error=between.form_share * model_error,
        **settings,
    )
    data = carried_over(first, corrected(problem.data, first.faults), between.form_share)
    damping = first.alone.damping
    if between.damping_std is not None:
        damping = replace(damping, std=between.damping_std)
    return first, changed, replace(problem, data=data, damping=damping)


def search_change(
    first: CalibratedFrfs,
    changed: Model,
    problem: FitProblem,
    candidates: tuple[Effect, ...],
    *,
    between: Between = ONE_STRUCTURE,
    progress: Progress,
    crew: Workers = ALONE,
    budget: Budget = NORMAL,
) -> Searched[FitProblem]:
    """Return a search for what has changed that knows the second state without effects.

    Parameters
    ----------
    first, changed, problem
        As returned by :func:`changed_frf_problem`.
    candidates : tuple of Effect
    between : Between
    progress : callable
    crew : Workers
    budget : Budget
    """
    formed = Formed(changed, changed, (), first.mesh_db)
    ranking = Ranking(form_share=between.form_share)
    searched = search_of_problem(
        problem, formed, candidates, ranking=ranking, progress=progress, crew=crew, budget=budget
    )
    note = (
        f"the calibrated model misses the first state's FRFs by {first.level * DB_PER_NEPER:.2g} dB; what it "
        "leaves there was taken off the second state's, so that only the change remains"
    )
    return replace(searched, notes=(*poor_baseline(first), note, *searched.notes))


def poor_baseline(first: CalibratedFrfs) -> tuple[str, ...]:
    """Return a sentence where the calibrated model does not explain the first state; none where it does.

    It does not where what the library does not have would be the more probable explanation of that state.
    """
    problem, result = first.problem, first.result
    if result.levels is None or result.gain_to(problem.allowed_squares()) <= UNKNOWN_ODDS:
        return ()
    lines = problem.lines_up_to(np.inf, FULL_LINES)
    band, f = problem.band_of(lines), problem.data.frequency[lines]
    k = int(np.argmax(result.misfit / result.levels.noise))
    there = f[band == np.unique(band)[k]]
    misfit, noise = (DB_PER_NEPER * float(np.sqrt(v[k])) for v in (result.misfit, result.levels.noise))
    return (
        f"the baseline is poor: from {there[0]:.4g} to {there[-1]:.4g} Hz the calibrated model misses it "
        f"by {misfit:.2g} dB, {misfit / noise:.2g} σ of its noise. Something may be missing in both states; "
        "what it does to the change is only in the uncertainty of what was taken off",
    )
