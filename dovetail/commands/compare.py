"""``dovetail compare``: the model's FRFs, or modes, compared with the measured ones."""

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import AddEffect, SetValues, add_bands, values_by_name
from dovetail.commands.common import Options, loaded, noted
from dovetail.commands.results import Results, save_picture
from dovetail.disk.output import Progress
from dovetail.file.contents import has_modes_alone

if TYPE_CHECKING:
    from dovetail.study import Study

EXAMPLE = "dovetail compare study.toml --add point_mass:beam --set mass=0.45,position=0.12 --fitted"

RESULTS = Results(picture="the FRFs, or natural frequencies, with the largest errors")

NULLS = {
    "held_out_db": "no compared line is held out",
    "error_db": "no line of the sensor is compared",
    "by_band_db": "no line of the sensor is compared in the band",
    "frac": "the FRFs have no phase, or no line of the pair is compared",
    "std": "no fit has it (--fitted), or it is at a bound",
}
"""Why numbers are missing."""

SIDES = "responses", "forces"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--add",
        action=AddEffect,
        default=argparse.SUPPRESS,
        metavar="CANDIDATE",
        help="compare the model with another effect, such as point_mass:beam; 'dovetail candidates' lists "
        "them; repeatable",
    )
    p.add_argument(
        "--set",
        action=SetValues,
        type=values_by_name,
        default=argparse.SUPPRESS,
        metavar="NAME=VALUE,...",
        help="values of the effect of the --add before it, in SI units, a spring's as stiffness or "
        "compliance; values that are not given are those of `dovetail candidates`",
    )
    p.add_argument(
        "--fitted", action="store_true", help="fit the uncertain parameters and the added effects first"
    )
    p.set_defaults(added=[])
    add_bands(p)


def run(options: Options, progress: Progress) -> Answer:
    """Return how far the model's FRFs, or natural frequencies, are from the measured ones."""
    from dovetail import pipeline, result
    from dovetail.commands.compared_modes import compare_modes
    from dovetail.notebook.comparison import StudyComparison
    from dovetail.report import words
    from updating.correlation.frf_correlation import exchanged_labels
    from updating.diagnosis.begin import begin_fitted
    from updating.quality.signs import reversed_channels

    study = loaded(options)
    for name, values in options.added:
        study = study.add(name, **values)
    if has_modes_alone(study):
        return compare_modes(options, study, progress)
    if study.amplitudes and not study.measurements and not options.fitted:
        return _compare_amplitudes(options, study, progress)
    if options.added and options.fitted:
        progress("fitting the uncertain parameters and the added effects", 0.1)
        study = study.fit(faults=True)
    progress("reducing the model")
    faults = study.faults
    if options.fitted and not options.added:
        progress("fitting the uncertain parameters", 0.3)
        problem, found, faults = begin_fitted(pipeline.formed_fit_problem(study))
    else:
        problem = pipeline.fit_problem(study)
        found = problem.nominal()
    what = "with fitted parameters" if options.fitted else "nominal"
    label = what + " with added effects" * bool(study.added)
    c = StudyComparison.of(problem, found, options.bands, study.name, label)
    save_picture(options, c.still)
    exchanged = exchanged_labels(problem.measured, c.computed, problem.data.mask)
    rows, columns = ({n for side, *pair in exchanged if side == word for n in pair} for word in SIDES)
    turned = reversed_channels(problem, found, rows, columns)
    suspected = (*exchanged.values(), *turned.words)
    return Answer(
        study,
        [
            *c.printed(),
            *(f"added: {words.added_text(e, study.fitted)}" for e in study.added),
            *(f"corrected: {words.fault_text(f)}" for f in faults),
            *suspected,
            *noted(problem.data.uncompared, study.measured_notes),
        ],
        {
            "model": what,
            **result.comparison_dict(c),
            "error_db": found.fit_db,
            "held_out_db": found.held_out_db,
            "all_lines_db": c.total_db,
            "noise_db": problem.data.noise_db,
            "added": [result.effect_dict(e, study.fitted) for e in study.added],
            "faults": [result.fault_dict(f) for f in faults],
            "suspected_labels": suspected,
            "uncompared": problem.data.uncompared,
        },
        NULLS,
    )


def _compare_amplitudes(options: Options, study: "Study", progress: Progress) -> Answer:
    """Return how far the model's amplitudes are from measured ones, which have no phase.

    No line is held out, and FRAC, which needs phases, is left out.
    """
    from dovetail import result
    from dovetail.notebook.comparison import frfs, table_of_errors, worst_pairs
    from updating.correlation.frf_correlation import compare as compare_frfs
    from updating.measurement.computed import computed_frf

    progress("computing the model's FRFs")
    m = study.amplitudes[0]
    frf = m.frf.select(band=study.band)
    computed = computed_frf(study.model, m.sensors, m.excitations, frf.frequency, frf.kind)
    c = compare_frfs(frf, replace(frf, H=np.abs(computed.H).astype(complex)), options.bands)
    title = f"{study.name}, nominal: the amplitudes with the largest errors"
    save_picture(options, lambda: frfs(frf, {"nominal": computed}, worst_pairs(c), title))
    c = replace(c, phase_deg=np.full(c.phase_deg.shape, np.nan), frac=np.full(c.frac.shape, np.nan))
    return Answer(
        study,
        [
            f"{study.name}, nominal: error of the amplitude {c.total_db:.2f} dB on all lines of {m.name}, "
            "whose FRFs have no phase",
            table_of_errors(c),
            *noted(study.measured_notes),
        ],
        {
            "model": "nominal",
            **result.comparison_dict(c),
            "all_lines_db": c.total_db,
            "phase": False,
            "added": [result.effect_dict(e, study.fitted) for e in study.added],
        },
        NULLS,
    )
