"""Resonances in measured FRFs that no mode of a model has, such as those of a fixture."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from fem.analysis.modes import Modes
from updating.correlation import mac
from updating.diagnosis.frf_modes import FrfModes
from updating.inference.fit import FitProblem
from updating.measurement.held_out import band_text
from updating.measurement.measurement import sensor_rows

SAME_SHAPE = 0.5
"""Least MAC of a measured and a computed mode that count as the same one [-]."""
HALF_POWER_WIDTHS = 3.0
"""Half the width of a resonance's band, in its half-power widths 2ζf: 36 times its power is at the middle."""


@dataclass(frozen=True, slots=True)
class ForeignMode:
    """A measured resonance without a mode of the model.

    Attributes
    ----------
    frequency : float
        [Hz].
    low, high : float
        Ends of its band [Hz].
    """

    frequency: float
    low: float
    high: float


def foreign_modes(problem: FitProblem, modes: Modes, measured: FrfModes | None) -> tuple[ForeignMode, ...]:
    """Return measured resonances that no mode of a model has, in order of frequency.

    Measured modes are paired with the model's by shape and frequency. Two within each other's half-power
    width are one resonance. Those in a held-out band are known. Empty for fewer than two sensors.

    Parameters
    ----------
    problem : FitProblem
    modes : Modes
        Of the fitted model.
    measured : FrfModes or None
        In the FRFs of the problem; None where they have none.
    """
    if measured is None or len(measured.measurement.sensors) < 2:
        return ()
    channels, found = measured.measurement.sensors, measured.found.modes
    elastic = np.arange(modes.n_rigid, modes.n_modes)
    shapes = np.real(sensor_rows(problem.reduced.model, channels) @ modes.shapes[:, elastic])
    alike = mac(found.shapes, shapes) if elastic.size else np.zeros((len(found.frequency), 0))
    apart = np.abs(np.log(found.frequency[:, None] / modes.frequency[elastic]))
    rows, columns = scipy.optimize.linear_sum_assignment(apart - alike)
    paired = {int(i) for i, j in zip(rows, columns, strict=True) if alike[i, j] >= SAME_SHAPE}
    zeta = np.zeros(len(found.frequency)) if found.zeta is None else np.asarray(found.zeta, dtype=float)
    width = 2 * zeta * found.frequency
    out = list[ForeignMode]()
    for k, f in enumerate(found.frequency.tolist()):
        known = any(abs(f - found.frequency[i]) <= max(width[k], width[i]) for i in paired)
        if known or any(low <= f <= high for low, high in problem.data.measurement.held_out):
            continue
        low = max(f - HALF_POWER_WIDTHS * width[k], problem.data.frequency[0])
        high = f + HALF_POWER_WIDTHS * width[k]
        if out and low <= out[-1].high:
            low, high, f = out[-1].low, max(high, out[-1].high), out.pop().frequency
        out.append(ForeignMode(f, float(low), float(high)))
    return tuple(out)


def note_of(modes: Sequence[ForeignMode]) -> str:
    """Return a sentence on resonances that no mode of a model has, and how to leave them out."""
    where = ", ".join(f"{_rounded(m.frequency, m.frequency / 10):.10g}" for m in modes)
    bands = ", ".join(
        f'"{band_text((_rounded(m.low, m.high - m.low), _rounded(m.high, m.high - m.low)))}"' for m in modes
    )
    return (
        f"{where} Hz: no mode of the model; is it the fixture? [fit] held_out = [{bands}] leaves "
        f"{'it' if len(modes) == 1 else 'them'} out"
    )


def _rounded(value: float, step: float) -> float:
    """Return a value to two significant digits of a step, whole numbers from a step of 10 on."""
    return round(value, max(0, 1 - math.floor(math.log10(step))))
