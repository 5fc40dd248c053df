"""Small parts of the page."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from nicegui import ui


@contextmanager
def card(title: str) -> Iterator[ui.element]:
    """Give a part of the page with a heading."""
    with ui.element("section").classes("desk-card") as section:
        section.props["aria-label"] = title
        with ui.element("h2"):
            ui.label(title)
        yield section


def button(
    text: str, work: Callable[[], Any], icon: str, *, label: str = "", hint: str = "", flat: bool = True
) -> ui.button:
    """Return a button with a text, an icon, and words for screen readers."""
    made = ui.button(text, icon=icon, on_click=work).props(
        f"no-caps dense {'flat' if flat else 'unelevated'}"
    )
    made.props["aria-label"] = label or text
    if hint:
        made.tooltip(hint)
    return made


def labelled(name: str) -> tuple[ui.label, ui.label]:
    """Return the labels of a number with a name below: the number, and a second one."""
    with ui.element("div").classes("desk-figure") as box:
        value = ui.label().classes("value")
        value.props["data-figure"] = name
        ui.label(name).classes("name")
        was = ui.label().classes("was")
    box.props["role"] = "group"
    box.props["aria-label"] = name
    return value, was
