"""Hypotheses changed by hand: numbers are those of the commands; fits hold what they must, and can end."""

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fem import ModelError, assemble, solve_modes
from tests.studies import fit_problem
from updating import Fault, compare
from updating.inference import fitted_model
from updating.live import (
    Hypothesis,
    LiveModel,
    fit_all,
    fit_effect,
    fit_uncertain,
    frequency_sensitivities,
    rank,
    sensitivities,
    weigh,
)

STUDY = Path(__file__).parents[2] / "examples" / "cross-beam" / "study.toml"
TURNING = "joint_stiffness:J.rx"
"""What the example's study does not know."""


class EndedError(Exception):
    pass


def quiet(text, done):
    pass


@pytest.fixture(scope="module")
def fitted(live):
    return fit_uncertain(live, Hypothesis.nominal(live.problem), quiet)


def test_the_nominal_errors_are_those_of_compare(live):
    found = live.evaluate(Hypothesis.nominal(live.problem))
    nominal = live.problem.nominal()
    c = compare(live.problem.measured, live.problem.frf(nominal), 6, live.problem.data.mask)
    assert found.result.fit_db == nominal.fit_db
    assert found.result.held_out_db == nominal.held_out_db
    assert found.comparison.total_db == c.total_db
    np.testing.assert_array_equal(found.comparison.by_sensor(), c.by_sensor())
    np.testing.assert_array_equal(found.comparison.by_band(), c.by_band())


@pytest.mark.parametrize(
    ("name", "moves"),
    [
        (TURNING, [{"stiffness": 1000.0}, {"stiffness": 200.0}]),
        ("point_mass:U", [{"mass": 0.1}, {"mass": 0.1, "position": 0.21}]),
        ("joint_zener:J.rx", [{"ratio": 0.5}, {"ratio": 0.5, "tau": 1e-4}]),
        ("ground_spring:D.1.z", [{"stiffness": 1e4}, {"stiffness": 1e5}]),
    ],
)
def test_a_moved_value_has_the_frfs_of_a_new_engine(live, candidates, fitted, name, moves):
    h = fitted.with_effect(candidates[name])
    moved = live.evaluate(h)
    for values in moves:
        for parameter, value in values.items():
            h = h.with_value(name, parameter, value)
        moved = live.evaluate(h)
    fresh = LiveModel(live.problem).evaluate(h)
    H, again = moved.frf.H, fresh.frf.H
    # rounding of K, in parts of the softest mode that a spring to the ground holds: 1e-16 of 1e9 and more
    assert np.abs(H - again).max() <= 1e-7 * np.abs(again).max()
    assert moved.result.fit_db != pytest.approx(live.evaluate(fitted).result.fit_db, abs=1e-3)


def test_an_effect_that_stands_for_an_uncertain_parameter_takes_its_place(candidates, fitted):
    h = fitted.with_effect(candidates[TURNING])
    assert ("J", "krx") in fitted.values
    assert ("J", "krx") not in h.result().values
    assert h.without_effect(TURNING).values == fitted.values


def test_values_stay_within_bounds_and_names_are_checked(candidates, fitted):
    h = fitted.with_effect(candidates[TURNING]).with_value(TURNING, "stiffness", -5.0)
    (p,) = h.effect(TURNING).parameters()
    assert p.value == p.lower
    with pytest.raises(ModelError, match="added already"):
        h.with_effect(candidates[TURNING])
    with pytest.raises(ModelError, match="no parameter 'mass'; it has stiffness"):
        h.with_value(TURNING, "mass", 1.0)
    with pytest.raises(ModelError, match="no effect 'x' is added; added are joint_stiffness"):
        h.without_effect("x")


def test_a_sensor_that_is_off_counts_nowhere(live, fitted):
    found = live.evaluate(fitted.switched("D3z"))
    k = found.comparison.outputs.index("D3z")
    assert np.isnan(found.comparison.by_sensor()[k])
    assert not found.mask[:, k].any()
    back = live.evaluate(fitted.switched("D3z").switched("D3z"))
    assert back.result.fit_db == live.evaluate(fitted).result.fit_db


def test_a_held_out_channel_is_compared_apart(study, live):
    h = Hypothesis.nominal(live.problem).held("sensor D3z").held("excitation U1z")
    found = live.evaluate(h)
    # a study that holds them out has data without them
    without = LiveModel(fit_problem(replace(study, held_out=("U1z",), held_out_sensors=("D3z",))))
    alone = without.evaluate(Hypothesis.nominal(without.problem))
    assert found.result.fit_db == pytest.approx(alone.result.fit_db, rel=1e-9)
    assert found.comparison.total_db == pytest.approx(alone.comparison.total_db, rel=1e-9)
    at = found.comparison.outputs.index("D3z")
    assert np.isnan(found.comparison.by_sensor()[at])
    assert found.by_sensor()[at] == found.held_out.by_sensor()[at]
    assert np.isfinite(found.by_band()[at]).all()
    ratio = found.held_out.log_ratio
    assert np.isnan(ratio[:, at, found.comparison.inputs.index("U1z")]).all()  # seen by neither end
    assert live.evaluate(h.held("sensor D3z").held("excitation U1z")).held_out is None


