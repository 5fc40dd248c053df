"""Joints that act over a stretch of their members: mean motions, closed forms, elements on them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fem
from dovetail import load_study
from fem import (
    Damping,
    Frame,
    Joint,
    MemberProperties,
    Mesh,
    Model,
    Section,
    assemble,
    compute_frf,
    dofs_of,
    lever_matrix,
    solve_static,
)
from fem.effects import JointPatch
from fem.effects.joint_patch import turning_parameters, with_patch
from tests.frames import FLAT, FLAT_STEEL, STEEL, fix
from updating import Nuisance, update
from updating.inference import PATCH_ELEMENTS, PATCH_REACH, TWIST_STD, refined_at, with_turning

RIGID = ("x", "y", "z", "rx", "ry", "rz")
GAP = 0.01


def lap(n=40, *, angle=90.0, overhang=0.02, sections=(FLAT, FLAT), **joint):
    """Return flat A along x and flat B above it, which begins a bit before the joint in A's middle."""
    turn = np.deg2rad(angle)
    along = np.array([np.cos(turn), np.sin(turn), 0.0])
    middle = np.array([0.3, 0.0, GAP])
    points = [[0, 0, 0], [0.6, 0, 0], middle - overhang * along, middle + 0.4 * along]
    mesh = Mesh.from_lines(points, [[0, 1], [2, 3]], {"A": [0], "B": [1]})
    mesh = mesh.with_point_on("A", 0.3, "JA").with_point_on("B", overhang, "JB")
    one, two = mesh.point_names["JA"], mesh.point_names["JB"]
    frame = Frame(members={m: MemberProperties(STEEL, s) for m, s in zip("AB", sections, strict=True)})
    between = Joint(
        name="J",
        point1=one,
        point2=two,
        location=(mesh.points[one] + mesh.points[two]) / 2,
        **(joint or {"rigid": RIGID}),
    )
    return Model(mesh.refined(size=0.6 / n), (frame, between), Damping.structural(0.01))


def patched(model, size):
    (patch,) = JointPatch.propose(model)
    return model.with_effect(patch.with_values(size=size))


def test_a_stretch_is_as_long_as_the_other_member_is_broad():
    (patch,) = JointPatch.propose(lap())
    ((a, b),) = patch.sides
    assert (a.member, b.member) == ("A", "B")
    assert_allclose([a.position, b.position], [0.3, 0.02])
    assert_allclose([a.half, b.half], 0.015)  # FLAT is 30 mm broad
    assert patch.where == "joint J"
    assert_allclose(patch.with_values(size=0.5).lengths(), 0.015)
    ((a, _),) = JointPatch.propose(lap(angle=45.0))[0].sides
    assert a.half == pytest.approx(0.015 / np.sin(np.pi / 4))
    assert JointPatch.propose(lap(angle=10.0)) == ()  # along each other
    assert JointPatch.propose(patched(lap(), 1.0)) == ()


def test_rigid_motions_of_patches_are_those_of_their_points():
    model = patched(lap(), 1.0)
    patch = model.effect("joint_patch:all")
    joint = model.effect("J")
    motion = np.vstack([lever_matrix(p) for p in model.mesh.points])  # about the origin
    for one, two in ((joint.point1, joint.point2), (joint.point2, joint.point1)):
        dofs, rows = patch.mean(model, one, two)
        assert_allclose(rows @ motion[dofs], motion[dofs_of(one)], atol=1e-12)
    assert patch.mean(model, joint.point1, None) is None
    assert patched(lap(), 0.0).effect("joint_patch:all").mean(model, joint.point1, joint.point2) is None


