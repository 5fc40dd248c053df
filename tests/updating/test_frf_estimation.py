"""FRFs from time data against closed forms: what is exact, what noise does, and by how much."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem import FRF, FRFKind
from updating import EstimationError, estimate_frf, estimate_roving, split_hits

RATE, N = 1000.0, 256
RNG = np.random.default_rng(1)


def white(n, rng, *channels):
    return rng.standard_normal((n, *channels))


def oscillator(frequency, f0=80.0, zeta=0.02):
    w, wn = 2 * np.pi * frequency, 2 * np.pi * f0
    return -(w**2) / (wn**2 - w**2 + 2j * zeta * wn * w)


def periodic(n_blocks, n_in, rng):
    """Forces of random spectra that repeat in each block, and the steady responses of oscillators to them."""
    lines = np.fft.rfftfreq(N, 1 / RATE)
    X = np.exp(2j * np.pi * rng.random((n_blocks, lines.size, n_in)))
    X[:, [0, -1]] = rng.standard_normal((n_blocks, 2, n_in))
    H = np.stack([[oscillator(lines, 60 + 30 * o + 15 * i) for i in range(n_in)] for o in range(2)])
    H[:, :, -1] = H[:, :, -1].real
    Y = np.einsum("oik,bki->bko", H, X)
    return np.fft.irfft(X, N, axis=1), np.fft.irfft(Y, N, axis=1), H.transpose(2, 0, 1)[1:]


@pytest.mark.parametrize("estimator", ["H1", "H2", "Hv"])
@pytest.mark.parametrize("n_in", [1, 2])
def test_periodic_data_are_exact(estimator, n_in):
    x, y, H = periodic(5, n_in, np.random.default_rng(0))
    found = estimate_frf(x, y, RATE, window="rectangular", estimator=estimator)
    assert np.allclose(found.frf.H, H, rtol=1e-9, atol=1e-12)
    assert found.frf.frequency[0] == RATE / N
    assert found.multiple_coherence == pytest.approx(1.0)
    assert found.std == pytest.approx(0.0, abs=1e-6)


def gain_with_noise(rng, into_force, into_response, estimator, **more):
    """A gain of 2 with white noise; the mean over all lines, and that of 64 blocks of 128."""
    x = white(64 * 128, rng)
    y = 2 * x + into_response * white(x.size, rng)
    x = x + into_force * white(x.size, rng)
    found = estimate_frf(x, y, RATE, block=128, overlap=0, window="rectangular", estimator=estimator, **more)
    return found, found.frf.H[:-1, 0, 0].mean()


@pytest.mark.parametrize(
    ("estimator", "into_force", "into_response", "factor"),
    [
        ("H1", 0.0, 1.0, 1.0),
        ("H1", 0.5, 0.0, 1 / (1 + 0.25)),
        ("H2", 0.5, 0.0, 1.0),
        ("H2", 0.0, 1.0, 1 + 1 / 4),
        ("Hv", 0.5, 0.0, 1.25**-0.5),
        ("Hv", 0.0, 1.0, 1.25**0.5),
    ],
)
def test_noise_biases_estimators_as_predicted(estimator, into_force, into_response, factor):
    """Standard deviation of a mean: noise/signal of 0.5 over √(2·64·63) is 0.6 %; biases have 1/64 more."""
    means = [
        gain_with_noise(np.random.default_rng(k), into_force, into_response, estimator)[1] for k in range(4)
    ]
    assert abs(np.mean(means) / 2 - factor) < 4 * 0.006 / 2 + (factor != 1 or estimator == "H2") / 64


def test_known_noise_makes_total_least_squares_right():
    found = [gain_with_noise(np.random.default_rng(k), 0.3, 0.6, "Hv", noise_ratio=2.0)[1] for k in range(8)]
    one = [gain_with_noise(np.random.default_rng(k), 0.3, 0.6, "H1")[1] for k in range(8)]
    assert abs(np.mean(found) / 2 - 1) < 0.006
    assert np.mean(one).real / 2 == pytest.approx(1 / 1.09, abs=0.006)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.01, 2), st.floats(0.01, 2), st.integers(0, 1000))
def test_hv_lies_between_the_others(into_force, into_response, seed):
    rng = np.random.default_rng(seed)
    x = white(1024, rng)
    y = np.convolve(x, [0.5, 1.0, -0.3], mode="same") + into_response * white(1024, rng)
    x = x + into_force * white(1024, rng)
    h1, hv, h2 = (np.abs(estimate_frf(x, y, RATE, estimator=e).frf.H) for e in ("H1", "Hv", "H2"))
    assert (h1 <= hv * (1 + 1e-9)).all()
    assert (hv <= h2 * (1 + 1e-9)).all()
    assert np.allclose(hv**2, h1 * h2)
    found = estimate_frf(x, y, RATE)
    assert np.allclose(found.coherence, h1 / h2)
    assert np.allclose(found.multiple_coherence, found.coherence[:, :, 0])


@pytest.mark.parametrize(
    ("window", "overlap", "n_in"), [("rectangular", 0.0, 1), ("hann", 0.5, 1), ("hann", 0.5, 2)]
)
def test_standard_deviations_are_those_of_repeated_measurements(window, overlap, n_in):
    """The formula leaves out terms of 1/n_d; 60 repetitions of 62 lines add 2 %."""
    rng = np.random.default_rng(4)
    gain = np.array([2.0, -1.0])[:n_in]
    real, said, n = [], [], 0.0
    for _ in range(60):
        x = white(40 * 128, rng, n_in)
        y = x @ gain + 1.5 * white(len(x), rng)
        found = estimate_frf(x, y, RATE, block=128, overlap=overlap, window=window)
        error = found.frf.H[1:-1, 0] - gain
        real.append((np.abs(error) ** 2).mean(axis=0) / 2)
        said.append((found.std[1:-1, 0] ** 2).mean(axis=0))
        n = found.effective_averages[0]
    assert np.sqrt(np.mean(real, axis=0) / np.mean(said, axis=0)) == pytest.approx(1.0, abs=n_in / n + 0.03)


def test_overlap_counts_by_the_closed_form():
    """Hann's window half over: Σ w(t) w(t + n/2) / Σ w² is 1/6."""
    x = white(128 * 20, RNG)
    found = estimate_frf(x, x, RATE, block=128, overlap=0.5)
    (n,) = found.n_averages
    assert n == 39
    assert found.effective_averages[0] == pytest.approx(n / (1 + 2 * (1 - 1 / n) / 36))
    assert estimate_frf(x, x, RATE, block=128, overlap=0).effective_averages[0] == pytest.approx(20)


