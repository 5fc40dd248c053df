"""Universal files (UFF, ``.uff`` and ``.unv``): the datasets that are read, and their results.

Datasets that define the meaning of others (units 164, coordinate systems 18 and 2420, nodes) act on all of
the file, whatever their place. Lengths and forces are in SI, positions and directions along the global axes.
A dataset of another type is in ``skipped``, unless it says nothing about geometry or measured values.
"""

import os
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.modes import Modes
from fem.io.faults import error_at, refuse
from fem.io.rawmesh import RawMesh, mesh_of
from fem.io.uff_elements import (
    GROUP_COLUMNS,
    HEADS,
    Elements,
    UffGroup,
    elements_of,
    groups_of,
    trace_line_of,
)
from fem.io.uff_format import UffBlock, UffError, split_blocks
from fem.io.uff_functions import FRF_TYPES, Record, frf_groups, frf_refusal, function_of, turned_records
from fem.io.uff_mesh import raw_mesh_of
from fem.io.uff_nodes import PATTERNS, UffNodes, UffSystems, turn_shape
from fem.io.uff_shapes import UffShape, modes_of, read_shape, shape_in_si
from fem.io.uff_types import Function, Header, Points, TraceLine, UffUnits
from fem.io.uff_units import response_and_force, units_of
from fem.mesh import Mesh


