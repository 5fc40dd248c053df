"""Runs a reader on many inputs in a process of its own, which may die, hang or ask for too much memory."""

import contextlib
import multiprocessing
import random
import resource
import signal
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.fuzz.mutation import mutated

OURS = ("fem", "updating", "joint", "viz", "dovetail")
"""Packages whose ValueErrors are answers."""

MOST_SECONDS = 20.0
"""Processor time of one input; a study that is damaged into 28 000 elements is checked in 8 s."""
MOST_MEMORY = 2 << 30
"""Address space that one input may ask for [bytes]."""
SILENCE = 90.0
"""Seconds without a finished input after which the process is killed: what hangs in compiled code."""


class TooLongError(BaseException):
    """An input took more than its processor time; no reader catches it."""


@dataclass(frozen=True)
class Target:
    """A reader under test.

    Attributes
    ----------
    name : str
    file : str
        Name of the file that the input is written to.
    seeds : callable
        Returns valid files; called once, with a scratch folder.
    read : callable
        Reads the file whose path it is given.
    draw : callable, optional
        Returns an input drawn from a random generator, for formats in which damaged bytes are refused before
        anything is read of them.
    """

    name: str
    file: str
    seeds: Callable[[Path], list[bytes]]
    read: Callable[[Path], Any]
    draw: Callable[[random.Random], bytes] | None = None


@dataclass(frozen=True)
class Failure:
    """An input that ended in something else than an answer.

    Attributes
    ----------
    index : int
    what : str
        Exception, signal, or limit.
    where : str
        Innermost line of ours.
    """

    index: int
    what: str
    where: str


def input_of(target: Target, seeds: list[bytes], seed: int, index: int) -> bytes:
    """Return the input with a number; the same one every time."""
    rng = random.Random(f"{target.name}:{seed}:{index}")
    if target.draw is not None and rng.random() < 0.7:
        return target.draw(rng)
    return mutated(rng, seeds)


def run(
    target: Target,
    seeds: list[bytes],
    seed: int,
    count: int,
    folder: Path,
    *,
    until: float = float("inf"),
    progress: Callable[[int], None] | None = None,
) -> tuple[int, list[Failure]]:
    """Run a target on `count` inputs, or until a time.

    Returns
    -------
    done : int
        Number of inputs that were run.
    failures : list of Failure
    """
    context = multiprocessing.get_context("fork")
    failures: list[Failure] = []
    start = 0
    while start < count and time.monotonic() < until:
        at = context.Value("q", start)
        queue = context.SimpleQueue()
        child = context.Process(
            target=_child, args=(target, seeds, seed, start, count, until, folder, at, queue)
        )
        child.start()
        seen, since = start, time.monotonic()
        while child.is_alive():
            child.join(0.2)
            failures += _drained(queue)
            if at.value != seen:
                seen, since = at.value, time.monotonic()
                if progress is not None:
                    progress(seen)
            if time.monotonic() - since > SILENCE:
                child.kill()
                child.join()
                failures.append(Failure(seen, f"no answer within {SILENCE:g} s", ""))
                break
        failures += _drained(queue)
        if child.exitcode == 0:
            return int(at.value), failures
        if (
            child.exitcode is not None
            and child.exitcode < 0
            and not (failures and failures[-1].index == at.value)
        ):
            failures.append(Failure(int(at.value), f"signal {signal.Signals(-child.exitcode).name}", ""))
        start = int(at.value) + 1
    return start, failures


def _drained(queue: Any) -> Iterator[Failure]:
    while not queue.empty():
        yield queue.get()


def _child(
    target: Target,
    seeds: list[bytes],
    seed: int,
    start: int,
    count: int,
    until: float,
    folder: Path,
    at: Any,
    queue: Any,
) -> None:
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MOST_MEMORY, size + MOST_MEMORY))
    signal.signal(signal.SIGVTALRM, _too_long)
    path = folder / target.file
    for index in range(start, count):
        if time.monotonic() > until:
            break
        path.write_bytes(input_of(target, seeds, seed, index))
        failure = attempt(target, path, index)
        if failure is not None:
            queue.put(failure)
        at.value = index + 1


def _too_long(*_: Any) -> None:
    raise TooLongError


def attempt(target: Target, path: Path, index: int = 0) -> Failure | None:
    """Read one file; return what went wrong, None for an answer."""
    signal.setitimer(signal.ITIMER_VIRTUAL, MOST_SECONDS)
    try:
        with warnings.catch_warnings(), open("/dev/null", "w") as sink, contextlib.redirect_stdout(sink):
            warnings.simplefilter("ignore")
            target.read(path)
    except TooLongError as reason:
        return Failure(index, f"more than {MOST_SECONDS:g} s", _where(reason))
    except OSError as reason:
        return None if reason.filename is not None else Failure(index, repr(reason)[:200], _where(reason))
    except ValueError as reason:
        if type(reason).__module__.split(".")[0] in OURS:
            return None
        return Failure(index, f"{type(reason).__name__}: {reason}"[:200], _where(reason))
    except BaseException as reason:
        return Failure(index, f"{type(reason).__name__}: {reason}"[:200], _where(reason))
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    return None


def _where(reason: BaseException) -> str:
    frames = traceback.extract_tb(reason.__traceback__)
    ours = [
        f
        for f in frames
        if any(f"/{name}/" in f.filename for name in OURS) and "site-packages" not in f.filename
    ]
    return f"{'/'.join(ours[-1].filename.split('/')[-3:])}:{ours[-1].lineno}" if ours else ""
