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
from updating.inference.fitting import COMPARED, QUICK_LINES, fit, refit
from updating.quality.corrections import (
    FAULTS,
    UNLIKE_EFFECTS,
    Fault,
    combined,
    corrected,
    inverse,
    mirrored,
    mirrored_fault,
    uncorrected,
)
from updating.quality.cross_prediction import (
    CrossPrediction,
    Field,
    cross_predict,
    less_certain,
    rival_predictions,
)
from updating.quality.fault_hypotheses import FaultHypothesis, Series, factor_hypotheses
from updating.quality.misplaced import misplaced_force
from updating.quality.sensor_faults import sensor_hypotheses, swap_hypotheses
from updating.quality.signs import reversed_channels

LEAST_CHANNELS = 3
"""Fewer channels cannot check one another."""


Score = Callable[[FitProblem, Sequence[Fault]], float]
"""Log probability of a model and faults, by data that are corrected for them."""


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
    # Largest number of faults that are searched for
    while len(faults) < 12:
        more = _reversed(problem, null) or _most_convincing(problem, null)
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
    for k, fault in enumerate(faults):
        if fault.kind.endswith(("sign", "swap")) or fault.shift:
            kept.append(fault)
            continue
        data = uncorrected(problem.data, faults)
        as_found = replace(problem, data=corrected(data, [*faults[:k], *faults[k + 1 :]]))
        again = _same_kind(as_found, result, fault)
        kept += [fault] if again is None else again
    return tuple(kept)


def _same_kind(problem: FitProblem, result: FitResult, fault: Fault) -> list[Fault] | None:
    """Return the same fault as it is found now; None where no other channels check this one."""
    for view, fitted, as_here in _views(problem, result):
        if as_here(fault).kind.startswith("excitation"):
            continue  # there the channel is no sensor
        X = cross_predict(view, Field.of(view, fitted))
        names = [s.name for s in view.data.measurement.sensors]
        found = [h for h in sensor_hypotheses(view, X, names.index(fault.sensor)) if h.large]
        again = [h for h in found if as_here(h.fault).kind == fault.kind]
        return [as_here(max(again, key=lambda h: h.gain).fault)] if again else []
    return None


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
    options = []
    for view, fitted, as_here in _views(problem, result):
        X = cross_predict(view, Field.of(view, fitted))
        best = _best(view, fitted, X)
        found = [_excitation_faults(view, fitted, X), _misplaced(view, X)]
        if best is not None and best.believed:
            found.append((best.fault,))
        options += [tuple(map(as_here, faults)) for faults in found if faults]
    return _likeliest(problem, result, options) if options else ()


def _misplaced(problem: FitProblem, X: CrossPrediction) -> tuple[Fault, ...]:
    """Return the force that is most certainly at another place of the test, if forces are few."""
    m = problem.data.measurement
    if len(m.sensors) < LEAST_CHANNELS or len(m.excitations) >= LEAST_CHANNELS:
        return ()
    found = [misplaced_force(problem, X, j) for j in range(len(m.excitations))]
    return tuple(fault for _, fault in sorted((f for f in found if f), key=lambda f: -f[0])[:1])


View = tuple[FitProblem, FitResult, Callable[[Fault], Fault]]
"""A problem, a result of it, and how its faults are those of another problem."""


def _transpose(problem: FitProblem, result: FitResult) -> View | None:
    """Return the problem with forces in the place of sensors; None where H is not symmetric.

    By reciprocity the FRFs of a roving hammer are the motions of its places for a force at the sensor.
    """
    m, model = problem.data.measurement, problem.reduced.model
    if not (m.has_transpose and all(e.reciprocal for e in model.effects)):
        return None
    return replace(problem, data=mirrored(problem.data)), _transposed(result, len(m.sensors)), mirrored_fault


def _transposed(result: FitResult, n_sensors: int) -> FitResult:
    """Return a result with the errors of the channels in the order of the transpose."""
    c, std = result.channels, result.channels_std
    n = n_sensors
    return replace(
        result,
        channels=np.concatenate([c[n:], c[:n]]),
        channels_std=np.concatenate([std[n:], std[:n]]),
    )


def _views(problem: FitProblem, result: FitResult) -> list[View]:
    """Return a problem, and its transpose where there are enough forces to check one another.

    Where sensors are too few for that, the transpose alone tells.
    """
    problem = problem.unloaded(result).as_forces(result)
    m, direct = problem.data.measurement, (problem, result, lambda fault: fault)
    turned = _transpose(problem, result) if len(m.excitations) >= LEAST_CHANNELS else None
    if turned is None:
        return [direct]
    return [turned] if len(m.sensors) < LEAST_CHANNELS else [direct, turned]


