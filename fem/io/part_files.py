"""Files with matrices of parts, by their endings and contents, and the files next to them.

Places of nodes come from a deck.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fem.io.abaqus import read_abaqus_nodes
from fem.io.abaqus_matrices import number_rows, read_entries, read_substructure, rows_in_order
from fem.io.ansys import ansys_places
from fem.io.arrays import TableError
from fem.io.harwell_boeing import read_harwell_boeing, read_mapping
from fem.io.mat_hdf5 import HDF5_MARK, Named, read_hdf5, read_mat
from fem.io.matrix_market import read_matrix_market
from fem.io.matrix_names import matrix_files
from fem.io.nastran import read_grids
from fem.io.nastran_cards import BulkData
from fem.io.nastran_matrices import DECKS, read_dmig, read_output4
from fem.io.programs import ABAQUS, ALLOWED, ANSYS, NASTRAN, program_of
from fem.matrices import MatricesError
from fem.mesh import MeshError

HARWELL_BOEING = (".hb", ".rsa", ".rua", ".matrix")
DMIG = (".pch", ".bdf", ".nas", ".dat", ".fem")
ENDINGS = (".mtx", *DMIG, ".op4", *HARWELL_BOEING, ".mat")
"""Endings of files that :func:`read_part` reads."""

_NUMBER = frozenset("-0123456789")
"""Beginning of an entry of ``*MATRIX OUTPUT``; internal nodes of Abaqus have negative numbers."""


def read_part(path: Path, deck: Path | None = None, *, ordered: bool = True) -> dict[str, Any]:
    """Read the matrices of a part, and what the files say of their rows and of places.

    Parameters
    ----------
    path, deck : path
        The matrices; a deck with the places of nodes, instead of one with the same name.
    ordered : bool
        Whether rows without labels may be those of the deck's nodes in their order.

    Returns
    -------
    dict
        Some of ``K``, ``M``, ``C``, ``D``, ``Q``; ``node`` and ``direction`` of the rows, or ``labels``;
        ``nodes``, ``points`` and ``axes``.

    Raises
    ------
    MatricesError
        If a file is missing or cannot be read.
    """
    found = _read(path, deck, ordered)
    if "nodes" in found and "node" in found:
        known = np.isin(found["nodes"], found["node"])
        found |= {"nodes": found["nodes"][known], "points": found["points"][known]}
        used = set(found["node"].tolist())
        found["axes"] = {p: R for p, R in found.get("axes", {}).items() if p in used}
    return found


def _read(path: Path, deck: Path | None, ordered: bool) -> dict[str, Any]:
    suffix = path.suffix.lower()
    if suffix not in (".mtx", *HARWELL_BOEING) and not path.is_file():
        msg = f"{path}: there is no such file"
        raise MatricesError(msg)
    if suffix in DMIG:
        return read_dmig(path, deck or _companion(path, path.stem, DECKS, path))
    if suffix == ".op4":
        if path.with_suffix(".dofs.csv").is_file():
            return {**read_output4(path, None), **(places(deck) if deck else {})}
        return read_output4(path, deck or _companion(path, path.stem, DECKS))
    if suffix == ".mat":
        return {**_matlab(path), **(places(deck) if deck else {})}
    base, files = matrix_files(path)
    found = _mtx(path, files) if suffix == ".mtx" else _harwell_boeing(path, files)
    deck = deck or _companion(path, base, (".nodes.csv", ".inp", ".cdb"))
    known = places(deck) if deck else {}
    tables = {path.with_name(f"{name}.dofs.csv") for name in (path.stem, base)}
    unlabelled = "node" not in found and suffix == ".mtx" and _has_entries(files["K"])
    if known and ordered and unlabelled and not any(table.is_file() for table in tables):
        found |= rows_in_order(found, known["nodes"], known["points"])
    return {**found, **known}


def _companion(path: Path, base: str, endings: tuple[str, ...], but: Path | None = None) -> Path | None:
    """Return the first file next to another with a name and one of some endings."""
    files = (path.with_name(f"{base}{ending}") for ending in endings)
    return next((file for file in files if file != but and file.is_file()), None)


def places(deck: Path) -> dict[str, Any]:
    """Return ``nodes``, ``points`` and, of Nastran, ``axes`` of a deck, or of a table node, x, y, z.

    Raises
    ------
    MatricesError
        If it cannot be read.
    """
    try:
        if deck.suffix.lower() == ".csv":
            text = deck.read_text(encoding="utf-8-sig")
            table = number_rows(deck, re.sub(r"^\s*[A-Za-z#].*$", "", text, flags=re.MULTILINE), 4)
            return {"nodes": table[:, 0].astype(np.int64), "points": table[:, 1:]}
        program = program_of(deck) or (NASTRAN if deck.suffix.lower() in DECKS else None)
        if program == NASTRAN:
            grids = read_grids(BulkData.of(deck, parts=True))
            return {"nodes": grids.numbers, "points": grids.points, "axes": grids.axes}
        if program == ABAQUS:
            return dict(zip(("nodes", "points"), read_abaqus_nodes(deck), strict=True))
        if program == ANSYS:
            return ansys_places(deck)
    except MatricesError:
        raise
    except (OSError, MeshError, ValueError) as reason:
        msg = f"{deck.name}: {reason}"
        raise MatricesError(msg) from reason
    msg = f"{deck.name}: places of nodes are read from .csv and from {ALLOWED}, not '{deck.suffix}'"
    raise MatricesError(msg)


def _mtx(path: Path, files: dict[str, Path]) -> dict[str, Any]:
    """Read ``.mtx`` files: Matrix Market, or those of Abaqus."""
    if not files and path.is_file():
        if _start(path)[:1] in _NUMBER:
            msg = (
                f"{path.name}: it is one matrix of *MATRIX OUTPUT; K and M are needed, in files with names "
                "such as job_STIF1.mtx and job_MASS1.mtx"
            )
            raise MatricesError(msg)
        return read_substructure(path)
    for key in "KM":
        if key not in files:
            file = path.with_name(f"{path.stem}.{key}.mtx")
            msg = (
                f"{file}: there is no such file; '{path.name}' is short for one file for each matrix, "
                f"such as {file.name}"
            )
            raise MatricesError(msg)
    if _has_entries(files["K"]):
        return read_entries({key: file for key, file in files.items() if key != "Q"})
    return {key: read_matrix_market(file) for key, file in files.items()}


def _has_entries(file: Path) -> bool:
    """Return whether a file is one of ``*MATRIX OUTPUT``: it begins with a number or a comment of Abaqus."""
    first = _start(file)
    return first[:1] in _NUMBER or first.startswith("**")


def _start(file: Path) -> str:
    with file.open("rb") as start:
        return start.read(80).decode("latin-1").lstrip()


def _harwell_boeing(path: Path, files: dict[str, Path]) -> dict[str, Any]:
    """Read Harwell-Boeing files and the table of equations next to that of K."""
    if not {"K", "M"} <= set(files):
        msg = (
            f"{path}: a file of K and one of M are needed, such as {path.stem}.K{path.suffix} and "
            f"{path.stem}.M{path.suffix} (ANSYS: HBMAT with STIFF, and with MASS)"
        )
        raise MatricesError(msg)
    found: dict[str, Any] = {key: read_harwell_boeing(file) for key, file in files.items() if key != "Q"}
    for file in (files["K"], path):
        table = _companion(file, file.stem, (".mapping", ".MAPPING"))
        if table is not None:
            return {**found, **read_mapping(table, found["K"].shape[0])}
    return found


def _matlab(path: Path) -> dict[str, Any]:
    """Read a MATLAB file: K, M, perhaps C and D; ``labels``, or ``dofs`` (n, 2) and ``nodes`` (n, 4)."""
    try:
        with path.open("rb") as file:
            head = file.read(2056)
        hdf5 = any(head[k : k + 8] == HDF5_MARK for k in (0, 512, 1024, 2048))
        arrays = read_hdf5(path) if hdf5 else read_mat(path)
    except TableError as reason:
        raise MatricesError(str(reason)) from reason
    named: dict[str, NDArray[Any]] = {}
    for name, array in arrays.items():
        for key in ("K", "M", "C", "D", "labels", "dofs", "nodes"):
            if name.split("/")[-1] == key or name.split("/")[-2:-1] == [key]:
                named[name[name.rfind(key) :]] = _turned(array, hdf5)
    found: dict[str, Any] = {}
    for key in "KMCD":
        if key in named:
            found[key] = named[key]
        elif f"{key}/data" in named:
            data, row, start = (named[f"{key}/{part}"].ravel() for part in ("data", "ir", "jc"))
            try:
                found[key] = sp.csc_array((data, row, start), shape=(start.size - 1,) * 2)
                found[key].check_format()
            except (ValueError, TypeError) as reason:
                msg = f"{path.name}: {key} is no square sparse matrix ({reason})"
                raise MatricesError(msg) from reason
    if "labels" in named:
        found["labels"] = named["labels"].ravel()
    for key, width in (("dofs", 2), ("nodes", 4)):
        if key in named and (named[key].ndim != 2 or named[key].shape[1] != width):
            words = "node, direction (1 to 6)" if key == "dofs" else "node, x, y, z"
            msg = f"{path.name}: '{key}' has the shape {named[key].shape}; (n, {width}) is expected: {words}"
            raise MatricesError(msg)
    if "dofs" in named:
        found |= {"node": named["dofs"][:, 0].astype(int), "direction": named["dofs"][:, 1].astype(int)}
    if "nodes" in named:
        found |= {"nodes": named["nodes"][:, 0].astype(int), "points": named["nodes"][:, 1:].astype(float)}
    return found


def _turned(array: Named, hdf5: bool) -> NDArray[Any]:
    """Return an array as MATLAB shows it: version 7.3 keeps it the other way round."""
    return array.values.T if hdf5 and array.values.ndim == 2 else array.values
