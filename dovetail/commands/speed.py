"""Options of commands that compute a rotor: ``--rpm``, one speed, and ``--speeds``, several."""

import argparse
from dataclasses import replace

from dovetail.commands.argument_types import finite, speed_range
from dovetail.commands.common import Options
from dovetail.file.rotation import at_speed
from dovetail.study import Study

NO_WHIRL = "nothing that spins tilts in the mode"
"""Why the whirl of a mode is missing."""


def add_rpm(p: argparse.ArgumentParser) -> None:
    """Add the option."""
    p.add_argument(
        "--rpm",
        type=finite,
        metavar="N",
        help="speed of the members with a spin, turns a minute (default: [rotation] rpm of the study)",
    )


def add_speeds(p: argparse.ArgumentParser) -> None:
    """Add the speeds over which a rotor is computed."""
    p.add_argument(
        "--speeds",
        type=speed_range,
        required=True,
        metavar="FIRST:LAST:NUMBER",
        help="speeds of members with spin 1, in turns a minute: the first, the last, and how many, such as "
        "0:6000:61",
    )


def at_asked_speed(study: Study, options: Options) -> Study:
    """Return the study with its shafts at the speed that is asked for, or at its own.

    Raises
    ------
    ModelError
        If no member has a spin.
    """
    return study if options.rpm is None else replace(study, model=at_speed(study.model, options.rpm))
