"""Which missing effects a planned test could see and name: closed forms, fits, and drawn data."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from fem import (
    Damping,
    Frame,
    MemberProperties,
    Mesh,
    Model,
    Relevant,
    assemble,
    compute_frf,
    parameter_values,
    solve_modes,
)
from fem.effects import MemberStiffness
from tests.frames import FLAT, STEEL, beam, fix, planar, portal
from updating import Nuisance, Sensor, plan_test, sensor_rows
from updating.diagnosis.evidence import near_to
from updating.forecast import Forecast
from updating.inference.fitting import fit
from updating.plan import (
    MULTIPLES,
    POWER,
    SURE,
    FailedTrial,
    drawn,
    needed,
    planned_measurement,
    size_of,
    trials,
    with_averages,
)
from updating.plan.visibility import Rivals, gain_at, least_amplitudes

BAND = np.linspace(20.0, 800.0, 44)
"""No more lines than those at which effects are looked at [Hz]."""
UP = (0.0, 0.0, 1.0)


def damped(model, zeta=0.01):
    return Model(model.mesh, model.effects, Damping.modal(zeta))


def halves(n=20):
    """Return a free straight beam of 1 m about the origin, whose halves are two members."""
    points = [[-0.5, 0, 0], [0, 0, 0], [0.5, 0, 0]]
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2]], {"left": [0], "right": [1]}).split(n)
    return damped(Model(mesh, (Frame(members=dict.fromkeys(mesh.members, MemberProperties(STEEL, FLAT))),)))


def channels(name, places, direction=UP):
    return tuple(
        Sensor(f"{name}{k}", np.array([x, 0.0, 0.0]), np.array(direction)) for k, x in enumerate(places)
    )


def measured_at(model, sensors, forces, noise=0.003, band=BAND, direction=UP):
    ends = channels("s", sensors, direction), channels("f", forces, direction)
    return planned_measurement(model, *ends, band, noise)


def mapped(model, sensors, forces, *nuisances, noise=0.003, discrepancy=0.0, band=BAND, **more):
    """Return the map of a beam along x whose form is right unless it is said otherwise."""
    test = measured_at(model, sensors, forces, noise, band)
    return plan_test(model, test, nuisances, discrepancy=discrepancy, **{"model_error": 0.0} | more)


def seen_sizes(plan):
    return np.array([x.enough[0] for x in plan.visibility.effects])


@pytest.fixture(scope="module")
def masses():
    """Return the map of masses and cracks on the halves, which a sensor beside the middle tells apart."""
    return mapped(halves(), (0.0, 0.2), (0.0,), kinds=("point_mass", "crack"))


def at_one_half_and_mirrored(plan):
    """Return pairs of a mass on the left half and its mirror image; there is at least one."""
    by_place = {
        (x.effect.member, round(x.effect.position, 9)): x
        for x in plan.visibility.effects
        if x.effect.kind == "point_mass"
    }
    left = [(position, x) for (member, position), x in by_place.items() if member == "left"]
    assert left
    return [(x, by_place["right", round(0.5 - position, 9)]) for position, x in left]


# What is needed -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("odds", [-1.0, 2.0, 9.0])
def test_gains_that_are_needed_are_enough_with_the_stated_probability(odds):
    """The gain in data is normal about that which is expected, with twice it as variance."""
    g = float(needed(np.array(odds)))
    gains = g + np.sqrt(2 * g) * np.random.default_rng(1).standard_normal(200_000)
    assert (gains > odds + np.log(SURE / (1 - SURE))).mean() == pytest.approx(POWER, abs=0.003)


def test_what_is_likelier_beforehand_needs_a_gain_too():
    """Whatever the odds, the gain must be positive with the stated probability."""
    g = float(needed(np.array(-50.0)))
    assert norm.cdf(0.0, g, np.sqrt(2 * g)) == pytest.approx(1 - POWER)
    assert (np.diff(needed(np.linspace(-2.0, 20.0, 9))) > 0).all()


# A planned test -------------------------------------------------------------------------------------------


def test_a_planned_test_has_the_frfs_of_its_model():
    model = halves()
    test = measured_at(model, (0.0, 0.3), (0.0, 0.4))
    rows = [sensor_rows(model, part) for part in (test.sensors, test.excitations)]
    H = compute_frf(assemble(model), BAND, *rows).H
    np.testing.assert_allclose(test.frf.H, H, rtol=1e-6, atol=1e-6 * np.abs(H).max())


def test_the_noise_of_a_planned_test_is_the_stated_share_of_the_frfs_of_each_force():
    test = measured_at(halves(), (0.0, 0.3, 0.4), (0.0, 0.4), noise=0.02)
    size = np.abs(test.frf.H)
    noise = np.sqrt(2) * size * test.scatter
    for k in range(2):
        rms = np.sqrt((size[:, :, k] ** 2).mean())
        np.testing.assert_allclose(noise[:, :, k], 0.02 * rms, rtol=1e-9)


def test_a_sensor_that_reads_nothing_has_no_noise_beside_its_signal():
    model = halves()
    across = channels("across", (0.3,), (0.0, 1.0, 0.0))
    test = planned_measurement(model, across, channels("f", (0.0,)), BAND)
    assert np.isfinite(test.scatter).all()


# Closed forms ---------------------------------------------------------------------------------------------


def test_on_its_axis_of_symmetry_a_test_cannot_tell_an_effect_from_its_mirror_image():
    plan = mapped(halves(), (0.0,), (0.0,), kinds=("point_mass",))
    for x, mirrored in at_one_half_and_mirrored(plan):
        assert x.enough[0] == pytest.approx(mirrored.enough[0], rel=1e-6)
        assert x.alike == pytest.approx(1.0, abs=1e-6)
        assert x.rival.member == "right"
        assert x.rival.position == pytest.approx(0.5 - x.effect.position)
        assert x.seen is not None
        assert x.located is None
        assert x.named is None
    assert plan.coverage("located") == plan.coverage("named") == 0.0


def test_a_sensor_beside_the_axis_tells_an_effect_from_its_mirror_image(masses):
    for x, mirrored in at_one_half_and_mirrored(masses):
        assert x.alike < 0.999
        assert x.enough[1] < 20 * x.enough[0]
        assert abs(x.enough[0] / mirrored.enough[0] - 1) > 1e-3


def test_masses_that_are_seen_weigh_as_the_inverse_squares_of_the_mode():
    """A mass m at x lowers the first eigenvalue of a pinned beam by m sin²(πx/L) / (ρ A L / 2)."""
    pinned = planar(beam(20, effects=(fix(0, ("x", "y", "z", "rx")), fix(1, ("y", "z", "rx")))))
    model = damped(pinned, 0.01)
    first = float(solve_modes(assemble(model), n=1).frequency[0])
    band = np.linspace(0.7, 1.3, 44) * first
    plan = mapped(model, (0.5,), (0.5,), kinds=("point_mass",), band=band)
    mass, shape = np.array(
        [(x.seen.mass, np.sin(np.pi * x.seen.position) ** 2) for x in plan.visibility.effects if x.seen]
    ).T
    assert len(mass) >= 9
    np.testing.assert_allclose(mass * shape, np.median(mass * shape), rtol=0.05)


def test_masses_where_nothing_moves_and_cracks_across_the_motion_are_not_seen():
    clamped = damped(beam(20, effects=(fix(0),)))
    plan = mapped(clamped, (1.0,), (1.0,), kinds=("point_mass", "crack"), noise=0.001)
    at_clamp, *_, at_tip = [x for x in plan.visibility.effects if x.effect.kind == "point_mass"]
    assert at_clamp.effect.position < 0.02
    assert at_clamp.seen is None or not at_clamp.is_plausible(at_clamp.enough[0])
    assert at_tip.is_plausible(at_tip.enough[0])
    across = [x for x in plan.visibility.effects if getattr(x.effect, "direction", "") == "rz"]
    assert len(across) == 11
    assert all(x.enough == (np.inf,) * 3 and x.seen is None for x in across)


def test_what_an_uncertain_parameter_does_is_not_seen():
    """Of a beam whose steel may be heavier nothing says that it is, but for what is beyond its tolerance."""
    kinds = ("member_density",)
    known = mapped(halves(), (0.0,), (0.0,), kinds=kinds)
    uncertain = mapped(halves(), (0.0,), (0.0,), Nuisance("frame", "rho:steel", 0.05), kinds=kinds)
    assert (seen_sizes(uncertain) > 1.5 * seen_sizes(known)).all()


# Sizes ----------------------------------------------------------------------------------------------------


def test_more_noise_hides_larger_effects():
    plans = [
        mapped(halves(), (0.0, 0.2), (0.0,), kinds=("point_mass",), noise=n) for n in (3e-3, 6e-3, 1.2e-2)
    ]
    sizes = np.array([[x.enough for x in p.visibility.effects] for p in plans])
    assert (np.diff(sizes, axis=0) > 0).all()


def test_averages_show_what_a_test_with_their_noise_does():
    """Of n averages the noise falls by √n: three times as many more halve it, at the values that counted."""
    noisy = mapped(halves(), (0.0, 0.2), (0.0,), kinds=("point_mass",), noise=4e-3)
    counted = noisy.visibility.problem.data.mask
    test = replace(measured_at(halves(), (0.0, 0.2), (0.0,), 2e-3), compared=counted.astype(float))
    quiet = plan_test(halves(), test, discrepancy=0.0, model_error=0.0, kinds=("point_mass",))
    sizes = seen_sizes(with_averages(noisy, 4, 12))
    assert sizes == pytest.approx(seen_sizes(quiet), rel=1e-3)
    assert (sizes < 0.8 * seen_sizes(noisy)).all()


@pytest.mark.parametrize("model_error", [0.0, 0.1])
def test_the_more_a_right_model_leaves_the_larger_effects_it_hides(model_error):
    how = {"kinds": ("point_mass",), "model_error": model_error}
    plans = [mapped(halves(), (0.0, 0.2), (0.0,), discrepancy=d, **how) for d in (0.06, 0.09, 0.15)]
    sizes = np.array([seen_sizes(p) for p in plans])
    assert (np.diff(sizes, axis=0) > 0).all()


def test_what_a_right_model_leaves_below_the_noise_hides_effects_too():
    plans = [mapped(halves(), (0.0, 0.2), (0.0,), kinds=("point_mass",), discrepancy=d) for d in (0.0, 0.03)]
    assert (seen_sizes(plans[1]) > 1.1 * seen_sizes(plans[0])).all()


@pytest.mark.parametrize(("n", "zeta"), [(5, 0.01), (20, 0.05)])
def test_of_a_planned_test_its_own_model_leaves_nothing(n, zeta):
    """Or else the mesh's error and the law of damping count as if something were missing."""
    problem = mapped(damped(halves(n), zeta), (0.0, 0.2), (0.0,), kinds=("point_mass",)).visibility.problem
    assert problem.nominal().level < 1e-6


