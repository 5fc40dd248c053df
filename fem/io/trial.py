"""Try compiled readers in a separate process first: a damaged file may end it."""

import faulthandler
import os
import signal
import warnings
from collections.abc import Callable
from contextlib import suppress

MOST_SECONDS = 120
"""Processor time of a trial [s]."""


def end_of_trial(read: Callable[[], object]) -> str | None:
    """Return the signal that ends a forked process which reads a file; None if it ends by itself.

    An exception of the trial counts as an end by itself: the caller comes upon it again. Systems that do not
    fork have no trial.
    """
    if not hasattr(os, "fork"):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads: the trial calls the reader alone
        try:
            pid = os.fork()
        except OSError:  # too many processes
            return None
    if pid == 0:
        _try(read)
    _, status = os.waitpid(pid, 0)
    return signal.Signals(os.WTERMSIG(status)).name if os.WIFSIGNALED(status) else None


def _try(read: Callable[[], object]) -> None:
    """Read quietly, and end this process whatever comes."""
    import resource

    try:
        faulthandler.disable()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_CPU, (MOST_SECONDS, MOST_SECONDS + 1))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        quiet = os.open(os.devnull, os.O_WRONLY)
        for stream in (1, 2):
            os.dup2(quiet, stream)
        with suppress(BaseException):
            read()
    finally:
        os._exit(0)
