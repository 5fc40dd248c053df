"""``dovetail diagnose``: the effect that the model lacks, without a report."""

import argparse

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_processes, count
from dovetail.commands.common import Options, check_places, loaded, noted
from dovetail.commands.diagnosis_words import found_lines, staircase, table_of_candidates
from dovetail.disk.output import Progress
from dovetail.file.contents import has_modes_alone
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
    from dovetail.mode_partners import mode_partners, partner_lines, partners_dict
    from dovetail.mode_result import mode_diagnosis_dict
    from dovetail.modes_pipeline import by_modes, diagnose_study_modes, mode_lines
    from dovetail.report import planning
    from updating.inference.workers import cores

    check_places(options)
    study = loaded(options)
    if has_modes_alone(study):
        study = by_modes(study)
        from_modes = diagnose_study_modes(study, progress)
        fields = {
            **mode_diagnosis_dict(from_modes),
            "notes": list(from_modes.notes),
            "seconds": from_modes.seconds,
        }
        return Answer(study, [*mode_lines(study.name, from_modes), *noted(study.measured_notes)], fields)
    found = pipeline.diagnose_study(study, progress, options.processes or cores(), options.budget)
    partners = mode_partners(found)
    beyond = pipeline.excluded(study, found, progress)
    excluded = planning.table_of_excluded(beyond) if beyond else None
    rounds = [table_of_candidates(ranked, k) for k, ranked in enumerate(found.rounds)]
    lines: list[str | Table] = [
        f"{study.name}: {found.verdict}; {found.reason}",
        *found_lines(found),
        "",
        staircase(found),
    ]
    lines += ["", *partner_lines(partners)] if partners else []
    lines += ["", planning.EXCLUDED, excluded] if excluded else []
    for k, (ranked, table) in enumerate(zip(found.rounds, rounds, strict=True)):
        if ranked:
            shown = table.first(options.number)
            heading = f"round {k + 1}, {min(options.number, len(ranked))} of {len(ranked)} candidates"
            lines += ["", heading, shown]
    return Answer(
        study,
        [*lines, *noted(found.notes, study.measured_notes)],
        {
            **result.diagnosis_dict(found),
            **({"measured_modes": partners_dict(partners)} if partners else {}),
            **result.excluded_dict(beyond),
            "notes": list(found.notes),
            "seconds": found.seconds,
        },
        sheets=[table for table in rounds if len(table.columns[0].values)],
    )
