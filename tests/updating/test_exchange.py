"""Tables of channels and labelled arrays go to other packages and come back."""

import numpy as np
import pytest

from fem import FRF, Modes
from tests.noise import complex_normal
from updating import (
    MeasurementError,
    Sensor,
    frf_from_labelled,
    labelled_from_frf,
    labelled_from_modes,
    modes_from_labelled,
    sensors_from_table,
    table_from_sensors,
)


class Columns:
    """What a DataFrame does for us: iterate over names of columns, and give one by name."""

    def __init__(self, columns):
        self._columns = columns

    def __iter__(self):
        return iter(self._columns)

    def __getitem__(self, name):
        return np.array(self._columns[name], dtype=object)


SENSORS = {
    "Name": ["A", "B"],
    "Description": ["lid", "foot"],
    "Position_1": [100, 0],
    "Position_2": [0, 50],
    "Position_3": [20.0, 0],
    # the second sensor is turned by a right angle about x, then by one about the fixed z
    "Orientation_1": [0, 90],
    "Orientation_2": [0, 0],
    "Orientation_3": [0, 90],
}


@pytest.mark.parametrize("form", [dict, Columns])
def test_triaxial_sensors_become_channels(form):
    found = sensors_from_table(form(SENSORS), scale=1e-3)
    assert [s.name for s in found] == ["Ax", "Ay", "Az", "Bx", "By", "Bz"]
    np.testing.assert_allclose(found[2].point, [0.1, 0, 0.02])
    # x stays by the first turn and goes to y by the second; y goes to z and stays; z goes to -y, then to x
    np.testing.assert_allclose(
        [s.direction for s in found[3:]], [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-15
    )


def test_channels_of_triaxial_sensors_are_those_of_pyfbs():
    """Numbers that ``pyfbs.utility.generate_channels_from_sensors`` of pyFBS 1.0.7 gives for these angles."""
    angles = [[10.0, 20.0, 30.0], [-135.0, 45.0, 0.0]]
    expected = [
        [0.8137976813493736, 0.4698463103929541, -0.34202014332566866],
        [-0.44096961052988237, 0.8825641192593854, 0.1631759111665348],
        [0.37852230636979245, 0.018028311236297265, 0.9254165783983233],
        [0.7071067811865475, 0.0, -0.7071067811865476],
        [-0.5, -0.7071067811865475, -0.5],
        [-0.5, 0.7071067811865477, -0.5],
    ]
    table = {"Name": ["A", "B"], **{f"Position_{i}": [0.0, 0.0] for i in (1, 2, 3)}}
    table |= {f"Orientation_{i + 1}": [a[i] for a in angles] for i in range(3)}
    found = np.array([s.direction for s in sensors_from_table(table)])
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_channels_come_back():
    oblique = np.array([1.0, 2.0, -2.0]) / 3
    point = np.array([0.1, 0.2, 0.3])
    given = (
        Sensor("a", point, np.array([0, 0, -1.0])),
        Sensor("b", point, oblique),
        Sensor("c", 2 * point, oblique),
    )
    table = table_from_sensors(given, "Force", scale=1e-3)
    assert table["Grouping"] == [1, 1, 2]
    assert table["Quantity"] == ["Force"] * 3
    for s, back in zip(given, sensors_from_table(table, scale=1e-3), strict=True):
        assert s.name == back.name
        np.testing.assert_allclose(back.point, s.point, rtol=1e-15)
        np.testing.assert_allclose(back.direction, s.direction, rtol=1e-15)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"Position_2": None}, "no column Position_2"),
        ({"Orientation_1": [0, float("nan")]}, "'B' is turned by"),
        ({"Orientation_1": None}, "no column Direction_1, Direction_2, Direction_3"),
        ({"Direction_1": [0, 0], "Direction_2": [0, 0], "Direction_3": [0, 0]}, "'A' is at"),
        ({key: [] for key in SENSORS}, "has no rows"),
        ({"Name": ["A", "A"]}, "two channels named 'Ax'"),
        ({"Position_1": [1, "far"]}, "must be numbers"),
        ({"Position_1": [1]}, "must be numbers"),
        ({"Position_1": [1, float("nan")]}, "finite numbers"),
    ],
)
def test_tables_that_do_not_fit(change, words):
    table = {k: v for k, v in (SENSORS | change).items() if v is not None}
    with pytest.raises(MeasurementError, match=words):
        sensors_from_table(table)


