"""``dovetail unbalance``: responses of a rotor to its unbalance over speed."""

import argparse
from pathlib import Path

import numpy as np

from dovetail.commands.common import Options, assumptions, loaded, say
from dovetail.commands.load_cases import require_sensors
from dovetail.commands.results import Results
from dovetail.commands.speed import add_speeds
from dovetail.disk.output import Progress, write_json
from dovetail.file.rotation import RPM
from dovetail.file.table import StudyError
from fem.analysis.unbalance import UnbalanceResponse, solve_unbalance
from fem.io.atomic import replacing
from updating.measurement.measurement import sensor_rows

HELP = "compute responses of a rotor to its unbalance over its speed"
EXAMPLE = "dovetail unbalance study.toml --speeds 0:6000:601 --picture unbalance.png"
RESULTS = Results(table="amplitudes and phases", picture="the amplitudes")


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    add_speeds(p)
    RESULTS.add_arguments(p)


def run(options: Options, progress: Progress) -> None:
    """Print largest amplitudes; draw and write them over speed."""
    RESULTS.check(options)
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
    if options.out is not None:
        _write(options.out, rpm, names, amplitude, phase)
    if options.picture is not None:
        from viz.rotors import plot_unbalance
        from viz.style import save

        save(plot_unbalance(found, names, f"{study.name}: response to unbalance"), options.picture)
    progress.close()
    write_json(
        options.json,
        {
            "study": study.name,
            "speed_rpm": rpm,
            "frequency_Hz": found.frequency,
            "sensors": names,
            "amplitude_m": amplitude,
            "phase_deg": phase,
            "assumptions": study.assumptions,
            "warnings": study.warnings,
        },
    )
    say(
        options,
        f"{study.name}: {len(study.unbalances)} unbalance(s), {number} speeds from {first:g} to {last:g} "
        "turns a minute",
        *_peaks(rpm, names, found),
        *assumptions(study),
    )


def _peaks(rpm: np.ndarray, names: list[str], found: UnbalanceResponse) -> list[str]:
    """Return the largest amplitude of each sensor and its speed."""
    width = max([len(n) for n in names] + [6])
    amplitude = np.abs(found.displacement)
    at = amplitude.argmax(axis=0)
    rows = [
        f"{name:{width}} {1e6 * amplitude[k, i]:16.5g} {rpm[k]:10.1f}"
        for i, (name, k) in enumerate(zip(names, at, strict=True))
    ]
    return [f"{'sensor':{width}} {'largest [µm]':>16} {'at 1/min':>10}", *rows]


def _write(path: Path, rpm: np.ndarray, names: list[str], amplitude: np.ndarray, phase: np.ndarray) -> None:
    """Write amplitudes and phases over speed."""
    head = [f"{name} {what}" for name in names for what in ("amplitude [m]", "phase [deg]")]
    each = np.stack([amplitude, phase], axis=2).reshape(rpm.size, -1)
    with replacing(path) as scratch:
        np.savetxt(
            scratch,
            np.column_stack([rpm, each]),
            fmt="%.9g",
            delimiter=",",
            header=",".join(["speed [1/min]", *head]),
            comments="",
            encoding="utf-8",
        )
