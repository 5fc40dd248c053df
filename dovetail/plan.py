"""What a study's test could see and name, planned or measured."""

from typing import Any

import numpy as np

from dovetail.file.contents import Study
from dovetail.file.table import StudyError
from dovetail.pipeline import Progress, fit_settings, measured, without_held_out
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.diagnose import diagnose
from updating.diagnosis.diagnosis import Diagnosis
from updating.diagnosis.evidence.diagnosis import begin_search
from updating.measurement.measurement import Measurement
from updating.plan.check import Trial, trials
from updating.plan.plan import Plan, plan_beside, plan_test
from updating.plan.planned import USUAL_NOISE, planned_measurement


def plan_study(
    study: Study, noise: float | None = None, left_db: float | None = None, progress: Progress | None = None
) -> Plan:
    """Return what a study's test could see and name.

    Of a study with measured FRFs with their noise and with what the fitted model leaves of them, unless
    ``noise`` or ``left_db`` is given.

    Parameters
    ----------
    study : Study
    noise : float, optional
        Noise of a planned test, in parts of each FRF's root mean square [-].
    left_db : float, optional
        What a right model will leave beside noise [dB].
    progress : callable, optional
        Called with a text and the fraction done.

    Raises
    ------
    StudyError
        If the study has no sensors or no excitations.
    """
    say = progress or (lambda text, done: None)
    how: dict[str, Any] = {"kinds": study.kinds, "exclude": study.exclude, **fit_settings(study)}
    if noise is None and left_db is None and (study.measurements or study.amplitudes):
        data = without_held_out(study, measured(study, phases=False)[0])
        begun = begin_search(
            study.model, data, study.nuisances, progress=lambda text, done: say(text, 0.3 * done), **how
        )
        return plan_beside(begun, study.relevant, lambda text, done: say(text, 0.3 + 0.7 * done))
    for part in ("sensors", "excitations"):
        if not getattr(study, part):
            msg = f"{study.path}: it has no [[{part}]]; a test has both sensors and excitations"
            raise StudyError(msg)
    frequency = study.measurements[0].frf.frequency if study.measurements else study.frequency
    test = planned_measurement(
        study.model, study.sensors, study.excitations, frequency,
        USUAL_NOISE if noise is None else noise, errors=study.channel_errors,
    )  # fmt: skip
    left = None if left_db is None else left_db / DB_PER_NEPER
    return plan_test(
        study.model, test, study.nuisances, sizes=study.relevant, left=left, progress=progress, **how
    )


def check_plan(
    study: Study, plan: Plan, n: int, seed: int = 1, progress: Progress | None = None
) -> tuple[Trial, ...]:
    """Return diagnoses of data drawn with effects of known sizes, to compare with a map.

    Parameters
    ----------
    study : Study
    plan : Plan
        Of a planned test.
    n : int
        So many sets of data.
    seed : int
    progress : callable, optional
        Called with a text and the fraction done.

    Raises
    ------
    StudyError
        If the map is that of measured data.
    """
    if plan.is_measured:
        msg = f"{study.path}: data can be drawn for a planned test; give its noise (--noise 0.01)"
        raise StudyError(msg)
    say, found = progress or (lambda text, done: None), []

    def diagnosed(data: Measurement) -> Diagnosis:
        say(f"diagnosing {data.name} of {n}", len(found) / n)
        how = {"kinds": study.kinds, "exclude": study.exclude, **fit_settings(study)}

        def part(text: str, done: float) -> None:
            say(f"{data.name} of {n}: {text}", (len(found) + done) / n)

        return diagnose(study.model, [data], study.nuisances, progress=part, **how)

    for trial in trials(plan, n, np.random.default_rng(seed), diagnosed):
        found.append(trial)
    return tuple(found)
