"""Candidates ranked by what each would gain beside a hypothesis, with all that may vary following it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem.array_types import Floats
from fem.model import Effect, parameter_values
from updating.diagnosis.evidence.fits import Fits
from updating.diagnosis.evidence.halving import Damped
from updating.diagnosis.evidence.hypothesis import Odds, ScoredFit
from updating.diagnosis.evidence.ranking import Ranking, screened_near
from updating.diagnosis.evidence.screening import look_at
from updating.diagnosis.evidence.shortlist import MOST_PLACES
from updating.diagnosis.findings import EffectParameter
from updating.forecast.forecast import Forecast
from updating.forecast.grid import Grid
from updating.forecast.look import Look
from updating.inference.belief import UNKNOWN_ODDS
from updating.inference.fit import FitProblem
from updating.inference.fit_function import ROBUST
from updating.inference.fit_result import FitResult
from updating.inference.heartbeat import Progress, beating
from updating.least_squares.costs import pseudo_huber
from updating.live.engine import LiveModel
from updating.live.hypothesis import Hypothesis

ALIKE = 0.9
"""Cosine of the angle between the changes by two effects from which on they count as twins [-]."""
COMPARED = 40
"""Candidates, the best first, whose changes are kept to be compared [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Promise:
    """A candidate at its best size, without a fit.

    Attributes
    ----------
    effect : Effect
    std : float
        Standard deviation of its first parameter; NaN far from the data [unit of the parameter].
    gain : float
        By how much the log posterior of a fit would rise with it; -∞ of what the data do not show [nats].
    probability : float
        That it is missing, as one effect beside those of the hypothesis; NaN far from the data [-].
    changes : ndarray (n, r) or None
        Directions of the changes of the whitened residuals beyond all that may vary, of length 1: with these
        values, and with those of its grid; of the first ``COMPARED`` candidates.
    """

    effect: Effect
    std: float
    gain: float
    probability: float
    changes: Floats | None = None

    @property
    def parameters(self) -> tuple[EffectParameter, ...]:
        """The effect's parameters at that size; of the others than the first none is determined."""
        std = (self.std, *[np.nan] * len(self.effect.parameters()))
        return tuple(
            EffectParameter(p.name, float(p.value), p.unit, s)
            for p, s in zip(self.effect.parameters(), std, strict=False)
        )


@dataclass(frozen=True, slots=True, eq=False)
class RankedCandidates:
    """Candidates beside a hypothesis, the most probable first, and the probabilities of other answers.

    Attributes
    ----------
    promises : tuple of Promise
    nothing, unknown : float
        Probabilities that nothing more is missing, and that what is missing is no single candidate; NaN far
        from the data [-].
    far : bool
        Whether the hypothesis is so far from the data that gains only order the candidates: of those that a
        search compares on damped FRFs, none is stated before it is fitted.
    """

    promises: tuple[Promise, ...] = ()
    nothing: float = np.nan
    unknown: float = np.nan
    far: bool = False

    def twins(self, name: str) -> tuple[tuple[Promise, float], ...]:
        """Return candidates that change the FRFs as another one does, the most alike first.

        With the cosine ρ of the angle between the change by one and that by the other at its most alike: of
        the gain of one the other reaches ρ². Nothing is alike to a candidate that was not ranked.
        """
        changes = next((p.changes for p in self.promises if p.effect.name == name), None)
        if changes is None:
            return ()
        others = [p for p in self.promises if p.changes is not None and p.effect.name != name]
        alike = [(p, float(np.abs(p.changes @ changes[0]).max())) for p in others]
        return tuple(sorted([x for x in alike if x[1] >= ALIKE], key=lambda x: -x[1]))


def rank(
    live: LiveModel, h: Hypothesis, candidates: Sequence[Effect], progress: Progress
) -> RankedCandidates:
    """Return candidates by what each would gain when added to a hypothesis, the most probable first.

    By the forecast that weighs them in a diagnosis (:mod:`updating.forecast`): all that is uncertain follows
    to first order. Far from the data, where that is not valid, damped FRFs and the values of the candidates'
    grids count, as in a search.

    Parameters
    ----------
    live : LiveModel
    h : Hypothesis
    candidates : sequence of Effect
        All that can be missing: they share the probability.
    progress : callable
        Called with a text and the fraction done; an exception from it ends the ranking.
    """
    with beating(progress) as say:
        say("ranking candidates", 0.0)
        problem, added = live.problem_of(h), {e.name for e in h.effects}
        odds = Odds.of(candidates, problem.reduced.model)
        base = ScoredFit(problem.assessed(h.result()), odds.prior(h.effects))
        fits = Fits(problem, (), odds, Ranking())
        free, far = fits.free(base), fits.is_far(base)
        damped = Damped.of(free, base.fitted, bent=fits.is_bent(base)) if far else None
        looked, near = free, base.fitted
        if damped is not None and (weak := damped.for_look()) is not None:
            looked, near = weak, near if h.effects else weak.far_start(near)
        effects = [e for e in candidates if e.name not in added]
        against = np.array([odds.against(h.effects, (e,)) for e in effects])
        return _ranked(looked, near, effects, against, say, far=far)


def _ranked(
    problem: FitProblem,
    base: FitResult,
    effects: Sequence[Effect],
    against: Floats,
    say: Progress,
    *,
    far: bool,
) -> RankedCandidates:
    """Return candidates beside a fit, each with the log odds against it beforehand."""
    forecast = Forecast.at(
        problem,
        base,
        effects,
        n_places=MOST_PLACES,
        say=lambda done: say("ranking candidates", 0.1 + 0.5 * done),
    )
    say("solving for the best candidates", 0.6)
    if far:
        screened = Ranking().screened(problem, base, effects, lambda e: False, far=True)
    else:
        screened = screened_near(problem, base, [forecast], against)
    solved = {s.effect.name: s for s in screened if s.starts}
    linear = forecast.best_gains
    gains = np.array([solved[e.name].gain if e.name in solved else linear[k] for k, e in enumerate(effects)])
    evidence = forecast.log_evidence + np.where(np.isfinite(gains), gains - np.maximum(linear, 0.0), 0.0)
    scores = np.append(evidence - against, [0.0, _gain_of_unknown(problem, forecast.look) - UNKNOWN_ODDS])
    # Far from the data a value of a grid may be better than another one, and none of them right.
    probabilities = np.full(len(scores), np.nan) if far else np.exp(scores - np.logaddexp.reduce(scores))
    order = np.argsort(-(gains if far else scores[:-2]), kind="stable")
    few_values, promises = look_at(problem, base), list[Promise]()
    for n, k in enumerate(order.tolist()):
        effect, some = effects[k], np.flatnonzero(forecast.owner == k)
        i = int(some[np.argmax(forecast.gains[some])])
        if effect.name in solved:
            effect = effect.with_values(**solved[effect.name].starts[0].values[0])
        else:
            effect = forecast.effect_at(i, float(forecast.factor[i]))
        std = np.nan if far else forecast.std(k, parameter_values(effect))
        changes = _directions(few_values, effect) if n < COMPARED else None
        promises.append(Promise(effect, std, float(gains[k]), float(probabilities[k]), changes))
    return RankedCandidates(tuple(promises), float(probabilities[-2]), float(probabilities[-1]), far)


def _gain_of_unknown(problem: FitProblem, look: Look) -> float:
    """Return what an effect gains that leaves no more than a right model may [nats]."""
    now = look.adapted(look.now[None], (), look.off)[0, : len(look.share)]
    v = pseudo_huber(now, ROBUST) @ look.share
    allowed = np.max(problem.allowed_squares(), initial=0.0)
    return look.likelihood.gain(v, look.likelihood.noise + allowed)


def _directions(look: Look, effect: Effect) -> Floats:
    """Return the directions of the whitened changes by an effect as it is, and on its grid, (n, r)."""
    grid = Grid.of(look.problem, effect)
    change = look.changes(Grid(effect, (parameter_values(effect), *grid.points)))
    v = look.whitened(look.adapted(change, effect.replaces()))
    return v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-300)
