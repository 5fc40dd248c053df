"""The page's list of held-out bands, chosen by two numbers or by a zoom into the figure of FRFs."""

from collections.abc import Callable, Mapping
from typing import Any

from nicegui import ui

from dovetail.desk.session import Desk
from dovetail.desk.widgets import Act, button, labelled
from updating.measurement.held_out import Band, band_text

ENDS = ("xaxis.range[0]", "xaxis.range[1]")
"""Ends of the visible frequencies in what plotly tells of a zoom."""
DIGITS = 5
"""Significant digits of an end that a zoom gives [-]."""


class BandList:
    """Two fields for the ends of a band, a button that holds it out, and the bands that are held out.

    Parameters
    ----------
    desk : Desk
    act : callable
    changed : callable
        Called with the ends of the band in the fields when they change [Hz].
    """

    def __init__(self, desk: Desk, act: Act, changed: Callable[[Band], None]) -> None:
        self._desk, self._act = desk, act
        self._shown: Any = None
        f = desk.shown.frf.frequency
        with ui.element("div").classes("desk-row"):
            self._low, self._high = (
                self._field(word, float(at)) for word, at in (("Band from", f[0]), ("to", f[-1]))
            )
            button("Hold out this band", self._hold, "lock", hint="Zoom into the figure to choose its ends")
            self._box = ui.element("div").classes("desk-row").style("width: auto")
        for field in (self._low, self._high):
            field.on_value_change(lambda: changed(self._band))
        self.refresh()

    @property
    def _band(self) -> Band:
        return float(self._low.value or 0.0), float(self._high.value or 0.0)

    def zoomed(self, change: Mapping[str, Any], *, log: bool = False) -> None:
        """Take the visible frequencies as the ends of a band; a logarithmic axis gives exponents."""
        ends = change.get("xaxis.range") or [change.get(key) for key in ENDS]
        for field, x in zip((self._low, self._high), ends, strict=True):
            if isinstance(x, int | float):
                field.set_value(float(f"{10.0**x if log else max(x, 0.0):.{DIGITS}g}"))

    def refresh(self) -> None:
        """Show the bands that are held out."""
        bands = self._desk.now.hypothesis.held_out_bands
        if bands == self._shown:
            return
        self._shown = bands
        self._box.clear()
        with self._box:
            if not bands:
                ui.label("Held out: every fourth block of lines").classes("desk-note")
            for text in map(band_text, bands):
                button(
                    f"{text} held out",
                    lambda part=text: self._switch(part),
                    "lock",
                    label=f"fit {text} again",
                )

    def _switch(self, part: str) -> None:
        self._act(lambda: self._desk.hold_out(part))

    def _hold(self) -> None:
        band = self._band
        if band not in self._desk.now.hypothesis.held_out_bands:
            self._switch(band_text(band))

    def _field(self, word: str, value: float) -> ui.number:
        shown = float(f"{value:.{DIGITS}g}")
        field = ui.number(word, value=shown, suffix="Hz", min=0).props("dense outlined")
        return labelled(field, f"{word}, Hz").style("width: 128px")