def _best(problem: FitProblem, result: FitResult, X: CrossPrediction) -> FaultHypothesis | None:
    """Return the most convincing fault of a sensor, believed or not."""
    n = len(problem.data.measurement.sensors)
    if n < LEAST_CHANNELS:
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
    # A fault must change the readings by this share of the residual level at the other sensors [-]
    found = [h for h in found if h.fault.kind in UNLIKE_EFFECTS or h.change > 0.4 * others[h.fault.sensor]]
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
    return min(alike, key=lambda h: FAULTS.index(h.fault.kind.partition("_")[2]))


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
    # A fault that lowers the misfit by more than this factor needs no comparison with unknown forces
    if best.before < 6.0 * best.after:
        rivals += rival_predictions(problem, X, i)
    for rival in rivals:
        again = [h for h in sensor_hypotheses(problem, rival, i) if h.fault.kind == best.fault.kind]
        # A fault must lower the misfit by this factor also where an unknown force may act near the sensor
        if not any(h.large and h.before > 1.5 * h.after for h in again):
            return False
    return True


def _reversed(problem: FitProblem, result: FitResult) -> tuple[Fault, ...]:
    """Return the reversed channels by the fit, or by the nominal model: a fit to wrong signs leads away."""
    found = reversed_channels(problem, result).faults
    if not found and not result.effects:
        found = reversed_channels(problem, problem.nominal()).faults
        if found:
            mended = replace(problem, data=corrected(problem.data, found))
            found = found if _again(mended, result).level < result.level else ()
    return found


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
    forces = [k for k, e in enumerate(excitations) if not e.per_acceleration]
    for n, k in enumerate(forces):
        for j in forces[:n]:
            y, p = motion[:, k, j], motion[:, j, k]
            floor = np.sqrt(variance[:, k, j]) / np.maximum(np.abs(y), 1e-300)
            sigma = np.hypot(floor, np.sqrt(variance[:, j, k]) / np.maximum(np.abs(p), 1e-300))
            sigma = np.sqrt(sigma**2 + 2 * error**2)
            seen: Any = X.seen.any(axis=1)
            series = Series.of(field.frequency, y, p, sigma, seen[:, j] & seen[:, k])
            for h in _of_excitation(series):
                other = inverse(replace(h.fault, sensor=excitations[j].name))
                options = (replace(h.fault, sensor=excitations[k].name),), (other,)
                found.append((h, options))
    if not any(h.believed for h, _ in found):
        lines = field.lines
        y, p = problem.data.H[lines], problem.receptance(result, lines)
        # The model's FRFs are 1/F of those that the data would have.
        # Assumed relative error of the model's FRFs, where only these can be compared [-]
        series = Series.of(field.frequency, p, y, np.full(p.shape, 0.1), problem.data.mask[lines])
        for h in _of_excitation(series)[1:]:
            found.append((h, (tuple(replace(h.fault, sensor=e.name) for e in excitations),)))
    believed = [(h, options) for h, options in found if h.believed]
    if not believed:
        return ()
    return _likeliest(problem, result, max(believed, key=lambda pair: pair[0].gain)[1])


def _of_excitation(series: Series) -> list[FaultHypothesis]:
    """Return the faults of an excitation, still without a name, that make a series' two sides agree."""
    # Smallest deviation of an excitation's gain from 1 that is called a fault, as a logarithm [-]. It is
    # larger than that of a sensor, as a factor that all excitations share may also be a wrong mass of the
    # model.
    return factor_hypotheses(series, "excitation", "", np.linspace(-8, 8, 321), 0.07)


def _likeliest(
    problem: FitProblem, result: FitResult, options: Sequence[tuple[Fault, ...]]
) -> tuple[Fault, ...]:
    """Return the faults with which the model fits best."""
    if len(options) == 1:
        return options[0]
    costs = []
    for faults in options:
        changed = replace(problem, data=corrected(problem.data, faults))
        costs.append(_shortly(changed, result).solution.cost)
    return options[int(np.argmin(costs))]


def _again(problem: FitProblem, result: FitResult) -> FitResult:
    """Fit again after a correction."""
    return problem.assessed(refit(problem, _shortly(problem, result)))


def _shortly(problem: FitProblem, result: FitResult) -> FitResult:
    """Fit few lines: from the last values of the effects, or else from the nominal start as well."""
    near = [result] if result.effects else [result, fit(problem, n_lines=QUICK_LINES, counted_as=0)]
    return min((refit(problem, r, **COMPARED) for r in near), key=lambda r: r.solution.cost)
