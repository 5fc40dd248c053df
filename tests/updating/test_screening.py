"""The first looks at candidates: what a little of an effect does, and who is on the short list."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from dovetail.validation.cases import CaseSettings, draw_case
from fem.model import parameter_values
from tests.hidden.cases import make_case
from updating.diagnosis import screening
from updating.diagnosis.candidates import propose
from updating.diagnosis.screening import Grid, screen
from updating.inference.preparation import build_problem


@pytest.fixture(scope="module")
def prepared():
    case = make_case(0)  # a member is heavier
    problem = build_problem(case.model, case.measurement, case.nuisances)
    return case, problem, problem.fit(), propose(case.model, test=case.measurement)


def silent(text, done):
    pass


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
    look = screening._Look.of(problem, null, 12, 6, 10**6)
    local, fields = look._local(()), look.fields()
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
    look = screening._Look.of(problem, problem.nominal(), 44, 24, 700)
    for effect in candidates:
        grid = Grid.of(problem, effect)
        r = look._residuals(look._local(effect.released()).with_terms(grid.terms(problem, False)))
        change = screening._level(look._adapted((r - look._now)[:, look.whole]))
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
        look = screening._Look.of(problem, base, 44, 0, 10**6)
        (seen_as,) = look._local(()).with_terms(look._terms(grid, False))
        there = effect.with_values(**softest)
        on_it = replace(problem, reduced=problem.reduced.with_forces_of([there]))
        values = {**base.values, **{(effect.name, k): v for k, v in softest.items()}}
        true = on_it.receptance(replace(base, effects=(there,), values=values), look.lines)
        without = problem.receptance(base, look.lines)
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
    look = screening._Look.of(mine, base, 44, 24, 700)
    gone, there = look._local(()).with_terms(look._terms(grid, False))
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


def test_a_place_is_moved_along_by_a_step_of_the_grid_within_the_member(prepared):
    case, problem, _, _ = prepared
    mass, bar = (propose(case.model, [kind])[0] for kind in ("point_mass", "member_density"))
    grid, (_, position) = Grid.of(problem, mass), mass.parameters()
    places = sorted({p["position"] for p in grid.points})
    step = places[1] - places[0]
    middle = {"mass": 0.1, "position": 0.5 * position.upper}
    assert [p["position"] for p in grid.along(middle)] == pytest.approx(
        [middle["position"] + by for by in (0.0, -step, step)]
    )
    assert {p["mass"] for p in grid.along(middle)} == {0.1}
    at_end = [p["position"] for p in grid.along({"mass": 0.1, "position": 0.1 * step})]
    assert at_end == pytest.approx([0.1 * step, position.lower, 1.1 * step])
    assert Grid.of(problem, bar).along({"change": 0.1}) == ()


@pytest.mark.parametrize("settled", [False, True])
def test_the_short_list_has_the_right_candidate(prepared, monkeypatch, settled):
    case, problem, null, candidates = prepared
    monkeypatch.setattr(screening, "MOST_CANDIDATES", 10)
    monkeypatch.setattr(screening, "N_LISTED", 5)
    grids = [Grid.of(problem, e) for e in candidates]
    listed, measures = screening.shortlist(problem, (null, problem.at_nominal(null)), grids, silent)
    assert len(listed) < 0.6 * len(grids)
    right = next(k for k, i in enumerate(listed) if grids[i].effect.name == case.hidden.name)
    assert measures.shape == (len(listed), 4)
    assert (measures < measures[right]).sum(axis=0).min() < 3
    chosen = [c for c in screen(problem, null, grids, settled, silent) if c.rank < 5]
    names = {(c.effect.kind, c.effect.where) for c in chosen}
    assert (case.hidden.kind, case.hidden.where) in names


def test_a_weak_effect_leads_by_its_score(prepared):
    # the same heavier member, a twentieth of it, in data of the fitted model itself with 1 % of noise
    case, problem, _, candidates = prepared
    grid = Grid.of(problem, case.hidden)
    weak = case.hidden.with_values(**grid.scaled({"change": case.hidden.change}, 0.05))
    nominal = problem.nominal()
    with_it = replace(nominal, effects=(weak,))
    rng = np.random.default_rng(0)
    H = problem.receptance(with_it)
    H = H * (1 + 0.01 * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)) / np.sqrt(2))
    problem = replace(problem, data=replace(problem.data, H=H))
    null = problem.fit()
    grids = [Grid.of(problem, e) for e in candidates]
    first, second, *_ = screen(problem, null, grids, True, silent)
    # with the material's density uncertain, a little more in one of two members is a little less in the other
    assert {first.effect.kind, second.effect.kind} == {weak.kind}
    assert weak.where in (first.effect.where, second.effect.where)


def test_strong_effects_are_looked_at_too_where_the_models_error_may_hide_them(prepared, monkeypatch):
    _, problem, null, candidates = prepared
    grids = [Grid.of(problem, e) for e in candidates]

    def looked(*weak):
        monkeypatch.setattr(screening, "_screen_weak", lambda *args: weak)
        return screen(problem, null, grids, True, silent, weak_only=False)

    strong = looked()
    assert len(strong) > 2
    assert all(c.rank < screening.N_BEST_STRONG for c in strong)
    names = [c.effect.name for c in strong]
    other = next(g for g in grids if g.effect.name not in names)
    known = strong[1].effect
    weak = (
        screening.Screened(known, (parameter_values(known),)),
        screening.Screened(other.effect, (other.points[0],)),
    )
    first, second, *rest = looked(*weak)
    assert first.starts == (*weak[0].starts, strong[1].starts[0])  # what is among both has both starts
    assert second.starts == weak[1].starts
    assert [(c.effect.name, c.starts) for c in rest] == [
        (c.effect.name, c.starts) for c in strong if c.effect.name != known.name
    ]
    assert screen(problem, null, grids, True, silent) == weak
    # of the low band, which few lines see apart from the whole, only while much is unexplained
    asked = []
    look = screening._Look.of
    monkeypatch.setattr(
        screening._Look, "of", lambda *args, **more: asked.append(args[3]) or look(*args, **more)
    )
    looked()
    screen(problem, null, grids[:2], False, silent)
    assert asked == [0, screening.N_LOW, screening.N_LOW]


def test_the_best_of_the_short_list_go_on_whatever_the_grids_say(prepared, monkeypatch):
    _, problem, null, candidates = prepared
    grids = [Grid.of(problem, e) for e in candidates]

    def first() -> set[str]:
        return {c.effect.name for c in screen(problem, null, grids, False, silent) if c.rank == 0}

    before = first()
    look = screening._Look.of(problem, null, 44, 24, 700)
    seen = [i for i, g in enumerate(grids) if np.isfinite(look.levels(g)).any() and not g.effect.released()]
    other = next(i for i in seen if grids[i].effect.name not in before)
    levels = np.ones((4, len(grids)))
    levels[2, other] = 0.1
    monkeypatch.setattr(screening, "MOST_CANDIDATES", 10)
    monkeypatch.setattr(screening, "_proportional_levels", lambda *args: levels)
    assert grids[other].effect.name in first()


def test_of_very_many_rivals_a_short_list_is_looked_at(prepared, monkeypatch):
    case, problem, _, candidates = prepared
    wrong = next(e for e in candidates if e.kind == "point_mass")
    best = problem.fit([wrong], [Grid.of(problem, wrong).points[0]])
    grids = [Grid.of(problem, e) for e in candidates if e is not wrong]
    looked: list[str] = []
    levels = screening._Look.levels
    monkeypatch.setattr(
        screening._Look, "levels", lambda look, grid: looked.append(grid.effect.name) or levels(look, grid)
    )
    monkeypatch.setattr(screening, "MOST_RIVALS", 10)
    monkeypatch.setattr(screening, "N_LISTED", 5)
    found = screening.rivals(problem, best, grids, 4)
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


def test_the_weakest_point_is_not_where_the_effect_is_absent():
    """The grid of an elastic joint's stiffness has the model's own value among its points."""
    case = make_case(1, "cross", "joint_stiffness")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    grids = [Grid.of(problem, e) for e in propose(case.model, ["joint_stiffness"])]
    elastic = [g for g in grids if np.isfinite(g.effect.parameters()[0].absent)]
    assert elastic
    for grid in elastic:
        model_has = grid.effect.parameters()[0].absent
        assert any(p["stiffness"] == pytest.approx(model_has, rel=1e-9) for p in grid.points)
        for point, most in grid.weak_points:
            assert abs(np.log(point["stiffness"] / model_has)) > 0.01
            assert 1 < most < 1e4


def test_a_weak_effect_is_looked_at_on_either_side_of_its_absence():
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    for effect in propose(case.model, ["member_density", "point_mass", "joint_stiffness"]):
        grid = Grid.of(problem, effect)
        p = effect.parameters()[0]
        sides = {np.sign(screening._distance(p, point[p.name])) for point, _ in grid.weak_points}
        all_sides = {np.sign(screening._distance(p, point[p.name])) for point in grid.points}
        assert sides == all_sides - {0}
        slight = [point for point, _ in grid.slight_points]
        assert slight == [point for point, _ in grid.weak_points][: len(slight)]
        assert len(slight) == len({tuple(v for k, v in q.items() if k != p.name) for q in grid.points})


def test_a_member_that_is_a_little_heavier_is_looked_at_among_the_first():
    """Its mode moves by more than its resonance is wide, and a little less mass does not show that."""
    case = draw_case(CaseSettings(seed=3401), "weak", 37)
    problem = build_problem(case.model, case.measurement, case.nuisances, connections=True, model_error=0.0)
    grids = tuple(Grid.of(problem, e) for e in propose(case.model, test=case.measurement))
    (hidden,) = case.implants
    looked = [s.effect for s in screen(problem, problem.fit(), grids, True, silent)]
    assert (hidden.hidden.kind, hidden.hidden.place.words) in [(e.kind, e.where) for e in looked]


def test_an_uncertain_parameter_does_not_hide_the_effect_that_takes_its_place():
    case = make_case(1, "cross", "joint_stiffness")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    look = screening._Look.of(problem, problem.nominal(), 60, 0, 10**6)
    uncertain = {(n.effect, n.parameter) for n in problem.nuisances}
    shown, differs = [], False
    for effect in propose(case.model, ["joint_stiffness"]):
        grid = Grid.of(problem, effect)
        if not set(effect.replaces()) & uncertain:
            continue
        near = next(p for p, _ in grid.weak_points)
        (H,) = look._local(()).with_terms([problem.reduced.value_of(effect.with_values(**near))])
        change = look._residuals([H]) - look._now
        size = [np.linalg.norm(look._adapted(change, replaced)) for replaced in ((), effect.replaces())]
        assert size[0] <= size[1] * (1 + 1e-9)
        own, hidden = (look.scores(g)[0] for g in (grid, Grid(cast("Any", Hidden(effect)), grid.points)))
        differs = differs or not np.allclose(own, hidden)
        shown.append(size[1] / size[0])
    assert max(shown) > 1.5
    assert differs  # from what is left where that parameter adapts


def test_an_unknown_at_its_bound_does_not_hide_a_weak_effect(prepared):
    """Connections that are damped as otherwise as they may be cannot be so still more."""
    case = make_case(1, "cross", "joint_stiffness")
    problem = build_problem(case.model, case.measurement, case.nuisances, connections=True)
    base = problem.nominal()
    zeta = base.zeta.copy()
    zeta[-2] = np.exp(problem.damping.limits[-2, 1])
    (effect,) = propose(case.model, ["joint_structural_damping"])
    grid = Grid.of(problem, effect)

    def hidden(zeta, **options):
        """Return the share of a loss factor's change that unknowns do not explain."""
        look = screening._Look.of(problem, replace(base, zeta=zeta), 60, 0, 10**6, **options)
        terms = [problem.reduced.value_of(grid.effect.with_values(**p)) for p, _ in grid.weak_points]
        change = look._residuals(look._local(()).with_terms(terms)) - look._now
        return np.linalg.norm(look._adapted(change)) / np.linalg.norm(change)

    assert hidden(zeta) < 0.85 * hidden(zeta, at_bounds=False)
    assert hidden(base.zeta, at_bounds=False) == pytest.approx(hidden(base.zeta))


def test_a_loss_that_an_unknown_at_its_bound_would_hide_leads_the_weak(monkeypatch):
    case = make_case(1, "cross", "joint_stiffness")
    problem = build_problem(case.model, case.measurement, case.nuisances, connections=True)
    zeta = problem.nominal().zeta.copy()
    zeta[-2] = np.exp(problem.damping.limits[-2, 1])
    base = replace(problem.nominal(), zeta=zeta)
    (effect,) = propose(case.model, ["joint_structural_damping"])
    (seen,) = screen(problem, base, [Grid.of(problem, effect)], True, silent)
    look = screening._Look.of
    monkeypatch.setattr(screening._Look, "of", lambda *args, at_bounds: look(*args))
    (hidden,) = screen(problem, base, [Grid.of(problem, effect)], True, silent)
    assert seen.starts != hidden.starts  # how much of it there may be depends on what the unknown takes
