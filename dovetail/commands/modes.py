"""``dovetail modes``: natural frequencies and mode shapes."""

import argparse

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_number, positive
from dovetail.commands.common import Options, assumptions, loaded, notes_of_mesh, warn
from dovetail.commands.results import Results
from dovetail.disk.output import Progress, result_folder
from dovetail.report.table import Column, Table
from fem.analysis.modes import first_modes, solve_modes
from fem.analysis.warping import warped_modes
from fem.io import write_modes
from fem.system import assemble

EXAMPLE = "dovetail modes study.toml --number 12 --picture out/modes"
RESULTS = Results(motions="the mode shapes", pictures=("each elastic mode", "mode-01.png"))


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    add_number(p, "number of modes, without rigid-body modes (default 10)", 100_000)
    p.add_argument("--max", type=positive, metavar="HZ", help="all modes up to this frequency instead")


def run(options: Options, progress: Progress) -> Answer:
    """Return natural frequencies; draw mode shapes."""
    study = loaded(options, ())
    progress("solving for modes")
    system = assemble(study.model, reciprocal=False)
    if options.max is not None:
        found = solve_modes(system, max_frequency=options.max)
    else:
        found = first_modes(system, options.number or 10)
    warped = warped_modes(study.model, found)
    warn(warped)
    zeta = np.zeros(found.n_modes) if found.zeta is None else found.zeta
    if options.vtu is not None:
        write_modes(found, study.model.mesh, options.vtu)
    if options.picture is not None:
        from viz.render import render_mode

        with result_folder(options.picture, options.force) as scratch:
            for k in range(found.n_rigid, found.n_modes):
                progress("drawing mode shapes", k - found.n_rigid, found.n_modes - found.n_rigid)
                render_mode(study.model, found, k, scratch / f"mode-{k + 1:02d}.png")
    remarks = [
        "rigid body" if k < found.n_rigid else "grows: the structure is unstable" if f < 0 else ""
        for k, f in enumerate(found.frequency)
    ]
    table = Table.of(
        "modes",
        Column("mode", range(1, found.n_modes + 1)),
        Column("frequency", found.frequency, "Hz", ".4f", key="frequency_Hz"),
        Column("damping", zeta, "%", ".3f", 100, key="damping_ratio"),
        Column("", remarks),
    )
    asked = 0 if options.max is not None else options.number or 0
    few = found.n_modes < found.n_rigid + asked
    return Answer(
        study,
        [
            f"{study.name}: {study.model.mesh.n_lines} elements, {system.n_free} coordinates",
            table,
            *notes_of_mesh(study),
            *([f"the model has {found.n_modes} modes in all"] if few else []),
            *assumptions(study),
        ],
        {
            "n_rigid": found.n_rigid,
            "modes": table.records(),
            "elements": study.model.mesh.n_lines,
            "warnings": (*study.warnings, *warped),
        },
    )
