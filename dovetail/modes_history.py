"""Several states of one structure: what has changed since the first one, or from state to state."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dovetail.file.contents import StudyContents
from dovetail.file.table import StudyError
from dovetail.modes_pipeline import by_modes, diagnose_study_modes, targets_of
from dovetail.report.printed import Printed
from dovetail.report.table import Column, Table
from dovetail.report.words import explanation_text
from dovetail.result import diagnosis_dict
from fem.array_types import Floats
from fem.model import Effect
from fem.summary import percent, summary
from updating.diagnosis.mode_diagnosis import ModeDiagnosis
from updating.diagnosis.states import partners
from updating.diagnosis.verdict import EFFECT, NOTHING
from updating.inference.mode_targets import ModeTargets


@dataclass(frozen=True, slots=True, eq=False)
class StateChange:
    """A state compared with the baseline or with another state before it.

    Attributes
    ----------
    name : str
    since : str
        The state before; empty for the baseline.
    shift, std : ndarray (n_modes,)
        ln(f / f of the baseline) of the baseline's modes and its standard deviation; NaN where the state
        lacks one [-].
    diagnosis : ModeDiagnosis
        Of the change since then.
    has : tuple of Effect
        Effects that the state has since the baseline, as far as they were found.
    """

    name: str
    since: str
    shift: Floats
    std: Floats
    diagnosis: ModeDiagnosis
    has: tuple[Effect, ...] = ()

    @property
    def answer(self) -> str:
        """What has changed since the state before, in words."""
        d = self.diagnosis
        if d.verdict == EFFECT:
            return explanation_text(d.reported, d.model)
        return "nothing" if d.verdict == NOTHING else "not explained"

    @property
    def probability(self) -> float:
        """Probability of the answer [-]."""
        d = self.diagnosis
        return d.reported.probability if d.verdict in (EFFECT, NOTHING) else np.nan


@dataclass(frozen=True, slots=True, eq=False)
class StatesHistory(Printed):
    """What has changed in each of several states.

    Attributes
    ----------
    name : str
        The study's.
    baseline : ndarray (n_modes,)
        Frequencies of the baseline [Hz].
    states : tuple of StateChange
    """

    name: str
    baseline: Floats
    states: tuple[StateChange, ...]

    def __repr__(self) -> str:
        """Return the states with their changes on one line."""
        return summary(self, f"{self.name}: " + ", ".join(f"{s.name}: {s.answer}" for s in self.states))

    def printed(self) -> list[str | Table]:
        """Return a line, and a table of the states, as ``dovetail history`` prints them."""
        states = self.states
        sized = [s.shift[np.isfinite(s.shift)] for s in states]
        largest = [s[np.abs(s).argmax()] if s.size else None for s in sized]
        row = any(s.since for s in states)
        table = Table.of(
            "states",
            Column("state", [s.name for s in states]),
            Column("largest shift" + " since the baseline" * row, largest, "%", "+.2f", 100),
            Column("probability", [s.probability for s in states], show=percent),
            *([Column("compared with", [s.since or "baseline" for s in states])] if row else []),
            Column("change since then" if row else "change since the baseline", [s.answer for s in states]),
        )
        return [f"{self.name}: {len(states)} states after the baseline", "", table]

    def as_dict(self) -> dict[str, Any]:
        """Return it in plain types."""
        return {
            "baseline_Hz": self.baseline,
            "states": [
                {
                    "name": s.name,
                    "since": s.since or "baseline",
                    "shift": s.shift,
                    "shift_std": s.std,
                    "answer": s.answer,
                    **diagnosis_dict(s.diagnosis),
                }
                for s in self.states
            ],
        }


def shifts(before: ModeTargets, after: ModeTargets) -> tuple[Floats, Floats]:
    """Return ln(f / f of the baseline) of the baseline's modes and its deviation, NaN without a partner."""
    shift, std = np.full((2, before.n), np.nan)
    for i, k in enumerate(partners(before, after)):
        if k >= 0:
            shift[k] = np.log(after.frequency[i] / before.frequency[k])
            std[k] = np.hypot(after.frequency_std[i], before.frequency_std[k])
    return shift, std


def diagnose_history(study: StudyContents, say: Callable[[str, float], None]) -> StatesHistory:
    """Find what has changed in each of a study's states: since the baseline, or since an earlier state.

    What was found in that one, it has: the change is looked for beside it, and its values are fitted anew.

    Raises
    ------
    StudyError
        If the study has no modes of a baseline, or no states.
    """
    study = by_modes(study)
    if study.baseline is None or not study.states:
        missing = "no [baseline]" if study.baseline is None else "no [[states]]"
        missing = study.lack_of_frfs if study.awaited else missing
        msg = f"{study.path.name}: it has {missing}; a history needs a baseline and later states"
        raise StudyError(msg)
    first, out = targets_of(study.baseline), dict[str, StateChange]()
    modes, judged = {state.name: state.modes for state in study.states}, None
    for k, state in enumerate(study.states):

        def report(text: str, done: float, first: int = k, name: str = state.name) -> None:
            say(f"{name}: {text}", (first + done) / len(study.states))

        pair = replace(study, modes=state.modes, measurements=())
        has: tuple[Effect, ...] = ()
        if state.since:
            has = out[state.since].has
            pair = replace(pair, baseline=modes[state.since])
        found = diagnose_study_modes(pair, report, None if state.since else judged, has)
        judged = judged if state.since else found.judged
        has = (*has, *found.found)
        out[state.name] = StateChange(
            state.name, state.since, *shifts(first, targets_of(state.modes)), found, has
        )
    return StatesHistory(study.name, study.baseline.modes.frequency, tuple(out.values()))
