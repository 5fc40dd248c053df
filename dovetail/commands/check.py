"""``dovetail check``: probable faults of the model."""

import argparse
from pathlib import Path

from dovetail.commands.common import (
    Options,
    check_places,
    notes_of_mesh,
    say,
    warn,
)
from dovetail.disk.output import Output, OutputError, Progress, write_json
from dovetail.study import load_study
from fem.checks import Defect, check_model
from fem.io.atomic import replacing
from viz.offscreen import require_drawing

HELP = "list probable faults of the model: loose parts, crossings, mechanisms"
EXAMPLE = "dovetail check study.toml --picture faults.png"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--picture", type=Path, metavar="FILE", help="also draw the faults, and how a mechanism moves"
    )


def run(options: Options, progress: Progress) -> None:
    """Print probable faults of the model; draw where they are."""
    if options.picture is not None and options.picture.suffix.lower() != ".png":
        msg = f"{options.picture}: the picture is written as .png"
        raise OutputError(msg)
    check_places(options, Output("--picture", options.picture))
    if options.picture is not None:
        require_drawing("--picture")
    study = load_study(options.study, needs=())
    warn(text for text in study.warnings if text not in study.implausible)
    progress("checking the model")
    faults = tuple(f for f in check_model(study.model) if f.kind != "implausible")
    faults += tuple(Defect("implausible", words) for words in study.implausible)
    if options.picture is not None:
        from viz.render import render_faults

        progress("drawing the faults")
        with replacing(options.picture) as scratch:
            render_faults(study.model, faults, scratch)
    progress.close()
    write_json(
        options.json,
        {
            "study": study.name,
            "warnings": study.warnings,
            "faults": [
                {"kind": f.kind, "message": f.message, "points": f.points.tolist(), "lines": f.lines.tolist()}
                for f in faults
            ],
            "mesh_notes": study.model.mesh.notes,
            "measured_notes": study.measured_notes,
            "assumptions": study.assumptions,
        },
    )
    mesh = study.model.mesh
    say(
        options,
        f"{study.name}: {mesh.n_points} points, {mesh.n_lines} elements, {len(mesh.members)} members",
        *(f"  {f.kind}: {f.message}" for f in faults),
        f"{len(faults)} fault(s) found" if faults else "no faults found",
        *notes_of_mesh(study),
    )
