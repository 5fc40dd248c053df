"""Faults of the measurement itself: sensors and excitations with a wrong sign, gain, place or label.

A fault changes one sensor's readings in a known way, the same at all lines; a missing effect changes the
motion of the structure, which the other sensors see too. So every sensor is compared with what all others
predict for its place (:mod:`updating.quality.cross_prediction`), as it is and with each fault that it may
have. A fault is believed if it makes most of the difference go away, in every part of the band, with a value
found in the other parts.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.elements.frame import Frame
from fem.model import Model
from updating.correlation import complex_log
from updating.inference.fit import FitProblem
from updating.inference.fit_data import FitData
from updating.inference.fit_result import FitResult
from updating.least_squares.loss import pseudo_huber
from updating.measurement.measurement import Measurement, MeasurementError, Sensor
from updating.quality.cross_prediction import (
    CrossPrediction,
    Field,
    cross_predict,
    less_certain,
    rival_predictions,
)

GAIN_LEAST = 0.06
"""Smallest deviation of a gain from 1 that is called a fault, as a logarithm [-]."""
EXCITATION_GAIN_LEAST = 0.07
"""Alike, for an excitation; what all excitations share may also be a wrong mass of the model [-]."""
DELAY_LEAST = 0.12
"""Smallest delay that is called a fault, as the phase at the highest frequency [rad]."""
TILT_LEAST = 0.08
"""Smallest angle of a sensor's direction to the stated one that is called a fault [rad]."""
SHIFT_LEAST = 0.02
"""Smallest distance from the stated place that is called a fault, in lengths of the member [-]."""
FALL = 2.2
"""A fault must lower a sensor's misfit to the others' prediction by more than this factor."""
SURE = 10.0
"""The value of a fault must be this multiple of its standard deviation."""
BLOCKS_BETTER = 0.8
"""A fault must lower the misfit in this share of the blocks of lines [-]."""

RIVAL = 1.5
"""A fault must do so by this factor where an unknown force acts near the sensor, too."""
NEEDED = 1.08
"""A fault that the final model seems to explain stays if without it the level is higher by this factor."""
MISFIT_SHARE = 0.4
"""A fault must change the readings by this share of the level that the model misses other sensors' by."""

CLEAR = 6.0
"""A fault that lowers the misfit by more than this factor needs no comparison with unknown forces."""
_OWN = ("sensor_sign", "sensor_delay", "sensor_swap")
"""What no effect on the structure looks like."""

MODEL_SIGMA = 0.1
"""Standard deviation of FRFs from the model's, where nothing else can be compared [-]."""

_SUSPECT = 1.5
"""Sensors with a smaller misfit to the others' prediction are not looked at; noise gives about 0.8 [-]."""
_TURN = 2.0
"""Misfit at which the loss turns from quadratic to linear, in standard deviations [-]."""
_N_BLOCKS = 10
_ZOOMS = 2
"""So many times the grid of a fault's values is drawn around the best."""
_MOST = 12
"""At most this many faults are looked for."""

_SIMPLER = ("sensor_sign", "sensor_gain", "sensor_delay", "sensor_swap", "sensor_tilt", "sensor_position")
"""Of faults that explain a sensor's readings alike, the first in this list is named."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a sensor or an excitation.

    Attributes
    ----------
    kind : str
        ``"sensor_sign"``, ``"sensor_gain"``, ``"sensor_delay"``, ``"sensor_swap"``, ``"sensor_tilt"``,
        ``"sensor_position"``, ``"excitation_sign"``, ``"excitation_gain"`` or ``"excitation_delay"``.
    sensor : str
        The sensor or the excitation.
    value : float
        -1 for a sign; the gain [-]; the delay [s]; the angle [rad]; the distance along the member from the
        stated place [m]; 0 for swapped labels.
    std : float
        Its standard deviation, of the gain or in ``unit``.
    unit : str
    other : str
        The sensor that it is swapped with, the member that it has moved on.
    direction : tuple of float
        Of a tilt: the unit vector, square to the stated direction, towards which it is tilted.
    """

    kind: str
    sensor: str
    value: float
    std: float
    unit: str = "-"
    other: str = ""
    direction: tuple[float, ...] = ()


