"""Geometric stiffness: what a rotation does to it, what it carries on, and what buckling warns of."""

import warnings

import numpy as np
import pytest

from fem import (
    DIRECTIONS,
    Attachment,
    Frame,
    InitialStrain,
    LineLoad,
    LoadCase,
    MemberForce,
    MemberProperties,
    Mesh,
    Model,
    ModelError,
    Section,
    Superelement,
    assemble,
    prestressed,
    solve_buckling,
    solve_modes,
    solve_static,
    sum_contributions,
)
from fem.effects import AddedMass, Joint, Prestress
from fem.elements.levers import lever_stiffness
from fem.io import matrices_of
from tests.frames import STEEL, beam, braced, fix, planar, portal

STRIP = Section.rectangle(0.002, 0.06)


def stress_of(model, loads):
    """Return K_G (n, n) of loads."""
    loaded = prestressed(model, solve_static(assemble(model), loads))
    return sum_contributions(loaded.effect("prestress").contribute(loaded), loaded.n_dof)[0].toarray()


def rotations(model):
    """Return the motions of a rigid body that turns about the global axes by 1 rad, (n_dof, 3)."""
    points = model.mesh.points
    return np.array([[[np.cross(axis, p), axis] for p in points] for axis in np.eye(3)]).reshape(3, -1).T


def test_a_rotation_turns_the_loads_and_nothing_else():
    # K_G r = (θ × f, θ × m/2) with the nodes' forces f and semitangential moments m; inside, these are in
    # equilibrium. Offsets, rigid zones, shear and loads at odd angles are all in it.
    model = beam(
        5,
        0.7,
        effects=(fix(0),),
        along=(1, 2, -0.5),
        theory="timoshenko",
        rigid1=0.05,
        rigid2=0.03,
        offset1=np.array([0, 0, 0.02]),
        offset2=np.array([0.01, 0, -0.03]),
    )
    rng = np.random.default_rng(1)
    f = np.zeros(model.n_dof)
    f[6:12], f[24:30] = rng.standard_normal((2, 6))
    K_G = stress_of(model, f)
    at_base = solve_static(assemble(model), f).reactions
    f[:6] = [at_base["support0", d][0] for d in DIRECTIONS]
    f = f.reshape(-1, 2, 3)
    for axis, r in zip(np.eye(3), rotations(model).T, strict=True):
        expected = np.cross(axis, f) * np.array([[1.0], [0.5]])
        np.testing.assert_allclose(K_G @ r, expected.ravel(), atol=1e-9)


def test_a_structure_in_equilibrium_with_itself_turns_freely():
    # the corners of the portal are rigid joints with lever arms; heating the beam loads it against itself
    model = portal(0.2)
    K_G = stress_of(model, LoadCase(members=(InitialStrain(member="beam", axial=1e-3),)))
    turned = (
        assemble(model).Q.T @ K_G @ rotations(model)
    )  # the forces of joints do no work on what they allow
    assert abs(K_G).max() > 10
    assert abs(turned).max() < 1e-9 * abs(K_G).max()


def test_lever_stiffness():
    # the potential F·θ × (θ × d)/2 by hand: a weight W at a height h above its point makes -W h of both tilts
    K = lever_stiffness(np.array([[0.0, 0.0, 0.3]]), np.array([[0.0, 0.0, 20.0]]))[0]
    np.testing.assert_allclose(K, -6.0 * np.diag([1.0, 1.0, 0.0]), atol=1e-15)
    rng = np.random.default_rng(0)
    d, F, t = rng.standard_normal((3, 3))
    work = F @ np.cross(t, np.cross(t, d)) / 2
    assert t @ lever_stiffness(d[None], F[None])[0] @ t / 2 == pytest.approx(work, rel=1e-12)


def test_the_state_does_not_depend_on_the_mesh_that_found_it():
    # forces between the ends of elements: kinks and jumps within a line, linear loads with cubic moments
    loads = LoadCase(
        members=(
            LineLoad(member="beam", force1=(1.0, 2.0, -3.0), force2=(0, -1.0, 5.0), start=0.13, stop=0.61),
            MemberForce(member="beam", position=0.37, force=(4.0, 0.0, -2.0)),
        )
    )

    def at(n):
        return beam(n, 1.0, effects=(fix(0),), section=STRIP)

    fine = at(12)
    one, many = (
        prestressed(fine, solve_static(assemble(at(n)), loads)).effect("prestress").contribute(fine)[0].K
        for n in (1, 12)
    )
    np.testing.assert_allclose(one, many, atol=1e-8 * abs(many).max())