@dataclass(frozen=True, eq=False)
class UffFile:
    """Content of a universal file.

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
    elements : sequence of Element
    header : Header or None
    units : UffUnits or None
    skipped : tuple of str
        Datasets that were not read or not used: place of the first, reason, and count.
    frf_runs : tuple of str
        Label that tells each FRF matrix from others, such as ``"load case 2"``; empty where nothing does.
    frf_axes : tuple of tuple of str
        Unit labels of the frequencies of each FRF matrix as the file has them, such as ``("rad/s",)``; the
        FRFs themselves are in Hz.
    frf_names : (mapping, mapping)
        Entity names of record 6 of the FRFs: of responses and of forces, by their labels.
    groups : tuple of Group
        Permanent groups; :meth:`mesh` makes sets of lines and of points of them.
    notes : tuple of str
        Records that were converted, turned or came twice: the lines of :func:`read_uff`'s warning.
    mesh_notes : tuple of str
        Those of the notes and of ``skipped`` that concern a mesh.
    geometry_fault : str
        Why the file cannot give a mesh, although its measured values can be read; empty if it can.
    """

    name: str
    frfs: tuple[FRF, ...] = ()
    frf_units: tuple[tuple[str, str], ...] = ()
    functions: tuple[Function, ...] = ()
    modes: tuple[Modes, ...] = ()
    points: Points | None = None
    trace_lines: tuple[TraceLine, ...] = ()
    elements: Elements = field(default_factory=lambda: Elements.joined([]))
    header: Header | None = None
    units: UffUnits | None = None
    skipped: tuple[str, ...] = ()
    frf_runs: tuple[str, ...] = ()
    frf_axes: tuple[tuple[str, ...], ...] = ()
    frf_names: tuple[Mapping[str, str], Mapping[str, str]] = ({}, {})
    groups: tuple[UffGroup, ...] = ()
    notes: tuple[str, ...] = ()
    mesh_notes: tuple[str, ...] = ()
    geometry_fault: str = ""

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
            msg = f"{self.name}: {len(self.frfs)} groups of FRFs; choose one with read_uff:\n" + "\n".join(
                f"  {k}: {frf.kind}, {run}{frf.n_freq} lines to {frf.frequency[-1]:g} Hz, "
                f"responses {_few(frf.outputs)}, forces {_few(frf.inputs)}"
                for k, (frf, run) in enumerate(zip(self.frfs, self._runs(), strict=True))
            )
            raise UffError(msg)
        msg = f"{self.name}: no FRFs that can be used; it holds {self.contents}"
        reasons = [line for line in self.skipped if "FRF" in line]
        raise UffError("\n  ".join([msg, *reasons[:3]]))

    def _runs(self) -> list[str]:
        return [f"{run}, " if run else "" for run in self.frf_runs or ("",) * len(self.frfs)]

    def one_set_of_modes(self) -> Modes:
        """Return the one set of modes of the file.

        Raises
        ------
        UffError
            If there is none, or several.
        """
        if not self.modes:
            reasons = [line for line in self.skipped if line.startswith(("dataset 55", "dataset 2414"))]
            msg = (
                f"{self.name}: no mode shapes that can be used; it holds {self.contents} (mode shapes are in "
                "datasets 55 and 2414)"
            )
            raise UffError("; ".join([msg, *reasons[:3]]))
        if len(self.modes) != 1:
            groups = "; ".join(
                f"{m.n_modes} modes at {m.frequency[0]:.6g} to {m.frequency[-1]:.6g} Hz with {len(m.labels)} "
                f"rows, {m.labels[0]} to {m.labels[-1]}"
                for m in self.modes
            )
            msg = (
                f"{self.name}: {len(self.modes)} groups of mode shapes where one is expected, which share "
                f"fewer than half of their nodes or directions: {groups}; delete the others from "
                "the file, or choose one with read_uff"
            )
            raise UffError(msg)
        return self.modes[0]

    @cached_property
    def contents(self) -> str:
        """Content of the file in one line."""
        parts = [
            f"{len(self.frfs)} FRF matrices" if self.frfs else "",
            *(
                f"{sum(f.type_name == name for f in self.functions)} x {name}"
                for name in dict.fromkeys(f.type_name for f in self.functions)
            ),
            f"{sum(m.n_modes for m in self.modes)} mode shapes" if self.modes else "",
            f"{self.points.labels.size} points" if self.points else "",
            f"{len(self.trace_lines)} trace lines" if self.trace_lines else "",
            f"{len(self.elements)} elements" if self.elements else "",
        ]
        return ", ".join(part for part in parts if part) or "nothing that can be read"

    def mesh(self) -> Mesh:
        """Return the lines of the file as a mesh: its rods, beams and pipes, or else its trace lines.

        Trace lines and permanent groups of elements make sets of lines by their names; elements in none of
        them make a set by their property table, ``"property 3"``. Points are named by their node numbers and
        by permanent groups of nodes; those on no line are left out. Other notes are in ``mesh_notes``, and
        in the warning of :func:`fem.io.read_mesh`.

        Raises
        ------
        UffError
            If the file has no lines, one of them refers to a node that it does not have, or a dataset that
            changes lines is not read.
        MeshError
            If the lines do not make a mesh.
        """
        raw = self.raw_mesh()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return mesh_of(raw, self.name, 1.0, None)

    def raw_mesh(self) -> RawMesh:
        """Return lines, sets and notes for :func:`fem.io.rawmesh.mesh_of`; raise as :meth:`mesh`."""
        if self.geometry_fault:
            raise error_at(self.name, f"{self.geometry_fault}", UffError)
        return raw_mesh_of(
            self.name, self.points, self.elements, self.trace_lines, self.groups, self.mesh_notes
        )


def _few(labels: tuple[str, ...]) -> str:
    return ", ".join(labels[:8]) + (f" … ({len(labels)})" if len(labels) > 8 else "")


def read_uff(
    path: str | os.PathLike[str], kind: FRFKind | str | None = None, unit_labels: bool = True
) -> UffFile:
    """Read a universal file; one warning lists records that were converted, turned or came twice.

    Single records of dataset 58 are put together to FRF matrices, those with the same kind, frequencies, load
    case and unit labels. A matrix with holes is split into complete ones, and a warning names the holes.

    Parameters
    ----------
    path : path
    kind : FRFKind or str, optional
        Kind of the FRFs whose data types do not say it. Those that say it keep theirs.
    unit_labels : bool
        Whether FRFs whose records have the label of a unit other than SI, such as g or mm/s², are converted
        by it; not where the caller gives a factor.

    Raises
    ------
    UffError
        If the file is no universal file, is cut off, or a dataset is damaged; the message names the dataset
        and its place. Datasets of types that are not known are left out and named in ``skipped``.
    """
    file = read_quietly(path, kind, unit_labels)
    if file.notes:
        warnings.warn(f"{file.name}: {'; '.join(file.notes)}", stacklevel=2)
    return file


