"""The result of a run on modes, and its form as ``result.json``."""

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.file.contents import StudyContents
from dovetail.result import (
    JSON,
    REPORT,
    SCHEMA,
    UncertainValue,
    program_version,
    uncertain_dict,
    uncertain_of,
)
from updating.diagnosis.findings import Finding, parameters_of
from updating.diagnosis.mode_diagnosis import Baseline, Explanation, ModeDiagnosis


@dataclass(frozen=True, slots=True, eq=False)
class ModeRunResult:
    """A diagnosis from modes with its study and folder.

    Attributes
    ----------
    study : Study
    diagnosis : ModeDiagnosis
    uncertain : tuple of Uncertain
        Uncertain parameters before and after the fit; of two states, that to the first one.
    finished : datetime
    folder : Path
        Where the files are.
    """

    study: StudyContents
    diagnosis: ModeDiagnosis
    uncertain: tuple[UncertainValue, ...]
    finished: datetime
    folder: Path

    @property
    def report(self) -> Path:
        """The report."""
        return self.folder / REPORT

    @property
    def json(self) -> Path:
        """The result for programs."""
        return self.folder / JSON

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader should know."""
        return self.diagnosis.notes


def mode_findings(d: ModeDiagnosis) -> tuple[Finding, ...]:
    """Return the effects of the verdict with their values."""
    result = d.final.fitted
    return tuple(Finding(e, parameters_of(e, result), ()) for e in d.found)


def mode_steps(d: ModeDiagnosis) -> dict[str, NDArray[np.float64]]:
    """Return the frequencies of the models that are compared with the measured ones, by label [Hz].

    Of two states the first model is that which was calibrated on the baseline.
    """
    m, what = d.modes, "effects" if len(d.found) > 1 else "effect"
    if d.baseline is None:
        return {"nominal": m.nominal, "fitted": m.fitted} | ({f"with the {what}": m.found} if d.found else {})
    return {"fitted to the baseline": m.fitted} | ({"with the change": m.found} if d.found else {})


def mode_uncertain(d: ModeDiagnosis) -> tuple[UncertainValue, ...]:
    """Return the uncertain parameters before and after the fit; of two states, that to the first one."""
    if d.baseline is None:
        problem, result, model = d.problem, d.final.fitted, d.model
    else:
        problem, result, model = d.baseline.problem, d.baseline.fitted, d.baseline.model
    damped = bool(np.isfinite(problem.targets.zeta).any())
    return uncertain_of(problem, result, model, damped=damped)


def mode_diagnosis_dict(d: ModeDiagnosis) -> dict[str, Any]:
    """Return a diagnosis from modes in plain types."""
    m = d.modes
    columns = {
        "measured_Hz": m.measured,
        "std": m.std,
        "nominal_Hz": m.nominal,
        "fitted_Hz": m.fitted,
        "found_Hz": m.found,
        "zeta": m.zeta,
        "zeta_found": m.zeta_found,
        "mac_nominal": m.mac_nominal,
        "mac_found": m.mac_found,
        "held_out": m.held_out,
        "found_std": m.found_std,
        "bad_probability": m.bad,
    }
    return {
        "verdict": d.verdict,
        "reason": d.reason,
        "effects": [_effect(e, d.searched.best.fitted.std) for e in d.found],
        "posterior": [
            {"effects": [x.name for x in e.effects] if e.known else ["unknown"], "probability": e.probability}
            for e in d.explanations
        ],
        "credible": [_explanation(e) for e in d.credible],
        "places": [{"place": name, "misfit_left": share} for name, share in d.places],
        "bad_readings": [
            {
                "mode": b.reading.mode + 1,
                "measured_Hz": b.frequency,
                "reading": b.reading.words,
                "probability": b.probability,
            }
            for b in d.bad_readings
        ],
        "next_measurements": list(d.next_measurements),
        "modes": [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)],
        "frequency_error": {
            step: {"fit": m.errors(f, False), "held_out": m.errors(f, True)}
            for step, f in (("nominal", m.nominal), ("fitted", m.fitted), ("found", m.found))
        },
        "uncertain": [uncertain_dict(u) for u in mode_uncertain(d)],
    } | ({} if d.judged is None else {"baseline": _baseline(d.judged)})


def _baseline(judged: Baseline) -> dict[str, Any]:
    """Return what the first state says of the calibrated model."""
    t, found = judged.first.problem.targets, judged.first.computed.frequency
    rows = zip(t.frequency, found, judged.first.missed, strict=True)
    return {
        "stands": judged.diagnosis is None,
        "modes": [{"measured_Hz": f, "calibrated_Hz": g, "missed_std": off} for f, g, off in rows],
        "causes": [_explanation(c) for c in judged.causes],
    }


def _effect(effect: Any, std: Any) -> dict[str, Any]:
    parameters = [
        {"name": p.name, "value": p.value, "unit": p.unit, "std": std.get((effect.name, p.name))}
        for p in effect.parameters()
    ]
    return {"kind": effect.kind, "where": effect.where, "name": effect.name, "parameters": parameters}


def _explanation(e: Explanation) -> dict[str, Any]:
    return {
        "explanation": e.label,
        "probability": e.probability,
        "effects": [
            {
                "kind": x.kind,
                "where": x.where,
                "name": x.name,
                "parameters": [
                    {"name": p.name, "value": p.value, "unit": p.unit, "std": None if p.at_bound else p.std}
                    for p in parameters
                ],
            }
            for x, parameters in zip(e.effects, e.parameters, strict=True)
        ],
    }


def mode_result_dict(done: ModeRunResult) -> dict[str, Any]:
    """Return a run on modes in plain types, as in ``result.json``."""
    d, study = done.diagnosis, done.study
    return {
        "schema": SCHEMA,
        "version": program_version(),
        "study": study.name,
        "finished": done.finished.isoformat(timespec="seconds"),
        "seconds": d.seconds,
        **mode_diagnosis_dict(d),
        "model": {"values": {f"{a}.{b}": v for (a, b), v in d.model.values().items()}},
        "assumptions": list(study.assumptions),
        "notes": list(d.notes),
        "measured_notes": list(study.measured_notes),
        "warnings": list(study.warnings),
    }
