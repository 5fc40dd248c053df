"""The command line."""

import argparse
import errno
import os
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any

from dovetail.commands import (
    base,
    buckling,
    campbell,
    candidates,
    check,
    compare,
    diagnose,
    ensemble,
    export,
    fleet,
    frf,
    frf_estimate,
    history,
    identify_joint,
    identify_modes,
    locate,
    match,
    modes,
    new,
    plan,
    psd,
    report,
    run,
    spectrum,
    static,
    transient,
    unbalance,
    update,
)
from dovetail.commands import complex as complex_modes
from dovetail.commands import open as open_desk
from dovetail.disk.output import Progress
from viz.offscreen import DrawingError

COMMANDS = (
    new,
    check,
    plan,
    modes,
    complex_modes,
    campbell,
    unbalance,
    frf,
    frf_estimate,
    ensemble,
    base,
    static,
    buckling,
    transient,
    spectrum,
    psd,
    open_desk,
    run,
    report,
    export,
    compare,
    candidates,
    locate,
    diagnose,
    history,
    identify_modes,
    match,
    update,
    identify_joint,
    fleet,
)
"""In the order of the help; each has HELP, EXAMPLE and run, which returns an `Answer`; RESULTS are its
files and add_arguments adds its other options, if there are some."""

WITHOUT_STUDY = (new, frf_estimate, report)
WITHOUT_TABLES = (*WITHOUT_STUDY, open_desk, run, export, identify_joint)

OF_THE_MACHINE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EPIPE, None)
"""Errors of files that the user's input has not caused: a full disk, a reader that has gone."""

OURS = ("fem", "updating", "joint", "viz", "dovetail")
"""Packages whose ValueErrors name the fault of the input in one line."""

DESCRIPTION = """\
Compare a frame model with measured frequency responses, find which physical effect the model lacks, add it
and report.
"""

EPILOG = """\
begin with:
  dovetail new my-frame
  dovetail modes my-frame/study.toml

docs/study-file.md describes the study file. Exit code: 0, 2 for bad input, 1 for anything else.
"""


class _EndedError(KeyboardInterrupt):
    """A signal that asks the process to end; what is unfinished is removed on the way out."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.signal = signal.Signals(number)


@contextmanager
def _ending(options: Any) -> Iterator[None]:
    """Let SIGTERM and SIGHUP end a command as Ctrl-C does, so that no temporary file is left.

    The desk has a server that takes signals itself.
    """
    numbers = [n for name in ("SIGTERM", "SIGHUP") if (n := getattr(signal, name, None)) is not None]
    of_desk = options.run is open_desk.run
    if of_desk or threading.current_thread() is not threading.main_thread():
        yield
        return
    process = os.getpid()

    def end(number: int, _: object) -> None:
        if os.getpid() != process:  # a fork of this process
            os._exit(128 + number)
        raise _EndedError(number)

    # one that is ignored, as by nohup, stays so
    before = {n: signal.getsignal(n) for n in numbers if signal.getsignal(n) == signal.SIG_DFL}
    for number in before:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code: 0, 2 for bad input, 1 for anything else."""
    try:
        options = build_parser().parse_args(argv)
    except SystemExit as stop:  # argparse has printed the reason
        return int(stop.code or 0)
    progress = Progress(getattr(options, "quiet", False))
    try:
        with warnings.catch_warnings(), _ending(options):
            warnings.showwarning = _warn if not options.debug else warnings.showwarning
            if options.results is not None:
                options.results.check(options)
            answer = options.run(options, progress)
            progress.close()
            if answer is not None:
                answer.give(options)
        sys.stdout.flush()  # while an error of it can still be reported
    except _EndedError as reason:
        progress.close()
        sys.stderr.write(f"dovetail: ended by {reason.signal.name}\n")
        return 128 + reason.signal
    except KeyboardInterrupt as reason:
        progress.close()
        sys.stderr.write(f"dovetail: interrupted{f': {reason}' if reason.args else ''}\n")
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
    """Report why output failed, unless its reader closed the pipe as ``head`` does; return 1."""
    with open(os.devnull, "wb") as nowhere:  # the rest of the buffer has nowhere to go
        os.dup2(nowhere.fileno(), sys.stdout.fileno())
    if not isinstance(reason, BrokenPipeError):
        sys.stderr.write(f"dovetail: standard output: {getattr(reason, 'strerror', reason)}\n")
    return 1


def _one_line(reason: BaseException) -> str:
    if isinstance(reason, OSError) and reason.filename is not None:
        return f"{reason.filename}: {reason.strerror}"
    text = "; ".join(line.strip() for line in str(reason).split("\n") if line.strip()).replace(":; ", ": ")
    # a name from a file may hold control characters, which a terminal would obey and not show
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def _warn(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """Write a warning of this program, not those of libraries, which users cannot act on."""
    if issubclass(category, UserWarning):
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
    for command in COMMANDS:
        p = sub.add_parser(
            command.__name__.rpartition(".")[2].replace("_", "-"),
            help=command.HELP,
            description=f"{command.HELP[0].upper()}{command.HELP[1:]}.",
            epilog=f"example:\n  {command.EXAMPLE}",
            formatter_class=plain,
        )
        results = getattr(command, "RESULTS", None)
        p.set_defaults(run=command.run, results=results)
        if command not in WITHOUT_STUDY:
            p.add_argument("study", type=Path, help="the study file (TOML)")
            p.add_argument(
                "--json", type=Path, metavar="FILE", help="write the result as JSON; - for standard output"
            )
        if command not in WITHOUT_TABLES:
            p.add_argument("--xlsx", type=Path, metavar="FILE", help="also write the tables for Excel: .xlsx")
        p.add_argument("--quiet", action="store_true", help="no table and no progress bar")
        p.add_argument("--debug", action="store_true", help="show the traceback of an error")
        if hasattr(command, "add_arguments"):
            command.add_arguments(p)
        if results is not None:
            results.add_arguments(p)
    return parser


def _version() -> str:
    try:
        return metadata.version("dovetail")
    except metadata.PackageNotFoundError:
        return "(not installed)"
