"""Reversed, misplaced and exchanged channels are named on either side of a test, forces as responses."""

from dataclasses import replace

import numpy as np
import pytest

from fem import FRF, Damping, assemble, compute_frf
from tests.frames import beam, fix
from tests.noise import complex_normal
from updating import Fault, Measurement, Sensor, assessed_fit, build_problem, find_faults, sensor_rows
from updating.quality import (
    corrected,
    log_odds,
    mirrored,
    mirrored_fault,
    reversed_channels,
    set_right,
    uncorrected,
)

LINES = np.arange(4.0, 400.0, 2.0)
PLACES = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]


def at(name, x):
    return Sensor(name, np.array([x, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]))


def bar(E=1.0):
    """A clamped bar with points every 0.1 m; four of its modes are in the band."""
    model = beam(10, effects=(fix(0),))
    model = model.with_values({("frame", "E:steel"): E * 210e9})
    return replace(model, damping=Damping.modal(0.01))


def measured(outputs, inputs, change=None, noise=0.01, stated=None):
    """Return the FRFs of a bar that is 3 % stiffer than the model; ``change`` alters H (n_freq, n_out, n_in).

    ``stated`` are channels whose description differs from the truth, by their names.
    """
    truth = bar(1.03)
    H = compute_frf(assemble(truth), LINES, sensor_rows(truth, outputs), sensor_rows(truth, inputs)).H
    H = np.array(H * (1 + noise * complex_normal(np.random.default_rng(1), H.shape)))
    if change is not None:
        change(H)
    frf = FRF.from_arrays(LINES, H, "accelerance", [s.name for s in outputs], [s.name for s in inputs])
    known = stated or {}
    return Measurement(frf, *(tuple(known.get(c.name, c) for c in group) for group in (outputs, inputs)))


def problem_of(measurement):
    return build_problem(bar(), measurement, ())


def sensors(places=PLACES):
    return tuple(at(f"a{i}", x) for i, x in enumerate(places))


def forces(places):
    return tuple(at(f"f{i}", x) for i, x in enumerate(places))


def turn(rows=(), columns=()):
    def change(H):
        H[:, list(rows)] *= -1
        H[:, :, list(columns)] *= -1

    return change


def found(measurement):
    problem = problem_of(measurement)
    return reversed_channels(problem, problem.nominal())


def kinds(faults):
    return {(f.kind, f.sensor) for f in faults}


def test_one_reversed_force_is_named_rather_than_all_of_its_responses():
    driven = found(measured(sensors(), forces([0.6]), turn(columns=[0])))
    assert kinds(driven.faults) == {("excitation_sign", "f0")}
    assert driven.faults[0].other == ""
    (text,) = driven.words
    assert "force 'f0' looks reversed" in text
    assert "gives power to the force where 'f0' and 'a4' are" in text
    assert found(measured(sensors(), forces([0.6]))).faults == ()


def test_without_a_driven_point_the_responses_are_named_as_well():
    places = [x for x in PLACES if x != 0.6]
    (fault,) = found(measured(sensors(places), forces([0.6]), turn(columns=[0]))).faults
    assert (fault.kind, fault.sensor, fault.other) == ("excitation_sign", "f0", "all 8 responses")


@pytest.mark.parametrize("place", [0.6, 1.0])
def test_of_one_response_to_one_force_nobody_knows_which_is_reversed(place):
    (fault,) = found(measured(sensors([place]), forces([1.0]), turn(columns=[0]))).faults
    assert {fault.sensor, fault.other} == {"a0", "f0"}


def test_one_reversed_force_of_several_is_named():
    result = found(measured(sensors(), forces([0.5, 0.8, 1.0]), turn(columns=[1])))
    assert kinds(result.faults) == {("excitation_sign", "f1")}


def test_a_reversed_force_and_a_reversed_response_at_its_place_are_both_named():
    """The drive point alone looks right."""
    result = found(measured(sensors(), forces([0.6]), turn(rows=[4], columns=[0])))
    assert kinds(result.faults) == {("excitation_sign", "f0"), ("sensor_sign", "a4")}


def test_a_reversed_response_to_a_roving_hammer_is_named_rather_than_all_forces():
    hammer = forces(PLACES)
    (fault,) = found(measured(sensors([0.6]), hammer, turn(rows=[0]))).faults
    assert (fault.kind, fault.sensor, fault.other) == ("sensor_sign", "a0", "")
    (one,) = found(measured(sensors([0.6]), hammer, turn(columns=[2]))).faults
    assert (one.kind, one.sensor) == ("excitation_sign", "f2")


def test_phases_near_chance_tell_no_sign():
    """Odds grow with the square of the mean cosine, so that a poor model reverses nothing."""
    assert 0 < log_odds(0.2, 6) < 0.5
    assert log_odds(-0.9, 6) == -log_odds(0.9, 6) < -15


