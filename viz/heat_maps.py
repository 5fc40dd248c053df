"""The errors of sensors by band as a heat map."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from viz import style
from viz.chart import Chart, Matrix, columns, rows
from viz.layout import shorten

MOST_NUMBERS = (40, 12)
"""Largest map, rows and columns, whose cells show their numbers."""


def error_map(
    values_db: ArrayLike,
    sensors: Sequence[str],
    bands: Sequence[tuple[float, float] | str],
    quantity: str = "error",
    unit: str = "dB",
    *,
    limits: tuple[float, float] | None = None,
    title: str = "",
) -> Chart:
    """Describe the error of each sensor in each band as a map.

    A cell's ``data`` is ``[sensor, low, high]`` with the ends of the band in hertz, for clicks.

    Parameters
    ----------
    values_db : array_like (n_sensors, n_bands)
        [dB]; NaN where nothing can be compared.
    sensors : sequence of str
    bands : sequence of (low, high) or str
        [Hz], or names.
    quantity, unit : str
        Of the colours.
    limits : (float, float), optional
        Ends of the colours [dB]; give the same for maps that will be compared.
    title : str

    Raises
    ------
    ValueError
        If the values' shape is not that of sensors and bands.
    """
    values = np.array(values_db, dtype=float, ndmin=2)
    n, m = values.shape
    if (n, m) != (len(sensors), len(bands)):
        msg = f"the errors have shape {values.shape} for {len(sensors)} sensors and {len(bands)} bands"
        raise ValueError(msg)
    words = [band if isinstance(band, str) else f"{band[0]:.4g}–{band[1]:.4g}" for band in bands]
    hertz = "" if words == list(bands) else " [Hz]"
    known = values[np.isfinite(values)]
    low, high = limits or ((float(known.min()), float(known.max())) if known.size else (0.0, 1.0))
    cells = Matrix(
        cells=values,
        colours=style.misfit_map(),
        limits=(low, high if high > low else low + 1),
        label=f"{quantity} [{unit}]",
        digits=(1 if high - low >= 2 else 2) if n <= MOST_NUMBERS[0] and m <= MOST_NUMBERS[1] else None,
        hover=[
            [
                f"{s}, {word}{' Hz' * bool(hertz)}: "
                + (f"{v:.2f} {unit}" if np.isfinite(v) else "nothing compared")
                for word, v in zip(words, row, strict=True)
            ]
            for s, row in zip(sensors, values, strict=True)
        ],
        data=[[[s, *(band if hertz else ())] for band in bands] for s in sensors],
    )
    size = float(np.clip(2.0 + 0.62 * m, 4.0, style.WIDTH)), 0.95 + max((0.19 if n <= 40 else 0.135) * n, 1.2)
    named = rows([shorten(s, 24) for s in sensors], "sensor")
    return Chart([cells], columns(words, f"band{hertz}"), named, title, min(104 + 21 * n, 1400), size)
