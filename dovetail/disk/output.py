"""Outputs of the commands: folders written atomically, JSON, progress; never over inputs."""

import ctypes
import errno
import json
import os
import shutil
import signal
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.disk.locks import Lock
from dovetail.file.paths import InputFile, refuse_device
from fem.io.atomic import LONGEST_NAME, WriteError, flushed, is_old, is_temporary, replacing, umask
from updating.inference.heartbeat import EndEarlyError, Lasting, may_end_early

MARK = ".dovetail"
"""File that tells a folder of ours from others."""

_OWNER, _NEW, _OLD = "owner", "new", "old"
"""Names in the temporary folder beside a result: its process's lock, the new result, the former one."""


class OutputError(ValueError):
    """A place where nothing can be written without destroying something."""


# Folders ----------------------------------------------------------------------------------------------------


@contextmanager
def result_folder(path: Path, force: bool = False) -> Iterator[Path]:
    """Give a temporary folder near ``path``, which takes its place when the block ends without an error.

    A folder that an earlier run made is replaced: where the system can exchange two names, there is a whole
    result under this name at every moment; elsewhere (not Linux, some network drives) there is none for the
    time between two renamings, and the next run puts the former one back if a process ended there. A folder
    with other files is refused, or with ``force`` kept: new files go into it, one by one, and replace
    files of the same names. Temporary folders of killed processes beside it are removed.

    Raises
    ------
    OutputError
        If ``path`` is a file, or a folder with files that are not ours.
    WriteError
        If the disk is full, for example; a folder that was there is as it was.
    """
    if path.exists() and not path.is_dir():
        msg = f"{path} is a file; give a folder to write into"
        raise OutputError(msg)
    target = Path(os.path.realpath(path))
    _tidy(target)
    ours = is_ours(target)
    if not ours and not force:
        msg = (
            f"{path} holds files that are not results of dovetail; choose another folder, or "
            "give --force to write into it"
        )
        raise OutputError(msg)
    with _errors_named(path, target, target):
        target.parent.mkdir(parents=True, exist_ok=True)
        scratch = Path(tempfile.mkdtemp(prefix=f".{target.name[:LONGEST_NAME]}-", dir=target.parent))
    lock = _owned(scratch)
    new = scratch / _NEW
    try:
        with _errors_named(path, new, target):
            new.mkdir()
            new.chmod(stat.S_IMODE(target.stat().st_mode) if target.is_dir() else 0o777 & ~umask())
            yield new
            (new / MARK).write_text(
                "This folder is written by dovetail and replaced as a whole.\n", encoding="utf-8"
            )
            for file in _files(new):
                flushed(new / file)
            if not ours or _must_stay(target):
                _fill(target, new, alone=ours)
            else:
                _put(new, target, scratch / _OLD)
    finally:
        _remove(scratch, lock)


def is_ours(path: Path) -> bool:
    """Whether a folder may be replaced: it does not exist, is empty or is an earlier result."""
    return not path.exists() or (path / MARK).is_file() or not any(path.iterdir())


def _owned(scratch: Path) -> Lock | None:
    """Lock a temporary folder for this process; the lock file gets its name only once it is locked."""
    if os.name == "nt":  # which renames no open file
        return Lock.take(scratch / _OWNER)
    lock = Lock.take(scratch / f"{_OWNER}.new")
    (scratch / f"{_OWNER}.new").rename(scratch / _OWNER)
    return lock


def _tidy(target: Path) -> None:
    """Remove temporary folders of ended processes next to a result; restore a former result if missing."""
    if not target.parent.is_dir():
        return
    for scratch in target.parent.glob(f".{_escaped(target.name[:LONGEST_NAME])}-*"):
        if not (scratch / _OWNER).is_file():
            _remove_unowned(scratch, target)
            continue
        with suppress(OSError):
            lock = Lock.take(scratch / _OWNER)
            if lock is not None:
                if (scratch / _OLD).is_dir() and not target.exists():
                    (scratch / _OLD).rename(target)
                _remove(scratch, lock)


