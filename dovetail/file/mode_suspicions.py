"""Suspicions about measured modes: their units, their deviations, and modes that are given twice.

Data and model may each be at fault, so these are warnings, as those of :mod:`dovetail.file.suspicions`.
"""

import numpy as np

from dovetail.file.measured import FREQUENCY_UNITS
from dovetail.file.measured_modes import MeasuredModes
from fem.analysis.modes import Modes, first_modes
from fem.array_types import Floats
from fem.model import Model
from fem.system import assemble
from updating.inference.mode_targets import mac_of
from updating.measurement.measurement import sensor_rows

SAME_SHAPE = 0.999
"""MAC of two shapes of one frequency that are one mode given twice [-]."""
MORE_MODES = 10
"""Modes of the model beyond the number of measured ones."""


def mode_suspicions(measured: MeasuredModes, model: Model) -> list[str]:
    """Return suspicions about measured modes, in sentences."""
    number = _unit(measured, model) or _unseen(measured, model)
    words = (number, _ratios(measured), _deviations(measured), *_twice(measured))
    return [f"{measured.name}: {text}" for text in words if text]


def _ratios(measured: MeasuredModes) -> str:
    """Return that damping ratios look like percent."""
    zeta = measured.modes.zeta
    known = np.zeros(0) if zeta is None else zeta[np.isfinite(zeta)]
    # Median damping ratio above which ratios look like percent [-]
    if not known.size or np.median(known) <= 0.2:
        return ""
    return (
        f"the damping ratios are {known.min():.3g} to {known.max():.3g}; are they in percent? 1 % is 0.01, "
        "or the heading 'zeta [%]' of a table"
    )


def _deviations(measured: MeasuredModes) -> str:
    """Return that standard deviations look like percent or Hz."""
    largest = float(measured.frequency_std.max(initial=0.0))
    # Relative standard deviation of a frequency above which it looks like percent or Hz [-]
    if largest <= 0.3:
        return ""
    return (
        f"frequency_std is {largest:.3g}, {100 * largest:.3g} % of the frequency; is it in percent or Hz? "
        "It is relative: 0.1 % is 0.001"
    )


def _twice(measured: MeasuredModes) -> list[str]:
    """Return which modes look as if they were given twice."""
    f, shapes = measured.modes.frequency, measured.modes.shapes
    alike = mac_of(shapes, np.nan_to_num(shapes)) if measured.has_shapes else np.ones((f.size, f.size))
    return [
        f"the modes {k + 1} and {k + 2} have the same frequency, {f[k]:.6g} Hz"
        + (", and the same shape" if measured.has_shapes else "")
        + "; is one given twice?"
        for k in np.flatnonzero(np.diff(f) == 0)
        if alike[k, k + 1] > SAME_SHAPE
    ]


def _unseen(measured: MeasuredModes, model: Model) -> str:
    """Return that the model has more modes than were measured, and nothing says which of them."""
    named = measured.numbers or measured.plane or measured.sensors or measured.driven
    f = measured.modes.frequency
    if named or not f.size:
        return ""
    computed = first_modes(assemble(model), f.size + MORE_MODES)
    n = int((computed.frequency[computed.n_rigid :] <= f[-1]).sum())
    if n <= f.size:
        return ""
    most = " or more" if n >= f.size + MORE_MODES else ""
    return (
        f"the model has {n}{most} modes up to {f[-1]:.4g} Hz, {f.size} were measured: without shapes "
        "torsional or axial modes may become their partners. Name sensors and excitations of the test in "
        "[modes], or its plane, or numbers"
    )


def _unit(measured: MeasuredModes, model: Model) -> str:
    """Return in which other unit the frequencies look, if that brings them to the model's."""
    f = measured.modes.frequency
    ratio = _over_computed(measured, first_modes(assemble(model), f.size + MORE_MODES), model)
    if not ratio.size or not f.size:
        return ""
    level = float(np.median(ratio))
    # Largest median deviation of these logarithms from their median, above which no unit is at fault [-]
    if np.median(np.abs(ratio - level)) > 0.15:
        return ""
    others = {unit: np.log(size) for unit, size in FREQUENCY_UNITS.items() if size != 1 and unit != "cpm"}
    unit, log_size = min(others.items(), key=lambda each: abs(abs(level) - abs(each[1])))
    # Largest deviation of ln(measured / computed) from that of another unit [-]
    if abs(abs(level) - abs(log_size)) > 0.3:
        return ""
    heading = f"'frequency [{unit}]'"
    why = f"they are in {unit}, and have to be given in Hz or, in a table, below {heading}"
    if level * log_size > 0:  # converted although they were in Hz
        why = f"they were converted from {unit} and were in Hz already, as below a heading {heading} over Hz"
    return (
        f"the natural frequencies, {f[0]:.4g} to {f[-1]:.4g} Hz, are {np.exp(level):.3g} times the model's: "
        f"either {why}, or the model is off by as much"
    )


def _over_computed(measured: MeasuredModes, computed: Modes, model: Model) -> Floats:
    """Return ln(measured / computed) of modes that are alike, or in their order without shapes."""
    f, elastic = measured.modes.frequency, computed.frequency[computed.n_rigid :]
    shapes = computed.shapes[:, computed.n_rigid :]
    if measured.has_shapes:
        alike = mac_of(measured.modes.shapes, sensor_rows(model, measured.sensors) @ shapes)
        # Least MAC of a measured mode and the model's mode whose frequencies are compared [-]
        return np.log(f / elastic[alike.argmax(axis=1)])[alike.max(axis=1) >= 0.8]
    if measured.numbers:
        known = np.array(measured.numbers) - 1
        return np.log(f[known < elastic.size] / elastic[known[known < elastic.size]])
    if measured.plane:
        motion = (np.abs(shapes.reshape(-1, 6, shapes.shape[1])[:, :3]) ** 2).sum(axis=0)
        within = motion[["xyz".index(axis) for axis in measured.plane]].sum(axis=0)
        elastic = elastic[within > 0.5 * motion.sum(axis=0)]
    n = min(f.size, elastic.size)
    return np.log(f[:n] / elastic[:n])
