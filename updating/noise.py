"""How noisy measured FRFs are, estimated from the data alone."""

import numpy as np
from numpy.typing import NDArray

_STENCIL = np.array([1.0, -4.0, 6.0, -4.0, 1.0])


def relative_noise(H: NDArray[np.complex128], window: int = 31) -> NDArray[np.float64]:
    """Estimate the relative noise of the amplitude at each line.

    An FRF is smooth between its resonances, so fourth differences of ln|H| over neighbouring lines are noise;
    their median absolute value over a window does not see the few lines at resonances and antiresonances.

    Parameters
    ----------
    H : ndarray (n_freq, n_out, n_in)
    window : int
        Number of lines.

    Returns
    -------
    ndarray (n_freq, n_out, n_in)
        Standard deviation of ln|H| [-].
    """
    n_freq = H.shape[0]
    if n_freq < 9:
        return np.full(H.shape, 0.01)
    with np.errstate(divide="ignore"):
        amplitude = np.log(np.maximum(np.abs(H), 1e-300))
    d = sum(c * amplitude[i : n_freq - 4 + i] for i, c in enumerate(_STENCIL)) / np.sqrt((_STENCIL**2).sum())
    d = np.abs(np.concatenate([d[:1], d[:1], d, d[-1:], d[-1:]])) / 0.6745
    half = min(window, n_freq) // 2
    centres = np.arange(0, n_freq, max(1, half // 2))
    level = np.stack([np.median(d[max(0, c - half) : c + half + 1], axis=0) for c in centres])
    out = np.empty(H.shape)
    for i in range(H.shape[1]):
        for j in range(H.shape[2]):
            out[:, i, j] = np.interp(np.arange(n_freq), centres, level[:, i, j])
    return out


def noise_from_coherence(coherence: NDArray[np.float64], n_averages: int) -> NDArray[np.float64]:
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


def noise_from_repeats(repeats: NDArray[np.complex128]) -> NDArray[np.float64]:
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
