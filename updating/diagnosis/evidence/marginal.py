"""Evidence of a model by Laplace's approximation."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


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
