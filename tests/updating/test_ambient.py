"""Modes from responses to random forces: closed forms, derivatives, scatter beside stated deviations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from updating import AmbientError, identify_ambient
from updating.ambient import (
    Correlations,
    block_correlations,
    decompose,
    fit_orders,
    prepare_record,
    singular_spectra,
)

RATE, ZETA, STIFFNESS = 40.0, 0.01, 1000.0
N = 4
_I = np.arange(1, N + 1)
FREQUENCY = np.sqrt(STIFFNESS) * np.sin((2 * _I - 1) * np.pi / (4 * N + 2)) / np.pi
"""Natural frequencies of equal masses on equal springs, clamped at one end [Hz]."""
SHAPES = 2 / np.sqrt(2 * N + 1) * np.sin(np.outer(_I, (2 * _I - 1) * np.pi / (2 * N + 1)))


def chain(n_samples, seed, noise=0.05):
    """Return accelerations of the masses under forces that are random and constant over each sample."""
    rng = np.random.default_rng(seed)
    still = int(40 * RATE)
    force = rng.standard_normal((n_samples + still, N))
    y = np.zeros_like(force)
    for k, f in enumerate(FREQUENCY):
        omega = 2 * np.pi * f
        omega_d = omega * np.sqrt(1 - ZETA**2)
        e, c, s = np.exp(-ZETA * omega / RATE), np.cos(omega_d / RATE), np.sin(omega_d / RATE)
        rise = [1.0, -e * (c + ZETA * omega / omega_d * s)]
        q = lfilter(np.convolve(rise, [1, -1]), [1, -2 * e * c, e * e], force @ SHAPES[:, k])
        y += np.outer(q, SHAPES[:, k])
    y = y[still:]
    return y + noise * y.std(axis=0) * rng.standard_normal(y.shape)


@pytest.fixture(scope="module")
def records():
    return [identify_ambient(chain(8000, seed), RATE, band=(1, 16)) for seed in range(12)]


def within_chance(scores):
    """Whether the mean square of standard normal numbers is within its central 99.9 %."""
    low, high = chi2.ppf([5e-4, 1 - 5e-4], scores.size) / scores.size
    return low < (scores**2).mean() < high


def test_modes_of_a_chain_are_found_with_standard_deviations_that_hold(records):
    assert [r.modes.n_modes for r in records] == [N] * len(records)
    of_frequency = np.array([(r.modes.frequency - FREQUENCY) / r.frequency_std for r in records])
    of_zeta = np.array([(r.modes.zeta - ZETA) / r.zeta_std for r in records])
    assert within_chance(of_frequency)
    assert within_chance(of_zeta)


def test_shapes_scatter_as_stated(records):
    scores = []
    for r in records:
        phi = r.modes.shapes
        true = SHAPES * np.sign((SHAPES * phi).sum(axis=0))
        phi, std = phi / np.linalg.norm(phi, axis=0), r.shape_std / np.linalg.norm(phi, axis=0)
        scores.append((phi - true / np.linalg.norm(true, axis=0)) / std)
    # of the four entries of a shape of fixed length three are free
    assert within_chance(np.array(scores)[:, 0].ravel())
    assert (np.concatenate([r.mpc for r in records]) > 0.99).all()
    assert (np.concatenate([r.spectra_mac for r in records]) > 0.99).all()


def test_standard_deviations_are_near_the_least_possible(records):
    """Those of the best estimate are √(ζ/2πN) f and √(ζ/2πN), N = f T periods (Au, MSSP 48, 2014, 15)."""
    duration = records[0].duration
    least = np.sqrt(ZETA / (2 * np.pi * FREQUENCY * duration))
    of_frequency = np.median([r.frequency_std / FREQUENCY for r in records], axis=0) / least
    of_zeta = np.median([r.zeta_std for r in records], axis=0) / least
    for ratio in (of_frequency, of_zeta):
        # √(1 - 1/64 blocks) and chance below; noise and a finite number of lags above
        assert (ratio > 0.8).all()
        assert (ratio < 1.6).all()


def test_deviations_are_derivatives_of_poles_and_shapes():
    y = chain(6000, 1)
    c = block_correlations(y / y.std(axis=0), 20, 16, [0, 1, 2])
    found = fit_orders(decompose(c, 10), RATE)
    block, step = 5, 1e-6
    moved = c.mean + step * (c.of_block[block] - c.mean)
    # other blocks are kept about the moved mean, so that both have the same orders
    other = fit_orders(decompose(Correlations(moved, c.of_block + (moved - c.mean)), 10), RATE)
    np.testing.assert_array_equal(found.order, other.order)
    of_pole = (other.poles - found.poles) / step
    sign = np.sign((other.shapes.real * found.shapes.real).sum(axis=1))[:, None]
    of_shape = (sign * other.shapes.real - found.shapes.real) / step
    # the error of a difference is of the order of the step times the curvature, larger for poles of the noise
    few = found.order <= 2 * N
    np.testing.assert_allclose(of_pole[few], found.pole_deviation[few, block], rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(of_shape[few], found.shape_deviation[few, block], rtol=1e-2, atol=1e-3)


def test_the_order_of_the_record_is_that_of_the_chain(records):
    assert np.median([r.order for r in records]) == 2 * N


def test_units_and_the_order_of_channels_change_nothing_else():
    y = chain(6000, 2)
    plain = identify_ambient(y, RATE, ["a", "b", "c", "d"], band=(1, 16))
    factor, turn = np.array([1.0, 9.8, 1e-3, -5.0]), [2, 0, 3, 1]
    other = identify_ambient((y * factor)[:, turn], RATE, ["c", "a", "d", "b"], band=(1, 16))
    np.testing.assert_allclose(other.modes.frequency, plain.modes.frequency, rtol=1e-9)
    np.testing.assert_allclose(other.zeta_std, plain.zeta_std, rtol=1e-6)
    expected = (plain.modes.shapes * factor[:, None])[turn]
    expected /= expected[np.argmax(np.abs(expected), axis=0), np.arange(N)]
    np.testing.assert_allclose(other.modes.shapes, expected, rtol=1e-6, atol=1e-9)


def test_a_record_that_was_sampled_faster_than_the_band_needs_gives_the_same_modes():
    y = chain(12_000, 3)
    whole = identify_ambient(y, RATE, band=(1, 16))
    low = identify_ambient(y, RATE, band=(0.5, 6.0))
    assert low.modes.n_modes == 2
    apart = (low.modes.frequency - whole.modes.frequency[:2]) / whole.frequency_std[:2]
    assert (np.abs(apart) < 2).all()


def test_a_machine_of_steady_speed_is_a_peak_and_no_mode():
    y = chain(12_000, 4)
    hum = np.sin(2 * np.pi * 6.2 * np.arange(len(y)) / RATE)
    found = identify_ambient(y + 0.5 * y.std(axis=0) * hum[:, None], RATE, band=(1, 16))
    assert found.modes.n_modes == N
    assert [p.frequency for p in found.unexplained] == pytest.approx([6.2], abs=found.spectra.step)
    assert "a peak at 6.2" in found.table()


def test_noise_has_no_modes():
    noise = lfilter([1], [1, -0.5], np.random.default_rng(5).standard_normal((8000, 3)), axis=0)
    found = identify_ambient(noise, RATE)
    assert found.modes.n_modes == 0
    assert found.relative_std()[0].size == 0
    assert "mode" in found.table()


def test_spectra_hold_the_power_of_the_record():
    record = prepare_record(chain(8000, 6), RATE, band=(1, 16))
    spectra = singular_spectra(replace(record, band=(1.0, RATE / 2)))
    power = spectra.values.sum() * spectra.step
    # channels have a standard deviation of 1; the window moves some of it beyond the ends of the spectrum
    assert power == pytest.approx(N, rel=0.02)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"values": chain(300, 7)}, r"the record is 7.5 s long, 300 samples .* blocks need 42.5 s"),
        ({"values": np.zeros((4000, 1))}, r"1 channel, a; at least 2"),
        ({"band": (1.0, 25.0)}, r"the band ends at 25 Hz, and samples .* sample at 62.5 Hz or more"),
        ({"band": (9.0, 3.0)}, r"the band is 9 to 3 Hz"),
        ({"sample_rate": 0.0}, r"the sample rate is 0"),
        ({"channels": ["a", "b"]}, r"2 names are given for 4 channels"),
    ],
)
def test_records_that_cannot_be_used_are_refused(change, words):
    given = {"values": chain(4000, 8), "sample_rate": RATE, "channels": ["a", "b", "c", "d"]} | change
    if given["values"].shape[1] == 1:
        given["channels"] = ["a"]
    with pytest.raises(AmbientError, match=words):
        identify_ambient(**given)


def test_a_channel_that_is_constant_for_a_while_is_named():
    y = chain(4000, 9)
    y[2000:2600, 2] = y[1999, 2]
    with pytest.raises(AmbientError, match=r"channel ch3 is constant from 50 s to 56\.25 s"):
        identify_ambient(y, RATE)
    y[:, 2] = 0.3
    with pytest.raises(AmbientError, match="channel ch3 is constant; leave it out"):
        identify_ambient(y, RATE)
    y[7, 1] = np.nan
    with pytest.raises(AmbientError, match="sample 8 of channel ch2 is not finite"):
        identify_ambient(y, RATE)
