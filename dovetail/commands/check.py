"""``dovetail check``: probable faults of the model, and what ``dovetail run`` would refuse."""

from pathlib import Path

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options, assumptions, notes_of_mesh, warn
from dovetail.commands.results import Results
from dovetail.disk.output import Progress
from dovetail.file.config import NEEDS
from dovetail.file.contents import has_modes_alone, measured, without_held_out
from dovetail.file.table import StudyError
from dovetail.report.table import Column, Table
from dovetail.study import Study, load_study
from fem.checks import Defect, check_model
from fem.io.atomic import replacing
from fem.lengths import show_lengths
from fem.summary import counted
from updating.measurement.measurement import usable_lines
from updating.quality.channels import check_channels

EXAMPLE = "dovetail check study.toml --picture faults.png"
UNMOVED = {"model", "no properties", "mechanism", "loose part", "unused point"}
"""Faults of a model that has no motion, or one that nothing opposes: nothing is asked of its sensors."""
RESULTS = Results(picture="the faults, and how a mechanism moves", rendered=True)


def run(options: Options, progress: Progress) -> Answer:
    """Return probable faults of the model; draw where they are."""
    study, refusals = _read(options.study)
    show_lengths(study.length_unit)
    unread = {text for text in study.warnings if any(words in text for words in study.left_out)}
    warnings = [text for text in study.warnings if text not in study.implausible and text not in unread]
    warn(warnings)
    progress("checking the model")
    faults = tuple(f for f in check_model(study.model) if f.kind != "implausible")
    faults += tuple(Defect("implausible", words) for words in study.implausible)
    if not any(f.kind in UNMOVED for f in faults):
        lines = study.measurements[0].frf.frequency if study.measurements else study.frequency
        faults += check_channels(study.model, study.sensors, study.excitations, lines, study.measurements)
    faults += tuple(Defect("refused", words) for words in refusals)
    if options.picture is not None:
        from viz.render import render_faults

        progress("drawing the faults")
        with replacing(options.picture) as scratch:
            render_faults(study.model, faults, scratch)
    mesh, more = study.model.mesh, counted(len(warnings), "warning")
    notes = [*notes_of_mesh(study), *assumptions(study)]
    refused = f"{options.study}: 'dovetail run' would refuse it: {refusals[0]}" if refusals else ""
    found = [
        {"kind": f.kind, "message": f.message, "points": f.points.tolist(), "lines": f.lines.tolist()}
        for f in faults
    ]
    return Answer(
        study,
        [
            f"{study.name}: {mesh.n_points} points, {mesh.n_lines} elements, {len(mesh.members)} members",
            *(f"  {f.kind}: {f.message}" for f in faults),
            *([*notes, ""] if notes else []),
            (f"{len(faults)} fault(s) found" if faults else "no faults found") + f", {more}" * bool(warnings),
        ],
        {"faults": found},
        sheets=[Table.of("faults", *(Column(key, [f[key] for f in found]) for key in ("kind", "message")))],
        refusal=StudyError(refused) if refused else None,
    )


def _read(path: Path) -> tuple[Study, tuple[str, ...]]:
    """Return a study, and why ``dovetail run`` would refuse it; without the parts that cannot be read."""
    try:
        study = load_study(path, NEEDS)
        if study.has_data and not has_modes_alone(study):
            for measurement in measured(study, phases=False):
                usable_lines(without_held_out(study, measurement), study.band)
        return study, ()
    except (ValueError, OSError) as reason:
        study = load_study(path, needs=())  # an error of the model itself comes again
        why = f"{reason.filename}: {reason.strerror}" if isinstance(reason, OSError) else str(reason)
        return study, tuple(dict.fromkeys([*study.left_out, " ".join(why.split())]))