def test_an_effect_is_seen_before_it_is_located_and_located_before_it_is_named(masses):
    enough = np.array([x.enough for x in masses.visibility.effects])
    enough = enough[np.isfinite(enough).all(axis=1)]
    assert (enough[:, 0] <= enough[:, 1]).all()
    assert (enough[:, 1] <= enough[:, 2]).all()
    assert (enough[:, 0] < enough[:, 2]).any()


def test_named_sizes_gain_what_small_effects_gain_where_they_are_told_from_rivals(masses):
    """Cracks saturate: one that is told from its rivals is larger than in proportion to what is seen."""
    v = masses.visibility
    rows = np.array([i for i, x in enumerate(v.effects) if x.enough[0] < x.enough[2] < np.inf])
    seen, _, named = np.array([v.effects[i].enough for i in rows]).T
    wanted = needed(v.against)
    _, in_proportion, _, _ = Rivals.of(v.forecast, v.against).separation_amplitudes(rows, seen, wanted[rows])
    sides = [
        v.forecast.littles[v.forecast.owner[i]].side(v.forecast.place[i], a)
        for i, a in zip(rows, named, strict=True)
    ]
    gains = np.full(len(wanted), np.inf)
    gains[rows] = [gain_at(v.forecast, i, a, 0.0) for i, a in zip(rows, sides, strict=True)]
    gained, as_seen = (least_amplitudes(v.forecast, each, 0.0)[rows] for each in (gains, wanted))
    assert np.median(gained / as_seen / (in_proportion / seen)) == pytest.approx(1.0, rel=0.05)
    cracks = [v.effects[i].effect.kind == "crack" for i in rows]
    assert (named[cracks] > 1.01 * in_proportion[cracks]).any()


