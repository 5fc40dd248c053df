"""Regular reports of long work, so that it can be ended anywhere by an exception from its progress."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial

Progress = Callable[[str, float], None]
"""Called with what is being done and the fraction done, 0 to 1."""


class Lasting(str):
    """What is known so far: a text that stays to be read when the next one comes."""

    __slots__ = ()


class EndEarlyError(KeyboardInterrupt):
    """Raised by a progress function to end a search with what it has found so far.

    Only where :func:`may_end_early` says that a search listens.
    """


_listens: ContextVar[bool] = ContextVar("listens", default=False)


@contextmanager
def ending_early() -> Iterator[None]:
    """Let the progress function end the block by :class:`EndEarlyError`."""
    token = _listens.set(True)
    try:
        yield
    finally:
        _listens.reset(token)


def may_end_early() -> bool:
    """Whether what runs now can be ended by :class:`EndEarlyError`."""
    return _listens.get()


INTERVAL = 0.25
"""Reports are at least so far apart [s]."""


class _Pulse:
    """The last report of some work, repeated while the work continues.

    Its parts judge by themselves how far they are; the fraction done never falls.
    """

    def __init__(self, report: Progress) -> None:
        self.report, self.last, self.at, self.most = report, ("", 0.0), time.monotonic(), 0.0

    def __call__(self, text: str, done: float) -> None:
        done = self.most = max(self.most, done)
        if not isinstance(text, Lasting):
            self.last = (text, done)
        self.at = time.monotonic()
        self.report(text, done)

    def beat(self) -> None:
        if time.monotonic() - self.at > INTERVAL:
            self(*self.last)


_pulse: ContextVar[_Pulse | None] = ContextVar("pulse", default=None)


@contextmanager
def beating(report: Progress) -> Iterator[Progress]:
    """Give a progress function whose last report :func:`beat` gives again within the block."""
    pulse = _Pulse(report)
    token = _pulse.set(pulse)
    try:
        yield partial(_Pulse.__call__, pulse)
    finally:
        _pulse.reset(token)


def beat() -> None:
    """Give the last report again, if that is due: long work calls this at every step."""
    pulse = _pulse.get()
    if pulse is not None:
        pulse.beat()
