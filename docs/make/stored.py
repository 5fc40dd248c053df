"""Results of commands and examples, stored in `.docs-cache`: a build repeats only what can have changed.

A result is stored by a hash of all that it depends on: command or script, files, packages, and versions.
"""

import ast
import hashlib
import os
import zipfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import metadata
from io import BytesIO
from pathlib import Path
from platform import machine, python_version
from threading import get_ident

ROOT = Path(__file__).parents[2]
CACHE = ROOT / ".docs-cache"
PACKAGES = ("dovetail", "viz", "joint", "updating", "fem")
"""In the order of the import contracts: each imports only those after it."""

TEXT = "text"
FILES = "files/"


@dataclass(frozen=True, slots=True)
class Result:
    """A text, and the files that were written with it, by their names relative to a folder."""

    text: str
    files: Mapping[str, bytes] = field(default_factory=dict)

    def write_files(self, folder: Path) -> None:
        """Write the files into a folder."""
        for name, content in self.files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)


@dataclass(frozen=True, slots=True)
class Store:
    """A folder of results, each in a file; without a folder everything is computed.

    ``used`` has the names of the files that this build has read or written.
    """

    folder: Path | None = None
    fresh: bool = False
    used: set[str] = field(default_factory=set)

    def result(self, key: Iterable[str], compute: Callable[[], Result]) -> Result:
        """Return the result that is stored by a key, or compute it and store it."""
        if self.folder is None:
            return compute()
        path = self.folder / digest(*key)
        self.used.add(path.name)
        found = None if self.fresh else _read(path)
        if found is None:
            found = compute()
            _write(path, found)
        return found

    def remove_unused(self) -> None:
        """Remove the results that this build has not used."""
        for path in self.folder.iterdir() if self.folder and self.folder.exists() else ():
            if path.name not in self.used:
                path.unlink()


NO_STORE = Store()


def _read(path: Path) -> Result | None:
    """Return a stored result; None if there is none, or if its file is not as it was written."""
    try:
        hashed, content = path.read_bytes().split(b"\n", 1)
    except (OSError, ValueError):
        return None
    if hashed != _hash(content):  # the ZIP format has no check sum of names
        return None
    with zipfile.ZipFile(BytesIO(content)) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    text = files.pop(TEXT).decode()
    return Result(text, {name.removeprefix(FILES): data for name, data in files.items()})


def _write(path: Path, result: Result) -> None:
    """Store a result; a build that is stopped meanwhile leaves no half file by this name."""
    archived = BytesIO()
    with zipfile.ZipFile(archived, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(TEXT, result.text)
        for name, data in result.files.items():
            archive.writestr(FILES + name, data)
    content = archived.getvalue()
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(f".{os.getpid()}-{get_ident()}")
    part.write_bytes(_hash(content) + b"\n" + content)
    part.replace(path)


def _hash(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()


def digest(*parts: str) -> str:
    """Return a hash of texts and of their borders."""
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]


def contents(folder: Path) -> dict[str, str]:
    """Return a hash of each file below a folder, by its name; byte code does not count."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and "__pycache__" not in path.parts
    }


@cache
def program(first: str = PACKAGES[0], *, book: bool = False) -> str:
    """Return a hash of a package, of all that it may import, and of the code in docs/make."""
    folders = [*PACKAGES[PACKAGES.index(first) :], "docs/make", *(["benchmarks/book"] if book else [])]
    return digest(environment(), *(f"{name} {contents(ROOT / name)}" for name in folders))


@cache
def environment() -> str:
    """Return the versions of Python and of all distributions: optional ones change results too."""
    versions = sorted({f"{d.name} {d.version}" for d in metadata.distributions()})
    return " ".join([python_version(), machine(), *versions])


def first_package(code: str) -> str:
    """Return the first of `PACKAGES` that a script imports; those before it cannot change its output."""
    names = set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.split(".")[0])
    return next((package for package in PACKAGES if package in names), PACKAGES[-1])