def test_a_wrong_sign_is_corrected_although_the_fit_to_it_leads_away():
    problem = problem_of(measured(sensors(), forces([0.6]), turn(columns=[0])))
    null = assessed_fit(problem)
    mended, fit, faults = find_faults(problem, null)
    assert kinds(faults) == {("excitation_sign", "f0")}
    np.testing.assert_allclose(mended.data.H, -problem.data.H)
    assert fit.level < 0.2 * null.level


ROVING = {
    "gain": (lambda H: H.__setitem__(np.s_[:, :, 3], H[:, :, 3] / 1.3), "excitation_gain", "f3", 1.3),
    "labels": (lambda H: H.__setitem__(np.s_[:, :, [2, 6]], H[:, :, [6, 2]]), "excitation_swap", "f6", 0.0),
}


@pytest.mark.parametrize("name", ROVING)
def test_forces_of_a_roving_hammer_check_one_another(name):
    change, kind, force, value = ROVING[name]
    problem = problem_of(measured(sensors([0.6]), forces(PLACES), change))
    _, fit, faults = find_faults(problem, assessed_fit(problem))
    assert kinds(faults) == {(kind, force)}
    assert faults[0].value == pytest.approx(value, rel=0.02)
    sound = problem_of(measured(sensors([0.6]), forces(PLACES)))
    assert fit.level < 1.2 * assessed_fit(sound).level


@pytest.mark.parametrize("roving", [True, False])
def test_the_fixed_channel_of_a_roving_test_is_found_at_its_right_place(roving):
    """A response that is said to be at 0.7 m is at 0.6 m; so is the force of a roving accelerometer."""
    fixed, others = sensors([0.6]), forces(PLACES)
    stated = {"a0": at("a0", 0.7)}
    m = measured(fixed, others, stated=stated) if roving else measured(others, fixed, stated=stated)
    problem = problem_of(m)
    null = assessed_fit(problem)
    mended, fit, (fault,) = find_faults(problem, null)
    assert (fault.kind, fault.sensor) == (f"{'sensor' if roving else 'excitation'}_position", "a0")
    assert fault.other == "the place of f4"
    np.testing.assert_allclose(fault.shift, [-0.1, 0, 0], atol=1e-12)
    assert fault.value == pytest.approx(0.1)
    np.testing.assert_array_equal(mended.data.mask, problem.data.mask)
    assert fit.level < 0.5 * null.level
    sound = problem_of(measured(fixed, others) if roving else measured(others, fixed))
    assert find_faults(sound, assessed_fit(sound))[2] == ()


def test_faults_of_forces_are_those_of_sensors_of_the_transpose():
    problem = problem_of(measured(sensors(), forces([0.5, 0.8, 1.0])))
    d = (1.0, 0.0, 0.0)
    for fault in (
        Fault("excitation_gain", "f1", 1.3, 0.01),
        Fault("excitation_delay", "f1", 1e-4, 1e-6, "s"),
        Fault("excitation_sign", "f1", -1.0, 0.0),
        Fault("excitation_swap", "f1", 0.0, 0.0, other="f2"),
        Fault("excitation_tilt", "f1", 0.2, 0.01, "rad", direction=d),
        Fault("excitation_position", "f1", 0.1, 0.0, "m", "point p", shift=(0.1, 0.0, 0.0)),
        Fault("excitation_position", "f1", 0.1, 0.01, "m", "beam"),
    ):
        there = corrected(problem.data, (fault,))
        other = mirrored(corrected(mirrored(problem.data), (mirrored_fault(fault),)))
        for a, b in ((there.H, other.H), (there.mask, other.mask)):
            np.testing.assert_allclose(a, b, rtol=1e-12)
        for a, b in zip(there.measurement.excitations, other.measurement.excitations, strict=True):
            np.testing.assert_allclose([a.point, a.direction], [b.point, b.direction])
        back = uncorrected(there, (fault,))
        np.testing.assert_allclose(back.H, problem.data.H, rtol=1e-12)
        np.testing.assert_array_equal(back.mask, problem.data.mask)
        np.testing.assert_allclose(
            [e.point for e in back.measurement.excitations],
            [e.point for e in problem.data.measurement.excitations],
            atol=1e-12,
        )


def test_a_force_whose_right_place_is_unknown_is_left_out():
    m = measured(sensors(), forces([0.5, 0.8, 1.0]))
    right = set_right(m, (Fault("excitation_position", "f1", 0.1, 0.01, "m", "beam"),))
    assert right.frf.inputs == ("f0", "f2")
    moved = set_right(m, (Fault("excitation_position", "f1", 0.1, 0.0, "m", "p", shift=(0.1, 0, 0)),))
    np.testing.assert_allclose(moved.excitations[1].point, [0.9, 0, 0])
