"""Sensors that have a mass and a gain: both act in the model, once."""

import numpy as np
import pytest

import fem
from dovetail import load_study
from tests.frames import FLAT_STEEL
from updating import (
    Measurement,
    MeasurementError,
    Sensor,
    build_problem,
    sensor_rows,
    update,
    with_sensor_masses,
)
from updating.inference import sensor_vectors, with_higher_mass

BEAM = f"""
[points]
root = [0.0, 0.0, 0.0]
tip = [0.5, 0.0, 0.0]

[members.beam]
from = "root"
to = "tip"
{FLAT_STEEL}
[[supports]]
point = "root"

[damping]
modal = 0.01

[frequency]
stop = 400.0
"""


def beam():
    mesh = fem.Mesh.from_lines([[0, 0, 0], [0.5, 0, 0]], [[0, 1]], {"beam": [0]}).split(10)
    part = fem.MemberProperties(fem.Material("steel", 210e9, 7850.0), fem.Section.rectangle(0.03, 0.01))
    effects = (fem.Frame(members={"beam": part}), fem.Support(name="root", point=0))
    return fem.Model(mesh, effects, fem.Damping(loss_factor=0.02))


def first(model):
    return fem.solve_modes(fem.assemble(model), n=2).frequency[0]


def test_a_mass_is_added_once_whatever_it_measures():
    model = beam()
    tip = model.mesh.nearest_point([0.5, 0, 0])[0]
    z = Sensor("tip z", np.array([0.5, 0, 0]), np.array([0, 0, 1.0]), mass=0.03)
    y = Sensor("tip y", np.array([0.5, 0, 0]), np.array([0, 1.0, 0]))
    loaded = with_sensor_masses(model, (z, y, z))
    by_hand = model.with_effect(fem.AddedMass(name="accelerometer", point=tip, mass=0.03))
    assert first(loaded) == first(by_hand) < first(model)
    assert with_sensor_masses(loaded, (z, y)) is loaded
    assert with_sensor_masses(model, (y,)) is model


@pytest.mark.parametrize("mass", [-0.01, np.nan, np.inf])
def test_a_mass_that_cannot_be_is_refused(mass):
    s = Sensor("a", np.array([0.5, 0, 0]), np.array([0, 0, 1.0]), mass=mass)
    with pytest.raises(MeasurementError, match=r"'a' has the mass .* finite and not negative"):
        with_sensor_masses(beam(), (s,))


def test_a_sensor_far_from_the_mesh_is_refused():
    s = Sensor("a", np.array([0.5, 0.3, 0]), np.array([0, 0, 1.0]), mass=0.01)
    with pytest.raises(MeasurementError, match=r"'a' is 0.3 m from the nearest point"):
        with_sensor_masses(beam(), (s,))


def test_a_sensor_stays_on_its_own_member():
    """Two members side by side have points at one place; the reading is that of the member's own."""
    points = [[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0]]
    mesh = fem.Mesh.from_lines(points, [[0, 1], [2, 3]], {"a": [0], "b": [1]})
    model = fem.Model(mesh, ())
    for member, point in (("a", 1), ("b", 2)):
        s = Sensor("s", np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), member)
        for rows in (sensor_vectors(model, (s,)).T, sensor_rows(model, (s,))):
            assert np.flatnonzero(rows[0]).tolist() == [6 * point + 2]


def measurement(model, sensors, lines):
    rows = sensor_vectors(model, sensors).T
    H = fem.compute_frf(fem.assemble(with_sensor_masses(model, sensors)), lines, rows, rows[:1]).H
    names = [s.name for s in sensors]
    return Measurement(
        fem.FRF.from_arrays(lines, H, "accelerance", names, names[:1]), tuple(sensors), tuple(sensors[:1])
    )


def test_masses_and_gains_act_in_updating_and_diagnosis():
    """The masses are 8 % of the beam's: without them the modulus would come out far off.

    Structural damping is the same on the reduced basis as on the mesh, so that nothing else differs.
    """
    model = with_higher_mass(beam())
    at = [np.array([x, 0, 0]) for x in (0.5, 0.25)]
    z = np.array([0, 0, 1.0])
    sensors = (Sensor("tip", at[0], z, mass=0.06), Sensor("middle", at[1], -z, gain=1.3, mass=0.03))
    lines = np.arange(5.0, 400.0, 1.0)
    measured = measurement(model, sensors, lines)
    wrong = model.with_values({("frame", "E:steel"): 200e9})
    found = update(wrong, [("frame", "E:steel")], frf=measured, noise=0.01, model_error=0, damping_std=0.0)
    assert found["frame E:steel"].value == pytest.approx(210e9, rel=1e-4)
    problem = build_problem(model, measured, ())
    assert np.nanmax(np.abs(problem.log_ratio(problem.nominal()))) < 1e-3


def test_a_study_says_mass_and_gain(tmp_path):
    path = tmp_path / "study.toml"
    sensor = '\n[[sensors]]\npoint = "tip"\ndirections = "xyz"\nmass = 0.06\ngain = 1.02\n'
    path.write_text(BEAM + sensor, encoding="utf-8")
    study = load_study(path)
    masses = study.model.of_kind(fem.AddedMass)
    assert [m.mass for m in masses] == [0.06]  # one body with three channels
    assert [s.gain for s in study.sensors] == [1.02] * 3
    assert np.abs(sensor_rows(study.model, study.sensors)).max() == 1.02
    path.write_text(BEAM + sensor.replace("1.02", "-1"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"gain: -1 is not allowed; a positive number"):
        load_study(path)
