"""Static solutions: what they refuse, how they are asked, and the prestress that they leave."""

import numpy as np
import pytest

from fem import (
    AddedMass,
    InitialStrain,
    Joint,
    LineLoad,
    LoadCase,
    MemberForce,
    ModelError,
    PointMass,
    assemble,
    prestressed,
    solve_modes,
    solve_static,
)
from fem.effects import MemberDensity, MemberStiffness, Preload, Prestress, StiffnessLoss, SupportFlexibility
from tests.frames import FLAT, STEEL, beam, chain, fix, portal

TIP = {(1, "z"): 5.0}


@pytest.fixture(scope="module")
def cantilever():
    return assemble(beam(3, effects=(fix(0),)))


@pytest.mark.parametrize(
    ("loads", "message"),
    [
        (None, "there are no loads"),
        ({(9, "z"): 1.0}, "point 9, but the mesh has 4 points"),
        ({(1, "Z"): 1.0}, "'Z' at point 1 is not a direction"),
        ({(1, "z"): np.nan}, "the load on point 1 z is nan"),
        (np.zeros(7), r"shape \(7,\); \(24,\) or \(24, n_cases\)"),
        (LoadCase(points=np.zeros(7)), r"shape \(7,\); \(24,\) is expected"),
        (LoadCase(gravity=(0, 1)), "gravity of load case 'load' is"),
        ([LoadCase(name="a"), LoadCase(name="a")], "two load cases have the name 'a'"),
        ([LoadCase(), np.zeros(24)], "mixed"),
        (LoadCase(members=(LineLoad(member="rod", force1=(0, 0, 1)),)), "no member or group 'rod'"),
        (LoadCase(members=(LineLoad(member="beam", force1=(0, 1)),)), "three finite components"),
        (LoadCase(members=(LineLoad(member="beam", force1=(0, 0, 1), axes="x"),)), "'x' axes"),
        (LoadCase(members=(LineLoad(member="beam", force1=(0, 0, 1), start=0.5, stop=2.0),)), "0.5 to 2 m"),
        (LoadCase(members=(MemberForce(member="beam", position=2.0, force=(0, 0, 1)),)), "lies outside"),
        (LoadCase(members=(InitialStrain(member="beam", axial=np.inf),)), "not finite"),
        (LoadCase(displacements={("support0", "q"): 1.0}), "which the model does not hold"),
        (LoadCase(displacements={("support0", "z"): np.nan}), "is nan"),
    ],
)
def test_loads_that_cannot_be_are_refused(cantilever, loads, message):
    with pytest.raises(ValueError, match=message):
        solve_static(cantilever, loads)


def test_structures_that_move_are_refused():
    with pytest.raises(ModelError, match=r"6 rigid-body motions \(x, y, z, rx, ry, rz\)"):
        solve_static(assemble(beam(3)), TIP)
    with pytest.raises(ModelError, match=r"1 rigid-body motion \(rx\)"):
        solve_static(assemble(beam(3, effects=(fix(0, ("x", "y", "z")), fix(1, ("y", "z"))))), TIP)
    hinged = chain(3, 2, (fix(0, ("x", "y", "z", "rx")), fix(5, ("y", "z"))))
    with pytest.raises(ModelError, match="mechanism"):
        solve_static(assemble(hinged), TIP)


def test_motions_that_two_supports_hold_are_refused():
    model = beam(2, effects=(fix(0), fix(1, ("z",), "a"), fix(1, ("z",), "b")))
    with pytest.raises(ModelError, match="other constraints hold the same"):
        solve_static(assemble(model), LoadCase(displacements={("a", "z"): 1e-3}))
    # both share the reaction alike
    single = solve_static(assemble(model.without_effect("b")), LoadCase(gravity=(0, 0, -9.81)))
    double = solve_static(assemble(model), LoadCase(gravity=(0, 0, -9.81)))
    for name in "ab":
        assert double.reactions[name, "z"][0] == pytest.approx(single.reactions["a", "z"][0] / 2, rel=1e-9)


def test_ways_to_say_a_load_are_the_same(cantilever):
    f = np.zeros((24, 2))
    f[8] = 5.0, 10.0
    many = solve_static(cantilever, f)
    one = solve_static(cantilever, TIP)
    assert many.cases == ("load1", "load2")
    assert many.case("load2") == 1
    np.testing.assert_array_equal(many.displacements[:, 0], one.displacements[:, 0])
    np.testing.assert_array_equal(solve_static(cantilever, f[:, 0]).displacements, one.displacements)
    np.testing.assert_allclose(many.displacements[:, 1], 2 * one.displacements[:, 0], rtol=1e-15)
    with pytest.raises(ModelError, match="no load case 'x'; the solution has load1, load2"):
        many.case("x")
    assert (many.residual < 1e-11).all()


