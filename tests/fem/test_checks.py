"""Defects of meshes and models: each planted one is found, and named by its points and lines."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fem import (
    AddedMass,
    Frame,
    Joint,
    MechanismError,
    MemberProperties,
    Mesh,
    Model,
    assemble,
    check_mesh,
    check_model,
    solve_modes,
)
from fem.lengths import metres_afterwards, show_lengths
from fem.sections.constants import NO_INERTIA_OF_TORSION
from tests.frames import FLAT, STEEL, beam, chain, cross_beam, fix, mounted, planar, portal, with_part

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
RING = [[0, 1], [1, 2], [2, 3], [3, 0]]


def model_of(mesh, *effects):
    return Model(mesh, (Frame(members={m: MemberProperties(STEEL, FLAT) for m in mesh.members}), *effects))


def kinds(faults):
    return [fault.kind for fault in faults]


@pytest.mark.parametrize(
    "model",
    [cross_beam(), portal(), beam(7), chain(3, 4, stiffness=1e3), mounted(), with_part()],
    ids=["cross", "portal", "beam", "chain", "mounted", "part"],
)
def test_sound_models_have_no_fault(model):
    assert check_model(model) == ()


def test_a_joint_connects_what_the_mesh_does_not():
    model = cross_beam()
    assert kinds(check_mesh(model.mesh)) == ["loose part"]
    (fault,) = check_model(model.without_effect("bolt"))
    assert fault.kind == "loose part"
    assert "'upper' are connected to nothing else" in fault.message
    assert "the nearest points are 4 and 1, 0.01 m apart" in fault.message
    assert set(fault.lines) == set(model.mesh.members["upper"])


def test_coincident_and_nearly_coincident_points():
    points = [*SQUARE, [1, 1, 0], [2, 1, 0]]
    mesh = Mesh.from_lines(points, [*RING, [4, 5]], {"ring": [0, 1, 2, 3], "arm": [4]})
    loose, near = check_mesh(mesh)
    assert (loose.kind, near.kind) == ("loose part", "coincident points")
    assert near.points.tolist() == [2, 4]
    assert "lie at the same place and are not connected; if they are one point, make them one" in near.message
    moved = Mesh.from_lines([*SQUARE, [1, 1, 1e-3], [2, 1, 0]], [*RING, [4, 5]])
    assert "are 0.001 m apart" in check_mesh(moved)[1].message
    assert kinds(check_mesh(moved, tolerance=5e-4)) == ["loose part"]
    # a spring between them is a connection, and then they are no fault
    K = np.diag([1e6] * 3 + [1e3] * 3)
    joint = Joint(name="j", point1=2, point2=4, location=np.array([1.0, 1, 0]), K=K)
    assert check_model(model_of(mesh, joint)) == ()


def test_points_beside_a_line_and_lines_that_cross():
    points = [*SQUARE, [0.4, 1e-3, 0], [0.4, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0]]
    mesh = Mesh.from_lines(points, [*RING, [4, 5], [6, 7]])
    faults = check_mesh(mesh)
    assert sorted(kinds(faults)) == [
        "loose part",
        "loose part",
        "unconnected crossing",
        "unconnected crossing",
    ]
    beside, cross = faults[2:]
    assert beside.points.tolist() == [4]
    assert beside.lines.tolist() == [0]
    assert "0.001 m beside it at (0.4, 0.001, 0) m; divide the line there" in beside.message
    with metres_afterwards():
        show_lengths(0.001)  # as of a deck in mm
        assert "1 mm beside it at (400, 1, 0) mm; divide the line there" in check_mesh(mesh)[2].message
    assert cross.lines.tolist() in ([0, 5], [5, 0])
    assert "cross at (0.5, 0, 0) m, and are not connected" in cross.message


@given(
    seed=st.integers(0, 2**32 - 1), gap=st.floats(0, 1.5), s=st.floats(0.05, 0.95), t=st.floats(0.05, 0.95)
)
@settings(max_examples=40, deadline=None)
def test_crossings_are_found_at_any_angle_exactly_within_the_tolerance(seed, gap, s, t):
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.2, np.pi - 0.2)
    u, v = np.array([1.0, 0, 0]), 0.7 * np.array([np.cos(angle), np.sin(angle), 0])
    tolerance = 0.01
    lift = np.array([0, 0, gap * tolerance])
    points = np.array([-s * u, (1 - s) * u, -t * v + lift, (1 - t) * v + lift])
    points = points @ Rotation.random(random_state=int(rng.integers(2**31))).as_matrix().T + rng.normal(
        size=3
    )
    found = kinds(check_mesh(Mesh.from_lines(points, [[0, 1], [2, 3]]), tolerance))
    if abs(gap - 1) > 1e-9:
        assert ("unconnected crossing" in found) == (gap < 1)


def test_a_large_mesh_has_the_faults_that_a_small_one_has(monkeypatch):
    rng = np.random.default_rng(3)
    points = np.round(rng.uniform(0, 1, (60, 3)), 1)  # some coincide, some lie on lines
    mesh = Mesh.from_lines(points, np.arange(60).reshape(-1, 2), {"all": range(30)})
    small = check_mesh(mesh)
    monkeypatch.setattr("fem.checks.MOST_PAIRS", 0)
    assert len(small) > 5
    assert [f.message for f in check_mesh(mesh)] == [f.message for f in small]


def test_lines_that_meet_are_no_crossing():
    star = [[0, 0, 0]] + [[np.cos(a), np.sin(a), 0] for a in np.linspace(0, 2 * np.pi, 7)[:-1]]
    assert check_mesh(Mesh.from_lines(star, [[0, k] for k in range(1, 7)])) == ()
    assert check_mesh(Mesh.from_lines(SQUARE, [*RING, [0, 2]]).split(5)) == ()
    assert kinds(check_mesh(Mesh.from_lines(SQUARE, [*RING, [0, 2], [1, 3]]))) == ["unconnected crossing"]


def test_a_long_line_beside_its_own_many_pieces_is_no_fault_but_the_short_ones():
    mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1], [1, 2]]).split([200, 1])
    (fault,) = check_mesh(mesh)
    assert fault.kind == "short line"
    assert fault.lines.tolist() == [199]


def test_lines_that_overlap_are_found():
    """From one point in one direction: the shorter one's end lies on the longer one."""
    (fault,) = check_mesh(Mesh.from_lines([[0, 0, 0], [1, 0, 0], [0.4, 0, 0]], [[0, 1], [0, 2]]))
    assert fault.kind == "unconnected crossing"
    assert fault.points.tolist() == [2]
    assert "lies on it" in fault.message


