"""``dovetail run``: compare, diagnose, locate and report."""

import argparse
from pathlib import Path

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_processes
from dovetail.commands.common import Options, check_places, loaded, noted
from dovetail.commands.diagnosis_words import found_lines, staircase
from dovetail.disk.output import Output, Progress
from dovetail.file.contents import has_modes_alone

EXAMPLE = "dovetail run study.toml --out out/report"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="folder for report.html, result.json, frf.npz and pictures/",
    )
    p.add_argument("--force", action="store_true", help="write into a folder that holds other files")
    add_processes(p)


def run(options: Options, progress: Progress) -> Answer:
    """Run the diagnosis, write the report and print the verdict."""
    from dovetail import pipeline
    from dovetail.mode_partners import partner_lines
    from dovetail.mode_result import mode_result_dict
    from dovetail.modes_pipeline import mode_lines, run_modes
    from dovetail.report import words
    from dovetail.result import NAMES, result_dict
    from updating.inference.workers import cores

    out = Output("--out", options.out, NAMES)
    check_places(options, out)
    study = loaded(options)
    if has_modes_alone(study):
        found = run_modes(study, options.out, progress, force=options.force)
        notes = noted(found.study.measured_notes)
        printed = [*mode_lines(study.name, found.diagnosis), *notes, "", str(found.report)]
        return Answer(None, printed, mode_result_dict(found))
    done = pipeline.run(
        study, options.out, progress, force=options.force, processes=options.processes or cores()
    )
    return Answer(
        None,  # JSON is result.json
        [
            f"{study.name}: {done.diagnosis.verdict}",
            words.headline(done),
            *found_lines(done.diagnosis),
            "",
            staircase(done.diagnosis, done.held_out_channels),
            *(["", *partner_lines(done.measured_modes)] if done.measured_modes else []),
            *noted(done.notes, study.measured_notes),
            "",
            str(done.report),
        ],
        result_dict(done),
    )
