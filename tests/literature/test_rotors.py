"""Rotors of the benchmark book: directions of whirl, convergence, and branches of the Campbell diagram."""

import numpy as np
import pytest

from benchmarks.book.rotors import TWO_DISCS, at_4000, rotor
from fem import solve_campbell


@pytest.mark.parametrize("kz", [1e6, 0.8e6])
def test_backward_and_forward_whirl_alternate(kz):
    sense = at_4000(kz)[1]
    assert "".join("F" if w > 0 else "B" for w in sense) == "BFBFBF"
    if kz == 1e6:
        np.testing.assert_allclose(abs(sense), 1.0, atol=1e-9)


@pytest.mark.parametrize("discs", [{1.0: 0.28, 1.5: 0.35}, {1.25: 0.28, 2.5: 0.35}])
def test_at_a_critical_speed_a_frequency_is_the_speed(discs):
    found = solve_campbell(rotor(10, discs, (0.5, 2.0)), np.linspace(0, 300, 7), 8)
    assert found.converged
    for c in found.critical:
        assert c.pole.imag == pytest.approx(c.speed, rel=1e-8)


def test_branches_keep_their_whirl_where_they_cross():
    """Of equal bearings forward and backward modes cross; 8 speeds are as good as 57 to follow them."""
    model = rotor(6, TWO_DISCS, (0.0, 1.5))
    fine, coarse = (solve_campbell(model, np.linspace(0, 2000, n), 8) for n in (57, 8))
    assert (np.diff(fine.frequency, axis=1) < 0).any(), "none cross"
    for k in range(8):
        known = fine.whirl[1:, k][np.isfinite(fine.whirl[1:, k])]
        assert known.size == 0 or (np.sign(known) == np.sign(known[0])).all()
    assert fine.likeness[1:, :8].min() > 0.9
    np.testing.assert_allclose(fine.frequency[8::8, :8], coarse.frequency[1:, :8], rtol=1e-9)
