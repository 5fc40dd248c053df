"""The pipeline: load, compare, diagnose, locate, draw, write. The place to begin reading."""

import time
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.disk.output import Output, check_outputs, result_folder, write_json
from dovetail.file.contents import StudyContents, has_modes_alone, measured, without_held_out
from dovetail.file.paths import input_files
from dovetail.file.settings import N_MAP_BANDS
from dovetail.found import found_text
from dovetail.modes_pipeline import (
    by_modes,
    diagnose_study_modes,
    first_state,
    modes_in_frfs,
    modes_of_states,
    targets_of,
)
from dovetail.result import (
    FOUND,
    FRFS,
    JSON,
    NAMES,
    PICTURES,
    REPORT,
    RunResult,
    by_frfs,
    by_modes_alone,
    frf_arrays,
    result_dict,
    uncertain_parameters,
)
from fem.io.atomic import replacing
from fem.model import Model
from updating.correlation import compare, rms_db
from updating.diagnosis.begin import begin
from updating.diagnosis.carried import carried_over
from updating.diagnosis.diagnose import diagnose
from updating.diagnosis.diagnosis import Diagnosis
from updating.diagnosis.evidence.budget import BUDGETS
from updating.diagnosis.fitted_modes import modes_of, pair_modes
from updating.diagnosis.frf_states import changed_frf_problem
from updating.diagnosis.localisation import locate
from updating.diagnosis.mode_diagnosis import ModeDiagnosis
from updating.diagnosis.mode_table import ModeTable
from updating.diagnosis.reported_modes import reported_modes
from updating.diagnosis.verdict import FAULT, NOTHING, Verdict
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.form import with_form
from updating.inference.formed import formed_problem
from updating.inference.heartbeat import Lasting, beating
from updating.inference.joint_fit import mode_problem_of
from updating.inference.preparation import N_FIT_LINES, prepared_like
from updating.measurement.measurement import Measurement
from updating.plan.plan import Plan, plan_from_search
from updating.quality.faults import corrected

Progress = Callable[[str, float], None]
"""Called with what is being done and the fraction done, 0 to 1."""

WRITING = "writing the report"
"""How progress calls all that follows the verdict."""


def run(
    study: StudyContents,
    out: Path,
    progress: Progress | None = None,
    *,
    force: bool = False,
    processes: int = 1,
    on_verdict: Callable[[RunResult[Any]], None] | None = None,
) -> RunResult[Any]:
    """Find what a study's model lacks, and write a report.

    ``out`` gets ``report.html``, ``result.json``, ``frf.npz`` of a study with FRFs, ``pictures/`` and
    ``found.toml``, the study with the reported model in it, all of them or none. A study without a file, of a
    model that was built in Python, has no ``found.toml``.

    Parameters
    ----------
    study : Study
    out : Path
        Folder that is new, empty, or of an earlier run.
    progress : callable, optional
        Called with a text and the fraction done.
    force : bool
        Whether to write into a folder that holds other files.
    processes : int
        Number of processes that fit in parallel.
    on_verdict : callable, optional
        Called with the verdict and its tables before comparisons and pictures for the report are made.

    Raises
    ------
    StudyError
        If the study has neither FRFs nor modes.
    OutputError
        If ``out`` holds something else.
    """
    study = by_modes(study)
    if not has_modes_alone(study):
        measured(study, phases=False)
    return _written(
        study,
        out,
        lambda say: analyse(study, out, say, processes, on_verdict),
        progress,
        diagnosing=0.85,
        force=force,
    )


def report(
    study: StudyContents, diagnosis: Verdict, out: Path, progress: Progress | None = None
) -> RunResult[Any]:
    """Write the report of a diagnosis of a study, as :func:`run` does.

    Raises
    ------
    OutputError
        If ``out`` holds something else.
    """
    study, begun = by_modes(study), time.perf_counter() - diagnosis.seconds
    return _written(
        study, out, lambda say: analysed(study, diagnosis, out, begun, say), progress, diagnosing=0.3
    )


def _written(
    study: StudyContents,
    out: Path,
    analysing: Callable[[Progress], RunResult[Any]],
    progress: Progress | None,
    *,
    diagnosing: float,
    force: bool = False,
) -> RunResult[Any]:
    """Return a result that is written into a folder; ``diagnosing`` is the share of the work before that."""
    say = progress or (lambda text, done: None)
    check_outputs(input_files(study.path) if study.text else (), Output("out", out, NAMES))
    with result_folder(out, force) as scratch:
        result = analysing(_part(say, 0.0, diagnosing))
        write(result, scratch, _part(say, diagnosing, 1.0))
    return result


def analyse(
    study: StudyContents,
    folder: Path,
    say: Progress,
    processes: int = 1,
    on_verdict: Callable[[RunResult[Any]], None] | None = None,
) -> RunResult[Any]:
    """Compare, diagnose and locate; nothing is drawn or written."""
    start_time = time.perf_counter()
    diagnosis = diagnose_any(study, _part(say, 0.0, 0.9), processes)
    return analysed(study, diagnosis, folder, start_time, _part(say, 0.9, 1.0), on_verdict)


