"""Changes between two states of one structure by their modes: what the states have in common."""

from dataclasses import replace

import numpy as np
import pytest

from fem import AddedMass, Damping, assemble, first_modes
from tests.frames import beam, fix
from updating import ModeTargets, Nuisance, Sensor, diagnose_modes
from updating.diagnosis import calibrate, changed_problem, judged
from updating.diagnosis.states import calibrated_errors, carried_modes, second_state
from updating.inference.fitting import fit

NOISE, N_MODES = 1e-3, 6


def cantilever(mass=0.0):
    """Return a cantilever with two small masses that are uncertain, and one more at its end."""
    masses = [AddedMass(name=f"m{p}", point=p, mass=m) for p, m in ((4, 0.2), (6, 0.2), (1, mass)) if m]
    return beam(8, effects=(fix(0), *masses), theory="timoshenko")


def frequencies(model, rng):
    modes = first_modes(assemble(model), N_MODES)
    f = modes.frequency[:N_MODES]
    return ModeTargets.of(f * (1 + NOISE * rng.standard_normal(N_MODES)), NOISE)


UNCERTAIN = (
    Nuisance("frame", "E:steel", 0.02),
    Nuisance("m4", "mass", 0.2),
    Nuisance("m6", "mass", 0.2),
)


def test_of_a_model_that_fits_to_the_noise_little_is_subtracted():
    rng = np.random.default_rng(1)
    model = cantilever()
    before, after = frequencies(model, rng), frequencies(model, rng)
    first = calibrate(model, before, UNCERTAIN, model_error=0.0)
    assert first.form_share[0].max() < 0.2
    carried = carried_modes(first, after)
    eigenvalues = (2 * np.pi * after.frequency) ** 2
    assert np.abs(carried.stiffness / eigenvalues).max() / 2 < 0.4 * NOISE


def test_what_no_parameter_explains_is_carried_from_one_state_to_the_other():
    rng = np.random.default_rng(2)
    true, model = cantilever(mass=0.1), cantilever()
    before, after = frequencies(true, rng), frequencies(true, rng)
    first, _, problem = changed_problem(model, before, after, UNCERTAIN)
    assert first.form_share[0].min() > 0.9
    left = np.log(after.frequency / problem.computed(problem.nominal()).frequency)
    assert np.abs(np.log(before.frequency / first.computed.frequency)).max() > 5 * NOISE
    assert np.abs(left).max() < 3 * NOISE


@pytest.mark.parametrize("mass", [0.1, 0.3, 1.0])
def test_what_the_first_state_misses_follows_modes_that_a_change_mixes(mass):
    """Frequencies fall by up to 50 %, and two modes change their order."""

    def modes(*more):
        true = first_modes(assemble(beam(8, effects=(fix(0), *more), theory="timoshenko")), 40)
        return ModeTargets.of(true.frequency[:5], 1e-4)

    unknown = AddedMass(name="unknown", point=5, mass=0.02)
    change = AddedMass(name="change", point=1, mass=mass)
    model = beam(8, effects=(fix(0),), theory="timoshenko")
    before, after = modes(unknown), modes(unknown, change)
    first, _, problem = changed_problem(model, before, after, changes=[change])
    left = np.log(problem.computed(problem.nominal()).frequency / after.frequency)
    assert np.abs(first.missed).max() > 30
    assert np.abs(left).max() < 1e-3


def test_shapes_and_damping_that_the_first_state_misses_are_carried_too():
    """A sensor that reads 10 % too much, and one mode that is damped half as much again."""
    model = beam(8, effects=(fix(0),), theory="timoshenko").with_damping(Damping.modal(0.01))
    points = [1, 3, 5, 7]
    sensors = [Sensor(f"s{p}", model.mesh.points[p], np.array([0.0, 1.0, 0.0])) for p in points]
    true = first_modes(assemble(model), 12)
    motion = true.shapes[[6 * p + 1 for p in points]]
    n = np.flatnonzero(np.abs(motion).max(axis=0) > 1e-2)[:3]
    shapes = motion[:, n] * np.array([[1.1], [1.0], [1.0], [1.0]])
    zeta = np.array([0.01, 0.015, 0.01])
    state = ModeTargets.of(
        true.frequency[n], 1e-4, zeta=zeta, zeta_std=0.01, shapes=shapes, shape_std=1e-3, sensors=sensors
    )
    first, _, problem = changed_problem(model, state, state)
    assert problem.carried is not None
    found = problem.computed(problem.nominal())
    assert first.computed.zeta[1] < 0.013
    np.testing.assert_allclose(found.zeta, zeta, rtol=0.03)
    assert first.computed.mac.min() < 0.999
    assert found.mac.min() > 0.99999


