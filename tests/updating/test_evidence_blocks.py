"""The look at candidates near the noise: a little of each is linear, alone and together with others."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hidden.cases import make_case
from fem.effects import JointStiffness
from tests.frames import cross_beam
from updating import build_problem, propose
from updating.diagnosis.evidence import (
    Blocks,
    Odds,
    ScoredFit,
    Search,
    best_starts,
    look_at,
    n_changes,
    values_of,
)
from updating.forecast import Forecast, Grid
from updating.inference import FULL_LINES
from updating.inference.fitting import fit


@pytest.fixture(scope="module")
def problem():
    case = make_case(3, "portal", "nothing")
    return build_problem(case.model, case.measurement, case.nuisances)


@pytest.fixture(scope="module")
def springs(problem):
    """Return what lets a support turn."""
    every = {e.name: e for e in propose(problem.reduced.model, ["support_flexibility"])}
    return tuple(every[f"support_flexibility:S1.{axis}"] for axis in ("rx", "ry", "rz"))


def hiding(problem, effects):
    """Return a problem whose data are those of the nominal model with effects, and no noise."""
    on_it = replace(problem, reduced=problem.reduced.with_forces_of(effects))
    nominal = on_it.nominal()
    values = {(e.name, p.name): p.value for e in effects for p in e.parameters()}
    there = replace(nominal, effects=tuple(effects), values={**nominal.values, **values})
    return replace(on_it, data=replace(on_it.data, H=on_it.receptance(there)))


def slight(problem, effect, times):
    """Return an effect at a multiple of its slight point."""
    grid = Grid.of(problem, effect)
    return effect.with_values(**grid.scaled(grid.slight_points()[0][0], times))


def test_a_weak_effect_begins_at_its_value(problem):
    (heavier, *_) = propose(problem.reduced.model, ["member_density"])
    hidden = heavier.with_values(change=0.004)
    known = hiding(problem, [hidden])
    look = look_at(known, known.nominal())
    grid = Grid.of(known, heavier)
    cost, start = best_starts(look, grid)[-1]
    # The density of the material is uncertain, and takes a part of it.
    (values,) = start.values
    assert values["change"] == pytest.approx(0.004, rel=0.1)
    assert cost < look.costs(look.now[None])[0] - 1


def log_posterior(problem, fitted):
    """Return the log likelihood of a fit with the prior of uncertain parameters and damping."""
    lines = problem.lines_up_to(np.inf, FULL_LINES)
    prior = problem.function(fitted.effects, values_of(fitted.effects), lines).prior()
    known = np.isfinite(prior.std)
    off = (fitted.solution.x - prior.mean)[known] / prior.std[known]
    return fitted.log_likelihood - 0.5 * float(off @ off)


def test_the_gain_of_a_weak_effect_is_that_of_its_fit(problem):
    (heavier, *_) = propose(problem.reduced.model, ["member_density"])
    known = hiding(problem, [heavier.with_values(change=0.004)])
    without = fit(known, n_lines=FULL_LINES)
    (gain,) = Forecast.at(known, without, [heavier]).best_gains
    there = fit(known, [heavier], [{"change": 0.004}], n_lines=FULL_LINES, x_from=without)
    risen = log_posterior(known, there) - log_posterior(known, without)
    assert risen > 1
    assert gain == pytest.approx(risen, rel=0.1)


def test_springs_in_two_directions_are_found_together(problem, springs):
    weak = [slight(problem, e, times) for e, times in zip(springs, (60.0, 100.0, 0.0), strict=True)]
    known = hiding(problem, weak[:2])
    look = look_at(known, known.nominal())
    grids = {e.name: Grid.of(known, e) for e in springs}
    blocks = Blocks(known, look)
    block, alone = blocks.of(springs), blocks.of(springs[:1])
    assert block.cost < alone.cost - 1
    for e, start in zip(weak[:2], block.start.values[:2], strict=True):
        assert start["stiffness"] == pytest.approx(e.stiffness, rel=0.15)
    # The third direction is rigid: it begins where it is hardly seen, at few times its slight point.
    least = grids[springs[2].name].slight_points()[0][0]["stiffness"]
    assert least / 3 < block.start.values[2]["stiffness"] <= least


def test_of_a_block_near_the_data_go_on_the_directions_that_pay(problem, springs):
    """Gains of small changes are weighed against the prior odds of each effect."""

    def what_pays(times):
        weak = [slight(problem, e, x) for e, x in zip(springs, times, strict=True)]
        known = hiding(problem, weak)
        search = Search(known, (), propose(known.reduced.model, ["support_flexibility"]))
        base = ScoredFit(fit(known, n_lines=FULL_LINES), 0.0)
        assert not search.fits.is_far(base)
        ranked = search.fits.ranking.blocks(known, base.fitted, far=True)
        (block,) = ranked([springs])
        kept, wins = search.paying(base, block, ranked)
        return [e.name for e in kept[0].effects], wins

    assert what_pays((60.0, 100.0, 1.0)) == ([e.name for e in springs[:2]], True)
    assert what_pays((1.0, 1.0, 1.0))[1] is False


def test_each_effect_costs_its_odds_and_each_place_its_number():
    """Of 2 joints with 3 candidates each: 1/2 for a joint, 1/3 for a law there, 1/10 for a second effect."""

    def spring(joint, axis):
        return JointStiffness(
            name=f"{joint}.{axis}", joints=(joint,), direction=axis, stiffness=1.0, assumed=2.0
        )

    every = [spring(joint, axis) for joint in ("J", "K") for axis in ("rx", "ry", "rz")]
    odds = Odds.of(every, cross_beam())
    one, same, other = every[:1], every[:2], (every[0], every[3])
    assert odds.prior(()) == 0.0
    assert odds.prior(one) == pytest.approx(-np.log(2 * 3))
    assert odds.prior(same) == pytest.approx(-np.log(2 * 3 * 10 * 3))
    assert odds.prior(other) == pytest.approx(2 * odds.prior(one) - np.log(10))
    assert odds.against(one, every[1:2]) == pytest.approx(np.log(10 * 3))


def test_a_law_with_two_changes_costs_as_much_as_two_effects(problem):
    """Where a mass sits along a member is no change of its own."""
    every = {e.kind: e for e in propose(problem.reduced.model)}
    assert n_changes(every["point_mass"]) == n_changes(every["support_flexibility"]) == 1
    assert n_changes(every["foundation"]) == 2
    odds, springs = Odds({}, {}, {}), [every["support_flexibility"]] * 2
    assert odds.prior([every["foundation"]]) == pytest.approx(odds.prior(springs))
    assert odds.prior(springs) < odds.prior(springs[:1])


def test_what_is_at_its_bound_does_not_adapt(problem):
    look = look_at(problem, problem.nominal())
    ref = look.refs[0]
    function = problem.function((), (), problem.lines_up_to(np.inf, 10))
    (k,) = (i for i, v in enumerate(function.variables) if v.ref == ref)
    most = function.variables[k].to_value(float(function.limits()[k, 1]))
    nominal = problem.nominal()
    bounded = look_at(problem, replace(nominal, values={**nominal.values, ref: most}))
    assert ref not in bounded.refs
    assert bounded.refs == look.refs[1:]
