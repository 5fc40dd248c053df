"""Response spectra, random vibration and shock spectra against closed forms."""

import numpy as np
import pytest

from fem import (
    AddedMass,
    Damping,
    Excitation,
    Joint,
    LoadCase,
    Material,
    Model,
    ModelError,
    Tabulated,
    assemble,
    compute_participation,
    shock_response_spectrum,
    solve_random,
    solve_spectrum,
    solve_static,
    solve_transient,
)
from fem.analysis.response_spectrum import combined, modal_correlation
from tests.frames import FLAT, STEEL, beam, fix, planar

FLAT_SPECTRUM = Tabulated.of([0.01, 1e6], [1.0, 1.0])


def cantilever(n, zeta=0.05, keep=("z", "ry"), effects=()):
    model = planar(beam(n, effects=(fix(0), *effects)), keep)
    return Model(model.mesh, model.effects, Damping.modal(zeta))


LIGHT, HEAVY = Material("light", STEEL.E, 1e-6), 5.0
"""A bar of next to no mass, and the mass [kg] at its end."""


def oscillator(zeta):
    """Return a mass on a bar, its frequency [Hz] and the bar's stiffness."""
    effects = (fix(0), AddedMass(name="mass", point=1, mass=HEAVY))
    model = planar(beam(1, material=LIGHT, effects=effects), ("x",))
    k = STEEL.E * FLAT.A
    return Model(model.mesh, model.effects, Damping.modal(zeta)), np.sqrt(k / HEAVY) / (2 * np.pi), k


def test_points_are_joined_by_straight_lines_on_logarithmic_axes():
    s = Tabulated.of([1, 10, 20], [2.0, 200.0, 0.0])
    assert s.at([0.5, 1, np.sqrt(10), 10, 15, 30]) == pytest.approx([2, 2, 20, 200, 100, 0])
    assert s.within([0.5, 1, 20, 21]) == pytest.approx([0, 2, 0, 0])


def test_correlation_of_two_close_modes():
    """For equal damping ρ = 8ζ²(1 + r) r^1.5 / ((1 - r²)² + 4ζ² r (1 + r)²) (Wilson, Der Kiureghian, Bayo
    1981); with ζ = 5 % and r = 0.9 that is 0.4730."""
    zeta, r = 0.05, 0.9
    rho = modal_correlation([10.0, 9.0], [zeta, zeta])
    expected = 8 * zeta**2 * (1 + r) * r**1.5 / ((1 - r**2) ** 2 + 4 * zeta**2 * r * (1 + r) ** 2)
    assert rho == pytest.approx(np.array([[1, expected], [expected, 1]]), rel=1e-12)
    assert rho[0, 1] == pytest.approx(0.4730, abs=5e-5)
    assert modal_correlation([7.0, 7.0], [0.02, 0.02]) == pytest.approx(np.ones((2, 2)))
    peaks = np.array([[3.0, 3.0], [4.0, -4.0]])
    assert combined(peaks, rho) == pytest.approx(np.sqrt(25 + 24 * expected * np.array([1, -1])))
    assert combined(peaks, np.eye(2)) == pytest.approx([5, 5])


def test_correlation_is_that_of_responses_to_white_noise():
    """ρ is the correlation of two oscillators' displacements, here of their transfer functions' integrals."""
    w, z = np.array([10.0, 11.5]), np.array([0.03, 0.08])
    x = np.linspace(0, 60, 400_001)
    H = 1 / (w[:, None] ** 2 - x**2 + 2j * z[:, None] * w[:, None] * x)
    cross = np.real(np.trapezoid(H[:, None] * H[None].conj(), x))
    rho = cross / np.sqrt(np.outer(np.diag(cross), np.diag(cross)))
    np.testing.assert_allclose(modal_correlation(w, z), rho, atol=1e-4)  # beyond 60 rad/s: 1/(3 · 60³)


def test_the_missing_mass_is_a_static_load():
    """A spectrum of nothing but the acceleration of the base itself."""
    model = cantilever(6)
    system = assemble(model)
    tiny = Tabulated.of([0.01, 1e6], [0.0, 0.0])
    found = solve_spectrum(system, {"z": tiny}, [(1, "z")], n_modes=1, rigid_acceleration={"z": 9.81})
    modes = found.modes.shapes[:, :1]
    participation = compute_participation(system, found.modes)
    rigid = np.tile([0, 0, 1, 0, 0, 0], model.mesh.n_points)
    left = rigid - modes[:, 0] * participation.factors[0, 2]
    assert found.acceleration[0] == pytest.approx(9.81 * abs(left[8]))
    assert found.base_force[0] == pytest.approx(
        9.81 * (participation.total[2] - participation.effective_masses[0, 2])
    )
    # with all that the one mode has, at the same acceleration and of the same sign, it is gravity
    gravity = solve_static(system, LoadCase(gravity=[0, 0, 9.81]))
    mode = modes[8, 0] * participation.factors[0, 2] * 9.81 / found.modes.omega[0] ** 2
    sign = np.sign(gravity.displacements[8, 0] - mode)
    assert mode + sign * found.displacement[0] == pytest.approx(gravity.displacements[8, 0])