def test_a_held_out_band_takes_the_place_of_the_blocks(study, live, fitted):
    band = (100.0, 250.0)
    h = fitted.held("band 100-250 Hz")
    found, f = live.evaluate(h), live.problem.data.frequency
    inside = (f >= band[0]) & (f <= band[1])
    ratio = np.where(found.mask, np.log(np.abs(found.frf.H / found.measured.H)), np.nan)
    for lines, error in ((inside, found.result.held_out_db), (~inside, found.result.fit_db)):
        assert 20 / np.log(10) * np.sqrt(np.nanmean(ratio[lines] ** 2)) == pytest.approx(error, rel=1e-9)
    seen = live.problem_of(h).lines_up_to(np.inf, 10_000)
    np.testing.assert_array_equal(seen, np.flatnonzero(~inside))
    held = LiveModel(fit_problem(replace(study, held_out_bands=(band,))))
    alone = held.evaluate(fitted)
    assert alone.result.fit_db == pytest.approx(found.result.fit_db, rel=1e-9)
    assert alone.result.held_out_db == pytest.approx(found.result.held_out_db, rel=1e-9)
    assert h.held("band 100-250 Hz").held_out_bands == ()


def test_the_form_changes_nothing_until_it_is_fitted(live, fitted):
    h = live.with_form(fitted)
    more = {name for name, _ in h.values} - {name for name, _ in fitted.values}
    assert more == {e.name for e in live.form}
    assert all(e.is_form for e in live.form)
    plain, formed = live.evaluate(fitted), live.evaluate(h)
    assert formed.result.fit_db == pytest.approx(plain.result.fit_db, rel=1e-4)  # another reduced basis
    ref = next(r for r in h.values if r[0] in more)
    assert abs(live.evaluate(h.with_uncertain(ref, 0.05)).result.fit_db - formed.result.fit_db) > 1e-3
    assert live.without_form(h).values == fitted.values


def test_a_corrected_sensor_is_read_otherwise(live, fitted):
    wrong = live.evaluate(fitted.with_fault(Fault("sensor_gain", "D3z", 2.0, 0.0)))
    plain = live.evaluate(fitted)
    k = plain.comparison.outputs.index("D3z")
    np.testing.assert_allclose(wrong.measured.H[:, k] * 2, plain.measured.H[:, k])
    turned = fitted.with_fault(Fault("sensor_sign", "D3z", -1.0, 0.0))
    np.testing.assert_allclose(live.evaluate(turned).measured.H[:, k], -plain.measured.H[:, k])
    assert turned.without_fault("sensor_sign", "D3z").faults == ()


@pytest.mark.slow
def test_fits_hold_what_they_are_not_asked_for(live, candidates, fitted):
    h = fitted.with_effect(candidates[TURNING]).with_value(TURNING, "stiffness", 200.0)
    only = fit_effect(live, h, TURNING, quiet)
    assert only.values == pytest.approx(h.values, rel=1e-12)
    np.testing.assert_allclose(only.zeta, h.zeta, rtol=1e-12)
    assert only.effect(TURNING).stiffness != pytest.approx(200.0, rel=1e-3)
    rest = fit_uncertain(live, h, quiet)
    assert rest.effect(TURNING).stiffness == pytest.approx(200.0, rel=1e-12)
    assert rest.values != pytest.approx(h.values, rel=1e-3)
    every = fit_all(live, h, quiet)
    error = {k: live.evaluate(x).result.fit_db for k, x in zip("hre", (h, rest, every), strict=True)}
    assert error["r"] < 1.0 < error["h"]
    assert every.fit.solution.cost <= rest.fit.solution.cost + 1e-9


def test_a_fit_tells_how_far_it_is_and_can_be_ended(live):
    told = []

    def ended(text, done):
        told.append(done)
        if len(told) == 5:
            raise EndedError

    with pytest.raises(EndedError):
        fit_uncertain(live, Hypothesis.nominal(live.problem), ended)
    assert len(told) == 5
    told = []
    fit_uncertain(live, Hypothesis.nominal(live.problem), lambda text, done: told.append(done))
    assert told == sorted(told)
    assert 0 <= told[0] < 0.2
    assert 0.5 < told[-1] < 1


