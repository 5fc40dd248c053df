"""Read tables of histories and spectra: a header with names, then numbers; ``.csv`` or ``.txt``."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail.file.table import StudyError
from fem.io.columns import cut_number, seconds_of
from fem.io.frf_labels import frequency_factor
from fem.io.units import (
    TIME_NAMES,
    UnitHeading,
    conversion,
    density_conversion,
    heading_of,
    named_unit,
    split_heading,
)

ABSCISSAE = {
    "frequency": ("frequency", "f", "freq", "frequencies", "frequenz"),
    "period": ("period", "t", "periode"),
    "time": TIME_NAMES,
}
"""Names of first columns by their quantity; of a name with two, the quantity asked for first counts."""

QUANTITIES = {
    "m/s^2": ("acceleration", "m/s^2, cm/s^2, mm/s^2, g"),
    "rad/s^2": ("angular acceleration", "rad/s^2, deg/s^2"),
    "N": ("force", "N, kN, lbf"),
    "1": ("a factor of loads", "- and %"),
}
"""Quantities that columns drive by their SI units: their names, and examples of units."""


@dataclass(frozen=True, slots=True, eq=False)
class HistoryColumns:
    """A table with named columns over an abscissa that increases.

    Attributes
    ----------
    file : str
    abscissa : str
        Quantity of the first column, one of ``ABSCISSAE``.
    x : ndarray (n,)
        Abscissa: times or periods [s] or frequencies [Hz].
    names : tuple of str
        Headings of the other columns; without their units after :meth:`named`.
    values : ndarray (n, n_names)
        In the units of the file.
    units : tuple of str
        Their labels; empty where a column has none.
    line : int
        Line of the header.
    per_radian : bool
        Whether the frequencies of the file are angular ones.
    """

    file: str
    abscissa: str
    x: NDArray[np.float64]
    names: tuple[str, ...]
    values: NDArray[np.float64]
    units: tuple[str, ...] = ()
    line: int = 1
    per_radian: bool = False

    def named(self, known: Sequence[str]) -> "HistoryColumns":
        """Return the columns with names and units apart, those of known names by underscore or blank too.

        Raises
        ------
        StudyError
            If two columns have one name.
        """
        found = [named_unit(text, known) for text in self.names]
        names = tuple(heading.name for heading in found)
        _refuse_twice(self.file, self.line, names)
        return replace(self, names=names, units=tuple(heading.unit for heading in found))

    def in_si(self, k: int, unit: str, density: bool = False) -> NDArray[np.float64]:
        """Return a column in SI.

        Parameters
        ----------
        k : int
        unit : str
            The SI unit of its quantity, one of ``QUANTITIES``; taken where the file states none.
        density : bool
            Whether the column is a one-sided density of the quantity over Hz.

        Raises
        ------
        StudyError
            For a unit that is not known, or of another quantity.
        """
        label, place = self.units[k], f"{self.file}, line {self.line}: the column '{self.names[k]}'"
        what, examples = QUANTITIES[unit]
        if not label:
            if density and self.per_radian:
                msg = (
                    f"{place} has no unit, and its frequencies are angular; state ({unit})^2/Hz or "
                    f"({unit})^2/(rad/s)"
                )
                raise StudyError(msg)
            return self.values[:, k]
        if label.upper() == "SI":
            return self.values[:, k]
        factor = density_conversion(label, unit) if density else conversion(label, unit)
        if factor is None:
            of = f"a density of {what}" if density else what
            allowed = f"the square of {examples} over Hz or rad/s" if density else examples
            msg = (
                f"{place} has the unit '{label}', which is none of {of} that is known; allowed are {allowed}"
            )
            raise StudyError(msg)
        return _scaled(self.file, f"the column '{self.names[k]}'", factor, self.values[:, k])


def read_columns(path: Path, abscissa: Sequence[str]) -> HistoryColumns:
    """Read a table whose first column is an abscissa.

    Columns are separated by commas, semicolons or tabs; numbers may have decimal commas where commas are no
    separators. Lines that begin with # are comments. The unit of the first column may be in brackets or
    behind an underscore or a blank; times may be date-times of ISO 8601.

    Parameters
    ----------
    path : Path
    abscissa : sequence of str
        Quantities that the first column may have, of ``ABSCISSAE``.

    Raises
    ------
    StudyError
        For a table without header or numbers, for values that are not finite, for a unit of the first column
        that is not known, and for a last number that may be cut; the message names file and line.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        msg = f"{path.name}: the text is not UTF-8"
        raise StudyError(msg) from None
    rows = [(n, line.strip()) for n, line in enumerate(text.splitlines(), 1)]
    rows, stamped = seconds_of([(n, line) for n, line in rows if line and not line.startswith("#")])
    if len(rows) < 3:
        msg = f"{path.name}: a header and at least two lines of numbers are needed"
        raise StudyError(msg)
    separator = next((s for s in ";\t," if s in rows[0][1]), ",")
    headings = [cell.strip().strip('"').strip() for cell in rows[0][1].split(separator)]
    found = next(
        ((q, head) for q in abscissa if (head := heading_of(headings[0], ABSCISSAE[q], digits=False))), None
    )
    if found is None or len(headings) < 2:
        names = [name for quantity in abscissa for name in ABSCISSAE[quantity][:2]]
        msg = (
            f"{path.name}, line {rows[0][0]}: the header is '{rows[0][1][:60]}'; its first column has to be "
            f"{' or '.join(dict.fromkeys(names))}, and others follow, separated by commas"
        )
        raise StudyError(msg)
    quantity, head = found
    _refuse_twice(path.name, rows[0][0], [headings[0], *(split_heading(h).name for h in headings[1:])])
    numbers = np.array([_numbers(path.name, n, line, separator, len(headings)) for n, line in rows[1:]])
    if not text.endswith(("\n", "\r")):
        cells = [line.split(separator) for _, line in rows[1:]]
        reason = cut_number([row[-1] for row in cells], cells[-1][1:-1])
        if reason:
            msg = f"{path.name}, line {rows[-1][0]}: {reason}"
            raise StudyError(msg)
    falling = np.flatnonzero(np.diff(numbers[:, 0]) <= 0)
    if falling.size:
        k = int(falling[0]) + 1
        msg = (
            f"{path.name}, line {rows[k + 1][0]}: {quantity} {numbers[k, 0]:g} comes after "
            f"{numbers[k - 1, 0]:g}; it has to increase"
        )
        raise StudyError(msg)
    factor = 1.0 if stamped else _abscissa_factor(path.name, rows[0][0], quantity, head)
    x = _scaled(path.name, "the first column", factor, numbers[:, 0])
    return HistoryColumns(
        path.name,
        quantity,
        x,
        tuple(headings[1:]),
        numbers[:, 1:],
        tuple(split_heading(h).unit for h in headings[1:]),
        rows[0][0],
        conversion(head.unit, "rad/s") is not None,
    )


def _abscissa_factor(file: str, line: int, quantity: str, heading: UnitHeading) -> float:
    """Return the size of the abscissa's unit [Hz or s]."""
    if not heading.unit:
        return 1.0
    of_frequency = quantity == "frequency"
    factor = frequency_factor(heading.unit) if of_frequency else conversion(heading.unit, "s")
    if factor is None:
        msg = (
            f"{file}, line {line}: the first column has the unit '{heading.unit}', which is none of "
            f"{quantity} that is known; allowed are "
            f"{'Hz, kHz, rad/s, 1/min' if of_frequency else 's, ms, us, min'}"
        )
        raise StudyError(msg)
    return factor


def _scaled(file: str, what: str, factor: float, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values in SI; refuse those beyond the largest number there is."""
    with np.errstate(over="ignore"):
        out = factor * values
    if not np.isfinite(out).all():
        msg = f"{file}: {what} has values that are not finite in SI"
        raise StudyError(msg)
    return out


def _refuse_twice(file: str, line: int, names: Sequence[str]) -> None:
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        msg = f"{file}, line {line}: the column '{twice}' is there twice"
        raise StudyError(msg)


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
