"""Universal files (UFF, ``.uff`` and ``.unv``): the datasets that are read, and their results.

Datasets that define the meaning of others (units 164, coordinate systems 18 and 2420, nodes) act on all of
the file, whatever their place. Lengths and forces are in SI, positions and directions along the global axes.
A dataset of another type is in ``skipped``, unless it says nothing about geometry or measured values.
"""

import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.modes import Modes
from fem.io.faults import error_at
from fem.io.rawmesh import RawMesh, mesh_of
from fem.io.uff_elements import Elements, UffGroup
from fem.io.uff_format import UffError, split_blocks
from fem.io.uff_mesh import raw_mesh_of
from fem.io.uff_reader import FileReader
from fem.io.uff_types import Function, Header, Points, TraceLine, UffUnits
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
