"""Errors of channels far outside their tolerances are findings, and rivals of effects."""

from dataclasses import replace

import numpy as np
import pytest

from dovetail.report.found_lines import found_lines
from fem import PointMass
from tests.noise import complex_normal
from tests.updating.test_channel_errors import bent, described, measured
from updating import Fault, Measurement, diagnose
from updating.diagnosis.evidence import log_prior, without_effects_of_channels
from updating.inference import fit_given, formed_problem
from updating.quality.channel_faults import channel_faults

SENSORS, FORCES = described()


def misread(factor, *, force=1.0, hidden=(), channels=SENSORS):
    """Return a model and a test of it whose last sensor reads a multiple, and whose FRFs all do."""
    model = bent([*SENSORS, *FORCES])
    frf = measured(model.with_effect(*hidden), channels, FORCES).frf
    H = frf.H * np.where(np.arange(6) == 5, factor, 1.0)[:, None] / force
    H = H * (1 + 0.003 * complex_normal(np.random.default_rng(2), H.shape))
    return model, Measurement(replace(frf, H=H), SENSORS, FORCES)


def fitted(*case, **more):
    """Return the faults of channels in a fit of all that is uncertain."""
    model, test = misread(*case, **more)
    problem, _ = formed_problem(model, test)
    return channel_faults(*fit_given(problem))


@pytest.fixture(scope="module")
def insensitive():
    model, test = misread(0.8)
    return diagnose(model, [test], kinds=["point_mass"])


@pytest.mark.parametrize("gain", [0.8, 0.88, 1.15])
def test_a_gain_beyond_tolerance_has_the_value_that_data_alone_give(gain):
    """The tolerance of 3 % draws the fitted error to zero: 0.87 for 0.8, 0.93 for 0.88."""
    (fault,) = fitted(gain)
    assert (fault.kind, fault.sensor, fault.tolerance) == ("sensor_gain", "tip z", 0.03)
    assert abs(fault.value - gain) < 2 * fault.std
    assert fault.std < 0.04


def test_a_force_and_a_turned_and_a_shifted_sensor_are_told():
    (force,) = fitted(1.0, force=1.2)
    assert (force.kind, force.sensor) == ("excitation_gain", "hit")
    assert abs(force.value - 1.2) < 2 * force.std
    turned = replace(SENSORS[0], direction=np.array([np.cos(0.15), np.sin(0.15), 0.0]))
    (tilt,) = fitted(1.0, channels=(turned, *SENSORS[1:]))
    assert (tilt.kind, tilt.sensor) == ("sensor_tilt", "post x")
    assert tilt.value == pytest.approx(0.15, abs=3 * tilt.std)
    assert abs(tilt.direction[1]) > 0.99


def test_errors_within_tolerances_are_no_faults():
    assert fitted(1.0) == ()
    assert fitted(1.03) == ()


def test_a_wrong_gain_is_the_verdict_with_its_value(insensitive):
    assert insensitive.verdict == "measurement fault"
    (fault,) = insensitive.every_fault
    assert (fault.kind, fault.sensor) == ("sensor_gain", "tip z")
    assert fault.value == pytest.approx(0.8, abs=0.01)
    assert any("tip z reads 0.8" in line or "tip z reads 0.79" in line for line in found_lines(insensitive))


def test_a_wrong_gain_next_to_an_effect_is_told_too():
    hidden = PointMass(name="hidden", member="arm", position=0.2, mass=0.3)
    model, test = misread(0.8, hidden=[hidden])
    found = diagnose(model, [test], kinds=["point_mass"])
    (finding,), (fault,) = found.findings, found.every_fault
    assert finding.effect.mass == pytest.approx(0.3, rel=0.1)
    assert (fault.kind, fault.sensor) == ("sensor_gain", "tip z")
    assert fault.value == pytest.approx(0.8, abs=0.01)


def test_a_fault_of_a_channel_replaces_an_effect_that_stands_in_for_it(insensitive):
    as_read = next(s for s in insensitive.searched.otherwise if not s.faults)
    as_read.search.run()  # the diagnosis has not begun it: it could not be as probable
    mass = max((h for h in as_read.search.known.values() if h.effects), key=lambda h: h.score)
    taken = replace(as_read, best=mass)
    better = without_effects_of_channels(taken)
    assert better.best.effects == ()
    (fault,) = better.faults
    assert fault.name == "sensor_gain:tip z"
    assert better.best.score > mass.score
    assert any(set(better.names(h)) == {*mass.key, f"not {fault.name}"} for h in better.hypotheses)


def test_the_odds_of_a_fault_know_that_its_channel_has_a_tolerance():
    """Any value within the tolerance does as well, however exact its estimate is."""
    _, test = misread(1.0)
    problem, _ = formed_problem(bent([*SENSORS, *FORCES]), test)
    exact, rough = (Fault("sensor_gain", "tip z", 0.8, std, span=6.0) for std in (1e-5, 1e-3))
    assert log_prior([exact], problem.data) == pytest.approx(log_prior([rough], problem.data), abs=0.01)
