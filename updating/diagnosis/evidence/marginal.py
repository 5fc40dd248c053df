"""Gaussian likelihoods with low-rank errors: the algebra, without any mechanics."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Complexes = NDArray[np.complex128]
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class LowRank:
    """Complex residuals in groups, each with independent noise and errors of a few shapes.

    r_g = e_g + G_g ρ_g with e ~ N(0, σ²) and ρ ~ N(0, s²) in the real and in the imaginary part. The
    covariance of a group is C = diag(σ²) + s² G Gᴴ, which is never formed (Woodbury's identity).

    Attributes
    ----------
    G : ndarray (n_groups, m, k)
        Shapes over their noise, G/σ.
    s : float
        Standard deviation of their amounts.
    M : ndarray (n_groups, k, k)
        I + s² Gᴴ G.
    """

    G: Complexes
    s: float
    M: Complexes

    @classmethod
    def of(cls, G: Complexes, s: float) -> "LowRank":
        """Return it for shapes that are divided by their noise already."""
        GH = G.conj().transpose(0, 2, 1)
        return cls(G, s, np.eye(G.shape[2]) + s**2 * (GH @ G))

    def solved(self, X: Complexes) -> Complexes:
        """Return C⁻¹ X of columns X (n_groups, m, n), divided by the noise as the shapes are."""
        return X - self.s * (self.G @ self.amounts(X))

    def amounts(self, X: Complexes) -> Any:
        """Return the most probable ρ / s of residuals X (n_groups, m, n), (n_groups, k, n)."""
        return self.s * np.linalg.solve(self.M, self.G.conj().transpose(0, 2, 1) @ X)

    @property
    def log_det(self) -> float:
        """Σ ln det C over all groups, without that of the noise."""
        return float(np.linalg.slogdet(self.M)[1].sum())

    def certain(self) -> float:
        """Return how many of the amounts the residuals determine, the sum over all groups."""
        n, k = self.M.shape[:2]
        return float(n * k - np.linalg.inv(self.M).trace(axis1=1, axis2=2).real.sum())

    def variance(self) -> Floats:
        """Return the variance of each value of G ρ that is left, (n_groups, m), over that of the noise."""
        inverse = np.linalg.inv(self.M)
        return self.s**2 * np.einsum("gmk,gkl,gml->gm", self.G, inverse, self.G.conj(), optimize=True).real


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


def scale_from(squares: float, certain: float, scale: float, typical: float) -> float:
    """Return the standard deviation of errors that their estimates make most probable.

    A step of the fixed point s² = Σ x̂² / (γ + s²/S²) with γ of them certain (MacKay, *Neural Computation* 4,
    1992, 415) and a half-normal prior of s, of width S = ``typical``.

    Parameters
    ----------
    squares : float
        Σ x̂².
    certain : float
        γ.
    scale : float
        s of the step before.
    typical : float
    """
    return float(np.sqrt(max(squares, 1e-30) / (max(certain, 1e-12) + (scale / typical) ** 2)))
