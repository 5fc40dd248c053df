"""The first looks at candidates: what a little of an effect does, and who is on the short list."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from benchmarks.hidden.cases import make_case
from updating import assessed_fit, build_problem, propose
from updating.diagnosis.evidence import NORMAL, screen
from updating.diagnosis.evidence import shortlist as listing
from updating.forecast import Grid, Look, candidate_terms, level


@pytest.fixture(scope="module")
def prepared():
    case = make_case(0)  # a member is heavier
    problem = build_problem(case.model, case.measurement, case.nuisances)
    return case, problem, assessed_fit(problem), propose(case.model, test=case.measurement)


class Hidden:
    """An effect that does not say which parameters it replaces."""

    def __init__(self, effect):
        self.effect = effect

    def __getattr__(self, name):
        return getattr(self.effect, name)

    def replaces(self):
        return ()


def test_slopes_from_the_responses_at_all_dofs_are_those_of_small_changes(prepared):
    _, problem, null, candidates = prepared
    look = Look.of(problem, null, 12, 6, 10**6)
    local = look.residuals.solved(())
    fields = local.fields()
    kinds = set()
    for effect in candidates:
        if effect.released() or effect.kind in kinds or effect.is_form:
            continue  # the form is in every model: no search screens it
        kinds.add(effect.kind)
        grid = Grid.of(problem, effect)
        little = effect.with_values(**grid.scaled(grid.points[0], 1e-4))
        slope = fields.slope(little.contribute(problem.reduced.model))
        (H,) = local.with_terms([problem.reduced.value_of(little)])
        change = H - local.H
        # a change that is ε of what resonates is curved by ε; the strongest of these points are 10² of it
        assert np.abs(slope - change).max() < 0.03 * np.abs(change).max(), effect.name
    assert len(kinds) > 15


def test_each_grid_begins_where_the_effect_is_hardly_seen(prepared):
    """Or else a weaker one passes unseen: all points of the grid are worse than nothing."""
    _, problem, _, candidates = prepared
    look = Look.of(problem, problem.nominal(), 44, 24, 700)
    for effect in candidates:
        grid = Grid.of(problem, effect)
        r = look.residuals.residuals(look.residuals.solved(effect.released()).with_terms(grid.terms(problem)))
        left = look.adapted((r - look.residuals.now)[:, look.residuals.full_band])
        change = level(left[:, : look.residuals.full_band.sum()])
        # beside what uncertain parameters imitate; tension makes a free member a pendulum: 0.11 for the least
        assert change.min() < 0.12, effect.name


def test_what_a_hinge_does_is_seen_on_members_that_are_not_nominal(prepared):
    """It takes away all of a short element's stiffness: a tenth too little leaves much."""
    case, problem, _, _ = prepared
    nominal = problem.nominal()
    moduli = {ref: 1.1 * v for ref, v in nominal.values.items() if ref[1].startswith("E:")}
    assert moduli
    base = replace(nominal, values={**nominal.values, **moduli})
    seen = 0
    for effect in propose(case.model, ["crack"]):
        softest = sorted(Grid.of(problem, effect).points, key=lambda p: (-p["compliance"], p["position"]))[1]
        grid = Grid(effect, (softest,))
        look = Look.of(problem, base, 44, 0, 10**6)
        (seen_as,) = look.residuals.solved(()).with_terms(candidate_terms(look.problem, look.base, grid))
        there = effect.with_values(**softest)
        on_it = replace(problem, reduced=problem.reduced.with_forces_of([there]))
        values = {**base.values, **{(effect.name, k): v for k, v in softest.items()}}
        true = on_it.receptance(replace(base, effects=(there,), values=values), look.residuals.lines)
        without = problem.receptance(base, look.residuals.lines)
        change, seen_change = (np.abs(np.log(H / without)).mean() for H in (true, seen_as))
        assert seen_change == pytest.approx(change, rel=0.08)
        seen += change > 0.05
    assert seen > 1


def test_what_takes_more_mass_away_than_there_is_is_never_the_best(prepared):
    """Beside an effect that has taken most of a member's mass already."""
    case, problem, _, _ = prepared
    member = propose(case.model, ["member_density"])[0]
    light = replace(member.with_values(change=-0.6), name="light")
    mine = replace(problem, reduced=problem.reduced.with_forces_of([light]))
    nominal = mine.nominal()
    values = {**nominal.values, (light.name, "change"): -0.6}
    base = replace(nominal, effects=(light,), values=values)
    grid = Grid(member, ({"change": -0.5}, {"change": 0.1}))
    look = Look.of(mine, base, 44, 24, 700)
    gone, there = look.residuals.solved(()).with_terms(candidate_terms(look.problem, look.base, grid))
    assert np.isnan(gone).all()
    assert np.isfinite(there).all()
    levels = look.levels(grid)
    assert np.isinf(levels[:, 0]).all()
    assert np.isfinite(levels[:, 1]).all()


def test_a_point_is_scaled_between_absent_and_itself(prepared):
    _, problem, _, candidates = prepared
    for effect in candidates:
        grid = Grid.of(problem, effect)
        for point in (grid.points[0], grid.points[-1]):
            first = effect.with_values(**point).parameters()[0]
            same = grid.scaled(point, 1.0)
            assert same == pytest.approx(point)
            gone = grid.scaled(point, 0.0)[first.name]
            assert gone == pytest.approx(min(first.absent, first.upper), rel=1e-9, abs=1e-12) or gone > 1e10


