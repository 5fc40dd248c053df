"""Peaks of FRFs that no identified mode explains are named, with the criterion that left their poles out."""

import time
import warnings

import numpy as np
import pytest

from fem import FRF
from tests.noise import complex_normal
from updating import Candidate, Stabilisation, identify_modes, mode_indicator, unexplained_peaks
from updating.modal import peak_words
from updating.modal import refinement as modal_fit

FREQUENCY = np.array([31.0, 58.0, 96.0, 140.0, 171.0, 230.0])
ZETA = np.array([0.4, 0.6, 0.5, 0.5, 0.4, 0.6]) / 100
STRONGEST = 2
N_RUNS = 9


def roving(noise=0.005, n_lines=1600, top=260.0, shift=0.0, phase=0.0, seed=0):
    """Return FRFs of a hammer that roves over nine places, with one accelerometer at the first.

    Each run may have another natural frequency of the strongest mode (shift: the whole range, relative), and
    another phase of it (phase: the whole range, radians): places, trigger and boundary changed between runs.
    """
    rng = np.random.default_rng(seed)
    f = np.linspace(0, top, n_lines + 1)[1:]
    w = 2 * np.pi * f[:, None]
    phi = np.cos(np.outer(np.linspace(0, 1, N_RUNS), np.pi * np.arange(1, 7)))
    strength = np.where(np.arange(6) == STRONGEST, 8.0, 1.0)
    H = np.zeros((n_lines, N_RUNS, 1), dtype=complex)
    for run, part in enumerate(np.linspace(-0.5, 0.5, N_RUNS)):
        own = np.where(np.arange(6) == STRONGEST, 1.0, 0.0)
        wn = 2 * np.pi * FREQUENCY * (1 + shift * part * own)
        turn = np.exp(1j * phase * rng.permutation(N_RUNS)[0] / N_RUNS * own)
        q = -(w**2) / (wn**2 - w**2 + 2j * ZETA * wn * w)
        H[:, run, 0] = (q * strength * phi[0] * phi[run] * turn).sum(axis=1)
    size = noise * np.sqrt((np.abs(H) ** 2).mean(axis=0) / 2)
    H = H + size * complex_normal(rng, H.shape)
    labels = [f"{k + 1}Z+" for k in range(N_RUNS)]
    return FRF.from_arrays(f, H, "accelerance", labels, labels[:1])


def identified(frf, **how):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = identify_modes(frf, **how)
    return found, [str(w.message) for w in caught]


def test_the_strongest_mode_of_a_roving_test_is_not_dropped_in_silence():
    """Phases differ from run to run, so that its shape is far from real: it is left out, and that is said."""
    frf = roving(phase=2 * np.pi)
    found, said = identified(frf)
    # it stays in the fit, so that the others do not bend to take its place
    assert found.modes.frequency == pytest.approx(np.delete(FREQUENCY, STRONGEST), rel=1e-3)
    peak = found.unexplained[0]
    assert peak.frequency == pytest.approx(96.0, abs=0.2)
    assert peak.share > 0.5
    assert "was left out: modal phase collinearity 0." in peak.reason
    assert "below 0.3 (least_mpc)" in peak.reason
    assert any(text.startswith("the peak at 9") and "Hz has no mode" in text for text in said)
    assert peak.words in found.table()
    assert len(found.unexplained) == 1
    # told to take complex shapes, it does, and nothing is left
    every, said = identified(frf, least_mpc=0.0, largest_mpd=90.0)
    assert every.modes.frequency == pytest.approx(FREQUENCY, rel=1e-3)
    assert every.mpc[STRONGEST] < 0.3
    assert not every.unexplained
    assert not said


@pytest.mark.parametrize("shift", [0.002, 0.01, 0.03])
@pytest.mark.parametrize("swapped", [False, True])
def test_every_peak_has_a_mode_near_or_a_reason(shift, swapped):
    """Masses that rove move a frequency from run to run; forces and responses may be either way round."""
    frf = roving(shift=shift)
    if swapped:
        frf = FRF.from_arrays(frf.frequency, frf.H.transpose(0, 2, 1), "accelerance", frf.inputs, frf.outputs)
    found, said = identified(frf)
    half_range = 0.5 * shift * 96 + 2
    for true in FREQUENCY:
        near = np.abs(found.modes.frequency - true).min() < (half_range if true == 96 else 0.1)
        named = any(abs(p.frequency - true) < half_range for p in found.unexplained)
        assert near or named, (true, found.modes.frequency, found.unexplained)
    assert said == peak_words(found.unexplained)


@pytest.mark.parametrize("how", [{}, {"least_mpc": 0.0, "largest_mpd": 90.0}])
def test_clean_data_have_no_unexplained_peaks(how):
    found, said = identified(roving(noise=0.03), **how)
    assert found.modes.frequency == pytest.approx(FREQUENCY, rel=1e-3)
    assert not found.unexplained
    assert not said


def test_noise_alone_has_none_either():
    rng = np.random.default_rng(1)
    H = complex_normal(rng, (2000, 9, 1))
    labels = [f"{k}Z+" for k in range(9)]
    found, said = identified(FRF.from_arrays(np.arange(1.0, 2001.0), H, "accelerance", labels, labels[:1]))
    assert not found.modes.n_modes
    assert not found.unexplained
    assert not said


def test_a_peak_beyond_what_orders_reach_is_named_too():
    """Two poles at most in each order: what they do not reach has no pole that persists."""
    frf = roving()
    found, _ = identified(frf, highest_order=8)
    named = [p.frequency for p in found.unexplained]
    for true in FREQUENCY:
        assert np.abs(found.modes.frequency - true).min() < 0.2 or np.abs(np.array(named) - true).min() < 1


