"""Small parts of the page."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar

from nicegui import Client, ui
from plotly.graph_objects import Figure

from dovetail.desk.jobs import Job
from dovetail.report.words import directions
from dovetail.units.work import duration
from viz.interactive.theme import CONFIG, at_night

E = TypeVar("E", bound=ui.element)
Act = Callable[[Callable[[], None]], None]
"""Does something that gives a new state, and shows it."""


@contextmanager
def card(title: str) -> Iterator[ui.element]:
    """Give a part of the page with a heading."""
    with ui.element("section").classes("desk-card") as section:
        section.props["aria-label"] = title
        with ui.element("h2"):
            ui.label(title)
        yield section


def labelled(element: E, words: str) -> E:
    """Return an element with words for screen readers."""
    element.props["aria-label"] = words
    return element


def choice(
    word: str,
    options: Any,
    value: str,
    chosen: Callable[[Any], None],
    *,
    width: int = 120,
    typed: bool = False,
) -> ui.select:
    """Return a list to choose from, by typing a part of a name if so ``typed``.

    ``chosen`` is called with the new value.
    """
    made = ui.select(options, value=value, label=word, with_input=typed, on_change=lambda e: chosen(e.value))
    return labelled(made.props("dense outlined"), word).style(f"min-width: {width}px; max-width: 100%")


def check(word: str, value: bool, changed: Callable[[bool], None] | None = None) -> ui.checkbox:
    """Return a box to tick; ``changed`` is called with whether it is ticked."""
    made = ui.checkbox(word, value=value, on_change=changed and (lambda e: changed(bool(e.value))))
    return labelled(made.props("dense"), word)


def button(text: str, work: Callable[[], Any], icon: str, *, label: str = "", hint: str = "") -> ui.button:
    """Return a button with a text, an icon, and words for screen readers."""
    made = ui.button(text, icon=icon, on_click=work).props("no-caps dense flat")
    if hint:
        made.tooltip(hint)
    return labelled(made, label or text)


def plot(figure: Figure, label: str) -> ui.plotly:
    """Return a figure in the page, with words for screen readers."""
    made = ui.plotly(_dressed(figure, ui.context.client)).classes("desk-plot").props("role=img")
    return labelled(made, label)


def show(made: ui.plotly, figure: Figure) -> None:
    """Show another figure in its place."""
    made.update_figure(_dressed(figure, made.client))


def _dressed(figure: Figure, client: Client) -> dict[str, Any]:
    """Return a figure as the page takes it, in the colours of the page."""
    coloured = at_night(figure) if is_dark(client) else figure
    return {**coloured.to_plotly_json(), "config": CONFIG}


class Keys(ui.element, component="keys.js"):
    """Keys of the whole page, wherever the focus is.

    Parameters
    ----------
    actions : mapping of str to callable
        By ``undo``, ``redo`` and ``save``.
    """

    def __init__(self, actions: Mapping[str, Callable[[], Any]]) -> None:
        super().__init__()
        self.on("act", lambda e: actions[e.args]())


class Numbers(ui.element, component="numbers.js"):
    """A row of numbers, each with a name below.

    They are shown by a method, as a property of an element makes the browser render the whole page anew.

    Parameters
    ----------
    names : mapping of str to str
        Their names by key.
    start : mapping of str to str
        Their texts.
    """

    def __init__(self, names: Mapping[str, str], start: Mapping[str, str]) -> None:
        super().__init__()
        self._props["names"], self._props["start"] = dict(names), dict(start)

    def show(self, now: Mapping[str, str], second: Mapping[str, str]) -> None:
        """Show other texts, and those of a second hypothesis below; without one no texts."""
        self.run_method("show", dict(now), dict(second))


# Light or dark: the server makes the figures, so that the address says which colours the browser prefers


KEY, LIGHT, DARK = "scheme", "light", "dark"
_SCRIPT = """<script>(() => {{
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const load = () => {{
    const address = new URL(location.href);
    address.searchParams.set("{key}", dark.matches ? "{dark}" : "{light}");
    location.replace(address);
  }};
  {when}
}})();</script>"""
ASK = _SCRIPT.format(key=KEY, dark=DARK, light=LIGHT, when="load();")
"""A page that loads the desk in the preferred colours."""
FOLLOW = _SCRIPT.format(key=KEY, dark=DARK, light=LIGHT, when='dark.addEventListener("change", load);')
"""Loads the desk again when the preference changes; its state is the server's."""


def is_dark(client: Client) -> bool:
    """Return whether a tab shows the desk in light colours on a dark page."""
    return client.request.query_params.get(KEY) == DARK


# The page's bar of a job that runs in the background --------------------------------------------------------


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
