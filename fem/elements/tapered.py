"""Beams whose section changes along them, from the section's constants at a few stations.

Forces at its ends load a beam with constant N, T and V and a linear M, for any section. The strains
follow from the local flexibility, and displacements from integrating these once or twice:

    θ(x) = ∫₀ˣ M / EI ds,   v(x) = ∫₀ˣ (x - s) M / EI ds + ∫₀ˣ V / kGA ds.

This is the flexibility method (Przemieniecki, Theory of Matrix Structural Analysis, ch. 8): exact in statics,
with shape functions that hold the taper. Integrands are polynomials through Gauss points.

Flexibilities are those of E = 1: moduli are factors, also of differences of moduli, which may be zero.
Lengths are L, places fractions x of them; arrays are (…, b) with b beams, sections (b, N_STATIONS).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Floats

Array = NDArray[Any]

N_STATIONS = 12
"""Gauss points of a beam at which its section is known."""

N_KNOTS = 17
"""Chebyshev points of a member between which its section's constants are interpolated."""

STATIONS, WEIGHTS = (part / 2 for part in np.polynomial.legendre.leggauss(N_STATIONS))
STATIONS = STATIONS + 0.5

KNOTS = (1 - np.cos(np.pi * np.arange(N_KNOTS) / (N_KNOTS - 1))) / 2


def _lagrange() -> Floats:
    """Return the coefficients of the polynomials that are 1 at one station, in Legendre's, (q, q)."""
    k = np.arange(N_STATIONS)
    values = np.polynomial.legendre.legvander(2 * STATIONS - 1, N_STATIONS - 1)
    return np.asarray((2 * k + 1)[:, None] * (values * WEIGHTS[:, None]).T)


def _integrated(coefficients: Floats) -> Floats:
    """Return the coefficients of the integrals from 0 on; x = (t + 1) / 2."""
    return np.array(np.polynomial.legendre.legint(coefficients, lbnd=-1, scl=0.5, axis=0), dtype=np.float64)


_SERIES = [_lagrange()]
_SERIES += [_integrated(_SERIES[0])]
_SERIES += [_integrated(_SERIES[1])]


def weights_at(x: Array, integrated: int = 0) -> Array:
    """Return the weights, (…, N_STATIONS), of a function's values at the stations.

    They give its value at x, its integral from 0 to x, or that of the integral.
    """
    series = _SERIES[integrated]
    terms = np.polynomial.legendre.legvander(2 * x - 1, len(series) - 1)
    # not @: BLAS rounds by the number of beams, and an element must not depend on those formed with it
    out: Array = np.einsum("...k,kj->...j", terms, series)
    return out


def between_knots(x: Floats) -> Floats:
    """Return the weights, (…, N_KNOTS), of values at the knots that give a function at fractions x.

    Barycentric interpolation: Berrut & Trefethen, SIAM Review 46 (2004) 501-517.
    """
    sign = (-1.0) ** np.arange(N_KNOTS)
    sign[[0, -1]] /= 2
    away = x[..., None] - KNOTS
    hit = np.abs(away) < 1e-14
    share = sign / np.where(hit, 1.0, away)
    share = np.where(hit.any(axis=-1, keepdims=True), hit.astype(float), share)
    return share / share.sum(axis=-1, keepdims=True)


def extension(x: Array, area: Array, derivative: bool = False) -> Array:
    """Return the part of the second end's motion along (or about) the axis that a place has, (…, b).

    ``area`` is A or J at the stations; ``derivative`` by x.
    """
    total = (WEIGHTS / area).sum(axis=-1)
    if derivative:
        return 1 / ((weights_at(x) * area).sum(axis=-1) * total)
    out: Array = (weights_at(x, 1) / area).sum(axis=-1) / total
    return out


