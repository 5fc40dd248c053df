"""The command line."""

import argparse
import errno
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from dovetail.commands import commands, investigate, measure
from dovetail.disk.output import Progress
from dovetail.validation import command as validation
from viz.offscreen import DrawingError

OF_THE_MACHINE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EPIPE, None)
"""Errors of files that are none of what was asked for: a full disk, a reader that has gone."""

OURS = ("fem", "updating", "joint", "viz", "dovetail")
"""Packages whose ValueErrors say in one line what is wrong with the input."""

DESCRIPTION = """\
Compare a frame model with measured frequency responses, find which physical effect the model lacks, add it
and report.
"""

EPILOG = """\
begin with:
  dovetail new my-frame
  dovetail modes my-frame/study.toml

docs/study-file.md says what a study file may hold. Exit code: 0, 2 for bad input, 1 for anything else.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code: 0, 2 for bad input, 1 for anything else."""
    try:
        options = build_parser().parse_args(argv)
    except SystemExit as stop:  # argparse has said why
        return int(stop.code or 0)
    progress = Progress(getattr(options, "quiet", False))
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _warn
            options.run(options, progress)
        sys.stdout.flush()  # while an error of it can still be said
    except KeyboardInterrupt:
        progress.close()
        sys.stderr.write("dovetail: interrupted\n")
        return 1
    except Exception as reason:
        progress.close()
        if options.debug:
            traceback.print_exc()
        if _is_of_stdout(reason):
            return _without_stdout(reason)
        full = isinstance(reason, OSError) and reason.errno in OF_THE_MACHINE
        if full or isinstance(reason, DrawingError):
            sys.stderr.write(f"dovetail: {_one_line(reason)}\n")
            return 1
        bad_input = isinstance(reason, OSError) or (
            isinstance(reason, ValueError) and type(reason).__module__.split(".")[0] in OURS
        )
        if bad_input:
            sys.stderr.write(f"dovetail: {_one_line(reason)}\n")
            return 2
        hint = "" if options.debug else " (a fault of the program; --debug shows where)"
        sys.stderr.write(f"dovetail: {type(reason).__name__}: {_one_line(reason)}{hint}\n")
        return 1
    finally:
        progress.close()
    return 0


def _is_of_stdout(reason: BaseException) -> bool:
    """Whether an error is that of printing."""
    if not isinstance(reason, OSError) or reason.filename is not None:
        return False
    try:
        sys.stdout.flush()
    except OSError:
        return True
    return isinstance(reason, BrokenPipeError)


def _without_stdout(reason: BaseException) -> int:
    """Say why nothing more can be printed, unless the reader has gone as ``head`` does; return 1."""
    with open(os.devnull, "wb") as nowhere:  # what is left in the buffer has nowhere to go
        os.dup2(nowhere.fileno(), sys.stdout.fileno())
    if not isinstance(reason, BrokenPipeError):
        sys.stderr.write(f"dovetail: standard output: {getattr(reason, 'strerror', reason)}\n")
    return 1


