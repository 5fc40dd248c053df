"""Geometry of a test: points with names, of a universal file or of a table, and the labels that name them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail.file.sensor_table import UNIT_OF_HEADING, cell_rows
from dovetail.file.table import StudyError
from fem.io import UFF_SUFFIXES, read_uff
from fem.io.columns import is_number
from fem.io.uff_format import UffError, parse_label
from fem.io.uff_types import Points
from updating.measurement.matching import SCALES

_NAMES = ("name", "point", "node", "label", "id", "no", "number")
_AXES = ("x", "y", "z")
_BEHIND = re.compile(
    r"(?P<name>.*?)[\s:_.,|]*(?P<sign>[+-]?)(?P<turn>R?)(?P<axis>[XYZ])(?P<after>[+-]?)", re.I
)
_BEFORE = re.compile(
    r"(?P<sign>[+-]?)(?P<turn>R?)(?P<axis>[XYZ])(?P<after>[+-]?)[\s:_.,|]*(?P<name>.*)", re.I
)


@dataclass(frozen=True, slots=True, eq=False)
class NamedPoints:
    """Points of a test.

    Attributes
    ----------
    names : tuple of str
    xyz : ndarray (n, 3)
        [m] where ``unit`` is given.
    unit : str or None
        "m" where the file states the unit of its coordinates in a heading.
    """

    names: tuple[str, ...]
    xyz: NDArray[np.float64]
    unit: str | None = None

    @classmethod
    def of(cls, points: Points) -> "NamedPoints":
        """Return the points of a universal file."""
        return cls(tuple(str(int(k)) for k in points.labels), points.coordinates)

    def at(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the coordinates of some points, (n, 3)."""
        return self.xyz[[self.names.index(name) for name in names]]

    def dof(self, label: str) -> tuple[str, int] | None:
        """Return the point and the direction of a label, 1 to 6 for x, y, z, rx, ry, rz, with the sense.

        ``12Z+``, ``12:+Z``, ``12_z``, ``Z12`` and ``wing:12:-Z`` name point 12; None where no point is named.
        Directions of 0 are scalars.
        """
        try:
            node, direction = parse_label(label)
        except UffError:
            pass
        else:
            return str(node), direction
        for form in (_BEHIND, _BEFORE):
            found = form.fullmatch(label.strip())
            if found is None or (found["sign"] and found["after"]):
                continue
            name = self._known(found["name"])
            if name is not None:
                sense = -1 if "-" in (found["sign"], found["after"]) else 1
                axis = "XYZ".index(found["axis"].upper()) + 1 + (3 if found["turn"] else 0)
                return name, sense * axis
        return None

    def _known(self, name: str) -> str | None:
        """Return the point that a label calls so, perhaps behind the name of its component."""
        for text in dict.fromkeys((name, name.rpartition(":")[2])):
            for known in self.names:
                same = text.casefold() == known.casefold()
                if same or (text.isdecimal() and known.isdecimal() and int(text) == int(known)):
                    return known
        return None


def read_named_points(path: Path) -> NamedPoints:
    """Read the points of a universal file, or of a table with name, x, y and z.

    A heading may put the columns in any order and give units, as in ``x [mm]``. Without a heading the first
    four columns are taken.

    Raises
    ------
    StudyError
        For a file without points, or a row that is none.
    UffError, TableError
        If the file cannot be read.
    """
    if path.suffix.lower() in UFF_SUFFIXES:
        points = read_uff(path).points
        if points is None:
            msg = f"{path}: it has no points (dataset 15 or 2411)"
            raise StudyError(msg)
        return NamedPoints.of(points)
    suffixes = ", ".join(UFF_SUFFIXES)
    allowed = f"a table of names and three coordinates, or a universal file ({suffixes}), is needed"
    rows = cell_rows(path)
    columns, unit = (0, 1, 2, 3), None
    if rows and not all(is_number(cell) for cell in rows[0][1][1:4]):
        columns, unit = _columns(path, rows[0][1])
        rows = rows[1:]
    names, xyz = [], []
    for k, cells in rows:
        chosen = [cells[at] if at < len(cells) else "" for at in columns]
        if not all(is_number(cell) for cell in chosen[1:]):
            msg = f"{path}: row {k} is {', '.join(cells)}; {allowed}"
            raise StudyError(msg)
        names.append(chosen[0])
        xyz.append([float(cell) for cell in chosen[1:]])
    if not xyz:
        msg = f"{path}: it has no points; {allowed}"
        raise StudyError(msg)
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        msg = f"{path}: two points have the name '{twice}'; names must differ"
        raise StudyError(msg)
    return NamedPoints(tuple(names), (1.0 if unit is None else SCALES[unit]) * np.array(xyz), unit and "m")


def _columns(path: Path, head: Sequence[str]) -> tuple[tuple[int, ...], str | None]:
    """Return the columns of name, x, y and z, and the unit that the heading states."""
    plain, units = [], []
    for title in head:
        found = UNIT_OF_HEADING.search(title)
        plain.append((title[: found.start()] if found else title).strip().lower())
        units.append(found[1] if found else None)
    if not {"x", "y", "z"} <= set(plain):  # a heading of other words, over columns in the usual order
        return (0, 1, 2, 3), None
    axes = tuple(plain.index(axis) for axis in _AXES)
    name = next((plain.index(word) for word in _NAMES if word in plain), None)
    if name is None:
        name = next(at for at in (*range(len(head)), len(head)) if at not in axes)
    stated = {units[at] for at in axes}
    unknown = next((u for u in stated if u is not None and u not in SCALES), None)
    if unknown is not None or len(stated) > 1:
        found_units = ", ".join(str(u) for u in sorted(stated, key=str))
        msg = f"{path}: its coordinates have the units {found_units}; one of {', '.join(SCALES)} is needed"
        raise StudyError(msg)
    return (name, *axes), stated.pop()


def unit_of(points: NamedPoints, asked: str | None, path: Path) -> str | None:
    """Return the unit by which coordinates are matched.

    Raises
    ------
    StudyError
        If a unit is asked for, and the file states one.
    """
    if points.unit is not None and asked is not None:
        msg = f"{path}: its heading states the unit of the coordinates; leave --geometry-unit out"
        raise StudyError(msg)
    return points.unit or asked