def decay_after_hit(n, end_value=None, f0=60.0, zeta=0.004, samples=4096):
    """A unit sample of force and an oscillator's sampled free decay; and its transform, a geometric sum."""
    t = np.arange(samples) / RATE
    pole = 2 * np.pi * f0 * (-zeta + 1j * np.sqrt(1 - zeta**2))
    force = np.zeros((n, samples))
    force[:, 0] = 3.0
    y = 3.0 * np.exp(pole * t).imag
    shift = 0.0 if end_value is None else -np.log(end_value) * RATE / samples
    line = 2j * np.pi * np.fft.rfftfreq(samples, 1 / RATE)[1:]

    def geometric(p):
        q = np.exp((p - shift - line) / RATE)
        return (1 - q**samples) / (1 - q)

    return force, np.tile(y, (n, 1)), (geometric(pole) - geometric(np.conj(pole))) / 2j, shift, pole


@pytest.mark.parametrize("end_value", [0.01, 1e-4])
def test_exponential_window_moves_poles_by_the_decay_it_reports(end_value):
    force, y, exact, shift, _ = decay_after_hit(3, end_value)
    found = estimate_frf(force[:, :, None], y[:, :, None], RATE, window="exponential", end_value=end_value)
    assert found.added_decay == pytest.approx(shift)
    assert np.allclose(found.frf.H[:, 0, 0], exact, rtol=1e-9)


def test_force_window_takes_off_what_follows_the_hit():
    force, y, _, _, _ = decay_after_hit(2)
    disturbed = force + np.where(np.arange(4096) > 100, 1e-2, 0.0)
    kwargs = {"window": "rectangular"}
    clean = estimate_frf(force[:, :, None], y[:, :, None], RATE, **kwargs)
    kept = estimate_frf(disturbed[:, :, None], y[:, :, None], RATE, force_length=0.02, **kwargs)
    assert np.allclose(kept.frf.H, clean.frf.H)


