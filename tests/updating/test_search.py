"""Rounds of the search, when an effect pays, and what a search begins with."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dovetail.validation.cases import CaseSettings, draw_case
from fem.model import parameter_values
from fem.reduction.reduced_model import reduce_model
from tests.frames import chain
from tests.hidden.cases import make_case
from updating.diagnosis import acceptance, findings, screening, search
from updating.diagnosis.bootstrap import bootstrap
from updating.diagnosis.diagnose import diagnose, propose
from updating.diagnosis.screening import Grid
from updating.inference import preparation
from updating.inference.fit import BEAMS_LEAVE, EXPLAINED_LEVEL, ITERATIONS, NOISE_COUNTED, FitProblem
from updating.inference.fit_function import LEVEL_FLOOR, ROBUST
from updating.inference.parameters import Nuisance
from updating.inference.preparation import build_problem


def test_effects_with_a_parameter_of_damping_must_gain_more():
    """What is not in the curve of modal damping would be taken for a soft support with much of it."""
    case = make_case(1)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    damps = {
        e.kind: any(acceptance._damps(problem, e, p) for p in e.parameters())
        for e in propose(case.model, test=case.measurement)
    }
    stiff = ("member_density", "member_stiffness", "joint_stiffness", "point_mass", "crack", "rigid_end_zone")
    assert not any(damps[kind] for kind in stiff if kind in damps)
    loose = (
        "joint_viscous_damping",
        "joint_structural_damping",
        "joint_zener",
        "member_damping",
        "foundation",
    )
    assert all(damps[kind] for kind in loose if kind in damps)
    assert damps["rotor"] is False  # what is skew takes no energy
    factors = {e.kind: acceptance.weak_factors(problem, e, beside=False) for e in propose(case.model)}
    assert factors["member_damping"] == (1.05, 1.05, 1.05)
    assert factors["rotor"] == (1.12, 1.05, 0)  # but makes modes complex, as damping out of proportion does
    assert factors["member_stiffness"] == (1.02, 0.95, 0)
    assert {"member_damping", "member_stiffness"} <= damps.keys()


def test_the_best_candidate_that_pays_comes_before_a_better_one_that_does_not():
    case = make_case(0)  # a member is heavier
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    null = problem.fit()
    kinds = ("member_density", "member_stiffness", "point_mass")
    candidates = propose(case.model, kinds)
    round_ = search._Round(problem, null, False, tuple(Grid.of(problem, e) for e in candidates))

    def ranked(pays):
        class Rule(acceptance.Rule):
            def pays(self, after, *, best=True):
                return pays(after.effects[-1].kind)

        rule = Rule(problem, 0.0, False, null)
        order, best = round_.run(rule, 5, lambda text, done: None)
        assert order[0].result is best
        return [r.kind for r in order if r.refined]

    freely = ranked(lambda kind: True)
    assert freely[0] == "member_density"
    other = ranked(lambda kind: kind != "member_density")
    assert other[0] == next(kind for kind in freely if kind != "member_density")
    assert ranked(lambda kind: False) == freely


@pytest.mark.slow
def test_a_round_run_again_fits_only_what_is_new(monkeypatch):
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    null = problem.fit()
    kinds = ("member_density", "member_stiffness", "point_mass", "joint_mass", "preload")
    grids = tuple(Grid.of(problem, e) for e in propose(case.model, kinds))
    rule = acceptance.Rule(problem, 0.0, False, null)
    fitted, looked = [], []

    def fit(self, effects, starts, **options):
        fitted.append(effects[-1].name)
        return whole_fit(self, effects, starts, **options)

    def screen(*args, **options):
        looked.append(options)
        return whole_screen(*args, **options)

    whole_fit, whole_screen = FitProblem.fit, search.screen
    monkeypatch.setattr(FitProblem, "fit", fit)
    monkeypatch.setattr(search, "screen", screen)
    alone = search._Round(problem, null, False, grids)
    few, _ = alone.run(rule, 1, lambda text, done: None)
    once = len(fitted)
    again, _ = alone.run(rule, 1, lambda text, done: None)
    assert len(fitted) == once
    assert [r.name for r in again] == [r.name for r in few]
    more, best = alone.run(rule, 20, lambda text, done: None)
    assert len(more) > len(few)
    quickly = len(fitted)
    fitted.clear()
    other = search._Round(problem, null, False, grids)
    anew, best_anew = other.run(rule, 20, lambda text, done: None)
    assert len(fitted) < quickly + 3  # what the first run fitted fully may not be among the best of all
    assert looked == [{"weak_only": True, "also": r._goes_on} for r in (alone, other)]
    not_right = replace(problem, model_error=EXPLAINED_LEVEL)
    rule = replace(rule, problem=not_right)
    erring = search._Round(not_right, null, True, grids)
    erring.run(rule, 1, lambda text, done: None)
    # a part of the level may be the model's own error
    assert looked[2:] == [{"weak_only": False, "also": erring._goes_on}]
    assert {r.name for r in more} == {r.name for r in anew}
    assert {r.name for r in few if r.refined} <= {r.name for r in more if r.refined}
    assert best.values == best_anew.values


@pytest.mark.parametrize(
    ("after", "falls"),
    [
        ((0.9, 0.9), True),
        ((0.99, 0.7), True),  # on all lines together by 1.08
        ((0.99, 0.99), False),  # by 1.01
        ((0.995, 0.98), False),
        ((0.9, 1.1), False),  # held-out lines worse than by chance
        ((0.45, 1.1), True),  # all in one narrow resonance
        ((0.45, 1.2), False),
    ],
)
def test_weak_effects_count_on_all_lines_together(after, falls):
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    one = replace(problem.nominal(), level=1.0, held_out_level=1.0)
    less = replace(one, level=after[0], held_out_level=after[1])
    weak = acceptance.Factors(acceptance.ACCEPT_WEAK, acceptance.ACCEPT_WEAK_HELD_OUT)
    assert acceptance.falls(one, less, weak, form_right=True) is falls


@pytest.mark.parametrize("form_right", [True, False])
@pytest.mark.parametrize(
    ("after", "falls"),
    [
        ((0.92, 0.92), True),
        ((0.973, 0.877), False),  # on all lines together by 1.05, of which held-out ones say most
        ((0.92, 0.98), False),
    ],
)
def test_what_damps_must_do_so_on_the_fitted_lines_by_themselves(after, falls, form_right):
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    one = replace(problem.nominal(), level=1.0, held_out_level=1.0)
    less = replace(one, level=after[0], held_out_level=after[1])
    (damping,) = propose(case.model, ["member_damping"])[:1]
    factors = acceptance.weak_factors(problem, damping, beside=False)
    assert acceptance.falls(one, less, factors, form_right=form_right) is falls


def test_joints_that_are_damped_otherwise_than_members_leave_no_more_than_noise():
    case = draw_case(CaseSettings(911), "null", 1)  # members 0.3 to 2.5 % over the band, the joint 0.4 %
    alike = build_problem(case.model, case.measurement, case.nuisances)
    assert alike.fit().level > 2 * alike.data.noise_level
    problem = build_problem(case.model, case.measurement, case.nuisances, connections=True)
    fit = problem.fit()
    assert fit.level < 1.2 * problem.data.noise_level
    _, joint = problem.damping.ratio(problem.damping.knots, fit.zeta)
    np.testing.assert_allclose(np.exp(np.log(joint).mean()), 0.004, rtol=0.15)


def test_a_joint_that_damps_many_times_more_is_not_let_off():
    case = draw_case(CaseSettings(1409), "single", 40)  # a loss factor of 0.116, members' ratio 0.4 to 1.4 %
    problem = build_problem(case.model, case.measurement, case.nuisances, connections=True)
    fit = problem.fit()
    assert fit.level > 1.2 * problem.data.noise_level
    right = next(e for e in propose(case.model, ["joint_structural_damping"]))
    start = [Grid.of(problem, right).points[0]]
    assert problem.fit([right], start).level < 0.85 * fit.level


def test_the_bases_error_is_small_where_connections_are_damped_otherwise():
    case = make_case(0, "cross", "nothing")
    problem = build_problem(case.model, case.measurement, case.nuisances, connections=True)
    nominal = problem.nominal()
    fit = replace(nominal, zeta=np.concatenate([nominal.zeta[:-2], [20.0, 1.0]]))
    changed = np.abs(problem.receptance(fit) / problem.receptance(nominal))
    assert np.abs(20 * np.log10(changed)).max() > 1.0  # the joint's damping is seen
    assert preparation.basis_error(problem, fit, 30) < 0.01
    assert (
        preparation.basis_error(problem, fit, 30) < 2 * preparation.basis_error(problem, nominal, 30) + 1e-3
    )


def test_the_basis_is_checked_once_for_each_fit(monkeypatch):
    case = make_case(0, "cross", "nothing")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    fit, other = problem.nominal(), problem.fit()
    asked = []

    def error(_, result, n_lines):
        asked.append((result, n_lines))
        return 0.1

    monkeypatch.setattr(search, "basis_error", error)
    begun = search.Search(problem, (), (), (), fit, (fit, 0.3))
    assert begun.basis_error(6) == 0.3
    assert not asked
    assert replace(begun, current=other).basis_error(6) == 0.1
    assert asked == [(other, 6)]


def test_before_what_is_left_is_unexplained_the_search_goes_on_from_other_candidates(monkeypatch):
    case = make_case(0)  # a member is heavier
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    candidates = propose(case.model, ("member_density", "point_mass"))
    wrong = next(e for e in candidates if e.kind == "point_mass")
    right = next(e for e in candidates if (e.kind, e.where) == (case.hidden.kind, case.hidden.where))
    null = problem.fit()
    fits = [problem.fit([e], [Grid.of(problem, e).points[0]]) for e in (wrong, right)]
    steps = findings.step_of("nominal", problem.nominal()), findings.step_of("uncertain", null)
    begin = search.Search(problem, (), (), steps, null)
    rule = acceptance.Rule(problem, 0.0, False, null)
    ranked = tuple(rule.ranked(f, s, True) for f, s in zip(fits, (1.0, 0.3), strict=True))
    taken = findings.Finding(wrong, findings.parameters_of(wrong, fits[0]), ())
    ended_at = replace(fits[0], solution=replace(fits[0].solution, cost=fits[0].solution.cost - 1.0))
    had = search.Search(problem, (taken,), (ranked,), (*steps, findings.step_of("mass", ended_at)), ended_at)
    floor = search.Floor(0.0, 0.0, EXPLAINED_LEVEL)

    def branched(ranked, enough=False):
        monkeypatch.setattr(search.Floor, "believes", lambda *args: enough)
        return search._branched(begin, had, ranked, candidates, floor, lambda text, done: None)

    ended = branched(ranked)
    (left,) = ended.findings
    assert (left.effect.kind, left.effect.where) == (case.hidden.kind, case.hidden.where)
    assert ended.current.level < 0.2 * had.current.level
    assert [s.label for s in ended.steps[:2]] == ["nominal", "uncertain"]
    assert len(ended.steps) == 3
    assert ended.rounds[0][0].name == right.name
    # the best goes first, though it may do much the same; of the others those that do something else
    wrong_again, right_again = (replace(r, name=f"{r.name} again") for r in ranked)
    order = (ranked[0], wrong_again, replace(ranked[0], name="once more"), ranked[1], right_again)

    def others(tried, order=order):
        return [r for r, _ in search._others(begin, order, tried)]

    assert others({wrong.name}) == [wrong_again, ranked[1]]
    assert others({right.name}) == [ranked[0]]
    assert others(()) == [ranked[0], ranked[1]]
    # so does the one that leaves least, which stands behind where it does not pay alone
    likely = replace(fits[0].solution, cost=min(f.solution.cost for f in fits) - 1.0)
    least = replace(ranked[0], name="least", result=replace(fits[0], solution=likely))
    assert others((), (ranked[0], wrong_again, least, ranked[1])) == [ranked[0], least, ranked[1]]
    # and comes before it where more would stand before it
    unlike = tuple(replace(ranked[0], name=f"mass {i}") for i in range(4))
    with monkeypatch.context() as patch:
        patch.setattr(search, "similarity_of", lambda a, b: 0.0)
        assert others((), (*unlike, least))[:2] == [unlike[0], least]
    # what was found goes on beside more of the candidates, each other beside the usual number, to two
    # effects; beside the best end, if it has two, a third is looked for
    went, found = [], 2
    usual, more = search.N_BEST, search.N_BEST_DEEP

    def forward(begin, candidates, grids, limits, n_best, *_, **options):
        went.append((options.get("most", search.MAX_EFFECTS), n_best))
        return replace(begin, findings=found * begin.findings)

    def ways(*args, **options):
        went.clear()
        branched(*args, **options)
        return went

    monkeypatch.setattr(search, "_forward", forward)
    both = [(2, more), (2, usual)]
    assert ways(ranked) == [*both, (3, usual)]
    no_better = replace(ranked[1], result=fits[0])
    assert ways((ranked[0], no_better)) == both
    found = 1
    assert ways(ranked) == both
    # where one explains all no other is tried
    monkeypatch.setattr(search, "_others", lambda *args: 2 * [(ranked[1], problem)])
    assert ways(ranked) == [*both, (2, usual)]
    assert ways(ranked, enough=True) == both


def test_what_is_looked_at_first_has_a_second_start_however_badly_its_first_ends(monkeypatch):
    monkeypatch.setattr(search, "QUICK_REACH", 0.0)
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    null = problem.fit()
    grids = tuple(Grid.of(problem, e) for e in propose(case.model, ("member_density", "point_mass")))
    round_ = search._Round(problem, null, False, grids)
    round_.run(acceptance.Rule(problem, 0.0, False, null), 3, lambda text, done: None)
    looked = [o for o in round_._looked if o.rank < 3]
    assert len({o.rank for o in looked}) > 1
    for o in looked:
        assert (len(round_._quick[o.effect.name]) > 1) == (o.rank == 0)


@pytest.mark.slow
def test_a_crack_that_stays_at_the_foot_is_found_where_it_is_before_data_are_unexplained(monkeypatch):
    case = draw_case(CaseSettings(seed=2301), "single", 14)
    (hidden,) = case.implants
    truth = hidden.hidden.values(hidden.amplitude)["position"]
    problem = build_problem(case.model, case.measurement, case.nuisances, connections=True, model_error=0.0)
    (crack,) = (e for e in propose(case.model, ("crack",)) if e.name == "crack:left.rz")
    null = problem.fit()
    rule = acceptance.Rule(problem, 0.0, False, null)

    def found():
        round_ = search._Round(problem, null, False, (Grid.of(problem, crack),))
        best = round_.run(rule, search.N_BEST_DEEP, lambda text, done: None)[1]
        assert best is not None
        return best.values[crack.name, "position"]

    def at_the_foot(self, name):
        start = {"compliance": 0.01 * crack.reference, "position": 0.02}
        self._on[name] = problem
        self._final[name] = problem.fit([crack], [start], stages=problem.stages[-1:], max_iterations=1)

    # as when the mass of its element did not follow the kink, and it stayed at the foot however it was fitted
    monkeypatch.setattr(search._Round, "_fit_fully", at_the_foot)
    monkeypatch.setattr(search._Round, "_fit_finely", lambda self, name: self._final[name])
    assert found() == pytest.approx(truth, abs=1e-3)
    monkeypatch.setattr(search._Round, "_fit_elsewhere", lambda self, name: self._final[name])
    assert abs(found() - truth) > 0.1


@pytest.mark.parametrize(("settled", "error", "more"), [(True, 0.3, 1), (True, 0.0, 0), (False, 0.3, 0)])
def test_short_fits_start_from_a_stronger_effect_where_beams_may_err(settled, error, more, monkeypatch):
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=error)
    null = problem.fit()
    grids = tuple(Grid.of(problem, e) for e in propose(case.model, ("member_density", "point_mass")))
    round_ = search._Round(problem, null, settled, grids)
    tried = []

    def fit_stronger(self, name):
        before = [f.values[name, self._grid(name).effect.parameters()[0].name] for f in self._quick[name]]
        whole(self, name)
        tried.append((name, before))

    whole = search._Round._fit_stronger
    monkeypatch.setattr(search._Round, "_fit_stronger", fit_stronger)
    starts = []
    whole_fit = FitProblem.fit

    def fit(self, effects, begin=(), **options):
        starts.append(begin[-1] if begin else {})
        return whole_fit(self, effects, begin, **options)

    monkeypatch.setattr(FitProblem, "fit", fit)
    round_.run(acceptance.Rule(problem, 0.0, settled, null), 5, lambda text, done: None)
    assert bool(tried) == bool(more)
    for name, (value, *_) in tried:
        first = round_._grid(name).effect.parameters()[0]
        stronger = min(max(search.STRONGER * value, first.lower), first.upper)
        assert any(start.get(first.name) == pytest.approx(stronger) for start in starts)


def test_what_leaves_little_of_much_is_not_searched_on_from(monkeypatch):
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    steps = findings.step_of("nominal", problem.nominal()), findings.step_of("uncertain", problem.fit())
    begin = search.Search(problem, (), (), steps, steps[1].result)
    candidates = propose(case.model, ["point_mass"])  # a member is heavier
    went = []
    monkeypatch.setattr(search, "_branched", lambda begin, search, *args: went.append(search) or search)
    floor = search.Floor(0.5 * begin.current.level / 1.25, begin.current.audible_db, 0.0)
    for most, times in ((np.inf, 0), (0.0, 1)):
        monkeypatch.setattr(search.Floor, "believed", lambda self, null, most=most: most)
        search.search_effects(begin, candidates, floor, lambda *a: None)
        assert len(went) == times


def test_what_is_idle_on_the_last_basis_is_dropped(monkeypatch):
    case = make_case(0)  # a member is heavier
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    steps = findings.step_of("nominal", problem.nominal()), findings.step_of("uncertain", problem.fit())
    begin = search.Search(problem, (), (), steps, steps[1].result)
    candidates = propose(case.model, ["member_density"])
    floor = search.Floor(problem.data.noise_level, problem.data.noise_db, 0.0)
    mass = propose(case.model, ["point_mass"])[0].with_values(mass=1e-9)

    def with_a_mass_of_nothing(ended):
        both = [*ended.current.effects, mass]
        fit = problem.fit(both, [parameter_values(e) for e in both], x_from=ended.current)
        entry = findings.Finding(mass, findings.parameters_of(mass, fit), ())
        return search.Search(
            problem,
            (*ended.findings, entry),
            (*ended.rounds[:1], ended.rounds[0]),
            (*ended.steps, findings.step_added([mass], fit)),
            fit,
        )

    monkeypatch.setattr(search, "_on_own_basis", with_a_mass_of_nothing)
    ended = search.search_effects(begin, candidates, floor, lambda *a: None)
    (left,) = ended.findings
    assert (left.effect.kind, left.effect.where) == (case.hidden.kind, case.hidden.where)
    assert [e.kind for e in ended.current.effects] == ["member_density"]
    assert len(ended.steps) == 3
    # one effect alone was judged by what it is
    monkeypatch.setattr(search, "_on_own_basis", lambda ended: replace(ended, current=replace(ended.current)))
    monkeypatch.setattr(search, "_with_idle_dropped", lambda ended, _: pruned.append(ended) or ended)
    pruned: list[search.Search] = []
    (left,) = search.search_effects(begin, candidates, floor, lambda *a: None).findings
    assert (left.effect.kind, left.effect.where) == (case.hidden.kind, case.hidden.where)
    assert len(pruned) == 1  # where it was found


@pytest.mark.parametrize("more", [1.001, 1 / 1.001])
def test_effects_explain_the_data_up_to_their_margin_of_the_level_and_of_the_mean_square(more):
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    null = problem.fit()
    mass = propose(case.model, ["point_mass"])[0]
    fit = problem.fit([mass], [parameter_values(mass)])
    found = findings.Finding(mass, findings.parameters_of(mass, fit), ())
    without, with_it = (search.Search(problem, f, (), (), fit) for f in ((), (found,)))
    level, db = (more * x / search.BELIEVED_MARGIN for x in (fit.level, fit.audible_db))
    for floor in (search.Floor(level, fit.audible_db, 0.0), search.Floor(fit.level, db, 0.0)):
        assert with_it.explains(floor, null) == (more > 1)
        assert without.explains(floor, null)  # a model may leave more
    assert with_it.explains(search.Floor(fit.level, db, fit.level), null)  # and so may beams that err


def test_a_search_among_no_candidates_ends():
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    steps = findings.step_of("nominal", problem.nominal()), findings.step_of("uncertain", problem.fit())
    begin = search.Search(problem, (), (), steps, steps[1].result)
    ended = search.search_effects(begin, (), search.Floor(0.0, 0.0, 0.0), lambda *a: None)
    assert ended.findings == ()
    assert ended.current is begin.current


def test_fine_stages_end_between_modes_and_have_lines():
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    frequency, stages = problem.data.frequency, problem.fine_stages
    modes = preparation.elastic_frequencies(problem.reduced, float(frequency[-1]))
    below = np.searchsorted(modes, stages)
    assert below[0] == preparation.FIRST_STAGE
    assert stages[-1] == frequency[-1]
    growth = preparation.FIRST_STAGE * preparation.STAGE_GROWTH ** np.arange(len(below) - 1)
    np.testing.assert_allclose(below[:-1], growth, atol=0.5)  # all but the last, which has all lines
    counted = frequency[problem.data.mask.any(axis=(1, 2)) & ~problem.data.held_out]
    assert np.searchsorted(counted, stages).min() >= preparation.STAGE_LINES


def test_the_others_at_the_place_of_an_accepted_effect_take_its_turn():
    case = make_case(3, "portal", "support_flexibility")
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    candidates = propose(case.model, ["support_flexibility", "crack", "point_mass"])
    grids = {e.name: Grid.of(problem, e) for e in candidates}
    null = problem.fit()
    rule = acceptance.Rule(problem, 0.0, False, null)
    corner = case.hidden.locations(case.model)[0]
    cracks = [
        (grid.effect, near.points)
        for grid in grids.values()
        if grid.effect.kind == "crack"
        if (near := grid.near(case.model, corner[None], 0.1 * case.model.mesh.size))
    ]
    fits = [problem.fit([effect], [points[len(points) // 2]]) for effect, points in cracks]
    taken = min(fits, key=lambda f: f.level)
    _, ranked, best = search._against_rivals(problem, rule, (), taken, candidates, grids)
    assert (best.effects[-1].kind, best.effects[-1].where) == (case.hidden.kind, case.hidden.where)
    assert ranked[0].name == best.effects[-1].name
    assert ranked[0].asked == null.level / acceptance.STEP_LEVEL
    assert taken.effects[-1].kind == "crack"


def test_a_position_is_fitted_from_beside_where_the_short_fit_ended():
    """A body of 0.16 g·m² 44 mm from a foot ended at 14 mm with four times as much, and a mass did better."""
    case = draw_case(CaseSettings(3501), "single", 93)
    candidates = propose(case.model, ["point_inertia", "point_mass"])
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    null = problem.fit()
    first = search._Round(problem, null, False, tuple(Grid.of(problem, e) for e in candidates))
    inertia = next(e for e in candidates if e.name == "point_inertia:post")
    effect = inertia.with_values(inertia=6.4e-4, position=0.0142)
    first._quick[inertia.name] = [replace(null, effects=(effect,))]
    first._fit_fully(inertia.name)
    ended = first._final[inertia.name]
    truth = case.implants[0].hidden.values(case.implants[0].amplitude)
    assert ended.values["point_inertia:post", "position"] == pytest.approx(truth["position"], abs=0.003)
    assert ended.level < 1.1 * problem.data.noise_level


@pytest.fixture(scope="module")
def of_one_material():
    """Two bars of one material; the second is 1.7 % stiffer than both are said to be."""
    case = draw_case(CaseSettings(3501), "single", 30)
    return case, build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)


def test_that_one_member_is_softer_is_named_with_that_the_other_is_stiffer(of_one_material):
    case, problem = of_one_material
    candidates = propose(case.model, ["member_stiffness", "member_density"])
    grids = {e.name: Grid.of(problem, e) for e in candidates}
    null = problem.fit()
    rule = acceptance.Rule(problem, 0.0, False, null)
    softer, stiffer = (e for e in candidates if e.kind == "member_stiffness")
    taken = problem.fit([softer], [{"change": -0.017}])
    _, ranked, _ = search._against_rivals(problem, rule, (), taken, candidates, grids)
    two = {r.name: r for r in ranked[:2]}
    assert set(two) == {softer.name, stiffer.name}
    assert two[stiffer.name].parameters[0].value == pytest.approx(0.0173, abs=0.001)
    assert two[stiffer.name].level == pytest.approx(two[softer.name].level, rel=0.02)
    assert two[stiffer.name].refined
    # the material's tolerance prefers the softer one, whichever was there first
    taken = problem.fit([stiffer], [{"change": 0.017}])
    _, ranked, best = search._against_rivals(problem, rule, (), taken, candidates, grids)
    assert best.effects[-1].name == ranked[0].name == softer.name
    assert ranked[1].name == stiffer.name


def test_the_opposite_of_a_change_is_that_of_the_only_other_member_of_the_material(of_one_material):
    case, _ = of_one_material
    effects = propose(case.model, ["member_stiffness", "member_density", "member_section", "member_shear"])
    by_kind = {kind: [e for e in effects if e.kind == kind] for kind in {e.kind for e in effects}}
    softer, stiffer = by_kind["member_stiffness"]
    (opposite,) = search._opposites(case.model, softer.with_values(change=-0.02), effects)
    assert (opposite.effect, opposite.starts) == (stiffer, ({"change": 0.02},))
    (opposite,) = search._opposites(case.model, softer.with_values(change=0.9), effects)
    assert opposite.starts == ({"change": -0.8},)  # the least there is
    assert search._opposites(case.model, softer, [softer]) == ()
    for kind in ("member_section", "member_shear"):  # each of two planes; another parameter
        assert search._opposites(case.model, by_kind[kind][0], effects) == ()
    mass = propose(case.model, ["point_mass"])[0]
    assert search._opposites(case.model, mass, effects) == ()
    four = make_case(3, "portal", "support_flexibility").model
    effects = propose(four, ["member_stiffness"])
    assert [len(search._opposites(four, e, effects)) for e in effects] == [0, 0, 0, 0]


def test_candidates_near_a_place_are_those_with_a_point_there():
    case = make_case(3, "portal", "support_flexibility")
    model, mesh = case.model, case.model.mesh
    problem = build_problem(model, case.measurement, case.nuisances)
    longest = max(mesh.member_length(m) for m in mesh.members)
    reach = 0.1 * mesh.size
    kept = 0
    for place in mesh.points[[0, len(mesh.points) // 2, -1]]:
        for effect in propose(model, ["crack", "distributed_mass", "support_flexibility"]):
            grid = Grid.of(problem, effect)
            there = [
                p
                for p in grid.points
                if (np.linalg.norm(effect.with_values(**p).locations(model) - place, axis=1) <= reach).any()
            ]
            near = grid.near(model, place[None], reach, longest)
            assert list(near.points if near else ()) == there
            kept += len(there)
    assert kept > 20


def test_what_is_half_a_member_away_is_at_another_place(monkeypatch):
    case = make_case(3, "portal", "support_flexibility")
    model = case.model
    problem = build_problem(model, case.measurement, case.nuisances)
    candidates = propose(model, ["support_flexibility", "crack", "point_mass"])
    grids = {e.name: Grid.of(problem, e) for e in candidates}
    null = problem.fit()
    right = grids[case.hidden.name].effect
    best = problem.fit([right], [grids[right.name].points[0]])
    near = []
    monkeypatch.setattr(search, "rivals", lambda problem, best, grids, n_best: near.extend(grids) or ())
    monkeypatch.setattr(search, "SAME_PLACE", 10.0)  # all of a frame
    rule = acceptance.Rule(problem, 0.0, False, null)
    search._against_rivals(problem, rule, (), best, candidates, grids)
    reach = search.SAME_MEMBER * max(map(model.mesh.member_length, model.mesh.members))
    places = right.locations(model)
    marks = [g.effect.with_values(**p).locations(model) for g in near for p in g.points]
    away = [np.linalg.norm(m[:, None] - places, axis=2).min() for m in marks]
    assert 0.8 * reach < max(away) <= reach
    assert {g.effect.name for g in near} < set(grids)


def test_what_stood_for_another_effect_gives_way_to_it():
    case = make_case(0)  # a member is heavier
    problem = build_problem(case.model, case.measurement, case.nuisances)
    kinds = ("member_density", "point_mass", "joint_stiffness")
    candidates = propose(case.model, kinds)
    wrong = [next(e for e in candidates if e.kind == kind) for kind in kinds[1:]]
    starts = [Grid.of(problem, e).points[0] for e in wrong]
    null, both = problem.fit(), problem.fit(wrong, starts)
    found = tuple(findings.Finding(e, findings.parameters_of(e, both), ()) for e in both.effects)
    fits = {"nominal": problem.nominal(), "uncertain": null, "both": both}
    steps = tuple(findings.step_of(label, fit) for label, fit in fits.items())
    had = search.Search(problem, found, ((), ()), steps, both)
    limits = acceptance.Limits(EXPLAINED_LEVEL)
    ended = search._exchanged(had, candidates, limits, lambda text, done: None)
    (left,) = ended.findings  # and the one beside it has become idle
    assert (left.effect.kind, left.effect.where) == (case.hidden.kind, case.hidden.where)
    assert [s.label for s in ended.steps[:2]] == ["nominal", "uncertain"]
    assert len(ended.steps) == 3
    assert ended.rounds[0][0].name == left.effect.name
    # what is right stays
    assert search._exchanged(ended, candidates, limits, lambda text, done: None) is ended
    assert search._better(ended, had) is ended
    assert search._better(had, ended) is ended


def test_searches_that_ended_on_few_and_on_many_lines_are_compared_on_as_many():
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    problems = (replace(problem, n_lines=n) for n in (30, 300))
    few, many = (search.Search(p, (), (), (), p.fit()) for p in problems)
    more = many.problem
    was = abs(few.current.solution.cost - many.current.solution.cost)
    cost = [s.current.solution.cost for s in search._on_as_many_lines(few, many)]
    assert was > 0.5
    assert cost[0] == pytest.approx(cost[1], abs=0.1)  # what the search calls no gain

    def told(found, cost):  # as its own lines may have it
        off = replace(found.current, solution=replace(found.current.solution, cost=cost))
        return replace(found, current=off)

    right = case.hidden
    better = search.Search(more, (), (), (), more.fit([right], [parameter_values(right)]))
    low = better.current.solution.cost - 100
    assert search._better(told(few, low), better) is better
    assert search._better(better, told(few, low)) is better
    high = few.current.solution.cost + 10 * acceptance.ACCEPT_GAIN
    assert search._as_good(told(few, high), many)


def test_short_fits_are_cut_short_only_where_much_is_unexplained(monkeypatch):
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    null, grid = problem.fit(), Grid.of(problem, case.hidden)
    option = screening.Screened(case.hidden, grid.points[:1])
    fit, asked = type(problem).fit, []

    def spy(self, *args, **options):
        asked.append((options["max_iterations"], options["n_lines"]))
        return fit(self, *args, **options)

    monkeypatch.setattr(type(problem), "fit", spy)
    for settled in (False, True):
        search._Round(problem, null, settled, (grid,))._fit_quickly([option], lambda text, done: None)
    assert set(asked[:-1]) == {(search.QUICK_ITERATIONS, search.QUICK_LINES)}
    assert asked[-1] == (ITERATIONS, problem.n_lines)


@pytest.mark.parametrize("kind", ["member_damping", "joint_structural_damping"])
@pytest.mark.parametrize(("share", "pays"), [(0.9, False), (-0.9, False), (1.1, True)])
def test_a_loss_factor_within_the_tolerance_of_damping_is_no_effect(kind, share, pays):
    case = make_case(0, "cross")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    null = replace(problem.nominal(), level=1.0, held_out_level=1.0)
    tolerance = problem.damping.std * 2 * np.exp(np.log(null.zeta).mean())
    effect = propose(case.model, [kind])[0].with_values(loss_factor=share * tolerance)
    std = {(effect.name, "loss_factor"): 0.01 * tolerance}
    better = replace(null, effects=(effect,), std=std, level=0.1, held_out_level=0.1)
    assert acceptance.Rule(problem, 0.0, False, null).pays(better) is pays
    # where nothing but noise stands against it, much less is one, but not beside another
    right = replace(problem, model_error=0.0)
    assert acceptance.Rule(right, 2.0, True, null).pays(better)
    little = effect.with_values(loss_factor=share * acceptance.LOSS_ALIKE / problem.damping.std * tolerance)
    within = replace(better, effects=(little,))
    assert acceptance.Rule(right, 2.0, True, null).pays(within) is pays
    beside = replace(null, effects=(propose(case.model, ["member_density"])[0],))
    assert acceptance.Rule(right, 2.0, True, beside).pays(better) is pays


def test_an_effect_that_may_as_well_be_absent_does_not_pay_where_the_model_is_settled():
    kinds = ("member_density", "joint_stiffness", "point_mass")
    crossed, standing = (make_case(i, family) for i, family in ((0, "cross"), (1, "portal")))
    heavier, joint, mass = (propose(crossed.model, [kind])[0] for kind in kinds)
    support = propose(standing.model, ["support_flexibility"])[0]

    def pays(effect, deviation, settled=True, level=0.9, with_place=0.0):
        case = standing if effect is soft else crossed
        problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
        null = replace(problem.nominal(), level=1.0, held_out_level=1.0)
        p, *_ = effect.parameters()
        fit = replace(null, effects=(effect,), level=level, held_out_level=level)
        fit = replace(fit, std={(effect.name, p.name): deviation})
        if effect is mass:  # ± deviation and ± 1 m, correlated
            own = {(effect.name, q.name): q.value for q in effect.parameters()}
            n, both = len(fit.values), with_place * deviation
            C = np.eye(n + 2)
            C[n:, n:] = [[deviation**2, both], [both, 1.0]]
            fit = replace(fit, values=fit.values | own, covariance=C)
        return acceptance.Rule(problem, 2.0, settled, null).pays(fit)

    soft = support.with_values(stiffness=1e6)
    assert np.isinf(soft.parameters()[0].absent)
    assert [pays(soft, x) for x in (3.3e5, 3.4e5)] == [True, False]
    assert pays(soft, 1e9, level=0.7)  # the FRFs of one that is loose no longer change with it
    more = heavier.with_values(change=0.01)
    assert [pays(more, x) for x in (0.0033, 0.0034)] == [True, False]
    assert pays(more, 0.0034, settled=False)  # more may be missing, and make everything uncertain
    assert [pays(heavier.with_values(change=-0.01), x) for x in (0.0033, 0.0034)] == [True, False]
    (p,) = joint.parameters()
    assert np.isfinite(p.absent)
    softer = joint.with_values(stiffness=p.absent / 1.2)  # ln 1.2 = 0.182
    deviations = (p.absent / 1.2 * np.sinh(x) for x in (0.060, 0.062))
    assert [pays(softer, x) for x in deviations] == [True, False]
    loose = joint.with_values(stiffness=0.01 * p.absent)  # next to nothing, by any factor
    assert [pays(loose, x * p.absent) for x in (0.32, 0.34)] == [True, False]
    mass = mass.with_values(mass=1.0)
    assert [pays(mass, x) for x in (0.33, 0.34)] == [True, False]
    # what is uncertain as its place is counts as where that is known: √(1 - 0.6²) = 0.8 of it
    assert [pays(mass, x, with_place=0.6) for x in (0.33 / 0.8, 0.34 / 0.8)] == [True, False]


def test_what_is_said_to_be_uncertain_is_no_effect_within_its_tolerance():
    case = make_case(1, "cross", "joint_stiffness")  # joints are known to 3 %
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    null = problem.nominal()
    joint = next(e for e in propose(case.model, ["joint_stiffness"]) if e.replaces() == (("J", "krz"),))
    (p,) = joint.parameters()

    def known(factor, problem=problem):
        fit = replace(null, effects=(joint.with_values(stiffness=factor * p.absent),))
        return acceptance.known_already(problem, fit, joint.name)

    within, beyond = (np.exp(0.03 * acceptance.STRAINED * f) for f in (0.99, 1.01))
    assert [known(f) for f in (within, 1 / within, beyond, 1 / beyond)] == [True, True, False, False]
    assert not known(1.0, replace(problem, nuisances=()))  # as certain as the rest of the model
    assert not acceptance.known_already(
        problem, replace(null, effects=(propose(case.model, ["member_density"])[0],)), "member_density:U"
    )
    fit = replace(
        null,
        level=0.5 * null.level,
        held_out_level=0.5 * null.held_out_level,
        effects=(joint.with_values(stiffness=within * p.absent),),
        std={(joint.name, p.name): 1e-9},
    )
    rule = acceptance.Rule(problem, 0.0, False, null)
    assert not rule.pays(fit)
    far = replace(fit, effects=(joint.with_values(stiffness=beyond * p.absent),))
    assert rule.pays(far)


def test_fits_are_repeated_from_where_they_are_on_the_whole_band():
    # On the lower part of the band a mass spread over 0.3 m and one that reaches to the member's end look
    # alike, and a fit that begins there ends in the second, 25 % worse.
    case = draw_case(CaseSettings(911), "two", 3)
    problem = build_problem(case.model, case.measurement, case.nuisances, connections=True)
    support, mass = (
        next(e for e in propose(case.model, [kind]) if e.name == name)
        for kind, name in (
            ("support_flexibility", "support_flexibility:S1.z"),
            ("distributed_mass", "distributed_mass:post"),
        )
    )
    starts = [{"stiffness": 2.7e7}, {"mass": 0.17, "position": 0.393, "width": 0.29}]
    right = problem.fit([support, mass], starts, stages=problem.stages[-1:])
    assert problem.refit(right).level == pytest.approx(right.level, rel=1e-3)
    wide = [starts[0], {"mass": 0.157, "position": 0.411, "width": 0.36}]
    valley = problem.fit([support, mass], wide, stages=problem.stages[-1:])
    assert valley.level > 1.1 * right.level
    assert search._polish(problem, valley).level < 1.01 * right.level


def test_what_damps_must_do_more_and_so_must_what_comes_beside_others():
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    heavier, damped = (propose(case.model, [kind])[0] for kind in ("member_density", "member_damping"))
    assert acceptance.weak_factors(problem, heavier, beside=False)[0] == acceptance.ACCEPT_WEAK
    assert acceptance.weak_factors(problem, heavier, beside=True)[0] == acceptance.ACCEPT_WEAK_BESIDE
    alone, among = (acceptance.weak_factors(problem, damped, beside=beside) for beside in (False, True))
    assert alone == (acceptance.ACCEPT_WEAK_DAMPING,) * 3
    assert among == (acceptance.ACCEPT_WEAK_DAMPING_BESIDE,) * 3
    fit = problem.nominal()
    fit = replace(fit, level=0.5, solution=replace(fit.solution, cost=-10.0))
    n = problem.n_independent()
    none, *scores = [
        acceptance.score(problem, replace(fit, effects=e), 1) for e in ((), (heavier,), (damped,))
    ]
    assert scores[0] - none == 1
    assert scores[1] - scores[0] == pytest.approx(n * np.log(acceptance.DAMPING_MARGIN))


def test_what_a_fit_foretells_counts_as_what_it_has_seen():
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    fit = problem.nominal()
    ratio, mask, held = problem.log_ratio(fit), problem.data.mask, problem.data.held_out
    weight, bands = problem.data.weight, problem.band_of(np.arange(len(held)))
    expected = 0.0
    for band in np.unique(bands):
        there = mask & (held & (bands == band))[:, None, None]
        square = np.abs(weight[there] * ratio[there]) ** 2
        misfit = (2 * ROBUST**2 * (np.sqrt(1 + square / ROBUST**2) - 1)).mean()
        share = there.sum() / mask[held].sum()
        expected += problem.n_independent() / 6 * share * np.log(LEVEL_FLOOR**2 + misfit)
    assert len(np.unique(bands)) > 1
    assert fit.unseen == pytest.approx(expected)
    fit = replace(fit, solution=replace(fit.solution, cost=-10.0))
    assert acceptance.fitted_score(problem, fit, 0) == -10
    for model_error in (0.0, 0.3):
        mine = replace(problem, model_error=model_error)
        assert acceptance.score(mine, fit, 0) == pytest.approx(expected - 10)


def test_a_mass_must_be_certain_to_be_spread_where_beams_may_err():
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    point, spread = (propose(case.model, [kind])[0] for kind in ("point_mass", "distributed_mass"))
    fit = replace(problem.nominal(), solution=replace(problem.nominal().solution, cost=0.0))
    for model_error, price in ((0.3, acceptance.CERTAIN**2 / 2), (0.0, 1 / NOISE_COUNTED)):
        mine = replace(problem, model_error=model_error)
        one, more = (acceptance.score(mine, replace(fit, effects=(e,))) for e in (point, spread))
        assert more - one == pytest.approx(price)
        both = acceptance.score(mine, replace(fit, effects=(spread, point)))  # only the last is asked for
        assert both == pytest.approx(one)


def test_beside_another_an_effect_must_take_more_where_beams_may_err():
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    nominal = problem.nominal()
    first, second = (propose(case.model, [kind])[0] for kind in ("member_density", "ground_spring"))
    second = second.with_values(stiffness=1e3)
    firm, loose = 0.99e3 / acceptance.FIRM, 1.01e3 / acceptance.FIRM
    before = replace(nominal, level=0.2, held_out_level=0.2, solution=replace(nominal.solution, cost=0.0))

    def pays(level, *, beside, noise=0.0, std=loose):
        without = replace(before, effects=(first,) if beside else ())
        after = replace(
            without, effects=(*without.effects, second), std={(second.name, "stiffness"): std}, level=level,
            held_out_level=level,
        )  # fmt: skip
        return acceptance.Rule(replace(problem, model_error=0.3), 0.3, True, without, noise).pays(after)

    alone, together = 0.2 / acceptance.ACCEPT_SETTLED, 0.2 / acceptance.ACCEPT_BESIDE
    assert pays(0.99 * alone, beside=False)
    assert not pays(0.99 * alone, beside=True)
    assert not pays(1.01 * together, beside=True)
    assert pays(0.99 * together, beside=True)
    assert pays(0.99 * alone, beside=True, noise=alone)
    assert pays(0.99 * alone, beside=True, std=firm)
    assert not pays(1.01 * alone, beside=True, std=firm)


def test_what_takes_energy_counts_by_the_score_where_beams_may_err():
    """Beams leave errors of stiffness and mass, which a damper does not take up."""
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.3)
    damper, spring = (propose(case.model, [kind])[0] for kind in ("ground_damper", "ground_spring"))
    damper, spring = damper.with_values(damping=30.0), spring.with_values(stiffness=1e3)
    foundation = propose(make_case(1).model, ["foundation_dashpot"])[0]
    assert acceptance.dissipates(problem, damper)
    assert not acceptance.dissipates(problem, spring)
    assert not acceptance.dissipates(
        build_problem(make_case(1).model, make_case(1).measurement, ()), foundation
    )
    nominal = problem.nominal()
    before = replace(
        nominal, level=0.1, held_out_level=0.1, unseen=0.0, solution=replace(nominal.solution, cost=0.0)
    )

    def pays(effect, fitted, unseen, *, beside=(), level=0.09, held_out=0.09, best=True, error=0.3, std=14.0):
        after = replace(
            before, effects=(*beside, effect), values={(effect.name, effect.parameters()[0].name): 30.0},
            std={(effect.name, effect.parameters()[0].name): std}, level=level, held_out_level=held_out,
            unseen=-unseen, solution=replace(nominal.solution, cost=-fitted),
        )  # fmt: skip
        rule = acceptance.Rule(
            replace(problem, model_error=error), 0.3, True, replace(before, effects=beside)
        )
        return rule.pays(after, best=best)

    least = acceptance.ACCEPT_DAMPING
    assert pays(damper, 0.6 * least, 0.5 * least)
    assert not pays(damper, 0.6 * least, 0.3 * least)
    assert not pays(damper, 0.6 * least, 0.5 * least, held_out=0.11)
    assert not pays(damper, 0.6 * least, 0.5 * least, best=False)
    assert pays(damper, 0.6 * least, 0.5 * least, error=0.0)  # certain by what it gains
    assert not pays(spring, 0.6 * least, 0.5 * least)
    # where the form is right a weak one counts, though the levels hardly fall, if it is certain and alone
    least = acceptance.ACCEPT_WEAK_DAMPED + 1 / NOISE_COUNTED
    weak = {"error": 0.0, "std": 5.0, "level": 0.099, "held_out": 0.099}
    assert pays(damper, 0.6 * least, 0.5 * least, **weak)
    assert not pays(damper, 0.6 * least, 0.3 * least, **weak)
    assert not pays(damper, 0.6 * least, 0.5 * least, **weak | {"held_out": 0.101})
    assert not pays(damper, 0.6 * least, 0.5 * least, **weak | {"std": 14.0})
    assert not pays(damper, 0.6 * least, 0.5 * least, **weak, best=False)
    assert not pays(damper, 0.6 * least, 0.5 * least, **weak, beside=(spring,))
    assert not pays(spring, 0.6 * least, 0.5 * least, **weak)


def test_nothing_that_damps_is_missing_where_members_damping_may_do_more():
    case = make_case(1)
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    kinds = ("member_damping", "foundation_dashpot", "member_density")
    final = {k: replace(problem.nominal(), effects=(propose(case.model, [k])[0],)) for k in kinds}

    def paying(order, tolerated, model_error=0.0):
        rule = SimpleNamespace(
            tolerates=lambda fit: fit.effects[0].kind in tolerated, pays=lambda fit, best: best or "not best"
        )
        mine = search._Round(replace(problem, model_error=model_error), problem.nominal(), True, ())
        return [mine._pays(rule, final, order, name) for name in order]

    assert paying(kinds, ()) == [True, "not best", "not best"]
    assert paying(kinds, kinds[:1]) == [False, False, "not best"]
    assert paying(kinds[::-1], kinds[:1]) == ["not best", True, "not best"]
    final["rotor"] = replace(problem.nominal(), effects=(propose(case.model, ["rotor"])[0],))
    assert paying((kinds[0], "rotor"), kinds[:1]) == [False, False]  # which makes modes complex, too
    assert paying(kinds, kinds[:1], 0.3) == [True, "not best", "not best"]


def test_twins_of_the_best_are_fitted_fully_where_weak_effects_are_looked_for():
    case = make_case(1)
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    nominal = problem.nominal()

    def fit(cost, level=0.1):
        return replace(nominal, level=level, solution=replace(nominal.solution, cost=cost))

    def near(settled, error=0.0):
        mine = search._Round(replace(problem, model_error=error), fit(0.0), settled, ())
        fits = {"best": fit(-10.0), "twin": fit(-9.1, 0.19), "other": fit(-8.9, 0.17)}
        mine._quick.update({name: [f] for name, f in fits.items()})
        return [name for name in fits if mine._is_near(name, "best")]

    assert near(settled=True) == ["best", "twin"]
    assert near(settled=True, error=0.3) == []
    assert near(settled=False) == ["best", "other"]


def test_what_held_out_lines_put_first_of_the_short_fits_is_fitted_fully(monkeypatch):
    case = make_case(1)
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    null = problem.nominal()
    effects = propose(case.model, ["member_density"])[:5] + propose(case.model, ["member_stiffness"])[:3]
    names = [e.name for e in effects]
    unseen = dict.fromkeys(names, 0.0)
    unseen[names[-1]], unseen[names[-2]] = -9.0, -5.0

    def fit_of(name):
        cost = 4.0 * names.index(name) / names.index(names[-1])
        effect = effects[names.index(name)]
        own = {(effect.name, p.name): p.value for p in effect.parameters()}
        solution = replace(null.solution, cost=cost)
        return replace(null, effects=(effect,), solution=solution, values=own, std=own)

    def fitted(settled, error):
        grids = tuple(Grid.of(problem, e) for e in effects)
        mine = search._Round(replace(problem, model_error=error), null, settled, grids)
        mine._looked = tuple(screening.Screened(e, (), 0, 2.0) for e in effects)
        fully = []

        def quickly(self, chosen, say):
            self._quick.update({n: [fit_of(n)] for n in names})
            self._on.update(dict.fromkeys(names, problem))

        monkeypatch.setattr(search._Round, "_fit_quickly", quickly)
        monkeypatch.setattr(search._Round, "_fit_stronger", lambda *_: None)
        monkeypatch.setattr(search._Round, "_is_near", lambda *_: False)
        monkeypatch.setattr(search._Round, "_pays", lambda *_: True)
        monkeypatch.setattr(search, "known_already", lambda *_: False)
        monkeypatch.setattr(
            search._Round, "_fit_fully", lambda self, n: (fully.append(n), self._final.update({n: fit_of(n)}))
        )
        monkeypatch.setattr(
            FitProblem,
            "assessed",
            lambda self, fit, n=None: replace(fit, unseen=unseen[fit.effects[0].name]),
        )
        mine.run(search.Rule(mine.problem, 1.0, settled, null), 20, lambda text, done: None)
        return fully

    first = names[: search.LEAST_REFINED]
    assert fitted(True, 0.0) == [*first, names[-2], names[-1]]
    assert fitted(True, 0.3)[:3] == first
    assert names[-1] not in fitted(True, 0.3)
    assert names[-1] not in fitted(False, 0.0)


def test_what_takes_energy_is_looked_at_whatever_stands_before_it(monkeypatch):
    case = make_case(1)
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.3)
    null = problem.fit()
    kinds = ("member_density", "member_stiffness", "point_mass", "ground_damper")
    grids = tuple(Grid.of(problem, e) for e in propose(case.model, kinds))
    monkeypatch.setattr(screening, "N_BEST_WEAK", 1)

    def weak(also):
        return screening.screen(problem, null, grids, True, lambda text, done: None, also=also)

    first = weak(lambda effect: False)
    assert len(first) == 1
    other = "ground_damper" if first[0].effect.kind != "ground_damper" else "point_mass"
    assert [s.effect.kind for s in weak(lambda effect: effect.kind == other)][1:] == [other]
    assert len(weak(lambda effect: effect.kind == first[0].effect.kind)) == 1


def test_an_effect_stays_beside_another_only_if_beams_could_not_leave_as_much(monkeypatch):
    case = make_case(0)
    problem = replace(build_problem(case.model, case.measurement, case.nuisances), model_error=0.3)
    nominal = problem.nominal()
    effects = tuple(propose(case.model, [kind])[0] for kind in ("member_density", "point_mass"))
    found = [findings.Finding(e, (), ()) for e in effects]

    def left(without, settled, firm=False, energy=False):
        """Return what stays of two where the second leaves 0.1 and 0.1 times a factor is left without it."""
        fits = {effects[0].name: 0.9, effects[1].name: 0.1 * without}
        monkeypatch.setattr(FitProblem, "fit_without", lambda self, fit, name: less(fits[name], name))
        monkeypatch.setattr(search, "known_already", lambda *_: False)
        monkeypatch.setattr(search, "stands_out", lambda *_: True)
        monkeypatch.setattr(search, "is_firm", lambda *_: firm)
        monkeypatch.setattr(search, "takes_energy", lambda *_: energy)
        monkeypatch.setattr(search, "at_values_of", lambda fit, kept: list(kept))
        limits = search.Limits(settled, 0.0, 0.0)
        kept, _ = search._without_idle(problem, list(found), less(0.1, ""), limits)
        return [f.effect.kind for f in kept]

    def less(level, name):
        kept = tuple(e for e in effects if e.name != name)
        return replace(nominal, effects=kept, level=level, held_out_level=level)

    both, one = [e.kind for e in effects], ["member_density"]
    less_than_asked = 0.95 * acceptance.ACCEPT_BESIDE
    assert left(1.05 * acceptance.ACCEPT_BESIDE, 0.3) == both
    assert left(less_than_asked, 0.3) == one
    assert left(less_than_asked, 0.15) == both  # not right without
    # what lies far off its absence, or takes energy as no stiffness does, stays for less
    assert left(less_than_asked, 0.3, firm=True) == both
    assert left(0.95 * acceptance.ACCEPT_LEVEL, 0.3, firm=True) == one
    assert left(1.01, 0.3, energy=True) == both
    assert left(0.95 * acceptance.ACCEPT_LEVEL, 0.11, energy=True) == one  # only where it is right without


@pytest.mark.parametrize(
    ("gain", "error", "stands"),
    [(1.1, 0.0, True), (0.9, 0.0, False), (1.1, 0.3, False)],
)
def test_what_the_likelihood_is_sure_of_need_not_lie_off_its_absence(gain, error, stands):
    """Where the form is right: a deviation is that of a linear law, and a width's may be far from one."""
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=error)
    nominal = replace(problem.nominal(), level=0.1, unseen=0.0)
    null = replace(nominal, solution=replace(nominal.solution, cost=0.0))
    spring = propose(case.model, ["ground_spring"])[0].with_values(stiffness=10.0)
    fitted, unseen = (-share * gain * acceptance.CERTAIN_GAIN for share in (0.7, 0.3))
    fit = replace(
        null,
        effects=(spring,),
        std={(spring.name, "stiffness"): 5.0},
        solution=replace(null.solution, cost=fitted),
        unseen=unseen,
    )
    assert acceptance.stands_out(problem, null, fit, spring.name) == stands


