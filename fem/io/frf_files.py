"""Files of FRFs: a table of readers, chosen by the first bytes of a file, or else by its ending."""

import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from fem.io.arrays import TableError, named_arrays, read_npz, typed
from fem.io.column_frf import frf_of_columns
from fem.io.faults import error_at, existing
from fem.io.frf_reading import Asked, Reading
from fem.io.mat_hdf5 import HDF5_MARK, read_hdf5, read_mat
from fem.io.named_frf import frf_of_arrays
from fem.io.uff import read_quietly

_HEAD = 4096
"""Bytes from the beginning of a file that tell its format."""


@dataclass(frozen=True, slots=True)
class FRFReader:
    """A reader of one format.

    Attributes
    ----------
    words : str
        The format in words.
    suffixes : tuple of str
        Endings of its files.
    read : callable
        From path and what the user says to the reading.
    options : tuple of str
        Fields of :class:`fem.io.frf_reading.Asked` that it uses besides kind, outputs, inputs and unit
        labels.
    begins : callable
        Whether the first bytes of a file are certainly its format.
    """

    words: str
    suffixes: tuple[str, ...]
    read: Callable[[Path, Asked], Reading]
    options: tuple[str, ...] = ()
    begins: Callable[[bytes], bool] = lambda head: False


def _uff(path: Path, asked: Asked) -> Reading:
    file = read_quietly(path, asked.kind, unit_labels=asked.unit_labels)
    if not file.frfs:
        file.frf()  # says what the file holds instead
    runs = (f"matrix {i}: {run}" for i, run in enumerate(file.frf_runs, 1) if run)
    return Reading(
        tuple(file.frfs),
        file.frf_axes,
        functions=file.functions,
        points=file.points,
        notes=(*file.notes, *file.skipped, *runs),
        names=file.frf_names,
    )


def _npz(path: Path, asked: Asked) -> Reading:
    frf, arrays = read_npz(path, asked.kind), named_arrays(path)
    gamma = typed(arrays, "coherence", path.name, "any", 3) if "coherence" in arrays else None
    if gamma is not None and gamma.shape != frf.H.shape:
        msg = f"{path.name}: the coherence has shape {gamma.shape}, H has {frf.H.shape}; they must agree"
        raise TableError(msg)
    averages = int(typed(arrays, "averages", path.name, "integer", 0)) if "averages" in arrays else None
    return Reading((frf,), coherence=None if gamma is None else gamma.astype(float), averages=averages)


def _mat(path: Path, asked: Asked) -> Reading:
    return frf_of_arrays(read_mat(path), path.name, asked)


def _hdf5(path: Path, asked: Asked) -> Reading:
    return frf_of_arrays(read_hdf5(path), path.name, asked)


def is_universal(head: bytes) -> bool:
    """Return whether a file begins with a line of -1 and one of a dataset's number, as universal files do."""
    lines = [line.strip() for line in head[:400].split(b"\n")[:2]]
    return len(lines) == 2 and lines[0] == b"-1" and lines[1][:4].rstrip(b"b ").isdigit()


READERS: tuple[FRFReader, ...] = (
    FRFReader("universal file", (".uff", ".unv", ".uf", ".ufb"), _uff, (), is_universal),
    FRFReader("NumPy archive", (".npz",), _npz, (), lambda head: head.startswith(b"PK\x03\x04")),
    FRFReader(
        "HDF5 file",
        (".h5", ".hdf5", ".hdf", ".nc"),
        _hdf5,
        ("arrays", "axes", "form"),
        lambda head: any(head[k : k + 8] == HDF5_MARK for k in (0, 512, 1024, 2048)),
    ),
    FRFReader(
        "MATLAB file, of 7.3 too",
        (".mat",),
        _mat,
        ("arrays", "axes", "form"),
        lambda head: head.startswith(b"MATLAB 5.0 MAT-file"),
    ),
    FRFReader(
        "text in columns",
        (".csv", ".txt", ".tsv", ".dat", ".asc"),
        frf_of_columns,
        ("delimiter", "header", "form", "pairs"),
    ),
)
"""All formats of FRFs."""


def reader_of(path: Path) -> FRFReader:
    """Return the reader of a file: by its first bytes where they are certain, else by its ending.

    Raises
    ------
    TableError
        If neither is known; the message lists what is.
    """
    with existing(path).open("rb") as file:
        head = file.read(_HEAD)
    suffix = path.suffix.lower()
    found = next((r for r in READERS if r.begins(head)), None)
    found = found or next((r for r in READERS if suffix in r.suffixes), None)
    if found is None:
        known = "; ".join(f"{', '.join(r.suffixes)} ({r.words})" for r in READERS)
        raise error_at(path.name, f"FRFs are read from files that end in {known}, not '{suffix}'", TableError)
    return found


def read_frfs(path: str | os.PathLike[str], asked: Asked) -> Reading:
    """Read all FRFs of a file.

    Raises
    ------
    UffError, TableError
        If the file is of no known format or cannot be read as what it is.
    """
    file = Path(path)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        reading = reader_of(file).read(file, asked)
    phase = reading.phase and any(frf.has_phase for frf in reading.frfs)
    return replace(reading, phase=phase, notes=(*reading.notes, *(str(w.message) for w in caught)))
