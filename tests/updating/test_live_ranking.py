"""Candidates ranked beside a hypothesis: by the forecasts that a diagnosis weighs them with."""

import numpy as np
import pytest

from benchmarks.hidden.cases import make_case
from fem.reduction.reduced_model import ReducedModel
from updating import assessed_fit, build_problem, propose
from updating.diagnosis.evidence import Fits, Odds, Ranking, ScoredFit
from updating.live import Hypothesis, LiveModel, fit_all, rank

KINDS = ("member_density", "member_stiffness", "point_mass", "joint_stiffness", "sensor_mass")


class EndedError(Exception):
    pass


def quiet(text, done):
    pass


@pytest.fixture(scope="module")
def case():
    """Return a model, its candidates, and the uncertain parameters fitted; member B is heavier."""
    made = make_case(0)
    problem = build_problem(made.model, made.measurement, made.nuisances)
    candidates = propose(made.model, KINDS, test=made.measurement)
    h = Hypothesis.nominal(problem).at(assessed_fit(problem))
    return LiveModel(problem), h, {e.name: e for e in candidates}


@pytest.fixture(scope="module")
def explained(case):
    """Return the hypothesis with the density of B, fitted."""
    live, h, candidates = case
    return fit_all(live, h.with_effect(candidates["member_density:B"]), quiet)


@pytest.fixture(scope="module")
def beside(case, explained):
    """Return the ranking beside what explains the data."""
    live, _, candidates = case
    return rank(live, explained, tuple(candidates.values()), quiet)


def test_far_from_the_data_the_missing_effect_is_first_before_any_fit_and_after(case):
    live, fitted, candidates = case
    for h in (Hypothesis.nominal(live.problem), fitted):
        ranked = rank(live, h, tuple(candidates.values()), quiet)
        assert ranked.far
        gains = [p.gain for p in ranked.promises]
        assert gains == sorted(gains, reverse=True)
        assert ranked.promises[0].effect.name == "member_density:B"
        assert ranked.promises[0].effect.change > 0
        # of values on grids none is the right one: nothing is stated but the order
        assert np.isnan([ranked.nothing, ranked.unknown, ranked.promises[0].probability]).all()


def test_probabilities_beside_what_explains_the_data_are_those_of_a_diagnosis(case, explained, beside):
    live, _, candidates = case
    problem, odds = (
        live.problem_of(explained),
        Odds.of(tuple(candidates.values()), live.problem.reduced.model),
    )
    fits = Fits(problem, (), odds, Ranking())
    base = ScoredFit(problem.assessed(explained.result()), 0.0)
    rest = [e for e in candidates.values() if e.name != "member_density:B"]

    def against(effect):
        return odds.against(explained.effects, (effect,))

    screened = Ranking().screened(fits.free(base), base.fitted, rest, lambda e: False, against)
    ratio = {s.effect.name: np.exp(s.estimate.log_evidence - against(s.effect)) for s in screened}
    assert not beside.far
    found = {p.effect.name: p.probability / beside.nothing for p in beside.promises}
    assert found == pytest.approx(ratio, rel=1e-9)
    assert [*found.values()] == sorted(found.values(), reverse=True)
    total = beside.nothing + beside.unknown + sum(p.probability for p in beside.promises)
    assert total == pytest.approx(1.0)
    assert beside.nothing > 0.8


def test_ranked_sizes_have_standard_deviations_of_fits(case, explained, beside):
    live, _, candidates = case
    name = "member_stiffness:A"
    promise = next(p for p in beside.promises if p.effect.name == name)
    h = fit_all(live, explained.with_effect(candidates[name]), quiet)
    assert promise.std == pytest.approx(h.fit.std[name, "change"], rel=0.15)


def test_few_candidates_are_projected_however_many_there_are(case, explained, monkeypatch):
    """Of the others a forecast costs their element matrices alone."""
    live, *_ = case
    many = propose(live.problem.reduced.model, test=live.problem.data.measurement)
    projected = set()
    value_of = ReducedModel.value_of

    def counted(self, effect, *more):
        projected.add(effect.name)
        return value_of(self, effect, *more)

    monkeypatch.setattr(ReducedModel, "value_of", counted)
    rank(live, explained, many, quiet)
    names = {e.name for e in many if not e.released()}
    assert len(names) > 70
    assert len(names & projected) < 50


def test_an_exception_from_its_progress_ends_a_ranking(case):
    live, h, candidates = case
    told = []

    def ended(text, done):
        told.append(done)
        if len(told) == 3:
            raise EndedError

    with pytest.raises(EndedError):
        rank(live, h, tuple(candidates.values()), ended)
    assert len(told) == 3
    told.clear()
    rank(live, h, tuple(candidates.values()), lambda text, done: told.append(done))
    assert told == sorted(told)
