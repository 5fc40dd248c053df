"""A fitted model: values, standard deviations, and errors on fitted and held-out lines."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fem.array_types import Floats
from fem.model import Effect, Model, ParameterRef
from fem.summary import counted, listed, summary
from updating.inference.solve import Solution
from updating.least_squares.costs import Costs
from updating.measurement.channel_errors import N_ERRORS


@dataclass(frozen=True, slots=True, eq=False)
class FitResult:
    """A fitted model.

    Attributes
    ----------
    solution : Solution
    values : mapping of (effect, parameter) to float
        Values of all parameters that varied.
    std : mapping of (effect, parameter) to float
        Standard deviations: linearised, of parameters that are fitted in the logarithm half the width of the
        interval.
    zeta : ndarray (n_unknowns,)
        The damping curve's unknowns: first the ratios at its knots [-].
    effects : tuple of Effect
        The added effects at their fitted values.
    fit_db, held_out_db : float
        Root mean square of the amplitude's error on the lines fitted and held out [dB].
    level : float
        Robust residual level, amplitude and phase, on the lines fitted [nepers].
    covariance : ndarray (n, n)
        Of the values, in their order, and the damping curve's unknowns: of ln θ for positive parameters and
        these unknowns, and of θ for others. Empty without a fit.
    unseen : float
        Negative log likelihood of the lines held out, as that of the fitted ones is minimised [-]; NaN unless
        it was assessed.
    scatter : ndarray (n,)
        The small deviations that varied too, but those of channels [-].
    channels, channels_std : ndarray (n_sensors + n_excitations, 5)
        Errors of the channels, as of :class:`ChannelErrors`, and their standard deviations; empty where none
        varied.
    log_evidence : float
        ln p(data | model), up to a constant that all models on the same lines share; NaN without a fit.
    levels : Costs or None
        How probable error levels are.
    misfit : ndarray (n_groups,)
        Robust mean square of the residuals of each group [nepers²].
    size : float, optional
        Most probable size of the shifts of modes' eigenvalues, if they may be of several [-].
    """

    solution: Solution
    values: Mapping[ParameterRef, float]
    std: Mapping[ParameterRef, float]
    zeta: Floats
    effects: tuple[Effect, ...]
    fit_db: float
    held_out_db: float
    level: float
    covariance: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    unseen: float = np.nan
    scatter: Floats = field(default_factory=lambda: np.zeros(0))
    channels: Floats = field(default_factory=lambda: np.zeros((0, N_ERRORS)))
    channels_std: Floats = field(default_factory=lambda: np.zeros((0, N_ERRORS)))
    log_evidence: float = np.nan
    levels: Costs | None = None
    misfit: Floats = field(default_factory=lambda: np.zeros(0))
    size: float | None = None

    def with_estimated(
        self, effect: Effect, values: Mapping[str, float], std: Mapping[str, float], gain: float
    ) -> "FitResult":
        """Return a fit with one effect more that was not made: all else stays, the evidence rises by a gain.

        Parameters
        ----------
        effect : Effect
        values, std : mapping of str to float
            Of its parameters.
        gain : float
            [nats]
        """
        return replace(
            self,
            effects=(*self.effects, effect.with_values(**values)),
            values={**self.values, **{(effect.name, key): value for key, value in values.items()}},
            std={**self.std, **{(effect.name, key): value for key, value in std.items()}},
            log_evidence=self.log_evidence + gain,
        )

    @property
    def log_likelihood(self) -> float:
        """Ln p(data | values), up to the constant of the evidence."""
        return self.log_likelihood_at(self.misfit)

    def log_likelihood_at(self, misfit: Floats) -> float:
        """Return the same with other mean squares of the groups."""
        return -self._costs.cost(misfit)

    def gain_to(self, allowed: Floats | float) -> float:
        """Return by how much the log likelihood would rise with mean squares at most so far above noise."""
        costs = self._costs
        return costs.gain(self.misfit, costs.noise + allowed)

    @property
    def _costs(self) -> Costs:
        assert self.levels is not None, "the result was not fitted"
        return self.levels

    def without(self, name: str) -> "FitResult":
        """Return the result without one of its effects; all else keeps the values fitted with it."""
        effects = tuple(e for e in self.effects if e.name != name)
        return replace(
            self, effects=effects, values={ref: v for ref, v in self.values.items() if ref[0] != name}
        )

    def as_described(self) -> "FitResult":
        """Return the result with channels as the test's description says they are."""
        return replace(self, channels=self.channels[:0])

    def __repr__(self) -> str:
        """Return the errors and the added effects on one line."""
        fitted = bool(np.isfinite(self.solution.cost))
        what = f"fit of {counted(len(self.values), 'parameter')}" if fitted else "model as given"
        errors = f"{self.fit_db:.2f} dB on the lines of the fit, {self.held_out_db:.2f} dB held out"
        added = f"; with {listed(e.name for e in self.effects)}" if self.effects else ""
        return summary(self, f"{what}: {errors}{added}")


def fitted_model(model: Model, result: FitResult) -> Model:
    """Return the full model with the values and the effects of a fit."""
    names = {e.name for e in model.effects}
    values = {ref: v for ref, v in result.values.items() if ref[0] in names}
    return model.with_values(values).with_effect(*result.effects)
