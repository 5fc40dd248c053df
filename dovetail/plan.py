"""What a study's test could see and name, planned or measured."""

from collections.abc import Callable
from dataclasses import replace
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.file.contents import StudyContents, measured, without_held_out
from dovetail.file.table import StudyError
from dovetail.pipeline import Progress, fit_settings
from fem.effects.places import members_mass
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.candidates import situated
from updating.diagnosis.diagnose import diagnose
from updating.diagnosis.diagnosis import Diagnosis
from updating.diagnosis.evidence.diagnosis import prepare_search, search_of_problem
from updating.diagnosis.separation import has_sensor, places_along
from updating.inference.heartbeat import beating
from updating.measurement.measurement import Measurement, Sensor
from updating.plan.check import FailedTrial, Trial, trials
from updating.plan.choose import ChosenChannels, choose
from updating.plan.perturbed import Separation, perturbed, with_masses, without_supports
from updating.plan.plan import Plan, plan_from_search, plan_test
from updating.plan.planned import USUAL_NOISE, planned_measurement

MASS_SHARE, MOST_TWINS = 0.05, 8
"""A known mass in parts of the structure's [-], and so many pairs of twins at most that it is to separate."""


def plan_study(
    study: StudyContents,
    noise: float | None = None,
    left_db: float | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Return what a study's test could see and name.

    Of a study with measured FRFs with their noise and with what the fitted model leaves of them, unless
    ``noise`` or ``left_db`` is given.

    Parameters
    ----------
    study : Study
    noise : float, optional
        Noise of a planned test, in parts of the root mean square of the FRFs of a force [-].
    left_db : float, optional
        What a right model will leave beside noise [dB].
    progress : callable, optional
        Called with a text and the fraction done.

    Raises
    ------
    StudyError
        If the study has no sensors or no excitations, or ``noise`` is not a number between 0 and 1.
    """
    if noise is not None and not (isinstance(noise, Real) and 0 < noise < 1):
        msg = f"noise is {noise!r}; a part of the FRFs' root mean square is needed, such as 0.01 for 1 %"
        raise StudyError(msg)
    with beating(progress or (lambda text, done: None)) as say:
        return _plan(study, noise, left_db, say)


def _plan(study: StudyContents, noise: float | None, left_db: float | None, say: Progress) -> Plan:
    how = _settings(study)
    if noise is None and left_db is None and (study.measurements or study.amplitudes):
        data = without_held_out(study, measured(study, phases=False)[0])
        say("reducing the model", 0.0)
        prepared = prepare_search(study.model, data, study.nuisances, **how)
        say("fitting the uncertain parameters", 0.3 * 0.05)
        found = search_of_problem(*prepared, progress=lambda text, done: say(text, 0.3 * done))
        return plan_from_search(found, study.relevant, lambda text, done: say(text, 0.3 + 0.7 * done), data)
    if not (study.sensors and study.excitations):
        awaited = f"; {study.awaited[-1]}" if study.awaited else ""
        msg = (
            f"{study.path}: a plan needs [[sensors]] and [[excitations]], or the numbers to choose "
            f"(--choose 8 --excitations 2; in Python choose=8, excitations=2){awaited}"
        )
        raise StudyError(msg)
    frequency = _lines(study)
    test = planned_measurement(
        study.model,
        study.sensors,
        study.excitations,
        frequency,
        USUAL_NOISE if noise is None else noise,
        errors=study.channel_errors,
    )
    level = None if left_db is None else left_db / DB_PER_NEPER
    how |= {"sizes": study.relevant, "discrepancy": level}
    return plan_test(study.model, test, study.nuisances, progress=say, **how)


def with_chosen(
    study: StudyContents,
    add: int | None = None,
    choose: int | None = None,
    excitations: int | None = None,
    noise: float | None = None,
    left_db: float | None = None,
    progress: Progress | None = None,
) -> tuple[StudyContents, ChosenChannels | None]:
    """Return a study with added or chosen channels, and these; as it is where none are asked for.

    Parameters
    ----------
    study : Study
    add : int, optional
        Number of sensors beside the study's.
    choose : int, optional
        Number of sensors in place of them.
    excitations : int, optional
        Number of forces that are chosen with ``choose``; those of the study unless given.
    noise, left_db, progress
        As of :func:`plan_study`.

    Raises
    ------
    StudyError
        As of :func:`choose_channels`; if both numbers of sensors are given, or forces alone are chosen.
    """
    if excitations is not None and choose is None:
        msg = "excitations are chosen in addition to sensors; choose gives the number of sensors"
        raise StudyError(msg)
    if add is not None and choose is not None:
        msg = "add keeps the study's sensors, and choose chooses all; give one of them"
        raise StudyError(msg)
    n_sensors = choose or add
    if not n_sensors:
        return study, None
    more: dict[str, Any] = {
        "noise": noise,
        "left_db": left_db,
        "progress": progress,
        "added": add is not None,
    }
    chosen = choose_channels(study, n_sensors, excitations, **more)
    return with_channels(study, chosen), chosen


def choose_channels(
    study: StudyContents,
    n_sensors: int,
    n_excitations: int | None = None,
    noise: float | None = None,
    left_db: float | None = None,
    progress: Progress | None = None,
    *,
    added: bool = False,
) -> ChosenChannels:
    """Choose sensors, and places for forces, by which most relevant effects are named.

    From points along all members, along x, y and z. Forces are the study's unless their number is given.
    Where sensors are ``added``, the study's stay beside them.

    Parameters
    ----------
    study : Study
    n_sensors : int
    n_excitations : int, optional
    noise, left_db, progress
        As of :func:`plan_study`.

    Raises
    ------
    StudyError
        If more are to be chosen than there are places, or the study has no forces and none are to be chosen.
    """
    mesh, kept = study.model.mesh, study.sensors if added else ()
    possible = tuple(
        Sensor(f"{place.removeprefix('member ')} {axis}", mesh.points[point], np.eye(3)[k])
        for point, place in places_along(study.model)
        for k, axis in enumerate("xyz")
        if not has_sensor(kept, mesh.points[point], np.eye(3)[k], mesh.size)
    )
    if n_excitations is None and not study.excitations:
        msg = f"{study.path}: it has no [[excitations]]; give the number to choose"
        raise StudyError(msg)
    for word, n in (("sensors", n_sensors), ("excitations", n_excitations or 1)):
        if n > len(possible):
            msg = f"{study.path}: {n} {word} are to be chosen from {len(possible)} places and directions"
            raise StudyError(msg)
    how = _settings(study)
    return choose(
        study.model,
        possible,
        study.excitations if n_excitations is None else possible,
        _lines(study),
        n_sensors,
        n_excitations,
        study.nuisances,
        kept=kept,
        sizes=study.relevant,
        noise=USUAL_NOISE if noise is None else noise,
        errors=study.channel_errors,
        discrepancy=None if left_db is None else left_db / DB_PER_NEPER,
        progress=progress,
        **how,
    )


def with_channels(study: StudyContents, chosen: ChosenChannels) -> StudyContents:
    """Return a study with the sensors and forces of another test, and no measurements."""
    none: dict[str, Any] = {"measurements": (), "amplitudes": (), "frequency": _lines(study)}
    return replace(study, sensors=(*chosen.kept, *chosen.sensors), excitations=chosen.excitations, **none)


def _settings(study: StudyContents) -> dict[str, Any]:
    """Return what a study says of candidates and fits, as diagnoses and plans take it."""
    return {"kinds": study.kinds, "exclude": study.exclude, **fit_settings(study)}


def _lines(study: StudyContents) -> NDArray[np.float64]:
    """Return the lines of a planned test: those that were measured, or those of the study [Hz]."""
    return study.measurements[0].frf.frequency if study.measurements else study.frequency


def separate_twins(
    study: StudyContents, plan: Plan, mass: float | None = None, progress: Progress | None = None
) -> list[Separation]:
    """Return what tells twins apart best in a second test with the same channels.

    A known mass, or the release of a support.

    Parameters
    ----------
    study : Study
    plan : Plan
        Of a planned test.
    mass : float, optional
        5 % of the structure's unless given [kg].
    progress : callable, optional
        Called with a text and the fraction done.
    """
    model = situated(study.model, study.kinds)
    known = MASS_SHARE * members_mass(study.model) if mass is None else mass
    return perturbed(
        plan,
        [*with_masses(model, known), *without_supports(model)],
        study.nuisances,
        plan.twins[:MOST_TWINS],
        progress=progress,
        **fit_settings(study),
    )


def require_planned(study: StudyContents, noise: float | None, left_db: float | None) -> None:
    """Refuse measured data where data of a planned test are drawn, or a second one is planned beside it.

    Raises
    ------
    StudyError
        If a map with this noise and discrepancy is that of measured data.
    """
    if noise is None and left_db is None and (study.measurements or study.amplitudes):
        msg = f"{study.path}: this needs a planned test, not measured data; give its noise (--noise 1%)"
        raise StudyError(msg)


def check_plan(
    study: StudyContents,
    plan: Plan,
    n: int,
    seed: int = 1,
    progress: Progress | None = None,
    keep: Callable[[Trial | FailedTrial], None] = lambda trial: None,
) -> tuple[Trial | FailedTrial, ...]:
    """Return diagnoses of data drawn with effects of known sizes, to compare with a map.

    Parameters
    ----------
    study : Study
    plan : Plan
        Of a planned test.
    n : int
        Number of sets of data.
    seed : int
    progress : callable, optional
        Called with a text and the fraction done.
    keep : callable
        Called with each diagnosis as it ends, so that a check that is stopped loses none.
    """
    say, found = progress or (lambda text, done: None), []

    def diagnosed(data: Measurement) -> Diagnosis:
        say(f"diagnosing {data.name} of {n}", len(found) / n)

        def part(text: str, done: float) -> None:
            say(f"{data.name} of {n}: {text}", (len(found) + done) / n)

        return diagnose(study.model, [data], study.nuisances, progress=part, **_settings(study))

    for trial in trials(plan, n, np.random.default_rng(seed), diagnosed):
        found.append(trial)
        keep(trial)
    return tuple(found)
