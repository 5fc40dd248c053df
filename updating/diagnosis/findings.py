"""What a search for effects has to tell: candidates and how well they do, findings, and the steps to them."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from fem.model import Effect, Parameter, covers, inverse, reciprocal_form
from fem.summary import counted, quantity, summary
from updating.diagnosis.separation import Decisive, Proposal
from updating.inference.fit_result import FitResult


@dataclass(frozen=True, slots=True)
class EffectParameter:
    """A parameter of a found effect: value and standard deviation in ``unit``.

    At a bound the deviation is that of a uniform density up to the other bound, and tells nothing.
    ``scale`` says what is normally distributed: the value (``"linear"``), its logarithm (``"log"``), or its
    reciprocal (``"reciprocal"``), as of a stiffness that was fitted by its compliance.
    """

    name: str
    value: float
    unit: str
    std: float
    at_bound: bool = False
    scale: str = "linear"

    @property
    def interval(self) -> tuple[float, float]:
        """The values one standard deviation below and above, on the scale of the fit; up to infinity."""
        relative = self.std / abs(self.value) if self.value else math.inf
        if self.scale == "log" and math.isfinite(relative):  # fits state x sinh σ for the deviation σ of ln x
            factor = relative + math.hypot(1.0, relative)
            return self.value / factor, self.value * factor
        if self.scale == "reciprocal":
            return self.value / (1 + relative), self.value / (1 - relative) if relative < 1 else math.inf
        return self.value - self.std, self.value + self.std

    @property
    def reciprocal(self) -> "EffectParameter | None":
        """The stiffness of a compliance x and the other way round, 1/x ± s/x²; None of other parameters."""
        form = reciprocal_form(self.name, self.unit)
        if form is None:
            return None
        std = self.std / self.value**2 if self.value and math.isfinite(self.value) else math.nan
        scale = {"linear": "reciprocal", "reciprocal": "linear"}.get(self.scale, self.scale)
        return replace(self, name=form[0], value=inverse(self.value), unit=form[1], std=std, scale=scale)


@dataclass(frozen=True, slots=True, eq=False)
class Ranked:
    """A candidate and how well it does.

    Attributes
    ----------
    name, kind, where : str
        The effect's.
    parameters : tuple of EffectParameter
    level : float
        Robust residual level with it [nepers].
    fit_db, held_out_db : float
        Error with it [dB].
    similarity : float
        Correlation of what it does to the FRFs with what the best candidate does [-].
    score : float
        Logarithm of the posterior probability of the hypothesis with it, up to a constant [-].
    result : FitResult
        The fit.
    """

    name: str
    kind: str
    where: str
    parameters: tuple[EffectParameter, ...]
    level: float
    fit_db: float
    held_out_db: float
    similarity: float
    score: float
    result: FitResult

    @property
    def effect(self) -> Effect | None:
        """The effect as it was fitted."""
        return next((e for e in self.result.effects if e.name == self.name), None)

    def extends(self, effect: Effect) -> bool:
        """Return whether it does the same as an effect at its place, and more."""
        return self.effect is not None and covers(self.effect, effect)

    def __repr__(self) -> str:
        """Return the candidate with its values and errors on one line."""
        values = ", ".join(f"{p.name} {quantity(p.value, p.unit)}" for p in self.parameters)
        errors = f"{self.fit_db:.2f} dB fitted, {self.held_out_db:.2f} dB held out"
        return summary(self, f"{self.name} at {self.where}: {values}; {errors}")


def _stated(p: EffectParameter) -> str:
    """Return value and standard deviation; of a compliance as the stiffness that engineers give."""
    shown = (p.reciprocal if p.name == "compliance" and p.value else None) or p
    return f"{shown.name} {shown.value:.4g} ± {quantity(shown.std, shown.unit)}"


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """A missing effect.

    Attributes
    ----------
    effect : Effect
        Ready to be added to the model.
    parameters : tuple of EffectParameter
    twins : tuple of Ranked
        Candidates that explain the data nearly as well: other effects, then those that contain this one.
    rival : Ranked or None
        The best candidate that is no twin and does not contain the effect.
    decisive : tuple of Decisive
        The pieces of the data that speak most for the effect against the rival, or without one against the
        first of the :attr:`alternatives`.
    equal_fits : tuple of Ranked
        Other effects that fit the data as well and are no twins: their priors alone make them improbable.
    proposals : tuple of tuple of Proposal
        For each of the first ``MOST_SEPARATED`` alternatives, the measurements that would separate the two.
    """

    effect: Effect
    parameters: tuple[EffectParameter, ...]
    twins: tuple[Ranked, ...]
    rival: Ranked | None = None
    decisive: tuple[Decisive, ...] = ()
    proposals: tuple[tuple[Proposal, ...], ...] = ()
    equal_fits: tuple[Ranked, ...] = ()

    @property
    def stiffness(self) -> EffectParameter | None:
        """Stiffness with standard deviation of a release, joint, support or crack [N/m or N·m/rad].

        Also where the fit has a compliance. None of an effect that has neither.
        """
        return self._form("stiffness")

    @property
    def compliance(self) -> EffectParameter | None:
        """The same as a compliance, 1/stiffness [m/N or rad/(N·m)]."""
        return self._form("compliance")

    def _form(self, name: str) -> EffectParameter | None:
        forms = (form for p in self.parameters for form in (p, p.reciprocal) if form is not None)
        return next((form for form in forms if form.name == name), None)

    @property
    def alternatives(self) -> tuple[Ranked, ...]:
        """Twins that are other effects."""
        return tuple(t for t in self.twins if not t.extends(self.effect))

    @property
    def extensions(self) -> tuple[Ranked, ...]:
        """Twins that do the same as the effect and have further parameters, which the data do not require."""
        return tuple(t for t in self.twins if t.extends(self.effect))

    def __repr__(self) -> str:
        """Return the effect with its values, and effects indistinguishable from it, on one line."""
        values = ", ".join(map(_stated, self.parameters))
        twins = f"; {counted(len(self.alternatives), 'effect')} alike" if self.alternatives else ""
        return summary(self, f"{self.effect.name} at {self.effect.where}: {values}{twins}")


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One step of the staircase: what was added, and the errors after it.

    Attributes
    ----------
    label : str
    fit_db, held_out_db : float
        On the lines fitted and held out [dB].
    level : float
        Robust residual level, amplitude and phase [nepers].
    result : FitResult
    """

    label: str
    fit_db: float
    held_out_db: float
    level: float
    result: FitResult

    def __repr__(self) -> str:
        """Return the label and the errors on one line."""
        return summary(self, f"{self.label}: {self.fit_db:.2f} dB fitted, {self.held_out_db:.2f} dB held out")