def _remove_unowned(scratch: Path, target: Path) -> None:
    """Remove a temporary folder of a process that ended before it had locked it."""
    with suppress(OSError):
        ours = is_temporary(scratch.name, f".{target.name[:LONGEST_NAME]}-") and not scratch.is_symlink()
        if ours and is_old(scratch) and {p.name for p in scratch.iterdir()} <= {f"{_OWNER}.new"}:
            lock = Lock.take(scratch / f"{_OWNER}.new")
            if lock is not None:
                _remove(scratch, lock)


def _escaped(name: str) -> str:
    return "".join(f"[{c}]" if c in "*?[" else c for c in name)


def _remove(scratch: Path, lock: Lock | None) -> None:
    """Remove a temporary folder, its lock last: after a crash the rest is still known as one."""
    for name in (_NEW, _OLD):
        shutil.rmtree(scratch / name, ignore_errors=True)
    if lock is not None:
        lock.release()
    shutil.rmtree(scratch, ignore_errors=True)


def _must_stay(target: Path) -> bool:
    """Whether a folder can only be filled, not exchanged: a shell is in it, or it is a file system's root."""
    here = Path(os.path.realpath(os.curdir))
    return target.is_dir() and (here == target or target in here.parents or os.path.ismount(target))


def _put(new: Path, target: Path, old: Path) -> None:
    """Give a finished folder its name; the former folder stays as ``new`` or ``old``."""
    if not target.exists():
        new.rename(target)
        return
    if exchanged(new, target):
        return
    target.rename(old)
    try:
        new.rename(target)
    except OSError:
        old.rename(target)
        raise


def _fill(target: Path, new: Path, *, alone: bool) -> None:
    """Copy finished files into a folder one by one, each atomically; if ``alone``, remove the others."""
    files = _files(new)
    for file in files:
        if alone or file != Path(MARK):
            (target / file).parent.mkdir(parents=True, exist_ok=True)
            with replacing(target / file) as scratch:
                shutil.copyfile(new / file, scratch)
    for file in set(_files(target)) - set(files) if alone else ():
        (target / file).unlink()


def _files(folder: Path) -> list[Path]:
    return sorted(p.relative_to(folder) for p in folder.rglob("*") if p.is_file())


@contextmanager
def _errors_named(path: Path, scratch: Path, target: Path) -> Iterator[None]:
    """Let errors of writing below ``scratch`` name the file below ``path`` that is wanted."""
    try:
        yield
    except OSError as reason:
        inside = _below(scratch, reason.filename)
        if inside is None and reason.filename is not None:
            raise  # of another file, that was read for example
        raise WriteError(reason, path / (inside or ""), target.exists(), "folder") from reason


def _below(folder: Path, name: Any) -> Path | None:
    """Return where a file is below a folder; None for others."""
    if not isinstance(name, str | bytes | os.PathLike):
        return None
    file = Path(os.fsdecode(name))
    return file.relative_to(folder) if file.is_relative_to(folder) else None


# Protection of inputs ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Output:
    """A file or a folder that a command is to write.

    Attributes
    ----------
    option : str
        How the user has named it, such as ``--json``.
    path : Path or None
        None or ``-`` for none.
    names : tuple of str
        Of a folder, the files and folders that will be in it; none for a file.
    """

    option: str
    path: Path | None
    names: tuple[str, ...] = ()

    @property
    def given(self) -> bool:
        """Whether it is a place in the file system."""
        return self.path is not None and str(self.path) != "-"


