"""Files of results that several commands write: tables, pictures, and motions of the structure."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from numpy.typing import ArrayLike

from dovetail.commands.common import Options, check_places
from dovetail.disk.output import Output, OutputError
from dovetail.file.paths import InputFile
from dovetail.study import Study
from fem.elements.frame import Frame
from fem.io import write_fields
from viz.offscreen import require_drawing

MOTION_FORMATS = (".vtu", ".vtk", ".xdmf")


@dataclass(frozen=True, slots=True)
class Results:
    """The files that a command writes if asked to, besides that of ``--json``.

    Attributes
    ----------
    table : str
        Contents of the file of ``--out``, in the plural; no such option if empty, as for the others.
    formats : tuple of str
        Suffixes that ``--out`` may have.
    motions : str
        Contents of the file of ``--vtu``.
    picture : str
        Contents of the picture of ``--picture``.
    pictures : tuple of (str, str)
        Contents of the folder of ``--pictures``, and the name of the first file in it.
    """

    table: str = ""
    formats: tuple[str, ...] = (".csv",)
    motions: str = ""
    picture: str = ""
    pictures: tuple[str, str] = ("", "")

    def add_arguments(self, p: argparse.ArgumentParser) -> None:
        """Add the options of these files to a command's parser."""
        if self.table:
            words = f"also write {self.table}: {_listed(self.formats)}"
            p.add_argument("--out", type=Path, metavar="FILE", help=words)
        if self.motions:
            words = f"also write {self.motions} for ParaView: {_listed(MOTION_FORMATS)}"
            p.add_argument("--vtu", type=Path, metavar="FILE", help=words)
        if self.picture:
            words = f"also draw {self.picture} as .png"
            p.add_argument("--picture", type=Path, metavar="FILE", help=words)
        if self.pictures[0]:
            words = f"also draw {self.pictures[0]} as PNG into this folder"
            p.add_argument("--pictures", type=Path, metavar="DIR", help=words)
            p.add_argument("--force", action="store_true", help="write into a folder that holds other files")

    def check(self, options: Options, *read: InputFile) -> None:
        """Refuse files that cannot be written, before anything is computed.

        Parameters
        ----------
        options : Options
        read : InputFile
            Inputs besides the study.

        Raises
        ------
        OutputError
            For a suffix that is not allowed, and as :func:`dovetail.disk.output.check_outputs`.
        """
        outputs = []
        for option, what, formats in (
            ("--out", self.table, self.formats),
            ("--vtu", self.motions, MOTION_FORMATS),
            ("--picture", self.picture, (".png",)),
        ):
            path = getattr(options, option.removeprefix("--")) if what else None
            if path is not None and path.suffix.lower() not in formats:
                msg = f"{option} {path} is written as {_listed(formats)}, not '{path.suffix}'"
                raise OutputError(msg)
            outputs.append(Output(option, path))
        folder = options.pictures if self.pictures[0] else None
        if folder is not None and folder.suffix.lower() in (".png", ".jpg", ".svg", ".pdf"):
            msg = f"--pictures {folder}: there are several, and a folder is needed, such as {folder.stem}"
            raise OutputError(msg)
        if self.pictures[0]:
            outputs.append(Output("--pictures", options.pictures, self.pictures[1:]))
        check_places(options, *outputs, more=read)
        if self.pictures[0] and options.pictures is not None:
            require_drawing("--pictures")


def write_motions(
    path: Path,
    study: Study,
    motions: Mapping[str, ArrayLike],
    *,
    lines: Mapping[str, ArrayLike] | None = None,
    times: ArrayLike | None = None,
) -> None:
    """Write motions of a study's structure, (n_dof,) each; see :func:`fem.io.write_fields`."""
    frame = study.model.of_kind(Frame)[0]
    write_fields(path, study.model.mesh, motions, lines=lines, frame=frame, times=times)


def _listed(words: Sequence[str]) -> str:
    """Return words as a list, the last behind 'or'."""
    *first, last = words
    return f"{', '.join(first)} or {last}" if first else last
