"""Singular values of the spectra of responses: the picture of an ambient test, and a check of its modes."""

from dataclasses import dataclass

import numpy as np

from fem.array_types import Complexes, Floats
from fem.summary import fields_summary
from updating.ambient.record import AmbientRecord

AVERAGES = 32
"""Segments, half of each shared with the next, that spectra are averaged over at least."""

LONGEST = 4096
"""Samples of a segment at most."""


@dataclass(frozen=True, slots=True, eq=False)
class SingularSpectra:
    """Singular value decomposition of the spectral matrix at every line.

    At a resonance the largest singular value peaks, and its vector is the shape of the mode (frequency domain
    decomposition: Brincker, Zhang and Andersen, *Smart Mater. Struct.* 10, 2001, 441).

    Attributes
    ----------
    frequency : ndarray (n_freq,)
        [Hz].
    values : ndarray (n_freq, n_channels)
        Singular values, falling, of channels with a standard deviation of 1 [1/Hz].
    vectors : ndarray of complex (n_freq, n_channels, n_channels)
        Columns of length 1, by channels with a standard deviation of 1.
    averages : float
        Number of independent segments that the average is worth [-].
    """

    frequency: Floats
    values: Floats
    vectors: Complexes
    averages: float

    __repr__ = fields_summary

    @property
    def step(self) -> float:
        """Distance of the lines [Hz]."""
        return float(self.frequency[1] - self.frequency[0])


@dataclass(frozen=True, slots=True)
class Peak:
    """A peak of the largest singular value: frequency [Hz], and rise above its surroundings [dB]."""

    frequency: float
    rise_db: float


def singular_spectra(record: AmbientRecord) -> SingularSpectra:
    """Return the singular values and vectors of a record's spectral matrix, averaged over segments.

    Segments of a Hann window share half of their samples (Welch, *IEEE Trans. Audio Electroacoust.* 15, 1967,
    70).
    """
    y, n = record.y, min(LONGEST, 2 * (len(record.y) // (AVERAGES + 1)))
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)
    starts = np.arange(0, len(y) - n + 1, n // 2)
    S = np.zeros((n // 2 + 1, y.shape[1], y.shape[1]), dtype=complex)
    for k in starts:
        Y = np.fft.rfft(y[k : k + n] * window[:, None], axis=0)
        S += Y[:, :, None] * Y[:, None, :].conj()
    S *= 2 / (len(starts) * record.sample_rate * (window @ window))
    f = np.fft.rfftfreq(n, 1 / record.sample_rate)
    inside = (f > 0) & (f <= record.band[1])
    U, s, _ = np.linalg.svd(S[inside])
    # segments that share half of a Hann window are correlated by 1/6, their powers by 1/36
    shared = 1 + 2 * (1 - 1 / len(starts)) / 36
    return SingularSpectra(np.asarray(f[inside], dtype=float), s, U, len(starts) / shared)


def spectra_mac(spectra: SingularSpectra, frequency: Floats, shapes: Complexes) -> Floats:
    """Return how much each shape is like a singular vector near its frequency, MAC, (n_modes,).

    Of two modes that share a peak, one is the first vector there and the other near the second. The line
    before and the one after count, too.

    Parameters
    ----------
    spectra : SingularSpectra
    frequency : ndarray (n_modes,)
        [Hz].
    shapes : ndarray (n_modes, n_channels)
        Of length 1, by channels with a standard deviation of 1.
    """
    out = np.zeros(len(frequency))
    for k, f in enumerate(frequency):
        at = int(np.argmin(np.abs(spectra.frequency - f)))
        near = spectra.vectors[max(at - 1, 0) : at + 2, :, :2]
        out[k] = float((np.abs(np.einsum("fcv,c->fv", near.conj(), shapes[k])) ** 2).max())
    return out


def peaks_of(spectra: SingularSpectra, band: tuple[float, float]) -> tuple[Peak, ...]:
    """Return the peaks of the largest singular value that are no chance, by frequency.

    The logarithm of a spectrum averaged over n segments scatters by 1/√n, a difference of two by √(2/n).
    """
    from scipy.signal import find_peaks  # a second to import

    level = np.log(np.maximum(spectra.values[:, 0], 1e-300))
    # Least rise of a peak above its surroundings, in standard deviations of the difference of two lines
    at, found = find_peaks(level, prominence=5.0 * np.sqrt(2 / spectra.averages))
    return tuple(
        Peak(float(spectra.frequency[k]), float(10 * rise / np.log(10)))
        for k, rise in zip(at, found["prominences"], strict=True)
        if band[0] <= spectra.frequency[k] <= band[1]
    )
