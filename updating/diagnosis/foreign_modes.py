"""Resonances in measured FRFs that no mode of a model has, such as those of a fixture."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from fem.analysis.modes import Modes
from updating.correlation import mac
from updating.inference.fit import FitProblem
from updating.measurement.held_out import band_text
from updating.measurement.measurement import sensor_rows
from updating.modal.identification import IdentificationError, identify_modes

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


def foreign_modes(problem: FitProblem, modes: Modes) -> tuple[ForeignMode, ...]:
    """Return measured resonances that no mode of a model has, in order of frequency.

    Modes that are identified in the FRFs, corrected for faults, are paired with the model's by shape and
    frequency. Two within each other's half-power width are one resonance. Those in a held-out band are known.
    Empty where the FRFs lack phase or the poles of the structure, as those over a reference sensor do.

    Parameters
    ----------
    problem : FitProblem
    modes : Modes
        Of the fitted model.
    """
    m, frf = problem.data.measurement, problem.measured
    channels, H = m.sensors, frf.H
    if len(m.excitations) > len(channels):  # by reciprocity, forces are responses to one at the sensor
        channels, H = m.excitations, frf.H.transpose(0, 2, 1)
    if len(channels) < 2 or not m.has_structure_poles or not frf.has_phase:
        return ()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # unscaled shapes suffice
        try:
            found = identify_modes(frf.frequency, H, kind=frf.kind).modes
        except IdentificationError:
            return ()
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
        if known or any(low <= f <= high for low, high in m.held_out):
            continue
        low = max(f - HALF_POWER_WIDTHS * width[k], frf.frequency[0])
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