def bending(x: Array, L: Array, I: Array, shear: Array, wanted: str) -> list[Array]:
    """Return shape functions for the ends' motion (v1, θ1, v2, θ2), each (…, b, 4).

    ``wanted`` has a letter for each: v deflection, r rotation, c curvature, s slope.

    Parameters
    ----------
    x : ndarray (…, b)
        Fractions of the length [-].
    L : ndarray (b,)
    I, shear : ndarray (b, N_STATIONS)
        Second moment, and shear flexibility 1/(kGA) for E = 1.
    wanted : str
        Letters.
    """
    arm = L[:, None] * (1 - STATIONS)
    length = np.broadcast_to(L, x.shape)
    one = weights_at(x, 1) * length[..., None]

    def of(which: str) -> Array:
        """Return the same of the cantilever under a unit force and a unit moment at the second end."""
        if which == "v":
            two = weights_at(x, 2) * length[..., None] ** 2
            return _pair((two * arm / I).sum(-1) + (one * shear).sum(-1), (two / I).sum(-1))
        if which == "r":
            return _pair((one * arm / I).sum(-1), (one / I).sum(-1))
        if which == "c":
            here = 1 / (weights_at(x) * I).sum(-1)
            return _pair(length * (1 - x) * here, here)
        strain = (weights_at(x) * shear).sum(-1)
        return of("r") + _pair(strain, np.zeros_like(strain))

    centre, across, turning = centre_flexibility(L, I, shear)
    force, moment = np.moveaxis(_motions(L, centre) / _pair(across, turning)[..., None], 1, 0)
    forces = np.stack([force, moment - force * (L - centre)[:, None]], axis=-2)
    zero, ones = np.zeros(x.shape), np.ones(x.shape)
    rigid = {
        "v": [ones, x * length, zero, zero],
        "r": [zero, ones, zero, zero],
        "s": [zero, ones, zero, zero],
        "c": [zero] * 4,
    }
    return [np.stack(rigid[w], axis=-1) + (of(w)[..., None, :] @ forces)[..., 0, :] for w in wanted]


def end_flexibility(
    L: Array, I: Array, shear: Array, lo: Array | float = 0.0, hi: Array | float = 1.0
) -> Array:
    """Return the motion (v, θ) of the second ends by unit forces there, (b, 2, 2), from x = lo … hi alone."""
    lo, hi = np.broadcast_to(lo, L.shape), np.broadcast_to(hi, L.shape)
    ds = (weights_at(hi, 1) - weights_at(lo, 1)) * L[:, None]
    arm = L[:, None] * (1 - STATIONS)
    mixed = (ds * arm / I).sum(-1)
    first = _pair((ds * (arm**2 / I + shear)).sum(-1), mixed)
    return np.stack([first, _pair(mixed, (ds / I).sum(-1))], axis=-2)


def _pair(a: Array, b: Array) -> Array:
    return np.stack([a, b], axis=-1)


def centre_flexibility(L: Array, I: Array, shear: Array) -> tuple[Array, Array, Array]:
    """Return the elastic centre's distance from the first end, and flexibilities there, each (b,).

    A force through the centre does not turn the ends against one another, so that the second end moves by
    the force times the first flexibility and turns by the moment times the other one.
    """
    turning = (WEIGHTS / I).sum(-1)
    fraction = (WEIGHTS * STATIONS / I).sum(-1) / turning
    arm = STATIONS - fraction[:, None]
    across = L**3 * (WEIGHTS * arm**2 / I).sum(-1) + L * (WEIGHTS * shear).sum(-1)
    return L * fraction, across, L * turning


def bending_stiffness(L: Array, I: Array, shear: Array) -> Array:
    """Return the stiffness for (v1, θ1, v2, θ2), E = 1, shape (b, 4, 4)."""
    centre, across, turning = centre_flexibility(L, I, shear)
    motions = _motions(L, centre)
    out: Array = np.swapaxes(motions, 1, 2) @ (motions / _pair(across, turning)[..., None])
    return (out + np.swapaxes(out, 1, 2)) / 2


def _motions(L: Array, centre: Array) -> Array:
    """Return displacement and rotation of the second end relative to the first, at the centre, (b, 2, 4)."""
    out = np.zeros((len(L), 2, 4), dtype=centre.dtype)
    out[:, 0] = np.stack([-np.ones_like(centre), -centre, np.ones_like(centre), centre - L], axis=-1)
    out[:, 1, 1], out[:, 1, 3] = -1.0, 1.0
    return out
