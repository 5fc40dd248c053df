"""The outer surface of a part of another program, for pictures: triangles between nodes of its matrices."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Floats, Ints
from fem.matrices import Matrices, MatricesError
from fem.summary import fields_summary

MOST_VERTICES = 20_000
"""Finer surfaces are drawn coarser: a page with twenty modes of so many vertices takes 5 MB."""
SAME_PLACE = 1e-4
"""Largest distance of a vertex from the node that it is, over the size of the part."""
SHARP = np.cos(np.deg2rad(30))
"""Edges between faces whose normals differ by more than 30° are drawn as lines."""

_FACES = {
    "tetra": ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)),
    "pyramid": ((0, 1, 2, 3), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    "wedge": ((0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "hexahedron": ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
}
"""Corners of the faces of solid cells in the order of VTK and meshio, which has mid-side nodes last."""
_FLAT = {"triangle": (0, 1, 2), "quad": (0, 1, 2, 3)}


@dataclass(frozen=True, slots=True, eq=False)
class PartFaces:
    """Triangles of the outer surface of a part.

    Attributes
    ----------
    points : ndarray (n_vertices, 3)
        Places at rest [m].
    rows : ndarray of int (n_vertices, 3)
        Rows of the part's matrices, or of its ``Q`` if it has one, that move a vertex along x, y and z; -1
        where a direction does not move.
    triangles : ndarray of int (n_triangles, 3)
        Vertices of each triangle, anticlockwise seen from outside where the part is solid.
    edges : ndarray of int (n_edges, 2)
        Vertices of the sharp edges and of the rims of shells.
    """

    points: Floats
    rows: Ints
    triangles: Ints
    edges: Ints

    __repr__ = fields_summary

    @classmethod
    def of_cells(
        cls,
        part: Matrices,
        points: ArrayLike,
        cells: Sequence[tuple[str, ArrayLike]],
        *,
        held: bool = False,
        most_vertices: int = MOST_VERTICES,
    ) -> "PartFaces":
        """Find the outer surface of a mesh whose nodes are those of the part.

        Nodes are recognised by their places. Finer surfaces than can be drawn are made coarser by
        vertex clustering (Rossignac & Borrel, Modeling in Computer Graphics, 1993, 455-465).

        Parameters
        ----------
        part : Matrices
        points : array_like (n, 3)
            Nodes of the mesh [m].
        cells : sequence of (str, array_like of int (n_cells, n_nodes))
            Types of cells by meshio's names, such as ``"hexahedron20"``, and their rows of ``points``. Lines
            and vertices are passed over.
        held : bool
            Whether the part is fixed to the ground by itself: nodes without rows then are at rest.
        most_vertices : int
            Largest number of vertices.

        Raises
        ------
        MatricesError
            If there is no face, or a vertex is no node of the part.
        """
        xyz = np.asarray(points, dtype=float)
        faces = _outer(xyz, cells)
        if not len(faces):
            kinds = ", ".join(dict.fromkeys(kind for kind, _ in cells)) or "none"
            msg = f"the mesh has no solid or shell cells that could be drawn; its cells are: {kinds}"
            raise MatricesError(msg)
        triangles = np.concatenate([faces[:, :3], faces[:, [0, 2, 3]]])
        triangles = triangles[np.arange(len(triangles)) < len(faces) + (faces[:, 2] != faces[:, 3]).sum()]
        used, numbered = np.unique(triangles, return_inverse=True)
        vertex, triangles = _coarser(xyz[used], numbered.reshape(-1, 3), most_vertices)
        rows = _rows(part, xyz[used][vertex], held)
        return cls(xyz[used][vertex], rows, triangles, _sharp_edges(xyz[used][vertex], triangles))

    def motion(self, part: Matrices, motion: NDArray[Any]) -> NDArray[Any]:
        """Return the displacements of the vertices, (n_vertices, 3), for a motion of the part's rows."""
        moved = motion if part.Q is None else part.Q @ motion
        return np.where(self.rows >= 0, moved[self.rows], 0.0)


def _outer(xyz: Floats, cells: Sequence[tuple[str, ArrayLike]]) -> Ints:
    """Return the faces that one solid cell alone has, and shells, shape (n, 4), quadrilaterals first.

    Triangles have their last corner twice. Faces of solids are anticlockwise seen from outside.
    """
    solid: list[Ints] = [np.zeros((0, 4), dtype=np.int64)]
    flat = list(solid)
    inside: list[Floats] = [np.zeros((0, 3))]
    for kind, rows in cells:
        shape, nodes = re.sub(r"\d+$", "", kind), np.asarray(rows, dtype=np.int64)
        for corners in _FACES.get(shape, ()):
            solid.append(nodes[:, [*corners, corners[-1]][:4]])
            inside.append(xyz[nodes].mean(axis=1))
        if shape in _FLAT:
            corners = _FLAT[shape]
            flat.append(nodes[:, [*corners, corners[-1]][:4]])
    faces, shells, centre = np.concatenate(solid), np.concatenate(flat), np.concatenate(inside)
    keys, shell_keys = _keys(faces, len(xyz)), _keys(shells, len(xyz))
    _, number, count = np.unique(keys, return_inverse=True, return_counts=True)
    alone = count[number] == 1
    faces, centre = faces[alone], centre[alone]
    a, b, c = (xyz[faces[:, k]] for k in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - centre) < 0
    quads = faces[:, 2] != faces[:, 3]
    faces[inwards & quads] = faces[inwards & quads][:, ::-1]
    faces[inwards & ~quads] = faces[inwards & ~quads][:, [1, 0, 2, 3]]
    faces = np.concatenate([faces, shells[~np.isin(shell_keys, keys)]])  # skins of solids are drawn once
    return faces[np.argsort(faces[:, 2] == faces[:, 3], kind="stable")]


