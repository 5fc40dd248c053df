"""Small parts of the page."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar

from nicegui import Client, ui
from plotly.graph_objects import Figure

from dovetail.desk.scheme import is_dark
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
