"""The page's list of added effects: sliders, fits, and the evidence for and against each."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from nicegui import run, ui

from dovetail.desk.jobs import Job
from dovetail.desk.scale import Scale
from dovetail.desk.session import Desk
from dovetail.desk.widgets import Act, Start, button, card, check, labelled
from dovetail.report.words import effect_label, number
from fem.model import Effect, Parameter, inverse, parameter_values
from updating.live.fitting import Weighed, WeighedChannel

POSITION = "(e) => emit(e.target.value)"
DRAGGED = """(e) => {{
  const [field, other] = e.target.closest('.desk-slider').querySelectorAll('.q-field input');
  const x = +e.target.value, value = Math.min({upper}, Math.max({lower}, {value}));
  field.value = +value.toPrecision(4);
  if (other) other.value = value ? +(1 / value).toPrecision(4) : '';
  emit(x);
}}"""
"""Writes the value into the fields at once: as a property it would have the whole page rendered anew."""
STEP = """(e) => {
  const steps = {ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -20, PageUp: 20}[e.key];
  if (!steps) return;
  e.preventDefault();
  const t = e.target, low = +t.min, high = +t.max;
  t.value = Math.min(high, Math.max(low, +t.value + steps * (high - low) / 400));
  t.dispatchEvent(new Event('input')); t.dispatchEvent(new Event('change'));
}"""
"""Keys move a slider by 1/400 of its way: one without steps, which mouse and fits may leave anywhere."""
Move = tuple[str, str, float]
"""Name of an added effect, its parameter, and the value that a slider is at."""


class EffectList:
    """The effects that are added, each with the sliders of its parameters.

    Parameters
    ----------
    desk : Desk
    act : callable
    fit : callable
        Starts a fit in the background.
    search : callable
        Starts another job in the background.
    move, release : callable
        Called with a move of a slider while it is dragged, and when it is let go.
    """

    def __init__(
        self,
        desk: Desk,
        act: Act,
        *,
        fit: Callable[[Callable[[], Job]], None],
        search: Start,
        move: Callable[[Move], None],
        release: Callable[[Move], None],
    ) -> None:
        self._desk, self._act, self._fit, self._search = desk, act, fit, search
        self._move, self._release = move, release
        self._scales: dict[str, dict[str, Scale]] = {}
        self._shown: list[tuple[str, dict[str, float]]] | None = None
        self._evidences: dict[str, ui.expansion] = {}
        self._fields: dict[tuple[str, str], Callable[[float], None]] = {}
        with card("Added effects"):
            self._follow = check("Fit uncertain parameters after each move", False)
            self._form = self._form_box()
            self._box = ui.element("div").classes("desk-column").style("width: 100%")
        self.refresh()

    def refresh(self) -> None:
        """Show the added effects of the present state; widgets that show them already keep their focus."""
        desk = self._desk
        if self._form is not None:
            self._form.set_value(desk.fits_form)
        effects = desk.now.hypothesis.effects
        now = [(e.name, parameter_values(e)) for e in effects]
        if now == self._shown:
            return
        self._shown = now
        wanted = {name for name, evidence in self._evidences.items() if evidence.value}
        self._evidences.clear()
        self._fields.clear()
        self._box.clear()
        with self._box:
            if not effects:
                ui.label("None yet. Pick a place in the model and press + at a candidate.").classes(
                    "desk-note"
                )
            for effect in effects:
                self._effect(effect)
                if effect.name in wanted:  # it stays open, and shows the words of the present state
                    self._evidences[effect.name].set_value(True)

    def _form_box(self) -> ui.checkbox | None:
        """Return a box that lets the form of the frame vary; None where the study says that it is right."""
        desk = self._desk
        if not desk.varies_form:
            return None

        def changed(on: bool) -> None:
            if on != desk.fits_form:
                self._act(lambda: desk.vary_form(on))

        word = "Form of sections and connections is uncertain, as in a diagnosis"
        return check(word, desk.fits_form, changed)

    @property
    def refits(self) -> bool:
        """Whether the uncertain parameters are to be fitted after each move of a slider."""
        return bool(self._follow.value)

    def moved_by_hand(self, effects: tuple[Effect, ...]) -> None:
        """Say that the sliders stand at these effects' values already."""
        self._shown = [(e.name, parameter_values(e)) for e in effects]
        for name, values in self._shown:
            if not self._holds(name, values):  # the sliders are made anew around it
                self._shown = None
                return
            for parameter, value in values.items():
                self._fields[name, parameter](float(value))
        for name in self._evidences:
            self.show_evidence(name)

    def _holds(self, name: str, values: Mapping[str, Any]) -> bool:
        """Return whether the scales of an effect's sliders have its values."""
        scales = self._scales.get(name, {})
        return scales.keys() == values.keys() and all(s.holds(float(values[k])) for k, s in scales.items())

    def _effect(self, effect: Effect) -> None:
        desk, name = self._desk, effect.name
        if not self._holds(name, parameter_values(effect)):
            self._scales[name] = desk.scales(effect)
        with ui.element("div").classes("desk-effect") as box:
            labelled(box.props("role=group"), name)
            with ui.element("div").classes("desk-row"):
                ui.label(effect_label(effect.kind, effect.where)).classes("desk-name")
                ui.space()
                button(
                    "Fit this",
                    lambda: self._fit(lambda: desk.fit_this(name)),
                    "tune",
                    label=f"Fit this: {name}",
                )
                button(
                    "Remove", lambda: self._act(lambda: desk.remove(name)), "delete", label=f"Remove {name}"
                )
            for p in effect.parameters():
                self._slider(name, p, self._scales[name][p.name])
            evidence = ui.expansion("Evidence", on_value_change=lambda: self.show_evidence(name))
            self._evidences[name] = labelled(evidence.props("dense"), f"evidence for {name}")

    def _slider(self, name: str, p: Parameter, scale: Scale) -> None:
        """Show a parameter with a slider, and with a field for each form in which it may be given."""
        words = f"{p.name.replace('_', ' ')} of {name}"
        with ui.element("div").classes("desk-slider"):
            ends = {"stiffness": ", free to rigid", "compliance": ", rigid to free"} if p.reciprocal else {}
            ui.label(p.name.replace("_", " ") + ends.get(p.name, "")).classes("label")
            slider = ui.element("input").props("type=range")
            shows = [self._field(name, p, form) for form in (p, p.reciprocal) if form is not None]
        # Vue writes a "value" again whenever anything near it changes, also while it is dragged
        at = scale.position(float(p.value))
        range_of = {"min": scale.low, "max": scale.high, "step": "any", "defaultValue": at}
        for key, value in {**range_of, "aria-label": words, "title": _range_text(p)}.items():
            slider.props[key] = value

        def value_at(position: Any) -> float:
            return float(np.clip(scale.value(float(position)), p.lower, p.upper))

        def left(value: float) -> None:
            for show in shows:
                show(value)

        self._fields[name, p.name] = left
        slider.on(
            "input",
            lambda e: self._move((name, p.name, value_at(e.args))),
            # Least time between two positions that a slider sends while it is dragged [s]
            throttle=0.03,
            js_handler=DRAGGED.format(value=scale.javascript, lower=_js(p.lower), upper=_js(p.upper)),
        )
        slider.on("change", lambda e: self._release((name, p.name, value_at(e.args))), js_handler=POSITION)
        slider.on("keydown", js_handler=STEP)

    def _field(self, name: str, p: Parameter, form: Parameter) -> Callable[[float], None]:
        """Show a field for one form of a parameter; return what writes a value of the parameter into it."""
        desk = self._desk
        unit = "" if form.unit == "-" else form.unit
        called = form.name.replace("_", " ")
        first = form is p

        def text_of(value: float, digits: int = 4) -> float | None:
            value = value if first else inverse(value)
            return float(f"{value:.{digits}g}") if np.isfinite(value) else None

        infinite = {"stiffness": "rigid", "compliance": "none"}.get(form.name)
        field = ui.number(value=text_of(float(p.value), 6), suffix=unit, placeholder=infinite)
        field.props("dense outlined debounce=500" + ("" if first else f" stack-label label={called}"))
        if not first:
            field.classes("other-form")
        labelled(field, f"{called} of {name}, {unit or 'no unit'}")
        typed = {"by_hand": True}

        def left(value: float) -> None:
            typed["by_hand"] = False
            field.set_value(text_of(value))
            typed["by_hand"] = True

        def entered(e: Any) -> None:
            if not typed["by_hand"] or e.value is None:  # it is empty while another number is typed
                return
            value = float(e.value)
            beyond = not form.lower <= value <= form.upper
            if beyond:  # told first: the field may be replaced by the action
                told = f"{called} of {name}: {_range_text(form)} is allowed"
                ui.notify(told, type="warning", multi_line=True)
            own = value if first else inverse(float(np.clip(value, form.lower, form.upper)))
            self._act(lambda: desk.set_value(name, p.name, own))
            if beyond:
                self.moved_by_hand(desk.now.hypothesis.effects)
                self.refresh()

        def emptied() -> None:
            if field.value is None:  # or no number: the present value is shown again
                left(float(parameter_values(desk.now.hypothesis.effect(name))[p.name]))

        field.on("blur", emptied)
        field.on_value_change(entered)
        return left

    # Evidence -----------------------------------------------------------------------------------------------

    def show_evidence(self, name: str) -> None:
        """Show the evidence for and against an effect, where the user wants to see it."""
        evidence = self._evidences.get(name)
        if evidence is None or not evidence.value:
            return
        desk = self._desk
        evidence.clear()
        with evidence:
            with ui.element("div").classes("desk-lines"):
                if name in desk.weighed:
                    self._words(desk.weighed[name])
            with ui.element("div").classes("desk-row"):
                button("Weigh", lambda: self._weigh(name), "balance", label=f"Weigh {name}")
                button(
                    "Fit without it",
                    lambda: self._search(lambda: desk.weigh_fitted(name), self._weighed(name)),
                    "difference",
                    label=f"Fit without {name}",
                )
            self._twins(name)

    async def _weigh(self, name: str) -> None:
        await run.io_bound(self._desk.weigh, name)
        self.show_evidence(name)

    def _weighed(self, name: str) -> Callable[[Job], None]:
        def take(job: Job) -> None:
            self._desk.weighed[name] = job.result
            self.show_evidence(name)

        return take

    def _words(self, w: Weighed) -> None:
        less, more = w.without.result, w.present.result
        how = "fitted again without it" if w.refitted else "all else as it is"
        errors = f"{less.fit_db:.2f} to {more.fit_db:.2f} dB on the lines of the fit"
        held = f"{less.held_out_db:.2f} to {more.held_out_db:.2f} dB on held-out lines"
        _said(f"error from {errors} ({how})", more.fit_db < less.fit_db)
        _said(f"error from {held}", more.held_out_db < less.held_out_db)
        likely = f"{number(abs(w.unseen_gain))} nats {'more' if w.unseen_gain > 0 else 'less'} likely"
        _said(f"lines that no fit has seen are {likely} with it", w.unseen_gain > 0)
        for c in w.better:
            _said(_channel_text(c), True)
        for c in w.worse:
            _said(_channel_text(c), False)
        for parameter in w.at_bound:
            _said(f"{parameter} is at its bound", False)
        for (effect, parameter), off in w.strained:
            _said(f"{parameter} of {effect} is {abs(off):.1f} standard deviations off", False)

    def _twins(self, name: str) -> None:
        desk = self._desk
        # At most so many twins are offered [-]
        alike = desk.ranking.twins(name)[:4]
        if not alike:
            return
        ui.label("Alternatives with a similar change of the FRFs:").classes("desk-note")
        for promise, similarity in alike:
            other = promise.effect
            with ui.element("div").classes("desk-row"):
                ui.label(f"{effect_label(other.kind, other.where)} ({similarity:.2f})").classes("desk-note")
                button(
                    "Take instead",
                    lambda o=other: self._act(lambda: desk.replace(name, o)),
                    "swap_horiz",
                    label=f"{other.name} in place of {name}",
                )


def _js(value: float) -> str:
    """Return a number of JavaScript."""
    return repr(float(value)) if np.isfinite(value) else ("Infinity" if value > 0 else "-Infinity")


def _range_text(p: Parameter) -> str:
    return f"{number(p.lower)} to {number(p.upper)}{'' if p.unit == '-' else ' ' + p.unit}"


def _said(text: str, speaks_for: bool) -> None:
    ui.label(text).classes("desk-for" if speaks_for else "desk-against")


def _channel_text(c: WeighedChannel) -> str:
    low, high = c.band
    return f"{c.sensor}, {low:.0f} to {high:.0f} Hz: {c.without:.2f} to {c.present:.2f} dB"
