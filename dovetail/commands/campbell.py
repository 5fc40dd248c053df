"""``dovetail campbell``: modes of a rotor over its speed, and critical speeds."""

import argparse
from typing import Any

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_number, positive
from dovetail.commands.common import Options, assumptions, loaded, notes_of_mesh
from dovetail.commands.results import Results, write_motions
from dovetail.commands.speed import NO_WHIRL, add_speeds
from dovetail.disk.output import Progress
from dovetail.file.rotation import RPM
from dovetail.report.table import Column, Table, columns_of
from fem.analysis.campbell import Campbell, solve_campbell
from fem.analysis.complex_modes import whirl_name

EXAMPLE = "dovetail campbell study.toml --speeds 0:6000:61 --order 1 --order 2 --picture campbell.png"
RESULTS = Results(
    table="frequencies and damping",
    motions="the shapes at the critical speeds",
    picture="the Campbell diagram",
)

_AWAY = "the branch is not among the computed modes there, or does not oscillate"
NULLS = {
    "damped_frequency_Hz": _AWAY,
    "damping_ratio": _AWAY,
    "whirl": f"{NO_WHIRL}, or {_AWAY}",
    "likeness_to_next": f"{_AWAY}, or at the next speed",
}
"""Why numbers are missing."""


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    add_speeds(p)
    add_number(p, "number of modes: those that are among the N slowest at some speed", 200, 8)
    p.add_argument(
        "--order",
        type=positive,
        action="append",
        default=[],
        metavar="K",
        help="an excitation at K times the speed; repeatable (default 1, unbalance)",
    )


def run(options: Options, progress: Progress) -> Answer:
    """Return critical speeds and modes over speed; draw and write them."""
    study = loaded(options, ())
    first, last, number = options.speeds
    rpm = np.linspace(first, last, number)
    orders = tuple(dict.fromkeys(options.order)) or (1.0,)
    found = solve_campbell(
        study.model,
        rpm * RPM,
        options.number,
        orders,
        lambda k, n: progress("solving for modes over speed", k, n),
    )
    if options.vtu is not None:
        names = (
            f"critical speed {k + 1}: {c.speed / RPM:.6g} rpm, {c.order:g}X"
            for k, c in enumerate(found.critical)
        )
        write_motions(options.vtu, study, dict(zip(names, found.critical_shapes.T, strict=True)))
    if options.picture is not None:
        from viz.rotors import plot_campbell
        from viz.style import save

        save(plot_campbell(found, orders, f"{study.name}: Campbell diagram"), options.picture)
    critical = _critical(found)
    title = f"{study.name}: {study.model.mesh.n_lines} elements, {number} speeds from {first:g} to {last:g}"
    return Answer(
        study,
        [
            f"{title} turns a minute",
            critical if found.critical else "no order meets a natural frequency within these speeds",
            "",
            "damped natural frequencies [Hz] (F forward, B backward, P in a plane; others tilt no rotor)",
            _damped(rpm, found),
            *_unstable(rpm, found),
            *([] if found.converged else ["not all modes have converged"]),
            *notes_of_mesh(study),
            *assumptions(study),
        ],
        {
            "speed_rpm": rpm,
            "orders": orders,
            "branches": [_branch(found, k) for k in range(found.n_branches)],
            "critical_speeds": critical.records(),
            "converged": found.converged,
        },
        NULLS,
        _every(rpm, found),
    )


def _branch(found: Campbell, k: int) -> dict[str, Any]:
    """Return a branch for JSON."""
    return {
        "whirl_sense": whirl_name(found.turning(k)),
        "damped_frequency_Hz": found.frequency[:, k],
        "damping_ratio": found.zeta[:, k],
        "whirl": found.whirl[:, k],
        "likeness_to_next": found.likeness[:, k],
    }


def _critical(found: Campbell) -> Table:
    """Return the critical speeds."""
    each = found.critical
    return Table.of(
        "critical speeds",
        Column("critical", [c.speed / RPM for c in each], "1/min", ".2f", key="speed_rpm"),
        Column("order", [c.order for c in each], show=lambda order: f"{order:g}X", key="order"),
        Column("branch", [c.branch + 1 for c in each], key="branch"),
        Column("frequency", [c.pole.imag / (2 * np.pi) for c in each], "Hz", ".4f", key="frequency_Hz"),
        Column("damping", [c.zeta for c in each], "%", _percent, 100, key="damping_ratio"),
        Column("whirl", [c.whirl for c in each], key="whirl", places=()),
        Column("whirl", [whirl_name(c.whirl) or "no tilt" for c in each]),
        Column("", [whirl_name(c.whirl) for c in each], key="whirl_sense", places=()),
    )


def _percent(zeta: float) -> str:
    """Return a damping ratio in percent, rounding as 0."""
    return f"{round(zeta, 9) + 0.0:.4f}"


def _damped(rpm: np.ndarray, found: Campbell) -> Table:
    """Return damped frequencies over speed, at some of the speeds."""
    # Most speeds that are printed; --json and --out have all
    chosen = np.unique(np.linspace(0, rpm.size - 1, min(rpm.size, 11)).round().astype(int))
    senses = [whirl_name(found.turning(k)) for k in range(found.n_branches)]
    head = [f"{k + 1} {sense[:1].upper()}".strip() for k, sense in enumerate(senses)]
    every = [Column("", rpm, "1/min", ".1f"), *columns_of(head, found.frequency, show=".3f")]
    return Table("modes over speed", every).rows(chosen)


def _every(rpm: np.ndarray, found: Campbell) -> Table:
    """Return frequencies, damping ratios and whirl of all branches over speed."""
    quantities = (
        ("frequency", "Hz", found.frequency),
        ("damping ratio", "-", found.zeta),
        ("whirl", "-", found.whirl),
    )
    return Table.of(
        "modes over speed",
        Column("speed", rpm, "1/min"),
        *(
            Column(f"{name} {k + 1}", values[:, k], unit)
            for k in range(found.n_branches)
            for name, unit, values in quantities
        ),
    )


def _unstable(rpm: np.ndarray, found: Campbell) -> list[str]:
    """Return the lowest of the speeds at which a mode grows, if one does."""
    at = np.flatnonzero(found.unstable)
    return [f"unstable: a mode grows at {rpm[at[0]]:g} 1/min"] if at.size else []
