"""Unknowns of fits and updates: parameters alone or in groups, with priors, bounds and a scale."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from fem.array_types import Floats
from fem.model import Effect, Model, ModelError, Parameter, ParameterRef, parameter_values
from updating.inference.parameters import Nuisance, refuse_constraining

WIDTH = 0.2
"""Assumed error of a parameter without a prior, where a scale is needed: relative, or of its scale [-]."""


NUISANCE_REACH = 4.0
"""Bounds of nuisance parameters, in standard deviations of their priors [-]."""


@dataclass(frozen=True, slots=True)
class Unknown:
    """A quantity that is updated: a parameter, or several that move together.

    Parameters on a logarithmic scale are all multiplied by the same factor, others all changed by the same
    amount; the value is that of the first.

    Attributes
    ----------
    refs : tuple of (effect, parameter)
        Parameters that it moves.
    std : float or None
        Standard deviation of the prior: relative for a log-normal one [-], in the parameter's unit for a
        normal one. None for no prior.
    prior : str
        ``"log-normal"``, ``"normal"``, or empty for the parameter's usual one.
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

    def in_place_of(self, p: Parameter) -> tuple[bool, float, float, float, float]:
        """Return whether a parameter varies by its logarithm, its mean, start, and lower and upper bound."""
        log = p.log if not self.prior else self.prior == "log-normal"
        mean = p.value if self.mean is None else self.mean
        start = mean if self.start is None else self.start
        lower = p.lower if self.lower is None else self.lower
        return log, mean, start, lower, p.upper if self.upper is None else self.upper


Uncertain = Nuisance | Unknown
"""What is uncertain in every fit of a problem."""

Parameters = Sequence[ParameterRef | Unknown] | Mapping[ParameterRef, float | None]
"""Parameters, unknowns, or prior standard deviations by parameter."""


