"""``dovetail locate``: sensors, bands and places that carry the misfit."""

import argparse

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_bands, count
from dovetail.commands.common import Options, check_places, columns_of_bands, loaded, noted
from dovetail.disk.output import Progress
from dovetail.report.table import Column, Table

EXAMPLE = "dovetail locate study.toml"
SHARE = "share of the misfit that a change there would explain"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    add_bands(p)
    p.add_argument(
        "--number", type=count, default=20, metavar="N", help="sensors and places to print (default 20)"
    )


def run(options: Options, progress: Progress) -> Answer:
    """Return which sensors, bands, members and places carry the misfit."""
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
    order = np.argsort(-np.nan_to_num(where.by_sensor_db), kind="stable")
    sensors = Table.of(
        "sensors",
        Column("sensor", where.sensors),
        Column("all", where.by_sensor_db, "dB", ".2f"),
        *columns_of_bands(where.bands, where.by_band_db),
    ).rows(order)
    shares = [(f"member {m}", s) for m, s in where.members.items()] + list(where.places)
    shares = sorted(shares, key=lambda place: -place[1])
    places = Table.of(
        "places",
        Column("place", [words.place(name) for name, _ in shares]),
        Column(SHARE, [s for _, s in shares], "%", "{:.1f} %".format, 100, head=SHARE),
    )
    return Answer(
        study,
        [
            f"{study.name}: {fitted.fit_db:.2f} dB once the uncertain parameters are fitted; sensors, the "
            "worst first",
            sensors.first(options.number),
            "",
            *([places.first(options.number), ""] if where.says_where else []),
            *(f"corrected: {words.fault_text(f)}" for f in faults),
            where.note,
            *noted(study.measured_notes),
        ],
        result.localisation_dict(where),
        sheets=[sensors, places] if where.says_where else [sensors],
    )