def test_the_mean_of_a_bent_stretch_is_that_of_least_squares():
    """Of w = x² about the joint over ±a: w₀ = a²/3, and the slope of x³ is 3a²/5 by displacements alone."""
    model = patched(lap(60), 1.0)
    joint, patch, a = model.effect("J"), model.effect("joint_patch:all"), 0.015
    dofs, rows = patch.mean(model, joint.point1, joint.point2)
    x = model.mesh.points[:, 0] - 0.3
    u = np.zeros((model.mesh.n_points, 6))
    u[:, 2], u[:, 4] = x**2, -2 * x
    assert rows[2] @ u.ravel()[dofs] == pytest.approx(a**2 / 3, rel=1e-6)
    u[:, 2], u[:, 4] = x**3, -3 * x**2
    # displacements turn it by ∫x⁴/∫x² = 3a²/5, the cross-sections' turns of mean a² count by I/A = h²/12
    inertia, own = a**2 / 3, 0.01**2 / 12
    expected = -(inertia * 3 * a**2 / 5 + own * a**2) / (inertia + own)
    assert rows[4] @ u.ravel()[dofs] == pytest.approx(expected, rel=0.02)  # the shape's own shear


def test_a_member_that_ends_in_a_patch_is_shorter_in_torsion():
    """By a torque at its tip, with the other as good as rigid: by a third of half the patch."""
    stiff = replace(FLAT, A=1e3 * FLAT.A, Iy=1e6 * FLAT.Iy, Iz=1e6 * FLAT.Iz, J=1e6 * FLAT.J)
    model = lap(240, sections=(stiff, FLAT))
    (patch,) = JointPatch.propose(model)
    ((a, b),) = patch.sides
    patch = replace(patch, sides=((a._replace(half=1e-9), b._replace(half=0.015)),), size=1.0)
    held = [fix(0), fix(1)]
    turn = []
    for effects in ((), (patch,)):
        whole = model.with_effect(*held, *effects)
        load = np.zeros(whole.n_dof)
        load[6 * 3 + 4] = 1.0
        turn.append(solve_static(assemble(whole), load).displacements.reshape(-1, 6)[3, 4])
    GJ = STEEL.G * FLAT.J
    assert turn[0] == pytest.approx(0.4 / GJ, rel=1e-3)
    assert turn[0] - turn[1] == pytest.approx(0.015 / 3 / GJ, rel=0.05)  # elements of 2.5 mm


def test_elastic_and_rigid_joints_have_patches_and_other_effects_see_them():
    k = np.diag([1e11] * 3 + [1e8] * 3)
    f, at = np.linspace(5.0, 900.0, 40), [(1, "z"), (3, "z"), (3, "ry")]
    rigid, elastic, plain = (
        compute_frf(assemble(m), f, at, at, method="direct").H
        for m in (patched(lap(), 1.0), patched(lap(K=k), 1.0), lap())
    )
    assert_allclose(elastic, rigid, rtol=0, atol=2e-3 * abs(rigid).max())
    assert abs(plain - rigid).max() > 0.1 * abs(rigid).max()
    soft = fem.effects.JointStiffness(
        name="s", joints=("J",), direction="rx", stiffness=500.0, assumed=np.inf
    )
    loose = patched(lap(rigid=("x", "y", "z", "ry", "rz"), K=np.diag([0, 0, 0, 500.0, 0, 0])), 1.0)
    given = compute_frf(assemble(loose), f, at, at, method="direct").H
    found = compute_frf(assemble(patched(lap(), 1.0).with_effect(soft)), f, at, at, method="direct").H
    assert_allclose(found, given, rtol=0, atol=1e-6 * abs(given).max())


def test_patches_hardly_depend_on_the_mesh():
    """Elements as long as half the stretch leave 0.2 % of a tip's compliance."""
    coarse, fine = (solve_static_of(patched(lap(n), 1.0)) for n in (60, 240))
    assert_allclose(coarse, fine, rtol=2e-3)


