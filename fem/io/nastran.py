"""Nastran bulk data (``.bdf``, ``.nas``, ``.fem``, ``.dat``): grid points and line elements.

meshio 5.3.5 reads them too, but wants ``BEGIN BULK`` and ``ENDDATA``, leaves elements in large-field format
out without a word, stops at elements without a property and takes coordinates in local systems for global
ones. So these are read here.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from fem.io.rawmesh import RawMesh
from fem.mesh import MeshError

_LINES = ("CBAR", "CBEAM", "CROD", "CTUBE", "CBEND", "CONROD")
_REPORTED = re.compile(
    r"C(QUAD|TRIA|TETRA|HEXA|PENTA|PYRA|SHEAR|ELAS|DAMP|BUSH|GAP|ONM|MASS|WELD|FAST)\w*|RBE\d|RBAR|RROD|MPC"
)


def read_nastran(path: Path) -> RawMesh:
    """Read the lines of a Nastran file; each property number is a set, ``"property 3"``.

    Raises
    ------
    MeshError
        For cards that are not numbers, grid points in local coordinate systems, or elements that refer to
        grid points which are not there.
    """
    raw = RawMesh()
    row_of: dict[int, int] = {}
    elements: list[tuple[int, str, list[str]]] = []
    for file, line, name, fields in _cards(path, path.name):
        if name == "GRID":
            try:
                number, system = int(fields[0]), int(fields[1] or 0)
                xyz = [_real(v) for v in fields[2:5]]
            except (ValueError, IndexError) as reason:
                msg = (
                    f"{file}: line {line}: GRID {', '.join(fields)} is not a number, a system and coordinates"
                )
                raise MeshError(msg) from reason
            if system != 0:
                msg = (
                    f"{file}: line {line}: grid point {number} is in coordinate system {system}; only "
                    "the basic "
                    "system (0) is read, so write the file with basic coordinates"
                )
                raise MeshError(msg)
            row_of[number] = len(raw.points)
            raw.points.append([*xyz, 0.0, 0.0, 0.0][:3])
        elif name in _LINES:
            elements.append((line, name, fields))
        elif _REPORTED.fullmatch(name):
            raw.left_out[f"{name} cards"] += 1
    for line, name, fields in elements:
        _add_line(raw, row_of, line, name, fields, path.name)
    return raw


def _add_line(
    raw: RawMesh, row_of: dict[int, int], line: int, name: str, fields: list[str], file: str
) -> None:
    try:
        number = int(fields[0])
        if name == "CONROD":
            prop, ends = 0, (int(fields[1]), int(fields[2]))
        else:
            prop, ends = int(fields[1] or number), (int(fields[2]), int(fields[3]))
    except (ValueError, IndexError) as reason:
        msg = (
            f"{file}: line {line}: {name} {', '.join(fields[:4])} is not a number, a property and two "
            "grid points"
        )
        raise MeshError(msg) from reason
    missing = next((n for n in ends if n not in row_of), None)
    if missing is not None:
        msg = (
            f"{file}: line {line}: {name} {number} refers to grid point {missing}, which the file does "
            "not have"
        )
        raise MeshError(msg)
    raw.add_to_set(f"property {prop}" if name != "CONROD" else "CONROD", len(raw.lines))
    raw.lines.append((row_of[ends[0]], row_of[ends[1]]))


def _real(text: str) -> float:
    """Read a number, also one such as ``1.5-3`` for 1.5e-3."""
    text = text.strip().upper().replace("D", "E")
    return float(re.sub(r"(?<=[\d.])([+-]\d+)$", r"E\1", text) if text else 0.0)


def _cards(path: Path, file: str) -> Iterator[tuple[str, int, str, list[str]]]:
    """Give file, line, name and fields of each card of the bulk data."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as reason:
        msg = f"{file}: the file {path.name} that it includes cannot be read ({reason.strerror})"
        raise MeshError(msg) from reason
    begin = next(
        (k for k, line in enumerate(lines) if re.match(r"\s*BEGIN\s*(BULK)?\b", line, re.IGNORECASE)), -1
    )
    card: tuple[int, str, list[str]] | None = None
    for k, raw_line in enumerate(lines[begin + 1 :], start=begin + 2):
        line = raw_line.split("$")[0].rstrip().expandtabs(8)
        if not line:
            continue
        if re.match(r"\s*ENDDATA\b", line, re.IGNORECASE):
            break
        included = re.match(r"\s*INCLUDE\s+['\"]?([^'\"]+)['\"]?\s*$", line, re.IGNORECASE)
        if included:
            yield from _cards(path.parent / included.group(1), file)
            continue
        name, fields = _fields(line)
        if name in ("", "+", "*") or line[0] in "+* ":
            if card is not None:
                card[2].extend(fields)
            continue
        if card is not None:
            yield (path.name, *card)
        card = (k, name, fields)
    if card is not None:
        yield (path.name, *card)


def _fields(line: str) -> tuple[str, list[str]]:
    """Split a line in free, small-field or large-field format into its name and data fields."""
    if "," in line:
        cells = [cell.strip() for cell in line.split(",")]
        wide = cells[0].endswith("*")
        name, data = cells[0], cells[1 : 5 if wide else 9]
        data += [""] * ((4 if wide else 8) - len(data))
    else:
        name = line[:8].strip()
        width, count = (16, 4) if name.endswith("*") or name.startswith("*") else (8, 8)
        padded = line.ljust(8 + width * count)
        data = [padded[8 + width * k : 8 + width * (k + 1)].strip() for k in range(count)]
    return name.upper().rstrip("*") or "*", data
