"""The page's help: a dialog that opens by itself until it was closed once."""

from nicegui import ui

COOKIE = "dovetail-desk-help"
"""Holds that the help was closed; a cookie, because its host has another port each time."""
CLOSED = f"document.cookie = '{COOKIE}=closed; path=/; max-age=31536000; SameSite=Strict'"
STEPS = {
    "Compare": "The header shows how far the model is from the measurement. A click on a sensor, or the list "
    "Sensor, shows its FRFs. The list View shows them as Nyquist plot, CMIF, FRAC or sensitivity.",
    "Fit": "Fit the uncertain parameters first: only what they cannot explain is missing from the model.",
    "Add effects": "A click on a joint or member lists the effects that may be missing there. + adds one. "
    "Its slider changes the FRFs at once. Evidence shows what supports it and what does not.",
    "Search": "Diagnose searches by itself. Take over makes its model the present hypothesis.",
    "Save": "Save study writes a study file that every command reads. Every action can be undone.",
}
KEYS = {
    "Tab, Shift+Tab": "next and previous control",
    "Enter, Space": "press a button, open a list, tick a box",
    "Ctrl+Z, Ctrl+Y, Ctrl+S": "undo, redo, save the study",
    "Arrow keys": "move a slider, or turn the model; + and − zoom the model",
    "Page Up, Page Down": "move a slider faster",
    "Esc": "close a dialog or a list",
}


class Help:
    """A dialog with the steps of the work and the keys."""

    def __init__(self) -> None:
        seen = COOKIE in ui.context.client.request.cookies
        with ui.dialog(value=not seen) as self._dialog, ui.card().classes("desk-help"):
            ui.label("How the desk works").classes("desk-title").props('role="heading" aria-level="2"')
            for rows in (STEPS, KEYS):
                with ui.element("dl"):
                    for term, words in rows.items():
                        with ui.element("dt"):
                            ui.label(term)
                        with ui.element("dd"):
                            ui.label(words)
            ui.button("Close", on_click=self._dialog.close).props("flat no-caps autofocus")
        self._dialog.on("hide", js_handler=f"() => {{ {CLOSED}; }}")

    def open(self) -> None:
        """Open the help again."""
        self._dialog.open()