def test_an_effect_is_located_before_it_is_told_from_others_at_its_place(masses):
    """A rival on the same member does not hide the place."""
    sooner = [x for x in masses.visibility.effects if x.enough[1] < 0.9 * x.enough[2] < np.inf]
    assert sooner
    assert all(x.rival.member == x.effect.member for x in sooner)


def test_small_effects_act_in_proportion_to_their_sizes(masses):
    effects = [x for x in masses.visibility.effects if x.effect.kind == "point_mass"]
    assert effects
    for x in effects:
        amplitudes = [x.amplitude(x.effect.with_values(mass=m)) for m in (0.004, 0.008)]
        assert amplitudes[1] / amplitudes[0] == pytest.approx(2.0, rel=1e-9)
        assert x.amplitude(x.slight) == pytest.approx(1.0)


def test_a_stiffness_that_is_lost_acts_in_proportion_too():
    plan = mapped(halves(), (0.0, 0.2), (0.0,), kinds=("member_stiffness",))
    sizes = np.array([0.05, 0.1, 0.2, 0.3])
    assert len(plan.visibility.effects) == 2  # the halves
    for x in plan.visibility.effects:
        acts = np.array([x.amplitude(x.effect.with_values(change=-c)) for c in sizes])
        # what is left of the stiffness falls, so that frequencies fall a little faster
        np.testing.assert_allclose(acts / acts[0], sizes / sizes[0], rtol=0.25)


