"""``dovetail locate``: sensors, bands and places that carry the misfit."""

import argparse

import numpy as np

from dovetail.commands.argument_types import count, whole_up_to
from dovetail.commands.common import (
    Options,
    check_places,
    loaded,
    say,
)
from dovetail.commands.tables import band_names, cell, width_of
from dovetail.disk.output import Progress, write_json

HELP = "find the sensors, bands and places that carry the misfit"
EXAMPLE = "dovetail locate study.toml"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--bands",
        type=whole_up_to(1000),
        default=6,
        metavar="N",
        help="number of equal frequency bands (default 6)",
    )
    p.add_argument(
        "--number", type=count, default=20, metavar="N", help="sensors and places to print (default 20)"
    )


def run(options: Options, progress: Progress) -> None:
    """Print which sensors, bands, members and places carry the misfit."""
    from dovetail import pipeline, result
    from dovetail.report import words
    from updating.diagnosis.begin import begin_fitted
    from updating.diagnosis.localisation import locate as find_places

    check_places(options)
    study = loaded(options)
    progress("reducing the model")
    problem = pipeline.formed_fit_problem(study)
    progress("fitting the uncertain parameters", 0.2)
    problem, fitted, faults = begin_fitted(problem)
    progress("locating the misfit", 0.5)
    where = find_places(problem, fitted, options.bands)
    progress.close()
    write_json(
        options.json,
        {
            "study": study.name,
            **result.localisation_dict(where),
            "measured_notes": study.measured_notes,
            "warnings": study.warnings,
        },
    )
    order = np.argsort(-np.nan_to_num(where.by_sensor_db), kind="stable")[: options.number]
    head = "  ".join(f"{word:>11}" for word in band_names(where.bands))
    width = width_of(where.sensors)
    places = sorted(
        [(f"member {m}", s) for m, s in where.members.items()] + list(where.places), key=lambda t: -t[1]
    )
    wide = width_of([words.place(p) for p, _ in places])
    say(
        options,
        f"{study.name}: {fitted.fit_db:.2f} dB once the uncertain parameters are fitted; sensors, the "
        "worst first",
        f"{'sensor':{width}}  {'all dB':>7}  {head}",
        *(
            f"{where.sensors[i]:{width}}  {where.by_sensor_db[i]:7.2f}  "
            f"{'  '.join(cell(db, 11) for db in where.by_band_db[i])}"
            for i in order
        ),
        "",
        f"{'place':{wide}}  share of the misfit that a small change would explain",
        *(f"{words.place(name):{wide}}  {100 * share:5.1f} %" for name, share in places[: options.number]),
        "",
        *(f"set right: {words.fault_text(f)}" for f in faults),
        where.note,
        *(f"note: {note}" for note in study.measured_notes),
    )
