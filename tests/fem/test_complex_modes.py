"""Complex modes: closed forms, orthogonality, superposition, and every kind of damping."""

import numpy as np
import pytest
import scipy.linalg as sla

from fem import (
    AddedMass,
    Damping,
    FRFError,
    Joint,
    Material,
    ModelError,
    Viscoelastic,
    Zener,
    assemble,
    compute_frf,
    solve_complex_modes,
    solve_modes,
)
from fem.analysis.complex_modes import DENSE_LIMIT, TOLERANCE
from tests.frames import FLAT, STEEL, beam, cross_beam, fix, mounted, planar

K, M = 4e4, 2.5
UP = np.diag([0, 0, 1.0, 0, 0, 0])
ONLY_Z = fix(0, ("x", "y", "rx", "ry", "rz"))
LIGHT = Material("light", 1e10, 1e-6)
DAMPER = np.diag([50, 50, 500, 3, 3, 1.0])


def mass_on(**matrices):
    """Return one mass on an element in z; the line that it sits on is held to move with it."""
    element = Joint(name="spring", point1=0, location=np.zeros(3), **{k: v * UP for k, v in matrices.items()})
    held = fix(1, ("x", "y", "rx", "ry", "rz"))
    lump = AddedMass(name="m", point=0, mass=M)
    return beam(1, 0.1, effects=(element, lump, ONLY_Z, held), material=LIGHT)


def on_soft_spring(n, k, c=0.0):
    """Return a stiff rod of n elements that a mass at its end holds on a soft spring in z."""
    spring = Joint(name="spring", point1=0, location=np.zeros(3), K=k * UP, C=c * UP)
    held = fix(0, ("x", "y", "rx", "ry", "rz")), fix(n, ("y", "rx", "rz"))
    return beam(n, 0.1, effects=(spring, AddedMass(name="m", point=0, mass=2.0), *held))


def dense_poles(system, n):
    """Return the slowest poles with Im s ≥ 0 from the state space of K̂, Ĉ, M."""
    d = system.model.damping
    K = (system.K + 1j * (system.D + d.loss_factor * system.K)).toarray()
    C = (system.C + d.alpha * system.M + d.beta * system.K).toarray()
    M = system.M.toarray()
    scale = 1 / np.sqrt(M.diagonal())
    K, C, M = (scale[:, None] * X * scale for X in (K, C, M))
    w = np.sqrt(abs(K).max())  # time in its unit: the state is of one size
    top = -np.linalg.solve(M, np.hstack([K / w**2, C / w]))
    eye = np.eye(len(K))
    s = w * sla.eigvals(np.vstack([np.hstack([0 * eye, eye]), top]))
    s = s[(s.imag > -1e-9 * abs(s)) & (abs(s) > 1.0)]
    return s[np.argsort(abs(s))][:n]


@pytest.mark.parametrize("c", [20.0, 632.0, 900.0])
def test_one_mass_and_a_dashpot(c):
    # s = -ζω ± iω√(1 - ζ²), or two real poles where ζ = c/(2√(km)) > 1; 632/(2√(km)) = 0.9993
    modes = solve_complex_modes(assemble(mass_on(K=K, C=c)), 1 if c < 900 else 2)
    exact = np.roots([M, c, K])
    exact = np.sort_complex(exact[exact.imag >= 0])[::-1]
    # beside critical damping a relative change ε moves s by √ε: the light line has 1e-13 of the mass
    np.testing.assert_allclose(modes.poles, exact, rtol=1e-9)
    assert modes.converged
    if c < 900:
        assert modes.zeta[0] == pytest.approx(c / (2 * np.sqrt(K * M)), rel=1e-9)
        assert modes.frequency[0] == pytest.approx(np.sqrt(K / M) / (2 * np.pi), rel=1e-9)
        assert modes.modal_a[0] == 2j * modes.poles[0].imag
        assert not modes.overdamped[0]
    else:
        np.testing.assert_array_equal(modes.overdamped[:2], True)
        np.testing.assert_array_equal(modes.zeta[:2], 1.0)
        np.testing.assert_allclose(abs(modes.modal_a[:2]), 2 * abs(modes.poles[:2]))
        assert modes.as_modes().n_modes == modes.n_modes - 2
    np.testing.assert_allclose(modes.modal_b, -modes.poles * modes.modal_a)
    f = np.array([0.0, 5.0, 20.0, 90.0])
    H = modes.frf(f, [(0, "z")], [(0, "z")], kind="receptance").H[:, 0, 0]
    w = 2 * np.pi * f
    np.testing.assert_allclose(H, 1 / (K + 1j * w * c - w**2 * M), rtol=1e-8)


