"""Files: universal files, arrays, meshes; nothing here imports pyuff or meshio before it reads."""

import os
from pathlib import Path
from typing import Any

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.modes import Modes
from fem.io.abaqus import read_node_sets
from fem.io.arrays import TableError, read_csv, read_npz, read_npz_modes, write_csv, write_npz
from fem.io.fields import line_axial_force, line_strain_energy, write_fields, write_modes
from fem.io.matrices import matrices_of, read_calculix, read_matrices, write_matrices
from fem.io.meshfile import read_mesh, write_mesh
from fem.io.uff import UffFile, read_uff, write_uff
from fem.io.uff_format import UffError, label_of, parse_label
from fem.matrices import Matrices, MatricesError

__all__ = [
    "Matrices",
    "MatricesError",
    "TableError",
    "UffError",
    "UffFile",
    "label_of",
    "line_axial_force",
    "line_strain_energy",
    "matrices_of",
    "parse_label",
    "read_calculix",
    "read_csv",
    "read_frf",
    "read_matrices",
    "read_mesh",
    "read_modes",
    "read_node_sets",
    "read_npz",
    "read_npz_modes",
    "read_uff",
    "write_csv",
    "write_fields",
    "write_matrices",
    "write_mesh",
    "write_modes",
    "write_npz",
    "write_uff",
]

UFF_SUFFIXES = (".uff", ".unv", ".uf", ".ufb")
"""Suffixes of universal files."""


def read_frf(path: str | os.PathLike[str], kind: FRFKind | str | None = None, **options: Any) -> FRF:
    """Read the FRFs of a file; the suffix says how.

    ``.uff``, ``.unv`` (one FRF matrix in the file), ``.npz``, ``.csv`` and ``.txt`` (see
    :func:`fem.io.arrays.read_csv` for the options).

    Raises
    ------
    UffError, TableError
        If the content of the file does not fit its suffix, or a universal file has no FRFs or several groups
        of them.
    """
    suffix = Path(path).suffix.lower()
    if suffix in (".csv", ".txt", ".tsv", ".dat"):
        return read_csv(path, kind=kind, **options)
    if options:
        msg = f"{Path(path).name}: the options {', '.join(options)} are for .csv and .txt files"
        raise TypeError(msg)
    if suffix in UFF_SUFFIXES:
        return read_uff(path, kind=kind).frf()
    if suffix == ".npz":
        return read_npz(path, kind=kind)
    msg = f"{Path(path).name}: FRFs are read from .uff, .unv, .npz, .csv and .txt files, not '{suffix}'"
    raise TableError(msg)


def read_modes(path: str | os.PathLike[str]) -> Modes:
    """Read the modes of a universal file (dataset 55) or an ``.npz`` file.

    Raises
    ------
    UffError, TableError
        If the file has no modes, several groups of them, or cannot be read.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".npz":
        return read_npz_modes(path)
    if suffix not in UFF_SUFFIXES:
        msg = f"{Path(path).name}: modes are read from .uff, .unv and .npz files, not '{suffix}'"
        raise TableError(msg)
    return read_uff(path).one_set_of_modes()
