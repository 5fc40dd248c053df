"""Measured modes of a true frame from its response to unknown forces."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from benchmarks.validation.frames import Draft, Generator, sensors_of
from benchmarks.validation.true_modes import ModesError, seen_modes
from benchmarks.validation.truth import TrueFrame
from updating import ModeTargets, identify_ambient
from updating.ambient import USED_BAND

Floats = NDArray[np.float64]
PERIODS = (1000.0, 4000.0)
"""Least and largest length of a record in periods of its lowest mode [-]."""
MOST_SAMPLES = 300_000
"""Samples of a record at most."""
ZETA = (0.003, 0.02)
"""Least and largest damping ratio of a mode [-]."""
POWER = 3.0
"""Root mean square of a mode's response over that of the others, up or down at most [-]."""
NOISE = 0.05
"""Noise of a channel over its root mean square [-]."""
AT_REST = 8.0
"""A record begins so many decay times after the forces [-]."""


def ambient_targets(truth: TrueFrame, draft: Draft, rng: Generator) -> ModeTargets:
    """Return the modes that are identified from a record of accelerations under random forces.

    Forces of the modes are independent and white; how strong they are, and how much each mode is damped, is
    drawn. Frequencies and shapes are given with the standard deviations of the identification; damping
    ratios are not, as the model's own are arbitrary.

    Raises
    ------
    ModesError
        If modes of the truth are missed, or none is identified.
    """
    low, high = float(draft.frequency[0]), float(draft.frequency[-1])
    f, phi = seen_modes(truth, draft)
    y, rate = response(f, phi, high / USED_BAND, rng)
    names = [s.name for s in draft.sensors]
    moving = y.std(axis=0) > 0
    found = identify_ambient(
        y[:, moving], rate, [n for n, h in zip(names, moving, strict=True) if h], (low, high)
    )
    if not found.modes.n_modes:
        msg = f"no mode of {len(f)} from {low:g} to {high:g} Hz was identified"
        raise ModesError(msg)
    f_std, shape_std = found.relative_std()
    sensors = sensors_of(draft.frame, draft.sensors)
    return ModeTargets.of(
        found.modes.frequency,
        f_std,
        shapes=found.modes.shapes,
        shape_std=shape_std,
        sensors=[s for s, h in zip(sensors, moving, strict=True) if h],
    )


def response(f: Floats, phi: Floats, rate: float, rng: Generator) -> tuple[Floats, float]:
    """Return accelerations (n_samples, n_out) of modes f [Hz] with shapes (n_out, n), and the sample rate."""
    zeta = np.exp(rng.uniform(*np.log(ZETA), size=len(f)))
    power = POWER ** rng.uniform(-1, 1, size=len(f))
    periods = float(np.exp(rng.uniform(*np.log(PERIODS))))
    n = min(MOST_SAMPLES, int(periods * rate / f.min()))
    still = int(AT_REST * rate / (2 * np.pi * zeta * f).min())
    y = np.zeros((n, len(phi)))
    for k in range(len(f)):
        q = acceleration(rng.standard_normal(n + still), f[k], zeta[k], rate)[still:]
        shape = phi[:, k] / np.sqrt((phi[:, k] ** 2).mean())
        y += np.outer(q * power[k] / q.std(), shape)
    return y + NOISE * y.std(axis=0) * rng.standard_normal(y.shape), rate


def acceleration(force: Floats, f: float, zeta: float, rate: float) -> Floats:
    """Return the acceleration of a mode under a force that is constant over each sample, exactly."""
    omega = 2 * np.pi * f
    omega_d = omega * np.sqrt(1 - zeta**2)
    e, c, s = np.exp(-zeta * omega / rate), np.cos(omega_d / rate), np.sin(omega_d / rate)
    # e^{-ζωt} (cos ω_d t - ζω/ω_d sin ω_d t) follows a step of the force
    rise = [1.0, -e * (c + zeta * omega / omega_d * s)]
    return np.asarray(lfilter(np.convolve(rise, [1, -1]), [1, -2 * e * c, e * e], force))