def test_the_short_list_has_the_right_candidate(prepared):
    case, problem, null, candidates = prepared
    grids = [Grid.of(problem, e) for e in candidates]
    listed = listing.shortlist(problem, (null, problem.at_nominal(null)), grids, 5)
    assert len(listed) < 0.6 * len(grids)
    assert case.hidden.name in {grids[i].effect.name for i in listed}
    first = screen(problem, (null, problem.at_nominal(null)), [grids[i] for i in listed], far=True)[:5]
    assert (case.hidden.kind, case.hidden.where) in {(c.effect.kind, c.effect.where) for c in first}


def test_of_very_many_rivals_a_short_list_is_looked_at(prepared, monkeypatch):
    case, problem, _, candidates = prepared
    wrong = next(e for e in candidates if e.kind == "point_mass")
    best = assessed_fit(problem, [wrong], [Grid.of(problem, wrong).points[0]])
    grids = [Grid.of(problem, e) for e in candidates if e is not wrong]
    looked: list[str] = []
    levels = Look.levels
    monkeypatch.setattr(
        Look, "levels", lambda look, grid: looked.append(grid.effect.name) or levels(look, grid)
    )
    found = listing.rivals(problem, best, grids, NORMAL.n_rivals, 10, 5)
    assert len(looked) < 0.6 * len(grids)
    assert (case.hidden.kind, case.hidden.where) in {(c.effect.kind, c.effect.where) for c in found}


def test_the_impedance_at_a_support_is_that_of_the_structure_around_it():
    case = make_case(3, "portal", "support_flexibility")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    basis, total = problem.reduced.basis, problem.reduced.base_sum
    omega = 2 * np.pi * problem.data.frequency[problem.lines_up_to(np.inf, 30)][:, None, None]
    for k, key in enumerate(basis.keys):
        active = [*range(basis.n_main), basis.n_main + k]
        K, M = (total[x][np.ix_(active, active)] for x in "KM")
        unit = np.eye(len(active), dtype=complex)[:, -1:]
        flexibility = np.linalg.solve(K * (1 + 0.02j) - omega**2 * M, unit)[:, -1, 0]
        assert problem.surroundings(key) == pytest.approx(1 / np.median(np.abs(flexibility)), rel=1e-6)
    assert basis.keys


def test_the_slightest_point_is_not_where_the_effect_is_absent():
    """The grid of an elastic joint's stiffness has the model's own value among its points."""
    case = make_case(1, "cross", "joint_stiffness")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    grids = [Grid.of(problem, e) for e in propose(case.model, ["joint_stiffness"])]
    elastic = [g for g in grids if np.isfinite(g.effect.parameters()[0].absent)]
    assert elastic
    for grid in elastic:
        model_has = grid.effect.parameters()[0].absent
        assert any(p["stiffness"] == pytest.approx(model_has, rel=1e-9) for p in grid.points)
        ((point, most),) = grid.slight_points()
        assert abs(np.log(point["stiffness"] / model_has)) > 0.001
        assert 1 < most < 1e5


def test_an_uncertain_parameter_does_not_hide_the_effect_that_takes_its_place():
    case = make_case(1, "cross", "joint_stiffness")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    look = Look.of(problem, problem.nominal(), 60, 0, 10**6)
    uncertain = {(n.effect, n.parameter) for n in problem.nuisances}
    shown, differs = [], False
    for effect in propose(case.model, ["joint_stiffness"]):
        grid = Grid.of(problem, effect)
        if not set(effect.replaces()) & uncertain:
            continue
        near = grid.slight_points()[0][0]
        (H,) = look.residuals.solved(()).with_terms([problem.reduced.value_of(effect.with_values(**near))])
        change = look.residuals.residuals([H]) - look.residuals.now
        seen = [look.adapted(change, replaced) for replaced in ((), effect.replaces())]
        trust = np.sqrt(look.weights)  # what the adaptation makes least
        size = [np.linalg.norm(trust * each) for each in seen]
        assert size[0] <= size[1] * (1 + 1e-9)
        size = [np.linalg.norm((trust * each)[:, : change.shape[1]]) for each in seen]
        own, hidden = (look.levels(g) for g in (grid, Grid(cast("Any", Hidden(effect)), grid.points)))
        differs = differs or not np.allclose(own, hidden)
        shown.append(size[1] / size[0])
    assert max(shown) > 1.5
    assert differs  # from what is left where that parameter adapts


@pytest.mark.parametrize("factor", [0.7, 1.3])
def test_effect_at_the_fitted_value_of_what_it_replaces_changes_nothing(factor):
    case = make_case(1, "cross", "joint_stiffness")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    nominal, uncertain = problem.nominal(), {(n.effect, n.parameter) for n in problem.nuisances}
    every = propose(case.model, ["joint_stiffness"])
    effect = next(e for e in every if set(e.replaces()) & uncertain)
    (ref,) = effect.replaces()
    fitted = factor * nominal.values[ref]
    look = Look.of(problem, replace(nominal, values={**nominal.values, ref: fitted}), 12, 0, 10**6)
    assert np.abs(look.changes(Grid(effect, ({"stiffness": fitted},)))).max() < 1e-9
    beyond = look.changes(Grid(effect, ({"stiffness": 2 * fitted},)))[0]
    true = Look.of(problem, replace(nominal, values={**nominal.values, ref: 2 * fitted}), 12, 0, 10**6)
    np.testing.assert_allclose(look.now + beyond, true.now, atol=0.02 * np.abs(beyond).max())


def test_what_data_to_come_will_leave_weighs_their_residuals_less(prepared):
    _, problem, null, _ = prepared
    looks = [Look.of(problem, null, 12, 0, 10**6, besides) for besides in (0.0, 0.2, 0.5)]
    weights = np.array([look.weights[: len(look.share)].mean() for look in looks])
    assert (np.diff(weights) < 0).all()
