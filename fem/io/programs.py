"""Which program a deck is for: its text decides, and its suffix only where the text does not."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from fem.io.nastran_names import HARMLESS, NAMED, READ, REFUSED

NASTRAN, ABAQUS, ANSYS = "Nastran", "Abaqus", "ANSYS"

SUFFIXES: Final[Mapping[str, tuple[str, ...]]] = {
    NASTRAN: (".bdf", ".nas", ".dat", ".fem"),
    ABAQUS: (".inp",),
    ANSYS: (".cdb", ".mac"),
}
"""Usual suffixes of decks."""

_SIGNS = {NASTRAN: "BEGIN BULK, SOL or GRID", ABAQUS: "*NODE or *HEADING", ANSYS: "/PREP7, ET or NBLOCK"}
ALLOWED = "; ".join(f"{', '.join(s)} or a text with {_SIGNS[p]} ({p})" for p, s in SUFFIXES.items())
"""Names of the programs of decks, for messages."""


_SLASH = re.compile(r"/[A-Z]{2,}")
_STAR = re.compile(r"\*\s*([A-Z][A-Z ]*?)\s*(,|$)")
_PARAMETERS = re.compile(r"SET|IF|DO|GET|DIM|ASK|AFUN|CREATE|USE|MSG|CFOPEN|DEL|GO")
"""Star commands of ANSYS, none of which is a keyword of Abaqus."""
_CARDS = READ | HARMLESS | frozenset(REFUSED) | frozenset(NAMED)
_CARD = re.compile(r"([A-Z][A-Z0-9]*)\*?\s*[,\s]\s*[-+.\d]")
_CONTROL = re.compile(
    r"SOL[\s,]+\w+|CEND|BEGIN[\s,]+(BULK|SUPER)\b.*|ENDDATA|NASTRAN\s.*|ASSIGN\s.*|INCLUDE\s*['\"].*"
)
_COMMAND = re.compile(r"([A-Z]+)\s*,")


def program_of(path: Path) -> str | None:
    """Return the program of a deck: what its text says, else its suffix; None for other files."""
    return program_by_text(path) or next((p for p, s in SUFFIXES.items() if path.suffix.lower() in s), None)


def program_by_text(path: Path) -> str | None:
    """Return the program of a file as :func:`program_of_text` does; None if it cannot be read."""
    try:
        with path.open("rb") as file:
            # Bytes of a file in which a line that tells its program is looked for
            head = file.read(1_000_000)
    except (OSError, ValueError):
        return None
    return None if b"\x00" in head else program_of_text(head.decode("utf-8-sig", errors="replace"))


def program_of_text(text: str) -> str | None:
    """Return the program of the first line that only one of them has, None without such a line."""
    for line in text.splitlines():
        # Characters of a line that are looked at
        found = _program_of_line(line[:200].split("!")[0].strip().upper())
        if found is not None:
            return found
    return None


def _program_of_line(line: str) -> str | None:
    if _SLASH.match(line):
        return ANSYS
    star = _STAR.match(line)
    if star is not None:
        return ANSYS if _PARAMETERS.fullmatch(star[1]) else ABAQUS
    if _CONTROL.fullmatch(line):
        return NASTRAN
    card = _CARD.match(line)
    if card is not None and card[1] in _CARDS:
        return NASTRAN
    command = _COMMAND.match(line)
    return ANSYS if command is not None and _is_ansys(command[1]) else None


def _is_ansys(command: str) -> bool:
    from fem.io.ansys_deck import MODEL  # every start asks for the program; few see a line like a command
    from fem.io.ansys_script import key_of

    return key_of(command) in MODEL
