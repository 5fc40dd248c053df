"""Matrices of Nastran: DMIG cards of punch files and decks, and OUTPUT4 files with the deck of their rows.

A matrix is known by its name: ``KAAX``, ``K2GG``, ``KXX``, ``KAA``, ``KGG`` and the like are stiffness,
``M…`` mass, ``B…`` viscous and ``K4…`` structural damping. The imaginary part of a complex stiffness is
structural damping. Scalar points are coordinates that are no motion of a node.
Source: MSC Nastran Quick Reference Guide, entries DMIG, EXTRN, ASET and ASET1.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from fem.array_types import Ints
from fem.io.deck import integer
from fem.io.nastran import Grids, read_grids
from fem.io.nastran_cards import BulkData, fields_of, real, runs_of
from fem.io.op4 import read_op4
from fem.matrices import MatricesError
from fem.mesh import MeshError

DECKS = (".pch", ".asm", ".bdf", ".dat", ".nas", ".fem")
"""Endings of files with cards that may say places and rows."""

MATRIX = re.compile(r"(K4|K|M|B)(2GG|AA|XX|GG|FF|LL|NN)?X?\d*")
"""Names of matrices, and the letters that say which they are."""

_KEYS = {"K": "K", "M": "M", "B": "C", "K4": "D"}
_FORMS = {1: "square", 6: "symmetric"}
_COMPLEX = (3, 4)
_SETS = frozenset({"EXTRN", "ASET", "ASET1", "OMIT", "OMIT1"})


@dataclass(slots=True)
class _Dmig:
    """A DMIG matrix while its cards are read: degrees of freedom (node, direction) of rows and columns."""

    place: str
    form: int
    kind: int
    rows: list[tuple[int, int]] = field(default_factory=list)
    columns: list[tuple[int, int]] = field(default_factory=list)
    values: list[complex] = field(default_factory=list)


def read_dmig(file: Path, deck: Path | None = None) -> dict[str, Any]:
    """Read the DMIG matrices of a punch file or deck, in small, large or free field.

    Parameters
    ----------
    file, deck : path
        The matrices; cards with the grid points, if the file has none itself.

    Returns
    -------
    dict
        Matrices ``K``, ``M``, ``C``, ``D``; ``node`` and ``direction`` of their rows; ``nodes``, ``points``
        and ``axes`` (displacement axes by node) of the grid points.

    Raises
    ------
    MatricesError
        For cards that cannot be read, with file and line, and for matrices of other forms.
    """
    try:
        bulk = BulkData.of(file, parts=True)
        found: dict[str, _Dmig] = {}
        for place, _, fields in _cards(bulk, frozenset({"DMIG"})):
            if MATRIX.fullmatch(fields[0].upper()):
                _card(found, place, fields)
        grids = read_grids(bulk)
        if not grids.numbers.size and deck is not None:
            grids = read_grids(BulkData.of(deck, parts=True))
    except (MeshError, ValueError) as reason:
        raise MatricesError(str(reason)) from reason
    dofs = sorted({dof for X in found.values() for dof in (*X.rows, *X.columns)})
    at = {dof: k for k, dof in enumerate(dofs)}
    matrices = {name: _assembled(name, X, at) for name, X in found.items()}
    return {**by_key(file, matrices), **_rows(dofs), **_places(grids)}


def _cards(bulk: BulkData, names: frozenset[str]) -> Iterator[tuple[str, str, list[str]]]:
    """Yield place, name and fields of cards."""
    for run in runs_of(bulk):
        if run.name in names:
            for first in range(run.first, run.first + run.count * run.length, run.length):
                yield bulk.place(first), run.name, fields_of(bulk, first, run.length)[1]


def _card(found: dict[str, _Dmig], place: str, fields: list[str]) -> None:
    """Read a header, or a column: name, degree of freedom, then row, direction, real and imaginary part."""
    name, fields = fields[0].upper(), [*fields, *[""] * (-len(fields) % 4)]
    try:
        if integer(fields[1] or "0") == 0:
            form, kind, polar = (integer(fields[k] or "0") for k in (2, 3, 5))
            if form not in _FORMS or kind not in (1, 2, 3, 4) or (polar and kind in _COMPLEX):
                text = (
                    f"form {form}, type {kind}, polar {polar}; read are forms 1 and 6, types 1 to 4, polar 0"
                )
                raise ValueError(text)
            if name in found:
                text = f"it is already defined at {found[name].place}"
                raise ValueError(text)
            found[name] = _Dmig(place, form, kind)
            return
        if name not in found:
            text = "its column comes before its header, whose second field is 0"
            raise ValueError(text)
        X = found[name]
        column = integer(fields[1]), integer(fields[2] or "0")
        for k in range(4, len(fields), 4):
            if fields[k]:
                X.columns.append(column)
                X.rows.append((integer(fields[k]), integer(fields[k + 1] or "0")))
                imaginary = real(fields[k + 3]) if X.kind in _COMPLEX else 0.0
                X.values.append(complex(real(fields[k + 2]), imaginary))
    except ValueError as reason:
        msg = f"{place}: DMIG {name}: {reason}"
        raise MatricesError(msg) from reason


def _assembled(name: str, X: _Dmig, at: dict[tuple[int, int], int]) -> sp.csr_array:
    """Return a matrix; a symmetric one has each entry once, above or below the diagonal."""
    i, j = (np.array([at[dof] for dof in dofs], dtype=np.int64) for dofs in (X.rows, X.columns))
    values = np.array(X.values, dtype=complex)
    if X.form != 1:
        i, j = np.minimum(i, j), np.maximum(i, j)
    if np.unique(i * len(at) + j).size != i.size:
        msg = f"{X.place}: DMIG {name} has an entry twice"
        raise MatricesError(msg)
    if X.form != 1:
        off = i != j
        i, j, values = np.r_[i, j[off]], np.r_[j, i[off]], np.r_[values, values[off]]
    values = values if X.kind in _COMPLEX else np.real(values)
    return sp.csr_array(sp.coo_array((values, (i, j)), shape=(len(at), len(at))))


def by_key(file: Path, matrices: dict[str, sp.csr_array]) -> dict[str, sp.csr_array]:
    """Return K, M, C and D of matrices with Nastran's names; a complex K gives D its imaginary part.

    Raises
    ------
    MatricesError
        If two could be one of them, or another matrix than K is complex.
    """
    found: dict[str, sp.csr_array] = {}
    names: dict[str, str] = {}
    for name, X in matrices.items():
        match = MATRIX.fullmatch(name)
        key = _KEYS[match[1]] if match else ""
        if not key or (key in "CD" and X.shape == (1, 1)):  # EXTSEOUT writes 1 x 1 for no damping
            continue
        if key in names:
            msg = f"{file.name}: {names[key]} and {name} could both be {key}; leave one of them in the file"
            raise MatricesError(msg)
        names[key], found[key] = name, X.real if np.iscomplexobj(X) else X
        imaginary = X.imag if np.iscomplexobj(X) else None
        if imaginary is not None and abs(imaginary).sum():
            if key != "K":
                msg = f"{file.name}: {name} is complex; only a stiffness may be, K + iD"
                raise MatricesError(msg)
            found["D"], names["D"] = imaginary, name
    return found


def _rows(dofs: list[tuple[int, int]]) -> dict[str, Ints]:
    table = np.array(dofs, dtype=np.int64).reshape(-1, 2)
    return {"node": np.where(table[:, 1] > 0, table[:, 0], -1), "direction": table[:, 1]}


def _places(grids: Grids) -> dict[str, Any]:
    return {"nodes": grids.numbers, "points": grids.points, "axes": grids.axes}


def read_output4(file: Path, deck: Path | None) -> dict[str, Any]:
    """Read the matrices of an OUTPUT4 file, and their rows from a deck if there is one.

    The rows are those of the analysis set in the order of the numbers of grid points and scalar points, as
    Nastran sorts them unless the deck asks for another sequence. The cards EXTRN, else ASET and ASET1, say
    which they are; without these all six of each grid point (matrices of the g-set).

    Raises
    ------
    MatricesError
        If a file cannot be read, or the rows of the deck are not as many as those of the matrices.
    """
    found: dict[str, Any] = dict(by_key(file, read_op4(file, MATRIX)))
    if deck is None or "K" not in found:
        return found
    n = found["K"].shape[0]
    try:
        bulk = BulkData.of(deck, parts=True)
        grids = read_grids(bulk)
        sets = _analysis_sets(bulk)
        scalars = {p for *_, fields in _cards(bulk, frozenset({"SPOINT"})) for p in _numbers(fields)}
    except (MeshError, ValueError) as reason:
        raise MatricesError(str(reason)) from reason
    every = {(int(p), d) for p in grids.numbers for d in range(1, 7)} | {(p, 0) for p in scalars}
    fitting = next((dofs for dofs in (*sets, every) if len(dofs) == n), None)
    if fitting is None:
        counts = ", ".join(str(len(dofs)) for dofs in (*sets, every) if dofs)
        msg = (
            f"{file.name}: the matrices have {n} rows, and the cards EXTRN, ASET and GRID of {deck.name} say "
            f"{counts or 'none'}; give a table {file.stem}.dofs.csv with the node and direction of each row"
        )
        raise MatricesError(msg)
    return {**found, **_rows(sorted(fitting)), **_places(grids)}


def _analysis_sets(bulk: BulkData) -> tuple[set[tuple[int, int]], set[tuple[int, int]]]:
    """Return the degrees of freedom of EXTRN cards, and those of ASET and ASET1 cards."""
    extrn: set[tuple[int, int]] = set()
    aset: set[tuple[int, int]] = set()
    for place, name, fields in _cards(bulk, _SETS):
        if name.startswith("OMIT"):
            msg = f"{place}: {name} is not read; give a table of the rows (.dofs.csv)"
            raise MeshError(msg)
        if name == "ASET1":
            pairs = [(p, fields[0]) for p in _numbers(fields[1:])]
        else:
            pairs = [(integer(p), c) for p, c in zip(fields[0::2], fields[1::2], strict=False) if p]
        (extrn if name == "EXTRN" else aset).update((p, int(d)) for p, c in pairs for d in c or "0")
    return extrn, aset


def _numbers(fields: list[str]) -> list[int]:
    """Return the numbers of a list with ``THRU``."""
    words = [f for f in fields if f]
    if len(words) == 3 and words[1].upper() == "THRU":
        return list(range(integer(words[0]), integer(words[2]) + 1))
    return [integer(word) for word in words]