def solve_static_of(model):
    held = model.with_effect(fix(0), fix(1))
    loads = np.zeros((held.n_dof, 2))
    loads[6 * 3 + 2, 0] = loads[6 * 3 + 4, 1] = 1.0
    u = solve_static(assemble(held), loads).displacements
    return np.array([u[6 * 3 + 2, 0], u[6 * 3 + 4, 1]])


DOUBTS = (Nuisance("frame", "E:steel", 0.02), Nuisance("frame", "rho:steel", 0.01))


def test_joints_at_hinges_zones_bars_and_tapers_have_no_patch():
    model = lap()
    (frame,) = model.of_kind(Frame)
    plain = frame.members["B"]
    for other in (
        replace(plain, release1=("ry",)),
        replace(plain, spring1={"ry": 50.0}),
        replace(plain, section2=FLAT),
        replace(plain, theory="bar"),
        replace(plain, rigid1=0.01),
    ):
        changed = replace(frame, members={**frame.members, "B": other})
        assert JointPatch.propose(Model(model.mesh, (changed, model.effect("J")))) == ()


def test_members_far_apart_have_no_patch():
    model = lap()
    (frame,) = model.of_kind(Frame)
    thin = MemberProperties(STEEL, Section.rectangle(0.03, 0.002))  # 2 mm thick, 10 mm apart
    assert (
        JointPatch.propose(Model(model.mesh, (Frame(members=dict.fromkeys("AB", thin)), model.effect("J"))))
        == ()
    )
    assert JointPatch.propose(Model(model.mesh, (frame, model.effect("J"))))


def test_members_that_butt_have_no_patch():
    """A joint in one point, or from an end to a side: nothing lies on anything."""
    for apart in ([0, 0, 0], [0, 0.01, 0]):
        points = [[0, 0, 0], [0.6, 0, 0], [0.3, *apart[1:]], [0.3, 0.4, 0]]
        mesh = Mesh.from_lines(points, [[0, 1], [2, 3]], {"A": [0], "B": [1]}).with_point_on("A", 0.3, "JA")
        frame = Frame(members={m: MemberProperties(STEEL, FLAT) for m in "AB"})
        butt = Joint(
            name="J", point1=mesh.point_names["JA"], point2=2, location=np.array([0.3, 0, 0]), rigid=RIGID
        )
        assert JointPatch.propose(Model(mesh, (frame, butt))) == ()


DISC = 4 * np.pi * STEEL.G * 0.015**2 * 0.01 / 2
"""Two flats of 30 x 10 mm in series, each of which holds a disc of 30 mm in its plane [N·m/rad]."""


def turning(model, twist, size=0.0):
    (patch,) = JointPatch.propose(model)
    return with_patch(model, patch.with_values(size=size, twist=twist))


def test_flats_turn_about_the_normal_of_a_patch_as_about_a_disc():
    model = turning(lap(), 0.5)
    joint = model.effect("J")
    assert joint.rigid == ("x", "y", "z", "rx", "ry")
    assert_allclose(joint.K, np.diag([0, 0, 0, 0, 0, 0.5 * DISC]), rtol=1e-9)
    assert turning_parameters(model) == (("J", "krz"),)
    assert turning(lap(), 0.0).effect("J").rigid == RIGID
    assert turning_parameters(turning(lap(), 0.0)) == ()
    wide = Section.rectangle(0.06, 0.01)
    (patch,) = JointPatch.propose(lap(sections=(wide, FLAT)))
    a, b = (4 * np.pi * STEEL.G * half**2 * 0.01 for half in (0.015, 0.03))  # A holds the narrow one's disc
    assert patch.turning(lap(sections=(wide, FLAT)))["J", "krz"] == pytest.approx(a * b / (a + b))


