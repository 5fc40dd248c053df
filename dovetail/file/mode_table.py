"""Measured modes from a table: a row for each mode, a column for each sensor."""

import re
from pathlib import Path

import numpy as np

from dovetail.file.sensor_table import cells_of
from dovetail.file.table import StudyError
from fem.analysis.modes import Modes
from fem.io.arrays import MODE_STD
from fem.io.frf_labels import frequency_factor

TABLE_SUFFIXES = (".csv", ".txt", ".tsv")
LONGEST_CELL = 40
"""Characters of a cell that a message repeats."""
_UNIT = re.compile(r"[\[(]([^\[\]()]*)[\])]\s*$")
_KEYS = {
    "frequency": "frequency",
    "natural frequency": "frequency",
    "f": "frequency",
    "zeta": "zeta",
    "damping": "zeta",
    "damping ratio": "zeta",
    **{key: key for key in MODE_STD},
}
"""Columns that are no sensor's, by their heading in lower case without its unit."""


def read_mode_table(path: Path) -> tuple[Modes, dict[str, np.ndarray]]:
    """Return modes of a table, by rising frequency, and the relative standard deviations that it gives.

    The heading names ``frequency`` [Hz], and where they are known ``zeta`` [-] and ``frequency_std``,
    ``zeta_std`` and ``shape_std`` [-]; ratios may be in percent. Every other column is a channel of the
    shapes. Its cells may be complex, such as ``0.3-0.1j``, and empty where a mode was not measured.

    Raises
    ------
    StudyError
        For a table that cannot be read; the message names the file, the row and the column.
    """
    (_, head), body = cells_of(path, "mode")
    columns: dict[str, int] = {}
    factor: dict[str, float] = {}
    channels: dict[str, int] = {}
    for k, title in enumerate(head):
        unit = _UNIT.search(title)
        key = _KEYS.get((title[: unit.start()] if unit else title).strip().lower())
        name = key or title.strip()
        if not name:
            continue
        if name in columns or name in channels:
            msg = f"{path.name}: two columns are called '{name}'; names must differ"
            raise StudyError(msg)
        (columns if key else channels)[name] = k
        if key:
            factor[key] = _factor(path.name, title, key, unit.group(1).strip() if unit else "")
    if "frequency" not in columns:
        msg = f"{path.name}: no column is called 'frequency'; the heading is {', '.join(head)}"
        raise StudyError(msg)

    def numbers(key: str, gaps: bool) -> np.ndarray:
        cells = [(row, line[columns[key]]) for row, line in body]
        return factor[key] * np.array([_number(path.name, row, key, c, gaps).real for row, c in cells])

    frequency = numbers("frequency", False)
    order = np.argsort(frequency, kind="stable")
    zeta = numbers("zeta", True)[order] if "zeta" in columns else None
    std = {key: numbers(key, False)[order] for key in MODE_STD if key in columns}
    for key, values in {"frequency": frequency, **std}.items():
        if (values <= 0).any():
            msg = f"{path.name}: the column '{key}' has {values.min():g}; numbers above 0 are needed"
            raise StudyError(msg)
    shapes = np.array(
        [
            [_number(path.name, row, name, line[k], True) for row, line in body]
            for name, k in channels.items()
        ],
        dtype=complex,
    ).reshape(len(channels), len(body))[:, order]
    real = not np.nan_to_num(np.imag(shapes)).any()
    return Modes(frequency[order], np.real(shapes) if real else shapes, zeta, tuple(channels)), std


def _factor(name: str, title: str, key: str, unit: str) -> float:
    """Return the size of a column's unit."""
    if key == "frequency":
        factor = frequency_factor(unit) if unit else 1.0
        known = "Hz, kHz, rad/s"
    else:
        factor, known = {"": 1.0, "-": 1.0, "%": 0.01}.get(unit), "-, %"
    if factor is None:
        msg = f"{name}: the column '{title}' has the unit '{unit}'; allowed are {known}"
        raise StudyError(msg)
    return factor


def _number(name: str, row: int, column: str, cell: str, gaps: bool) -> complex:
    """Return the number of a cell, NaN of an empty one where gaps are allowed."""
    if gaps and not cell:
        return complex(np.nan, 0.0)
    try:
        value = complex(cell.replace(" ", "").replace("i", "j"))
    except ValueError:
        value = complex(np.nan)
    if not np.isfinite(value):
        more = ", or nothing where it was not measured," if gaps else ""
        shown = cell if len(cell) <= LONGEST_CELL else f"{cell[:LONGEST_CELL]}…"
        msg = f"{name}, row {row}, {column}: '{shown}' is not allowed; a number{more} is needed"
        raise StudyError(msg)
    return value