def test_moments_under_a_bent_state_close():
    # Second-order moments of a model under its own state: continuous at points, none at the free end, and
    # those of twice a load are those of the load at twice the state's effect on it.
    model = beam(4, effects=(fix(0),), along=(1, 1, 0.3))
    state = solve_static(assemble(model), {(1, "x"): 30.0, (1, "z"): -8.0, (1, "y"): 5.0})
    solution = solve_static(assemble(prestressed(model, state)), {(1, "y"): 2.0, (1, "z"): 1.0})
    M = solution.line_forces[:, :, 3:, 0]
    scale = abs(M).max()
    assert abs(M[-1, 1]).max() < 1e-9 * scale
    np.testing.assert_allclose(M[:-1, 1], M[1:, 0], atol=1e-9 * scale)
    # about the clamp: the load on its arm, and the state's forces on the displacement of the end
    arm, tip = model.mesh.points[1], solution.displacements[6:9, 0]
    about = np.cross(arm, [0, 2.0, 1.0]) + np.cross(tip, [30.0, 5.0, -8.0])
    (frame,) = model.of_kind(Frame)
    np.testing.assert_allclose(M[0, 0], frame.rotations(model.mesh)[0] @ about, atol=1e-9 * scale)


def test_a_bent_strip_slows_down_to_its_lateral_buckling():
    # ω² of the lateral mode falls with the square of the moment: 1 - (M/M_cr)²
    ends = (fix(0, ("x", "y", "z", "rx")), fix(1, ("y", "z", "rx")))
    model = beam(8, 1.0, effects=ends, section=STRIP)
    modes = solve_buckling(model, {(0, "ry"): 1.0, (1, "ry"): -1.0}, 1)
    rest, half, near = (
        solve_modes(assemble(modes.loaded(f * modes.factors[0])), 1).frequency[0] ** 2
        for f in (0, 0.5, 0.999)
    )
    assert half / rest == pytest.approx(0.75, rel=0.01)
    assert near / rest == pytest.approx(1 - 0.999**2, rel=0.03)


def test_only_a_load_that_destabilises_nothing_is_refused():
    free = LoadCase(members=(InitialStrain(member="beam", axial=1e-3, curvature_y=0.1),))
    for along in ((1, 0, 0), (1, 2, -0.5)):
        with pytest.raises(ModelError, match="no member a section force that works on a motion it can make"):
            solve_buckling(beam(4, effects=(fix(0),), along=along, section=STRIP), free)
    # pure bending in a plane that nothing leaves
    flat = planar(beam(4, effects=(fix(0),), section=STRIP), ("x", "z", "ry"))
    with pytest.raises(ModelError, match="nothing buckles"):
        solve_buckling(flat, {(1, "ry"): 1.0})
    # the same in space does buckle, under either sign
    found = solve_buckling(
        beam(4, effects=(fix(0),), section=STRIP), {(1, "ry"): 1.0}, 2, sign="both"
    ).factors
    assert found[0] == pytest.approx(-found[1], rel=1e-9)


# ------------------------------------------------------------------------------------------------ warnings


def messages(model, loads):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solve_buckling(model, loads, 1)
    return [str(w.message) for w in caught]


FORKS = (fix(0, ("x", "y", "z", "rx")), fix(1, ("y", "z", "rx")))
BENT = {(0, "ry"): 1.0, (1, "ry"): -1.0}