def corrected(data: FitData, faults: Sequence[Fault]) -> FitData:
    """Return data without the faults, set right in their order.

    Signs, gains, delays and labels are set right in the FRFs, a tilt in the sensor's direction. A sensor at a
    wrong place is left out. Faults of sensors and excitations that the data do not have are passed over.
    """
    for fault in faults:
        data = _turned(data, fault, undo=False)
    return data


def set_right(measurement: Measurement, faults: Sequence[Fault]) -> Measurement:
    """Return a measurement without known faults, set right in their order as by :func:`corrected`.

    A sensor at a wrong place is left out, as nothing says its right one closely enough.

    Raises
    ------
    MeasurementError
        If no sensor is left.
    """
    H, n = measurement.frf.H, len(measurement.frf.frequency)
    # what is known of the noise follows its channel, as weights and noise of a fit's data do
    known = [
        np.full(H.shape, np.nan) if x is None else x for x in (measurement.coherence, measurement.scatter)
    ]
    every, none = np.ones(H.shape, dtype=bool), np.zeros(n, dtype=bool)
    data = FitData(measurement, measurement.frf.frequency, H, every, known[0], known[1], none)
    right = corrected(data, faults)
    new = replace(
        right.measurement,
        frf=replace(measurement.frf, H=right.H),
        coherence=None if measurement.coherence is None else right.weight,
        scatter=None if measurement.scatter is None else right.noise,
    )
    kept = [s.name for k, s in enumerate(new.sensors) if right.mask[:, k].any()]
    if not kept:
        msg = f"[[faults]] puts every sensor of '{measurement.name}' at a wrong place; one at least is needed"
        raise MeasurementError(msg)
    return new if len(kept) == len(new.sensors) else new.with_frf(new.frf.select(outputs=kept))


def uncorrected(data: FitData, faults: Sequence[Fault]) -> FitData:
    """Return data as they were before :func:`corrected`."""
    for fault in reversed(faults):
        data = _turned(data, fault, undo=True)
    return data


def _turned(data: FitData, fault: Fault, undo: bool) -> FitData:
    m = data.measurement
    where, kind = fault.kind.split("_", 1)
    names = [s.name for s in (m.sensors if where == "sensor" else m.excitations)]
    if fault.sensor not in names:
        return data
    i, axis = names.index(fault.sensor), 1 if where == "sensor" else 2
    if kind in ("sign", "gain", "delay"):
        # A force that is F times what was said makes FRFs that are 1/F of what they were.
        factor = _factor(fault, data.frequency)
        H = np.array(data.H)
        part = np.moveaxis(H, axis, 1)
        ratio = factor if undo == (where == "sensor") else 1 / factor
        part[:, i] = part[:, i] * ratio[:, None]
        return replace(data, H=H)
    if kind == "swap":
        order = np.arange(len(names))
        j = names.index(fault.other)
        order[[i, j]] = j, i
        rows = {key: getattr(data, key)[:, order] for key in ("H", "mask", "weight", "noise")}
        return replace(data, **rows)
    if kind == "tilt":
        sensor, towards = m.sensors[i], np.array(fault.direction)
        c, s = np.cos(fault.value), np.sin(fault.value)
        d = (sensor.direction - s * towards) / c if undo else c * sensor.direction + s * towards
        turned = replace(sensor, direction=d / np.linalg.norm(d))
        sensors = tuple(turned if k == i else other for k, other in enumerate(m.sensors))
        return replace(data, measurement=replace(m, sensors=sensors))
    mask = np.array(data.mask)
    mask[:, i] = (data.weight[:, i] > 0) if undo else False
    return replace(data, mask=mask)