def diagnose_any(
    study: StudyContents, say: Progress | None = None, processes: int = 1, budget: str = "normal"
) -> Diagnosis | ModeDiagnosis:
    """Diagnose by the FRFs of a study, or by its modes where it has no FRFs or a baseline has modes."""
    if has_modes_alone(study):
        return diagnose_study_modes(study, say)
    return diagnose_study(study, say, processes, budget)


def analysed(
    study: StudyContents,
    diagnosis: Verdict,
    folder: Path,
    start_time: float,
    progress: Progress | None = None,
    on_verdict: Callable[[RunResult[Any]], None] | None = None,
) -> RunResult[Any]:
    """Return what a diagnosis means for the report: comparisons, places of the misfit, modes.

    Parameters
    ----------
    study : Study
    diagnosis : Verdict
    folder : Path
        Where the report will be.
    start_time : float
        ``time.perf_counter()`` when the work began [s].
    progress : callable, optional
        Called with a text and the fraction done.
    on_verdict : callable, optional
        Called with the verdict and its tables, before the rest is computed.
    """
    say = progress or (lambda text, done: None)
    more: dict[str, Any] = {}
    told: dict[str, Any] = {}
    if by_frfs(diagnosis):
        told = {
            "measured_modes": measured_modes(diagnosis),
            "held_out_channels": held_out_errors(study, diagnosis),
        }
    if by_modes_alone(diagnosis):
        told = {"measured_modes": diagnosis.modes}
    result = RunResult(
        study=study,
        diagnosis=diagnosis,
        uncertain=uncertain_parameters(diagnosis),
        finished=datetime.now().astimezone(),
        seconds=time.perf_counter() - start_time,
        folder=folder,
        **told,
    )
    if on_verdict is not None:
        on_verdict(result)
    say(Lasting(WRITING), 0.0)
    if by_frfs(diagnosis):
        more = _compared_frfs(study, diagnosis, say)
    if by_modes_alone(diagnosis):
        more = {"reported": reported_modes(diagnosis)}
    more["excluded"] = excluded(study, diagnosis, progress)
    seconds = time.perf_counter() - start_time
    return replace(result, finished=datetime.now().astimezone(), seconds=seconds, **more)


def _compared_frfs(study: StudyContents, d: Diagnosis, say: Progress) -> dict[str, Any]:
    """Return what measured FRFs tell beside the diagnosis."""
    say(f"{WRITING}: comparing", 0.1)
    problem, steps = d.problem, d.steps
    nominal, _, fitted = modes_of(d)
    frfs = (d.frf(k) for k in range(len(steps)))
    more: dict[str, Any] = {
        "comparisons": tuple(compare(problem.measured, frf, N_MAP_BANDS, problem.data.mask) for frf in frfs),
        "localisation": locate(problem, steps[min(1, len(steps) - 1)].result, N_MAP_BANDS),
        "modes": pair_modes(nominal, fitted, d.model.mesh.n_points),
    }
    say(f"{WRITING}: identifying modes in the FRFs", 0.3)
    more["states"] = modes_of_states(study, d, nominal, fitted)
    return more | {"identified": modes_in_frfs(study, d, nominal, fitted)}


def measured_modes(d: Diagnosis) -> ModeTable | None:
    """Return the measured modes of a diagnosis by FRFs with the partners in its models; None without any."""
    targets, steps = d.problem.modes, {}
    if targets is None:
        return None
    for step in d.steps:
        problem = mode_problem_of(d.problem, step.result.effects)
        assert problem is not None
        steps[step.label] = problem.computed(step.result)
    return ModeTable.of(targets, steps)


def write(result: RunResult[Verdict], folder: Path, say: Progress) -> None:
    """Write pictures, FRFs, ``result.json`` and the report into a folder."""
    from dovetail.report.pictures import draw_all
    from dovetail.report.report import write_report

    album = draw_all(result, folder / PICTURES, say)
    if by_frfs(result.diagnosis):
        arrays: dict[str, Any] = frf_arrays(result.diagnosis)
        with replacing(folder / FRFS) as scratch, scratch.open("wb") as file:
            np.savez_compressed(file, **arrays)
    write_json(folder / JSON, result_dict(result))
    write_report(result, album, folder / REPORT)
    if not result.study.text:
        return
    with replacing(folder / FOUND) as scratch:
        # the folder's own name: files that the text names are found from there, not from where it is made
        scratch.write_bytes(found_text(result, result.folder).encode())


