"""``dovetail fleet``: many units of one structure, their population and its outliers."""

import argparse
from pathlib import Path

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_pool, integer_up_to
from dovetail.commands.common import Options, check_places, warn
from dovetail.commands.stepping import step_progress
from dovetail.disk.output import Output, Progress
from dovetail.file.paths import InputFile
from dovetail.units.pool import pool_of

EXAMPLE = "dovetail fleet study.toml units/*.uff --diagnose 5 --out out/fleet"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "units", type=Path, nargs="+", metavar="FILE", help="FRFs of each unit; the first gives the lines"
    )
    p.add_argument(
        "--diagnose",
        type=integer_up_to(100_000, 0),
        default=0,
        metavar="N",
        help="full diagnosis of up to N units that are more probably outliers than not (default 0)",
    )
    p.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder of results (default: fleet-STUDY); a run that was stopped, and one with more units, "
        "continues there",
    )
    add_pool(p, "units")


def run(options: Options, progress: Progress) -> Answer:
    """Triage the units, rank them, diagnose the outliers, and write table and page."""
    from dovetail.fleet.diagnosing import diagnose_outliers
    from dovetail.fleet.run import JOURNAL, UNITS, run_fleet
    from dovetail.fleet.triage import Fleet
    from dovetail.fleet.written import (
        PAGE,
        PICTURE,
        RANKING,
        as_dict,
        lines_of,
        ranking,
        rows_of,
        write_files,
    )

    folder: Path = options.out or Path(f"fleet-{options.study.stem}")
    files = [Path(f) for f in dict.fromkeys(options.units)]
    names = (JOURNAL, UNITS, RANKING, PAGE, PICTURE)
    read = [InputFile(f, "the FRFs of a unit") for f in files]
    check_places(options, Output("--out", folder, names), more=read)
    progress("building the shared basis")
    fleet = Fleet.of(options.study.read_text(encoding="utf-8"), options.study, files)
    study = fleet.study_of(files[0])
    warn(study.warnings)
    with pool_of(options.processes, options.scheduler) as pool:
        found = run_fleet(fleet, files, folder, pool, step_progress(options, progress))
        diagnoses, failures = {}, ()
        if options.diagnose:
            progress("diagnosing outliers", 0, options.diagnose)
            diagnoses, failures = diagnose_outliers(
                found, options.diagnose, folder, pool, step_progress(options, progress)
            )
    rows = rows_of(found, diagnoses)
    progress("writing", 1, 1)
    write_files(found, rows, study, folder, failures)
    printed = [*lines_of(found, rows, study, failures), f"written to {folder}"]
    return Answer(study, printed, as_dict(found, rows, study, diagnoses, failures), full=ranking(rows))
