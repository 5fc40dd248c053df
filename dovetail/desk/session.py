"""Actions of the desk, without a page: each makes a new state, which the journal keeps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from dovetail.desk.compared_modes import ComparedModes, compared_modes
from dovetail.desk.jobs import Job
from dovetail.desk.journal import JournalError, journal_of, read_journal, set_aside, write_journal
from dovetail.desk.saving import (
    held_out_of,
    holding_out,
    live_model,
    save_study,
    study_with,
    write_desk_report,
)
from dovetail.desk.scale import Scale, scales_of
from dovetail.desk.state import DeskState, History, Stair
from dovetail.file.contents import measured
from dovetail.file.effects import with_given_values
from dovetail.pipeline import Progress, diagnose_study
from dovetail.plan import plan_study
from dovetail.report.words import effect_label
from dovetail.study import Study, load_study
from fem.effects.joint import Spread
from fem.lengths import show_lengths
from fem.model import Effect, parameter_values
from updating.diagnosis.diagnosis import Diagnosis
from updating.diagnosis.evidence.places import place_of
from updating.inference.workers import cores
from updating.live.engine import Evaluation, LiveModel
from updating.live.fitting import Weighed, fit_all, fit_effect, fit_uncertain, weigh
from updating.live.hypothesis import Hypothesis
from updating.live.ranking import RankedCandidates, rank
from updating.live.sensitivity import (
    FrequencySensitivity,
    Sensitivity,
    frequency_sensitivities,
    sensitivities,
)
from updating.plan.plan import Plan
from updating.quality.corrections import Fault

NOMINAL = "nominal model"
FITTED = "uncertain parameters fitted"
RANKED_UNASKED = 500
"""Number of candidates that are ranked after each fit without a request [-]."""


SAME_SPOT = 0.02
"""Places nearer to each other than this share of the structure's size are one spot in the model [-]."""


@dataclass(frozen=True, slots=True)
class Spot:
    """A point of the structure where candidates act.

    Attributes
    ----------
    name : str
        Its first place.
    point : (float, float, float)
        [m].
    on_structure : bool
        Whether it is on a member or near one; candidates that act at several points are between these.
    places : mapping of str to tuple of str
        Names of the candidates at each of its places.
    """

    name: str
    point: tuple[float, float, float]
    on_structure: bool
    places: Mapping[str, tuple[str, ...]]


