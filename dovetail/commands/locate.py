"""``dovetail locate``: sensors, bands and places that carry the misfit."""

import argparse

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_bands, count
from dovetail.commands.common import Options, loaded
from dovetail.commands.results import Results
from dovetail.disk.output import Progress

EXAMPLE = "dovetail locate study.toml --picture located.png"
RESULTS = Results(picture="sensors, members and joints coloured by their part in the misfit", rendered=True)


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    add_bands(p)
    p.add_argument(
        "--number", type=count, default=20, metavar="N", help="sensors and places to print (default 20)"
    )


def run(options: Options, progress: Progress) -> Answer:
    """Return which sensors, bands, members and places carry the misfit."""
    from dovetail.notebook.located import located
    from dovetail.result import localisation_dict

    study = loaded(options)
    found = located(study, options.bands, progress)
    if options.picture is not None:
        found.draw(options.picture)
    sheets = [found.sensors, *([found.places] if found.where.says_where else [])]
    return Answer(study, found.printed(options.number), localisation_dict(found.where), sheets=sheets)
