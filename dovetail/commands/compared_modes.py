"""Part of ``dovetail compare``: the model's natural frequencies compared with measured ones."""

from dataclasses import replace
from typing import TYPE_CHECKING

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options, noted
from dovetail.commands.results import save_picture
from dovetail.disk.output import Progress

if TYPE_CHECKING:
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
    save_picture(options, c.still)
    fitted = found if options.fitted else None
    added = study.added if fitted is None else fitted.effects
    return Answer(
        study,
        [
            *c.printed(),
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
