"""``dovetail base``: FRFs from a motion of the base to the sensors."""

import argparse

import numpy as np
from numpy.typing import ArrayLike

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import finite, positive
from dovetail.commands.common import Options, assumptions, loaded, without_rounding
from dovetail.commands.frf import add_lines, asked_lines, table_of_frf
from dovetail.commands.load_cases import require_sensors
from dovetail.commands.results import Results, write_motions
from dovetail.commands.speed import add_rpm, at_asked_speed
from dovetail.disk.output import Progress
from dovetail.report.table import Column, Table
from dovetail.study import Study
from fem.analysis.base_excitation import Motion, compute_base_frf
from fem.analysis.frf import FRF
from fem.analysis.selection import Selection
from fem.directions import directions_from
from fem.io import write_csv, write_npz
from fem.system import assemble
from updating.measurement.measurement import sensor_rows

EXAMPLE = "dovetail base study.toml --motion z --out transmissibility.npz --picture base.png"
KINDS = {"displacement": "receptance", "velocity": "mobility", "acceleration": "accelerance"}
WRITERS = {".npz": write_npz, ".csv": write_csv}
RESULTS = Results(
    table="the FRFs",
    formats=tuple(WRITERS),
    motions="displacements of the whole structure for 1 m or 1 rad of the base",
    picture="the FRFs",
)


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--motion",
        action="append",
        default=[],
        metavar="DIRECTION",
        help="x y z rx ry rz of all supports together, such as xyz, or SUPPORT:DIRECTION of one alone "
        "(default: z); repeatable",
    )
    p.add_argument(
        "--relative", action="store_true", help="responses relative to the slow motion of the base"
    )
    p.add_argument(
        "--response",
        choices=tuple(KINDS),
        default="displacement",
        help="response to a displacement of the base of 1 m or 1 rad (default displacement: the "
        "transmissibility, which is also acceleration for acceleration)",
    )
    p.add_argument(
        "--about", type=finite, nargs=3, metavar="M", help="point about which the base turns (default: 0 0 0)"
    )
    p.add_argument(
        "--at",
        type=positive,
        action="append",
        default=[],
        metavar="HZ",
        help="frequency of the displacements of --vtu (default: that of the largest response); repeatable",
    )
    add_rpm(p)
    add_lines(p)


def run(options: Options, progress: Progress) -> Answer:
    """Return FRFs from the base; draw and write them."""
    study = at_asked_speed(loaded(options, ("sensors",)), options)
    sensors = require_sensors(study)
    frequency = asked_lines(study, options, len(sensors) * max(1, len(options.motion)))
    progress("computing FRFs")
    kind = KINDS[options.response]
    found = _frf(options, study, frequency, sensor_rows(study.model, sensors), _motions(options), kind)
    names = tuple(s.name for s in sensors)
    if options.vtu is not None:
        _write_shapes(options, study, found)
    found = FRF.from_arrays(frequency, found.H, found.kind, names, found.inputs)
    if options.out is not None:
        WRITERS[options.out.suffix.lower()](options.out, found)
    if options.picture is not None:
        from viz.responses import plot_transmissibility
        from viz.style import save

        save(plot_transmissibility(found, options.response, relative=options.relative), options.picture)
    size, at = np.abs(found.H).max(axis=0), found.frequency[np.abs(found.H).argmax(axis=0)]
    peaks = np.array([without_rounding(column) for column in size.T])
    table = Table.of(
        "largest responses",
        Column("sensor", list(found.outputs) * len(found.inputs)),
        Column("base", np.repeat(found.inputs, len(found.outputs))),
        Column("largest", peaks.ravel()),
        Column("at", np.where(peaks > 0, at.T, np.nan).ravel(), "Hz", ".6g"),
    )
    return Answer(
        study,
        [
            f"{study.name}: {options.response} of {len(names)} sensor(s) for a displacement of the base, "
            f"{found.n_freq} lines from {frequency[0]:g} to {frequency[-1]:g} Hz",
            table,
            *assumptions(study),
        ],
        {
            "file": None if options.out is None else str(options.out),
            "response": options.response,
            "relative": options.relative,
            "motions": found.inputs,
            "sensors": found.outputs,
            "frequency_Hz": found.frequency,
            "real": np.real(found.H),
            "imaginary": np.imag(found.H),
        },
        {"file": "the FRFs are written to none (--out)"},
        sheets=[table_of_frf(found)],
    )


def _motions(options: Options) -> list[Motion]:
    """Return the motions asked for: directions of the whole base, or supports and their directions."""
    pairs = [text.rpartition(":") for text in options.motion or ["z"]]
    return [
        (name, direction) if colon else direction
        for name, colon, words in pairs
        for direction in directions_from(words, "--motion")
    ]


def _frf(
    options: Options,
    study: Study,
    frequency: ArrayLike,
    outputs: Selection,
    motions: list[Motion],
    kind: str = "receptance",
) -> FRF:
    """Return the FRFs from motions of the base, with the options of the command."""
    system = assemble(study.model, reciprocal=False)
    about = options.about
    return compute_base_frf(
        system, frequency, outputs, motions, relative=options.relative, about=about, kind=kind
    )


def _write_shapes(options: Options, study: Study, found: FRF) -> None:
    """Write displacements of all DOFs at the frequencies asked for, or where a sensor responds most."""
    every = range(study.model.n_dof)
    shapes: dict[str, ArrayLike] = {}
    for j, motion in enumerate(_motions(options)):
        largest = found.frequency[np.abs(found.H[:, :, j]).max(axis=1).argmax()]
        at = options.at or [float(largest)]
        full = _frf(options, study, at, every, [motion])
        names = (f"{found.inputs[j]}, {f:.6g} Hz" for f in at)
        shapes |= dict(zip(names, full.H[:, :, 0], strict=True))
    write_motions(options.vtu, study, shapes)
