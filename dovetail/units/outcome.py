"""Outcomes of units: a value, or the reason why there is none."""

import os
import traceback
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Unit = Hashable
"""Names a unit: a number, a file, a tuple of both. It decides all that is random in it, such as its seed."""

Function = Callable[[Any, Any], Any]
"""function(shared, unit) of a module, so that other processes find it."""

PROCESS_ENDED = "its process ended: out of memory, or stopped from outside"
"""Reason of a unit that ended a process of its own."""


class PoolError(ValueError):
    """Workers that cannot be had, or that run another program."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a unit.

    Attributes
    ----------
    unit : hashable
    value : object
        Result of the function; None for a unit that failed.
    failure : str
        Why it failed, in a line; empty for one that did not.
    traceback : str
        Of the error that it failed with.
    """

    unit: Any
    value: Any = None
    failure: str = ""
    traceback: str = ""


def outcome_of(function: Function, shared: Any, unit: Any) -> Outcome:
    """Call a function for a unit with one BLAS thread, so that its numbers are the same everywhere."""
    from fem.linalg.solvers import one_thread

    try:
        with one_thread():
            return Outcome(unit, function(shared, unit))
    except Exception as reason:
        return failed(unit, reason)


def failed(unit: Any, reason: BaseException) -> Outcome:
    """Return the outcome of a unit that raised an error."""
    text = " ".join(str(reason).split()) or "no message"
    # Records are kept with the results: where the program lay says nothing.
    trace = "".join(traceback.format_exception(reason)).replace(f"{Path(__file__).parents[2]}{os.sep}", "")
    named = text if isinstance(reason, ValueError | OSError) else f"{type(reason).__name__}: {text}"
    return Outcome(unit, None, named, trace)
