"""Errors that residuals have in common, because a few uncertain numbers act on all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.array_types import Complexes, Floats


@dataclass(frozen=True, slots=True, eq=False)
class CommonErrors:
    """Makes residuals independent of one another that have errors in common.

    Residuals with standard deviations σ_i and the errors Σ_k ξ_k S_ki in common, ξ ~ N(0, 1), have the
    covariance D (1 + U Uᵀ) D with D = diag(σ) and U = D⁻¹ Sᵀ. D (1 + U Uᵀ)^-½ D⁻¹ makes them independent,
    with the same standard deviations. Real and imaginary parts are separate residuals.

    Attributes
    ----------
    std : ndarray (2 m,)
        σ of real parts, and of imaginary ones behind them.
    directions : ndarray (2 m, k)
        Left singular vectors of U.
    less : ndarray (k,)
        1 - (1 + s²)^-½ of its singular values s [-].
    """

    std: Floats
    directions: Floats
    less: Floats

    @classmethod
    def of(cls, std: Floats, errors: Complexes) -> CommonErrors:
        """Make it of standard deviations (m,) and of what each uncertain number does, (k, m)."""
        both = np.tile(std, 2)
        U, s, _ = np.linalg.svd((_parts(errors) / both).T, full_matrices=False)
        return cls(both, U, 1 - 1 / np.sqrt(1 + s**2))

    @property
    def log_density(self) -> float:
        """Logarithm of the determinant of the map: by so much densities of what it maps are higher."""
        return float(np.log1p(-self.less).sum())

    def removed(self, r: Complexes) -> Complexes:
        """Return residuals, or changes of them, (..., m), made independent."""
        plain = _parts(r) / self.std
        plain = (plain - ((plain @ self.directions) * self.less) @ self.directions.T) * self.std
        real, imag = np.split(plain, 2, axis=-1)
        return real + 1j * imag


def _parts(r: Complexes) -> Floats:
    """Return real parts, and imaginary ones behind them."""
    return np.concatenate([np.real(r), np.imag(r)], axis=-1)
