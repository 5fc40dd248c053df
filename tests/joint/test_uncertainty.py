"""What a fitted joint states of its values: deviations beyond noise, bounds, and what stays open."""

import numpy as np
import pytest

from benchmarks.joint_noise import ARMS, model_parts, noisy, parts
from joint import Uncertain, couple, fit_joint, relative_coordinates, relative_form
from joint.joint_fit import inverse_information, jackknife, model_share, peak_count
from tests.noise import complex_normal

LINES = np.linspace(20.0, 1500.0, 120)
K = np.array([3e7, 2e7, 1e7, 900.0, 800.0, 500.0])


@pytest.fixture(scope="module")
def slim():
    return parts(LINES, 6)


def form_of(parts, kinds="K"):
    return relative_form(parts.interface.joint, relative_coordinates(*ARMS), kinds, pattern=np.eye(6))


def measured(parts, form, theta, level=0.005, seed=0, lines=LINES):
    """Noisy FRFs of the assembly, without those that symmetry makes zero."""
    H = couple(parts, form.Z(lines, theta)).H_nn
    size = np.sqrt((np.abs(H) ** 2).mean(axis=0))
    H = np.where(size > 1e-9 * size.max(), H, np.nan)
    return noisy(H, level, np.random.default_rng(seed))


def test_white_noise_widens_nothing(slim):
    form = form_of(slim)
    fit = fit_joint(form, slim, LINES, measured(slim, form, K), 1.1 * K, noise=0.005)
    np.testing.assert_allclose(fit.covariance, fit.independent, rtol=1e-9)
    assert not fit.at_bound.any()
    assert abs((fit.values - K) / fit.std).max() < 3.5


@pytest.mark.parametrize("accuracy", [None, 0.03])
def test_deviations_cover_an_error_of_the_model(slim, accuracy):
    """The parts are softer than the model by 1 % and 0.5 %, which it does not know.

    If what is left were noise, the truth would lie more than ten of its deviations off; whether the error is
    above the noise that is given or within the accuracy that is asked makes no difference.
    """
    form = form_of(slim)
    soft = model_parts(
        LINES, [Uncertain("U", "frame", "E:steel", 0.01), Uncertain("D", "frame", "E:steel", 0.005)]
    )
    H = measured(soft.evaluate(np.array([-1.0, -1.0]))[0], form, K, seed=3)
    fit = fit_joint(form, slim, LINES, H, K, noise=0.005 if accuracy is None else accuracy)
    off = np.abs(fit.values - K)
    assert (off / np.sqrt(np.diag(fit.independent))).max() > 10
    known = fit.identifiability.determined
    assert known.any()
    assert (off / fit.std)[known].max() < 3


def test_a_value_at_its_bound_has_no_deviation(slim):
    form = form_of(slim, "KD")
    theta = np.append(K, 0.02 * K)
    # the assembly has less damping than the parts allow, so that the joint's would be negative
    theta[[6, 10]] = [-0.01 * K[0], -0.01 * K[4]]
    H = measured(slim, form, theta, 1e-3, 1)
    fit = fit_joint(form, slim, LINES, H, np.abs(theta), noise=1e-3, positive=True)
    assert {form.names[i] for i in np.flatnonzero(fit.at_bound)} == {"D x x", "D ry ry"}
    assert (fit.values[fit.at_bound] == 0).all()
    assert np.isnan(fit.std[fit.at_bound]).all()
    assert np.isnan(fit.interval()[fit.at_bound]).all()
    assert np.isfinite(fit.std[~fit.at_bound]).all()
    assert not fit.identifiability.determined[:12][fit.at_bound].any()
    assert fit.words(6) == "0, at its bound"
    assert "at a bound: D x x, D ry ry" in fit.message
    assert "do not determine D x x" not in fit.message
    assert np.isfinite(fit.Z_std()).all()


def test_what_is_released_is_said_in_words(slim):
    """No stiffness about x, beside noise of 0.5 %: the value is what noise makes of none."""
    form = form_of(slim)
    theta = K.copy()
    theta[3] = 0.0
    fit = fit_joint(
        form,
        slim,
        LINES,
        measured(slim, form, theta),
        np.where(theta, theta, 1.0),
        noise=0.005,
        positive=True,
    )
    assert not fit.identifiability.determined[3]
    if fit.at_bound[3]:
        assert fit.words(3) == "0, at its bound"
    else:
        assert fit.open_end[3] == "released"
        assert fit.words(3).startswith("not determined: below ")
        assert fit.words(3).endswith("(95 %), cannot be distinguished from zero")
    assert " ± " in fit.words(4)


