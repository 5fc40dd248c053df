"""Warnings of measured modes whose units, deviations or rows look wrong."""

import numpy as np
import pytest

from dovetail import load_study, main
from fem.io import write_npz
from tests.frames import MAST
from tests.studies import study_file, study_from
from updating import sensor_rows

SENSORS = "".join(
    f'\n[[sensors]]\nname = "{d}{k}"\npoint = [0.0, 0.0, {0.25 * k}]\ndirection = "{d}"\n'
    for d in "xy"
    for k in (1, 2, 3, 4)
)
NOMINAL = np.array([8.36, 25.05, 52.35, 146.4])


def warned(folder, text):
    return study_from(folder, MAST + text).warnings


def listed(frequency, more=""):
    return f"[modes]\nfrequency = {np.asarray(frequency).tolist()}\n{more}\n"


@pytest.mark.parametrize(
    ("factor", "unit"), [(1e-3, "kHz"), (2 * np.pi, "rad/s"), (60.0, "rpm"), (1.0, ""), (1.4, ""), (0.8, "")]
)
def test_frequencies_in_another_unit_are_named(tmp_path, factor, unit):
    found = warned(tmp_path, listed(1.05 * factor * NOMINAL))
    said = [text for text in found if "torsional or axial" not in text]
    assert [f"either they are in {unit}," in text for text in said] == ([True] if unit else [])


@pytest.mark.parametrize("unit", ["kHz", "rad/s", "rpm"])
def test_frequencies_in_hz_below_a_heading_of_another_unit_are_named(tmp_path, unit):
    values = "\n".join(map(str, 1.05 * NOMINAL))
    (tmp_path / "m.csv").write_text(f"frequency [{unit}]\n{values}\n", encoding="utf-8")
    found = warned(tmp_path, '[modes]\nfile = "m.csv"\n')
    assert [t for t in found if f"converted from {unit} and were in Hz already" in t]


def test_a_unit_is_known_by_shapes_where_the_test_missed_modes(tmp_path):
    study = MAST + SENSORS
    (tmp_path / "plain.toml").write_text(study, encoding="utf-8")
    plain = load_study(tmp_path / "plain.toml", ("sensors",))
    modes, rows = plain.solve_modes(8), sensor_rows(plain.model, plain.sensors)
    kept = [2, 4, 5]
    shapes, labels = rows @ modes.shapes[:, kept], [s.name for s in plain.sensors]
    for factor, n in ((2 * np.pi, 1), (1.0, 0)):
        write_npz(tmp_path / "m.npz", type(modes)(factor * modes.frequency[kept], shapes, None, labels))
        found = warned(tmp_path, SENSORS + '[modes]\nfile = "m.npz"\n')
        assert len([t for t in found if "either they are in rad/s" in t]) == n


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("zeta = [0.6, 0.8, 0.5, 1.1]", "the damping ratios are 0.5 to 1.1; are they in percent?"),
        ("zeta = [0.006, 0.008, 0.005, 0.3]", ""),
        ("frequency_std = 2.0", "is it in percent or Hz?"),
        ("frequency_std = 0.1", ""),
    ],
)
def test_ratios_and_deviations_that_look_like_percent_are_named(tmp_path, more, words):
    found = warned(tmp_path, listed(NOMINAL, more))
    assert [words in text for text in found] == ([True] if words else [])


def test_a_mode_that_is_given_twice_is_named(tmp_path):
    (text,) = warned(tmp_path, listed([8.36, 25.05, 25.05, 52.35]))
    assert "modes 2 and 3 have the same frequency, 25.05 Hz; is one given twice?" in text


def test_two_modes_of_one_frequency_and_two_shapes_are_none_twice(tmp_path):
    table = "frequency,x2,x4,y2,y4\n8.4,0.3,1,0,0\n8.4,0,0,0.3,1\n8.4,0,0,0.3,1\n"
    (tmp_path / "m.csv").write_text(table, encoding="utf-8")
    found = warned(tmp_path, SENSORS + '[modes]\nfile = "m.csv"\n')
    assert [t for t in found if "given twice" in t] == [
        "m.csv: the modes 2 and 3 have the same frequency, 8.4 Hz, and the same shape; is one given twice?"
    ]


def test_columns_without_a_sensor_and_sensors_without_a_column_are_printed(tmp_path, capsys):
    (tmp_path / "m.csv").write_text("frequency,x1,X2,x3,x4\n8.4,0.1,0.3,0.6,1\n", encoding="utf-8")
    along_x = SENSORS.split('\n[[sensors]]\nname = "y1"')[0]
    study_file(tmp_path, MAST + along_x + '\n[modes]\nfile = "m.csv"\n')
    assert main(["compare", str(tmp_path / "study.toml")]) == 0
    out = capsys.readouterr().out
    assert "note: m.csv: the rows X2 of the shapes belong to no sensor and are not used" in out
    assert "note: m.csv: its shapes have no row of the sensors x2" in out


def test_modes_without_any_partner_have_no_error(tmp_path, capsys):
    (tmp_path / "m.csv").write_text("frequency,x1,x2,x3\n8.4,1,-1,1\n", encoding="utf-8")
    study_file(tmp_path, MAST + SENSORS + '[modes]\nfile = "m.csv"\n')
    assert main(["compare", str(tmp_path / "study.toml")]) == 0
    out = capsys.readouterr().out
    assert "no measured mode has a partner in the model; standard deviation" in out
    assert "nan" not in out


def test_frequencies_that_may_be_torsional_or_axial_are_warned_of(tmp_path):
    """The fourth in the weak plane lies above seven modes of the model."""
    weak = [8.36, 52.35, 146.6, 287.2]
    assert any("torsional or axial" in text for text in warned(tmp_path, listed(weak)))
    for more in ('plane = "x"', "numbers = [1, 3, 4, 6]"):
        assert not any("torsional or axial" in text for text in warned(tmp_path, listed(weak, more)))
    assert not any("torsional or axial" in text for text in warned(tmp_path, SENSORS + listed(weak)))