class Desk:
    """A study on the desk.

    Parameters
    ----------
    study : Study
    live : LiveModel
    history : History
    journal : Path or None
        Where the history is kept; None keeps none.
    """

    def __init__(self, study: Study, live: LiveModel, history: History, journal: Path | None = None) -> None:
        self.study, self.live, self.history, self._journal = study, live, history, journal
        self.notes: list[str] = []
        self.ranking = RankedCandidates()
        self.ranked_beside = self.now.hypothesis
        self.diagnosis: Diagnosis | None = None
        self.mapped: tuple[Hypothesis, Plan] | None = None
        self.compared_modes: ComparedModes | None = None
        self.weighed: dict[str, Weighed] = {}
        self.fits_form = self.varies_form
        self.shown = live.evaluate(self.now.hypothesis)
        self._others: dict[int, Evaluation] = {}

    @classmethod
    def open(cls, path: Path, progress: Progress | None = None) -> "Desk":
        """Return the desk of a study file, where it was left if there is a journal."""
        say = progress or (lambda text, done: None)
        say("reading the study", 0.1)
        study = load_study(path)
        show_lengths(study.length_unit)
        say("reducing the model", 0.5)
        live = live_model(holding_out(study, ()))
        start = replace(Hypothesis.nominal(live.problem), held_out=held_out_of(study))
        first = DeskState("open the study", start, (Stair.of(NOMINAL, live.evaluate(start)),))
        desk = cls(study, live, History((first,)), journal_of(study.path))
        desk._go_on()
        return desk

    def _go_on(self) -> None:
        """Take up the journal, where there is one that fits."""
        if self._journal is None or not self._journal.exists():
            return
        try:
            history = read_journal(self._journal, self.study.text, self.candidates)
            self.history, self.shown = history, self._evaluated(history)
            if len(self.history.states) > 1:
                self.notes.append("The desk continues where you stopped; undo goes further back.")
        except JournalError as reason:
            self.notes.append(f"{reason}; it is kept as {set_aside(self._journal).name}")

    def _evaluated(self, history: History) -> Evaluation:
        """Return what a history of the journal shows."""
        nominal = Hypothesis.nominal(self.live.problem)
        for state in history.states:
            for h in filter(None, (state.hypothesis, state.other)):
                first = self.live.with_form(nominal) if self.live.has_form(h) else nominal
                if h.values.keys() != first.values.keys() or h.zeta.shape != first.zeta.shape:
                    msg = f"{self._journal}: the state '{state.label}' has not the parameters of the study"
                    raise JournalError(msg)
        try:
            return self.live.evaluate(history.now.hypothesis)
        except (ValueError, ArithmeticError) as reason:  # values that no model can have
            msg = f"{self._journal}: the state '{history.now.label}' cannot be computed ({reason})"
            raise JournalError(msg) from reason

    @property
    def now(self) -> DeskState:
        """The present state."""
        return self.history.now

    @cached_property
    def candidates(self) -> dict[str, Effect]:
        """Candidate effects by name; none that constrain the model otherwise than its basis."""
        return {e.name: e for e in self.study.candidates() if not isinstance(e, Spread)}

    @cached_property
    def spots(self) -> dict[str, Spot]:
        """Spots by name: places that are nearly at one point, connections first."""
        model = self.live.problem.reduced.model
        at: dict[str, list[Effect]] = {}
        for effect in sorted(self.candidates.values(), key=lambda e: place_of(e)[0] != "joint"):
            at.setdefault(place_of(effect)[1], []).append(effect)
        out: dict[str, Spot] = {}
        for name, effects in at.items():
            points = np.vstack([e.locations(model) for e in effects])
            middle = points.mean(axis=0) if len(points) else model.mesh.points.mean(axis=0)
            own = {name: tuple(e.name for e in effects)}
            near = [s for s in out.values() if np.linalg.norm(middle - s.point) < SAME_SPOT * model.mesh.size]
            if near:
                spot = near[0]
                out[spot.name] = replace(spot, places={**spot.places, **own})
            else:
                x, y, z = (float(v) for v in middle)
                off = model.mesh.nearest_on_members(middle)[2]
                out[name] = Spot(name, (x, y, z), off < SAME_SPOT * model.mesh.size, own)
        return out

    @cached_property
    def joints(self) -> frozenset[str]:
        """Names of the spots at joints."""
        at = (place_of(e) for e in self.candidates.values())
        return frozenset(name for kind, name in at if kind == "joint" and name in self.spots)

    def spot_of(self, name: str) -> str:
        """Return the spot of a place, a member, a joint or an added effect that a click names; or nothing."""
        for spot in self.spots.values():
            for place, candidates in spot.places.items():
                if name in (place, *candidates) or place in (
                    f"joint {name}",
                    f"member {name}",
                    f"support {name}",
                ):
                    return spot.name
        return ""

    @cached_property
    def nominal(self) -> Evaluation:
        """The model as the study states it, and the measurement as it was read."""
        h = Hypothesis.nominal(self.live.problem)
        return self.live.evaluate(replace(h, held_out=held_out_of(self.study)))

    def spot_near(self, point: Sequence[float]) -> str:
        """Return the spot at a point of the structure; empty if none is near."""
        spot = min(self.spots.values(), key=lambda s: float(np.linalg.norm(np.subtract(s.point, point))))
        off = float(np.linalg.norm(np.subtract(spot.point, point)))
        return spot.name if off < 2 * SAME_SPOT * self.study.model.mesh.size else ""

    def sensitivities(self, pair: tuple[str, str]) -> tuple[Sensitivity, ...]:
        """Return the change of an FRF by each parameter of the present hypothesis, the largest first."""
        return sensitivities(self.live, self.now.hypothesis, pair)

    def frequency_sensitivities(self, found: ComparedModes, j: int) -> tuple[FrequencySensitivity, ...]:
        """Return the change of the frequency of an elastic computed mode by each parameter."""
        k = found.computed.n_rigid + j
        f, shape = (
            float(found.computed.frequency[k]),
            np.asarray(found.computed.shapes[:, k].real, dtype=float),
        )
        return frequency_sensitivities(self.live, found.hypothesis, found.model, f, shape)

    def second(self) -> Evaluation | None:
        """Return the evaluation of the second hypothesis, where there is one."""
        other = self.now.other
        if other is None:
            return None
        if id(other) not in self._others:
            self._others = {id(other): self.live.evaluate(other)}
        return self._others[id(other)]

    # Actions ------------------------------------------------------------------------------------------------

    def commit(self, state: DeskState) -> None:
        """Make a state the present one, and keep it in the journal."""
        self._changed(self.history.then(state))

    def undo(self) -> None:
        """Go one state back."""
        self._changed(self.history.undone())

    def redo(self) -> None:
        """Go one state on again."""
        self._changed(self.history.redone())

    def _changed(self, history: History) -> None:
        self.history = history
        self.shown = self.live.evaluate(self.now.hypothesis)
        self.weighed = {}
        if self._journal is not None:
            try:
                write_journal(self._journal, history, self.study.text)
            except OSError as reason:
                self.notes.append(
                    f"{reason.filename or self._journal}: {reason.strerror}. The desk goes on, but cannot be "
                    "taken up from here again; save the study elsewhere"
                )

    def suppose(self, label: str, hypothesis: Hypothesis) -> None:
        """Make a hypothesis the present one."""
        self.commit(self.now.moved(label, hypothesis))

    def add(self, name: str, **values: float) -> None:
        """Add a candidate: where it begins to be absent, or at given values."""
        effect = with_given_values(self.candidates[name], values)
        if not np.isfinite(list(parameter_values(effect).values())).all():
            starts = effect.starts(self.live.problem.surroundings)
            effect = with_given_values(effect.with_values(**starts[len(starts) // 2]), values)
        h = self.now.hypothesis.with_effect(effect)
        self.suppose(f"add {_called(effect)}", h)

    def remove(self, name: str) -> None:
        """Take an added effect away."""
        h = self.now.hypothesis
        self.suppose(f"remove {_called(h.effect(name))}", h.without_effect(name))

    def replace(self, name: str, other: Effect) -> None:
        """Put another effect in the place of an added one."""
        h = self.now.hypothesis
        label = f"{_called(other)} in place of {_called(h.effect(name))}"
        self.suppose(label, h.without_effect(name).with_effect(other))

    def set_value(self, name: str, parameter: str, value: float) -> None:
        """Give a parameter of an added effect a value, at most up to its bounds."""
        before = self.now.hypothesis
        h = before.with_value(name, parameter, value)
        if parameter_values(h.effect(name)) != parameter_values(before.effect(name)):
            words = f"{parameter.replace('_', ' ')} of {_called(h.effect(name))}"
            self.suppose(words, h)

    def preview(self, name: str, parameter: str, value: float) -> Evaluation:
        """Return the errors with another value, which is not kept."""
        self.shown = self.live.evaluate(self.now.hypothesis.with_value(name, parameter, value))
        return self.shown

    def switch(self, sensor: str) -> None:
        """Leave a sensor out, or take it in again."""
        word = "take in" if sensor in self.now.hypothesis.off else "leave out"
        self.suppose(f"{word} sensor {sensor}", self.now.hypothesis.switched(sensor))

    def turn(self, sensor: str) -> None:
        """Turn a sensor's sign, or turn it back."""
        h = self.now.hypothesis
        turned = any((f.kind, f.sensor) == ("sensor_sign", sensor) for f in h.faults)
        other = h.without_fault("sensor_sign", sensor)
        other = other if turned else h.with_fault(Fault("sensor_sign", sensor, -1.0, 0.0))
        self.suppose(f"turn the sign of sensor {sensor}", other)

    def hold_out(self, part: str) -> None:
        """Keep a channel or a band from the fits and compare it apart, or fit it again.

        Parameters
        ----------
        part : str
            Such as ``sensor A1``, ``excitation E1`` or ``band 120-180 Hz``.

        Raises
        ------
        StudyError, MeasurementError
            If no sensor, no excitation or no line would be left for the fit, or if a band has no line.
        """
        h = self.now.hypothesis.held(part)
        measured(holding_out(self.study, h.held_out))
        self.live.data_of(h)
        self.suppose(f"{'hold out' if part in h.held_out else 'fit'} {part}", h)

    def set_gain(self, sensor: str, gain: float) -> None:
        """Say that a sensor reads so many times too much; 1 takes the correction away.

        Raises
        ------
        ValueError
            If the gain is not positive.
        """
        if not gain > 0:
            msg = f"{gain:g} is no gain of sensor {sensor}: it must be above 0; a button turns the sign"
            raise ValueError(msg)
        h = self.now.hypothesis.without_fault("sensor_gain", sensor)
        if gain != 1:
            h = h.with_fault(Fault("sensor_gain", sensor, float(gain), 0.0))
        self.suppose(f"gain of sensor {sensor}", h)

    def keep(self) -> None:
        """Keep the present hypothesis as the second one."""
        self.commit(self.now.kept())

    def swap(self) -> None:
        """Exchange the two hypotheses."""
        self.commit(self.now.swapped())

    def drop(self) -> None:
        """Drop the second hypothesis."""
        self.commit(self.now.alone())

    # Longer work --------------------------------------------------------------------------------------------

    @property
    def _to_fit(self) -> Hypothesis:
        """The present hypothesis; its form may vary as in a diagnosis, unless that was declined."""
        h = self.now.hypothesis
        return self.live.with_form(h) if self.fits_form else h

    def fit_uncertain(self) -> Job:
        """Fit the uncertain parameters and the damping."""
        h = self._to_fit
        return Job("Fit uncertain parameters", lambda say: fit_uncertain(self.live, h, say)).start()

    def fit_this(self, name: str) -> Job:
        """Fit one added effect."""
        h = self._to_fit
        return Job(f"Fit {_called(h.effect(name))}", lambda say: fit_effect(self.live, h, name, say)).start()

    def fit_all(self) -> Job:
        """Fit everything that may vary."""
        h = self._to_fit
        return Job("Fit all", lambda say: fit_all(self.live, h, say)).start()

    def take_fit(self, job: Job) -> None:
        """Make the result of a fit the present state, with a step of the staircase."""
        h: Hypothesis = job.result
        names = " and ".join(map(_called, h.effects))
        stair = Stair.of(f"{names}, fitted" if names else FITTED, self.live.evaluate(h))
        self.commit(self.now.moved(job.title, h).with_stair(stair))

    def rank(self) -> Job:
        """Rank all candidates beside the present hypothesis."""
        h, effects = self._to_fit, list(self.candidates.values())
        self.ranked_beside = self.now.hypothesis
        return Job("Rank candidates", lambda say: rank(self.live, h, effects, say)).start()

    def weigh(self, name: str) -> Weighed:
        """Return the evidence for and against an added effect, the rest as it is."""
        if name not in self.weighed:
            self.weighed[name] = weigh(self.live, self.now.hypothesis, name)
        return self.weighed[name]

    def weigh_fitted(self, name: str) -> Job:
        """Weigh an added effect against a fit without it."""
        h = self.now.hypothesis
        return Job(
            f"Fit without {_called(h.effect(name))}", lambda say: weigh(self.live, h, name, say)
        ).start()

    def diagnose(self) -> Job:
        """Search for effects that the study's model lacks, as `dovetail diagnose` does."""
        study = holding_out(self.study, self.now.hypothesis.held_out)
        return Job("Diagnose", lambda say: diagnose_study(study, say, cores())).start()

    def plan(self, noise: float | None = None) -> Job:
        """Map what the test could show beside the present hypothesis, as `dovetail plan` does.

        ``noise`` is that of a planned test with the same channels and lines [-]; unless it is given, the
        measured data count, with what the fitted model leaves of them.
        """
        h = self.now.hypothesis

        def mapped(say: Progress) -> tuple[Hypothesis, Plan]:
            say("writing the hypothesis into the study", 0.0)
            return h, plan_study(study_with(self.study, self.live, h), noise, progress=say)

        return Job("Map of the test", mapped).start()

    def compare_modes(self) -> Job:
        """Compute the modes of the present hypothesis, and compare them with the measured ones."""
        h, known = self.now.hypothesis, self.compared_modes
        return Job("Compare modes", lambda say: compared_modes(self.study, self.live, h, known, say)).start()

    def save(self, path: Path) -> Path:
        """Write the study with the present hypothesis in it; see :func:`saving.save_study`."""
        return save_study(self.study, self.live, self.now.hypothesis, path)

    def report(self, folder: Path) -> Job:
        """Write a report of the present hypothesis into a folder."""
        h = self.now.hypothesis
        work = partial(write_desk_report, self.study, self.live, h, folder)
        return Job("Export report", work).start()

    def take_over(self) -> tuple[str, ...]:
        """Make the diagnosed model the present hypothesis: all that its last fit has fitted.

        Effects, uncertain parameters with the form of the frame, damping and corrections of sensors are those
        of the diagnosis, so that the error is the one that it reports. Sensors that were switched off stay
        off.

        Returns
        -------
        tuple of str
            Effects found that the desk cannot show.
        """
        d = self.diagnosis
        assert d is not None
        last, h = d.steps[-1].result, self.now.hypothesis
        found = [f.effect for f in d.findings]
        own = [
            self.candidates[e.name].with_values(**parameter_values(e))
            for e in found
            if e.name in self.candidates
        ]
        h = self.live.with_form(h) if self.varies_form else h
        values = {ref: float(last.values.get(ref, v)) for ref, v in h.values.items()}
        h = replace(
            h,
            effects=tuple(own),
            values=values,
            zeta=last.zeta,
            channels=last.channels,
            faults=d.faults,
            fit=None,
        )
        self.live.learn(h)
        stair = Stair.of("diagnosis taken over", self.live.evaluate(h))
        self.commit(self.now.moved("take over the diagnosis", h).with_stair(stair))
        return tuple(e.name for e in found if e.name not in self.candidates)

    @property
    def varies_form(self) -> bool:
        """Whether the form may vary: beams may err, and it was not calibrated on a baseline."""
        return self.study.model_error > 0 and self.study.baseline_frfs is None

    def vary_form(self, on: bool) -> None:
        """Let the form of the frame vary in fits, as a diagnosis does, or take it as it is drawn."""
        self.fits_form = on
        h = self.now.hypothesis
        h = self.live.with_form(h) if on else self.live.without_form(h)
        self.suppose(f"{'vary' if on else 'do not vary'} the form of the frame", h)

    def scales(self, effect: Effect) -> dict[str, Scale]:
        """Return the scales of the sliders of an effect's parameters."""
        return scales_of(effect, self.live.problem)


def _called(effect: Effect) -> str:
    return effect_label(effect.kind, effect.where)
