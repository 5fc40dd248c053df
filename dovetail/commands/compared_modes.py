"""Part of ``dovetail compare``: the model's natural frequencies beside measured ones."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from dovetail.commands.common import Options, say
from dovetail.disk.output import Progress, write_json

if TYPE_CHECKING:
    from dovetail.study import Study
    from updating.inference.fit_result import FitResult
    from updating.inference.mode_fit import ModeProblem


def compare_modes(options: Options, study: "Study", progress: Progress) -> None:
    """Print how far the model's modes are from the measured ones."""
    from dovetail import result
    from dovetail.report import words
    from updating.diagnosis.mode_diagnosis import frequency_error

    progress("reducing the model")
    problem, found = _fitted(study, progress) if options.fitted else _nominal(study)
    t, computed = problem.targets, problem.computed(found)
    progress.close()
    fit, held_out = (frequency_error(t.frequency, computed.frequency, t.held_out == k) for k in (False, True))
    what = "with fitted parameters" if options.fitted else "nominal"
    columns = {
        "measured_Hz": t.frequency, "std": t.frequency_std, "computed_Hz": computed.frequency,
        "zeta": t.zeta, "zeta_computed": computed.zeta, "mac": computed.mac, "held_out": t.held_out,
    }  # fmt: skip
    own = found if options.fitted else None
    write_json(
        options.json,
        {
            "study": study.name,
            "model": what,
            "frequency_error": {"fit": fit, "held_out": held_out},
            "modes": [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)],
            "added": [result.effect_dict(e, own) for e in _added(study, own)],
            "measured_notes": study.measured_notes,
            "warnings": study.warnings,
        },
    )
    predicted = f", {100 * held_out:.2g} % of those held out" if np.isfinite(held_out) else ""
    say(
        options,
        f"{study.name}, {what}: error of the natural frequencies {100 * fit:.2g} %{predicted}; standard "
        f"deviation of the measurement {100 * t.noise_level:.2g} %",
        *_rows(t, computed),
        *(f"added: {words.added_text(e, own)}" for e in _added(study, own)),
        *_baseline_note(study),
        *(f"note: {note}" for note in study.measured_notes),
    )


def _nominal(study: "Study") -> "tuple[ModeProblem, FitResult]":
    from dovetail.modes_pipeline import mode_problem

    problem = mode_problem(study)
    return problem, problem.nominal()


def _fitted(study: "Study", progress: Progress) -> "tuple[ModeProblem, FitResult]":
    from dovetail.modes_pipeline import mode_problem
    from fem.model import parameter_values
    from updating.diagnosis.evidence.fitting import fit

    names, effects = {e.name for e in study.added}, study.added
    base = replace(
        study, model=study.model.without_effect(*names),
        changes=tuple(name for name in study.changes if name not in names),
    )  # fmt: skip
    problem = mode_problem(base)
    problem = replace(problem, reduced=problem.reduced.with_forces_of(effects))
    progress("fitting the uncertain parameters" + (" and the added effects" if effects else ""), 0.3)
    return problem, fit(problem, effects, [parameter_values(e) for e in effects]).result


def _added(study: "Study", found: "FitResult | None") -> Any:
    return study.added if found is None else found.effects


def _baseline_note(study: "Study") -> list[str]:
    if study.baseline is None:
        return []
    return [
        "note: the measured modes are without what the model leaves on the baseline once it is calibrated"
    ]


def _rows(t: Any, computed: Any) -> list[str]:
    rows = []
    for k, measured in enumerate(t.frequency):
        f, mac = computed.frequency[k], computed.mac[k]
        off = f"{100 * (f / measured - 1):+.3f}" if np.isfinite(f) else "-"
        rows.append(
            f"{measured:11.5g}  {f'{f:.5g}' if np.isfinite(f) else '-':>11}  {off:>9}  "
            f"{100 * t.frequency_std[k]:7.2g}  {f'{mac:.3f}' if np.isfinite(mac) else '-':>5}"
            + ("  predicted, not fitted" if t.held_out[k] else "")
        )
    return [f"{'measured Hz':>11}  {'computed Hz':>11}  {'off by %':>9}  {'std %':>7}  {'MAC':>5}", *rows]