def test_one_value_that_is_computed_to_be_nearly_nothing_does_not_make_the_error(monkeypatch):
    """At an antiresonance the computed FRF is as near 0 as a line may lie to it; noise keeps the measured."""
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    data = replace(problem.data, noise=np.full(problem.data.noise.shape, 0.1))
    problem, nominal = replace(problem, data=data), problem.nominal()
    computed = np.where(data.mask, 1.1 * data.H, 1.0)
    line = int(np.flatnonzero(data.mask[:, 0, 0] & ~data.held_out)[0])
    monkeypatch.setattr(FitProblem, "receptance", lambda self, fit, lines: computed[lines])
    before = problem.assessed(nominal)
    computed[line, 0, 0] = 1e-9 * data.H[line, 0, 0]
    after = problem.assessed(nominal)
    n = data.mask[~data.held_out].sum()
    error = np.log([1.1, 0.1]) * 20 / np.log(10)
    assert before.audible_db == pytest.approx(error[0])
    assert after.audible_db == pytest.approx(np.sqrt(((n - 1) * error[0] ** 2 + error[1] ** 2) / n))
    assert after.fit_db == pytest.approx(np.sqrt(((n - 1) * error[0] ** 2 + 180**2) / n))
    computed[line, 0, 0] = 1e9 * data.H[line, 0, 0]  # which no noise does
    far = problem.assessed(nominal)
    assert far.audible_db == far.fit_db == pytest.approx(after.fit_db)


