"""``dovetail check``: probable faults of the model, and what ``dovetail run`` would refuse."""

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
from dovetail.file.table import StudyError
from dovetail.study import Study, load_study
from fem.checks import Defect, check_model
from fem.io.atomic import replacing
from fem.summary import counted
from viz.offscreen import require_drawing

HELP = "list probable faults of the model, such as loose parts, and what 'run' would refuse"
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
    study, refusals = _read(options.study)
    unread = {text for text in study.warnings if any(words in text for words in study.left_out)}
    warnings = [text for text in study.warnings if text not in study.implausible and text not in unread]
    warn(warnings)
    progress("checking the model")
    faults = tuple(f for f in check_model(study.model) if f.kind != "implausible")
    faults += tuple(Defect("implausible", words) for words in study.implausible)
    faults += tuple(Defect("refused", words) for words in refusals)
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
    mesh, more = study.model.mesh, counted(len(warnings), "warning")
    say(
        options,
        f"{study.name}: {mesh.n_points} points, {mesh.n_lines} elements, {len(mesh.members)} members",
        *(f"  {f.kind}: {f.message}" for f in faults),
        *notes_of_mesh(study),
        *([""] if notes_of_mesh(study) else []),
        (f"{len(faults)} fault(s) found" if faults else "no faults found")
        + (f", {more}" if warnings else ""),
    )
    if refusals:
        msg = f"{options.study}: 'dovetail run' would refuse it: {refusals[0]}"
        raise StudyError(msg)


def _read(path: Path) -> tuple[Study, tuple[str, ...]]:
    """Return a study, and why ``dovetail run`` would refuse it; without the parts that cannot be read."""
    from dovetail.modes_pipeline import has_modes_alone
    from dovetail.pipeline import measured, without_held_out
    from updating.inference.preparation import usable_lines

    try:
        study = load_study(path)
        if study.has_data and not has_modes_alone(study):
            for measurement in measured(study, phases=False):
                usable_lines(without_held_out(study, measurement), study.band)
        return study, ()
    except (ValueError, OSError) as reason:
        study = load_study(path, needs=())  # an error of the model itself comes again
        why = f"{reason.filename}: {reason.strerror}" if isinstance(reason, OSError) else str(reason)
        return study, tuple(dict.fromkeys([*study.left_out, " ".join(why.split())]))
