"""Writing a file completely or not at all; devices and pipes are written to."""

import errno
import os
import re
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

LONGEST_NAME = 80
"""Characters of a file's name that its temporary file's name has: both must fit a directory entry [-]."""


_UNLOCKED, _LOCK = ".new", ".lock"
"""Suffixes of the file next to a temporary one that its process has locked, before it is locked and then.

The temporary file itself is not locked: HDF5 locks the files that it writes, and finds them locked.
"""


_CHUNK = 1 << 20
"""Bytes that are written to a device at a time."""


class WriteError(OSError):
    """A file that could not be written, such as on a full disk; ``filename`` is the one that was wanted."""

    # A subclass of OSError with other arguments would be turned into one of its builtin kinds.
    def __init__(self, reason: OSError, target: Path, before: bool, what: str = "file") -> None:
        kept = f"; the {what} that was there before is unchanged" if before else ""
        super().__init__(reason.errno, f"{_cause(reason)}{kept}", str(target))


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary file next to ``path``, which takes its name when the block ends without an error.

    The temporary name keeps the suffix, for libraries that choose the format by it. A link is followed; a
    file that is there keeps its permissions. A target that is no regular file, such as a device or a pipe,
    and the target of standard output are written to and not replaced. Temporary files of killed processes
    next to it are removed.

    Raises
    ------
    WriteError
        If the file cannot be written; one that was there before is as it was.
    """
    path = Path(path)
    stream = _stream(path)
    if stream is not None:
        # without a buffer, whose rest would fail once more when it is closed
        with os.fdopen(stream, "wb", buffering=0) as out, tempfile.TemporaryDirectory() as folder:
            scratch = Path(folder) / f"out{path.suffix}"
            scratch.touch()
            yield scratch
            with _named(path, scratch, False), scratch.open("rb") as file:
                while chunk := memoryview(file.read(_CHUNK)):
                    while chunk:
                        chunk = chunk[out.write(chunk) :]
        return
    target = Path(os.path.realpath(path))
    before = _status(target)
    if before is not None and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, "it may not be written to", str(path))
    prefix, suffix = f".{target.name[:LONGEST_NAME]}-", target.suffix[:LONGEST_NAME]
    _tidy(target.parent, prefix, suffix)
    with _named(path, target, before is not None):
        handle, name = tempfile.mkstemp(prefix=prefix, suffix=_UNLOCKED, dir=target.parent)
    lock = Path(name)
    stem = lock.name.removesuffix(_UNLOCKED)
    scratch = lock.with_name(f"{stem}{suffix}")
    try:
        if _locked(handle):
            # it gets its name once it is locked, so that no other process takes it for one without owner
            lock = lock.rename(lock.with_name(f"{stem}{_LOCK}"))
        with _named(path, scratch, before is not None):
            os.close(os.open(scratch, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600))
            yield scratch
            flushed(scratch)
            scratch.chmod(0o666 & ~umask() if before is None else stat.S_IMODE(before.st_mode))
            if before is not None and hasattr(os, "chown"):
                with suppress(OSError):  # only root may give a file to its former owner
                    os.chown(scratch, before.st_uid, before.st_gid)
            scratch.replace(target)
    except BaseException:
        scratch.unlink(missing_ok=True)
        raise
    finally:
        os.close(handle)
        lock.unlink(missing_ok=True)


def is_temporary(name: str, prefix: str, suffix: str = "") -> bool:
    """Return whether a name is one that `tempfile` has made of a prefix and a suffix."""
    return re.fullmatch(rf"{re.escape(prefix)}[a-z0-9_]{{8}}{re.escape(suffix)}", name) is not None


def is_old(path: Path) -> bool:
    """Return whether a temporary file or folder is so old that its process must have locked it."""
    # Age from which a temporary file without a lock is that of an ended process: locking takes less [s]
    return time.time() - path.stat().st_mtime > 60.0


def _tidy(folder: Path, prefix: str, suffix: str) -> None:
    """Remove temporary files whose lock no process holds any more."""
    with suppress(OSError), os.scandir(folder) as entries:
        for name in [e.name for e in entries]:
            lock, is_new = folder / name, is_temporary(name, prefix, _UNLOCKED)
            if not (is_new or is_temporary(name, prefix, _LOCK)) or (is_new and not is_old(lock)):
                continue
            if lock.is_symlink() or not lock.is_file():
                continue
            with lock.open("rb") as file:
                if _locked(file.fileno()):
                    lock.with_name(f"{lock.stem}{suffix}").unlink(missing_ok=True)
                    lock.unlink(missing_ok=True)


def _locked(handle: int) -> bool:
    """Lock an open file as long as its process lives; return whether that could be done."""
    try:
        import fcntl
    except ImportError:  # Windows, where an open file could not be renamed
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def flushed(path: Path) -> None:
    """Wait until a file is on the disk: after a power cut a name must not lead to an empty file."""
    with path.open("rb+") as file:
        try:
            os.fsync(file.fileno())
        except OSError as reason:
            # Errors of file systems that cannot flush
            if reason.errno not in (errno.EINVAL, errno.ENOTSUP):
                raise


def goes_to_stdout(path: str | os.PathLike[str]) -> bool:
    """Whether a path leads to the target of standard output."""
    there = _status(Path(path))
    return there is not None and _same(there, 1)


def umask() -> int:
    """Return which permissions new files do not get."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _stream(path: Path) -> int | None:
    """Return a file descriptor to write to where a path is no regular file; None for a file."""
    there = _status(path)
    if there is None or stat.S_ISDIR(there.st_mode):
        return None
    # File descriptors of standard output and standard error
    for stream in (1, 2):
        # A file that the shell has opened is written on: replaced, later output would go to the former one.
        if _same(there, stream):
            return os.dup(stream)
    return None if stat.S_ISREG(there.st_mode) else os.open(path, os.O_WRONLY)


def _same(there: os.stat_result, stream: int) -> bool:
    try:
        return os.path.samestat(there, os.fstat(stream))
    except OSError:  # it is closed
        return False


def _status(path: Path) -> os.stat_result | None:
    """Return the status of the target of a path; None where there is nothing."""
    try:
        return path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return None


@contextmanager
def _named(path: Path, scratch: Path, before: bool) -> Iterator[None]:
    """Let errors of writing name the file that is wanted, rather than a temporary one or none."""
    try:
        yield
    except WriteError:
        raise
    except OSError as reason:
        # an error of another file, which the block reads, names that
        other = reason.filename is not None and Path(os.fsdecode(reason.filename)).parent != scratch.parent
        if other:
            raise
        raise WriteError(reason, path, before) from reason


def _cause(reason: OSError) -> str:
    # NumPy says "n requested and m written", with no number of an error
    return reason.strerror or f"writing stopped before the end ({reason})"
