"""Resonances in measured FRFs that no mode of the model has."""

import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hidden.cases import make_case
from fem import FRF, assemble, first_modes
from updating import build_problem, sensor_rows
from updating.diagnosis.foreign_modes import ForeignMode, foreign_modes, note_of
from updating.diagnosis.frf_modes import identified_in
from updating.measurement.held_out import band_of

ZETA, BAND = 0.004, (20.0, 500.0)


@pytest.fixture(scope="module")
def lap():
    """A case with nothing hidden, and its modes."""
    case = make_case(5)
    return case, first_modes(assemble(case.model), 12)


def with_resonance(case, modes, frequency):
    """Return the case with a resonance of a fixture that moves the structure as its first mode does."""
    frf, m = case.measurement.frf, case.measurement
    shape = modes.shapes[:, [modes.n_rigid]]
    rows, columns = (sensor_rows(case.model, some) @ shape for some in (m.sensors, m.excitations))
    w, w0 = 2 * np.pi * frf.frequency, 2 * np.pi * frequency
    resonance = -(w**2) / (w0**2 - w**2 + 2j * ZETA * w * w0)
    H = frf.H + 0.5 * resonance[:, None, None] * (rows @ columns.T)
    other = FRF.from_arrays(frf.frequency, H, frf.kind, frf.outputs, frf.inputs)
    return replace(case, measurement=m.with_frf(other))


def found_in(problem, modes):
    return foreign_modes(problem, modes, identified_in(problem))


def test_a_resonance_of_a_fixture_is_found_with_its_band(lap):
    case, modes = lap
    f = modes.frequency[modes.n_rigid :]
    between = float(np.sqrt(f[1] * f[2]))
    case = with_resonance(case, modes, between)
    problem = build_problem(case.model, case.measurement, case.nuisances, band=BAND)
    (found,) = found_in(problem, modes)
    assert found.frequency == pytest.approx(between, rel=2e-3)
    assert found.low < between < found.high
    assert found.high - found.low == pytest.approx(12 * ZETA * between, rel=0.3)
    assert f"{found.frequency:.0f} Hz: no mode of the model" in note_of([found])
    known = replace(problem.data.measurement, held_out=((found.low, found.high),))
    assert not found_in(replace(problem, data=replace(problem.data, measurement=known)), modes)


def test_a_test_of_the_structure_alone_has_no_foreign_resonance(lap):
    case, modes = lap
    problem = build_problem(case.model, case.measurement, case.nuisances, band=BAND)
    assert not found_in(problem, modes)


@pytest.mark.parametrize(
    ("mode", "text"),
    [
        (ForeignMode(0.4013, 0.3772, 0.4254), '0.401 Hz: .*"band 0.377-0.425 Hz"'),
        (ForeignMode(40.02, 1.0, 88.04), '40 Hz: .*"band 1-88 Hz"'),
        (ForeignMode(1234.4, 1204.77, 1264.03), '1234 Hz: .*"band 1205-1264 Hz"'),
    ],
)
def test_the_note_gives_bands_that_can_be_held_out(mode, text):
    note = note_of([mode])
    assert re.match(text, note)
    band = band_of(note.split('"')[1])
    assert band is not None
    low, high = band
    assert 0 < low < mode.frequency < high


def test_a_broad_resonance_begins_at_the_first_line(lap, monkeypatch):
    case, modes = lap
    f = modes.frequency[modes.n_rigid :]
    between = float(np.sqrt(f[1] * f[2]))
    case = with_resonance(case, modes, between)
    problem = build_problem(case.model, case.measurement, case.nuisances, band=BAND)
    monkeypatch.setattr("updating.diagnosis.foreign_modes.HALF_POWER_WIDTHS", 1e3)
    (found,) = found_in(problem, modes)
    assert found.low == problem.measured.frequency[0]


def test_ratios_to_a_reference_sensor_have_no_foreign_resonance(lap, monkeypatch):
    case, modes = lap
    f = modes.frequency[modes.n_rigid :]
    case = with_resonance(case, modes, float(np.sqrt(f[1] * f[2])))
    problem = build_problem(case.model, case.measurement, case.nuisances, band=BAND)
    monkeypatch.setattr(type(case.measurement), "has_structure_poles", False)
    assert not found_in(problem, modes)
