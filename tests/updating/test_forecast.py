"""Forecasts of what effects would do to the data of a fit, against fits with these effects."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from benchmarks.hidden.cases import make_case
from fem import parameter_values
from updating import assessed_fit, build_problem, propose
from updating.forecast import Forecast, Grid, Little, Look, Sizes
from updating.inference import FULL_LINES
from updating.inference.fitting import fit
from updating.inference.workers import workers
from updating.plan.planned import as_planned
from updating.plan.visibility import amplitudes_as_solved, gain_at, least_amplitudes


@pytest.fixture(scope="module")
def prepared():
    case = make_case(0)  # a member is heavier
    problem = build_problem(case.model, case.measurement, case.nuisances)
    return problem, assessed_fit(problem), propose(case.model, test=case.measurement)


def hiding(problem, effect):
    """Return a problem whose data have an effect."""
    on_it = replace(problem, reduced=problem.reduced.with_forces_of([effect]))
    nominal = problem.nominal()
    values = {**nominal.values, **{(effect.name, k): v for k, v in parameter_values(effect).items()}}
    H = on_it.receptance(replace(nominal, effects=(effect,), values=values))
    return replace(problem, data=replace(problem.data, H=H))


def log_posterior(problem, fitted):
    """Return the log likelihood of a fit with the prior of uncertain parameters and damping."""
    values = [parameter_values(e) for e in fitted.effects]
    prior = problem.function(fitted.effects, values, problem.lines_up_to(np.inf, FULL_LINES)).prior()
    known = np.isfinite(prior.std)
    off = (fitted.solution.x - prior.mean)[known] / prior.std[known]
    return fitted.log_likelihood - 0.5 * float(off @ off)


@pytest.mark.parametrize("kind", ["point_mass", "member_density", "member_stiffness", "crack"])
def test_effect_of_five_standard_deviations_gains_what_its_forecast_says(prepared, kind):
    """Of a planned test; the fits are to data with the effect, with all that is uncertain free."""
    problem, _, candidates = prepared
    planned = as_planned(problem, problem.nominal())
    effect = next(e for e in candidates if e.kind == kind)
    first = effect.parameters()[0].name
    forecast = Forecast.at(planned, planned.nominal(), [effect], besides=0.0)
    i = len(forecast.owner) // 2
    there = forecast.effect_at(i, 5.0 / forecast.precision[i])
    known = hiding(planned, there)
    without = fit(known, n_lines=FULL_LINES, tolerance=1e-6)
    right = fit(
        known, [effect], [parameter_values(there)], x_from=without, n_lines=FULL_LINES, tolerance=1e-6
    )
    gain = log_posterior(known, right) - log_posterior(known, without)
    assert gain == pytest.approx(0.5 * 5.0**2, rel=0.15)
    if kind == "point_mass":  # beside the data the same, of the place that is its own
        after = Forecast.at(known, without, [effect])
        slight = after.littles[0].points[i][first]
        std = slight / after.precision[i]
        assert std == pytest.approx(right.std[effect.name, first], rel=0.2)
        assert slight * after.factor[i] == pytest.approx(right.values[effect.name, first], abs=0.2 * std)
        assert after.gains[i] == pytest.approx(gain, rel=0.1)


def test_support_that_gives_way_gains_what_its_forecast_says():
    """A basis that holds the support errs by more than a little flexibility changes."""
    case = make_case(3, "portal", "support_flexibility")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    planned = as_planned(problem, problem.nominal())
    effect = next(e for e in propose(case.model, ["support_flexibility"]) if e.direction == "ry")
    forecast = Forecast.at(planned, planned.nominal(), [effect], besides=0.0)
    soft = forecast.effect_at(0, 5.0 / forecast.precision[0])
    known = hiding(planned, soft)
    how = {"n_lines": FULL_LINES, "tolerance": 1e-6}
    without = fit(known, **how)
    right = fit(known, [effect], [parameter_values(soft)], x_from=without, **how)
    gain = log_posterior(known, right) - log_posterior(known, without)
    assert gain == pytest.approx(0.5 * 5.0**2, rel=0.3)


@pytest.fixture(scope="module")
def cross():
    """Two beams with a joint whose stiffness is known to 3 %, as their test is planned."""
    case = make_case(1, "cross", "nothing")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    planned = as_planned(problem, problem.nominal())
    planned = replace(planned, scatter=replace(planned.scatter, sizes=()))
    kinds = ["joint_stiffness", "joint_complex_stiffness"]
    return planned, Forecast.at(
        planned, planned.nominal(), propose(case.model, kinds), besides=0.0, vectors=True
    )


def test_little_of_two_parameters_is_a_little_in_both(cross):
    """A loss factor dissipates at any stiffness: near absence both are near the model's."""
    planned, forecast = cross
    model = planned.reduced.model
    little = next(o for o in forecast.littles if o.grid.effect.kind == "joint_complex_stiffness")
    assert little.grid.one_sided()  # a loss factor below none has no meaning
    for k in range(len(little.points)):
        small, smaller = (
            np.concatenate(
                [
                    little.grid.effect.with_values(**little.values(k, f)).contribute(model)[0].D[0],
                    little.grid.effect.with_values(**little.values(k, f)).contribute(model)[0].K[0],
                ]
            )
            for f in (1e-3, 1e-6)
        )
        assert np.abs(small).max() > 0
        assert smaller == pytest.approx(1e-3 * small, rel=0.01, abs=1e-9 * np.abs(small).max())


