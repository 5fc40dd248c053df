"""FRFs and modes as arrays in ``.npz`` files, and FRFs as tables in text files.

Keys of an ``.npz`` file with FRFs: ``frequency`` (n_freq,) [Hz], ``H`` (n_freq, n_out, n_in), ``kind``,
``outputs``, ``inputs``; with modes: ``frequency`` (n_modes,) [Hz], ``shapes`` (n_dof, n_modes), and where
they are known ``zeta`` (n_modes,), ``labels`` (n_dof,) and ``n_rigid``.
"""

import csv
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRF, WITHOUT_PHASE, FRFError, FRFKind
from fem.analysis.modes import Modes
from fem.io.atomic import replacing

_CELL = re.compile(r"(re|im)\((.+)/([^/]+)\)")
_DELIMITERS = (";", "\t", ",", " ")


class TableError(ValueError):
    """A file of arrays that cannot be read; the message names the file, the line and the column."""


# .npz -------------------------------------------------------------------------------------------------------


def write_npz(path: str | os.PathLike[str], data: FRF | Modes) -> None:
    """Write FRFs or modes to an ``.npz`` file; nothing is lost."""
    if isinstance(data, FRF):
        arrays = {
            "frequency": data.frequency,
            "H": data.H,
            "kind": np.array(str(data.kind)),
            "outputs": np.array(data.outputs, dtype=str),
            "inputs": np.array(data.inputs, dtype=str),
        }
    else:
        arrays = {"frequency": data.frequency, "shapes": data.shapes, "n_rigid": np.array(data.n_rigid)}
        if data.zeta is not None:
            arrays["zeta"] = data.zeta
        if data.labels:
            arrays["labels"] = np.array(data.labels, dtype=str)
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
    return _checked(frequency, H, given, outputs, inputs, name)


def _checked(
    frequency: Any,
    H: Any,
    kind: FRFKind | str,
    outputs: Sequence[str] | None,
    inputs: Sequence[str] | None,
    name: str,
) -> FRF:
    try:
        return FRF.from_arrays(frequency, H, kind, outputs, inputs)
    except (FRFError, ValueError, TypeError) as reason:
        msg = f"{name}: {reason}"
        raise TableError(msg) from reason


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
    n_rigid = int(typed(arrays, "n_rigid", name, "whole", 0)) if "n_rigid" in arrays else 0
    if frequency.shape != shapes.shape[1:]:
        msg = (
            f"{name}: shapes have shape {shapes.shape} for {frequency.size} frequencies; (n_dof, n_modes) "
            "is expected"
        )
        raise TableError(msg)
    if labels and len(labels) != len(shapes):
        msg = f"{name}: {len(labels)} labels for {len(shapes)} rows of the shapes"
        raise TableError(msg)
    if zeta is not None and zeta.shape != frequency.shape:
        msg = f"{name}: {zeta.size} damping ratios for {frequency.size} frequencies"
        raise TableError(msg)
    if not 0 <= n_rigid <= frequency.size:
        msg = f"{name}: n_rigid is {n_rigid}; 0 to {frequency.size}, the number of modes, are allowed"
        raise TableError(msg)
    return Modes(frequency, shapes, zeta, labels, n_rigid)