def test_an_effect_as_large_as_its_amplitude_is_the_effect(masses):
    effects = [x for x in masses.visibility.effects if np.isfinite(x.enough[0])]
    assert effects
    for x in effects:
        for amplitude in (2.0, 30.0):
            effect = x.at(amplitude)
            assert x.amplitude(effect) == pytest.approx(amplitude, rel=1e-6)
            again = x.at(x.amplitude(effect))
            assert parameter_values(again) == pytest.approx(parameter_values(effect), rel=1e-6)


def test_no_size_is_stated_beyond_the_bounds_of_an_effect():
    """Of a member's stiffness no more than all can be lost, but it may be as much higher."""
    plan = mapped(halves(), (0.0, 0.2), (0.0,), kinds=("member_stiffness",))
    for x in plan.visibility.effects:
        (p,) = x.slight.parameters()
        most = max(abs(b) for b in (p.lower, p.upper) if np.isfinite(b)) / abs(float(p.value))
        assert x.at(0.99 * most) is not None
        assert x.at(1.01 * most) is None


def test_at_the_least_sizes_the_chances_are_those_that_are_stated(masses):
    told = [x for x in masses.visibility.effects if np.isfinite(x.enough[2])]
    assert len(told) > 20
    for x in told:
        seen, _, named = x.enough
        assert x.chances(seen)[0] == pytest.approx(POWER)
        assert x.chances(named)[1] == pytest.approx(POWER)
        chances = np.array([x.chances(a) for a in np.geomspace(0.2 * seen, 3 * named, 12)])
        assert (np.diff(chances, axis=0) >= 0).all()
        assert (chances[:, 1] <= chances[:, 0]).all()
        assert chances[0, 0] < 0.05
        assert chances[-1, 1] > 0.999


# Against fits ---------------------------------------------------------------------------------------------


def receptance_with(problem, effect):
    """Return a problem with the responses to an effect in its basis, and the receptances with it."""
    problem = replace(problem, reduced=problem.reduced.with_forces_of([effect]))
    nominal = problem.nominal()
    values = {**nominal.values, **{(effect.name, k): v for k, v in parameter_values(effect).items()}}
    return problem, problem.receptance(replace(nominal, effects=(effect,), values=values))


@pytest.mark.parametrize(("kind", "position"), [("point_mass", 3), ("point_mass", 10), ("crack", 5)])
def test_effects_that_are_barely_seen_gain_in_fits_what_the_map_says(masses, kind, position):
    """Of data without noise the gain is that which is expected of data with it."""
    x = [x for x in masses.visibility.effects if x.effect.kind == kind][position]
    effect = x.seen
    problem, H = receptance_with(masses.visibility.problem, effect)
    problem = replace(problem, data=replace(problem.data, H=H))
    how = {"stages": problem.stages[-1:], "tolerance": 1e-4}
    nothing, right = fit(problem, **how), fit(problem, [effect], [parameter_values(effect)], **how)
    known = problem.function((), (), problem.lines_up_to(np.inf, problem.n_lines)).prior()
    gain = right.log_likelihood - nothing.log_likelihood + known.cost(nothing.solution.x)
    assert (right.misfit < 2e-3 * right.levels.noise).all()
    assert gain == pytest.approx(x.nats[0], rel=0.15)


