"""Evidence of a model by Laplace's approximation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


SIZE_STEPS = 20
"""Iterations for the sizes of groups."""


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """A normal posterior whose unknowns have, in groups, prior deviations of uncertain size.

    Attributes
    ----------
    deviation : ndarray (n,)
        Most probable unknowns less their prior means.
    curvature : ndarray (n, n)
        Second derivatives of the negative log posterior.
    groups : tuple of ndarray of int
        Rows of each group; their prior deviations are 1 at the trial sizes.
    """

    deviation: Floats
    curvature: Floats
    groups: tuple[NDArray[np.int64], ...]

    def log_factors(self, log_off: Floats, spread: float) -> Floats:
        """Return the logarithms of the factors that lead from trial sizes to the most probable ones.

        Those of the greatest evidence, by MacKay's iteration (Information Theory, 2003, chapter 27): with
        γ = Σ (1 - variance) the number of deviations that the data determine, γ u + ½ Σ ĝ² e^{-2u} and the
        sizes' prior are least.

        Parameters
        ----------
        log_off : ndarray (n_groups,)
            Logarithms of the trial sizes over the prior's medians.
        spread : float
            Standard deviation of the sizes' logarithms beforehand.
        """
        u, b = np.zeros(len(self.groups)), self.curvature @ self.deviation
        for _ in range(SIZE_STEPS):
            A = self.curvature.copy()
            for k, rows in enumerate(self.groups):
                A[rows, rows] += np.exp(-2 * u[k]) - 1
            inverse = np.linalg.inv(A)
            x = inverse @ b
            for k, rows in enumerate(self.groups):
                known = len(rows) - float(np.exp(-2 * u[k]) * inverse[rows, rows].sum())
                part = float((x[rows] ** 2).sum() * np.exp(-2 * u[k]))
                slope = known - part + (u[k] + log_off[k]) / spread**2
                u[k] -= np.clip(slope / (2 * part + 1 / spread**2), -1.0, 1.0)
        return u

    def log_evidence(self, log_off: Floats, spread: float) -> float:
        """Return what uncertain sizes add to the log evidence at trial sizes, by Laplace's approximation."""
        inverse = np.linalg.inv(self.curvature)
        known = np.array([len(rows) - inverse[rows, rows].sum() for rows in self.groups])
        prior = -0.5 * (log_off / spread) ** 2 - 0.5 * np.log(1 + 2 * known * spread**2)
        return float(prior.sum())


def log_evidence(log_likelihood: float, deviation: Floats, std: Floats, curvature: Floats) -> float:
    """Return ln p(data) of a model by Laplace's approximation.

    ln p(data | ẑ) - ½ Σ ((ẑ - mean)/std)² - Σ ln std - ½ ln det A, with independent normal priors and A the
    second derivatives of the negative log posterior (MacKay, Information Theory, 2003, chapter 27).

    Parameters
    ----------
    log_likelihood : float
        At the most probable unknowns ẑ.
    deviation : ndarray (n,)
        ẑ - mean.
    std : ndarray (n,)
    curvature : ndarray (n, n)
        A.
    """
    prior = -0.5 * float(((deviation / std) ** 2).sum()) - float(np.log(std).sum())
    return log_likelihood + prior - 0.5 * float(np.linalg.slogdet(curvature)[1])