_VALUES = {
    "real": ("fiu", "finite real numbers"),
    "complex": ("fiuc", "finite numbers"),
    "gaps": ("fiuc", "finite numbers, or NaN where nothing was measured,"),
    "whole": ("fiu", "whole numbers"),
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
    what : {"real", "complex", "whole", "any", "text"}
        Type of the values; all numbers but "any" must be finite, and bytes are texts.
    n_axes : int
        Number of axes. A single value is taken for an array of one where one axis is needed, and an array of
        one value for the value.
    error : type
        Type of the exception.

    Raises
    ------
    TableError
        If the array is of another type or has another number of axes.
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
    elif fits and what == "whole":
        fits = bool((abs(array.astype(float)) < 2.0**53).all() and (array == np.floor(array)).all())
    if not fits:
        need = (f"one of {words}", f"a list of {words}", f"rows of {words}")[min(n_axes, 2)]
        msg = f"{name}: the array '{key}' is {found}; {need} is expected"
        raise error(msg)
    if what == "text":
        return np.char.decode(array, "latin-1") if array.dtype.kind == "S" else array
    return array.astype(np.int64) if what == "whole" else array


def named_arrays(path: str | os.PathLike[str]) -> dict[str, NDArray[Any]]:
    """Read all arrays of an ``.npz`` file.

    Raises
    ------
    TableError
        If it is no archive of named arrays.
    """
    name = Path(path).name
    with Path(path).open("rb") as file:
        try:
            loaded: Any = np.load(file, allow_pickle=False)
            found = loaded if isinstance(loaded, np.ndarray) else dict(loaded)
        except Exception as reason:  # damaged archives raise whatever zipfile, zlib and numpy come upon
            msg = f"{name}: it cannot be read as .npz ({reason})"
            raise TableError(msg) from reason
    if isinstance(found, np.ndarray):
        msg = f"{name}: it holds one bare array; an .npz file with named arrays is expected"
        raise TableError(msg)
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

    Nothing is lost. The first line says the kind: ``# kind: accelerance, (m/s²)/N``.

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
        head += [f"{part}({frf.outputs[i]}/{frf.inputs[j]})" for part in ("re", "im")]
    columns = [frf.frequency]
    for i, j in pairs:
        columns += [frf.H[:, i, j].real, frf.H[:, i, j].imag]
    with replacing(path) as scratch, scratch.open("w", newline="", encoding="utf-8") as file:
        file.write(f"# kind: {frf.kind}, {frf.kind.unit}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        writer.writerows([repr(float(v)) for v in row] for row in np.column_stack(columns))


def read_csv(
    path: str | os.PathLike[str],
    kind: FRFKind | str | None = None,
    *,
    outputs: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    delimiter: str | None = None,
    header: bool | None = None,
    form: str = "auto",
) -> FRF:
    """Read FRFs from a text table, one line for each frequency.

    The first column is the frequency [Hz]. Then come the FRFs: the responses to the first force, those to the
    second, and so on. Lines that are empty or begin with ``#`` or ``%`` are passed over.

    Parameters
    ----------
    path : path
    kind : FRFKind or str, optional
        Kind of the FRFs; a line ``# kind: mobility`` in the file goes before it.
    outputs, inputs : sequence of str, optional
        Labels of the responses and of the forces. Without them they come from a header as :func:`write_csv`
        writes it, or else each column is a response (out1, …) to one force (in1).
    delimiter : str, optional
        ``";"``, ``","``, tab or blank; found from the first line unless given. With ``;`` and tab a comma in
        a number is a decimal comma.
    header : bool, optional
        Whether the first line holds names; found from it unless given.
    form : {"auto", "complex", "re-im", "magnitude-degrees"}
        Columns of an FRF: one complex number such as ``1.2-3.4j``, real and imaginary part, or
        magnitude and phase. ``"auto"`` takes complex numbers where there is a ``j`` or ``i``, else real and
        imaginary parts.

    Raises
    ------
    TableError
        For a cell that is no number, a line with too few or too many cells, or columns that do not fit the
        labels; the message names line and column.
    """
    if form not in ("auto", "complex", "re-im", "magnitude-degrees"):
        msg = f"the form is '{form}'; allowed are auto, complex, re-im, magnitude-degrees"
        raise TableError(msg)
    table = _Table(Path(path), delimiter, header)
    stated = table.stated_kind or kind
    if stated is None:
        msg = f"{table.name}: it does not say the kind of its FRFs; give kind, one of {', '.join(FRFKind)}"
        raise TableError(msg)
    frequency, values = table.numbers(form)
    outputs, inputs, order = _labels(table, values.shape[1], outputs, inputs)
    H = values[:, order].reshape(len(frequency), len(inputs), len(outputs)).transpose(0, 2, 1)
    return _checked(frequency, H, stated, outputs, inputs, table.name)


class _Table:
    """The cells of a text table."""

    def __init__(self, path: Path, delimiter: str | None, header: bool | None) -> None:
        self.name = path.name
        raw = path.read_bytes()
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("latin-1")
        self.stated_kind = self._kind_in(text)
        numbered = [(k, line.strip()) for k, line in enumerate(text.splitlines(), start=1)]
        self.rows = [(k, line) for k, line in numbered if line and line[0] not in "#%"]
        if not self.rows:
            msg = f"{self.name}: the file has no lines of data"
            raise TableError(msg)
        self.delimiter = delimiter or self._sniffed()
        first = self._cells(self.rows[0][1])
        named = header if header is not None else not self._is_number(first[0])
        self.head = first if named else None
        self.body = [(k, self._cells(line)) for k, line in self.rows[1 if named else 0 :]]
        if not self.body:
            msg = f"{self.name}: the file has a header and no lines of data"
            raise TableError(msg)

    def _kind_in(self, text: str) -> str | None:
        found = re.search(r"^[#%]\s*kind:\s*([A-Za-z]+)", text, re.MULTILINE)
        return found.group(1).lower() if found else None

    def _sniffed(self) -> str:
        line = self.rows[min(1, len(self.rows) - 1)][1]  # the second line is data, with a header or without
        found = next((d for d in _DELIMITERS if d in line), None)
        if found is None:
            msg = (
                f"{self.name}: line {self.rows[0][0]} has one column; frequency and FRFs are expected, by "
                "; , tab or blank"
            )
            raise TableError(msg)
        return found

    def _cells(self, line: str) -> list[str]:
        if self.delimiter == " ":
            return line.split()
        cells = [c.strip() for c in next(csv.reader([line], delimiter=self.delimiter))]
        return cells[:-1] if len(cells) > 1 and not cells[-1] else cells

    def _is_number(self, text: str) -> bool:
        try:
            self._real(text)
        except ValueError:
            return False
        return True

    def _real(self, text: str) -> float:
        if self.delimiter in (";", "\t"):
            text = text.replace(",", ".")
        return float(text.removesuffix("+0j"))  # a frequency that was written as a complex number

    def _complex(self, text: str) -> complex:
        if self.delimiter in (";", "\t"):
            text = text.replace(",", ".")
        return complex(text.replace(" ", "").replace("*", "").replace("i", "j").replace("I", "j"))

    def numbers(self, form: str) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        """Return frequencies and FRFs (n_freq, n_frfs)."""
        width = len(self.body[0][1])
        if form == "auto":
            form = "complex" if any(c[-1:].lower() in ("j", "i", ")") for c in self.body[0][1]) else "re-im"
        if width < 2 or (form != "complex" and width % 2 == 0):
            pair = {"magnitude-degrees": "magnitude and degrees"}.get(form, "real and imaginary part")
            need = (
                "at least one complex number" if form == "complex" else f"two columns for each FRF, {pair},"
            )
            msg = (
                f"{self.name}: line {self.body[0][0]} has {width} columns; the frequency and "
                f"{need} are expected{'' if form == 'complex' else f': {WITHOUT_PHASE}'}"
            )
            raise TableError(msg)
        frequency = np.empty(len(self.body))
        cells = np.empty((len(self.body), width - 1), dtype=complex if form == "complex" else float)
        parse = self._complex if form == "complex" else self._real
        for row, (line, texts) in enumerate(self.body):
            if len(texts) != width:
                msg = f"{self.name}: line {line} has {len(texts)} columns, the first line of data has {width}"
                raise TableError(msg)
            frequency[row] = self._cell(line, 0, texts[0], self._real)
            cells[row] = [self._cell(line, k, text, parse) for k, text in enumerate(texts[1:], start=1)]
        if form == "complex":
            return frequency, cells
        if form == "re-im":
            return frequency, cells[:, 0::2] + 1j * cells[:, 1::2]
        return frequency, cells[:, 0::2] * np.exp(1j * np.deg2rad(cells[:, 1::2]))

    def _cell(self, line: int, column: int, text: str, parse: Any) -> Any:
        try:
            return parse(text)
        except ValueError:
            msg = (
                f"{self.name}: line {line}, column {column + 1} has {text[:30]!r} where a number is expected"
            )
            raise TableError(msg) from None


def _labels(
    table: _Table, n: int, outputs: Sequence[str] | None, inputs: Sequence[str] | None
) -> tuple[list[str], list[str], list[int]]:
    """Return the labels, and which column each FRF is in, force by force."""
    pairs = _named_pairs(table.head, n)
    if outputs is None and inputs is None and pairs is not None:
        outputs, inputs = (list(dict.fromkeys(pair[k] for pair in pairs)) for k in (0, 1))
        where = {pair: k for k, pair in enumerate(pairs)}
        missing = [f"{o}/{i}" for i in inputs for o in outputs if (o, i) not in where]
        if missing or len(where) < n:
            twice = next((f"{o}/{i}" for o, i in pairs if pairs.count((o, i)) > 1), "")
            what = f"lacks {', '.join(missing[:5])}" if missing else f"names {twice} twice"
            msg = f"{table.name}: the header {what}; each response to each force is expected once"
            raise TableError(msg)
        return list(outputs), list(inputs), [where[o, i] for i in inputs for o in outputs]
    n_in = len(inputs) if inputs is not None else max(1, n // len(outputs) if outputs else 1)
    inputs = list(inputs) if inputs is not None else [f"in{k + 1}" for k in range(n_in)]
    outputs = (
        list(outputs) if outputs is not None else [f"out{k + 1}" for k in range(n // max(1, len(inputs)))]
    )
    if len(outputs) * len(inputs) != n:
        msg = (
            f"{table.name}: it has {n} FRFs for {len(outputs)} responses and {len(inputs)} forces; "
            f"{len(outputs) * len(inputs)} are expected"
        )
        raise TableError(msg)
    return outputs, inputs, list(range(n))


def _named_pairs(head: list[str] | None, n: int) -> list[tuple[str, str]] | None:
    """Read a header of re(…) and im(…) names."""
    if head is None or len(head) != 2 * n + 1:
        return None
    found = [_CELL.fullmatch(name) for name in head[1:]]
    pairs: list[tuple[str, str]] = []
    for re_name, im_name in zip(found[0::2], found[1::2], strict=True):
        if re_name is None or im_name is None or re_name.groups()[1:] != im_name.groups()[1:]:
            return None
        if (re_name.group(1), im_name.group(1)) != ("re", "im"):
            return None
        pairs.append((re_name.group(2), re_name.group(3)))
    return pairs
