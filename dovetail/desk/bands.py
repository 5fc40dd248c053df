"""The page's list of held-out bands, chosen by two numbers or by a zoom into the figure of FRFs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from nicegui import ui

from dovetail.desk.widgets import button
from updating.measurement.held_out import band_text

if TYPE_CHECKING:
    from dovetail.desk.page import Page

ENDS = ("xaxis.range[0]", "xaxis.range[1]")
"""Ends of the visible frequencies in what plotly tells of a zoom."""
DIGITS = 5
"""Significant digits of an end that a zoom gives [-]."""


class BandList:
    """Two fields for the ends of a band, a button that holds it out, and the bands that are held out.

    Parameters
    ----------
    page : Page
    """

    def __init__(self, page: Page) -> None:
        self._page = page
        self._shown: Any = None
        f = page.desk.shown.frf.frequency
        with ui.element("div").classes("desk-row"):
            self._low, self._high = (
                self._field(word, float(at)) for word, at in (("Band from", f[0]), ("to", f[-1]))
            )
            button("Hold out this band", self._hold, "lock", hint="Zoom into the figure to choose its ends")
            self._box = ui.element("div").classes("desk-row").style("width: auto")
        self.refresh()

    def zoomed(self, change: Mapping[str, Any]) -> None:
        """Take the visible frequencies as the ends of a band."""
        ends = change.get("xaxis.range") or [change.get(key) for key in ENDS]
        for field, x in zip((self._low, self._high), ends, strict=True):
            if isinstance(x, int | float):
                field.set_value(float(f"{max(x, 0.0):.{DIGITS}g}"))

    def refresh(self) -> None:
        """Show the bands that are held out."""
        page, desk = self._page, self._page.desk
        bands = desk.now.hypothesis.held_out_bands
        if bands == self._shown:
            return
        self._shown = bands
        self._box.clear()
        with self._box:
            if not bands:
                ui.label("Held out: every fourth block of lines").classes("desk-note")
            for text in map(band_text, bands):
                button(
                    f"{text} held out", lambda part=text: page.act(lambda: desk.hold_out(part)), "lock",
                    label=f"fit {text} again",
                )  # fmt: skip

    def _hold(self) -> None:
        page, desk = self._page, self._page.desk
        band = (float(self._low.value or 0.0), float(self._high.value or 0.0))
        if band not in desk.now.hypothesis.held_out_bands:
            page.act(lambda: desk.hold_out(band_text(band)))

    def _field(self, word: str, value: float) -> ui.number:
        shown = float(f"{value:.{DIGITS}g}")
        field = ui.number(word, value=shown, suffix="Hz", min=0).props("dense outlined")
        field.props["aria-label"] = f"{word}, Hz"
        return field.style("width: 128px")
