"""``[channel_errors]`` of a study file: how well a test's sensors and excitations are described."""

from collections.abc import Sequence

import numpy as np

from dovetail.file.table import StudyTable, suggest
from dovetail.file.toml import rounded_or_zero
from updating.measurement.channel_errors import N_ERRORS, USUAL, ChannelErrors
from updating.measurement.measurement import Measurement, Sensor, references_of

TABLE = "channel_errors"


def read_channel_errors(
    top: StudyTable, sensors: Sequence[Sensor], excitations: Sequence[Sensor]
) -> ChannelErrors:
    """Read ``[channel_errors]``: standard deviations, and the errors that an earlier fit has found."""
    t = top.table(TABLE)
    direction = t.number("direction", float(np.degrees(USUAL.direction)), least=0.0, unit="°")
    position = t.number("position", USUAL.position, least=0.0, unit="m")
    gain = t.number("gain", USUAL.gain, least=0.0, unit="-")
    sensor = t.number("sensor_mass", USUAL.sensor_mass, least=0.0, unit="kg")
    driver = t.number("driver_mass", USUAL.driver_mass, least=0.0, unit="kg")
    stinger = t.number("stinger", USUAL.stinger, least=0.0, unit="N/m")
    known = [
        _known(t.table(key), [c.name for c in channels])
        for key, channels in (("sensors", sensors), ("excitations", excitations))
    ]
    for s in references_of(excitations):
        if s.name in known[0]:
            t.table("sensors").refuse(
                s.name, "responses refer to it, and its errors do not vary; give its gain in [[sensors]]"
            )
    t.finish()
    return ChannelErrors(position, float(np.radians(direction)), gain, sensor, driver, stinger, *known)


def _known(t: StudyTable, names: Sequence[str]) -> dict[str, tuple[float, ...]]:
    out = {}
    for name in t.values:
        if name not in names:
            t.refuse(name, f"there is no such channel; {suggest(name, names)}")
        out[name] = tuple(t.vector(name, size=N_ERRORS, unit="-, rad, rad, m, m").tolist())
    return out


def channel_error_values(measurement: Measurement) -> dict[tuple[str, ...], object]:
    """Return what a study file says of the errors that a fit has found, by place."""
    errors = measurement.errors
    known = {"sensors": errors.sensors, "excitations": errors.excitations}
    return {
        (TABLE, key): {
            name: [rounded_or_zero(v, s) for v, s in zip(each, errors.std, strict=True)]
            for name, each in values.items()
        }
        for key, values in known.items()
        if values
    }
