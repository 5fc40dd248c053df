"""Computing units one by one into a store, with the remaining time, until all are done or the user stops."""

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from dovetail.units.outcome import Function, Outcome, Unit
from dovetail.units.pool import Pool


@dataclass(frozen=True, slots=True)
class WorkStep:
    """A unit that has just ended.

    Attributes
    ----------
    outcome : Outcome
    done, total : int
        Units that are done, those of earlier runs too, and all [-].
    seconds_left : float
        By the mean time of the units of this run [s].
    """

    outcome: Outcome
    done: int
    total: int
    seconds_left: float

    @property
    def words(self) -> str:
        """How far the work is, in words."""
        return f"{self.done} of {self.total}, {duration(self.seconds_left)} to go"


def work_through(
    pool: Pool,
    function: Function,
    shared: Any,
    units: Sequence[Unit],
    keep: Callable[[Outcome], None],
    say: Callable[[WorkStep], None] = lambda step: None,
    done: int = 0,
) -> tuple[Outcome, ...]:
    """Compute units and keep the outcome of each as it ends; return those that failed.

    Parameters
    ----------
    pool : Pool
    function : callable
        function(shared, unit), of a module.
    shared : object
    units : sequence
        Those to be computed.
    keep : callable
        Writes an outcome, so that a run that is stopped loses none that has ended.
    say : callable
        Told of each unit.
    done : int
        Units that earlier runs have done.

    Raises
    ------
    KeyboardInterrupt
        With the number of units that are done, if the user stops the work.
    """
    start_time, total, ended = time.monotonic(), done + len(units), 0
    failures: list[Outcome] = []
    try:
        with closing(pool.outcomes(function, shared, units)) as outcomes:
            for outcome in outcomes:
                keep(outcome)
                ended += 1
                if outcome.failure:
                    failures.append(outcome)
                remaining = (time.monotonic() - start_time) / ended * (len(units) - ended)
                say(WorkStep(outcome, done + ended, total, remaining))
    except KeyboardInterrupt:
        msg = f"{done + ended} of {total} are done; the same command continues with the others"
        raise KeyboardInterrupt(msg) from None
    return tuple(failures)


def duration(seconds: float) -> str:
    """Return a time in words."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