def test_what_tells_an_effect_from_a_simpler_one_must_be_certain_in_the_fit_as_well():
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    wide = propose(case.model, ["distributed_mass"])[0].with_values(width=0.06)
    for std, certain in ((0.019, True), (0.021, False)):
        fit = replace(problem.nominal(), effects=(wide,), std={(wide.name, "width"): std})
        assert acceptance.spread_is_certain(fit, wide) == certain
    point = propose(case.model, ["point_mass"])[0]
    assert acceptance.spread_is_certain(problem.nominal(), point)


@pytest.mark.parametrize("kind", ["foundation", "foundation_dashpot"])
def test_a_foundation_must_be_certain_to_be_damped_where_beams_may_err(kind, monkeypatch):
    case = make_case(1)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    effect = propose(case.model, [kind])[0]
    nominal = problem.nominal()
    fit = replace(nominal, effects=(effect,), solution=replace(nominal.solution, cost=0.0))
    prices = []
    for model_error in (0.3, 0.0):
        mine = replace(problem, model_error=model_error)
        damped = acceptance.score(mine, fit)
        with monkeypatch.context() as m:
            m.setattr(type(effect), "spread", "")
            prices.append(damped - acceptance.score(mine, fit))
    assert prices == [pytest.approx(acceptance.CERTAIN**2 / 2 - 1), pytest.approx(0.0)]


