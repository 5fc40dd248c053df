"""Generalised Tikhonov regularisation, L-curve and subset selection against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from updating import gsvd, l_curve, select_by_pivoting, select_forward, tikhonov

modest = settings(max_examples=40, derandomize=True, deadline=None)
seeds = st.integers(0, 2**31)


@modest
@given(seeds, st.integers(1, 6), st.integers(0, 4), st.integers(0, 3))
def test_gsvd_gives_both_matrices_back(seed, n, more, fewer):
    rng = np.random.default_rng(seed)
    A, L = rng.standard_normal((n + more, n)), rng.standard_normal((max(1, n - fewer), n))
    G = gsvd(A, L)
    Y = np.linalg.inv(G.X)
    np.testing.assert_allclose(G.U * G.c @ Y, A, atol=1e-9 * np.abs(A).max() * np.linalg.cond(G.X))
    np.testing.assert_allclose(G.V * G.s @ Y, L, atol=1e-9 * np.abs(L).max() * np.linalg.cond(G.X))
    np.testing.assert_allclose(G.c**2 + G.s**2, 1, rtol=1e-12)
    assert (np.diff(G.c) <= 1e-12).all()


@modest
@given(seeds, st.floats(1e-3, 1e3))
def test_tikhonov_solves_its_normal_equations(seed, parameter):
    rng = np.random.default_rng(seed)
    A, b, L = rng.standard_normal((9, 5)), rng.standard_normal(9), rng.standard_normal((4, 5))
    x = tikhonov(A, b, parameter, L)
    normal = A.T @ A + parameter**2 * L.T @ L
    np.testing.assert_allclose(normal @ x, A.T @ b, atol=1e-9 * np.linalg.norm(normal) * np.linalg.norm(x))


def smoothing(n=24):
    """Return a matrix of falling singular values, a smooth truth, and the operator of second differences."""
    t = (np.arange(n) + 0.5) / n
    A = np.exp(-((t[:, None] - t) ** 2) / (2 * 0.05**2)) / n
    truth = np.sin(np.pi * t) + 0.5 * t
    L = np.diff(np.eye(n), 2, axis=0)
    return A, truth, L


def test_the_curvature_is_that_of_the_curve():
    A, truth, L = smoothing()
    b = A @ truth + 1e-3 * np.random.default_rng(1).standard_normal(len(truth))
    curve = l_curve(A, b, L, n=2001)
    p, q, t = np.log(curve.misfit), np.log(curve.size), np.log(curve.parameter)
    d, e = (np.gradient(v, t, edge_order=2) for v in (p, q))
    dd, ee = (np.gradient(v, t, edge_order=2) for v in (d, e))
    numerical = (d * ee - dd * e) / (d**2 + e**2) ** 1.5
    middle = slice(200, -200)
    # differences err by the square of the step in ln λ, which is 0.01 here, times higher derivatives
    scale = np.abs(curve.curvature[middle]).max()
    np.testing.assert_allclose(curve.curvature[middle], numerical[middle], atol=2e-3 * scale)


def test_the_corner_is_nearly_the_best_there_is():
    A, truth, L = smoothing()
    best, chosen, plain = [], [], []
    for seed in range(10):
        b = A @ truth + 1e-3 * np.random.default_rng(seed).standard_normal(len(truth))
        curve = l_curve(A, b, L)
        errors = np.linalg.norm(curve.solutions - truth, axis=1)
        best.append(errors.min())
        chosen.append(errors[curve.corner])
        plain.append(np.linalg.norm(np.linalg.solve(A, b) - truth))
        assert curve.distinct
    assert np.median(chosen) < 3 * np.median(best)
    assert np.median(chosen) < 0.01 * np.median(plain)


def test_what_neither_data_nor_operator_know_is_refused():
    A = np.array([[1.0, 0, 0], [0, 1.0, 0]])
    with pytest.raises(ValueError, match="neither in the data nor in the operator"):
        gsvd(A, np.array([[1.0, -1.0, 0]]))
    with pytest.raises(ValueError, match="A has 3 columns and L 2"):
        gsvd(A, np.eye(2))


def test_pivoting_leaves_out_what_others_do_and_says_which():
    rng = np.random.default_rng(0)
    A = 100 * rng.standard_normal((40, 4))
    A[:, 3] = A[:, 0] - A[:, 1] + 1e-3 * rng.standard_normal(40)
    A[:, 2] *= 1e-4
    chosen = select_by_pivoting(A, ["a", "b", "faint", "both"])
    assert len(chosen.kept) == 2
    reasons = {one.index: one.reason for one in chosen.left_out}
    assert "standard deviations only" in reasons[2]
    (twin,) = set(reasons) - {2}
    assert "does the same as" in reasons[twin]


def test_forward_selection_finds_the_columns_of_which_the_data_are_made():
    rng = np.random.default_rng(3)
    A = 20 * rng.standard_normal((60, 12))
    b = A[:, 4] * 0.9 - A[:, 7] * 0.5 + rng.standard_normal(60)
    chosen = select_forward(A, b)
    assert set(chosen.kept) == {4, 7}
    assert all("explains nothing" in one.reason for one in chosen.left_out)
