"""``dovetail compare``: the model's FRFs beside the measured ones."""

import argparse

from dovetail.commands.argument_types import AddEffect, SetValues, values_by_name, whole_up_to
from dovetail.commands.common import (
    Options,
    check_places,
    loaded,
    say,
)
from dovetail.commands.tables import band_names, cell, width_of
from dovetail.disk.output import Progress, write_json

HELP = "compare the model's FRFs with the measured ones"
EXAMPLE = "dovetail compare study.toml --add point_mass:beam --set mass=0.45,position=0.12 --fitted"


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
        help="values of the effect of the --add before it, in SI units; others stay as it begins with them",
    )
    p.add_argument(
        "--fitted", action="store_true", help="fit the uncertain parameters and the added effects first"
    )
    p.set_defaults(added=[])
    p.add_argument(
        "--bands",
        type=whole_up_to(1000),
        default=6,
        metavar="N",
        help="number of equal frequency bands (default 6)",
    )


def run(options: Options, progress: Progress) -> None:
    """Print how far the model's FRFs are from the measured ones."""
    from dovetail import pipeline, result
    from dovetail.report import words
    from updating.correlation import compare as compare_frfs
    from updating.diagnosis.begin import begin_fitted

    check_places(options)
    study = loaded(options)
    for name, values in options.added:
        study = study.add(name, **values)
    if options.added and options.fitted:
        progress("fitting the uncertain parameters and the added effects", 0.1)
        study = study.fit(faults=True)
    progress("reducing the model")
    problem, faults = pipeline.fit_problem(study), study.faults
    if options.fitted and not options.added:
        progress("fitting the uncertain parameters", 0.3)
        problem, found, faults = begin_fitted(problem)
    else:
        found = problem.nominal()
    c = compare_frfs(problem.measured, problem.frf(found), options.bands, problem.data.mask)
    progress.close()
    what = "with fitted parameters" if options.fitted else "nominal"
    write_json(
        options.json,
        {
            "study": study.name,
            "model": what,
            **result.comparison_dict(c),
            "error_db": found.fit_db,
            "held_out_db": found.held_out_db,
            "all_lines_db": c.total_db,
            "noise_db": problem.data.noise_db,
            "added": [result.effect_dict(e, study.fitted) for e in study.added],
            "faults": [result.fault_dict(f) for f in faults],
            "measured_notes": study.measured_notes,
            "warnings": study.warnings,
        },
    )
    head = "  ".join(f"{word:>11}" for word in band_names(c.bands))
    width = width_of(c.outputs)
    say(
        options,
        f"{study.name}, {what}: error of the amplitude {found.fit_db:.2f} dB on the lines of the fit, "
        f"{cell(found.held_out_db, 0)} on those held out and {c.total_db:.2f} on all; noise of the "
        f"measurement {problem.data.noise_db:.2f} dB",
        f"{'sensor':{width}}  {'all dB':>7}  {head}  {'least FRAC':>10}",
        *(
            f"{name:{width}}  {cell(total, 7)}  {'  '.join(cell(db, 11) for db in row)}  {cell(frac, 10, 3)}"
            for name, total, row, frac in zip(
                c.outputs, c.by_sensor(), c.by_band(), result.least_frac(c), strict=True
            )
        ),
        *(f"added: {words.added_text(e, study.fitted)}" for e in study.added),
        *(f"set right: {words.fault_text(f)}" for f in faults),
        *(f"note: {note}" for note in study.measured_notes),
    )