def test_roving_hammer_says_which_hits_it_leaves_out():
    force, y, _, _, _ = decay_after_hit(4)
    twice = force.copy()
    twice[1, 40] = 1.0
    loud = y.copy()
    loud[2] = np.clip(loud[2], -0.5, 0.5)
    with pytest.warns(UserWarning, match="place"):
        found = estimate_roving({"1Z+": (force, y), "2Z+": (twice, 2 * loud)}, RATE, outputs=["1Z+"])
    assert found.frf.inputs == ("1Z+", "2Z+")
    assert found.n_averages.tolist() == [4, 2]
    assert found.messages == (
        "place '2Z+': hit 2 is left out: double hit",
        "place '2Z+': hit 3 is left out: overload in response 1",
    )
    assert np.allclose(found.frf.H[:, :, 1], 2 * found.frf.H[:, :, 0])


def test_hits_of_one_record_are_found():
    force, y, _, _, _ = decay_after_hit(1, samples=1000)
    quiet = np.zeros(300)
    record = np.concatenate([quiet, force[0], force[0], quiet])
    answer = np.concatenate([quiet, y[0], y[0], quiet])
    f, r = split_hits(record, answer, RATE, 0.99)
    assert f.shape == (2, 990, 1)
    assert (np.argmax(f[:, :, 0], axis=1) == 5).all()
    assert np.allclose(r[0, 5:, 0], y[0, :985])


def test_one_average_has_no_standard_deviation():
    x = white(256, RNG)
    assert np.isnan(estimate_frf(x, x, RATE, block=256).std).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"estimator": "H3"}, "estimator is 'H3'; allowed are H1, H2, Hv"),
        ({"window": "kaiser"}, "window is 'kaiser'"),
        ({"sample_rate": 0.0}, "sample rate is 0"),
        ({"block": 4}, "blocks of 4 samples"),
        ({"overlap": 1.0}, "overlap lies"),
        ({"band": (10.0, 10.1)}, "no line lies in the band"),
        ({"response": np.ones(7)}, "they must be the same"),
        ({"response": np.ones((3, 512))}, "samples come before channels"),
        ({"force": np.zeros(512)}, "no force acts"),
        ({"force": np.repeat(white(512, RNG, 1), 2, axis=1)}, "proportional to one another"),
        ({"force": np.where(np.arange(512) == 30, np.nan, 1.0)}, "first in block 1, sample 30, channel 1"),
    ],
)
def test_bad_data_are_refused(change, message):
    given = {"force": white(512, RNG), "response": white(512, RNG), "sample_rate": RATE} | change
    with pytest.raises(EstimationError, match=message):
        estimate_frf(**given)


def test_h2_needs_a_square_problem():
    with pytest.raises(EstimationError, match="2 forces and 3 responses"):
        estimate_frf(white(512, RNG, 2), white(512, RNG, 3), RATE, estimator="H2")


def test_kinds_are_converted_exactly_at_the_first_and_the_last_line():
    """Powers of iω line by line, with no derivative over lines that would need neighbours."""
    lines = np.array([0.25, 1.0, 7.5, 1e4])
    H = np.array([1 + 2j, 3 - 1j, 0.5j, -2 + 0j])
    receptance = FRF.from_arrays(lines, H, FRFKind.RECEPTANCE)
    for kind, power in (("mobility", 1), ("accelerance", 2)):
        there = receptance.as_kind(kind)
        assert np.allclose(there.H[:, 0, 0], H * (2j * np.pi * lines) ** power, rtol=1e-15)
        assert np.allclose(there.as_kind("receptance").H, receptance.H, rtol=4e-16)
    zero = FRF.from_arrays([0.0, 1.0], [1.0, 1.0], "accelerance")
    assert np.allclose(FRF.from_arrays([0.0, 1.0], [1, 1], "receptance").as_kind("accelerance").H[0], 0)
    with pytest.raises(ValueError, match="a line at 0 Hz cannot be converted"):
        zero.as_kind("receptance")