@pytest.mark.parametrize("length", [2.0, 8.0])
def test_warping_is_named_with_its_size(length):
    # Timoshenko and Gere, eq. 6-14: M = π/L √(EIz GJ) √(1 + k²); half of an upper bound's k² is the twist's
    section = Section.i_section(0.1, 0.2, 0.0085, 0.0056)
    Iw = section.Iz * (0.2 - 0.0085) ** 2 / 4
    k2 = np.pi**2 * STEEL.E * Iw / (STEEL.G * section.J * length**2)
    found = [m for m in messages(beam(12, length, effects=FORKS, section=section), BENT) if "warping" in m]
    (message,) = found
    assert f"(k = {np.sqrt(k2):.2g} for its length)" in message
    stated = float(message.rpartition("up to ")[2].partition(" %")[0]) / 100
    assert stated == pytest.approx(k2 / 2, rel=0.05, abs=0.006)
    assert stated >= np.sqrt(1 + k2) - 1 - 0.006


def test_a_column_without_twist_is_not_warned_of_warping():
    section = Section.i_section(0.1, 0.2, 0.0085, 0.0056)
    held = planar(beam(8, 2.0, effects=FORKS, section=section), ("x", "z", "ry"))
    assert messages(held, {(1, "x"): -1.0}) == []
    assert messages(beam(8, effects=FORKS, section=STRIP), BENT) == []


def test_a_shear_centre_off_the_centroid_is_named():
    section = Section.channel(0.05, 0.1, 0.006, 0.004)
    found = messages(beam(6, 3.0, effects=FORKS, section=section), {(1, "x"): -1.0})
    (message,) = [m for m in found if "shear centre" in m]
    assert f"{np.hypot(*section.shear_centre):.3g} m from its centroid" in message
    assert "member 'beam'" in message


def test_displacements_before_buckling_are_named_with_their_size():
    # the bar 30 x 10: truly M = M_cr/√((1 - Iz/Iy)(1 - GJ/EIy)), a few per cent above
    stocky = Section.rectangle(0.01, 0.03)
    (message,) = messages(beam(12, effects=FORKS, section=stocky), BENT)
    r, g = stocky.Iz / stocky.Iy, STEEL.G * stocky.J / (STEEL.E * stocky.Iy)
    stated = float(message.rpartition("about ")[2].removesuffix(" %")) / 100
    true = 1 / np.sqrt((1 - r) * (1 - g)) - 1
    assert true / 2 < stated < 2.5 * true
    assert "turned member 'beam' by" in message
    # thrust with a lateral load of a thousandth is not worth a word
    assert messages(beam(12, effects=FORKS, section=stocky), {(1, "x"): -1.0, (0, "ry"): 1e-6}) == []


def test_a_prestress_of_axial_forces_alone_is_as_before():
    places, N = np.array([0.0, 1.0]), np.array([-3.0, 5.0])
    model = beam(1)
    K = Prestress(name="p", tension={"beam": (places, N)}).contribute(model)[0].K[0]
    # ∫ N v'² with v = x² (3 - 2x), N = -3 + 8x: v' = 6x (1 - x), by symmetry as with the mean of N, 1
    assert K[7, 7] == pytest.approx(36 * (1 / 30), rel=1e-12)
    # with the end's rotation, v = x³ - x², it is not: v' = 3x² - 2x, ∫ v'² = 2/15, ∫ x v'² = 1/10
    assert K[11, 11] == pytest.approx(-3 * 2 / 15 + 8 / 10, rel=1e-12)


def test_a_member_on_springs_refers_to_its_modulus():
    # its springs and its own stiffness share a slip, which is in the shapes of the geometric stiffness
    model = braced()
    loaded = prestressed(model, solve_static(assemble(model), {(1, "z"): -5.0, (1, "x"): 3.0}))
    effect = loaded.effect("prestress")
    assert effect.refers_to(loaded) == (("frame", "E:steel"),)
    stepped = loaded.with_values({("frame", "E:steel"): 210e9 * (1 + 1e-200j)})
    assert np.imag(effect.contribute(stepped)[0].K).any()


def test_members_whose_lines_are_not_in_order():
    mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[1, 2], [0, 1]], {"second": [0], "first": [1]})
    p = MemberProperties(STEEL, STRIP, theory="euler-bernoulli")
    model = Model(mesh.split(3), (Frame(members={"first": p, "second": p}), fix(0)))
    loads = LoadCase(members=(LineLoad(member="second", force1=(-1.0, 0, 0)),))
    effect = prestressed(model, solve_static(assemble(model), loads)).effect("prestress")
    np.testing.assert_allclose(effect.line_tension(model, "first"), -1.0)
    np.testing.assert_allclose(effect.line_tension(model, "second"), np.array([-5, -3, -1]) / 6)