def _one_line(reason: BaseException) -> str:
    if isinstance(reason, OSError) and reason.filename is not None:
        return f"{reason.filename}: {reason.strerror}"
    text = "; ".join(line.strip() for line in str(reason).split("\n") if line.strip())
    # a name from a file may hold control characters, which a terminal would obey and not show
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def _warn(message: Warning | str, *_: Any, **__: Any) -> None:
    sys.stderr.write(f"dovetail: warning: {' '.join(str(message).split())}\n")


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    plain = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        "dovetail", description=DESCRIPTION, epilog=EPILOG, formatter_class=plain
    )
    parser.add_argument("--version", action="version", version=f"dovetail {_version()}")
    parser.set_defaults(debug=False)
    sub = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)

    def command(name: str, run: Any, help: str, example: str, study: bool = True) -> argparse.ArgumentParser:
        p = sub.add_parser(
            name,
            help=help,
            description=f"{help[0].upper()}{help[1:]}.",
            epilog=f"example:\n  {example}",
            formatter_class=plain,
        )
        p.set_defaults(run=run)
        if study:
            p.add_argument("study", type=Path, help="the study file (TOML)")
            p.add_argument(
                "--json", type=Path, metavar="FILE", help="write the result as JSON; - for standard output"
            )
        p.add_argument("--quiet", action="store_true", help="no table and no progress bar")
        p.add_argument("--debug", action="store_true", help="show the traceback of an error")
        return p

    p = command(
        "new", commands.new, "write a commented study to start from", "dovetail new my-frame", study=False
    )
    p.add_argument("folder", type=Path, metavar="DIR", help="folder to make")
    p.add_argument("--force", action="store_true", help="write into a folder that holds other files")

    p = command(
        "check",
        commands.check,
        "list probable faults of the model: loose parts, crossings, mechanisms",
        "dovetail check study.toml --picture faults.png",
    )
    p.add_argument(
        "--picture", type=Path, metavar="FILE", help="also draw the faults, and how a mechanism moves"
    )

    p = command(
        "modes",
        commands.modes,
        "compute natural frequencies and mode shapes",
        "dovetail modes study.toml --number 12 --pictures out/modes",
    )
    p.add_argument(
        "--number",
        type=_up_to(100_000),
        metavar="N",
        help="number of modes besides rigid-body ones (default 10)",
    )
    p.add_argument("--max", type=_positive, metavar="HZ", help="all modes up to this frequency instead")
    p.add_argument(
        "--pictures", type=Path, metavar="DIR", help="also draw each elastic mode as a PNG into this folder"
    )
    p.add_argument("--force", action="store_true", help="write into a folder that holds other files")

    p = command(
        "frf",
        commands.frf,
        "compute FRFs from the excitations to the sensors",
        "dovetail frf study.toml --out frf.npz --stop 500 --step 0.5",
    )
    p.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="file to write: .npz, .csv or .uff"
    )
    p.add_argument(
        "--kind",
        choices=["receptance", "mobility", "accelerance"],
        help="kind of FRF (default: that of the measurement, or accelerance)",
    )
    for key, text in (
        ("start", "first frequency"),
        ("stop", "last frequency"),
        ("step", "distance of the lines"),
    ):
        p.add_argument(
            f"--{key}",
            type=_positive,
            metavar="HZ",
            help=f"{text} (default: the measurement's lines, or [frequency])",
        )

    p = command(
        "run",
        investigate.run,
        "compare, locate, diagnose and write a report",
        "dovetail run study.toml --out out/report",
    )
    p.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="folder for report.html, result.json, frf.npz and pictures/",
    )
    p.add_argument("--force", action="store_true", help="write into a folder that holds other files")

    p = command(
        "compare",
        investigate.compare,
        "compare the model's FRFs with the measured ones",
        "dovetail compare study.toml --fitted",
    )
    p.add_argument("--fitted", action="store_true", help="fit the uncertain parameters first")
    p.add_argument(
        "--bands",
        type=_up_to(1000),
        default=6,
        metavar="N",
        help="number of equal frequency bands (default 6)",
    )

    p = command(
        "locate",
        investigate.locate,
        "find the sensors, bands and places that carry the misfit",
        "dovetail locate study.toml",
    )
    p.add_argument(
        "--bands",
        type=_up_to(1000),
        default=6,
        metavar="N",
        help="number of equal frequency bands (default 6)",
    )
    p.add_argument(
        "--number", type=_count, default=20, metavar="N", help="sensors and places to print (default 20)"
    )

    p = command(
        "diagnose",
        investigate.diagnose,
        "find which effect the model lacks, without a report",
        "dovetail diagnose study.toml",
    )
    p.add_argument("--number", type=_count, default=20, metavar="N", help="candidates to print (default 20)")

    p = command(
        "identify-modes",
        measure.identify_modes,
        "identify natural modes from the measured FRFs, with their uncertainty",
        "dovetail identify-modes study.toml --picture stabilisation.png --out modes.uff",
    )
    p.add_argument("--out", type=Path, metavar="FILE", help="also write the modes: .npz or .uff")
    p.add_argument("--picture", type=Path, metavar="FILE", help="also draw the stabilisation diagram")
    p.add_argument("--synthesis", type=Path, metavar="FILE", help="also draw synthesised over measured FRFs")
    p.add_argument("--measurement", metavar="NAME", help="which measurement (default: the first)")
    p.add_argument(
        "--band",
        type=_positive,
        nargs=2,
        metavar="HZ",
        help="lowest and highest frequency (default: [fit] band)",
    )
    p.add_argument(
        "--least-mpc",
        type=_within(1),
        metavar="X",
        help="smallest modal phase collinearity of a mode, 0 to 1 (default: [identification] least_mpc, 0.3)",
    )
    p.add_argument(
        "--largest-mpd",
        type=_within(90),
        metavar="DEG",
        help="largest mean phase deviation, 0 to 90 (default: [identification] largest_mpd, 45)",
    )

    p = command(
        "match",
        measure.match,
        "find where the points of a test's geometry lie on the model, with units and axes",
        "dovetail match study.toml geometry.unv --tolerance 0.005 --picture match.png",
    )
    p.add_argument(
        "geometry", type=Path, help="universal file with points, or a table (CSV) of name, x, y, z"
    )
    p.add_argument(
        "--tolerance", type=_positive, default=0.01, metavar="M", help="largest distance [m] (default 0.01)"
    )
    p.add_argument("--unit", choices=["m", "mm", "cm", "in", "ft"], help="of the geometry (default: found)")
    p.add_argument("--same-axes", action="store_true", help="the geometry has the model's axes and origin")
    p.add_argument(
        "--alternative", type=int, metavar="K", help="which of several placements, as an error numbers them"
    )
    p.add_argument("--picture", type=Path, metavar="FILE", help="also draw the points on the model")

    p = command(
        "update",
        measure.update,
        "update uncertain parameters to measured modes or FRFs, with their uncertainty",
        "dovetail update study.toml --out out/updated",
    )
    p.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="folder for report.html, update.json, study.toml with the new values, and pictures/",
    )
    p.add_argument("--force", action="store_true", help="write into a folder that holds other files")

    p = command(
        "identify-joint",
        commands.identify_joint,
        "fit a joint to the measured FRFs, with its uncertainty, and propose it to the model",
        "dovetail identify-joint study.toml --joint J --directions rx --propose new.toml --picture Z.png",
    )
    p.add_argument("--joint", required=True, metavar="NAME", help="name of the joint in the study")
    p.add_argument(
        "--directions",
        required=True,
        metavar="LIST",
        help="relative motions to identify, such as z,rx; the others keep the study's values",
    )
    p.add_argument(
        "--terms",
        metavar="LIST",
        default="K,D",
        help="what each direction may have: some of K, C, D (stiffness, viscous and structural damping), or "
        "one of zener, fractional_kelvin_voigt, fractional_zener (default K,D)",
    )
    p.add_argument("--coupled", action="store_true", help="let the stiffness couple the directions")
    p.add_argument(
        "--accuracy",
        type=_not_negative,
        default=0.05,
        metavar="X",
        help="accuracy asked of the model, relative to each FRF; 0 takes it for exact (default 0.05)",
    )
    p.add_argument(
        "--propose", type=Path, metavar="FILE", help="write the study with the identified joint, as .toml"
    )
    p.add_argument(
        "--picture", type=Path, metavar="FILE", help="draw the dynamic stiffness over frequency, as .png"
    )
    p.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="write values, covariance, and Z line by line with its condition numbers to an .npz file",
    )
    p.add_argument("--measurement", metavar="NAME", help="which measurement (default: the first)")
    p.add_argument(
        "--amplification",
        type=_positive,
        default=1e3,
        metavar="X",
        help="line by line: largest amplification of errors, cond(A)·cond(B), of a line that counts "
        "(default 1000)",
    )

    p = command(
        "validate",
        validation.run,
        "measure how often a diagnosis is right, on frames and hidden effects drawn from a seed",
        "dovetail validate --seed 7 --cases 300 --nulls 200 --processes 4 --out out/seed-7",
        study=False,
    )
    p.add_argument("--seed", type=_number, required=True, metavar="S", help="what the cases are drawn from")
    p.add_argument(
        "--cases",
        type=_up_to(1_000_000),
        default=33,
        metavar="N",
        help="cases of each set but null (default 33)",
    )
    p.add_argument(
        "--nulls",
        type=_up_to(1_000_000, 0),
        metavar="M",
        help="cases with nothing hidden (default: as many as the others)",
    )
    p.add_argument(
        "--sets", metavar="LIST", help="of single, null, withheld, weak, two, faults (default: all)"
    )
    p.add_argument(
        "--processes", type=_up_to(1000), default=1, metavar="P", help="cases at a time (default 1)"
    )
    p.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of the results; a run that was stopped goes on there"
    )
    p.add_argument("--case", metavar="CASE", help="run one case alone and print it, such as 12 or null:3")
    p.add_argument("--small", action="store_true", help="small frames and few lines, to try the command")
    return parser


