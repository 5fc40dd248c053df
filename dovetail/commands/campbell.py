"""``dovetail campbell``: modes of a rotor over its speed, and critical speeds."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.commands.argument_types import positive, whole_up_to
from dovetail.commands.common import Options, assumptions, loaded, notes_of_mesh, say
from dovetail.commands.results import Results, write_motions
from dovetail.commands.speed import NO_WHIRL, add_speeds
from dovetail.disk.output import Progress, write_json
from dovetail.file.rotation import RPM
from fem.analysis.campbell import Campbell, CriticalSpeed, solve_campbell
from fem.analysis.whirl import whirl_name
from fem.io.atomic import replacing

HELP = "compute natural frequencies and damping of a rotor over its speed, and critical speeds"
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

_PRINTED = 11
"""Most speeds that are printed; --json and --out have all."""


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    add_speeds(p)
    p.add_argument(
        "--number",
        type=whole_up_to(200),
        default=8,
        metavar="N",
        help="number of modes: those that are among the N slowest at some speed (default 8)",
    )
    p.add_argument(
        "--order",
        type=positive,
        action="append",
        default=[],
        metavar="K",
        help="an excitation at K times the speed; repeatable (default 1, unbalance)",
    )
    RESULTS.add_arguments(p)


def run(options: Options, progress: Progress) -> None:
    """Print critical speeds and modes over speed; draw and write them."""
    RESULTS.check(options)
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
    if options.out is not None:
        _write_table(options.out, rpm, found)
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
    progress.close()
    write_json(
        options.json,
        {
            "study": study.name,
            "speed_rpm": rpm,
            "orders": orders,
            "branches": [_branch(found, k) for k in range(found.n_branches)],
            "critical_speeds": [_critical(c) for c in found.critical],
            "converged": found.converged,
            "assumptions": study.assumptions,
            "warnings": study.warnings,
        },
        NULLS,
    )
    say(
        options,
        f"{study.name}: {study.model.mesh.n_lines} elements, {number} speeds from {first:g} to {last:g} "
        "turns a minute",
        *_critical_lines(found),
        *_table(rpm, found),
        *_unstable(rpm, found),
        *([] if found.converged else ["not all modes have converged"]),
        *notes_of_mesh(study),
        *assumptions(study),
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


def _critical(c: CriticalSpeed) -> dict[str, Any]:
    """Return a critical speed for JSON."""
    return {
        "speed_rpm": c.speed / RPM,
        "order": c.order,
        "branch": c.branch + 1,
        "frequency_Hz": c.pole.imag / (2 * np.pi),
        "damping_ratio": c.zeta,
        "whirl": c.whirl,
        "whirl_sense": whirl_name(c.whirl),
    }


def _critical_lines(found: Campbell) -> list[str]:
    """Return the table of critical speeds."""
    if not found.critical:
        return ["no order meets a natural frequency within these speeds"]
    rows = [
        f"{c.speed / RPM:12.2f}  {c.order:5g}X  {c.branch + 1:6d}  {c.pole.imag / (2 * np.pi):12.4f}"
        f"  {_percent(c.zeta):9.4f}   {whirl_name(c.whirl) or 'no tilt'}"
        for c in found.critical
    ]
    return ["critical 1/min   order  branch  frequency Hz  damping %   whirl", *rows]


def _percent(zeta: float) -> float:
    """Return a damping ratio in percent, rounding as 0."""
    return round(100 * zeta, 9) + 0.0


def _table(rpm: np.ndarray, found: Campbell) -> list[str]:
    """Return damped frequencies over speed, at some of the speeds."""
    chosen = np.unique(np.linspace(0, rpm.size - 1, min(rpm.size, _PRINTED)).round().astype(int))
    senses = [whirl_name(found.turning(k)) for k in range(found.n_branches)]
    head = [f"{k + 1} {sense[:1].upper()}".strip() for k, sense in enumerate(senses)]
    rows = [
        f"{rpm[i]:12.1f}"
        + "".join(f"{f:11.3f}" if np.isfinite(f) else f"{'-':>11}" for f in found.frequency[i])
        for i in chosen
    ]
    return [
        "",
        "damped natural frequencies [Hz] (F forward, B backward, P in a plane; others tilt no rotor)",
        f"{'1/min':>12}" + "".join(f"{name:>11}" for name in head),
        *rows,
    ]


def _unstable(rpm: np.ndarray, found: Campbell) -> list[str]:
    """Return the lowest of the speeds at which a mode grows, if one does."""
    grows = np.nan_to_num(found.zeta) < -1e-9  # below it is rounding
    at = np.flatnonzero(grows.any(axis=1))
    return [f"unstable: a mode grows at {rpm[at[0]]:g} 1/min"] if at.size else []


def _write_table(path: Path, rpm: np.ndarray, found: Campbell) -> None:
    """Write frequencies and damping ratios of all branches over speed."""
    names = [f"{what} {k + 1} [{unit}]" for k in range(found.n_branches) for what, unit in _COLUMNS]
    each = np.stack([found.frequency, found.zeta, found.whirl], axis=2).reshape(rpm.size, -1)
    with replacing(path) as scratch:
        np.savetxt(
            scratch,
            np.column_stack([rpm, each]),
            fmt="%.9g",
            delimiter=",",
            header=",".join(["speed [1/min]", *names]),
            comments="",
            encoding="utf-8",
        )


_COLUMNS = (("frequency", "Hz"), ("damping ratio", "-"), ("whirl", "-"))
