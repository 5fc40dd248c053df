"""``dovetail spectrum``: largest responses to a motion of the base given by its response spectrum."""

import argparse
from pathlib import Path

import numpy as np

from dovetail.commands.argument_types import number_up_to, positive, whole_up_to
from dovetail.commands.common import Options, assumptions, loaded, say, without_rounding
from dovetail.commands.excitations import BASE
from dovetail.commands.results import Results, write_motions
from dovetail.disk.output import Progress, write_json
from dovetail.file.histories import Columns, read_columns
from dovetail.file.paths import InputFile
from dovetail.file.rotation import RPM
from dovetail.file.table import StudyError, suggest
from dovetail.study import Study
from fem.analysis.response_spectrum import COMBINATIONS, SpectrumResponse, solve_spectrum
from fem.analysis.section_forces import SECTION_FORCES
from fem.analysis.shock_spectrum import shock_response_spectrum
from fem.analysis.tabulated import Tabulated
from fem.effects.spin import Spin
from fem.model import DIRECTIONS
from fem.system import assemble
from updating.measurement.measurement import motions_of, sensor_rows

HELP = "combine the largest responses of modes to a response spectrum of the base"
FREQUENCY, PERIOD, TIME = "frequency", "period", "time"
PER_OCTAVE = 24
"""Oscillators of a shock response spectrum in each octave, from a hundredth of a turn in the record's time to
half its sampling rate. Below, only the final velocity of the base counts, above, its largest acceleration."""
EXAMPLE = "dovetail spectrum study.toml --spectrum design.csv --max 60 --json spectrum.json"
RESULTS = Results(
    motions="the largest displacements and section forces, and the peak of each mode",
    picture="the spectrum with the modes",
)


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--spectrum",
        type=Path,
        required=True,
        metavar="FILE",
        help="CSV with frequency [Hz] or period [s] and columns x, y, z, rx, ry, rz: pseudo-acceleration of "
        "the base [m/s²] for the modes' damping; at period 0 that of the base itself. With time [s] as the "
        "first column it is a record of the base's acceleration, whose shock response spectrum is taken",
    )
    p.add_argument(
        "--zeta",
        type=number_up_to(0.99),
        default=0.05,
        metavar="RATIO",
        help="damping ratio of a record's shock response spectrum (default 0.05)",
    )
    p.add_argument(
        "--combine", choices=COMBINATIONS, default="cqc", help="how peaks of modes are combined (default cqc)"
    )
    p.add_argument("--number", type=whole_up_to(10_000), metavar="N", help="number of modes (default 20)")
    p.add_argument("--max", type=positive, metavar="HZ", help="all modes up to this frequency instead")
    p.add_argument(
        "--no-missing-mass", action="store_true", help="leave out the inertia that the modes do not have"
    )
    RESULTS.add_arguments(p)


def run(options: Options, progress: Progress) -> None:
    """Print combined responses."""
    RESULTS.check(options, InputFile(options.spectrum, "the spectrum"))
    study = loaded(options, ())
    refuse_rotors(study)
    table = read_columns(options.spectrum, (FREQUENCY, PERIOD, TIME))
    spectra, rigid = _spectra(table, options.zeta)
    sensors = motions_of(study.sensors)
    progress("combining modes")
    found = solve_spectrum(
        assemble(study.model),
        spectra,
        sensor_rows(study.model, sensors),
        n_modes=options.number,
        max_frequency=options.max,
        combination=options.combine,
        missing_mass=not options.no_missing_mass,
        rigid_acceleration=rigid,
    )
    if options.vtu is not None:
        _write_peaks(options.vtu, study, found)
    if options.picture is not None:
        from viz.responses import plot_spectra
        from viz.style import save

        save(plot_spectra(spectra, found.modes.frequency, study.name), options.picture)
    progress.close()
    share = found.effective_mass / np.where(found.total_mass > 0, found.total_mass, np.inf)
    mesh = study.model.mesh
    members = {m: abs(found.line_forces[rows]).max(axis=(0, 1)) for m, rows in mesh.members.items()}
    reactions: dict[str, dict[str, float]] = {}
    for (name, direction), value in found.reactions.items():
        reactions.setdefault(name, {})[direction] = value
    write_json(
        options.json,
        {
            "study": study.name,
            "combination": found.combination,
            "missing_mass": found.missing_mass,
            "directions": found.directions,
            "spectra": {
                k: {"frequency_Hz": s.frequency, "pseudo_acceleration": s.values} for k, s in spectra.items()
            },
            "modes": [
                {
                    "frequency_Hz": f,
                    "damping_ratio": z,
                    "spectrum": dict(zip(found.directions, sa, strict=True)),
                    "effective_mass_share": dict(zip(found.directions, mass, strict=True)),
                }
                for f, z, sa, mass in zip(
                    found.modes.frequency, found.zeta, found.acceleration_of_modes, share, strict=True
                )
            ],
            "base_force": dict(zip(found.directions, found.base_force, strict=True)),
            "reactions": reactions,
            "members": {m: dict(zip(SECTION_FORCES, own, strict=True)) for m, own in members.items()},
            "sensors": {
                s.name: {"displacement": u, "acceleration": a}
                for s, u, a in zip(sensors, found.displacement, found.acceleration, strict=True)
            },
            "assumptions": study.assumptions,
            "warnings": study.warnings,
        },
    )
    say(options, *_lines(study, found, share, reactions, members), *assumptions(study))


