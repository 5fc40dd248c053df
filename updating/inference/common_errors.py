"""Errors that residuals have in common, because a few uncertain numbers act on all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.array_types import Complexes, Floats
from fem.reduction.reduced_model import ReducedModel
from fem.reduction.terms import ReducedTerm


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


# What a calibrated model misses of one state's modes, carried to another state as a change of its matrices
# With modes φ_r of the calibrated model, φᵀMφ = 1, the measured modes of that state are the model's with
#
#     K + Σ_r Δ_r Mφ_r φ_rᵀM,   D + Σ_r ε_r Mφ_r φ_rᵀM,   y = Cx + Σ_r d_r φ_rᵀM x:
#
# eigenvalues λ_r + Δ_r, losses 2 ζ_r λ_r + ε_r, and shapes Cφ_r + d_r at the sensors. In another state each
# mode is a mixture of these, and takes as much of each deviation as it has of the mode.


@dataclass(frozen=True, slots=True, eq=False)
class CarriedModes:
    """Deviations of modes, as changes of matrices and of what sensors read.

    Attributes
    ----------
    forces : ndarray (n_dof, n)
        Mφ_r of each mode [kg^½].
    stiffness : ndarray (n,)
        Δ_r [rad²/s²].
    loss : ndarray (n,)
        ε_r [rad²/s²].
    shapes : ndarray (n_out, n)
        d_r [kg^-½]; no rows where the sensors are others.
    """

    forces: Floats
    stiffness: Floats
    loss: Floats
    shapes: Floats

    def term(self, reduced: ReducedModel) -> ReducedTerm:
        """Return the changes of the matrices of a reduced model."""
        K, D = np.diag(self.stiffness), np.diag(self.loss)
        return ReducedTerm(self._along(reduced).T, K, None, None, D)

    def outputs(self, reduced: ReducedModel) -> Floats:
        """Return what the sensors read besides, as combinations of the basis's columns (r + p, n_out)."""
        return self._along(reduced) @ self.shapes.T

    def _along(self, reduced: ReducedModel) -> Floats:
        return reduced.projected(self, lambda: self.forces)[1]
