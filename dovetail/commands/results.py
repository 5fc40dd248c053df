"""Files that commands read and write if asked to: tables, pictures, and motions of the structure."""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from numpy.typing import ArrayLike

from dovetail.commands.common import Options, check_places
from dovetail.disk.output import Output, OutputError
from dovetail.file.paths import InputFile
from dovetail.study import Study
from fem.elements.frame import Frame
from fem.io import write_fields
from viz.offscreen import require_drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOTION_FORMATS = (".vtu", ".vtk", ".xdmf")


class Written(NamedTuple):
    """A file that an option writes: contents in words, suffixes that it may have, whether it is needed."""

    option: str
    contents: str
    formats: tuple[str, ...] = (".png",)
    required: bool = False


@dataclass(frozen=True, slots=True)
class Results:
    """The files that a command reads besides the study, and writes besides those of JSON and Excel.

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
        Contents of the folder of ``--picture`` where there are several, and the name of the first file in it.
    more : tuple of Written
        Other files.
    read : mapping of str to str
        Inputs: options' names, whose values are a file or several, and what these files are.
    rendered : bool
        Whether the picture is of the structure, which needs OpenGL.
    """

    table: str = ""
    formats: tuple[str, ...] = (".csv",)
    motions: str = ""
    picture: str = ""
    pictures: tuple[str, str] = ("", "")
    more: tuple[Written, ...] = ()
    read: Mapping[str, str] = field(default_factory=dict)
    rendered: bool = False

    def files(self) -> tuple[Written, ...]:
        """Return the files that can be asked for."""
        known = (
            Written("--out", f"also write {self.table}" * bool(self.table), self.formats),
            Written("--vtu", f"also write {self.motions} for ParaView" * bool(self.motions), MOTION_FORMATS),
            *self.more,
            Written("--picture", f"also draw {self.picture}" * bool(self.picture)),
        )
        return tuple(w for w in known if w.contents)

    def add_arguments(self, p: argparse.ArgumentParser) -> None:
        """Add the options of these files to a command's parser."""
        for name, contents, formats, required in self.files():
            words = f"{contents}: {_listed(formats)}"
            if name == "--picture":
                command = p.prog.split()[-1]
                read, words = _in_folder(f"{command}.png"), f"{words}; into a folder as {command}.png"
                p.add_argument(name, type=read, metavar="FILE|DIR", help=words, required=required)
            else:
                p.add_argument(name, type=Path, metavar="FILE", help=words, required=required)
        if self.pictures[0]:
            words = f"also draw {self.pictures[0]} as PNG into this folder"
            p.add_argument("--picture", type=Path, metavar="DIR", help=words)
            p.add_argument("--force", action="store_true", help="write into a folder that holds other files")

    def check(self, options: Options) -> None:
        """Refuse files that cannot be written, before anything is computed.

        Raises
        ------
        OutputError
            For a suffix that is not allowed, and as :func:`dovetail.disk.output.check_outputs`.
        """
        outputs = []
        for option, _, formats, _ in self.files():
            path = getattr(options, option.removeprefix("--"))
            if path is not None and path.suffix.lower() not in formats:
                msg = f"{option} {path} is written as {_listed(formats)}, not '{path.suffix}'"
                raise OutputError(msg)
            outputs.append(Output(option, path))
        folder = options.picture if self.pictures[0] else None
        if folder is not None and folder.suffix.lower() in (".png", ".jpg", ".svg", ".pdf"):
            msg = f"--picture {folder}: there are several, and a folder is needed, such as {folder.stem}"
            raise OutputError(msg)
        if self.pictures[0]:
            outputs.append(Output("--picture", folder, self.pictures[1:]))
        check_places(options, *outputs, more=tuple(self._inputs(options)))
        if folder is not None or (self.rendered and options.picture is not None):
            require_drawing("--picture")

    def _inputs(self, options: Options) -> Iterator[InputFile]:
        for name, what in self.read.items():
            given = getattr(options, name)
            for path in given if isinstance(given, list) else [given] * (given is not None):
                yield InputFile(path, what)


def _in_folder(name: str) -> Callable[[str], Path]:
    """Return a reader of a file's path, which has a name in a folder: one that exists, or without suffix."""
    return lambda text: Path(text) / name if Path(text).is_dir() or not Path(text).suffix else Path(text)


def save_picture(options: Options, draw: Callable[[], "Figure"]) -> None:
    """Write the figure that a command draws, if its picture is asked for."""
    if options.picture is not None:
        from viz.style import save

        save(draw(), options.picture)


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
