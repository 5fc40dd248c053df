"""``[[faults]]`` of a study file: faults of the measurement that are known, set right before all else."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dovetail.file.table import Table, suggest
from dovetail.file.toml import toml_table
from updating.measurement.measurement import Sensor
from updating.quality.corrections import Fault

UNITS = {
    "sensor_sign": "-",
    "sensor_gain": "-",
    "sensor_delay": "s",
    "sensor_swap": "-",
    "sensor_tilt": "rad",
    "sensor_position": "m",
    "excitation_sign": "-",
    "excitation_gain": "-",
    "excitation_delay": "s",
}
"""Kinds of faults, and the units of their values."""


def read_faults(top: Table, sensors: Sequence[Sensor], excitations: Sequence[Sensor]) -> tuple[Fault, ...]:
    """Read ``[[faults]]``, in the order in which they are set right."""
    out = []
    for t in top.tables("faults"):
        kind = t.text("kind", choices=tuple(UNITS))
        what = kind.partition("_")[0]
        name = _name(t, what, sensors if what == "sensor" else excitations)
        value, other, towards = 0.0, "", ()
        if kind.endswith("sign"):
            value = -1.0
        elif kind.endswith("gain"):
            value = t.number("value", above=0, unit="-")
        elif kind != "sensor_swap":
            value = t.number("value", unit=UNITS[kind])
        if kind == "sensor_swap":
            other = _name(t, "other", sensors)
            if other == name:
                t.refuse("other", f"sensor '{name}' cannot be swapped with itself")
        elif kind == "sensor_position":
            other = t.text("other", "")
        elif kind == "sensor_tilt":
            towards = _square(t, next(s for s in sensors if s.name == name))
        t.finish()
        out.append(Fault(kind, name, value, 0.0, UNITS[kind], other, towards))
    return tuple(out)


def _name(t: Table, key: str, known: Sequence[Sensor]) -> str:
    name, names = t.text(key), [s.name for s in known]
    if name not in names:
        word = "excitation" if key == "excitation" else "sensor"
        t.refuse(key, f"there is no {word} '{name}'; {suggest(name, names)}")
    return name


def _square(t: Table, sensor: Sensor) -> tuple[float, ...]:
    """Read the direction towards which a sensor is tilted, square to its own."""
    towards = t.direction("towards")
    if abs(float(towards @ sensor.direction)) > 1e-6:
        t.refuse("towards", f"it must be square to the direction of sensor '{sensor.name}'")
    return tuple(towards.tolist())


def fault_table(fault: Fault) -> str:
    """Return the ``[[faults]]`` entry of a found fault."""
    what = fault.kind.partition("_")[0]
    values: dict[str, Any] = {"kind": fault.kind, what: fault.sensor}
    if not fault.kind.endswith(("sign", "swap")):
        values["value"] = fault.value
    if fault.other:
        values["other"] = fault.other
    if fault.direction:
        values["towards"] = list(fault.direction)
    return toml_table("[[faults]]", values)


def tilted(sensors: Sequence[Sensor], faults: Sequence[Fault]) -> tuple[Sensor, ...]:
    """Return sensors with the directions that they really have."""
    by_name = {s.name: s for s in sensors}
    for f in faults:
        if f.kind == "sensor_tilt" and f.sensor in by_name:
            s = by_name[f.sensor]
            d = np.cos(f.value) * s.direction + np.sin(f.value) * np.array(f.direction)
            by_name[f.sensor] = replace(s, direction=d / np.linalg.norm(d))
    return tuple(by_name[s.name] for s in sensors)
