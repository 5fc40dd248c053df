"""Work beside the page: jobs with progress and cancel, and values of which only the newest counts."""

import asyncio
import threading
import time
from collections.abc import Awaitable, Callable
from typing import Any, Generic, TypeVar

T = TypeVar("T")
Progress = Callable[[str, float], None]


class Cancelled(Exception):  # noqa: N818 - no error: the user asked for it
    """A job that was asked to end."""


class Job:
    """Work in a thread, with its progress; one that is cancelled ends at its next report, without a result.

    Parameters
    ----------
    title : str
    work : callable
        Called with a function that takes a text and the fraction done.
    """

    def __init__(self, title: str, work: Callable[[Progress], Any]) -> None:
        self.title, self.text, self.fraction = title, "", 0.0
        self.result: Any = None
        self.error: Exception | None = None
        self._work, self._stop, self._begun = work, threading.Event(), time.monotonic()
        self._told = self._begun
        self._thread = threading.Thread(target=self._run, name=title, daemon=True)

    def start(self) -> "Job":
        """Begin, and return the job."""
        self._thread.start()
        return self

    def cancel(self) -> None:
        """Ask the job to end."""
        self._stop.set()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait for the end; return whether it has come."""
        self._thread.join(seconds)
        return self.done

    @property
    def done(self) -> bool:
        """Whether it has ended."""
        return not self._thread.is_alive() and self._thread.ident is not None

    @property
    def cancelled(self) -> bool:
        """Whether it ended because it was asked to."""
        return isinstance(self.error, Cancelled)

    @property
    def ending(self) -> bool:
        """Whether it was asked to end."""
        return self._stop.is_set()

    @property
    def remaining(self) -> float | None:
        """Seconds that are probably left, as if the rest went on at the same rate; None while unknown.

        The last report gave them; they run down until the next one.
        """
        if self.fraction <= 0.02:
            return None
        left = (self._told - self._begun) * (1 / self.fraction - 1) - (time.monotonic() - self._told)
        return left if left > 0 else None

    def _run(self) -> None:
        try:
            result = self._work(self._progress)
            if self._stop.is_set():
                raise Cancelled
            self.result = result
        except Exception as reason:  # told to the user, as every error of the page
            self.error = reason

    def _progress(self, text: str, fraction: float) -> None:
        if self._stop.is_set():
            raise Cancelled
        self.text, self.fraction, self._told = text, max(float(fraction), 0.0), time.monotonic()


class Newest(Generic[T]):
    """Values that come faster than they can be worked on: each time the newest is taken, older ones go.

    Parameters
    ----------
    work : callable
        A coroutine function of a value.
    """

    def __init__(self, work: Callable[[T], Awaitable[None]]) -> None:
        self._work = work
        self._waiting: list[T] = []
        self._running: asyncio.Task[None] | None = None

    def put(self, value: T) -> None:
        """Take a value; it is worked on as soon as the last one is done, unless a newer one comes."""
        self._waiting = [value]
        if self._running is None or self._running.done():
            self._running = asyncio.get_running_loop().create_task(self._go_on())

    async def settled(self) -> None:
        """Wait until nothing is left to be done."""
        while self._running is not None and not self._running.done():
            await asyncio.shield(self._running)

    async def _go_on(self) -> None:
        while self._waiting:
            await self._work(self._waiting.pop())