def _keys(faces: Ints, n: int) -> Ints:
    """Return a number for each face that does not depend on the order of its corners.

    It is made of the three smallest corners, which no two faces of a conforming mesh share.
    """
    lowest = np.sort(faces, axis=1)[:, :3]
    triangle = faces[:, 2] == faces[:, 3]
    lowest[triangle] = np.sort(faces[triangle, :3], axis=1)
    return (lowest[:, 0] * n + lowest[:, 1]) * n + lowest[:, 2]


def _coarser(xyz: Floats, triangles: Ints, most: int) -> tuple[Ints, Ints]:
    """Return the vertices that are kept, at most ``most``, and the triangles between them.

    Of the vertices in one cube of a grid the one nearest to their mean stands for all.
    """
    if len(xyz) <= most:
        return np.arange(len(xyz)), triangles
    a, b, c = (xyz[triangles[:, k]] for k in range(3))
    side = np.sqrt(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 / most)
    while True:
        cube, number = np.unique(
            np.floor((xyz - xyz.min(axis=0)) / side).astype(int), axis=0, return_inverse=True
        )
        if len(cube) <= most:
            break
        side *= 1.1
    number = number.ravel()
    mean = np.array([np.bincount(number, x) for x in xyz.T]).T / np.bincount(number)[:, None]
    away = np.linalg.norm(xyz - mean[number], axis=1)
    order = np.lexsort([away, number])
    vertex = order[np.searchsorted(number[order], np.arange(len(cube)))]
    rows = number[triangles]
    rows = rows[(rows[:, 0] != rows[:, 1]) & (rows[:, 1] != rows[:, 2]) & (rows[:, 2] != rows[:, 0])]
    _, first = np.unique(np.sort(rows, axis=1), axis=0, return_index=True)
    used, numbered = np.unique(rows[np.sort(first)], return_inverse=True)
    return vertex[used], numbered.reshape(-1, 3)


def _rows(part: Matrices, xyz: Floats, held: bool) -> Ints:
    """Return the rows of the part's matrices that move places along x, y and z, shape (n, 3)."""
    if not len(part.points):
        msg = "the places of the part's nodes are not known, so that no mesh can be matched to them"
        raise MatricesError(msg)
    size = float(np.ptp(xyz, axis=0).max())
    away, at = scipy.spatial.cKDTree(part.points).query(xyz)
    lost = away > SAME_PLACE * size
    if lost.any():
        k = int(np.argmax(away))
        msg = (
            f"{lost.sum()} of {len(xyz)} surface nodes of the mesh are no nodes of the part: the one at "
            f"({', '.join(f'{v:.4g}' for v in xyz[k])}) m is {away[k]:.3g} m from the nearest; the mesh must "
            "be that of the matrices, in their units"
        )
        raise MatricesError(msg)
    if part.Q is not None:
        return 6 * at[:, None] + np.arange(3)
    key = 7 * part.node + part.direction
    order = np.argsort(key)
    wanted = 7 * part.nodes[at][:, None] + np.arange(1, 4)
    found = order[np.minimum(np.searchsorted(key[order], wanted), max(len(order) - 1, 0))]
    rows = np.where(key[found] == wanted, found, -1)
    still = (rows < 0).all(axis=1)
    if still.any() and not held:
        msg = (
            f"the matrices have no rows of {still.sum()} of {len(xyz)} surface nodes, such as node "
            f"{part.nodes[at[np.argmax(still)]]}, whose motion is therefore unknown; a part that was reduced "
            "to some of its nodes cannot be drawn"
        )
        raise MatricesError(msg)
    return rows


def _sharp_edges(xyz: Floats, triangles: Ints) -> Ints:
    """Return the edges at which faces meet at an angle, or that one face alone has, (n, 2)."""
    a, b, c = (xyz[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    pairs = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1
    )
    face = np.tile(np.arange(len(triangles)), 3)
    order = np.lexsort(pairs.T)
    pairs, face = pairs[order], face[order]
    first = np.flatnonzero(np.r_[True, (pairs[1:] != pairs[:-1]).any(axis=1)])
    count = np.diff(np.r_[first, len(pairs)])
    second = np.minimum(first + 1, len(pairs) - 1)
    cosine = np.einsum("ij,ij->i", normal[face[first]], normal[face[second]])
    return pairs[first][(count != 2) | (cosine < SHARP)]
