"""Shock response spectra: largest responses of single oscillators to a motion of their base."""

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.recurrence import oscillators
from fem.array_types import Floats
from fem.model import ModelError

RESPONSES = ("acceleration", "pseudo_velocity", "displacement")
PARTS = ("maximax", "positive", "negative")


def shock_response_spectrum(
    time: ArrayLike,
    acceleration: ArrayLike,
    frequency: ArrayLike,
    zeta: float = 0.05,
    *,
    response: str = "acceleration",
    part: str = "maximax",
) -> Floats:
    """Return the shock response spectrum of an acceleration of the base, shape (n_freq,).

    Oscillators step exactly for accelerations that are linear between samples, which is Smallwood's ramp
    invariant filter (Shock Vib. Bull. 51, 1981). What follows the record is free vibration, whose first peaks
    are known in closed form, so that the residual spectrum is in it.

    Parameters
    ----------
    time : array_like (n_t,)
        At equal steps [s].
    acceleration : array_like (n_t,)
        Of the base [m/s²].
    frequency : array_like (n_freq,)
        Natural frequencies of the oscillators, above 0 [Hz].
    zeta : float
        Their damping ratio, from 0 to less than 1 [-].
    response : str
        ``"acceleration"``, absolute [m/s²]; ``"displacement"``, relative to the base [m]; or
        ``"pseudo_velocity"``, ω times that [m/s].
    part : str
        ``"maximax"`` for the largest size, ``"positive"`` or ``"negative"`` for that of either sign.

    Raises
    ------
    ModelError
        For shapes that do not fit, steps that are not equal, and values that are not allowed.
    """
    t, a = np.asarray(time, dtype=float), np.asarray(acceleration, dtype=float)
    f = np.array(frequency, dtype=float, ndmin=1)
    if t.ndim != 1 or t.shape != a.shape or t.size < 2 or not np.isfinite(a).all():
        msg = f"times have shape {t.shape} and accelerations {a.shape}; both have to be (n_t,), finite"
        raise ModelError(msg)
    step = np.diff(t)
    if not (step > 0).all() or np.ptp(step) > 1e-4 * step.mean():
        msg = "times must increase by equal steps [s]"
        raise ModelError(msg)
    if not (np.isfinite(f) & (f > 0)).all() or not 0 <= zeta < 1:
        msg = "frequencies must lie above 0 Hz, and the damping ratio from 0 to less than 1"
        raise ModelError(msg)
    if response not in RESPONSES or part not in PARTS:
        msg = f"allowed are the responses {', '.join(RESPONSES)} and the parts {', '.join(PARTS)}"
        raise ModelError(msg)
    h = float(t[-1] - t[0]) / (t.size - 1)
    # oscillators that need equally fine steps are stepped together
    # Least number of steps a period: the largest sample is then at most (π/48)²/2 = 0.2 % below the peak
    pieces = 2 ** np.ceil(np.log2(np.maximum(f * h * 48, 1.0))).astype(int)
    out = np.empty(f.size)
    for n in np.unique(pieces):
        chosen = np.flatnonzero(pieces == n)
        fine = np.interp(np.arange((t.size - 1) * n + 1) / n, np.arange(t.size), a)
        out[chosen] = _largest(fine, h / n, 2 * np.pi * f[chosen], zeta, response, part)
    return out


def _largest(a: Floats, h: float, omega: Floats, zeta: float, response: str, part: str) -> Floats:
    """Return the largest responses of oscillators during and after an acceleration."""
    rest = np.zeros(omega.size)
    damping = 2 * zeta * omega
    z, v = oscillators(omega**2, damping, np.repeat(-a[:, None], omega.size, axis=1), h, (rest, rest))
    if response == "acceleration":
        during = -(omega**2) * z - damping * v
        # the base rests behind the record: z'' = -ω² z - c z'
        fall = -(omega**2) * v[-1] - damping * (-(omega**2) * z[-1] - damping * v[-1])
    else:
        during, fall = z, v[-1]
    after = _free_peaks(during[-1], fall, omega, zeta)
    high = np.maximum(np.vstack([during, after]).max(axis=0), 0.0)
    low = np.maximum((-np.vstack([during, after])).max(axis=0), 0.0)
    size = {"maximax": np.maximum(high, low), "positive": high, "negative": low}[part]
    return omega * size if response == "pseudo_velocity" else size


def _free_peaks(value: Floats, slope: Floats, omega: Floats, zeta: float) -> Floats:
    """Return the next two extremes of e^{-ζωt} (A cos ω_d t + B sin ω_d t), shape (2, n)."""
    damped, decay = omega * np.sqrt(1 - zeta**2), zeta * omega
    A, B = value, (slope + decay * value) / damped
    # the derivative vanishes where tan θ = (ω_d B - ζω A)/(ω_d A + ζω B)
    first = np.arctan2(damped * B - decay * A, damped * A + decay * B) % np.pi
    at = np.stack([first, first + np.pi])
    return np.exp(-decay / damped * at) * (A * np.cos(at) + B * np.sin(at))


def pseudo_acceleration_spectrum(
    time: ArrayLike, acceleration: ArrayLike, zeta: float
) -> tuple[Floats, Floats]:
    """Return the shock response spectra of motions of a base at all frequencies that their record has.

    Parameters
    ----------
    time : ndarray (n_times,)
        Even [s].
    acceleration : ndarray (n_times, n)
        [m/s², rad/s²].
    zeta : float
        Damping ratio of the oscillators [-].

    Returns
    -------
    frequency : ndarray (n_freq,)
        [Hz].
    spectra : ndarray (n_freq, n)
        Pseudo-accelerations ω² max|u| of the relative displacement u [m/s², rad/s²].
    """
    time, acceleration = np.asarray(time, dtype=float), np.asarray(acceleration, dtype=float)
    span, n = float(time[-1] - time[0]), len(time) - 1
    # Oscillators of a shock response spectrum in each octave, from a hundredth of a turn in the record's time
    # to half its sampling rate. Below, only the final velocity of the base counts, above, its largest
    # acceleration.
    f = np.geomspace(0.01 / span, 0.5 * n / span, int(np.ceil(24 * np.log2(50 * n))) + 1)
    each = [shock_response_spectrum(time, a, f, zeta, response="pseudo_velocity") for a in acceleration.T]
    return f, 2 * np.pi * f[:, None] * np.stack(each, axis=1)
