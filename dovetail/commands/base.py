"""``dovetail base``: FRFs from a motion of the base to the sensors."""

import argparse
from pathlib import Path

import numpy as np

from dovetail.commands.common import Options, assumptions, check_places, loaded, say
from dovetail.commands.frf import add_lines, asked_lines
from dovetail.commands.load_cases import check_png, require_sensors
from dovetail.commands.speed import add_rpm, at_asked_speed
from dovetail.disk.output import Output, OutputError, Progress, write_json
from fem.analysis.base_excitation import Motion, compute_base_frf
from fem.analysis.frf import FRF
from fem.io import write_csv, write_npz
from fem.system import assemble
from updating.measurement.measurement import sensor_rows

HELP = "compute FRFs from a motion of the base to the sensors"
EXAMPLE = "dovetail base study.toml --motion z --out transmissibility.npz --picture base.png"
KINDS = {"displacement": "receptance", "velocity": "mobility", "acceleration": "accelerance"}


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--motion",
        action="append",
        default=[],
        metavar="DIRECTION",
        help="x y z rx ry rz of all supports together, or SUPPORT:DIRECTION of one alone (default: z); "
        "repeatable",
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
        "--about", type=float, nargs=3, metavar="M", help="point about which the base turns (default: 0 0 0)"
    )
    p.add_argument("--out", type=Path, metavar="FILE", help="also write the FRFs: .npz or .csv")
    p.add_argument("--picture", type=Path, metavar="FILE", help="also draw the first four FRFs as .png")
    add_rpm(p)
    add_lines(p)


def run(options: Options, progress: Progress) -> None:
    """Compute FRFs from the base and write them."""
    writers = {".npz": write_npz, ".csv": write_csv}
    if options.out is not None and options.out.suffix.lower() not in writers:
        msg = f"{options.out}: FRFs of the base are written as .npz or .csv, not '{options.out.suffix}'"
        raise OutputError(msg)
    check_png(options.picture)
    check_places(options, Output("--out", options.out), Output("--picture", options.picture))
    study = at_asked_speed(loaded(options, ("sensors",)), options)
    require_sensors(study)
    frequency = asked_lines(study, options, len(study.sensors) * max(1, len(options.motion)))
    progress("computing FRFs")
    found = compute_base_frf(
        assemble(study.model, reciprocal=False),
        frequency,
        sensor_rows(study.model, study.sensors),
        [_motion(text) for text in options.motion or ["z"]],
        relative=options.relative,
        about=options.about,
        kind=KINDS[options.response],
    )
    names = tuple(s.name for s in study.sensors)
    found = FRF.from_arrays(frequency, found.H, found.kind, names, found.inputs)
    if options.out is not None:
        writers[options.out.suffix.lower()](options.out, found)
    if options.picture is not None:
        from viz.responses import plot_transmissibility
        from viz.style import save

        save(plot_transmissibility(found, options.response, relative=options.relative), options.picture)
    progress.close()
    peaks = [
        (output, motion, *_peak(found, i, j))
        for j, motion in enumerate(found.inputs)
        for i, output in enumerate(found.outputs)
    ]
    write_json(
        options.json,
        {
            "study": study.name,
            "file": None if options.out is None else str(options.out),
            "response": options.response,
            "relative": options.relative,
            "motions": found.inputs,
            "sensors": found.outputs,
            "frequency_Hz": found.frequency,
            "real": np.real(found.H),
            "imaginary": np.imag(found.H),
            "assumptions": study.assumptions,
            "warnings": study.warnings,
        },
    )
    width = max(len(p[0]) for p in peaks)
    say(
        options,
        f"{study.name}: {options.response} of {len(names)} sensor(s) for a displacement of the base, "
        f"{found.n_freq} lines from {frequency[0]:g} to {frequency[-1]:g} Hz",
        f"{'sensor':{width}}  {'base':12}  {'largest':>12}  at Hz",
        *(f"{o:{width}}  {m:12}  {value:12.5g}  {f:.6g}" for o, m, value, f in peaks),
        *assumptions(study),
    )


def _motion(text: str) -> Motion:
    """Return a direction of the whole base, or a support and its direction."""
    name, colon, direction = text.rpartition(":")
    return (name, direction) if colon else text


def _peak(frf: FRF, i: int, j: int) -> tuple[float, float]:
    """Return the largest amplitude of an FRF and its frequency [Hz]."""
    size = np.abs(frf.H[:, i, j])
    k = int(size.argmax())
    return float(size[k]), float(frf.frequency[k])