def _factor(fault: Fault, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    if fault.kind.endswith("delay"):
        return np.exp(-2j * np.pi * frequency * fault.value)
    return np.full(len(frequency), fault.value, dtype=complex)


@dataclass(frozen=True, slots=True)
class _Hypothesis:
    """A fault that a sensor may have, and what it explains.

    ``size`` and ``least`` are what is compared to call it large. ``gain`` is by how much the sum of losses
    falls, ``before`` and ``after`` the mean losses without and with it, on lines that did not give its value;
    ``better`` the share of blocks of lines where the loss falls; ``change`` what the fault does to the
    logarithm of the readings, the median.
    """

    fault: Fault
    size: float
    least: float
    gain: float
    before: float
    after: float
    better: float
    change: float = np.inf

    @property
    def large(self) -> bool:
        return abs(self.size) > self.least

    @property
    def believed(self) -> bool:
        sure = abs(self.fault.value) > SURE * self.fault.std if self.fault.kind[-4:] != "gain" else True
        if self.fault.kind.endswith("gain"):
            sure = abs(self.size) > SURE * self.fault.std / self.fault.value
        if self.fault.kind.endswith(("swap", "sign")):
            sure = True
        return self.large and sure and self.before > FALL * self.after and self.better >= BLOCKS_BETTER


Losses = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""From values (n,) of a fault to the losses (n, n_lines)."""


def _loss(z: NDArray[np.complex128] | NDArray[np.float64]) -> NDArray[np.float64]:
    return pseudo_huber(z, _TURN)


def _log(ratio: NDArray[np.complex128]) -> NDArray[np.complex128]:
    return complex_log(np.where((ratio == 0) | ~np.isfinite(ratio), 1e-300, ratio))


@dataclass(frozen=True, slots=True, eq=False)
class _Series:
    """A sensor's readings and their prediction, both (n_lines, n), with relative standard deviation."""

    frequency: NDArray[np.float64]
    measured: NDArray[np.complex128]
    predicted: NDArray[np.complex128]
    sigma: NDArray[np.float64]
    seen: NDArray[np.bool_]

    @classmethod
    def of(cls, frequency: NDArray[np.float64], *arrays: Any) -> "_Series":
        """Return a series of readings, prediction, deviation and mask of any shape (n_lines, …)."""
        measured, predicted, sigma, seen = (np.reshape(a, (len(frequency), -1)) for a in arrays)
        return cls(frequency, measured, predicted, sigma, seen)

    def losses(self, predicted: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the losses (…, n_lines) against other predictions (…, n_lines, n)."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            z = _log(self.measured / predicted) / self.sigma
        return (_loss(z) * self.seen).sum(axis=-1)

    def change(self, predicted: NDArray[np.complex128]) -> float:
        """Return the median of |ln(other prediction / prediction)|."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return float(np.median(np.abs(_log(predicted / self.predicted))[self.seen]))

    @property
    def log_ratio(self) -> NDArray[np.complex128]:
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.where(self.seen, _log(self.measured / self.predicted), 0.0)

    def gain_losses(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the losses for gains exp(x)."""
        z = (self.log_ratio - x[:, None, None]) / self.sigma
        return (_loss(z) * self.seen).sum(axis=-1)

    def delay_losses(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the losses for delays x [s]."""
        r = self.log_ratio
        phase = r.imag + 2 * np.pi * self.frequency[:, None] * x[:, None, None]
        phase = (phase + np.pi) % (2 * np.pi) - np.pi
        return (_loss(np.hypot(r.real, phase) / self.sigma) * self.seen).sum(axis=-1)


def _valued(grid: NDArray[np.float64], losses: Losses) -> tuple[float, float, NDArray[np.float64]]:
    """Return the best value of a fault, its standard deviation, and the losses (n_lines,).

    The loss of each block of lines is that with the value from all other blocks; the deviation is Tukey's
    jackknife over blocks (Efron & Tibshirani, An Introduction to the Bootstrap, 1993, ch. 11).
    """
    lowest, highest = float(grid[0]), float(grid[-1])
    every, parts, block = 0.0, np.zeros(0), np.zeros(0, dtype=int)
    for _ in range(_ZOOMS + 1):  # the losses at resonances and between them have a narrow valley
        table, step = losses(grid), grid[1] - grid[0]
        n = table.shape[1]
        block = np.arange(n) * _N_BLOCKS // n
        every, *rest = (_lowest(grid, table[:, block != b]) for b in range(-1, _N_BLOCKS))
        parts = np.array(rest)
        first, last = max(parts.min() - step, lowest), min(parts.max() + step, highest)
        grid = np.linspace(first, last, len(grid))
    held = losses(parts)[block, np.arange(len(block))]
    variance = (_N_BLOCKS - 1) / _N_BLOCKS * ((parts - parts.mean()) ** 2).sum()
    return every, float(np.sqrt(variance)), held


def _lowest(grid: NDArray[np.float64], table: NDArray[np.float64]) -> float:
    """Return where the sum of losses (n, n_lines) is least, between the points of the grid by a parabola."""
    total = table.sum(axis=1)
    k = int(np.argmin(total))
    if not 0 < k < len(grid) - 1:
        return float(grid[k])
    a, b, c = total[k - 1 : k + 2]
    curvature = a - 2 * b + c
    return float(grid[k] + (0.5 * (a - c) / curvature * (grid[1] - grid[0]) if curvature > 0 else 0.0))


def _judge(
    fault: Fault,
    size: float,
    least: float,
    before: NDArray[np.float64],
    after: NDArray[np.float64],
    count: int,
    change: float = np.inf,
) -> _Hypothesis:
    start = np.searchsorted(np.arange(len(before)) * _N_BLOCKS // len(before), np.arange(_N_BLOCKS))
    was, fall = (np.add.reduceat(x, start) for x in (before, before - after))
    tell = was > count / _N_BLOCKS  # blocks with something to explain
    better = float((fall[tell] > 0).mean()) if tell.sum() >= _N_BLOCKS // 3 else 0.0
    return _Hypothesis(
        fault,
        size,
        least,
        float((before - after).sum()),
        float(before.sum() / count),
        float(after.sum() / count),
        better,
        change,
    )


def _directions(model: Model, sensor: Sensor, member: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return unit vectors square to a sensor's direction, the first in its plane with the member's axis."""
    mesh = model.mesh
    points = mesh.points[mesh.member_points(member)]
    k = int(np.argmin(np.linalg.norm(points - sensor.point, axis=1)))
    axis = points[min(k + 1, len(points) - 1)] - points[max(k - 1, 0)]
    d = np.asarray(sensor.direction) / np.linalg.norm(sensor.direction)
    towards: Any = axis / np.linalg.norm(axis)
    towards = towards - (towards @ d) * d
    if np.linalg.norm(towards) < 0.1:  # along the member: any two directions
        unit = np.eye(3)[int(np.argmin(np.abs(d)))]
        towards = unit - (unit @ d) * d
    towards = towards / np.linalg.norm(towards)
    return towards, np.asarray(np.cross(towards, d), dtype=float)


def _azimuth(
    least: Callable[[NDArray[np.complex128]], float], motions: NDArray[np.complex128]
) -> NDArray[np.float64]:
    """Return the direction in the plane of two motions with the least loss, (1, 2): to 15°, then to 3°."""
    best, width = 0.0, np.radians(75)
    for step in np.radians([15.0, 3.0]):
        tried = best + np.arange(-width, width + 0.5 * step, step)
        turns = np.stack([np.cos(tried), np.sin(tried)], axis=1)
        k = int(np.argmin([least(np.tensordot(t, motions, (0, 0))) for t in turns]))
        best, width = float(tried[k]), step
    return np.array([[np.cos(best), np.sin(best)]])


def _sensor_hypotheses(problem: FitProblem, X: CrossPrediction, i: int) -> list[_Hypothesis]:
    """Return the faults that sensor i alone may have."""
    model, sensor = problem.reduced.model, problem.data.measurement.sensors[i]
    series = _series(X, i)
    count = int(series.seen.sum())
    if count < 20:
        return []
    before = series.losses(series.predicted)
    if before.sum() < _SUSPECT * count:
        return []
    name, top = sensor.name, float(X.field.frequency[-1])
    out = [
        _judge(
            Fault("sensor_sign", name, -1.0, 0.0), 1.0, 0.0, before, series.losses(-series.predicted), count
        )
    ]
    x, std, after = _valued(np.linspace(-3, 3, 121), series.gain_losses)
    gain = float(np.exp(x))
    out.append(
        _judge(Fault("sensor_gain", name, gain, gain * std), x, GAIN_LEAST, before, after, count, abs(x))
    )
    x, std, after = _valued(np.linspace(-0.8, 0.8, 129) / top, series.delay_losses)
    fault = Fault("sensor_delay", name, x, std, "s")
    change = float(np.median(2 * np.pi * X.field.frequency * abs(x)))
    out.append(_judge(fault, 2 * np.pi * top * x, DELAY_LEAST, before, after, count, change))

    mesh, frames = model.mesh, model.of_kind(Frame)
    member, position, _ = mesh.nearest_on_members(sensor.point)
    if sensor.member in mesh.members:
        member = str(sensor.member)
        points = mesh.points[mesh.member_points(member)]
        nearest = int(np.argmin(np.linalg.norm(points - sensor.point, axis=1)))
        position = float(mesh.member_positions(member)[nearest])
    point, _ = mesh.nearest_point(sensor.point)
    towards = np.array(_directions(model, sensor, member))
    other = X.elsewhere(i, towards @ X.field.shapes[6 * point : 6 * point + 3])

    def tilted(a: NDArray[np.float64], motion: NDArray[np.complex128]) -> NDArray[np.complex128]:
        angle = a[:, None, None]
        return np.cos(angle) * series.predicted + np.sin(angle) * motion

    angles = np.radians(np.linspace(-80, 80, 41))
    turn = _azimuth(lambda motion: float(series.losses(tilted(angles, motion)).sum(axis=1).min()), other)
    towards, other = (np.concatenate([x, np.tensordot(turn, x, (1, 0))]) for x in (towards, other))
    for direction, motion in zip(towards, other, strict=True):
        x, std, after = _valued(angles, lambda a, m=motion: series.losses(tilted(a, m)))
        fault = Fault("sensor_tilt", name, x, std, "rad", direction=tuple(map(float, direction)))
        change = series.change(tilted(np.array([x]), motion)[0])
        out.append(_judge(fault, x, TILT_LEAST, before, after, count, change))
    if not frames:
        return out
    length = mesh.member_length(member)

    def moved(s: NDArray[np.float64]) -> NDArray[np.complex128]:
        dofs, N = frames[0].interpolate(mesh, [mesh.locate(member, float(x)) for x in s])
        motion = np.einsum("d,ndk->nk", sensor.direction, N[:, :3])
        return X.elsewhere(i, np.einsum("nk,nkr->nr", motion, X.field.shapes[dofs]))

    x, std, after = _valued(np.linspace(0, length, 41), lambda s: series.losses(moved(s)))
    fault = Fault("sensor_position", name, x - position, std, "m", member)
    out.append(
        _judge(
            fault,
            (x - position) / length,
            SHIFT_LEAST,
            before,
            after,
            count,
            series.change(moved(np.array([x]))[0]),
        )
    )
    return out


def _series(X: CrossPrediction, i: int) -> _Series:
    predicted = X.predicted[:, i]
    sigma = np.sqrt(X.variance[:, i]) / np.maximum(np.abs(predicted), 1e-300)
    return _Series(X.field.frequency, X.measured[:, i], predicted, sigma, X.seen[:, i])


def _swap_hypotheses(problem: FitProblem, X: CrossPrediction, suspects: Sequence[int]) -> list[_Hypothesis]:
    """Return the pairs of suspects whose labels may be exchanged, each predicted from all others."""
    names = [s.name for s in problem.data.measurement.sensors]
    out = []
    for b, i in enumerate(suspects):
        for j in suspects[:b]:
            seen = X.seen[:, [i, j]] & X.seen[:, [j, i]]
            count = int(seen.sum())
            if count < 20:
                continue
            predicted, variance = X.without((i, j))
            sigma = np.sqrt(variance) / np.maximum(np.abs(predicted), 1e-300)
            losses = []
            for pair in ([i, j], [j, i]):
                series = _Series.of(X.field.frequency, X.measured[:, pair], predicted, sigma, seen)
                losses.append(series.losses(series.predicted))
            fault = Fault("sensor_swap", names[i], 0.0, 0.0, "-", names[j])
            out.append(_judge(fault, 1.0, 0.0, losses[0], losses[1], count))
    return out


def _best(problem: FitProblem, result: FitResult, X: CrossPrediction, doubtful: bool) -> _Hypothesis | None:
    """Return the most convincing fault of a sensor, believed or not."""
    n = len(problem.data.measurement.sensors)
    if n < 3:
        return None
    found: list[_Hypothesis] = []
    suspects = []
    for i in range(n):
        of_sensor = _sensor_hypotheses(problem, X, i)
        if of_sensor:
            suspects.append(i)
        found += of_sensor
    found += _swap_hypotheses(problem, X, suspects)
    found = [h for h in found if h.large and h.gain > 0]
    if not found:
        return None
    others = _levels_of_others(problem, result, {h.fault.sensor for h in found})
    found = [h for h in found if h.fault.kind in _OWN or h.change > MISFIT_SHARE * others[h.fault.sensor]]
    if not found:
        return None
    best = max(found, key=lambda h: h.gain)
    if best.fault.kind == "sensor_position":  # two exchanged labels look like two wrong places
        swaps = [h for h in found if h.believed and h.fault.kind == "sensor_swap"]
        both = [h for h in swaps if best.fault.sensor in (h.fault.sensor, h.fault.other)]
        best = max(both, key=lambda h: h.gain, default=best)
    sure = doubtful or best.fault.kind in _OWN
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
    """Return the residual level [nepers] that a fit leaves at all sensors but each of some, by its name.

    That of all where no other sensor counts.
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


def _needed(problem: FitProblem, X: CrossPrediction, best: _Hypothesis) -> bool:
    """Whether a fault is needed, too, where constraints may give way or a force may act near the sensor."""
    i = [s.name for s in problem.data.measurement.sensors].index(best.fault.sensor)
    rivals = [less_certain(problem, X)] if X.field.loose.any() else []
    if best.before < CLEAR * best.after:
        rivals += rival_predictions(problem, X, i)
    for rival in rivals:
        again = [h for h in _sensor_hypotheses(problem, rival, i) if h.fault.kind == best.fault.kind]
        if not any(h.large and h.before > RIVAL * h.after for h in again):
            return False
    return True


def find_faults(
    problem: FitProblem, null: FitResult, *, doubtful: bool = False
) -> tuple[FitProblem, FitResult, tuple[Fault, ...]]:
    """Set sensors and excitations right that are at fault, and fit again.

    The most convincing fault is set right first, and everything is fitted and compared again, as one bad
    sensor spoils what is predicted for those beside it.

    Parameters
    ----------
    problem : FitProblem
    null : FitResult
        Its fit; effects in it are fitted again with the rest.
    doubtful : bool
        Whether faults count, too, that what acts near the sensor, or a support that gives way, may look like.

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
    while len(faults) < _MOST:
        more = _turned_excitations(problem, null) or _most_convincing(problem, null, doubtful)
        same = {(f.kind, f.sensor) for f in faults}
        if not more or any((f.kind, f.sensor) in same for f in more):
            break
        mended = replace(problem, data=corrected(start, [*faults, *more]))
        fit = _again(mended, null)
        if fit.level > null.level and not any(f.kind in _OWN for f in more):
            break  # nothing was set right: what acts near the sensor looks like its fault
        faults += more
        problem, null = mended, fit
    return problem, null, tuple(faults)


def _most_convincing(problem: FitProblem, result: FitResult, doubtful: bool) -> tuple[Fault, ...]:
    """Return the fault to set right next, none if there is none.

    A sensor beside an excitation can look as if it was at fault where the excitation is, and the other way
    round: the one that brings the FRFs nearer to the model's is named.
    """
    X = cross_predict(problem, Field.of(problem, result))
    best = _best(problem, result, X, doubtful)
    options = [_excitation_faults(problem, result, X)]
    if best is not None and best.believed:
        options.append((best.fault,))
    options = [faults for faults in options if faults]
    return _likeliest(problem, result, options) if options else ()


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

    With two excitations or more the motion of each one's place by the other must be the same, H_jk = H_kj
    (Maxwell); both are predicted from the sensors, so that none needs to sit there. Which of the two is at
    fault is what brings the FRFs nearer to the model's. Whether all are off by the same factor, the
    model alone can say.
    """
    excitations = problem.data.measurement.excitations
    field = X.field
    motion, variance = less_certain(problem, X, 0.3).everywhere(problem.vectors[1].T @ field.shapes)
    found: list[tuple[_Hypothesis, tuple[tuple[Fault, ...], ...]]] = []
    error = X.prior[1]
    for k in range(len(excitations)):
        for j in range(k):
            y, p = motion[:, k, j], motion[:, j, k]
            floor = np.sqrt(variance[:, k, j]) / np.maximum(np.abs(y), 1e-300)
            sigma = np.hypot(floor, np.sqrt(variance[:, j, k]) / np.maximum(np.abs(p), 1e-300))
            sigma = np.sqrt(sigma**2 + 2 * error**2)
            heard: Any = X.seen.any(axis=1)
            series = _Series.of(field.frequency, y, p, sigma, heard[:, j] & heard[:, k])
            for h in _factor_hypotheses(series, ""):
                other = _inverse(replace(h.fault, sensor=excitations[j].name))
                options = (replace(h.fault, sensor=excitations[k].name),), (other,)
                found.append((h, options))
    if not any(h.believed for h, _ in found):
        lines = field.lines
        y, p = problem.data.H[lines], problem.receptance(result, lines)
        # The model's FRFs are 1/F of those that the data would have.
        series = _Series.of(field.frequency, p, y, np.full(p.shape, MODEL_SIGMA), problem.data.mask[lines])
        for h in _factor_hypotheses(series, "")[1:]:
            found.append((h, (tuple(replace(h.fault, sensor=e.name) for e in excitations),)))
    believed = [(h, options) for h, options in found if h.believed]
    if not believed:
        return ()
    return _likeliest(problem, result, max(believed, key=lambda pair: pair[0].gain)[1])


def _inverse(fault: Fault) -> Fault:
    """Return the fault of the other excitation that would explain the same."""
    if fault.kind == "excitation_delay":
        return replace(fault, value=-fault.value)
    return replace(fault, value=1 / fault.value, std=fault.std / fault.value**2)


def _factor_hypotheses(series: _Series, name: str) -> list[_Hypothesis]:
    """Return the sign, gain and delay of an excitation that make the series' two sides agree."""
    count = int(series.seen.sum())
    if count < 20:
        return []
    before, top = series.losses(series.predicted), float(series.frequency[-1])
    if before.sum() < _SUSPECT * count:
        return []
    turned = Fault("excitation_sign", name, -1.0, 0.0)
    out = [_judge(turned, 1.0, 0.0, before, series.losses(-series.predicted), count)]
    x, std, after = _valued(np.linspace(-8, 8, 321), series.gain_losses)
    gain = float(np.exp(x))
    fault = Fault("excitation_gain", name, gain, gain * std)
    out.append(_judge(fault, x, EXCITATION_GAIN_LEAST, before, after, count))
    x, std, after = _valued(np.linspace(-0.8, 0.8, 129) / top, series.delay_losses)
    fault = Fault("excitation_delay", name, x, std, "s")
    return [*out, _judge(fault, 2 * np.pi * top * x, DELAY_LEAST, before, after, count)]


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
    """Fit again after a correction: from the nominal start, or from where the effects were."""
    again = problem.refit(result)
    return again if result.effects else min(again, problem.fit(), key=lambda r: r.solution.cost)


def confirm_faults(problem: FitProblem, faults: Sequence[Fault], result: FitResult) -> tuple[Fault, ...]:
    """Return the faults with their values against the final model, without those that it has explained.

    Each sensor is compared with the others' prediction once more, without the correction of its own fault and
    with those of all others. The data stay as they are; :func:`settle_faults` puts back what is withdrawn.

    Parameters
    ----------
    problem : FitProblem
        With corrected data.
    faults : sequence of Fault
        What was corrected.
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
        found = _sensor_hypotheses(as_found, X, names.index(fault.sensor))
        again = [h for h in found if h.fault.kind == fault.kind and h.large]
        if again:
            kept.append(max(again, key=lambda h: h.gain).fault)
    return tuple(kept)


def combined(faults: Sequence[Fault]) -> tuple[Fault, ...]:
    """Return faults with those of one kind at one sensor as one: delays added, gains and signs multiplied.

    What was taken for a fault before an effect was found, and back again after it, ends up as nothing. Faults
    of sensors with swapped labels stay as they are, for there the order counts.
    """
    swapped = {name for f in faults if f.kind.endswith("swap") for name in (f.sensor, f.other)}
    out: dict[tuple[str, ...], Fault] = {}
    for k, fault in enumerate(faults):
        added, multiplied = fault.kind.endswith("delay"), fault.kind.endswith(("gain", "sign"))
        if fault.sensor in swapped or not (added or multiplied):
            out[fault.kind, fault.sensor, str(k)] = fault
            continue
        key = fault.kind, fault.sensor
        if key not in out:
            out[key] = fault
            continue
        first = out[key]
        if added:
            value, std = first.value + fault.value, np.hypot(first.std, fault.std)
        else:
            value = first.value * fault.value
            std = abs(value) * np.hypot(first.std / first.value, fault.std / fault.value)
        out[key] = replace(fault, value=value, std=float(std))
    return tuple(f for f in out.values() if not (f.kind.endswith("sign") and f.value == 1))


def settle_faults(
    problem: FitProblem, result: FitResult, faults: Sequence[Fault]
) -> tuple[FitProblem, FitResult, tuple[Fault, ...]]:
    """Value faults once more with the final model, and take back the corrections of those it has explained.

    A fault whose data, put back, the model fits worse by a factor of ``NEEDED`` stays all the same.

    Parameters
    ----------
    problem : FitProblem
        With corrected data.
    result : FitResult
        The fit with the effects that were found.
    faults : sequence of Fault
        What was corrected, in its order.

    Returns
    -------
    problem : FitProblem
        With the data corrected for the faults that are left, with their last values.
    result : FitResult
        Fitted to them.
    faults : tuple of Fault
    """
    as_read = uncorrected(problem.data, faults)
    faults = combined(faults)
    problem = replace(problem, data=corrected(as_read, faults))
    left = confirm_faults(problem, faults, result)

    def fitted(kept: Sequence[Fault]) -> tuple[FitProblem, FitResult]:
        now = replace(problem, data=corrected(as_read, kept))
        return now, _again(now, result)

    best = fitted(left)
    for fault in faults:
        if any((f.kind, f.sensor) == (fault.kind, fault.sensor) for f in left):
            continue
        names = {(f.kind, f.sensor): f for f in left} | {(fault.kind, fault.sensor): fault}
        more = tuple(names[f.kind, f.sensor] for f in faults if (f.kind, f.sensor) in names)
        other = fitted(more)
        if best[1].level > NEEDED * other[1].level:
            left, best = more, other
    return *best, tuple(left)
