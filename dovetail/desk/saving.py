"""What leaves the desk: a study file with the hypothesis in it, and a report of it."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from dovetail.disk.output import Output, check_outputs, result_folder
from dovetail.file.config import Study
from dovetail.file.paths import input_files
from dovetail.found import Reported, reported_text
from dovetail.pipeline import Progress, analysed, write
from dovetail.result import NAMES
from fem.io.atomic import replacing
from updating.diagnosis.diagnosis import EFFECT, FITTED, N_CHECKED, NOTHING, Diagnosis
from updating.diagnosis.findings import Finding, parameters_of, step_added, step_of
from updating.inference.preparation import basis_error, discretisation_error, fitted_model
from updating.live.engine import LiveModel
from updating.live.fitting import fit_uncertain
from updating.live.hypothesis import Hypothesis

BY_HAND = "The effects of this report were chosen by hand; no search has compared them with others."


def save_study(study: Study, live: LiveModel, h: Hypothesis, path: Path) -> Path:
    """Write the study with a hypothesis in it, and beside it which values were compared.

    `dovetail compare` with this file prints the errors that the desk shows.

    Parameters
    ----------
    study : Study
    live : LiveModel
    h : Hypothesis
    path : Path
        The study file; the choice of values has its name and ``.npz``.

    Returns
    -------
    Path
        The study file.

    Raises
    ------
    OutputError
        If a file that the study reads would be overwritten.
    """
    compared = path.with_suffix(".npz")
    check_outputs(input_files(study.path), Output("path", path), Output("path", compared))
    result, data = h.result(), live.data_of(h)
    reported = Reported(
        study, live.problem, result, fitted_model(study.model, result), result.effects, h.faults
    )
    text = reported_text(reported, path.parent, compared.name)
    frf = data.measurement.frf
    with replacing(compared) as scratch, scratch.open("wb") as file:
        np.savez_compressed(
            file,
            frequency=frf.frequency,
            outputs=np.array(frf.outputs, dtype=str),
            inputs=np.array(frf.inputs, dtype=str),
            compared=data.mask,
        )
    with replacing(path) as scratch:
        scratch.write_text(text, encoding="utf-8")
    return path


def write_desk_report(study: Study, live: LiveModel, h: Hypothesis, folder: Path, say: Progress) -> Path:
    """Write the report of a hypothesis, as `dovetail run` writes that of a search.

    Parameters
    ----------
    study : Study
    live : LiveModel
    h : Hypothesis
    folder : Path
        New, empty, or of an earlier run.
    say : callable
        Called with a text and the fraction done.

    Returns
    -------
    Path
        The report.
    """
    begun = time.perf_counter()
    check_outputs(input_files(study.path), Output("folder", folder, NAMES))
    with result_folder(folder) as scratch:
        say("fitting what is uncertain", 0.05)
        less = fit_uncertain(live, replace(h, effects=(), fit=None), lambda text, done: say(text, 0.4 * done))
        diagnosis = by_hand(study, live, replace(less, faults=h.faults), h, time.perf_counter() - begun)
        result = analysed(study, diagnosis, folder, begun)
        write(result, scratch, lambda text, done: say(text, 0.4 + 0.6 * done))
    return result.report


def by_hand(study: Study, live: LiveModel, without: Hypothesis, h: Hypothesis, seconds: float) -> Diagnosis:
    """Return a hypothesis in the form in which reports take what a search has found."""
    problem = live.problem_of(h)
    before, found = (problem.assessed(x.result()) for x in (without, h))
    steps = [step_of("nominal model", problem.nominal()), step_of(FITTED, before)]
    if h.effects:
        steps.append(step_added(h.effects, found))
    findings = tuple(Finding(e, parameters_of(e, found), ()) for e in h.effects)
    mesh_db, mesh_level = discretisation_error(problem)
    floor = float(np.hypot(problem.data.noise_level, mesh_level))
    return Diagnosis(
        EFFECT if h.effects else NOTHING, "effects were added by hand", findings, h.faults, tuple(steps), (),
        problem.data.noise_db, mesh_db, basis_error(problem, found, N_CHECKED),
        max(problem.model_error, floor), floor, problem, fitted_model(study.model, found), (BY_HAND,),
        seconds,
    )  # fmt: skip
