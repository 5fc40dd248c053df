"""The mesh of a part whose matrices are imported, for pictures."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fem.elements.part_faces import PartFaces
from fem.io.faults import no_file
from fem.io.meshio_mesh import load
from fem.matrices import Matrices, MatricesError, consistent_units
from fem.mesh import MeshError


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
