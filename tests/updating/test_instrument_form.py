"""What instruments add to a structure: masses of sensors and exciters, stiffness of stingers."""

from dataclasses import replace

import numpy as np
import pytest

from dovetail.report import departure_text
from fem import assemble
from fem.effects import DriverForm, SensorForm
from tests.updating.test_channel_errors import bent, described, measured
from updating import ChannelErrors, Nuisance
from updating.diagnosis.departures import departures
from updating.inference import LIGHT, STATED_MASS, fit_given, form_of, formed_problem
from updating.measurement import instruments_on

E = Nuisance("frame", "E:steel", 0.05)


def the(kind, effects):
    (effect,) = (e for e in effects if e.kind == kind)
    return effect


@pytest.fixture(scope="module")
def drawn():
    sensors, forces = described()
    model = bent([*sensors, *forces])
    return model, sensors, forces, measured(model, sensors, forces)


def test_a_rigid_motion_has_the_energy_of_points_and_of_a_spring_across(drawn):
    model, _, forces, measurement = drawn
    effects, _ = form_of(model, measurement)
    sensors, driver = the("sensor_form", effects), the("driver_form", effects)
    v = np.array([0.3, -0.2, 0.5])
    motion = np.zeros((model.mesh.n_points, 6))
    motion[:, :3] = v
    before = assemble(model)
    with_masses = assemble(model.with_effect(sensors.with_values(mass=0.01), driver.with_values(mass=0.02)))
    u = before.Q.T @ motion.ravel()
    free = np.asarray(before.Q @ u).reshape(-1, 6)  # the root is held
    points = [*sensors.points, driver.point]
    each = np.array([0.01] * len(sensors.points) + [0.02])
    energy = each @ (free[points, :3] ** 2).sum(axis=1)
    assert u @ ((with_masses.M - before.M) @ u) == pytest.approx(energy)
    held = assemble(model.with_effect(driver.with_values(across=3e3)))
    across = v - (v @ forces[0].direction) * forces[0].direction
    assert u @ ((held.K - before.K) @ u) == pytest.approx(3e3 * across @ across)


def test_tolerances_follow_the_test(drawn):
    model, sensors, _, measurement = drawn

    def stds(errors, masses=()):
        own = tuple(replace(s, mass=m) for s, m in zip(sensors, masses, strict=False)) or sensors
        test = replace(measurement, sensors=(*own, *sensors[len(own) :]), errors=errors)
        effects, varied = form_of(model, test)
        of = {e.name: e for e in effects}
        own = [(of[n.effect], n) for n in varied]
        return {(e.kind, n.parameter): n.std for e, n in own if isinstance(e, SensorForm | DriverForm)}

    tiny = ChannelErrors(sensor_mass=1e-6, driver_mass=2e-6, stinger=0.5)
    masses = {("sensor_form", "mass"): 1e-6, ("driver_form", "mass"): 2e-6}
    assert stds(tiny) == masses | {("driver_form", "across"): 0.5}
    assert stds(ChannelErrors(sensor_mass=0, driver_mass=0, stinger=0)) == {}
    without_stinger = ChannelErrors(sensor_mass=0, driver_mass=1e-6, stinger=0)
    assert stds(without_stinger) == {("driver_form", "mass"): 1e-6}
    stated = stds(tiny, [1e-4, 3e-4])
    assert stated["sensor_form", "mass"] == pytest.approx(STATED_MASS * 2e-4)
    tested = model.with_instruments(instruments_on(model.mesh, measurement))
    reference = SensorForm.propose(tested)[0].reference
    heavy = ChannelErrors(sensor_mass=1.0, driver_mass=1.0, stinger=1e9)
    assert stds(heavy)["sensor_form", "mass"] == stds(heavy)["driver_form", "mass"] == LIGHT * reference


def test_a_driver_and_a_stinger_are_found_and_the_modulus_with_them(drawn):
    model, sensors, forces, _ = drawn
    (driver,) = DriverForm.propose(
        model.with_instruments(instruments_on(model.mesh, measured(model, sensors, forces)))
    )
    added = driver.with_values(mass=0.03, across=800.0)
    true = model.with_values({("frame", "E:steel"): 1.02 * 210e9}).with_effect(added)
    measurement = measured(true, sensors, forces)
    errors = ChannelErrors(driver_mass=0.02, stinger=1e3)
    found = []
    for own in (errors, replace(errors, driver_mass=0, stinger=0, sensor_mass=0)):
        problem, _ = formed_problem(model, replace(measurement, errors=own), (E,))
        found.append((problem, fit_given(problem)[1]))
    (problem, free), (_, without) = found
    truth = {("frame", "E:steel"): 1.02 * 210e9, (driver.name, "mass"): 0.03, (driver.name, "across"): 800.0}
    z = {ref: (free.values[ref] - value) / free.std[ref] for ref, value in truth.items()}
    assert max(map(abs, z.values())) < 1.5
    assert free.std[driver.name, "mass"] < 0.01
    assert free.log_evidence > without.log_evidence + 10


def test_a_heavy_driver_is_outside_the_usual_range(drawn):
    problem, _ = formed_problem(drawn[0], drawn[3])
    nominal = problem.nominal()
    (driver,) = problem.reduced.model.of_kind(DriverForm)
    heavy = {(driver.name, "mass"): 0.030}
    result = replace(nominal, values=nominal.values | heavy, std=dict.fromkeys(nominal.values, 0.001))
    (odd,) = departures(problem, result)
    assert (odd.parameter, odd.unit, odd.value) == ("mass", "kg", pytest.approx(0.030))
    assert (
        "excitation at member arm at 0.300 m: mass is 0.0300 ± 0.0010 kg more than stated"
        in departure_text(odd).replace("\u00a0", " ")
    )


def test_a_model_keeps_what_an_earlier_diagnosis_found(drawn):
    model, _, _, measurement = drawn
    effects, _ = form_of(model, measurement)
    known = replace(the("driver_form", effects), name="known driver", mass=0.01)
    again, varied = form_of(model.with_effect(known), measurement)
    assert not [e for e in again if e.kind == "driver_form"]
    assert {n.parameter for n in varied if n.effect == "known driver"} == {"mass", "across"}
