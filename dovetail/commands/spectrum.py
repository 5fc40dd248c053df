"""``dovetail spectrum``: largest responses to a motion of the base given by its response spectrum."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_number, number_up_to, positive
from dovetail.commands.common import Options, assumptions, loaded, without_rounding
from dovetail.commands.excitations import BASE
from dovetail.commands.load_cases import table_of_reactions
from dovetail.commands.results import Results, write_motions
from dovetail.disk.output import Progress
from dovetail.file.histories import HistoryColumns, read_columns
from dovetail.file.rotation import RPM
from dovetail.file.table import StudyError, suggest
from dovetail.report.table import Column, Table, columns_of
from dovetail.study import Study
from fem.analysis.response_spectrum import COMBINATIONS, SpectrumResponse, solve_spectrum
from fem.analysis.section_forces import SECTION_FORCES
from fem.analysis.shock_spectrum import pseudo_acceleration_spectrum
from fem.analysis.tabulated import Tabulated
from fem.effects.spin import Spin
from fem.model import DIRECTIONS
from fem.system import assemble
from updating.measurement.measurement import Sensor, motions_of, sensor_rows

FREQUENCY, PERIOD, TIME = "frequency", "period", "time"
EXAMPLE = "dovetail spectrum study.toml --spectrum design.csv --max 60 --json spectrum.json"
Forces = dict[str, dict[str, float]]
RESULTS = Results(
    motions="the largest displacements and section forces, and the peak of each mode",
    picture="the spectrum with the modes",
    read={"spectrum": "the spectrum"},
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
    add_number(p, "number of modes (default 20)", 10_000)
    p.add_argument("--max", type=positive, metavar="HZ", help="all modes up to this frequency instead")
    p.add_argument(
        "--no-missing-mass", action="store_true", help="leave out the inertia that the modes do not have"
    )


def run(options: Options, progress: Progress) -> Answer:
    """Return combined responses."""
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
    share = found.mass_share
    mesh = study.model.mesh
    members = {m: abs(found.line_forces[rows]).max(axis=(0, 1)) for m, rows in mesh.members.items()}
    reactions: Forces = {}
    for (name, direction), value in found.reactions.items():
        reactions.setdefault(name, {})[direction] = value
    table = Table.of(
        "modes",
        Column("mode", range(1, found.modes.n_modes + 1)),
        Column("frequency", found.modes.frequency, "Hz", ".4f"),
        *(
            column
            for j, k in enumerate(found.directions)
            for column in (
                Column(f"S {k}", found.acceleration_of_modes[:, j], "m/s²"),
                Column(f"mass {k}", share[:, j], "%", ".3f", 100),
            )
        ),
    )
    sums = ", ".join(f"{k} {100 * m:.2f} %" for k, m in zip(found.directions, share.sum(axis=0), strict=True))
    forces = ", ".join(f"{k} {f:.5g}" for k, f in zip(found.directions, found.base_force, strict=True))
    mass = ", missing mass added" * found.missing_mass
    return Answer(
        study,
        [
            f"{study.name}: {found.combination.upper()} of {found.modes.n_modes} modes{mass}",
            table,
            f"effective mass of these modes: {sums}",
            f"force of the base [N, N·m]: {forces}",
            "",
            table_of_reactions(_beyond_rounding(reactions), "support"),
            "",
            _largest_forces(members),
            *(["", _at_sensors(sensors, found)] if sensors else []),
            *assumptions(study),
        ],
        {
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
            "members": {m: dict(zip(SECTION_FORCES, peak, strict=True)) for m, peak in members.items()},
            "sensors": {
                s.name: {"displacement": u, "acceleration": a}
                for s, u, a in zip(sensors, found.displacement, found.acceleration, strict=True)
            },
        },
    )


def _beyond_rounding(reactions: Forces) -> Forces:
    """Return reactions with rounding errors, relative to the largest, as 0."""
    clean = iter(without_rounding([value for row in reactions.values() for value in row.values()]))
    return {name: {d: float(next(clean)) for d in row} for name, row in reactions.items()}


def _largest_forces(members: Mapping[str, np.ndarray]) -> Table:
    """Return the largest section forces of members."""
    forces = without_rounding(list(members.values()))
    unit = Column("N, N·m, largest", [""] * len(members), places=("text",))
    return Table.of("members", Column("member", list(members)), *columns_of(SECTION_FORCES, forces), unit)


def _at_sensors(sensors: Sequence[Sensor], found: SpectrumResponse) -> Table:
    """Return the largest displacements and accelerations of sensors."""
    return Table.of(
        "sensors",
        Column("sensor", [s.name for s in sensors]),
        Column("relative", without_rounding(found.displacement), "m"),
        Column("acceleration", without_rounding(found.acceleration), "m/s²"),
    )


def _write_peaks(path: Path, study: Study, found: SpectrumResponse) -> None:
    """Write the largest displacements and section forces, and the peak of each mode in each direction."""
    motions = {"largest": found.motion}
    for k, (f, peaks) in enumerate(zip(found.modes.frequency, found.mode_motions, strict=True)):
        for direction, motion in zip(found.directions, peaks, strict=True):
            motions[f"mode {k + 1}: {f:.6g} Hz, {direction}"] = motion
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


def _spectra(table: HistoryColumns, zeta: float) -> tuple[dict[str, Tabulated], dict[str, float]]:
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
        x, values = pseudo_acceleration_spectrum(x, values, zeta)
    if table.abscissa == PERIOD:
        if x[0] == 0:
            rigid, x, values = dict(zip(names, values[0].tolist(), strict=True)), x[1:], values[1:]
        x, values = 1 / x[::-1], values[::-1]
    return {name: Tabulated.of(x, column) for name, column in zip(names, values.T, strict=True)}, rigid