def frf():
    rng = np.random.default_rng(1)
    H = complex_normal(rng, (5, 3, 2))
    return FRF.from_arrays(np.arange(1.0, 6), H, "mobility", ("1X+", "101Z-", "7RY+"), ("101Z-", "2S"))


@pytest.mark.parametrize("written", [True, False])
def test_labelled_frfs_come_back_in_any_arrangement(written):
    given = frf()
    f, ordinate, coordinate = labelled_from_frf(given)
    assert ordinate.shape == (3, 2, 5)
    assert coordinate[1, 0].tolist() == [(101, -3), (101, -3)]
    if written:
        coordinate = np.array(
            [
                [["1X+", "101Z-"], ["1X+", "2S"]],
                [["101Z-", "101Z-"], ["101Z-", "2S"]],
                [["7RY+", "101Z-"], ["7RY+", "2S"]],
            ]
        )
    back = frf_from_labelled(f, ordinate, coordinate, "mobility")
    assert (back.outputs, back.inputs, back.kind) == (given.outputs, given.inputs, given.kind)
    np.testing.assert_array_equal(back.H, given.H)
    order = [4, 1, 0, 5, 3, 2]
    flat = frf_from_labelled(
        np.tile(f, (6, 1)), ordinate.reshape(6, 5)[order], coordinate.reshape(6, 2)[order], "mobility"
    )
    np.testing.assert_array_equal(flat.select(given.outputs, given.inputs).H, given.H)


def test_labelled_functions_that_make_no_matrix():
    f, ordinate, coordinate = labelled_from_frf(frf())
    with pytest.raises(MeasurementError, match=r"need 6 functions; 7RY\+/2S are missing"):
        frf_from_labelled(f, ordinate.reshape(6, 5)[:5], coordinate.reshape(6, 2)[:5])
    with pytest.raises(MeasurementError, match="comes twice"):
        frf_from_labelled(f, ordinate[[0, 0]], coordinate[[0, 0]])
    with pytest.raises(MeasurementError, match="have shape"):
        frf_from_labelled(f[:-1], ordinate, coordinate)
    with pytest.raises(MeasurementError, match="different frequencies"):
        frf_from_labelled(f * np.ones((3, 2, 1)) * [[[1], [1]], [[1], [2]], [[1], [1]]], ordinate, coordinate)
    with pytest.raises(MeasurementError, match="'lid' is not the label"):
        frf_from_labelled(f, ordinate[0], [["lid", "1X+"], ["1X+", "1X+"]])
    named = FRF.from_arrays(f, ordinate[:1, :1].transpose(2, 0, 1), "mobility", ("U1z",), ("1X+",))
    with pytest.raises(MeasurementError, match="name its degree of freedom in dofs"):
        labelled_from_frf(named)
    assert labelled_from_frf(named, {"U1z": "12Z+"})[2][0, 0, 0].item() == (12, 3)


def test_labelled_shapes_come_back():
    modes = Modes(
        np.array([3.0, 7.0]),
        np.array([[1.0, 2], [3, 4], [5, 6j]]),
        np.array([0.1, 0.2]),
        ("1X+", "2Y-", "3Z+"),
    )
    f, shapes, coordinate = labelled_from_modes(modes)
    back = modes_from_labelled(f[::-1], shapes[::-1], np.tile(coordinate, (2, 1)), [0.2, 0.1])
    np.testing.assert_array_equal(back.frequency, modes.frequency)
    np.testing.assert_array_equal(back.shapes, modes.shapes)
    assert back.labels == modes.labels
    assert back.zeta is not None
    np.testing.assert_array_equal(back.zeta, [0.1, 0.2])
    with pytest.raises(MeasurementError, match="the same coordinates for all modes"):
        modes_from_labelled(f, shapes, [["1X+", "2Y-", "3Z+"], ["1X+", "2Y-", "4Z+"]])
    with pytest.raises(MeasurementError, match="no labels"):
        labelled_from_modes(Modes(f, shapes.T))