def step_of(label: str, result: FitResult) -> Step:
    """Return a step that ended with a fit."""
    return Step(label, result.fit_db, result.held_out_db, result.level, result)


def step_added(effects: Iterable[Effect], result: FitResult) -> Step:
    """Return the step in which effects were added."""
    return step_of(f"{labels(effects)} added", result)


def labels(effects: Iterable[Effect]) -> str:
    """Return what effects are and where, in words."""
    return " and ".join(map(label, effects))


def label(effect: Effect) -> str:
    """Return what an effect is and where, in words."""
    return f"{effect.kind.replace('_', ' ')} at {effect.where}"


def parameters_of(effect: Effect, fit: FitResult) -> tuple[EffectParameter, ...]:
    """Return an effect's parameters as a fit has them."""
    return tuple(
        EffectParameter(p.name, value, p.unit, fit.std[effect.name, p.name], _at_bound(p, value), scale_of(p))
        for p in effect.parameters()
        for value in (fit.values[effect.name, p.name],)
    )


def scale_of(p: Parameter) -> str:
    """Return the scale on which a parameter is fitted, as of :class:`EffectParameter`."""
    return "log" if p.log else "linear"


def _at_bound(p: Parameter, value: float) -> bool:
    """Return whether a value has run to a bound, but for rounding."""
    # Values are at a bound if they differ from it by no more than this, relatively [-]
    return any(
        np.isfinite(bound) and abs(value - bound) <= 1e-6 * max(abs(bound), abs(value) if bound else 0.0)
        for bound in (p.lower, p.upper)
    )
