"""How far mode shapes are from real ones, and the real shape nearest to a complex one."""

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Complexes, Floats

LEAST_MPC, LARGEST_MPD = 0.3, 45.0
"""Shapes that are identified are no less collinear [-], and no farther from real ones [degrees], unless the
caller says so."""


def modal_phase_collinearity(shapes: ArrayLike) -> Floats:
    """Compute the modal phase collinearity |φᵀφ|² / (φᴴφ)² of each shape: 1 for real ones.

    Pappa, Elliott and Schenk, *J. Guidance Control Dyn.* 16, 1993, 852, with the variances about zero:
    [(S_xx - S_yy)² + 4 S_xy²] / (S_xx + S_yy)² of real and imaginary parts.

    Parameters
    ----------
    shapes : array_like (n_dof, n_modes)
        Real or complex; one shape may be a vector.

    Returns
    -------
    ndarray (n_modes,)
        0 to 1 [-]; 0 for a shape that is zero.
    """
    phi = _unit(shapes)
    size = (np.abs(phi) ** 2).sum(axis=0)
    return np.minimum(_over(np.abs((phi**2).sum(axis=0)) ** 2, size**2), 1.0)


def mean_phase_deviation(shapes: ArrayLike) -> Floats:
    """Compute the mean angle between the entries of each shape and its mean phase, weighted by their size.

    Heylen, Lammens and Sas, *Modal Analysis Theory and Testing*, 1998. The mean phase is that of the line
    through zero from which the entries deviate least.

    Parameters
    ----------
    shapes : array_like (n_dof, n_modes)

    Returns
    -------
    ndarray (n_modes,)
        0 for real shapes to 90 [degrees].
    """
    turned = _unit(shapes) * np.exp(-1j * mean_phase(shapes))
    size = np.abs(turned)
    angle = np.arctan2(np.abs(turned.imag), np.abs(turned.real))
    return np.minimum(np.rad2deg(_over((size * angle).sum(axis=0), size.sum(axis=0))), 90.0)


def modal_complexity_factor(shapes: ArrayLike) -> Floats:
    """Compute the area that each shape's entries and their negatives enclose in the complex plane.

    It is divided by the area of the circle about zero through the largest entry: the second modal complexity
    factor of Imregun and Ewins, IMAC XIII, 1995. Negatives are added because a sensor's sign is arbitrary.

    Parameters
    ----------
    shapes : array_like (n_dof, n_modes)

    Returns
    -------
    ndarray (n_modes,)
        0 for real shapes to 1 [-].
    """
    phi = _unit(shapes)
    largest = np.abs(phi).max(axis=0, initial=0.0)
    area = np.array([_hull_area(np.concatenate([column, -column])) for column in phi.T])
    return _over(area, np.pi * largest**2)


def mean_phase(shapes: ArrayLike) -> Floats:
    """Return the phase of the line through zero nearest to each shape, half that of φᵀφ [rad]."""
    return np.angle((_unit(shapes) ** 2).sum(axis=0)) / 2


def real_shapes(shapes: ArrayLike) -> Floats:
    """Turn each shape by its mean phase and return the real part, the largest entry positive.

    Parameters
    ----------
    shapes : array_like (n_dof, n_modes)

    Returns
    -------
    ndarray (n_dof, n_modes)
        Of the unit of ``shapes``.
    """
    real = (_columns(shapes) * np.exp(-1j * mean_phase(shapes))).real
    if not real.size:
        return real
    sign = np.sign(real[np.argmax(np.abs(real), axis=0), np.arange(real.shape[1])])
    return real * np.where(sign == 0, 1.0, sign)


def _columns(shapes: ArrayLike) -> Complexes:
    phi = np.asarray(shapes, dtype=complex)
    phi = phi[:, None] if phi.ndim == 1 else phi
    if phi.ndim != 2 or not np.isfinite(phi).all():
        msg = f"shapes have the shape {phi.shape}; finite numbers (n_dof, n_modes) are expected"
        raise ValueError(msg)
    return phi


def _unit(shapes: ArrayLike) -> Complexes:
    """Return shapes with a largest entry of size 1, so that squares keep their digits."""
    phi = _columns(shapes)
    largest = np.maximum(np.abs(phi.real), np.abs(phi.imag)).max(axis=0, initial=0.0)
    return phi / np.where(largest > 1e-300, largest, 1.0)


def _over(a: Floats, b: Floats) -> Floats:
    return np.divide(a, b, out=np.zeros(a.shape), where=b > 0)


def _hull_area(points: Complexes) -> float:
    """Return the area of the convex hull, by chains of right and of left turns."""
    order = np.lexsort([points.imag, points.real])
    chains: list[complex] = []
    for rows in (order, order[::-1]):
        chain: list[complex] = []
        for z in points[rows].tolist():
            while len(chain) > 1 and ((chain[-1] - chain[-2]).conjugate() * (z - chain[-1])).imag <= 0:
                chain.pop()
            chain.append(z)
        chains += chain[:-1]
    hull: Complexes = np.array(chains, dtype=complex)
    return float(abs((hull.conj() * np.roll(hull, -1)).imag.sum()) / 2)