def _write_peaks(path: Path, study: Study, found: SpectrumResponse) -> None:
    """Write the largest displacements and section forces, and the peak of each mode in each direction."""
    motions = {"largest": found.motion}
    factors = np.sqrt(found.effective_mass) * found.acceleration_of_modes / found.modes.omega[:, None] ** 2
    for k, (f, own) in enumerate(zip(found.modes.frequency, factors, strict=True)):
        for direction, factor in zip(found.directions, own, strict=True):
            name = f"mode {k + 1}: {f:.6g} Hz, {direction}"
            motions[name] = factor * np.real(found.modes.shapes[:, k])
    forces = np.abs(found.line_forces).max(axis=1)
    lines = {f"largest {q}": forces[:, i] for i, q in enumerate(SECTION_FORCES)}
    write_motions(path, study, motions, lines=lines)


def refuse_rotors(study: Study) -> None:
    """Raise a StudyError for a rotor that turns: peaks of real modes cannot be combined."""
    turning = study.model.of_kind(Spin)
    if turning:
        rpm = turning[0].speed / RPM
        msg = (
            f"{study.path.name}: its rotor turns at {rpm:g} 1/min. A response spectrum combines the peaks of "
            "modes that keep their shape, and those of a turning rotor whirl; give an accelerogram to "
            "dovetail transient, or leave out [rotation]"
        )
        raise StudyError(msg)


def _spectra(table: Columns, zeta: float) -> tuple[dict[str, Tabulated], dict[str, float]]:
    """Return the spectra of a table by direction, and the accelerations at period 0.

    Those of a record are its shock response spectra for a damping ratio.
    """
    table = table.named([*DIRECTIONS, *(BASE + d for d in DIRECTIONS)])
    names = [name.lower().removeprefix(BASE) for name in table.names]
    for name in names:
        if name not in DIRECTIONS:
            msg = f"{table.file}: '{name}' is no direction of the base; {suggest(name, DIRECTIONS)}"
            raise StudyError(msg)
    units = ["rad/s^2" if name.startswith("r") else "m/s^2" for name in names]
    x, rigid = table.x, {}
    values = np.column_stack([table.in_si(k, unit) for k, unit in enumerate(units)])
    if table.abscissa == TIME:
        rigid = dict(zip(names, np.abs(values).max(axis=0).tolist(), strict=True))
        x, values = _shock_spectra(x, values, zeta)
    if table.abscissa == PERIOD:
        if x[0] == 0:
            rigid, x, values = dict(zip(names, values[0].tolist(), strict=True)), x[1:], values[1:]
        x, values = 1 / x[::-1], values[::-1]
    return {name: Tabulated.of(x, column) for name, column in zip(names, values.T, strict=True)}, rigid


def _shock_spectra(time: np.ndarray, acceleration: np.ndarray, zeta: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies, and the pseudo-accelerations of each column (n_freq, n) there."""
    span, n = float(time[-1] - time[0]), len(time) - 1
    f = np.geomspace(0.01 / span, 0.5 * n / span, int(np.ceil(PER_OCTAVE * np.log2(50 * n))) + 1)
    each = [shock_response_spectrum(time, a, f, zeta, response="pseudo_velocity") for a in acceleration.T]
    return f, 2 * np.pi * f[:, None] * np.stack(each, axis=1)


def _lines(
    study: Study,
    found: SpectrumResponse,
    share: np.ndarray,
    reactions: dict[str, dict[str, float]],
    members: dict[str, np.ndarray],
) -> list[str]:
    """Return what is printed."""
    d, sensors = found.directions, motions_of(study.sensors)
    head = "".join(f"{f'S {k} m/s²':>12}{f'mass {k} %':>10}" for k in d)
    width = max([len(m) for m in (*members, *reactions, *(s.name for s in sensors))] + [8])
    out = [
        f"{study.name}: {found.combination.upper()} of {found.modes.n_modes} modes"
        f"{', missing mass added' if found.missing_mass else ''}",
        f" mode  frequency Hz{head}",
    ]
    for k, f in enumerate(found.modes.frequency):
        cells = "".join(
            f"{sa:12.5g}{100 * m:10.3f}"
            for sa, m in zip(found.acceleration_of_modes[k], share[k], strict=True)
        )
        out.append(f"{k + 1:5d}  {f:12.4f}{cells}")
    sums = ", ".join(f"{k} {100 * m:.2f} %" for k, m in zip(d, share.sum(axis=0), strict=True))
    forces = ", ".join(f"{k} {force:.5g}" for k, force in zip(d, found.base_force, strict=True))
    out += [f"effective mass of these modes: {sums}", f"force of the base [N, N·m]: {forces}"]
    out += ["", f"{'support':{width}} " + "".join(f"{k:>12}" for k in DIRECTIONS) + "   N, N·m"]
    held = iter(without_rounding([value for row in reactions.values() for value in row.values()]))
    for name, row in ((name, {k: next(held) for k in own}) for name, own in reactions.items()):
        cells = "".join(f"{row[k]:12.5g}" if k in row else f"{'-':>12}" for k in DIRECTIONS)
        out.append(f"{name:{width}} {cells}")
    out += ["", f"{'member':{width}} " + "".join(f"{q:>12}" for q in SECTION_FORCES) + "   N, N·m, largest"]
    forces = without_rounding(list(members.values()))
    out += [
        f"{m:{width}} " + "".join(f"{v:12.5g}" for v in own) for m, own in zip(members, forces, strict=True)
    ]
    if sensors:
        out += ["", f"{'sensor':{width}} {'relative m':>12}{'m/s²':>12}"]
        moved, accelerated = without_rounding(found.displacement), without_rounding(found.acceleration)
        for s, u, a in zip(sensors, moved, accelerated, strict=True):
            out.append(f"{s.name:{width}} {u:12.5g}{a:12.5g}")
    return out
