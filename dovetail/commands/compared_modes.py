"""Part of ``dovetail compare``: the model's natural frequencies compared with measured ones."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options, noted
from dovetail.disk.output import Progress
from dovetail.report.table import Column, Table

if TYPE_CHECKING:
    from dovetail.notebook.modes import StudyModeComparison
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

ON_BASELINE = "the measured modes are without what the model leaves on the baseline once it is calibrated"


def compare_modes(options: Options, study: "Study", progress: Progress) -> Answer:
    """Return how far the model's modes are from the measured ones."""
    from dovetail import result
    from dovetail.notebook.modes import StudyModeComparison
    from dovetail.report import words

    progress("reducing the model")
    problem, found = _fitted(study, progress) if options.fitted else _nominal(study)
    what = "with fitted parameters" if options.fitted else "nominal"
    c = StudyModeComparison.of(problem, found, study.name, what)
    fitted = found if options.fitted else None
    added = study.added if fitted is None else fitted.effects
    held_out = c.held_out_error
    predicted = f", {100 * held_out:.2g} % of those held out" if np.isfinite(held_out) else ""
    error = f"error of the natural frequencies {100 * c.error:.2g} %"
    if not np.isfinite(c.error):
        error = "no measured mode has a partner in the model"
    return Answer(
        study,
        [
            f"{study.name}, {what}: {error}{predicted}; standard deviation of the measurement "
            f"{100 * problem.targets.noise_level:.2g} %",
            _table(c),
            *(f"added: {words.added_text(e, fitted)}" for e in added),
            *noted([ON_BASELINE] if study.baseline is not None else [], study.measured_notes),
        ],
        {
            "model": what,
            "frequency_error": {"fit": c.error, "held_out": c.held_out_error},
            "modes": c.rows(),
            "added": [result.effect_dict(e, fitted) for e in added],
        },
        NULLS,
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
        study,
        model=study.model.without_effect(*names),
        changes=tuple(name for name in study.changes if name not in names),
    )
    problem = mode_problem(base)
    progress("fitting the uncertain parameters" + (" and the added effects" if effects else ""), 0.3)
    return fit_given(problem, effects)


def _table(c: "StudyModeComparison") -> Table:
    """Return measured and computed modes."""
    file = ("file",)
    return Table.of(
        "modes",
        Column("measured", c.measured, "Hz"),
        Column("computed", c.computed, "Hz"),
        Column("off by", c.computed / c.measured - 1, "%", "+.3f", 100),
        Column("std", c.std, "%", ".2g", 100),
        Column("MAC", c.mac, show=".3f"),
        Column("measured zeta", c.zeta, "%", scale=100, places=file),
        Column("computed zeta", c.zeta_computed, "%", scale=100, places=file),
        Column("held out", c.held_out, places=file),
        Column("", ["predicted, not fitted" * bool(held_out) for held_out in c.held_out], places=("text",)),
    )
