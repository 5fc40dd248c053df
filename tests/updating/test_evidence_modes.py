"""Measured modes as data of the search by evidence: residuals, matching, likelihood, verdicts."""

import re

import numpy as np
import pytest

from fem import PointMass, assemble, first_modes
from tests.frames import beam, fix
from updating import (
    EFFECT,
    NOTHING,
    ModeTargets,
    Nuisance,
    Sensor,
    build_mode_problem,
    diagnose_modes,
    place_sensors,
    propose,
    sensor_rows,
)
from updating.inference import match
from updating.least_squares import ModeLevels

E = Nuisance("frame", "E:steel", 0.02)
SENSORS = tuple(
    Sensor(f"{d}{k}", np.array([x, 0.0, 0.0]), np.eye(3)["xyz".index(d)])
    for k, x in enumerate((0.25, 0.5, 0.75, 1.0))
    for d in "yz"
)


def cantilever():
    model = beam(8, effects=(fix(0),), theory="timoshenko")
    return model.with_mesh(place_sensors(model.mesh, SENSORS))


def measured(model, n=6, *, shapes=True, noise=1e-3, seed=0, **more):
    modes = first_modes(assemble(model), n)
    f, phi = modes.frequency[:n], (sensor_rows(model, SENSORS) @ modes.shapes)[:, :n]
    rng = np.random.default_rng(seed)
    f = f * (1 + noise * rng.standard_normal(n))
    phi = phi + 0.02 * np.sqrt((phi**2).mean(axis=0)) * rng.standard_normal(phi.shape)
    known = {"shapes": phi, "shape_std": 0.02, "sensors": SENSORS} if shapes else {}
    return ModeTargets.of(f, noise, **known, **more)


def levels_of(n, variance, left, bad_prior=0.0):
    one = np.ones(len(n))
    kind = np.zeros(len(n), dtype=int)
    return ModeLevels.up_to(kind, n, n, variance * one, left * one, 0.3**2 * one, bad_prior)


def with_mass(model, mass, position):
    (effect,) = propose(model, ["point_mass"])
    return model.with_effect(effect.with_values(mass=mass, position=position))