def test_a_misfit_of_a_rigid_joint_opens_it():
    # a joint's rigid direction moved by δ: the first side stands δ further than the second
    model = portal(0.25)
    solution = solve_static(assemble(model), LoadCase(displacements={("corner0", "x"): 1e-3}))
    corner = model.effect("corner0")
    dofs, B = corner.relative(model)
    np.testing.assert_allclose(B @ solution.displacements[dofs, 0], [1e-3, 0, 0, 0, 0, 0], atol=1e-16)
    assert solution.reactions["corner0", "x"][0] > 0  # it pushes the first side
    feet = sum(solution.reactions[f"foot{i}", "x"][0] for i in (0, 1))
    assert abs(feet) < 1e-8 * abs(solution.reactions["corner0", "x"][0])


def test_springs_to_ground_stand_in_for_supports():
    model = beam(4, effects=(fix(0), fix(1, ("x", "y", "z"), "end")))
    soft = SupportFlexibility(name="give", supports=("end",), direction="z", stiffness=1e5)
    mount = Joint(name="mount", point1=3, location=np.array([0.5, 0.1, 0]), K=np.diag([0, 0, 1e4, 0, 0, 0]))
    solution = solve_static(assemble(model.with_effect(soft, mount)), {(3, "z"): -80.0, (2, "y"): 30.0})
    u = solution.displacements[:, 0]
    assert solution.springs["give", "z"][0] == pytest.approx(-1e5 * u[8], rel=1e-12)
    carried = u[20] + u[21] * 0.1 - u[22] * (0.5 - model.mesh.points[3, 0])
    assert solution.springs["mount", "z"][0] == pytest.approx(-1e4 * carried, rel=1e-12)
    total = sum(v[0] for k, v in {**solution.reactions, **solution.springs}.items() if k[1] == "z")
    assert total == pytest.approx(80.0, rel=1e-9)
    assert not any(abs(v[0]) > 1e-12 for k, v in solution.springs.items() if k[1] not in ("z",))


def test_effects_on_members_carry_their_share():
    # internal forces include what a loss of stiffness, a changed member and a mass on it add
    effects = (
        fix(0),
        fix(1),
        StiffnessLoss(name="loss", member="beam", position=0.4, loss=0.5, width=0.2, length=1.0),
        MemberStiffness(name="E", member="beam", change=0.2),
        MemberDensity(name="rho", member="beam", change=0.5),
        PointMass(name="m", member="beam", position=0.77, mass=0.3),
        AddedMass(name="lump", point=2, mass=0.2),
    )
    model = beam(5, effects=effects, theory="timoshenko")
    g = -9.81
    solution = solve_static(assemble(model), LoadCase(gravity=(0, 0, g)))
    s = np.linspace(0, 1, 41)
    V, M = solution.internal_forces("beam", s)[:, [2, 4], 0].T
    at = model.mesh.points[2, 0]
    q = 1.5 * STEEL.rho * FLAT.A * g
    # "just before" a force within a line, but of the second line at a point
    expected = V[0] - q * s - 0.3 * g * (s > 0.77) - 0.2 * g * (s > at - 1e-9)
    np.testing.assert_allclose(V, expected, atol=1e-9 * abs(V).max())
    assert V[0] - V[-1] == pytest.approx(g * (1.5 * STEEL.rho * FLAT.A + 0.5), rel=1e-9)
    dM = (V[1:] + V[:-1]) / 2 * np.diff(s)  # exact where V is linear
    smooth = (s[1:] <= 0.77) & (abs(s[1:] - at) > 1e-9) | (s[:-1] > 0.78)
    np.testing.assert_allclose(np.diff(M)[smooth], dM[smooth], atol=1e-9 * abs(M).max())


def test_prestress_stays_when_the_mesh_is_refined():
    # a column under its own weight: N = -ρAg (L - s), linear, the same on every mesh
    model = beam(3, along=(0, 0, 1), effects=(fix(0),))
    solution = solve_static(assemble(model), LoadCase(gravity=(0, 0, -9.81)))
    fine = prestressed(model.with_mesh(model.mesh.refined(0.07)), solution)
    effect = fine.effect("prestress")
    s = fine.mesh.member_positions("beam")
    expected = -STEEL.rho * FLAT.A * 9.81 * (1 - (s[1:] + s[:-1]) / 2)
    np.testing.assert_allclose(effect.line_tension(fine, "beam"), expected, rtol=1e-9)
    own = prestressed(model, solution).effect("prestress")
    s = model.mesh.member_positions("beam")
    expected = -STEEL.rho * FLAT.A * 9.81 * (1 - (s[1:] + s[:-1]) / 2)
    np.testing.assert_allclose(own.line_tension(model, "beam"), expected, rtol=1e-9)


