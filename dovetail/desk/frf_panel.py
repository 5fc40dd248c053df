"""The page's FRFs: which one, in which view, and the bands that are held out."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from nicegui import ui
from plotly.graph_objects import Figure

from dovetail.desk.session import Desk
from dovetail.desk.views import VIEWS, Chosen, DeskView
from dovetail.desk.widgets import Act, button, card, check, choice, labelled, plot, show
from updating.live.engine import Evaluation
from updating.measurement.held_out import Band, band_text

FIRST = next(iter(VIEWS))
"""The view at the beginning."""
ENDS = ("xaxis.range[0]", "xaxis.range[1]")
"""Ends of the visible frequencies in what plotly tells of a zoom."""
DIGITS = 5
"""Significant digits of an end that a zoom gives [-]."""


class FrfPanel:
    """Lists for sensor, excitation and view, the figure, and the bands.

    Parameters
    ----------
    desk : Desk
    act : callable
    """

    def __init__(self, desk: Desk, act: Act) -> None:
        self._desk, self._name = desk, FIRST
        measured = desk.shown.measured
        sensors, excitations, f = list(measured.outputs), list(measured.inputs), measured.frequency
        self._chosen = Chosen((sensors[0], excitations[0]), False, (float(f[0]), float(f[-1])))
        views = [name for name, view in VIEWS.items() if measured.has_phase or not view.needs_phase]
        with card("FRFs") as self._card:
            with ui.element("div").classes("desk-row"):
                self._view = choice("View", views, FIRST, self._show_view, width=190)
                self._sensor = choice("Sensor", sensors, sensors[0], self._show_sensor)
                self._excitation = choice("Excitation", excitations, excitations[0], self._show_excitation)
                self._scale = check("Logarithmic frequency", False, self._show_scale)
            self._figure = self._drawn()
            self.plot = plot(self._figure, self.view.words)
            self.bands = BandList(desk, act, self._show_band)
        self.plot.on("plotly_relayout", lambda e: self._zoomed(e.args))
        self.plot.on("plotly_click", lambda e: self._clicked(e.args))

    @property
    def view(self) -> DeskView:
        """The view shown."""
        return VIEWS[self._name]

    def refresh(self) -> None:
        """Show the present state."""
        self._figure = self._drawn()
        show(self.plot, self._figure)
        self.bands.refresh()

    def moved(self, shown: Evaluation) -> tuple[list[Any], list[int]]:
        """Return the changes of the figure with a slider, and the traces that get them."""
        return self.view.moved(self._figure, shown, self._chosen)

    def open(self, role: str, name: str) -> None:
        """Show an FRF of a sensor or an excitation that was clicked, and bring it into sight."""
        if not self.view.one_frf:
            self._view.set_value(FIRST)
        (self._sensor if role == "sensor" else self._excitation).set_value(name)
        ui.run_javascript(f"getHtmlElement({self._card.id}).scrollIntoView({{block: 'nearest'}})")

    def _drawn(self) -> Figure:
        figure = self.view.draw(self._desk, self._chosen)
        # a zoom stays while values change, but not in another view
        return figure.update_layout(uirevision=f"{self._name} {self._chosen.log}")

    def _show_view(self, name: str) -> None:
        self._name = name
        self._scale.set_visibility(self.view.over_frequency)
        labelled(self.plot, self.view.words)
        self.refresh()

    def _show_scale(self, log: bool) -> None:
        self._choose(log=log)

    def _show_sensor(self, name: str) -> None:
        self._choose(pair=(name, self._chosen.pair[1]))

    def _show_excitation(self, name: str) -> None:
        self._choose(pair=(self._chosen.pair[0], name))

    def _show_band(self, band: Band) -> None:
        self._chosen = replace(self._chosen, band=band)
        if self.view.of_band:
            self.refresh()

    def _choose(self, **changes: Any) -> None:
        self._chosen = replace(self._chosen, **changes)
        self.refresh()

    def _zoomed(self, change: dict[str, Any]) -> None:
        if self.view.over_frequency:
            self.bands.zoomed(change, log=self._chosen.log)

    def _clicked(self, event: dict[str, Any]) -> None:
        sensor = event["points"][0].get("customdata")
        if sensor in self._desk.shown.measured.outputs:
            self.open("sensor", sensor)


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
