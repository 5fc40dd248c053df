"""Sprung masses against Den Hartog's closed form of the tuned absorber, and against masses on springs."""

import numpy as np
import pytest

from fem import (
    AddedMass,
    Damping,
    Frame,
    LoadCase,
    Material,
    MemberProperties,
    Mesh,
    Model,
    ModelError,
    Section,
    assemble,
    compute_base_frf,
    compute_frf,
    compute_participation,
    solve_complex_modes,
    solve_modes,
    solve_static,
)
from fem.effects import Plane, SprungMass
from tests.frames import beam, fix, planar

MASS, RATIO = 10.0, 0.05
STIFFNESS = MASS * (2 * np.pi * 3.0) ** 2


def oscillator(*effects):
    """Return a mass on a spring of 3 Hz that moves along x, with effects on the mass."""
    mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]], {"spring": [0]})
    part = MemberProperties(Material("m", 1.0, 1e-15), Section(STIFFNESS, 1.0, 1.0, 1.0))
    body = AddedMass(name="mass", point=1, mass=MASS)
    model = Model(mesh, (Frame(members={"spring": part}), fix(0), body))
    return planar(model, ("x",)).with_effect(*effects)


def absorber(frequency=3.0 / (1 + RATIO), zeta=0.0, **more):
    return SprungMass.tuned("absorber", 1, RATIO * MASS, frequency, zeta, ("x",), **more)


def den_hartog(g, f, zeta):
    """Return |x k/F| of the main mass at g = ω/Ω, with f = ω_a/Ω (Den Hartog, Mechanical Vibrations, 3.2)."""
    damped = (2 * zeta * f * g) ** 2
    free = RATIO * f**2 * g**2 - (g**2 - 1) * (g**2 - f**2)
    above = damped + (g**2 - f**2) ** 2
    below = damped * (g**2 - 1 + RATIO * g**2) ** 2 + free**2
    return np.sqrt(above / below)


@pytest.mark.parametrize("zeta", [0.0, 0.05, 0.127, 1.0])
@pytest.mark.parametrize("f", [1.0, 1 / (1 + RATIO)])
def test_the_main_mass_moves_as_den_hartog_says(f, zeta):
    g = np.linspace(0.6, 1.4, 81) + 0.00123
    system = assemble(oscillator(absorber(3.0 * f, zeta)))
    H = compute_frf(system, 3.0 * g, [(1, "x")], [(1, "x")], "receptance", method="direct").H[:, 0, 0]
    np.testing.assert_allclose(np.abs(H) * STIFFNESS, den_hartog(g, f, zeta), rtol=1e-8)


def test_at_the_fixed_points_damping_does_not_matter():
    """Of the best tuning f = 1/(1 + μ) both have √(1 + 2/μ)."""
    best = 1 / (1 + RATIO)
    # f g⁴ terms: g⁴ - 2 g² (1 + f² + μ f²)/(2 + μ) + 2 f²/(2 + μ) = 0
    middle = (1 + best**2 * (1 + RATIO)) / (2 + RATIO)
    spread = np.sqrt(middle**2 - 2 * best**2 / (2 + RATIO))
    fixed = np.sqrt([middle - spread, middle + spread])
    for zeta in (0.02, 0.3):
        H = compute_frf(
            assemble(oscillator(absorber(zeta=zeta))), 3.0 * fixed, [(1, "x")], [(1, "x")], "receptance"
        ).H[:, 0, 0]
        np.testing.assert_allclose(np.abs(H) * STIFFNESS, np.sqrt(1 + 2 / RATIO), rtol=1e-7)


def test_modes_and_poles_are_those_of_two_masses():
    zeta = 0.127
    model = oscillator(absorber(zeta=zeta))
    m, w = RATIO * MASS, 2 * np.pi * 3.0 / (1 + RATIO)
    k, c = m * w**2, 2 * zeta * m * w
    M, K = np.diag([MASS, m]), np.array([[STIFFNESS + k, -k], [-k, k]])
    C = c * np.array([[1.0, -1.0], [-1.0, 1.0]])
    free = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)) / (2 * np.pi)
    np.testing.assert_allclose(solve_modes(assemble(model), 2).frequency, free, rtol=1e-10)
    state = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    poles = np.linalg.eigvals(state)
    poles = poles[poles.imag > 0][np.argsort(np.abs(poles[poles.imag > 0]))]
    np.testing.assert_allclose(solve_complex_modes(assemble(model), 2).poles, poles, rtol=1e-8)


