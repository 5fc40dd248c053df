"""Exact modes of true frames: a clamped bar against its closed form, and directions that have no mass."""

import numpy as np
import pytest

from benchmarks.validation.true_modes import _linear_modes, true_modes
from benchmarks.validation.truth import Cut, Member, Reading, TrueFrame, TrueSupport

BETA = np.array([1.8751040687, 4.6940911330, 7.8547574382])
"""Roots of cos β cosh β = -1, of a bar clamped at one end."""


def test_a_clamped_bar_has_the_modes_of_the_closed_form():
    E, rho, side, L = 70e9, 2700.0, 0.002, 0.8
    bar = Member(np.zeros(3), np.array([L, 0.0, 0.0]), side, side, E, 0.3, rho, 0.0)
    frame = TrueFrame({"a": bar}, supports=(TrueSupport("S", Cut("a", 0.0)),))
    unit = side / L**2 * np.sqrt(E / (12 * rho)) / (2 * np.pi)
    tips = [Reading(d, Cut("a", L), np.eye(3)["xyz".index(d)]) for d in "yz"]
    found, shapes = true_modes(frame, tips, 0.5 * unit * BETA[0] ** 2, 1.2 * unit * BETA[-1] ** 2)
    # each twice: about both axes of the square section
    assert found == pytest.approx(np.repeat(BETA, 2) ** 2 * unit, rel=1e-4)
    assert np.linalg.matrix_rank(shapes[:, :2]) == 2


def test_rounding_of_a_mass_that_is_none_stands_in_no_mode_s_way():
    K = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    M = np.diag([1.0, 1.0, -1e-17])
    lam, V = _linear_modes(K, M)
    # without mass the third point follows the second: K is condensed
    expected, _ = np.linalg.eigh(np.array([[2.0, -1.0], [-1.0, 1.0]]))
    assert lam[:2] == pytest.approx(expected, rel=1e-9)
    assert V[2, :2] == pytest.approx(V[1, :2], rel=1e-9)
