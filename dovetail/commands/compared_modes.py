"""Part of ``dovetail compare``: the model's natural frequencies beside measured ones."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from dovetail.commands.common import Options, say
from dovetail.commands.spreadsheet import Sheet, write_xlsx
from dovetail.disk.output import Progress, write_json

if TYPE_CHECKING:
    from dovetail.notebook.modes import ModeComparison
    from dovetail.study import Study
    from updating.inference.fit_result import FitResult
    from updating.inference.mode_fit import ModeProblem

NULLS = {
    "fit": "no mode that a fit sees is paired",
    "held_out": "no mode that is held out is paired",
    "computed_Hz": "no mode of the model has such a shape or frequency",
    "zeta": "no damping was measured",
    "zeta_computed": "no mode of the model is paired",
    "mac": "no shape was measured, or no mode of the model is paired",
    "std": "no fit has it (--fitted), or it is at a bound",
}
"""Why numbers are missing."""


def compare_modes(options: Options, study: "Study", progress: Progress) -> None:
    """Print how far the model's modes are from the measured ones."""
    from dovetail import result
    from dovetail.notebook.modes import ModeComparison
    from dovetail.report import words

    progress("reducing the model")
    problem, found = _fitted(study, progress) if options.fitted else _nominal(study)
    what = "with fitted parameters" if options.fitted else "nominal"
    c = ModeComparison.of(problem, found, study.name, what)
    progress.close()
    own = found if options.fitted else None
    write_json(
        options.json,
        {
            "study": study.name,
            "model": what,
            "frequency_error": {"fit": c.error, "held_out": c.held_out_error},
            "modes": c.rows(),
            "added": [result.effect_dict(e, own) for e in _added(study, own)],
            "measured_notes": study.measured_notes,
            "warnings": study.warnings,
        },
        NULLS,
    )
    write_xlsx(options.xlsx, {"modes": _sheet(c)})
    held_out = c.held_out_error
    predicted = f", {100 * held_out:.2g} % of those held out" if np.isfinite(held_out) else ""
    error = f"error of the natural frequencies {100 * c.error:.2g} %"
    if not np.isfinite(c.error):
        error = "no measured mode has a partner in the model"
    say(
        options,
        f"{study.name}, {what}: {error}{predicted}; standard deviation of the measurement "
        f"{100 * problem.targets.noise_level:.2g} %",
        *_rows(c),
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
    from updating.inference.fitting import fit_given

    names, effects = {e.name for e in study.added}, study.added
    base = replace(
        study, model=study.model.without_effect(*names),
        changes=tuple(name for name in study.changes if name not in names),
    )  # fmt: skip
    problem = mode_problem(base)
    progress("fitting the uncertain parameters" + (" and the added effects" if effects else ""), 0.3)
    return fit_given(problem, effects)


def _added(study: "Study", found: "FitResult | None") -> Any:
    return study.added if found is None else found.effects


def _baseline_note(study: "Study") -> list[str]:
    if study.baseline is None:
        return []
    return [
        "note: the measured modes are without what the model leaves on the baseline once it is calibrated"
    ]


def _sheet(c: "ModeComparison") -> Sheet:
    """Return measured and computed modes for Excel."""
    head = (
        "measured [Hz]", "std [%]", "computed [Hz]", "off by [%]", "MAC", "measured zeta [%]",
        "computed zeta [%]", "held out",
    )  # fmt: skip
    columns = (
        c.measured, 100 * c.std, c.computed, 100 * (c.computed / c.measured - 1), c.mac, 100 * c.zeta,
        100 * c.zeta_computed, c.held_out,
    )  # fmt: skip
    return head, [tuple(x.item() for x in row) for row in zip(*columns, strict=True)]


def _rows(c: "ModeComparison") -> list[str]:
    rows = []
    for k, measured in enumerate(c.measured):
        f, mac = c.computed[k], c.mac[k]
        off = f"{100 * (f / measured - 1):+.3f}" if np.isfinite(f) else "-"
        rows.append(
            f"{measured:11.5g}  {f'{f:.5g}' if np.isfinite(f) else '-':>11}  {off:>9}  "
            f"{100 * c.std[k]:7.2g}  {f'{mac:.3f}' if np.isfinite(mac) else '-':>5}"
            + ("  predicted, not fitted" if c.held_out[k] else "")
        )
    return [f"{'measured Hz':>11}  {'computed Hz':>11}  {'off by %':>9}  {'std %':>7}  {'MAC':>5}", *rows]
