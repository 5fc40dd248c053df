"""``dovetail update``: uncertain parameters fitted to modes or FRFs."""

import argparse
from pathlib import Path
from typing import Any

from dovetail.commands.common import (
    Options,
    check_places,
    loaded,
    say,
)
from dovetail.commands.update_report import REPORT, errors_before_and_after, write_update_report
from dovetail.disk.output import Output, Progress, result_folder, write_json
from dovetail.update import StudyUpdate, update_study, updated_text

HELP = "update uncertain parameters to measured modes or FRFs, with their uncertainty"
EXAMPLE = "dovetail update study.toml --out out/updated"
STUDY, JSON = "study.toml", "update.json"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="folder for report.html, update.json, study.toml with the new values, and pictures/",
    )
    p.add_argument("--force", action="store_true", help="write into a folder that holds other files")


def run(options: Options, progress: Progress) -> None:
    """Update a study's model to its measurement; write a report and the study with the new values."""
    check_places(options, Output("--out", options.out, (REPORT, STUDY, JSON, "pictures")))
    study = loaded(options)
    progress("updating")
    result = update_study(study)
    text, unsaid = updated_text(study, result.updated, options.out)
    data = _update_dict(result, unsaid)
    with result_folder(options.out, options.force) as scratch:
        progress("drawing", 0.8)
        (scratch / STUDY).write_text(text, encoding="utf-8")
        write_json(scratch / JSON, data)
        write_update_report(result, unsaid, scratch)
    progress.close()
    write_json(options.json, data)
    u = result.updated
    say(
        options,
        f"{study.name}: updated to {' and '.join(result.to)}; {u.ending.value[0]}",
        u.table(),
        *errors_before_and_after(result),
        *(f"note: {text}" for text in (*result.notes, *unsaid, *study.measured_notes)),
        f"{options.out / REPORT} and {options.out / STUDY} are written",
    )


def _update_dict(result: StudyUpdate, unsaid: tuple[str, ...]) -> dict[str, Any]:
    u = result.updated
    return {
        "study": result.study.name,
        "to": result.to,
        "ending": u.ending.value[0],
        "parameters": [
            {
                "name": p.name, "unit": p.unit, "start": p.start, "lower": p.lower, "upper": p.upper,
                "prior_std": p.prior_std, "value": p.value, "std": p.std, "interval_95": p.interval(0.95),
                "at_bound": p.at_bound, "determined": p.determined, "from_prior": p.from_prior,
                "prior_let_go": p.released,
            }
            for p in u.parameters
        ],
        "correlation": u.correlation,
        "misfit": dict(u.misfit),
        "path": [
            {
                "stage": s.stage, "values": s.values, "frequency_error": s.frequency_error, "mac": s.mac,
                "frf_db": s.frf_db,
            }
            for s in u.path
        ],
        "messages": u.messages,
        "notes": (*result.notes, *unsaid),
        "warnings": result.study.warnings,
        "mesh_notes": result.study.model.mesh.notes,
        "measured_notes": result.study.measured_notes,
    }  # fmt: skip