def four_masses(change=0.0, **masses):
    """Return a cantilever with four masses, and one that comes at its end."""
    at = {"m3": 0.2, "m4": 0.2, "m5": 0.2, "m6": 0.2, **masses}
    every = [AddedMass(name=name, point=int(name[1:]), mass=m) for name, m in at.items()]
    every += [AddedMass(name="change", point=1, mass=change)] * bool(change)
    return beam(8, effects=(fix(0), *every), theory="timoshenko")


@pytest.mark.parametrize("change", [0.1, 2.0])
def test_what_both_states_leave_of_a_change_is_that_of_a_fit_to_both_at_once(change):
    """A normal approximation with the same unknowns in both states, by differences of the beam itself.

    Three modes know four masses badly. With errors of the second state without the change, ± is 0.67 and 1.29
    of that.
    """
    modes, std = [0, 2, 4], 2e-4

    def measured(**masses):
        return first_modes(assemble(four_masses(**masses)), 12).frequency[modes]

    at = {"m3": 0.2, "m4": 0.2, "m5": 0.2, "m6": 0.2, "change": change}
    J = []
    for key, value in at.items():
        low, high = ({**at, key: value * np.exp(d)} for d in (-1e-4, 1e-4))
        pairs = [({**low, "change": 0.0}, {**high, "change": 0.0}), (low, high)]
        J.append(np.concatenate([np.log(measured(**b) / measured(**a)) for a, b in pairs]) / 2e-4)
    prior = np.diag([0.5**-2] * 4 + [0.0])
    both = change * np.sqrt(np.linalg.inv(np.array(J) @ np.array(J).T / std**2 + prior)[-1, -1])

    before, after = (ModeTargets.of(measured(change=m), std, numbers=modes) for m in (0.0, change))
    uncertain = tuple(Nuisance(name, "mass", 0.5) for name in ("m3", "m4", "m5", "m6"))
    _, _, problem = changed_problem(four_masses(), before, after, uncertain, model_error=0.0)
    later = AddedMass(name="later", point=1, mass=0.0)
    problem = replace(problem, bad_prior=0.0, reduced=problem.reduced.with_forces_of([later]))
    near = fit(problem, [later], [{"mass": change}])
    _, basis = problem.better_basis(near) or (0.0, problem.reduced)
    fitted = fit(replace(problem, reduced=basis), [later], [{"mass": change}])
    assert fitted.effects[0].mass == pytest.approx(change, rel=1e-4)
    assert fitted.std["later", "mass"] == pytest.approx(both, rel=0.12)


def test_what_is_carried_follows_the_uncertain_parameters():
    """Of what they do to the first state the share that is carried has no part in the second one."""
    true, model = cantilever(mass=0.1), cantilever()
    same = ModeTargets.of(first_modes(assemble(true), N_MODES).frequency[:N_MODES], NOISE)
    first, _, problem = changed_problem(model, same, same, UNCERTAIN)
    function = problem.function((), (), problem.targets.fitted)
    x = function.start.copy()
    off = 1e-3 * np.ones(problem.calibrated.loads.shape[1])
    before = np.log(problem.computed(problem.nominal()).frequency)
    x[-len(off) :] = off
    every = function.modes_at(x).pairs(0).frequency
    partner = problem.computed(problem.nominal()).partner
    moved = np.log(every[partner]) - before
    errors = problem.calibrated.loads @ off
    alone = calibrated_errors(first)[1].T @ errors
    assert 0.9 < first.form_share[0].min() < 0.999
    np.testing.assert_allclose(moved, (1 - first.carried_share[0]) * alone, atol=0.01 * np.abs(alone).max())


def test_a_model_that_the_first_state_does_not_contradict_stands():
    rng, model = np.random.default_rng(5), cantilever()
    first = calibrate(model, frequencies(model, rng), UNCERTAIN, model_error=0.0)
    found = judged(first, ["point_mass"], say=lambda text, done: None)
    assert found.diagnosis is None
    assert found.bases == (first,)
    assert found.texts == ()