def test_duplicate_short_and_unused():
    points = [[0, 0, 0], [1, 0, 0], [1.005, 0, 0], [9, 9, 9]]
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2], [1, 0]], {"a": [0, 1], "b": [2]})
    unused, duplicate, short = check_mesh(mesh)
    assert unused.points.tolist() == [3]
    assert unused.message == "point 3 is on no line and no joint; leave it out"
    assert sorted(duplicate.lines) == [0, 2]
    assert "2 lines of members 'a' and 'b' join the same points 0 and 1" in duplicate.message
    assert short.lines.tolist() == [1]
    assert "0.005 m long next to one of 1 m" in short.message


def test_members_without_properties():
    mesh = Mesh.from_lines(SQUARE, RING, {"a": [0, 1], "b": [2, 3]})
    names = list(mesh.members)
    frame = Frame(members={names[0]: MemberProperties(STEEL, FLAT)})
    faults = check_model(Model(mesh, (frame,)))
    assert kinds(faults) == ["no properties"] * (len(names) - 1)
    assert faults[0].message == f"member '{names[1]}' has no material and section; given are {names[0]}"


def test_a_mechanism_comes_with_its_motions():
    model = chain(3, 4)  # two hinges that pass no moment: two bending motions of each, and a twist
    (fault,) = check_model(model)
    assert fault.kind == "mechanism"
    assert fault.motions.shape == (model.n_dof, 6)
    system = assemble(model)
    q = system.Q.T @ fault.motions
    np.testing.assert_allclose(system.Q @ q, fault.motions, atol=1e-12)
    # the energy of each is rounding, of what its entries would give one by one
    terms = np.einsum("ij,ij->j", abs(q), abs(system.K) @ abs(q))
    assert (abs(np.einsum("ij,ij->j", q, system.K @ q)) <= 1e-10 * terms).all()
    assert np.linalg.matrix_rank(fault.motions, tol=1e-6) == 6
    size = np.tile(np.repeat([1.0, model.mesh.size], 3), model.mesh.n_points)
    np.testing.assert_allclose(abs(size[:, None] * fault.motions).max(axis=0), 1.0)
    with pytest.raises(MechanismError) as error:
        solve_modes(system)
    np.testing.assert_array_equal(error.value.motions, fault.motions)


def test_a_straight_frame_of_lumped_masses_turns_without_mass():
    """About its axis; a rotary inertia there is all that it lacks."""
    x = np.linspace(1.0, 2.0, 4)
    mesh = Mesh.from_lines(np.c_[x, 2 * x, 0 * x], [[0, 1], [1, 2], [2, 3]], {"bar": range(3)})
    section = replace(FLAT, Ip=NO_INERTIA_OF_TORSION * (FLAT.Iy + FLAT.Iz))  # as of a CBAR
    bar = MemberProperties(STEEL, section, mass="lumped-slender")
    model = Model(mesh, (Frame(members={"bar": bar}),))
    fault = check_model(model)[0]
    assert fault.kind == "mechanism"
    assert "turns about the line through (1.5, 3, 0) m along (0.447, 0.894, 0)" in fault.message
    assert "without any mass" in fault.message
    at = fault.motions[:, 0].reshape(-1, 6)
    np.testing.assert_allclose(at[:, :3], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.cross(at[:, 3:], [1.0, 2.0, 0.0]), 0.0, atol=1e-9)
    with pytest.raises(MechanismError, match="without any mass"):
        solve_modes(assemble(model), n=3)
    held = model.with_effect(AddedMass(name="disc", point=0, mass=0.1, inertia=1e-3 * np.eye(3)))
    assert "mechanism" not in kinds(check_model(held))


def test_a_mechanism_beside_a_support():
    """A pinned column that leans: one motion in its plane, and the free points are those that move."""
    model = planar(chain(2, 3, (fix(0),)), keep=("z", "ry"))
    faults = check_model(model)
    assert kinds(faults) == ["mechanism"]
    (fault,) = faults
    assert fault.motions.shape[1] == 1
    moved = np.unique(np.flatnonzero(abs(fault.motions[:, 0]) > 1e-9) // 6)
    assert set(moved) == set(model.mesh.member_points("m1"))
    assert set(fault.points) <= set(moved)


def test_a_model_that_cannot_be_assembled_says_why():
    mesh = Mesh.from_lines(SQUARE, RING)
    broken = replace(MemberProperties(STEEL, FLAT), rigid1=2.0)
    frame = Frame(members=dict.fromkeys(mesh.members, broken))
    (fault,) = check_model(Model(mesh, (frame,)))
    assert fault.kind == "model"
    assert "rigid end zone of 2 m does not fit" in fault.message
