"""FRFs and modes as arrays in ``.npz`` files, and FRFs written as tables.

Keys of an ``.npz`` file with FRFs: ``frequency`` (n_freq,) [Hz], ``H`` (n_freq, n_out, n_in), ``kind``,
``outputs``, ``inputs``, and where there are some ``base``, the inputs that are accelerations, and ``strain``,
the outputs that are strains; with modes:
``frequency`` (n_modes,) [Hz], ``shapes`` (n_dof, n_modes), and where they are known ``zeta`` (n_modes,),
``labels`` (n_dof,), ``n_rigid``, and relative standard deviations
``frequency_std``, ``zeta_std`` and ``shape_std`` (n_modes,) [-].
"""

import csv
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRF, STRAIN, TRANSMISSIBILITY, FRFError, FRFKind
from fem.analysis.modes import Modes
from fem.array_types import Floats
from fem.io.atomic import replacing
from fem.io.faults import error_at, refuse


class TableError(ValueError):
    """A file of arrays that cannot be read; the message names the file, the line and the column."""


# .npz -------------------------------------------------------------------------------------------------------


MODE_STD = ("frequency_std", "zeta_std", "shape_std")
"""Relative standard deviations that a file with modes may have; of shapes, over their root mean square."""


def write_npz(
    path: str | os.PathLike[str], data: FRF | Modes, std: Mapping[str, Floats] | None = None
) -> None:
    """Write FRFs or modes to an ``.npz`` file; nothing is lost.

    Parameters
    ----------
    path : path
    data : FRF or Modes
    std : mapping of str to ndarray (n_modes,), optional
        Relative standard deviations of modes, by the names of ``MODE_STD`` [-].
    """
    if isinstance(data, FRF):
        arrays = {
            "frequency": data.frequency,
            "H": data.H,
            "kind": np.array(str(data.kind)),
            "outputs": np.array(data.outputs, dtype=str),
            "inputs": np.array(data.inputs, dtype=str),
        }
        if data.base:
            arrays["base"] = np.array(data.base, dtype=str)
        if data.strain:
            arrays["strain"] = np.array(data.strain, dtype=str)
    else:
        arrays = {"frequency": data.frequency, "shapes": data.shapes, "n_rigid": np.array(data.n_rigid)}
        if data.zeta is not None:
            arrays["zeta"] = data.zeta
        if data.labels:
            arrays["labels"] = np.array(data.labels, dtype=str)
        arrays |= dict(std or {})
    with replacing(path) as scratch, scratch.open("wb") as file:
        np.savez_compressed(file, **arrays)


def read_npz(path: str | os.PathLike[str], kind: FRFKind | str | None = None) -> FRF:
    """Read FRFs from an ``.npz`` file; without ``outputs`` and ``inputs`` the labels are out1, …, in1, ….

    Parameters
    ----------
    path : path
    kind : FRFKind or str, optional
        Kind of the FRFs where the file does not say it.

    Raises
    ------
    TableError
        If a key is missing or the arrays do not make an FRF.
    """
    arrays, name = named_arrays(path), Path(path).name
    frequency, H = (_required(arrays, key, name, "frequency and H") for key in ("frequency", "H"))
    given = str(typed(arrays, "kind", name, "text", 0)) if "kind" in arrays else kind
    if given is None:
        msg = f"{name}: it does not say the kind of its FRFs; give kind, one of {', '.join(FRFKind)}"
        raise TableError(msg)
    outputs, inputs = (
        tuple(typed(arrays, key, name, "text", 1).tolist()) if key in arrays else None
        for key in ("outputs", "inputs")
    )
    base = typed(arrays, "base", name, "text", 1).tolist() if "base" in arrays else ()
    if given == TRANSMISSIBILITY:
        given = FRFKind.ACCELERANCE
        base = inputs or [f"in{k + 1}" for k in range(np.shape(H)[-1] if np.ndim(H) else 0)]
    strain = typed(arrays, "strain", name, "text", 1).tolist() if "strain" in arrays else ()
    return _checked(frequency, H, given, outputs, inputs, name, base, strain)


