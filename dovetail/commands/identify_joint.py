"""``dovetail identify-joint``: a joint fitted to measured FRFs."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import not_negative, positive
from dovetail.commands.common import Options, loaded
from dovetail.commands.results import Results, Written
from dovetail.disk.output import Progress
from fem.io.atomic import replacing

EXAMPLE = "dovetail identify-joint study.toml --joint J --directions rx --propose new.toml --picture Z.png"

RESULTS = Results(
    table="values, covariance, and Z line by line with its condition numbers",
    formats=(".npz",),
    picture="the dynamic stiffness over frequency",
    more=(Written("--propose", "write the study with the identified joint", (".toml",)),),
)


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument("--joint", required=True, metavar="NAME", help="name of the joint in the study")
    p.add_argument(
        "--directions",
        required=True,
        metavar="LIST",
        help="relative motions to identify, such as z,rx or xyz; the others keep the study's values",
    )
    p.add_argument(
        "--terms",
        metavar="LIST",
        default="K,D",
        help="terms of each direction: some of K, C, D (stiffness, viscous and structural damping), or "
        "one of zener, fractional_kelvin_voigt, fractional_zener (default K,D)",
    )
    p.add_argument("--coupled", action="store_true", help="let the stiffness couple the directions")
    p.add_argument(
        "--accuracy",
        type=not_negative,
        default=0.05,
        metavar="X",
        help="accuracy expected of the model, relative to each FRF; 0 means exact (default 0.05)",
    )
    p.add_argument("--measurement", metavar="NAME", help="which measurement (default: the first)")
    p.add_argument(
        "--amplification",
        type=positive,
        default=1e3,
        metavar="X",
        help="line by line: largest amplification of errors, cond(A)·cond(B), of a line that counts "
        "(default 1000)",
    )


def run(options: Options, progress: Progress) -> Answer:
    """Fit a joint by output error; show it line by line in addition; write the joint into a study."""
    from dovetail.identify import read_task, write_proposal
    from dovetail.report.joint import draw_joint, joint_result, joint_words
    from joint import JointIdentificationError
    from joint.assembly import identify, summarise
    from joint.assembly_fit import estimate

    study = loaded(options)
    task = read_task(study, options.joint, options.directions, options.measurement)
    terms = tuple(options.terms.replace(",", " ").split())
    progress("line by line")
    lines, reason = None, ""
    try:
        lines = identify(task, options.amplification)
    except JointIdentificationError as refusal:
        reason = str(refusal).partition(": ")[2]
    progress("fitting the joint to all lines")
    found = estimate(task, terms, coupled=options.coupled, accuracy=options.accuracy, lines=lines)
    summary = [] if lines is None else summarise(lines, task.directions)
    if options.out is not None:
        _write_joint(options.out, found, lines)
    if options.picture is not None:
        draw_joint(found, options.picture, options.amplification)
    proposal = write_proposal(study, found, options.propose) if options.propose is not None else ()
    check = f"Check it with dovetail compare {options.propose}"
    written = [f"{options.propose} is written: the study with this joint. {check}"] if proposal else []
    printed = [*joint_words(found, lines, summary, reason), *written]
    return Answer(study, printed, joint_result(study.name, found, lines, summary))


def _write_joint(path: Path, found: Any, lines: Any) -> None:
    fit = found.fit
    arrays: dict[str, Any] = {
        "directions": np.array(found.task.directions),
        "names": np.array(fit.form.names),
        "values": fit.values,
        "covariance": fit.covariance,
        "fit_frequency": fit.frequency,
        "H": fit.H,
        "measured": found.measured,
    }
    if lines is not None:
        arrays |= {
            "frequency": lines.frequency,
            "Z": lines.z,
            "regular": lines.regular,
            "condition_A": lines.condition_A,
            "condition_B": lines.condition_B,
            "residual": lines.residual,
        }
    with replacing(path) as scratch, scratch.open("wb") as file:
        np.savez_compressed(file, **arrays)