def test_beside_what_a_right_model_leaves_effects_gain_what_the_map_says():
    """On average, in data that are drawn; far above the noise the gain is that of an estimated level."""
    plan = mapped(halves(), (0.0, 0.2), (0.0,), kinds=("point_mass",), discrepancy=0.1)
    x = [x for x in plan.visibility.effects if x.effect.kind == "point_mass"][6]
    effect, rng, gains = x.seen, np.random.default_rng(6), []
    problem, _ = receptance_with(plan.visibility.problem, effect)
    for _ in range(12):
        H = drawn(problem, (effect,), 0.1, rng).frf.as_kind("receptance").H
        own = replace(problem, data=replace(problem.data, H=H))
        nothing, right = fit(own), fit(own, [effect], [parameter_values(effect)])
        gains.append(right.log_likelihood - nothing.log_likelihood)
    assert np.mean(gains) == pytest.approx(x.nats[0], rel=0.2)


def test_the_receptances_of_unknowns_are_those_of_the_model_that_they_stand_for(masses):
    problem = masses.visibility.problem
    lines = np.array([0, 7, 30])
    function = problem.function((), (), lines)
    H = function.receptance(function.moved_to(problem.nominal()))
    np.testing.assert_allclose(H, problem.receptance(problem.nominal(), lines), rtol=1e-9)


# Relevant sizes -------------------------------------------------------------------------------------------


def test_relevant_effects_are_seen_from_the_least_size_on(masses):
    assert {o.relevant.kind for o in masses.relevant} == {"point_mass", "crack"}
    for o in masses.relevant:
        for what in ("seen", "located", "named"):
            least = getattr(o.visible, what)
            assert getattr(o, what) == (least is not None and size_of(o.relevant) >= size_of(least))
    for what in ("seen", "located", "named"):
        share = np.mean([getattr(o, what) for o in masses.relevant])
        assert masses.coverage(what) == pytest.approx(share)


def test_larger_relevant_sizes_are_named_more_often(masses):
    model = halves()
    plans = [
        mapped(model, (0.0, 0.2), (0.0,), kinds=("point_mass",), sizes=Relevant(masses=share))
        for share in (1e-5, 1e-3, 0.1)
    ]
    total = 7850 * 0.03 * 0.01 * 1.0
    assert [p.relevant[0].relevant.mass / total for p in plans] == pytest.approx([1e-5, 1e-3, 0.1])
    covered = [p.coverage("seen") for p in plans]
    assert covered[0] < covered[1] < covered[2]


def test_the_rows_of_kinds_hold_the_least_and_largest_sizes(masses):
    rows = masses.sizes_of("seen")
    assert {row["kind"] for row in rows} == {"point_mass", "crack"}
    for row in rows:
        some = [o for o in masses.relevant if o.relevant.kind == row["kind"]]
        sizes = [size_of(e) for o in some if (e := o.visible.seen) is not None]
        assert row["n"] == len(some)
        assert row["blind"] == len(some) - len(sizes)
        assert size_of(row["least"]) == min(sizes)
        assert row["most"] is None if row["blind"] else size_of(row["most"]) == max(sizes)