def test_a_joint_turns_about_its_own_axis_along_the_normal():
    model = lap(rigid=RIGID, axes=np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]]))
    assert turning(model, 1.0).effect("J").elastic == ("rx",)
    askew = np.array([[np.cos(0.3), 0, -np.sin(0.3)], [0, 1, 0], [np.sin(0.3), 0, np.cos(0.3)]])
    assert turning(lap(rigid=RIGID, axes=askew), 1.0).effect("J").rigid == RIGID
    elastic = lap(rigid=("x", "y", "z", "rx", "ry"), K=np.diag([0, 0, 0, 0, 0, 7e4]))
    assert turning(elastic, 1.0).effect("J").K[5, 5] == 7e4


def test_the_stiffness_about_the_normal_is_uncertain_whatever_else_is_said():
    model = turning(lap(), 1.0)
    own = Nuisance("J", "krz", TWIST_STD)
    assert with_turning(DOUBTS, model) == (*DOUBTS, own)
    assert with_turning((Nuisance("J", "krz", 0.03), *DOUBTS), model) == (own, *DOUBTS)
    assert with_turning(DOUBTS, lap()) == DOUBTS
    given = Nuisance("J", "krz", 0.03)  # of a joint that is elastic about it anyhow
    elastic = lap(rigid=("x", "y", "z", "rx", "ry"), K=np.diag([0, 0, 0, 0, 0, 7e4]))
    assert with_turning((given,), turning(elastic, 1.0)) == (given,)


def test_elements_on_patches_are_short_and_others_stay():
    model = lap(12)
    (patch,) = JointPatch.propose(model)
    mesh = refined_at(model, patch).mesh
    for member, position in (("A", 0.3), ("B", 0.02)):
        s = mesh.member_positions(member)
        on = abs((s[1:] + s[:-1]) / 2 - position) < PATCH_REACH * 0.015
        assert np.diff(s)[on].max() <= 0.015 / PATCH_ELEMENTS + 1e-9
        assert on.sum() <= 2 * PATCH_REACH * PATCH_ELEMENTS + 2
    assert mesh.n_lines < model.mesh.n_lines + 24
    assert_allclose(mesh.points[: model.mesh.n_points], model.mesh.points)
    again = refined_at(refined_at(model, patch), patch)
    assert again.mesh.n_lines == mesh.n_lines


def test_the_size_of_patches_is_no_parameter_of_an_updating():
    with pytest.raises(fem.ModelError, match="cannot vary in a fit"):
        update(patched(lap(), 1.0), [("joint_patch:all", "size")], frequency=[10.0])


STUDY = f"""{FLAT_STEEL}
[members.A]
from = [0, 0, 0]
to = [0.6, 0, 0]
[members.B]
from = [0.3, -0.02, 0.01]
to = [0.3, 0.4, 0.01]
[damping]
modal = 0.004
[frequency]
start = 5
stop = 1200
step = 5
[[joints]]
name = "J"
member1 = "A"
position1 = 0.3
member2 = "B"
position2 = 0.02
rigid = "all"
[[sensors]]
points = [[0, 0, 0], [0.15, 0, 0], [0.45, 0, 0], [0.6, 0, 0], [0.3, 0.2, 0.01], [0.3, 0.4, 0.01]]
names = ["a", "b", "c", "d", "e", "f"]
directions = "xz"
[[excitations]]
sensor = "az"
[[excitations]]
sensor = "fz"
"""


def test_a_study_with_patches_has_joints_that_turn(tmp_path):
    study = tmp_path / "study.toml"
    study.write_text(
        STUDY
        + '[[effects]]\ncandidate = "joint_patch:all"\nsize = 0.7\ntwist = 0.6\n'
        + '[[effects]]\ncandidate = "joint_stiffness:J.rz"\nstiffness = 9000\n',
        encoding="utf-8",
    )
    read = load_study(study)
    assert read.model.effect("J").K[5, 5] == pytest.approx(0.6 * DISC, rel=0.01)
    assert read.model.effect("known joint_stiffness:J.rz").assumed == pytest.approx(0.6 * DISC, rel=0.01)
    assert Nuisance("J", "krz", TWIST_STD) in read.nuisances
