"""Measured modes of a study as data of fits and of diagnoses, identified in its FRFs where need be."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.file.contents import StudyContents, measured, without_held_out
from dovetail.file.measured_modes import MeasuredModes, ShapeLimits
from dovetail.file.table import StudyError
from dovetail.frf_modes import ModesInFrfs
from fem.analysis.modes import Modes
from fem.model import Effect, Model
from updating.correlation import ModeComparison, comac, compare_modes
from updating.diagnosis.diagnose_modes import diagnose_modes
from updating.diagnosis.diagnosis import Diagnosis
from updating.diagnosis.frf_modes import identified_in, modes_in, with_more_sensors
from updating.diagnosis.mode_diagnosis import Baseline, ModeDiagnosis
from updating.diagnosis.states import changed_problem
from updating.inference.formed import formed_mode_problem
from updating.inference.mode_fit import BAD_PRIOR, ModeProblem
from updating.inference.mode_targets import ModeTargets
from updating.inference.preparation import prepared_like
from updating.measurement.measurement import (
    Measurement,
    sensor_rows,
    shapes_like_motions,
    with_resting_base,
)
from updating.modal.identified_modes import IdentifiedModes
from updating.quality.faults import corrected

Progress = Callable[[str, float], None]


def by_modes(study: StudyContents) -> StudyContents:
    """Return a study whose states all have modes: of a state with FRFs they are identified in these.

    Their frequencies repeat no better than those of the state that was given by modes.

    Raises
    ------
    StudyError
        If no mode is found in the FRFs.
    """
    if study.baseline is None and study.baseline_frfs is not None and not study.measurements:
        later = study.modes or (study.states[0].modes if study.states else None)
        modes, warnings = _identified(study, study.baseline_frfs, later)
        study = replace(study, baseline=modes, baseline_frfs=None)
    elif study.baseline is not None and study.modes is None and study.measurements and not study.states:
        modes, warnings = _identified(study, study.measurements[0], study.baseline)
        study = replace(study, modes=modes, measurements=())
    else:
        return study
    return replace(study, measured_notes=(*study.measured_notes, *warnings))


def _identified(
    study: StudyContents, data: Measurement, other: MeasuredModes | None
) -> tuple[MeasuredModes, tuple[str, ...]]:
    """Return the modes in the FRFs of one state, and sentences on them."""
    data = with_more_sensors(data, study.model)
    found, warnings = modes_in(data, study.band, **asdict(study.shape_limits))
    modes = as_measured(found, data)
    repeatability = float(np.median(other.frequency_std)) if other is not None else 0.0
    f = modes.modes.frequency
    text = (
        f"{data.name}: {len(f)} modes from {f[0]:.4g} to {f[-1]:.4g} Hz were identified in its FRFs, because "
        "the other state has modes"
    )
    return replace(modes, frequency_std=np.hypot(modes.frequency_std, repeatability)), (text, *warnings)


def targets_of(modes: MeasuredModes) -> ModeTargets:
    """Return the measured modes of a study as data of fits."""
    m = modes.modes
    return ModeTargets.of(
        m.frequency,
        modes.frequency_std,
        zeta=None if m.zeta is None else np.asarray(m.zeta, dtype=float),
        zeta_std=modes.zeta_std,
        shapes=m.shapes if modes.has_shapes else None,
        shape_std=modes.shape_std,
        sensors=modes.sensors,
        numbers=[n - 1 for n in modes.numbers] or None,
        plane=modes.plane,
        held_out=[n - 1 for n in modes.held_out],
        name=modes.name,
        driven=modes.driven,
    )


def diagnose_study_modes(
    study: StudyContents,
    say: Progress | None = None,
    judged: Baseline | None = None,
    known: Sequence[Effect] = (),
) -> ModeDiagnosis:
    """Diagnose by the measured modes of a study: what is missing, or what has changed since a baseline.

    What the baseline says of the model is found out unless it is known from another state's diagnosis, or
    which effects it has is ``known``.
    """
    study = by_modes(study)
    assert study.modes is not None
    more: dict[str, Any] = {
        "damping_std": study.damping_std,
        "kinds": study.kinds,
        "exclude": study.exclude,
        "model_error": study.model_error,
        "progress": say,
    }
    model, changes = first_state(study)
    if study.baseline is not None:
        more |= {"baseline": judged or targets_of(study.baseline), "changes": changes, "known": known}
    return diagnose_modes(model, targets_of(study.modes), study.nuisances, **more)


def mode_problem(study: StudyContents) -> ModeProblem:
    """Return the reduced model and the measured modes of a study, as a diagnosis begins with.

    Of two states it is the second one's, with the model calibrated on the first.
    """
    return mode_problem_and_model(study)[0]


def mode_problem_and_model(study: StudyContents) -> tuple[ModeProblem, Model]:
    """Return a study's problem by modes, and the model that its results are values and effects of."""
    study = by_modes(study)
    assert study.modes is not None
    after = targets_of(study.modes)
    more: dict[str, Any] = {"damping_std": study.damping_std, "model_error": study.model_error}
    if study.baseline is None:
        problem, made = formed_mode_problem(study.model, after, study.nuisances, **more)
        return replace(problem, bad_prior=BAD_PRIOR), made.formed
    before, (model, changes) = targets_of(study.baseline), first_state(study)
    _, changed, problem = changed_problem(model, before, after, study.nuisances, changes=changes, **more)
    return problem, changed