@pytest.fixture(scope="module")
def poor():
    """Return what a first state says of a model that lacks a mass of 0.3 kg at its end."""
    first = calibrate(
        cantilever(), frequencies(cantilever(mass=0.3), np.random.default_rng(6)), UNCERTAIN, model_error=0.0
    )
    return judged(first, ["point_mass"], say=lambda text, done: None)


def test_a_bad_reading_of_the_first_state_is_not_carried():
    rng, model = np.random.default_rng(8), cantilever()
    before, after = frequencies(model, rng), frequencies(model, rng)
    misread = before.frequency * np.array([1, 1, 1, 0.93, 1, 1])
    baseline = judged(
        calibrate(model, ModeTargets.of(misread, NOISE), UNCERTAIN),
        ["point_mass"],
        say=lambda text, done: None,
    )
    (first,) = baseline.bases
    _, problem = second_state(first, after)
    assert first.bad[0].argmax() == 3
    assert first.bad[0, 3] > 0.99
    found = problem.computed(problem.nominal()).frequency
    assert np.abs(np.log(found / after.frequency)).max() < 5 * NOISE
    assert problem.targets.frequency_std[3] > problem.targets.frequency_std[2]


def test_a_bad_reading_of_the_first_state_hides_no_cause():
    true = frequencies(cantilever(mass=0.3), np.random.default_rng(6))
    misread = true.frequency * np.array([1, 1, 1, 0.93, 1, 1])
    first = calibrate(cantilever(), ModeTargets.of(misread, NOISE), UNCERTAIN)
    found = judged(first, ["point_mass"], say=lambda text, done: None)
    (cause,) = found.bases[0].fitted.effects
    assert cause.mass == pytest.approx(0.3, rel=0.1)
    assert found.bases[0].bad[0].argmax() == 3


def test_what_both_states_lack_is_a_model_of_the_first(poor):
    (cause,) = poor.bases[0].fitted.effects
    assert cause.kind == "point_mass"
    assert cause.name.startswith("common ")
    assert cause.mass == pytest.approx(0.3, rel=0.1)
    assert poor.weights.sum() == pytest.approx(1)
    assert np.abs(poor.first.missed).max() > 10 > 4 > np.abs(poor.bases[0].missed).max()
    assert f"mode {1 + np.abs(poor.first.missed).argmax()} by" in poor.texts[0]


@pytest.mark.parametrize("more", [0.0, 0.05])
def test_a_change_is_looked_for_beside_what_both_states_lack(poor, more):
    after = cantilever(mass=0.3)
    if more:
        after = after.with_effect(AddedMass(name="later", point=5, mass=more))
    after = frequencies(after, np.random.default_rng(7))
    kinds = ["point_mass", "stiffness_loss"]
    d = diagnose_modes(cantilever(), after, UNCERTAIN, baseline=poor, kinds=kinds, model_error=0.0)
    assert d.judged is poor
    assert d.baseline in poor.bases
    assert sum(e.probability for e in d.explanations) == pytest.approx(1)
    if more:
        assert [e.kind for e in d.found] == ["point_mass"]
        assert d.found[0].mass == pytest.approx(more, rel=0.2)
    else:
        assert d.verdict == "nothing missing"


def test_beside_a_second_cause_the_search_begins_with_what_was_found_beside_the_first(poor):
    after = cantilever(mass=0.3).with_effect(AddedMass(name="later", point=5, mass=0.05))
    after = frequencies(after, np.random.default_rng(7))
    twice = replace(poor, bases=(poor.bases[0],) * 2, log_weights=np.zeros(2))
    kinds = ["point_mass", "stiffness_loss"]
    d = diagnose_modes(cantilever(), after, UNCERTAIN, baseline=twice, kinds=kinds, model_error=0.0)
    (again,) = d.searched.otherwise
    one, two = (
        {h.key for h in search.known.values() if len(h.effects) < 2}
        for search in (d.searched.search, again.search)
    )
    assert two <= one
    assert again.best.key == d.searched.best.key
    assert again.best.score == pytest.approx(d.searched.best.score, abs=0.1)
