"""Bands of frequency that no fit sees: as a study writes them, and the lines that they hold."""

import re
from collections.abc import Sequence

import numpy as np

from fem.array_types import Bools, Floats
from updating.measurement.measurement import Measurement, MeasurementError

Band = tuple[float, float]
EXAMPLE = "band 120-180 Hz"
_NUMBER = r"(\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)"
_BAND = re.compile(rf"band {_NUMBER} ?(?:-|–|to) ?{_NUMBER}(?: ?Hz)?")


def band_text(band: Band) -> str:
    """Return a band as ``[fit] held_out`` writes it, such as ``band 120-180 Hz``."""
    return f"band {band[0]:.10g}-{band[1]:.10g} Hz"


def band_of(text: str) -> Band | None:
    """Return the band that a text writes [Hz]; None if it writes none.

    Raises
    ------
    MeasurementError
        If its lower end is not below its upper one.
    """
    found = _BAND.fullmatch(text)
    if found is None:
        return None
    low, high = (float(x) for x in found.groups())
    if low >= high:
        msg = f"'{text}' ends at {high:g} Hz and begins at {low:g} Hz; a band ends above its beginning"
        raise MeasurementError(msg)
    return low, high


def held_out_lines(frequency: Floats, bands: Sequence[Band] = (), name: str = "the measurement") -> Bools:
    """Return which lines no fit sees, (n_freq,): those in the bands, or every fourth block without bands.

    Raises
    ------
    MeasurementError
        If a band has no line, or if they have all lines.
    """
    if not bands:
        # Blocks of lines, of which every fourth is held out where nobody has chosen bands [-]
        block = np.arange(len(frequency)) * 20 // len(frequency)
        return block % 4 == 2
    out = np.zeros(len(frequency), dtype=bool)
    ends = f"the lines of {name} go from {frequency[0]:.6g} to {frequency[-1]:.6g} Hz"
    for band in bands:
        inside = (frequency >= band[0]) & (frequency <= band[1])
        if not inside.any():
            msg = f"no line lies in the held-out {band_text(band)}; {ends}"
            raise MeasurementError(msg)
        out |= inside
    if out.all():
        msg = f"the held-out bands have every line; {ends}: leave some for the fit"
        raise MeasurementError(msg)
    return out


def lines_held_out(measurement: Measurement, frequency: Floats) -> Bools:
    """Return which of a measurement's lines no fit sees, by its bands or by blocks."""
    return held_out_lines(frequency, measurement.held_out, f"'{measurement.name}'")
