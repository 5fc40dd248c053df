"""``dovetail check``: probable faults of the model, and what ``dovetail run`` would refuse."""

from pathlib import Path

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options, assumptions, notes_of_mesh, warn
from dovetail.commands.results import Results
from dovetail.disk.output import Progress
from dovetail.file.config import NEEDS
from dovetail.file.contents import has_modes_alone, measured, without_held_out
from dovetail.file.table import StudyError
from dovetail.notebook.faults import faults_of
from dovetail.report.table import Column, Table
from dovetail.study import Study, load_study
from fem.lengths import show_lengths
from updating.measurement.measurement import usable_lines

EXAMPLE = "dovetail check study.toml --picture faults.png"
RESULTS = Results(picture="the faults, and how a mechanism moves", rendered=True)


def run(options: Options, progress: Progress) -> Answer:
    """Return probable faults of the model; draw where they are."""
    study, refusals = _read(options.study)
    show_lengths(study.length_unit)
    progress("checking the model")
    faults = faults_of(study, refusals)
    warn(faults.warnings)
    if options.picture is not None:
        from viz.render import render_faults

        progress("drawing the faults")
        render_faults(study.model, faults.found, options.picture)
    notes = [*notes_of_mesh(study), *assumptions(study)]
    refused = f"{options.study}: 'dovetail run' would refuse it: {refusals[0]}" if refusals else ""
    found = [
        {"kind": f.kind, "message": f.message, "points": f.points.tolist(), "lines": f.lines.tolist()}
        for f in faults
    ]
    return Answer(
        study,
        [
            faults.size,
            *faults.lines,
            *([*notes, ""] if notes else []),
            faults.count,
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
