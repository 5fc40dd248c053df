"""``found.toml``: the study with the model that a run reports, ready to be compared, run and updated."""

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.file.channel_errors import TABLE, channel_error_values
from dovetail.file.config import StudyContents
from dovetail.file.effects import written_values
from dovetail.file.estimates import FittedEstimate, estimate_key, merged, with_estimates
from dovetail.file.faults import fault_table
from dovetail.file.paths import with_paths
from dovetail.file.toml import toml_comment, with_comments, with_values
from dovetail.file.writing import (
    rebased_values,
    with_damping,
    with_effects,
    with_element_sizes,
    with_parameters,
)
from dovetail.report.words import fault_text, place
from dovetail.result import (
    FRFS,
    RunResult,
    UncertainValue,
    by_frfs,
    by_modes_alone,
    form_words,
    uncertain_parameters,
    uncertain_values,
)
from fem.effects.joint import Spread
from fem.model import Damping, Effect, Model, ParameterRef
from updating.diagnosis.baseline import uncommon
from updating.diagnosis.departures import Departure, departures
from updating.diagnosis.findings import EffectParameter, parameters_of
from updating.diagnosis.mode_diagnosis import ModeDiagnosis
from updating.diagnosis.verdict import Verdict
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.fitted_damping import Connections, fitted_damping
from updating.inference.problem import Problem
from updating.measurement.measurement import Measurement
from updating.quality.corrections import Fault


def found_text(result: RunResult[Verdict], folder: Path) -> str:
    """Return the study with the reported model in it, as a file in a folder.

    It has the fitted values of uncertain parameters and of the damping, the effects and the patches of
    joints that were found, the faults of the measurement, and the choice of values that were compared, so
    that its nominal error is the last one of the report.

    Parameters
    ----------
    result : RunResult
    folder : Path
        Where the text will lie, beside the FRFs of the run.
    """
    d = result.diagnosis
    if by_modes_alone(d):
        return mode_found_text(result.study, d, folder)
    assert by_frfs(d)
    effects, found = (*patches(result), *form(result)), tuple(f.effect for f in d.findings)
    fit = (
        result.study,
        folder / FRFS,
        d.problem,
        d.steps[-1].result,
        d.model,
        estimates_in(d, result.uncertain),
    )
    if d.baseline is not None:  # faults of the second state alone are not those of the baseline
        text = fitted_text(*fit, effects, d.baseline.faults, found)
    else:
        text = fitted_text(*fit, (*effects, *found), d.faults)
    comments = [toml_comment(f"{fault_text(f)}: it is part of [channel_errors]") for f in d.channel_faults]
    return "\n".join([text.rstrip("\n"), *([""] if comments else []), *comments]) + "\n"


def fitted_text(
    study: StudyContents,
    compared: Path,
    problem: FitProblem,
    result: FitResult,
    model: Model,
    estimates: Mapping[str, FittedEstimate],
    effects: Sequence[Effect],
    faults: Sequence[Fault],
    changes: Sequence[Effect] = (),
) -> str:
    """Return a study with a fitted model in it.

    Parameters
    ----------
    study : Study
    compared : Path
        File with the choice of values that were compared; the text will lie in the same folder.
    problem : FitProblem
    result : FitResult
        Values of uncertain parameters and damping.
    model : Model
        The full model with them and with all effects.
    estimates : mapping of str to FittedEstimate
    effects : sequence of Effect
        Effects that the study's model does not have.
    faults : sequence of Fault
        Of the measurement.
    changes : sequence of Effect
        Effects that have come since the baseline.
    """
    text = text_with_model(
        _headed(study),
        compared.parent,
        _fitted_values(study, result, model),
        fitted_damping(problem, result, model),
        [e.rebased(model) for e in effects],
        faults,
        [e.rebased(model) for e in changes],
        estimates,
    )
    if not study.measurements and not study.amplitudes:
        return text
    text = with_values(text, {("measurements", 0, "compared"): compared.name})
    return with_test(text, problem.test_of(result))


