"""A record of responses to unknown forces: checks, and the samples that an identification uses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats
from fem.summary import fields_summary

LEAST_CHANNELS = 2
"""Channels of which a shape can be made."""

USED_BAND = 0.4
"""Highest frequency in parts of the sample rate: filters before sampling leave the rest in doubt [-]."""


LEAST_ROWS = 20
"""Block rows at least."""

MOST_ROWS = 800
"""Rows of the block Hankel matrix at most: the computation grows with their third power."""

BLOCKS = (64, 32, 16)
"""Numbers of blocks of a record from whose scatter uncertainty is: the largest that it is long enough for."""


class AmbientError(ValueError):
    """A record or settings from which modes cannot be identified; the message gives the value found."""


@dataclass(frozen=True, slots=True, eq=False)
class AmbientRecord:
    """Responses as an identification uses them.

    Attributes
    ----------
    y : ndarray (n_samples, n_channels)
        Without trend, with a standard deviation of 1.
    scale : ndarray (n_channels,)
        By which it was divided [unit of the channel].
    channels : tuple of str
    sample_rate : float
        After decimation [Hz].
    band : (float, float)
        Lowest and highest frequency of modes [Hz].
    n_rows : int
        Block rows: half a period of the lowest frequency, or ``LEAST_ROWS``.
    n_blocks : int
        One of ``BLOCKS``.
    duration : float
        [s].
    """

    y: Floats
    scale: Floats
    channels: tuple[str, ...]
    sample_rate: float
    band: tuple[float, float]
    n_rows: int
    n_blocks: int
    duration: float

    __repr__ = fields_summary


def prepare_record(
    values: ArrayLike,
    sample_rate: float,
    channels: Sequence[str] | None = None,
    band: tuple[float, float] | None = None,
) -> AmbientRecord:
    """Check a record, take off its trend and reduce its sample rate to what the band needs.

    Parameters
    ----------
    values : array_like (n_samples, n_channels)
        Responses of one kind in one unit, sampled together.
    sample_rate : float
        [Hz].
    channels : sequence of str, optional
        Their names; ch1, ch2 and so on unless given.
    band : (float, float), optional
        Lowest and highest frequency of modes; 1 to 40 % of the sample rate unless given [Hz].

    Raises
    ------
    AmbientError
        For too few channels or samples, a channel that is constant for a while or not finite, and a band
        that the sample rate does not hold.
    """
    y = np.array(values, dtype=float)
    names = _checked(y, sample_rate, channels)
    low, high = _band(sample_rate, band)
    y = y - y.mean(axis=0)
    _refuse_constant(y, sample_rate, names)
    factor = int(USED_BAND * sample_rate / high)
    if factor > 1:
        from scipy.signal import decimate  # a second to import

        y = decimate(y, factor, ftype="fir", axis=0)
    y, rate = _without_trend(y), sample_rate / factor if factor > 1 else sample_rate
    n_rows = max(LEAST_ROWS, int(np.ceil(rate / (2 * low))))
    n_rows = max(2, min(n_rows, MOST_ROWS // y.shape[1] - 1))
    n_blocks = _n_blocks(len(y), 2 * n_rows, rate, names)
    scale = y.std(axis=0)
    duration = len(y) / rate
    return AmbientRecord(y / scale, scale, names, rate, (low, high), n_rows, n_blocks, duration)


def _checked(y: Floats, sample_rate: float, channels: Sequence[str] | None) -> tuple[str, ...]:
    """Return the names of the channels of an array of samples."""
    if y.ndim != 2 or not y.size:
        msg = f"the record has shape {y.shape}; (n_samples, n_channels) is expected"
        raise AmbientError(msg)
    names = tuple(channels) if channels is not None else tuple(f"ch{k + 1}" for k in range(y.shape[1]))
    if len(names) != y.shape[1]:
        msg = f"{len(names)} names are given for {y.shape[1]} channels"
        raise AmbientError(msg)
    if y.shape[1] < LEAST_CHANNELS:
        msg = (
            f"the record has {y.shape[1]} channel, {names[0]}; at least {LEAST_CHANNELS} are needed, as a "
            "shape has no fewer values"
        )
        raise AmbientError(msg)
    bad = np.argwhere(~np.isfinite(y))
    if bad.size:
        k, c = (int(v) for v in bad[0])
        msg = (
            f"sample {k + 1} of channel {names[c]} is not finite, {len(bad)} in all; samples must follow "
            "evenly, without gaps"
        )
        raise AmbientError(msg)
    if not (np.isfinite(sample_rate) and sample_rate > 0):
        msg = f"the sample rate is {sample_rate}; a positive number [Hz] is needed"
        raise AmbientError(msg)
    return names


def _band(sample_rate: float, band: tuple[float, float] | None) -> tuple[float, float]:
    high = USED_BAND * sample_rate if band is None else float(band[1])
    # Highest over lowest frequency of a band that is not given [-]
    low = high / 40.0 if band is None else float(band[0])
    if not 0 < low < high:
        msg = f"the band is {low:g} to {high:g} Hz; a positive frequency and a higher one are needed"
        raise AmbientError(msg)
    if high > sample_rate / 2:
        msg = (
            f"the band ends at {high:g} Hz, and samples at {sample_rate:g} Hz hold frequencies up to "
            f"{sample_rate / 2:g} Hz: sample at {high / USED_BAND:g} Hz or more, or end the band at "
            f"{USED_BAND * sample_rate:g} Hz"
        )
        raise AmbientError(msg)
    return low, high


def _refuse_constant(y: Floats, sample_rate: float, names: tuple[str, ...]) -> None:
    """Refuse a channel that has no signal in a block: a loose cable, or an amplifier that is off."""
    for k, block in enumerate(np.array_split(y, min(BLOCKS[-1], len(y)))):
        still = np.flatnonzero(np.ptp(block, axis=0) == 0) if len(block) > 1 else np.zeros(0, dtype=int)
        if still.size:
            c = int(still[0])
            n = len(y) / BLOCKS[-1] / sample_rate
            throughout = np.ptp(y[:, c]) == 0
            when = "" if throughout else f" from {k * n:.4g} s to {(k + 1) * n:.4g} s"
            msg = f"channel {names[c]} is constant{when}; leave it out, or cut the record"
            raise AmbientError(msg)


def _without_trend(y: Floats) -> Floats:
    t = np.linspace(-1.0, 1.0, len(y))
    y = y - y.mean(axis=0)
    return y - np.outer(t, t @ y / (t @ t))


def _n_blocks(n: int, n_lags: int, rate: float, names: tuple[str, ...]) -> int:
    """Return the number of blocks, each at least as long as the lags and as many samples as channels."""
    least = max(n_lags, len(names))
    fitting = [b for b in BLOCKS if n >= b * least + n_lags]
    if not fitting:
        need = BLOCKS[-1] * least + n_lags
        msg = (
            f"the record is {n / rate:.4g} s long, {n} samples at the {rate:g} Hz that the band needs; "
            f"correlations up to {n_lags / rate:.3g} s and their scatter over {BLOCKS[-1]} blocks need "
            f"{need / rate:.4g} s: measure for longer, or raise the lower end of the band"
        )
        raise AmbientError(msg)
    return fitting[0]