@pytest.mark.parametrize("kind", ["point_mass", "distributed_mass", "support_flexibility", "crack"])
def test_derivatives_of_residuals_are_those_of_differences(kind):
    model = cantilever()
    problem = build_mode_problem(model, measured(model, zeta=np.full(6, 0.008)), (E,))
    effect = propose(model, [kind])[0]
    start = effect.starts(problem.surroundings)
    function = problem.function((effect,), [start[len(start) // 2]], problem.targets.fitted)
    x, step = function.start + 0.01, 1e-5
    _, J = function(x, True)
    assert J is not None
    for k in range(len(x)):
        d = np.zeros(len(x))
        d[k] = step
        numeric = (function(x + d, False)[0] - function(x - d, False)[0]) / (2 * step)
        # The metric in which shapes are compared is held in a step: that is all that may differ.
        scale = np.abs(J[k]).max() + 1e-3
        assert np.abs(numeric - J[k])[function.kinds < 2].max() < 1e-4 * scale
        assert np.abs(numeric - J[k]).max() < 2e-2 * scale


def test_modes_that_have_crossed_keep_their_partners_by_their_shapes():
    targets = ModeTargets.of(np.array([10.0, 10.5]), 1e-3, shapes=np.eye(2))
    found = match(targets, np.array([9.9, 10.4]), np.eye(2)[::-1], np.ones(2, dtype=bool))
    assert found.partner.tolist() == [1, 0]
    assert found.mac.tolist() == [1.0, 1.0]


def test_without_shapes_a_mode_that_the_test_has_missed_is_passed_over():
    targets = ModeTargets.of(np.array([10.0, 30.0]), 1e-3)
    found = match(targets, np.array([10.1, 20.0, 29.8]), np.zeros((0, 3)), np.ones(3, dtype=bool))
    assert found.partner.tolist() == [0, 2]


def test_motion_out_of_the_plane_of_a_test_is_not_matched():
    model = cantilever()
    every = first_modes(assemble(model), 6).frequency
    in_plane = first_modes(assemble(beam(8, effects=(fix(0),), theory="timoshenko")), 6)
    z = np.abs(in_plane.shapes[2::6]).max(axis=0) > 10 * np.abs(in_plane.shapes[1::6]).max(axis=0)
    targets = ModeTargets.of(every[:6][z[:6]], 1e-3, plane="z")
    problem = build_mode_problem(model, targets)
    assert problem.computed(problem.nominal()).frequency == pytest.approx(targets.frequency, rel=1e-6)


def test_with_noise_alone_the_likelihood_is_that_of_independent_data():
    one = np.ones(1)
    levels = levels_of(5 * one, 4e-6, 0.0)
    assert levels.cost(9e-6 * one) - levels.cost(4e-6 * one) == pytest.approx(5 / 2 * (9 - 4) / 4)


def test_a_discrepancy_of_any_size_lets_a_large_misfit_cost_less():
    one = np.ones(1)
    known, unknown = (levels_of(5 * one, 1e-6, t) for t in (0.0, 0.01))
    v = 25e-6 * one
    assert unknown.cost(v) < known.cost(v)
    slope = (unknown.cost(v * 1.0001) - unknown.cost(v)) / (v[0] * 1e-4)
    assert 2 * slope == pytest.approx(unknown.weight(v)[0], rel=1e-3)


def test_the_slopes_of_the_cost_of_bad_readings_are_those_of_differences():
    levels = levels_of(np.array([1.0, 1.0, 6.0]), 1e-6, 0.01, 0.015)
    v = np.array([2e-6, 2e-3, 5e-6])
    for k in range(3):
        up, down = (np.where(np.arange(3) == k, v * (1 + a), v) for a in (1e-5, -1e-5))
        slope = (levels.cost(up) - levels.cost(down)) / (2e-5 * v[k])
        assert 2 * slope == pytest.approx(levels.weight(v)[k], rel=1e-4)
    assert levels.is_bad(v) == pytest.approx([0.0, 1.0, 0.0], abs=0.02)


def test_a_bad_reading_costs_its_odds_and_no_more_the_farther_it_is_off():
    one = np.ones(5)
    sure, doubtful = (levels_of(one, 1e-6, 0.0, p) for p in (0.0, 0.015))
    good = 1e-6 * one
    bad = np.where(np.arange(5) == 2, 0.05**2, good)
    assert sure.cost(bad) - sure.cost(good) > 1000
    odds = -np.log(0.015 / (1 - 0.015)) + np.log(0.3 / 1e-3) - 0.5 + 0.5 * (0.05 / 0.3) ** 2
    assert doubtful.cost(bad) - doubtful.cost(good) == pytest.approx(odds, rel=1e-3)


def test_the_unknown_explains_one_mode_by_no_more_than_the_odds_against_a_bad_reading():
    levels = levels_of(np.ones(5), 1e-6, 0.0, 0.015)
    v = np.where(np.arange(5) < 2, 0.05**2, 1e-6)
    assert levels.gain(v, np.full(5, 1e-6)) == pytest.approx(-2 * np.log(0.015), rel=1e-6)


def test_a_hidden_mass_is_found_by_shapes_and_held_out_modes_are_predicted():
    model = cantilever()
    targets = measured(with_mass(model, 0.3, 0.6), held_out=[5])
    found = diagnose_modes(model, targets, (E,), kinds=["point_mass"], model_error=0.0)
    assert found.verdict == EFFECT
    (effect,) = found.found
    values = {p.name: p.value for p in effect.parameters()}
    assert values["mass"] == pytest.approx(0.3, rel=0.05)
    assert values["position"] == pytest.approx(0.6, abs=0.02)
    assert found.explanations[0].probability > 0.9
    m = found.modes
    assert m.errors(m.found, True) < 0.005 < m.errors(m.fitted, True)


def test_the_reason_quotes_the_error_that_decides():
    model = cantilever()
    exact = measured(with_mass(model, 0.2, 0.6), 4)
    known = {"shapes": exact.shapes, "shape_std": 0.02, "sensors": SENSORS}
    targets = ModeTargets.of(exact.frequency, 0.2, **known)
    found = diagnose_modes(model, targets, (E,), kinds=["point_mass"], model_error=0.0)
    assert found.verdict == EFFECT
    assert " lowers the error of the mode shapes, √(1 − MAC), from " in found.reason


def test_without_effects_the_reason_quotes_what_is_left_of_every_quantity_measured():
    model = cantilever()
    exact = measured(model, 4)
    known = {"shapes": exact.shapes, "shape_std": 0.02, "sensors": SENSORS}
    targets = ModeTargets.of(exact.frequency, 0.002, zeta=np.full(4, 0.01), zeta_std=0.3, **known)
    found = diagnose_modes(model, targets, (E,), kinds=["point_mass"], model_error=0.0)
    assert found.verdict == NOTHING
    left = (
        r"error of the natural frequencies is \S+ % \(\S+ % of the damping ratios, \S+ % of the mode shapes, "
    )
    assert re.search(left, found.reason)
    alone = diagnose_modes(model, ModeTargets.of(exact.frequency, 0.002), (E,), kinds=["point_mass"])
    assert "damping" not in alone.reason
    assert "shapes" not in alone.reason.split(";")[0]


def test_nothing_is_found_in_frequencies_with_nothing_hidden():
    model = cantilever()
    found = diagnose_modes(model, measured(model, shapes=False), (E,), kinds=["point_mass"], model_error=0.0)
    assert found.verdict == NOTHING
    assert not [e for e in found.explanations if e.effects and e.probability > 0.5]


def test_where_symmetric_places_are_alike_frequencies_do_not_name_one():
    """A mass at s and at L - s of a free beam changes no frequency differently."""
    model = beam(8, theory="timoshenko")
    (effect,) = propose(model, ["point_mass"])
    assert isinstance(effect, PointMass)
    f = first_modes(assemble(model.with_effect(effect.with_values(mass=0.2, position=0.3))), 5)
    targets = ModeTargets.of(f.frequency[f.n_rigid :], 1e-3)
    found = diagnose_modes(model, targets, (E,), kinds=["point_mass"], model_error=0.0)
    likely = [e for e in found.credible if e.known]
    positions = sorted(p.value for e in likely for p in e.parameters[0] if p.name == "position")
    assert positions == pytest.approx([0.3, 0.7], abs=0.01)
    assert [e.probability for e in likely] == pytest.approx([0.5, 0.5], abs=0.1)
    assert not found.sure or found.explanations[0].probability < 0.6
    assert any("shapes" in note for note in found.notes)


@pytest.mark.parametrize("position", [0.28, 0.61])
def test_the_frequencies_of_what_was_found_are_those_of_the_whole_model(position):
    """A basis with the forces of another place, even 1 mm away, makes a crack too stiff."""
    model, noise = cantilever(), 1e-4
    crack = next(e for e in propose(model, ["crack"]) if "about local y" in e.where)
    true = model.with_effect(crack.with_values(compliance=2e-5, position=position))
    targets = measured(true.with_mesh(true.mesh.split(4)), noise=noise)
    found = diagnose_modes(model, targets, (E,), kinds=["crack"], model_error=0.0)
    assert found.verdict == EFFECT
    whole = first_modes(assemble(found.model), 6).frequency[:6]
    assert np.abs(np.log(whole / targets.frequency)).max() < 4 * noise
    np.testing.assert_allclose(found.modes.found, whole, rtol=noise)
