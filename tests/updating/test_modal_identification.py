"""Modes from FRFs: known modes come back, with the errors that noise predicts, and no others."""

import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sla
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fem import FRF
from fem.io import read_frf
from tests.noise import complex_normal
from updating import (
    IdentificationError,
    damping_matrix,
    estimate_roving,
    identify_modes,
    mac,
    mean_phase_deviation,
    modal_complexity_factor,
    modal_phase_collinearity,
    real_shapes,
)

SOUTHAMPTON = Path(__file__).parents[2] / "examples" / "southampton-frame" / "accelerance_3x3.uff"


def superposed(lines, frequency, zeta, phi, inputs, kind="accelerance", lower=0.0, upper=0.0):
    """FRFs of real modes of modal mass 1, with residuals."""
    w, wn = 2 * np.pi * lines[:, None], 2 * np.pi * np.asarray(frequency)
    q = 1 / (wn**2 - w**2 + 2j * np.asarray(zeta) * wn * w)
    H = (phi * q[:, None, :]) @ phi[inputs].T + upper - lower / w[:, :, None] ** 2
    power = {"receptance": 0, "mobility": 1, "accelerance": 2}[kind]
    labels = [f"{k + 1}Z+" for k in range(len(phi))]
    return FRF.from_arrays(
        lines, H * (1j * w[:, :, None]) ** power, kind, labels, [labels[i] for i in inputs]
    )


def noisy(frf, part, rng):
    """Complex noise of a part of the root mean square of each FRF."""
    size = part * np.sqrt((np.abs(frf.H) ** 2).mean(axis=0) / 2)
    noise = complex_normal(rng, frf.H.shape)
    return FRF.from_arrays(frf.frequency, frf.H + size * noise, frf.kind, frf.outputs, frf.inputs)


FOURTEEN = np.array([14.2, 23.7, 31.0, 44.5, 52.3, 63.8, 75.1, 88.0, 89.2, 104.6, 121.3, 139.9, 158.2, 181.7])
RATIOS = np.array([1.1, 0.8, 0.6, 0.9, 0.5, 0.7, 1.2, 0.6, 0.8, 0.5, 0.9, 0.7, 0.6, 0.8]) / 100


@pytest.mark.parametrize("seed", [0, 1])
def test_fourteen_modes_with_a_close_pair_come_out_of_noise(seed):
    rng = np.random.default_rng(seed)
    phi = rng.standard_normal((60, 14)) / 3
    exact = superposed(np.linspace(5, 205, 1600), FOURTEEN, RATIOS, phi, [0, 20, 41], upper=1e-7)
    found = identify_modes(noisy(exact, 0.01, rng))
    assert found.modes.n_modes == 14
    assert np.abs(found.modes.frequency / FOURTEEN - 1).max() < 5e-5
    assert np.abs(found.modes.zeta / RATIOS - 1).max() < 5e-3
    assert mac(found.modes.shapes, phi).diagonal().min() > 0.999
    assert found.scaled
    # the standard deviations are right: 28 squares of normal numbers lie below 63 but once in 5000
    score = np.concatenate(
        [
            (found.modes.frequency - FOURTEEN) / found.frequency_std,
            (found.modes.zeta - RATIOS) / found.zeta_std,
        ]
    )
    assert (score**2).sum() < 63
    # unit modal mass: the error of a shape's size is that of its driving points
    size = np.linalg.norm(found.modes.shapes, axis=0) / np.linalg.norm(phi, axis=0)
    assert np.abs(size - 1).max() < 0.01
    # what is left is the noise
    assert found.error == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("kind", ["receptance", "mobility", "accelerance"])
