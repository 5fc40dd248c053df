"""Poles of all orders from one matrix, and their tracks."""

import numpy as np
import pytest

from fem import FRF
from tests.noise import complex_normal
from updating.modal import LEAST_ORDERS, channel_sizes, fit_orders, track_poles

LINES = np.linspace(5, 60, 400)
F, ZETA = np.array([20.0, 20.4, 41.0]), np.array([0.01, 0.012, 0.008])


def frfs(noise, seed=0, n_in=2):
    rng = np.random.default_rng(seed)
    phi = rng.standard_normal((8, 3))
    w, wn = 2 * np.pi * LINES[:, None], 2 * np.pi * F
    H = (phi * (1 / (wn**2 - w**2 + 2j * ZETA * wn * w))[:, None]) @ phi[:n_in].T
    size = noise * np.sqrt((np.abs(H) ** 2).mean(axis=0) / 2)
    return FRF.from_arrays(LINES, H + size * complex_normal(rng, H.shape), "receptance")


def fitted(frf, orders):
    return fit_orders(frf, orders, channel_sizes(frf.H)[0], np.ones(frf.n_freq))


def test_an_order_does_not_depend_on_which_others_are_asked_for():
    """Only on the highest, which is the numerator's."""
    frf = frfs(0.01)
    every, some = fitted(frf, np.arange(3, 13)), fitted(frf, np.array([5, 12]))
    for order in (5, 12):
        assert np.allclose(every.poles[every.order == order], some.poles[some.order == order], rtol=1e-9)


def test_poles_do_not_depend_on_the_units_of_outputs_and_inputs():
    frf = frfs(0.01)
    other = FRF.from_arrays(LINES, frf.H * np.logspace(-3, 3, 8)[:, None] * [1.0, 1e-4], "receptance")
    one, two = fitted(frf, np.arange(3, 13)), fitted(other, np.arange(3, 13))
    assert np.allclose(one.poles, two.poles, rtol=1e-6)
    # participations take the units of the forces
    turned = one.participation * [1.0, 1e-4]
    alike = np.abs((turned.conj() * two.participation).sum(axis=1)) / np.linalg.norm(turned, axis=1)
    assert alike == pytest.approx(1.0, abs=1e-6)


def test_tracks_follow_each_pole_of_a_close_pair_with_one_member_an_order():
    s = fitted(frfs(0.005), np.arange(4, 25))
    tracks = track_poles(s)
    assert len(tracks) == 3
    for track, f, zeta in zip(tracks, F, ZETA, strict=True):
        assert len(np.unique(s.order[track.members])) == len(track.members) >= LEAST_ORDERS
        assert abs(track.frequency - f) < 0.1 * zeta * f
        assert track.zeta == pytest.approx(zeta, rel=0.15)


def test_poles_that_fit_noise_are_unstable_and_dropped():
    """With the lowest coefficient fixed: of noise alone hardly a pole stays."""
    rng = np.random.default_rng(1)
    H = complex_normal(rng, (400, 8, 2))
    orders = np.arange(4, 25)
    s = fitted(FRF.from_arrays(LINES, H), orders)
    assert s.poles.size < 0.05 * orders.sum()  # as many pairs with two inputs
    assert track_poles(s) == ()
