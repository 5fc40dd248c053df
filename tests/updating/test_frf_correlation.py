"""Criteria of FRFs against closed forms and their own symmetries."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.noise import complex_normal
from updating.correlation import frf_correlation as fc

modest = settings(max_examples=30, derandomize=True, deadline=None)
seeds = st.integers(0, 2**31)


def receptance(f, stiffness=1.0):
    """Return 3 x 2 receptances of a chain of three masses with loss factors, all springs scaled alike."""
    K = stiffness * (np.diag([2.0, 2, 1]) - np.eye(3, k=1) - np.eye(3, k=-1)) * (1 + 0.03j)
    return np.array([np.linalg.inv(K - (2 * np.pi * w) ** 2 * np.eye(3))[:, :2] for w in f])


def test_frac_of_a_shifted_resonance_is_a_lorentzian_of_the_shift():
    """∫ h_1 h_2* dω of h = 1/(a - ω + iσ) is 2π/|a - b + 2iσ|, hence FRAC = 1/(1 + (δ/2σ)²).

    The lines end at ±W, beyond which 2σ/(πW) of ∫|h|² lies. Sums over lines err by e^{-2πσ/dω}."""
    sigma, W = 1.0, 2000.0
    omega = np.arange(-W, W, 0.25)
    h = 1 / (1j * sigma - omega)
    tail = 2 * sigma / (np.pi * W)
    for shift in (0.5, 2.0, 10.0):
        value = fc.frac(h, 1 / (shift + 1j * sigma - omega))
        expected = 1 / (1 + (shift / (2 * sigma)) ** 2)
        # each of the three integrals misses about the tail's part of ∫|h|², the cross term twice in FRAC
        assert abs(value - expected) < 2 * tail * np.sqrt(expected) + 2 * tail * expected
    assert fc.frac(h, 1 / (2 + 1j * sigma - omega)) == pytest.approx(0.5, abs=3 * tail)


def test_a_stiffer_model_has_its_ridge_where_the_frequencies_are_scaled():
    """K scaled by s²: H_a(s f) = H(f)/s², so FDAC(f, s f) = 1 and the CSF of these is 2 s²/(1 + s⁴)."""
    s, f = 1.2, np.linspace(0.02, 0.35, 40)
    x, a = receptance(f), receptance(s * f, s**2)
    np.testing.assert_allclose(np.diagonal(fc.fdac(x, a)), 1, rtol=1e-12)
    np.testing.assert_allclose(fc.cross_signature_assurance(x, a), 1, rtol=1e-12)
    np.testing.assert_allclose(fc.cross_signature_scale(x, a), 2 * s**2 / (1 + s**4), rtol=1e-12)
    same = receptance(f, s**2)
    assert fc.cross_signature_assurance(x, same).min() < 0.5
    f_a = np.linspace(0.02, 0.45, 25)
    assert fc.fdac(x, receptance(f_a, s**2)).shape == (40, 25, 2)


def test_orthogonal_and_reversed_responses():
    x = np.array([[[1.0], [0]], [[1], [1]], [[0], [0]]])
    a = np.array([[[0.0], [1]], [[1], [-1]], [[1], [1]]])
    np.testing.assert_array_equal(fc.cross_signature_assurance(x, a), np.zeros((3, 1)))
    np.testing.assert_array_equal(fc.cross_signature_scale(x, a), np.zeros((3, 1)))
    # sums over lines: FRF 1 has 1·0 + 1·1, |x|² = 2, |a|² = 2; FRF 2 has 1·(-1), |x|² = 1, |a|² = 3
    np.testing.assert_allclose(fc.frac(x, a), [[1 / 4], [1 / 3]], rtol=1e-14)
    np.testing.assert_allclose(fc.signature_assurance(x, -a), [[1 / 4], [1 / 3]], rtol=1e-14)


def test_sac_sees_no_delay_and_frac_does():
    rng = np.random.default_rng(1)
    f, H = np.linspace(0, 10, 101), complex_normal(rng, (101, 2, 2))
    late = H * np.exp(-2j * np.pi * f * 0.3)[:, None, None]
    np.testing.assert_allclose(fc.signature_assurance(H, late), 1, rtol=1e-12)
    assert (fc.frac(H, late) < 0.2).all()


def test_band_errors_of_a_known_factor():
    """H_a = g H in one band, sensor and force: error |g - 1|, level 20 lg|g|, logarithm |ln g|."""
    rng = np.random.default_rng(2)
    f, H = np.arange(10.0, 50.0), complex_normal(rng, (40, 3, 2))
    g = 2 * np.exp(0.5j)
    wrong = H.copy()
    wrong[f >= 30, 1, 0] *= g
    e = fc.band_error(f, H, wrong, bands=[10, 30, 50])
    expected = np.zeros((2, 3, 2))
    expected[1, 1, 0] = 1.0
    np.testing.assert_allclose(e.relative("each"), abs(g - 1) * expected, atol=1e-12)
    np.testing.assert_allclose(e.level_db("each"), 20 * np.log10(2) * expected, atol=1e-12)
    np.testing.assert_allclose(e.log_error("each"), abs(np.log(g)) * expected, atol=1e-12)
    energy = (np.abs(H) ** 2).sum(axis=0)
    bad = (np.abs(H[f >= 30, 1, 0]) ** 2).sum()
    assert e.relative() == pytest.approx(abs(g - 1) * np.sqrt(bad / energy.sum()))
    np.testing.assert_allclose(
        e.relative("output"), [0, abs(g - 1) * np.sqrt(bad / energy[1].sum()), 0], atol=1e-12
    )
    np.testing.assert_allclose(
        e.relative("input"), [abs(g - 1) * np.sqrt(bad / energy[:, 0].sum()), 0], atol=1e-12
    )
    np.testing.assert_allclose(e.log_error("band"), [0, abs(np.log(g)) / np.sqrt(6)], atol=1e-12)
    assert e.n_lines.tolist() == [20, 20]
    silent = fc.band_error(f, np.where(f[:, None, None] >= 30, H, 0), H, bands=[10, 30, 50])
    assert np.isnan(silent.relative("band")[0])
    assert np.isnan(silent.log_error("band")[0])
    assert silent.relative("band")[1] == 0
    dead = fc.band_error(f, H, 0 * H, bands=1)
    assert dead.level_db() == -np.inf
    assert dead.relative() == 1


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="must be the same"):
        fc.frac(np.ones((3, 2, 1)), np.ones((4, 2, 1)))
    with pytest.raises(ValueError, match="same outputs and inputs"):
        fc.fdac(np.ones((3, 2, 1)), np.ones((4, 3, 1)))
    with pytest.raises(ValueError, match=r"\(n_freq, n_out, n_in\) is expected"):
        fc.cross_signature_assurance(np.ones(3), np.ones(3))
    with pytest.raises(ValueError, match="2 frequencies are given for 3 lines"):
        fc.band_error([1, 2], np.ones((3, 2, 1)), np.ones((3, 2, 1)))
    with pytest.raises(ValueError, match="by 'sensor' are not known; allowed are all, band"):
        fc.band_error([1, 2, 3], np.ones((3, 2, 1)), np.ones((3, 2, 1))).relative("sensor")  # pyright: ignore[reportArgumentType]


@modest
@given(seeds, st.integers(1, 5), st.integers(1, 3), st.floats(1e-100, 1e100))
def test_ranges_and_inequalities(seed, n_out, n_in, scale):
    rng = np.random.default_rng(seed)
    x, a = complex_normal(rng, (6, n_out, n_in)), complex_normal(rng, (6, n_out, n_in))
    csac, csf = fc.cross_signature_assurance(x, a), fc.cross_signature_scale(x, a)
    sac, frac, fdac = fc.signature_assurance(x, a), fc.frac(x, a), fc.fdac(x, a)
    for value in (csac, csf, sac, frac, fdac):
        assert ((value >= 0) & (value <= 1)).all()
    assert (csf <= np.sqrt(csac) + 1e-12).all()  # arithmetic and geometric mean
    assert (sac >= frac - 1e-12).all()  # triangle inequality
    np.testing.assert_allclose(np.diagonal(fdac).T, csac, atol=1e-12)
    np.testing.assert_allclose(fc.cross_signature_assurance(scale * x, 1j * a), csac, rtol=1e-9)
    np.testing.assert_allclose(fc.frac(scale * x, 1j * a), frac, rtol=1e-9)
    np.testing.assert_allclose(fc.fdac(a, x), fdac.transpose(1, 0, 2), atol=1e-12)
    c = 0.1 + 2j
    np.testing.assert_allclose(fc.cross_signature_scale(x, c * x), 2 * abs(c) / (1 + abs(c) ** 2), rtol=1e-12)
    if n_out == 1:
        np.testing.assert_allclose(csac, 1, rtol=1e-12)


def test_cmif_of_one_mode_is_its_peak_and_a_second_mode_adds_a_value():
    rng = np.random.default_rng(0)
    f = np.linspace(1.0, 3.0, 41)
    phi = np.linalg.qr(rng.standard_normal((4, 2)))[0]
    resonance = [1 / (f0**2 - f**2 + 0.02j * f0 * f) for f0 in (2.0, 2.05)]
    H = np.einsum("mf,om,im->foi", resonance[:1], phi[:, :1], phi[:, :1])
    values = fc.cmif(H)
    assert values.shape == (41, 4)
    np.testing.assert_allclose(values[:, 0], abs(resonance[0]), rtol=1e-12)
    assert values[:, 1:].max() < 1e-15 * values.max()
    both = fc.cmif(H + np.einsum("f,o,i->foi", resonance[1], phi[:, 1], phi[:, 1]))
    expected = np.sort(np.abs(resonance), axis=0)[::-1].T  # orthogonal shapes share no singular value
    np.testing.assert_allclose(both[:, :2], expected, rtol=1e-12)
    H[3, 0, 0] = np.nan
    assert np.flatnonzero(np.isnan(fc.cmif(H)[:, 0])).tolist() == [3]