def test_each_point_of_a_grid_is_a_multiple_of_a_little(cross):
    for little in cross[1].littles:
        grid, absent = little.grid, little.absent
        little_ones = {grid.direction(point, absent) for point in little.points}
        assert {grid.direction(point, absent) for point in grid.points} == little_ones


@pytest.mark.parametrize("kind", ["joint_stiffness", "joint_complex_stiffness"])
def test_effect_that_replaces_an_uncertain_parameter_is_forecast_as_it_is_fitted(cross, kind):
    """Without the effect a fit varies the parameter within its prior, with it at will."""
    planned, forecast = cross
    rows = [i for i, o in enumerate(forecast.owner) if forecast.candidates[o].kind == kind]
    i = max(rows, key=lambda i: forecast.precision[i])
    effect = forecast.candidates[forecast.owner[i]]
    there = forecast.effect_at(i, 5.0 / forecast.precision[i])
    known = hiding(planned, there)
    how = {"n_lines": FULL_LINES, "tolerance": 1e-6}
    start = {"x_from": known.nominal(), "stages": known.stages[-1:]}
    without, right = fit(known, **how), fit(known, [effect], [parameter_values(there)], **start, **how)
    gain = log_posterior(known, right) - log_posterior(known, without)
    expected = gain_at(forecast, i, 5.0 / float(forecast.precision[i]), 0.0)
    assert expected == pytest.approx(gain, abs=3.0)
    if kind == "joint_stiffness":
        std = there.stiffness - forecast.effect_at(i, 4.0 / forecast.precision[i]).stiffness
        assert abs(std) == pytest.approx(right.std[effect.name, "stiffness"], rel=0.1)


def test_a_problem_is_sent_to_other_processes_after_a_forecast_as_before_it():
    """What a forecast keeps for the next one is not sent: laws of dashpots and rubber cannot be."""
    assert workers  # its module teaches pickle read-only mappings
    case = make_case(5)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    before = len(pickle.dumps(problem))
    candidates = propose(case.model, ["joint_zener", "point_mass", "joint_stiffness"])
    assert {e.kind for e in candidates} >= {"joint_zener", "point_mass"}
    Forecast.at(problem, problem.nominal(), candidates)
    assert len(pickle.dumps(problem)) < 1.2 * before


def test_letting_go_alone_counts_as_no_change(monkeypatch):
    """A support that gives way dissipates as a connection: held, and hardly held, differ by that alone."""
    case = make_case(3, "portal", "support_flexibility")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    look = Look.of(problem, problem.nominal(), 12, 0, 200)
    effect = next(e for e in propose(case.model, ["support_flexibility"]) if e.released())
    little = Little.of(Grid.of(problem, effect), {})
    (k,) = (point["stiffness"] for point in little.points)

    def changes(look, grid):
        return np.array([[7.0 + 3.0 * k / point["stiffness"]] for point in grid.points])

    monkeypatch.setattr(Look, "all_changes", changes)
    assert look.small_changes(little) == pytest.approx(np.array([[3.0]]))


def test_effects_that_release_nothing_are_forecast_as_if_they_were_projected(prepared):
    problem, null, candidates = prepared
    look = Look.of(problem, null, 20, 0, 2_000)
    some = [e for e in candidates if e.kind in {"point_mass", "member_stiffness", "ground_spring"}]
    forecast = Forecast.of(look, [Grid.of(problem, e) for e in some], changes=True)
    trust = np.sqrt(look.weights)
    for k, effect in enumerate(some):
        there = look.little(Grid.of(problem, effect)).change
        one, two = (trust * look.adapted(c) for c in (there, forecast.changes[forecast.owner == k]))
        size = np.linalg.norm(one, axis=1)
        alike = np.abs((one.conj() * two).sum(axis=1)) / (size * np.linalg.norm(two, axis=1))
        assert alike[size > 0.1 * size.max()].min() > 0.9, effect.name


def test_what_the_data_do_not_see_keeps_its_prior(prepared):
    problem, null, candidates = prepared
    forecast = Forecast.at(problem, null, candidates)
    unseen = ~np.isfinite(forecast.best_gains)
    assert forecast.log_evidence[unseen] == pytest.approx(0.0, abs=1e-9)
    # a larger likelihood at one size is no larger average over all
    assert (forecast.log_evidence <= np.maximum(forecast.best_gains, 0.0) + 1e-9).all()