@dataclass(frozen=True, slots=True, eq=False)
class ScaledUnknown:
    """An unknown on its own scale, x = ln θ or θ/scale, which least squares and sampling vary.

    Attributes
    ----------
    name, unit : str
        For tables.
    refs : tuple of (effect, parameter)
        Parameters that it moves; empty where it is none of the model, such as a damping ratio.
    values : ndarray (n_refs,)
        The model's values of them [unit].
    nominal : float
        θ of the model, the value of the first [unit].
    log : bool
        Whether x = ln θ.
    scale : float
        One unit of x of a linear unknown [unit].
    start, low, high : float
        Start and bounds of x.
    mean, std : float
        Prior of x; the deviation is infinite without one.
    prior_std : float or None
        The prior's deviation as it was given: relative for positive parameters, or in the unit.
    width : float
        Assumed error of x: the prior's deviation, or ``WIDTH``.
    absent : float
        x at which an effect is absent, or the bound next to it; NaN where there is none.
    """

    name: str
    unit: str
    refs: tuple[ParameterRef, ...]
    values: Floats
    nominal: float
    log: bool
    scale: float
    start: float
    low: float
    high: float
    mean: float
    std: float = np.inf
    prior_std: float | None = None
    width: float = WIDTH
    absent: float = np.nan

    @classmethod
    def of(cls, unknown: Unknown, parameters: Sequence[Parameter]) -> "ScaledUnknown":
        """Return an unknown of parameters; nothing is checked (see :func:`checked_unknowns`)."""
        p = parameters[0]
        log, mean, start, lower, upper = unknown.in_place_of(p)
        # A parameter that is 0 has no size of its own: its bounds give one.
        reach = [abs(b) for b in (lower, upper) if np.isfinite(b) and b != 0]
        scale = 1.0 if log else abs(p.value) or (0.1 * max(reach) if reach else unknown.std or 1.0)
        std = np.inf if unknown.std is None else unknown.std / scale
        bare = cls(
            name=unknown.name or " ".join(unknown.refs[0]),
            unit=p.unit,
            refs=tuple(unknown.refs),
            values=np.array([q.value for q in parameters], dtype=float),
            nominal=p.value,
            log=log,
            scale=scale,
            start=0.0,
            low=0.0,
            high=0.0,
            mean=0.0,
            std=float(std),
            prior_std=unknown.std,
            width=float(std) if np.isfinite(std) else WIDTH,
        )
        return replace(
            bare,
            start=bare.to_x(start),
            low=bare.to_x(lower),
            high=bare.to_x(upper),
            mean=bare.to_x(mean),
            absent=_absent(bare, p, lower, upper),
        )

    @property
    def ref(self) -> ParameterRef:
        """The first of the parameters that it moves."""
        return self.refs[0]

    @property
    def has_prior(self) -> bool:
        """Whether anything is known of it beforehand."""
        return bool(np.isfinite(self.std))

    @property
    def size(self) -> float:
        """Size of one unit of x: 1 where x = ln θ, or in that of θ."""
        return 1.0 if self.log else self.scale

    def to_x(self, value: float) -> float:
        """Return x of a value."""
        if not self.log:
            return float(value / self.scale)
        return float(np.log(value)) if value > 0 else -np.inf

    def to_value(self, x: float) -> float:
        """Return the value of x."""
        return float(np.exp(x)) if self.log else x * self.scale

    def slope(self, x: float) -> float:
        """Return dθ/dx."""
        return float(np.exp(x)) if self.log else self.scale

    def deviation(self, x: float, std: float) -> float:
        """Return half the width of the interval of θ for x ± its deviation, θ sinh(std) of θ = exp x.

        For small deviations that is |dθ/dx| std; of a stiffness that may be anything the first order would
        say that it is known to a few times its value.
        """
        # Deviation of a logarithm beyond which half the width of an interval is no floating-point number [-]
        return float(np.exp(x) * np.sinh(min(std, 300.0))) if self.log else abs(self.scale) * std

    def deviations(self, x: float, std: float) -> dict[ParameterRef, float]:
        """Return the deviations of all parameters that it moves, as :meth:`deviation`."""
        deviation = self.deviation(x, std)
        size = np.abs(self.moved(x) / self.to_value(x)) if self.log else np.ones(len(self.refs))
        return dict(zip(self.refs, (deviation * size).tolist(), strict=True))

    def bounds(self) -> tuple[float, float]:
        """Return the bounds of x."""
        return self.low, self.high

    def moved(self, x: float) -> Floats:
        """Return the values of its parameters, moved by the same factor or by the same amount."""
        value = self.to_value(x)
        if len(self.values) == 1:
            return np.array([value])
        return self.values * (value / self.nominal) if self.log else self.values + (value - self.nominal)

    def slopes(self, x: float) -> Floats:
        """Return the derivatives by x of its parameters."""
        return self.moved(x) if self.log else np.full(len(self.values), self.scale)


def _absent(unknown: ScaledUnknown, p: Parameter, lower: float, upper: float) -> float:
    value = float(np.clip(p.absent, lower, upper))
    if not np.isfinite(value) or p.absent == p.value:
        return np.nan
    return unknown.to_x(max(value, 1e-300) if unknown.log else value)


def checked_unknowns(model: Model, parameters: Parameters) -> tuple[Unknown, ...]:
    """Return parameters as unknowns.

    Raises
    ------
    ModelError
        For parameters that the model does not have, or that are named twice or are of different kinds, and
        for priors, starts and bounds that contradict one another.
    """
    given: list[Unknown] = []
    if isinstance(parameters, Mapping):
        given = [Unknown((ref,), std=std) for ref, std in parameters.items()]
    else:
        given = [p if isinstance(p, Unknown) else Unknown((p,)) for p in parameters]
    seen: set[ParameterRef] = set()
    for unknown in given:
        _check(unknown, _parameters_of(model, unknown))
        twice = seen & set(unknown.refs)
        if twice:
            effect, parameter = next(iter(twice))
            msg = f"parameter '{parameter}' of effect '{effect}' is updated twice; name it once"
            raise ModelError(msg)
        seen |= set(unknown.refs)
    return tuple(given)


