"""``dovetail modes``: natural frequencies and mode shapes."""

import argparse

import numpy as np

from dovetail.commands.argument_types import positive, whole_up_to
from dovetail.commands.common import Options, assumptions, loaded, notes_of_mesh, say, warn
from dovetail.commands.results import Results
from dovetail.disk.output import Progress, result_folder, write_json
from fem.analysis.modes import first_modes, solve_modes
from fem.analysis.warping import warped_modes
from fem.io import write_modes
from fem.system import assemble

HELP = "compute natural frequencies and mode shapes"
EXAMPLE = "dovetail modes study.toml --number 12 --pictures out/modes"
RESULTS = Results(motions="the mode shapes", pictures=("each elastic mode", "mode-01.png"))


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--number",
        type=whole_up_to(100_000),
        metavar="N",
        help="number of modes besides rigid-body ones (default 10)",
    )
    p.add_argument("--max", type=positive, metavar="HZ", help="all modes up to this frequency instead")
    RESULTS.add_arguments(p)


def run(options: Options, progress: Progress) -> None:
    """Print natural frequencies; draw mode shapes."""
    RESULTS.check(options)
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
    if options.pictures is not None:
        from viz.render import render_mode

        with result_folder(options.pictures, options.force) as scratch:
            for k in range(found.n_rigid, found.n_modes):
                progress("drawing mode shapes", k - found.n_rigid, found.n_modes - found.n_rigid)
                render_mode(study.model, found, k, scratch / f"mode-{k + 1:02d}.png")
    progress.close()
    write_json(
        options.json,
        {
            "study": study.name,
            "n_rigid": found.n_rigid,
            "modes": [
                {"frequency_Hz": f, "damping_ratio": z} for f, z in zip(found.frequency, zeta, strict=True)
            ],
            "elements": study.model.mesh.n_lines,
            "mesh_notes": study.model.mesh.notes,
            "measured_notes": study.measured_notes,
            "assumptions": study.assumptions,
            "warnings": (*study.warnings, *warped),
        },
    )
    rows = [
        f"{k + 1:5d}  {f:12.4f}  {100 * z:8.3f}"
        f"{'   rigid body' if k < found.n_rigid else '   grows: the structure is unstable' if f < 0 else ''}"
        for k, (f, z) in enumerate(zip(found.frequency, zeta, strict=True))
    ]
    say(
        options,
        f"{study.name}: {study.model.mesh.n_lines} elements, {system.n_free} coordinates",
        " mode  frequency Hz  damping %",
        *rows,
        *notes_of_mesh(study),
        *(
            [f"the model has {found.n_modes} modes in all"]
            if options.max is None and options.number and found.n_modes < found.n_rigid + options.number
            else []
        ),
        *assumptions(study),
    )
