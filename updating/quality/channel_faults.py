"""Errors of channels that a fit has found far outside the tolerances of the test's description."""

import numpy as np

from fem.array_types import Floats
from updating.inference.belief import FAR_STD
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.measurement.channel_errors import DIRECTION, GAIN, POSITION
from updating.measurement.measurement import Sensor
from updating.quality.corrections import Fault

CORRECTED_KINDS = ("sensor_gain", "sensor_tilt", "excitation_gain")
"""Kinds of these faults that data can be corrected for."""

_SPAN = {"gain": 6.0, "tilt": float(np.radians(160.0)), "position": 0.0}
"""Ranges of values that a search for faults looks at, for Occam factors: of ln gain [-], of tilts [rad]."""


def channel_faults(problem: FitProblem, result: FitResult) -> tuple[Fault, ...]:
    """Return the errors of channels that the tolerances of the test do not explain, the farthest first.

    An error is one if it exceeds ``FAR_STD`` of its tolerance and of what the data leave open, together. Its
    value is what the data alone say, all else as it was fitted: the tolerance draws a fitted error to zero.
    A turn or a shift towards two axes is one fault, towards their resultant.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
        Of this problem. Its model of the test has these errors: the data are not corrected for them.
    """
    m = problem.data.measurement
    found: list[tuple[float, Fault]] = []
    rows = zip((*m.sensors, *m.excitations), result.channels, result.channels_std, strict=False)
    for k, (channel, errors, stds) in enumerate(rows):
        sort = "sensor" if k < len(m.sensors) else "excitation"
        values, deviations = _by_data_alone(errors, stds, m.errors.std)
        for part in (GAIN, DIRECTION, POSITION):
            size, tolerance = float(np.linalg.norm(errors[part])), float(m.errors.std[part][0])
            if not size or not tolerance:
                continue
            along = errors[part] / size
            value, std = float(along @ values[part]), float(np.linalg.norm(along * deviations[part]))
            z = abs(value) / np.hypot(tolerance, std)
            if z > FAR_STD:
                found.append((z, _fault(sort, channel, part, along, value, std, tolerance)))
    return tuple(fault for _, fault in sorted(found, key=lambda each: -each[0]))


def _by_data_alone(errors: Floats, stds: Floats, tolerances: Floats) -> tuple[Floats, Floats]:
    """Return errors and deviations (5,) without their normal priors about zero; 0 where data know nothing."""
    prior = np.where(tolerances > 0, tolerances, 1.0) ** 2
    variance = np.maximum(stds, 1e-9 * np.sqrt(prior)) ** 2
    # Data know an error of a channel if they take more than this share of its prior's variance [-]
    learnt = (tolerances > 0) & (variance < (1 - 0.01) * prior)
    alone = np.where(learnt, 1 / np.where(learnt, 1 / variance - 1 / prior, 1.0), 0.0)
    return alone * errors / variance, np.sqrt(alone)


def _fault(
    sort: str, channel: Sensor, part: slice, along: Floats, value: float, std: float, tolerance: float
) -> Fault:
    """Return one error of a channel, of a size along its axes, as a fault."""
    unit, towards = "-", ()
    if part is GAIN:
        kind, value = "gain", 1 + value * float(along[0])
        if sort == "excitation":  # a force recorded F times as large makes FRFs that are 1/F of the true ones
            value, std = 1 / value, std / value**2
    else:
        towards = tuple(map(float, along @ channel.axes_across))
        kind, unit = ("tilt", "rad") if part is DIRECTION else ("position", "m")
        if part is DIRECTION:  # the direction is d + Σ tᵢ eᵢ, of any length
            value = float(np.arctan(value))
    more = {"direction": towards, "span": _SPAN[kind], "tolerance": tolerance}
    return Fault(f"{sort}_{kind}", channel.name, value, std, unit, **more)
