"""Rotors against closed forms: discs on massless shafts, free precession, spinning shafts."""

import numpy as np
import pytest
import scipy.linalg as sla

from fem.analysis.complex_modes import DENSE_LIMIT, solve_complex_modes
from fem.analysis.frf_solver import compute_frf
from fem.analysis.whirl import whirl, whirl_name
from fem.effects.added_mass import AddedMass
from fem.effects.joint import Joint
from fem.effects.rotor import Rotor
from fem.materials import Material
from fem.model import Damping
from fem.sections.section import Section
from fem.system import assemble
from tests.frames import beam, cross_beam, fix

LIGHT = Material("light", 210e9, 1e-6)
ROUND = Section.circle(0.02)
MASS, IT, IP = 3.0, 0.01, 0.018


def overhung(momentum, length=0.4):
    """Return a disc at the end of a massless cantilever along x."""
    disc = AddedMass(name="disc", point=1, mass=MASS, inertia=np.diag([IP, IT, IT]))
    rotor = Rotor(name="spin", point=1, axis=(1.0, 0.0, 0.0), momentum=momentum)
    return beam(2, length, effects=(fix(0), disc, rotor), section=ROUND, material=LIGHT)


def overhung_frequencies(momentum, length=0.4):
    """Return the whirl speeds of the disc, positive forward: 4 roots of a quartic.

    With w = v + iw and its slope in complex numbers: det [k₁₁ - mω², k₁₂; k₁₂, k₂₂ - I_t ω² + hω] = 0.
    """
    EI = LIGHT.E * ROUND.Iy
    k = EI * np.array([[12 / length**3, -6 / length**2], [-6 / length**2, 4 / length]])
    first = np.array([-MASS, 0, k[0, 0]])
    second = np.array([-IT, momentum, k[1, 1]])
    return np.sort(np.real(np.roots(np.polysub(np.polymul(first, second), [k[0, 1] ** 2]))))


@pytest.mark.parametrize("momentum", [0.5, 5.0, -5.0])
def test_an_overhung_disc(momentum):
    model = overhung(momentum)
    modes = solve_complex_modes(assemble(model, reciprocal=False), 6)
    turning = whirl(model, modes.poles, modes.shapes)
    bending = np.isfinite(turning)
    assert bending.sum() == 4  # beside stretching and torsion
    exact = overhung_frequencies(abs(momentum))
    np.testing.assert_allclose(
        np.sort(modes.damped_frequency[bending] * np.sign(turning[bending])), exact / (2 * np.pi), rtol=1e-7
    )
    np.testing.assert_allclose(abs(turning[bending]), 1.0, atol=1e-9)
    np.testing.assert_allclose(modes.zeta[bending], 0.0, atol=1e-9)
    np.testing.assert_allclose(modes.left[:, bending], modes.shapes[:, bending].conj(), atol=1e-6)
    assert [whirl_name(v) for v in (0.3, -1.0, 0.0, np.nan)] == ["forward", "backward", "planar", ""]


def test_a_free_rotor_precesses():
    """Free of all forces the axis of a body turns about its angular momentum, at h/I_t."""
    disc = AddedMass(name="disc", point=2, mass=MASS, inertia=np.diag([IP, IT, IT]))
    rotor = Rotor(name="spin", point=2, axis=(1.0, 0.0, 0.0), momentum=2.0)
    shaft = Material("shaft", 210e9, 1.0)
    inertia = IT + shaft.rho * ROUND.A * 0.4**3 / 12
    model = beam(2, 0.4, effects=(disc, rotor), section=ROUND, material=shaft)
    modes = solve_complex_modes(assemble(model, reciprocal=False), 3)
    assert modes.rigid.shape[1] == 4  # translations and spin; tilts of the axis are modes
    assert (abs(modes.poles[:2]) < 1e-5 * 2.0 / IT).all()  # 0 but for rounding
    assert modes.damped_frequency[2] == pytest.approx(2.0 / inertia / (2 * np.pi), rel=1e-7)
    assert whirl(model, modes.poles, modes.shapes)[2] == pytest.approx(1.0)


def spinning(size, *, damped):
    """Return crossed beams with a rotor at an odd angle, and dampers or not."""
    model = cross_beam(size, C=np.diag([50, 50, 500, 3, 3, 1.0]) * damped, eta=0.3 * damped, loss_factor=0)
    if damped:
        model = model.with_damping(Damping(alpha=3.0, beta=2e-6))
    spring = Joint(
        name="ground", point1=0, location=np.array([-0.4, 0, 0]), K=np.diag([1e4] * 3 + [50.0] * 3)
    )
    return model.with_effect(spring, Rotor(name="r", point=3, axis=(0.6, 0.0, 0.8), momentum=0.5))


@pytest.mark.parametrize("damped", [False, True])
def test_all_modes_together_are_the_receptance_with_a_rotor(damped):
    system = assemble(spinning(0.2, damped=damped), reciprocal=False)
    modes = solve_complex_modes(system, 2 * system.n_free)
    f = np.array([3.0, 40.0, 47.9, 200.0, 900.0])
    places = [(0, "z"), (1, "x"), (3, "z"), (4, "ry")]
    direct = compute_frf(system, f, places, places, kind="receptance", method="direct").H
    assert abs(direct - np.swapaxes(direct, 1, 2)).max() > 1e-3 * abs(direct).max()
    found = modes.frf(f, places, places, kind="receptance").H
    error = abs(found - direct).max(axis=(0, 2)) / abs(direct).max(axis=(0, 2))
    assert error.max() < 1e-6  # rounding of the highest poles, as without rotors


@pytest.mark.parametrize("damped", [False, True])
def test_poles_with_a_rotor_are_those_of_the_state_space(damped):
    system = assemble(spinning(0.04, damped=damped), reciprocal=False)
    assert system.n_free > DENSE_LIMIT
    d = system.model.damping
    K = (system.K + 1j * system.D).toarray()
    M = system.M.toarray()
    C = (system.C + d.alpha * system.M + d.beta * system.K).toarray()
    scale = 1 / np.sqrt(M.diagonal())
    K, C, M = (scale[:, None] * X * scale for X in (K, C, M))
    w = np.sqrt(abs(K).max())
    eye, none = np.eye(len(K)), np.zeros_like(K)
    s = w * sla.eigvals(np.block([[none, eye], [-np.linalg.solve(M, K / w**2), -np.linalg.solve(M, C / w)]]))
    s = s[(s.imag > 0) & (abs(s) > 1.0)]
    exact = s[np.argsort(abs(s))][:10]
    modes = solve_complex_modes(system, 10)
    assert modes.converged
    # rounding of the state space is that of its fastest pole
    np.testing.assert_allclose(modes.poles, exact, atol=1e-15 * w * len(K), rtol=1e-6)