def test_a_stiff_spring_carries_the_mass_rigidly():
    """Also its arm and its inertia; in directions without spring it is rigid anyway."""
    arm, inertia = np.array([0.02, 0.01, 0.03]), np.diag([2e-3, 3e-3, 1e-3])
    free = beam(6, effects=(fix(0),), theory="timoshenko")
    rigid = free.with_effect(AddedMass(name="body", point=1, mass=0.4, arm=arm, inertia=inertia))
    k = {"x": 1e13, "z": 1e13, "ry": 1e11}
    sprung = free.with_effect(SprungMass(name="body", point=1, mass=0.4, k=k, arm=arm, inertia=inertia))
    found, want = (solve_modes(assemble(m), 5).frequency for m in (sprung, rigid))
    np.testing.assert_allclose(found, want, rtol=1e-6)


def test_weight_and_effective_mass_are_those_of_the_whole_body():
    model = beam(4, effects=(fix(0, name="wall"),)).with_effect(
        SprungMass(name="body", point=1, mass=2.0, k={"z": 500.0}, arm=np.array([0.1, 0, 0]))
    )
    system = assemble(model)
    found = solve_static(system, LoadCase(gravity=(0, 0, -9.81)))
    own = solve_static(assemble(model.without_effect("body")), LoadCase(gravity=(0, 0, -9.81)))
    weight = found.reactions["wall", "z"][0] - own.reactions["wall", "z"][0]
    assert weight == pytest.approx(2 * 9.81, rel=1e-9)
    moment = found.reactions["wall", "ry"][0] - own.reactions["wall", "ry"][0]
    assert moment == pytest.approx(-2 * 9.81 * 1.1, rel=1e-9)
    sag = found.displacements[model.internal_dofs("body"), 0]
    assert sag == pytest.approx([-2 * 9.81 / 500.0])
    part = compute_participation(system, solve_modes(system, 4))
    assert part.total[2] == pytest.approx(2.0 + own_mass(model), rel=1e-9)


def own_mass(model):
    part = model.of_kind(Frame)[0].members["beam"]
    return part.material.rho * part.section.A * model.mesh.member_length("beam")


def test_a_moving_base_drives_it():
    """Transmissibility of a rigid foot: 1/(1 - (f/f₀)²) of the body, seen in the force on the point."""
    model = oscillator(absorber(2.0))
    f = np.array([0.5, 1.5, 2.5, 4.0])
    found = compute_base_frf(assemble(model), f, [(1, "x")], ["x"], relative=False).H[:, 0, 0]
    g, fa = f / 3.0, 2.0 / 3.0
    # k x₀ drives the main mass: x/x₀ as the force's response, and both masses' own
    exact = (fa**2 - g**2) / ((1 - g**2) * (fa**2 - g**2) - RATIO * fa**2 * g**2)
    np.testing.assert_allclose(found.real, exact, rtol=1e-7)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"k": {}}, "has no spring; give its stiffness"),
        ({"k": {"z": 1.0}, "c": {"x": 1.0}}, "a dashpot in x but no spring there"),
        ({"k": {"z": 0.0}}, "stiffness in z is 0; it must be positive"),
        ({"k": {"rz": 1.0}}, "sprung in rz without inertia"),
        ({"k": {"q": 1.0}}, "sprung in 'q'; allowed are x, y"),
        ({"k": {"z": 1.0}, "mass": -1.0}, "mass is -1 kg"),
    ],
)
def test_what_cannot_be(more, message):
    with pytest.raises(ModelError, match=message):
        SprungMass(**({"name": "body", "point": 0, "mass": 1.0} | more))


def test_in_a_planar_model_it_is_sprung_in_the_plane():
    flat = beam(4, effects=(fix(0),)).with_effect(Plane(name="plane", plane="xz"))
    assemble(flat.with_effect(SprungMass(name="body", point=1, mass=0.1, k={"z": 100.0})))
    with pytest.raises(ModelError, match=r"'body' does not fit .* it is sprung in y, out of the plane"):
        assemble(flat.with_effect(SprungMass(name="body", point=1, mass=0.1, k={"y": 100.0})))


def test_structural_damping_is_its_own():
    """With a loss factor alone at resonance |H| = 1/η k of a body on a rigid point."""
    body = SprungMass(name="body", point=1, mass=1.0, k={"x": 1e3}, eta=0.04)
    model = oscillator(body).with_damping(Damping())
    f = np.sqrt(1e3) / (2 * np.pi)
    system = assemble(model)
    dof = model.internal_dofs("body")[0]
    u = np.linalg.solve(
        system.dynamic_stiffness(2 * np.pi * f).toarray(), np.asarray(system.Q.T[:, [dof]].todense())
    )
    s = (system.Q @ u)[dof, 0]
    K = np.array([[STIFFNESS, 0], [0, 1e3 * (1 + 0.04j)]])
    M = np.array([[MASS + 1, 1], [1, 1]])
    assert s == pytest.approx(np.linalg.inv(K - (2 * np.pi * f) ** 2 * M)[1, 1], rel=1e-9)
