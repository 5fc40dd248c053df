"""Universal files (UFF, ``.uff`` and ``.unv``): datasets 15, 55, 58, 58b, 82, 151, 164, 2411 and 2412.

pyuff decodes the text of all of them but 55. Read here are the framing and the binary values (pyuff trusts neither the
byte count nor the precision that a header states, and stops without a place where they are wrong) and dataset 55 (pyuff
knows no complex shapes with rotations). Lengths and forces come out in SI, by the units of dataset 164.
"""

import os
import re
import tempfile
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.frf import FRF, FRFError, FRFKind
from fem.io.uff_format import Block, UffError, label_of, parse_label, split_blocks
from fem.io.uff_write import write_uff
from fem.mesh import Mesh, MeshError
from fem.modes import Modes

__all__ = [
    "Element",
    "Function",
    "Header",
    "Points",
    "TraceLine",
    "UffError",
    "UffFile",
    "Units",
    "label_of",
    "parse_label",
    "read_uff",
    "write_uff",
]

FUNCTION_TYPES = (
    "general",
    "time response",
    "auto spectrum",
    "cross spectrum",
    "frequency response function",
    "transmissibility",
    "coherence",
    "auto correlation",
    "cross correlation",
    "power spectral density",
    "energy spectral density",
    "probability density function",
    "spectrum",
)
"""Names of the function types of dataset 58, by number; higher ones have a number only."""

_FRF = 4
_KINDS = {8: FRFKind.RECEPTANCE, 11: FRFKind.MOBILITY, 12: FRFKind.ACCELERANCE}
_FORCES = (9, 13)
_LINE_ELEMENTS = (11, 21, 22, 23, 24)
_SI_LABEL = re.compile(r"\(?(m|g|rad)([/.*]?s(\^|\*\*)?[-]?[12²]?)?\)?([/.*]\(?(n|nm|n\.?m|n\*m)\)?)?|n|n[.*]?m")


@dataclass(frozen=True, slots=True)
class Header:
    """Dataset 151: where the file comes from."""

    model: str = "NONE"
    description: str = "NONE"
    program: str = "NONE"
    created: str = ""


@dataclass(frozen=True, slots=True)
class Units:
    """Dataset 164: value in SI = value in the file / factor.

    Attributes
    ----------
    code : int
        1 for m and N, 5 for mm and mN, 9 for the user's own, 10 for mm and N, …
    description : str
        For documentation only.
    length, force : float
        Factors of lengths and forces [file unit per m, file unit per N].
    """

    code: int = 1
    description: str = "m, N"
    length: float = 1.0
    force: float = 1.0

    @property
    def mass(self) -> float:
        """One mass unit of the file [kg]."""
        return self.length / self.force


