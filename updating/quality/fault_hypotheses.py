"""Hypotheses about faults: the best value of each, and how much of a misfit it explains."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.array_types import Bools, Complexes, Floats
from updating.correlation import complex_log
from updating.inference.heartbeat import beat
from updating.least_squares.costs import pseudo_huber
from updating.quality.corrections import Fault

LEAST_MISFIT_RATIO = 2.2
"""A fault must lower a sensor's misfit to the others' prediction by more than this factor."""

LEAST_VALUE_PER_STD = 10.0
"""The value of a fault must be this multiple of its standard deviation."""


_N_BLOCKS = 10
"""Number of blocks of lines in which a fault must lower the misfit, each for itself."""


Losses = Callable[[Floats], Floats]
"""From values (n,) of a fault to the losses (n, n_lines)."""


@dataclass(frozen=True, slots=True)
class FaultHypothesis:
    """A fault that a sensor or an excitation may have, and the misfit that it explains.

    Attributes
    ----------
    fault : Fault
    size, least : float
        The fault is large if |size| exceeds ``least``.
    gain : float
        Decrease of the sum of losses.
    before, after : float
        Mean losses without and with the fault, on lines that did not give its value.
    better : float
        Share of the blocks of lines where the loss falls [-].
    change : float
        Median change of the logarithm of the readings by the fault.
    """

    fault: Fault
    size: float
    least: float
    gain: float
    before: float
    after: float
    better: float
    change: float = np.inf

    @property
    def large(self) -> bool:
        """Whether the fault is larger than deviations that every measurement has."""
        return abs(self.size) > self.least

    @property
    def believed(self) -> bool:
        """Whether the fault is large, well determined, and explains most of the misfit all over the band."""
        # A fault must lower the misfit in this share of the blocks of lines [-]
        explained = self.before > LEAST_MISFIT_RATIO * self.after and self.better >= 0.8
        return self.large and self._determined and explained

    @property
    def _determined(self) -> bool:
        fault = self.fault
        if fault.kind.endswith(("swap", "sign")):  # these have no value
            return True
        if fault.kind.endswith("gain"):
            return abs(self.size) > LEAST_VALUE_PER_STD * fault.std / fault.value
        return abs(fault.value) > LEAST_VALUE_PER_STD * fault.std


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """A sensor's readings and their prediction, both (n_lines, n), with relative standard deviation."""

    frequency: Floats
    measured: Complexes
    predicted: Complexes
    sigma: Floats
    seen: Bools

    @classmethod
    def of(cls, frequency: Floats, *arrays: Any) -> "Series":
        """Return a series of readings, prediction, deviation and mask of any shape (n_lines, …)."""
        measured, predicted, sigma, seen = (np.reshape(a, (len(frequency), -1)) for a in arrays)
        return cls(frequency, measured, predicted, sigma, seen)

    def losses(self, predicted: Complexes) -> Floats:
        """Return the losses (…, n_lines) against other predictions (…, n_lines, n)."""
        beat()
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            z = _log(self.measured / predicted) / self.sigma
        return (_loss(z) * self.seen).sum(axis=-1)

    def change(self, predicted: Complexes) -> float:
        """Return the median of |ln(other prediction / prediction)|."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return float(np.median(np.abs(_log(predicted / self.predicted))[self.seen]))

    @property
    def log_ratio(self) -> Complexes:
        """Logarithm of readings over prediction, 0 where a line is masked."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.where(self.seen, _log(self.measured / self.predicted), 0.0)

    def gain_losses(self, x: Floats) -> Floats:
        """Return the losses for gains exp(x)."""
        z = (self.log_ratio - x[:, None, None]) / self.sigma
        return (_loss(z) * self.seen).sum(axis=-1)

    def delay_losses(self, x: Floats) -> Floats:
        """Return the losses for delays x [s]."""
        r = self.log_ratio
        phase = r.imag + 2 * np.pi * self.frequency[:, None] * x[:, None, None]
        phase = (phase + np.pi) % (2 * np.pi) - np.pi
        return (_loss(np.hypot(r.real, phase) / self.sigma) * self.seen).sum(axis=-1)