def test_the_missing_effect_promises_most(live, candidates, fitted):
    near = [
        e
        for e in candidates.values()
        if e.kind in ("joint_stiffness", "joint_mass", "joint_complex_stiffness")
    ]
    ranked = rank(live, fitted, near, quiet)
    assert ranked.promises[0].effect.name == TURNING
    # a complex stiffness about the same axis holds the same storage
    assert [p.effect.name for p, _ in ranked.twins(TURNING)] == ["joint_complex_stiffness:J.rx"]


def test_what_speaks_for_an_effect(live, candidates, fitted):
    h = fitted.with_effect(candidates[TURNING]).with_value(TURNING, "stiffness", 200.0)
    weighed = weigh(live, h, TURNING)
    assert weighed.without.result.fit_db == live.evaluate(fitted).result.fit_db
    assert weighed.unseen_gain > 0
    assert all(c.present < c.without for c in weighed.better)
    assert all(c.present > c.without for c in weighed.worse)
    low = weigh(live, h.with_value(TURNING, "stiffness", 0.0), TURNING)
    assert low.at_bound == ("stiffness",)


def test_memory_stays_flat_while_values_move(live, candidates, fitted):
    h = fitted.with_effect(candidates["point_mass:U"]).with_value("point_mass:U", "mass", 0.05)

    def moves(n):
        for k in range(n):
            live.evaluate(h.with_value("point_mass:U", "position", 0.1 + 0.5 * (k % 97) / 97))

    moves(10)  # fills the caches
    tracemalloc.start()
    moves(5)
    before = tracemalloc.get_traced_memory()[0]
    moves(40)
    after = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    one_frf = live.problem.data.H.nbytes
    assert after - before < one_frf


@pytest.mark.parametrize("with_form", [False, True])
def test_sensitivities_are_the_differences_of_two_models(live, candidates, fitted, with_form):
    h = fitted.with_effect(candidates["point_mass:U"]).with_value("point_mass:U", "mass", 0.1)
    h = live.with_form(h) if with_form else live.without_form(h)
    found = sensitivities(live, h, ("U3z", "D3z"))
    assert [s.mean_db for s in found] == sorted((s.mean_db for s in found), reverse=True)
    by_ref = {s.refs[0]: s for s in found}
    assert by_ref["frame", "E:steel"].added is False
    mass = by_ref["point_mass:U", "mass"]
    assert (mass.added, mass.assumed) == (True, True)
    assert any(s.refs[0][0].startswith("section_form") for s in found) == with_form
    h0 = live.evaluate(h).frf
    o, i = (names.index(n) for names, n in zip((h0.outputs, h0.inputs), ("U3z", "D3z"), strict=True))
    std, step = {("frame", "E:steel"): 0.02, ("point_mass:U", "mass"): 0.2}, 1e-7
    for ref, sigma in std.items():
        if ref[0] == "frame":
            moved = [h.with_uncertain(ref, h.values[ref] * np.exp(s * step)) for s in (1, -1)]
        else:
            moved = [h.with_value(*ref, 0.1 * (1 + s * step)) for s in (1, -1)]
        levels = [20 * np.log10(np.abs(live.evaluate(m).frf.H[:, o, i])) for m in moved]
        change = sigma * (levels[0] - levels[1]) / (2 * step)
        at = int(np.abs(h0.frequency - by_ref[ref].frequency).argmin())
        assert change[at] == pytest.approx(by_ref[ref].largest_db, rel=2e-3)


def test_sensitivities_of_a_natural_frequency_are_the_differences_of_two_models(live, candidates, fitted):
    h = fitted.with_effect(candidates["point_mass:U"]).with_value("point_mass:U", "mass", 0.1)
    model = fitted_model(live.problem.reduced.model, h.result())
    pairs = solve_modes(assemble(model), n=9)
    k = pairs.n_rigid
    f, shape = float(pairs.frequency[k]), pairs.shapes[:, k]
    found = frequency_sensitivities(live, h, model, f, shape)
    assert [abs(s.percent) for s in found] == sorted((abs(s.percent) for s in found), reverse=True)
    by_ref = {s.refs[0]: s for s in found}
    for ref, sigma in {("frame", "E:steel"): 0.02, ("point_mass:U", "mass"): 0.2}.items():
        value, step = model.values()[ref], 1e-4
        moved = [
            solve_modes(assemble(model.with_values({ref: value * (1 + s * step)})), n=9).frequency[k]
            for s in (1, -1)
        ]
        change = 100 * sigma * (moved[0] - moved[1]) / (2 * step * f)
        assert by_ref[ref].percent == pytest.approx(change, rel=1e-3)
    assert by_ref["point_mass:U", "mass"].added
