"""``[[faults]]`` of a study file: faults of the measurement that are known, set right before all else."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dovetail.file.table import StudyTable, suggest
from dovetail.file.toml import rounded, toml_table
from updating.measurement.measurement import Sensor
from updating.quality.corrections import CHANNELS, FAULTS, Fault

_UNIT_OF = {"delay": "s", "tilt": "rad", "position": "m"}

UNITS = {f"{of}_{fault}": _UNIT_OF.get(fault, "-") for of in CHANNELS for fault in FAULTS}
"""Kinds of faults, and the units of their values."""


def read_faults(
    top: StudyTable, sensors: Sequence[Sensor], excitations: Sequence[Sensor]
) -> tuple[Fault, ...]:
    """Read ``[[faults]]``, in the order in which they are set right."""
    out = []
    for t in top.tables("faults"):
        kind = t.text("kind", choices=tuple(UNITS))
        of, fault = kind.split("_", 1)
        channels = sensors if of == "sensor" else excitations
        name = _name(t, of, of, channels)
        value, other, towards, shift = 0.0, "", (), ()
        if fault == "sign":
            value = -1.0
        elif fault == "gain":
            value = t.number("value", above=0, unit="-")
        elif fault != "swap":
            value = t.number("value", unit=UNITS[kind])
        if fault == "swap":
            other = _name(t, "other", of, channels)
            if other == name:
                t.refuse("other", f"{of} '{name}' cannot be swapped with itself")
        elif fault == "position":
            other = t.text("other", "")
            shift = tuple(t.vector("shift").tolist()) if "shift" in t else ()
        elif fault == "tilt":
            towards = _square(t, next(s for s in channels if s.name == name))
        t.finish()
        out.append(Fault(kind, name, value, 0.0, UNITS[kind], other, towards, shift=shift))
    return tuple(out)


def _name(t: StudyTable, key: str, of: str, known: Sequence[Sensor]) -> str:
    name, names = t.text(key), [s.name for s in known]
    if name not in names:
        t.refuse(key, f"there is no {of} '{name}'; {suggest(name, names)}")
    return name


def _square(t: StudyTable, sensor: Sensor) -> tuple[float, ...]:
    """Read the direction towards which a channel is tilted, square to its own."""
    towards = t.direction("towards")
    if abs(float(towards @ sensor.direction)) > 1e-6:
        t.refuse("towards", f"it must be square to the direction of '{sensor.name}'")
    return tuple(towards.tolist())


def fault_table(fault: Fault) -> str:
    """Return the ``[[faults]]`` entry of a found fault."""
    what = fault.kind.partition("_")[0]
    values: dict[str, Any] = {"kind": fault.kind, what: fault.sensor}
    if not fault.kind.endswith(("sign", "swap")):
        values["value"] = fault.value
    if fault.other and not fault.kind.endswith("sign"):
        values["other"] = fault.other
    if fault.direction:
        values["towards"] = list(fault.direction)
    if fault.shift:
        values["shift"] = list(fault.shift)
    return toml_table("[[faults]]", rounded(values))


def as_mounted(channels: Sequence[Sensor], of: str, faults: Sequence[Fault]) -> tuple[Sensor, ...]:
    """Return sensors, or excitations, with the directions and places that they really have."""
    by_name = {s.name: s for s in channels}
    for f in faults:
        if not f.kind.startswith(of) or f.sensor not in by_name:
            continue
        s = by_name[f.sensor]
        if f.kind.endswith("tilt"):
            d = np.cos(f.value) * s.direction + np.sin(f.value) * np.array(f.direction)
            by_name[f.sensor] = replace(s, direction=d / np.linalg.norm(d))
        elif f.shift:
            by_name[f.sensor] = replace(s, point=s.point + np.array(f.shift))
    return tuple(by_name[s.name] for s in channels)