def with_test(text: str, measurement: Measurement) -> str:
    """Return the text of a study with FRFs with the form of damping and the errors of channels of a fit."""
    values: dict[Any, Any] = channel_error_values(measurement)
    if tomllib.loads(text)["measurements"][0].get("viscous", False) != measurement.viscous:
        values["measurements", 0, "viscous"] = measurement.viscous
    words = "gain [-], turned towards two axes across [rad], shifted along them [m]"
    errors = dict.fromkeys((path for path in values if path[0] == TABLE), words)
    return with_comments(with_values(text, values), errors)


def mode_found_text(study: StudyContents, d: ModeDiagnosis, folder: Path) -> str:
    """Return the study with the model that a run on modes reports, as a file in a folder.

    Damping is that of the study where no damping ratio was measured. What has changed between two states is
    marked as such, so that the first one's modes are still compared with the model without it. What both
    states lack is an effect of both.

    Parameters
    ----------
    study : Study
    d : ModeDiagnosis
    folder : Path
        Where the text will lie.
    """
    known = {e.name for e in study.model.effects}
    forms = [e for e in d.model.effects if e.is_form and e.name not in known]
    two = d.baseline is not None
    common = [uncommon(e) for e in d.baseline.fitted.effects] if d.baseline is not None else []
    damped = d.problem.data.has_damping
    return text_with_model(
        _headed(study),
        folder,
        values_in(study, d.model),
        fitted_damping(d.problem, d.final.fitted, d.model) if damped else None,
        [e.rebased(d.model) for e in (*forms, *common, *(() if two else d.found))],
        (),
        [e.rebased(d.model) for e in d.found] if two else (),
        estimates_in(d, uncertain_parameters(d)),
    )


def estimates_in(d: Verdict, uncertain: Iterable[UncertainValue]) -> dict[str, FittedEstimate]:
    """Return what a diagnosis says of the values that its study gets, as its report states them."""
    found = [(f.effect.name, f.parameters) for f in d.findings]
    return estimates_of(d.model, uncertain, found, d.departures)


def fit_estimates(problem: Problem[Any], fit: FitResult, model: Model) -> dict[str, FittedEstimate]:
    """Return what a fit that no search has made says of the values of its model."""
    effects = [(e.name, parameters_of(e, fit)) for e in fit.effects if not e.is_form]
    return estimates_of(model, uncertain_values(problem, fit, model), effects, departures(problem, fit))


def estimates_of(
    model: Model,
    uncertain: Iterable[UncertainValue],
    effects: Iterable[tuple[str, Iterable[EffectParameter]]],
    departed: Iterable[Departure],
) -> dict[str, FittedEstimate]:
    """Return the estimates of a model's uncertain parameters, and of effects that were added.

    Parameters
    ----------
    model : Model
    uncertain : iterable of UncertainValue
        Those that are parameters of the model count.
    effects : iterable of (str, iterable of EffectParameter)
        Names, and fitted parameters.
    departed : iterable of Departure
        What of the form is outside its usual range.
    """
    refs = {f"{name}.{parameter}": (name, parameter) for name, parameter in model.values()}
    outside = {(d.effect.name, d.parameter) for d in departed}
    out = {
        estimate_key(*refs[u.name]): FittedEstimate(
            u.std or np.nan, np.nan if u.form_of else u.nominal, refs[u.name] in outside, u.unit
        )
        for u in uncertain
        if u.name in refs and np.isfinite(u.fitted)
    }
    for name, parameters in effects:
        out |= effect_estimates(name, parameters)
    return out


def effect_estimates(name: str, parameters: Iterable[EffectParameter]) -> dict[str, FittedEstimate]:
    """Return the estimates of an effect that was added."""
    return {
        estimate_key(name, p.name): FittedEstimate(np.nan if p.at_bound else p.std or np.nan, unit=p.unit)
        for p in parameters
    }


def _headed(study: StudyContents) -> StudyContents:
    """Return a study whose text says at its end whose effects follow."""
    heading = toml_comment(f"{study.path.name} with the effects found by dovetail and with its fitted values")
    return replace(study, text=study.text.rstrip("\n") + "\n\n" + heading)


