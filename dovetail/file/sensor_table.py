"""Sensors and excitations as rows of a table in a text file (CSV), with row and column in every error."""

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dovetail.file.lines import Path as KeyPath
from dovetail.file.table import Source, StudyError, StudyTable
from fem.io.columns import text_of
from fem.io.faults import no_file
from fem.summary import did_you_mean
from updating.measurement.matching import SCALES

NUMBERS = ("gain", "mass", "sign", "phase", "position", "node", "offset_y", "offset_z")
TEXTS = ("name", "label", "kind", "point", "member", "on", "sensor", "quantity")
FLAGS = ("conjugate", "roving", "arm")
COLUMNS: dict[str, str] = {
    **{key: key for key in (*NUMBERS, *TEXTS, *FLAGS, "direction", "x", "y", "z", "dx", "dy", "dz")},
    "directions": "direction",
    "channel": "label",
    "position_1": "x",
    "position_2": "y",
    "position_3": "z",
    "direction_1": "dx",
    "direction_2": "dy",
    "direction_3": "dz",
}
"""Columns by their headings in small letters; those of pyFBS among them."""

_PLACE, _VECTOR, _OFFSET = ("x", "y", "z"), ("dx", "dy", "dz"), ("offset_y", "offset_z")
_PLACES = ("x", "point", "member", "node", "sensor")
UNIT_OF_HEADING = re.compile(r"[\[(]\s*(\w+)\s*[\])]\s*$")
"""A unit in brackets at the end of a heading."""

