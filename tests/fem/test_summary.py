"""Short texts of names and numbers."""

import pytest

from fem.summary import did_you_mean, nearest


@pytest.mark.parametrize(
    ("word", "known", "found"),
    [
        ("e", ["E", "rho"], ["E"]),
        ("FRF.UFF", ["modes.uff", "frf.uff"], ["frf.uff"]),
        ("masss", ["points", "mass"], ["mass"]),
        ("x", ["points"], []),
        ("x", [], []),
    ],
)
def test_the_nearest_word_is_found_capitals_or_not(word, known, found):
    assert nearest(word, known) == found
    assert did_you_mean(word, known) == "".join(f"did you mean '{one}'?" for one in found)
