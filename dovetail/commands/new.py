"""``dovetail new``: a study to start from."""

import argparse
from pathlib import Path

from dovetail.commands.common import (
    Options,
    say,
)
from dovetail.disk.output import OutputError, Progress, result_folder

HELP = "write a commented study to start from"
EXAMPLE = "dovetail new my-frame"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument("folder", type=Path, metavar="DIR", help="folder to make")
    p.add_argument("--force", action="store_true", help="write into a folder that holds other files")


def run(options: Options, progress: Progress) -> None:
    """Write a study to start from, and FRFs for it."""
    from dovetail.file.template import write_template

    for name in ("study.toml", "frf.npz"):
        if options.force and (options.folder / name).exists():
            msg = f"{options.folder / name} exists and would be overwritten; choose another folder"
            raise OutputError(msg)
    progress("computing its measurement")
    with result_folder(options.folder, options.force) as scratch:
        write_template(scratch)
    (options.folder / ".dovetail").unlink(missing_ok=True)  # from now on it is the user's
    progress.close()
    say(
        options,
        f"{options.folder / 'study.toml'} is written: a portal frame, to be changed into yours.",
        f"{options.folder / 'frf.npz'} is a simulated measurement, with noise and with an effect "
        "that the study lacks.",
        "Next:",
        f"  dovetail modes {options.folder / 'study.toml'}",
    )
