"""Named arrays of MATLAB files and HDF5 files, with the labels of their axes where they have some."""

import faulthandler
import os
import signal
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.io.arrays import TableError
from fem.io.faults import error_at, refuse
from fem.io.frf_reading import optional
from fem.io.mat5 import read_mat5

HDF5_MARK = b"\x89HDF\r\n\x1a\n"
_UNIT_KEYS = ("units", "unit", "unit_string", "ni_unitdescription")
"""Attributes that hold the unit of an array, in small letters."""


@dataclass(frozen=True, slots=True, eq=False)
class Named:
    """An array of a file.

    Attributes
    ----------
    values : ndarray, numbers, or texts as ``str``
    axes : tuple of str, names of its axes; empty where the file gives none
    unit : str
    scales : mapping of str to ndarray, values along its axes by the names of these
    attributes : mapping of str to object, numbers and texts that the file has with the array
    """

    values: NDArray[Any]
    axes: tuple[str, ...] = ()
    unit: str = ""
    scales: dict[str, NDArray[Any]] = field(default_factory=dict)
    attributes: dict[str, Any] = field(default_factory=dict)


def read_mat(path: Path) -> dict[str, Named]:
    """Return the arrays of a MATLAB file up to version 7, members of structures as ``structure/member``."""
    return {name: Named(values) for name, values in read_mat5(path).items()}


def read_hdf5(path: Path) -> dict[str, Named]:
    """Return the arrays of an HDF5 file, or of a MATLAB file of version 7.3, by their paths.

    Arrays of MATLAB are turned to its order of axes.
    """
    h5py = optional("h5py", path.name)
    if (end := end_of_trial(partial(_arrays, h5py, path))) is not None:
        msg = f"{path.name}: it cannot be read as HDF5; the file is damaged (the library ends with {end})"
        raise TableError(msg)
    try:
        return _arrays(h5py, path)
    except Exception as reason:  # damaged files raise whatever the library comes upon
        raise error_at(path.name, f"it cannot be read as HDF5 ({_short(reason)})", TableError) from reason


def _arrays(h5py: Any, path: Path) -> dict[str, Named]:
    out: dict[str, Named] = {}
    # Deflate makes data smaller by this factor at most (zlib's documentation, "maximum compression factor")
    most = 1032 * path.stat().st_size
    with h5py.File(path, "r") as file:

        def visit(key: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset) and not key.startswith("#"):
                if item.size is not None and item.size * item.dtype.itemsize > most:
                    refuse(f"{key} would have {item.size * item.dtype.itemsize} bytes, too many for the file")
                found = _dataset(h5py, file, item)
                if found is not None:
                    out[key] = found

        file.visititems(visit)
    return out


def _dataset(h5py: Any, file: Any, item: Any) -> Named | None:
    """Return an array of an HDF5 file; None for values that are neither numbers nor texts."""
    kind = item.attrs.get("MATLAB_class")
    matlab = kind.decode("latin-1") if isinstance(kind, bytes) else ""
    if matlab and "MATLAB_empty" in item.attrs:
        return None
    values = item[()]
    if matlab == "cell":
        texts = [_text_of(file[reference][()]) for reference in np.asarray(values).T.reshape(-1)]
        return Named(np.array(texts, dtype=str)) if texts and all(texts) else None
    if matlab == "char":
        return Named(np.array([_text_of(values)], dtype=str))
    if h5py.check_string_dtype(item.dtype) is not None:
        strings = np.asarray(item.asstr(errors="replace")[()], dtype=object)
        return Named(np.array([str(s) for s in strings.reshape(-1)], dtype=str))
    array = np.asarray(values)
    if array.dtype.names and set(array.dtype.names) >= {"real", "imag"}:
        array = array["real"] + 1j * array["imag"]
    elif array.dtype.names and set(array.dtype.names) >= {"r", "i"}:
        array = array["r"] + 1j * array["i"]
    if array.dtype.kind not in "fiucb":
        return None
    names, scales = _dimensions(h5py, item)
    keys = {str(key).lower(): str(key) for key in item.attrs}
    unit = next((u for key in _UNIT_KEYS if key in keys and (u := _attribute(item, keys[key]))), "")
    attributes = {str(key): value for key, value in item.attrs.items() if np.size(value) == 1}
    return Named(array.T if matlab else array, names[::-1] if matlab else names, unit, scales, attributes)


def _dimensions(h5py: Any, item: Any) -> tuple[tuple[str, ...], dict[str, NDArray[Any]]]:
    """Return the names of an array's axes, all or none, and the values along them."""
    names: list[str] = []
    scales: dict[str, NDArray[Any]] = {}
    for dim in item.dims:
        scale = next((s for s in dim.values() if isinstance(s, h5py.Dataset)), None)
        name = dim.label or ("" if scale is None else scale.name.rpartition("/")[2])
        names.append(name)
        if scale is not None and name and scale.shape == (item.shape[len(names) - 1],):
            texts = h5py.check_string_dtype(scale.dtype) is not None
            scales[name] = (
                np.array([str(s) for s in scale.asstr()[()]], str) if texts else np.asarray(scale[()])
            )
    return (tuple(names) if all(names) else ()), scales


def _text_of(values: Any) -> str:
    """Return a text of MATLAB, which HDF5 holds as numbers of characters."""
    codes = np.asarray(values)
    return "".join(chr(int(c)) for c in codes.T.reshape(-1)).strip() if codes.dtype.kind in "ui" else ""


def _attribute(item: Any, key: str) -> str:
    value = item.attrs.get(key, "")
    value = np.ravel(value)[0] if isinstance(value, np.ndarray) and value.size == 1 else value
    value = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
    return str(value) if isinstance(value, str) else ""


def _short(reason: BaseException) -> str:
    return " ".join(str(reason).split())[:120] or type(reason).__name__


# Try compiled readers in a separate process first: a damaged file may end it --------------------------------


MOST_SECONDS = 120
"""Processor time of a trial [s]."""


def end_of_trial(read: Callable[[], object]) -> str | None:
    """Return the signal that ends a forked process which reads a file; None if it ends by itself.

    An exception of the trial counts as an end by itself: the caller comes upon it again. Systems that do not
    fork have no trial.
    """
    if not hasattr(os, "fork"):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads: the trial calls the reader alone
        try:
            pid = os.fork()
        except OSError:  # too many processes
            return None
    if pid == 0:
        _try(read)
    _, status = os.waitpid(pid, 0)
    return signal.Signals(os.WTERMSIG(status)).name if os.WIFSIGNALED(status) else None


def _try(read: Callable[[], object]) -> None:
    """Read quietly, and end this process whatever comes."""
    import resource

    try:
        faulthandler.disable()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_CPU, (MOST_SECONDS, MOST_SECONDS + 1))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        quiet = os.open(os.devnull, os.O_WRONLY)
        for stream in (1, 2):
            os.dup2(quiet, stream)
        with suppress(BaseException):
            read()
    finally:
        os._exit(0)
