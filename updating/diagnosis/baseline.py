"""The first of two states: whether its calibrated model explains it, and what both states may lack.

A model that lacks something in the first state lacks it in the second one, too. What it leaves is then no
constant: it depends on what has changed. So each effect that may be missing in both is a model of the first
state, as probable as that state makes it, and the change is looked for beside each of them:

    p(change | both) ∝ Σ_cause p(first | cause) p(cause) p(second | first, cause, change) p(change).
"""

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from fem.model import Effect, Model
from updating.diagnosis.evidence.diagnosis import search_progress
from updating.diagnosis.evidence.hypothesis import ScoredFit, values_of
from updating.diagnosis.evidence.mode_ranking import ModeRanking
from updating.diagnosis.evidence.search import Search
from updating.diagnosis.mode_diagnosis import (
    Baseline,
    Calibrated,
    ModeDiagnosis,
    candidates_for,
    concluded,
    searched_modes,
)
from updating.diagnosis.mode_table import HALF
from updating.diagnosis.verdict import CREDIBLE
from updating.inference.bases import N_BASES
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.fit_result import FitResult
from updating.inference.fitting import fit
from updating.inference.formed import Formed, formed_mode_problem
from updating.inference.heartbeat import EndEarlyError, Progress
from updating.inference.mode_fit import BAD_PRIOR, ModeProblem
from updating.inference.mode_targets import ModeTargets
from updating.inference.parameters import Nuisance
from updating.inference.preparation import fitted_model

COMMON = "common "
"""Begins the names of effects that are missing in both states: a change may be of the same kind and place."""


def calibrate(
    model: Model,
    before: ModeTargets,
    nuisances: Sequence[Nuisance] = (),
    *,
    known: Sequence[Effect] = (),
    damping_std: float = 0.5,
    model_error: float = EXPLAINED_LEVEL,
) -> Calibrated:
    """Fit uncertain parameters, and the form's, to the modes of the first state.

    ``known`` are effects that it is known to have, such as what was found when it was compared with an
    earlier one; their values are fitted, from those that they have.
    """
    problem, made = formed_mode_problem(
        model, before, nuisances, damping_std=damping_std, model_error=model_error
    )
    if known:
        return _with_causes_fitted(replace(problem, bad_prior=BAD_PRIOR), made, known)
    return _calibrated(problem, made)


def _calibrated(problem: ModeProblem, made: Formed) -> Calibrated:
    return _with_enriched_basis(problem, made, fit(problem))


def _with_enriched_basis(problem: ModeProblem, made: Formed, fitted: FitResult) -> Calibrated:
    """Return a fit whose basis has the modes of the fitted model.

    The second state's basis begins with them, and what one of the two lacks would look like a change.
    """
    for _ in range(N_BASES):
        better = problem.better_basis(fitted)
        if better is None:
            break
        problem = replace(problem, reduced=better[1])
        effects = fitted.effects
        fitted = fit(problem, effects, values_of(effects), stages=problem.stages[-1:], x_from=fitted)
    return Calibrated(fitted_model(made.formed, fitted), problem, fitted, problem.computed(fitted), made)


def judged(
    first: Calibrated, kinds: Sequence[str] | None = None, exclude: Sequence[str] = (), *, say: Progress
) -> Baseline:
    """Return what the first state says of its calibrated model, and what may be missing in both states.

    The model stands where "nothing missing" is more probable than all single effects, by a look at them, and
    than what the library does not have; a few readings may be bad ones. Otherwise the first state is
    diagnosed as any other test is, and the models of its credible set are those that the change is looked
    for beside.
    """
    start_time, made = time.perf_counter(), first.made
    candidates = candidates_for(made.model, first.problem.targets, kinds, exclude)

    def search_at(base: Calibrated) -> Search[ModeProblem]:
        tell = search_progress(say, start_time)
        out = Search(base.problem, made.form, candidates, tell, ranking=ModeRanking())
        out.known[frozenset()] = ScoredFit(base.fitted, out.fits.odds.prior(()))
        return out

    def stands(search: Search[ModeProblem]) -> bool:
        nothing = search.known[frozenset()]
        search.promise_rest(nothing)
        scores = [nothing.score, search.unknown(nothing), *(h.score for h in search.promises())]
        return bool(nothing.score - np.logaddexp.reduce(scores) > np.log(HALF))

    search = search_at(first)
    if stands(search):
        return Baseline(first, (first,), np.zeros(1))
    doubting = _calibrated(replace(first.problem, bad_prior=BAD_PRIOR), made)
    search = search_at(doubting)
    if stands(search):
        return Baseline(doubting, (doubting,), np.zeros(1))
    done = searched_modes(search, made.formed, say)
    if not done.finished:
        msg = "the first state was not yet judged"
        raise EndEarlyError(msg)
    return _with_causes(doubting, concluded(done))


def _with_causes(first: Calibrated, d: ModeDiagnosis) -> Baseline:
    """Return the models of the first state's credible set.

    A cause that the library does not have may act on the change as the constant that the calibrated model
    leaves, or as its representative in the library does: one is as probable as the other.
    """
    done, search = d.searched, d.searched.search
    nothing, half = search.known[frozenset()], done.unknown - np.log(2.0)
    every = [(float(np.logaddexp(nothing.score, half)), nothing)]
    if with_effects := [h for h in done.weighed if h.effects]:
        all_ = np.logaddexp.reduce([h.score for h in with_effects])
        every += [(float(h.score + np.logaddexp(0.0, half - all_)), h) for h in with_effects]
    every.sort(key=lambda each: -each[0])
    before = np.cumsum([0.0, *(np.exp(score - done.evidence) for score, _ in every)])
    # Largest number of first-state models with which the change is searched: each costs a search
    likely = [each for each, p in zip(every, before, strict=False) if p < CREDIBLE][:4]
    bases, scores = [], []
    for score, h in likely:
        with suppress(np.linalg.LinAlgError):  # on the basis with its forces there is no structure
            full = h if search.is_full(h) else search.full(h.effects, values_of(h.effects), h)
            bases.append(_with_cause(first, search, full) if h.effects else first)
            scores.append(score)
    if not bases:
        return Baseline(first, (first,), np.zeros(1), d)
    return Baseline(first, tuple(bases), np.array(scores), d)


def _with_cause(first: Calibrated, search: Search[ModeProblem], h: ScoredFit) -> Calibrated:
    """Return the model of the first state with the effects of a hypothesis."""
    return _with_causes_fitted(search.fits.free(h), first.made, h.effects, h.fitted)


def _with_causes_fitted(
    problem: ModeProblem, made: Formed, causes: Sequence[Effect], near: FitResult | None = None
) -> Calibrated:
    """Return the model of the first state with effects, fitted from their values.

    What has grown from state to state is there several times, each with a name of its own.
    """
    names = [f"{COMMON}{uncommon(e).name}" for e in causes]
    before = [names[:k].count(name) for k, name in enumerate(names)]
    each = zip(causes, names, before, strict=True)
    effects = tuple(replace(e, name=f"{name} {n + 1}" if n else name) for e, name, n in each)
    problem = replace(problem, reduced=problem.reduced.with_forces_of(effects))
    stages = problem.stages if near is None else problem.stages[-1:]
    fitted = fit(problem, effects, values_of(effects), stages=stages, x_from=near)
    return _with_enriched_basis(problem, made, fitted)


def uncommon(effect: Effect) -> Effect:
    """Return an effect that is missing in both states by the name of its candidate."""
    return replace(effect, name=effect.name.removeprefix(COMMON))
