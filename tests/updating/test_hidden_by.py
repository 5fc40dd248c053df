"""Which uncertain parameters hide an effect, and from what size measured modes show it."""

import numpy as np
import pytest

from fem import assemble, first_modes
from tests.updating.test_evidence_modes import SENSORS, E, cantilever
from updating import ModeTargets, Nuisance, build_mode_problem, propose, sensor_rows
from updating.diagnosis.evidence import ModeRanking, Odds, Search, values_of
from updating.forecast import Forecast, Look
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


def places_of(problem, candidates):
    """Return a forecast of candidates, and each place's size that would be seen, up to a common factor."""
    forecast = Forecast.at(problem, problem.nominal(), candidates, vectors=True)
    return forecast, 1 / np.maximum(np.linalg.norm(forecast.vectors, axis=1), 1e-12)


def test_the_parameters_that_hide_a_kind_are_those_without_which_the_least_of_it_is_seen(looked):
    """Each is compared with forecasts of problems that know it, at all places."""
    problem, _, candidates = looked
    model = cantilever()
    precise = {
        some: build_mode_problem(model, exact(model), some, model_error=0.0) for some in ((E,), (RHO,), ())
    }
    for effect in candidates:
        forecast, now = places_of(problem, [effect])
        found = forecast.look.hidden_by(1 / now, forecast.moved, now)
        if now.min() == 1e12:  # the sensors do not see it
            continue
        left, before = (E, RHO), now.min()
        for ref, place, factor in found:
            known = {}
            for nuisance in left:
                rest = tuple(n for n in left if n is not nuisance)
                known[nuisance] = places_of(precise[rest], [effect])[1]
            best = min(known, key=lambda nuisance: known[nuisance].min())
            assert best.refs[0] == ref
            assert known[best].argmin() == place
            assert now[place] / factor == pytest.approx(known[best].min(), rel=1e-3)
            assert known[best].min() <= before
            left, before = tuple(n for n in left if n is not best), known[best].min()


def test_a_place_that_a_parameter_hides_is_the_best_one_if_it_is_known(looked):
    """Two places: one that nothing hides, and one at which a parameter does nearly all."""
    _, look, _ = looked
    C = look._nuisances[0][: len(look.refs), : len(look.refs)]
    moved = np.zeros((2, len(look.refs)))
    moved[1, 0] = 3.0 * np.sqrt(C[0, 0])  # if it stayed, 9 would be added to the square of what is left
    (first, place, factor), *_ = look.hidden_by(np.array([1.0, 0.5]), moved, np.array([1.0, 2.0]))
    assert (first, place) == (look.refs[0], 1)
    assert factor == pytest.approx(np.sqrt(0.25 + 9) / 0.5)


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
