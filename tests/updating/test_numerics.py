"""Comparison, noise and the robust solver: what they promise on data whose truth is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem import FRF, FRFError, Parameter
from tests.frames import cross_beam
from tests.noise import complex_normal
from updating import (
    DampingCurve,
    Measurement,
    MeasurementError,
    Sensor,
    Unknown,
    compare,
    frac,
    mac,
    place_sensors,
    relative_noise,
)
from updating.correlation import DB_PER_NEPER, log_ratio, rms_db
from updating.inference import Prior, ScaledUnknown, solve_robust
from updating.least_squares import Levels

modest = settings(max_examples=40, derandomize=True, deadline=None)
seeds = st.integers(0, 2**31)


# ----------------------------------------------------------------------------------------- correlation


@modest
@given(seeds, st.integers(1, 8), st.integers(1, 4), st.floats(1e-9, 1e9))
def test_mac_lies_between_zero_and_one_and_knows_no_scale(seed, n_dof, n_modes, scale):
    rng = np.random.default_rng(seed)
    x, a = complex_normal(rng, (n_dof, n_modes)), complex_normal(rng, (n_dof, n_modes + 1))
    value = mac(x, a)
    assert value.shape == (n_modes, n_modes + 1)
    assert ((value >= 0) & (value <= 1)).all()
    factors = scale * np.exp(1j * rng.uniform(0, 2 * np.pi, n_modes))
    np.testing.assert_allclose(mac(x * factors, a), value, rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(mac(a, x), value.T, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(np.diag(mac(x, x * factors)), 1, rtol=1e-12)


def test_mac_of_orthogonal_and_zero_shapes():
    assert mac([1, 0], [0, 1]) == 0
    assert mac([0, 0], [0, 1]) == 0
    assert mac([3, 4], [3, 0]) == pytest.approx(9 / 25)
    with pytest.raises(ValueError, match="2 and 3 DOFs"):
        mac([1, 2], [1, 2, 3])


@modest
@given(seeds, st.floats(1e-6, 1e6))
def test_frac_is_blind_to_a_factor_and_sees_the_rest(seed, scale):
    rng = np.random.default_rng(seed)
    H, G = complex_normal(rng, (20, 2, 3)), complex_normal(rng, (20, 2, 3))
    np.testing.assert_allclose(frac(H, scale * np.exp(1j) * H), 1, rtol=1e-12)
    assert ((frac(H, G) >= 0) & (frac(H, G) < 1)).all()
    np.testing.assert_allclose(frac(H, G), frac(G, H), rtol=1e-12)


@modest
@given(seeds, st.floats(1e-3, 1e3), st.floats(-3.0, 3.0))
def test_log_ratio_is_a_logarithm(seed, gain, phase):
    rng = np.random.default_rng(seed)
    H, G, F = (complex_normal(rng, (9, 2, 2)) for _ in range(3))
    np.testing.assert_allclose(
        log_ratio(gain * np.exp(1j * phase) * H, H), np.log(gain) + 1j * phase, atol=1e-12
    )
    np.testing.assert_allclose(log_ratio(H, G), -log_ratio(G, H), atol=1e-12)
    chain = log_ratio(H, G) + log_ratio(G, F) - log_ratio(H, F)
    np.testing.assert_allclose(chain.real, 0, atol=1e-12)
    np.testing.assert_allclose(np.exp(1j * chain.imag), 1, atol=1e-12)
    assert rms_db(log_ratio(gain * H, H)) == pytest.approx(abs(20 * np.log10(gain)), abs=1e-9)


def test_log_ratio_of_nothing_is_no_number():
    one, zero = np.ones((1, 1, 1), complex), np.zeros((1, 1, 1), complex)
    for a, b in ((one, zero), (zero, one), (zero, zero)):
        assert np.isnan(log_ratio(a, b)).all()
    assert np.isnan(rms_db(log_ratio(one, zero)))


def test_comparison_puts_errors_where_they_are():
    f = np.linspace(10, 100, 91)
    rng = np.random.default_rng(1)
    H = complex_normal(rng, (91, 3, 2))
    wrong = H.copy()
    wrong[f >= 55, 1] *= 10 ** (6 / 20) * np.exp(0.3j)  # 6 dB and 0.3 rad on the second sensor above 55 Hz
    measured, computed = (FRF.from_arrays(f, X, "accelerance") for X in (H, wrong))
    c = compare(measured, computed.as_kind("mobility"), bands=[10, 55, 100])
    expected = np.zeros((2, 3, 2))
    expected[1, 1] = 6.0
    np.testing.assert_allclose(c.error_db, expected, atol=1e-9)
    np.testing.assert_allclose(c.phase_deg, expected / 6 * np.rad2deg(0.3), atol=1e-9)
    np.testing.assert_allclose(c.by_band(), expected[:, :, 0].T, atol=1e-9)
    share = (f >= 55).mean()
    np.testing.assert_allclose(c.by_sensor(), [0, 6 * np.sqrt(share), 0], atol=1e-9)
    assert c.total_db == pytest.approx(6 * np.sqrt(share / 3))
    dead = H.copy()
    dead[f >= 70, 1] = 0  # a sensor that falls silent says nothing of amplitude or phase there
    half = compare(FRF.from_arrays(f, dead, "accelerance"), computed, bands=[55, 90])
    assert half.phase_deg[0, 1, 0] == pytest.approx(np.rad2deg(0.3), rel=1e-9)
    masked = compare(measured, computed, mask=np.array([[True, True], [False, False], [True, True]]))
    assert masked.total_db == pytest.approx(0, abs=1e-9)
    assert np.isnan(masked.by_sensor()[1])
    with pytest.raises(FRFError, match="not at the same frequencies"):
        compare(measured, computed.select(band=(20, 100)))
    with pytest.raises(FRFError, match="the measured FRFs are out1, out2, out3"):
        compare(measured, computed.select(outputs=["out1"]))
    assert pytest.approx(8.685889638) == DB_PER_NEPER


# ----------------------------------------------------------------------------------------------- noise


def resonances(n=1200):
    f = np.linspace(5, 500, n)
    H = sum(1 / (r**2 * (1 + 0.02j) - f**2) for r in (60.0, 150.0, 155.0, 320.0))
    return f, np.asarray(H)[:, None, None] * np.array([1, 2j, -0.1])[None, :, None]


@pytest.mark.parametrize("sigma", [1e-3, 1e-2, 0.1])
def test_noise_is_estimated_from_noisy_data(sigma):
    _, H = resonances()
    rng = np.random.default_rng(3)
    # complex noise of relative size σ√2 has a real part of σ, which is the amplitude's
    noisy = H * (1 + sigma * complex_normal(rng, H.shape))
    estimate = relative_noise(noisy)
    # a median of 31 lines scatters by 1.17/√(31/2.6), 30 %, as the stencil mixes neighbours; its mean by 5 %
    assert np.sqrt((estimate**2).mean()) == pytest.approx(sigma, rel=0.25)
    assert np.median(estimate) == pytest.approx(sigma, rel=0.1)


def test_noise_that_grows_along_the_band_is_seen_to():
    _, H = resonances()
    rng = np.random.default_rng(4)
    sigma = np.geomspace(1e-3, 1e-1, len(H))[:, None, None]
    estimate = relative_noise(H * (1 + sigma * complex_normal(rng, H.shape)))
    ratio = np.log(estimate / sigma)
    assert abs(ratio.mean()) < 0.1
    assert ratio.std() < 0.45


@pytest.mark.parametrize("sigma", [1e-3, 1e-2])
def test_noise_that_is_added_shows_at_antiresonances(sigma):
    f, H = resonances()
    rng = np.random.default_rng(5)
    H = H * (f**2)[:, None, None]  # as an accelerometer sees it: the added noise is the same at all lines
    added = 3e-4 * np.abs(H).max(axis=(0, 2), keepdims=True) * np.array([1.0, 2.0, 0.1])[None, :, None]
    noisy = H * (1 + sigma * complex_normal(rng, H.shape)) + added * complex_normal(rng, H.shape)
    truth = np.hypot(sigma, added / np.abs(H))
    some = (truth > 3 * sigma) & (truth < 0.2)
    assert some.sum() > 50
    ratio = np.log(relative_noise(noisy) / truth)[some]
    # the added noise is the median of 60 lines' |d|², ±18 %, so ±9 % in σ; what is in proportion blurs it
    assert abs(np.median(ratio)) < 0.2
    assert np.quantile(np.abs(ratio), 0.9) < 0.7


def test_noise_that_is_added_shows_where_all_of_a_window_is_small():
    f = np.linspace(1, 500, 1000)
    rng = np.random.default_rng(6)
    H = (f**2 / (300.0**2 * (1 + 0.02j) - f**2))[:, None, None] * np.array([1, 2j, -0.1])[None, :, None]
    added = 1e-3 * np.abs(H[:, 0, 0])[20]  # the same for all sensors: 21 lines of the first are below it
    noisy = H * (1 + 1e-3 * complex_normal(rng, H.shape)) + added * complex_normal(rng, H.shape)
    truth = np.hypot(1e-3, added / np.abs(H))
    ratio = (relative_noise(noisy) / truth)[:30]
    assert 0.6 < ratio.min() <= ratio.max() < 1.7


def test_added_noise_of_an_FRF_that_is_sampled_coarsely_is_that_of_the_other_sensors():
    f = np.linspace(1, 500, 1000)
    rng = np.random.default_rng(7)
    smooth = f**2 / (300.0**2 * (1 + 0.02j) - f**2)
    # 14 lines from resonance to resonance: differences of its smallest lines are not white
    poles = np.arange(1, 40, 7.0)
    coarse = sum(f**2 / (p**2 * (1 + 0.05j) - f**2) for p in poles) * 1e-3
    H = np.stack([smooth, -0.5 * smooth, coarse], axis=1)[:, :, None]
    added = 1e-6
    for own in (added, 0.01 * added):  # the same, or less than the others have
        noisy = H + np.array([added, added, own])[:, None] * complex_normal(rng, H.shape)
        estimate = relative_noise(noisy)[:, 2, 0] * np.abs(H[:, 2, 0])
        assert 0.7 * own < estimate.min() < 1.4 * own


def test_clean_data_have_next_to_no_noise():
    # fourth differences of ln|H| at lines of 0.4 Hz: (Δf/δ)⁴ at δ from a resonance, tens of Hz for most
    assert np.median(relative_noise(resonances()[1])) < 1e-6


def test_too_few_lines_are_given_one_per_cent():
    assert (relative_noise(np.ones((8, 2, 1), complex)) == 0.01).all()


# ---------------------------------------------------------------------------------------------- solver


def linear_problem(seed=0, n=3, m=200, noise=0.01):
    rng = np.random.default_rng(seed)
    A, truth = complex_normal(rng, (m, n)), rng.uniform(-1, 1, n)
    b = A @ truth + noise * complex_normal(rng, m)

    def residual(x, jacobian):
        return A @ x - b, A.T if jacobian else None

    return residual, A, b, truth


def solve(residual, n, **more):
    floor, groups = more.pop("floor", 1e-6), more.get("groups", np.zeros(1, dtype=int))
    sizes = np.unique(groups, return_counts=True)[1]
    nothing = np.zeros(len(sizes))
    levels = Levels(more.pop("n_independent", 400.0) * sizes / sizes.sum(), nothing + floor**2, nothing)
    keys = {"prior": Prior(np.zeros(n), np.full(n, np.inf)), "levels": levels}
    keys |= {"bounds": (np.full(n, -9.0), np.full(n, 9.0)), "max_iterations": 60, "tolerance": 1e-10, **more}
    x0 = keys.pop("x0", np.zeros(n))
    return solve_robust(residual, x0, **keys)


def test_without_outliers_it_is_least_squares():
    residual, A, b, _ = linear_problem()
    result = solve(residual, 3, robust=1e3)
    both = np.vstack([A.real, A.imag])
    expected = np.linalg.lstsq(both, np.concatenate([b.real, b.imag]))[0]
    np.testing.assert_allclose(result.x, expected, atol=1e-6)
    assert result.converged


@pytest.mark.parametrize("relative", [False, True])
def test_an_unknown_with_a_long_way_to_go_does_not_hold_up_the_others(relative):
    residual, A, b, _ = linear_problem()
    both = np.vstack([A.real, A.imag])
    expected = np.linalg.lstsq(both, np.concatenate([b.real, b.imag]))[0]

    def in_small_units(x, gradient):  # of the last unknown: 400 of them are to go
        r, J = residual(np.array([*x[:2], x[2] / 400]), gradient)
        return r, None if J is None else J * np.array([1, 1, 1 / 400])[:, None]

    start, bounds = np.array([0.0, 0.0, 1.0]), (np.full(3, -1e4), np.full(3, 1e4))
    last = np.array([False, False, relative])
    result = solve(in_small_units, 3, x0=start, bounds=bounds, robust=1e3, max_iterations=15, relative=last)
    others = np.linalg.lstsq(both[:, :2], np.concatenate([b.real, b.imag]) - both[:, 2] * result.x[2] / 400)
    np.testing.assert_allclose(result.x[:2], others[0], atol=1e-2)
    assert (abs(result.x[2] / 400 - expected[2]) < 1e-3) == relative


def test_a_step_to_where_there_is_no_structure_is_shortened():
    """As one that takes more mass away than there is: the minimum lies before that, the full step beyond."""
    tried = []

    def residual(x, gradient):  # its slope at 0 is a third of that near the minimum, 0.75
        tried.append(x[0])
        if x[0] > 1:
            raise np.linalg.LinAlgError
        r = x[0] ** 3 + x[0] - 0.75**3 - 0.75
        return np.array([r], complex), np.array([[3 * x[0] ** 2 + 1]], complex)

    result = solve(residual, 1, max_step=9.0, robust=1e3)
    assert max(tried) > 1
    assert result.x[0] == pytest.approx(0.75, rel=1e-6)


def test_a_small_gain_by_a_shortened_step_is_no_end():
    def residual(x, gradient):  # 2.2 are to be gained over 1185 units
        return np.array([1.0, 0.15 * (x[0] / 1186 - 1)], complex), np.array([[0, 0.15 / 1186]], complex)

    more = {"x0": np.ones(1), "bounds": (np.zeros(1), np.full(1, 1e5)), "robust": 1e3, "tolerance": 5e-3}
    result = solve(residual, 1, relative=np.ones(1, dtype=bool), max_iterations=20, **more)
    assert result.x[0] == pytest.approx(1186, rel=0.01)


@pytest.mark.parametrize("std", [1e-4, 0.3, 8.0])
@pytest.mark.parametrize("log", [True, False])
def test_a_deviation_is_half_the_width_of_the_interval_of_the_value(log, std):
    p = Parameter("stiffness", "N/m", 250.0, np.inf, 0.0, np.inf, log=log)
    v = ScaledUnknown.of(Unknown((("spring", "stiffness"),)), [p])
    x = v.to_x(250.0)
    width = v.to_value(x + std) - v.to_value(x - std)
    assert v.deviation(x, std) == pytest.approx(width / 2, rel=1e-9)


def test_outliers_hardly_move_it():
    _, A, b, truth = linear_problem()
    spoilt = b.copy()
    spoilt[:20] += 30.0

    def bad(x, jacobian):
        return A @ x - spoilt, A.T if jacobian else None

    robust = solve(bad, 3, robust=0.05)
    squares = solve(bad, 3, robust=1e4)
    assert abs(robust.x - truth).max() < 0.05 * abs(squares.x - truth).max()


def test_priors_hold_what_the_data_do_not_say():
    residual, A, _, truth = linear_problem()

    def blind(x, jacobian):
        r, J = residual(x[:3], True)
        return r, np.vstack([J, 0 * J[:1]]) if jacobian else None

    prior = Prior(np.array([0, 0, 0, 0.7]), np.array([np.inf, np.inf, np.inf, 0.2]))
    result = solve(blind, 4, prior=prior)
    assert result.x[3] == pytest.approx(0.7, abs=1e-4)
    np.testing.assert_allclose(result.x[:3], truth, atol=0.01)
    assert A.shape[1] == 3


def test_bounds_are_kept_and_the_rest_is_best_within_them():
    residual, A, b, truth = linear_problem()
    k = int(np.argmax(abs(truth)))
    lo, hi = np.full(3, -9.0), np.full(3, 9.0)
    (hi if truth[k] > 0 else lo)[k] = 0.5 * truth[k]
    result = solve(residual, 3, bounds=(lo, hi), robust=1e3)
    assert result.x[k] == pytest.approx(0.5 * truth[k])
    others = [i for i in range(3) if i != k]
    both = np.vstack([A.real, A.imag])
    rest = np.concatenate([b.real, b.imag]) - both[:, k] * result.x[k]
    np.testing.assert_allclose(result.x[others], np.linalg.lstsq(both[:, others], rest)[0], atol=1e-4)


def test_a_curved_valley_is_followed_and_reported():
    def rosenbrock(x, jacobian):
        r = np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]], dtype=complex)
        J = np.array([[-20 * x[0], -1.0], [10.0, 0.0]], dtype=complex)
        return r, J if jacobian else None

    result = solve(
        rosenbrock,
        2,
        x0=np.array([-1.2, 1.0]),
        robust=10.0,
        floor=1e-6,
        max_iterations=200,
        n_independent=2.0,
    )
    np.testing.assert_allclose(result.x, 1.0, atol=1e-3)
    assert result.converged
    short = solve(rosenbrock, 2, x0=np.array([-1.2, 1.0]), robust=10.0, floor=1e-6, max_iterations=2)
    assert not short.converged
    assert short.n_iterations == 2


# ----------------------------------------------------------------------------------------- measurement


def sensor(name, x, y, z, direction="z", **more):
    return Sensor(name, np.array([x, y, z]), np.eye(3)["xyz".index(direction)], **more)


def test_sensors_get_points_of_the_mesh():
    mesh = cross_beam(0.1).mesh
    sensors = (sensor("a", 0.123, 0.0, 0.001), sensor("b", -0.4, 0, 0), sensor("c", 0, 0.271, 0.01))
    placed = place_sensors(mesh, sensors)
    assert placed.n_points == mesh.n_points + 2
    np.testing.assert_array_equal(placed.points[: mesh.n_points], mesh.points)
    for s, foot in zip(sensors, ([0.123, 0, 0], [-0.4, 0, 0], [0, 0.271, 0.01]), strict=True):
        point, _ = placed.nearest_point(s.point)
        np.testing.assert_allclose(placed.points[point], foot, atol=1e-12)
    for name in mesh.members:
        assert placed.member_length(name) == pytest.approx(mesh.member_length(name))
    with pytest.raises(
        MeasurementError, match=r"sensor 'far' at \[0.0, 0.0, 1.0\] m is 0.99 m from the nearest member"
    ):
        place_sensors(mesh, (sensor("far", 0.0, 0.0, 1.0),))


def test_a_measurement_needs_its_sensors():
    frf = FRF.from_arrays([1.0, 2.0], np.ones((2, 2, 1)), outputs=["a", "b"], inputs=["f"])
    a, b, f = (sensor(n, 0, 0, 0) for n in "abf")
    whole = Measurement(frf, (a, b), (f,))
    part = whole.with_frf(frf.select(outputs=["b"]))
    assert part.sensors == (b,)
    with pytest.raises(MeasurementError, match="the FRF's responses are a, b, the sensors' names b, a"):
        Measurement(frf, (b, a), (f,))


# --------------------------------------------------------------------------------------------- damping


def test_damping_in_proportion_to_mass_or_stiffness_is_followed_between_knots():
    f = np.array([0.0, 20.0, 70.0, 300.0, 900.0, 2000.0])
    for power in (-1, 0, 1):  # ζ = α/2ω + βω/2
        knots = np.array([20.0, 250.0, 2000.0])
        curve = DampingCurve(knots, 1e-4 * knots**power, 0.5)
        zeta = np.exp(curve.hats(f) @ np.log(curve.nominal))
        np.testing.assert_allclose(zeta[1:], 1e-4 * f[1:] ** power, rtol=1e-12)
        assert zeta[0] == pytest.approx(curve.nominal[0])  # constant outside
