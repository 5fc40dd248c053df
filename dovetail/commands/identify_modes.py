"""``dovetail identify-modes``: natural modes in the measured FRFs, or in responses to unknown forces."""

import argparse
from dataclasses import replace

from dovetail.commands.ambient_modes import identify_ambient_modes, std_of, table_of_modes
from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import number_up_to, positive
from dovetail.commands.common import Options, loaded, noted, write_with_nodes
from dovetail.commands.labels import NodeNumbers
from dovetail.commands.results import Results, Written
from dovetail.disk.output import OutputError, Progress
from dovetail.file.config import NEEDS
from dovetail.update import identify_study
from fem.io import UFF_SUFFIXES, write_npz
from updating.measurement.measurement import motions_of

EXAMPLE = "dovetail identify-modes study.toml --picture stabilisation.png --out modes.uff"

RESULTS = Results(
    table="the modes",
    formats=(".npz", *UFF_SUFFIXES),
    picture="the stabilisation diagram",
    more=(Written("--synthesis", "also draw synthesised over measured FRFs"),),
)


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "--ambient",
        action="store_true",
        help="use the time data of [ambient] (default: if there are no [[measurements]])",
    )
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


def run(options: Options, progress: Progress) -> Answer:
    """Return the modes in a study's FRFs with their uncertainty; draw and write them."""
    suffix = "" if options.out is None else options.out.suffix.lower()
    study = loaded(options, ("sensors",) if options.ambient else NEEDS)
    if options.ambient or (study.ambient is not None and not study.measurements):
        return identify_ambient_modes(options, study, progress)
    progress("identifying modes")
    asked = {"least_mpc": options.least_mpc, "largest_mpd": options.largest_mpd}
    limits = replace(study.shape_limits, **{key: value for key, value in asked.items() if value is not None})
    one = identify_study(study, options.measurement, options.band, limits)
    found, data, warnings, roving = one.found, one.measurement, one.warnings, one.is_roving
    if options.out is not None and suffix == ".npz":
        write_npz(options.out, found.modes, std_of(found))
    elif options.out is not None:
        nodes = NodeNumbers(study)
        moving = motions_of(data.sensors)  # dataset 55 would call strains displacements
        if not moving:
            msg = f"{options.out}: all sensors read strain, and universal files have motions; write .npz"
            raise OutputError(msg)
        names = dict(
            zip(
                (s.name for s in moving), nodes.labels("inputs" if roving else "outputs", moving), strict=True
            )
        )
        rows = [k for k, s in enumerate(data.sensors) if s in moving]
        modes = replace(found.modes, shapes=found.modes.shapes[rows], labels=tuple(names))
        write_with_nodes(options.out, nodes, modes=modes, dofs=names)
    for path, kind in ((options.picture, "stabilisation"), (options.synthesis, "synthesis")):
        if path is not None:
            from viz.modal import plot_stabilisation, plot_synthesis
            from viz.style import save

            progress("drawing")
            draw = plot_stabilisation if kind == "stabilisation" else plot_synthesis
            save(draw(data.frf, found), path)
    table = table_of_modes(found, mpc=found.mpc, mpd_deg=found.mpd)
    return Answer(
        study,
        [
            *one.printed(),
            *noted(study.measured_notes),
        ],
        {
            "measurement": data.name,
            "modes": table.records(),
            "outputs": data.frf.outputs,
            "scaled": found.scaled,
            "left_out": [
                {"frequency_Hz": c.frequency, "reason": c.reason} for c in found.candidates if not c.accepted
            ],
            "unexplained_peaks": [
                {"frequency_Hz": p.frequency, "level_dB": p.level_db, "share": p.share, "reason": p.reason}
                for p in found.unexplained
            ],
            "warnings": (*warnings, *study.warnings),
        },
        sheets=[table],
    )
