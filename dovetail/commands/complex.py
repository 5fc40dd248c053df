"""``dovetail complex``: frequencies and damping ratios with all damping of the model."""

import argparse

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_number
from dovetail.commands.common import Options, assumptions, loaded, notes_of_mesh
from dovetail.commands.results import MOTION_FORMATS, Results
from dovetail.commands.speed import NO_WHIRL, add_rpm, at_asked_speed
from dovetail.disk.output import Progress, result_folder
from dovetail.report.table import Column, Table
from fem.analysis.complex_modes import solve_complex_modes, whirl, whirl_name
from fem.io import write_modes
from fem.system import assemble
from updating.correlation.complexity import modal_phase_collinearity

EXAMPLE = "dovetail complex study.toml --number 8 --out modes.uff"
RESULTS = Results(
    table="the oscillating modes",
    formats=(".uff", ".unv", ".npz", *MOTION_FORMATS),
    motions="the oscillating modes",
    pictures=("each oscillating mode", "mode-01.png"),
)


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    add_number(p, "number of modes, without rigid-body modes; overdamped ones count", 1000, 10)
    add_rpm(p)


def run(options: Options, progress: Progress) -> Answer:
    """Return complex modes; draw and write them."""
    study = at_asked_speed(loaded(options, ()), options)
    progress("solving for complex modes")
    model = study.model
    found = solve_complex_modes(assemble(model, reciprocal=False), options.number)
    modes = found.as_modes()
    turning = whirl(model, found.poles, found.shapes)
    for path in filter(None, (options.out, options.vtu)):
        write_modes(modes, study.model.mesh, path)
    if options.picture is not None:
        from viz.render import mode_title, render_mode

        of_modes = [whirl_name(w) for w in turning[~found.overdamped]]
        with result_folder(options.picture, options.force) as scratch:
            for k in range(modes.n_rigid, modes.n_modes):
                progress("drawing mode shapes", k, modes.n_modes)
                name = of_modes[k - modes.n_rigid]
                title = f"{mode_title(modes, k)}{f', {name}' if name else ''}"
                render_mode(study.model, modes, k, scratch / f"mode-{k + 1:02d}.png", title=title)
    n = 6 * study.model.mesh.n_points
    moved = found.shapes[:n].reshape(-1, 6, found.n_modes)[:, :3].reshape(-1, found.n_modes)
    collinearity = modal_phase_collinearity(moved)
    senses = [whirl_name(w) for w in turning]
    table = Table.of(
        "complex modes",
        Column("mode", range(1, found.n_modes + 1)),
        Column("pole", found.poles, key="pole", places=()),
        Column("frequency", found.frequency, "Hz", ".4f", key="frequency_Hz"),
        Column("damped", found.damped_frequency, "Hz", ".4f", key="damped_frequency_Hz"),
        Column("damping", found.zeta, "%", ".4f", 100, key="damping_ratio"),
        Column("MPC", collinearity, show=".3f", key="modal_phase_collinearity"),
        Column("whirl", turning, key="whirl", places=("file",)),
        Column("sense of whirl", senses, key="whirl_sense", places=("file",)),
        Column("", [_words(*mode) for mode in zip(found.damped_frequency, senses, strict=True)]),
    )
    n_rigid = found.rigid.shape[1]
    failed = f"not converged: largest residual {found.residual.max(initial=0.0):.1e}"
    return Answer(
        study,
        [
            f"{study.name}: {study.model.mesh.n_lines} elements, {n_rigid} rigid-body mode(s) apart",
            table,
            *([] if found.converged else [failed]),
            *notes_of_mesh(study),
            *assumptions(study),
        ],
        {
            "n_rigid": n_rigid,
            "modes": table.records(),
            "converged": found.converged,
            "largest_residual": float(np.max(found.residual, initial=0.0)),
        },
        {"whirl": NO_WHIRL},
    )


def _words(damped: float, sense: str) -> str:
    """Return the words behind a mode: overdamped, or the sense of its whirl."""
    return "   ".join(word for word in ("" if damped else "overdamped", sense) if word)
