"""The page's list of sensors and excitations: left out, held out, or corrected by sign and gain."""

from typing import Any

import numpy as np
from nicegui import ui

from dovetail.desk.session import Desk
from dovetail.desk.widgets import Act, labelled


class SensorList:
    """For each sensor a switch, whether it is held out, a sign and a gain; for excitations the second alone.

    Parameters
    ----------
    desk : Desk
    act : callable
    """

    def __init__(self, desk: Desk, act: Act) -> None:
        self._desk, self._act = desk, act
        with ui.expansion("Sensors: leave out, hold out, turn, correct").classes("desk-card"):
            ui.label(
                "A sensor that is left out counts nowhere. One that is held out (lock) is compared and not "
                "fitted. The gain is the factor by which it reads too much."
            ).classes("desk-note")
            self._box = ui.element("div").classes("desk-sensors")
        self._known: Any = None
        self._errors: dict[str, ui.label] = {}
        self.refresh()

    def refresh(self) -> None:
        """Show the present corrections of the sensors."""
        desk = self._desk
        h, sensors = desk.now.hypothesis, desk.shown.comparison.outputs
        now = (h.off, h.held_out, h.faults)
        if now != self._known:
            self._known = now
            self._show_rows()
        for name, error in zip(sensors, desk.shown.by_sensor(), strict=True):
            self._errors[name].set_text(f"{error:.1f} dB" if np.isfinite(error) else "–")

    def _show_rows(self) -> None:
        """Make the rows anew; most actions change the errors alone, whose texts are less work."""
        desk, h = self._desk, self._desk.now.hypothesis
        faults = {(f.kind, f.sensor): f.value for f in h.faults}
        self._box.clear()
        with self._box:
            for name in desk.shown.comparison.outputs:
                self._row(name, name not in h.off, faults)
            for name in desk.shown.comparison.inputs if len(desk.shown.comparison.inputs) > 1 else ():
                with ui.element("div").classes("desk-sensor"):
                    ui.label(f"excitation {name}").classes("name")
                    self._hold(f"excitation {name}")

    def _row(self, name: str, on: bool, faults: dict[tuple[str, str], float]) -> None:
        act, desk = self._act, self._desk
        with ui.element("div").classes("desk-sensor"):
            counted = ui.checkbox(value=on, on_change=lambda: act(lambda: desk.switch(name)))
            labelled(counted, f"count sensor {name}")
            ui.label(name).classes("name")
            self._errors[name] = ui.label().classes("desk-note")
            turned = ("sensor_sign", name) in faults
            self._hold(f"sensor {name}")
            sign = ui.button("−" if turned else "+", on_click=lambda: act(lambda: desk.turn(name)))
            _pressed(sign, turned, f"sign of sensor {name}")
            gain = ui.number(value=faults.get(("sensor_gain", name), 1.0), step=0.05, format="%.4g")
            gain.props("dense borderless debounce=600").style("width: 58px")
            labelled(gain, f"gain of sensor {name}")
            gain.on_value_change(lambda e: self._entered(name, e.value))

    def _entered(self, sensor: str, gain: float | None) -> None:
        """Take a gain that was typed; the field shows the present one again where it is refused."""
        if gain is not None:  # the field is empty while another number is typed
            self._act(lambda: self._desk.set_gain(sensor, float(gain)))
            if gain <= 0:
                self._known = None
                self.refresh()

    def _hold(self, channel: str) -> None:
        """Show whether a channel is held out, as a button that changes it."""
        held = channel in self._desk.now.hypothesis.held_out
        made = ui.button(
            icon="lock" if held else "lock_open",
            on_click=lambda: self._act(lambda: self._desk.hold_out(channel)),
        )
        _pressed(made, held, f"hold out {channel}")


def _pressed(made: ui.button, on: bool, words: str) -> None:
    """Let a round button show whether it is pressed."""
    labelled(made.props("dense flat round size=sm"), words).props["aria-pressed"] = str(on).lower()
