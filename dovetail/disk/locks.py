"""Locks on files that a process holds as long as it lives, whichever way it ends."""

import errno
import os
import socket
from pathlib import Path
from typing import BinaryIO


class Lock:
    """A lock on a file, which holds who has it.

    The operating system takes it from a process that ends: neither a number of a process that another one
    has by now nor a file that was left behind keeps anybody out. Where a file system has no locks, it is had
    by everybody.

    Attributes
    ----------
    path : Path
    """

    def __init__(self, path: Path, file: BinaryIO | None) -> None:
        self.path, self._file = path, file

    @classmethod
    def take(cls, path: Path) -> "Lock | None":
        """Return the lock on a file, which is made if it is not there; None if another process has it."""
        file = path.open("ab+")
        try:
            if not _locked(file):
                file.close()
                return None
            file.seek(0)
            file.truncate()
            file.write(f"process {os.getpid()} on {socket.gethostname()}\n".encode())
            file.flush()
        except OSError as reason:
            file.close()
            # Errors of file systems without locks, such as some network drives
            if reason.errno in (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL):
                return cls(path, None)
            raise
        return cls(path, file)

    def release(self) -> None:
        """Let go of the lock; the file stays."""
        if self._file is not None:
            self._file.close()
            self._file = None


def holder(path: Path) -> str:
    """Return who holds a lock, in words, as far as its file says it."""
    try:
        return path.read_text(encoding="utf-8").strip() or "another process"
    except OSError:  # Windows does not let a locked file be read
        return "another process"


def _locked(file: BinaryIO) -> bool:
    """Lock a file for this process; return whether nobody else has."""
    try:
        import fcntl
    except ImportError:
        import msvcrt

        file.seek(0)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        except OSError:
            return False
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