def test_size_that_the_data_refuse_is_less_probable_than_before(prepared):
    """Of effects with one sign whose best size is none, though a plausible one would be seen."""
    problem, null, candidates = prepared
    forecast = Forecast.at(problem, null, candidates)
    refused = []
    for k, little in enumerate(forecast.littles):
        rows = forecast.owner == k
        sharp = (little.most * forecast.precision[rows]).min() > 30.0
        if little.grid.one_sided() and sharp and (forecast.factor[rows] == 0).all():
            refused.append(k)
    assert len(refused) > 3
    assert (forecast.log_evidence[refused] < -0.1).all()
    assert forecast.best_gains[refused] == pytest.approx(0.0, abs=1e-9)


def test_log_share_of_sizes_is_the_integral_over_the_prior(prepared):
    """Of sizes between two of any order of magnitude, density 1 / (x ln(most / least))."""
    problem, _, candidates = prepared
    mass = next(e for e in candidates if e.kind == "point_mass")
    little = Little.of(Grid.of(problem, mass), {})
    sizes = Sizes.of(problem, little)
    least, most = sizes.prior.least, sizes.prior.least * np.exp(sizes.prior.range)
    best = np.sqrt(least * most)
    std = best / 8
    unit = sizes.x(0, 1.0)
    integral, _ = quad(
        lambda x: np.exp(-0.5 * ((x - best) / std) ** 2) / (x * sizes.prior.range), least, most
    )
    assert sizes.log_share(0, best / unit, std / unit) == pytest.approx(np.log(integral), abs=0.05)
    # of sizes that all are as likely nothing is lost
    assert sizes.log_share(0, best / unit, 100 * most / unit) == pytest.approx(0.0, abs=1e-9)


def test_explained_shares_lie_between_nothing_and_all(prepared):
    problem, null, candidates = prepared
    forecast = Forecast.at(problem, null, candidates)
    shares = forecast.best_shares
    assert (shares >= 0).all()
    assert (shares <= 1).all()
    heavier = max(range(len(candidates)), key=lambda k: shares[k])
    assert candidates[heavier].where == make_case(0).hidden.where


@pytest.mark.parametrize("kind", ["point_mass", "stiffness_loss"])
def test_std_of_a_forecast_is_that_of_a_fit_with_a_free_position(prepared, kind):
    problem, _, candidates = prepared
    planned = as_planned(problem, problem.nominal())
    planned = replace(planned, scatter=replace(planned.scatter, sizes=()))
    effect = next(e for e in candidates if e.kind == kind)
    forecast = Forecast.at(planned, planned.nominal(), [effect], besides=0.0)
    i = len(forecast.owner) // 3
    there = forecast.effect_at(i, 5.0 / forecast.precision[i])
    known = hiding(planned, there)
    start = {"x_from": known.nominal(), "stages": known.stages[-1:], "n_lines": FULL_LINES}
    right = fit(known, [effect], [parameter_values(there)], **start)
    (found,), first = right.effects, effect.parameters()[0].name
    stated = right.std[effect.name, first]
    assert forecast.std(0, parameter_values(found)) == pytest.approx(stated, rel=0.2)


def test_spring_stiffer_than_what_it_holds_is_seen_at_no_size():
    """At the top of a post on a fixed base, along the post; as a multiple of a soft one it would be."""
    case = make_case(1, "portal", "nothing")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    planned = as_planned(problem, problem.nominal())
    springs = [e for e in propose(case.model, ["ground_spring"]) if "left" in e.where]
    forecast = Forecast.at(planned, planned.nominal(), springs, besides=0.015, vectors=True)
    wanted = np.full(len(forecast.owner), 12.5)
    linear, solved = (f(forecast, wanted, 0.015) for f in (least_amplitudes, amplitudes_as_solved))
    along = [k for k, e in enumerate(springs) if e.where.endswith("z")]
    assert np.isfinite(linear).all()
    assert np.isinf(solved[along]).all()
    assert np.isfinite(solved[[k for k in range(len(springs)) if k not in along]]).any()


@pytest.mark.parametrize(
    ("shape", "kind"), [("portal", "support_flexibility"), ("cross", "stiffness_loss"), ("cross", "crack")]
)
def test_the_more_stiffness_is_lost_the_more_strongly_it_counts(shape, kind):
    """Far beyond the width of resonances, from which on compared FRFs show no more of it."""
    case = make_case(1, shape, "nothing")
    problem = build_problem(case.model, case.measurement, case.nuisances)
    planned = as_planned(problem, problem.nominal())
    candidates = propose(case.model, [kind])[:2]
    forecast = Forecast.at(planned, planned.nominal(), candidates, besides=0.0, vectors=True)
    i = int(np.argmax(forecast.precision))
    little, place = forecast.littles[forecast.owner[i]], int(forecast.place[i])
    sizes = 5 / forecast.precision[i] * 2.0 ** np.arange(24)
    sizes = np.array([a for a in sizes if little.reaches(place, a)])
    assert len(sizes) > 4
    _, strengths = forecast.squares_at(np.full(len(sizes), i), sizes)
    assert (np.diff(strengths) > -1e-3 * strengths[:-1]).all()
    assert strengths[0] == pytest.approx(sizes[0], rel=0.1)
    assert strengths[-1] > 4 * strengths[0]
