"""Read tables of histories and spectra: a header with names, then numbers; ``.csv`` or ``.txt``."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail.file.table import StudyError


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """A table with named columns over an abscissa that increases.

    Attributes
    ----------
    file : str
    abscissa : str
        Name of the first column, in lower case.
    x : ndarray (n,)
        Abscissa: times [s] or frequencies [Hz].
    names : tuple of str
        Names of the other columns, without their units.
    values : ndarray (n, n_names)
    """

    file: str
    abscissa: str
    x: NDArray[np.float64]
    names: tuple[str, ...]
    values: NDArray[np.float64]


def read_columns(path: Path, abscissa: Sequence[str]) -> Columns:
    """Read a table whose first column is an abscissa.

    Columns are separated by commas, semicolons or tabs; numbers may have decimal commas where commas are no
    separators. A unit in brackets behind a name is dropped; lines that begin with # are comments.

    Parameters
    ----------
    path : Path
    abscissa : sequence of str
        Names that the first column may have.

    Raises
    ------
    StudyError
        For a table without header or numbers, and for values that are not finite; the message names file and
        line.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        msg = f"{path.name}: the text is not UTF-8"
        raise StudyError(msg) from None
    rows = [(n, line.strip()) for n, line in enumerate(text.splitlines(), 1)]
    rows = [(n, line) for n, line in rows if line and not line.startswith("#")]
    if len(rows) < 3:
        msg = f"{path.name}: a header and at least two lines of numbers are needed"
        raise StudyError(msg)
    separator = next((s for s in ";\t," if s in rows[0][1]), ",")
    names = [
        re.sub(r"\s*\[[^\]]*\]\s*$", "", cell.strip().strip('"')) for cell in rows[0][1].split(separator)
    ]
    if names[0].lower() not in abscissa or len(names) < 2:
        msg = (
            f"{path.name}, line {rows[0][0]}: the header is '{rows[0][1][:60]}'; its first column has to be "
            f"{' or '.join(abscissa)}, and others follow, separated by commas"
        )
        raise StudyError(msg)
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        msg = f"{path.name}, line {rows[0][0]}: the column '{twice}' is there twice"
        raise StudyError(msg)
    numbers = np.array([_numbers(path.name, n, line, separator, len(names)) for n, line in rows[1:]])
    falling = np.flatnonzero(np.diff(numbers[:, 0]) <= 0)
    if falling.size:
        k = int(falling[0]) + 1
        msg = (
            f"{path.name}, line {rows[k + 1][0]}: {names[0]} {numbers[k, 0]:g} comes after "
            f"{numbers[k - 1, 0]:g}; it has to increase"
        )
        raise StudyError(msg)
    return Columns(path.name, names[0].lower(), numbers[:, 0], tuple(names[1:]), numbers[:, 1:])


def _numbers(file: str, n: int, line: str, separator: str, wanted: int) -> list[float]:
    """Return the numbers of a line."""
    cells = line.split(separator)
    if len(cells) != wanted:
        msg = f"{file}, line {n}: {len(cells)} columns are found, and the header has {wanted}"
        raise StudyError(msg)
    out = []
    for cell in cells:
        try:
            value = float(cell if separator == "," else cell.replace(",", "."))
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            msg = f"{file}, line {n}: '{cell.strip()}' is not a finite number"
            raise StudyError(msg)
        out.append(value)
    return out
