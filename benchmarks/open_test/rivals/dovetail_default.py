"""Dovetail by FRFs, as `dovetail diagnose` searches."""

from benchmarks.open_test.rivals.common import Said
from benchmarks.open_test.words import explanations_of

SOURCE = "this package"


def solve(case):
    """Return the posterior of a diagnosis."""
    return Said(*explanations_of(case.study.diagnose(case.watch), case.structure))