def read_quietly(
    path: str | os.PathLike[str], kind: FRFKind | str | None = None, unit_labels: bool = True
) -> UffFile:
    """Read a universal file as :func:`read_uff` without its warning, for callers that show ``notes``."""
    file = Path(path)
    blocks, notes = split_blocks(file.read_bytes(), file.name)
    reader = FileReader(file.name, None if kind is None else _known_kind(kind), unit_labels, notes)
    for block in blocks:
        reader.take(block)
    return UffFile(file.name, **reader.result())


def _known_kind(kind: FRFKind | str) -> FRFKind:
    try:
        return FRFKind(kind)
    except ValueError:
        msg = f"the FRF kind is '{kind}'; allowed are {', '.join(FRFKind)}"
        raise UffError(msg) from None


# The datasets of a universal file, taken in one by one and given their meaning when all are there -----------


HARMLESS: dict[int, str] = {1858: "qualifiers of functions", 2400: "model header"}
"""Datasets without influence on the data that are read."""

GEOMETRY: dict[int, str] = {71: "elements of an old form"}
"""Datasets that change the lines of a mesh and are not read: a mesh is refused where there is one."""

LEFT_OUT: dict[int, str] = {
    56: "results on elements",
    57: "results at nodes on elements",
    754: "constraints",
    755: "restraints",
    756: "loads",
    757: "degrees of freedom of analyses",
    772: "beam cross sections",
    773: "materials",
    776: "beam cross sections",
    789: "physical properties",
    790: "loads",
    791: "restraints",
    1710: "materials",
    2437: "physical properties",
    2448: "physical properties",
    2470: "materials",
}
"""Words for some of the datasets that are left out and named."""

_RESULTS = ("FRF", "55", "57", "58", "2414")
"""Beginnings of keys of skipped datasets that do not concern a mesh."""

T = TypeVar("T")
R = TypeVar("R")


@dataclass(slots=True)
class _Counted:
    """A sentence about the first of several things, and how many there are."""

    first: str
    count: int = 1

    def __str__(self) -> str:
        return self.first + (f"; {self.count} of them" if self.count > 1 else "")


class _Sentences:
    """Sentences, one for each subject."""

    def __init__(self) -> None:
        self._counted: dict[str, _Counted] = {}

    def add(self, key: str, words: str) -> None:
        """Add a sentence, or count it where there is one about the same."""
        if key in self._counted:
            self._counted[key].count += 1
        else:
            self._counted[key] = _Counted(words)

    def texts(self, without: tuple[str, ...] = ()) -> list[str]:
        """Return all sentences but those whose keys begin with one of some words."""
        return [str(c) for key, c in self._counted.items() if not without or not key.startswith(without)]


