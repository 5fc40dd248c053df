"""Several states of one structure: what has changed since the first one, or from state to state."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dovetail.file.contents import StudyContents
from dovetail.file.table import StudyError
from dovetail.modes_pipeline import by_modes, diagnose_study_modes, targets_of
from dovetail.report.table import Column, Table
from dovetail.report.words import explanation_text
from dovetail.result import diagnosis_dict
from fem.array_types import Floats
from fem.model import Effect
from fem.summary import percent
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
            return explanation_text(d.reported)
        return "nothing" if d.verdict == NOTHING else "not explained"

    @property
    def probability(self) -> float:
        """Probability of the answer [-]."""
        d = self.diagnosis
        return d.reported.probability if d.verdict in (EFFECT, NOTHING) else np.nan


def shifts(before: ModeTargets, after: ModeTargets) -> tuple[Floats, Floats]:
    """Return ln(f / f of the baseline) of the baseline's modes and its deviation, NaN without a partner."""
    shift, std = np.full((2, before.n), np.nan)
    for i, k in enumerate(partners(before, after)):
        if k >= 0:
            shift[k] = np.log(after.frequency[i] / before.frequency[k])
            std[k] = np.hypot(after.frequency_std[i], before.frequency_std[k])
    return shift, std


def diagnose_history(study: StudyContents, say: Callable[[str, float], None]) -> tuple[StateChange, ...]:
    """Find what has changed in each of a study's states: since the baseline, or since an earlier state.

    What was found in that one, it has: the change is looked for beside it, and its values are fitted anew.

    Raises
    ------
    StudyError
        If the study has no modes of a baseline, or no states.
    """
    study = by_modes(study)
    if study.baseline is None or not study.states:
        missing = "[baseline]" if study.baseline is None else "[[states]]"
        msg = f"{study.path.name}: it has no {missing}; a history needs a baseline and later states"
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
    return tuple(out.values())


def history_lines(study: StudyContents, history: tuple[StateChange, ...]) -> list[str | Table]:
    """Return a history as printed: a line, and a table of the states."""
    sized = [s.shift[np.isfinite(s.shift)] for s in history]
    row = any(s.since for s in history)
    table = Table.of(
        "states",
        Column("state", [s.name for s in history]),
        Column("largest shift", [s[np.abs(s).argmax()] if s.size else None for s in sized], "%", "+.2f", 100),
        Column("probability", [s.probability for s in history], show=percent),
        *([Column("compared with", [s.since or "baseline" for s in history])] if row else []),
        Column("change since then" if row else "change since the baseline", [s.answer for s in history]),
    )
    return [f"{study.name}: {len(history)} states after the baseline", "", table]


def history_dict(study: StudyContents, history: tuple[StateChange, ...]) -> dict[str, Any]:
    """Return a history in plain types."""
    assert study.baseline is not None
    return {
        "baseline_Hz": study.baseline.modes.frequency,
        "states": [
            {
                "name": s.name,
                "since": s.since or "baseline",
                "shift": s.shift,
                "shift_std": s.std,
                "answer": s.answer,
                **diagnosis_dict(s.diagnosis),
            }
            for s in history
        ],
    }
