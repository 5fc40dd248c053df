"""The numbers in the text of universal files: in columns of fixed width, or between blanks.

The format has columns, in which numbers may touch (``0-1.000000E+00``) and an empty column means 0; many
programs write other widths, with blanks between. A line with as many numbers between blanks as it has columns
is taken by its blanks, every other one by its columns. Datasets whose lines are all of the first kind
are converted at once.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np

from fem.array_types import Floats, Ints
from fem.io.faults import refuse
from fem.io.uff_format import UffBlock

# Each part can match in one way only, so that a long line of digits takes linear time.
_NUMBER = re.compile(
    r"([-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+))(?:[EeDd]([-+]?[0-9]+)|([-+][0-9]+))?", re.ASCII
)
_LARGEST_INTEGER = 2.0**53
"""Integers up to which a float is exact."""


@dataclass(frozen=True, slots=True, eq=False)
class Tokens:
    """Numbers of the lines of a dataset that are not blank.

    Attributes
    ----------
    values : ndarray (n,)
    count, start : ndarray of int (n_lines,), how many numbers a line has, and the index of its first
    record : ndarray of int (n_lines,), number of the line in the dataset; line 0 is the one with the type
    """

    values: Floats
    count: Ints
    start: Ints
    record: Ints


def number_of(text: str) -> float | None:
    """Return a number with an exponent of E, D or its sign alone; None if it is none."""
    text = text.strip()
    found = _NUMBER.fullmatch(text) if len(text) <= 60 else None
    return None if found is None else float(f"{found[1]}e{found[2] or found[3] or 0}")


def integer_of(text: str) -> int | None:
    """Return a whole number; None if it is none."""
    value = number_of(text)
    exact = value is not None and value == np.floor(value) and abs(value) <= _LARGEST_INTEGER
    return int(value) if exact and value is not None else None


def real(block: UffBlock, record: int, text: str) -> float:
    """Return the number in a column, 0 where it is empty.

    Raises
    ------
    ValueError
        With the line of the file, if it is no finite number.
    """
    value = number_of(text) if text.strip() else 0.0
    if value is None or not np.isfinite(value):
        refuse(f"{block.at(record)} has {text.strip()[:20]!r} where a number is expected")
    return value


def integer(block: UffBlock, record: int, text: str) -> int:
    """Return the whole number in a column, 0 where it is empty; raise as :func:`real`."""
    value = integer_of(text) if text.strip() else 0
    if value is None:
        refuse(f"{block.at(record)} has {text.strip()[:20]!r} where a whole number is expected")
    return value


def cells(block: UffBlock, record: int, widths: Sequence[int]) -> list[str]:
    """Return the columns of a line as text: by its blanks where as many numbers stand there, else by widths.

    Raises
    ------
    ValueError
        If it has more than its columns, or its last column is not there.
    """
    line = block.lines[record]
    words = line.split()
    if len(words) == len(widths) and all(number_of(word) is not None for word in words):
        return words
    edges = (0, *accumulate(widths))
    if line[edges[-1] :].strip() or not line[edges[-2] :].strip():
        bad = next((word for word in words if number_of(word) is None), None)
        if bad is not None:
            refuse(f"{block.at(record)} has {bad[:20]!r} where a number is expected")
        refuse(f"{block.at(record)} has {len(words)} numbers where {len(widths)} are expected")
    return [line[a:b] for a, b in pairwise(edges)]


def text_at(block: UffBlock, record: int) -> str:
    """Return a line; raise where the dataset has ended before."""
    if record >= block.n_lines:
        refuse(f"it ends after {block.at(block.n_lines - 1)}, within its header or a record")
    return block.lines[record]


def tokens(block: UffBlock, first: int = 1) -> Tokens | None:
    """Return the numbers between blanks from a line of a dataset on; None where one is no number."""
    text = block.body
    for _ in range(first - 1):
        text = text[text.find(b"\n") + 1 :] if b"\n" in text else b""
    if not text.strip():
        return Tokens(np.zeros(0), *(np.zeros(0, dtype=np.int64) for _ in range(3)))
    try:
        values = np.fromstring(text.replace(b"D", b"E").replace(b"d", b"e"), sep=" ")
    except ValueError:
        return None
    byte = np.frombuffer(text, np.uint8)
    begins = byte > ord(" ")
    begins[1:] &= byte[:-1] <= ord(" ")
    begins = np.flatnonzero(begins)
    ends = np.append(np.flatnonzero(byte == ord("\n")), byte.size)
    count = np.diff(np.searchsorted(begins, ends), prepend=0)
    if count.sum() != values.size:
        return None
    full = np.flatnonzero(count)
    count = count[full]
    return Tokens(values, count, np.cumsum(count) - count, full + first)


def records(block: UffBlock, pattern: Sequence[Sequence[int]], first: int = 1) -> Floats:
    """Return the numbers of records that all have the same lines, shape (n_records, n_columns).

    Parameters
    ----------
    block : Block
    pattern : sequence of sequence of int
        For each line of a record the widths of its columns.
    first : int
        Line of the dataset at which records begin.

    Raises
    ------
    ValueError
        With the line of the file, where there is no number or the last record is not complete.
    """
    found = tokens(block, first)
    columns = np.array([len(widths) for widths in pattern])
    if found is not None and found.count.size % columns.size == 0:
        per_line = found.count.reshape(-1, columns.size)
        if (per_line == columns).all():
            return found.values.reshape(-1, columns.sum())
    full = [k for k in range(first, block.n_lines) if block.lines[k].strip()]
    values = [
        [real(block, k, text) for text in cells(block, k, pattern[position % len(pattern)])]
        for position, k in enumerate(full)
    ]
    if len(full) % len(pattern):
        refuse(f"its last record, at {block.at(full[-1])}, has fewer lines than {len(pattern)}")
    return np.array([x for row in values for x in row]).reshape(-1, columns.sum())


def line_of(block: UffBlock, position: int, n_lines: int) -> str:
    """Return the place in the file of a record among those of ``n_lines`` lines each."""
    full = [k for k, line in enumerate(block.body.split(b"\n"), start=1) if line.strip()]
    return block.at(full[position * n_lines])


def integer_columns(block: UffBlock, values: Floats, columns: Sequence[int], n_lines: int) -> Ints:
    """Return columns of records as whole numbers; raise with the line where one is none."""
    chosen = values[:, columns]
    good = np.isfinite(chosen) & (np.abs(chosen) <= _LARGEST_INTEGER)
    good &= np.where(good, chosen, 0.5) == np.floor(np.where(good, chosen, 0.0))
    if not good.all():
        row, column = (int(k) for k in np.argwhere(~good)[0])
        refuse(f"{line_of(block, row, n_lines)} has {chosen[row, column]:g} where a whole number is expected")
    return chosen.astype(np.int64)
