"""Measured modes with a bad reading, and modes that a test cannot have seen; truths are closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from fem import Section, assemble, first_modes
from tests.frames import FLAT, STEEL, beam, fix
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
)
from updating.diagnosis.evidence import ModeRanking
from updating.forecast import Look
from updating.inference import match, n_below
from updating.inference.fitting import fit
from updating.inference.mode_fit import BAD_PRIOR
from updating.inference.mode_targets import match_each

E = Nuisance("frame", "E:steel", 0.02)
KINDS = ["support_flexibility", "point_mass", "member_stiffness"]
STD = 1e-3
STIFFNESS = STEEL.E * 0.03 * 0.01**3 / 12
"""Weak bending stiffness of the cantilever [N m²]."""


def bending(n, softness=1e-9):
    """Return natural frequencies of the cantilever of 1 m, bent about its weak axis [Hz].

    Euler and Bernoulli's, with a rotational spring k at the root and softness = E I / k L: the roots of
    1 + cos β cosh β = softness β (sin β cosh β - cos β sinh β), here over cosh β.
    """
    x = np.linspace(0.2, (n + 1) * np.pi, 100_000)
    y = np.cos(x) + 1 / np.cosh(x) - softness * x * (np.sin(x) - np.cos(x) * np.tanh(x))
    k = np.flatnonzero(y[:-1] * y[1:] < 0)[:n]
    beta = x[k] - y[k] * (x[k + 1] - x[k]) / (y[k + 1] - y[k])
    return beta**2 / (2 * np.pi) * np.sqrt(STIFFNESS / (STEEL.rho * 0.03 * 0.01))


def sensor(direction, x=1.0):
    return Sensor(f"{direction}{x:g}", np.array([x, 0.0, 0.0]), np.eye(3)["xyz".index(direction)])


def cantilever(sensors=(), section=FLAT):
    model = beam(24, effects=(fix(0),), section=section)
    return model.with_mesh(place_sensors(model.mesh, sensors))


def measured(f, seed=0, **more):
    return ModeTargets.of(f * (1 + STD * np.random.default_rng(seed).standard_normal(len(f))), STD, **more)


def diagnosed(targets):
    model = beam(8, effects=(fix(0),))
    return diagnose_modes(model, targets, (E,), kinds=KINDS)


def test_a_bad_reading_is_named_and_no_cause_with_it():
    f = bending(6)
    f[3] *= 1.06
    found = diagnosed(measured(f, plane="z", held_out=[5]))
    assert found.verdict == NOTHING
    (bad,) = found.bad_readings
    assert (bad.reading.mode, bad.reading.words) == (3, "frequency")
    assert bad.probability > 0.9
    assert "mode 4" in found.reason
    assert "does not belong to the structure's model" in found.reason
    m = found.modes
    assert m.errors(m.found, False) < 2 * STD
    assert np.isfinite(m.found_std).tolist() == [False] * 5 + [True]
    assert STD / 5 < m.found_std[5] < 5 * STD
    assert abs(np.log(m.found[5] / f[5])) < 3 * np.hypot(m.found_std[5], STD)


def test_no_candidate_is_promised_more_than_a_perfect_fit_gains():
    """Beside a soft clamp all readings seem bad, and are hundreds of nats off if they are believed."""
    problem = build_mode_problem(beam(8, effects=(fix(0),)), measured(bending(6, 0.3), plane="z"), (E,))
    problem = replace(problem, bad_prior=BAD_PRIOR)
    nothing, candidates = fit(problem), propose(problem.reduced.model, KINDS)
    look = Look.of(problem, nothing, None, 0, 0)
    assert look.is_doubtful
    most = look.cost_now - look.likelihood.cost(np.zeros(len(look.squares)))
    looked = ModeRanking().screened(problem, nothing, candidates, lambda e: True)
    gains = {each.effect.name: each.gain for each in looked}
    assert 0.5 * most < gains["support_flexibility:support0.ry"] == max(gains.values()) < most
    assert max(e.log_evidence for e in ModeRanking().estimates(problem, nothing, candidates)) < most


def test_a_soft_clamp_is_found_beside_a_bad_reading():
    f = bending(7, softness=0.05)
    f[4] *= 0.93
    found = diagnosed(measured(f, plane="z"))
    assert found.verdict == EFFECT
    (effect,) = found.found
    assert effect.kind == "support_flexibility"
    assert effect.parameters()[0].value == pytest.approx(STIFFNESS / 0.05, rel=0.1)
    assert [b.reading.mode for b in found.bad_readings] == [4]


def test_a_soft_clamp_alone_leaves_no_bad_reading():
    found = diagnosed(measured(bending(5, softness=0.05), plane="z"))
    assert found.verdict == EFFECT
    assert found.found[0].kind == "support_flexibility"
    assert found.found[0].parameters()[0].value == pytest.approx(STIFFNESS / 0.05, rel=0.1)
    assert not found.bad_readings


def test_a_mode_that_the_model_has_not_is_left_out_of_pairs_in_order():
    targets = ModeTargets.of(np.array([10.0, 17.0, 30.0]), 1e-3)
    computed, seen = np.array([10.1, 29.8]), np.ones(2, dtype=bool)
    assert match(targets, computed, np.zeros((0, 2)), seen, 0.01, 0.015).partner.tolist() == [0, -1, 1]


@pytest.mark.parametrize("bad_prior", [0.0, BAD_PRIOR])
@pytest.mark.parametrize("softer", [0.9, 1.1])
def test_a_reading_that_is_no_mode_does_not_shift_the_pairs_above_it(softer, bad_prior):
    """Of a bar that bends in two planes at frequencies 15 % apart, its modulus 10 % off."""
    model = beam(8, effects=(fix(0),), section=Section.rectangle(0.0115, 0.01))
    f = first_modes(assemble(model), 8).frequency[:8] * np.sqrt(softer)
    targets = ModeTargets.of(np.append(f, 1.02 * f[2]), STD)
    uncertain = Nuisance("frame", "E:steel", 0.1)
    problem = replace(build_mode_problem(model, targets, (uncertain,)), bad_prior=bad_prior)
    found = problem.computed(fit(problem))
    assert found.partner.tolist() == [0, 1, 2, -1, 3, 4, 5, 6, 7]
    assert np.nanmax(np.abs(np.log(found.frequency / targets.frequency))) < 0.02


@pytest.mark.parametrize("alien", [0.0, 0.015])
def test_modes_of_many_models_find_the_partners_that_each_finds_alone(alien):
    rng = np.random.default_rng(0)
    targets = ModeTargets.of(np.sort(rng.uniform(10, 100, 7)), 1e-3)
    computed, seen = np.sort(rng.uniform(5, 150, (60, 12)), axis=1), rng.random((60, 12)) < 0.7
    together = match_each(targets, computed, np.zeros((60, 0, 12)), seen, 0.05, alien).partner
    for k in range(60):
        alone = match(targets, computed[k], np.zeros((0, 12)), seen[k], 0.05, alien).partner
        assert together[k].tolist() == alone.tolist()
        found = alone[alone >= 0]
        assert seen[k, found].all()
        assert (np.diff(found) > 0).all()
        assert alien or len(found) == min(7, seen[k].sum())


def test_a_mode_off_by_more_than_the_fit_is_no_reason_to_take_its_neighbour():
    targets = ModeTargets.of(np.array([10.0, 31.0]), 1e-3)
    computed, seen = np.array([10.0, 28.5, 31.0]), np.ones(3, dtype=bool)
    assert match(targets, computed, np.zeros((0, 3)), seen, 0.01, 0.015).partner.tolist() == [0, 2]


@pytest.mark.parametrize("direction", ["z", "y"])
def test_sensors_see_bending_in_their_direction_and_no_torsion_or_axial_mode(direction):
    sensors = (sensor(direction), sensor(direction, 0.6))
    f = bending(8) * (1 if direction == "z" else 3)
    problem = build_mode_problem(cantilever(sensors), measured(f, sensors=sensors))
    function = problem.function((), (), problem.targets.fitted)
    at = function.modes_at(function.start)
    computed = at.pairs(0).frequency[problem.seen(at)][:5]
    assert computed == pytest.approx(f[:5], rel=2e-3)


def test_numbers_count_the_modes_that_the_test_can_see():
    sensors = (sensor("y"),)
    f = 3 * bending(2)
    problem = build_mode_problem(cantilever(sensors), measured(f, sensors=sensors, numbers=[0, 1]))
    assert problem.computed(problem.nominal()).frequency == pytest.approx(f, rel=2e-3)


def test_forces_across_the_sensors_excite_nothing_that_these_see():
    sensors, forces = (sensor("z"),), (sensor("y"),)
    problem = build_mode_problem(
        cantilever((*sensors, *forces)), measured(1.01 * bending(4), sensors=sensors, driven=forces)
    )
    assert n_below(problem) == 0
    assert n_below(replace(problem, data=replace(problem.targets, driven=sensors))) == 4


def test_of_two_bending_modes_of_one_frequency_a_sensor_sees_one():
    sensors = (sensor("z"),)
    model = cantilever((*sensors, sensor("y")), Section.rectangle(0.01, 0.01))
    targets = measured(bending(4), sensors=sensors)
    top = replace(targets, frequency=targets.frequency * 1.01)
    problem = build_mode_problem(model, top)
    assert n_below(problem) == 4
    assert n_below(replace(problem, data=replace(top, sensors=(*sensors, sensor("y"))))) == 8
    assert n_below(replace(problem, data=replace(top, sensors=(), plane="z"))) == 4


def test_bending_frequencies_alone_are_not_paired_with_the_modes_that_come_near():
    """Nine modes of the model lie among the five: those across, and a torsional one."""
    f = bending(5)
    f[1] *= 0.916
    found = diagnosed(measured(f))
    assert not [e for e in found.explanations if e.known and e.effects and e.probability > 0.5]
    assert [b.reading.mode for b in found.bad_readings] == [1]
    assert any("torsional" in note for note in found.notes)
