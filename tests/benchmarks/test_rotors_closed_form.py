"""Rotors against closed forms: discs on massless shafts, free precession, spinning shafts."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sla

from fem import (
    AddedMass,
    Damping,
    Joint,
    Material,
    ModelError,
    Section,
    assemble,
    compute_frf,
    solve_campbell,
    solve_complex_modes,
)
from fem.analysis.complex_modes import DENSE_LIMIT, whirl, whirl_name
from fem.effects import Rotor, Spin
from fem.model import skew
from fem.system import rigid_motions
from tests.frames import FLAT, STEEL, beam, cross_beam, fix

LIGHT = Material("light", 210e9, 1e-6)
ROUND = Section.circle(0.02)
MASS, IT, IP = 3.0, 0.01, 0.018
OFF = np.array([0.0, 0.02, 0.02])


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


SLENDER = replace(Section.circle(0.06), ky=0.0, kz=0.0)
"""Rotary inertia without shear: Rayleigh's beam."""


def pinned_shaft(n, length=1.0):
    ends = (fix(0, ("x", "y", "z", "rx")), fix(1, ("y", "z")))
    return beam(n, length, effects=ends, section=SLENDER, theory="timoshenko", spin=1.0)


def pinned_whirl(k, speed, length=1.0):
    """Return forward and backward whirl of a pinned Rayleigh shaft in its k-th shape.

    (1 + r²β²) ω² - 2 r²β² Ω ω - EI β⁴/ρA = 0, r² = I/A, since the polar inertia is twice that of bending.
    """
    beta = k * np.pi / length
    ratio = SLENDER.Iy / SLENDER.A * beta**2
    bend = STEEL.E * SLENDER.Iy * beta**4 / (STEEL.rho * SLENDER.A)
    roots = np.real(np.roots([1 + ratio, -2 * ratio * speed, -bend]))
    return np.sort(roots)[::-1]


def test_a_spinning_rayleigh_shaft():
    """Errors fall with the fourth power of the element, and are about those (βh)⁴/1440 of a beam at rest."""
    speed, error = 60000.0, {}
    for n in (8, 16):
        model = pinned_shaft(n).with_effect(Spin(name="spin", speed=speed))
        modes = solve_complex_modes(assemble(model, reciprocal=False), 10)
        sense = whirl(model, modes.poles, modes.shapes)
        for sign in (1, -1):
            mine = np.sort(modes.poles[np.nan_to_num(sense) * sign > 0.5].imag)[:2]
            exact = [abs(pinned_whirl(k, speed)[0 if sign > 0 else 1]) for k in (1, 2)]
            error[n, sign] = mine / exact - 1
    split = pinned_whirl(1, speed)
    assert split[0] > 1.3 * abs(split[1]), "the gyroscopic effect is not small"
    for sign in (1, -1):
        coarse, fine = error[8, sign], error[16, sign]
        np.testing.assert_allclose(coarse / fine, 16, rtol=0.1)
        bound = (np.pi * np.array([1, 2]) / 16) ** 4 / 1440
        assert (abs(fine) < 2 * bound).all()
        assert (abs(fine) > 0.1 * bound).all()


def test_a_rayleigh_shaft_at_its_critical_speeds():
    """At ω = Ω the forward whirl has Ω² = EIβ⁴/ρA / (1 - r²β²), the backward one / (1 + 3 r²β²)."""
    model = pinned_shaft(16)
    beta = np.pi
    ratio, bend = SLENDER.Iy / SLENDER.A * beta**2, STEEL.E * SLENDER.Iy * beta**4 / (STEEL.rho * SLENDER.A)
    exact = np.sqrt([bend / (1 + 3 * ratio), bend / (1 - ratio)])
    found = solve_campbell(model, np.linspace(0, 1.2 * exact[1], 6), 4)
    lowest = [c for c in found.critical if np.isfinite(c.whirl)][:2]
    assert [whirl_name(c.whirl) for c in lowest] == ["backward", "forward"]
    np.testing.assert_allclose([c.speed for c in lowest], exact, rtol=2 * (beta / 16) ** 4 / 1440)
    # without damping the critical speeds of order k solve K x = Ω² (k²M - ikG) x, which is Hermitian
    system = assemble(model)
    unit = model.with_effect(Spin(name="spin", speed=1.0))
    G = assemble(unit, reciprocal=False).C.toarray()
    K, M = system.K.toarray(), system.M.toarray()
    for order in (1.0, 2.0):
        mu = sla.eigh(order**2 * M - 1j * order * G, K, eigvals_only=True)
        direct = 1 / np.sqrt(mu[::-1][:3])
        again = solve_campbell(model, np.linspace(0, 1.2 * exact[1], 6), 4, [order]).critical
        np.testing.assert_allclose([c.speed for c in again[:2]], direct[:2], rtol=1e-7)


def test_spin_is_linear_in_speed_and_rotation_of_the_frame():
    """C of lumped, offset and rigid-ended shafts keeps the angular momentum ρ Ip L Ω for a rigid turn."""
    for more in (
        {},
        {"mass": "lumped"},
        {"rigid1": 0.1, "offset1": OFF, "offset2": OFF},
        {"mass": "higher-order"},
    ):
        model = beam(
            3, 0.9, along=(1, 2, -2), section=ROUND, theory="timoshenko", spin=-2.0, **more
        ).with_effect(Spin(name="spin", speed=7.0))
        C = assemble(model, reciprocal=False)
        full = np.asarray((C.Q @ C.C @ C.Q.T).todense())
        np.testing.assert_allclose(full, -full.T, atol=1e-15 * abs(full).max())
        turns = rigid_motions(model)[:, 3:6]
        turns = turns / turns[3, 0]  # by 1 rad
        axis = np.array([1, 2, -2]) / 3
        momentum = -2.0 * 7.0 * STEEL.rho * ROUND.Ip * 0.9
        np.testing.assert_allclose(turns.T @ full @ turns, -momentum * skew(axis), atol=1e-12 * abs(momentum))


def test_what_cannot_spin_is_refused():
    def spun(**more):
        return Spin(name="spin", speed=1.0).contribute(
            beam(2, 1.0, spin=1.0, **{"section": ROUND, "theory": "timoshenko", **more})
        )

    with pytest.raises(ModelError, match="'beam' cannot spin: its theory is 'euler-bernoulli'"):
        spun(theory="euler-bernoulli")
    with pytest.raises(ModelError, match="a shaft that is not round"):
        spun(section=FLAT)
    flat = AddedMass(name="vane", point=2, mass=1.0, inertia=np.diag([3.0, 1.0, 2.0]))
    with pytest.raises(ModelError, match=r"'vane' cannot spin: its inertia .* spins = false"):
        spun(effects=(flat,))
    assert spun(effects=(replace(flat, spins=False),))
    aside = AddedMass(name="aside", point=2, mass=1.0, inertia=np.eye(3), arm=np.array([0, 0.1, 0]))
    with pytest.raises(ModelError, match="its centre lies off the axis"):
        spun(effects=(aside,))
    with pytest.raises(ModelError, match="no member spins"):
        solve_campbell(beam(2), [0, 1])
    with pytest.raises(ModelError, match="an order is -1"):
        solve_campbell(pinned_shaft(2), [0, 1], orders=[-1])