def in_line(*held):
    """Return a strut of 1 m whose middle 0.3 m are a reduced part."""
    points = [[0, 0, 0], [0.4, 0, 0], [0.7, 0, 0], [1.0, 0, 0]]
    mesh = Mesh.from_lines(points, [[0, 1], [2, 3]], {"left": [0], "right": [1]}).split(4)
    frame = Frame(members={name: MemberProperties(STEEL, STRIP) for name in mesh.members})
    middle = beam(6, 0.3, along=(1, 0, 0), section=STRIP)
    part = matrices_of(assemble(middle)).placed(shift=np.array([0.4, 0, 0]))
    ties = [Attachment(1, (0,)), Attachment(2, (1,))]
    return Model(mesh, (frame, Superelement.from_matrices("middle", part, mesh, ties), *held))


def test_a_reduced_part_that_carries_the_load_is_named():
    """Without its geometric stiffness the strut seems stronger than the Euler load."""
    model = in_line(fix(0))
    with pytest.warns(UserWarning, match="the reduced part 'middle' carries load, but its matrices say noth"):
        found = solve_buckling(model, {(3, "x"): -1.0}, 1)
    euler = np.pi**2 * STEEL.E * min(STRIP.Iy, STRIP.Iz) / 4
    assert found.factors[0] > 1.05 * euler


def test_a_reduced_part_that_only_moves_along_is_not_named():
    """Loads that end before the part move it as a rigid body: only rounding strains it."""
    g = np.random.default_rng(0)
    model = in_line(fix(0))
    for _ in range(5):
        load = {(1, d): float(f) for d, f in zip(DIRECTIONS, g.standard_normal(6), strict=True)}
        assert [m for m in messages(model, load) if "reduced part" in m] == []
        load[3, "z"] = 1e-3
        assert len([m for m in messages(model, load) if "reduced part" in m]) == 1


@pytest.mark.parametrize(
    ("loaded", "n", "sign"), [(2, 20, "positive"), (2, 20, "negative"), (60, 5, "negative")]
)
def test_load_factors_are_none_of_rounding(loaded, n, sign):
    # only the first elements are compressed: few factors exist, and none is negative
    column = beam(120, effects=(fix(0),), section=STRIP)
    found = solve_buckling(column, {(loaded, "x"): -1.0}, n, sign=sign)
    assert (found.factors < 1e10 * found.factors[:1]).all()
    if sign == "positive":
        short = beam(loaded, loaded / 120, effects=(fix(0),), section=STRIP)
        alone = solve_buckling(short, {(loaded, "x"): -1.0}, 2).factors
        np.testing.assert_allclose(found.factors[:2], alone, rtol=1e-6)
    else:
        assert found.factors.size == 0


def test_shape_of_pure_twist_has_a_largest_rotation_of_one():
    # of a wide strip's first element between held ends the lowest motion is twist: no point moves
    held = fix(0), fix(1, ("y", "z", "ry", "rz"))
    found = solve_buckling(beam(1, 0.05, effects=held, section=STRIP), {(1, "x"): -1.0}, 1)
    turned = found.shapes.reshape(-1, 6)[:, 3:]
    assert abs(turned).max() == pytest.approx(1.0)


def test_the_mass_of_a_joint_hangs_on_its_arm_like_any_other():
    arm, m = np.array([0.0, 0.1, 0.05]), 2.0
    frame = beam(3, effects=(fix(0, name="wall"),))
    M = np.diag([m, m, m, 0, 0, 0])
    joint = Joint(name="block", point1=3, location=frame.mesh.points[3] + arm, M=M)
    K = []
    for body in (AddedMass(name="block", point=3, mass=m, arm=arm), joint):
        model = frame.with_effect(body)
        state = prestressed(model, solve_static(assemble(model), LoadCase(gravity=(0, 0, -9.81))))
        K.append(sum_contributions(state.effect("prestress").contribute(state), state.n_dof)[0].toarray())
    assert abs(K[0] - K[1]).max() <= 1e-9 * abs(K[0]).max()