def test_exact_data_of_three_masses_give_the_eigensolution(kind):
    M = np.diag([1.0, 2.0, 1.5])
    K = 1e5 * np.array([[2, -1, 0], [-1, 2.2, -1], [0, -1, 1]])
    squares, phi = sla.eigh(K, M)
    frequency, zeta = np.sqrt(squares) / (2 * np.pi), np.array([0.01, 0.02, 0.005])
    found = identify_modes(superposed(np.linspace(0, 80, 801)[1:], frequency, zeta, phi, [0, 2], kind))
    assert found.modes.frequency == pytest.approx(frequency, rel=1e-9)
    assert found.modes.zeta == pytest.approx(zeta, rel=1e-7)
    sign = np.sign((found.modes.shapes * phi).sum(axis=0))
    assert np.allclose(found.modes.shapes * sign, phi, atol=1e-7)
    assert found.mpc == pytest.approx(1.0)
    assert found.modes.labels == ("1Z+", "2Z+", "3Z+")
    # and the damping matrix rebuilds Z
    C = damping_matrix(sp.csr_array(M), found.modes.shapes, found.modes.frequency, found.modes.zeta)
    omega = 2 * np.pi * 21.0
    H = np.linalg.inv(K + 1j * omega * C - omega**2 * M)
    one = superposed(np.array([21.0]), frequency, zeta, phi, [0, 1, 2], "receptance").H[0]
    assert np.allclose(H, one, rtol=1e-6, atol=1e-8 * np.abs(one).max())
    assert found.damping().ratio_at(frequency) == pytest.approx(zeta, rel=1e-6)


def test_bare_arrays_and_uneven_lines_do():
    lines = np.sort(np.random.default_rng(3).uniform(2, 40, 300))
    exact = superposed(lines, [10.0, 25.0], [0.01, 0.02], np.array([[1.0, 0.5], [0.4, -1.0]]), [0])
    with pytest.warns(UserWarning, match="Modal masses are unknown"):
        found = identify_modes(lines, exact.H)
    assert found.modes.frequency == pytest.approx([10, 25], rel=1e-8)
    assert not found.scaled
    assert np.abs(found.modes.shapes).max(axis=0) == pytest.approx([1, 1])
    same = identify_modes(lines, exact.H, driving=[("out1", "in1")])
    assert same.modes.shapes == pytest.approx(np.array([[1, -0.5], [0.4, 1.0]]), rel=1e-6)


def test_the_decay_that_a_window_added_is_taken_off_exactly():
    """FRFs of damping 0.5 % at s = iω + a, in which the window has more damping than the structure."""
    lines, a = np.linspace(5, 60, 500), 4.0
    f, z, phi = np.array([20.0, 41.0]), np.array([0.005, 0.008]), np.array([[0.8, 0.3], [0.4, -1.0]])
    s, wn = (2j * np.pi * lines + a)[:, None], 2 * np.pi * f
    q = s**2 / (s**2 + 2 * z * wn * s + wn**2)
    H = (phi * q[:, None, :]) @ phi[[0]].T
    frf = FRF.from_arrays(lines, H, "accelerance", ["1Z+", "2Z+"], ["1Z+"])
    found = identify_modes(frf, added_decay=a)
    assert found.modes.frequency == pytest.approx(f, rel=1e-8)
    assert found.modes.zeta == pytest.approx(z, rel=1e-6)
    assert np.abs(found.modes.shapes) == pytest.approx(np.abs(phi), rel=1e-6)
    with pytest.raises(IdentificationError, match="added_decay is -1"):
        identify_modes(frf, added_decay=-1.0)


def test_a_roving_hammer_gives_the_modes_without_the_damping_of_its_window():
    """Free decays after unit samples of force, through the exponential window, to modes.

    Sampling adds copies of each mode at the sample rate, smooth in the band; the end of the block cuts off
    e^{-dT} times the window's end value, 1e-4 · e^{-0.63 · 4.1} = 8e-6 of the decay.
    """
    rate, n, f, z = 2000.0, 8192, np.array([20.0, 41.0]), np.array([0.005, 0.008])
    phi, wn, t = np.array([[0.8, 0.3], [0.4, -1.0]]), 2 * np.pi * f, np.arange(n) / rate
    damped = wn * np.sqrt(1 - z**2)
    decays = np.exp(-z * wn * t[:, None]) * np.sin(damped * t[:, None]) / damped
    force = np.zeros((3, n))
    force[:, 0] = rate  # a unit impulse
    hits = {f"{k + 1}Z+": (force, np.tile((decays * phi[k]) @ phi.T, (3, 1, 1))) for k in range(2)}
    estimate = estimate_roving(
        hits, rate, outputs=list(hits), kind="receptance", end_value=1e-4, band=(5.0, 60.0)
    )
    found = identify_modes(estimate.frf, added_decay=estimate.added_decay)
    assert found.modes.frequency == pytest.approx(f, rel=1e-5)
    assert found.modes.zeta == pytest.approx(z, rel=1e-3)
    assert np.abs(found.modes.shapes) == pytest.approx(np.abs(phi), rel=1e-3)


