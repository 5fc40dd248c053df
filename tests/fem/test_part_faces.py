"""The surface of an imported part: faces that one cell alone has, in any mixture of cells."""

import meshio
import numpy as np
import pytest

from fem import Matrices
from fem.elements.part_faces import PartFaces
from fem.io import MatricesError, read_part_faces

CUBE = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=float)
MIDDLE = np.vstack([CUBE, [[0.5, 0.5, 0.5]]])
SIDES = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))
CELLS = {
    "hexahedron": [("hexahedron", [[0, 1, 2, 3, 4, 5, 6, 7]])],
    "wedge": [("wedge", [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]])],
    "pyramid": [("pyramid", [[*side, 8] for side in SIDES])],
    "tetra": [("tetra", [[0, *pair, 6] for pair in ((1, 2), (2, 3), (3, 7), (7, 4), (4, 5), (5, 1))])],
    "mixed": [
        ("pyramid", [[*side, 8] for side in SIDES[:3]]),
        ("tetra", [[a, b, c, 8] for p, q, r, s in SIDES[3:] for a, b, c in ((p, q, r), (p, r, s))]),
    ],
}


def part_of(points, held_back=()):
    """Return a part with three rows for each node, but for some nodes."""
    number = np.arange(len(points)) + 11
    node = np.repeat(np.setdiff1d(number, held_back), 3)
    unit = np.eye(node.size)
    return Matrices.from_arrays(unit, unit, node, np.tile([1, 2, 3], node.size // 3), number, points)


def volume(faces):
    """Return the enclosed volume by the divergence theorem, positive where triangles look outwards."""
    a, b, c = (faces.points[faces.triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("kind", CELLS)
def test_a_cube_of_any_cells_has_its_surface(kind):
    faces = PartFaces.of_cells(part_of(MIDDLE), MIDDLE, CELLS[kind])
    assert volume(faces) == pytest.approx(1.0)
    assert len(faces.points) == 8  # the middle is not on the surface
    assert len(faces.triangles) == 12
    ends = np.sort(faces.points[faces.edges], axis=1)
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert sorted(lengths) == pytest.approx([1.0] * 12)  # diagonals of sides are not sharp


def test_two_cells_share_no_face_and_skins_are_drawn_once():
    points = np.vstack([CUBE, CUBE[[1, 2, 5, 6]] + [1, 0, 0]])
    cells = [("hexahedron", [[0, 1, 2, 3, 4, 5, 6, 7], [1, 8, 9, 2, 5, 10, 11, 6]]), ("quad", [[0, 3, 2, 1]])]
    faces = PartFaces.of_cells(part_of(points), points, cells)
    assert volume(faces) == pytest.approx(2.0)
    assert len(faces.triangles) == 20


def test_middle_nodes_of_quadratic_cells_are_no_corners():
    ends = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
    points = np.vstack([CUBE, [(CUBE[a] + CUBE[b]) / 2 for a, b in ends]])
    faces = PartFaces.of_cells(part_of(points), points, [("hexahedron20", [list(range(20))])])
    assert len(faces.points) == 8
    assert volume(faces) == pytest.approx(1.0)


def test_a_shell_has_its_rim_and_its_fold():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, 1], [1, 1, 1.0]])
    faces = PartFaces.of_cells(part_of(points), points, [("quad", [[0, 1, 2, 3], [1, 4, 5, 2]])])
    assert len(faces.triangles) == 4
    assert len(faces.edges) == 7


def test_vertices_move_with_the_rows_of_their_nodes():
    points = MIDDLE[::-1]
    part = part_of(points)
    faces = PartFaces.of_cells(part, MIDDLE, CELLS["hexahedron"])
    motion = np.arange(part.n, dtype=float)
    at = [np.flatnonzero((points == place).all(axis=1))[0] for place in faces.points]
    np.testing.assert_array_equal(faces.motion(part, motion), motion.reshape(-1, 3)[at])


def test_what_eliminated_constraints_move_is_drawn():
    """Node 12 follows node 11; one coordinate moves both."""
    Q = np.zeros((6 * 3, 7))
    Q[[0, 6], 0] = 1.0
    Q[12:15, 1:4] = np.eye(3)
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    unit = np.eye(7)
    part = Matrices.from_arrays(unit, unit, -np.ones(7), np.zeros(7), [11, 12, 13], points, Q=Q)
    faces = PartFaces.of_cells(part, points, [("triangle", [[0, 1, 2]])])
    moved = faces.motion(part, np.array([1.0, 0, 2.0, 0, 0, 0, 0]))
    np.testing.assert_array_equal(moved, [[1, 0, 0], [1, 0, 0], [0, 2, 0]])


def test_fine_surfaces_are_drawn_coarser():
    n = 60
    u = np.linspace(0, np.pi, n)
    phi, theta = np.meshgrid(2 * u, u, indexing="ij")
    sphere = np.stack([np.cos(phi) * np.sin(theta), np.sin(phi) * np.sin(theta), np.cos(theta)], axis=-1)
    points, number = np.unique(np.round(sphere.reshape(-1, 3), 12), axis=0, return_inverse=True)
    at = number.reshape(n, n)
    quads = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1, 4)
    cells = [
        ("triangle", [q[:3] for q in quads if len(set(q[:3].tolist())) == 3]),
        ("triangle", [q[[0, 2, 3]] for q in quads if len(set(q[[0, 2, 3]].tolist())) == 3]),
    ]
    part = part_of(points)
    fine = PartFaces.of_cells(part, points, cells)
    coarse = PartFaces.of_cells(part, points, cells, most_vertices=600)
    assert 300 < len(coarse.points) <= 600 < len(fine.points)
    assert abs(volume(coarse)) == pytest.approx(4 * np.pi / 3, rel=0.05)
    away = np.linalg.norm(coarse.points[:, None] - points, axis=2).min(axis=1)
    np.testing.assert_array_equal(away, 0.0)  # vertices are nodes, whose motion is known


