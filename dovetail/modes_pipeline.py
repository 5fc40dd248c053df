"""Studies with measured modes alone: their diagnosis, and what is written of it."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.disk.output import Output, check_outputs, result_folder, write_json
from dovetail.file.contents import Study
from dovetail.file.measured_modes import MeasuredModes
from dovetail.file.paths import input_files
from dovetail.result import JSON, REPORT, SCHEMA, program_version
from fem.io.atomic import replacing
from updating.diagnosis.evidence.mode_diagnosis import Explanation, ModeDiagnosis, diagnose_modes
from updating.diagnosis.evidence.states import diagnose_change
from updating.inference.mode_targets import ModeTargets

Progress = Callable[[str, float], None]
NAMES = (REPORT, JSON)
"""What the folder of a run on modes holds."""
MOST_SAID = 12
"""Explanations that are printed."""


@dataclass(frozen=True, slots=True, eq=False)
class ModeRunResult:
    """A diagnosis from modes with its study and folder."""

    study: Study
    diagnosis: ModeDiagnosis
    finished: datetime
    folder: Path

    @property
    def report(self) -> Path:
        """The report."""
        return self.folder / REPORT


def has_modes_alone(study: Study) -> bool:
    """Whether a study has measured modes and no FRFs."""
    return study.modes is not None and not study.measurements


def targets_of(modes: MeasuredModes) -> ModeTargets:
    """Return the measured modes of a study as data of fits."""
    m = modes.modes
    return ModeTargets.of(
        m.frequency, modes.frequency_std,
        zeta=None if m.zeta is None else np.asarray(m.zeta, dtype=float), zeta_std=modes.zeta_std,
        shapes=m.shapes if len(modes.sensors) else None, shape_std=modes.shape_std, sensors=modes.sensors,
        numbers=[n - 1 for n in modes.numbers] or None, plane=modes.plane,
        held_out=[n - 1 for n in modes.held_out], name=modes.name,
    )  # fmt: skip


def diagnose_study_modes(study: Study, say: Progress | None = None) -> ModeDiagnosis:
    """Diagnose by the measured modes of a study: what is missing, or what has changed since a baseline."""
    assert study.modes is not None
    states = [targets_of(m) for m in (study.baseline, study.modes) if m is not None]
    search = diagnose_modes if len(states) == 1 else diagnose_change
    return search(
        study.model, *states, study.nuisances, damping_std=study.damping_std, kinds=study.kinds,
        exclude=study.exclude, model_error=study.model_error, progress=say,
    )  # fmt: skip


def run_modes(
    study: Study, out: Path, progress: Progress | None = None, *, force: bool = False
) -> ModeRunResult:
    """Diagnose a study by its modes, and write ``report.html`` and ``result.json`` into a folder.

    Raises
    ------
    OutputError
        If ``out`` holds something else.
    """
    from dovetail.report.modes import report_html

    check_outputs(input_files(study.path), Output("out", out, NAMES))
    with result_folder(out, force) as scratch:
        done = ModeRunResult(study, diagnose_study_modes(study, progress), datetime.now().astimezone(), out)
        write_json(scratch / JSON, mode_result_dict(done))
        with replacing(scratch / REPORT) as file:
            file.write_text(report_html(done), encoding="utf-8")
    return done


def mode_diagnosis_dict(d: ModeDiagnosis) -> dict[str, Any]:
    """Return a diagnosis from modes in plain types."""
    m = d.modes
    columns = {
        "measured_Hz": m.measured, "std": m.std, "nominal_Hz": m.nominal, "fitted_Hz": m.fitted,
        "found_Hz": m.found, "zeta": m.zeta, "zeta_found": m.zeta_found, "mac_nominal": m.mac_nominal,
        "mac_found": m.mac_found, "held_out": m.held_out,
    }  # fmt: skip
    return {
        "verdict": d.verdict,
        "reason": d.reason,
        "effects": [_effect(e, d.searched.best.fitted.result.std) for e in d.found],
        "posterior": [
            {"effects": [x.name for x in e.effects] if e.known else ["unknown"], "probability": e.probability}
            for e in d.explanations
        ],
        "credible": [_explanation(e) for e in d.credible],
        "places": [{"place": name, "misfit_left": left} for name, left in d.places],
        "next_measurements": list(d.next_measurements),
        "modes": [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)],
        "frequency_error": {
            step: {"fit": m.errors(f, False), "held_out": m.errors(f, True)}
            for step, f in (("nominal", m.nominal), ("fitted", m.fitted), ("found", m.found))
        },
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
                "kind": x.kind, "where": x.where, "name": x.name,
                "parameters": [
                    {"name": p.name, "value": p.value, "unit": p.unit, "std": None if p.at_bound else p.std}
                    for p in parameters
                ],
            }
            for x, parameters in zip(e.effects, e.parameters, strict=True)
        ],
    }  # fmt: skip


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


def mode_lines(name: str, d: ModeDiagnosis) -> list[str]:
    """Return a diagnosis from modes as lines of text."""
    m, out = d.modes, [f"{name}: {d.verdict}; {d.reason}", ""]
    out.append("probability  explanation")
    for e in d.credible[:MOST_SAID]:
        out.append(f"{e.probability:11.2f}  {explanation_text(e)}")
    if len(d.credible) > MOST_SAID:
        out.append(f"{'':11}  and {len(d.credible) - MOST_SAID} more that share the rest of 90 %")
    out += ["", "measured Hz  nominal %  fitted %  found %   MAC"]
    for k in range(len(m.measured)):
        off = [_off(f[k], m.measured[k]) for f in (m.nominal, m.fitted, m.found)]
        mac = f"{m.mac_found[k]:5.3f}" if np.isfinite(m.mac_found[k]) else "    -"
        out.append(
            f"{m.measured[k]:11.5g}  {off[0]:>9}  {off[1]:>8}  {off[2]:>7}  {mac}"
            + ("  predicted, not fitted" if m.held_out[k] else "")
        )
    if d.next_measurements:
        out += ["", "would tell the first two explanations apart:", *(f"  {t}" for t in d.next_measurements)]
    return [*out, *(f"note: {note}" for note in d.notes)]


def _off(computed: float, measured: float) -> str:
    return f"{100 * (computed / measured - 1):+.2f}" if np.isfinite(computed) else "-"


def explanation_text(e: Explanation) -> str:
    """Return an explanation with the values of its effects."""
    values = [
        f"{p.name} {p.value:.3g}{'' if p.at_bound else f' ± {p.std:.1g}'} {p.unit}"
        for parameters in e.parameters
        for p in parameters
    ]
    return f"{e.label}: {', '.join(values)}" if values else e.label