def _checked(
    frequency: Any,
    H: Any,
    kind: FRFKind | str,
    outputs: Sequence[str] | None,
    inputs: Sequence[str] | None,
    name: str,
    base: Sequence[str] = (),
    strain: Sequence[str] = (),
) -> FRF:
    try:
        return FRF.from_arrays(frequency, H, kind, outputs, inputs, base, strain)
    except (FRFError, ValueError, TypeError) as reason:
        raise error_at(name, str(reason), TableError) from reason


def read_npz_modes(path: str | os.PathLike[str]) -> Modes:
    """Read modes from an ``.npz`` file.

    Raises
    ------
    TableError
        If a key is missing or the shapes do not fit the frequencies and labels.
    """
    arrays, name = named_arrays(path), Path(path).name
    for key in ("frequency", "shapes"):
        _required(arrays, key, name, "frequency and shapes")
    frequency = typed(arrays, "frequency", name, "real", 1)
    shapes = typed(arrays, "shapes", name, "gaps", 2)
    zeta = typed(arrays, "zeta", name, "real", 1) if "zeta" in arrays else None
    labels = tuple(typed(arrays, "labels", name, "text", 1).tolist()) if "labels" in arrays else ()
    n_rigid = int(typed(arrays, "n_rigid", name, "integer", 0)) if "n_rigid" in arrays else 0
    if frequency.shape != shapes.shape[1:]:
        msg = (
            f"{name}: shapes have shape {shapes.shape} for {frequency.size} frequencies; (n_dof, n_modes) "
            "is expected"
        )
        raise TableError(msg)
    if labels and len(labels) != len(shapes):
        raise error_at(name, f"{len(labels)} labels for {len(shapes)} rows of the shapes", TableError)
    if zeta is not None and zeta.shape != frequency.shape:
        raise error_at(name, f"{zeta.size} damping ratios for {frequency.size} frequencies", TableError)
    if not 0 <= n_rigid <= frequency.size:
        msg = f"{name}: n_rigid is {n_rigid}; 0 to {frequency.size}, the number of modes, are allowed"
        raise TableError(msg)
    return Modes(frequency, shapes, zeta, labels, n_rigid)


def read_npz_mode_std(path: str | os.PathLike[str]) -> dict[str, Floats]:
    """Return the relative standard deviations that an ``.npz`` file with modes has, by ``MODE_STD``.

    Raises
    ------
    TableError
        If there is another number of them than of modes, or one is not positive.
    """
    arrays, name = named_arrays(path), Path(path).name
    n = arrays["frequency"].size if "frequency" in arrays else 0
    out = {key: typed(arrays, key, name, "real", 1) for key in MODE_STD if key in arrays}
    for key, values in out.items():
        if values.size != n or (values <= 0).any():
            msg = f"{name}: '{key}' has {values.size} values for {n} modes; one each, above 0, is needed"
            raise TableError(msg)
    return out


_VALUES = {
    "real": ("fiu", "finite real numbers"),
    "complex": ("fiuc", "finite numbers"),
    "gaps": ("fiuc", "finite numbers, or NaN where nothing was measured,"),
    "integer": ("fiu", "whole numbers"),
    "any": ("fiuc", "numbers"),
    "text": ("US", "texts"),
}
"""Contents that an array of an archive may need: NumPy's kinds of types, and the words for them."""