_REAL = r"\d+(,\d+)?([eE][+-]?\d+)?"
_COMMA_NUMBER = re.compile(rf"[+-]?{_REAL}(\s*[+-]\s*{_REAL}[ij])?")
"""A number with decimal commas, which may be complex."""
_LETTERS = re.compile(r"[+-]?[xyz]([\s,;]*[+-]?[xyz])*", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class SensorRows(Source):
    """Places in a table: ``file, row 3, column x``."""

    columns: Mapping[str, str] = field(default_factory=dict)

    def place(self, path: KeyPath) -> str:
        """Return file, row and column of a path (row, key, …)."""
        row = f", row {path[0]}" if path else ""
        key = next((str(p) for p in path[1:] if isinstance(p, str)), "")
        column = f", column {self.columns.get(key, key)}" if key else ""
        return f"{self.file}{row}{column}"

    def number(self, row: int, key: str, cell: str) -> float:
        """Return the number of a cell."""
        try:
            value = float(cell)
        except ValueError:
            value = float("nan")
        if not abs(value) < float("inf"):
            raise self.error((row, key), f"'{cell}' is not allowed; a number is needed")
        return value


def sensor_tables(t: StudyTable, folder: Path, notes: list[str]) -> Iterator[StudyTable]:
    """Yield ``[[sensors]]`` or ``[[excitations]]`` as they are, or the rows of the file that one names.

    Parameters
    ----------
    t : Table
        With ``file`` and nothing else, if rows are wanted.
    folder : Path
        Of the study.
    notes : list of str
        Gains what is not used.

    Raises
    ------
    StudyError
        For a table that cannot be read; the message names the file, the row as a spreadsheet counts it, and
        the column.
    """
    if "file" not in t:
        yield t
        return
    name = t.text("file")
    t.finish()
    path = folder / name
    if not path.is_file():
        t.refuse("file", no_file(path))
    with t.at("file"):
        head, body = cells_of(path)
        columns, units = _columns(path.name, head[1], notes)
    row_source = SensorRows(path.name, {}, {**columns, "directions": columns.get("direction", "direction")})
    for row, cells in body:
        chosen = {key: cells[head[1].index(title)] for key, title in columns.items()}
        values = _values(row_source, row, chosen, units)
        for one in _by_direction(row_source, row, values):
            yield StudyTable(row_source, (row,), one)


def cell_rows(path: Path) -> list[tuple[int, list[str]]]:
    """Return the rows of a table, a heading included, with their numbers, counted from 1."""
    return _rows_of(text_of(path))


def _rows_of(text: str) -> list[tuple[int, list[str]]]:
    lines = [(k, line) for k, line in enumerate(text.splitlines(), start=1)]
    lines = [(k, line) for k, line in lines if line.strip(" ;,\t\r") and not line.lstrip().startswith("#")]
    if not lines:
        return []
    mark = max(("\t", ";", ","), key=lines[0][1].count)
    rows = [(k, [c.strip() for c in next(csv.reader([line], delimiter=mark))]) for k, line in lines]
    if mark != ",":  # decimal commas
        rows = [
            (k, [c.replace(",", ".") if _COMMA_NUMBER.fullmatch(c) else c for c in cells])
            for k, cells in rows
        ]
    return rows


def cells_of(path: Path, what: str = "sensor") -> tuple[tuple[int, list[str]], list[tuple[int, list[str]]]]:
    """Return the heading and the rows of a table with their numbers, counted from 1."""
    text = text_of(path)
    rows = _rows_of(text)
    if len(rows) < 2:
        msg = f"{path.name}: a heading and a row for each {what} are needed"
        raise StudyError(msg)
    width = len(rows[0][1])
    for k, cells in rows[1:]:
        if len(cells) != width and any(cells[width:]):
            msg = f"{path.name}, row {k}: it has {len(cells)} cells, the heading has {width}"
            raise StudyError(msg)
    last, cells = rows[-1]
    if len(cells) < width and text[-1] not in "\r\n":
        msg = (
            f"{path.name}, row {last}: the file ends after {len(cells)} of {width} cells; it may be cut off. "
            "If not, end the row with a line break"
        )
        raise StudyError(msg)
    return rows[0], [(k, (cells + [""] * width)[:width]) for k, cells in rows[1:]]


def _columns(name: str, head: Sequence[str], notes: list[str]) -> tuple[dict[str, str], dict[str, float]]:
    """Return the heading of each key, and the metres in the unit of each coordinate."""
    found: dict[str, str] = {}
    units: dict[str, float] = {}
    unused: list[str] = []
    for title in head:
        unit = UNIT_OF_HEADING.search(title)
        key = COLUMNS.get((title[: unit.start()] if unit else title).strip().lower())
        if key is None:
            unused += [title] if title else []
            continue
        if key in found:
            msg = f"{name}, column {title}: the column {found[key]} has the same meaning"
            raise StudyError(msg)
        found[key] = title
        if unit and key in (*_PLACE, *_OFFSET):
            if unit[1] not in SCALES:
                msg = f"{name}, column {title}: the unit '{unit[1]}' is not allowed; {', '.join(SCALES)} are"
                raise StudyError(msg)
            units[key] = SCALES[unit[1]]
    for title in unused:
        hint = did_you_mean(title, COLUMNS, 0.75)
        notes.append("; ".join(filter(None, [f"{name}: the column {title} is not used", hint])))
    for group in (_PLACE, _VECTOR, _OFFSET):
        some = [key for key in group if key in found]
        if some and len(some) < len(group):
            missing = next(key for key in group if key not in found)
            msg = (
                f"{name}: it has the column {found[some[0]]} and no column {missing}; all of "
                f"{', '.join(group)} are needed"
            )
            raise StudyError(msg)
    if not found:
        msg = f"{name}: no heading is known ({', '.join(head[:8])}); allowed are {', '.join(COLUMNS)}"
        raise StudyError(msg)
    if unused and not {*_PLACES} & {*found}:
        msg = (
            f"{name}: no column gives places, and {', '.join(unused[:8])} are not known; x, y and z, with a "
            f"unit as in 'x [mm]', or one of {', '.join(_PLACES[1:])} are needed"
        )
        raise StudyError(msg)
    return found, units


def _values(
    source: SensorRows, row: int, cells: Mapping[str, str], units: Mapping[str, float]
) -> dict[str, Any]:
    """Return the values of a row as a study file would have them; empty cells are left out."""
    out: dict[str, Any] = {}
    for key, cell in cells.items():
        if not cell:
            continue
        if key in TEXTS or key == "direction":
            out[key] = cell
        elif key in FLAGS:
            if cell.lower() not in ("true", "false", "1", "0", "yes", "no"):
                raise source.error((row, key), f"'{cell}' is not allowed; true or false is needed")
            out[key] = cell.lower() in ("true", "1", "yes")
        else:
            out[key] = source.number(row, key, cell) * units.get(key, 1.0)
    if "node" in out:
        if out["node"] != int(out["node"]):
            raise source.error((row, "node"), f"'{cells['node']}' is not allowed; a whole number is needed")
        out["node"] = int(out["node"])
    for group, key in ((_PLACE, "point"), (_VECTOR, "direction"), (_OFFSET, "offset")):
        some = [k for k in group if k in out]
        if not some:
            continue
        missing = next((k for k in group if k not in out), None)
        if missing is not None:
            raise source.error((row, missing), f"it is empty, and {source.columns[some[0]]} is not")
        if key in out:
            others = ", ".join(group)
            raise source.error((row, key), f"'{out[key]}' is given together with {others}; give one of them")
        out[key] = [out.pop(k) for k in group]
    return out


def _by_direction(source: SensorRows, row: int, values: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield one table for each direction of a sensor: ``xyz`` of A1 gives A1x, A1y and A1z."""
    text = values.get("direction")
    if not isinstance(text, str):
        yield values
        return
    text = re.sub(r"^([xyzXYZ])([+-])$", r"\2\1", text)
    if not _LETTERS.fullmatch(text):
        raise source.error((row, "direction"), f"'{text}' is not allowed; x, -z, xyz or the like is needed")
    words = [w.lower().removeprefix("+") for w in re.findall(r"[+-]?[xyz]", text, re.IGNORECASE)]
    for k, word in enumerate(words):
        one = {**values, "direction": word}
        if len(words) > 1:
            if "label" in values:
                raise source.error(
                    (row, "label"), "one label does not fit several directions; write a row for each"
                )
            if "name" in values:
                one["name"] = f"{values['name']}{word.removeprefix('-')}"
            if k > 0:
                one.pop("mass", None)  # one body with several channels
        yield one