def test_a_body_that_drifts_in_a_dashpot():
    # no spring against z: a pole at 0, and one near -c/m, m the beam's mass; bending makes m less, and the
    # pole faster, by c²/(m k) of its stiffness k at the middle, 48 EI/L³ and more
    c = 0.5
    dashpot = Joint(name="pot", point1=2, location=np.array([0.5, 0, 0]), C=c * UP)
    model = planar(beam(2, effects=(dashpot, fix(0, ("ry",), "turn"))))
    modes = solve_complex_modes(assemble(model), 8)
    assert modes.rigid.shape[1] == 0
    assert abs(modes.poles[0]) < 1e-6
    mass = STEEL.rho * FLAT.A
    assert modes.poles[1].real == pytest.approx(-c / mass, rel=c**2 / mass / (48 * STEEL.E * FLAT.Iy))
    f = np.array([0.01, 1.0, 10.0])
    H = modes.frf(f, [(0, "z")], [(1, "z")], kind="receptance").H
    direct = compute_frf(assemble(model), f, [(0, "z")], [(1, "z")], kind="receptance", method="direct").H
    np.testing.assert_allclose(H, direct, rtol=1e-6)


@pytest.mark.parametrize("ratio", [0.3, 0.8])
def test_a_rod_with_a_dashpot_at_its_end(ratio):
    # fixed-free rod, impedance Z = A √(Eρ): cosh γL + (c/Z) sinh γL = 0, γ = s/c0, so that
    # s = (c0/L) (-atanh(c/Z) + iπ(k - ½)). Linear elements err by order h²: extrapolated, by h⁴.
    length, speed = 1.7, np.sqrt(STEEL.E / STEEL.rho)
    Z = FLAT.A * np.sqrt(STEEL.E * STEEL.rho)
    exact = speed / length * (-np.arctanh(ratio) + 1j * np.pi * (np.arange(1, 4) - 0.5))
    damper = Joint(
        name="end", point1=1, location=np.array([length, 0, 0]), C=np.diag([ratio * Z, 0, 0, 0, 0, 0])
    )
    error = []
    for n in (20, 40):
        modes = solve_complex_modes(assemble(planar(beam(n, length, effects=(fix(0), damper)), ("x",))), 3)
        assert modes.converged
        error.append(modes.poles / exact - 1)
    coarse, fine = error
    kh = abs(exact) * length / speed / 20
    np.testing.assert_allclose(coarse / fine, 4, atol=0.3 * kh.max() ** 2 * 4)
    assert (abs(fine) < kh**2 / 24).all()
    assert (abs(4 * fine - coarse) / 3 < kh**4 / 24).all()


