"""Participation factors, effective masses, and where modes have their energy and damping."""

import numpy as np
import pytest

from fem import Damping, Joint, assemble, compute_energies, compute_participation, solve_modes
from fem.analysis.participation import rigid_motion_field
from tests.frames import FLAT, STEEL, beam, cross_beam, fix, mounted, portal


def test_effective_masses_of_a_cantilever():
    # The closed form is (2 σ/β)² of m L, β the roots of cosh β cos β = -1, σ = (sinh β - sin β)/(cosh β + cos
    # β): 0.6131, 0.1883, 0.0647. The shapes err as the interpolation does: in the mean of φ by less than
    # (βh)⁴/720.
    n, length = 16, 0.8
    model = beam(n, length, effects=(fix(0),))
    modes = solve_modes(assemble(model), 12)
    found = compute_participation(assemble(model), modes)
    m = STEEL.rho * FLAT.A * length
    beta = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613])
    sigma = (np.sinh(beta) - np.sin(beta)) / (np.cosh(beta) + np.cos(beta))
    exact = (2 * sigma / beta) ** 2
    np.testing.assert_allclose(exact, [0.6131, 0.1883, 0.0647], atol=5e-5)
    bending = np.flatnonzero(found.effective_masses[:, 2] > 1e-6 * m)[:3]
    share = found.effective_masses[bending, 2] / m
    np.testing.assert_array_less(abs(share / exact - 1), (beta / n) ** 4 / 360 + 1e-9)
    assert found.total[:3] == pytest.approx(np.full(3, m), rel=1e-12)
    # about the foot, rotation about y is m L²/3 of the lines (Euler-Bernoulli: no rotary inertia)
    assert found.total[4] == pytest.approx(m * length**2 / 3, rel=1e-12)


@pytest.mark.parametrize(
    "model", [portal(0.25), cross_beam(0.2), beam(3, effects=(fix(0),), theory="timoshenko")]
)
def test_effective_masses_of_all_modes_add_up(model):
    system = assemble(model)
    place = np.array([0.1, -0.2, 0.3])
    modes = solve_modes(system, system.n_free)
    found = compute_participation(system, modes, place)
    np.testing.assert_allclose(found.effective_masses.sum(axis=0), found.moving, rtol=1e-8)
    np.testing.assert_allclose(found.cumulative[-1], 1.0, rtol=1e-8)
    assert (found.moving <= found.total * (1 + 1e-12)).all()
    if modes.n_rigid == 6:
        np.testing.assert_allclose(found.moving, found.total, rtol=1e-9)
        np.testing.assert_allclose(found.effective_masses[:6].sum(axis=0), found.total, rtol=1e-9)
        assert abs(found.effective_masses[6:]).max() < 1e-12 * found.total.max()


def test_rotations_are_about_the_point():
    model = portal(0.25)
    place = np.array([0.3, 0.1, -0.2])
    r = rigid_motion_field(model, place)
    p = model.mesh.points[3] - place
    np.testing.assert_allclose(r[18:21, 3:].T, [np.cross(e, p) for e in np.eye(3)], atol=1e-15)
    np.testing.assert_allclose(r[21:24, 3:], np.eye(3), atol=1e-15)


def test_energies_add_up_and_give_the_damping():
    model = cross_beam(0.1, loss_factor=0.004)
    modes = solve_modes(assemble(model), 20)
    found = compute_energies(model, modes)
    assert found.parts == ("lower", "upper", "bolt")
    np.testing.assert_allclose(found.kinetic.sum(axis=0), 1.0, rtol=1e-12)
    np.testing.assert_allclose(found.strain[:, 6:].sum(axis=0), 1.0, rtol=1e-12)
    assert not found.strain[:, :6].any()
    # the bolt's loss factor of 0.006 acts on its share of the strain energy, 0.004 on all
    np.testing.assert_allclose(found.damping[2, 6:], 0.003 * found.strain[2, 6:], rtol=1e-6, atol=1e-20)
    np.testing.assert_allclose(found.zeta[6:], 0.002 + 0.003 * found.strain[2, 6:], rtol=1e-6)
    assert not found.zeta[:6].any()
    name, share = found.largest(8, 1)[0]
    assert share == found.strain[:, 8].max()
    assert name in found.parts


def test_a_damper_and_rayleigh_damping():
    # one mass on a spring beside a dashpot: ζ = c/(2mω) + α/(2ω) + βω/2
    c, k = 7.0, 4e4
    spring = Joint(
        name="spring",
        point1=1,
        location=np.array([1.0, 0, 0]),
        K=np.diag([0, 0, k, 0, 0, 0]),
        C=np.diag([0, 0, c, 0, 0, 0]),
    )
    model = beam(4, effects=(fix(0), spring)).with_damping(Damping.rayleigh(2.0, 1e-5))
    modes = solve_modes(assemble(model), 4)
    found = compute_energies(model, modes)
    tip = modes.shapes[8]
    np.testing.assert_allclose(found.damping[1], c * tip**2 / (2 * modes.omega), rtol=1e-9)
    np.testing.assert_allclose(found.damping[2], 1 / modes.omega + 5e-6 * modes.omega, rtol=1e-8)
    assert found.parts == ("beam", "spring")


def test_laws_count_at_the_modes_frequency():
    model = mounted()
    modes = solve_modes(assemble(model), 12)
    found = compute_energies(model, modes)
    at = found.parts.index("rubber")
    rubber = model.effect("rubber")
    (c,) = rubber.contribute(model)
    for r in (7, 9):
        u = modes.shapes[c.dofs[0], r]
        storage, loss = rubber.law(modes.omega[[r]])
        form = u @ c.K[0] @ u
        assert found.damping[at, r] == pytest.approx(loss[0] * form / (2 * modes.omega[r] ** 2), rel=1e-9)
        whole = storage[0] * form / found.strain[at, r]
        spring, (s,) = found.parts.index("spring"), model.effect("spring").contribute(model)
        v = modes.shapes[s.dofs[0], r]
        assert found.strain[spring, r] * whole == pytest.approx(v @ s.K[0] @ v, rel=1e-9)
