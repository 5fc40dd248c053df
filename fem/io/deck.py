"""Text decks of solvers: files that include others, within bounds, and numbers as Fortran writes them."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fem.io.faults import error_at
from fem.mesh import MeshError

MOST_GENERATED = 1_000_000
"""Nodes and elements that generators and copies of a part may add together: a deck of a few lines must not
ask for more than the largest meshes that are written out."""

LARGEST_INTEGER = 10**12
"""So that a million steps of it still are an integer of the machine."""

DEEPEST_INCLUDE = 50
MOST_FILES = 1000
MOST_READ_AGAIN = 100_000_000
"""Characters of files that are included more than once."""

MOST_NAMED = 20
"""Names that one sentence lists."""


@dataclass(frozen=True, slots=True)
class DeckFile:
    """An opened file: its name in messages, its path, and the names of the files that lead to it."""

    name: str
    path: Path
    chain: tuple[Path, ...]
    text: str


@dataclass(slots=True)
class DeckBudget:
    """Number of items that may still be generated."""

    remaining: int = MOST_GENERATED

    def take(self, count: int, place: str, what: str) -> None:
        """Count the nodes or elements that a line generates."""
        self.remaining -= count
        if self.remaining < 0:
            msg = (
                f"{place}: {what} would make {count} more nodes or elements; generators and copies of parts "
                f"make at most {MOST_GENERATED} in one deck, so check the numbers"
            )
            raise MeshError(msg)


@dataclass(slots=True)
class Files:
    """Open the files of a deck, and refuse those that include themselves or that have no end.

    Attributes
    ----------
    main : path, the deck
    """

    main: Path
    opened: Counter[Path] = field(default_factory=Counter)
    read_again: int = 0

    def first(self) -> DeckFile:
        """Return the deck itself."""
        return self._open(self.main, (), self.main.name)

    def include(self, name: str, parent: DeckFile, line: int) -> DeckFile:
        """Return a file that another names: in the folder of that one, or in that of the deck."""
        place = f"{parent.name}: line {line}"
        if not name:
            raise error_at(place, "it includes a file without a name")
        chain = (*parent.chain, parent.path)
        found = next((path for path in self._candidates(name, parent) if _is_file(path)), None)
        if found is None:
            raise error_at(
                place,
                f"the included file {_short(name)} cannot be read: the folder of {parent.name} has none",
            )
        resolved = found.resolve()
        if resolved in [path.resolve() for path in chain]:
            loop = " → ".join(path.name for path in (*chain, found))
            msg = f"{place}: the file {found.name} includes itself ({loop}); delete one of the include lines"
            raise MeshError(msg)
        if len(chain) > DEEPEST_INCLUDE:
            raise error_at(place, f"included files are nested more than {DEEPEST_INCLUDE} levels deep")
        return self._open(found, chain, found.name, place)

    def _candidates(self, name: str, parent: DeckFile) -> list[Path]:
        names = [name] if "\\" not in name else [name, name.replace("\\", "/")]
        return [folder / n for n in names for folder in (parent.path.parent, self.main.parent)]

    def _open(self, path: Path, chain: tuple[Path, ...], name: str, place: str = "") -> DeckFile:
        where = f"{place}: the included file {path.name}" if place else path.name
        try:
            text = path.read_text(encoding="utf-8-sig", errors="replace")
        except (OSError, ValueError) as reason:
            msg = f"{where} cannot be read ({getattr(reason, 'strerror', None) or reason})"
            raise MeshError(msg) from reason
        key = path.resolve()
        self.opened[key] += 1
        self.read_again += len(text) if self.opened[key] > 1 else 0
        if self.opened.total() > MOST_FILES or self.read_again > MOST_READ_AGAIN:
            msg = (
                f"{where} exceeds a limit: a deck may include at most {MOST_FILES} files, and repeat at most "
                f"{MOST_READ_AGAIN} characters of files that it includes more than once"
            )
            raise MeshError(msg)
        return DeckFile(name, path, chain, text)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _short(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:57]}…"


def integer(text: str) -> int:
    """Return a whole number.

    Raises
    ------
    ValueError
        If the text is something else.
    """
    text = text.strip()
    if len(text) > 20 or "_" in text or not text.isascii():
        raise ValueError(_unlike(text, "a whole number"))
    try:
        value = int(text)
    except ValueError as reason:
        raise ValueError(_unlike(text, "a whole number")) from reason
    if abs(value) > LARGEST_INTEGER:
        raise ValueError(_unlike(text, f"a number up to {LARGEST_INTEGER}"))
    return value


def _unlike(text: str, what: str) -> str:
    hint = "; parameters are not evaluated, so write their values" if text.startswith("<") else ""
    return f"'{_short(text)}' is not {what}{hint}"


def real(text: str) -> float:
    """Return a finite number, with ``D`` for ``E`` allowed; nothing is zero.

    Raises
    ------
    ValueError
        If the text is something else, or too large.
    """
    text = text.strip()
    if not text:
        return 0.0
    if "_" in text or not text.isascii():
        raise ValueError(_unlike(text, "a number"))
    try:
        value = float(text.upper().replace("D", "E"))
    except ValueError as reason:
        raise ValueError(_unlike(text, "a number")) from reason
    if not abs(value) < float("inf"):
        raise ValueError(_unlike(text, "a finite number"))
    return value


def named(names: Sequence[str]) -> str:
    """Join names for a sentence, at most :data:`MOST_NAMED` of them."""
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


def counted(found: Mapping[str, Sequence[object]], at: str = "") -> str:
    """Return names with their counts and the first of their places, for a sentence."""
    return named(
        [
            f"{name} ({len(places)}, first at {at}{places[0]})"
            if len(places) > 1
            else f"{name} ({at}{places[0]})"
            for name, places in found.items()
        ]
    )


def words(text: str) -> frozenset[str]:
    """Return the words of a table."""
    return frozenset(text.split())
