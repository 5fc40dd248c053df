"""A table as one value, and its writers: text in aligned columns, CSV, JSON and Excel."""

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.disk.output import OutputError
from dovetail.report.office import office
from fem.io.atomic import replacing

LARGEST_SHEET = (1_048_576, 16_384)
"""Rows and columns that a sheet of Excel can have."""
LONGEST_TITLE = 31
"""Of a sheet of Excel [characters]."""
WIDTH = 14
"""Least width of a column in Excel [characters]."""


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column of a table.

    Attributes
    ----------
    name : str
        Heading without unit.
    values : sequence
        Numbers or words, one for each row; None, NaN and infinities are missing.
    unit : str
        Of the numbers as people read them, ``values`` times ``scale``.
    show : str or function
        How a number is printed: a format such as ``".4g"``, or a function of the scaled number.
    scale : float
        The unit's number of those of ``values``: 100 for ratios in percent.
    key : str
        Name in JSON, where ``values`` are as they are; a column without one is not there.
    places : tuple of str
        Writers that have the column: ``"text"``, ``"file"`` (CSV and Excel); JSON goes by ``key``.
    head : str
        Heading of printed text, where it is not name and unit.
    """

    name: str
    values: Sequence[Any] | np.ndarray
    unit: str = ""
    show: str | Callable[[Any], str] = ".5g"
    scale: float = 1.0
    key: str = ""
    places: tuple[str, ...] = ("text", "file")
    head: str = ""

    @property
    def heading(self) -> str:
        """Name and unit for files."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    @property
    def in_words(self) -> bool:
        """Whether the column has words, which are left-aligned."""
        return any(isinstance(v, str) for v in self.values)

    def scaled(self) -> list[Any]:
        """Return words, whole numbers and scaled numbers of Python; those that are missing as they are."""
        return [_scaled(v, self.scale) for v in self.values]

    def texts(self) -> list[str]:
        """Return the cells as they are printed, a dash where a number is missing."""
        cells = self.scaled()
        return ["-" if _is_missing(v) else v if isinstance(v, str) else self._text(v) for v in cells]

    def _text(self, value: Any) -> str:
        if callable(self.show):
            return self.show(value)
        return str(value) if isinstance(value, int) else format(value, self.show)


def _scaled(value: Any, scale: float) -> Any:
    """Return a number as one of Python, times its scale; words and None as they are."""
    value = value.item() if isinstance(value, np.generic) else value
    return value if scale == 1 or value is None or isinstance(value, str) else value * scale


