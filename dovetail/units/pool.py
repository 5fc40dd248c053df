"""Pools of workers behind one interface: this process, processes of this machine, or a Dask cluster."""

import pickle
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol

from dovetail.units.outcome import PROCESS_ENDED, Function, Outcome, PoolError, Unit, failed, outcome_of
from updating.inference.workers import process_pool


class Pool(Protocol):
    """What computes units, in any order; the values are the same on every pool."""

    def outcomes(self, function: Function, shared: Any, units: Sequence[Unit]) -> Generator[Outcome]:
        """Yield the outcome of function(shared, unit) of each unit, as they end.

        Parameters
        ----------
        function : callable
            Of a module, so that other processes find it.
        shared : object
            What all units need; each worker gets it once.
        units : sequence
        """
        ...


class ThisProcess:
    """One unit after another, without other processes."""

    def outcomes(self, function: Function, shared: Any, units: Sequence[Unit]) -> Generator[Outcome]:
        """Yield the outcome of each unit, in their order."""
        for unit in units:
            yield outcome_of(function, shared, unit)


@dataclass(frozen=True, slots=True)
class LocalProcesses:
    """Processes of this machine, by ``concurrent.futures``.

    A process that ends from outside breaks the pool. Its units are then computed again, each alone, and the
    rest goes on in new processes. A unit that ends its process once more has failed.

    Attributes
    ----------
    n : int
        Number of processes.
    """

    n: int

    def outcomes(self, function: Function, shared: Any, units: Sequence[Unit]) -> Generator[Outcome]:
        """Yield the outcome of each unit, as they end."""
        waiting = deque(units)
        with TemporaryDirectory() as folder:
            file = Path(folder, "shared")
            file.write_bytes(pickle.dumps(shared, pickle.HIGHEST_PROTOCOL))
            while waiting:
                running: dict[Future[Outcome], Unit] = {}
                try:
                    with process_pool(self.n) as pool:
                        yield from self._together(pool, (function, str(file)), waiting, running)
                except BrokenProcessPool:
                    # one of these ended its process: each alone, to see which
                    for unit in running.values():
                        yield _alone(function, str(file), unit)

    def _together(
        self,
        pool: ProcessPoolExecutor,
        call: tuple[Function, str],
        waiting: deque[Unit],
        running: dict[Future[Outcome], Unit],
    ) -> Generator[Outcome]:
        while waiting or running:
            while waiting and len(running) < self.n:
                unit = waiting.popleft()
                try:
                    running[pool.submit(_call, *call, unit)] = unit
                except BrokenProcessPool:
                    waiting.appendleft(unit)
                    raise
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                outcome = _outcome(future, running[future])
                del running[future]
                yield outcome


def _outcome(future: Future[Outcome], unit: Unit) -> Outcome:
    """Return what a process gave, or why it gave nothing: a value that cannot be sent, for example."""
    try:
        return future.result()
    except BrokenProcessPool:
        raise
    except Exception as reason:
        return failed(unit, reason)


def _alone(function: Function, file: str, unit: Unit) -> Outcome:
    """Return the outcome of a unit in a process of its own."""
    try:
        with process_pool(1) as pool:
            return _outcome(pool.submit(_call, function, file, unit), unit)
    except BrokenProcessPool:
        return Outcome(unit, None, PROCESS_ENDED)


@lru_cache(1)
def _read(file: str) -> Any:
    return pickle.loads(Path(file).read_bytes())


def _call(function: Function, file: str, unit: Unit) -> Outcome:
    try:
        shared = _read(file)
    except Exception as reason:
        return failed(unit, reason)
    return outcome_of(function, shared, unit)


@contextmanager
def pool_of(processes: int | None = None, scheduler: str | None = None) -> Iterator[Pool]:
    """Give a pool: of a Dask cluster where its scheduler is named, of local processes otherwise.

    Parameters
    ----------
    processes : int, optional
        Processes of this machine; this one alone for 1 or None.
    scheduler : str, optional
        Address of a running Dask scheduler, ``tcp://host:8786``, or its scheduler file, ``cluster.json``.

    Raises
    ------
    PoolError
        If both are given, or the scheduler cannot be reached.
    """
    if scheduler is None:
        yield LocalProcesses(processes) if processes is not None and processes > 1 else ThisProcess()
        return
    if processes is not None:
        msg = (
            f"--processes {processes} and --scheduler {scheduler} are both given; a cluster has the workers "
            "that it was started with: give one of the two"
        )
        raise PoolError(msg)
    from dovetail.units.cluster import cluster_pool

    with cluster_pool(scheduler) as pool:
        yield pool
