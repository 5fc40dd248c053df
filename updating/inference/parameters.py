"""What may vary in a fit.

These are nuisance parameters with prior knowledge, the damping curve, and effects' parameters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.effects.joint import Spread
from fem.model import Effect, Model, ModelError, Parameter, ParameterRef

CONNECTIONS_REACH = 2.0
"""Connections' damping is let off by at most so many standard deviations; more is an effect of its own."""


@dataclass(frozen=True, slots=True)
class Nuisance:
    """A parameter of the model that is known only roughly.

    Attributes
    ----------
    effect, parameter : str
        Names of an effect of the model and of its parameter.
    std : float
        Relative standard deviation [-]; of the logarithm for positive quantities.
    """

    effect: str
    parameter: str
    std: float


@dataclass(frozen=True, slots=True, eq=False)
class DampingCurve:
    """The modal damping ratio as a smooth function of frequency: a power of it between knots.

    ζ(f) = exp(Σ z_k B_k(f)), B_k the hat functions of the knots over ln f; constant outside. Damping in
    proportion to mass or stiffness is a power of f, 1/f or f, and so followed exactly.

    Connections may be damped otherwise than members: ζ_c(f) = r ζ̄ (f/f̄)^b, with ζ̄ and f̄ the geometric means
    of ζ and f at the knots. Then r and b are two more unknowns, behind the ratios at the knots, as r and
    exp(b).

    Attributes
    ----------
    knots : ndarray (n,)
        Frequencies [Hz].
    nominal : ndarray (n,)
        Nominal ratios at the knots [-].
    std : float
        Standard deviation of the logarithm at a knot, of ln r and of b [-].
    connections : bool
        Whether connections have a ratio of their own.
    base : callable, optional
        From frequencies [Hz] to the nominal ζ (n_freq,), or with connections that and theirs (2, n_freq).
        The curve is this at its start, whatever lies between the knots, and all unknowns multiply it; a
        nominal curve of powers of frequency between the knots unless given.
    """

    knots: NDArray[np.float64]
    nominal: NDArray[np.float64]
    std: float
    connections: bool = False
    base: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None

    @property
    def start(self) -> NDArray[np.float64]:
        """All unknowns at their nominal values, (n_unknowns,)."""
        return np.concatenate([self.nominal, np.ones(2 if self.connections else 0)])

    @property
    def limits(self) -> NDArray[np.float64]:
        """Bounds of their logarithms, (n_unknowns, 2)."""
        ratio = np.log([[1e-5, 0.3]])
        other = CONNECTIONS_REACH * self.std * np.array([[-1.0, 1.0]])
        return np.repeat(np.vstack([ratio, other]), [len(self.knots), 2 if self.connections else 0], axis=0)

    def hats(self, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return B, by which ln ζ = B ln(unknowns): (n_freq, n_knots), or (2, n_freq, n_knots + 2).

        With connections the second of the two is theirs.
        """
        at, knots = np.log(np.maximum(frequency, 1e-9 * self.knots[0])), np.log(self.knots)
        hats = np.stack([np.interp(at, knots, row) for row in np.eye(len(knots))], axis=1)
        if not self.connections:
            return hats
        out = np.zeros((2, len(at), len(knots) + 2))
        out[0, :, : len(knots)] = hats
        out[1, :, : len(knots)] = 1 / len(knots)
        out[1, :, len(knots)] = 1
        out[1, :, len(knots) + 1] = at - knots.mean()
        return out

    def ratio(self, frequency: NDArray[np.float64], unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return ζ at frequencies [Hz], (n_freq,), or with connections that and theirs, (2, n_freq) [-]."""
        return np.exp(self.hats(frequency) @ np.log(unknowns) + self.offset(frequency))

    def offset(self, frequency: NDArray[np.float64]) -> Any:
        """Return what ln ζ has besides B ln(unknowns), as :meth:`ratio` has its shape; 0 without a base."""
        if self.base is None:
            return 0.0
        return np.log(self.base(frequency)) - self.hats(frequency) @ np.log(self.start)


@dataclass(frozen=True, slots=True, eq=False)
class Variable:
    """One unknown of a fit on its own scale, x = ln θ or θ / unit.

    Attributes
    ----------
    ref : (str, str)
    parameter : Parameter
    scale : float
        For linear parameters, the size of one unit of x.
    prior : float or None
        Mean of x.
    std : float or None
        Standard deviation of x; None for a free parameter.
    """

    ref: ParameterRef
    parameter: Parameter
    scale: float
    prior: float | None
    std: float | None

    def to_x(self, value: float) -> float:
        """Return x of a value."""
        return float(np.log(value)) if self.parameter.log else value / self.scale

    def to_value(self, x: float) -> float:
        """Return the value of x."""
        return float(np.exp(x)) if self.parameter.log else x * self.scale

    def slope(self, x: float) -> float:
        """Return dθ/dx."""
        return float(np.exp(x)) if self.parameter.log else self.scale

    def deviation(self, x: float, std: float) -> float:
        """Return half the width of the interval of θ for x ± its deviation, θ sinh(std) of θ = exp x.

        For small deviations that is |dθ/dx| std; of a stiffness that may be anything the first order would
        say that it is known to a few times its value.
        """
        return float(np.exp(x) * np.sinh(std)) if self.parameter.log else abs(self.scale) * std

    @property
    def unit(self) -> float:
        """Size of one unit of x: 1 where x = ln θ, or in that of θ."""
        return 1.0 if self.parameter.log else self.scale

    def bounds(self) -> tuple[float, float]:
        """Return the bounds of x."""
        p = self.parameter
        lo, hi = p.lower, p.upper
        if (
            self.std is not None and self.prior is not None
        ):  # what is known within ±std is not let off beyond 4 of it
            near = self.prior - 4 * self.std, self.prior + 4 * self.std
            return near if p.log else (max(near[0], lo / self.scale), min(near[1], hi / self.scale))
        if p.log:
            return float(np.log(lo)), float(np.log(hi))
        return lo / self.scale, hi / self.scale


def nuisance_variables(model: Model, nuisances: Sequence[Nuisance]) -> tuple[Variable, ...]:
    """Return the unknowns of nuisance parameters, with their priors at the nominal values."""
    out = []
    for n in nuisances:
        known = {p.name: p for p in model.effect(n.effect).parameters()}
        if n.parameter not in known:
            msg = f"effect '{n.effect}' has no parameter '{n.parameter}'; it has {', '.join(known)}"
            raise ValueError(msg)
        refuse_constraining(model, (n.effect, n.parameter))
        p = known[n.parameter]
        if p.log:
            out.append(Variable((n.effect, n.parameter), p, 1.0, float(np.log(p.value)), n.std))
        else:
            scale = abs(p.value) or 1.0
            out.append(Variable((n.effect, n.parameter), p, scale, p.value / scale, n.std))
    return tuple(out)


def refuse_constraining(model: Model, ref: ParameterRef) -> None:
    """Refuse a parameter by which constraints change: matrices on a basis do not follow it.

    Raises
    ------
    ModelError
    """
    effect, parameter = ref
    if isinstance(model.effect(effect), Spread):
        msg = (
            f"'{parameter}' of effect '{effect}' changes what constrains the model, and cannot vary in a "
            "fit; state it, or let a diagnosis choose it"
        )
        raise ModelError(msg)


def effect_variables(effects: Sequence[Effect], start: Sequence[dict[str, float]]) -> tuple[Variable, ...]:
    """Return the unknowns of candidate effects; the scale of a linear parameter is the size of its start."""
    out = []
    for effect, values in zip(effects, start, strict=True):
        for p in effect.parameters():
            reach = [abs(b) for b in (p.lower, p.upper) if np.isfinite(b)]
            scale = abs(values[p.name]) or (0.1 * max(reach) if reach else 1.0)
            out.append(Variable((effect.name, p.name), p, scale, None, None))
    return tuple(out)