def check_outputs(inputs: Iterable[InputFile], *outputs: Output) -> None:
    """Refuse outputs that cannot be written, or would take the place of an input or of one another.

    To be called before anything is computed. Files are the same if the file system says so, whatever they are
    called: links of both kinds and other spellings count.

    Raises
    ------
    OutputError
        For the first of them; it names option, file and the file's role.
    """
    given = [o for o in outputs if o.given]
    check_writable(*(o.path for o in given if not o.names))
    for k, output in enumerate(given):
        for other in given[:k]:
            _refuse_same(output, other)
    known = tuple(inputs)
    for file in known:
        refuse_device(file.path)
    for output in given:
        for file in known:
            if output.names:
                _refuse_within(output, file)
            elif output.path is not None and _same_file(output.path, file.path):
                msg = (
                    f"{output.option} {output.path} is {file.what}, which would be overwritten; "
                    "give another file"
                )
                raise OutputError(msg)


def _refuse_same(one: Output, two: Output) -> None:
    """Refuse two outputs at one place."""
    a, b = (Path(os.path.realpath(o.path or "")) for o in (one, two))
    folder, file = (a, b) if one.names else (b, a)
    names = one.names or two.names
    if _is_stream(a):
        return  # a device or a pipe takes one after the other
    inside = bool(names) and folder in file.parents and file.relative_to(folder).parts[0] in names
    if a == b or _same_file(a, b) or inside:
        msg = (
            f"{one.option} {one.path} and {two.option} {two.path} are the same place; give two different ones"
        )
        raise OutputError(msg)


def _refuse_within(output: Output, file: InputFile) -> None:
    """Refuse a folder whose replacement, or whose new files, would take an input away."""
    assert output.path is not None
    folder, inside = Path(os.path.realpath(output.path)), Path(os.path.realpath(file.path))
    if folder in inside.parents and is_ours(folder):
        msg = (
            f"{output.option} {output.path} holds {inside.relative_to(folder)}, {file.what}, and would be "
            "replaced as a whole; give another folder"
        )
        raise OutputError(msg)
    for name in output.names:
        place = output.path / name
        if _same_file(place, file.path) or Path(os.path.realpath(place)) in inside.parents:
            msg = f"{output.option} {output.path} would overwrite {name}, {file.what}; give another folder"
            raise OutputError(msg)


def _is_stream(path: Path) -> bool:
    """Whether a path leads to a device or a pipe."""
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def _same_file(one: Path, two: Path) -> bool:
    """Whether two paths lead to one file that is there."""
    try:
        return os.path.samefile(one, two)
    except OSError:
        return False


def check_writable(*paths: Path | None) -> None:
    """Refuse files that cannot be written, before anything is computed for them.

    Raises
    ------
    OutputError
        For the first whose folder is not there, that is a folder, or that is protected.
    """
    for path in paths:
        if path is None or str(path) == "-":
            continue
        if not path.parent.is_dir():
            msg = f"{path}: there is no folder {path.parent} to write it into"
            raise OutputError(msg)
        if path.is_dir():
            msg = f"{path} is a folder; give a file"
            raise OutputError(msg)
        if path.exists() and not os.access(path, os.W_OK):
            msg = f"{path} may not be written to; give another file, or change its permissions"
            raise OutputError(msg)
        if not path.exists() and not os.access(path.parent, os.W_OK):
            msg = f"{path}: the folder {path.parent} may not be written to; give another one"
            raise OutputError(msg)


