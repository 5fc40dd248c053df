"""Sections and connections whose fitted form is outside its usual range, and what may be there instead."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from fem.model import Effect
from updating.diagnosis.evidence.hypothesis import ScoredFit, near_to
from updating.inference.belief import FAR_STD, RARE
from updating.inference.fit_result import FitResult
from updating.inference.problem import Problem


@dataclass(frozen=True, slots=True, eq=False)
class Departure:
    """A parameter of the form of a frame or test that a fit has moved out of its usual range.

    Attributes
    ----------
    effect : Effect
        Of the form, at its fitted values.
    parameter : str
    unit : str
    value, std : float
        A relative change, or the logarithm of a factor of stiffness [-]; of an instrument what it adds.
    prior_std : float
        Of its prior.
    probability : float
        That it is outside the range: ``FAR_STD`` deviations of the prior, or less where that is odd [-].
    rivals : tuple of (tuple of Effect, float)
        Hypotheses with an effect there in place of it, and their probabilities.
    """

    effect: Effect
    parameter: str
    unit: str
    value: float
    std: float
    prior_std: float
    probability: float
    rivals: tuple[tuple[tuple[Effect, ...], float], ...] = ()

    @property
    def where(self) -> str:
        """The section or connection."""
        return self.effect.where

    @property
    def near(self) -> set[str]:
        """Names of the members, and of the joint or support, that it acts on."""
        members = {zone[0] for zone in getattr(self.effect, "zones", ())}
        return members | {*getattr(self.effect, "members", ()), getattr(self.effect, "around", "")} - {""}


def departures(problem: Problem[Any], result: FitResult) -> list[Departure]:
    """Return the parameters of the form outside their usual ranges, the farthest first."""
    out = list[tuple[float, Departure]]()
    for u in problem.nuisance_unknowns:
        effect = problem.reduced.model.effect(u.ref[0])
        value = result.values.get(u.ref, u.nominal)
        if not effect.is_form or not u.has_prior or not np.isfinite(value):
            continue
        off, prior = value - u.to_value(u.mean), u.std * u.size
        (parameter,) = (p for p in effect.parameters() if p.name == u.ref[1])
        limit = min(FAR_STD * prior, parameter.usual_change)
        std = result.std.get(u.ref, 0.0)
        if abs(off) > limit:
            fitted = {r[1]: v for r, v in result.values.items() if r[0] == effect.name}
            p = float(scipy.special.ndtr((abs(off) - limit) / std)) if std > 0 else 1.0
            found = Departure(effect.with_values(**fitted), u.ref[1], u.unit, value, std, prior, p)
            out.append((abs(off) / prior, found))
    return [d for _, d in sorted(out, key=lambda pair: -pair[0])]


def departed(
    hypotheses: Sequence[tuple[ScoredFit, float]], problem: Problem[Any], result: FitResult
) -> tuple[Departure, ...]:
    """Return the departures of a result, each with the effects that a search has fitted in its place.

    Of hypotheses, each with its probability, those that have more effects than the result and are not
    ``RARE``.
    """
    reported, out = {e.name for e in result.effects}, []
    for d in departures(problem, result):
        rivals = []
        for h, p in sorted(hypotheses, key=lambda pair: -pair[0].score):
            more = tuple(e for e in h.effects if e.name not in reported)
            if more and p >= RARE and reported <= h.key and any(near_to(e) & d.near for e in more):
                rivals.append((more, p))
        out.append(replace(d, rivals=tuple(rivals)))
    return tuple(out)
