"""The command line."""

import argparse
import errno
import gc
import os
import shutil
import signal
import sys
import textwrap
import threading
import traceback
import warnings
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from viz.offscreen import DrawingError

GROUPS = {
    "prepare a study and a test": {
        "new": "write a commented study to start from",
        "check": "list probable faults, such as loose parts, and what 'run' would refuse",
        "match": "find where the points of a test's geometry lie on the model, with units and axes",
        "plan": "say which missing effects a test could see and name, before it is made",
    },
    "find what the model lacks": {
        "compare": "compare the model's FRFs, or natural frequencies, with the measured ones",
        "locate": "find the sensors, bands and places that carry the misfit",
        "candidates": "list the effects that may be added, with places, parameters and units",
        "diagnose": "find which effect the model lacks, without a report",
        "run": "compare, locate, diagnose and write a report",
        "open": "open the desk in a browser: compare, add effects, fit and save by hand",
        "update": "update uncertain parameters to measured modes or FRFs, with their uncertainty",
        "history": "find what has changed in each of several states since the first one",
        "learn": "learn how far the form of frames is off, from frames that lack nothing",
        "fleet": "compare many units of one structure: their population, and which units are not of it",
    },
    "estimate from measured data": {
        "frf-estimate": "estimate FRFs from time data, with coherence",
        "identify-modes": "identify natural modes from measured FRFs or ambient responses, with uncertainty",
        "identify-joint": "fit a joint to measured FRFs, with its uncertainty, and propose it to the model",
    },
    "compute responses of the model": {
        "modes": "compute natural frequencies and mode shapes",
        "complex": "compute complex modes: frequencies and damping ratios with all damping",
        "frf": "compute FRFs from the excitations to the sensors",
        "ensemble": "compute bands of natural frequencies and FRFs from uncertain parameters",
        "base": "compute FRFs from a motion of the base to the sensors",
        "static": "compute displacements, reactions and section forces under loads",
        "buckling": "compute load factors and shapes of linear buckling",
        "transient": "compute responses in time to forces, motions of the base, or the release of a load",
        "spectrum": "combine the largest responses of modes to a response spectrum of the base",
        "psd": "compute root mean squares and densities under random forces and motions of the base",
        "campbell": "compute frequencies and damping of a rotor over its speed, and critical speeds",
        "unbalance": "compute responses of a rotor to its unbalance over its speed",
    },
    "write reports and decks": {
        "report": "write the report of a run or an update as a Word document or as PowerPoint slides",
        "export": "write the effects found, or the model, as a deck of Nastran, Abaqus or ANSYS",
    },
}
"""What each command does, by task, in the order of the help. Its module in `dovetail.commands` is imported
when it is chosen: EXAMPLE and run, which returns an `Answer`; RESULTS are its files and add_arguments adds
its other options, if there are some."""

COMMANDS = {name: words for group in GROUPS.values() for name, words in group.items()}

ALIASES = {"desk": "open"}
"""Commands by their other names."""

WITHOUT_STUDY = ("new", "frf-estimate", "report", "learn")
WITHOUT_TABLES = ("new", "frf-estimate", "report", "open", "run", "export", "identify-joint")

OF_THE_MACHINE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EPIPE, None)
"""Errors of files that the user's input has not caused: a full disk, a reader that has gone."""

OURS = ("fem", "updating", "joint", "viz", "dovetail")
"""Packages whose ValueErrors name the fault of the input in one line."""

DESCRIPTION = """\
Compare a frame model with measured frequency responses or modes, find which
physical effect the model lacks, add it and report.
"""