def test_what_the_posterior_gains_by_much_pays_though_the_whole_level_falls_little():
    """A soft spring to the ground acts below the first resonance of a free structure and nowhere else."""
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    null = problem.nominal()
    null = replace(null, level=0.2, held_out_level=0.2, solution=replace(null.solution, cost=0.0))
    spring = propose(case.model, ["ground_spring"])[0].with_values(stiffness=1e3)

    def pays(gain, held_out, *, settled, form_right):
        mine = replace(problem, model_error=0.0 if form_right else 0.3)
        price = acceptance.score(mine, replace(null, effects=(spring,))) - acceptance.score(mine, null, 0)
        solution = replace(null.solution, cost=-price - gain)
        after = replace(
            null,
            effects=(*null.effects, spring),
            std={(spring.name, "stiffness"): 1.0},
            level=0.199,
            held_out_level=held_out,
            solution=solution,
        )
        return acceptance.Rule(mine, 0.3, settled, null).pays(after)

    enough = acceptance.ACCEPT_GAIN + 0.1
    for settled in (False, True):
        assert pays(enough, 0.2, settled=settled, form_right=False)
        assert not pays(acceptance.ACCEPT_GAIN - 0.1, 0.2, settled=settled, form_right=False)
        assert not pays(enough, 0.22, settled=settled, form_right=False)
    assert pays(enough, 0.2, settled=False, form_right=True)
    null = replace(null, effects=(propose(case.model, ["member_density"])[0],))  # beside another
    assert not pays(enough, 0.2, settled=False, form_right=False)
    null = replace(null, effects=())
    assert not pays(enough, 0.2, settled=True, form_right=True)  # weak effects have thresholds of their own


