"""Measured modes from a table: a row for each mode."""

import shutil

import numpy as np
import pytest

from dovetail import StudyError, load_study
from dovetail.file import read_mode_table
from dovetail.modes_pipeline import targets_of
from tests.studies import study_from

TABLE = """\
# modes of Friday's test
frequency [kHz]; zeta [%]; frequency_std [%]; U1z; U2z; far one
0,2; 1,5; 0,2; 1,0; 0,5; -0,25
0,1; ; 0,1; 3,0e-1-0,1j; ; 2
"""


def written(folder, text):
    (folder / "modes.csv").write_text(text, encoding="utf-8")
    return folder / "modes.csv"


def test_units_gaps_and_complex_cells_of_a_table_are_read_and_modes_rise(tmp_path):
    modes, std = read_mode_table(written(tmp_path, TABLE))
    np.testing.assert_allclose(modes.frequency, [100.0, 200.0])
    np.testing.assert_allclose(modes.zeta, [np.nan, 0.015])
    np.testing.assert_allclose(std["frequency_std"], [0.001, 0.002])
    assert modes.labels == ("U1z", "U2z", "far one")
    np.testing.assert_allclose(modes.shapes, [[0.3 - 0.1j, 1.0], [np.nan, 0.5], [2.0, -0.25]])


def test_a_study_reads_the_same_modes_from_a_table_as_from_an_archive(root, tmp_path):
    folder = shutil.copytree(root / "examples" / "four-storeys", tmp_path / "four")
    before = load_study(folder / "study.toml").modes
    rows = ["frequency [Hz], floor 1 x, floor 2 x, floor 3 x, floor 4 x, zeta [%]"]
    for f, psi in zip(before.modes.frequency, before.modes.shapes.T, strict=True):
        rows.append(", ".join([repr(float(f)), *(repr(float(v)) for v in psi), "0.7" if f < 1 else ""]))
    written(folder, "\n".join(rows))
    text = (folder / "study.toml").read_text(encoding="utf-8").replace("modes.npz", "modes.csv")
    after = study_from(folder, text).modes
    np.testing.assert_array_equal(after.modes.frequency, before.modes.frequency)
    np.testing.assert_array_equal(after.modes.shapes, before.modes.shapes)
    assert np.isnan(targets_of(after).zeta).tolist() == [False, True, True, True]


def test_frequencies_alone_need_no_channels(root, tmp_path):
    folder = shutil.copytree(root / "examples" / "three-storeys", tmp_path / "three")
    written(folder, "frequency\n20.961\n7.203\n30.435\n")
    text = (folder / "study.toml").read_text(encoding="utf-8")
    line = "frequency = [7.203, 20.961, 30.435]"
    assert line in text
    modes = study_from(folder, text.replace(line, 'file = "modes.csv"')).modes
    assert modes.modes.frequency.tolist() == [7.203, 20.961, 30.435]
    assert modes.modes.zeta is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("U1z,U2z\n1,2\n", "no column is called 'frequency'; the heading is U1z, U2z"),
        ("frequency,U1z,U1z\n1,2,3\n", "two columns are called 'U1z'"),
        ("frequency [km],U1z\n1,2\n", "has the unit 'km'; allowed are Hz, kHz, rad/s"),
        ("frequency,zeta [dB]\n1,2\n", "has the unit 'dB'; allowed are -, %"),
        ("frequency,U1z\n12.5,2\n,1\n", "row 3, frequency: '' is not allowed; a number is needed"),
        ("frequency,U1z\n12.5,two\n", "row 2, U1z: 'two' is not allowed; a number, or nothing where"),
        ("frequency,U1z\n-3,1\n", "the column 'frequency' has -3; numbers above 0 are needed"),
        ("frequency,U1z\n12.5,2\n13.5", "row 3: the file ends after 1 of 2 cells; it may be cut off"),
        ("frequency,U1z\n", "a heading and a row for each mode are needed"),
    ],
)
def test_tables_that_cannot_be_read_are_refused_with_their_place(tmp_path, text, words):
    with pytest.raises(StudyError) as caught:
        read_mode_table(written(tmp_path, text))
    assert words in str(caught.value)
