"""Nastran's OUTPUT4 files (``.op4``): text and binary, dense and sparse, with and without BIGMAT.

A file has matrices one after the other, and a matrix its columns. A column is dense (its first row, and the
values from there), or has strings of successive values. A string begins with ``L, row`` (BIGMAT, for L - 1
words of values) or with the number ``65536 (L + 1) + row`` (otherwise, for L words). The word has 4 bytes, or
8 in files of 64-bit integers. Source: MSC Nastran DMAP Programmer's Guide, module OUTPUT4.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fem.array_types import Floats
from fem.matrices import MatricesError

_FORMAT = re.compile(r"(?:1P,)?(\d+)[ED](\d+)\.\d+", re.IGNORECASE)
_FORMS = {1: "square", 2: "rectangular", 6: "symmetric"}
_MOST_ROWS = 20_000_000


@dataclass(slots=True)
class _Matrix:
    """A matrix while its columns are read; ``reals`` is the numbers of a value, ``words`` its words."""

    name: str
    rows: int
    columns: int
    form: int
    reals: int
    words: int
    bigmat: bool
    parts: list[tuple[int, int, NDArray[Any]]] = field(default_factory=list)

    def add(self, column: int, row: int, numbers: Floats) -> bool:
        """Keep successive values of a column; return whether they lie within the matrix."""
        values = numbers if self.reals == 1 else numbers[0::2] + 1j * numbers[1::2]
        self.parts.append((row - 1, column - 1, values))
        return 1 <= column <= self.columns and 1 <= row <= self.rows - values.size + 1

    def built(self, file: Path) -> sp.csr_array:
        """Return the matrix; of a symmetric one that has one triangle alone, both."""
        if self.form not in _FORMS:
            allowed = ", ".join(f"{k} {word}" for k, word in _FORMS.items())
            _refuse(file, f"matrix {self.name}", f"the form is {self.form}; read are {allowed}")
        shape = (self.rows, self.columns)
        if not self.parts:
            return sp.csr_array(shape)
        i = np.concatenate([row + np.arange(v.size) for row, _, v in self.parts])
        j = np.concatenate([np.full(v.size, column) for _, column, v in self.parts])
        X = sp.coo_array((np.concatenate([v for *_, v in self.parts]), (i, j)), shape=shape).tocsr()
        lower, upper = sp.tril(X, -1).count_nonzero(), sp.triu(X, 1).count_nonzero()
        # form 6 is symmetric
        one = self.form == 6 and (not lower or not upper)
        return sp.csr_array(X + X.T - sp.diags_array(X.diagonal())) if one else X


def read_op4(file: Path, wanted: re.Pattern[str]) -> dict[str, sp.csr_array]:
    """Return the matrices of an OUTPUT4 file with some names, in capitals; complex ones are complex.

    Raises
    ------
    MatricesError
        If the file is none, or is cut or damaged; the message names the matrix and the place.
    """
    data = file.read_bytes()
    found: dict[str, sp.csr_array] = {}
    first = data[:4]
    binary = first in (struct.pack(f"{order}i", size) for order in "<>" for size in (24, 48))
    for matrix in _binary(file, data) if binary else _text(file, data):
        if not wanted.fullmatch(matrix.name):
            continue
        if matrix.name in found:
            msg = f"{file.name}: it has two matrices {matrix.name}; write one file for each"
            raise MatricesError(msg)
        found[matrix.name] = matrix.built(file)
    return found


def _opened(file: Path, place: str, numbers: list[int], name: str, word: int) -> _Matrix:
    columns, rows, form, kind = numbers
    if kind not in (1, 2, 3, 4) or not (1 <= columns <= _MOST_ROWS and 1 <= abs(rows) <= _MOST_ROWS):
        _refuse(file, place, f"matrix {name} of {columns} columns, {rows} rows and type {kind} (1 to 4)")
    reals = 1 if kind <= 2 else 2
    # values of single and of double precision fill a word of 8 bytes alike
    words = reals * (2 if kind in (2, 4) and word == 4 else 1)
    return _Matrix(name, abs(rows), columns, form, reals, words, rows < 0)


def _refuse(file: Path, place: str, text: str) -> NoReturn:
    msg = f"{file.name}, {place}: {text}"
    raise MatricesError(msg)


# Text -------------------------------------------------------------------------------------------------------


def _text(file: Path, data: bytes) -> Iterator[_Matrix]:
    lines = data.decode("ascii", errors="replace").splitlines()
    at = 0
    while at < len(lines) and lines[at].strip():
        width, numbers, rest = _heading(file, at, lines[at])
        form = _FORMAT.search(rest[8:]) or ("", "5", "16")  # Nastran's default is 1P,5E16.9
        name = rest[:8].strip().upper()
        matrix = _opened(file, f"line {at + 1}", numbers, name, 8 if width == 16 else 4)
        at = yield from _columns(file, lines, at + 1, matrix, width, (int(form[1]), int(form[2])))
        yield matrix


def _heading(file: Path, at: int, line: str) -> tuple[int, list[int], str]:
    """Return the width of the whole numbers that follow a heading, its four numbers, and its rest.

    Files of 64-bit integers have 16 columns for each number. Others have as many only for the numbers of
    columns and rows of a matrix too large for eight, and say so after its format.
    """
    if line[:8].strip():
        return 8, _ints(file, at, line[:32], 8, 4), line[32:]
    if line.rstrip().upper().endswith("|I16"):
        return 8, _ints(file, at, line[:32], 16, 2) + _ints(file, at, line[32:48], 8, 2), line[48:]
    return 16, _ints(file, at, line[:64], 16, 4), line[64:]


def _columns(
    file: Path, lines: list[str], at: int, matrix: _Matrix, width: int, form: tuple[int, int]
) -> Iterator[Any]:
    """Read the columns of a matrix in text, and return the line after them."""
    yield from ()
    while True:
        column, row, n = _ints(file, at, lines[at] if at < len(lines) else "", width, 3)
        if column > matrix.columns:
            return at + 1 + -(-max(n, 0) // form[0])
        head, at = at, at + 1
        if row:
            values, at = _values(file, lines, at, n, form)
            good = matrix.add(column, row, values)
        else:
            good = True
            while n > 0:
                mark = _ints(file, at, lines[at] if at < len(lines) else "", width, 2 if matrix.bigmat else 1)
                row, words, spent = _string(matrix, mark)
                n -= spent
                size = words // matrix.words * matrix.reals
                values, at = _values(file, lines, at + 1, size, form)
                good = good and n >= 0 and matrix.add(column, row, values)
        if not good:
            _refuse(
                file, f"line {head + 1}", f"column {column} of {matrix.name} exceeds its {matrix.rows} rows"
            )


def _string(matrix: _Matrix, mark: list[int]) -> tuple[int, int, int]:
    """Return the row of a string, the words of its values, and all its words."""
    if matrix.bigmat:
        return mark[1], mark[0] - 1, mark[0] + 1
    words = mark[0] // 65536 - 1
    return mark[0] % 65536, words, words + 1


def _ints(file: Path, at: int, line: str, width: int, n: int) -> list[int]:
    try:
        words = line.split()  # some numbers are wider than their columns say, others touch
        if len(words) == n:
            return [int(word) for word in words]
        return [int(line[width * k : width * (k + 1)]) for k in range(n)]
    except ValueError:
        _refuse(file, f"line {at + 1}", f"{line[:60]!r} is found where {n} whole numbers are expected")


def _values(file: Path, lines: list[str], at: int, n: int, form: tuple[int, int]) -> tuple[Floats, int]:
    each, width = form
    end = at + -(-max(n, 0) // each)
    texts = [
        lines[k][width * j : width * (j + 1)]
        for k in range(at, min(end, len(lines)))
        for j in range(min(each, n - each * (k - at)))
    ]
    try:
        values = np.array([float(text.replace("D", "E")) for text in texts])
    except ValueError:
        values = np.zeros(0)
    if values.size != n or n < 1 or not np.isfinite(values).all():
        _refuse(file, f"line {at + 1}", f"{n} numbers of {width} columns are expected from here on")
    return values, end


# Binary -----------------------------------------------------------------------------------------------------


def _binary(file: Path, data: bytes) -> Iterator[_Matrix]:
    """Read Fortran records: a matrix has one of 24 bytes (48 with 64-bit integers), and one a column."""
    order = "<" if data[0] in (24, 48) else ">"
    word = 4 if data[0 if order == "<" else 3] == 24 else 8
    integer, matrix = np.dtype(f"{order}i{word}"), None
    at = 0
    while at < len(data):
        record, end = _record(file, data, at, order)
        if matrix is None:
            if len(record) != 6 * word:
                _refuse(
                    file, f"byte {at}", f"a record of {len(record)} bytes; a matrix begins with {6 * word}"
                )
            numbers = np.frombuffer(record, integer, 4).tolist()
            name = record[4 * word :].decode("latin-1").strip("\0 ").upper()
            matrix = _opened(file, f"byte {at}", numbers, name, word)
        else:
            if len(record) < 3 * word or len(record) % word:
                _refuse(file, f"byte {at}", f"a record of {len(record)} bytes is no column of {matrix.name}")
            column, row, n = np.frombuffer(record, integer, 3).tolist()
            if column > matrix.columns:
                yield matrix
                matrix = None
            elif not _binary_column(matrix, record[3 * word :], column, row, n, integer):
                text = f"column {column} of {matrix.name} has {n} words that do not fit {matrix.rows} rows"
                _refuse(file, f"byte {at}", text)
        at = end
    if matrix is not None:
        _refuse(file, f"byte {at}", f"the file ends within matrix {matrix.name}: is it cut?")


def _record(file: Path, data: bytes, at: int, order: str) -> tuple[bytes, int]:
    size = struct.unpack_from(f"{order}i", data, at)[0] if at + 4 <= len(data) else -1
    end = at + 8 + size
    if size < 0 or end > len(data) or struct.unpack_from(f"{order}i", data, end - 4)[0] != size:
        _refuse(
            file, f"byte {at}", f"a record of {size} bytes does not end where it should: is the file cut?"
        )
    return data[at + 4 : end - 4], end


def _binary_column(matrix: _Matrix, data: bytes, column: int, row: int, n: int, integer: Any) -> bool:
    """Read a column of a binary file; return whether it fits the matrix."""
    size = integer.itemsize
    real = np.dtype(f"{integer.byteorder}f{size * matrix.words // matrix.reals}")
    if not 0 < n <= len(data) // size:
        return False
    if row:
        return matrix.add(column, row, np.frombuffer(data[: n * size], real).astype(float))
    at, good = 0, True
    while at < n and good:
        head = 2 if matrix.bigmat else 1
        mark = np.frombuffer(data[at * size : (at + head) * size], integer).tolist()
        if len(mark) < head:
            return False
        row, words, spent = _string(matrix, mark)
        text = data[(at + head) * size : (at + spent) * size]
        good = words > 0 and len(text) == words * size and not len(text) % real.itemsize
        good = good and matrix.add(column, row, np.frombuffer(text, real).astype(float))
        at += spent
    return good
