"""Faults of the measurement itself: sensors and excitations with a wrong sign, gain, place or label.

A fault changes one sensor's readings in a known way, the same at all lines. A missing effect changes the
motion of the structure, which the other sensors see too. So every sensor is compared with the prediction of
all others for its place (:mod:`updating.quality.cross_prediction`), as it is and with each fault that it may
have. A fault is believed if it explains most of the difference in every part of the band, with a value
from the other parts.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.fitting import fit, refit
from updating.measurement.measurement import BaseMotion
from updating.quality.corrections import UNLIKE_EFFECTS, Fault, combined, corrected, uncorrected
from updating.quality.cross_prediction import (
    CrossPrediction,
    Field,
    cross_predict,
    less_certain,
    rival_predictions,
)
from updating.quality.fault_hypotheses import FaultHypothesis, Series, factor_hypotheses
from updating.quality.sensor_faults import sensor_hypotheses, swap_hypotheses

EXCITATION_GAIN_LEAST = 0.07
"""Smallest deviation of an excitation's gain from 1 that is called a fault, as a logarithm [-]. It is larger
than that of a sensor, as a factor that all excitations share may also be a wrong mass of the model."""

LEAST_RATIO_WITH_FORCES = 1.5
"""A fault must lower the misfit by this factor also where an unknown force may act near the sensor."""

MISFIT_SHARE = 0.4
"""A fault must change the readings by this share of the residual level at the other sensors [-]."""

CLEAR_MISFIT_RATIO = 6.0
"""A fault that lowers the misfit by more than this factor needs no comparison with unknown forces."""

MODEL_SIGMA = 0.1
"""Assumed relative error of the model's FRFs, where only these can be compared [-]."""

_MOST = 12
"""Largest number of faults that are searched for."""

_SIMPLER = ("sensor_sign", "sensor_gain", "sensor_delay", "sensor_swap", "sensor_tilt", "sensor_position")
"""Of faults that explain a sensor's readings equally well, the first in this list is reported."""


Score = Callable[[FitProblem, Sequence[Fault]], float]
"""How probable a model and faults are, as a logarithm, by data that are corrected for them."""


def find_faults(problem: FitProblem, null: FitResult) -> tuple[FitProblem, FitResult, tuple[Fault, ...]]:
    """Correct the data for faults of sensors and excitations, and fit again.

    The most convincing fault is corrected first, then the model is fitted and the sensors are compared again:
    one bad sensor spoils the predictions for its neighbours.

    Parameters
    ----------
    problem : FitProblem
    null : FitResult
        Its fit; effects in it are fitted again with the rest.

    Returns
    -------
    problem : FitProblem
        With corrected data.
    null : FitResult
        Fitted to them.
    faults : tuple of Fault
        In the order in which :func:`corrected` must apply them.
    """
    faults: list[Fault] = []
    start = problem.data
    if not start.phase:  # amplitudes do not say what other sensors imply: their motions do not add up
        return problem, null, ()
    while len(faults) < _MOST:
        more = _turned_excitations(problem, null) or _most_convincing(problem, null)
        same = {f.name for f in faults}
        if not more or any(f.name in same for f in more):
            break
        mended = replace(problem, data=corrected(start, [*faults, *more]))
        fit = _again(mended, null)
        if fit.level > null.level and not any(f.kind in UNLIKE_EFFECTS for f in more):
            break  # the correction helps nothing: an effect near the sensor resembles its fault
        faults += more
        problem, null = mended, fit
    return problem, null, tuple(faults)


def confirm_faults(problem: FitProblem, faults: Sequence[Fault], result: FitResult) -> tuple[Fault, ...]:
    """Return the faults with their values against the final model, without those that it explains.

    Each sensor is compared with the others' prediction once more, without the correction of its own fault and
    with those of all others. The data stay as they are; :func:`settle_faults` undoes corrections.

    Parameters
    ----------
    problem : FitProblem
        With corrected data.
    faults : sequence of Fault
        Faults that were corrected.
    result : FitResult
        The fit with the effects that were found.
    """
    kept = []
    names = [s.name for s in problem.data.measurement.sensors]
    for k, fault in enumerate(faults):
        if not fault.kind.startswith("sensor") or fault.kind.endswith(("sign", "swap")):
            kept.append(fault)
            continue
        data = uncorrected(problem.data, faults)
        as_found = replace(problem, data=corrected(data, [*faults[:k], *faults[k + 1 :]]))
        X = cross_predict(as_found, Field.of(as_found, result))
        found = sensor_hypotheses(as_found, X, names.index(fault.sensor))
        again = [h for h in found if h.fault.kind == fault.kind and h.large]
        if again:
            kept.append(max(again, key=lambda h: h.gain).fault)
    return tuple(kept)


