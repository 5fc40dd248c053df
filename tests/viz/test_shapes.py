"""Surfaces: exact geometry and kinematics, no screen."""

import numpy as np
import pytest

from fem import Frame, Material, MemberProperties, Mesh, Model, Section
from tests.noise import complex_normal
from viz import models, shapes, surfaces
from viz.layout import merge_names, place_labels
from viz.surfaces import circle_of_area, triangulate

STEEL = Material("steel", 210e9, 7850)
BOX = Section.hollow_rectangle(0.04, 0.06, 0.003)
SECTIONS = {
    "rectangle": Section.rectangle(0.03, 0.01),
    "hollow": BOX,
    "tube": Section.tube(0.05, 0.004),
    "I": Section.i_section(0.08, 0.1, 0.008, 0.006),
}


def signed_volume(vertices, triangles):
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


def line_rotations(points, lines):
    """Return default local axes of lines: x along, z as upright as possible, shape (n_lines, 3, 3).

    Vertical lines take global y for their local y.
    """
    points, lines = np.asarray(points, dtype=float), np.asarray(lines, dtype=np.int64)
    x = points[lines[:, 1]] - points[lines[:, 0]]
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross([0.0, 0.0, 1.0], x)
    upright = np.linalg.norm(y, axis=1) < 1e-6
    y[upright] = [0.0, 1.0, 0.0]
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def one_line(section, motion=None, pieces=6, **more):
    points, lines = np.array([[0.1, 0.2, 0.3], [1.1, 1.2, 0.8]]), [[0, 1]]
    R = line_rotations(points, lines)
    return surfaces.extrude(points, lines, R, [section.outlines], motion, pieces=pieces, **more), points, R[0]


@pytest.mark.parametrize("name", SECTIONS)
def test_a_swept_section_encloses_its_polygon_area_times_length(name):
    section = SECTIONS[name]
    surface, points, _ = one_line(section)

    def area(loop):
        y, z = loop.T
        return abs(float((y * np.roll(z, -1) - np.roll(y, -1) * z).sum())) / 2

    outer, *holes = section.outlines
    expected = (area(outer) - sum(map(area, holes))) * np.linalg.norm(points[1] - points[0])
    assert signed_volume(surface.rest, surface.triangles) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", SECTIONS)
def test_end_faces_are_triangulated_without_overlap(name):
    loops = SECTIONS[name].outlines
    turned = [loop if i == 0 else loop[::-1] for i, loop in enumerate(loops)]  # both are given anticlockwise
    xy = np.vstack(turned)
    triangles = triangulate(loops)
    a, b, c = (xy[triangles[:, k]] for k in range(3))
    areas = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert (areas > 0).all()
    assert len(triangles) == len(xy) - 2 + 2 * (len(loops) - 1)


def test_end_cross_sections_lie_at_the_nodes_and_have_the_section_s_dimensions():
    surface, points, R = one_line(SECTIONS["rectangle"])
    for rows, point in ((slice(0, 4), points[0]), (slice(-4, None), points[1])):
        local = (surface.rest[rows] - point) @ R.T
        assert np.allclose(local[:, 0], 0, atol=1e-15)
        assert np.allclose(np.abs(local[:, 1]), 0.015)
        assert np.allclose(np.abs(local[:, 2]), 0.005)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 5.0])
def test_a_rigid_motion_keeps_every_cross_section_s_dimensions(scale):
    points = np.array([[0.1, 0.2, 0.3], [1.1, 1.2, 0.8]])
    theta, u = np.array([0.2, -0.3, 0.4]), np.array([0.05, 0.02, -0.01])
    motion = np.array([[*(u + np.cross(theta, p)), *theta] for p in points])
    surface, *_ = one_line(BOX, motion)
    before, after = (v.reshape(7, 8, 3) for v in (surface.rest, surface.deformed(scale)))
    distances = [np.linalg.norm(v[:, :, None] - v[:, None, :], axis=3) for v in (before, after)]
    assert np.allclose(distances[0], distances[1], rtol=1e-12, atol=1e-14)


def test_to_first_order_a_rigid_motion_moves_every_vertex_rigidly():
    points = np.array([[0.1, 0.2, 0.3], [1.1, 1.2, 0.8]])
    theta, u = np.array([0.2, -0.3, 0.4]), np.array([0.05, 0.02, -0.01])
    motion = np.array([[*(u + np.cross(theta, p)), *theta] for p in points])
    surface, *_ = one_line(BOX, motion)
    assert np.allclose(surface.displacement, u + np.cross(theta, surface.rest), atol=1e-15)
    h = 1e-6
    slope = (surface.deformed(h) - surface.deformed(-h)) / (2 * h)
    assert np.allclose(slope, surface.displacement, atol=1e-9)


