"""A roving accelerometer loads the structure at one place after another, and each response knows its own."""

from dataclasses import replace

import numpy as np
import pytest

import fem
from dovetail import StudyError, load_study
from tests.updating.test_sensor_masses import BEAM, beam
from updating import Measurement, Nuisance, Sensor, build_problem, computed_frf, update
from updating.inference import discretisation_error, sensor_vectors, with_higher_mass
from updating.measurement import instruments_on

LINES = np.arange(5.0, 400.0, 2.0)
PLACES = (0.1, 0.2, 0.3, 0.4, 0.5)
MASS = 0.06
"""8 % of the beam's [kg]."""


def sensor(name, x, **more):
    return Sensor(name, np.array([x, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), **more)


def roving_test(model):
    """Return FRFs of an accelerometer at one place at a time, and of a fixed sensor at the force."""
    fixed = sensor("fixed", 0.25)
    moved = [sensor(f"a{k}", x, mass=MASS, roving=True) for k, x in enumerate(PLACES)]
    force = sensor_vectors(model, (fixed,)).T
    H = [fem.compute_frf(fem.assemble(model), LINES, force, force).H]
    for s in moved:
        point = model.mesh.nearest_point(s.point)[0]
        loaded = model.with_effect(fem.AddedMass(name="accelerometer", point=point, mass=MASS))
        row = sensor_vectors(model, (s,)).T
        H.append(fem.compute_frf(fem.assemble(loaded), LINES, row, force).H)
    names = [fixed.name, *(s.name for s in moved)]
    frf = fem.FRF.from_arrays(LINES, np.concatenate(H, axis=1), "accelerance", names, ["fixed"])
    return Measurement(frf, (fixed, *moved), (fixed,))


@pytest.fixture(scope="module")
def model():
    return with_higher_mass(replace(beam(), mesh=beam().mesh.split(2)))


@pytest.fixture(scope="module")
def problem(model):
    return build_problem(model, roving_test(model), ())


def test_each_response_has_the_mass_at_its_own_place(problem):
    nominal = problem.nominal()
    assert np.nanmax(np.abs(problem.log_ratio(nominal))) < 2e-3
    free = problem.unloaded(nominal)
    assert not free.data.measurement.roving_masses
    assert np.nanmax(np.abs(free.log_ratio(nominal))) < 2e-3
    assert np.nanmax(np.abs(np.log(np.abs(free.data.H / problem.data.H)))) > 0.5
    np.testing.assert_allclose(free.data.H[:, 0], problem.data.H[:, 0], rtol=1e-12)


def test_computed_frfs_are_those_of_the_loaded_structures(model):
    m = roving_test(model)
    computed = computed_frf(model, m.sensors, m.excitations, LINES, m.frf.kind)
    size = np.abs(m.frf.H).max()
    np.testing.assert_allclose(computed.H, m.frf.H, rtol=0, atol=2e-5 * size)  # twice compute_frf's tolerance


def test_the_modulus_is_found_with_the_masses_and_missed_without(model):
    measured = roving_test(model)
    wrong = model.with_values({("frame", "E:steel"): 200e9})
    how = {"noise": 0.01, "model_error": 0, "damping_std": 0.0}
    found = update(wrong, [("frame", "E:steel")], frf=measured, **how)
    assert found["frame E:steel"].value == pytest.approx(210e9, rel=2e-4)
    light = replace(measured, sensors=tuple(replace(s, mass=0.0) for s in measured.sensors))
    missed = update(wrong, [("frame", "E:steel")], frf=light, **how)["frame E:steel"].value
    assert abs(missed / 210e9 - 1) > 0.01


def test_derivatives_are_those_of_the_loaded_responses(model):
    p = build_problem(model, roving_test(model), (Nuisance("frame", "E:steel", 0.05),))
    function = p.function((), (), np.arange(0, len(p.data.frequency), 20))
    x = function.start + 0.01
    _, J = function(x, True)
    for k in range(len(x)):
        h = np.zeros(len(x))
        h[k] = 1e-5
        slope = (function(x + h, False)[0] - function(x - h, False)[0]) / 2e-5
        np.testing.assert_allclose(J[k], slope, atol=2e-3 * np.abs(J).max())


def test_a_roving_sensor_is_not_everywhere_at_once(model, problem):
    assert len(instruments_on(model.mesh, problem.data.measurement).sensors) == 1
    assert discretisation_error(problem)[0] < 0.5


def test_a_study_says_that_a_sensor_roves(tmp_path):
    path = tmp_path / "study.toml"
    table = '\n[[sensors]]\npoint = "tip"\ndirections = "xz"\nmass = 0.06\nroving = true\n'
    path.write_text(BEAM + table, encoding="utf-8")
    study = load_study(path)
    assert [(s.roving, s.mass) for s in study.sensors] == [(True, 0.06), (True, 0.0)]
    assert not study.model.of_kind(fem.AddedMass)
    path.write_text('sensors = "s.csv"\n' + BEAM, encoding="utf-8")
    (tmp_path / "s.csv").write_text("name,point,direction,mass,roving\nA,tip,z,0.06,yes\n", encoding="utf-8")
    assert [(s.roving, s.mass) for s in load_study(path).sensors] == [(True, 0.06)]
    path.write_text(BEAM + table.replace("mass = 0.06\n", ""), encoding="utf-8")
    with pytest.raises(StudyError, match=r"roving: a roving sensor acts by its mass; give mass"):
        load_study(path)
