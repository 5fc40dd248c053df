"""The answer of somebody who has not looked at the data."""

from benchmarks.open_test.rivals.common import Said

SOURCE = "none: what is known before a test"


def solve(case):
    """Return no explanation."""
    return Said()
