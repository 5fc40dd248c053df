"""The result of an update: parameters before and after, the path between them, and how it ended."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
import scipy

from fem.array_types import Floats
from fem.model import Model, ParameterRef
from fem.summary import fields_summary
from updating.inference.fit_function import Errors
from updating.inference.fit_result import FitResult
from updating.inference.mode_fit import ComputedModes
from updating.inference.problem import Problem
from updating.inference.regularisation import LCurve
from updating.inference.sampling import Samples
from updating.inference.update_settings import UpdateSettings


class Ending(Enum):
    """Ending of an updating, with its cause and a remedy."""

    CONVERGED = ("converged", "the last step is small compared with the standard deviations", "")
    OUT_OF_ITERATIONS = (
        "out of iterations",
        "the misfit was still falling",
        "allow more iterations, or start nearer: a wrong start makes steps short",
    )
    NO_PARTNERS = (
        "no partners",
        "no measured mode looks like a mode of the model at the start",
        "check the outputs' points, directions and signs, or raise the number of starts",
    )
    NOTHING_DETERMINED = (
        "nothing determined",
        "no measured mode or line changes with any of the parameters",
        "check which modes the measured ones are (shapes, or numbers), or name other parameters",
    )
    AT_BOUNDS = (
        "at bounds",
        "every parameter has run to a bound",
        "the model lacks an effect, or the bounds are too narrow: look for a missing effect",
    )

    @property
    def cause(self) -> str:
        """Cause of the ending."""
        return self.value[1]

    @property
    def remedy(self) -> str:
        """Advice to the user; empty where nothing need be done."""
        return self.value[2]


@dataclass(frozen=True, slots=True)
class UpdatedParameter:
    """One unknown before and after.

    Attributes
    ----------
    name, unit : str
    refs : tuple of (effect, parameter)
        Parameters that it moves; empty for a damping ratio.
    start, lower, upper : float
        [unit]
    prior_std : float or None
        Relative for a log-normal prior, in its unit for a normal one.
    value, std : float
        [unit]; the deviation is infinite where the data say nothing, and NaN at a bound.
    log : bool
        Whether the logarithm is normally distributed.
    at_bound : bool
    determined : bool
        Whether the data, and not the prior, determine it.
    from_prior : float
        How far the value is from the prior's mean, in its standard deviations; NaN without a prior [-].
    """

    name: str
    unit: str
    refs: tuple[ParameterRef, ...]
    start: float
    lower: float
    upper: float
    prior_std: float | None
    value: float
    std: float
    log: bool
    at_bound: bool
    determined: bool
    from_prior: float = np.nan

    @property
    def change(self) -> str:
        """Change of the value from its start as text; a dash where it starts at 0."""
        return f"{100 * (self.value / self.start - 1):+.2f} %" if self.start else "-"

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Return the interval that holds the truth with a probability; symmetric in ln θ where ``log``."""
        half = float(scipy.special.ndtri(0.5 + level / 2)) * self.std
        if self.log:
            factor = float(np.exp(min(half / self.value, 700.0)))  # beyond is without bounds, as floats go
            return self.value / factor, self.value * factor
        return self.value - half, self.value + half


@dataclass(frozen=True, slots=True, eq=False)
class UpdateStep:
    """One accepted step.

    Attributes
    ----------
    stage : str
        ``"modes"``, or up to which frequency FRFs were fitted.
    values : ndarray (n,)
        Of all parameters [their units].
    cost : float
        Negative log posterior up to a constant; comparable within a stage.
    errors : Errors
        How far the model is from what was measured.
    """

    stage: str
    values: Floats
    cost: float
    errors: Errors


@dataclass(frozen=True, slots=True, eq=False)
class Updated:
    """An updated model, how it came about, and how far to trust it.

    Attributes
    ----------
    model : Model
        With the parameters at their updated values, the form and the damping as they were fitted.
    parameters : tuple of UpdatedParameter
        Then damping ratios, if they were fitted.
    correlation : ndarray (n, n)
        Of the estimates [-].
    covariance : ndarray (n, n)
        Linearised, of the values [products of their units].
    path : tuple of UpdateStep
        From the start to the end.
    misfit : mapping of str to float
        Mean square residual in units of the stated variance, of ``"modes"`` and ``"frf"``; 1 if nothing but
        noise as stated is left [-].
    modes : ComputedModes or None
        Partners of the measured modes, in their order.
    left_out : tuple of (name, reason)
        Parameters that selection kept at their start.
    curve : LCurve or None
        Of the regularisation.
    samples : Samples or None
        Of the values, if asked for.
    starts : tuple of (values, log evidence)
        Where several starts led.
    ending : Ending
    messages : tuple of str
        Doubts about the result.
    problem : Problem
        What was fitted.
    fitted : FitResult
        The fit.
    settings : UpdateSettings
    """

    model: Model
    parameters: tuple[UpdatedParameter, ...]
    correlation: Floats
    covariance: Floats
    path: tuple[UpdateStep, ...]
    misfit: Mapping[str, float]
    modes: ComputedModes | None
    left_out: tuple[tuple[str, str], ...]
    curve: LCurve | None
    samples: Samples | None
    starts: tuple[tuple[Floats, float], ...]
    ending: Ending
    messages: tuple[str, ...]
    problem: Problem[Any] = field(repr=False)
    fitted: FitResult = field(repr=False)
    settings: UpdateSettings

    __repr__ = fields_summary

    @property
    def converged(self) -> bool:
        """Whether it ended as it should."""
        return self.ending is Ending.CONVERGED

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns."""
        return tuple(p.name for p in self.parameters)

    @property
    def values(self) -> Floats:
        """Updated values, (n,) [their units]."""
        return np.array([p.value for p in self.parameters])

    @property
    def std(self) -> Floats:
        """Standard deviations, (n,) [their units]."""
        return np.array([p.std for p in self.parameters])

    def __getitem__(self, name: str) -> UpdatedParameter:
        for p in self.parameters:
            if p.name == name:
                return p
        msg = f"nothing named '{name}' was updated; there are {', '.join(self.names)}"
        raise KeyError(msg)

    def table(self) -> str:
        """Return start, value and standard deviation of each parameter as text, then the doubts."""
        width = max([len("parameter"), *(len(p.name) for p in self.parameters)])
        lines = [f"{'parameter':{width}}  {'start':>11}  {'value':>11}  {'std':>9}  {'change':>8}  unit"]
        for p in self.parameters:
            mark = " (at its bound)" if p.at_bound else "" if p.determined else " (not determined)"
            std = f"{p.std:9.2g}" if np.isfinite(p.std) else f"{'-':>9}"
            lines.append(
                f"{p.name:{width}}  {p.start:11.5g}  {p.value:11.5g}  {std}  {p.change:>8}  {p.unit}{mark}"
            )
        lines += [f"{name}: left at its start, as {reason}" for name, reason in self.left_out]
        return "\n".join([*lines, *self.messages])