def test_large_deformations_keep_cross_sections_at_right_angles_to_the_bent_axis():
    L = 2.0
    motion = np.array([[0, 0, 0, 0, 0, 0], [0, 0, 0.3, 0, -0.6, 0.0]])
    points = np.array([[0.0, 0, 0], [L, 0, 0]])
    R = line_rotations(points, [[0, 1]])
    surface = surfaces.extrude(points, [[0, 1]], R, [BOX.outlines], motion, pieces=200)
    rings = surface.deformed(1.0).reshape(201, 8, 3)
    axis = np.gradient(rings.mean(axis=1), axis=0)[1:-1]
    across = (rings - rings.mean(axis=1, keepdims=True))[1:-1]
    cosine = np.einsum("ki,kji->kj", axis, across) / np.linalg.norm(axis, axis=1)[:, None] / 0.03
    assert np.abs(cosine).max() < 1e-4


def test_hermite_interpolation_reproduces_a_cubic_in_both_planes():
    L, xi = 1.7, np.linspace(0, 1, 13)
    x = L * xi
    v, w = np.poly1d([0.4, -1.1, 0.7, 0.2]), np.poly1d([-0.3, 0.5, 0.9, -0.4])
    ends = [[0.1, v(0), w(0)], [0.3, v(L), w(L)]]
    rotations = [[0.5, -w.deriv()(0), v.deriv()(0)], [-0.1, -w.deriv()(L), v.deriv()(L)]]
    u, theta = surfaces.hermite(xi, L, ends, rotations)
    assert np.allclose(u, np.stack([0.1 + 0.2 * xi, v(x), w(x)], axis=1), atol=1e-14)
    assert np.allclose(theta, np.stack([0.5 - 0.6 * xi, -w.deriv()(x), v.deriv()(x)], axis=1), atol=1e-13)


def test_rigid_arms_carry_the_axis_with_the_node():
    arms = np.array([[[0, 0, 0.1], [0, 0, 0.1]]])
    points = np.array([[0.0, 0, 0], [1, 0, 0]])
    motion = np.array([[0, 0, 0, 0, 0.2, 0], [0, 0, -0.2, 0, 0.2, 0.0]])  # rigid rotation about y
    R = line_rotations(points, [[0, 1]])
    surface = surfaces.extrude(
        points, [[0, 1]], R, [BOX.outlines], motion, arms=arms, rigid=[[0.1, 0.2]], pieces=4
    )
    assert np.allclose(surface.displacement, np.cross([0, 0.2, 0], surface.rest), atol=1e-15)
    assert surface.centre[:, 0].min() == 0
    assert surface.centre[:, 0].max() == 1
    assert np.allclose(surface.centre[:, 2], 0.1)


def test_a_section_without_outline_becomes_a_circle_of_about_its_area():
    loop = circle_of_area(2e-4, n=400)
    assert np.allclose(np.linalg.norm(loop, axis=1) ** 2 * np.pi, 2e-4)
    frame = Frame(members={"bar": MemberProperties(STEEL, Section(2e-4, 1e-8, 1e-8, 1e-8))})
    model = Model(Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]], {"bar": [0]}), (frame,))
    surface = models.model_surface(model)
    assert np.allclose(np.linalg.norm(surface.arm, axis=1), np.sqrt(2e-4 / np.pi))


def test_amplification_makes_the_largest_displacement_a_fraction_of_the_size():
    motion = np.array([[0, 0, 0, 0, 0, 0], [0, 0, 3e-4, 0, 0, 0.0]])
    surface, *_ = one_line(BOX, motion)
    scale = shapes.amplification(surface, 1.5, fraction=0.08)
    moved = scale * np.linalg.norm(surface.displacement, axis=1).max()
    assert moved == pytest.approx(0.08 * 1.5)


def test_amplification_limits_the_twist_of_a_slender_bar():
    motion = np.array([[0, 0, 0, 0, 0, 0], [0, 0, 0, 1.0, 1.0, 0.5]])
    twist = np.array([[0.0] * 6, [0, 0, 0, *(np.array([1, 1, 0.5]) / 1.5)]])
    surface, *_ = one_line(BOX, twist)
    assert shapes.amplification(surface, 1.5) == pytest.approx(0.7)
    assert shapes.amplification(one_line(BOX, 0 * motion)[0], 1.5) == 1.0


def test_model_displacements_beside_the_axis_follow_the_cross_section():
    mesh = Mesh.from_lines([[0, 0, 0], [2, 0, 0]], [[0, 1]], {"bar": [0]})
    model = Model(mesh, (Frame(members={"bar": MemberProperties(STEEL, BOX)}),))
    theta, u = np.array([0.2, -0.3, 0.4]), np.array([0.05, 0.02, -0.01])
    motion = np.concatenate([[*(u + np.cross(theta, p)), *theta] for p in mesh.points])
    places = np.array([[0.3, 0, 0.03], [1.7, 0.02, 0], [1.0, 0, 0]])
    assert np.allclose(models.displacement_at(model, motion, places), u + np.cross(theta, places), atol=1e-14)
    assert np.allclose(models.displacement_at(model, 1j * motion, places).imag, u + np.cross(theta, places))