def write_json(path: Path | None, data: Any, nulls: Mapping[str, str] | None = None) -> None:
    """Write data as JSON to a file atomically; to standard output for ``-``; nowhere for None.

    Parameters
    ----------
    path : Path or None
    data : dict
    nulls : mapping, optional
        Why a number may be missing, by its key: ``missing`` then has the reasons of those that are null.
    """
    if path is None:
        return
    plain = _plain(data)
    if nulls is not None:
        plain["missing"] = {key: nulls[key] for key in nulls if key in set(null_keys(plain))}
    text = json.dumps(plain, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    if str(path) == "-":
        sys.stdout.write(text)
        return
    check_writable(path)
    with replacing(path) as scratch:
        scratch.write_text(text, encoding="utf-8")


def null_keys(value: Any, key: str = "") -> Iterator[str]:
    """Yield the nearest keys above the nulls in plain data."""
    if value is None:
        yield key
    elif isinstance(value, dict):
        for name, part in value.items():
            yield from null_keys(part, name)
    elif isinstance(value, list):
        for part in value:
            yield from null_keys(part, key)


def _plain(value: Any) -> Any:
    """Turn arrays, tuples and NumPy numbers into JSON's types; numbers that are not finite into null."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple | set):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, complex):
        return {"re": _plain(value.real), "im": _plain(value.imag)}
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


class Progress:
    """A progress bar on a terminal, or a line every ten seconds where the output is piped.

    Call it with the step, and with its count and total where these are known. What is known so far stays.
    """

    def __init__(self, quiet: bool = False) -> None:
        self._quiet, self._bar = quiet, sys.stderr.isatty()
        self._start = self._last = time.monotonic()
        self._line = ""
        self._ends = self._told = False

    def __call__(self, text: str, done: float = 0, total: float | None = None) -> None:
        """Show a step.

        Raises
        ------
        EndEarlyError
            Once, after Ctrl-C where that ends a search early.
        """
        if self._ends and not self._told and not self._quiet:
            self._told = True
            print("\nending the search; Ctrl-C once more ends at once", file=sys.stderr, flush=True)
        if self._ends and may_end_early():
            self._ends = False
            raise EndEarlyError
        if self._quiet:
            return
        now, share = time.monotonic(), min(done / (total or 1), 1.0)
        minutes, seconds = divmod(int(now - self._start), 60)
        if isinstance(text, Lasting) or not self._bar:
            # A piped progress prints a line so often [s]
            if isinstance(text, Lasting) or now - self._last > 10.0:
                self.close()
                self._last = now
                print(f"{minutes:02d}:{seconds:02d} {text}", file=sys.stderr, flush=True)
            return
        end = f" {'#' * int(30 * share):30} {100 * share:3.0f} % {minutes:02d}:{seconds:02d}"
        width = shutil.get_terminal_size().columns - 1  # a full line would wrap
        self._draw((text[: max(0, width - len(end))] + end)[:width])

    @contextmanager
    def ending_early(self) -> Iterator[None]:
        """Let the first Ctrl-C in the block end a search with what it has found so far.

        A second one interrupts at once, as elsewhere.
        """
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = signal.getsignal(signal.SIGINT)

        def end(number: int, frame: object) -> None:
            signal.signal(signal.SIGINT, before)
            self._ends = True

        signal.signal(signal.SIGINT, end)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)
            self._ends = False

    def close(self) -> None:
        """Take the bar away."""
        if self._line:
            self._draw("")
            print(end="\r", file=sys.stderr, flush=True)

    def _draw(self, line: str) -> None:
        """Put a line over the last one; blanks, as old consoles of Windows have no escape sequences."""
        print(f"\r{line:{len(self._line)}}", end="", file=sys.stderr, flush=True)
        self._line = line


# Two folders that take each other's names at one moment -----------------------------------------------------


_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
_NOT_HERE = (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP, errno.EPERM)
"""Errors of kernels and file systems that cannot exchange names."""


def exchanged(one: Path, two: Path) -> bool:
    """Exchange the names of two files or folders of one file system; return whether that can be done here.

    ``renameat2`` with ``RENAME_EXCHANGE`` (Linux 3.15, glibc 2.28): each name leads to the one or to the
    other at every moment, also across a crash. Nothing has changed where it returns False.

    Raises
    ------
    OSError
        If one of them is not there, or their folder may not be written to.
    """
    rename = _renameat2()
    if rename is None:
        return False
    if rename(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(two), _RENAME_EXCHANGE) == 0:
        return True
    number = ctypes.get_errno()
    if number in _NOT_HERE:
        return False
    raise OSError(number, os.strerror(number), str(two))


@cache
def _renameat2() -> Any:
    if not sys.platform.startswith("linux"):
        return None
    try:
        function = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError):
        return None
    function.argtypes = [ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_uint]
    function.restype = ctypes.c_int
    return function
