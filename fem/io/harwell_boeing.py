"""Harwell-Boeing files (``.rsa``, ``.hb``, ANSYS's ``.matrix``), and ANSYS's ``.mapping`` of equations.

Format: Duff, Grimes, Lewis, "Users' guide for the Harwell-Boeing sparse matrix collection", 1992.
SciPy's reader takes no symmetric matrices. ANSYS writes both with ``HBMAT``; the table has a line of titles,
then equation, node and label of each row.
"""

import re
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import scipy.sparse as sp

from fem.array_types import Floats
from fem.matrices import MatricesError

_FORMAT = re.compile(r"(\d*)\s*[IEDFG](\d+)", re.IGNORECASE)
LABELS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
"""ANSYS's names of the directions 1 to 6."""


def read_harwell_boeing(file: Path) -> sp.csr_array:
    """Return a real assembled matrix; of a symmetric one the file has one triangle.

    Raises
    ------
    MatricesError
        For other kinds, and files that are cut or damaged.
    """
    lines = file.read_text(encoding="latin-1").splitlines()
    if len(lines) < 5 or "\0" in lines[0]:
        _refuse(file, 1, "it is no Harwell-Boeing file in text (ANSYS: HBMAT with ASCII)")
    counts = _ints(file, 2, lines[1].split())
    kind, sizes = lines[2][:3].upper(), _ints(file, 3, lines[2][3:].split())
    if kind not in ("RSA", "RUA") or len(sizes) < 3 or len(counts) < 4 or sizes[0] != sizes[1]:
        _refuse(file, 3, f"{lines[2].strip()[:40]!r}: a square RSA or RUA matrix is expected")
    formats = [(int(each or 1), int(width)) for each, width in _FORMAT.findall(lines[3])]
    if len(formats) < 3:
        _refuse(file, 4, f"{lines[3].strip()[:40]!r} does not give three formats such as (3E25.16)")
    n, entries = sizes[0], sizes[2]
    at = 5 if len(counts) > 4 and counts[4] > 0 else 4
    parts: list[Floats] = []
    for k, (count, wanted) in enumerate(zip(counts[1:4], (n + 1, entries, entries), strict=True)):
        parts.append(_numbers(file, at, lines[at : at + count], wanted, formats[k]))
        at += count
    start, row = (part.astype(np.int64) - 1 for part in parts[:2])
    if start[0] != 0 or start[-1] != entries or (np.diff(start) < 0).any() or row.min(initial=0) < 0:
        _refuse(file, 5, f"the columns do not begin at 1 and end at {entries + 1} in rising order")
    if row.max(initial=0) >= n:
        _refuse(file, 5, f"row {row.max() + 1} of {n}")
    X = sp.csc_array((parts[2], row, start), shape=(n, n))
    lower, upper = sp.tril(X, -1).count_nonzero(), sp.triu(X, 1).count_nonzero()
    one = kind == "RSA" and not (lower and upper)  # ANSYS writes both triangles of some symmetric matrices
    return sp.csr_array(X + X.T - sp.diags_array(X.diagonal())) if one else sp.csr_array(X)


def _refuse(file: Path, line: int, text: str) -> NoReturn:
    msg = f"{file.name}, line {line}: {text}"
    raise MatricesError(msg)


def _ints(file: Path, line: int, words: list[str]) -> list[int]:
    if not all(word.isdigit() and len(word) < 12 for word in words):
        _refuse(file, line, f"{' '.join(words)[:40]!r} is found where whole numbers are expected")
    return [int(word) for word in words]


def _numbers(file: Path, at: int, lines: list[str], wanted: int, form: tuple[int, int]) -> Floats:
    words = " ".join(lines).split()
    if len(words) != wanted:  # numbers may touch
        each, width = form
        words = [line[k : k + width] for line in lines for k in range(0, min(len(line), each * width), width)]
        words = [word for word in words if word.strip()]
    try:
        values = np.array([float(word.replace("D", "E").replace("d", "e")) for word in words])
    except ValueError:
        values = np.zeros(0)
    if values.size != wanted or not np.isfinite(values).all():
        _refuse(
            file, at + 1, f"{wanted} numbers are expected in {len(lines)} lines from here: is the file cut?"
        )
    return values


def read_mapping(file: Path, n: int) -> dict[str, Any]:
    """Return ``node`` and ``direction`` of the rows from ANSYS's table of equations.

    Raises
    ------
    MatricesError
        For labels that are no motions, and rows that are missing or twice.
    """
    node, direction = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    for k, line in enumerate(file.read_text(encoding="latin-1").splitlines(), start=1):
        words = line.split()
        if len(words) < 3 or not words[0].isdigit():
            continue  # titles
        label = words[2].upper()
        if label not in LABELS or not words[1].isdigit():
            _refuse(
                file, k, f"{line.strip()[:40]!r}: equation, node and one of {', '.join(LABELS)} are expected"
            )
        row = int(words[0]) - 1
        if not 0 <= row < n or direction[row]:
            _refuse(
                file, k, f"equation {row + 1} is not in the matrices, which have {n} rows, or comes twice"
            )
        node[row], direction[row] = int(words[1]), LABELS.index(label) + 1
    if not direction.all():
        _refuse(file, 1, f"there is no line about equation {int(np.argmin(direction)) + 1} of {n}")
    return {"node": node, "direction": direction}
