"""``dovetail candidates``: the effects that may be added to a model, by name and place."""

import argparse

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options, check_places, loaded
from dovetail.disk.output import Progress
from dovetail.report.table import Column, Table

EXAMPLE = "dovetail candidates study.toml --at joint:J"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--at",
        action="append",
        metavar="PLACE",
        help="only those at a place, such as joint:J, member:beam, support:base or end:beam.1; repeatable",
    )
    p.add_argument(
        "--kind",
        action="append",
        metavar="KIND",
        help="only those of a kind, such as point_mass; repeatable (default: all that the study allows)",
    )


def run(options: Options, progress: Progress) -> Answer:
    """Return names, places and parameters of candidates."""
    from dovetail.notebook.candidates import parameter_text
    from dovetail.report.words import unstated_text
    from updating.diagnosis.candidates import admitted, situated

    check_places(options)
    study = loaded(options, needs=("sensors",))
    found = study.candidates(options.kind, options.at)
    model = situated(study.model, options.kind or study.kinds)
    rows = [row | {"admitted": admitted(e, model)} for row, e in zip(found.rows(), found, strict=True)]
    table = Table.of(
        "candidates",
        Column("candidate", found.names),
        Column("where", [e.where for e in found]),
        Column("parameters", [", ".join(map(parameter_text, e.parameters())) for e in found]),
    )
    return Answer(
        study,
        [
            f"{study.name}: {len(found)} candidates; each parameter with its first value and its bounds",
            table,
            *(unstated_text(model) if options.kind is None else ()),
        ],
        {"candidates": rows},
    )