def text_with_model(
    study: StudyContents,
    folder: Path,
    values: Mapping[ParameterRef, float],
    damping: tuple[Damping, Connections] | None,
    effects: Sequence[Effect],
    faults: Sequence[Fault],
    changes: Sequence[Effect] = (),
    estimates: Mapping[str, FittedEstimate] | None = None,
) -> str:
    """Return a study's text with other values, effects and faults in it, as a file in a folder.

    Parameters
    ----------
    study : Study
    folder : Path
        Where the text will lie: the files that it names are found from there.
    values : mapping of (effect, parameter) to float
    damping : (Damping, (ndarray, ndarray) or None) or None
        The structure's, and that of connections as in `with_damping`; None keeps those of the text.
    effects : sequence of Effect
        Relative to these values.
    faults : sequence of Fault
    changes : sequence of Effect
        Effects that have come since the baseline.
    estimates : mapping of str to FittedEstimate, optional
        Of these values and effects.
    """
    text = with_element_sizes(with_paths(study.text, study.path.parent, folder), study.chosen_sizes)
    fitted = study.model.with_values(values)
    written = {(e.name, k): v for e in fitted.effects for k, v in written_values(e).items()}
    text = with_parameters(text, {ref: written.get(ref, value) for ref, value in values.items()})
    if damping is not None:
        text = with_damping(text, *damping)
    text = with_effects(with_effects(text, effects), changes, since_baseline=True)
    text = "\n\n".join(part.strip("\n") for part in (text, *map(fault_table, faults)))
    text = with_units(text, (*study.model.effects, *effects, *changes))
    return with_estimates(text, merged(study.estimates, estimates or {}))


def with_units(text: str, effects: Iterable[Effect]) -> str:
    """Return a study's text with places of effects, units of values, and what those of the form mean."""
    tree, comments = tomllib.loads(text), {}
    named = {e.name.removeprefix("known "): e for e in effects}
    tables = [(("effects", i), t.get("candidate", "")) for i, t in enumerate(tree.get("effects", []))]
    tables += [(("values", name), name) for name in tree.get("values", {})]
    for path, name in tables:
        for p in named[name].parameters() if name in named else ():
            comments[(*path, p.name)] = p.unit
        if name in named:
            comments[(*path, "candidate")] = place(named[name].where)
    for name in tree.get("fitted_form", {}):
        if name in named:
            where = place(named[name].where)
            comments["fitted_form", name] = f"{where}: {form_words(named[name].parameters())}"
    return with_comments(text, {path: unit for path, unit in comments.items() if unit not in ("", "-")})


def values_in(study: StudyContents, model: Model) -> dict[ParameterRef, float]:
    """Return the values that parameters of a study's model have in another one, where they differ."""
    before, now = study.model.values(), model.values()
    values = {ref: float(now[ref]) for ref, v in before.items() if ref in now and now[ref] != v}
    return values | rebased_values(model, study.model.effects)


def _fitted_values(study: StudyContents, result: FitResult, model: Model) -> dict[ParameterRef, float]:
    """Return the values of the fit that parameters of the study's own model have."""
    if study.baseline_frfs is not None:
        return values_in(study, model)
    known = study.model.values()
    values = {ref: float(v) for ref, v in result.values.items() if ref in known}
    return values | rebased_values(model, study.model.effects)


def patches(result: RunResult[Verdict]) -> tuple[Spread, ...]:
    """Return the joints' patches that the fitted model has and the study has not, with its values."""
    known, model = {e.name for e in result.study.model.effects}, result.diagnosis.model
    return tuple(e.fitted_in(model) for e in model.of_kind(Spread) if e.name not in known)


def form(result: RunResult[Verdict]) -> tuple[Effect, ...]:
    """Return the uncertain form of sections and connections of the fitted model that the study has not."""
    d, model = result.diagnosis, result.diagnosis.model
    known = (*result.study.model.effects, *patches(result), *(f.effect for f in d.findings))
    return tuple(e for e in model.effects if e.is_form and e.name not in {k.name for k in known})