def _is_missing(value: Any) -> bool:
    return value is None or (isinstance(value, float) and not math.isfinite(value))


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Columns of one length under a title, which names the sheet in Excel.

    Attributes
    ----------
    title : str
    columns : tuple of Column
    indent : str
        Before each printed line.
    """

    title: str
    columns: Sequence[Column]
    indent: str = ""

    def __post_init__(self) -> None:
        if len({len(c.values) for c in self.columns}) > 1:
            msg = f"table {self.title}: columns of {[len(c.values) for c in self.columns]} rows"
            raise ValueError(msg)

    @classmethod
    def of(cls, title: str, *columns: Column) -> "Table":
        """Return a table of columns."""
        return cls(title, columns)

    def rows(self, chosen: Iterable[int]) -> "Table":
        """Return the table with some of its rows."""
        columns = [replace(c, values=[c.values[int(k)] for k in chosen]) for c in self.columns]
        return replace(self, columns=columns)

    def first(self, number: int) -> "Table":
        """Return the table with its first rows."""
        return self.rows(range(min(number, *(len(c.values) for c in self.columns))))

    def lines(self) -> list[str]:
        """Return the printed lines: a heading and the rows, each column as wide as it needs to be."""
        head, rows = self.texts()
        left_aligned = [c.in_words for c in self.columns if "text" in c.places]
        widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
        return [
            self.indent
            + "  ".join(
                f"{text:{'<' if words else '>'}{width}}"
                for text, words, width in zip(row, left_aligned, widths, strict=True)
            ).rstrip()
            for row in (head, *rows)
        ]

    def texts(self) -> tuple[list[str], list[tuple[str, ...]]]:
        """Return the headings and the rows as they are printed, without widths."""
        shown = [c for c in self.columns if "text" in c.places]
        head = [c.head or f"{c.name} {c.unit}".strip() for c in shown]
        return head, list(zip(*(c.texts() for c in shown), strict=True))

    def records(self) -> list[dict[str, Any]]:
        """Return a mapping for each row, for JSON."""
        keyed = [c for c in self.columns if c.key]
        return [
            dict(zip((c.key for c in keyed), row, strict=True))
            for row in zip(*(c.values for c in keyed), strict=True)
        ]

    def of_files(self) -> tuple[list[str], list[tuple[Any, ...]]]:
        """Return headings with units, and rows of words and scaled numbers, for CSV and Excel."""
        shown = [c for c in self.columns if "file" in c.places]
        return [c.heading or "remarks" for c in shown], list(zip(*(c.scaled() for c in shown), strict=True))


def columns_of(
    names: Iterable[str], values: np.ndarray, unit: str = "", show: str = ".5g", **more: Any
) -> list[Column]:
    """Return a column for each of the columns of ``values`` (n_rows, n)."""
    return [Column(n, v, unit, show, **more) for n, v in zip(names, np.transpose(values), strict=True)]


def columns_of_bands(bands: np.ndarray, errors_db: np.ndarray) -> list[Column]:
    """Return a column for each band [Hz], of the errors (n_rows, n_bands) [dB]."""
    names = [f"{a:.4g}-{b:.4g}" for a, b in pairwise(bands)]
    return [
        Column(f"{name} Hz", errors, "dB", ".2f", head=name)
        for name, errors in zip(names, errors_db.T, strict=True)
    ]


def write_csv(path: Path, table: Table) -> None:
    """Write a table as CSV with nine digits atomically; numbers that are None are ``nan``."""
    head, rows = table.of_files()
    with replacing(path) as scratch, scratch.open("w", encoding="utf-8", newline="") as file:
        for row in (head, *rows):
            file.write(",".join(map(_csv_cell, row)) + "\n")


def _csv_cell(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.9g}"
    text = "nan" if value is None else str(value)
    return '"' + text.replace('"', '""') + '"' if re.search(r'[",\r\n]', text) else text


def write_xlsx(path: Path | None, tables: Iterable[Table]) -> None:
    """Write tables as the sheets of an Excel file atomically; missing numbers are empty cells.

    Raises
    ------
    OutputError
        For a table that is larger than a sheet can be.
    OfficeError
        If openpyxl is not installed.
    """
    if path is None:
        return
    book = office("openpyxl").Workbook(write_only=True)
    taken: set[str] = set()
    for table in tables:
        _add_sheet(book, _sheet_title(table.title, taken), table)
    with replacing(path) as scratch:
        book.save(scratch)


def _add_sheet(book: Any, title: str, table: Table) -> None:
    """Add a sheet with bold headings that stay in sight."""
    head, rows = table.of_files()
    if len(rows) >= LARGEST_SHEET[0] or len(head) > LARGEST_SHEET[1]:
        msg = (
            f"the table of {table.title} has {len(rows)} rows and {len(head)} columns; a sheet of Excel has "
            f"at most {LARGEST_SHEET[0]} and {LARGEST_SHEET[1]}: write .csv"
        )
        raise OutputError(msg)
    sheet = book.create_sheet(title)
    sheet.freeze_panes = "A2"
    letter, bold = office("openpyxl.utils").get_column_letter, office("openpyxl.styles").Font(bold=True)
    for k, text in enumerate(head, 1):
        sheet.column_dimensions[letter(k)].width = max(WIDTH, len(text) + 2)
    for n, row in enumerate((head, *rows)):
        font = None if n else bold
        cells = [None if _is_missing(v) else v for v in row]
        sheet.append([_word_cell(sheet, v, font) if isinstance(v, str) else v for v in cells])


def _word_cell(sheet: Any, text: str, font: Any) -> Any:
    """Return a cell with words, which are no formula even where they begin with an equals sign."""
    module = office("openpyxl.cell.cell")
    cell = module.WriteOnlyCell(sheet, module.ILLEGAL_CHARACTERS_RE.sub("", text))
    cell.data_type = "s"
    if font is not None:
        cell.font = font
    return cell


def _sheet_title(title: str, taken: set[str]) -> str:
    """Return a title that Excel allows and no other sheet has."""
    plain = re.sub(r"[\[\]:*?/\\]", "-", title).strip("' ") or "table"
    name, k = plain[:LONGEST_TITLE], 2
    while name.casefold() in taken:
        name, k = f"{plain[: LONGEST_TITLE - 5]} ({k})", k + 1
    taken.add(name.casefold())
    return name
