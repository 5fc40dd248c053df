"""Quantiles of samples with their standard errors, whatever the distribution."""

from dataclasses import dataclass

import numpy as np

from fem.array_types import Floats

PROBABILITIES = (0.05, 0.5, 0.95)
"""Quantiles that make a band: 5 %, the median and 95 %."""


@dataclass(frozen=True, slots=True, eq=False)
class Quantiles:
    """Quantiles at ``PROBABILITIES``.

    Attributes
    ----------
    value, error : ndarray (3, ...)
        Quantiles and their standard errors; the errors are infinite where there are too few samples.
    """

    value: Floats
    error: Floats

    @property
    def width(self) -> Floats:
        """Distance from the 5 % to the 95 % quantile."""
        return self.value[2] - self.value[0]


def quantiles(samples: Floats) -> Quantiles:
    """Return quantiles over the first axis, and half the distance of the order statistics about each.

    The number of n samples below the quantile of probability p is binomial, n p ± √(n p (1 - p)). The values
    at these two ranks are one standard error either side of it (David and Nagaraja, *Order Statistics*, 2003,
    section 7.1).

    Parameters
    ----------
    samples : ndarray (n, ...)
    """
    n, p = len(samples), np.array(PROBABILITIES)
    spread = np.sqrt(p * (1 - p) / n)
    at = np.concatenate([p, np.clip(p - spread, 0, 1), np.clip(p + spread, 0, 1)])
    value, below, above = np.split(np.quantile(samples, at, axis=0), 3)
    known = ((p - spread) * n >= 1) & ((p + spread) * n <= n - 1)
    error = (above - below) / 2
    error[~known] = np.inf
    return Quantiles(value, error)
