"""Data that are read with and without doubtful faults of the measurement."""

from dataclasses import replace

import numpy as np
import pytest

from dovetail import load_study
from dovetail.file import without_held_out
from dovetail.file.contents import measured
from dovetail.report import label_of
from tests.frames import write_study
from updating import EFFECT, FAULT, Fault, diagnose
from updating.diagnosis import begin
from updating.diagnosis.evidence import as_read, doubtful, log_prior
from updating.inference import EFFECT_ODDS, FitData
from updating.inference.fitting import refit
from updating.quality import corrected

GAIN = Fault("sensor_gain", "K", 1.3, 0.013, span=6.0)
SIGN = Fault("sensor_sign", "T", -1.0, 0.0)


def asked(folder, mass, gain=1.0):
    """Return a study, and its measurement with the gain of one sensor."""
    study = load_study(write_study(folder, mass))
    (measurement,) = (without_held_out(study, m) for m in measured(study))
    H = np.array(measurement.frf.H)
    H[:, measurement.frf.outputs.index("K")] *= gain
    return study, measurement.with_frf(replace(measurement.frf, H=H))


def diagnosed(study, measurement, monkeypatch, fault=GAIN):
    """Return a diagnosis where a rule believes in a fault of one sensor, whatever the data say."""

    def find(problem, null):
        right = replace(problem, data=corrected(problem.data, [fault]))
        return right, right.assessed(refit(right, null)), (fault,)

    monkeypatch.setattr(begin, "find_faults", find)
    return diagnose(
        study.model,
        [measurement],
        study.nuisances,
        damping_std=study.damping_std,
        kinds=["point_mass", "member_stiffness"],
        model_error=0.1,
    )


@pytest.mark.slow
def test_an_effect_that_a_rule_has_taken_for_a_fault_is_found(tmp_path, monkeypatch):
    found = diagnosed(*asked(tmp_path, 0.25), monkeypatch)
    assert found.verdict == EFFECT
    (finding,) = found.findings
    assert finding.effect.kind == "point_mass"
    assert found.faults == ()
    (check,) = (c for c in found.gates.checks if c.name == "sensors and forces")
    assert "the apparent fault of K is explained by the effects" in check.found
    (other,) = found.searched.otherwise
    assert other.faults == (GAIN,)
    assert sum(p for _, p in found.posterior) == pytest.approx(1.0, abs=1e-9)
    with_fault = [p for names, p in found.posterior if "sensor_gain:K" in names]
    assert len(with_fault) == len(other.search.known)
    assert sum(with_fault) < 1e-3
    assert label_of(found, ["sensor_gain:K"]) == "K: wrong gain"


def test_a_fault_stays_one_where_no_effect_does_the_same(tmp_path, monkeypatch):
    found = diagnosed(*asked(tmp_path, 0.0, gain=1.3), monkeypatch)
    assert found.verdict == FAULT
    (fault,) = found.faults
    assert (fault.kind, fault.sensor) == ("sensor_gain", "K")
    (other,) = found.searched.otherwise
    assert other.faults == ()
    assert set(other.search.known) == {frozenset()}  # no effect in its place could be as probable


def test_a_fault_that_the_data_do_not_have_is_withdrawn_at_the_end(tmp_path, monkeypatch):
    """A damper at a driven point resembles a delay, so that the data are read in both ways."""
    delay = Fault("sensor_delay", "K", 2e-5, 1e-6, "s", span=4e-3)
    found = diagnosed(*asked(tmp_path, 0.25), monkeypatch, delay)
    assert len(found.searched.otherwise) == 1
    assert found.verdict == EFFECT
    assert found.faults == ()


def test_only_doubtful_faults_are_left_in_the_data(tmp_path):
    _, measurement = asked(tmp_path, 0.0)
    shape = measurement.frf.H.shape
    data = FitData(
        measurement,
        measurement.frf.frequency,
        measurement.frf.H,
        np.ones(shape, dtype=bool),
        np.ones(shape),
        np.full(shape, 0.02),
        np.zeros(shape[0], dtype=bool),
    )
    faults = (GAIN, SIGN)
    assert doubtful(faults) == (GAIN,)
    right = replace(corrected(data, faults), noise=np.full(shape, 0.01))
    read = as_read(data, right, [SIGN])
    gain, sign = (measurement.frf.outputs.index(f.sensor) for f in faults)
    np.testing.assert_array_equal(read.H[:, gain], data.H[:, gain])
    np.testing.assert_array_equal(read.H[:, sign], -data.H[:, sign])
    np.testing.assert_array_equal(read.noise, right.noise)
    # Against one change of six at one of the sensors. Its value is known to 1 % of a range of 6 nepers, and
    # any value within the tolerance of 3 % does as well.
    n_log = np.log(6 * len(measurement.sensors))
    occam = np.log(np.sqrt(2 * np.pi) * np.hypot(0.01, measurement.errors.gain) / 6)
    assert log_prior([GAIN], data) == pytest.approx(occam - EFFECT_ODDS - n_log)
    assert log_prior(faults, data) == pytest.approx(occam - 2 * EFFECT_ODDS - 2 * n_log)
