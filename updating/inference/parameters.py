"""Nuisance parameters and the damping curve, which fits vary besides the effects in question."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.array_types import Floats
from fem.effects.joint import Spread
from fem.model import Model, ModelError, ParameterRef


@dataclass(frozen=True, slots=True)
class Nuisance:
    """A parameter of the model that is known only roughly.

    Attributes
    ----------
    effect, parameter : str
        Names of an effect of the model and of its parameter.
    std : float
        Relative standard deviation [-]; of the logarithm for positive quantities. With a mean that of the
        parameter in its unit.
    mean : float or None
        Mean of a normal prior [unit of the parameter]; the model's value unless given.
    """

    effect: str
    parameter: str
    std: float
    mean: float | None = None

    @property
    def refs(self) -> tuple[ParameterRef]:
        """The parameter, as of an :class:`updating.inference.unknowns.Unknown`."""
        return ((self.effect, self.parameter),)


@dataclass(frozen=True, slots=True, eq=False)
class DampingCurve:
    """The modal damping ratio as a smooth function of frequency: a power of it between knots.

    ζ(f) = exp(Σ z_k B_k(f)), B_k the hat functions of the knots over ln f; constant outside. Damping in
    proportion to mass or stiffness is a power of f, 1/f or f, and so followed exactly.

    Connections may be damped otherwise than members: ζ_c(f) = r ζ̄ (f/f̄)^b, with ζ̄ and f̄ the geometric
    means of ζ and f at the knots. Then r and b are two more unknowns, behind the ratios at the knots, as r
    and exp(b).

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

    knots: Floats
    nominal: Floats
    std: float
    connections: bool = False
    base: Callable[[Floats], Floats] | None = None

    @property
    def start(self) -> Floats:
        """All unknowns at their nominal values, (n_unknowns,)."""
        return np.concatenate([self.nominal, np.ones(2 if self.connections else 0)])

    @property
    def limits(self) -> Floats:
        """Bounds of their logarithms, (n_unknowns, 2)."""
        ratio = np.log([[1e-5, 0.3]])
        # Connections' damping is let off by at most so many standard deviations; more is an effect of its own
        other = 2.0 * self.std * np.array([[-1.0, 1.0]])
        return np.repeat(np.vstack([ratio, other]), [len(self.knots), 2 if self.connections else 0], axis=0)

    def hats(self, frequency: Floats) -> Floats:
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

    def ratio(self, frequency: Floats, unknowns: Floats) -> Floats:
        """Return ζ at frequencies [Hz], (n_freq,), or with connections that and theirs, (2, n_freq) [-]."""
        return np.exp(self.hats(frequency) @ np.log(unknowns) + self.offset(frequency))

    def offset(self, frequency: Floats) -> Any:
        """Return ln ζ less B ln(unknowns), shaped as of :meth:`ratio`; 0 without a base."""
        if self.base is None:
            return 0.0
        return np.log(self.base(frequency)) - self.hats(frequency) @ np.log(self.start)


def refuse_constraining(model: Model, ref: ParameterRef) -> None:
    """Refuse a parameter by which constraints change: matrices on a basis do not follow it.

    Raises
    ------
    ModelError
    """
    effect, parameter = ref
    if isinstance(model.effect(effect), Spread):
        msg = (
            f"'{parameter}' of effect '{effect}' changes a constraint of the model, and cannot vary in a "
            "fit; state it, or let a diagnosis choose it"
        )
        raise ModelError(msg)
