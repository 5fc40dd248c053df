"""Measured beside computed natural frequencies: values, marks and what is refused."""

import numpy as np
import pytest

from viz import deviations, draw, interactive, mac_map, staircase

MEASURED, STD = np.array([10.0, 20.0, 40.0]), np.array([1e-3, 2e-3, 1e-3])
COMPUTED = {"nominal": [11.0, 19.0, np.nan], "with <b>": [10.01, 20.0, 39.98]}
HELD_OUT = [False, False, True]
PERCENT = {"unit": "%", "ylabel": "error [%]", "names": ("of fitted modes", "of held-out modes"), "digits": 3}


def test_deviations_are_in_percent_with_two_deviations_of_the_measurement():
    figure = interactive.draw(deviations(MEASURED, STD, COMPUTED, HELD_OUT))
    by_series = {t.meta["series"]: t for t in figure.data if t.meta}
    assert by_series["measured"].error_y.array == pytest.approx([0.2, 0.4, 0.2])
    assert by_series["nominal"].y == pytest.approx([10.0, -5.0, np.nan], nan_ok=True)
    assert by_series["with <b>"].y == pytest.approx([0.1, 0.0, -0.05])
    assert by_series["with <b>"].name == "with &lt;b&gt;"
    shaded, _ = figure.layout.shapes
    assert shaded.x0 < 2 < shaded.x1
    assert figure.data[-1].name == "predicted, not fitted"


def test_the_still_picture_shows_the_same_values():
    (ax,) = draw(deviations(MEASURED, STD, COMPUTED, HELD_OUT)).axes
    drawn = {line.get_label(): line.get_ydata() for line in ax.lines}
    assert drawn["nominal"] == pytest.approx([10.0, -5.0, np.nan], nan_ok=True)
    assert drawn["with <b>"] == pytest.approx([0.1, 0.0, -0.05])
    assert [t.get_text() for t in ax.get_xticklabels()] == ["10", "20", "40"]
    assert len(ax.patches) == 1


def test_numbers_of_other_modes_are_refused():
    with pytest.raises(ValueError, match="2 frequencies for 3 measured modes"):
        deviations(MEASURED, STD, {"nominal": [1.0, 2.0]})
    with pytest.raises(ValueError, match=r"shape \(1, 2\) for 2 measured and 2 modes"):
        mac_map([[1.0, 0.0]], ["a", "b"], ["a", "b"])


def test_a_map_has_measured_shapes_as_rows():
    described = mac_map([[1.0, 0.2, 0.0], [0.1, 0.9, 0.3]], ["10", "20"], ["11", "21", "31"])
    (heat,) = interactive.draw(described).data
    assert heat.hovertext[1][2] == "measured 20, computed 31: 0.300"
    assert (heat.zmin, heat.zmax) == (0.0, 1.0)


def test_a_staircase_may_be_of_frequencies_in_percent():
    steps = [("nominal", 8.41, None), ("+ mass", 0.017, 0.031)]
    described = staircase(steps, 0.028, **PERCENT)
    figure = interactive.draw(described)
    assert [t.name for t in figure.data] == ["of fitted modes", "of held-out modes"]
    assert list(figure.data[0].text) == ["8.410", "0.017"]
    assert "0.028 %" in figure.layout.annotations[0].text
    (ax,) = draw(described).axes
    assert {"8.410", "0.017", "0.031", "noise floor 0.028 %"} == {t.get_text() for t in ax.texts} - {""}