def test_corners_are_filled_to_the_outside_and_inner_faces_left_out():
    mesh = Mesh.from_lines([[0, 0, 0], [0, 0, 1], [1, 0, 1]], [[0, 1], [1, 2]], {"column": [0], "beam": [1]})
    p = MemberProperties(STEEL, Section.rectangle(0.04, 0.1))
    surface = models.model_surface(Model(mesh, (Frame(members={"column": p, "beam": p}),)))
    assert surface.rest[:, 2].max() == pytest.approx(1.05, abs=2e-3)
    assert surface.rest[:, 0].min() == pytest.approx(-0.05, abs=2e-3)
    assert surface.centre[:, 2].min() == 0


def test_refining_a_member_leaves_its_surface_closed():
    mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]], {"bar": [0]})
    frame = Frame(members={"bar": MemberProperties(STEEL, BOX)})
    volume = [
        signed_volume(s.rest, s.triangles)
        for s in (models.model_surface(Model(mesh.refined(counts={"bar": n}), (frame,))) for n in (1, 7))
    ]
    assert volume[0] == pytest.approx(BOX.A, rel=1e-9)
    assert volume[1] == pytest.approx(BOX.A, rel=1e-9)


def test_arrows_begin_outside_the_section():
    mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]], {"bar": [0]})
    model = Model(mesh, (Frame(members={"bar": MemberProperties(STEEL, BOX)}),))
    places = models.surface_places(model, [[0.5, 0, 0]] * 3, [[0, 0, 2], [0, -1, 0], [1, 0, 0]], [0, 0, 1])
    assert np.allclose(places, [[0.5, 0, 0.03], [0.5, -0.02, 0], [0.5, 0, 0.03]])


def test_matching_recovers_scale_and_sign_of_a_measured_shape():
    rng = np.random.default_rng(3)
    directions = np.eye(3)[rng.integers(0, 3, 12)]
    computed = complex_normal(rng, (12, 3))
    readings = np.einsum("ij,ij->i", computed, directions)[:, None] * directions
    assert shapes.match_scale(readings / (-2.5 + 1j), computed) == pytest.approx(-2.5 + 1j)


def test_components_at_one_place_are_grouped_only_at_right_angles():
    points = [[0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 0, 0]]
    vectors = [[1, 0, 0], [0, 2, 0], [0, 0, 1], [1, 0, 0]]
    assert shapes.group_components(points, vectors, 1e-9) == [[0, 1], [2], [3]]


def test_a_complex_shape_is_turned_to_its_largest_real_part():
    phi = np.array([1.0, -2.0, 0.5])
    got = shapes.real_shape(phi * np.exp(0.7j))
    assert np.allclose(np.abs(got), np.abs(phi))


def test_wrong_sizes_are_named():
    with pytest.raises(ValueError, match=r"motion has shape \(1, 6\); \(2, 6\) is expected"):
        one_line(BOX, np.zeros((1, 6)))


def test_labels_do_not_overlap_and_avoid_what_is_taken():
    rng = np.random.default_rng(0)
    anchors = rng.uniform([300, 200], [900, 600], (60, 2))
    sizes = np.tile([52.0, 14.0], (60, 1))
    spots = place_labels(anchors, sizes, np.zeros((800, 1200), dtype=bool), [(0, 0, 400, 300)])
    boxes = np.hstack([spots.centre - sizes / 2, spots.centre + sizes / 2])[spots.shown]
    assert spots.shown.sum() > 45
    for k, a in enumerate(boxes):
        assert a[0] > 400 or a[1] > 300
        for b in boxes[k + 1 :]:
            assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]


def test_labels_prefer_empty_ground():
    occupied = np.zeros((400, 400), dtype=bool)
    occupied[:, 200:] = True
    spots = place_labels([[200, 200]], [[60, 14]], occupied)
    assert spots.centre[0, 0] + 30 <= 201


def test_names_at_one_place_are_merged():
    got = merge_names(["P1y", "P2z", "P1x", "hammer"], [[0, 0, 0], [1, 0, 0], [0, 0, 0], [1, 0, 0]], 1e-6)
    assert got == [("P1x,y", 0), ("P2z, hammer", 1)]
    for names, label in (
        (["101X+", "101Z+", "101Y+"], "101X+,Y+,Z+"),
        (["P1x", "P10x"], "P1x, P10x"),
        (["A", "A"], "A, A"),
    ):
        assert merge_names(names, np.zeros((len(names), 3)), 1e-6) == [(label, 0)]
