"""Random values of a study's uncertain parameters and damping, each sample from a seed of its own."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from fem.array_types import Floats
from fem.model import Damping, Model, ParameterRef
from updating.inference.parameters import Nuisance
from updating.inference.unknowns import ScaledUnknown, nuisance_unknowns


@dataclass(frozen=True, slots=True)
class Draw:
    """One sample.

    Attributes
    ----------
    values : ndarray (n_par,)
        Of the uncertain parameters [SI].
    ratio : ndarray (n_knots,)
        Factors of the modal damping ratio at the knots [-].
    others : tuple of float
        Factors of the loss factor, of alpha and of beta [-].
    """

    values: Floats
    ratio: Floats
    others: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """Independent priors of parameters and of the damping, as fits take them.

    Positive quantities are log-normal, others normal within the bounds of the parameter. Each factor of the
    damping is log-normal.

    Attributes
    ----------
    unknowns : tuple of ScaledUnknown
    knots : ndarray (n,)
        Frequencies at which the modal damping ratio varies by itself [Hz].
    damping : Damping
        Nominal, of the whole structure.
    damping_std : float
        Standard deviation of the logarithm of each factor of the damping [-].
    """

    unknowns: tuple[ScaledUnknown, ...]
    knots: Floats
    damping: Damping
    damping_std: float

    @classmethod
    def of(
        cls, model: Model, nuisances: Sequence[Nuisance], damping_std: float, modes: Floats
    ) -> "Uncertainty":
        """Return the uncertainty of a model.

        Parameters
        ----------
        model : Model
        nuisances : sequence of Nuisance
        damping_std : float
        modes : ndarray (n_modes,)
            Elastic natural frequencies within the band [Hz].

        Raises
        ------
        ModelError
            For a parameter that the model does not have, or that changes a constraint.
        """
        # Frequencies at which the damping ratio varies by itself, at most, as in a fit [-]
        n = int(np.clip(len(modes) // 2, 1, 8))
        knots = np.unique(np.quantile(modes, np.linspace(0, 1, n))) if len(modes) else np.ones(1)
        return cls(nuisance_unknowns(model, nuisances), knots, model.damping, damping_std)

    @property
    def refs(self) -> tuple[ParameterRef, ...]:
        """The parameters that vary."""
        return tuple(u.ref for u in self.unknowns)

    def draw(self, seed: int, k: int) -> Draw:
        """Return sample k of a seed; it depends on nothing else."""
        u = np.random.default_rng((seed, k)).random(len(self.unknowns) + len(self.knots) + 3)
        n = len(self.unknowns)
        values = np.array([_within(v, p) for v, p in zip(self.unknowns, u[:n], strict=True)])
        factors = np.exp(self.damping_std * scipy.special.ndtri(u[n:]))
        loss, alpha, beta = (float(f) for f in factors[-3:])
        return Draw(values, factors[:-3], (loss, alpha, beta))

    def ratio(self, draw: Draw, frequency: Floats) -> Floats:
        """Return the modal damping ratio of a sample at frequencies [Hz]."""
        at, knots = np.log(np.maximum(frequency, 1e-9 * self.knots[0])), np.log(self.knots)
        return self.damping.ratio_at(frequency) * np.exp(np.interp(at, knots, np.log(draw.ratio)))

    def of_structure(self, draw: Draw, frequency: Floats) -> Damping:
        """Return the damping of a sample, with the modal ratio exact at some rising frequencies [Hz]."""
        loss, alpha, beta = draw.others
        d = self.damping
        return replace(
            Damping.modal(self.ratio(draw, frequency), frequency),
            loss_factor=loss * d.loss_factor,
            alpha=alpha * d.alpha,
            beta=beta * d.beta,
        )


def _within(unknown: ScaledUnknown, u: float) -> float:
    """Return the value of an unknown at a probability, of a normal x within the bounds of the parameter."""
    if unknown.log:
        return unknown.to_value(unknown.mean + unknown.std * float(scipy.special.ndtri(u)))
    low, high = ((x - unknown.mean) / unknown.std for x in (unknown.low, unknown.high))
    share = scipy.special.ndtr(low) + u * (scipy.special.ndtr(high) - scipy.special.ndtr(low))
    return unknown.to_value(unknown.mean + unknown.std * float(scipy.special.ndtri(share)))
