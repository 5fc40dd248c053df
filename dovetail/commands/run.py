"""``dovetail run``: compare, diagnose, locate and report."""

import argparse

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_processes, add_report_folder
from dovetail.commands.common import Options, check_places, loaded, noted
from dovetail.commands.diagnosis_words import diagnosis_lines
from dovetail.disk.output import Output, Progress

EXAMPLE = "dovetail run study.toml --out out/report"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    add_report_folder(p, "report.html, result.json, frf.npz and pictures/")
    add_processes(p)


def run(options: Options, progress: Progress) -> Answer:
    """Run the diagnosis, write the report and print the verdict."""
    from dovetail import pipeline
    from dovetail.report import words
    from dovetail.result import NAMES, result_dict
    from updating.diagnosis.verdict import UNFINISHED
    from updating.inference.workers import cores

    out = Output("--out", options.out, NAMES)
    check_places(options, out)
    study = loaded(options)
    with progress.ending_early():
        done = pipeline.run(
            study, options.out, progress, force=options.force, processes=options.processes or cores()
        )
    d = done.diagnosis
    return Answer(
        None,  # JSON is result.json
        [
            f"{study.name}: {d.verdict}",
            words.headline(done),
            *(f"  {b.text}" for b in d.bad_readings),
            *diagnosis_lines(d, done.measured_modes, done.held_out_channels),
            *noted(done.notes, done.study.measured_notes),
            "",
            str(done.report),
        ],
        result_dict(done),
        finished=d.verdict != UNFINISHED,
    )
