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