def test_residuals_stand_for_modes_outside_the_band():
    lines = np.linspace(20, 60, 500)
    exact = superposed(lines, [40.0], [0.01], np.array([[1.0], [0.5]]), [0], lower=0.3, upper=2e-5)
    found = identify_modes(exact)
    assert found.lower[:, 0] == pytest.approx(0.3, rel=1e-4)
    assert found.upper[:, 0] == pytest.approx(2e-5, rel=1e-4)
    assert found.error.max() < 1e-8
    assert np.allclose(found.residues[0][:, 0], np.array([1, 0.5]) / (2j * found.poles[0].imag), rtol=1e-5)


def test_an_output_against_the_force_has_the_other_sign():
    exact = superposed(np.linspace(5, 50, 400), [20.0], [0.01], np.array([[0.8], [0.3]]), [0])
    turned = FRF.from_arrays(exact.frequency, -exact.H, exact.kind, ["1Z-", "2Z-"], ["1Z+"])
    assert np.abs(identify_modes(turned).modes.shapes[:, 0]) == pytest.approx([0.8, 0.3], rel=1e-6)
    wrong = FRF.from_arrays(exact.frequency, -exact.H, exact.kind, ["1Z+", "2Z+"], ["1Z+"])
    with pytest.warns(UserWarning, match="opposite directions"):
        found = identify_modes(wrong)
    assert found.modes.shapes[:, 0] == pytest.approx([0.8, 0.3], rel=1e-6)


def test_modes_do_not_depend_on_the_units_of_channels():
    phi = np.random.default_rng(0).standard_normal((6, 2))
    exact = superposed(np.linspace(5, 50, 300), [20.0, 30.0], [0.01] * 2, phi, [0, 1])
    data = noisy(exact, 0.02, np.random.default_rng(5))
    units = np.logspace(-3, 3, 6)[:, None] * [1.0, 1e-4]
    other = FRF.from_arrays(data.frequency, data.H * units, data.kind, data.outputs, data.inputs)
    one, two = identify_modes(data), identify_modes(other)
    assert np.allclose(one.poles, two.poles, rtol=1e-6)
    assert two.frequency_std == pytest.approx(one.frequency_std, rel=1e-3)


def test_noise_alone_has_no_modes():
    rng = np.random.default_rng(8)
    H = complex_normal(rng, (400, 5, 2))
    with pytest.warns(UserWarning, match="Modal masses"):
        found = identify_modes(np.linspace(1, 100, 400), H)
    assert found.modes.n_modes == 0
    assert all(candidate.reason for candidate in found.candidates)


def test_the_same_data_give_the_same_result():
    exact = superposed(
        np.linspace(5, 50, 300), [20.0, 30.0], [0.01] * 2, np.array([[0.8, 0.2], [0.3, -1]]), [0]
    )
    data = noisy(exact, 0.02, np.random.default_rng(5))
    one, two = identify_modes(data), identify_modes(data)
    assert np.array_equal(one.poles, two.poles)
    assert one.choices == two.choices