def first_state(study: StudyContents) -> tuple[Model, tuple[Effect, ...]]:
    """Return the model of a study's first state, and the effects that have come since.

    Of a study without a baseline all effects are the model's.
    """
    if not study.has_baseline:
        return study.model, ()
    changes = tuple(e for e in study.model.effects if e.name in study.changes)
    return study.model.without_effect(*study.changes), changes


def as_measured(found: IdentifiedModes, data: Measurement) -> MeasuredModes:
    """Return identified modes as measured ones, with their standard deviations.

    Raises
    ------
    StudyError
        If there is none.
    """
    if not found.modes.n_modes:
        msg = (
            f"no mode could be identified from the FRFs of {data.name}; give [modes], or "
            'set to = "frf" in [update]'
        )
        raise StudyError(msg)
    f_std, shape_std = found.relative_std()
    shapes, sensors = shapes_like_motions(found.modes.shapes, data.sensors)
    modes = replace(found.modes, shapes=shapes)
    return MeasuredModes(modes, sensors, f_std, shape_std, f"FRFs of {data.name}")


def modes_in_frfs(study: StudyContents, d: Diagnosis, nominal: Modes, reported: Modes) -> ModesInFrfs | None:
    """Identify modes in the measured FRFs and pair them with computed ones.

    None where the study has measured modes, or where the FRFs do not allow it: amplitudes without phase, or
    no mode that stands out.

    Parameters
    ----------
    study : StudyContents
    d : Diagnosis
    nominal, reported : Modes
        Of the nominal and of the reported model, with a row for every DOF.
    """
    if d.problem.modes is not None:
        return None
    usual = study.shape_limits == ShapeLimits()
    found = (usual and d.identified) or identified_in(d.problem, **asdict(study.shape_limits))
    if not found or not found.found.modes.n_modes:
        return None
    measured = as_measured(found.found, found.measurement)
    rows = sensor_rows(d.model, measured.sensors)
    before = sensor_rows(with_resting_base(d.problem.reduced.model), measured.sensors)
    pairs = {
        "nominal": compare_modes(measured.modes, nominal, before),
        "reported": compare_modes(measured.modes, reported, rows),
    }
    return ModesInFrfs(measured, reported, pairs, comac_of(measured, reported, pairs["reported"], rows))


def modes_of_states(
    study: StudyContents, d: Diagnosis, nominal: Modes, reported: Modes
) -> tuple[dict[int, float], dict[int, float]] | None:
    """Return the frequencies measured before and after, by the number of the computed mode [Hz].

    Both are identified in the FRFs as they were measured: those that a search compares have no part that the
    calibrated model leaves on the baseline. None for one state, or where modes cannot be identified.

    Parameters
    ----------
    study : StudyContents
    d : Diagnosis
    nominal, reported : Modes
        Of the calibrated and of the reported model, with a row for every DOF.
    """
    if d.baseline is None:
        return None
    after = without_held_out(study, measured(study, phases=False)[0])
    changed = replace(d.problem, data=corrected(prepared_like(d.problem, after, study.band), d.faults))
    models = with_resting_base(d.problem.reduced.model), d.model
    out: list[dict[int, float]] = []
    for problem, model, modes in zip((d.baseline.problem, changed), models, (nominal, reported), strict=True):
        found = identified_in(problem, **asdict(study.shape_limits))
        if found is None or not found.found.modes.n_modes:
            return None
        known = as_measured(found.found, found.measurement)
        pairs = compare_modes(known.modes, modes, sensor_rows(model, known.sensors)).pairs
        out.append({int(j): float(known.modes.frequency[i]) for i, j in pairs})
    return out[0], out[1]


def comac_of(
    measured: MeasuredModes, computed: Modes, comparison: ModeComparison, rows: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the CoMAC of each sensor over paired modes, (n_sensors,) [-]; NaN for fewer than two pairs."""
    same = np.array(comparison.pairs, dtype=np.int64).reshape(-1, 2)
    if len(same) < 2:  # of one pair all values are 1
        return np.full(len(rows), np.nan)
    return comac(measured.modes.shapes[:, same[:, 0]], rows @ computed.shapes[:, same[:, 1]])
