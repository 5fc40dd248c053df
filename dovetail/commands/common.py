"""Common parts of several commands: loading a study, printing, and checks of the places to write to."""

import argparse
import sys
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.commands.labels import NodeNumbers
from dovetail.disk.output import Output, check_outputs
from dovetail.file.config import NEEDS
from dovetail.file.paths import InputFile, input_files
from dovetail.study import Study, load_study
from fem.io import write_uff
from fem.io.atomic import goes_to_stdout

Options = argparse.Namespace

ROUNDING = 1e-10
"""Values below this part of the largest of their table are printed as 0 [-]."""


def say(options: Options, *lines: str) -> None:
    """Print lines, unless quiet is asked for or standard output is wanted for JSON."""
    target = getattr(options, "json", None)
    taken = target is not None and (str(target) == "-" or goes_to_stdout(target))
    if not options.quiet and not taken:
        sys.stdout.write("".join(f"{line}\n" for line in lines))


def without_rounding(values: ArrayLike) -> NDArray[np.float64]:
    """Return values with those that are rounding beside the largest as 0."""
    v = np.asarray(values, float)
    return np.where(abs(v) > ROUNDING * abs(v).max(initial=0.0), v, 0.0)


def loaded(options: Options, needs: Collection[str] = NEEDS) -> Study:
    """Load the study of a command, and print its probable faults on standard error."""
    study = load_study(options.study, needs)
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
        With the study and, if asked for, the file for JSON.
    outputs : Output
        All others.
    more : sequence of InputFile
        Inputs besides the study.
    """
    check_outputs((*input_files(options.study), *more), *outputs, Output("--json", options.json))


def write_with_nodes(path: Path, nodes: NodeNumbers, **data: Any) -> None:
    """Write a universal file with the mesh, or with its points as the study's labels number them."""
    if nodes.own:
        write_uff(path, geometry=nodes.geometry(), trace_lines=nodes.lines(), **data)
    else:
        write_uff(path, mesh=nodes.mesh, **data)


def notes_of_mesh(study: Study) -> list[str]:
    """Return the notes of the readers of the mesh file and of the measured files."""
    notes = {
        "notes on the mesh file:": study.model.mesh.notes,
        "notes on the measured files:": study.measured_notes,
    }
    return [
        line for head, said in notes.items() if said for line in ("", head, *(f"  - {text}" for text in said))
    ]


def assumptions(study: Study, *, spreads: bool = False) -> list[str]:
    """Return the assumptions for missing entries of the study as lines, with those on deviations if asked."""
    said = [text for text in study.assumptions if spreads or text not in study.assumed_spreads]
    return ["", "assumed:", *(f"  - {text}" for text in said)] if said else []
