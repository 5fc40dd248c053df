"""Universal files (UFF, ``.uff`` and ``.unv``): datasets 15, 55, 58, 58b, 82, 151, 164, 2411 and 2412.

pyuff decodes the text of all of them but 55. Read here are the framing and the binary values (pyuff trusts
neither the byte count nor the precision that a header states, and stops without a place where they are wrong)
and dataset 55 (pyuff knows no complex shapes with rotations). Lengths and forces come out in SI, by the units
of dataset 164.
"""

import os
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.frf import FRF, FRFKind
from fem.io.uff_decode import decoded, why
from fem.io.uff_format import Block, UffError, label_of, parse_label, split_blocks
from fem.io.uff_functions import FRF_TYPE, frf_groups, frf_refusal, function_of, si_factor, text_of
from fem.io.uff_mesh import mesh_from
from fem.io.uff_shapes import Shape, modes_of, read_shape, shape_in_si
from fem.io.uff_types import Element, Function, Header, Points, TraceLine, Units
from fem.io.uff_write import write_uff
from fem.mesh import Mesh
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


@dataclass(frozen=True, eq=False)
class UffFile:
    """What a universal file holds.

    Attributes
    ----------
    name : str
        File name.
    frfs : tuple of FRF
        Each a complete matrix; several where kind, frequencies, runs or unit labels differ, or the matrix has
        holes.
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
            *(
                f"{sum(f.type_name == name for f in self.functions)} x {name}"
                for name in self._function_names()
            ),
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

        Members are the trace lines, by their names; elements on no trace line are named by their property
        table, ``"property 3"``. Points are named by their node numbers; those on no line are left out.

        Raises
        ------
        UffError
            If the file has no lines, or one of them refers to a node that it does not have.
        MeshError
            If the lines do not make a mesh.
        """
        return mesh_from(self.name, self.points, self.elements, self.trace_lines)


def read_uff(path: str | os.PathLike[str], kind: FRFKind | str | None = None) -> UffFile:
    """Read a universal file.

    Single records of dataset 58 are put together to FRF matrices, those with the same kind, frequencies, load
    case and unit labels. A matrix with holes is split into complete ones, and a warning names the holes.

    Parameters
    ----------
    path : path
    kind : FRFKind or str, optional
        Kind of the FRFs whose data types do not say it. Those that say it keep theirs.

    Raises
    ------
    UffError
        If the file is no universal file, is cut off, or a dataset is damaged; the message names the dataset
        and its place. Datasets of types that are not known are left out and named in ``skipped``.
    """
    file = Path(path)
    blocks, notes = split_blocks(file.read_bytes(), file.name)
    reader = _Reader(file.name, None if kind is None else _known_kind(kind), notes)
    for block, fields in zip(blocks, decoded(blocks, file.name), strict=True):
        reader.add(block, fields)
    return reader.result()


def _known_kind(kind: FRFKind | str) -> FRFKind:
    try:
        return FRFKind(kind)
    except ValueError:
        msg = f"the FRF kind is '{kind}'; allowed are {', '.join(FRFKind)}"
        raise UffError(msg) from None


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
        self.shapes: list[Shape] = []
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
            msg = f"{self.file}: {block.name} is damaged: {why(block)}"
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
            int(fields["units_code"]),
            fields["units_description"],
            float(fields["length"]),
            float(fields["force"]),
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
        name = text_of(fields["id"]) or f"line {number}"
        self.traces.append(TraceLine(number, name, tuple(tuple(s) for s in strokes if len(s) > 1)))

    def _elements(self, block: Block, fields: dict[Any, Any]) -> None:
        found = [
            Element(
                e["element_nums"], e["fe_descriptor"], e["phys_table"], e["mat_table"], tuple(e["nodes_nums"])
            )
            for key, entries in fields.items()
            if isinstance(key, int)
            for e in entries
        ]
        self.elements.extend(sorted(found, key=lambda e: e.number))

    def _shape(self, block: Block, fields: dict[Any, Any]) -> None:
        shape = read_shape(block)
        if isinstance(shape, str):
            self.skipped.append(f"{block.name}: {shape}")
            return
        self.shapes.append(shape_in_si(shape, self._scale("mode shapes")))

    def _function(self, block: Block, fields: dict[Any, Any]) -> None:
        function = function_of(block, fields)
        if function.function_type != FRF_TYPE:
            self.functions.append(function)
            return
        kind = function.kind or self.kind
        reason = frf_refusal(function, kind)
        if reason or kind is None:
            self.functions.append(function)
            self.skipped.append(f"{block.name}: FRF {function.response}/{function.reference}: {reason}")
            return
        self.frfs.append((self._in_si(function), kind))

    def _in_si(self, function: Function) -> Function:
        factor = si_factor(function, self.units or Units())
        if factor is None:
            self.converted.add(f"not the FRFs, whose unit label '{function.unit}' goes before")
            return function
        self._scale("FRFs")
        return replace(function, values=function.values * factor)

    def result(self) -> UffFile:
        """Return all datasets of the file."""
        if self.converted and self.units is not None:
            words = "; ".join(sorted(self.converted))
            warnings.warn(
                f"{self.file}: its units ('{self.units.description}', dataset 164) are not SI: "
                "lengths are divided by "
                f"{self.units.length:g} and forces by {self.units.force:g} in {words}",
                stacklevel=3,
            )
        if self.local:
            self.skipped.append(
                f"local coordinate systems are not read: {self.local} points refer to one, and are "
                "taken as global"
            )
        groups = frf_groups(self.frfs, self.file)
        return UffFile(
            self.file,
            tuple(frf for frf, _ in groups),
            tuple(units for _, units in groups),
            tuple(self.functions),
            modes_of(self.shapes, self.file),
            Points(np.concatenate(self.labels), np.concatenate(self.coordinates)) if self.labels else None,
            tuple(self.traces),
            tuple(self.elements),
            self.header,
            self.units,
            tuple(self.skipped),
        )