@pytest.mark.parametrize("given", [False, True])
def test_standard_deviations_are_those_of_repeated_measurements(given):
    """Coverage: the squares of 30 x 4 scores have a mean of 1 within four times √(2/120), 0.52."""
    rng = np.random.default_rng(11)
    f, z = np.array([20.0, 21.0]), np.array([0.01, 0.015])
    exact = superposed(
        np.linspace(10, 32, 300), f, z, np.array([[0.8, 0.4], [0.3, -1.0], [0.5, 0.2]]), [0, 1]
    )
    std = 0.03 * np.sqrt((np.abs(exact.H) ** 2).mean(axis=0) / 2) if given else None
    score = []
    for _ in range(30):
        found = identify_modes(noisy(exact, 0.03, rng), std=std, highest_order=10)
        score.append((found.modes.frequency - f) / found.frequency_std)
        score.append((found.modes.zeta - z) / found.zeta_std)
    assert np.mean(np.square(score)) == pytest.approx(1.0, abs=0.52)


def test_single_reference_tells_a_close_pair():
    """One force, modes one and a half half-widths apart: what merges in a single-reference pole picker."""
    rng = np.random.default_rng(2)
    phi = rng.standard_normal((20, 3))
    exact = superposed(np.linspace(60, 120, 900), [70.0, 88.0, 89.2], [0.01, 0.006, 0.008], phi, [0])
    found = identify_modes(noisy(exact, 0.01, rng))
    assert found.modes.frequency == pytest.approx([70, 88, 89.2], rel=1e-4)
    assert found.modes.zeta == pytest.approx([0.01, 0.006, 0.008], rel=0.02)


CLEAR = np.array([139.0, 381.0, 739.0, 1154.0])


def averaged_hits(seed, shift, colour, weak):
    """One FRF averaged over six hits, whose four resonances shift from hit to hit as those of real beams do.

    Weak modes of a fixture lie between them, and noise of neighbouring lines is correlated. A sum of several
    poles describes each peak better than one.
    """
    rng = np.random.default_rng(seed)
    lines = np.linspace(60, 1400, 600)
    zeta, strength = np.array([0.008, 0.006, 0.01, 0.012]), np.array([1.0, -0.8, 0.9, -1.0])

    def modes(frequency, zeta, strength):
        w, wn = 2 * np.pi * lines[:, None], 2 * np.pi * frequency
        return (strength * -(w**2) / (wn**2 - w**2 + 2j * zeta * wn * w)).sum(axis=1)

    fixture = rng.uniform(80, 1380, 20), rng.uniform(0.002, 0.03, 20), weak * rng.standard_normal(20)
    H = modes(*fixture)
    for _ in range(6):
        H = H + modes(CLEAR * (1 + shift * zeta * rng.standard_normal(4)), zeta, strength) / 6
    window = np.hanning(colour + 2)[1:-1]
    noise = np.convolve(complex_normal(rng, lines.size), window / np.linalg.norm(window), "same")
    return lines, (H + 0.01 * np.sqrt((np.abs(H) ** 2).mean() / 2) * noise)[:, None, None]


@cache
def found_in_hits(seed, shift, colour, weak):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of modal masses and of weak peaks
        return identify_modes(*averaged_hits(seed, shift, colour, weak))


@pytest.mark.parametrize(
    ("seed", "shift", "colour", "weak"),
    [
        (2, 0.6, 25, 0.02),  # two of four were lost
        (5, 0.6, 15, 0.05),  # three of four, after two copies of the second had been taken
        (8, 0.6, 15, 0.05),
        (3, 0.3, 25, 0.02),  # a pole far outside the band made the variances of all others infinite
    ],
)
def test_one_frf_of_averaged_hits_keeps_its_clear_resonances(seed, shift, colour, weak):
    found = found_in_hits(seed, shift, colour, weak)
    nearest = np.abs(found.modes.frequency[:, None] / CLEAR - 1).min(axis=0)
    assert nearest.max() < 0.01


def test_one_frf_has_one_mode_for_each_peak():
    """Two poles whose half-power widths overlap describe one peak of one FRF, be it nonlinear or a pair."""
    found = found_in_hits(7, 0.6, 25, 0.02)
    poles = found.poles
    overlap = np.abs(poles[:, None] - poles) / -(poles.real[:, None] + poles.real)
    assert overlap[~np.eye(poles.size, dtype=bool)].min() > 1
    assert np.abs(found.modes.frequency / 139 - 1).min() < 0.01