def valued(grid: Floats, losses: Losses) -> tuple[float, float, Floats]:
    """Return the best value of a fault, its standard deviation, and the losses (n_lines,).

    The loss of each block of lines is that with the value from all other blocks; the deviation is Tukey's
    jackknife over blocks (Efron & Tibshirani, An Introduction to the Bootstrap, 1993, ch. 11).
    """
    lowest, highest = float(grid[0]), float(grid[-1])
    every, parts, block = 0.0, np.zeros(0), np.zeros(0, dtype=int)
    # Number of times that the grid of a fault's values is refined around the best
    for _ in range(2 + 1):  # the losses at resonances and between them have a narrow valley
        table, step = losses(grid), grid[1] - grid[0]
        n = table.shape[1]
        block = np.arange(n) * _N_BLOCKS // n
        every, *rest = (_lowest(grid, table[:, block != b]) for b in range(-1, _N_BLOCKS))
        parts = np.array(rest)
        first, last = max(parts.min() - step, lowest), min(parts.max() + step, highest)
        grid = np.linspace(first, last, len(grid))
    held_out = losses(parts)[block, np.arange(len(block))]
    variance = (_N_BLOCKS - 1) / _N_BLOCKS * ((parts - parts.mean()) ** 2).sum()
    return every, float(np.sqrt(variance)), held_out


def judge(
    fault: Fault, size: float, least: float, before: Floats, after: Floats, count: int, change: float = np.inf
) -> FaultHypothesis:
    """Return a hypothesis from the losses (n_lines,) of ``count`` readings without and with a fault."""
    start = np.searchsorted(np.arange(len(before)) * _N_BLOCKS // len(before), np.arange(_N_BLOCKS))
    was, fall = (np.add.reduceat(x, start) for x in (before, before - after))
    tell = was > count / _N_BLOCKS  # blocks with something to explain
    better = float((fall[tell] > 0).mean()) if tell.sum() >= _N_BLOCKS // 3 else 0.0
    return FaultHypothesis(
        fault,
        size,
        least,
        float((before - after).sum()),
        float(before.sum() / count),
        float(after.sum() / count),
        better,
        change,
    )


def factor_hypotheses(
    series: Series, of: str, name: str, gains: Floats, least: float
) -> list[FaultHypothesis]:
    """Return the sign, gain and delay of a channel that make the series' two sides agree.

    Parameters
    ----------
    series : Series
    of : {"sensor", "excitation"}
    name : str
    gains : ndarray (n,)
        Logarithms of gains to try [-].
    least : float
        Smallest deviation of a gain from 1 that is called a fault, as a logarithm [-].
    """
    count = int(series.seen.sum())
    if count < 20:
        return []
    before, top = series.losses(series.predicted), float(series.frequency[-1])
    # Sensors with a smaller misfit to the others' prediction are not examined; noise gives about 0.8 [-]
    if before.sum() < 1.5 * count:
        return []
    turned = Fault(f"{of}_sign", name, -1.0, 0.0)
    out = [judge(turned, 1.0, 0.0, before, series.losses(-series.predicted), count)]
    x, std, after = valued(gains, series.gain_losses)
    gain = float(np.exp(x))
    fault = Fault(f"{of}_gain", name, gain, gain * std, span=float(np.ptp(gains)))
    out.append(judge(fault, x, least, before, after, count, abs(x)))
    delays = np.linspace(-0.8, 0.8, 129) / top
    x, std, after = valued(delays, series.delay_losses)
    fault = Fault(f"{of}_delay", name, x, std, "s", span=float(np.ptp(delays)))
    change = float(np.median(2 * np.pi * series.frequency * abs(x)))
    # Smallest delay that is called a fault, as the phase at the highest frequency [rad]
    return [*out, judge(fault, 2 * np.pi * top * x, 0.12, before, after, count, change)]


def _lowest(grid: Floats, table: Floats) -> float:
    """Return the value with the least sum of losses (n, n_lines), by a parabola through the grid's points."""
    total = table.sum(axis=1)
    k = int(np.argmin(total))
    if not 0 < k < len(grid) - 1:
        return float(grid[k])
    a, b, c = total[k - 1 : k + 2]
    curvature = a - 2 * b + c
    return float(grid[k] + (0.5 * (a - c) / curvature * (grid[1] - grid[0]) if curvature > 0 else 0.0))


def _loss(z: Complexes | Floats) -> Floats:
    # Misfit at which the loss turns from quadratic to linear, in standard deviations [-]
    return pseudo_huber(z, 2.0)


def _log(ratio: Complexes) -> Complexes:
    return complex_log(np.where((ratio == 0) | ~np.isfinite(ratio), 1e-300, ratio))
