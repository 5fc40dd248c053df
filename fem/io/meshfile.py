"""Line meshes from files and to files; the suffix says the format, but for decks the text.

Universal files, Gmsh, Abaqus, Nastran and ANSYS decks are read by Dovetail; everything else, such as
``.vtu``, ``.vtk``, ``.xdmf``, ``.med``, through meshio. A format is imported when a file of it is met.
"""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import ArrayLike

from fem.io.atomic import replacing
from fem.io.faults import error_at
from fem.io.meshio_mesh import SET_PREFIX, quiet, read_by_meshio
from fem.io.programs import ABAQUS, ANSYS, NASTRAN, program_of
from fem.io.rawmesh import RawMesh, mesh_of
from fem.mesh import Mesh, MeshError

_UNIVERSAL = (".uff", ".unv")


def read_mesh(
    path: str | os.PathLike[str],
    scale: float = 1.0,
    merge_tolerance: float | None = None,
    sets: str | None = None,
    *,
    free_points: bool = False,
) -> Mesh:
    """Read a line mesh.

    Sets of cells name the members: Gmsh's physical groups, Abaqus' element sets, ANSYS' components,
    ``property 3`` of a Nastran file, cell sets or an integer cell array of the others. Sets that overlap are
    cut into parts that do not, and become groups. A three-node line becomes two lines. Sets of points name
    points: ``base`` for one point, ``base.1``, ``base.2``, … for up to 50.

    One :class:`~fem.mesh.MeshWarning` lists data that were left out or look wrong: cells that are not lines,
    points on no line (the others are renumbered in their order), the number of points that coincide without
    being connected, sections, cards and datasets that are not read. The mesh keeps its sentences as
    ``notes``.

    Parameters
    ----------
    path : path
    scale : float
        Factor that converts coordinates to metres: 0.001 for a file in mm. The units that a universal
        file states are applied besides.
    merge_tolerance : float, optional
        Distance within which points become one [m]. Nothing is merged unless it is given.
    sets : str, optional
        Name of the integer cell array whose values are the members, for files that meshio reads.
    free_points : bool
        Whether to keep points on no line that have a name: masses, joints and links may act there.

    Raises
    ------
    MeshError
        If the file cannot be read or has no lines; the message names the file and the reason.
    """
    file = Path(path)
    if not file.is_file():
        raise error_at(file, "there is no such file")
    suffix = file.suffix.lower()
    if suffix in _UNIVERSAL:
        return mesh_of(_universal(file), file.name, scale, merge_tolerance, free_points)
    program = None if suffix in (".msh", ".vtu", ".vtk", ".xdmf", ".med") else program_of(file)
    if suffix == ".msh":
        from fem.io.gmsh import read_gmsh

        raw = read_gmsh(file)
    elif program == ABAQUS:
        from fem.io.abaqus import read_abaqus

        raw = read_abaqus(file)
    elif program == NASTRAN:
        from fem.io.nastran import read_nastran

        raw = read_nastran(file)
    elif program == ANSYS:
        from fem.io.ansys import read_ansys

        raw = read_ansys(file)
    else:
        raw = read_by_meshio(file, sets)
    return mesh_of(raw, file.name, scale, merge_tolerance, free_points)


def _universal(file: Path) -> RawMesh:
    from fem.io.uff import read_quietly
    from fem.io.uff_format import UffError

    try:
        return read_quietly(file).raw_mesh()
    except UffError as reason:
        raise MeshError(str(reason)) from reason


# Writing ----------------------------------------------------------------------------------------------------


