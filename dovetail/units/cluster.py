"""A pool of the workers of a running Dask cluster."""

import hashlib
import logging
import pickle
import threading
import time
import warnings
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from dovetail.units.outcome import PROCESS_ENDED, Function, Outcome, PoolError, Unit, failed, outcome_of
from dovetail.units.program import fingerprint

CONNECT_SECONDS = 20
"""Longest wait for an answer of the scheduler [s]."""


KILLED = f"{PROCESS_ENDED}, on two workers"

_ONE = threading.Lock()
"""Threads and warnings of numerics belong to a process: units of one process run one after another."""

_SHARED: dict[str, Any] = {}


@dataclass(frozen=True, slots=True)
class ClusterPool:
    """The workers of a Dask cluster, whose number may change.

    Units that were on a worker that ends are computed once more, each alone, and have failed if that ends a
    worker too. So a unit that always ends its process takes two workers, however many are restarted or not.
    What all units need is a task as well, which any worker can do again, and not data that end with the
    workers that hold them.

    Attributes
    ----------
    client : distributed.Client
    """

    client: Any

    def outcomes(self, function: Function, shared: Any, units: Sequence[Unit]) -> Generator[Outcome]:
        """Yield the outcome of each unit, as they end.

        Raises
        ------
        PoolError
            If a worker runs another program, or the scheduler has gone.
        """
        payload = pickle.dumps(shared, pickle.HIGHEST_PROTOCOL)
        suspects: list[Unit] = []
        threads = sum(self.client.nthreads().values())
        with _no_second_worker(self.client):
            for outcome in self._together(
                # the scheduler holds 4 units for each thread, and 256 at least: workers may join later
                self._call(function, payload),
                units,
                max(4 * threads, 256),
            ):
                if outcome.failure == KILLED:
                    suspects.append(outcome.unit)
                else:
                    yield outcome
            for unit in suspects:  # one of those together has ended the worker: each alone, to see which
                yield from self._together(self._call(function, payload), [unit], 1)

    def _call(self, function: Function, payload: bytes) -> Any:
        """Return what submits a unit, with the data that all need sent once."""
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Sending large graph")
            sent = self.client.submit(_same, payload, pure=False)
        key = hashlib.sha256(payload).hexdigest()
        return partial(self.client.submit, _call, function, sent, key, fingerprint(), pure=False)

    def _together(self, call: Any, units: Sequence[Unit], ahead: int) -> Generator[Outcome]:
        """Yield the outcomes of units, with at most ``ahead`` at the scheduler at a time."""
        from distributed import as_completed

        waiting, running = deque(units), {}

        def submit() -> Any:
            unit = waiting.popleft()
            future = call(unit)
            running[future] = unit
            return future

        ended = as_completed([submit() for _ in range(min(len(waiting), ahead))], loop=self.client.loop)
        try:
            for future in ended:
                outcome = _outcome(future, running.pop(future))
                future.release()
                if waiting:
                    ended.add(submit())
                yield outcome
        finally:
            with suppress(Exception):  # the scheduler may have ended
                self.client.cancel(list(running))


@contextmanager
def _no_second_worker(client: Any) -> Iterator[None]:
    """Let the scheduler give no unit of a worker that ended to another one by itself.

    By default it does so four times, and a unit that ends its process takes as many workers with it: all of
    a small cluster, where nothing restarts them. Whoever else uses the cluster meets the same meanwhile.
    """

    def allow(dask_scheduler: Any, number: int | None) -> None:
        from dask import config

        default = config.get("distributed.scheduler.allowed-failures")
        dask_scheduler.allowed_failures = default if number is None else number

    client.run_on_scheduler(allow, number=0)
    try:
        yield
    finally:
        with suppress(Exception):  # the scheduler may have ended
            client.run_on_scheduler(allow, number=None)


def _outcome(future: Any, unit: Unit) -> Outcome:
    """Return what a worker gave, or why it gave nothing."""
    from distributed import CancelledError, KilledWorker

    try:
        return future.result()  # waits where the worker has ended since, and another one begins again
    except KilledWorker:
        return Outcome(unit, None, KILLED)
    except PoolError:
        raise
    except CancelledError:
        msg = "the connection to the scheduler was lost; the same command continues with the others"
        raise PoolError(msg) from None
    except Exception as reason:
        return failed(unit, reason)


def _same(payload: bytes) -> bytes:
    return payload


def _call(function: Function, payload: bytes, key: str, program: str, unit: Unit) -> Outcome:
    if fingerprint() != program:
        msg = (
            f"a worker of the cluster runs another version of the program, or of NumPy or SciPy "
            f"({fingerprint()} there, {program} here); install the same on all machines"
        )
        raise PoolError(msg)
    with _ONE:
        if key not in _SHARED:
            _SHARED.clear()
            _SHARED[key] = pickle.loads(payload)
        return outcome_of(function, _SHARED[key], unit)


def _wait_for(file: Path) -> None:
    """Wait for a file that a scheduler writes when it starts; raise a PoolError if it does not come."""
    end = time.monotonic() + CONNECT_SECONDS
    while not file.exists():
        if time.monotonic() > end:
            msg = f"--scheduler {file}: there is no such file; a scheduler writes it when it starts"
            raise PoolError(msg)
        time.sleep(0.1)


@contextmanager
def cluster_pool(scheduler: str) -> Iterator[ClusterPool]:
    """Give the pool of a running cluster; the cluster stays.

    Parameters
    ----------
    scheduler : str
        Address, ``tcp://host:8786``, or a scheduler file, which ends in ``.json``.

    Raises
    ------
    PoolError
        Without the extra ``cluster``, or if the scheduler does not answer.
    """
    try:
        from distributed import Client
    except ImportError:
        msg = "--scheduler needs Dask; install it with python -m pip install distributed"
        raise PoolError(msg) from None
    logging.getLogger("distributed.client").setLevel(logging.ERROR)
    where: dict[str, Any] = {"scheduler_file" if scheduler.endswith(".json") else "address": scheduler}
    if "scheduler_file" in where:
        _wait_for(Path(scheduler))  # Client would wait for it without end
    try:
        client = Client(**where, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError) as reason:
        text = " ".join(str(reason).split())
        msg = f"--scheduler {scheduler}: no Dask scheduler answers there ({text or type(reason).__name__})"
        raise PoolError(msg) from None
    try:
        yield ClusterPool(client)
    finally:
        with suppress(Exception):
            client.close()