def _version() -> str:
    try:
        return metadata.version("dovetail")
    except metadata.PackageNotFoundError:
        return "(not installed)"


def _up_to(most: int, least: int = 1) -> Callable[[str], int]:
    """Return a reader of whole numbers up to a bound: more is a slip, and would take all memory."""

    def read(text: str) -> int:
        value = int(text) if text.isdecimal() and len(text) < 20 else -1
        if not least <= value <= most:
            msg = f"'{text}' is not allowed; a whole number from {least} to {most} is needed"
            raise argparse.ArgumentTypeError(msg)
        return value

    return read


def _count(text: str) -> int:
    value = int(text) if text.isdecimal() and len(text) < 20 else 0
    if value < 1:
        msg = f"'{text}' is not allowed; a whole number of at least 1 is needed"
        raise argparse.ArgumentTypeError(msg)
    return value


def _number(text: str) -> int:
    if not text.isdecimal() or len(text) > 1000:
        msg = f"'{text}' is not allowed; a whole number of at least 0 is needed"
        raise argparse.ArgumentTypeError(msg)
    return int(text)


def _not_negative(text: str) -> float:
    return 0.0 if text.strip() in ("0", "0.0") else _positive(text)


def _within(most: float) -> Callable[[str], float]:
    """Return a reader of numbers from 0 to the given one."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = -1.0
        if not 0 <= value <= most:
            msg = f"'{text}' is not allowed; a number from 0 to {most:g} is needed"
            raise argparse.ArgumentTypeError(msg)
        return value

    return read


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        msg = f"'{text}' is not allowed; a positive number is needed"
        raise argparse.ArgumentTypeError(msg)
    return value