def write_mesh(
    mesh: Mesh,
    path: str | os.PathLike[str],
    point_data: Mapping[str, ArrayLike] | None = None,
    line_data: Mapping[str, ArrayLike] | None = None,
) -> None:
    """Write a mesh; the suffix gives the format, and the file is replaced completely or not at all.

    Members, groups and named points are kept in ``.inp``, members and named points in ``.msh`` (format 2.2),
    members in ``.uff``, and in ``.vtu`` and meshio's other formats: there as an integer array ``member`` and
    one array of 0 and 1 for each, ``set:name``.

    Parameters
    ----------
    mesh : Mesh
    path : path
    point_data : mapping of str to array_like, optional
        Values at the points, shape (n_points,) or (n_points, k): mode shapes, for example. Kept by ``.vtu``,
        ``.vtk`` and ``.xdmf``.
    line_data : mapping of str to array_like, optional
        Values of the lines, shape (n_lines,) or (n_lines, k). Kept by the same.

    Raises
    ------
    MeshError
        If the format cannot be written or does not keep such data.
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if suffix in (".inp", ".msh", *_UNIVERSAL) and (point_data or line_data):
        msg = f"{file.name}: a '{suffix}' file keeps no {'point' if point_data else 'line'} data; write .vtu"
        raise MeshError(msg)
    if suffix in (".inp", ".msh"):
        check_names([*mesh.members, *mesh.groups, *mesh.point_names], file.name)
        if suffix == ".inp":
            from fem.io.abaqus import abaqus_text as text_of
        else:
            from fem.io.gmsh import gmsh_text as text_of
        text = text_of(mesh)
        with replacing(file) as scratch:
            scratch.write_text(text, encoding="utf-8", newline="\n")
    elif suffix in _UNIVERSAL:
        from fem.io.uff_write import write_uff

        write_uff(file, mesh=mesh)
    else:
        data = [{k: np.asarray(v) for k, v in (given or {}).items()} for given in (point_data, line_data)]
        _write_by_meshio(mesh, file, *data)


def check_names(names: Iterable[str], file: str) -> None:
    """Refuse names that ``.inp`` and ``.msh`` files cannot have."""
    bad = next((name for name in names if '"' in name or "," in name or "\n" in name), None)
    if bad is not None:
        msg = f"{file}: the name {bad!r} cannot be written; quotes, commas and line ends are not allowed"
        raise MeshError(msg)


def member_arrays(mesh: Mesh, blanks: bool = True) -> dict[str, Any]:
    """Return the members as arrays of the lines: ``member``, numbers from 1, and ``set:name``, 0 and 1."""
    cells = {"member": np.zeros(mesh.n_lines, dtype=np.int64)}
    for number, (name, rows) in enumerate(mesh.members.items(), start=1):
        cells["member"][rows] = number
        word = name if blanks else quote(name, safe="")
        cells[f"{SET_PREFIX}{word}"] = np.isin(np.arange(mesh.n_lines), rows).astype(np.int64)
    return cells


def _write_by_meshio(mesh: Mesh, file: Path, point_data: dict[str, Any], line_data: dict[str, Any]) -> None:
    for word, data, n in (("point", point_data, mesh.n_points), ("line", line_data, mesh.n_lines)):
        for name, values in data.items():
            if values.shape[:1] != (n,) or np.iscomplexobj(values):
                msg = (
                    f"{word} data '{name}' have shape {values.shape} and type {values.dtype}; "
                    f"({n},) or ({n}, k) real numbers are expected"
                )
                raise MeshError(msg)
    blanks = file.suffix.lower() != ".vtk"  # whose names have none
    if not blanks:
        point_data, line_data = (
            {"_".join(k.split()): v for k, v in d.items()} for d in (point_data, line_data)
        )
    cells = member_arrays(mesh, blanks) | line_data
    with quiet() as log, replacing(file) as scratch:
        import meshio

        try:
            out: Any = meshio.Mesh(
                np.array(mesh.points),
                [("line", np.array(mesh.lines))],
                point_data=point_data,
                cell_data={name: [values] for name, values in cells.items()},
            )
            meshio.write(scratch, out)
            back: Any = meshio.read(scratch)  # some formats leave lines out without a word
        except (Exception, SystemExit) as reason:
            words = " ".join(f"{reason} {log.getvalue()}".split())
            msg = f"{file.name}: it cannot be written as {file.suffix or 'a mesh'} ({words[:300]})"
            raise MeshError(msg) from reason
        if sum(len(block.data) for block in back.cells if block.type == "line") != mesh.n_lines:
            raise error_at(file.name, f"it cannot be written as {file.suffix}, a format that keeps no lines")
