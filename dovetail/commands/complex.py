"""``dovetail complex``: frequencies and damping ratios with all damping of the model."""

import argparse

import numpy as np

from dovetail.commands.argument_types import whole_up_to
from dovetail.commands.common import Options, assumptions, loaded, notes_of_mesh, say
from dovetail.commands.results import MOTION_FORMATS, Results
from dovetail.commands.speed import NO_WHIRL, add_rpm, at_asked_speed
from dovetail.disk.output import Progress, result_folder, write_json
from fem.analysis.complex_modes import solve_complex_modes
from fem.analysis.whirl import whirl, whirl_name
from fem.io import write_modes
from fem.system import assemble
from updating.correlation.complexity import modal_phase_collinearity

HELP = "compute complex modes: frequencies and damping ratios with all damping"
EXAMPLE = "dovetail complex study.toml --number 8 --out modes.uff"
RESULTS = Results(
    table="the oscillating modes",
    formats=(".uff", ".unv", ".npz", *MOTION_FORMATS),
    motions="the oscillating modes",
    pictures=("each oscillating mode", "mode-01.png"),
)


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--number",
        type=whole_up_to(1000),
        default=10,
        metavar="N",
        help="number of modes besides rigid-body ones; overdamped ones count (default 10)",
    )
    add_rpm(p)
    RESULTS.add_arguments(p)


def run(options: Options, progress: Progress) -> None:
    """Print complex modes; draw and write them."""
    RESULTS.check(options)
    study = at_asked_speed(loaded(options, ()), options)
    progress("solving for complex modes")
    model = study.model
    found = solve_complex_modes(assemble(model, reciprocal=False), options.number)
    modes = found.as_modes()
    turning = whirl(model, found.poles, found.shapes)
    for path in filter(None, (options.out, options.vtu)):
        write_modes(modes, study.model.mesh, path)
    if options.pictures is not None:
        from viz.render import mode_title, render_mode

        of_modes = [whirl_name(w) for w in turning[~found.overdamped]]
        with result_folder(options.pictures, options.force) as scratch:
            for k in range(modes.n_rigid, modes.n_modes):
                progress("drawing mode shapes", k, modes.n_modes)
                name = of_modes[k - modes.n_rigid]
                title = f"{mode_title(modes, k)}{f', {name}' if name else ''}"
                render_mode(study.model, modes, k, scratch / f"mode-{k + 1:02d}.png", title=title)
    progress.close()
    n = 6 * study.model.mesh.n_points
    moved = found.shapes[:n].reshape(-1, 6, found.n_modes)[:, :3].reshape(-1, found.n_modes)
    collinearity = modal_phase_collinearity(moved)
    columns = found.frequency, found.damped_frequency, found.zeta, collinearity, turning
    write_json(
        options.json,
        {
            "study": study.name,
            "n_rigid": found.rigid.shape[1],
            "modes": [
                {
                    "pole": pole,
                    "frequency_Hz": f,
                    "damped_frequency_Hz": d,
                    "damping_ratio": z,
                    "modal_phase_collinearity": c,
                    "whirl": w,
                    "whirl_sense": whirl_name(w),
                }
                for pole, f, d, z, c, w in zip(found.poles, *columns, strict=True)
            ],
            "converged": found.converged,
            "largest_residual": float(np.max(found.residual, initial=0.0)),
            "assumptions": study.assumptions,
            "warnings": study.warnings,
        },
        {"whirl": NO_WHIRL},
    )
    rows = [
        f"{k + 1:5d}  {f:12.4f}  {d:12.4f}  {100 * z:9.4f}  {c:6.3f}{_words(d, w)}"
        for k, (f, d, z, c, w) in enumerate(zip(*columns, strict=True))
    ]
    say(
        options,
        f"{study.name}: {study.model.mesh.n_lines} elements, {found.rigid.shape[1]} rigid-body mode(s) apart",
        " mode  frequency Hz     damped Hz  damping %     MPC",
        *rows,
        *([] if found.converged else [f"not converged: largest residual {found.residual.max():.1e}"]),
        *notes_of_mesh(study),
        *assumptions(study),
    )


def _words(damped: float, turning: float) -> str:
    """Return the words behind a mode: overdamped, or the sense of its whirl."""
    words = [*([] if damped else ["overdamped"]), *([] if np.isnan(turning) else [whirl_name(turning)])]
    return "".join(f"   {word}" for word in words)
