"""Common parts of several commands: loading a study, notes, and checks of the places to write to."""

import argparse
import sys
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.commands.labels import NodeNumbers
from dovetail.disk.output import Output, OutputError, check_outputs
from dovetail.file.config import NEEDS
from dovetail.file.paths import InputFile, input_files
from dovetail.report.office import office
from dovetail.study import Study, load_study
from fem.io import write_uff
from fem.lengths import show_lengths

Options = argparse.Namespace

ROUNDING = 1e-10
"""Values below this part of the largest of their table are printed as 0 [-]."""


def without_rounding(values: ArrayLike) -> NDArray[np.float64]:
    """Return values with rounding errors, relative to the largest, as 0."""
    v = np.asarray(values, float)
    return np.where(abs(v) > ROUNDING * abs(v).max(initial=0.0), v, 0.0)


def first_largest(values: ArrayLike) -> int:
    """Return the flat index of the largest value: the first of those that differ by rounding alone."""
    v = np.asarray(values, float).ravel()
    return int(np.argmax(v >= v.max() - ROUNDING * abs(v).max()))


def loaded(options: Options, needs: Collection[str] = NEEDS) -> Study:
    """Load the study of a command, and print its probable faults on standard error."""
    study = load_study(options.study, needs)
    show_lengths(study.length_unit)
    warn(study.warnings)
    return study


def warn(sentences: Iterable[str]) -> None:
    """Write warnings to standard error, whatever else is asked for."""
    sys.stderr.write("".join(f"dovetail: warning: {text}\n" for text in sentences))


def check_places(options: Options, *outputs: Output, more: Sequence[InputFile] = ()) -> None:
    """Refuse outputs over a command's inputs, over one another, or where nothing can be written.

    Parameters
    ----------
    options : Options
        With the study, if the command has one, and the files for JSON and Excel, if asked for.
    outputs : Output
        All others.
    more : sequence of InputFile
        Inputs besides the study.

    Raises
    ------
    OutputError, OfficeError
        For an Excel file of another suffix, or without its library, and as
        :func:`dovetail.disk.output.check_outputs`.
    """
    xlsx = getattr(options, "xlsx", None)
    if xlsx is not None and xlsx.suffix.lower() != ".xlsx":
        msg = f"--xlsx {xlsx} is written as .xlsx, not '{xlsx.suffix}'"
        raise OutputError(msg)
    if xlsx is not None:
        office("openpyxl")
    study = getattr(options, "study", None)
    known = (*(() if study is None else input_files(study)), *more)
    json = getattr(options, "json", None)
    check_outputs(known, *outputs, Output("--json", json), Output("--xlsx", xlsx))


def write_with_nodes(path: Path, nodes: NodeNumbers, **data: Any) -> None:
    """Write a universal file with the mesh, or with its points as the study's labels number them."""
    if nodes.from_labels:
        write_uff(path, geometry=nodes.geometry(), trace_lines=nodes.lines(), **data)
    else:
        write_uff(path, mesh=nodes.mesh, **data)


def notes_of_mesh(study: Study) -> list[str]:
    """Return the notes of the readers of the mesh file and of the measured files."""
    notes = {
        "notes on the mesh file:": study.model.mesh.notes,
        "notes on the measured files:": study.measured_notes,
    }
    return [line for head, texts in notes.items() if texts for line in ("", head, *_listed(texts))]


def assumptions(study: Study, *, spreads: bool = False) -> list[str]:
    """Return the assumptions for missing entries of the study as lines, with those on deviations if asked."""
    texts = [text for text in study.assumptions if spreads or text not in study.assumed_spreads]
    return ["", "assumed:", *_listed(texts)] if texts else []


def noted(*notes: Iterable[str]) -> list[str]:
    """Return notes as printed lines."""
    return [f"note: {text}" for texts in notes for text in texts]


def _listed(texts: Iterable[str]) -> list[str]:
    return [f"  - {text}" for text in texts]
