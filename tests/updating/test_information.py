"""What data to come tell: least squares beyond unknowns, and gains that are to be expected."""

from functools import reduce
from operator import add

import numpy as np
import pytest

from updating.forecast import ExpectedGains, Information, without
from updating.least_squares.costs import Levels


@pytest.fixture(scope="module")
def slopes():
    """Return what three unknowns and two changes do to 40 residuals of two groups, and the precision."""
    rng = np.random.default_rng(3)
    rows, group = rng.standard_normal((5, 40)), np.arange(40) % 2
    return rows, group, np.diag([1.0, 4.0, 0.5])


def information_of(rows, group, n=2):
    return Information.of([rows[:, group == g] for g in (0, 1)], 3, n)


def test_changes_beyond_unknowns_are_the_residuals_of_regularised_least_squares(slopes):
    rows, group, known = slopes
    A = np.vstack([rows[:3].T, np.sqrt(known)])
    found = information_of(rows, group).beyond(known)
    for k in range(2):
        y, *_ = np.linalg.lstsq(A, np.append(rows[3 + k], np.zeros(3)), rcond=None)
        rest = rows[3 + k] - y @ rows[:3]
        assert found.squares[k] == pytest.approx([(rest[group == g] ** 2).sum() for g in (0, 1)])
        assert found.known[k] == pytest.approx(0.5 * y @ known @ y)
        assert found.lengths[k] == pytest.approx((rest**2).sum() + y @ known @ y)
    assert np.diag(found.cosines_squared) == pytest.approx([1.0, 1.0])


def test_unknowns_of_one_test_alone_can_be_taken_out_first(slopes):
    rows, group, known = slopes
    at_once = information_of(rows, group, 1).beyond(known)
    rest = without(rows @ rows.T, known[:1, :1])
    later = Information.of_matrix(rest, 2, 1).beyond(known[1:, 1:])
    assert later.lengths == pytest.approx(at_once.lengths)
    assert later.cosines_squared == pytest.approx(at_once.cosines_squared)


def test_information_of_several_data_adds_up(slopes):
    rows, group, known = slopes
    parts = (information_of(rows[:, s], group[s]) for s in (slice(0, 16), slice(16, 40)))
    total, found = information_of(rows, group).beyond(known), reduce(add, parts).beyond(known)
    for name in ("squares", "known", "products", "lengths"):
        assert getattr(found, name) == pytest.approx(getattr(total, name))


def test_small_changes_gain_half_their_squares_and_large_ones_the_logarithm():
    n, least = np.array([20.0, 8.0]), np.array([1e-3, 4e-3])
    left = ExpectedGains(Levels(n, least, np.zeros(2)), np.zeros(2))
    squares, known = np.array([[1e-3, 2e-3]]), np.array([0.3])
    a = 1e-3
    small = left.gains(np.array([a]), squares, known)[0]
    assert small == pytest.approx(a**2 * (0.5 * (n * squares[0] / least).sum() + 0.3), rel=1e-5)
    large = left.gains(np.array([50.0]), squares, known)[0]
    assert large == pytest.approx(0.5 * (n * np.log1p(2500 * squares[0] / least)).sum() + 2500 * 0.3)


@pytest.mark.parametrize("wanted", [0.1, 5.0, 300.0])
def test_least_multiples_gain_what_is_wanted(wanted):
    left = ExpectedGains(Levels(np.array([20.0]), np.array([1e-3]), np.array([2e-4])), np.array([1e-4]))
    squares, known = np.array([[1e-3], [4e-3], [0.0]]), np.array([0.0, 0.1, 0.0])
    a = left.multiples(squares, known, np.full(3, wanted))
    reached = np.isfinite(a)
    assert not reached[2]
    assert reached[:2].any()
    gains = left.gains(np.where(reached, a, 1.0), squares, known)
    assert gains[reached] == pytest.approx(wanted, rel=1e-5)
