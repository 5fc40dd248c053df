"""The files that a study names: which they are, and their names when its text moves to another folder."""

import os
import re
import stat
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dovetail.file.table import StudyError
from dovetail.file.toml import with_values
from fem.io.matrix_names import matrix_files
from fem.io.programs import ABAQUS, NASTRAN, program_of
from fem.matrices import MatricesError

FILES: dict[tuple[str, ...], str] = {
    ("source", "file"): "the source deck",
    ("mesh", "file"): "the mesh",
    ("measurements", "file"): "a measurement",
    ("measurements", "repeats"): "a repeated measurement",
    ("measurements", "coherence"): "the coherence of a measurement",
    ("measurements", "compared"): "the choice of compared values",
    ("superelements", "file"): "the matrices of a part",
    ("superelements", "deck"): "the places of a part's nodes",
    ("superelements", "node_sets"): "the node sets of a part",
    ("superelements", "mesh"): "the mesh of a part",
    ("damping", "file"): "the modes that give the damping",
    ("form", "file"): "what was learned of the form",
    ("modes", "file"): "the measured modes",
    ("ambient", "file"): "the record of an ambient test",
    ("baseline", "file"): "the modes of the baseline",
    ("states", "file"): "the modes of a state",
    ("sections",): "the table of sections",
    ("sections", "file"): "the table of sections",
    ("baseline", "measurements", "file"): "a measurement of the baseline",
    ("baseline", "measurements", "repeats"): "a repeated measurement of the baseline",
    ("baseline", "measurements", "coherence"): "the coherence of the baseline",
    ("baseline", "measurements", "compared"): "the choice of compared values of the baseline",
    ("sensors",): "the table of sensors",
    ("sensors", "file"): "the table of sensors",
    ("excitations",): "the table of excitations",
    ("excitations", "file"): "the table of excitations",
}
"""Keys of a study that name files, without the numbers of tables, and the files' roles."""

CONDENSED = ".condensed.npz"
"""End of the names of files with condensed parts, which follow from others."""

_INCLUDES = (
    re.compile(
        r"^\*(?:INCLUDE|NODE|ELEMENT)\b[^\n]*?\bINPUT\s*=\s*(?:\"([^\"\n]+)\"|([^,\s]+))", re.I | re.M
    ),
    re.compile(r"^\s*INCLUDE\s*'([^']+)'()", re.I | re.M),
)
"""How Abaqus and Nastran name further files."""


@dataclass(frozen=True, slots=True)
class InputFile:
    """A file that a command reads, and its role, such as "the mesh of the study"."""

    path: Path
    what: str


def refuse_device(path: Path) -> None:
    """Refuse a device, such as ``/dev/zero``: it may have no end. Pipes and files pass.

    Raises
    ------
    StudyError
        If it is one.
    """
    with suppress(OSError):  # the reader says what cannot be opened
        mode = path.stat().st_mode
        if stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
            msg = f"{path}: it is a device, which may have no end; a file is needed"
            raise StudyError(msg)


def named_files(values: Any) -> Iterator[tuple[tuple[str | int, ...], tuple[str, ...], str]]:
    """Yield place, kind of key and name of each file in the values of a study."""

    def walk(value: Any, place: tuple[str | int, ...], keys: tuple[str, ...]) -> Any:
        if keys in FILES and isinstance(value, str):
            yield place, keys, value
        elif keys in FILES and isinstance(value, list) and all(isinstance(item, str) for item in value):
            for i, item in enumerate(value):
                yield (*place, i), keys, item
        elif isinstance(value, dict) and len(keys) < 3:
            for key, inner in value.items():
                yield from walk(inner, (*place, key), (*keys, key))
        elif isinstance(value, list) and len(keys) in (1, 2):
            for i, inner in enumerate(value):
                yield from walk(inner, (*place, i), keys)

    yield from walk(values, (), ())


def with_paths(text: str, old: Path, new: Path) -> str:
    """Return a study's text as a file in another folder: names of other files lead from there."""
    if old.resolve() == new.resolve():
        return text
    changes: dict[tuple[str | int, ...], Any] = {}
    for place, keys, name in named_files(tomllib.loads(text)):
        if keys[-2:] == ("measurements", "repeats") and not isinstance(place[-1], int):
            changes[place] = [_moved(word, old, new) for word in name.replace(",", " ").split()]
        else:
            changes[place] = _moved(name, old, new)
    return with_values(text, changes)


def _moved(name: str, old: Path, new: Path) -> str:
    """Return the name of a file from another folder; absolute where no way leads there (Windows drives)."""
    if os.path.isabs(name):
        return name
    # Of real folders: ".." of a link leads elsewhere than its name says.
    real = (old / name).parent.resolve() / Path(name).name
    try:
        return Path(os.path.relpath(real, new.resolve())).as_posix()
    except ValueError:
        return real.as_posix()


def input_files(study: Path) -> tuple[InputFile, ...]:
    """Return a study file and all files that it names, as far as they are there and its text can be read.

    Meshes' includes and the other files of matrices count, too. Nothing is refused: reading the study does.
    """
    out = [InputFile(study, "the study itself")]
    values: Any = {}
    refuse_device(study)
    with suppress(OSError, ValueError, RecursionError):
        values = tomllib.loads(study.read_text(encoding="utf-8"))
    for place, keys, name in named_files(values):
        words = (
            name.replace(",", " ").split() if keys[-1] == "repeats" and isinstance(place[-1], str) else [name]
        )
        for word in words:
            path, what = study.parent / word, f"{FILES[keys]} of {study.name}"
            out.append(InputFile(path, what))
            if keys == ("superelements", "file"):
                with suppress(OSError, MatricesError):
                    base, files = matrix_files(path)
                    stems = (f"{path.stem}.", f"{base}.", *(f"{file.stem}." for file in files.values()))
                    siblings = [p for p in path.parent.iterdir() if p.name.startswith(stems)]
                    out += [InputFile(p, what) for p in siblings if not p.name.endswith(CONDENSED)]
            elif keys == ("mesh", "file") or keys[0] == "superelements":
                out += [InputFile(p, f"included by {what}") for p in _included(path)]
    return tuple(out)


def _included(path: Path) -> list[Path]:
    """Return the files that a mesh file includes, directly or not."""
    found: list[Path] = []
    todo, seen = [path], {path.resolve()}
    while todo:
        one = todo.pop()
        if one == path and program_of(one) not in (ABAQUS, NASTRAN):
            break
        with suppress(OSError):
            text = one.read_text(encoding="utf-8", errors="replace")
            for pattern in _INCLUDES:
                for quoted, bare in pattern.findall(text):
                    # a long name may go on in the next line
                    name = "".join(part.strip() for part in (quoted or bare).splitlines())
                    for base in (one.parent, path.parent):
                        file = base / name
                        if file.is_file() and file.resolve() not in seen:
                            seen.add(file.resolve())
                            found.append(file)
                            todo.append(file)
    return found