def test_forces_and_responses_change_places_without_another_result():
    """Reciprocity: nine forces and one response are the same test as one force and nine responses."""
    frf = roving(noise=0.01)
    one, _ = identified(frf)
    other, _ = identified(
        FRF.from_arrays(frf.frequency, frf.H.transpose(0, 2, 1), "accelerance", frf.inputs, frf.outputs)
    )
    np.testing.assert_allclose(other.poles, one.poles, rtol=1e-12)
    np.testing.assert_allclose(other.synthesised.H, one.synthesised.H.transpose(0, 2, 1), rtol=1e-9)
    np.testing.assert_allclose(other.residues, one.residues.transpose(0, 2, 1), rtol=1e-9)
    np.testing.assert_allclose(other.noise, one.noise.transpose(0, 2, 1), rtol=1e-9)
    assert other.modes.shapes.shape == (1, 6)
    # at the driving point both have the same size; the phase is that of one response, or the mean of nine
    np.testing.assert_allclose(np.abs(other.complex_shapes[0]), np.abs(one.complex_shapes[0]), rtol=1e-9)
    np.testing.assert_allclose(other.shape_std[0], one.shape_std[0], rtol=0.05)


def test_fifty_thousand_lines_of_nine_forces_are_a_matter_of_seconds():
    """A hammer test at high resolution: 142 s before responses and forces changed places, some 7 s now."""
    frf = roving(n_lines=51200, top=260.0)
    swapped = FRF.from_arrays(frf.frequency, frf.H.transpose(0, 2, 1), "accelerance", frf.inputs, frf.outputs)
    began = time.process_time()
    found, _ = identified(swapped)
    assert time.process_time() - began < 30
    assert found.modes.frequency == pytest.approx(FREQUENCY, rel=1e-4)


# ------------------------------------------------------------------------------------------------- pieces


def nothing():
    empty = np.zeros(0)
    flags = empty.astype(bool)
    return Stabilisation(
        empty.astype(int),
        empty.astype(complex),
        np.zeros((0, 1), complex),
        flags,
        flags,
        flags,
        np.arange(2, 9),
    )


def test_a_peak_without_any_pole_says_so_and_peaks_are_counted():
    f = np.linspace(1, 100, 3000)
    poles = np.arange(4.0, 100.0, 6.0)
    H = (1 / (poles**2 - f[:, None] ** 2 + 0.01j * poles * f[:, None])).sum(axis=1)[:, None, None]
    sigma = np.full(H.shape, 1e-9)
    peaks = unexplained_peaks(f, H, np.zeros_like(H), sigma, (), nothing())
    assert len(peaks) == len(poles)
    np.testing.assert_allclose(sorted(p.frequency for p in peaks), poles, atol=0.2)
    assert peaks[0].words.endswith("Hz has no mode: no model of an order up to 8 has a pole there")
    assert [p.level_db for p in peaks] == sorted((p.level_db for p in peaks), reverse=True)
    words = peak_words(peaks)
    assert len(words) == 13
    assert words[-1].startswith("4 lower peaks have no mode either, at ")
    # all of it synthesised, nothing is unexplained
    assert not unexplained_peaks(f, H, H, sigma, (), nothing())
    assert mode_indicator(H, np.ones((1, 1))) == pytest.approx(np.abs(H[:, 0, 0]) ** 2)


def test_a_peak_names_the_nearest_rejected_pole_and_none_of_high_damping():
    f = np.linspace(1, 20, 2000)
    H = (1 / (np.array([8.0, 15.0]) ** 2 - f[:, None] ** 2 + 0.05j * f[:, None])).sum(axis=1)[:, None, None]
    rejected = (
        Candidate(8.01, 0.004, 5, False, "insignificant"),
        Candidate(8.03, 0.005, 20, False, "outside the band"),
        Candidate(12.0, 0.46, 22, False, "damping ratio above 0.2"),
    )
    peaks = unexplained_peaks(f, H, np.zeros_like(H), np.full(H.shape, 1e-9), rejected, nothing())
    reason = {round(p.frequency): p.reason for p in peaks}
    assert reason[8] == "the pole at 8.01 Hz, in 5 orders, was left out: insignificant"
    assert reason[15] == "no model of an order up to 8 has a pole there"


@pytest.mark.parametrize("condition", [1.0, 1e4, 1e9])
def test_tall_matrices_are_made_orthogonal_to_rounding(condition, monkeypatch):
    monkeypatch.setattr(modal_fit, "_TALL", 0)
    rng = np.random.default_rng(0)
    U, V = np.linalg.qr(rng.standard_normal((3000, 12)))[0], np.linalg.qr(rng.standard_normal((12, 12)))[0]
    B = U * np.geomspace(1, 1 / condition, 12) @ V
    B = B / np.linalg.norm(B, axis=0)
    Q, R = modal_fit._orthogonal(B)
    np.testing.assert_allclose(Q.T @ Q, np.eye(12), atol=1e-13)
    np.testing.assert_allclose(Q @ R, B, atol=1e-13)


def test_blocks_of_lines_give_the_same_fit(monkeypatch):
    frf = roving(noise=0.01, n_lines=700)
    one, _ = identified(frf)
    monkeypatch.setattr(modal_fit, "_BLOCK", 97)
    monkeypatch.setattr(modal_fit, "_TALL", 0)
    other, _ = identified(frf)
    np.testing.assert_allclose(other.poles, one.poles, rtol=1e-10)
    np.testing.assert_allclose(other.frequency_std, one.frequency_std, rtol=1e-6)
