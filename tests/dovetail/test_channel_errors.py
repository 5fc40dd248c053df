"""``[channel_errors]``: how well a study describes its channels, and errors that an earlier fit has found."""

import numpy as np
import pytest

from dovetail import StudyError, load_study
from dovetail.pipeline import formed_fit_problem
from tests.frames import write_study
from updating.measurement import USUAL


def with_table(folder, text):
    """Return a study's file with a table of channel errors, and the study without."""
    study = write_study(folder)
    plain = load_study(study)
    study.write_text(study.read_text(encoding="utf-8") + "\n" + text, encoding="utf-8")
    return study, plain


def test_nothing_said_stands_for_the_usual_test(tmp_path):
    errors = load_study(write_study(tmp_path)).measurements[0].errors
    assert errors == USUAL


def test_tolerances_are_read_in_degrees_and_metres(tmp_path):
    file, _ = with_table(tmp_path, "[channel_errors]\ngain = 0.01\ndirection = 5.0\nposition = 0\n")
    std = load_study(file).measurements[0].errors.std
    np.testing.assert_allclose(std, [0.01, np.radians(5), np.radians(5), 0.0, 0.0])


def test_known_errors_move_the_nominal_model(tmp_path):
    file, plain = with_table(tmp_path, "")
    (name, *_) = (s.name for s in plain.measurements[0].sensors if s.name not in plain.held_out_sensors)
    text = f'[channel_errors]\nsensors = {{ "{name}" = [0.2, 0.0, 0.0, 0.0, 0.0] }}\n'
    file.write_text(file.read_text(encoding="utf-8") + text, encoding="utf-8")
    ratios = []
    for study in (plain, load_study(file)):
        problem = formed_fit_problem(study)
        ratios.append(problem.receptance(problem.nominal()))
    np.testing.assert_allclose(ratios[1][:, 0], 1.2 * ratios[0][:, 0], rtol=1e-9)
    np.testing.assert_allclose(ratios[1][:, 1:], ratios[0][:, 1:], rtol=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gain = -0.1", "at least 0"),
        ("direction = '2 deg'", r"a number of at least 0 \[°\] is needed"),
        ("gian = 0.1", "did you mean 'gain'"),
        ("sensors = { nobody = [0, 0, 0, 0, 0] }", "there is no such channel"),
        ("excitations = 3", r"a table, \[excitations\], is needed"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, words):
    file, _ = with_table(tmp_path, f"[channel_errors]\n{text}\n")
    with pytest.raises(StudyError, match=words):
        load_study(file)


def test_five_numbers_are_needed(tmp_path):
    file, plain = with_table(tmp_path, "")
    name = plain.measurements[0].excitations[0].name
    text = f'[channel_errors]\nexcitations = {{ "{name}" = [0.1] }}\n'
    file.write_text(file.read_text(encoding="utf-8") + text, encoding="utf-8")
    with pytest.raises(StudyError, match="5 numbers"):
        load_study(file)