def test_effects_at_several_places_and_without_a_relevant_size_are_rivals_alone(monkeypatch):
    solved, squares_at = set(), Forecast.squares_at

    def recorded(forecast, rows, multiples):
        solved.update(forecast.candidates[k].kind for k in forecast.owner[rows])
        return squares_at(forecast, rows, multiples)

    monkeypatch.setattr(Forecast, "squares_at", recorded)
    model = portal()
    places = [model.mesh.points[2 * k + 1] for k in range(2)]
    sensors = tuple(Sensor(f"s{k}", p, np.array([1.0, 0, 0])) for k, p in enumerate(places))
    forces = (replace(sensors[0], name="hit"),)
    test = planned_measurement(model, sensors, forces, np.linspace(5.0, 150.0, 40), 0.003)
    plan = plan_test(model, test, kinds=("support_flexibility", "driver_mass"), model_error=0.0)
    assert solved == {"support_flexibility"}
    kinds = {x.effect.kind for x in plan.visibility.effects}
    assert kinds == {"support_flexibility", "driver_mass"}
    assert {o.relevant.kind for o in plan.relevant} == {"support_flexibility"}
    assert {len(near_to(o.relevant)) for o in plan.relevant} == {1}
    assert {len(near_to(x.effect)) for x in plan.visibility.effects} == {1, 2}
    assert len(plan.kinds) == 2  # along and about: of two units


def test_what_is_seen_and_not_named_is_told_once_with_its_rival():
    plan = mapped(halves(), (0.0,), (0.0,), kinds=("point_mass",))
    pairs = [frozenset((o.relevant.name, rival.name)) for o, rival in plan.twins]
    assert pairs == [frozenset(("point_mass:left", "point_mass:right"))]


# Drawn data -----------------------------------------------------------------------------------------------


def residual_level(problem, test):
    """Return the level that a fit leaves of data [nepers]."""
    data = replace(problem.data, H=test.frf.as_kind("receptance").H)
    fitted = fit(replace(problem, data=data))
    return float(np.sqrt(fitted.misfit.mean()))


