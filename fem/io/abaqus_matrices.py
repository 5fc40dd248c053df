"""Matrices that Abaqus writes as text (``.mtx``).

``*MATRIX OUTPUT`` writes a file for each matrix, and a line for each entry: node, direction, node,
direction and value (formats ``MATRIX INPUT`` and ``LABELS``), or row, column and value (``COORDINATE``).
A direction that
a support holds has 1e36 on the diagonal. ``*SUBSTRUCTURE MATRIX OUTPUT``, of CalculiX too, writes one file
with the nodes and directions of the rows, and the lower triangle of each matrix by rows.
Source: Abaqus Analysis User's Guide, "Generating structural matrices"; Keywords Reference, ``*USER ELEMENT``.
"""

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from fem.array_types import Floats, Ints
from fem.io.columns import cut_number, is_number
from fem.matrices import MatricesError
from fem.model import lever_matrix

FIXED = 1e36
"""What Abaqus adds to the diagonal in a direction that a support holds."""


_TYPES = {"STIFFNESS": "K", "MASS": "M", "VISCOUSDAMPING": "C", "STRUCTURALDAMPING": "D"}
_MATRIX = re.compile(r"^\*MATRIX\s*,\s*TYPE\s*=\s*([A-Z ]+)", re.IGNORECASE)


def number_rows(file: Path, text: str, width: int) -> Floats:
    """Return the numbers of lines that have as many each, separated by commas or blanks, shape (n, width).

    Raises
    ------
    MatricesError
        If a line has others; the message names it.
    """
    text = re.sub(r"^\*.*$", "", text, flags=re.MULTILINE).replace(",", " ").replace("D", "E")
    if text.strip() and not text.endswith("\n"):
        last = [line.split()[-1] for line in text.splitlines()[-50:] if line.strip()]
        if reason := cut_number(last, ()):
            msg = f"{file.name}, the last line: {reason}"
            raise MatricesError(msg)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # so NumPy says that it met something else than a number
            table = np.fromstring(text, sep=" ").reshape(-1, width)
        if np.isfinite(table).all():
            return table
    except (ValueError, DeprecationWarning):
        pass
    for k, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not (len(line.split()) == width and all(map(is_number, line.split()))):
            msg = f"{file.name}, line {k}: {line.strip()[:50]!r} is found where {width} numbers are expected"
            raise MatricesError(msg)
    msg = f"{file.name}: lines of {width} numbers are expected"
    raise MatricesError(msg)


