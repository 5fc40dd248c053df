"""Faults of sensors and excitations, and FRFs corrected for them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from updating.inference.fit_data import FitData
from updating.measurement.measurement import Measurement, MeasurementError

UNLIKE_EFFECTS = ("sensor_sign", "sensor_delay", "sensor_swap")
"""Kinds of faults that no effect on the structure resembles."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a sensor or an excitation.

    Attributes
    ----------
    kind : str
        ``"sensor_sign"``, ``"sensor_gain"``, ``"sensor_delay"``, ``"sensor_swap"``, ``"sensor_tilt"``,
        ``"sensor_position"``, ``"excitation_sign"``, ``"excitation_gain"`` or ``"excitation_delay"``; of
        errors of channels also ``"excitation_tilt"``, ``"sensor_shift"`` and ``"excitation_shift"``.
    sensor : str
        The sensor or the excitation.
    value : float
        -1 for a sign; the gain [-]; the delay [s]; the angle [rad]; the distance along the member from the
        stated place, or across the channel's direction [m]; 0 for swapped labels.
    std : float
        Its standard deviation, of the gain or in ``unit``.
    unit : str
    other : str
        The sensor that it is swapped with, the member that it has moved on.
    direction : tuple of float
        Of a tilt or a shift: the unit vector, square to the stated direction, towards which it is.
    span : float
        Range of the values that were looked at, of a gain that of its logarithm; 0 of what has no value.
    tolerance : float
        Stated standard deviation of the error, in ``unit``, of a fault that is part of a fitted model of the
        test (:func:`updating.quality.channel_faults.channel_faults`); 0 of one that data are corrected for.
    """

    kind: str
    sensor: str
    value: float
    std: float
    unit: str = "-"
    other: str = ""
    direction: tuple[float, ...] = ()
    span: float = 0.0
    tolerance: float = 0.0

    @property
    def name(self) -> str:
        """Kind and channel, as effects are named."""
        return f"{self.kind}:{self.sensor}"


def corrected(data: FitData, faults: Sequence[Fault]) -> FitData:
    """Return data that are corrected for faults, in their order.

    Signs, gains, delays and labels are corrected in the FRFs, a tilt in the sensor's direction. A sensor at a
    wrong place is masked. Faults of sensors and excitations that the data do not have are ignored.
    """
    for fault in faults:
        data = _turned(data, fault, undo=False)
    return data


def set_right(measurement: Measurement, faults: Sequence[Fault]) -> Measurement:
    """Return a measurement that is corrected for known faults, in their order, as by :func:`corrected`.

    A sensor at a wrong place is left out, as its right place is not known closely enough.

    Raises
    ------
    MeasurementError
        If no sensor is left.
    """
    H, n = measurement.frf.H, len(measurement.frf.frequency)
    # coherence and scatter follow their channel, as weights and noise of a fit's data do
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


def combined(faults: Sequence[Fault]) -> tuple[Fault, ...]:
    """Return faults with those of one kind at one sensor merged: delays added, gains and signs multiplied.

    A fault that was corrected before an effect was found and undone after it vanishes. Faults of sensors with
    swapped labels stay as they are, as their order counts.
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


def _turned(data: FitData, fault: Fault, undo: bool) -> FitData:
    m = data.measurement
    where, kind = fault.kind.split("_", 1)
    names = [s.name for s in (m.sensors if where == "sensor" else m.excitations)]
    if fault.sensor not in names:
        return data
    i, axis = names.index(fault.sensor), 1 if where == "sensor" else 2
    if kind in ("sign", "gain", "delay"):
        # A force that is F times the stated one makes FRFs that are 1/F of the true ones.
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
