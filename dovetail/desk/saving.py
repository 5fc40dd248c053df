"""Files of the desk: a study file with the hypothesis in it, and a report of it."""

import time
from collections.abc import Collection
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from dovetail.disk.output import Output, check_outputs, result_folder
from dovetail.file.config import StudyContents, load_study
from dovetail.file.paths import input_files
from dovetail.file.toml import with_values
from dovetail.found import fit_estimates, fitted_text
from dovetail.pipeline import Progress, analysed, fit_problem, formed_fit_problem, write
from dovetail.result import NAMES
from fem.io.atomic import replacing
from fem.model import Effect, Model
from updating.diagnosis.diagnosis import N_CHECKED, Diagnosis
from updating.diagnosis.findings import Finding, parameters_of, step_added, step_of
from updating.diagnosis.verdict import EFFECT, FITTED, NOTHING
from updating.inference.preparation import basis_error, discretisation_error, fitted_model
from updating.live.engine import LiveModel
from updating.live.fitting import fit_uncertain
from updating.live.hypothesis import Hypothesis
from updating.measurement.held_out import band_of, band_text

BY_HAND = "The effects of this report were chosen by hand; no search has compared them with others."


def save_study(study: StudyContents, live: LiveModel, h: Hypothesis, path: Path) -> Path:
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
    model = model_of(study, live, h)
    form = {e.name for e in form_of(live, h)}
    effects = (*(e for e in model.effects if e.name in form), *result.effects)
    estimates = fit_estimates(live.problem_of(h), result, model)
    text = fitted_text(study, compared, live.problem, result, model, estimates, effects, h.faults)
    if h.held_out != held_out_of(study):
        text = with_values(text, {("fit", "held_out"): sorted(h.held_out)})
    frf = data.measurement.frf
    with replacing(compared) as scratch, scratch.open("wb") as file:
        np.savez_compressed(
            file,
            frequency=frf.frequency,
            outputs=np.array(frf.outputs, dtype=str),
            inputs=np.array(frf.inputs, dtype=str),
            compared=live.compared(h),
            pieces=live.problem_of(h).pieces,
        )
    with replacing(path) as scratch:
        scratch.write_text(text, encoding="utf-8")
    return path


def study_with(study: StudyContents, live: LiveModel, h: Hypothesis) -> StudyContents:
    """Return a study with a hypothesis in it, as :func:`save_study` writes it."""
    with TemporaryDirectory() as folder:
        saved = load_study(save_study(study, live, h, Path(folder) / study.path.name))
    return replace(saved, path=study.path)  # for messages


def form_of(live: LiveModel, h: Hypothesis) -> tuple[Effect, ...]:
    """Return the effects that let the form vary, of no size; none where a hypothesis does not."""
    return live.form if live.has_form(h) else ()


def model_of(study: StudyContents, live: LiveModel, h: Hypothesis) -> Model:
    """Return the full model of a hypothesis."""
    return fitted_model(study.model.with_effect(*form_of(live, h)), h.result())


def write_desk_report(
    study: StudyContents, live: LiveModel, h: Hypothesis, folder: Path, say: Progress
) -> Path:
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
    if h.held_out:  # a report compares held-out channels apart, beside data that do not have them
        study, h = holding_out(study, h.held_out), replace(h, held_out=frozenset(), fit=None)
        live = live_model(study)
        have = {*live.problem.measured.outputs, *live.problem.measured.inputs}
        known = (f for f in h.faults if f.sensor in have and (not f.kind.endswith("swap") or f.other in have))
        h = replace(h, faults=tuple(known))
    with result_folder(folder) as scratch:
        say("fitting uncertain parameters", 0.05)
        less = fit_uncertain(live, replace(h, effects=(), fit=None), lambda text, done: say(text, 0.4 * done))
        diagnosis = by_hand(study, live, replace(less, faults=h.faults), h, time.perf_counter() - begun)
        result = analysed(study, diagnosis, folder, begun)
        write(result, scratch, lambda text, done: say(text, 0.4 + 0.6 * done))
        say("done", 1.0)  # one that is cancelled leaves no folder
    return result.report


def live_model(study: StudyContents) -> LiveModel:
    """Return a study's model, ready for one hypothesis after the other, with its form or without."""
    return LiveModel(fit_problem(study), partial(formed_fit_problem, study))


def held_out_of(study: StudyContents) -> frozenset[str]:
    """Return the channels and bands that a study keeps from fits, as `[fit] held_out` writes them."""
    held = (*(f"excitation {n}" for n in study.held_out), *(f"sensor {n}" for n in study.held_out_sensors))
    return frozenset((*held, *map(band_text, study.held_out_bands)))


def holding_out(study: StudyContents, parts: Collection[str]) -> StudyContents:
    """Return a study that keeps other channels and bands from fits, channels in the study's own order."""
    return replace(
        study,
        held_out=tuple(c.name for c in study.excitations if f"excitation {c.name}" in parts),
        held_out_sensors=tuple(c.name for c in study.sensors if f"sensor {c.name}" in parts),
        held_out_bands=tuple(sorted(b for b in map(band_of, parts) if b is not None)),
    )


def by_hand(
    study: StudyContents, live: LiveModel, without: Hypothesis, h: Hypothesis, seconds: float
) -> Diagnosis:
    """Return a hypothesis as the diagnosis that reports take."""
    problem = live.problem_of(h)
    before, found = (problem.assessed(x.result()) for x in (without, h))
    steps = [step_of("nominal model", problem.nominal()), step_of(FITTED, before)]
    if h.effects:
        steps.append(step_added(h.effects, found))
    findings = tuple(Finding(e, parameters_of(e, found), ()) for e in h.effects)
    mesh_db, mesh_level = discretisation_error(problem)
    floor = float(np.hypot(problem.data.noise_level, mesh_level))
    return Diagnosis(
        verdict=EFFECT if h.effects else NOTHING,
        reason="effects were added by hand",
        findings=findings,
        faults=h.faults,
        steps=tuple(steps),
        rounds=(),
        noise_db=problem.data.noise_db,
        discretisation_db=mesh_db,
        basis_db=basis_error(problem, found, N_CHECKED),
        limit=max(problem.model_error, floor),
        noise_limit=floor,
        problem=problem,
        model=fitted_model(problem.reduced.model, found),
        searched=None,
        modes=None,
        notes=(BY_HAND,),
        seconds=seconds,
    )
