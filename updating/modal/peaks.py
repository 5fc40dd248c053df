"""Peaks of measured FRFs that identified modes do not explain, and why they have none."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem.array_types import Complexes, Floats
from updating.modal.poles import LEAST_ORDERS, MATHEMATICAL_DAMPING, Stabilisation

HALF_POWER_DB = 3.0
"""Least prominence of a peak: it then has half-power points to either side [dB]."""

UNEXPLAINED_SHARE = 0.5
"""Part of a peak's power beyond which the synthesised FRFs do not explain it [-]."""


MOST_NAMED = 12
"""Largest number of peaks that are listed one by one, the highest first."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A pole that was tried as a mode.

    Attributes
    ----------
    frequency, zeta : float
        As tried last [Hz, -].
    n_orders : int
        Number of orders of the stabilisation diagram in which it was found.
    accepted : bool
    reason : str
        Why it was not taken; empty if it was.
    """

    frequency: float
    zeta: float
    n_orders: int
    accepted: bool
    reason: str = ""


@dataclass(frozen=True, slots=True)
class UnexplainedPeak:
    """A peak of the mode indicator that the identified modes do not explain.

    Attributes
    ----------
    frequency : float
        [Hz]
    level_db : float
        Of the mode indicator, over its median [dB].
    share : float
        Part of the peak's power that the synthesised FRFs leave [-].
    reason : str
        Why there is no mode: which pole was left out by which criterion, or that none persists.
    """

    frequency: float
    level_db: float
    share: float
    reason: str

    @property
    def words(self) -> str:
        """Return a sentence with the peak, and the reason why there is no mode."""
        return f"the peak at {self.frequency:.5g} Hz has no mode: {self.reason}"


def mode_indicator(H: Complexes, size: Floats) -> Floats:
    """Return Σ |H_oi|² / size_oi² at each line, (n_freq,): every FRF counts alike."""
    return (np.abs(H) ** 2 / np.where(size > 0, size, 1.0) ** 2).sum(axis=(1, 2))


def unexplained_peaks(
    frequency: Floats,
    H: Complexes,
    fitted: Complexes,
    sigma: Floats,
    candidates: Sequence[Candidate],
    stabilisation: Stabilisation,
) -> tuple[UnexplainedPeak, ...]:
    """Return the peaks of measured FRFs that synthesised ones lack, the highest first.

    A peak of the mode indicator has half-power points to either side. It is explained if the synthesised FRFs
    have most of its power and a peak between these points, or if the residual may be noise.

    Parameters
    ----------
    frequency : ndarray (n_freq,)
        [Hz]
    H, fitted : ndarray of complex (n_freq, n_out, n_in)
        Measured and synthesised.
    sigma : ndarray (n_freq, n_out, n_in)
        Standard deviation of real and imaginary parts.
    candidates : sequence of Candidate
        All poles that were tried.
    stabilisation : Stabilisation
    """
    from scipy.signal import find_peaks  # a second to import, and few need it

    size = np.sqrt((np.abs(H) ** 2).mean(axis=0))
    level = 10 * np.log10(np.maximum(mode_indicator(H, size), 1e-300))
    synthesised = 10 * np.log10(np.maximum(mode_indicator(fitted, size), 1e-300))
    residual = mode_indicator(H - fitted, size)
    noise = (np.abs(H - fitted) ** 2 / (2 * sigma**2)).sum(axis=(1, 2))
    per_line = H.shape[1] * H.shape[2]
    of_model = find_peaks(synthesised, prominence=HALF_POWER_DB / 2)[0]
    out = []
    for peak in find_peaks(level, prominence=HALF_POWER_DB)[0]:
        first, last = _half_power(level, int(peak))
        lines = slice(first, last + 1)
        n = per_line * (last + 1 - first)
        # The residual of a peak must exceed noise by this many standard deviations of it [-]
        if noise[lines].sum() < n + 8.0 * np.sqrt(n) + np.log(len(H)):
            continue
        share = float(residual[lines].sum() / (10 ** (level[lines] / 10)).sum())
        seen = ((of_model >= first) & (of_model <= last)).any()
        if share <= UNEXPLAINED_SHARE and (seen or share <= UNEXPLAINED_SHARE / 2):
            continue
        reach = max(frequency[last] - frequency[peak], frequency[peak] - frequency[first])
        reason = _reason(float(frequency[peak]), float(reach), candidates, stabilisation)
        out.append(
            UnexplainedPeak(float(frequency[peak]), float(level[peak] - np.median(level)), share, reason)
        )
    return tuple(sorted(out, key=lambda p: -p.level_db))


def _half_power(level: Floats, peak: int) -> tuple[int, int]:
    """Return the lines to either side of a peak at which it is 3 dB lower, or the ends."""
    below = level < level[peak] - HALF_POWER_DB
    before, after = np.flatnonzero(below[:peak]), np.flatnonzero(below[peak:])
    first = int(before[-1]) if before.size else 0
    return first, peak + int(after[0]) if after.size else len(level) - 1


def _reason(
    frequency: float, reach: float, candidates: Sequence[Candidate], stabilisation: Stabilisation
) -> str:
    """Say why there is no mode at a peak."""
    near = [
        c
        for c in candidates
        if not c.accepted
        and c.zeta <= MATHEMATICAL_DAMPING  # a pole of more damping is at no peak
        and abs(c.frequency - frequency) <= max(reach, c.zeta * c.frequency)
    ]
    if near:
        c = min(near, key=lambda c: abs(c.frequency - frequency))
        return f"the pole at {c.frequency:.5g} Hz, in {c.n_orders} orders, was left out: {c.reason}"
    close = np.abs(stabilisation.poles.imag / (2 * np.pi) - frequency) <= reach
    n_orders = np.unique(stabilisation.order[close]).size
    if n_orders:
        return (
            f"{n_orders} of {stabilisation.orders.size} model orders have a pole near it, but none "
            f"persists over {LEAST_ORDERS} orders and stays there in the fit"
        )
    return f"no model of an order up to {stabilisation.orders[-1]} has a pole there"


def peak_words(peaks: Sequence[UnexplainedPeak]) -> list[str]:
    """Return a sentence for each peak, the highest first, and how many more there are."""
    out = [p.words for p in peaks[:MOST_NAMED]]
    if len(peaks) > MOST_NAMED:
        rest = ", ".join(f"{p.frequency:.5g}" for p in peaks[MOST_NAMED:])
        out.append(f"{len(peaks) - MOST_NAMED} lower peaks have no mode either, at {rest} Hz")
    return out
