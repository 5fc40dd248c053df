"""Faults of the measurement itself: sensors that read with a wrong sign or gain."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GAIN_LEAST = 0.06
"""Smallest deviation of a gain from 1 that is called a fault, as a logarithm [-]."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a sensor.

    Attributes
    ----------
    kind : str
        ``"sensor_sign"`` or ``"sensor_gain"``.
    sensor : str
    value : float
        Factor that its readings carry: -1, or the gain [-].
    std : float
        Standard deviation of the factor [-].
    """

    kind: str
    sensor: str
    value: float
    std: float


def find_sign_faults(log_ratio: NDArray[np.complex128]) -> tuple[int, ...]:
    """Return the sensors whose phase is opposite to the model's over most lines.

    Parameters
    ----------
    log_ratio : ndarray (n_freq, n_out, n_in)
        ln(H_computed / H_measured) after the nuisance fit, NaN where masked.
    """
    cosine = np.cos(log_ratio.imag)
    out = []
    for i in range(log_ratio.shape[1]):
        seen = cosine[:, i][np.isfinite(log_ratio[:, i].real)]
        if seen.size and np.median(seen) < -0.5 and (seen < 0).mean() > 0.75:
            out.append(i)
    return tuple(out)


def find_gain_faults(log_ratio: NDArray[np.complex128], n_blocks: int = 10) -> tuple[tuple[int, float], ...]:
    """Return the sensors whose amplitude is off by the same factor over the whole band, and ln of the factor.

    A missing physical effect changes the ratio from one resonance to the next; a calibration error does not.
    A sensor is named if the median of its ratio stands out from the other sensors' and blocks of lines agree
    on it.

    Parameters
    ----------
    log_ratio : ndarray (n_freq, n_out, n_in)
        ln(H_computed / H_measured) after the nuisance fit, NaN where masked.
    n_blocks : int
    """
    n_freq, n_out, _ = log_ratio.shape
    block = np.arange(n_freq) * n_blocks // n_freq
    medians = np.full((n_blocks, n_out), np.nan)
    for b in range(n_blocks):
        part = -log_ratio.real[block == b]
        for i in range(n_out):
            seen = part[:, i][np.isfinite(part[:, i])]
            if seen.size >= 4:
                medians[b, i] = np.median(seen)
    heard = np.isfinite(medians).sum(axis=0) >= n_blocks // 2
    if heard.sum() < 4:
        return ()
    index = np.flatnonzero(heard)
    medians = medians[:, index]
    centre = np.nanmedian(medians, axis=0)
    usual = np.nanmedian(centre)
    spread = 1.4826 * np.nanmedian(np.abs(centre - usual))
    out = []
    for i in np.argsort(-np.abs(centre - usual)):
        deviation = float(centre[i] - usual)
        scatter = 1.4826 * np.nanmedian(np.abs(medians[:, i] - centre[i]))
        agree = np.nanmean((medians[:, i] - usual) * np.sign(deviation) > 0.5 * abs(deviation))
        if abs(deviation) > max(GAIN_LEAST, 6 * spread) and scatter < 0.35 * abs(deviation) and agree >= 0.8:
            out.append((int(index[i]), deviation))
    return tuple(out)
