"""``dovetail run``: compare, diagnose, locate and report."""

import argparse
from typing import TYPE_CHECKING

from dovetail.commands.answer import Answer, show_now
from dovetail.commands.argument_types import add_processes, add_report_folder
from dovetail.commands.common import Options, check_places, loaded, noted
from dovetail.commands.diagnosis_words import diagnosis_lines
from dovetail.disk.output import Output, Progress

if TYPE_CHECKING:
    from dovetail.report.table import Table
    from dovetail.result import RunResult
    from updating.diagnosis.verdict import Verdict

EXAMPLE = "dovetail run study.toml --out out/report"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    add_report_folder(p, "report.html, result.json, frf.npz and pictures/")
    add_processes(p)


def run(options: Options, progress: Progress) -> Answer:
    """Run the diagnosis, print the verdict, and write the report."""
    from dovetail import pipeline
    from dovetail.result import NAMES, result_dict
    from updating.diagnosis.verdict import UNFINISHED
    from updating.inference.workers import cores

    def on_verdict(known: "RunResult[Verdict]") -> None:
        progress.close()
        show_now(options, _verdict_lines(known))

    out = Output("--out", options.out, NAMES)
    check_places(options, out)
    study = loaded(options)
    more = {"force": options.force, "processes": options.processes or cores()}
    with progress.ending_early():
        done = pipeline.run(study, options.out, progress, on_verdict=on_verdict, **more)
    return Answer(
        None,  # JSON is result.json
        ["", str(done.report)],
        result_dict(done),
        finished=done.diagnosis.verdict != UNFINISHED,
    )


def _verdict_lines(known: "RunResult[Verdict]") -> "list[str | Table]":
    from dovetail.report import words

    d = known.diagnosis
    return [
        f"{known.study.name}: {d.verdict}",
        words.headline(d),
        *(f"  {b.text}" for b in d.bad_readings),
        *diagnosis_lines(d, known.measured_modes, known.held_out_channels),
        *noted(known.notes, known.study.measured_notes),
    ]
