"""How noisy measured FRFs are, estimated from the data alone."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Complexes, Floats

MEDIAN_OF_SQUARE = 2 * np.log(2)
"""Median of |z|², where real and imaginary part of z are standard normal variables."""


WHITE = 1.6
"""Fourth and sixth differences of white noise have the same mean square within this factor."""

SMALLEST = 8
"""At least so many lines show the noise that is added to the response; five in a hundred of many."""

_STENCILS = {4: (1.0, -4.0, 6.0, -4.0, 1.0), 6: (1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0)}


def relative_noise(H: Complexes, window: int = 31) -> Floats:
    """Estimate the relative noise of the amplitude at each line.

    Two kinds of noise are told apart. One is proportional to the response: an FRF is smooth between its
    resonances, so fourth differences of ln H over neighbouring lines are noise; their median size over a
    window does not see the few lines at resonances and antiresonances. The other is added to it, the same at
    all lines of an FRF: it shows where the response is small, in fourth and sixth differences of H itself,
    which crosses zero smoothly at an antiresonance.

    Parameters
    ----------
    H : ndarray (n_freq, n_out, n_in)
        In the kind that was measured, in which the added noise is the same at all lines.
    window : int
        Number of lines.

    Returns
    -------
    ndarray (n_freq, n_out, n_in)
        Standard deviation of ln|H| [-], taken to be that of the phase as well; infinite where H is 0 but not
        noiseless.
    """
    n_freq = H.shape[0]
    if n_freq < 9:
        return np.full(H.shape, 0.01)
    size = np.abs(H)
    logarithm = np.log(np.maximum(size, 1e-300)) + 1j * np.unwrap(np.angle(H), axis=0)
    half = min(window, n_freq) // 2
    centres = np.arange(0, n_freq, max(1, half // 2))

    def smoothed(x: Floats) -> Floats:
        level = np.stack([np.median(x[max(0, c - half) : c + half + 1], axis=0) for c in centres])
        flat = level.reshape(len(centres), -1)
        lines = np.arange(n_freq)
        return np.stack([np.interp(lines, centres, column) for column in flat.T], axis=1).reshape(H.shape)

    seen = smoothed(np.abs(_difference(logarithm, 4)) ** 2) / MEDIAN_OF_SQUARE
    # Where all of a window is small, the scatter there is the added noise: the proportional one is taken to
    # be no more than usual.
    excess = _added(H, np.minimum(seen, np.median(seen, axis=0)) * size**2)
    excess = np.broadcast_to(excess, H.shape)
    added = np.divide(excess, size**2, out=np.where(excess > 0, np.inf, 0.0), where=size > 0)
    # At the lines where the window's median lies, the two together are the scatter there.
    return np.sqrt(np.maximum(seen - smoothed(added), 0.0) + added)


def amplitude_noise(H: Complexes) -> Floats:
    """Estimate the relative noise of amplitudes without phase as :func:`relative_noise`, from one part."""
    # Median of the square of a standard normal variable
    return relative_noise(H) * float(np.sqrt(MEDIAN_OF_SQUARE / 0.45494))


def _added(H: Complexes, proportional: Floats) -> Floats:
    """Return the variance (n_out, n_in) of the added noise, in addition to the proportional one.

    It is that of the smallest lines, if they are white: differences of both orders of white noise have the
    same size, but not differences of a coarsely sampled FRF. They are made fewer until they have more of it
    than of the other. Where they are not white it is the added noise of the other sensors at the same
    excitation, if most of them show it, but no more than the lines allow that differ least from their
    neighbours, as it is the same at all.
    """
    size = np.abs(H)
    # Where it is exactly 0, nothing was measured.
    smallest = np.argsort(np.where(size > 0, size, np.inf), axis=0)
    differences = [np.abs(_difference(H, order)) ** 2 / MEDIAN_OF_SQUARE for order in (4, 6)]
    added = np.zeros(H.shape[1:])
    seen = open_ = np.ones(added.shape, dtype=bool)
    first = n = max(SMALLEST, len(H) // 20)
    while n >= SMALLEST:
        lines = smallest[:n]
        fourth, sixth, part = (
            np.median(np.take_along_axis(x, lines, axis=0), axis=0) for x in (*differences, proportional)
        )
        excess = np.maximum(fourth - part, 0.0)
        white = open_ & (sixth < WHITE * fourth) & (fourth < WHITE * sixth)
        added = np.where(white, excess, added)
        seen = white if n == first else seen
        open_ = open_ & seen & ~(white & (fourth > 2 * part))
        n //= 2
    # A tenth of |z|² of normal variables lies below -2 ln 0.9.
    most = np.quantile(differences[0], 0.1, axis=0) * MEDIAN_OF_SQUARE / (-2 * np.log(0.9))
    for k in np.flatnonzero(seen.mean(axis=0) > 0.5):
        others = np.median(added[seen[:, k], k])
        added[:, k] = np.where(seen[:, k], added[:, k], np.minimum(most[:, k], others))
    return added


def _difference(x: NDArray[Any], order: int) -> NDArray[Any]:
    """Return differences along the first axis, scaled to pass white noise on with its variance."""
    stencil, n = np.array(_STENCILS[order]), len(x)
    d = sum(c * x[i : n - order + i] for i, c in enumerate(stencil)) / np.sqrt((stencil**2).sum())
    return np.concatenate([d[:1]] * (order // 2) + [d] + [d[-1:]] * (order // 2))


def noise_from_coherence(coherence: Floats, n_averages: int) -> Floats:
    """Return the relative noise of FRFs from their coherence.

    σ(ln|H|) = √((1 - γ²) / (2 n γ²)) for the estimator H1 with noise at the output (Bendat & Piersol, Random
    Data, 2010, equation 9.90).

    Parameters
    ----------
    coherence : ndarray (n_freq, n_out, n_in)
        γ², 0 to 1 [-].
    n_averages : int
        n, independent averages.

    Returns
    -------
    ndarray (n_freq, n_out, n_in)
        Standard deviation of ln|H| [-]; infinite where the coherence is 0.

    Raises
    ------
    ValueError
        For a coherence outside 0 to 1, or no averages.
    """
    gamma2 = np.asarray(coherence, dtype=float)
    if n_averages < 1 or not ((gamma2 >= 0) & (gamma2 <= 1)).all():
        msg = (
            f"coherence lies between 0 and 1, and there is at least one average; found {n_averages} averages"
        )
        raise ValueError(msg + f" and coherences of {gamma2.min():.3g} to {gamma2.max():.3g}")
    with np.errstate(divide="ignore"):
        return np.sqrt((1 - gamma2) / (2 * n_averages * gamma2))


def noise_from_repeats(repeats: Complexes) -> Floats:
    """Return the relative noise of the mean of FRFs that were measured several times.

    The sample standard deviation of H over the repeats, in each part, over √n and |mean H|.

    Parameters
    ----------
    repeats : ndarray (n, n_freq, n_out, n_in)

    Returns
    -------
    ndarray (n_freq, n_out, n_in)
        Standard deviation of ln|mean H| [-].

    Raises
    ------
    ValueError
        For fewer than two repeats.
    """
    H = np.asarray(repeats)
    if len(H) < 2:
        msg = f"noise needs at least 2 repeats, found {len(H)}"
        raise ValueError(msg)
    mean = H.mean(axis=0)
    variance = (np.abs(H - mean) ** 2).sum(axis=0) / (len(H) - 1) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sqrt(variance / len(H)) / np.abs(mean)