def settle_faults(
    problem: FitProblem, result: FitResult, faults: Sequence[Fault], score: Score
) -> tuple[FitProblem, FitResult, tuple[Fault, ...]]:
    """Estimate faults again with the final model, and undo the corrections of those that it explains.

    A correction stays if it makes the model with the data more probable.

    Parameters
    ----------
    problem : FitProblem
        With corrected data.
    result : FitResult
        The fit with the effects that were found.
    faults : sequence of Fault
        Faults that were corrected, in their order.
    score : callable
        How probable the model and faults are, as a logarithm, by the data that are corrected for them.

    Returns
    -------
    problem : FitProblem
        With data corrected for the remaining faults, with their last values.
    result : FitResult
        Fitted to them.
    faults : tuple of Fault
    """
    as_read = uncorrected(problem.data, faults)
    faults = combined(faults)
    problem = replace(problem, data=corrected(as_read, faults))
    last = {f.name: f for f in confirm_faults(problem, faults, result)}
    remaining = tuple(last.get(f.name, f) for f in faults)

    def with_faults(kept: Sequence[Fault]) -> FitProblem:
        return replace(problem, data=corrected(as_read, kept))

    best = score(with_faults(remaining), remaining)
    for fault in remaining:
        fewer = tuple(f for f in remaining if f is not fault)
        without = score(with_faults(fewer), fewer)
        if without > best:
            remaining, best = fewer, without
    settled = with_faults(remaining)
    return settled, _again(settled, result), remaining


def _most_convincing(problem: FitProblem, result: FitResult) -> tuple[Fault, ...]:
    """Return the faults to correct next, which may be none.

    A fault of an excitation can resemble one of a sensor beside it, and the other way round. The one whose
    correction brings the FRFs nearer to the model's is returned.
    """
    X = cross_predict(problem, Field.of(problem, result))
    best = _best(problem, result, X)
    options = [_excitation_faults(problem, result, X)]
    if best is not None and best.believed:
        options.append((best.fault,))
    options = [faults for faults in options if faults]
    return _likeliest(problem, result, options) if options else ()


def _best(problem: FitProblem, result: FitResult, X: CrossPrediction) -> FaultHypothesis | None:
    """Return the most convincing fault of a sensor, believed or not."""
    n = len(problem.data.measurement.sensors)
    if n < 3:
        return None
    found: list[FaultHypothesis] = []
    suspects = []
    for i in range(n):
        of_sensor = sensor_hypotheses(problem, X, i)
        if of_sensor:
            suspects.append(i)
        found += of_sensor
    found += swap_hypotheses(problem, X, suspects)
    found = [h for h in found if h.large and h.gain > 0]
    if not found:
        return None
    others = _levels_of_others(problem, result, {h.fault.sensor for h in found})
    found = [
        h for h in found if h.fault.kind in UNLIKE_EFFECTS or h.change > MISFIT_SHARE * others[h.fault.sensor]
    ]
    if not found:
        return None
    best = max(found, key=lambda h: h.gain)
    if best.fault.kind == "sensor_position":  # two exchanged labels look like two wrong places
        swaps = [h for h in found if h.believed and h.fault.kind == "sensor_swap"]
        both = [h for h in swaps if best.fault.sensor in (h.fault.sensor, h.fault.other)]
        best = max(both, key=lambda h: h.gain, default=best)
    sure = best.fault.kind in UNLIKE_EFFECTS
    if best.believed and not sure and not _needed(problem, X, best):
        return replace(best, better=0.0)
    alike = [
        h
        for h in found
        if h.fault.sensor == best.fault.sensor
        and h.before - h.after > 0.97 * (best.before - best.after)
        and h.after < 1.1 * best.after
    ]
    return min(alike, key=lambda h: _SIMPLER.index(h.fault.kind))


def _levels_of_others(problem: FitProblem, result: FitResult, names: Collection[str]) -> dict[str, float]:
    """Return the residual level [nepers] of a fit at all sensors except each of ``names``, by its name.

    It is the level of all sensors where no other sensor counts.
    """
    ratio, lines = problem.log_ratio(result), np.arange(len(problem.data.frequency))
    out = {}
    for i, sensor in enumerate(problem.data.measurement.sensors):
        if sensor.name not in names:
            continue
        rest = ratio.copy()
        rest[:, i] = np.nan
        level = problem.level(rest, lines)
        out[sensor.name] = result.level if np.isnan(level) else level
    return out


