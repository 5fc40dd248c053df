"""The answer that nothing is missing, whatever was measured."""

from benchmarks.open_test.answer import Explanation
from benchmarks.open_test.rivals.common import Said

SOURCE = "none: what a user has who trusts the model"


def solve(case):
    """Return that nothing is missing."""
    return Said((Explanation(1.0, ()),))
