"""``dovetail psd``: responses of the sensors to random forces and motions of the base."""

import argparse
from pathlib import Path

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.common import Options, assumptions, loaded, without_rounding
from dovetail.commands.excitations import driven_by
from dovetail.commands.frf import MOST_VALUES
from dovetail.commands.load_cases import require_sensors
from dovetail.commands.results import Results, write_motions
from dovetail.commands.speed import add_rpm, at_asked_speed
from dovetail.disk.output import Progress
from dovetail.file.histories import read_columns
from dovetail.report.table import Column, Table, columns_of
from fem.analysis.random_vibration import RESPONSES, RandomResponse, solve_random
from fem.analysis.selection import Selection
from fem.analysis.tabulated import Tabulated
from fem.system import assemble
from updating.measurement.measurement import sensor_rows

EXAMPLE = "dovetail psd study.toml --psd vibration.csv --response acceleration --picture psd.png"
RESULTS = Results(
    table="the densities",
    motions="root mean squares of the whole structure",
    picture="the densities",
    read={"psd": "the excitation's density"},
)
UNITS = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s²"}


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--psd",
        type=Path,
        required=True,
        metavar="FILE",
        help="CSV with frequency [Hz] and one-sided densities by name: of an excitation's force [N²/Hz], of "
        "the factor of a load case [1/Hz], or of 'base x' … 'base rz' [(m/s²)²/Hz]; none is correlated with "
        "another",
    )
    p.add_argument("--response", choices=RESPONSES, default="acceleration", help="default acceleration")
    p.add_argument("--relative", action="store_true", help="responses relative to the base")
    add_rpm(p)


def run(options: Options, progress: Progress) -> Answer:
    """Return root mean squares and densities; draw and write them."""
    study = at_asked_speed(loaded(options, ("sensors",)), options)
    sensors = require_sensors(study)
    table = read_columns(options.psd, ("frequency",))
    driven = driven_by(study, table, density=True)
    progress("computing densities")
    system = assemble(study.model, reciprocal=False)

    def solved(outputs: Selection) -> RandomResponse:
        return solve_random(
            system,
            outputs,
            loads=driven.loads.T,
            forces=[Tabulated.of(table.x, driven.values[:, k]) for k in driven.of_loads],
            base={d: Tabulated.of(table.x, driven.values[:, k]) for d, k in driven.base.items()},
            response=options.response,
            relative=options.relative,
        )

    found = solved(sensor_rows(study.model, sensors))
    names, unit = [s.name for s in sensors], UNITS[options.response]
    square = f"({unit})²/Hz"
    if options.vtu is not None:
        progress("computing root mean squares of all points")
        at_once = max(1, MOST_VALUES // (found.frequency.size * len(table.names)))
        blocks = (
            range(k, min(k + at_once, system.model.n_dof)) for k in range(0, system.model.n_dof, at_once)
        )
        rms = np.concatenate([solved(block).rms for block in blocks])
        write_motions(options.vtu, study, {f"RMS {options.response}": rms})
    if options.picture is not None:
        from viz.responses import plot_densities
        from viz.style import save

        title = f"{study.name}: {options.response}{', relative to the base' * options.relative}"
        save(plot_densities(found.frequency, found.density, names, square, title), options.picture)
    rms = without_rounding(found.rms)
    sizes = Table.of(
        "root mean squares",
        Column("sensor", names),
        Column("RMS", rms, unit),
        Column("3 sigma", 3 * rms, unit, head="3 sigma"),
        Column("crossings", np.where(rms > 0, found.crossings, np.nan), "Hz"),
    )
    densities = [Column("frequency", found.frequency, "Hz"), *columns_of(names, found.density, square)]
    return Answer(
        study,
        [
            f"{study.name}: random {options.response}, {found.frequency.size} lines from "
            f"{found.frequency[0]:g} to {found.frequency[-1]:g} Hz",
            sizes,
            *assumptions(study),
        ],
        {
            "response": found.response,
            "relative": found.relative,
            "rms": dict(zip(names, found.rms, strict=True)),
            "crossings_Hz": dict(zip(names, found.crossings, strict=True)),
            "frequency_Hz": found.frequency,
            "density": dict(zip(names, found.density.T, strict=True)),
        },
        full=Table("densities", densities),
    )