EPILOG = """\
begin with:
  dovetail new my-frame
  dovetail check my-frame/study.toml
  dovetail run my-frame/study.toml --out my-frame/report

docs/study-file.md describes the study file. Exit code: 0, 2 for bad input, 1 for
anything else and for a search that was ended early.
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
    of_desk = options.command == "open"
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


@contextmanager
def _without_collection(*, for_good: bool) -> Iterator[None]:
    """Collect no garbage meanwhile: imports leave none, and to look for it costs a tenth of a short command.

    What is there at the end is not looked at again if the process is ours ``for_good``.
    """
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if for_good:
            gc.freeze()
        if collecting:
            gc.enable()


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code: 0, 2 for bad input, 1 for anything else."""
    try:
        words = sys.argv[1:] if argv is None else argv
        # the first word that names a command is the command: no option before it takes a value
        with _without_collection(for_good=argv is None):
            called = [ALIASES.get(word, word) for word in words]
            parser = build_parser([word for word in called if word in COMMANDS][:1])
        _check_command(parser, called)
        options = parser.parse_args(words)
    except SystemExit as stop:  # argparse has printed the reason
        return int(stop.code or 0)
    from dovetail.disk.output import Progress  # --help and --version need no more than the parser
    from fem.lengths import metres_afterwards

    progress, code = Progress(getattr(options, "quiet", False)), 0
    try:
        with warnings.catch_warnings(), metres_afterwards(), _ending(options):
            warnings.showwarning = _warn if not options.debug else warnings.showwarning
            if options.results is not None:
                options.results.check(options)
            answer = options.run(options, progress)
            progress.close()
            if answer is not None:
                answer.give(options)
                code = int(not answer.finished)
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
    return code


def _check_command(parser: argparse.ArgumentParser, words: Sequence[str]) -> None:
    """Refuse a command that does not exist, with the name that is meant."""
    # no option before the command takes a value
    command = next((word for word in words if not word.startswith("-")), None)
    if command is None or command in COMMANDS:
        return
    from dovetail.file.table import suggest

    parser.error(f"there is no command '{command}'; {suggest(command, COMMANDS)}")


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


def build_parser(commands: Collection[str] = tuple(COMMANDS)) -> argparse.ArgumentParser:
    """Return the parser of all commands, with the arguments of some; only these are imported."""
    plain = argparse.RawDescriptionHelpFormatter
    listed = "" if len(commands) == 1 else f"\n{_commands_in_groups()}"  # only its own help is asked for
    parser = argparse.ArgumentParser(
        "dovetail",
        usage="dovetail COMMAND ... [-h] [--version]",
        description=f"{DESCRIPTION}{listed}",
        epilog=EPILOG,
        formatter_class=plain,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    parser.set_defaults(debug=False)
    sub = parser.add_subparsers(prog="dovetail", metavar="COMMAND", required=True, help=argparse.SUPPRESS)
    for name, words in COMMANDS.items():
        description = f"{words[0].upper()}{words[1:]}."
        known = {"description": description, "formatter_class": plain}
        p = sub.add_parser(name, aliases=[alias for alias, of in ALIASES.items() if of == name], **known)
        if name in commands:
            _add_arguments(p, name)
    return parser


def _commands_in_groups() -> str:
    """Return the commands with what they do, by task."""
    names = {name: f"{name} ({alias})" for alias, name in ALIASES.items()}
    lines = []
    for group, commands in GROUPS.items():
        lines += [f"{group}:"]
        for name, words in commands.items():
            text = textwrap.wrap(words, min(shutil.get_terminal_size().columns, 110) - 20)
            lines += [f"  {names.get(name, name):16}{text[0]}", *(f"{'':18}{more}" for more in text[1:])]
    return "\n".join(lines)


def _add_arguments(p: argparse.ArgumentParser, name: str) -> None:
    """Add the arguments of a command to its parser."""
    command = import_module(f"dovetail.commands.{name.replace('-', '_')}")
    results = getattr(command, "RESULTS", None)
    p.epilog = f"example:\n  {command.EXAMPLE}"
    p.set_defaults(command=name, run=command.run, results=results)
    if name not in WITHOUT_STUDY:
        p.add_argument("study", type=Path, help="the study file (TOML)")
        p.add_argument(
            "--json", type=Path, metavar="FILE", help="write the result as JSON; - for standard output"
        )
    if name not in WITHOUT_TABLES:
        p.add_argument("--xlsx", type=Path, metavar="FILE", help="also write the tables for Excel: .xlsx")
    p.add_argument("--quiet", action="store_true", help="no table and no progress bar")
    p.add_argument("--debug", action="store_true", help="show the traceback of an error")
    if hasattr(command, "add_arguments"):
        command.add_arguments(p)
    if results is not None:
        results.add_arguments(p)


class _Version(argparse.Action):
    """Prints the version; reading it for every command would take as long as NumPy's import."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        """Print the version and exit."""
        from importlib import metadata

        from dovetail.distribution import DISTRIBUTION

        try:
            version = metadata.version(DISTRIBUTION)
        except metadata.PackageNotFoundError:
            version = "(not installed)"
        sys.stdout.write(f"dovetail {version}\n")
        parser.exit()
