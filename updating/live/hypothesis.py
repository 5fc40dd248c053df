"""A user's hypothesis: added effects, values of uncertain parameters, and corrections of the measurement."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fem.array_types import Floats
from fem.model import Effect, ModelError, Parameter, ParameterRef, parameter_values
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.solve import Solution
from updating.measurement.channel_errors import N_ERRORS
from updating.measurement.held_out import Band, band_of
from updating.quality.corrections import Fault


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A model with added effects, and the measurement as it is believed.

    Attributes
    ----------
    effects : tuple of Effect
        Added effects with their present values.
    values : mapping of (effect, parameter) to float
        Values of the model's uncertain parameters, and of the form of its frame where that may vary.
    zeta : ndarray (n_unknowns,)
        The damping curve's unknowns [-].
    faults : tuple of Fault
        Corrections of sensors and excitations, in the order in which they are applied.
    off : frozenset of str
        Sensors that are left out of comparison and fit.
    held_out : frozenset of str
        Channels and bands that are compared and not fitted: ``"sensor A1"``, ``"excitation E1"``,
        ``"band 120-180 Hz"``.
    channels : ndarray (n_sensors + n_excitations, 5)
        Errors of the channels as the last fit has found them; empty for none.
    fit : FitResult or None
        The fit that gave these values; None as soon as one of them is changed by hand.
    """

    effects: tuple[Effect, ...]
    values: Mapping[ParameterRef, float]
    zeta: Floats
    faults: tuple[Fault, ...] = ()
    off: frozenset[str] = field(default_factory=frozenset)
    fit: FitResult | None = None
    held_out: frozenset[str] = field(default_factory=frozenset)
    channels: Floats = field(default_factory=lambda: np.zeros((0, N_ERRORS)))

    @classmethod
    def nominal(cls, problem: FitProblem) -> "Hypothesis":
        """Return the model as the study states it."""
        start = problem.nominal()
        return cls((), start.values, start.zeta, channels=start.channels)

    def effect(self, name: str) -> Effect:
        """Return an added effect.

        Raises
        ------
        ModelError
            If there is none of this name.
        """
        for effect in self.effects:
            if effect.name == name:
                return effect
        have = ", ".join(e.name for e in self.effects) or "none"
        msg = f"no effect '{name}' is added; added are {have}"
        raise ModelError(msg)

    def with_effect(self, effect: Effect) -> "Hypothesis":
        """Return the hypothesis with one more effect.

        Raises
        ------
        ModelError
            If an effect of this name is added already.
        """
        if any(e.name == effect.name for e in self.effects):
            msg = f"'{effect.name}' is added already; change its values instead"
            raise ModelError(msg)
        return replace(self, effects=(*self.effects, effect), fit=None)

    def without_effect(self, name: str) -> "Hypothesis":
        """Return the hypothesis without an added effect."""
        self.effect(name)
        return replace(self, effects=tuple(e for e in self.effects if e.name != name), fit=None)

    def with_value(self, name: str, parameter: str, value: float) -> "Hypothesis":
        """Return the hypothesis with another value of an added effect's parameter, within its bounds."""
        effect = self.effect(name)
        p = parameter_of(effect, parameter)
        changed = effect.with_values(**{parameter: float(np.clip(value, p.lower, p.upper))})
        effects = tuple(changed if e is effect else e for e in self.effects)
        return replace(self, effects=effects, fit=None)

    def with_uncertain(self, ref: ParameterRef, value: float) -> "Hypothesis":
        """Return the hypothesis with another value of an uncertain parameter."""
        if ref not in self.values:
            msg = f"'{'.'.join(ref)}' is not uncertain in this study"
            raise ModelError(msg)
        return replace(self, values={**self.values, ref: float(value)}, fit=None)

    def with_fault(self, fault: Fault) -> "Hypothesis":
        """Return the hypothesis with a correction, in place of one of the same kind and channel."""
        return replace(self, faults=(*self.without_fault(fault.kind, fault.sensor).faults, fault), fit=None)

    def without_fault(self, kind: str, sensor: str) -> "Hypothesis":
        """Return the hypothesis without the corrections of a kind at a sensor or excitation."""
        kept = tuple(f for f in self.faults if (f.kind, f.sensor) != (kind, sensor))
        return replace(self, faults=kept, fit=None)

    def switched(self, sensor: str) -> "Hypothesis":
        """Return the hypothesis with a sensor left out that was counted, or the other way round."""
        return replace(self, off=self.off ^ {sensor}, fit=None)

    def held(self, part: str) -> "Hypothesis":
        """Return the hypothesis with a channel or band held out that was fitted, or the other way round."""
        return replace(self, held_out=self.held_out ^ {part}, fit=None)

    @property
    def held_out_bands(self) -> tuple[Band, ...]:
        """Bands of frequency that no fit sees, in place of the problem's own blocks of lines [Hz]."""
        return tuple(sorted(band for band in map(band_of, self.held_out) if band is not None))

    def result(self) -> FitResult:
        """Return the hypothesis as a fit, whose errors are not assessed unless it was fitted."""
        if self.fit is not None:
            return self.fit
        added = {(e.name, k): float(v) for e in self.effects for k, v in parameter_values(e).items()}
        replaced = {ref for e in self.effects for ref in e.replaces()}
        values = {ref: v for ref, v in self.values.items() if ref not in replaced} | added
        nothing = Solution(np.zeros(0), np.nan, np.nan, 0, True)
        zero = dict.fromkeys(values, 0.0)
        return FitResult(
            nothing, values, zero, self.zeta, self.effects, np.nan, np.nan, np.nan, channels=self.channels
        )

    def at(self, fit: FitResult) -> "Hypothesis":
        """Return the hypothesis with the values of a fit; uncertain parameters that it fixed stay."""
        values = {ref: float(fit.values.get(ref, v)) for ref, v in self.values.items()}
        return replace(
            self, effects=fit.effects, values=values, zeta=fit.zeta, channels=fit.channels, fit=fit
        )


def parameter_of(effect: Effect, name: str) -> Parameter:
    """Return a parameter of an effect.

    Raises
    ------
    ModelError
        If it has none of this name.
    """
    for p in effect.parameters():
        if p.name == name:
            return p
    have = ", ".join(p.name for p in effect.parameters())
    msg = f"'{effect.name}' has no parameter '{name}'; it has {have}"
    raise ModelError(msg)
