"""``dovetail identify-modes``: natural modes in the measured FRFs, or in responses to unknown forces."""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from dovetail.commands.ambient_modes import identify_ambient_modes, std_of
from dovetail.commands.argument_types import number_up_to, positive
from dovetail.commands.common import (
    Options,
    check_places,
    loaded,
    say,
    write_with_nodes,
)
from dovetail.commands.labels import NodeNumbers
from dovetail.disk.output import Output, OutputError, Progress, write_json
from dovetail.file.config import NEEDS
from dovetail.update import identify_study
from fem.io import UFF_SUFFIXES, write_npz
from fem.io.atomic import replacing
from updating.measurement.measurement import motions_of
from updating.modal.peaks import peak_words

HELP = "identify natural modes from measured FRFs or ambient responses, with their uncertainty"
EXAMPLE = "dovetail identify-modes study.toml --picture stabilisation.png --out modes.uff"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument("--out", type=Path, metavar="FILE", help="also write the modes: .npz or .uff")
    p.add_argument("--picture", type=Path, metavar="FILE", help="also draw the stabilisation diagram")
    p.add_argument("--synthesis", type=Path, metavar="FILE", help="also draw synthesised over measured FRFs")
    p.add_argument(
        "--ambient", action="store_true",
        help="use the time data of [ambient] (default: if there are no [[measurements]])",
    )  # fmt: skip
    p.add_argument("--measurement", metavar="NAME", help="which measurement (default: the first)")
    p.add_argument(
        "--band",
        type=positive,
        nargs=2,
        metavar="HZ",
        help="lowest and highest frequency (default: [fit] band, of time data [ambient] band)",
    )
    p.add_argument(
        "--least-mpc",
        type=number_up_to(1),
        metavar="X",
        help="smallest modal phase collinearity of a mode, 0 to 1 (default: [identification] least_mpc, 0.3)",
    )
    p.add_argument(
        "--largest-mpd",
        type=number_up_to(90),
        metavar="DEG",
        help="largest mean phase deviation, 0 to 90 (default: [identification] largest_mpd, 45)",
    )


def run(options: Options, progress: Progress) -> None:
    """Print the modes in a study's FRFs with their uncertainty; draw and write them."""
    for path in (options.picture, options.synthesis):
        if path is not None and path.suffix.lower() != ".png":
            msg = f"{path}: the picture is written as .png"
            raise OutputError(msg)
    suffix = "" if options.out is None else options.out.suffix.lower()
    if suffix not in ("", ".npz", *UFF_SUFFIXES):
        msg = f"{options.out}: modes are written as .npz or .uff, not '{suffix}'"
        raise OutputError(msg)
    check_places(
        options, Output("--out", options.out), Output("--picture", options.picture),
        Output("--synthesis", options.synthesis),
    )  # fmt: skip
    study = loaded(options, ("sensors",) if options.ambient else NEEDS)
    if options.ambient or (study.ambient is not None and not study.measurements):
        identify_ambient_modes(options, study, progress)
        return
    progress("identifying modes")
    own = {"least_mpc": options.least_mpc, "largest_mpd": options.largest_mpd}
    limits = replace(study.shape_limits, **{key: value for key, value in own.items() if value is not None})
    found, data, said = identify_study(study, options.measurement, options.band, limits)
    if options.out is not None and suffix == ".npz":
        write_npz(options.out, found.modes, std_of(found))
    elif options.out is not None:
        nodes = NodeNumbers(study)
        moving = motions_of(data.sensors)  # dataset 55 would call strains displacements
        if not moving:
            msg = f"{options.out}: all sensors read strain, and universal files have motions; write .npz"
            raise OutputError(msg)
        names = dict(zip((s.name for s in moving), nodes.labels("outputs", moving), strict=True))
        rows = [k for k, s in enumerate(data.sensors) if s in moving]
        modes = replace(found.modes, shapes=found.modes.shapes[rows], labels=tuple(names))
        write_with_nodes(options.out, nodes, modes=modes, dofs=names)
    for path, kind in ((options.picture, "stabilisation"), (options.synthesis, "synthesis")):
        if path is not None:
            from viz.modal import plot_stabilisation, plot_synthesis
            from viz.style import save

            progress("drawing")
            draw = plot_stabilisation if kind == "stabilisation" else plot_synthesis
            with replacing(path) as scratch:
                save(draw(data.frf, found), scratch)
    progress.close()
    zeta = np.zeros(found.modes.n_modes) if found.modes.zeta is None else found.modes.zeta
    write_json(
        options.json,
        {
            "study": study.name,
            "measurement": data.name,
            "modes": [
                {
                    "frequency_Hz": f, "frequency_std_Hz": found.frequency_std[k],
                    "damping_ratio": zeta[k], "damping_ratio_std": found.zeta_std[k],
                    "mpc": found.mpc[k], "mpd_deg": found.mpd[k],
                    "shape": found.modes.shapes[:, k], "shape_std": found.shape_std[:, k],
                }
                for k, f in enumerate(found.modes.frequency)
            ],
            "outputs": data.frf.outputs,
            "scaled": found.scaled,
            "left_out": [
                {"frequency_Hz": c.frequency, "reason": c.reason} for c in found.candidates if not c.accepted
            ],
            "unexplained_peaks": [
                {"frequency_Hz": p.frequency, "level_dB": p.level_db, "share": p.share, "reason": p.reason}
                for p in found.unexplained
            ],
            "measured_notes": study.measured_notes,
            "warnings": (*said, *study.warnings),
        },
    )  # fmt: skip
    left = sum(not c.accepted for c in found.candidates)
    say(
        options,
        f"{study.name}: {found.modes.n_modes} mode(s) identified from {data.name}; {left} other "
        "pole(s) were tried and rejected",
        found.table(),
        *(f"warning: {text}" for text in said if text not in peak_words(found.unexplained)),
        *(f"note: {text}" for text in study.measured_notes),
    )