def test_prestress_of_a_constant_tension_is_a_preload():
    model = beam(4, effects=(fix(0), fix(1, ("y", "z"))), along=(1, 2, 3))
    pull = np.zeros(model.n_dof)
    pull[6:9] = 700.0 * np.array([1, 2, 3]) / np.sqrt(14)
    solution = solve_static(assemble(model.without_effect("support1")), pull)
    found = solve_modes(assemble(prestressed(model, solution, factor=2.0)), 6).frequency
    preload = Preload(name="pull", member="beam", tension=1400.0, buckling=1.0)
    np.testing.assert_allclose(
        found, solve_modes(assemble(model.with_effect(preload)), 6).frequency, rtol=1e-9
    )


def test_prestress_jumps_where_a_force_acts():
    places, N = np.array([0.0, 0.3, 0.3, 1.0]), np.array([5.0, 5.0, -1.0, -1.0])
    model = beam(2).with_effect(Prestress(name="p", tension={"beam": (places, N)}))
    effect = model.effect("p")
    np.testing.assert_allclose(effect.line_tension(model, "beam"), [(1.5 - 0.2) / 0.5, -1.0], rtol=1e-15)
    for bad, message in (
        ((np.array([0.0, 1.0]), np.zeros(3)), "3 forces at 2 places"),
        ((np.array([1.0, 0.0]), np.zeros(2)), "do not fall"),
        ((np.array([0.0, 1.0]), np.array([0, np.nan])), "finite"),
    ):
        with pytest.raises(ModelError, match=message):
            Prestress(name="p", tension={"beam": bad})
    with pytest.raises(ModelError, match="is of member 'rod'; the mesh has beam"):
        assemble(beam(2).with_effect(Prestress(name="p", tension={"rod": (places, N)})))


def test_second_order_moments_close_at_the_second_end():
    # Under a tension the moment gains N times the displacement; at a free end none is left.
    pull = Preload(name="pull", member="beam", tension=3000.0, buckling=1.0)
    model = beam(4, effects=(fix(0), pull), along=(1, 1, 0.3))
    solution = solve_static(assemble(model), LoadCase(gravity=(0, 0, -9.81)))
    M = solution.line_forces[:, :, 3:, 0]
    scale = abs(M).max()
    assert abs(M[-1, 1]).max() < 1e-9 * scale
    np.testing.assert_allclose(M[:-1, 1], M[1:, 0], atol=1e-9 * scale)


def test_a_beam_of_one_element_that_is_clamped_at_both_ends_carries_its_loads():
    length, q, P, g = 1.2, 5.0, 30.0, 9.81
    model = beam(1, length, effects=(fix(0), fix(1)))
    cases = [
        LoadCase(name="q", members=(LineLoad(member="beam", force1=(0, 0, -q)),)),
        LoadCase(name="P", members=(MemberForce(member="beam", position=length / 2, force=(0, 0, -P)),)),
        LoadCase(name="own weight", gravity=(0, 0, -g)),
        LoadCase(name="on a support", points={(0, "z"): 4.0}),
        LoadCase(name="settlement", displacements={("support1", "z"): 0.01}),
    ]
    found = solve_static(assemble(model), cases)
    EI, own = STEEL.E * FLAT.Iy, STEEL.rho * FLAT.A * g
    settled = 12 * EI * 0.01 / length**3
    np.testing.assert_allclose(
        found.reactions["support0", "z"],
        [q * length / 2, P / 2, own * length / 2, -4.0, -settled],
        rtol=1e-12,
    )
    np.testing.assert_allclose(
        found.internal_forces("beam", [length / 2])[0, 4],
        [-q * length**2 / 24, -P * length / 8, -own * length**2 / 24, 0, 0],
        atol=1e-12 * P,
    )
    np.testing.assert_allclose(
        found.displacements_along("beam", [length / 2])[0, 2],
        [-q * length**4 / (384 * EI), -P * length**3 / (192 * EI), -own * length**4 / (384 * EI), 0, 0.005],
        rtol=1e-12,
    )
