"""Meshes that meshio reads: ``.vtu``, ``.vtk``, ``.xdmf``, ``.med`` and others, with notes on lost cells."""

import contextlib
import io
import os
import re
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from fem.array_types import Ints
from fem.elements.part_faces import PartFaces
from fem.io.faults import error_at, no_file
from fem.io.programs import ALLOWED
from fem.io.rawmesh import LineSets, RawMesh, listed
from fem.matrices import Matrices, MatricesError, consistent_units
from fem.mesh import MeshError

SET_PREFIX = "set:"
"""Beginning of the names of cell arrays of 0 and 1 that say which lines belong to a set."""

_TAGS = (
    "gmsh:physical",
    "cell_tags",
    "medit:ref",
    "nastran:ref",
    "member",
    "members",
    "CellEntityIds",
    "group",
)
"""Integer cell data that number the members, in the order in which they are looked for."""

_VTK_TYPES = {2: "poly-vertices", 4: "polylines", 6: "triangle strips", 8: "pixels", 11: "voxels"}

_Sets = list[tuple[str, Ints]]
"""Names, and the cells of each, numbered through all blocks."""


@contextlib.contextmanager
def quiet() -> Iterator[io.StringIO]:
    """Catch meshio's printed lines."""
    log = io.StringIO()
    with contextlib.redirect_stdout(log), contextlib.redirect_stderr(log):
        yield log


def read_by_meshio(file: Path, sets: str | None) -> RawMesh:
    """Read the lines of a file, with its cell sets or the numbers of a cell array as sets."""
    found, log = load(file)
    raw = _raw_of(found, file.name, sets)
    raw.notes += _in_plain_words(log)
    return raw


def load(file: Path) -> tuple[Any, str]:
    """Return the mesh of a file as meshio gives it, and the lines that meshio printed.

    Raises
    ------
    MeshError
        If meshio cannot read the file.
    """
    with quiet() as log:
        import meshio

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return meshio.read(file), log.getvalue()
        except (Exception, SystemExit) as reason:
            if file.suffix.lower() not in meshio.extension_to_filetypes:
                msg = f"{file.name}: '{file.suffix}' is no format of meshes; decks are {ALLOWED}"
                raise MeshError(msg) from reason
            msg = f"{file.name}: it cannot be read as {file.suffix or 'a mesh'} ({_why(file, reason, log)})"
            raise MeshError(msg) from reason


def _why(file: Path, reason: BaseException, log: io.StringIO) -> str:
    if isinstance(reason, ImportError):
        return f"it needs the package {reason.name}: python -m pip install {reason.name}, or write .vtu"
    text = "" if isinstance(reason, SystemExit) else f"{type(reason).__name__}: {reason}"
    words = " ".join(f"{text} {log.getvalue()}".split()).replace(str(file), file.name)
    hint = "; saving the mesh as .vtu is more reliable" if file.suffix.lower() == ".vtk" else ""
    return (words[:300] or "meshio gave no reason") + hint


def _in_plain_words(log: str) -> Iterator[str]:
    """Yield meshio's printed lines, with names for the cells that it cannot read."""
    lost = re.compile(r"(Warning: )?File contains cells that meshio cannot handle \(types? ([\d, ]+)\)\.?")
    for found in lost.finditer(log):
        kinds = [int(k) for k in re.findall(r"\d{1,4}", found.group(2))]
        names = ", ".join(_VTK_TYPES.get(k, f"cells of VTK type {k}") for k in kinds)
        remedy = "; write them as lines of two points each" if 4 in kinds else ""
        yield f"{names} left out, which meshio cannot read{remedy}"
    rest = " ".join(lost.sub("", log).split())
    if rest:
        yield f"meshio says: {rest[:300]}"


