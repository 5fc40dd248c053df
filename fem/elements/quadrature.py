"""Gauss points on the unit interval."""

from functools import cache

import numpy as np

from fem.array_types import Floats


@cache
def gauss_points(n: int) -> tuple[Floats, Floats]:
    """Return n Gauss points of 0 … 1 and their weights, which sum to 1."""
    x, w = np.polynomial.legendre.leggauss(n)
    points, weights = (x + 1) / 2, w / 2
    points.flags.writeable = weights.flags.writeable = False  # all callers share them
    return points, weights
