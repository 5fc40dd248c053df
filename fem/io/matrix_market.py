"""Matrix Market files, read number by number.

SciPy's reader (fast_matrix_market) ends the process on some damaged files, such as one that is cut
inside an exponent, and takes the sizes in the header at their word. Its writer is used by
:mod:`fem.io.matrices`.
Format: Boisvert, Pozo, Remington, "The Matrix Market exchange formats", NISTIR 5935, 1996.
"""

from pathlib import Path
from typing import NoReturn

import numpy as np
import scipy.sparse as sp

from fem.array_types import Floats, Ints
from fem.io.columns import is_number
from fem.io.faults import refuse
from fem.matrices import MatricesError

MOST_ROWS = 20_000_000
"""Rows or columns beyond which a size is taken for a mistake."""

FIELDS = ("real", "double", "integer")
SYMMETRIES = ("general", "symmetric", "skew-symmetric")


def read_matrix_market(file: Path) -> sp.csr_array:
    """Return the real matrix of a Matrix Market file, coordinate or array, with both triangles."""
    text = file.read_text(encoding="utf-8", errors="replace")
    lines = text.splitlines()
    form, symmetry = _banner(file, lines)
    at = next((k for k, line in enumerate(lines[1:], start=1) if line.strip() and line[0] != "%"), None)
    if at is None:
        _refuse(file, len(lines), "the file ends before the line with the sizes of the matrix")
    width = 3 if form == "coordinate" else 2
    sizes = _sizes(file, at + 1, lines[at], width)
    rows, columns = sizes[:2]
    if symmetry != "general" and rows != columns:
        _refuse(file, at + 1, f"a {symmetry} matrix of {rows} rows and {columns} columns; it must be square")
    body = lines[at + 1 :]
    if form == "array":
        return _array(file, at + 2, body, rows, columns, symmetry)
    return _coordinate(file, at + 2, body, rows, columns, sizes[2], symmetry)


def _refuse(file: Path, line: int, text: str) -> NoReturn:
    refuse(f"{file.name}, line {line}: {text}", MatricesError)


def _banner(file: Path, lines: list[str]) -> tuple[str, str]:
    words = lines[0].lower().split() if lines else []
    if (
        len(words) != 5
        or words[:2] != ["%%matrixmarket", "matrix"]
        or words[2] not in ("coordinate", "array")
    ):
        _refuse(
            file,
            1,
            "it does not begin with '%%MatrixMarket matrix coordinate' or 'array', field and symmetry",
        )
    form, field, symmetry = words[2:]
    if field not in FIELDS:
        _refuse(file, 1, f"the field is '{field[:30]}'; allowed are {', '.join(FIELDS)}")
    if symmetry not in SYMMETRIES:
        _refuse(file, 1, f"the symmetry is '{symmetry[:30]}'; allowed are {', '.join(SYMMETRIES)}")
    return form, symmetry


def _sizes(file: Path, line: int, text: str, width: int) -> list[int]:
    words = text.split()
    if len(words) != width or not all(word.isascii() and word.isdigit() and len(word) < 12 for word in words):
        need = "rows, columns and entries" if width == 3 else "rows and columns"
        _refuse(file, line, f"{text.strip()[:40]!r} is found where the numbers of {need} are expected")
    sizes = [int(word) for word in words]
    if not all(1 <= size <= MOST_ROWS for size in sizes[:2]):
        _refuse(file, line, f"{sizes[0]} rows and {sizes[1]} columns; allowed are 1 to {MOST_ROWS}")
    return sizes


def _numbers(file: Path, first: int, body: list[str], width: int) -> Floats:
    """Return the numbers of the lines that are not empty, shape (n, width)."""
    kept = [line.split() for line in body]
    try:
        values = np.array([words for words in kept if words], dtype=float).reshape(-1, width)
    except ValueError:
        values = np.full((0, width), np.nan)
    if len(values) == sum(map(bool, kept)) and np.isfinite(values).all():
        return values
    for k, words in enumerate(kept):
        if words and (len(words) != width or not all(map(is_number, words))):
            _refuse(
                file,
                first + k,
                f"{body[k].strip()[:40]!r} is found where {width} finite number(s) are expected",
            )
    return values


def _coordinate(
    file: Path, first: int, body: list[str], rows: int, columns: int, n: int, symmetry: str
) -> sp.csr_array:
    table = _numbers(file, first, body, 3)
    if len(table) != n:
        _refuse(file, first - 1, f"{n} entries are announced, and {len(table)} follow")
    index = table[:, :2]
    wrong = (index < 1) | (index > [rows, columns]) | (index != np.floor(index))
    if wrong.any():
        k = int(np.argmax(wrong.any(axis=1)))
        line = [j for j, text in enumerate(body) if text.strip()][k]
        _refuse(
            file,
            first + line,
            f"row {index[k, 0]:g} and column {index[k, 1]:g} of {rows} rows and {columns} columns",
        )
    i, j = (index.astype(np.int64) - 1).T
    return _both_triangles(i, j, table[:, 2], (rows, columns), symmetry)


def _array(file: Path, first: int, body: list[str], rows: int, columns: int, symmetry: str) -> sp.csr_array:
    """Read values column by column; of symmetric matrices only the lower triangle is written."""
    values = _numbers(file, first, body, 1)[:, 0]
    n = {"general": rows * columns, "symmetric": rows * (rows + 1) // 2}.get(symmetry, rows * (rows - 1) // 2)
    if values.size != n:  # so that the size line cannot ask for more memory than the file has numbers
        _refuse(file, first - 1, f"{n} entries are announced, and {values.size} follow")
    if symmetry == "general":
        return sp.csr_array(values.reshape(columns, rows).T)
    j, i = np.triu_indices(rows, 0 if symmetry == "symmetric" else 1)
    return _both_triangles(i, j, values, (rows, columns), symmetry)


def _both_triangles(i: Ints, j: Ints, values: Floats, shape: tuple[int, int], symmetry: str) -> sp.csr_array:
    if symmetry != "general":
        off, sign = i != j, -1.0 if symmetry == "skew-symmetric" else 1.0
        i, j, values = np.r_[i, j[off]], np.r_[j, i[off]], np.r_[values, sign * values[off]]
    return sp.csr_array(sp.coo_array((values, (i, j)), shape=shape))