def test_missing_mass_replaces_modes_above_the_range():
    """The resultant is that of the modes and of what they leave out, and so is the reaction."""
    model = cantilever(8)
    system = assemble(model)
    gamma = []
    for n in (1, 4):
        found = solve_spectrum(system, {"z": FLAT_SPECTRUM}, [(1, "z")], n_modes=n, combination="srss")
        one = np.sqrt(found.effective_mass**2).sum(axis=0)
        rest = found.total_mass - found.effective_mass.sum(axis=0)
        expected = np.sqrt((found.effective_mass**2).sum(axis=0) + rest**2)
        assert found.base_force == pytest.approx(expected)
        assert found.reactions["support0", "z"] == pytest.approx(expected[0])
        gamma.append(one[0])
    assert gamma[1] > gamma[0]


def test_section_forces_are_those_of_the_inertia_beyond_the_section():
    """Of one mode: shear and moment at the foot are ∫ρA φ γ S and ∫ρA x φ γ S, those of the reactions."""
    model = cantilever(8)
    found = solve_spectrum(assemble(model), {"z": FLAT_SPECTRUM}, [(1, "z")], n_modes=1, missing_mass=False)
    foot = found.line_forces[0, 0]
    assert foot[2] == pytest.approx(found.reactions["support0", "z"])
    assert foot[4] == pytest.approx(found.reactions["support0", "ry"])
    assert found.line_forces[7, 1] == pytest.approx(0, abs=1e-9 * foot[2])  # at the free end
    # published: mode 1 of a clamped-free beam has 61.31 % of the mass
    share = found.effective_mass[0, 0] / found.total_mass[0]
    assert share == pytest.approx(0.6131, abs=1e-4)


def test_an_oscillator_meets_its_own_spectrum():
    """The spectrum of a record, and the peak of the response to that record in time."""
    zeta, t = 0.03, 1e-5 * np.arange(8001)
    a = np.sin(600 * t) * np.exp(-60 * t)
    model, f, _ = oscillator(zeta)
    system = assemble(model)
    sd = shock_response_spectrum(t, a, f, zeta, response="pseudo_velocity")[0] * 2 * np.pi * f
    spectrum = Tabulated.of([f], [sd])
    found = solve_spectrum(system, {"x": spectrum}, [(1, "x")], n_modes=1, missing_mass=False)
    e = Excitation.of(model, t, base={"x": a})
    response = solve_transient(system, e, [(1, "x")], n_modes=1, relative=True)
    assert found.displacement[0] == pytest.approx(np.abs(response.displacement).max(), rel=3e-3)


def half_sine(amplification_at):
    """Return the undamped spectrum of a half sine (Clough and Penzien, Dynamics of Structures, 1993, 5-2)."""
    beta = 1 / (2 * amplification_at)  # Ω/ω, of frequencies in 1/duration
    after = np.abs(2 * beta * np.cos(np.pi / (2 * beta)) / (1 - beta**2))
    k = np.arange(1, 40)[:, None]
    at = 2 * np.pi * k * beta / (1 + beta)
    during = (np.sin(at) - beta * np.sin(at / beta)) / (1 - beta**2)
    return np.maximum(after, np.where(at <= np.pi, np.abs(during), 0).max(axis=0))


def test_shock_spectrum_of_a_half_sine():
    x = np.array([0.1, 0.3, 0.45, 0.6, 0.81, 1.2, 2.3, 5.1])
    t = np.linspace(0, 1, 401)
    found = shock_response_spectrum(t, np.sin(np.pi * t), x, 0.0)
    # samples: 0.2 % below the peak at most; straight lines: (π/400)²/8
    np.testing.assert_allclose(found, half_sine(x), rtol=2.2e-3)
    assert found.max() == pytest.approx(1.769, rel=2e-3)  # the largest there is, at 0.81 of the duration
    displacement = shock_response_spectrum(t, np.sin(np.pi * t), x, 0.0, response="displacement")
    np.testing.assert_allclose(displacement * (2 * np.pi * x) ** 2, found, rtol=1e-9)
    whole, *parts = (
        shock_response_spectrum(t, np.sin(np.pi * t), x, 0.05, part=p)
        for p in ("maximax", "positive", "negative")
    )
    np.testing.assert_array_equal(np.maximum(*parts), whole)


def test_peaks_behind_the_record_are_found():
    """A record followed by nothing has the spectrum of the same record followed by zeros."""
    t = np.linspace(0, 1, 201)
    a = np.sin(np.pi * t) ** 2
    long = np.concatenate([a, np.zeros(1000)])
    f = [0.2, 0.4, 0.9]
    short = shock_response_spectrum(t, a, f, 0.05)
    padded = shock_response_spectrum(0.005 * np.arange(1201), long, f, 0.05)
    np.testing.assert_allclose(short, padded, rtol=1e-3)
    assert (short >= padded * (1 - 1e-12)).all()