def _parameters_of(model: Model, unknown: Unknown) -> list[Parameter]:
    known: list[Parameter] = []
    if not unknown.refs or isinstance(unknown.refs[0], str):
        msg = f"an unknown moves {unknown.refs!r}; (effect, parameter) pairs are needed"
        raise ModelError(msg)
    for ref in unknown.refs:
        known.append(_parameter(model, ref))
        refuse_constraining(model, ref)
    return known


def _parameter(model: Model, ref: ParameterRef) -> Parameter:
    effect, name = ref
    by_name = {p.name: p for p in model.effect(effect).parameters()}
    if name not in by_name:
        msg = f"effect '{effect}' has no parameter '{name}'; it has {', '.join(by_name) or 'none'}"
        raise ModelError(msg)
    return by_name[name]


def _check(unknown: Unknown, known: Sequence[Parameter]) -> None:
    """Refuse parameters that cannot move together, and priors, starts and bounds that do not fit."""
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
    log, mean, start, lower, upper = unknown.in_place_of(p)
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


def unknown_of(model: Model, nuisance: Nuisance) -> Unknown:
    """Return a nuisance parameter as an unknown with its prior.

    Raises
    ------
    ModelError
        If the effect has no such parameter.
    """
    ref = nuisance.effect, nuisance.parameter
    p = _parameter(model, ref)
    if nuisance.mean is not None:
        return Unknown((ref,), std=nuisance.std, prior="normal", mean=nuisance.mean, start=p.value)
    # A nuisance is known relative to its value; one that is 0, in its unit.
    return Unknown((ref,), std=nuisance.std if p.log else nuisance.std * (abs(p.value) or 1.0))


def values_at(variables: Sequence[ScaledUnknown], x: Floats) -> Floats:
    """Return the values (n_refs,) of the parameters that unknowns move, in their order."""
    return np.array([value for v, xi in zip(variables, x, strict=True) for value in v.moved(xi)])


def by_unknowns(variables: Sequence[ScaledUnknown], x: Floats, by_refs: NDArray[Any]) -> NDArray[Any]:
    """Return derivatives (n, ...) by unknowns from those by the parameters that they move, (n_refs, ...)."""
    slopes = [v.slopes(xi) for v, xi in zip(variables, x, strict=True)]
    every = np.concatenate([*slopes, np.zeros(0)])
    scaled = by_refs * every.reshape(-1, *[1] * (by_refs.ndim - 1))
    if len(every) == len(slopes):
        return scaled
    first = np.cumsum([0, *map(len, slopes)][:-1])
    return np.add.reduceat(scaled, first, axis=0)


def nuisance_unknowns(model: Model, nuisances: Sequence[Uncertain]) -> tuple[ScaledUnknown, ...]:
    """Return the unknowns of uncertain parameters.

    Those of a :class:`Nuisance` have their prior at the nominal value, and stay within ``NUISANCE_REACH``
    standard deviations: an error beyond that is an effect of its own.
    """
    out = []
    for nuisance in nuisances:
        if isinstance(nuisance, Unknown):
            out.append(ScaledUnknown.of(nuisance, _parameters_of(model, nuisance)))
            continue
        unknown = unknown_of(model, nuisance)
        scaled = ScaledUnknown.of(unknown, _parameters_of(model, unknown))
        low = scaled.mean - NUISANCE_REACH * scaled.std
        high = scaled.mean + NUISANCE_REACH * scaled.std
        if not scaled.log:
            low, high = max(low, scaled.low), min(high, scaled.high)
        out.append(replace(scaled, low=low, high=high))
    return tuple(out)


def effect_unknowns(
    effects: Sequence[Effect], starts: Sequence[dict[str, float]]
) -> tuple[ScaledUnknown, ...]:
    """Return the unknowns of candidate effects; the scale of a linear parameter is the size of its start."""
    return tuple(
        ScaledUnknown.of(Unknown(((effect.name, p.name),)), [replace(p, value=values[p.name])])
        for effect, values in zip(effects, starts, strict=True)
        for p in effect.parameters()
    )