def _raw_of(found: Any, file: str, sets: str | None) -> RawMesh:
    points = np.asarray(found.points)
    if points.ndim != 2 or points.shape[1] not in (2, 3) or points.dtype.kind not in "iuf":
        msg = (
            f"{file}: points have shape {points.shape} and type {points.dtype}; two or three real "
            "coordinates each are expected"
        )
        raise MeshError(msg)
    for name in (*found.cell_data, *found.cell_sets, *found.point_sets):
        if not isinstance(name, str):
            raise error_at(file, f"the array {name!r} has a name that is no text")
    raw = RawMesh(np.column_stack([points.astype(float), np.zeros((len(points), 3 - points.shape[1]))]))
    lines: list[Ints] = [np.zeros((0, 3), dtype=np.int64)]
    counts: list[Ints] = [np.zeros(0, dtype=np.int64)]
    for block in found.cells:
        rows, count = _lines_of(block, file)
        lines.append(rows)
        counts.append(count)
        if not len(rows) and len(block.data) and block.type != "vertex":
            raw.left_out[f"{block.type} cells"] += len(block.data)
    raw.lines, count = np.concatenate(lines), np.concatenate(counts)
    named = _sets_of(found, file, sets, [len(block.data) for block in found.cells], raw.notes)
    names = {name: k for k, name in enumerate(dict.fromkeys(name for name, _ in named))}
    number = [np.full(len(cells), names[name]) for name, cells in named]
    cells = [cells for _, cells in named]
    none = [np.zeros(0, dtype=np.int64)]
    every = LineSets(list(names), np.concatenate(number or none), np.concatenate(cells or none))
    raw.sets = every.over(np.cumsum(count) - count, count).mapping()
    raw.point_sets = {
        name: np.asarray(rows, dtype=np.int64).ravel() for name, rows in found.point_sets.items()
    }
    return raw


def _lines_of(block: Any, file: str) -> tuple[Ints, Ints]:
    """Return the lines of a block, two or three points each, and how many each cell has become."""
    n = len(block.data)
    if re.fullmatch(r"line\d*|VTK_LAGRANGE_CURVE", block.type):
        data = np.asarray(block.data)
        if data.ndim != 2 or data.shape[1] < 2 or data.dtype.kind not in "iu":
            msg = f"{file}: {block.type} cells have shape {data.shape} and type {data.dtype}; whole numbers "
            msg += "are expected, two or more for each"
            raise MeshError(msg)
        chain = data[:, [0, *range(2, data.shape[1]), 1]].astype(np.int64)  # both ends are given first
        if data.shape[1] == 3:
            return chain, np.ones(n, dtype=np.int64)
        return _pairs(chain.ravel(), np.full(n, data.shape[1]))
    if block.type in ("polyline", "poly_line"):
        count = np.array([len(nodes) for nodes in block.data], dtype=np.int64)
        nodes = [np.asarray(nodes, dtype=np.int64) for nodes in block.data]
        return _pairs(np.concatenate(nodes) if nodes else np.zeros(0, dtype=np.int64), count)
    return np.zeros((0, 3), dtype=np.int64), np.zeros(n, dtype=np.int64)


def _pairs(nodes: Ints, count: Ints) -> tuple[Ints, Ints]:
    """Return the two-point lines of chains of nodes, one after the other, and how many each chain has."""
    inner = np.ones(len(nodes), dtype=bool)
    inner[np.cumsum(count[count > 0]) - 1] = False
    first = np.flatnonzero(inner)
    return np.column_stack([nodes[first], nodes[first + 1], np.full(len(first), -1)]), np.maximum(
        count - 1, 0
    )


# Sets -------------------------------------------------------------------------------------------------------