CASES = {
    "viscous": {"C": DAMPER, "eta": 0.0, "loss_factor": 0.0},
    "structural": {"eta": 0.3, "loss_factor": 0.01},
    "mixed": {"C": DAMPER, "eta": 0.1, "loss_factor": 0.02},
    "creeping": {"C": np.diag([5e4, 2e4, 5e3, 9, 9, 30]), "eta": 0.0, "loss_factor": 0.0},
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("rayleigh", [False, True])
def test_all_modes_together_are_the_receptance(name, rayleigh):
    model = cross_beam(0.2, **CASES[name])
    if rayleigh:
        model = model.with_damping(Damping(alpha=3.0, beta=2e-6, loss_factor=CASES[name]["loss_factor"]))
    system = assemble(model)
    modes = solve_complex_modes(system, 2 * system.n_free)
    assert modes.rigid.shape[1] == (0 if rayleigh else 6)
    f = np.array([3.0, 40.0, 47.9, 200.0, 900.0])
    places = [(0, "z"), (1, "x"), (3, "z"), (4, "ry")]
    direct = compute_frf(system, f, places, places[:2], kind="receptance", method="direct").H
    found = modes.frf(f, places, places[:2], kind="receptance").H
    # rounding: poles of the highest modes are known to 1e-16 of |K|, and cancel between them
    error = abs(found - direct).max(axis=(0, 2)) / abs(direct).max(axis=(0, 2))
    assert error.max() < 1e-6


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("size", [0.2, 0.04])
def test_poles_are_those_of_the_state_space(name, size):
    system = assemble(cross_beam(size, **CASES[name]))
    assert (system.n_free > DENSE_LIMIT) == (size == 0.04)
    modes = solve_complex_modes(system, 10)
    assert modes.converged
    assert (modes.residual <= TOLERANCE).all()
    exact = dense_poles(system, 10)
    # the state space loses 1e-16 of its highest pole
    np.testing.assert_allclose(modes.frequency, abs(exact) / (2 * np.pi), rtol=1e-6)
    oscillating = ~modes.overdamped
    np.testing.assert_allclose(modes.zeta[oscillating], (-exact.real / abs(exact))[oscillating], atol=1e-6)


@pytest.mark.parametrize("size", [0.1, 0.04])
def test_modes_are_orthogonal(size):
    # xᵀ((s + t) M + C) y = 0 and xᵀ(K - s t M) y = 0 for different poles s and t: modal A and B
    system = assemble(cross_beam(size, **CASES["viscous"]))
    modes = solve_complex_modes(system, 10)
    x, s = system.Q.T @ modes.shapes, modes.poles
    every, poles = np.hstack([x, x.conj()]), np.concatenate([s, s.conj()])
    mass, damping = every.T @ (system.M @ every), every.T @ (system.C @ every)
    stiffness = every.T @ (system.K @ every)
    sums, products = poles[:, None] + poles, poles[:, None] * poles
    A, B = sums * mass + damping, stiffness - products * mass
    different = abs(poles[:, None] - poles) > 1e-6 * abs(poles[:, None])
    scale = np.sqrt(np.outer(abs(np.diag(A)), abs(np.diag(A))))
    assert abs(A[different]).max() < 1e-7 * scale.max()
    assert abs(B[different]).max() < 1e-7 * scale.max() * abs(poles).max()
    np.testing.assert_allclose(np.diag(A)[:10], modes.modal_a, rtol=1e-6)
    np.testing.assert_allclose(np.diag(B)[:10], modes.modal_b, rtol=1e-6)


@pytest.mark.parametrize(
    "damping",
    [Damping.rayleigh(4.0, 1e-6), Damping.structural(0.02), Damping.modal([0.01, 0.03], [10.0, 400.0])],
)
@pytest.mark.parametrize("n", [8, 40])
def test_proportional_damping_leaves_the_modes_real(damping, n):
    system = assemble(beam(n, effects=(fix(0),)).with_damping(damping))
    real, found = solve_modes(system, 8), solve_complex_modes(system, 8).as_modes()
    # structural: s² = -ω²(1 + iη), |s| = ω(1 + η²)^¼, and ζ is η/2 but for η³
    eta = damping.loss_factor
    np.testing.assert_allclose(found.frequency, real.frequency * (1 + eta**2) ** 0.25, rtol=1e-8)
    np.testing.assert_allclose(found.zeta, real.zeta, rtol=1e-8, atol=eta**3 / 4)
    M = system.M
    x = system.Q.T @ found.shapes
    mac = abs((system.Q.T @ real.shapes).T @ (M @ x)) ** 2
    np.testing.assert_allclose(np.diag(mac), 1.0, rtol=max(1e-6, eta**2))
    # one phase: the imaginary part is the real one's multiple
    turned = x / (x[abs(x).argmax(axis=0), np.arange(8)])
    assert abs(turned.imag).max() < 1e-6


def test_a_law_is_met_at_the_modes_own_frequency():
    # m s² + K (storage + i loss)(Im s) = 0, iterated apart
    law = Zener(3.0, 5e-3)
    rubber = Viscoelastic(name="rubber", point1=0, location=np.zeros(3), K=K * UP, law=law)
    held = fix(1, ("x", "y", "rx", "ry", "rz"))
    model = beam(1, 0.1, effects=(rubber, AddedMass(name="m", point=0, mass=M), ONLY_Z, held), material=LIGHT)
    modes = solve_complex_modes(assemble(model), 1)
    s = 1j * np.sqrt(K / M)
    for _ in range(200):
        storage, loss = law(np.array([s.imag]))
        s = 1j * np.sqrt(K * (storage[0] + 1j * loss[0]) / M)
    assert modes.poles[0] == pytest.approx(s, rel=1e-9)
    assert modes.converged
    with pytest.raises(FRFError, match="do not superpose"):
        modes.frf([1.0], [(0, "z")], [(0, "z")])


@pytest.mark.parametrize("size", [0.1, 0.02])
def test_laws_are_met_in_a_frame(size):
    system = assemble(mounted(size))
    modes = solve_complex_modes(system, 3)
    assert modes.converged
    # each pole is one of Z with its laws frozen at its own frequency
    for s, x in zip(modes.poles, modes.shapes.T, strict=True):
        eta = system.model.damping.loss_factor
        frozen = system.dynamic_stiffness(s.imag) - (1 + 1j * eta) * system.K + s.imag**2 * system.M
        Z = frozen + (1 + 1j * eta) * system.K + s**2 * system.M
        q = system.Q.T @ x
        terms = abs(Z) @ abs(q)
        assert abs(Z @ q).max() < 1e-7 * terms.max()


@pytest.mark.parametrize("n", [1, 4, 20])
@pytest.mark.parametrize("c", [0.0, 1.0])
def test_slow_and_fast_modes_of_one_list_converge(n, c):
    # 3 Hz of a mass on a soft spring beside 1e4 Hz and more of the rod: each is right in its own equation
    model = on_soft_spring(n, 800.0, c)
    modes = solve_complex_modes(assemble(model), 8)
    assert modes.converged
    assert modes.residual.max() < 1e-7
    undamped = solve_modes(assemble(model), 8).frequency
    np.testing.assert_allclose(modes.frequency, undamped[: modes.n_modes], rtol=1e-6)


def test_rounding_above_a_millionth_is_not_converged():
    # stiffnesses twelve decades apart: the assembled matrix has lost the slow mode's digits
    system = assemble(on_soft_spring(20, 1.0))
    modes = solve_complex_modes(system, 8)
    exact = solve_modes(system, 8).frequency
    error = abs(modes.frequency[0] / exact[0] - 1)
    assert 1e-6 < error < modes.residual.max() * 10
    assert not modes.converged


def test_what_is_asked_wrongly_is_refused():
    system = assemble(cross_beam(0.2))
    with pytest.raises(ModelError, match="0 modes"):
        solve_complex_modes(system, 0)
    modes = solve_complex_modes(system, 2)
    with pytest.raises(FRFError, match="nothing holds"):
        modes.frf([0.0], [(0, "z")], [(0, "z")])
    whole = modes.as_modes()
    assert whole.n_rigid == 6
    assert whole.n_modes == 8
    assert not whole.frequency[:6].any()
