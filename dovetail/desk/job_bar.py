"""The page's bar of a job that runs in the background."""

from collections.abc import Callable
from typing import Any

from nicegui import ui

from dovetail.desk.jobs import Job
from dovetail.desk.widgets import button, labelled
from dovetail.report.words import directions
from dovetail.units.work import duration

Start = Callable[[Callable[[], Job], Callable[[Job], None]], None]
"""Starts a job, unless one is running, and calls the second argument with it when it has a result."""


class JobBar:
    """One job at a time, with its progress, the remaining time, and a button that cancels it.

    Parameters
    ----------
    word : str
        Kind of its jobs.
    before : callable
        Called before a job starts.
    """

    def __init__(self, word: str, before: Callable[[], Any]) -> None:
        self._word, self._before = word, before
        self._job: Job | None = None
        self._take: Callable[[Job], None] | None = None
        self._row = ui.element("div").classes("desk-row").props(f'role="status" aria-label="{word}"')
        with self._row:
            self._text = ui.label().classes("desk-note desk-job")
            self._bar = ui.linear_progress(0.0, show_value=False).style("flex: 1; min-width: 120px")
            labelled(self._bar, f"{word}: progress")
            button("Cancel", self._cancel, "stop", label=f"Cancel: {word}")
        self._row.set_visibility(False)

    @property
    def busy(self) -> bool:
        """Whether a job is running."""
        return self._job is not None

    def start(self, begin: Callable[[], Job], take: Callable[[Job], None]) -> None:
        """Start a job, unless one is running; its result is passed on with it."""
        if self._job is not None:
            ui.notify(f"A {self._word.lower()} is running; cancel it first.", type="warning")
            return
        self._before()
        self._job, self._take = begin(), take
        self._show(self._job)

    def look(self) -> None:
        """Show how far the job is, or pass its result on."""
        job, take = self._job, self._take
        if job is None or take is None:
            return
        self._show(job)
        if not (job.done or job.ending):
            return
        self._job = self._take = None
        self._row.set_visibility(False)
        if job.ending:  # its thread ends with the step that it is at, and gives nothing
            ui.notify(f"{job.title}: cancelled")
        elif job.error is not None:
            ui.notify(f"{job.title}: {job.error}", type="negative", multi_line=True)
        else:
            take(job)

    def _cancel(self) -> None:
        if self._job is not None:
            self._job.cancel()

    def _show(self, job: Job) -> None:
        self._row.set_visibility(True)
        left = job.remaining
        rest = "" if left is None else f", about {duration(left)} left"
        self._text.set_text(f"{job.title}: {job.fraction:.0%}{rest}: {directions(job.text) or 'begins'}")
        self._bar.set_value(round(job.fraction, 3))