def test_what_takes_the_level_down_to_noise_pays_though_it_was_little():
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)  # beams may err
    null = replace(problem.nominal(), level=0.05, held_out_level=0.05)
    heavier, another = propose(case.model, ["member_density"])[:2]
    (dashpot, *_) = propose(case.model, ["ground_damper"])

    def pays(level, held_out, *, noise, effect=heavier, beside=(), settled=True):
        before = replace(null, effects=beside)
        p = effect.parameters()[0]
        after = replace(
            null,
            effects=(*beside, effect.with_values(**{p.name: 1.0})),
            std={(effect.name, p.name): 1e-3},
            level=level,
            held_out_level=held_out,
        )
        return acceptance.Rule(problem, 0.3, settled, before, noise).pays(after)

    least, firmly = acceptance.ACCEPT_TO_NOISE, acceptance.ACCEPT_TO_NOISE_FIRMLY
    low, lower = 0.0499 / least, 0.0499 / firmly
    assert pays(low, low, noise=low)
    assert not pays(low, low, noise=0.99 * low)  # beams leave more
    assert not pays(1.01 * low, 1.01 * low, noise=0.05)
    assert not pays(0.9 * low, 0.051, noise=0.05)  # held-out lines are worse
    for other in ({"beside": (another,)}, {"effect": dashpot}):
        assert not pays(1.01 * lower, 1.01 * lower, noise=0.05, **other)
        assert pays(lower, lower, noise=0.05, **other)