def _sets_of(found: Any, file: str, sets: str | None, sizes: list[int], notes: list[str]) -> _Sets:
    """Return the sets of cells: those of the file, arrays of 0 and 1, or else the numbers of an array."""
    if sets is not None:
        if sets not in found.cell_data:
            msg = f"{file}: there is no cell array '{sets}'; it has {', '.join(found.cell_data) or 'none'}"
            raise MeshError(msg)
        numbers = _numbers(found, sets, sizes)
        if numbers is None:
            raise error_at(file, f"the cell array '{sets}' does not have one whole number for each cell")
        return _by_number(found, sets, numbers)
    begin = np.cumsum([0, *sizes])
    named: _Sets = []
    for name, per_block in found.cell_sets.items():
        parts = [
            np.asarray(rows, dtype=np.int64).ravel() + start
            for rows, start in zip(per_block, begin, strict=False)
            if rows is not None
        ]
        if parts and not name.startswith("gmsh:"):
            named.append((name, np.concatenate(parts)))
    for array in found.cell_data:
        if array.startswith(SET_PREFIX):
            name = array.removeprefix(SET_PREFIX)
            name = unquote(name) if file.endswith(".vtk") else name
            numbers = _numbers(found, array, sizes)
            if numbers is None:
                notes.append(f"the cell array '{array}' is no set: it has not one whole number for each cell")
            else:
                named.append((name, np.flatnonzero(numbers)))
    if named:
        return named
    integer_arrays = {
        array: numbers for array in found.cell_data if (numbers := _numbers(found, array, sizes)) is not None
    }
    tag = next((tag for tag in _TAGS if tag in found.cell_data), None)
    if tag is not None and tag in integer_arrays:
        return _by_number(found, tag, integer_arrays[tag])
    if tag is not None:
        notes.append(f"the cell array '{tag}' names no members: it has not one whole number for each cell")
    if integer_arrays:
        notes.append(
            f"no members are named; the cell arrays {listed(list(integer_arrays))} have whole numbers, and "
            f"sets = '{next(iter(integer_arrays))}' would take the members from them"
        )
    return named


def _numbers(found: Any, array: str, sizes: list[int]) -> Ints | None:
    """Return a cell array through all blocks, or None if it is not one whole number for each cell."""
    parts = [np.asarray(values) for values in found.cell_data[array]]
    parts = [part.ravel() if part.size == len(part) else part for part in parts]
    if [part.shape for part in parts] != [(n,) for n in sizes]:
        return None
    values = np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64)
    if values.dtype.kind == "f" and not (np.abs(values) < 2**53).all():
        return None
    if values.dtype.kind not in "iufb" or not (values == np.rint(values)).all():
        return None
    return values.astype(np.int64)


def _by_number(found: Any, tag: str, numbers: Ints) -> _Sets:
    """Name cells by the numbers of a cell array, with the names that the file has for them."""
    # A VTK file may hold field data of any shape; meshio makes (number, dimension) of a Gmsh file's names.
    pairs = {name: np.ravel(v) for name, v in found.field_data.items() if np.size(v) == 2}
    known = {int(v[0]): name for name, v in pairs.items() if np.isfinite(v).all() and int(v[1]) == 1}
    families = getattr(found, "cell_tags", None) or {}
    word = {"gmsh:physical": "physical"}.get(tag, tag)
    order = np.argsort(numbers, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1) if order.size else []
    named: _Sets = []
    for rows in sorted(parts, key=lambda rows: rows[0]):
        number = int(numbers[rows[0]])
        set_names = families.get(number) or [known.get(number, f"{word} {number}")]
        named += [(name, rows) for name in set_names]
    return named


# The mesh of a part whose matrices are imported, for pictures -----------------------------------------------


def read_part_faces(
    path: str | os.PathLike[str], part: Matrices, units: str | Sequence[float] = "SI", *, held: bool = False
) -> PartFaces:
    """Read the outer surface of a part from a mesh with the same nodes, in any format that meshio reads.

    Parameters
    ----------
    path : str or os.PathLike
        ``.vtu``, ``.inp``, ``.msh``, ``.bdf`` and others.
    part : Matrices
        The part, in SI units. Nodes are recognised by their places.
    units : str or (length, mass, time)
        Of the mesh's coordinates, as for :func:`fem.io.read_matrices`.
    held : bool
        Whether the part is fixed to the ground by itself; nodes without rows then are at rest.

    Raises
    ------
    MatricesError
        If the file cannot be read, or its mesh is not that of the part.
    """
    file = Path(path)
    if not file.is_file():
        raise MatricesError(no_file(file))
    try:
        found, _ = load(file)
    except MeshError as reason:
        raise MatricesError(str(reason)) from reason
    points = np.asarray(found.points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        msg = f"{file.name}: points have shape {points.shape}; three coordinates each are expected"
        raise MatricesError(msg)
    cells = [(block.type, block.data) for block in found.cells]
    length, _, _ = consistent_units(units)
    try:
        return PartFaces.of_cells(part, length * points, cells, held=held)
    except MatricesError as reason:
        msg = f"{file.name}: {reason}"
        raise MatricesError(msg) from reason