# Priors of the parameters of effects ------------------------------------------------------------------------


DECADE = 10.0
"""An unknown whose plausible sizes span more than this factor may be of any order of magnitude [-]."""


class Surrounded(Protocol):
    """A problem that knows how stiff the structure is around a constraint."""

    def surroundings(self, key: tuple[str, str]) -> float:
        """Return the median impedance to motion along a released constraint [N/m, N·m/rad]."""
        ...


@dataclass(frozen=True, slots=True)
class EffectPrior:
    """The prior of an unknown of an effect.

    Attributes
    ----------
    mean, std : float
        Of a normal density.
    least, range : float
        Of a size that may be of any order of magnitude, ``range`` is the logarithm of how much larger the
        largest plausible one is than the ``least``, twice that where it has either sign: its density is
        1 / (|x| range). 0 for others.
    """

    mean: float
    std: float
    least: float = 0.0
    range: float = 0.0

    def width_at(self, x: float) -> float:
        """Return the standard deviation of a normal density that is as high at its mean as this is at x."""
        return max(abs(x), self.least) * self.range / float(np.sqrt(2 * np.pi))

    def mass(self, low: float, high: float) -> float:
        """Return the probability of values between two, of which there may be more than are plausible."""
        x = np.array([low, high])
        if not self.range:
            F = scipy.special.ndtr((x - self.mean) / self.std)
        else:
            size = np.abs(x) / self.least
            F = np.sign(x) * np.where(size < 1, size, 1 + np.log(np.maximum(size, 1.0))) / self.range
        return min(abs(float(F[1] - F[0])), 1.0)


def prior_of(problem: Surrounded, effect: Effect, variable: ScaledUnknown) -> EffectPrior:
    """Return what is known beforehand of an unknown of an effect.

    As wide as the grid from which the effect asks to be started, on the scale of the unknown: it spans what
    is plausible, decades of a stiffness, a member's length, or a fifth of its mass. An unknown with one value
    on it has the width of its bounds.
    """
    name = variable.ref[1]
    grid = effect.starts(problem.surroundings)
    x = np.array([variable.to_x(point[name]) for point in grid if name in point])
    size = np.abs(x)
    p = next(q for q in effect.parameters() if q.name == name)
    sized = len(x) > 0 and not p.log and p.absent == 0 and size.min() > 0
    if sized and size.max() > DECADE * size.min():
        signs = 2 if x.min() < 0 < x.max() else 1
        return EffectPrior(0.0, float(size.max()), float(size.min()), signs * np.log(size.max() / size.min()))
    if len(x) and np.ptp(x) > 0:
        return EffectPrior(float(x.mean()), float(x.std()))
    lo, hi = variable.bounds()
    width = hi - lo if np.isfinite(hi - lo) else 6.0
    centre = float(x.mean()) if len(x) else (lo + hi) / 2
    return EffectPrior(centre, float(min(width / 12**0.5, 10.0)))


def log_occam_factor(problem: Surrounded, effect: Effect, n_deviations: float, n_positions: int) -> float:
    """Return ln of the share of an effect's sizes and positions that are as likely as its best one.

    A size of so many of its standard deviations is known to 1 / ``n_deviations`` of itself, and one of
    ``n_positions`` is the best: the factor by which the evidence of the effect is less than its likelihood
    (MacKay, *Information Theory, Inference, and Learning Algorithms*, 2003, ch. 28).
    """
    variables = effect_unknowns((effect,), (parameter_values(effect),))
    first = effect.name, effect.parameters()[0].name
    span = next((prior_of(problem, effect, v).range for v in variables if v.ref == first), 0.0)
    return -float(np.log(max(span, 1.0) * n_deviations / np.sqrt(2 * np.pi)) + np.log(max(n_positions, 1)))
