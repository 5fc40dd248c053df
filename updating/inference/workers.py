"""Processes that compute side by side, each with what they share."""

import copyreg
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any, TypeVar

from fem.lengths import show_lengths, shown_unit
from fem.linalg.solvers import one_thread
from updating.inference.heartbeat import INTERVAL, beat

Shared = TypeVar("Shared")
Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(slots=True, eq=False)
class Workers:
    """What calls a function for many items: other processes, or this one where there are none.

    The results are the same, in the order of the items.
    """

    pool: ProcessPoolExecutor | None = None

    def map(
        self, function: Callable[[Shared, Item], Result], shared: Shared, items: Sequence[Item]
    ) -> list[Result]:
        """Return function(shared, item) for each item.

        Parameters
        ----------
        function : callable
            Of a module, so that other processes find it.
        shared : object
            Sent to each process once.
        items : sequence
        """
        if self.pool is not None and len(items) > 1:
            results: list[Any] = []
            try:
                with TemporaryDirectory() as folder:
                    file = Path(folder, "shared")
                    file.write_bytes(pickle.dumps(shared, pickle.HIGHEST_PROTOCOL))
                    results = [self.pool.submit(_call, function, str(file), item) for item in items]
                    while wait(results, INTERVAL).not_done:
                        beat()
                    return [r.result() for r in results]
            except KeyboardInterrupt:
                for r in results:
                    r.cancel()
                raise
            except BrokenProcessPool:  # one was stopped from outside, perhaps for its memory
                self.pool = None
        results = []
        for item in items:
            beat()
            results.append(function(shared, item))
        return results


ALONE = Workers()
"""No other processes."""


def cores() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def workers(n: int) -> Iterator[Workers]:
    """Give workers, which end with the block: n processes, or none for one.

    They begin at once: they import the program while this process computes.
    """
    if n <= 1:
        yield ALONE
        return
    with process_pool(n) as pool:
        for _ in range(n):
            pool.submit(os.getpid)
        crew = Workers(pool)
        try:
            yield crew
        finally:
            crew.pool = None


@contextmanager
def process_pool(n: int) -> Iterator[ProcessPoolExecutor]:
    """Give a pool of processes that end with this one, however it ends, or when the block exits early.

    Each holds one end of a pipe and ends when the other end, which this process alone holds, is closed.
    """
    context = get_context("spawn")
    watched, write_end = context.Pipe(duplex=False)
    with watched, write_end, ProcessPoolExecutor(n, context, _begin, (watched, shown_unit())) as pool:
        try:
            yield pool
        except BaseException:  # leaving the pool waits for its processes, so they must end first
            write_end.close()
            raise


def _begin(watched: Connection, unit: float) -> None:
    """Let this process end when the other end of a pipe is closed, and not by Ctrl-C.

    Its texts give lengths in a unit of so many metres.
    """
    show_lengths(unit)

    def watch() -> None:
        with suppress(EOFError, OSError):
            watched.recv_bytes()  # nothing is ever sent
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=watch, daemon=True).start()


def _read_only(mapping: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(mapping)


# Meshes and effects hold read-only mappings, which pickle does not know.
copyreg.pickle(MappingProxyType, lambda mapping: (_read_only, (dict(mapping),)))


@lru_cache(1)
def _read(file: str) -> Any:
    return pickle.loads(Path(file).read_bytes())


def _call(function: Callable[[Any, Any], Any], file: str, item: Any) -> Any:
    with one_thread():
        return function(_read(file), item)