def test_each_rejected_pole_is_listed_once_and_its_reason_names_a_mode_that_is_reported():
    found = found_in_hits(3, 0.3, 25, 0.02)
    rejected = [c for c in found.candidates if not c.accepted]
    places = [(c.frequency, c.zeta) for c in rejected]
    assert rejected
    assert len(set(places)) == len(places)
    reported = {f"{pole.imag / (2 * np.pi):.4g} Hz" for pole in found.poles}
    named = [c.reason.partition("mode at ")[2].partition(",")[0] for c in rejected if "mode at" in c.reason]
    assert named
    assert set(named) <= reported
    assert sum(c.accepted for c in found.candidates) == found.modes.n_modes


@pytest.mark.parametrize("seed", [0, 3])
def test_a_mode_hidden_by_a_close_one_is_found_in_the_residual(seed):
    """Two pairs lie a third of a half-width apart: in the residual, one of a pair overlaps the mode found."""
    frequency = np.array(
        [25.6, 32.59, 32.713, 34, 43.7, 44.93, 54.97, 134.94, 150.42, 154.242, 154.367, 188.66]
    )
    frequency = np.append(frequency, [191.24, 218.87, 221.23])
    zeta = (
        np.array([0.74, 1.11, 1.1, 0.3, 0.79, 0.47, 0.57, 0.6, 1.04, 1.13, 0.3, 0.45, 0.37, 0.9, 0.5]) / 100
    )
    rng = np.random.default_rng(seed)
    phi = rng.standard_normal((20, 15))
    found = identify_modes(
        noisy(superposed(np.linspace(5, 260, 600), frequency, zeta, phi, [0, 7]), 0.05, rng)
    )
    assert found.modes.frequency == pytest.approx(frequency, rel=1e-3)


BEAM = Path(__file__).parents[3] / "shared" / "data" / "measured-beams" / "six-masses.npz"


@pytest.mark.skipif(not BEAM.exists(), reason="the measured beam is not there")
@pytest.mark.parametrize("sample", [12, 29])
def test_one_measured_frf_keeps_its_clear_resonances(sample):
    """Weak modes of the fixture lie among those of the beam: dropped at once, they took some along."""
    with np.load(BEAM) as beam, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = identify_modes(beam["frequency"], beam["healthy"][sample].astype(complex), band=(8, 2000))
        for peak in beam["peaks"][sample]:
            assert np.abs(found.modes.frequency / peak - 1).min() < 0.01


def test_measured_frame():
    """Peaks are at 6.50, 17.47 and 26.50 Hz; small ones near 29 and 42 Hz lie outside the plane."""
    data = read_frf(SOUTHAMPTON)
    spacing = 1 / 32
    found = identify_modes(data, band=(2.0, 60.0))
    assert found.modes.frequency[[0, 1, 2]] == pytest.approx([6.50, 17.47, 26.50], abs=spacing)
    assert found.modes.n_modes == 5
    assert found.modes.frequency[3:] == pytest.approx([29, 42], abs=0.2)
    assert found.mpc.min() > 0.99
    assert found.error.max() < 0.12
    # the three of the plane move along the sensors, the others hardly
    along = np.linalg.norm(found.modes.shapes, axis=0)
    assert along[:3].min() > 5 * along[3:].max()


def test_the_measured_frame_has_the_modes_that_were_read_by_eye():
    """Peaks of the nine FRFs over the whole band, read from plots [Hz]."""
    by_eye = [6.50, 17.47, 26.50, 28.97, 42.06, 76.78]
    found = identify_modes(read_frf(SOUTHAMPTON), band=(0.5, 128.0))
    assert found.modes.n_modes == len(by_eye)
    assert found.modes.frequency == pytest.approx(by_eye, abs=0.06)
    assert found.unexplained == ()


# Complexity -------------------------------------------------------------------------------------------------


