"""A study of a model that was built in Python."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import fem
from dovetail import Study, StudyError, load_study, pipeline
from dovetail.report import Album
from tests.frames import write_study
from updating import MeasurementError, Sensor, place_sensors

X, _, Z = np.eye(3)
STEEL = fem.Material("steel", E=210e9, rho=7850.0, nu=0.3)
SENSORS = (
    Sensor("P", 0.25 * Z, X),
    Sensor("K", 0.5 * Z, X),
    Sensor("T", [0.4, 0.0, 0.5], Z),
    Sensor("A", [0.2, 0.0, 0.5], Z),
)
TABLES = {
    "candidates": {"kinds": ["point_mass", "member_stiffness"]},
    "fit": {"held_out": ("K", "sensor P")},
    "uncertain": {"E": np.float64(0.02), "rho": 0.01},
}


def built():
    """Return the bent frame of tests/frames.py, built without a file."""
    mesh = fem.Mesh.from_lines(
        [[0, 0, 0], [0, 0, 0.5], [0.4, 0, 0.5]], [[0, 1], [1, 2]], {"post": [0], "arm": [1]}
    )
    mesh = place_sensors(mesh.split([6, 6]), SENSORS)
    part = fem.MemberProperties(STEEL, fem.Section.rectangle(0.03, 0.012, nu=0.3))
    frame = fem.Frame(members={"post": part, "arm": part})
    return fem.Model(mesh, (frame, fem.Support(name="foot", point=0)), fem.Damping.modal(0.01))


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    """Return the study of the same frame from a file, with measured FRFs that a mass is missing in."""
    return load_study(write_study(tmp_path_factory.mktemp("study"), mass=0.25))


@pytest.fixture(scope="module")
def study(read):
    (measured,) = read.measurements
    named = {s.name: s for s in SENSORS}
    ends = {key: tuple(named[s.name] for s in getattr(measured, key)) for key in ("sensors", "excitations")}
    return Study.from_model(built(), [replace(measured, **ends)], name="bent", **TABLES)


def test_the_study_of_a_model_is_that_of_its_file(study, read):
    assert study.nuisances == read.nuisances
    for key in ("kinds", "held_out", "held_out_sensors", "damping_std", "model_error", "relevant", "band"):
        assert getattr(study, key) == getattr(read, key), key
    np.testing.assert_allclose(study.solve_modes(6).frequency, read.solve_modes(6).frequency, rtol=1e-9)
    np.testing.assert_allclose(study.compare().by_sensor(), read.compare().by_sensor(), rtol=1e-6)


@pytest.fixture(scope="module")
def found(study):
    return study.diagnose(budget="quick")


def test_its_diagnosis_finds_what_that_of_the_file_does(study, read, found):
    expected = read.diagnose(budget="quick")
    assert found.verdict == expected.verdict == "effect"
    (one,), (other,) = found.findings, expected.findings
    assert one.effect.name == other.effect.name
    assert one.parameters[0].value == pytest.approx(other.parameters[0].value, rel=1e-4)
    fitted = study.add(*found.findings).fit()
    assert fitted.compare().total_db < 0.5 * study.compare().total_db


def test_a_study_without_a_file_says_how_it_is_kept(study, tmp_path):
    with pytest.raises(StudyError, match="built in Python has no study file to write; pickle the study, or"):
        study.save(tmp_path / "kept.toml")
    assert not list(tmp_path.iterdir())
    kept = pickle.loads(pickle.dumps(study))
    assert kept.error() == study.error()


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"uncertian": {}}, "bent, uncertian: unknown key; did you mean 'uncertain'"),
        ({"uncertain": {"e": 0.02}}, "bent, uncertain.e: unknown key; did you mean 'E'"),
        ({"fit": {"held_out": ["Q"]}}, "bent, fit.held_out: there is no excitation or sensor 'Q'"),
        ({"supports": []}, "bent, supports: unknown key; allowed are candidates, channel_errors, "),
    ],
)
def test_tables_are_read_as_those_of_a_study_file(tables, words):
    with pytest.raises(StudyError) as found:
        Study.from_model(built(), name="bent", sensors=SENSORS, **tables)
    assert str(found.value).startswith(words)


def test_a_sensor_at_no_point_of_the_mesh_is_refused():
    with pytest.raises(MeasurementError, match=r"sensor 'far' is 0\.4 m from the nearest point of the mesh"):
        Study.from_model(built(), sensors=[Sensor("far", [0.4, 0.4, 0.5], Z)])


def test_measured_frequencies_of_a_model_are_compared_and_planned_tests_mapped():
    exact = Study.from_model(built()).solve_modes(4).frequency
    study = Study.from_model(built(), modes={"frequency": 0.99 * exact[:4]})
    found = study.compare()
    np.testing.assert_allclose(found.computed / found.measured, 1 / 0.99, rtol=2e-5)  # of the reduced model
    plan = Study.from_model(
        built(), sensors=SENSORS, excitations=SENSORS[2:3], frequency={"stop": 400.0}, **TABLES | {"fit": {}}
    )
    assert sum(row.n for row in plan.plan(noise=0.01).rows) == 28


def test_a_run_of_a_model_writes_a_report_without_a_study_file(study, found, tmp_path, monkeypatch):
    monkeypatch.setattr("dovetail.report.pictures.draw_all", lambda result, folder, say: Album(folder))
    result = pipeline.analysed(study, found, tmp_path, 0.0)
    pipeline.write(result, tmp_path, lambda text, done: None)
    assert {p.name for p in tmp_path.iterdir()} == {"report.html", "result.json", "frf.npz"}
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "bent, a model built in Python" in html
    assert "The study file" not in html
    assert "found.toml" not in html