def read_entries(files: dict[str, Path]) -> dict[str, Any]:
    """Read files of ``*MATRIX OUTPUT``, one for each of K, M, C and D.

    Returns
    -------
    dict
        The matrices; with labels ``node`` and ``direction`` of their rows too.

    Raises
    ------
    MatricesError
        For lines that cannot be read, internal nodes, directions that are no motions, and files in different
        formats.
    """
    tables = {}
    for key, file in files.items():
        text = file.read_text(encoding="latin-1")
        first = next((line for line in text.splitlines() if line.strip() and line[0] != "*"), "")
        width = len(first.replace(",", " ").split())
        if width not in (3, 5) or (tables and width != next(iter(tables.values())).shape[1]):
            msg = (
                f"{file.name}: {first.strip()[:50]!r} has {width} numbers; 5 or, in all files, 3 are expected"
            )
            raise MatricesError(msg)
        tables[key] = number_rows(file, text, width)
        _check_indices(file, tables[key][:, :-1])
    if next(iter(tables.values())).shape[1] == 3:
        n = int(max(table[:, :2].max() for table in tables.values()))
        return {key: _symmetric(t[:, 0] - 1, t[:, 1] - 1, t[:, 2], n) for key, t in tables.items()}
    # one number for node and direction, of which np.unique makes rows
    coded = {key: (t[:, [0, 2]] * 8 + t[:, [1, 3]]).astype(np.int64) for key, t in tables.items()}
    dofs = np.unique(np.concatenate([codes.ravel() for codes in coded.values()]))
    found = {
        key: _symmetric(rows[:, 0], rows[:, 1], tables[key][:, 4], dofs.size)
        for key, rows in ((key, np.searchsorted(dofs, codes)) for key, codes in coded.items())
    }
    free = np.flatnonzero(found["K"].diagonal() < FIXED / 2) if "K" in found else np.arange(dofs.size)
    found = {key: sp.csr_array(X[free][:, free]) for key, X in found.items()}
    return {**found, "node": dofs[free] // 8, "direction": dofs[free] % 8}


def rows_in_order(found: dict[str, Any], nodes: Ints, points: Floats) -> dict[str, Any]:
    """Return matrices of the format ``COORDINATE``, and ``node`` and ``direction`` of their rows.

    Abaqus numbers rows by node, rising, and by direction. Rigid-body motions show whether it did: without
    supports they meet no force, and with supports none at most nodes.

    Parameters
    ----------
    found : dict
        K, M, perhaps C and D.
    nodes, points : ndarray (n_nodes,), (n_nodes, 3)
        All nodes of the deck, and their places.

    Returns
    -------
    dict
        Without the rows that a support holds; empty if the rows are not 3 or 6 for each node in this order.
    """
    n = found["K"].shape[0]
    per_node = n // max(len(nodes), 1)
    if per_node not in (3, 6) or n != per_node * len(nodes):
        return {}
    order = np.argsort(nodes)
    node, direction = np.repeat(nodes[order], per_node), np.tile(np.arange(1, per_node + 1), len(nodes))
    free = np.flatnonzero(found["K"].diagonal() < FIXED / 2)
    kept = {key: sp.csr_array(X)[free][:, free] for key, X in found.items()}
    R = lever_matrix(points[order] - points.mean(axis=0))[:, :per_node].reshape(-1, 6)[free]
    if not moves_freely(kept["K"], R):
        return {}
    return {**kept, "node": node[free], "direction": direction[free]}


def moves_freely(K: sp.csr_array, R: Floats) -> bool:
    """Return whether most rows (m, n) of a stiffness that rigid-body motions R (n, 6) reach meet no force."""
    terms = (abs(K) @ np.abs(R)).max(axis=1)
    force = np.abs(K @ R).max(axis=1)
    reached = terms > 0
    # Force of a rigid-body motion, relative to its terms, that shows other rows than were taken
    return bool((force > 1e-6 * terms)[reached].sum() <= reached.sum() / 2)


def _check_indices(file: Path, index: Floats) -> None:
    wrong = (index < 1) | (index != np.floor(index)) | (index > 1e12)
    if index.shape[1] == 4:
        wrong[:, 1::2] |= index[:, 1::2] > 6
    if wrong.any():
        row = index[int(np.argmax(wrong.any(axis=1)))]
        words = ", ".join(f"{v:g}" for v in row)
        msg = (
            f"{file.name}: an entry of {words}: nodes count from 1 and directions are 1 to 6; internal nodes "
            "(of hybrid elements, connectors, contact) and other unknowns cannot be read"
        )
        raise MatricesError(msg)


def _symmetric(i: Any, j: Any, values: Floats, n: int) -> sp.csr_array:
    """Return a matrix of which one triangle or both are given."""
    X = sp.coo_array((values, (i.astype(np.int64), j.astype(np.int64))), shape=(n, n)).tocsr()
    one = not sp.triu(X, 1).count_nonzero() or not sp.tril(X, -1).count_nonzero()
    return sp.csr_array(X + X.T - sp.diags_array(X.diagonal())) if one else X


def read_substructure(file: Path) -> dict[str, Any]:
    """Read a file of ``*SUBSTRUCTURE MATRIX OUTPUT``: matrices, and ``node`` and ``direction`` of the rows.

    Raises
    ------
    MatricesError
        If there is more than one element, or the numbers of rows and of entries do not fit.
    """
    lines = file.read_text(encoding="latin-1").splitlines()
    starts = [k for k, line in enumerate(lines) if line.upper().startswith("*USER ELEMENT")]
    if len(starts) != 1 or "UNSYMM" in lines[starts[0]].upper():
        msg = f"{file.name}: {len(starts)} *USER ELEMENT are found; one with symmetric matrices is expected"
        raise MatricesError(msg)
    first = next((k for k, line in enumerate(lines) if _MATRIX.match(line)), len(lines))
    node, direction = _element_rows(file, lines[starts[0] + 1 : first], starts[0] + 2)
    found: dict[str, Any] = {"node": node, "direction": direction}
    for at in range(first, len(lines)):
        match = _MATRIX.match(lines[at])
        key = _TYPES.get(match[1].upper().replace(" ", "")) if match else None
        if key is None:
            continue
        end = next((k for k in range(at + 1, len(lines)) if lines[k][:1] == "*"), len(lines))
        words = " ".join(lines[at + 1 : end]).replace(",", "\n") + "\n"
        values = number_rows(file, "\n".join(words.split()) + "\n", 1)[:, 0]
        if values.size != node.size * (node.size + 1) // 2:
            msg = (
                f"{file.name}, line {at + 1}: {key} has {values.size} entries; the lower triangle of "
                f"{node.size} rows has {node.size * (node.size + 1) // 2}"
            )
            raise MatricesError(msg)
        X = np.zeros((node.size, node.size))
        X[np.tril_indices(node.size)] = values
        found[key] = X + np.tril(X, -1).T
    return found


def _element_rows(file: Path, lines: list[str], at: int) -> tuple[Ints, Ints]:
    """Return node and direction of the rows of ``*USER ELEMENT``.

    Comments have the nodes; the first line the directions of the first, and each further line a place in
    the list of nodes and the directions from there on.
    """
    nodes: list[int] = []
    changes: dict[int, list[int]] = {}
    for k, line in enumerate(lines, start=at):
        words = line.lstrip("*").replace(",", " ").split()
        if not words or (line.startswith("**") and not all(map(str.isdigit, words))):
            continue
        if not all(map(str.isdigit, words)) or (line[0] == "*" and line[1:2] != "*"):
            msg = f"{file.name}, line {k}: {line.strip()[:50]!r} is found where whole numbers are expected"
            raise MatricesError(msg)
        numbers = [int(word) for word in words]
        if line.startswith("**"):
            nodes += numbers
        elif not changes:
            changes[1] = numbers
        else:
            changes[numbers[0]] = numbers[1:]
    pairs: list[tuple[int, int]] = []
    directions: list[int] = []
    for k, node in enumerate(nodes, start=1):
        directions = changes.get(k, directions)
        pairs += [(node, d) for d in directions]
    table = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    # Directions above this are amplitudes of modes; 7 to this are no motions (temperatures and the like)
    strange = (table[:, 1] < 1) | ((table[:, 1] > 6) & (table[:, 1] <= 100))
    if strange.any():
        msg = f"{file.name}: a row has the direction {table[strange, 1][0]}; 1 to 6 are motions"
        raise MatricesError(msg)
    moves = table[:, 1] <= 6
    return np.where(moves, table[:, 0], -1), np.where(moves, table[:, 1], 0)
