"""``dovetail transient``: responses of the sensors in time."""

import argparse
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import finite, integer_up_to, motion_at, positive
from dovetail.commands.common import Options, assumptions, loaded, noted, without_rounding
from dovetail.commands.excitations import driven_by
from dovetail.commands.load_cases import require_sensors
from dovetail.commands.results import Results, write_motions
from dovetail.commands.speed import add_rpm, at_asked_speed
from dovetail.disk.output import OutputError, Progress
from dovetail.file.histories import HistoryColumns, read_columns
from dovetail.file.loads import InitialMotion, start_of
from dovetail.file.table import suggest
from dovetail.report.table import Column, Table, columns_of
from dovetail.study import Study
from fem.analysis.excitation import Excitation, interpolated
from fem.analysis.transient import METHODS, solve_transient
from fem.io.atomic import replacing
from fem.system import System, assemble
from updating.measurement.measurement import sensor_rows

EXAMPLE = "dovetail transient study.toml --excitation quake.csv --picture quake.png --out quake-out.csv"
QUANTITIES = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s²"}
RESULTS = Results(
    table="the responses",
    formats=(".csv", ".npz"),
    motions="displacements of the whole structure at some times",
    picture="the responses",
    read={"excitation": "the excitation"},
)
Start = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Displacements and velocities of all DOFs."""
MOST_STEPS = 2_000_000
"""Most steps in time: more is a slip in --step or --duration."""


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--excitation",
        type=Path,
        metavar="FILE",
        help="CSV with a column time [s] and others by name: an excitation of the study (its force [N]), a "
        "load case or combination (a factor of it), or 'base x' … 'base rz' (acceleration of the base)",
    )
    p.add_argument(
        "--release", metavar="CASE", help="begin at rest under this load case, which is taken away at once"
    )
    for option, unit, words in (
        ("displacement", "m, rad", "of a point, held there until then with the rest in equilibrium"),
        ("velocity", "m/s, rad/s", "of a point, or of a member or group as a rigid body"),
    ):
        p.add_argument(
            f"--{option}",
            type=motion_at,
            action="append",
            default=[],
            metavar="PLACE:DIRECTION=VALUE",
            help=f"initial {option} [{unit}] {words}, such as B:x=0.01; repeatable, adds to [[initial]]",
        )
    p.add_argument("--method", choices=METHODS, default="modal", help="default modal, which is exact")
    p.add_argument(
        "--alpha",
        type=finite,
        default=0.0,
        metavar="A",
        help="of newmark: -1/3 to 0, damps what a step cannot resolve (Hilber, Hughes and Taylor; default 0)",
    )
    p.add_argument("--step", type=positive, metavar="S", help="step in time (default: that of the file)")
    p.add_argument(
        "--duration", type=positive, metavar="S", help="time computed; beyond the file nothing acts"
    )
    p.add_argument("--number", type=integer_up_to(10_000), metavar="N", help="number of modes")
    p.add_argument(
        "--max",
        type=positive,
        metavar="HZ",
        help="modes up to this frequency (default: half the sampling rate)",
    )
    p.add_argument("--relative", action="store_true", help="responses relative to the base")
    add_rpm(p)
    p.add_argument(
        "--frames",
        type=integer_up_to(10_000),
        default=100,
        metavar="N",
        help="number of times, from the first to the last, whose displacements --vtu has (default 100)",
    )


def run(options: Options, progress: Progress) -> Answer:
    """Return responses in time and their peaks; draw and write them."""
    study = at_asked_speed(loaded(options, ("sensors",)), options)
    sensors = require_sensors(study)
    system = assemble(study.model, reciprocal=False)
    initial = _initial(study, system, options)
    excitation = _excitation(study, options, initial)
    n = excitation.time.size
    frames = np.unique(np.linspace(0, n - 1, min(options.frames, n)).round().astype(int))
    progress("stepping in time")
    found = solve_transient(
        system,
        excitation,
        sensor_rows(study.model, sensors),
        method=options.method,
        n_modes=options.number,
        max_frequency=options.max,
        alpha=options.alpha,
        initial=initial,
        relative=options.relative,
        snapshots=() if options.vtu is None else frames,
    )
    names = [s.name for s in sensors]
    if options.out is not None and options.out.suffix.lower() == ".npz":
        with replacing(options.out) as scratch, scratch.open("wb") as file:
            arrays = {q: getattr(found, q) for q in QUANTITIES}
            np.savez_compressed(file, time=found.time, outputs=np.array(names), **arrays)
    if options.vtu is not None:
        times = found.time[frames]
        motions = dict(zip((f"{t:.6g} s" for t in times), found.snapshots.T, strict=True))
        write_motions(options.vtu, study, motions, times=times)
    if options.picture is not None:
        from viz.responses import plot_histories
        from viz.style import save

        panels = [(f"{q} [{unit}]", getattr(found, q)) for q, unit in QUANTITIES.items()]
        save(plot_histories(found.time, panels, names, study.name), options.picture)
    peaks = {q: found.peak(q) for q in QUANTITIES}
    largest = [Column("sensor", names)]
    for q, unit in QUANTITIES.items():
        sizes = without_rounding(peaks[q][0])
        largest += [Column(q, sizes, unit), Column("at", np.where(sizes > 0, peaks[q][1], np.nan), "s")]
    every = [columns_of((f"{n} {q}" for n in names), getattr(found, q), u) for q, u in QUANTITIES.items()]
    return Answer(
        study,
        [
            f"{study.name}: {found.method}, {found.n_modes} modes, {found.time.size} times up to "
            f"{found.time[-1]:g} s; largest sizes",
            Table("largest responses", largest),
            *noted(found.notes),
            *assumptions(study),
        ],
        {
            "method": found.method,
            "n_modes": found.n_modes,
            "relative": found.relative,
            "time_s": found.time,
            "responses": {
                name: {q: getattr(found, q)[:, i] for q in QUANTITIES} for i, name in enumerate(names)
            },
            "peaks": {
                name: {q: {"size": peaks[q][0][i], "time_s": peaks[q][1][i]} for q in QUANTITIES}
                for i, name in enumerate(names)
            },
            "notes": found.notes,
        },
        full=Table("responses", [Column("time", found.time, "s"), *chain(*every)]),
    )


def _initial(study: Study, system: System, options: Options) -> Start | None:
    """Return the displacements and velocities at the first sample, None where the structure is at rest."""
    mesh = study.model.mesh
    asked = []
    for key in ("displacement", "velocity"):
        for place, direction, value in getattr(options, key):
            fields: dict[str, Any] = {key: {direction: value}}
            if place in mesh.point_names:
                fields["point"] = mesh.point_names[place]
            elif key == "velocity" and (place in mesh.members or place in mesh.groups):
                fields["members"] = mesh.groups.get(place, (place,))
            else:
                known = [*mesh.point_names, *([*mesh.members, *mesh.groups] if key == "velocity" else [])]
                msg = f"--{key}: there is no place '{place}'; {suggest(place, known)}"
                raise OutputError(msg)
            asked.append(InitialMotion(**fields))
    motions = (*study.loads.initial, *asked)
    start = start_of(system, motions)
    if options.release is None:
        return start
    if any(each.displacement for each in motions):
        msg = f"--release {options.release} and an initial displacement are given; give one of them"
        raise OutputError(msg)
    at_release = study.static(options.release).displacements[:, 0]
    return at_release, np.zeros_like(at_release) if start is None else start[1]


def _excitation(study: Study, options: Options, initial: Start | None) -> Excitation:
    """Return the excitation of the file on the steps asked for, or none for an initial motion alone."""
    if options.excitation is None:
        if initial is None:
            msg = "nothing acts: give --excitation FILE, --release CASE, --displacement or --velocity"
            raise OutputError(msg)
        if options.step is None or options.duration is None:
            msg = "a response without --excitation needs --step and --duration"
            raise OutputError(msg)
        table = HistoryColumns("", "time", np.array([0.0, options.duration]), (), np.zeros((2, 0)))
    else:
        table = read_columns(options.excitation, ("time",))
    driven = driven_by(study, table)
    time, values = table.x, driven.values
    step = options.step or float(time[-1] - time[0]) / (time.size - 1)
    duration = options.duration or float(time[-1] - time[0])
    if duration / step > MOST_STEPS:
        msg = f"{duration:g} s in steps of {step:g} s are {duration / step:.3g} steps; at most {MOST_STEPS}"
        raise OutputError(msg)
    if step > duration:
        msg = (
            f"a step of {step:g} s is longer than the {duration:g} s that are computed; give a smaller --step"
        )
        raise OutputError(msg)
    if options.step is not None:
        time, values = interpolated(time, values, step)
    if options.duration is not None:
        n = round(duration / step) + 1
        more = max(0, n - time.size)
        time = np.concatenate([time, time[-1] + step * np.arange(1, more + 1)])[:n]
        values = np.vstack([values, np.zeros((more, values.shape[1]))])[:n]
    base = {d: values[:, k] for d, k in driven.base.items()}
    return Excitation.of(study.model, time, driven.loads, values[:, list(driven.of_loads)], base)
