"""FRFs and modes of a file of any format."""

import os
from pathlib import Path
from typing import Any

from fem.analysis.frf import FRF, WITHOUT_PHASE, FRFKind
from fem.analysis.modes import Modes
from fem.io.arrays import TableError, read_npz_modes
from fem.io.faults import error_at, existing
from fem.io.frf_files import READERS, read_frfs, reader_of
from fem.io.frf_reading import Asked
from fem.io.uff import read_uff

UFF_SUFFIXES = (".uff", ".unv", ".uf", ".ufb")
"""Suffixes of universal files."""


def read_frf(path: str | os.PathLike[str], kind: FRFKind | str | None = None, **options: Any) -> FRF:
    """Read the FRFs of a file; its content, or else its ending, says how.

    Universal files, ``.npz``, text in columns, MATLAB files and HDF5: the table ``READERS`` of
    :mod:`fem.io.frf_files`. Options are the fields of :class:`fem.io.frf_reading.Asked`, such as
    ``outputs``, ``inputs``, ``form``, ``arrays`` and ``axes``.

    Raises
    ------
    UffError, TableError
        If the file cannot be read as what it is, has amplitudes without phase, or has no FRFs or several
        groups of them.
    """
    file = Path(path)
    reader = reader_of(file)
    allowed = ("outputs", "inputs", "unit_labels", *reader.options)
    if reader.words in ("universal file", "NumPy archive"):
        allowed = ("unit_labels",) if reader.words == "universal file" else ()
    wrong = [key for key in options if key not in allowed]
    if wrong:
        other = "; ".join(f"{', '.join(r.options)} for {r.words}" for r in READERS if r.options)
        msg = f"{file.name}: the options {', '.join(wrong)} are not for a {reader.words}; there are {other}"
        raise TypeError(msg)
    if reader.words == "universal file":
        return read_uff(path, kind=kind, **options).frf()
    reading = read_frfs(file, Asked(kind, **options))
    if not reading.phase:
        raise error_at(file.name, WITHOUT_PHASE, TableError)
    return reading.frfs[0]


def read_modes(path: str | os.PathLike[str]) -> Modes:
    """Read the modes of a universal file (dataset 55) or an ``.npz`` file.

    Raises
    ------
    UffError, TableError
        If the file has no modes, several groups of them, or cannot be read.
    """
    suffix = existing(path).suffix.lower()
    if suffix == ".npz":
        return read_npz_modes(path)
    if suffix not in UFF_SUFFIXES:
        msg = f"{Path(path).name}: modes are read from .uff, .unv and .npz files, not '{suffix}'"
        raise TableError(msg)
    return read_uff(path).one_set_of_modes()
