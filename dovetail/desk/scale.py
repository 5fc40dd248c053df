"""Sliders' scales: positions along them, and the values of parameters that they stand for."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem.model import Effect, Parameter
from updating.inference.fit import FitProblem

N_STEPS = 400
"""Steps of a slider [-]."""
BEYOND = 100.0
"""A parameter without bounds reaches to so many times the largest value that its search begins with [-]."""


@dataclass(frozen=True, slots=True)
class Scale:
    """From a slider's position x to a value and back.

    x = lg v for positive parameters, and x = arsinh((v - absent)/size) for others: even around the value at
    which the effect is absent, and logarithmic far from it, so that orders of magnitude have equal room.

    Attributes
    ----------
    log : bool
    absent : float
    size : float
        [unit of v].
    low, high : float
        Ends of x.
    """

    log: bool
    absent: float
    size: float
    low: float
    high: float

    @classmethod
    def of(cls, p: Parameter, starts: Sequence[float]) -> "Scale":
        """Return the scale of a parameter.

        Parameters
        ----------
        p : Parameter
        starts : sequence of float
            Values that a search would begin with: they tell which sizes matter.
        """
        known = [v for v in (*starts, p.value) if np.isfinite(v)]
        largest = max((abs(v) for v in known), default=0.0) or 1.0
        lower = p.lower if np.isfinite(p.lower) else -BEYOND * largest
        upper = p.upper if np.isfinite(p.upper) else BEYOND * largest
        if p.log:
            lower = max(lower, upper * 1e-12)
            return cls(True, 0.0, 1.0, float(np.log10(lower)), float(np.log10(upper)))
        absent = p.absent if np.isfinite(p.absent) else 0.0
        off = [abs(v - absent) for v in known if v != absent]
        size = min(off, default=upper - lower) if not p.position else 1e3 * (upper - lower)
        low, high = np.arcsinh((np.array([lower, upper]) - absent) / size)
        return cls(False, float(absent), float(size), float(low), float(high))

    @property
    def step(self) -> float:
        """One step of the slider."""
        return (self.high - self.low) / N_STEPS

    def position(self, value: float) -> float:
        """Return where a value is along the slider, at its end if beyond."""
        if self.log:
            x = float(np.log10(value)) if value > 0 else self.low
        else:
            x = float(np.arcsinh((value - self.absent) / self.size))
        return min(max(x, self.low), self.high)

    def value(self, x: float) -> float:
        """Return the value at a position."""
        return float(10.0**x) if self.log else float(self.absent + self.size * np.sinh(x))

    @property
    def javascript(self) -> str:
        """The value at a position ``x``, as an expression of JavaScript."""
        return "10 ** x" if self.log else f"{self.absent!r} + {self.size!r} * Math.sinh(x)"


def scales_of(effect: Effect, problem: FitProblem) -> dict[str, Scale]:
    """Return the scales of an effect's parameters by name."""
    starts = effect.starts(problem.surroundings)
    return {
        p.name: Scale.of(p, [float(s[p.name]) for s in starts if p.name in s]) for p in effect.parameters()
    }