class FileReader:
    """Collects the datasets of one file."""

    def __init__(self, file: str, kind: FRFKind | None, unit_labels: bool, notes: Iterable[str]) -> None:
        self.file, self.kind, self.unit_labels = file, kind, unit_labels
        self.skipped, self.notes, self.mesh_notes = _Sentences(), _Sentences(), _Sentences()
        for note in notes:
            self.skipped.add(f"text {note}", note)
        self.functions: list[Function] = []
        self.records: list[Record] = []
        self.systems = UffSystems()
        self.nodes = UffNodes(self.systems)
        self.traces: list[TraceLine] = []
        self.elements: list[Elements] = []
        self.groups: list[UffGroup] = []
        self.shapes: list[UffShape] = []
        self.header: Header | None = None
        self.units: UffUnits | None = None
        self.units_at = ""
        self.fault = ""
        self.takers: dict[int, Callable[[UffBlock], object]] = {
            **dict.fromkeys(PATTERNS, self.nodes.add),
            **dict.fromkeys(HEADS, lambda block: self.elements.append(elements_of(block))),
            **dict.fromkeys(GROUP_COLUMNS, lambda block: self.groups.extend(groups_of(block))),
            **dict.fromkeys((18, 2420), self.systems.add),
            **dict.fromkeys((55, 2414), self._shape),
            58: self._function,
            82: lambda block: self.traces.append(trace_line_of(block)),
            151: self._header,
            164: self._units,
        }

    def take(self, block: UffBlock) -> None:
        """Take one dataset in."""
        if block.refusal:
            self._skip(block, block.refusal)
        elif block.kind in self.takers:
            self._guarded(block.name, self.takers[block.kind], block)
        elif block.kind in GEOMETRY:
            words = f"{GEOMETRY[block.kind]} are not read"
            self.fault = self.fault or f"{block.name}: {words}; write them as dataset 2412"
            self._skip(block, words)
        elif block.kind not in HARMLESS:
            word = f" ({LEFT_OUT[block.kind]})" if block.kind in LEFT_OUT else ""
            self._skip(block, f"datasets of type {block.kind}{word} are not read")

    def _guarded(self, place: str, call: Callable[[T], R], argument: T) -> R:
        """Call, and name file and dataset where something is wrong."""
        try:
            return call(argument)
        except UffError:
            raise
        except ValueError as reason:
            msg = f"{self.file}: {place}: {reason}" if place else f"{self.file}: {reason}"
            raise UffError(msg) from reason

    def _skip(self, block: UffBlock, reason: str) -> None:
        self.skipped.add(f"{block.kind} {reason}", f"{block.name}: {reason}")

    def _header(self, block: UffBlock) -> None:
        text = [*block.lines[1:], *[""] * 7]
        created = " ".join(text[3][:20].split())
        self.header = Header(text[0].strip(), text[1].strip(), text[5].strip(), created)

    def _units(self, block: UffBlock) -> None:
        units = units_of(block)
        if self.units is None:
            self.units, self.units_at = units, block.name
        elif (units.length, units.force) != (self.units.length, self.units.force):
            refuse(
                f"its factors are {units.length:g} for lengths and {units.force:g} for forces, beside "
                f"{self.units.length:g} and {self.units.force:g} of {self.units_at}; a file has one system "
                "of units: cut it into two"
            )

    def _shape(self, block: UffBlock) -> None:
        shape = read_shape(block)
        if isinstance(shape, str):
            self._skip(block, shape)
        else:
            self.shapes.append(shape)

    def _function(self, block: UffBlock) -> None:
        function, notes = function_of(block)
        for note in notes:
            self.notes.add(note, f"{note} ({block.name})")
        # a strain takes the kind of the other records once these are known
        kind = function.kind or self.kind or (FRFKind.RECEPTANCE if function.is_strain else None)
        reason = frf_refusal(function, kind) if function.function_type in FRF_TYPES else ""
        if reason:
            self._skip_frf(function, reason)
        if function.function_type not in FRF_TYPES or reason or kind is None:
            self.functions.append(function)
        else:
            self.records.append((function, kind))

    def _skip_frf(self, function: Function, reason: str) -> None:
        ends = f"{function.response}/{function.reference}"
        self.skipped.add(f"FRF {reason}", f"{function.place}: FRF {ends}: {reason}")

    # The rest needs all datasets ----------------------------------------------------------------------------

    def result(self) -> dict[str, Any]:
        """Return the attributes of :class:`fem.io.uff.UffFile` but its name."""
        units = self.units or UffUnits()
        points = self._guarded("", self.nodes.points, units.length)
        elements = self._guarded("", Elements.without_copies, Elements.joined(self.elements))
        for note in self.nodes.notes:
            self.mesh_notes.add(note, note)
            self.notes.add(note, note)
        converted = set() if points is None else {"coordinates"}
        converted |= {"mode shapes"} if self.shapes else set()
        frfs = frf_groups(self._guarded("", self._frfs, (units, converted)), self.file)
        modes, mode_notes = modes_of(self._guarded("", self._global_shapes, units), self.file)
        for note in (*frfs.notes, *mode_notes):
            self.notes.add(note, note)
        for words in frfs.left_out:
            self.skipped.add(f"FRF {words}", words)
        if converted and not units.is_si:
            self._say_units(units, converted)
        return {
            "frfs": tuple(frfs.frfs),
            "frf_units": tuple(frfs.units),
            "frf_axes": tuple(frfs.axes),
            "frf_names": frfs.names,
            "frf_runs": tuple(frfs.runs),
            "functions": tuple(self._guarded("", self._global_functions, self.functions)),
            "modes": modes,
            "points": points,
            "trace_lines": tuple(self.traces),
            "elements": elements,
            "groups": tuple(self.groups),
            "header": self.header,
            "units": self.units,
            "skipped": tuple(self.skipped.texts()),
            "notes": tuple(self.notes.texts()),
            "mesh_notes": (*self.mesh_notes.texts(), *self.skipped.texts(without=_RESULTS)),
            "geometry_fault": self.fault,
        }

    def _say_units(self, units: UffUnits, converted: set[str]) -> None:
        words = (
            f"dataset 164 ('{units.description}') has unit factors other than 1: lengths are divided by "
            f"{units.length:g} and forces by {units.force:g} in "
        )
        self.notes.add("units", words + ", ".join(sorted(converted)))
        if "coordinates" in converted:
            self.mesh_notes.add("units", f"{words}coordinates")

    def _frfs(self, given: tuple[UffUnits, set[str]]) -> list[Record]:
        """Return FRFs in SI along the global axes."""
        units, converted = given
        out: list[Record] = []
        of_motions = next((kind for f, kind in self.records if not f.is_strain), None)
        for f, stated in self.records:
            kind = of_motions if f.is_strain and of_motions is not None else stated
            factor, by_file, problem = response_and_force(f, kind, units, self.unit_labels)
            if problem:
                self.skipped.add(f"FRF {problem}", f"{f.place}: FRF {f.response}/{f.reference}: {problem}")
            if np.isclose(factor, by_file, rtol=1e-12, atol=0):
                converted.add("FRFs")
            else:
                label = " and ".join(f"'{label}'" for label in (f.unit, f.denominator_unit) if label)
                if not units.is_si:
                    self.notes.add(
                        "labels before units",
                        f"the unit label '{f.unit}' of FRFs takes precedence over dataset 164 ({f.place})",
                    )
                if factor != 1.0:
                    words = f"FRFs with the unit label {label} are multiplied by {factor:.6g} to SI"
                    self.notes.add(words, f"{words} ({f.place})")
            out.append((replace(f, values=f.values * factor), kind))
        if not self.nodes.any_turned:
            return out
        out, lost, n_turned = turned_records(out, self.nodes)
        for words in lost:
            self.skipped.add("FRF along no global axis", words)
        if n_turned:
            words = (
                "directions of FRFs in the displacement systems of their nodes are turned into global ones"
            )
            self.notes.add(words, f"{n_turned} {words}")
        return out

    def _global_shapes(self, units: UffUnits) -> list[UffShape]:
        """Return shapes in SI along the global axes."""
        out: list[UffShape] = []
        for shape in self.shapes:
            if self.nodes.any_turned:
                shape = replace(shape, values=shape.values.copy())
                if n := turn_shape(self.nodes, shape.nodes.tolist(), shape.values):
                    words = f"displacements of shapes at {n} nodes are turned from local systems"
                    self.notes.add("shapes turned", f"{words} into global ones")
            out.append(shape_in_si(shape, units))
        return out

    def _global_functions(self, functions: Iterable[Function]) -> list[Function]:
        """Return functions whose directions are global; those along no global axis are left out by name."""
        out: list[Function] = []
        for f in functions:
            ends = [self.nodes.global_label(end) for end in (f.response, f.reference)]
            if ends[0] is None or ends[1] is None:
                words = f"{f.type_name} {f.response}/{f.reference} is along no global axis"
                self.skipped.add("58 along no global axis", f"{f.place}: {words}")
                continue
            out.append(replace(f, response=ends[0], reference=ends[1]))
        return out