def typed(
    arrays: Mapping[str, NDArray[Any]],
    key: str,
    name: str,
    what: str,
    n_axes: int,
    error: type[ValueError] = TableError,
) -> NDArray[Any]:
    """Return an array of an archive with the type and the number of axes that are required.

    Parameters
    ----------
    arrays : mapping of str to ndarray
    key : str
    name : str
        The file, for the message.
    what : {"real", "complex", "integer", "any", "text"}
        Type of the values; all numbers but "any" must be finite, and bytes are texts.
    n_axes : int
        Number of axes. A single value is taken for an array of one where one axis is needed, and an array of
        one value for the value.
    error : type
        Type of the exception.
    """
    array = arrays[key]
    kinds, words = _VALUES[what]
    if array.ndim != n_axes and array.size == 1 and {array.ndim, n_axes} == {0, 1}:
        array = array.reshape((1,) * n_axes)
    found = f"{array.dtype} of shape {array.shape}"
    fits = array.dtype.kind in kinds and array.ndim == n_axes
    if fits and what == "gaps":
        fits, found = not np.isinf(array).any(), "infinite somewhere"
    elif fits and what not in ("text", "any") and not np.isfinite(array).all():
        fits, found = False, "not finite everywhere"
    elif fits and what == "integer":
        fits = bool((abs(array.astype(float)) < 2.0**53).all() and (array == np.floor(array)).all())
    if not fits:
        need = (f"one of {words}", f"a list of {words}", f"rows of {words}")[min(n_axes, 2)]
        msg = f"{name}: the array '{key}' is {found}; {need} is expected"
        raise error(msg)
    if what == "text":
        return np.char.decode(array, "latin-1") if array.dtype.kind == "S" else array
    # in double precision and this machine's byte order, as sparse matrices are in no other
    return array.astype(np.int64 if what == "integer" else np.result_type(array, float), copy=False)


def named_arrays(path: str | os.PathLike[str]) -> dict[str, NDArray[Any]]:
    """Read all arrays of an ``.npz`` file."""
    name = Path(path).name
    with Path(path).open("rb") as file:
        if file.read(2) not in (b"PK", b"\x93N"):
            raise error_at(name, "it cannot be read as .npz (it begins as no NumPy archive does)", TableError)
        file.seek(0)
        try:
            loaded: Any = np.load(file, allow_pickle=False)
            found = loaded if isinstance(loaded, np.ndarray) else dict(loaded)
        except Exception as reason:  # damaged archives raise whatever zipfile, zlib and numpy come upon
            raise error_at(name, f"it cannot be read as .npz ({reason})", TableError) from reason
    if isinstance(found, np.ndarray):
        refuse(f"{name}: it holds one bare array; an .npz file with named arrays is expected", TableError)
    return found


def _required(arrays: dict[str, NDArray[Any]], key: str, name: str, needed: str) -> NDArray[Any]:
    if key not in arrays:
        msg = (
            f"{name}: there is no array '{key}'; it has {', '.join(arrays) or 'none'}, and {needed} are "
            "needed"
        )
        raise TableError(msg)
    return arrays[key]


# Text tables ------------------------------------------------------------------------------------------------


def write_csv(path: str | os.PathLike[str], frf: FRF) -> None:
    """Write FRFs as a table: ``frequency_Hz``, then ``re(out/in)`` and ``im(out/in)`` of each.

    Nothing is lost. The first line has the kind: ``# kind: accelerance, (m/s²)/N``. Strains have their unit
    after their names: ``re(out/in) [1/N]``.

    Raises
    ------
    TableError
        For the label of a force with a slash.
    """
    bad = next((name for name in frf.inputs if "/" in name), None)
    if bad is not None:
        msg = (
            f"the force label '{bad}' has a slash, which separates response and force in the header; rename "
            "it"
        )
        raise TableError(msg)
    pairs = [(i, j) for j in range(len(frf.inputs)) for i in range(len(frf.outputs))]
    head = ["frequency_Hz"]
    for i, j in pairs:
        unit = f" [{STRAIN[0][1]}]" if frf.outputs[i] in frf.strain else ""
        head += [f"{part}({frf.outputs[i]}/{frf.inputs[j]}){unit}" for part in ("re", "im")]
    columns = [frf.frequency]
    for i, j in pairs:
        columns += [frf.H[:, i, j].real, frf.H[:, i, j].imag]
    with replacing(path) as scratch, scratch.open("w", newline="", encoding="utf-8") as file:
        moving = [name for name in frf.outputs if name not in frf.strain] or None
        file.write(f"# kind: {frf.kind}, {frf.select(moving).unit}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        writer.writerows([repr(float(v)) for v in row] for row in np.column_stack(columns))
