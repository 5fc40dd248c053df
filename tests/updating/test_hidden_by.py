"""Which uncertain parameters hide an effect, and from what size measured modes show it."""

import numpy as np
import pytest

from fem import assemble, first_modes
from tests.updating.test_evidence_modes import SENSORS, E, cantilever
from updating import ModeTargets, Nuisance, build_mode_problem, propose, sensor_rows
from updating.diagnosis.evidence import ModeRanking, Odds, Search, values_of
from updating.forecast import Forecast, Grid, Look
from updating.plan.visibility import visibility

RHO = Nuisance("frame", "rho:steel", 0.02)


def exact(model, n=6):
    """Return modes of a model without noise."""
    modes = first_modes(assemble(model), n)
    shapes = (sensor_rows(model, SENSORS) @ modes.shapes)[:, :n]
    return ModeTargets.of(modes.frequency[:n], 1e-3, shapes=shapes, shape_std=0.02, sensors=SENSORS)


@pytest.fixture(scope="module")
def looked():
    model = cantilever()
    problem = build_mode_problem(model, exact(model), (E, RHO), model_error=0.0)
    candidates = propose(model, ["point_mass", "support_flexibility", "crack"])
    return problem, Look.of(problem, problem.nominal(), None, 0, 0), candidates


def test_the_parameters_that_hide_an_effect_are_those_without_which_most_of_it_is_seen(looked):
    problem, look, candidates = looked
    for effect in candidates:
        for change in look.little(Grid.of(problem, effect)).change:
            first, second = look.hidden_by(change)
            alone = {ref: look._left(change, [ref]) / look._left(change, []) for ref in look.refs}
            assert first == (max(alone, key=lambda ref: alone[ref]), max(alone.values()))
            assert {first[0], second[0]} == set(look.refs)
            assert second[1] >= first[1] >= 1


def test_what_is_known_exactly_hides_nothing(looked):
    problem, look, (effect, *_) = looked
    change = look.little(Grid.of(problem, effect)).change[-1]
    now = Forecast.at(problem, problem.nominal(), [effect]).precision[-1]
    (first, _), _ = found = look.hidden_by(change)
    others = tuple(n for n in (E, RHO) if n.refs[0] != first)
    for (_, more), nuisances in zip(found, (others, ()), strict=True):
        known = build_mode_problem(cantilever(), exact(cantilever()), nuisances, model_error=0.0)
        precise = Forecast.at(known, known.nominal(), [effect]).precision[-1]
        assert more == pytest.approx(precise / now, rel=1e-3)


@pytest.mark.parametrize("kind", ["point_mass", "support_flexibility"])
def test_an_effect_of_the_size_that_modes_show_gains_what_it_must(looked, kind):
    problem, _, candidates = looked
    effects = [e for e in candidates if e.kind == kind]
    seen = visibility(problem, problem.nominal(), effects, Odds.of(effects, problem.reduced.model), None)
    x = min((x for x in seen.effects if x.seen is not None), key=lambda x: x.enough[0])
    there = x.seen
    model = cantilever()
    search = Search(
        build_mode_problem(model, exact(model.with_effect(there)), (E, RHO), model_error=0.0),
        (),
        tuple(effects),
        ranking=ModeRanking(),
    )
    nothing = search.full((), ())
    found = search.full((there,), values_of((there,)), nothing)
    gain = found.fitted.log_likelihood - nothing.fitted.log_likelihood
    assert gain == pytest.approx(x.nats[0], rel=0.25)
    assert np.isfinite(found.score)
