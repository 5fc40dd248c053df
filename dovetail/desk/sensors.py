"""The page's list of sensors and excitations: left out, held out, or corrected by sign and gain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from nicegui import ui

if TYPE_CHECKING:
    from dovetail.desk.page import Page


class SensorList:
    """For each sensor a switch, whether it is held out, a sign and a gain; for excitations the second alone.

    Parameters
    ----------
    page : Page
    """

    def __init__(self, page: Page) -> None:
        self._page = page
        with ui.expansion("Sensors: leave out, hold out, turn, correct").classes("desk-card"):
            ui.label(
                "A sensor that is left out counts nowhere. One that is held out (lock) is compared and not "
                "fitted. The gain is the factor by which it reads too much."
            ).classes("desk-note")
            self._box = ui.element("div").classes("desk-sensors")
        self._known: Any = None
        self.refresh()

    def refresh(self) -> None:
        """Show the present corrections of the sensors."""
        desk = self._page.desk
        h, errors = desk.now.hypothesis, desk.shown.by_sensor()
        now = (h.off, h.held_out, h.faults, errors.tobytes())
        if now == self._known:
            return
        self._known = now
        faults = {(f.kind, f.sensor): f.value for f in h.faults}
        self._box.clear()
        with self._box:
            for name, error in zip(desk.shown.comparison.outputs, errors, strict=True):
                self._row(name, float(error), name not in h.off, faults)
            for name in desk.shown.comparison.inputs if len(desk.shown.comparison.inputs) > 1 else ():
                with ui.element("div").classes("desk-sensor"):
                    ui.label(f"excitation {name}").classes("name")
                    self._hold(f"excitation {name}")

    def _row(self, name: str, error: float, on: bool, faults: dict[tuple[str, str], float]) -> None:
        page, desk = self._page, self._page.desk
        with ui.element("div").classes("desk-sensor"):
            counted = ui.checkbox(value=on, on_change=lambda: page.act(lambda: desk.switch(name)))
            counted.props["aria-label"] = f"count sensor {name}"
            ui.label(name).classes("name")
            ui.label(f"{error:.1f} dB" if np.isfinite(error) else "–").classes("desk-note")
            turned = ("sensor_sign", name) in faults
            self._hold(f"sensor {name}")
            sign = ui.button("−" if turned else "+", on_click=lambda: page.act(lambda: desk.turn(name)))
            sign.props("dense flat round size=sm")
            sign.props["aria-label"] = f"sign of sensor {name}"
            sign.props["aria-pressed"] = str(turned).lower()
            gain = ui.number(value=faults.get(("sensor_gain", name), 1.0), step=0.05, format="%.4g")
            gain.props("dense borderless debounce=600").style("width: 58px")
            gain.props["aria-label"] = f"gain of sensor {name}"
            gain.on_value_change(lambda e: self._entered(name, e.value))

    def _entered(self, sensor: str, gain: float | None) -> None:
        """Take a gain that was typed; the field shows the present one again where it is refused."""
        page, desk = self._page, self._page.desk
        if gain is not None:  # the field is empty while another number is typed
            page.act(lambda: desk.set_gain(sensor, float(gain)))
            if gain <= 0:
                self._known = None
                self.refresh()

    def _hold(self, channel: str) -> None:
        """Show whether a channel is held out, as a button that changes it."""
        page, desk = self._page, self._page.desk
        held = channel in desk.now.hypothesis.held_out
        made = ui.button(
            icon="lock" if held else "lock_open", on_click=lambda: page.act(lambda: desk.hold_out(channel))
        )
        made.props("dense flat round size=sm")
        made.props["aria-label"] = f"hold out {channel}"
        made.props["aria-pressed"] = str(held).lower()