def test_where_beams_leave_as_much_only_what_promises_something_is_fitted():
    case = make_case(0)  # a member is heavier
    problem = build_problem(case.model, case.measurement, case.nuisances)
    null = problem.fit()
    grids = tuple(Grid.of(problem, e) for e in propose(case.model, ["member_density"]))

    def fitted(model_error, promise):
        mine = replace(problem, model_error=model_error)
        round_ = search._Round(mine, null, True, grids)
        ranked, _ = round_.run(acceptance.Rule(mine, 1.0, True, null), 5, lambda text, done: None, promise)
        return len(ranked)

    looked = screening.screen(problem, null, grids, True, lambda text, done: None, weak_only=False)
    best = max(option.promise for option in looked)
    assert best > search.PROMISING
    much = 2 * null.level / BEAMS_LEAVE  # beams may leave all of it
    assert fitted(much, 1.01 * best) == 0 < fitted(much, 0.99 * best)
    assert fitted(0.9 * null.level / BEAMS_LEAVE, 1.01 * best) > 0


def test_a_lone_effect_that_the_posterior_asks_for_is_not_pruned(monkeypatch):
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    kinds = ("member_density", "member_damping")
    heavier, damped = (propose(case.model, [kind])[0] for kind in kinds)
    damped = damped.with_values(loss_factor=1e-5)
    null = replace(problem.nominal(), level=0.20, held_out_level=0.20)

    def left(effects, before, gained, limit=0.0):
        """Return what stays of effects without each of which the level is ``before``."""
        values = {(e.name, p.name): p.value for e in effects for p in e.parameters()}
        std = dict.fromkeys(values, 0.1)
        levels = {"level": 0.19, "held_out_level": 0.19}
        fit = replace(null, effects=tuple(effects), values=null.values | values, std=std, **levels)
        monkeypatch.setattr(search, "gains", lambda *args: gained)
        monkeypatch.setattr(
            FitProblem,
            "fit_without",
            lambda self, r, name: replace(
                r,
                effects=tuple(e for e in r.effects if e.name != name),
                level=r.level * before / 0.19,
                held_out_level=r.held_out_level * before / 0.19,
            ),
        )
        taken = [findings.Finding(e, findings.parameters_of(e, fit), ()) for e in effects]
        return [f.effect.kind for f in search._without_idle(problem, taken, fit, acceptance.Limits(limit))[0]]

    assert left([heavier], 0.20, True) == ["member_density"]
    assert left([heavier], 0.20, False) == []
    assert left([heavier], 0.40, False) == ["member_density"]
    with monkeypatch.context() as patch:
        patch.setattr(search, "known_already", lambda problem, fit, name: True)
        assert left([heavier], 0.40, True) == []
    # a loss factor that the tolerance of damping allows for does not stay beside another effect
    assert left([heavier, damped], 0.40, False) == ["member_density"]
    assert left([damped], 0.40, False) == ["member_damping"]
    # nor does what may as well be absent, where the model is right with it
    uncertain = heavier.with_values(change=0.29)  # ± 0.1
    assert left([uncertain], 0.22, True) == ["member_density"]
    assert left([uncertain], 0.22, True, limit=0.2) == []
    assert left([uncertain], 0.24, True, limit=0.2) == ["member_density"]
    assert left([heavier.with_values(change=0.31)], 0.22, True, limit=0.2) == ["member_density"]


