"""Numbers in columns with a header, as analysers and spreadsheets export them.

The separator and the decimal mark are found from the lines of numbers at the end of the file; what stands
before the first of them is the header. Each column keeps the cells of the header above it.
"""

import csv
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import NoReturn

import numpy as np

from fem.array_types import Complexes, Floats, Ints
from fem.io.arrays import TableError
from fem.io.faults import error_at
from fem.io.frf_labels import frequency_factor

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?$")
_NOT_FINITE = (
    "nan",
    "inf",
    "infinity",
    "-inf",
    "-nan",
    "+inf",
    "1.#qnan",
    "-1.#ind",
    "1.#inf",
    "#n/a",
    "n/a",
)
_LONGEST = 80
"""Characters of a number."""
_STAMP = re.compile(
    r'\s*"?(?:(\d{4}-\d\d-\d\d)[T ])?(\d\d:\d\d:\d\d)(?:([.,])(\d{1,12}))?(Z|[+-]\d\d:?\d\d)?"?(?=[\s;,]|$)'
)
"""A date-time of ISO 8601, or a time of day, at the beginning of a line."""
_DIGITS = re.compile(r"[+-]?\d*[.,]?(?P<decimals>\d*)(?:[eEdD][+-]?(?P<exponent>\d*))?")
_SAMPLE = 40
"""Lines at the end of a file from which separator and decimal mark are found."""
FIXED_ROWS = 4
"""Numbers of a column that all have as many decimals are printed with a fixed number of them."""


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Columns of a text file.

    Attributes
    ----------
    name : str, the file
    separator : str
    heads : tuple of tuple of str
        Rows of the header from the top, a cell above each column, empty where there is none; a cell that
        spans
        several columns stands above each of them.
    rows : tuple of tuple of str
        All rows of the header above the columns as they are, a cell for each column.
    header : tuple of str, all lines of the header, without marks of comments
    lines : ndarray of int (n,), number of each line of data in the file
    values : ndarray (n, n_columns)
        Real numbers, or complex ones where a cell of the first line of data is complex.
    stamped : bool
        Whether the first column has date-times in the file, which are seconds from the first of them here.
    """

    name: str
    separator: str
    heads: tuple[tuple[str, ...], ...]
    header: tuple[str, ...]
    lines: Ints
    values: Floats | Complexes
    stamped: bool = False
    rows: tuple[tuple[str, ...], ...] = ()

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.values.shape[1]


def read_columns(path: Path, separator: str | None = None, header: bool | None = None) -> Columns:
    """Read columns of numbers.

    Parameters
    ----------
    path : Path
    separator : str, optional
        Found unless given.
    header : bool, optional
        Whether the first line is a header; found unless given.
    """
    return _Text(path.name, text_of(path)).read(separator, header)


def text_of(path: Path) -> str:
    """Return the text of a file in UTF-8, UTF-16 with a mark, or Latin-1."""
    raw = path.read_bytes()
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return raw.decode("utf-16", "replace")
    if b"\0" in raw:
        raise error_at(path.name, "it is no text (it has bytes that are zero)", TableError)
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def seconds_of(rows: Sequence[tuple[int, str]]) -> tuple[list[tuple[int, str]], bool]:
    """Return lines with seconds from the first one in place of ISO date-times, and whether there are any.

    Zones are taken off, so that a record may run over a change of the clocks.
    """
    out, first = [], None
    for line, text in rows:
        found = _STAMP.match(text)
        if found is None:
            out.append((line, text))
            continue
        date, clock, mark, digits, zone = found.groups()
        end = found.end()
        if mark == "," and not {";", "\t"} & set(text):  # the comma parts columns
            digits, end = None, found.end(2)
            mark = zone = None
        try:
            at = np.datetime64(f"{date or '1970-01-01'}T{clock}", "s").astype(np.int64)
        except ValueError:
            out.append((line, text))
            continue
        if zone and zone != "Z":
            at -= (1 if zone[0] == "+" else -1) * (int(zone[1:3]) * 3600 + int(zone[-2:]) * 60)
        pico = int((digits or "").ljust(12, "0"))
        first = (at, pico) if first is None else first
        seconds = f"{Decimal(int(at - first[0])) + Decimal(pico - first[1]).scaleb(-12):f}"
        out.append((line, seconds.replace(".", mark or ".") + text[end:]))
    return out, first is not None


def is_number(word: str) -> bool:
    """Whether a word is a finite number."""
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


def cut_number(numbers: Sequence[str], others: Sequence[str]) -> str:
    """Return the reason for which the last number of a file that ends within a line may be cut; else nothing.

    It ends with a point, has fewer digits of its exponent than all others, or fewer decimals: by two at
    least, or by one where all others have as many. Where final zeros are left out, a number has two decimals
    less than usual once in a hundred. One less is common, but not next to ``FIXED_ROWS`` others that have as
    many.

    Parameters
    ----------
    numbers : sequence of str
        The column, the last number at its end.
    others : sequence of str
        The rest of the last line, with which the number is compared where the column has no other one.
    """
    last, compared = numbers[-1], numbers[:-1] or others
    if not compared:
        return ""

    def digits(part: str, text: str) -> int:
        found = _DIGITS.fullmatch(text.strip().strip('"'))
        return len(found[part] or "") if found is not None else 0

    each = [digits("decimals", text) for text in compared]
    fewer = min(each) - digits("decimals", last)
    fixed = len(each) >= FIXED_ROWS and len(set(each)) == 1
    if last.endswith((".", ",")) and not any(text.strip().endswith((".", ",")) for text in compared):
        words = "ends with its decimal mark"
    elif digits("exponent", last) < min(digits("exponent", text) for text in compared):
        words = "has fewer digits in its exponent than the others"
    elif fewer >= 2 or (fixed and fewer >= 1):
        words = "has fewer decimals than the others"
    else:
        return ""
    return (
        f"its last number '{last}' {words} and no line end follows, so the file may be cut; write it again, "
        "or end its last line"
    )


class _Text:
    """The lines of a text file."""

    def __init__(self, name: str, text: str) -> None:
        self.name = name
        self.all = [(k, line.rstrip("\r\n")) for k, line in enumerate(text.splitlines(), start=1)]
        filled, self.stamped = seconds_of([(k, line) for k, line in self.all if line.strip()])
        self.ended = text.endswith(("\n", "\r"))
        self.comments = [(k, line) for k, line in filled if line.lstrip()[0] in "#%"]
        self.rows = [(k, line) for k, line in filled if line.lstrip()[0] not in "#%"]
        if not self.rows:
            self.refuse("the file has no lines of data")

    def refuse(self, text: str) -> NoReturn:
        """Raise an error with the file's name."""
        raise error_at(self.name, text, TableError)

    def read(self, separator: str | None, header: bool | None) -> Columns:
        """Return the columns."""
        self.separator, self.comma = self._marks(separator)
        first = self._first(header)
        body = self.rows[first:]
        if not body:
            self.refuse("the file has a header and no lines of data")
        values, lines = self._numbers(body)
        start = body[0][0]
        above = [line for k, line in self.rows[:first]]
        if not self.ended:
            self._refuse_cut(body)
        comments = [line.lstrip().lstrip("#%").strip() for k, line in self.comments]
        for k in sorted(self.blank):
            above_it = [self.cells(line) for j, line in self.all if j < start]
            named = next((cells[k] for cells in above_it if len(cells) > k and cells[k]), "")
            if named:
                self.refuse(f"column {k + 1} ('{named}') is blank in all lines of numbers; leave it out")
        width, before = values.shape[1], [line for k, line in self.all if k < start and line.strip()]
        heads, rows = self._heads(width, before), self._rows(width, before)
        every = (*comments, *above)
        return Columns(self.name, self.separator, heads, every, lines, values, self.stamped, rows)

    def _refuse_cut(self, body: Sequence[tuple[int, str]]) -> None:
        """Refuse a file whose last number may be cut, where no line end follows it."""
        cells = self.filled(body[-1][1])
        if body[-1] != self.rows[-1] or self.all[-1][0] != body[-1][0]:
            return
        reason = cut_number([self.filled(text)[-1] for _, text in body], cells[1:-1])
        if reason:
            self.refuse(f"line {body[-1][0]}: {reason}")

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line, without an empty one after a last separator."""
        if self.separator == " ":
            return line.split()
        if '"' in line:
            cells = next(csv.reader([line], delimiter=self.separator))
        else:
            cells = line.split(self.separator)
        cells = [c.strip() for c in cells]
        return cells[:-1] if len(cells) > 1 and not cells[-1] else cells

    def filled(self, line: str) -> list[str]:
        """Return the cells of a line without those of columns that are blank in all lines of numbers."""
        return [cell for k, cell in enumerate(self.cells(line)) if k not in self.blank]

    def _blank_columns(self, sample: Sequence[str]) -> frozenset[int]:
        """Return the columns that no line of numbers fills, such as spacers between functions."""
        every = [self.cells(line) for line in sample]
        rows = [cells for cells in every if self._is_data([c for c in cells if c])]
        width = max(map(len, rows), default=0)
        return frozenset(k for k in range(width) if not any(row[k] for row in rows if len(row) > k))

    def _marks(self, separator: str | None) -> tuple[str, bool]:
        """Return the separator, and whether numbers have a decimal comma."""
        sample = [line for _, line in self.rows[-_SAMPLE:]]
        # Characters that may part columns, the surest first
        for mark in ("\t", ";", ",", " ") if separator is None else (separator,):
            self.separator = mark
            for comma in (False, True):
                if comma and mark == ",":
                    continue
                self.comma = comma
                self.blank = frozenset[int]() if mark == " " else self._blank_columns(sample)
                good = [cells for line in sample if self._is_data(cells := self.filled(line))]
                # most lines, as one may be cut short; and not a header of a file without data
                if len(good) > len(sample) // 2 and len(good[0]) >= (2 if separator is None else 1):
                    self._refuse_both_marks(good, comma)
                    if mark == ",":
                        self._refuse_two_commas(sample)
                    return mark, comma
        return self._poor(sample, separator)

    def _poor(self, sample: Sequence[str], separator: str | None) -> tuple[str, bool]:
        """Return marks of a file whose lines are not numbers throughout, so that a cell can be named."""
        self.blank = frozenset()
        if separator is not None:
            return separator, separator in ";\t"
        line = sample[min(1, len(sample) - 1)]
        found = next((d for d in (";", "\t", ",", " ") if d in line.strip()), None)
        if found is None:
            self.refuse(
                f"line {self.rows[0][0]} has one column; frequency and FRFs are expected, by ; , tab or blank"
            )
        return found, found in ";\t"

    def _refuse_both_marks(self, rows: Sequence[Sequence[str]], comma: bool) -> None:
        """Refuse decimal commas together with decimal points: one of them may separate thousands."""
        if comma and any("." in cell for row in rows for cell in row):
            self.refuse(
                "its numbers have commas and points, so that one of them could part thousands; export it "
                "with one decimal mark"
            )

    def _refuse_two_commas(self, sample: Sequence[str]) -> None:
        """Refuse commas that separate columns together with some that look decimal: ``1,5, 2,5``."""
        if all(", " in line and re.search(r"\d,\d", line) for line in sample):
            self.refuse(
                "its lines have commas with and without a blank behind them, so that some could be decimal "
                "commas; export it with ; or tab between columns"
            )

    def _is_data(self, cells: Sequence[str]) -> bool:
        return bool(cells) and all(self._is_number(c) for c in cells)

    def _is_number(self, text: str) -> bool:
        real = text.replace(",", ".") if self.comma else text
        if len(text) > _LONGEST:
            return False
        return bool(_NUMBER.match(real)) or text.lower() in _NOT_FINITE or self._is_complex(text)

    def _is_complex(self, text: str) -> bool:
        if text[-1:] not in ("i", "j", "I", "J", ")") or len(text) > _LONGEST:
            return False
        try:
            self._complex(text)
        except ValueError:
            return False
        return True

    def _first(self, header: bool | None) -> int:
        """Return the index of the first line of data: the first that begins with numbers to the last cell."""
        if header is True:
            return 1
        if header is False:
            return 0
        width = self._width()
        for i, (_, line) in enumerate(self.rows):
            cells = self.filled(line)
            if len(cells) == width and self._is_data(cells):
                return i
        for i, (_, line) in enumerate(self.rows):
            if self._is_number("".join(self.filled(line)[:1])):
                return i
        return len(self.rows)

    def _width(self) -> int:
        """Return how many columns most lines of numbers have."""
        sample = self.rows[-_SAMPLE:]
        widths = [len(c) for _, line in sample if self._is_data(c := self.filled(line))]
        return max(set(widths), key=widths.count) if widths else -1

    def _numbers(self, body: Sequence[tuple[int, str]]) -> tuple[Floats | Complexes, Ints]:
        first = self.filled(body[0][1])
        width = len(first)
        is_complex = any(self._is_complex(c) for c in first[1:])
        out = np.empty((len(body), width), dtype=complex if is_complex else float)
        parse = self._complex if is_complex else self._real
        for row, (line, text) in enumerate(body):
            cells = self.filled(text)
            if len(cells) != width:
                self.refuse(f"line {line} has {len(cells)} columns, the first line of data has {width}")
            try:
                out[row] = [self._real(cells[0]), *map(parse, cells[1:])]
            except ValueError:
                self._refuse_cell(line, cells, parse)
        self._refuse_infinite(out, body)
        return out, np.array([k for k, _ in body], dtype=np.int64)

    def _refuse_cell(self, line: int, cells: Sequence[str], parse: Callable[[str], complex]) -> NoReturn:
        for column, cell in enumerate(cells):
            try:
                (self._real if column == 0 else parse)(cell)
            except ValueError:
                self.refuse(f"line {line}, column {column + 1} has {cell[:30]!r} where a number is expected")
        raise AssertionError

    def _refuse_infinite(self, values: Complexes | Floats, body: Sequence[tuple[int, str]]) -> None:
        bad = np.argwhere(~np.isfinite(values))
        if bad.size:
            row, column = (int(v) for v in bad[0])
            self.refuse(
                f"line {body[row][0]}, column {column + 1} has a value that is not finite, {len(bad)} in "
                "all; leave such lines or channels out"
            )

    def _real(self, text: str) -> float:
        if self.comma:
            text = text.replace(",", ".")
        if "_" in text:
            raise ValueError
        try:
            return float(text.removesuffix("+0j"))  # a frequency that was written as a complex number
        except ValueError:
            if text.lower() in _NOT_FINITE:
                return float("nan")
            return float(text.replace("D", "E").replace("d", "e"))

    def _complex(self, text: str) -> complex:
        if self.comma:
            text = text.replace(",", ".")
        return complex(text.replace(" ", "").replace("*", "").replace("i", "j").replace("I", "j"))

    def _heads(self, width: int, above: Sequence[str]) -> tuple[tuple[str, ...], ...]:
        """Return the cells above each column: of lines of the header that have about as many cells."""
        rows: list[tuple[str, ...]] = []
        for line in above:
            text = line.lstrip().lstrip("#%").strip() if line.lstrip()[:1] in ("#", "%") else line
            cells = self._head_cells(text, width)
            filled = [k for k, c in enumerate(cells) if c]
            if not 1 < len(cells) <= width or not filled:
                continue
            spans = not cells[0] or len(filled) < len(cells)
            units = frequency_factor(cells[0]) is not None
            if not (spans or units or len(cells) == width or (width > 3 and len(cells) > width // 2)):
                continue
            cells += [""] * (width - len(cells))
            rows.append(tuple(_spread(cells) if spans else cells))
        return tuple(rows)

    def _rows(self, width: int, above: Sequence[str]) -> tuple[tuple[str, ...], ...]:
        """Return the rows of the header with a cell for each column."""
        rows = []
        for line in above:
            cells = self._head_cells(line.strip("\r\n"), width)[:width]
            if cells:
                rows.append((*cells, *[""] * (width - len(cells))))
        return tuple(rows)

    def _head_cells(self, text: str, width: int) -> list[str]:
        """Return the cells of a line of the header; where blanks part columns, names may have one blank."""
        if self.separator != " ":
            cells = self.filled(text)
            while cells and not cells[-1]:
                cells.pop()
            return cells
        cells = text.split()
        return cells if len(cells) == width else re.split(r"\s{2,}|\t", text.strip())


def _spread(cells: Sequence[str]) -> list[str]:
    """Return cells with each empty one behind the first filled one as the one before it."""
    out, last = [], ""
    for k, cell in enumerate(cells):
        last = cell or (last if k > 1 else "")
        out.append(cell or last)
    return out
