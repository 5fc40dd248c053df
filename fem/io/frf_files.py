"""Files of FRFs: a table of readers, chosen by the first bytes of a file, or else by its ending."""

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fem.analysis.frf import FRF, WITHOUT_PHASE, FRFKind
from fem.analysis.modes import Modes
from fem.io.arrays import TableError, named_arrays, read_npz, read_npz_modes, typed
from fem.io.column_frf import frf_of_columns
from fem.io.faults import error_at, existing
from fem.io.frf_labels import matrix_of
from fem.io.frf_reading import Asked, Reading
from fem.io.mat_hdf5 import HDF5_MARK, read_hdf5, read_mat
from fem.io.named_frf import frf_of_arrays
from fem.io.uff import read_quietly, read_uff

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


# FRFs of several files, such as one for each pair, as one matrix --------------------------------------------


def joined(readings: Sequence[Reading], names: Sequence[str]) -> Reading:
    """Return the FRFs of several files as one matrix.

    Parameters
    ----------
    readings : sequence of Reading
        With one matrix each.
    names : sequence of str
        Their files, for messages.
    """
    for reading, name in zip(readings, names, strict=True):
        if len(reading.frfs) != 1:
            msg = f"{name}: it has {len(reading.frfs)} matrices of FRFs; of several files each must have one"
            raise TableError(msg)
    frfs = [reading.frfs[0] for reading in readings]
    first = frfs[0]
    for frf, reading, name in zip(frfs, readings, names, strict=True):
        same = frf.n_freq == first.n_freq and np.allclose(frf.frequency, first.frequency, rtol=1e-6, atol=0)
        if not same:
            msg = (
                f"{name}: it has {frf.n_freq} lines from {frf.frequency[0]:g} to {frf.frequency[-1]:g} Hz, "
                f"{names[0]} {first.n_freq} from {first.frequency[0]:g} to {first.frequency[-1]:g} Hz; FRFs "
                "of one matrix need the same lines"
            )
            raise TableError(msg)
        if frf.kind != first.kind or reading.phase != readings[0].phase:
            msg = (
                f"{name}: its FRFs are {_words(reading)}, those of {names[0]} {_words(readings[0])}; one "
                "kind is needed"
            )
            raise TableError(msg)
    where: dict[tuple[str, str], tuple[int, int, int]] = {}
    for k, frf in enumerate(frfs):
        for i, output in enumerate(frf.outputs):
            for j, force in enumerate(frf.inputs):
                if (output, force) in where:
                    msg = (
                        f"{names[k]}: {output}/{force} is in {names[where[output, force][0]]}, too; give "
                        "pairs, response/force of each file"
                    )
                    raise TableError(msg)
                where[output, force] = k, i, j
    outputs, inputs, missing = matrix_of(where)
    if missing:
        msg = (
            f"the files {', '.join(names[:4])}{' …' if len(names) > 4 else ''} lack "
            f"{', '.join(missing[:5])}; each response to each force is needed once"
        )
        raise TableError(msg)
    H = np.empty((first.n_freq, len(outputs), len(inputs)), dtype=complex)
    known = [r.coherence is not None for r in readings]
    gamma = np.full(H.shape, np.nan)
    for (output, force), (k, i, j) in where.items():
        at = outputs.index(output), inputs.index(force)
        H[:, at[0], at[1]] = frfs[k].H[:, i, j]
        coherence = readings[k].coherence
        if coherence is not None:
            gamma[:, at[0], at[1]] = coherence[:, i, j]
    base = [name for name in inputs if any(name in frf.base for frf in frfs)]
    strain = [name for name in outputs if any(name in frf.strain for frf in frfs)]
    labels = tuple(dict.fromkeys(label for r in readings for group in r.axes for label in group))
    return Reading(
        (FRF.from_arrays(first.frequency, H, first.kind, outputs, inputs, base, strain),),
        (labels,) if labels else (),
        readings[0].phase,
        gamma if any(known) else None,
        readings[0].averages,
        tuple(f for r in readings for f in r.functions),
        next((r.points for r in readings if r.points is not None), None),
        tuple(f"{name}: {note}" for r, name in zip(readings, names, strict=True) for note in r.notes),
    )


def _words(reading: Reading) -> str:
    return f"{reading.frfs[0].kind}{'' if reading.phase else ' without phase'}"


# FRFs and modes of a file of any format ---------------------------------------------------------------------


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