def test_joints_that_are_set_alike_are_off_together():
    model = chain(3, 2, stiffness=100.0)
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    nuisances = tuple(Nuisance(f"hinge{i}", "krx", 0.05) for i in (0, 1))
    reduced = reduce_model(model, np.eye(model.n_dof)[:, :1], 100.0)
    problem, null = replace(problem, reduced=reduced, nuisances=nuisances), problem.nominal()
    both = next(
        e for e in propose(model, ["joint_stiffness"]) if e.name == "joint_stiffness:hinge0+hinge1.rx"
    )

    def known(deviations, of=nuisances):
        effect = both.with_values(stiffness=100.0 * np.exp(0.05 * deviations))
        fit = replace(null, effects=(effect,))
        return acceptance.known_already(replace(problem, nuisances=of), fit, both.name)

    limit = acceptance.STRAINED / np.sqrt(2)
    assert [known(0.99 * limit), known(1.01 * limit)] == [True, False]
    assert not known(0.0, nuisances[:1])  # the other is as certain as the rest of the model


def test_of_idle_effects_that_goes_first_which_costs_the_least(monkeypatch):
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    kinds = ("member_density", "point_mass", "member_torsion")
    effects = tuple(propose(case.model, [kind])[0] for kind in kinds)
    values = {(e.name, p.name): p.value for e in effects for p in e.parameters()}
    null = problem.nominal()
    fit = replace(null, effects=effects, values=null.values | values, std=dict.fromkeys(values, 0.1))
    # the first two do much the same: one of them may go, and then not the other
    cost = {"member_density": 3.0, "point_mass": 1.0, "member_torsion": 50.0}

    def without(self, result, name):
        left = tuple(e for e in result.effects if e.name != name)
        both = len({e.kind for e in result.effects} & {"member_density", "point_mass"}) > 1
        gone = next(e.kind for e in result.effects if e.name == name)
        level = result.level * (1.0 if both and gone != "member_torsion" else 1.5)
        solution = replace(result.solution, cost=result.solution.cost + cost[gone])
        return replace(result, effects=left, level=level, held_out_level=level, solution=solution)

    monkeypatch.setattr(FitProblem, "fit_without", without)
    fit = replace(fit, level=0.2, held_out_level=0.2, solution=replace(fit.solution, cost=0.0))
    taken = [findings.Finding(e, findings.parameters_of(e, fit), ()) for e in effects]
    stay, less = search._without_idle(problem, taken, fit, acceptance.Limits(0.0))
    assert [f.effect.kind for f in stay] == ["member_density", "member_torsion"]
    assert [e.kind for e in less.effects] == ["member_density", "member_torsion"]


