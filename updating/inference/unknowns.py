"""What an updating varies: parameters alone or in groups, with priors and bounds, damping, and nuisances."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.model import Model, ModelError, Parameter, ParameterRef
from updating.inference.parameters import refuse_constraining
from updating.inference.residuals import COMMON, FRFData, FRFResidual

WIDTH = 0.2
"""What a parameter without a prior may be wrong by where a scale is needed: relative, or of its scale [-]."""

_KNOTS = 20
"""Most damping ratios that are fitted unless knots are given."""


@dataclass(frozen=True, slots=True)
class Unknown:
    """A quantity that is updated: a parameter, or several that move together.

    Parameters on a logarithmic scale are all multiplied by the same factor, others all changed by the same
    amount; the value is that of the first.

    Attributes
    ----------
    refs : tuple of (effect, parameter)
        What it moves.
    std : float or None
        Standard deviation of the prior: relative for a log-normal one [-], in the parameter's unit for a
        normal one. None for no prior.
    prior : str
        ``"log-normal"``, ``"normal"``, or empty for what suits the parameter.
    mean : float or None
        Median of the prior; the model's value unless given.
    start : float or None
        Where to start; the mean unless given.
    lower, upper : float or None
        Bounds; the parameter's own unless given.
    name : str
        For tables; ``"effect parameter"`` unless given.
    """

    refs: tuple[ParameterRef, ...]
    std: float | None = None
    prior: str = ""
    mean: float | None = None
    start: float | None = None
    lower: float | None = None
    upper: float | None = None
    name: str = ""


Parameters = Sequence[ParameterRef | Unknown] | Mapping[ParameterRef, float | None]
"""Parameters, unknowns, or prior standard deviations by parameter."""


@dataclass(frozen=True, slots=True, eq=False)
class Scaled:
    """An unknown on its own scale, x = ln θ or θ/scale, and what it moves."""

    name: str
    unit: str
    refs: tuple[ParameterRef, ...]
    at: NDArray[np.float64]  # the model's values of refs
    first: float  # the value of the unknown in the model
    log: bool
    scale: float
    start: float
    low: float
    high: float
    mean: float
    std: float  # of x; inf without prior
    prior_std: float | None
    width: float  # what x may be wrong by
    absent: float = (
        np.nan
    )  # x where what it stands for is not there, within the bounds; NaN where there is none

    def x_of(self, value: float) -> float:
        """Return x of a value."""
        return float(np.log(value)) if self.log else value / self.scale

    def value_of(self, x: float) -> float:
        """Return the value of x."""
        return float(np.exp(x)) if self.log else x * self.scale

    def slope(self, x: float) -> float:
        """Return the derivative of the value by x."""
        return float(np.exp(x)) if self.log else self.scale

    def moved(self, x: float) -> NDArray[np.float64]:
        """Return the values of what it moves."""
        value = self.value_of(x)
        return self.at * (value / self.first) if self.log else self.at + (value - self.first)

    def slopes(self, x: float) -> NDArray[np.float64]:
        """Return the derivatives of what it moves by x."""
        return self.moved(x) if self.log else np.full(len(self.at), self.scale)


def scaled_unknowns(model: Model, parameters: Parameters) -> tuple[Scaled, ...]:
    """Return the unknowns of parameters, checked."""
    given: list[Unknown] = []
    if isinstance(parameters, Mapping):
        given = [Unknown((ref,), std=std) for ref, std in parameters.items()]
    else:
        given = [p if isinstance(p, Unknown) else Unknown((p,)) for p in parameters]
    seen: set[ParameterRef] = set()
    out: list[Scaled] = []
    for unknown in given:
        scaled = _scaled(model, unknown)
        twice = seen & set(scaled.refs)
        if twice:
            effect, parameter = next(iter(twice))
            msg = f"parameter '{parameter}' of effect '{effect}' is updated twice; name it once"
            raise ModelError(msg)
        seen |= set(scaled.refs)
        out.append(scaled)
    return tuple(out)


def _scaled(model: Model, unknown: Unknown) -> Scaled:
    known: list[Parameter] = []
    if not unknown.refs or isinstance(unknown.refs[0], str):
        msg = f"an unknown moves {unknown.refs!r}; (effect, parameter) pairs are needed"
        raise ModelError(msg)
    for effect, name in unknown.refs:
        by_name = {p.name: p for p in model.effect(effect).parameters()}
        if name not in by_name:
            msg = f"effect '{effect}' has no parameter '{name}'; it has {', '.join(by_name) or 'none'}"
            raise ModelError(msg)
        refuse_constraining(model, (effect, name))
        known.append(by_name[name])
    p = known[0]
    label = unknown.name or " ".join(unknown.refs[0])
    if any(q.log != p.log or q.unit != p.unit for q in known):
        msg = f"'{label}' moves parameters of different kinds ({', '.join(q.unit for q in known)})"
        raise ModelError(msg)
    if unknown.prior not in ("", "normal", "log-normal"):
        msg = f"the prior of '{label}' is '{unknown.prior}'; allowed are normal, log-normal"
        raise ModelError(msg)
    if unknown.std is not None and not unknown.std > 0:
        msg = f"the prior of '{label}' has the standard deviation {unknown.std}; it must be positive"
        raise ModelError(msg)
    log = p.log if not unknown.prior else unknown.prior == "log-normal"
    mean = p.value if unknown.mean is None else unknown.mean
    start = mean if unknown.start is None else unknown.start
    lower = p.lower if unknown.lower is None else unknown.lower
    upper = p.upper if unknown.upper is None else unknown.upper
    if not np.isfinite([p.value, mean, start]).all() or (
        log and not (p.value > 0 and mean > 0 and start > 0)
    ):
        msg = (
            f"'{label}' has the value {p.value:g}, mean {mean:g} and start {start:g}; they must be finite"
            f"{' and positive' if log else ''}: give the model another value to start from"
        )
        raise ModelError(msg)
    if not lower < upper or not lower <= start <= upper:
        msg = f"'{label}' starts at {start:g} with the bounds {lower:g} and {upper:g}; it must lie between"
        raise ModelError(msg)
    reach = [abs(b) for b in (lower, upper) if np.isfinite(b) and b != 0]
    scale = 1.0
    if not log:
        scale = abs(p.value) or (0.1 * max(reach) if reach else unknown.std or 1.0)
    std = np.inf if unknown.std is None else unknown.std if log else unknown.std / scale
    low, high = (np.log(max(lower, 1e-300)), np.log(upper)) if log else (lower / scale, upper / scale)
    return Scaled(
        label, p.unit, tuple(unknown.refs), np.array([q.value for q in known], dtype=float), p.value, log,
        scale, float(np.log(start)) if log else start / scale, float(low), float(high),
        float(np.log(mean)) if log else mean / scale, float(std), unknown.std,
        float(std) if np.isfinite(std) else WIDTH,
        _absent(p, log, scale, lower, upper),
    )  # fmt: skip


def _absent(p: Parameter, log: bool, scale: float, lower: float, upper: float) -> float:
    """Return x of the value that means that an effect is absent, or of the bound next to it."""
    value = float(np.clip(p.absent, lower, upper))
    if not np.isfinite(value) or p.absent == p.value:
        return np.nan
    return float(np.log(max(value, 1e-300))) if log else value / scale


def damping_knots(model: Model, data: FRFData, given: ArrayLike | None) -> NDArray[np.float64]:
    """Return the frequencies between which damping is linear: given ones, or those of the modes seen [Hz]."""
    if given is not None:
        knots = np.array(given, dtype=float, ndmin=1)
        if not (np.isfinite(knots).all() and (np.diff(knots) > 0).all() and knots.size):
            msg = f"the damping's frequencies are {knots.tolist()}; they must rise [Hz]"
            raise ModelError(msg)
        return knots
    f = FRFResidual(data.lines(np.inf, 20), model, (), margin=1.5).seen()
    if f.size < 2:
        return np.array([float(np.sqrt(data.frequency[0] * data.frequency[-1]))])
    return np.unique(f if f.size <= _KNOTS else np.quantile(f, np.linspace(0, 1, _KNOTS)))


def nuisances_of(knots: NDArray[np.float64], data: FRFData) -> list[Scaled]:
    """Return what the model misses though its parameters are right: shifts of frequencies, and gains.

    Part of the shifts' variance is common to all: models tend to be too stiff, or too soft, throughout.
    """
    shifts, gains = [], []
    if knots.size:
        common, own = data.model_error * np.sqrt(COMMON), data.model_error * np.sqrt(1 - COMMON)
        shifts = [("shift of all", common), *((f"shift at {f:.4g} Hz", own) for f in knots.tolist())]
    if data.amplitude_error > 0:
        names = [f"gain of output {i}" for i in range(data.outputs.shape[1])]
        names += [f"gain of input {i}" for i in range(data.inputs.shape[1])]
        gains = [(name, data.amplitude_error) for name in names]
    return [
        Scaled(name, "-", (), np.zeros(0), 0.0, False, 1.0, 0.0, -8 * std, 8 * std, 0.0, std, std, std)
        for name, std in (*shifts, *gains)
    ]


def damping_ratios(model: Model, knots: NDArray[np.float64]) -> list[Scaled]:
    """Return modal damping ratios as unknowns, which start at the model's; ln ζ is known within 1.5."""
    d = model.damping
    omega = 2 * np.pi * knots
    other = (d.alpha / omega + d.beta * omega + d.loss_factor) / 2
    ratio = d.ratio_at(knots)
    start = np.where(ratio > 0, ratio, np.where(other > 0, 0.1 * other, 0.005))
    return [
        Scaled(
            f"damping at {f:.4g} Hz", "-", (), np.zeros(0), z, True, 1.0, float(np.log(z)),
            float(np.log(1e-6)), float(np.log(0.5)), float(np.log(z)), 1.5, 1.5, 1.5,
        )
        for f, z in zip(knots.tolist(), start.tolist(), strict=True)
    ]  # fmt: skip
