"""The option ``--rpm`` of commands that compute a rotor at one speed."""

import argparse
from dataclasses import replace

from dovetail.commands.argument_types import finite
from dovetail.commands.common import Options
from dovetail.file.rotation import at_speed
from dovetail.study import Study


def add_rpm(p: argparse.ArgumentParser) -> None:
    """Add the option."""
    p.add_argument(
        "--rpm",
        type=finite,
        metavar="N",
        help="speed of the members with a spin, turns a minute (default: [rotation] rpm of the study)",
    )


def at_asked_speed(study: Study, options: Options) -> Study:
    """Return the study with its shafts at the speed that is asked for, or at its own.

    Raises
    ------
    ModelError
        If no member has a spin.
    """
    return study if options.rpm is None else replace(study, model=at_speed(study.model, options.rpm))