def test_twins_gain_as_much_of_the_posterior_not_of_the_level():
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    null = problem.fit()
    rule = acceptance.Rule(problem, 0.3, True, null)
    effects = propose(case.model, ["member_density", "member_stiffness"])

    def entry(effect, gain, level):
        solution = replace(null.solution, cost=null.solution.cost - gain)
        values = {**null.values, (effect.name, "change"): 0.01}
        fit = replace(null, effects=(effect,), values=values, solution=solution, level=level * null.level)
        return rule.ranked(replace(fit, std=dict.fromkeys(values, 0.1)), 1.0, True)

    best, as_likely, as_low = (
        entry(effects[0], 50, 0.99),
        entry(effects[1], 47, 1.0),
        entry(effects[2], 5, 0.9),
    )
    twins, rival, *_ = search._explained(problem, (best, as_likely, as_low), null)
    assert twins == (as_likely,)
    assert rival is as_low


def test_of_candidates_that_do_alike_that_comes_first_of_whose_kind_there_are_fewest_places():
    """A member's stiffness is one of two, its thickness one of four: (log 2) / c is between them."""
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    null = problem.fit()
    rule = acceptance.Rule(problem, 1.0, False, null)
    candidates = propose(case.model, ["member_stiffness", "member_section", "point_mass"])
    n_places = {
        kind: sum(e.kind == kind for e in candidates) for kind in ("member_stiffness", "member_section")
    }
    margin = np.log(n_places["member_section"] / n_places["member_stiffness"])
    assert margin > 0.5
    margin /= problem.noise_counted

    def fit_of(kind, gain):
        effect = next(e for e in candidates if e.kind == kind)
        solution = replace(null.solution, cost=null.solution.cost - gain)
        values = {**null.values, **{(effect.name, p.name): 0.1 for p in effect.parameters()}}
        std = dict.fromkeys(values, 1e-3)
        level, held_out = 0.1 * null.level, 0.1 * null.held_out_level
        return replace(
            null,
            effects=(effect,),
            values=values,
            std=std,
            solution=solution,
            level=level,
            held_out_level=held_out,
        )

    def chosen(best, other, pays=True):
        asked = rule if pays else replace(rule, before=other)
        return search._of_fewest_places(problem, asked, [rule.ranked(other, 1.0, True)], best, candidates)

    many = fit_of("member_section", 100.0)
    nearly, too_poor = (fit_of("member_stiffness", 100.0 - f * margin) for f in (0.9, 1.1))
    assert chosen(many, nearly) is nearly
    assert chosen(many, too_poor) is many
    assert chosen(many, nearly, pays=False) is many
    assert chosen(nearly, fit_of("member_section", 100.0)) is nearly
    more = fit_of("point_mass", 101.0)
    assert chosen(many, more) is many  # more parameters would have to earn their places, too


def test_one_effect_does_not_take_the_place_of_two_that_are_much_more_likely():
    case = make_case(0)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    nominal, n = problem.nominal(), acceptance.ACCEPT_GAIN

    def ended(level, cost):
        fit = replace(nominal, level=level, solution=replace(nominal.solution, cost=cost))
        return search.Search(problem, (), (), (), fit)

    several = ended(0.10, 0.0)
    assert search._as_good(ended(0.11, n - 1), several)
    assert not search._as_good(ended(0.11, n + 1), several)
    assert not search._as_good(ended(0.13, n - 1), several)


def test_the_damping_curve_has_a_knot_for_every_two_modes():
    case = draw_case(CaseSettings(911), "null", 3)  # nine modes
    problem = build_problem(case.model, case.measurement, case.nuisances)
    assert (problem.n_modes, len(problem.damping.knots)) == (9, 4)


def test_much_may_be_left_of_more_where_beams_may_err():
    case = make_case(1)
    null = replace(build_problem(case.model, case.measurement, case.nuisances).nominal(), level=0.4)
    assert search.Floor(0.03, 0.2, 0.0).believed(null) == pytest.approx(1.15 * 0.03)
    assert search.Floor(0.03, 0.2, 0.1).believed(null) == pytest.approx(np.sqrt(0.25) * 0.4)
    assert search.Floor(0.03, 0.2, 0.3).believed(null) == 0.3
    assert search.Floor(0.3, 2.0, 0.3).believed(null) == pytest.approx(1.25 * 0.3)
    # the root mean square only counts where the form is right
    fit = replace(null, level=0.03, audible_db=0.27)
    assert not search.Floor(0.03, 0.2, 0.0).believes(fit, null)
    assert search.Floor(0.03, 0.2, 0.1).believes(fit, null)
    # and what is computed under the noise counts as noise in it
    assert search.Floor(0.03, 0.2, 0.0).believes(replace(fit, audible_db=0.2, fit_db=2.0), null)


def test_what_damps_is_tried_though_what_does_nothing_stands_before_it(monkeypatch):
    """Its level counts a tenth more where candidates are compared; a weak effect does not make up for it."""
    monkeypatch.setattr(acceptance, "DAMPING_MARGIN", 1.1)
    case = draw_case(CaseSettings(1511), "weak", 10)  # a fractional joint; with it the level falls by 1.1
    options = {"connections": True, "n_lines": 480, "model_error": 0.0}
    problem = build_problem(case.model, case.measurement, case.nuisances, **options)
    null = problem.fit()
    steps = tuple(
        findings.step_of(label, fit) for label, fit in (("nominal", problem.nominal()), ("uncertain", null))
    )
    begin = search.Search(problem, (), (), steps, null)
    kinds = ("joint_fractional", "joint_viscous_damping", "joint_stiffness", "member_torsion", "rotor")
    candidates = propose(case.model, kinds)
    ended = search._forward(begin, candidates, {}, acceptance.Limits(1.0, 1.0), 5, lambda text, done: None, 1)
    (found,) = ended.findings
    assert acceptance.damps(problem, found.effect)
    assert found.effect.where == "joint J1, rx"
    idle = [r for r in ended.rounds[0] if not acceptance.damps(problem, r.result.effects[-1])]
    first = min(acceptance.fitted_score(problem, r.result) for r in idle)
    assert first < acceptance.fitted_score(problem, ended.current)


def test_an_uncertain_parameter_far_off_its_tolerance_is_an_effect():
    case = draw_case(CaseSettings(1601), "weak", 20)  # a joint that is 28 % softer, known to 8.7 %
    told = {}
    for model_error in (0.0, EXPLAINED_LEVEL):
        kinds = ["joint_stiffness", "point_mass"]
        told[model_error] = diagnose(
            case.model, [case.measurement], case.nuisances, kinds=kinds, model_error=model_error
        )
    found = told[0.0]
    (finding,) = found.findings
    assert (found.verdict, finding.effect.name) == ("effect", "joint_stiffness:J1.rx")
    assert -4 < finding.strain < -3
    assert "3.7 standard deviations off nominal" in found.reason
    (stiffness,) = finding.parameters
    assert stiffness.value == pytest.approx(1905.34, abs=3 * stiffness.std)  # what was drawn
    assert found.rounds[0][0].name == finding.effect.name
    assert [s.label for s in found.steps][2:] == ["joint stiffness at joint J1, rx added"]
    # beams are not the structure itself: joints take up what they differ by
    assert told[EXPLAINED_LEVEL].verdict == "nothing missing"
    # chance has no say in it
    begin = search.Search(found.problem, found.findings, found.rounds, found.steps, found.steps[-1].result)
    after, (tried,) = bootstrap(
        begin, propose(case.model, ["point_mass"])[:2], acceptance.Limits(1.0, 1.0), 1, lambda *_: None
    )
    assert after is begin
    assert tried.effect == ""