def test_drawn_data_are_the_same_for_the_same_seed(masses):
    problem = masses.visibility.problem
    one, same, other = (drawn(problem, (), 0.02, np.random.default_rng(seed)).frf.H for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.abs(np.log(other / one)).max() > 0.01


def test_of_drawn_data_a_fit_leaves_their_noise_and_what_a_right_model_leaves(masses):
    problem, rng = masses.visibility.problem, np.random.default_rng(2)
    noise = float(np.sqrt(problem.function((), (), np.arange(44)).levels().noise.mean()))
    bare = np.mean([residual_level(problem, drawn(problem, (), 0.0, rng)) for _ in range(4)])
    assert 0.5 * noise < bare < 1.1 * noise
    more = np.mean([residual_level(problem, drawn(problem, (), 0.1, rng)) for _ in range(8)])
    assert 0.06 < more < 0.11


def test_data_are_drawn_from_the_model_and_not_from_the_basis_of_another():
    """Of a beam half of which is five times as stiff, modes of the even beam gave FRFs that were 14 % off."""
    problem = mapped(halves(), (-0.5, 0.2, 0.5), (0.5,), kinds=("member_stiffness",)).visibility.problem
    stiff = MemberStiffness(name="stiff", member="right", change=4.0)
    test = drawn(problem, (stiff,), 0.0, np.random.default_rng(1))
    model = problem.reduced.model
    rows = [sensor_rows(model, part) for part in (test.sensors, test.excitations)]
    true = compute_frf(assemble(model.with_effect(stiff)), test.frf.frequency, *rows)
    ratio = np.abs(test.frf.as_kind("receptance").H / true.as_kind("receptance").H)
    assert np.median(np.abs(np.log(ratio))) < 0.02


def test_drawn_damping_lies_within_its_prior():
    """Its logarithm is uncertain by a half: the resonances of many draws scatter by about as much."""
    model = damped(planar(beam(20, effects=(fix(0),))), 0.02)
    first = float(solve_modes(assemble(model), n=1).frequency[0])
    test = measured_at(model, (1.0,), (1.0,), noise=1e-4, band=np.linspace(0.5, 1.5, 45) * first)
    problem = plan_test(
        model, test, kinds=("point_mass",), model_error=0.0, discrepancy=0.0
    ).visibility.problem
    rng = np.random.default_rng(3)
    peaks = [np.abs(drawn(problem, (), 0.0, rng).frf.H).max() for _ in range(40)]
    assert 0.3 < np.std(np.log(peaks)) < 0.75


def test_an_effect_in_drawn_data_has_its_size(masses):
    x = [x for x in masses.visibility.effects if x.effect.kind == "point_mass"][8]
    effect = x.at(4 * x.enough[0])
    problem = replace(
        masses.visibility.problem, reduced=masses.visibility.problem.reduced.with_forces_of([effect])
    )
    test = drawn(problem, (effect,), 0.0, np.random.default_rng(4))
    own = replace(problem, data=replace(problem.data, H=test.frf.as_kind("receptance").H))
    fitted = fit(own, [effect], [parameter_values(effect)])
    ref = effect.name, "mass"
    assert abs(fitted.values[ref] - effect.mass) < 4 * fitted.std[ref]
    assert fitted.std[ref] < 0.3 * effect.mass


def test_channels_and_modes_of_drawn_data_err_where_the_form_may():
    plan = mapped(halves(), (0.0, 0.2), (0.0,), kinds=("point_mass",), model_error=0.1)
    problem, rng = plan.visibility.problem, np.random.default_rng(5)
    assert problem.scatter.sizes
    H = np.array([drawn(problem, (), 0.0, rng).frf.H[0] for _ in range(30)])
    # below its resonances the beam is a rigid body: errors of gains, 3 % of each channel, are left
    spread = np.std(np.log(np.abs(H)), axis=0)
    assert (spread > 0.02).all()
    assert (spread < 0.2).all()


# Checks ---------------------------------------------------------------------------------------------------


def test_checks_draw_named_effects_at_multiples_and_judge_what_is_found(masses):
    """A diagnosis that is not sure the first time, is of something the second, and of the effect then."""
    answers = iter([(0.2, 0.1), (0.05, 0.3), (0.01, 0.95), (0.099, 0.901), (0.101, 0.899)])
    names = {f"{kind}:{place}" for kind in ("point_mass", "crack") for place in ("left", "right")}
    names = {x.effect.name for x in masses.visibility.effects} | names
    given = []

    def diagnose(data):
        given.append(data)
        nothing, right = next(answers)
        rest = (1 - nothing - right) / 2
        posterior = [((), nothing), *(((name,), right) for name in sorted(names)), (("a", "b"), rest)]
        return SimpleNamespace(posterior=tuple(posterior))

    done = list(trials(masses, 5, np.random.default_rng(1), diagnose))
    assert [t.multiple for t in done] == list(MULTIPLES)
    assert [t.seen for t in done] == [False, True, True, True, False]
    assert [t.named for t in done] == [False, False, True, True, False]
    assert [d.name for d in given] == [f"drawn {k}" for k in range(1, 6)]
    for t in done:
        (x,) = (
            x
            for x in masses.visibility.effects
            if x.effect.name == t.effect.name
            and parameter_values(x.effect)["position"]
            == pytest.approx(parameter_values(t.effect)["position"])
        )
        amplitude = x.amplitude(t.effect)
        assert amplitude == pytest.approx(t.multiple * x.enough[2], rel=1e-6)
        assert t.chances == pytest.approx(x.chances(amplitude))
    assert len({t.effect.name for t in done}) > 1


def test_a_set_whose_diagnosis_fails_is_one_of_the_trials(masses):
    """The others are those of a check without errors."""
    calls = []

    def diagnose(data):
        calls.append(data.frf.H[0, 0, 0])
        if len(calls) == 2:
            msg = "the matrix is singular"
            raise np.linalg.LinAlgError(msg)
        return SimpleNamespace(posterior=(((), 1.0),))

    done = list(trials(masses, 3, np.random.default_rng(1), diagnose))
    assert [isinstance(t, FailedTrial) for t in done] == [False, True, False]
    assert [t.multiple for t in done] == list(MULTIPLES[:3])
    assert str(done[1].error) == "the matrix is singular"
    whole = list(
        trials(masses, 3, np.random.default_rng(1), lambda data: SimpleNamespace(posterior=(((), 1.0),)))
    )
    assert [parameter_values(t.effect) for t in done] == [parameter_values(t.effect) for t in whole]


def test_an_exception_by_which_a_user_stops_the_work_ends_a_check(masses):
    class Stopped(Exception):  # noqa: N818 - no error
        pass

    def diagnose(data):
        raise Stopped

    with pytest.raises(Stopped):
        list(trials(masses, 3, np.random.default_rng(1), diagnose))


def test_checks_draw_nothing_where_nothing_is_named():
    plan = mapped(halves(), (0.0,), (0.0,), kinds=("point_mass",))
    assert list(trials(plan, 3, np.random.default_rng(1), lambda data: None)) == []
