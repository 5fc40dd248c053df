"""``dovetail new``: a study to start from."""

import argparse
from pathlib import Path

from dovetail.commands.argument_types import positive
from dovetail.commands.common import (
    Options,
    say,
    warn,
)
from dovetail.disk.output import OutputError, Progress, result_folder

HELP = "write a commented study to start from"
EXAMPLE = "dovetail new my-frame --from measurements.uff mesh.msh"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "folder", type=Path, nargs="?", metavar="DIR", help="folder to make (with --from: default study)"
    )
    p.add_argument("--force", action="store_true", help="write into a folder that holds other files")
    p.add_argument(
        "--from", dest="test", type=Path, nargs=2, metavar=("FRFS", "MESH"),
        help="make the study of a test's FRFs with geometry (.uff) and a mesh; sensors are put on members",
    )  # fmt: skip
    p.add_argument(
        "--geometry", type=Path, metavar="FILE", help="of the test: a universal file, where FRFS has none"
    )
    p.add_argument(
        "--kind", choices=["receptance", "mobility", "accelerance"], help="of FRFs whose file does not say it"
    )
    p.add_argument(
        "--mesh-scale",
        type=positive,
        default=1.0,
        metavar="S",
        help="metres in the mesh's unit, 0.001 for mm",
    )
    p.add_argument(
        "--tolerance", type=positive, default=0.01, metavar="M", help="largest distance [m] (default 0.01)"
    )
    p.add_argument("--unit", choices=["m", "mm", "cm", "in", "ft"], help="of the geometry (default: found)")
    p.add_argument("--same-axes", action="store_true", help="the geometry has the mesh's axes and origin")
    p.add_argument(
        "--alternative",
        type=int,
        metavar="K",
        help="which of several placements, as 'dovetail match' numbers them",
    )


def run(options: Options, progress: Progress) -> None:
    """Write a study to start from: one of a test and a mesh, or a template with FRFs for it."""
    if options.test is not None:
        _from_test(options, progress)
        return
    from dovetail.file.template import write_template

    if options.folder is None:
        msg = "give the folder to make, such as: dovetail new my-frame"
        raise OutputError(msg)
    _refuse_existing(options, options.folder, ("study.toml", "frf.npz"))
    progress("computing its measurement")
    with result_folder(options.folder, options.force) as scratch:
        write_template(scratch)
    (options.folder / ".dovetail").unlink(missing_ok=True)  # from now on it is the user's
    progress.close()
    say(
        options,
        f"{options.folder / 'study.toml'} is written: a portal frame, to be changed into yours.",
        f"{options.folder / 'frf.npz'} is a simulated measurement, with noise and with an effect "
        "that the study lacks.",
        "Next:",
        f"  dovetail modes {options.folder / 'study.toml'}",
    )


def _refuse_existing(options: Options, folder: Path, names: tuple[str, ...]) -> None:
    """Refuse to write over files that are there, with --force, too."""
    for name in names:
        if options.force and (folder / name).exists():
            msg = f"{folder / name} exists and would be overwritten; choose another folder"
            raise OutputError(msg)


def _from_test(options: Options, progress: Progress) -> None:
    """Write a study of a test and a mesh, with tables of sensors and excitations."""
    from dovetail.file.from_test import EXCITATIONS, SENSORS, STUDY, Placing, draft_study
    from dovetail.study import load_study
    from fem.io import read_uff

    folder = options.folder or Path("study")
    _refuse_existing(options, folder, (STUDY, SENSORS, EXCITATIONS))
    points = None
    if options.geometry is not None:
        points = read_uff(options.geometry).points
        if points is None:
            msg = f"{options.geometry}: it has no points (dataset 15 or 2411)"
            raise OutputError(msg)
    progress("matching")
    placing = Placing(options.tolerance, options.unit, options.same_axes, options.alternative)
    measured, mesh = options.test
    draft = draft_study(
        measured, mesh, folder, kind=options.kind, mesh_scale=options.mesh_scale, points=points,
        placing=placing,
    )  # fmt: skip
    with result_folder(folder, options.force) as scratch:
        for name, text in draft.files.items():
            (scratch / name).write_text(text, encoding="utf-8")
    (folder / ".dovetail").unlink(missing_ok=True)  # from now on it is the user's
    progress.close()
    try:
        load_study(folder / STUDY, ("sensors",))
    except ValueError as reason:
        warn([f"the study needs a change before it can be used: {reason}"])
    say(
        options,
        f"{folder / STUDY} is written, with {SENSORS} and {EXCITATIONS}.",
        *(f"note: {note}" for note in draft.notes),
        "Material, sections, supports and damping are placeholders. Next:",
        f"  dovetail check {folder / STUDY}",
    )