def test_a_file_is_read_in_its_units(tmp_path):
    meshio.Mesh(1e3 * CUBE, [("hexahedron", np.arange(8)[None])]).write(tmp_path / "cube.vtu")
    faces = read_part_faces(tmp_path / "cube.vtu", part_of(CUBE), "mm-t-s")
    np.testing.assert_allclose(np.sort(faces.points, axis=0), np.sort(CUBE, axis=0))


@pytest.mark.parametrize(
    ("units", "cells", "words"),
    [
        ("SI", [("hexahedron", np.arange(8)[None])], r"7 of 8 surface nodes .* in their units"),
        ("mm-t-s", [("line", np.array([[0, 1]]))], "no solid or shell cells that could be drawn.*: line"),
    ],
)
def test_a_mesh_of_something_else_is_refused(tmp_path, units, cells, words):
    meshio.Mesh(1e3 * CUBE, cells).write(tmp_path / "cube.vtu")
    with pytest.raises(MatricesError, match=rf"cube\.vtu: .*{words}"):
        read_part_faces(tmp_path / "cube.vtu", part_of(CUBE), units)


def test_a_part_without_rows_on_its_surface_must_be_held():
    cells, part = CELLS["hexahedron"], part_of(CUBE, held_back=[13])
    with pytest.raises(MatricesError, match=r"no rows of 1 of 8 surface nodes, such as node 13, .*reduced"):
        PartFaces.of_cells(part, CUBE, cells)
    faces = PartFaces.of_cells(part, CUBE, cells, held=True)
    still = (faces.points == CUBE[2]).all(axis=1)
    moved = faces.motion(part, np.ones(part.n))
    np.testing.assert_array_equal(moved, np.where(still[:, None], 0.0, 1.0) * np.ones((8, 3)))


def test_a_missing_or_broken_file_is_refused_in_one_line(tmp_path):
    with pytest.raises(MatricesError, match="there is no file"):
        read_part_faces(tmp_path / "none.vtu", part_of(CUBE))
    (tmp_path / "broken.vtu").write_text("<VTKFile>")
    with pytest.raises(MatricesError, match=r"broken\.vtu: it cannot be read as \.vtu"):
        read_part_faces(tmp_path / "broken.vtu", part_of(CUBE))
