"""Evidence of a model by Laplace's approximation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Found:
    """Deviations of common, uncertain size as data have found them, in standard deviations of a trial size.

    Attributes
    ----------
    n : float
        How many of them the data determine: γ = Σ (1 - variance) (MacKay, chapter 27).
    square : float
        Sum of their squares.
    """

    n: float
    square: float

    def log_factor(self, log_off: float, spread: float) -> float:
        """Return the logarithm of the factor that leads to the most probable size.

        That of least γ u + ½ Σ ĝ² e^{-2u} + ½ ((u + log_off)/spread)², by Newton's method.

        Parameters
        ----------
        log_off : float
            Logarithm of the trial size over the prior's median.
        spread : float
            Standard deviation of the size's logarithm beforehand.
        """
        u = 0.0
        for _ in range(20):
            part = self.square * np.exp(-2 * u)
            slope = self.n - part + (u + log_off) / spread**2
            u -= float(np.clip(slope / (2 * part + 1 / spread**2), -1.0, 1.0))
        return u

    def log_evidence(self, log_off: float, spread: float) -> float:
        """Return what the uncertain size adds to the log evidence at a size, by Laplace's approximation."""
        return float(-0.5 * (log_off / spread) ** 2 - 0.5 * np.log(1 + 2 * self.n * spread**2))


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