@dataclass(frozen=True, slots=True, eq=False)
class Function:
    """A dataset 58 or 58b, in the units of the file.

    Attributes
    ----------
    function_type : int
        Its number in the format: 1 time response, 4 frequency response function, 6 coherence, 9 power spectral density.
    response, reference : str
        Labels of the degrees of freedom, such as ``"12Z+"``; ``"0S"`` where the file gives none.
    response_name, reference_name : str
        Entity names; empty where there is none.
    x : ndarray (n,)
        Abscissa: time [s], frequency [Hz], …
    values : ndarray (n,)
        Ordinate, real or complex.
    x_type, ordinate_type, denominator_type : int
        Specific data types: 8 displacement, 11 velocity, 12 acceleration, 13 force, 17 time, 18 frequency, 0 unknown.
    x_unit, unit, denominator_unit : str
        Labels of the units; empty where there is none.
    title : tuple of str
        The five lines of text.
    load_case, version : int
        Numbers that tell runs apart.
    place : str
        Dataset and line in the file.
    """

    function_type: int
    response: str
    reference: str
    response_name: str
    reference_name: str
    x: NDArray[np.float64]
    values: NDArray[Any]
    x_type: int
    ordinate_type: int
    denominator_type: int
    x_unit: str
    unit: str
    denominator_unit: str
    title: tuple[str, ...]
    load_case: int
    version: int
    place: str

    @property
    def type_name(self) -> str:
        """The function type in words."""
        known = self.function_type < len(FUNCTION_TYPES)
        return FUNCTION_TYPES[self.function_type] if known else f"function of type {self.function_type}"

    @property
    def kind(self) -> FRFKind | None:
        """Kind of the FRF by its data types; None where they do not say."""
        return _KINDS.get(self.ordinate_type) if self.denominator_type in _FORCES else None


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Points of datasets 15 and 2411.

    Attributes
    ----------
    labels : ndarray of int (n,)
        Node numbers of the file.
    coordinates : ndarray (n, 3)
        Coordinates [m].
    """

    labels: NDArray[np.int64]
    coordinates: NDArray[np.float64]

    def at(self, node: int) -> NDArray[np.float64]:
        """Return the coordinates of a node, shape (3,) [m].

        Raises
        ------
        UffError
            If the file has no such node.
        """
        found = np.flatnonzero(self.labels == node)
        if not found.size:
            msg = f"there is no node {node}; the file has {self.labels.size} nodes"
            raise UffError(msg)
        return self.coordinates[found[-1]]


@dataclass(frozen=True, slots=True)
class TraceLine:
    """Dataset 82: polylines through nodes; the pen is lifted between ``strokes``."""

    number: int
    name: str
    strokes: tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True)
class Element:
    """An element of dataset 2412; descriptors 11 and 21 to 24 are rods and beams."""

    number: int
    descriptor: int
    property: int
    material: int
    nodes: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class UffFile:
    """What a universal file holds.

    Attributes
    ----------
    name : str
        File name.
    frfs : tuple of FRF
        Each a complete matrix; several where kind, frequencies, runs or unit labels differ, or the matrix has holes.
    frf_units : tuple of (str, str)
        Unit labels of response and force of each FRF as the file has them, for instance ``("g", "N")``.
    functions : tuple of Function
        Everything else of dataset 58: time data, spectra, coherences, and FRFs of unknown kind.
    modes : tuple of Modes
        Shapes of dataset 55; several where nodes differ.
    points : Points or None
    trace_lines : tuple of TraceLine
    elements : tuple of Element
    header : Header or None
    units : Units or None
    skipped : tuple of str
        One line for each dataset that was not read or not used, saying why.
    """

    name: str
    frfs: tuple[FRF, ...] = ()
    frf_units: tuple[tuple[str, str], ...] = ()
    functions: tuple[Function, ...] = ()
    modes: tuple[Modes, ...] = ()
    points: Points | None = None
    trace_lines: tuple[TraceLine, ...] = ()
    elements: tuple[Element, ...] = ()
    header: Header | None = None
    units: Units | None = None
    skipped: tuple[str, ...] = ()

    def frf(self) -> FRF:
        """Return the one FRF matrix of the file.

        Raises
        ------
        UffError
            If there is none, or several.
        """
        if len(self.frfs) == 1:
            return self.frfs[0]
        if self.frfs:
            msg = f"{self.name}: {len(self.frfs)} groups of FRFs, use read_uff and choose one:\n" + "\n".join(
                f"  {k}: {frf.kind}, {frf.n_freq} lines to {frf.frequency[-1]:g} Hz, "
                f"responses {', '.join(frf.outputs)}, forces {', '.join(frf.inputs)}"
                for k, frf in enumerate(self.frfs)
            )
            raise UffError(msg)
        msg = f"{self.name}: no FRFs that can be used; it holds {self.contents}"
        reasons = [line for line in self.skipped if "FRF" in line]
        raise UffError("\n  ".join([msg, *reasons[:3]]))

    @cached_property
    def contents(self) -> str:
        """What the file holds, in a line."""
        parts = [
            f"{len(self.frfs)} FRF matrices" if self.frfs else "",
            *(f"{sum(f.type_name == name for f in self.functions)} x {name}" for name in self._function_names()),
            f"{sum(m.n_modes for m in self.modes)} mode shapes" if self.modes else "",
            f"{self.points.labels.size} points" if self.points else "",
            f"{len(self.trace_lines)} trace lines" if self.trace_lines else "",
            f"{len(self.elements)} elements" if self.elements else "",
        ]
        return ", ".join(part for part in parts if part) or "nothing that can be read"

    def _function_names(self) -> list[str]:
        return list(dict.fromkeys(f.type_name for f in self.functions))

    def mesh(self) -> Mesh:
        """Return the lines of the file as a mesh: its beam and rod elements, or else its trace lines.

        Members are the trace lines, by their names; elements on no trace line are named by their property table,
        ``"property 3"``. Points are named by their node numbers; those on no line are left out.

        Raises
        ------
        UffError
            If the file has no lines, or one of them refers to a node that it does not have.
        MeshError
            If the lines do not make a mesh.
        """
        return _mesh_of(self)


def read_uff(path: str | os.PathLike[str], kind: FRFKind | str | None = None) -> UffFile:
    """Read a universal file.

    Single records of dataset 58 are put together to FRF matrices, those with the same kind, frequencies, load case and
    unit labels. A matrix with holes is split into complete ones, and a warning names the holes.

    Parameters
    ----------
    path : path
    kind : FRFKind or str, optional
        Kind of the FRFs whose data types do not say it. Those that say it keep theirs.

    Raises
    ------
    UffError
        If the file is no universal file, is cut off, or a dataset is damaged; the message names the dataset and its
        place. Datasets of types that are not known are left out and named in ``skipped``.
    """
    file = Path(path)
    blocks, notes = split_blocks(file.read_bytes(), file.name)
    reader = _Reader(file.name, None if kind is None else _known_kind(kind), notes)
    for block, fields in zip(blocks, _decoded(blocks, file.name), strict=True):
        reader.add(block, fields)
    return reader.result()


def _known_kind(kind: FRFKind | str) -> FRFKind:
    try:
        return FRFKind(kind)
    except ValueError:
        msg = f"the FRF kind is '{kind}'; allowed are {', '.join(FRFKind)}"
        raise UffError(msg) from None


# Decoding with pyuff ------------------------------------------------------------------------------------------------

_BY_PYUFF = (15, 58, 82, 151, 164, 2411, 2412)


def _decoded(blocks: Sequence[Block], file: str) -> list[dict[Any, Any]]:
    """Return the fields of each dataset, empty for those that pyuff does not read."""
    import pyuff

    chosen = [k for k, b in enumerate(blocks) if b.kind in _BY_PYUFF and not b.refusal]
    fields: list[dict[Any, Any]] = [{} for _ in blocks]
    if not chosen:
        return fields
    with tempfile.TemporaryDirectory() as folder:
        clean = Path(folder) / "clean.uff"
        clean.write_text("".join(_clean_text(blocks[k]) for k in chosen), encoding="utf-8", newline="\n")
        reader: Any = pyuff.UFF(str(clean))
        for position, k in enumerate(chosen):
            try:
                fields[k] = reader.read_sets(position, header_only=blocks[k].values is not None)
            except Exception as reason:
                if blocks[k].kind == 151:  # nothing depends on it
                    continue
                msg = f"{file}: {blocks[k].name} is damaged: {_why(blocks[k])}"
                raise UffError(msg) from reason
    return fields


def _clean_text(block: Block) -> str:
    """Write a dataset such that pyuff reads it: one blank between columns, E exponents, Unix line ends."""
    lines = list(block.lines)
    if block.kind == 58:
        lines[1:6] = [line[:80] for line in lines[1:6]]
        body = [line.replace("D", "E").replace("d", "e") for line in lines[12:]]
        lines[12:] = [_padded(line, lines[7]) for line in body if line.strip()]
    elif block.kind == 15:
        lines[1:] = [_apart(line, (10, 20, 30, 40, 53, 66, 79)) for line in lines[1:]]
    elif block.kind == 164:
        lines[2:] = [_apart(line, (25, 50, 75)) for line in lines[2:]]
    mark = "    -1\n"
    return mark + "".join(f"{line}\n" for line in lines) + mark


def _padded(line: str, form: str) -> str:
    """Fill a line of numbers up to whole columns, since pyuff leaves a last column that is cut short out."""
    if form[:10].strip() in ("2", "5"):
        return line.ljust(-(-len(line) // 13) * 13)
    return line.ljust(-(-len(line) // 20) * 20) if form[20:30].strip() == "1" else line


def _apart(line: str, columns: tuple[int, ...]) -> str:
    """Put a blank between the columns of a line, where numbers may touch; D exponents become E."""
    line = line.replace("D", "E").replace("d", "e")
    edges = (0, *columns)
    if len(line.split()) == len(columns):
        return line + " "
    return " ".join(line[a:b] for a, b in zip(edges, edges[1:], strict=False)) + " "


def _why(block: Block) -> str:
    """Find the line of a damaged dataset, as far as the numbers show it."""
    skip = {58: 12, 82: 3, 164: 2}.get(block.kind, 1)
    if len(block.lines) <= skip:
        return f"it has {len(block.lines)} lines, too few for its header"
    for k, line in enumerate(block.lines[skip:], start=skip):
        for word in line.split():
            if not re.fullmatch(r"[-+]?[\d.]+([EeDd]?[-+]?\d+)?([-+][\d.]+[EeDd][-+]?\d+)*", word):
                return f"line {block.line + 1 + k} has {word[:20]!r} where a number is expected"
    return "the number or the columns of its values are not what its header says"


# Putting datasets together ------------------------------------------------------------------------------------------


class _Reader:
    """Collects the datasets of one file."""

    def __init__(self, file: str, kind: FRFKind | None, notes: Iterable[str]) -> None:
        self.file, self.kind = file, kind
        self.skipped = list(notes)
        self.functions: list[Function] = []
        self.frfs: list[tuple[Function, FRFKind]] = []
        self.labels: list[NDArray[np.int64]] = []
        self.coordinates: list[NDArray[np.float64]] = []
        self.traces: list[TraceLine] = []
        self.elements: list[Element] = []
        self.shapes: list[_Shape] = []
        self.header: Header | None = None
        self.units: Units | None = None
        self.local = 0
        self.converted: set[str] = set()

    def add(self, block: Block, fields: dict[Any, Any]) -> None:
        """Take one dataset in."""
        if block.refusal:
            self.skipped.append(f"{block.name}: {block.refusal}")
            return
        take = {
            15: self._points,
            2411: self._points,
            55: self._shape,
            58: self._function,
            82: self._trace,
            151: self._header,
            164: self._units,
            2412: self._elements,
        }.get(block.kind)
        if take is None:
            self.skipped.append(f"{block.name}: datasets of type {block.kind} are not read")
            return
        try:
            take(block, fields)
        except (KeyError, IndexError, TypeError, OverflowError) as reason:
            msg = f"{self.file}: {block.name} is damaged: {_why(block)}"
            raise UffError(msg) from reason
        except UffError:
            raise
        except ValueError as reason:
            msg = f"{self.file}: {block.name}: {reason}"
            raise UffError(msg) from reason

    def _header(self, block: Block, fields: dict[Any, Any]) -> None:
        if not fields:
            self.skipped.append(f"{block.name}: the header cannot be read")
            return
        created = " ".join(str(fields.get(key, "")) for key in ("date_db_created", "time_db_created")).strip()
        self.header = Header(fields["model_name"], fields["description"], fields.get("program", ""), created)

    def _units(self, block: Block, fields: dict[Any, Any]) -> None:
        units = Units(
            int(fields["units_code"]), fields["units_description"], float(fields["length"]), float(fields["force"])
        )
        if not (np.isfinite([units.length, units.force]).all() and units.length > 0 and units.force > 0):
            msg = f"unit factors {units.length} and {units.force}; they must be positive"
            raise ValueError(msg)
        self.units = units

    def _points(self, block: Block, fields: dict[Any, Any]) -> None:
        labels = np.asarray(fields["node_nums"], dtype=float).astype(np.int64)
        xyz = [np.asarray(fields[axis], dtype=float) for axis in "xyz"]
        if any(axis.size != labels.size for axis in xyz):
            msg = f"{labels.size} node numbers and {min(axis.size for axis in xyz)} complete coordinates"
            raise ValueError(msg)
        self.local += int(np.count_nonzero(np.asarray(fields["def_cs"], dtype=float)))
        coordinates = np.column_stack(xyz)
        if not np.isfinite(coordinates).all():
            node = labels[~np.isfinite(coordinates).all(axis=1)][0]
            msg = f"node {node} has a coordinate that is not a finite number"
            raise ValueError(msg)
        self.labels.append(labels)
        self.coordinates.append(coordinates / self._scale("coordinates").length)

    def _scale(self, what: str) -> Units:
        """Return the units to divide by, and say once that they are not SI."""
        units = self.units or Units()
        if (units.length, units.force) != (1.0, 1.0) and what not in self.converted:
            self.converted.add(what)
        return units

    def _trace(self, block: Block, fields: dict[Any, Any]) -> None:
        nodes = np.asarray(fields["nodes"], dtype=float).astype(np.int64).tolist()
        nodes = nodes[: int(fields["n_nodes"])]
        strokes: list[list[int]] = [[]]
        for node in nodes:
            if node == 0:
                strokes.append([])
            elif not strokes[-1] or strokes[-1][-1] != node:
                strokes[-1].append(node)
        number = int(fields["trace_num"])
        name = _text(fields["id"]) or f"line {number}"
        self.traces.append(TraceLine(number, name, tuple(tuple(s) for s in strokes if len(s) > 1)))

    def _elements(self, block: Block, fields: dict[Any, Any]) -> None:
        found = [
            Element(e["element_nums"], e["fe_descriptor"], e["phys_table"], e["mat_table"], tuple(e["nodes_nums"]))
            for key, entries in fields.items()
            if isinstance(key, int)
            for e in entries
        ]
        self.elements.extend(sorted(found, key=lambda e: e.number))

    def _shape(self, block: Block, fields: dict[Any, Any]) -> None:
        shape = _read_shape(block)
        if isinstance(shape, str):
            self.skipped.append(f"{block.name}: {shape}")
            return
        self.shapes.append(_shape_in_si(shape, self._scale("mode shapes")))

    def _function(self, block: Block, fields: dict[Any, Any]) -> None:
        function = _function_of(block, fields)
        if function.function_type != _FRF:
            self.functions.append(function)
            return
        kind = function.kind or self.kind
        reason = _frf_refusal(function, kind)
        if reason or kind is None:
            self.functions.append(function)
            self.skipped.append(f"{block.name}: FRF {function.response}/{function.reference}: {reason}")
            return
        self.frfs.append((self._frf_in_si(function), kind))

    def _frf_in_si(self, function: Function) -> Function:
        units = self.units or Units()
        if (units.length, units.force) == (1.0, 1.0):
            return function
        label = function.unit.lower().replace(" ", "")
        if label and _SI_LABEL.fullmatch(label):
            self.converted.add(f"not the FRFs, whose unit label '{function.unit}' goes before")
            return function
        self._scale("FRFs")
        turned = abs(parse_label(function.response)[1]) > 3
        moment = abs(parse_label(function.reference)[1]) > 3
        factor = units.force * (units.length if moment else 1.0) / (1.0 if turned else units.length)
        return replace(function, values=function.values * factor)

    def result(self) -> UffFile:
        """Return all datasets of the file."""
        if self.converted and self.units is not None:
            words = "; ".join(sorted(self.converted))
            warnings.warn(
                f"{self.file}: its units ('{self.units.description}', dataset 164) are not SI: lengths are divided by "
                f"{self.units.length:g} and forces by {self.units.force:g} in {words}",
                stacklevel=3,
            )
        if self.local:
            self.skipped.append(
                f"local coordinate systems are not read: {self.local} points refer to one, and are taken as global"
            )
        groups = _frf_groups(self.frfs, self.file)
        return UffFile(
            self.file,
            tuple(frf for frf, _ in groups),
            tuple(units for _, units in groups),
            tuple(self.functions),
            _modes_of(self.shapes, self.file),
            Points(np.concatenate(self.labels), np.concatenate(self.coordinates)) if self.labels else None,
            tuple(self.traces),
            tuple(self.elements),
            self.header,
            self.units,
            tuple(self.skipped),
        )


def _text(value: object) -> str:
    text = str(value).strip()
    return "" if text.upper() == "NONE" else text


# Functions: dataset 58 ----------------------------------------------------------------------------------------------


def _function_of(block: Block, fields: dict[Any, Any]) -> Function:
    x, values = _ordinates(block, fields)
    return Function(
        int(fields["func_type"]),
        label_of(int(fields["rsp_node"]), int(fields["rsp_dir"])),
        label_of(int(fields["ref_node"]), int(fields["ref_dir"])),
        _text(fields["rsp_ent_name"]),
        _text(fields["ref_ent_name"]),
        x,
        values,
        int(fields["abscissa_spec_data_type"]),
        int(fields["ordinate_spec_data_type"]),
        int(fields["orddenom_spec_data_type"]),
        _text(fields["abscissa_axis_units_lab"]),
        _text(fields["ordinate_axis_units_lab"]),
        _text(fields["orddenom_axis_units_lab"]),
        tuple(str(fields[f"id{k}"]) for k in range(1, 6)),
        int(fields["load_case_id"]),
        int(fields["ver_num"]),
        block.name,
    )


def _ordinates(block: Block, fields: dict[Any, Any]) -> tuple[NDArray[np.float64], NDArray[Any]]:
    """Return abscissa and ordinate, as many as the header announces."""
    n, even = int(fields["num_pts"]), int(fields["abscissa_spacing"]) == 1
    if block.values is not None:
        y = block.values["y"].astype(float)
        values = y[:, 0] + 1j * y[:, 1] if y.shape[1] == 2 else y[:, 0]
        stored = None if even else block.values["x"].astype(float)
    else:
        values = np.asarray(fields["data"])
        stored = None if even else np.asarray(fields["x"], dtype=float)
    if values.size < n:
        msg = f"it announces {n} values and has {values.size}"
        raise ValueError(msg)
    x = float(fields["abscissa_min"]) + np.arange(n) * float(fields["abscissa_inc"]) if stored is None else stored[:n]
    return x, values[:n]


def _frf_refusal(function: Function, kind: FRFKind | None) -> str:
    """Say why a record cannot be used as an FRF; empty if it can."""
    if not np.iscomplexobj(function.values):
        return "its values are real; amplitudes without phase are not used"
    if not function.x.size:
        return "it has no values"
    if function.x_type not in (0, 1, 18):
        return f"its abscissa has data type {function.x_type}, not 18 (frequency)"
    if kind is None:
        return (
            f"its data types {function.ordinate_type} and {function.denominator_type} do not say whether it is a "
            "receptance, mobility or accelerance; give kind=…"
        )
    return ""


def _frf_groups(records: Sequence[tuple[Function, FRFKind]], file: str) -> list[tuple[FRF, tuple[str, str]]]:
    """Put records together to matrices."""
    groups: list[tuple[tuple[Any, ...], dict[tuple[str, str], Function]]] = []
    for function, kind in records:
        key = (kind, function.x.tobytes(), function.load_case, function.unit.lower(), function.denominator_unit.lower())
        pair = (function.response, function.reference)
        home = next((cells for k, cells in groups if k == key and pair not in cells), None)
        if home is None:
            home = {}
            groups.append((key, home))
        home[pair] = function
    found: list[tuple[FRF, tuple[str, str]]] = []
    for key, cells in groups:
        parts = _complete_parts(cells)
        if len(parts) > 1:
            _warn_of_holes(cells, len(parts), file)
        for outputs, inputs in parts:
            first = cells[outputs[0], inputs[0]]
            H = np.stack([np.stack([cells[o, i].values for i in inputs], -1) for o in outputs], 1)
            try:
                frf = FRF.from_arrays(first.x, H, key[0], outputs, inputs)
            except FRFError as reason:
                msg = f"{file}: FRFs from {first.place} on: {reason}"
                raise UffError(msg) from reason
            found.append((frf, (first.unit, first.denominator_unit)))
    return found


def _complete_parts(cells: dict[tuple[str, str], Function]) -> list[tuple[list[str], list[str]]]:
    """Group the columns of a matrix that have the same rows."""
    rows: dict[str, list[str]] = {}
    for output, reference in cells:
        rows.setdefault(reference, []).append(output)
    parts: dict[frozenset[str], tuple[list[str], list[str]]] = {}
    for reference, outputs in rows.items():
        parts.setdefault(frozenset(outputs), (outputs, []))[1].append(reference)
    return list(parts.values())


def _warn_of_holes(cells: dict[tuple[str, str], Function], n_parts: int, file: str) -> None:
    outputs, inputs = (list(dict.fromkeys(pair[k] for pair in cells)) for k in (0, 1))
    holes = [f"{o}/{i}" for i in inputs for o in outputs if (o, i) not in cells]
    more = f" and {len(holes) - 5} more" if len(holes) > 5 else ""
    warnings.warn(
        f"{file}: the FRF matrix of {len(outputs)} responses and {len(inputs)} forces lacks {', '.join(holes[:5])}{more}; "
        f"it is given as {n_parts} complete matrices",
        stacklevel=5,
    )


# Mode shapes: dataset 55 --------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class _Shape:
    nodes: NDArray[np.int64]
    values: NDArray[Any]  # (n_nodes, 3 or 6)
    frequency: float
    zeta: float
    modal_mass: float
    place: str


def _read_shape(block: Block) -> _Shape | str:
    """Read a dataset 55: a shape, or why it is none."""
    if len(block.lines) < 9:
        msg = f"it has {len(block.lines)} lines, too few for its header"
        raise ValueError(msg)
    head = [_whole(block, 6, k) for k in range(6)]
    analysis, data_type, per_node = head[1], head[4], head[5]
    if analysis not in (2, 3, 7):
        return f"analysis type {analysis} holds no mode shapes (2, 3 and 7 do)"
    if data_type not in (2, 5) or per_node not in (3, 6):
        return f"data type {data_type} with {per_node} values at each node; 2 or 5 (real, complex) and 3 or 6 are read"
    reals = [_number(block, 8, k, 13) for k in range(6 if analysis in (3, 7) else 4)]
    if analysis == 2:
        frequency, modal_mass, zeta = reals[0], reals[1], reals[2] or reals[3] / 2
    else:
        size = float(np.hypot(reals[0], reals[1]))
        frequency, modal_mass, zeta = size / (2 * np.pi), 0.0, -reals[0] / size if size else 0.0
    nodes, values = _nodal_values(block, per_node * (2 if data_type == 5 else 1))
    if data_type == 5:
        values = values[:, 0::2] + 1j * values[:, 1::2]
    return _Shape(nodes, values, frequency, zeta, modal_mass, block.name)


def _whole(block: Block, record: int, position: int) -> int:
    text = block.lines[record][10 * position : 10 * position + 10]
    try:
        return int(text)
    except ValueError:
        msg = f"line {block.line + 1 + record} has {text.strip()!r} where a whole number is expected"
        raise ValueError(msg) from None


def _number(block: Block, record: int, position: int, width: int) -> float:
    text = block.lines[record][width * position : width * (position + 1)].replace("D", "E").replace("d", "e")
    if not text.strip():
        return 0.0
    try:
        return float(text)
    except ValueError:
        msg = f"line {block.line + 1 + record} has {text.strip()!r} where a number is expected"
        raise ValueError(msg) from None


def _nodal_values(block: Block, count: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Read node numbers and the values that follow each, six to a line."""
    nodes: list[int] = []
    rows: list[list[float]] = []
    record = 9
    while record < len(block.lines):
        if not block.lines[record].strip():
            record += 1
            continue
        nodes.append(_whole(block, record, 0))
        record += 1
        row: list[float] = []
        while len(row) < count and record < len(block.lines):
            found = -(-len(block.lines[record]) // 13)
            row += [_number(block, record, k, 13) for k in range(min(found, count - len(row)))]
            record += 1
            if not found:
                break
        if len(row) < count:
            msg = f"node {nodes[-1]} has {len(row)} values of {count}"
            raise ValueError(msg)
        rows.append(row)
    if not rows:
        msg = "it has no nodes"
        raise ValueError(msg)
    values = np.array(rows)
    if not np.isfinite(values).all():
        msg = f"node {nodes[int(np.argwhere(~np.isfinite(values))[0, 0])]} has a value that is not a finite number"
        raise ValueError(msg)
    return np.array(nodes, dtype=np.int64), values


def _shape_in_si(shape: _Shape, units: Units) -> _Shape:
    """Scale a shape to unit modal mass in kg, where the file gives its modal mass; rotations to radians per metre."""
    values = shape.values.copy()
    values[:, 3:] *= units.length
    if shape.modal_mass > 0:
        values /= np.sqrt(shape.modal_mass * units.mass)
    return replace(shape, values=values)


def _modes_of(shapes: Sequence[_Shape], file: str) -> tuple[Modes, ...]:
    """Put shapes on the same nodes together."""
    groups: dict[tuple[Any, ...], list[_Shape]] = {}
    for shape in shapes:
        groups.setdefault((shape.nodes.tobytes(), shape.values.shape[1]), []).append(shape)
    found: list[Modes] = []
    for group in groups.values():
        for shape in group:
            if not (np.isfinite(shape.frequency) and shape.frequency >= 0):
                msg = f"{file}: {shape.place}: natural frequency {shape.frequency} Hz; it must be a number not below 0"
                raise UffError(msg)
        group.sort(key=lambda s: s.frequency)
        frequency = np.array([s.frequency for s in group])
        zeta = np.array([s.zeta for s in group])
        nodes, width = group[0].nodes, group[0].values.shape[1]
        labels = tuple(label_of(int(node), d) for node in nodes for d in range(1, width + 1))
        phi = np.column_stack([s.values.ravel() for s in group])
        found.append(Modes(frequency, phi, zeta if zeta.any() else None, labels, int((frequency == 0).sum())))
    return tuple(found)


# Meshes: datasets 15, 2411, 2412, 82 --------------------------------------------------------------------------------


def _mesh_of(file: UffFile) -> Mesh:
    if file.points is None:
        msg = f"{file.name}: no points (dataset 15 or 2411); it holds {file.contents}"
        raise UffError(msg)
    beams = [e for e in file.elements if e.descriptor in _LINE_ELEMENTS]
    lines = [pair for e in beams for pair in zip(e.nodes, e.nodes[1:], strict=False)]
    sets: dict[str, list[int]] = {}
    owner: dict[frozenset[int], str] = {}
    traced: list[tuple[int, int]] = []
    for name, trace in _named_apart(file.trace_lines):
        for stroke in trace.strokes:
            for pair in zip(stroke, stroke[1:], strict=False):
                if frozenset(pair) not in owner:
                    owner[frozenset(pair)] = name
                    traced.append(pair)
    if not beams:
        lines = traced
        if file.elements and not lines:
            msg = f"{file.name}: none of its {len(file.elements)} elements is a line and there are no trace lines"
            raise UffError(msg)
    properties = [f"property {e.property}" for e in beams for _ in e.nodes[1:]]
    for row, pair in enumerate(lines):
        name = owner.get(frozenset(pair)) or properties[row]
        sets.setdefault(name, []).append(row)
    return _checked_mesh(file, lines, {n: sets[n] for n in dict.fromkeys([*owner.values(), *sets]) if n in sets})


def _named_apart(traces: Sequence[TraceLine]) -> list[tuple[str, TraceLine]]:
    """Number trace lines that have the same name."""
    names = [t.name for t in traces]
    return [(t.name if names.count(t.name) == 1 else f"{t.name} {t.number}", t) for t in traces]


def _checked_mesh(file: UffFile, lines: Sequence[tuple[int, int]], sets: dict[str, list[int]]) -> Mesh:
    if not lines or file.points is None:
        msg = f"{file.name}: no lines (beam elements of dataset 2412 or trace lines, dataset 82)"
        raise UffError(msg)
    row_of = {int(label): row for row, label in enumerate(file.points.labels)}
    missing = next((node for pair in lines for node in pair if node not in row_of), None)
    if missing is not None:
        msg = f"{file.name}: a line refers to node {missing}, which is not among the {len(row_of)} points of the file"
        raise UffError(msg)
    index = np.array([[row_of[a], row_of[b]] for a, b in lines])
    used, compact = np.unique(index, return_inverse=True)
    names = {str(int(file.points.labels[row])): k for k, row in enumerate(used)}
    try:
        return Mesh.from_lines(file.points.coordinates[used], compact.reshape(index.shape), sets, names)
    except MeshError as reason:
        msg = f"{file.name}: {reason}"
        raise MeshError(msg) from reason
