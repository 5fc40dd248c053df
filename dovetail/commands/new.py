"""``dovetail new``: a study to start from."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dovetail.commands.answer import Answer
from dovetail.commands.argument_types import add_placing
from dovetail.commands.common import Options, assumptions, noted, warn
from dovetail.disk.output import OutputError, Progress, is_ours, result_folder

if TYPE_CHECKING:
    from dovetail.file.named_points import NamedPoints

EXAMPLE = "dovetail new my-frame --from measurements.uff mesh.msh"

_MESHES = (".msh", ".vtu", ".vtk", ".xdmf", ".med")
"""Suffixes of files that are a mesh where two are given; universal files may be either."""


def add_arguments(p: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser."""
    p.add_argument(
        "folder", type=Path, nargs="?", metavar="DIR", help="folder to make (with --from: default study)"
    )
    p.add_argument("--force", action="store_true", help="write into a folder that holds other files")
    p.add_argument(
        "--from",
        dest="test",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="make the study of a Nastran, Abaqus or ANSYS deck or a mesh, with the FRFs and geometry of a "
        "test (.uff) if given; sensors are put on members",
    )
    p.add_argument(
        "--units",
        default="SI",
        help="of a deck, such as mm-t-s, or length,mass,time in m, kg and s; of a mesh, such as mm (default "
        "SI)",
    )
    p.add_argument(
        "--geometry",
        type=Path,
        metavar="FILE",
        help="points of the test, where the file of FRFs has none: a universal file, or a table (CSV) of "
        "name, x [mm], y [mm], z [mm]",
    )
    p.add_argument(
        "--kind", choices=["receptance", "mobility", "accelerance"], help="of FRFs whose file does not say it"
    )
    add_placing(p, "mesh")


def run(options: Options, progress: Progress) -> Answer:
    """Write a study to start from: one of a test and a mesh, or a template with FRFs for it."""
    if options.test is not None:
        return _from_test(options, progress)
    from dovetail.file.template import write_template

    if options.folder is None:
        msg = "give the folder to make, such as: dovetail new my-frame"
        raise OutputError(msg)
    _refuse_existing(options, options.folder, ("study.toml", "frf.npz"))
    progress("computing its measurement")
    with result_folder(options.folder, options.force) as scratch:
        write_template(scratch)
    (options.folder / ".dovetail").unlink(missing_ok=True)  # from now on it is the user's
    return Answer(
        None,
        [
            f"{options.folder / 'study.toml'} is written: a portal frame, to be changed into yours.",
            f"{options.folder / 'frf.npz'} is a simulated measurement, with noise and with an effect "
            "that the study lacks.",
            "Next:",
            f"  dovetail modes {options.folder / 'study.toml'}",
        ],
    )


def _refuse_existing(options: Options, folder: Path, names: tuple[str, ...]) -> None:
    """Refuse to write over files that are there, with --force, too."""
    if not options.force and is_ours(folder):
        return
    for name in names:
        if (folder / name).exists():
            msg = f"{folder / name} exists and would be overwritten; choose another folder, or move the file"
            raise OutputError(msg)


def _from_test(options: Options, progress: Progress) -> Answer:
    """Write a study of a deck or a mesh, and of a test with tables of sensors and excitations."""
    from dovetail.file.from_deck import MESH, read_structure, study_text
    from dovetail.file.from_test import EXCITATIONS, SENSORS, STUDY, Draft, Placing, draft_study
    from dovetail.study import load_study

    folder = options.folder or Path("study")
    measured, mesh = _files_of(options.test)
    _refuse_existing(options, folder, (STUDY, MESH, SENSORS, EXCITATIONS))
    progress("reading")
    structure = read_structure(
        mesh,
        folder,
        units=_units(options.units),
        mesh_will_do=measured is not None,
    )
    if measured is None:
        draft = Draft({STUDY: study_text(structure, mesh.name), **structure.files}, structure.notes)
    else:
        draft = draft_study(
            mesh.stem,
            measured,
            structure,
            folder,
            kind=options.kind,
            points=_geometry(options),
            placing=Placing(options.tolerance, options.unit, options.same_axes, options.alternative),
        )
    with result_folder(folder, options.force) as scratch:
        for name, text in draft.files.items():
            (scratch / name).write_text(text, encoding="utf-8")
    (folder / ".dovetail").unlink(missing_ok=True)  # from now on it is the user's
    assumed: list[str] = []
    try:
        assumed = assumptions(load_study(folder / STUDY, () if measured is None else ("sensors",)))
    except ValueError as reason:
        warn([f"the study needs a change before it can be used: {reason}"])
    others = [name for name in draft.files if name != STUDY]
    with_others = f", with {' and '.join(others)}" if others else ""
    change = "" if structure.complete else "Material, sections, supports and damping are placeholders. "
    return Answer(
        None,
        [
            f"{folder / STUDY} is written{with_others}.",
            *noted(draft.notes),
            *([*assumed, ""] if assumed else []),
            f"{change}Next:",
            f"  dovetail check {folder / STUDY}",
        ],
    )


def _files_of(given: Sequence[Path]) -> tuple[Path | None, Path]:
    """Return the FRFs, None without any, and the mesh or deck, in whatever order they are given."""
    if len(given) == 1:
        return None, given[0]
    if len(given) > 2:
        msg = f"--from takes a deck or a mesh, and FRFs if there are some; found {len(given)} files"
        raise OutputError(msg)
    one, other = given
    if _is_structure(one) and not _is_structure(other):
        one, other = other, one
    return one, other


def _is_structure(file: Path) -> bool:
    """Whether a file is a mesh or a deck; .dat is a deck by its text only, as FRFs may end so, too."""
    from fem.io.programs import program_by_text, program_of

    if file.suffix.lower() in _MESHES or program_by_text(file) is not None:
        return True
    return file.suffix.lower() != ".dat" and program_of(file) is not None


def _units(text: str) -> str | tuple[float, ...]:
    """Return the name of units, or their three sizes."""
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        return text


def _geometry(options: Options) -> "NamedPoints | None":
    """Return the geometry of the test where it has a file of its own."""
    from dovetail.file.named_points import read_named_points, unit_of

    if options.geometry is None:
        return None
    points = read_named_points(options.geometry)
    unit_of(points, options.unit, options.geometry)
    return points
