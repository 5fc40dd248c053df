"""Planar models: the motions out of the plane are gone, those in it are those of the model in space."""

import numpy as np
import pytest

from fem import (
    AddedMass,
    Damping,
    Frame,
    LineLoad,
    LoadCase,
    MemberProperties,
    Mesh,
    Model,
    ModelError,
    Section,
    Superelement,
    assemble,
    compute_base_frf,
    compute_frf,
    solve_complex_modes,
    solve_modes,
    solve_static,
)
from fem.effects import ClampForm, Plane
from fem.effects.plane import refusals
from tests.frames import FLAT, STEEL, fix, planar, portal, with_part
from updating import propose

XZ = Plane(name="plane", plane="xz")


def bent(n=6, *, plane=True, theory="timoshenko", orientation=None, **more):
    """Return a portal of welded members with a mass beside its corner, in space or planar."""
    points = [[0, 0, 0], [0, 0, 0.5], [0.6, 0, 0.5], [0.6, 0, 0]]
    names = {"left": [0], "beam": [1], "right": [2]}
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2], [2, 3]], names).split(n)
    part = MemberProperties(STEEL, FLAT, theory=theory, orientation=orientation, **more)
    mass = AddedMass(name="mass", point=1, mass=0.3, arm=np.array([0.02, 0, 0.01]))
    effects = (Frame(members=dict.fromkeys(names, part)), fix(0, name="a"), fix(3, name="b"), mass)
    model = Model(mesh, effects, Damping.structural(0.01))
    return model.with_effect(XZ) if plane else model


def test_modes_are_those_in_the_plane():
    flat, space = bent(), bent(plane=False)
    found, every = solve_modes(assemble(flat), 4), solve_modes(assemble(space), 14)
    in_plane = [k for k in range(14) if np.abs(every.shapes[1::6, k]).max() < 1e-9]
    np.testing.assert_allclose(found.frequency, every.frequency[in_plane[:4]], rtol=1e-9)
    assert np.abs(found.shapes.reshape(-1, 6, 4)[:, [1, 3, 5]]).max() == 0.0
    by_supports = solve_modes(assemble(planar(space, ("x", "z", "ry"))), 4)
    np.testing.assert_allclose(found.frequency, by_supports.frequency, rtol=1e-10)


def test_a_free_planar_structure_has_three_rigid_motions():
    model = bent().without_effect("a", "b")
    modes = solve_modes(assemble(model), 6)
    assert modes.n_rigid == 3
    with pytest.raises(ModelError, match=r"3 rigid-body motions \(x, z, ry\)"):
        solve_static(assemble(model), {(1, "x"): 1.0})


def test_statics_and_reactions_are_those_in_space():
    load = LoadCase(
        points={(1, "x"): 40.0, (2, "ry"): 3.0},
        members=(LineLoad(member="beam", force1=[0, 0, -100.0]),),
        gravity=(0, 0, -9.81),
    )
    flat, space = (solve_static(assemble(bent(plane=p)), load) for p in (True, False))
    np.testing.assert_allclose(flat.displacements, space.displacements, atol=1e-12)
    assert {key[0] for key in flat.reactions} == {"a", "b"}
    for key, value in space.reactions.items():
        assert flat.reactions[key] == pytest.approx(value, rel=1e-7, abs=1e-7)
    assert flat.residual[0] < 1e-9


def test_frfs_and_complex_modes_are_those_in_space():
    f = np.linspace(5, 300, 40)
    lines = [(1, "x"), (2, "ry")]
    flat, space = (compute_frf(assemble(bent(plane=p)), f, lines, [(1, "z")], "receptance").H for p in (1, 0))
    np.testing.assert_allclose(flat, space, rtol=1e-8, atol=1e-15)
    base = [compute_base_frf(assemble(bent(plane=p)), f, lines, ["x"]).H for p in (1, 0)]
    np.testing.assert_allclose(*base, rtol=1e-7)
    poles = solve_complex_modes(assemble(bent()), 3).poles
    assert poles.imag / (2 * np.pi) == pytest.approx(solve_modes(assemble(bent()), 3).frequency, rel=1e-4)


@pytest.mark.parametrize(
    ("load", "message"),
    [
        ({(1, "y"): 1.0}, "acts on point 1 in y, out of the model's plane xz; allowed are x, z, ry"),
        ({(1, "rx"): 1.0}, "acts on point 1 in rx"),
        (LoadCase(name="wind", members=(LineLoad(member="beam", force1=[0, 1.0, 0]),)), "'wind' acts"),
        (LoadCase(name="tilted", gravity=(0, 1, -9.81)), "'tilted' acts on point [0-9]+ in y"),
    ],
)
def test_loads_out_of_the_plane_are_refused(load, message):
    with pytest.raises(ModelError, match=message):
        solve_static(assemble(bent()), load)


@pytest.mark.parametrize("motion", ["y", "rx", ("a", "y")])
def test_motions_of_the_base_out_of_the_plane_are_refused(motion):
    with pytest.raises(ModelError, match="out of the model's plane xz"):
        compute_base_frf(assemble(bent()), [10.0], [(1, "x")], [motion])


def test_what_is_not_planar_is_refused():
    away = bent()
    points = away.mesh.points.copy()
    points[2, 1] = 0.01
    lines = Mesh.from_lines(points, away.mesh.lines, away.mesh.members)
    with pytest.raises(ModelError, match=r"point 2 does not fit .* lies 0\.01 m off the plane"):
        assemble(away.with_mesh(lines))
    with pytest.raises(ModelError, match="oblique to the plane"):
        assemble(bent(orientation=np.array([0.5, 1.0, 0.3])))
    oblique_rod = MemberProperties(STEEL, Section.circle(0.02), np.array([0.5, 1.0, 0.3]))
    rods = Frame(members=dict.fromkeys(("left", "beam", "right"), oblique_rod))
    assemble(bent().without_effect("frame").with_effect(rods))
    part = with_part().effects[-2]
    assert isinstance(part, Superelement)
    assert "a superelement moves in space" in [
        why.partition(",")[0] for _, why in refusals(bent().with_effect(part), "xz")
    ]
    with pytest.raises(ModelError, match="the plane is 'zx'; allowed are xy, yz, xz"):
        Plane(name="plane", plane="zx")


def test_candidates_act_in_the_plane():
    kinds = ("joint_stiffness", "support_flexibility", "ground_spring", "member_torsion", "member_stiffness")
    flat = Model(portal().mesh, (*portal().effects, XZ))
    names = {p: {e.name for e in propose(flat if p else portal(), kinds)} for p in (True, False)}
    assert names[True] < names[False]
    gone = names[False] - names[True]
    assert all(name.endswith((".y", ".rx", ".rz")) or name.startswith("member_torsion") for name in gone)
    assert not any(name.endswith((".y", ".rx", ".rz")) for name in names[True])
    assert "member_stiffness:beam" in names[True]
    assert any(name.startswith("support_flexibility") and name.endswith(".ry") for name in names[True])


def test_candidates_of_a_model_that_already_has_them():
    (clamp, *_) = ClampForm.propose(bent())
    mass = propose(bent(), ("point_mass",))[0].with_values(mass=0.2)
    names = {e.name for e in propose(bent())}
    assert {e.name for e in propose(bent().with_effect(clamp, mass))} >= names - {mass.name}
