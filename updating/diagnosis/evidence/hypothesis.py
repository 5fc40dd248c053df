"""Models with effects more than the nominal one, and how probable they are before any data."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.model import Effect, Model, covers, parameter_values
from updating.diagnosis.candidates import admitted
from updating.diagnosis.evidence.places import place_of
from updating.inference.belief import EFFECT_ODDS, MISSING
from updating.inference.fit_result import FitResult

Values = tuple[dict[str, float], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """Where a fit begins.

    Attributes
    ----------
    values : tuple of dict
        Of the effects.
    near : FitResult
        All else begins as it is there.
    """

    values: Values
    near: FitResult


@dataclass(frozen=True, slots=True, eq=False)
class ScoredFit:
    """A model with effects, fitted, or as the forecast beside another fit has it.

    Attributes
    ----------
    fitted : FitResult
    prior : float
        Logarithm of its prior probability, up to a constant.
    """

    fitted: FitResult
    prior: float

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects at their fitted values."""
        return self.fitted.effects

    @property
    def score(self) -> float:
        """Logarithm of its posterior probability, up to a constant."""
        return self.fitted.log_evidence + self.prior

    def at_score(self, score: float) -> "ScoredFit":
        """Return the same with another score."""
        return replace(self, fitted=replace(self.fitted, log_evidence=score - self.prior))

    @property
    def key(self) -> frozenset[str]:
        """Names of the effects."""
        return key_of(self.effects)

    @property
    def places(self) -> frozenset[str]:
        """Members and connections that the effects act on."""
        return places_near(self.effects)

    @property
    def name(self) -> str:
        """Effects in words."""
        return " + ".join(sorted(f"{e.kind} {e.where}" for e in self.effects)) or "nothing"


@dataclass(frozen=True, slots=True, eq=False)
class Odds:
    """Prior odds of effects, by how many candidates a place has, and how many places a kind of place.

    Kinds of places are equally probable, so that all candidates together have the odds of one change.
    ``admitted`` is the probability that the situation of the structure admits a kind, by kind, times its
    weight; a candidate of it counts as so much of one. ``beforehand`` is the logarithm of the odds of
    everything else that is believed of the data, ``something`` that of the odds against the first change;
    each further one has those of ``EFFECT_ODDS``.
    """

    n_candidates: Mapping[str, float]
    n_places: Mapping[str, int]
    admitted: Mapping[str, float]
    beforehand: float = 0.0
    something: float = 0.0

    @classmethod
    def of(cls, candidates: Sequence[Effect], model: Model, beforehand: float = 0.0) -> "Odds":
        """Count candidates and their places."""
        where = [place_of(c) for c in candidates]
        believed = model.belief
        share = {c.kind: admitted(c, model) * believed.weights.get(c.kind, 1.0) for c in candidates}
        n_candidates: dict[str, float] = {}
        for c, (_, name) in zip(candidates, where, strict=True):
            n_candidates[name] = n_candidates.get(name, 0.0) + share[c.kind]
        p = MISSING if believed.missing is None else believed.missing
        something = float(np.log((1 - p) / p))
        return cls(n_candidates, Counter(kind for kind, _ in set(where)), share, beforehand, something)

    def prior(self, effects: Sequence[Effect]) -> float:
        """Return the logarithm of the prior probability of effects."""
        n = sum(map(n_changes, effects))
        total = self.beforehand - (self.something + EFFECT_ODDS * (n - 1) if n else 0.0)
        seen: set[str] = set()
        for e in effects:
            kind, name = place_of(e)
            total -= np.log(max(self.n_candidates.get(name, 0.0), 1))
            total += np.log(self.admitted.get(e.kind, 1.0))
            if name not in seen:
                seen.add(name)
                total -= np.log(max(self.n_places.get(kind, 0), 1) * max(len(self.n_places), 1))
        return float(total)

    def against(self, effects: Sequence[Effect], new: Sequence[Effect]) -> float:
        """Return the logarithm of the prior odds against effects in addition to some."""
        return self.prior(effects) - self.prior((*effects, *new))


def is_simpler(h: ScoredFit, other: ScoredFit) -> bool:
    """Return whether a hypothesis has nothing that another one does not have or contain, and less."""
    here = (e.name in other.key or any(covers(o, e) for o in other.effects) for e in h.effects)
    return h.key != other.key and all(here)


def n_changes(effect: Effect) -> int:
    """Return how many things an effect changes, where it is not counted.

    A stiffness with a loss factor is as improbable as the two effects that change one of them.
    """
    return max(1, sum(not p.position for p in effect.parameters()))


def key_of(effects: Sequence[Effect]) -> frozenset[str]:
    """Return the names of effects."""
    return frozenset(e.name for e in effects)


def values_of(effects: Sequence[Effect]) -> Values:
    """Return the parameter values of effects."""
    return tuple(map(parameter_values, effects))


def places_near(effects: Sequence[Effect]) -> frozenset[str]:
    """Return the names of the members and connections that effects act on."""
    return frozenset(set[str]().union(*map(near_to, effects)))


def near_to(effect: Effect) -> set[str]:
    """Return the names of the members and connections that an effect acts on."""
    fields = (getattr(effect, key, None) for key in ("joint", "support", "member"))
    names = {f for f in fields if isinstance(f, str)}
    for key in ("joints", "supports"):
        many = getattr(effect, key, None)
        names |= {x for x in many if isinstance(x, str)} if isinstance(many, tuple) else set()
    names |= {member for member, _ in getattr(effect, "ends", ())}
    return names or {place_of(effect)[1]}
