"""``dovetail unbalance``: responses of a rotor to its unbalance over speed."""

import argparse

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options, assumptions, loaded
from dovetail.commands.load_cases import require_sensors
from dovetail.commands.results import Results
from dovetail.commands.speed import add_speeds
from dovetail.disk.output import Progress
from dovetail.file.rotation import RPM
from dovetail.file.table import StudyError
from dovetail.report.table import Column, Table
from fem.analysis.unbalance import solve_unbalance
from updating.measurement.measurement import sensor_rows

EXAMPLE = "dovetail unbalance study.toml --speeds 0:6000:601 --picture unbalance.png"
RESULTS = Results(table="amplitudes and phases", picture="the amplitudes")


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    add_speeds(p)


def run(options: Options, progress: Progress) -> Answer:
    """Return largest amplitudes, and all over speed; draw them."""
    study = loaded(options, ("sensors",))
    sensors = require_sensors(study)
    if not study.unbalances:
        msg = f"{study.path.name}: the study has no unbalance; give [[unbalances]]"
        raise StudyError(msg)
    first, last, number = options.speeds
    rpm = np.linspace(first, last, number)
    found = solve_unbalance(
        study.model,
        study.unbalances,
        rpm * RPM,
        sensor_rows(study.model, sensors),
        lambda k, n: progress("solving over speed", k, n),
    )
    names = [s.name for s in sensors]
    amplitude = np.abs(found.displacement)
    phase = np.degrees(np.angle(found.displacement))
    if options.picture is not None:
        from viz.rotors import plot_unbalance
        from viz.style import save

        save(plot_unbalance(found, names, f"{study.name}: response to unbalance"), options.picture)
    at = amplitude.argmax(axis=0)
    peaks = Table.of(
        "largest amplitudes",
        Column("sensor", names),
        Column("largest", amplitude.max(axis=0), "µm", scale=1e6, head="largest [µm]"),
        Column("at", rpm[at], "1/min", ".1f"),
    )
    each = [
        column
        for k, name in enumerate(names)
        for column in (
            Column(f"{name} amplitude", amplitude[:, k], "m"),
            Column(f"{name} phase", phase[:, k], "deg"),
        )
    ]
    return Answer(
        study,
        [
            f"{study.name}: {len(study.unbalances)} unbalance(s), {number} speeds from {first:g} to {last:g} "
            "turns a minute",
            peaks,
            *assumptions(study),
        ],
        {
            "speed_rpm": rpm,
            "frequency_Hz": found.frequency,
            "sensors": names,
            "amplitude_m": amplitude,
            "phase_deg": phase,
        },
        full=Table("response over speed", [Column("speed", rpm, "1/min"), *each]),
    )
