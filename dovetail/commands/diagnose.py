"""``dovetail diagnose``: the effect that the model lacks, without a report."""

import argparse

from dovetail.commands.argument_types import add_processes, count
from dovetail.commands.common import (
    Options,
    check_places,
    loaded,
    say,
)
from dovetail.commands.diagnosis_words import found_lines, staircase
from dovetail.commands.tables import cell, width_of
from dovetail.disk.output import Progress, write_json

HELP = "find which effect the model lacks, without a report"
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


def run(options: Options, progress: Progress) -> None:
    """Print the missing effects and the ranking of all candidates."""
    from dovetail import pipeline, result
    from dovetail.mode_result import mode_diagnosis_dict
    from dovetail.modes_beside import beside_dict, beside_lines, modes_beside
    from dovetail.modes_pipeline import by_modes, diagnose_study_modes, has_modes_alone, mode_lines
    from dovetail.report import planning, words
    from updating.correlation import DB_PER_NEPER
    from updating.inference.workers import cores

    check_places(options)
    study = loaded(options)
    if has_modes_alone(study):
        study = by_modes(study)
        from_modes = diagnose_study_modes(study, progress)
        progress.close()
        write_json(
            options.json,
            {
                "study": study.name,
                **mode_diagnosis_dict(from_modes),
                "notes": list(from_modes.notes),
                "measured_notes": study.measured_notes,
                "warnings": study.warnings,
                "seconds": from_modes.seconds,
            },
        )
        notes = (f"note: {note}" for note in study.measured_notes)
        say(options, *mode_lines(study.name, from_modes), *notes)
        return
    found = pipeline.diagnose_study(study, progress, options.processes or cores(), options.budget)
    beside = modes_beside(found)
    beyond = pipeline.excluded(study, found, progress)
    progress.close()
    write_json(
        options.json,
        {
            "study": study.name,
            **result.diagnosis_dict(found),
            **({"measured_modes": beside_dict(beside)} if beside else {}),
            **result.excluded_dict(beyond),
            "notes": list(found.notes),
            "measured_notes": study.measured_notes,
            "warnings": study.warnings,
            "seconds": found.seconds,
        },
    )
    lines = [f"{study.name}: {found.verdict}; {found.reason}", *found_lines(found), "", *staircase(found)]
    lines += ["", *beside_lines(beside)] if beside else []
    lines += (
        ["", planning.EXCLUDED, *words.columns(planning.EXCLUDED_HEAD, planning.excluded_rows(beyond))]
        if beyond
        else []
    )
    for k, ranked in enumerate(found.rounds):
        if not ranked:
            continue
        shown = ranked[: options.number]
        width = width_of([words.ranked_label(r) for r in shown])
        lines += [
            "",
            f"round {k + 1}, {len(shown)} of {len(ranked)} candidates",
            f"{'':{width}}  level dB  fitted dB  held-out dB  similarity",
            *(
                f"{words.ranked_label(r):{width}}  {r.level * DB_PER_NEPER:8.2f}  {r.fit_db:9.2f}  "
                f"{cell(r.held_out_db, 11)}  "
                f"{r.similarity:10.2f}  "
                f"{words.parameters_text(r.parameters)}"
                for r in shown
            ),
        ]
    say(options, *lines, *(f"note: {note}" for note in (*found.notes, *study.measured_notes)))