def test_real_shapes_have_no_complexity():
    phi = np.random.default_rng(0).standard_normal((6, 2)) * np.exp([0.3j, 2.1j])
    assert modal_phase_collinearity(phi) == pytest.approx([1, 1])
    assert mean_phase_deviation(phi) == pytest.approx([0, 0], abs=1e-6)
    assert modal_complexity_factor(phi) == pytest.approx([0, 0], abs=1e-12)
    assert np.abs(real_shapes(phi)) == pytest.approx(np.abs(phi))


def test_a_circle_is_wholly_complex():
    n = 8
    phi = np.exp(2j * np.pi * np.arange(n) / n)
    assert modal_phase_collinearity(phi) == pytest.approx([0], abs=1e-12)
    assert mean_phase_deviation(phi) == pytest.approx([45.0])
    assert modal_complexity_factor(phi) == pytest.approx([n / 2 * np.sin(2 * np.pi / n) / np.pi])


def test_an_ellipse_has_the_closed_form():
    t = 2 * np.pi * np.arange(400) / 400
    phi = np.cos(t) + 0.2j * np.sin(t)
    assert modal_phase_collinearity(phi) == pytest.approx([((1 - 0.04) / (1 + 0.04)) ** 2])
    assert modal_complexity_factor(phi) == pytest.approx([0.2], rel=1e-4)


@settings(max_examples=30, deadline=None)
@given(
    arrays(complex, (4, 2), elements=st.complex_numbers(max_magnitude=10, allow_subnormal=False)),
    st.floats(0, 6.28),
    st.floats(0.1, 10),
)
def test_complexity_does_not_depend_on_the_scale(phi, phase, size):
    for measure, top in (
        (modal_phase_collinearity, 1),
        (mean_phase_deviation, 90),
        (modal_complexity_factor, 1),
    ):
        value = measure(phi)
        assert ((value >= 0) & (value <= top)).all()
        if measure is not mean_phase_deviation and (np.abs(phi).max(axis=0) > 1e-3).all():
            assert np.allclose(measure(phi * size * np.exp(1j * phase)), value, atol=1e-6)


# Errors -----------------------------------------------------------------------------------------------------


@pytest.fixture
def small():
    return superposed(np.linspace(5, 50, 300), [20.0], [0.01], np.array([[0.8], [0.3]]), [0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"band": (10.0, 11.0)}, "at least 20 are needed"),
        ({"highest_order": 3}, "highest order is 3"),
        ({"std": np.ones(7)}, r"std has the shape \(7,\)"),
        ({"std": np.zeros((1, 2, 1))}, "standard deviations must be positive"),
        ({"driving": [("3Z+", "1Z+")]}, "names the response '3Z.'"),
        ({"H": np.ones(3)}, "give the FRF alone"),
    ],
)
def test_bad_settings_are_refused(small, change, message):
    with pytest.raises(IdentificationError, match=message):
        identify_modes(small, **change)


def test_dead_channels_are_named(small):
    H = small.H.copy()
    H[:, 1] = 0
    with pytest.raises(IdentificationError, match="response '2Z\\+' are zero"):
        identify_modes(FRF.from_arrays(small.frequency, H, small.kind, small.outputs, small.inputs))


def test_frequencies_without_frfs_are_refused(small):
    with pytest.raises(IdentificationError, match="without FRFs"):
        identify_modes(small.frequency)


@pytest.mark.parametrize(
    ("args", "message"),
    [
        ((np.eye(3), np.ones((2, 1)), [1.0], [0.01]), "2 rows"),
        ((np.eye(2), np.ones((2, 1)), [1.0, 2.0], [0.01]), "1 shapes need"),
        ((-np.eye(2), np.ones((2, 1)), [1.0], [0.01]), "must be positive"),
    ],
)
def test_damping_matrix_refuses_what_does_not_fit(args, message):
    with pytest.raises(IdentificationError, match=message):
        damping_matrix(*args)


