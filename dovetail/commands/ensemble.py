"""``dovetail ensemble``: bands of natural frequencies and FRFs from uncertain parameters."""

import argparse
from pathlib import Path

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_kind, add_pool, integer_up_to, natural
from dovetail.commands.common import Options, assumptions, check_places, loaded
from dovetail.commands.frf import add_lines, asked_lines
from dovetail.commands.load_cases import refuse_gauges
from dovetail.commands.stepping import step_progress
from dovetail.disk.output import Output, OutputError, Progress
from dovetail.units.pool import pool_of
from fem.analysis.frf import FRFKind

EXAMPLE = "dovetail ensemble study.toml --samples 10000 --processes 4 --out out/ensemble"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--samples",
        type=integer_up_to(10_000_000),
        default=1000,
        metavar="N",
        help="samples of the parameters of [uncertain] and of the damping (default 1000)",
    )
    p.add_argument("--seed", type=natural, default=0, metavar="S", help="seed of the samples (default 0)")
    p.add_argument(
        "--checks",
        type=integer_up_to(1_000_000, 0),
        default=5,
        metavar="M",
        help="samples that the full model solves as well, for the error of the reduced basis (default 5)",
    )
    p.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder of samples and results (default: ensemble-STUDY); a run that was stopped, and one with "
        "more samples, continues there",
    )
    add_kind(p)
    add_lines(p)
    add_pool(p, "samples")


def run(options: Options, progress: Progress) -> Answer:
    """Compute samples, print and write their bands."""
    from dovetail.ensemble.run import JOURNAL, SAMPLES, run_ensemble
    from dovetail.ensemble.samples import SampledModel
    from dovetail.ensemble.written import BANDS, FREQUENCIES, FRFS, PICTURE, as_dict, lines_of, write_files

    folder: Path = options.out or Path(f"ensemble-{options.study.stem}")
    names = (JOURNAL, SAMPLES, BANDS, FREQUENCIES, FRFS, PICTURE)
    check_places(options, Output("--out", folder, names))
    study = loaded(options, ("sensors",))
    if not study.nuisances and not study.damping_std:
        msg = f"{study.path}: nothing in it is uncertain; give standard deviations in [uncertain]"
        raise OutputError(msg)
    refuse_gauges(study)
    n_frfs = len(study.sensors) * len(study.excitations)
    frequency = asked_lines(study, options, max(n_frfs, 1))
    measured = study.measurements[0].frf.kind if study.measurements else FRFKind.ACCELERANCE
    progress("building the reduced basis")
    model = SampledModel.of(
        study.model,
        study.nuisances,
        study.damping_std,
        frequency[frequency > 0],
        study.sensors,
        study.excitations,
        FRFKind(options.kind or measured),
        options.seed,
    )
    with pool_of(options.processes, options.scheduler) as pool:
        shown = step_progress(options, progress)
        found = run_ensemble(model, options.samples, options.checks, folder, pool, shown)
    progress("writing", 1, 1)
    write_files(found, study, folder)
    printed = [*lines_of(found, study), f"written to {folder}", *assumptions(study, spreads=True)]
    return Answer(study, printed, as_dict(found, study))
