"""sdypy-EMA on the same FRFs: the modes that stand alone agree, and of a close pair it finds one."""

import numpy as np
import pytest

from benchmarks.modal_identification import FREQUENCY, RATIO, measured, sdypy
from updating import identify_modes

pytestmark = [pytest.mark.peer, pytest.mark.slow]


def test_separate_modes_agree_and_the_pair_is_merged_there():
    """Twelve modes within 1 % of their half-widths, and their ratios within 1 %, at noise of 0.1 %.

    88.0 and 89.2 Hz are 1.2 Hz, a bandwidth (2ζf), apart, and the least squares of single references takes
    them for one: both of the true frequencies lead to the same pole.
    """
    data, _ = measured(1e-3, np.random.default_rng(0))
    ours, theirs = identify_modes(data).modes, sdypy(data, 60)
    pair = [7, 8]
    assert ours.frequency[pair] == pytest.approx(FREQUENCY[pair], rel=1e-6)
    assert theirs["frequency"][7] == theirs["frequency"][8]
    assert 88.0 < theirs["frequency"][7] < 89.2
    alone = np.setdiff1d(np.arange(14), pair)
    off = np.abs(theirs["frequency"] - ours.frequency) / (RATIO * FREQUENCY)
    assert off[alone].max() < 0.01
    assert ours.zeta is not None
    assert np.abs(theirs["ratio"] / ours.zeta - 1)[alone].max() < 0.01
