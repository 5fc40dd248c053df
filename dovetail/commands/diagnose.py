"""``dovetail diagnose``: the effect that the model lacks, without a report."""

import argparse
from typing import TYPE_CHECKING

from dovetail.commands.answer import Answer, show_now
from dovetail.commands.argument_types import add_processes, count
from dovetail.commands.common import Options, check_places, loaded, noted
from dovetail.commands.diagnosis_words import diagnosis_lines
from dovetail.disk.output import Progress

if TYPE_CHECKING:
    from dovetail.report.table import Table

EXAMPLE = "dovetail diagnose study.toml"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument("--number", type=count, default=20, metavar="N", help="candidates to print (default 20)")
    add_processes(p)
    p.add_argument(
        "--budget",
        choices=("quick", "normal", "thorough"),
        default="normal",
        help="how much is tried with FRFs (default normal); quick gives a first answer",
    )


def run(options: Options, progress: Progress) -> Answer:
    """Return the missing effects and the ranking of all candidates."""
    from dovetail import pipeline, result
    from dovetail.modes_pipeline import by_modes
    from dovetail.report import planning, words
    from dovetail.report.sections import rounds
    from updating.diagnosis.verdict import UNFINISHED
    from updating.inference.workers import cores

    check_places(options)
    study = by_modes(loaded(options))
    with progress.ending_early():
        found = pipeline.diagnose_any(study, progress, options.processes or cores(), options.budget)
    modes = pipeline.measured_modes(found) if result.by_frfs(found) else found.modes
    head = [f"{study.name}: {found.verdict}; {found.reason}", words.headline(found)]
    known = [*head, *diagnosis_lines(found, modes)]
    progress.close()
    show_now(options, known)
    beyond = pipeline.excluded(study, found, progress)
    fields = result.diagnosis_dict(found) | result.excluded_dict(beyond)
    lines: list[str | Table] = []
    for heading, table in planning.tables_of_excluded(beyond) if beyond else ():
        lines += ["", heading, table]
    if result.by_frfs(found):
        fields |= result.modes_dict(modes)
        lines += rounds.lines(found, options.number)
    notes = result.notes_of(found)
    return Answer(
        study,
        [*lines, *noted(notes, study.measured_notes)],
        {**fields, "notes": list(notes), "seconds": found.seconds},
        sheets=[rounds.table(ranked, k, found.model) for k, ranked in enumerate(found.rounds) if ranked],
        finished=found.verdict != UNFINISHED,
        shown=known,
    )
