"""Errors of readers and writers."""

import errno
import os
from pathlib import Path
from typing import NoReturn, TypeVar

from fem.mesh import MeshError
from fem.summary import did_you_mean

E = TypeVar("E", bound=ValueError)


def error_at(place: object, words: str, error: type[E] = MeshError) -> E:
    """Return an error whose message is a place (a file, its line, a card) and what is wrong there."""
    return error(f"{place}: {words}")


def refuse(words: str, error: type[ValueError] = ValueError) -> NoReturn:
    """Raise an error; a ValueError gets its place from a caller."""
    raise error(words)


class MissingFileError(FileNotFoundError):
    """A file that does not exist; the message names it, its folder, and files there of like names."""

    def __str__(self) -> str:
        """Return the file and the reason."""
        return f"{self.filename}: {self.strerror}"


def existing(path: str | os.PathLike[str]) -> Path:
    """Return the path of a file.

    Raises
    ------
    MissingFileError
        If there is none.
    """
    if not (path := Path(path)).exists():
        raise MissingFileError(errno.ENOENT, f"no such file in {_searched(path)}", str(path))
    return path


def no_file(path: Path) -> str:
    """Return that there is no such file, the folder searched, and files there of like names."""
    escapes = "; a backslash in double quotes begins an escape: write / in place of it, or single quotes"
    hint = "" if path.name.isprintable() else escapes
    return f"there is no file {ascii(path.name) if hint else repr(path.name)} in {_searched(path)}{hint}"


def _searched(path: Path) -> str:
    folder = path.parent.absolute()
    if not folder.is_dir():
        return f"'{folder}', which is no folder"
    files = [p.name for p in folder.iterdir() if p.suffix == path.suffix or p.stem == path.stem]
    return "; ".join(filter(None, [f"'{folder}'", did_you_mean(path.name, files)]))
