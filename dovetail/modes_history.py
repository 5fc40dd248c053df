"""Several states of one structure: what has changed since the first one, state by state."""

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
from fem.summary import percent
from updating.diagnosis.mode_diagnosis import ModeDiagnosis
from updating.diagnosis.states import partners
from updating.diagnosis.verdict import EFFECT, NOTHING
from updating.inference.mode_targets import ModeTargets


@dataclass(frozen=True, slots=True, eq=False)
class StateChange:
    """A state compared with the baseline.

    Attributes
    ----------
    name : str
    shift, std : ndarray (n_modes,)
        ln(f / f of the baseline) of the baseline's modes and its standard deviation; NaN where the state
        lacks one [-].
    diagnosis : ModeDiagnosis
        Of the change since the baseline.
    """

    name: str
    shift: Floats
    std: Floats
    diagnosis: ModeDiagnosis

    @property
    def answer(self) -> str:
        """What has changed since the baseline, in words."""
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
    """Find what has changed since the baseline in each of a study's states.

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
    before, out = targets_of(study.baseline), list[StateChange]()
    for k, state in enumerate(study.states):

        def report(text: str, done: float, first: int = k, name: str = state.name) -> None:
            say(f"{name}: {text}", (first + done) / len(study.states))

        judged = out[-1].diagnosis.judged if out else None
        found = diagnose_study_modes(replace(study, modes=state.modes, measurements=()), report, judged)
        out.append(StateChange(state.name, *shifts(before, targets_of(state.modes)), found))
    return tuple(out)


def history_lines(study: StudyContents, history: tuple[StateChange, ...]) -> list[str | Table]:
    """Return a history as printed: a line, and a table of the states."""
    sized = [s.shift[np.isfinite(s.shift)] for s in history]
    table = Table.of(
        "states",
        Column("state", [s.name for s in history]),
        Column("largest shift", [s[np.abs(s).argmax()] if s.size else None for s in sized], "%", "+.2f", 100),
        Column("probability", [s.probability for s in history], show=percent),
        Column("change since the baseline", [s.answer for s in history]),
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
                "shift": s.shift,
                "shift_std": s.std,
                "answer": s.answer,
                **diagnosis_dict(s.diagnosis),
            }
            for s in history
        ],
    }