def test_miles_equation_and_the_exact_root_mean_square():
    """White noise at the base: σ² = π f S (1 + 4ζ²)/(4ζ) of the acceleration; Miles leaves out 4ζ²."""
    for zeta in (0.01, 0.1):
        model, f, _ = oscillator(zeta)
        # a band of two decades either way leaves out less than 1e-4 of the square
        white = Tabulated.of([f / 300, 300 * f], [2.0, 2.0])
        found = solve_random(assemble(model), [(1, "x")], base={"x": white})
        exact = np.sqrt(np.pi * f * 2.0 * (1 + 4 * zeta**2) / (4 * zeta))
        miles = np.sqrt(np.pi / 2 * f / (2 * zeta) * 2.0)
        assert found.rms[0] == pytest.approx(exact, rel=3e-4)
        assert found.rms[0] / miles - 1 == pytest.approx(np.sqrt(1 + 4 * zeta**2) - 1, abs=1e-3)
        moved = solve_random(
            assemble(model), [(1, "x")], base={"x": white}, response="displacement", relative=True
        )
        # of the relative displacement σ² = π f S/(4ζ ω⁴)
        assert moved.rms[0] == pytest.approx(
            np.sqrt(np.pi * f * 2.0 / (4 * zeta)) / (2 * np.pi * f) ** 2, rel=1e-3
        )
        assert moved.crossings[0] == pytest.approx(f, rel=5e-3)


def test_random_force_on_an_oscillator():
    """σ² = S/(8 ζ ω³ m²) of a two-sided S per rad/s; one-sided per hertz: S ω/(8 ζ k²)."""
    zeta, S = 0.05, 4.0
    model, f, k = oscillator(zeta)
    omega = 2 * np.pi * f
    row = np.zeros((1, model.n_dof))
    row[0, 6] = 1.0
    white = Tabulated.of([f / 1e4, 300 * f], [S, S])
    found = solve_random(assemble(model), [(1, "x")], loads=row, forces=[white], response="displacement")
    assert found.rms[0] == pytest.approx(np.sqrt(S * omega / (8 * zeta)) / k, rel=1e-3)


def test_forces_and_base_add_as_squares_and_dampers_count():
    damper = Joint(name="damper", point1=1, location=(1.0, 0.0, 0.0), C=np.diag([0, 0, 2.0, 0, 0, 0]))
    model = cantilever(4, 0.01, effects=(damper,))
    system, S = assemble(model), Tabulated.of([5, 50], [1.0, 1.0])
    row = np.zeros((1, model.n_dof))
    row[0, 8] = 1.0
    force = {"loads": row, "forces": [S]}
    parts = [solve_random(system, [(1, "z")], **more).density for more in (force, {"base": {"z": S}})]
    both = solve_random(system, [(1, "z")], base={"z": S}, **force)
    np.testing.assert_allclose(both.density, parts[0] + parts[1], rtol=1e-9)
    # straight lines, which are above a density where it is convex, agree on such lines
    assert np.sqrt(np.trapezoid(both.density[:, 0], both.frequency)) == pytest.approx(both.rms[0], rel=5e-3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: solve_spectrum(s, {}, [0]), "no spectrum is given"),
        (lambda s: solve_spectrum(s, {"w": FLAT_SPECTRUM}, [0]), "the base moves in 'w'"),
        (lambda s: solve_spectrum(s, {"x": FLAT_SPECTRUM}, [0], combination="abs"), "allowed are cqc, srss"),
        (lambda s: solve_random(s, [0]), "at least one density"),
        (
            lambda s: solve_random(s, [0], base={"x": FLAT_SPECTRUM}, response="jerk"),
            "allowed are displacement",
        ),
        (lambda _: Tabulated.of([0, 1], [1, 1]), "must rise, above 0 Hz; the first is 0 Hz"),
        (lambda _: Tabulated.of([1, 2], [1, -3]), "the spectrum is -3 at 2 Hz"),
        (lambda _: Tabulated.of([1, 2], [1, -1]), "not negative"),
        (lambda _: Tabulated.of([1, 2], [1]), "must agree"),
        (lambda _: shock_response_spectrum([0, 1], [0, 1], [0.0]), "above 0 Hz"),
        (lambda _: shock_response_spectrum([0, 1, 3], [0, 1, 2], [1.0]), "equal steps"),
        (lambda _: shock_response_spectrum([0, 1], [0, 1], [1.0], part="both"), "maximax, positive"),
    ],
)
def test_what_cannot_be_meant_is_refused(call, message):
    with pytest.raises(ModelError, match=message):
        call(assemble(cantilever(1)))
