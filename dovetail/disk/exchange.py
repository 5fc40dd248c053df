"""Two folders that take each other's names at one moment."""

import ctypes
import errno
import os
import sys
from functools import cache
from pathlib import Path
from typing import Any

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
