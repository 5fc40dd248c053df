"""Faults of sensors and excitations, and FRFs corrected for them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.array_types import Complexes, Floats
from updating.inference.belief import EFFECT_ODDS
from updating.inference.fit_data import FitData
from updating.measurement.measurement import Measurement, MeasurementError

CHANNELS = ("sensor", "excitation")
FAULTS = ("sign", "gain", "delay", "swap", "tilt", "position")
"""Faults that a sensor or an excitation may have. Of two that explain its readings equally well, the first in
this list is reported."""

UNLIKE_EFFECTS = tuple(f"{of}_{fault}" for of in CHANNELS for fault in ("sign", "swap"))
"""Kinds of faults that no effect on the structure resembles; a damper at a driven point resembles a delay."""


def log_odds_against(n_channels: int) -> float:
    """Return the prior odds, as a logarithm, against one fault of one of so many channels [nats].

    The odds are those against one more change of the structure.
    """
    return float(EFFECT_ODDS + np.log(len(FAULTS) * n_channels))


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a sensor or an excitation.

    Attributes
    ----------
    kind : str
        One of ``CHANNELS`` and one of ``FAULTS``, such as ``"sensor_gain"`` or ``"excitation_sign"``.
    sensor : str
        The sensor or the excitation.
    value : float
        -1 for a sign; the gain [-]; the delay [s]; the angle [rad]; the distance along the member from the
        stated place, or across the channel's direction [m]; 0 for swapped labels.
    std : float
        Its standard deviation, of the gain or in ``unit``.
    unit : str
    other : str
        The sensor that it is swapped with, the member or the point that it has moved to; of a sign, channels
        that explain the same data if they are reversed instead.
    direction : tuple of float
        Of a tilt or a shift: the unit vector, square to the stated direction, towards which it is.
    span : float
        Range of the values that were looked at, of a gain that of its logarithm; 0 of what has no value.
    tolerance : float
        Stated standard deviation of the error, in ``unit``, of a fault that is part of a fitted model of the
        test (:func:`updating.quality.channel_faults.channel_faults`); 0 of one that data are corrected for.
    shift : tuple of float
        Of a position: from the stated place to the real one, if that is a point of the test or the mesh [m].
        Data are corrected by it; without it the channel is left out.
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
    shift: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        """Kind and channel, as effects are named."""
        return f"{self.kind}:{self.sensor}"


def corrected(data: FitData, faults: Sequence[Fault]) -> FitData:
    """Return data that are corrected for faults, in their order.

    Signs, gains, delays and labels are corrected in the FRFs, a tilt in the channel's direction and a
    position in its place. A channel whose right place is not known is masked. Faults of sensors and
    excitations that the data do not have are ignored.
    """
    for fault in faults:
        data = _turned(data, fault, undo=False)
    return data


def set_right(measurement: Measurement, faults: Sequence[Fault]) -> Measurement:
    """Return a measurement that is corrected for known faults, in their order, as by :func:`corrected`.

    A sensor or an excitation whose right place is not known is left out.

    Raises
    ------
    MeasurementError
        If no sensor or no excitation is left.
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
    rows, columns = (
        [c.name for k, c in enumerate(channels) if right.mask.take(k, axis).any()]
        for channels, axis in ((new.sensors, 1), (new.excitations, 2))
    )
    for word, kept in (("sensor", rows), ("excitation", columns)):
        if not kept:
            msg = (
                f"[[faults]] puts every {word} of '{measurement.name}' at a wrong place; one at least is "
                "needed"
            )
            raise MeasurementError(msg)
    if len(rows) == len(new.sensors) and len(columns) == len(new.excitations):
        return new
    return new.with_frf(new.frf.select(outputs=rows, inputs=columns))


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


def mirrored(data: FitData) -> FitData:
    """Return data whose sensors are the excitations and the other way round."""
    arrays = {key: np.swapaxes(getattr(data, key), 1, 2) for key in ("H", "mask", "weight", "noise")}
    return replace(data, measurement=data.measurement.transposed(), **arrays)


def mirrored_fault(fault: Fault) -> Fault:
    """Return the fault of an excitation that acts on H as one of a sensor does on its transpose, or reverse.

    A force that is F times the stated one makes FRFs that are 1/F of the true ones.
    """
    of, kind = fault.kind.split("_", 1)
    other = replace(fault, kind=f"{'excitation' if of == 'sensor' else 'sensor'}_{kind}")
    return inverse(other) if kind in ("gain", "delay") else other


def inverse(fault: Fault) -> Fault:
    """Return the gain or the delay with the opposite effect on the FRFs."""
    if fault.kind.endswith("delay"):
        return replace(fault, value=-fault.value)
    return replace(fault, value=1 / fault.value, std=fault.std / fault.value**2)


def _turned(data: FitData, fault: Fault, undo: bool) -> FitData:
    m = data.measurement
    where, kind = fault.kind.split("_", 1)
    group, axis = ("sensors", 1) if where == "sensor" else ("excitations", 2)
    channels = getattr(m, group)
    names = [s.name for s in channels]
    if fault.sensor not in names:
        return data
    i = names.index(fault.sensor)
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
        rows = {key: getattr(data, key).take(order, axis) for key in ("H", "mask", "weight", "noise")}
        return replace(data, **rows)
    if kind == "tilt" or fault.shift:
        channel = channels[i]
        if kind == "tilt":
            towards = np.array(fault.direction)
            c, s = np.cos(fault.value), np.sin(fault.value)
            d = (channel.direction - s * towards) / c if undo else c * channel.direction + s * towards
            changed = replace(channel, direction=d / np.linalg.norm(d))
        else:
            shift = np.array(fault.shift)
            changed = replace(channel, point=channel.point - shift if undo else channel.point + shift)
        new = tuple(changed if k == i else other for k, other in enumerate(channels))
        return replace(data, measurement=replace(m, **{group: new}))
    mask = np.array(data.mask)
    part = np.moveaxis(mask, axis, 1)
    part[:, i] = np.moveaxis(data.weight, axis, 1)[:, i] > 0 if undo else False
    return replace(data, mask=mask)


def _factor(fault: Fault, frequency: Floats) -> Complexes:
    if fault.kind.endswith("delay"):
        return np.exp(-2j * np.pi * frequency * fault.value)
    return np.full(len(frequency), fault.value, dtype=complex)