def diagnose_study(
    study: StudyContents, say: Progress | None = None, processes: int = 1, budget: str = "normal"
) -> Diagnosis:
    """Diagnose with what the study says about uncertainty, band and candidates.

    ``budget`` is a name of :data:`updating.diagnosis.evidence.budget.BUDGETS`.
    """
    more: dict[str, Any] = {}
    model = study.model
    if study.baseline_frfs is not None:
        model, changes = first_state(study)
        more = {"baseline": without_held_out(study, study.baseline_frfs), "changes": changes}
    elif study.modes is not None:
        more["modes"] = targets_of(study.modes)
    return diagnose(
        model,
        [without_held_out(study, m) for m in measured(study, phases=False)],
        study.nuisances,
        kinds=study.kinds,
        exclude=study.exclude,
        progress=say,
        processes=processes,
        budget=BUDGETS[budget],
        **fit_settings(study),
        **more,
    )


def fit_problem(study: StudyContents) -> FitProblem:
    """Return the reduced model and the prepared data of a study's first measurement, for its model as it is.

    Of two states it is the second one's, with the model calibrated on the first.
    """
    if study.baseline_frfs is not None:
        return formed_problem_and_model(study)[0]
    after = without_held_out(study, measured(study, phases=False)[0])
    return begin(study.model, after, study.nuisances, **fit_settings(study))


def formed_fit_problem(study: StudyContents) -> FitProblem:
    """Return a study's problem for fits: the form of its frame is among what is uncertain.

    Of two states it is that of :func:`fit_problem`, whose form was calibrated on the first.
    """
    return formed_problem_and_model(study)[0]


def formed_problem_and_model(study: StudyContents) -> tuple[FitProblem, Model]:
    """Return a study's problem for fits, and the model that its results are values and effects of."""
    more = fit_settings(study)
    after = without_held_out(study, measured(study, phases=False)[0])
    if study.baseline_frfs is None:
        problem, _ = formed_problem(study.model, after, study.nuisances, **more)
        return problem, with_form(study.model, study.model_error, after)
    before, (model, changes) = without_held_out(study, study.baseline_frfs), first_state(study)
    _, changed, problem = changed_frf_problem(model, before, after, study.nuisances, changes=changes, **more)
    return problem, changed


def excluded(study: StudyContents, d: Verdict, progress: Progress | None = None) -> Plan | None:
    """Return what data in which nothing is missing would have shown; None for others, and of two states.

    Nothing is missing either where only errors of channels were found, which the fitted model has.

    Parameters
    ----------
    study : Study
    d : Verdict
    progress : callable, optional
        Called with a text and the fraction done.
    """
    nothing = d.verdict == NOTHING or (d.verdict == FAULT and not d.faults)
    frfs = by_frfs(d)
    several = frfs and d.searched is not None and d.searched.n_levels > 1
    if not nothing or d.searched is None or d.baseline is not None or several:
        return None
    measurement = d.problem.data.measurement if frfs else None
    with beating(progress or (lambda text, done: None)) as say:
        return plan_from_search(d.searched, study.relevant, say, measurement)


def fit_settings(study: StudyContents) -> dict[str, Any]:
    """Return what a study says about damping, band, lines and the model's error, as diagnoses take it."""
    return {
        "damping_std": study.damping_std,
        "band": study.band,
        "n_lines": study.n_lines or N_FIT_LINES,
        "model_error": study.model_error,
    }


def held_out_errors(study: StudyContents, d: Diagnosis) -> dict[str, tuple[float, ...]]:
    """Return, for each excitation and sensor that no fit has seen, the error of each step [dB].

    A sensor is compared for the excitations of the fit, an excitation at the sensors of the fit.
    """
    full = measured(study, phases=False)[0]
    fitted = without_held_out(study, full).frf
    parts = {f"excitation {n}": (fitted.outputs, [n]) for n in study.held_out if n in full.frf.inputs}
    sensors = [n for n in study.held_out_sensors if n in full.frf.outputs]
    parts |= {f"sensor {n}": ([n], fitted.inputs) for n in sensors}
    out = {}
    for label, (outputs, inputs) in parts.items():
        kept = full.with_frf(full.frf.select(outputs, inputs))
        data = corrected(prepared_like(d.problem, kept, study.band), d.faults)
        if d.baseline is not None and study.baseline_frfs is not None:
            data = carried_over(d.baseline.at(study.baseline_frfs, outputs, inputs), data)
        problem = replace(d.problem, data=data)
        results = (_at_channels(s.result, d.problem.data.measurement, kept) for s in d.steps)
        out[label] = tuple(rms_db(problem.log_ratio(r)) for r in results)
    return out


def _at_channels(result: FitResult, fitted: Measurement, other: Measurement) -> FitResult:
    """Return a result with its errors of channels at those of another measurement, by name."""
    if not len(result.channels):
        return result
    errors = fitted.with_channel_errors(result.channels).errors
    return replace(result, channels=replace(other, errors=errors).channel_errors)


def _part(say: Progress, start: float, end: float) -> Progress:
    return lambda text, done: say(text, start + (end - start) * done)
