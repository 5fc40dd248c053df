"""The share of the posterior of candidates that no fit has tried."""

import numpy as np
import pytest
from scipy.integrate import quad

from tests.updating.test_evidence_modes import E, cantilever, measured
from updating import build_mode_problem, diagnose_modes, propose
from updating.diagnosis.evidence import ModeRanking, Search, Searched, values_of
from updating.diagnosis.evidence.diagnosis import search_promised
from updating.forecast import Forecast
from updating.inference import TWIN_NATS, EffectPrior, ModeProblem
from updating.inference.joint_fit import JointLevels
from updating.least_squares import ModeLevels
from updating.least_squares.costs import Levels


@pytest.mark.parametrize(
    "prior",
    [EffectPrior(0.3, 0.5), EffectPrior(0.0, 0.8, 0.01, 2 * np.log(80)), EffectPrior(0, 1, 0.01, 4.6)],
)
def test_the_mass_of_a_prior_is_the_integral_of_its_density(prior):
    low, high = 0.05, 0.7
    if prior.range:
        exact = quad(lambda x: 1 / (np.sqrt(2 * np.pi) * prior.width_at(x)), low, high)[0]
    else:
        exact = quad(lambda x: np.exp(-(((x - prior.mean) / prior.std) ** 2) / 2), low, high)[0]
        exact /= np.sqrt(2 * np.pi) * prior.std
    assert prior.mass(low, high) == pytest.approx(exact, rel=1e-9)
    assert prior.mass(high, low) == pytest.approx(exact, rel=1e-9)


TWO_READINGS = ModeLevels.up_to(
    np.arange(2),
    np.array([5.0, 7.0]),
    np.array([5.0, 8.0]),
    np.array([1e-6, 4e-6]),
    np.ones(2),
    np.ones(2),
    0.015,
)
TWO_BANDS = Levels(np.array([30.0, 50.0]), np.array([1e-5, 2e-5]), np.array([2e-6, 4e-6]))


@pytest.mark.parametrize(
    "levels", [TWO_READINGS, TWO_BANDS, JointLevels(TWO_BANDS, TWO_READINGS)], ids=["modes", "frf", "both"]
)
def test_costs_of_many_levels_are_those_of_each(levels):
    v = np.array([[1e-6, 3e-6], [5e-5, 1e-4], [2e-3, 1e-6]])
    v = np.tile(v, (1, len(levels.noise) // 2))
    assert levels.costs(v) == pytest.approx([levels.cost(each) for each in v])
    assert levels.weight(v) == pytest.approx(np.array([levels.weight(each) for each in v]))
    assert levels.is_bad(v) == pytest.approx(np.array([levels.is_bad(each) for each in v]))
    assert levels.believed.is_bad(v) == pytest.approx(np.zeros_like(v))


def begun(kinds, seed=0):
    model = cantilever()
    problem = build_mode_problem(model, measured(model, shapes=False, seed=seed), (E,), model_error=0.0)
    search = Search(problem, (), propose(model, kinds), ranking=ModeRanking())
    return search, search.full((), ())


@pytest.mark.parametrize("kind", ["member_section", "support_flexibility", "point_mass", "stiffness_loss"])
def test_evidence_by_slopes_is_that_of_a_fit_where_effects_are_weak(kind):
    search, nothing = begun([kind])
    problem = search.fits.problem
    assert isinstance(problem, ModeProblem)
    forecast = Forecast.at(problem, nothing.fitted, search.candidates)
    seen = np.flatnonzero(np.isfinite(forecast.best_gains)).tolist()
    assert seen
    for k in seen:
        i = forecast.best_place(k)
        effect = search.candidates[k].with_values(**forecast.estimate(i)[0])
        fit = search.full((effect,), values_of((effect,)), nothing).fitted
        gain = fit.log_evidence - nothing.fitted.log_evidence
        assert forecast.log_evidence[k] == pytest.approx(gain, abs=0.4)


def test_every_candidate_has_a_probability_beside_nothing():
    search, nothing = begun(["member_section", "member_density", "support_flexibility", "crack"])
    search.promise_rest(nothing)
    promised = {h.effects[0].name: h for h in search.promises()}
    assert set(promised) == {e.name for e in search.candidates}
    # The density of all that there is does what Young's modulus does, and torsion moves no sensor.
    unseen = [h for h in promised.values() if h.effects[0].kind == "member_density"]
    assert [h.score - nothing.score for h in unseen] == pytest.approx([h.prior for h in unseen])
    seen = [h for h in promised.values() if h.effects[0].kind in ("member_section", "crack")]
    assert all(np.isfinite(list(h.fitted.std.values())).all() for h in seen)
    assert len({h.score - h.prior for h in seen}) > 1


def test_what_promises_to_be_a_twin_of_the_best_hypothesis_is_fitted():
    search, nothing = begun(["member_section", "support_flexibility"])
    search.promise_rest(nothing)
    twin, *others = search.promises()
    search.promised = {h.key: h.at_score(nothing.score - 2 * TWIN_NATS) for h in others}
    search.promised[twin.key] = twin.at_score(nothing.score - TWIN_NATS / 2)
    search.fit_promised()
    assert search.is_full(search.known[twin.key])
    assert search.known[twin.key].score == pytest.approx(twin.score, abs=1.0)
    assert {h.key for h in search.promises()} == {h.key for h in others}


def test_frequencies_alone_are_not_sure_of_nothing():
    """Before the data one effect of any kind is as probable as "nothing", and they change little."""
    model = cantilever()
    kinds = ["member_section", "support_flexibility", "point_mass"]
    found = diagnose_modes(model, measured(model, shapes=False), (E,), kinds=kinds, model_error=0.0)
    first = found.explanations[0]
    assert not first.effects
    assert 0.5 < first.probability < 0.9
    assert sum(e.probability for e in found.explanations) == pytest.approx(1.0)


@pytest.mark.parametrize(("n", "more", "found"), [(1, 0.1, True), (1, -0.1, False), (30, -0.1, True)])
def test_nothing_is_reported_where_no_effect_and_not_all_together_are_more_probable(n, more, found):
    """An effect had 73 % and "nothing missing" 13 %, which was reported as the simpler answer; once 4 %."""
    search, nothing = begun(None)
    search.promise_rest(nothing)
    some = search.promises()[:n]
    search.promised = {}
    search.known |= {h.key: h.at_score(nothing.score + more * TWIN_NATS) for h in some}
    done = Searched(search, search.best, (), float("nan"), cantilever())
    assert not done.best.effects
    answer = done.answered()
    assert bool(answer.best.effects) == found


def test_a_promise_that_a_fit_does_not_keep_is_none():
    """A lap joint promised 11 nats by small changes, a fit gained none: "nothing missing" had 0.001 %."""
    search, nothing = begun(["member_section", "support_flexibility"])
    search.promise_rest(nothing)
    first = search.promises()[0]
    search.promised[first.key] = first.at_score(nothing.score + 11.0)
    done = search_promised(Searched(search, nothing, (), float("nan"), cantilever()))
    assert done.answered().best is nothing
    assert done.probability(nothing) > 0.5