def test_a_released_direction_without_bounds_has_a_limit(slim):
    form = form_of(slim)
    theta = K.copy()
    theta[3] = 0.0
    H = measured(slim, form, theta)
    fit = fit_joint(form, slim, LINES, H, theta, noise=0.005)
    assert not fit.identifiability.determined[3]
    assert fit.open_end[3] == "released"
    assert "cannot be distinguished from zero" in fit.words(3)


def test_what_is_rigid_is_told_from_what_is_released(slim):
    """Lines up to 160 Hz cannot tell 3e9 N/m along x from a rigid joint."""
    lines = LINES[:12]
    few = parts(lines, 6)
    form = form_of(few)
    H = measured(few, form, 1e2 * K, 0.02, lines=lines)
    fit = fit_joint(form, few, lines, H, 1e2 * K, noise=0.02, positive=True)
    assert fit.open_end[0] == "rigid"
    assert fit.words(0) == "not determined: cannot be distinguished from rigid"


def test_a_direction_without_information_has_no_finite_deviation(slim):
    """Two springs in one place: only their sum is determined."""
    form = form_of(slim)
    twin = form.with_term("K second", "K", form.matrices[2], "N/m")
    theta = np.append(K, 2e6)
    fit = fit_joint(twin, slim, LINES, measured(slim, twin, theta), theta, noise=0.005)
    assert np.isinf(fit.std[[2, 6]]).all()
    assert np.isfinite(fit.std[[0, 1, 3, 4, 5]]).all()
    assert not fit.identifiability.determined[[2, 6]].any()
    assert "do not determine K z z, K second" in fit.message
    assert fit.words(2).startswith("not determined")


# ------------------------------------------------------------------------------------------------- pieces


def test_singular_information_is_inverted_where_it_can_be():
    J = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 2.0], [1.0, 1.0, 1.0]])
    C = inverse_information(J.T @ J, np.zeros(3, dtype=bool))
    assert np.isinf(C[[0, 1], [0, 1]]).all()
    # of the sum s and z: [[2, 1], [1, 5]], inverse of twice that
    assert C[2, 2] == pytest.approx(2 / 9 / 2)
    one = inverse_information(J.T @ J, np.array([True, False, False]))
    np.testing.assert_allclose(one[1:, 1:], np.linalg.inv(2 * (J.T @ J)[1:, 1:]))
    assert not one[0].any()


def test_the_jackknife_of_a_mean_is_its_standard_error():
    """For the mean of groups it is Σ(x - mean)² / (G (G - 1)), exactly."""
    x = np.random.default_rng(0).standard_normal(12)

    def information(first, end):
        return np.array([[float(end - first)]]), np.array([-(x[first:end] - x.mean()).sum()])

    C = jackknife(np.array([[12.0]]), information, np.arange(13), np.array([True]))
    assert C[0, 0] == pytest.approx(x.var(ddof=1) / 12)


def test_the_share_of_the_model_tells_noise_from_what_lines_share():
    rng = np.random.default_rng(2)
    white = complex_normal(rng, (400, 3, 2)) / np.sqrt(2)
    own = np.ones(white.shape)
    assert model_share(white, own) < 0.03
    assert model_share(5 * white, own) == pytest.approx(1 - 2 / 25, abs=0.03)
    smooth = np.exp(1j * np.linspace(0, 3, 400))[:, None, None] * np.ones(white.shape)
    assert model_share(smooth, own) > 0.9
    # of as much noise as of what is smooth, half is shared
    assert model_share(smooth + white, own * np.sqrt(2)) == pytest.approx(0.5, abs=0.1)


def test_peaks_count_the_modes_that_frfs_show():
    f, poles = np.linspace(1, 100, 2000), np.array([20.0, 45.0, 80.0])
    H = (1 / (poles**2 - f[:, None] ** 2 + 0.02j * poles * f[:, None])).sum(axis=1)
    assert peak_count(H[:, None, None]) == 3