def _needed(problem: FitProblem, X: CrossPrediction, best: FaultHypothesis) -> bool:
    """Whether a fault is needed even if constraints may give way or a force may act near the sensor."""
    i = [s.name for s in problem.data.measurement.sensors].index(best.fault.sensor)
    rivals = [less_certain(problem, X)] if X.field.loose.any() else []
    if best.before < CLEAR_MISFIT_RATIO * best.after:
        rivals += rival_predictions(problem, X, i)
    for rival in rivals:
        again = [h for h in sensor_hypotheses(problem, rival, i) if h.fault.kind == best.fault.kind]
        if not any(h.large and h.before > LEAST_RATIO_WITH_FORCES * h.after for h in again):
            return False
    return True


def _turned_excitations(problem: FitProblem, result: FitResult) -> tuple[Fault, ...]:
    """Return the excitations whose FRFs have the opposite phase of the model's at most sensors and lines."""
    cosine = np.cos(problem.log_ratio(result).imag)
    out = []
    for j, excitation in enumerate(problem.data.measurement.excitations):
        seen = cosine[:, :, j][np.isfinite(cosine[:, :, j])]
        if seen.size and np.median(seen) < -0.5 and (seen < 0).mean() > 0.75:
            out.append(Fault("excitation_sign", excitation.name, -1.0, 0.0))
    return tuple(out)


def _excitation_faults(problem: FitProblem, result: FitResult, X: CrossPrediction) -> tuple[Fault, ...]:
    """Return a gain or a delay of an excitation, or one that all of them share.

    Two excitations must move each other's places alike, H_jk = H_kj (Maxwell). Both motions are predicted
    from the sensors, so that no sensor needs to be there. Of the two excitations, that one is at fault whose
    correction brings the FRFs nearer to the model's. Only the model shows a factor that all share.
    """
    excitations = problem.data.measurement.excitations
    field = X.field
    motion, variance = less_certain(problem, X, 0.3).everywhere(problem.vectors[1].T @ field.shapes)
    found: list[tuple[FaultHypothesis, tuple[tuple[Fault, ...], ...]]] = []
    error = X.prior[1]
    forces = [k for k, e in enumerate(excitations) if not isinstance(e, BaseMotion)]
    for n, k in enumerate(forces):
        for j in forces[:n]:
            y, p = motion[:, k, j], motion[:, j, k]
            floor = np.sqrt(variance[:, k, j]) / np.maximum(np.abs(y), 1e-300)
            sigma = np.hypot(floor, np.sqrt(variance[:, j, k]) / np.maximum(np.abs(p), 1e-300))
            sigma = np.sqrt(sigma**2 + 2 * error**2)
            seen: Any = X.seen.any(axis=1)
            series = Series.of(field.frequency, y, p, sigma, seen[:, j] & seen[:, k])
            for h in _of_excitation(series):
                other = _inverse(replace(h.fault, sensor=excitations[j].name))
                options = (replace(h.fault, sensor=excitations[k].name),), (other,)
                found.append((h, options))
    if not any(h.believed for h, _ in found):
        lines = field.lines
        y, p = problem.data.H[lines], problem.receptance(result, lines)
        # The model's FRFs are 1/F of those that the data would have.
        series = Series.of(field.frequency, p, y, np.full(p.shape, MODEL_SIGMA), problem.data.mask[lines])
        for h in _of_excitation(series)[1:]:
            found.append((h, (tuple(replace(h.fault, sensor=e.name) for e in excitations),)))
    believed = [(h, options) for h, options in found if h.believed]
    if not believed:
        return ()
    return _likeliest(problem, result, max(believed, key=lambda pair: pair[0].gain)[1])


def _of_excitation(series: Series) -> list[FaultHypothesis]:
    """Return the faults of an excitation, still without a name, that make a series' two sides agree."""
    return factor_hypotheses(series, "excitation", "", np.linspace(-8, 8, 321), EXCITATION_GAIN_LEAST)


def _inverse(fault: Fault) -> Fault:
    """Return the fault of the other excitation with the same consequence."""
    if fault.kind == "excitation_delay":
        return replace(fault, value=-fault.value)
    return replace(fault, value=1 / fault.value, std=fault.std / fault.value**2)


def _likeliest(
    problem: FitProblem, result: FitResult, options: Sequence[tuple[Fault, ...]]
) -> tuple[Fault, ...]:
    """Return the faults with which the model fits best."""
    if len(options) == 1:
        return options[0]
    costs = []
    for faults in options:
        changed = replace(problem, data=corrected(problem.data, faults))
        costs.append(_again(changed, result).solution.cost)
    return options[int(np.argmin(costs))]


def _again(problem: FitProblem, result: FitResult) -> FitResult:
    """Fit again after a correction: from the nominal start, or from the last values of the effects."""
    again = [refit(problem, result)]
    if not result.effects:
        again.append(fit(problem))
    return problem.assessed(min(again, key=lambda r: r.solution.cost))
