"""Dovetail by FRFs with a small budget: a first answer."""

from benchmarks.open_test.rivals.common import Said
from benchmarks.open_test.words import explanations_of

SOURCE = "this package"


def solve(case):
    """Return the posterior of a quick diagnosis."""
    return Said(*explanations_of(case.study.diagnose(case.watch, budget="quick"), case.structure))
