"""Sliders' scales: positions along them, and the values of parameters that they stand for."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem.model import Effect, Parameter
from updating.inference.fit import FitProblem

N_STEPS = 400
"""Steps of a slider [-]."""
HALF = 10**1.5
"""A slider spans three decades: so many times less and more than the value of interest, in its middle [-]."""
RIGID_OR_FREE = 1e3
"""A spring so many times stiffer or softer than what is around it acts as rigid or free, to 0.1 % [-]."""


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
            With its present value, which is of interest unless the effect is absent there. A spring's scale
            runs from rigid to free, whatever its value.
        starts : sequence of float
            Values that a search would begin with: they tell which sizes matter.
        """
        absent = p.absent if np.isfinite(p.absent) and not p.log else 0.0
        off = [abs(v - absent) for v in starts if np.isfinite(v) and v != absent]
        now = abs(p.value - absent) if np.isfinite(p.value) else 0.0
        usual = float(np.exp(np.mean(np.log(off)))) if off else now or 1.0
        if p.reciprocal is not None:
            near, far = usual / RIGID_OR_FREE, max(usual * RIGID_OR_FREE, HALF * now)
            if p.log:
                ends = max(p.lower, min(near, (now or near) / HALF)), min(p.upper, far)
                return cls(True, 0.0, 1.0, *(float(x) for x in np.log10(ends)))
            return cls(False, absent, near, 0.0, float(np.arcsinh(min(p.upper - absent, far) / near)))
        middle = now or usual
        lower, upper = max(p.lower, absent - HALF * middle), min(p.upper, absent + HALF * middle)
        if p.log:
            lower = max(p.lower, middle / HALF)
            return cls(True, 0.0, 1.0, float(np.log10(lower)), float(np.log10(upper)))
        size = min(max(min(off, default=middle), middle / HALF), middle)
        if p.position:
            lower, upper = p.lower, p.upper
            size = 1e3 * (upper - lower)
        low, high = np.arcsinh((np.array([lower, upper]) - absent) / size)
        return cls(False, float(absent), float(size), float(low), float(high))

    def holds(self, value: float) -> bool:
        """Return whether a value is on the scale and off its ends."""
        return self.low + self.step < self.position(value) < self.high - self.step

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