def test_a_kept_zero_line_is_left_out(small):
    frequency = np.concatenate([[0.0], small.frequency])
    H = np.concatenate([np.zeros((1, 2, 1)), small.H])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = identify_modes(FRF.from_arrays(frequency, H, small.kind, small.outputs, small.inputs))
    assert found.modes.frequency == pytest.approx([20], rel=1e-8)


def test_a_mode_that_its_driving_point_hardly_moves_keeps_the_weight_of_its_shape():
    """Over 8 repetitions of 12 entries in 5 modes: the mean square score is 1, with a deviation of 0.07.

    The fourth mode moves its driving points by a thousandth of the others: its scale is unknown, its shape is
    known as well as theirs.
    """
    lines = np.linspace(0.25, 100, 400)
    frequency, zeta = [14.0, 31.0, 33.0, 60.0, 82.0], [0.01, 0.006, 0.012, 0.008, 0.01]
    rng = np.random.default_rng(3)
    phi = rng.standard_normal((12, 5))
    phi[[0, 5], 3] *= 1e-3
    strong = np.array([0, 1, 2, 4])
    forces = [0, 5, 8]  # of which the third has no sensor at its place, and moves all modes
    scores, weak, scale = [], [], []
    for _ in range(8):
        frf = noisy(superposed(lines, frequency, zeta, phi, forces), 0.02, rng)
        frf = FRF.from_arrays(frf.frequency, frf.H, frf.kind, frf.outputs, ["1Z+", "6Z+", "elsewhere"])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = identify_modes(frf, highest_order=30)
        shapes, std = found.modes.shapes, found.relative_std(0.0)[1]
        share = (shapes * phi).sum(axis=0) / (phi**2).sum(axis=0)
        across = shapes / share - phi  # at the scale that fits best
        scores.append((across**2).sum(axis=0) / ((std**2) * (phi**2).sum(axis=0)))
        weak.append(std[3] / std[strong].max())
        scale.append(np.linalg.norm(found.shape_std[:, 3]) / np.linalg.norm(shapes[:, 3]))
    assert abs(np.mean(scores) - 1) < 4 * np.sqrt(2 / (11 * 5 * 8))
    assert max(weak) < 2.0
    assert min(scale) > 0.1


@pytest.mark.parametrize("scaled", [True, False])
def test_shapes_scatter_as_their_standard_deviations_say(scaled):
    """Over 8 repetitions of 12 entries in 5 modes: the mean square score is 1, with a deviation of 0.16.

    Entries of a mode share the error of its scale, so that a mode of a repetition counts as two data.
    """
    lines = np.linspace(0, 100, 401)
    w, wn = 2 * np.pi * lines[:, None], 2 * np.pi * np.array([14.0, 31.0, 33.0, 60.0, 82.0])
    zeta = np.array([0.01, 0.006, 0.012, 0.008, 0.01])
    rng = np.random.default_rng(3)
    phi = rng.standard_normal((12, 5))
    H = (phi * (-(w**2) / (wn**2 - w**2 + 2j * zeta * wn * w))[:, None]) @ phi[[0, 5]].T
    labels = [f"{k}Z+" for k in range(12)]
    forces = ["0Z+", "5Z+"] if scaled else ["a", "b"]
    level = 0.05 * np.sqrt((np.abs(H) ** 2).mean() / 2)
    scores = []
    for _ in range(8):
        noise = level * complex_normal(rng, H.shape)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = identify_modes(
                FRF.from_arrays(lines, H + noise, "accelerance", labels, forces), highest_order=30
            )
        shapes = found.modes.shapes
        largest = np.argmax(np.abs(shapes), axis=0)
        true = phi if scaled else phi / phi[largest, range(5)]
        error = shapes * np.sign((shapes * true).sum(axis=0)) - true
        if not scaled:  # the largest entry is 1 without an error
            assert np.abs(found.shape_std[largest, range(5)]).max() < 3e-2 * found.shape_std.max()
            error[largest, range(5)] = found.shape_std[largest, range(5)]
        scores.append(error / found.shape_std)
    mean = float(np.mean(np.square(scores)))
    assert abs(mean - 1) < 4 * np.sqrt(2 / (2 * 5 * 8))
