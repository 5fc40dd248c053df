"""Responses in time against closed forms, and the errors of Newmark's method against their formulas."""

import numpy as np
import pytest

from fem import Damping, Excitation, Joint, Model, ModelError, assemble, compute_base_frf, solve_transient
from fem.analysis.excitation import interpolated
from fem.analysis.recurrence import coupled, oscillators
from fem.effects import Rotor
from tests.frames import FLAT, STEEL, beam, fix, planar

ROOTS = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613, 10.995540734875467])
"""Of cos λ cosh λ = -1: clamped-free beams."""


def oscillator(zeta=0.0, effects=()):
    """Return a bar that is one oscillator, of consistent mass ρAL/3 and stiffness EA/L, and its ω."""
    model = planar(beam(1, effects=(fix(0), *effects)), keep=("x",))
    model = Model(model.mesh, model.effects, Damping.modal(zeta))
    return model, np.sqrt(3 * STEEL.E / STEEL.rho)


def tip_force(model, size=1.0, direction=0):
    F = np.zeros(model.n_dof)
    F[6 + direction] = size
    return F


@pytest.mark.parametrize("zeta", [0.0, 0.05, 0.7])
def test_a_step_is_exact_however_long_the_steps_in_time(zeta):
    model, omega = oscillator(zeta)
    t = np.linspace(0, 40 / omega, 31)  # 1.3 radians a step
    found = solve_transient(
        assemble(model),
        Excitation.of(model, t, tip_force(model, 1e6), np.ones_like(t)),
        [(1, "x")],
        n_modes=1,
    )
    static = 1e6 / (STEEL.E * FLAT.A)
    damped = omega * np.sqrt(1 - zeta**2)
    decay = np.exp(-zeta * omega * t)
    expected = static * (1 - decay * (np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t)))
    np.testing.assert_allclose(found.displacement[:, 0], expected, atol=1e-11 * static)
    speed = static * omega**2 / damped * decay * np.sin(damped * t)
    np.testing.assert_allclose(found.velocity[:, 0], speed, atol=1e-11 * static * omega)


@pytest.mark.parametrize("zeta", [0.0, 0.05])
def test_an_impulse_is_an_initial_velocity(zeta):
    model, omega = oscillator(zeta)
    t = np.linspace(0, 30 / omega, 50)
    start = np.zeros(model.n_dof), tip_force(model, 2.0)
    found = solve_transient(assemble(model), Excitation.of(model, t), [(1, "x")], n_modes=1, initial=start)
    damped = omega * np.sqrt(1 - zeta**2)
    expected = 2.0 / damped * np.exp(-zeta * omega * t) * np.sin(damped * t)
    np.testing.assert_allclose(found.displacement[:, 0], expected, atol=1e-11 * 2 / omega)


def test_a_ramp_a_free_mass_and_an_overdamped_oscillator():
    t = np.linspace(0, 3, 7)
    one = np.ones(1)
    y, v = oscillators(np.array([4.0]), 0 * one, t[:, None], t[1], (0 * one, 0 * one))
    np.testing.assert_allclose(y[:, 0], t / 4 - np.sin(2 * t) / 8, atol=1e-13)
    y, v = oscillators(0 * one, 0 * one, t[:, None], t[1], (1 * one, 2 * one))
    np.testing.assert_allclose(y[:, 0], 1 + 2 * t + t**3 / 6, rtol=1e-13)
    np.testing.assert_allclose(v[:, 0], 2 + t**2 / 2, rtol=1e-13)
    # roots -1 and -4
    y, v = oscillators(np.array([4.0]), np.array([5.0]), 0 * t[:, None], t[1], (one, 0 * one))
    np.testing.assert_allclose(y[:, 0], (4 * np.exp(-t) - np.exp(-4 * t)) / 3, atol=1e-13)


def test_coupled_steps_of_uncoupled_oscillators_are_theirs():
    rng = np.random.default_rng(0)
    k, c, B = rng.uniform(1, 50, 4), rng.uniform(0, 20, 4), rng.standard_normal((4, 2))
    p, start = rng.standard_normal((30, 2)), (rng.standard_normal(4), rng.standard_normal(4))
    alone = oscillators(k, c, p @ B.T, 0.1, start)
    together = coupled(np.diag(k), np.diag(c), B, p, 0.1, start)
    np.testing.assert_allclose(together, alone, atol=1e-12)


def newmark_free(steps_per_radian, n, alpha=0.0):
    """Return free vibration from a unit displacement by Newmark's method, and ωh."""
    model, omega = oscillator()
    wh = 1 / steps_per_radian
    t = wh / omega * np.arange(n)
    start = tip_force(model, 1.0), np.zeros(model.n_dof)
    found = solve_transient(
        assemble(model),
        Excitation.of(model, t),
        [(1, "x")],
        method="newmark",
        alpha=alpha,
        initial=start,
        n_modes=1,
    )
    return found.displacement[:, 0], wh


