"""Gauss points on the unit interval."""

import numpy as np
from numpy.typing import NDArray


def gauss_points(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return n Gauss points of 0 … 1 and their weights, which sum to 1."""
    x, w = np.polynomial.legendre.leggauss(n)
    return (x + 1) / 2, w / 2
