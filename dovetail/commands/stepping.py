"""How commands tell how far work on many units is."""

import sys
import time
from collections.abc import Callable
from pathlib import Path

from dovetail.commands.common import Options
from dovetail.disk.output import Progress
from dovetail.units.outcome import Unit
from dovetail.units.work import WorkStep

SECONDS = 10.0
"""Least time between two lines where there is no terminal for a bar [s]."""


def step_progress(options: Options, progress: Progress) -> Callable[[WorkStep], None]:
    """Return a function that shows each step: as a bar, or now and then as a line on standard error."""
    last = [time.monotonic()]

    def say(step: WorkStep) -> None:
        progress(step.words, step.done, step.total)
        now = time.monotonic()
        due = now - last[0] > SECONDS
        if not options.quiet and not sys.stderr.isatty() and (due or step.outcome.failure):
            last[0] = now
            ended = f"; {_name(step.outcome.unit)}: {step.outcome.failure}" if step.outcome.failure else ""
            sys.stderr.write(f"{step.words}{ended}\n")

    return say


def _name(unit: Unit) -> str:
    """Return a unit in words: a file by its name, without the size and time by which it is known again."""
    return Path(unit[0]).name if isinstance(unit, tuple) else str(unit)