@pytest.mark.parametrize("steps_per_radian", [0.2, 1, 5])
def test_the_average_acceleration_lengthens_periods_and_keeps_amplitudes(steps_per_radian):
    """tan(Ω/2) = ωh/2 of the average acceleration (Hughes, The Finite Element Method, 1987, section 9.3)."""
    u, wh = newmark_free(steps_per_radian, 200)
    turn = 2 * np.arctan(wh / 2)
    np.testing.assert_allclose(u, np.cos(turn * np.arange(200)), atol=1e-10)


def test_hilber_hughes_and_taylor_damp_what_a_step_cannot_resolve():
    """The spectral radius at ωh → ∞ is (1 + α)/(1 - α), that of a double root (Hughes 1987, section 9.3)."""
    alpha = -0.2
    u, _ = newmark_free(1e-5, 40, alpha)
    n = np.arange(14, 40)  # the third root, α/(1 + α), has died away
    # a double root ρ: u = (a + b n) ρⁿ, with ρ negative
    rho = -(1 + alpha) / (1 - alpha)
    a, b = np.polynomial.polynomial.polyfit(n, u[n] / rho**n, 1)
    np.testing.assert_allclose(u[n] / rho**n, a + b * n, rtol=1e-5)


@pytest.mark.parametrize("alpha", [0.0, -0.1])
def test_newmark_converges_with_the_square_of_the_step(alpha):
    """A damper couples the modes; by modes the result is exact."""
    damper = Joint(name="damper", point1=1, location=(1.0, 0.0, 0.0), C=np.diag([0, 0, 40.0, 0, 0, 0]))
    model = beam(4, effects=(fix(0), damper))
    model = Model(planar(model).mesh, planar(model).effects, Damping.modal(0.02))
    system = assemble(model)
    F = tip_force(model, 10.0, 2)

    def found(n, method):
        t = np.linspace(0, 0.1, n + 1)
        e = Excitation.of(model, t, F, np.sin(20 * t) ** 2)
        more = {"alpha": alpha} if method == "newmark" else {}
        return solve_transient(system, e, [(1, "z")], method=method, n_modes=system.n_free, **more)

    exact = found(6400, "modal").displacement[:, 0]
    errors = [np.abs(found(n, "newmark").displacement[:, 0] - exact[:: 6400 // n]).max() for n in (400, 800)]
    assert errors[0] / errors[1] == pytest.approx(4, abs=0.4)


@pytest.mark.parametrize("n_modes", [1, 2, 4])
def test_a_cantilever_under_a_step_at_its_tip(n_modes):
    """u = (4 F L³/EI) Σ (1 - cos ω t)/λ⁴, the static part of the modes left out included."""
    n = 16
    model = beam(n, effects=(fix(0),))
    model = Model(planar(model).mesh, planar(model).effects, Damping())
    EI, m, F = STEEL.E * FLAT.Iy, STEEL.rho * FLAT.A, 25.0
    roots = ROOTS[:n_modes]
    omega = roots**2 * np.sqrt(EI / m)
    t = np.linspace(0, 4 * np.pi / omega[0], 200)
    e = Excitation.of(model, t, tip_force(model, F, 2), np.ones_like(t))
    found = solve_transient(assemble(model), e, [(1, "z")], n_modes=n_modes)
    rest = F / (3 * EI) - (4 * F / EI / roots**4).sum()
    expected = rest + (4 * F / EI / roots**4 * (1 - np.cos(np.outer(t, omega)))).sum(axis=1)
    # frequencies are (λ/n)⁴/1440 too high, and a mode's amplitude errs by twice that
    error = (roots / n) ** 4 / 1440
    allowed = (4 * F / EI / roots**4 * error * (2 + np.outer(t, omega))).sum(axis=1) + 1e-9 * F / EI
    assert (np.abs(found.displacement[:, 0] - expected) < 1.2 * allowed).all()
    assert np.abs(found.displacement[:, 0] - expected).max() > 0.05 * allowed.max()


def test_a_motion_of_the_base_settles_to_its_transmissibility():
    model = beam(6, effects=(fix(0),))
    model = Model(planar(model).mesh, planar(model).effects, Damping.modal(0.1))
    system = assemble(model)
    f, h = 12.0, 1e-4
    t = h * np.arange(int(3.0 / h) + 1)
    e = Excitation.of(model, t, base={"z": np.sin(2 * np.pi * f * t)})
    for relative in (True, False):
        found = solve_transient(system, e, [(1, "z")], n_modes=system.n_free, relative=relative)
        H = compute_base_frf(system, f, [(1, "z")], ["z"], relative=relative).H[0, 0, 0]
        last = t > 2.8
        expected = np.imag(H * np.exp(2j * np.pi * f * t[last]))
        # straight lines between samples of a sine have 1 - (ωh)²/12 of it
        slack = 2 * (2 * np.pi * f * h) ** 2 / 12 * abs(H)
        np.testing.assert_allclose(found.acceleration[last, 0], expected, atol=slack + 1e-9)


def test_newmark_takes_motions_of_the_base_and_modal_ratios():
    model = beam(3, effects=(fix(0),))
    model = Model(planar(model).mesh, planar(model).effects, Damping.modal(0.05))
    system, t = assemble(model), 2e-5 * np.arange(2000)
    e = Excitation.of(model, t, base={"z": np.sin(300 * t)})
    by_modes, stepped = (
        solve_transient(system, e, [(1, "z")], method=m, n_modes=system.n_free) for m in ("modal", "newmark")
    )
    size = np.abs(by_modes.displacement).max()
    np.testing.assert_allclose(stepped.displacement, by_modes.displacement, atol=2e-5 * size)


def test_a_rotor_precesses():
    """Two equal bending modes with a gyroscopic moment: the energy stays, and both planes move."""
    rotor = Rotor(name="rotor", point=1, axis=(1.0, 0.0, 0.0), momentum=5.0)
    model = beam(2, section=FLAT, effects=(fix(0), rotor))
    model = Model(planar(model, ("y", "z", "ry", "rz")).mesh, model.effects, Damping())
    system = assemble(model, reciprocal=False)
    t = np.linspace(0, 0.2, 400)
    start = np.zeros(model.n_dof), np.zeros(model.n_dof)
    start[1][6 + 2] = 1.0
    rows = list(range(6, model.n_dof))
    found = solve_transient(system, Excitation.of(model, t), rows, n_modes=system.n_free, initial=start)
    q, v = (np.pad(x, ((0, 0), (6, 0))) @ system.Q for x in (found.displacement, found.velocity))
    energy = (np.einsum("ti,ti->t", q, q @ system.K) + np.einsum("ti,ti->t", v, v @ system.M)) / 2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)
    assert np.abs(found.displacement[:, 1]).max() > 0.01 * np.abs(found.displacement[:, 2]).max()
    with pytest.raises(ModelError, match="use the modal method"):
        solve_transient(system, Excitation.of(model, t), rows, method="newmark")


def test_a_free_structure_flies_off():
    model = beam(2)
    mass = STEEL.rho * FLAT.A
    t = np.linspace(0, 0.1, 50)
    F = np.zeros(model.n_dof)
    F[[2, 8]] = 5.0
    found = solve_transient(
        assemble(model), Excitation.of(model, t, F, np.ones_like(t)), [(0, "z"), (1, "z"), (2, "z")]
    )
    middle = found.acceleration.mean(axis=0)
    assert found.displacement[-1].mean() == pytest.approx(0.5 * 10 / mass * 0.1**2, rel=0.05)
    assert middle.shape == (3,)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"method": "euler"}, "allowed are modal, newmark"),
        ({"alpha": 0.1}, "allowed are -1/3 to 0"),
        ({"initial": (np.ones(12), np.zeros(12))}, "where supports or rigid joints do not allow it"),
        ({"initial": (np.ones(3), np.zeros(12))}, r"has shape \(3,\)"),
    ],
)
def test_what_cannot_be_meant_is_refused(change, message):
    model, _ = oscillator()
    with pytest.raises(ModelError, match=message):
        solve_transient(assemble(model), Excitation.of(model, [0, 1]), [(1, "x")], n_modes=1, **change)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"time": [0, 1, 3]}, "steps from 1 to 2 s"),
        ({"time": [0, 0]}, "that increase"),
        ({"time": [0, 1], "base": {"w": [0, 0]}}, "the base moves in 'w'"),
        ({"time": [0, 1], "base": {"x": [0]}}, r"has shape \(1,\)"),
        ({"time": [0, 1], "loads": np.zeros(12), "forces": [0, np.nan]}, "not finite"),
        ({"time": [0, 1], "loads": np.zeros(5), "forces": [0, 1]}, r"loads have shape \(5, 1\)"),
    ],
)
def test_excitations_that_cannot_be_meant_are_refused(parts, message):
    model, _ = oscillator()
    with pytest.raises(ModelError, match=message):
        Excitation.of(model, **parts)


def test_histories_are_interpolated_on_equal_steps():
    t, v = interpolated([0, 1, 3], [[0.0], [1.0], [5.0]], 0.5)
    np.testing.assert_allclose(t, np.arange(7) / 2)
    np.testing.assert_allclose(v[:, 0], [0, 0.5, 1, 2, 3, 4, 5])


def test_structural_damping_is_noted():
    model, _ = oscillator()
    model = Model(model.mesh, model.effects, Damping.structural(0.02))
    found = solve_transient(assemble(model), Excitation.of(model, [0, 1e-5]), [(1, "x")], n_modes=1)
    assert "structural damping is replaced" in found.notes[0]
