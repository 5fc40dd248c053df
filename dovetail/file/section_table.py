"""Sections by name: those of a study, of a table in a text file (CSV), and rolled shapes of EN 10365.

The table is one's own, or the shapes database of AISC.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from dovetail.file import aisc
from dovetail.file.sensor_table import SensorRows, cells_of
from dovetail.file.table import StudyError, StudyTable
from fem.sections.section import OPTIONS, SHAPES, Section
from updating.measurement.matching import SCALES

ROLLED = Path(__file__).with_name("en10365.csv")
"""Nominal dimensions of IPE, HEA and HEB."""

POWERS = {
    **dict.fromkeys((key for group in (*SHAPES.values(), *OPTIONS.values()) for key in group), 1),
    "A": 2,
    **dict.fromkeys(("Iy", "Iz", "J"), 4),
    **dict.fromkeys(("n", "nu", "ky", "kz"), 0),
}
"""Columns of numbers, and the power of a length that each has."""

Reader = Callable[[StudyTable, str, float], Section]
"""Makes a section of a table, a name, and Poisson's ratio where the table has none."""

_UNIT = re.compile(r"[\[(]\s*([a-z]+)(?:\s*\^)?(?:\s*([234²³⁴]))?\s*[\])]\s*$")
_SUPERSCRIPTS = {"²": 2, "³": 3, "⁴": 4, "": 1}


@dataclass(frozen=True, slots=True)
class Sections(Mapping[str, StudyTable]):
    """Tables of sections by name; one is read when a member asks for it, for the material of that member.

    Attributes
    ----------
    given : mapping of str to StudyTable
        Those of the study's ``[sections.NAME]``.
    rows : mapping of str to StudyTable
        Those of its table.
    read : callable
        Makes a section of a table.
    """

    given: Mapping[str, StudyTable]
    rows: Mapping[str, StudyTable]
    read: Reader
    _known: dict[tuple[str, float], Section] = field(default_factory=dict)

    def section(self, name: str, nu: float) -> Section:
        """Return a section, with the shear coefficients for Poisson's ratio ``nu`` unless it states one."""
        if (name, nu) not in self._known:
            self._known[name, nu] = self.read(self[name], name, nu)
        return self._known[name, nu]

    def check_unused(self) -> None:
        """Read the study's sections that no member has, for their errors."""
        used = {name for name, _ in self._known}
        for name in self.given:
            if name not in used:
                self.section(name, 0.0)

    def __getitem__(self, name: str) -> StudyTable:
        """Return the table of a name, however it is spelt: of the study, else of the rolled shapes."""
        if name in self.given:
            return self.given[name]
        if name in self.rows:
            return self.rows[name]
        short = short_name(name)
        alike = [row for known, row in self.rows.items() if short_name(known) == short]
        return alike[0] if len(alike) == 1 else rolled()[short]

    def __contains__(self, name: object) -> bool:
        try:
            return bool(self[str(name)])
        except KeyError:
            return False

    def __iter__(self) -> Iterator[str]:
        yield from self.given
        yield from (name for name in self.rows if name not in self.given)

    def __len__(self) -> int:
        return len(list(iter(self)))


def section_rows(path: Path, notes: list[str]) -> dict[str, StudyTable]:
    """Return the rows of a table of sections by name.

    Raises
    ------
    StudyError
        For a table that cannot be read; the message names file, row and column.
    """
    (_, head), body = cells_of(path, "section")
    if aisc.is_database(head):
        head, body = aisc.sections_of(head, body)
    keys, scales = [], []
    for title in head:
        key, scale = _column(path.name, title)
        keys.append(key)
        scales.append(scale)
    unused = [title for title, key in zip(head, keys, strict=True) if not key and title]
    if unused:
        notes.append(f"{path.name}: the columns {', '.join(unused)} are not used")
    if "name" not in keys:
        msg = f"{path.name}: there is no column name; it has {', '.join(head)}"
        raise StudyError(msg)
    source = SensorRows(path.name, {}, {key: title for key, title in zip(keys, head, strict=True) if key})
    out: dict[str, StudyTable] = {}
    for row, cells in body:
        values: dict[str, Any] = {}
        for key, scale, cell in zip(keys, scales, cells, strict=True):
            if key and cell:
                values[key] = cell if scale is None else _number(source, row, key, cell, scale)
        name = values.pop("name", "")
        if not name or name in out:
            why = f"there is a section '{name}' already" if name else "it is empty"
            raise source.error((row, "name"), f"{why}; each row needs a name of its own")
        out[name] = StudyTable(source, (row,), values)
    return out


@cache
def rolled() -> Mapping[str, StudyTable]:
    """Return the rolled shapes by their short names."""
    return {short_name(name): table for name, table in section_rows(ROLLED, []).items()}


def short_name(name: str) -> str:
    """Return the name of a rolled shape without spaces: HEA200 of ``"HE 200 A"``."""
    short = re.sub(r"[\s_-]", "", name).upper()
    found = re.fullmatch(r"HE(\d+)([AB])", short)
    return f"HE{found[2]}{found[1]}" if found else short


def _column(file: str, title: str) -> tuple[str, float | None]:
    """Return the key of a column, empty for an unknown one, and its factor to SI, None for texts."""
    unit = _UNIT.search(title)
    key = (title[: unit.start()] if unit else title).strip()
    if key in ("name", "shape"):
        return key, None
    if key == "Ix":
        msg = (
            f"{file}, column {title}: sections have the axes y and z; bending along the height has Iy, which "
            "tables with Ix and Iy call Ix, and bending across it has Iz"
        )
        raise StudyError(msg)
    if key not in POWERS:
        return "", None
    if unit is None:
        return key, 1.0
    raised = unit[2] or ""
    power = int(raised) if raised.isdecimal() else _SUPERSCRIPTS[raised]
    if unit[1] not in SCALES or power != POWERS[key]:
        needed = f"a length to the power {POWERS[key]}" if POWERS[key] else "a number without unit"
        msg = f"{file}, column {title}: {key} is {needed}; units of length are {', '.join(SCALES)}"
        raise StudyError(msg)
    return key, SCALES[unit[1]] ** power


def _number(source: SensorRows, row: int, key: str, cell: str, scale: float) -> float:
    value = source.number(row, key, cell)
    return int(value) if key == "n" and value == int(value) else value * scale
