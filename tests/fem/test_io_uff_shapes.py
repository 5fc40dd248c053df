"""Mode shapes in universal files: components, gaps and nodes."""

import numpy as np
import pytest

from fem import Modes
from fem.io import UffError, read_modes, write_npz, write_uff
from tests.fem.test_io_uff_meaning import ints, quietly, read, shape


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.unv"


FIRST = [(1, 1.0, 0, 0), (2, 2.0, 0, 0), (3, 3.0, 0, 0)]


def test_a_node_missing_in_one_mode_is_a_gap_of_that_mode_and_named(path):
    second = [(1, 4.0, 0, 0), (3, 6.0, 0, 0)]
    modes, said = quietly(path, shape(FIRST), shape(second, 20.0, 2), reader=read_modes)
    assert modes.labels == tuple(f"{node}{d}+" for node in (1, 2, 3) for d in "XYZ")
    np.testing.assert_array_equal(modes.shapes[::3], [[1, 4], [2, np.nan], [3, 6]])
    np.testing.assert_array_equal(np.isnan(modes.shapes).nonzero(), [[3, 4, 5], [1, 1, 1]])
    assert "mode 2 at 20 Hz (dataset 55 at line 18 (byte " in said
    assert "has no values at node 2, which is left out of this mode alone" in said


def test_nodes_that_several_modes_lack_are_named_once(path):
    lacking = [(1, 4.0, 0, 0), (3, 6.0, 0, 0)]
    blocks = shape(FIRST), shape(lacking, 20.0, 2), shape(lacking[:1] + FIRST[1:2], 30.0, 3)
    modes, said = quietly(path, *blocks, shape(lacking[::-1], 40.0, 4), reader=read_modes)
    np.testing.assert_array_equal(
        modes.shapes[::3], [[1, 4, 4, 4], [2, np.nan, 2, np.nan], [3, 6, np.nan, 6]]
    )
    assert "and mode 4 have no values at node 2, which is left out of these modes alone" in said
    assert "mode 3 at 30 Hz" in said
    assert "has no values at node 3, which is left out of this mode alone" in said


def test_complex_shapes_with_gaps_are_written_and_read_again(path):
    labels = tuple(f"{node}{d}+" for node in (4, 9, 2) for d in "XYZ")
    shapes = np.round(np.random.default_rng(1).standard_normal((9, 3, 2)) @ [1, 1j], 3)
    shapes[3:6, 1] = np.nan
    write_uff(path, modes=Modes(np.array([10.0, 20.0, 30.0]), shapes, np.full(3, 0.01), labels))
    with pytest.warns(UserWarning, match=r"mode 2 at .* has no values at node 9"):
        again = read_modes(path)
    assert again.labels == labels
    np.testing.assert_allclose(again.shapes, shapes, rtol=1e-5)
    write_npz(path.with_suffix(".npz"), again)
    np.testing.assert_array_equal(read_modes(path.with_suffix(".npz")).shapes, again.shapes)


def test_a_gap_in_one_direction_of_a_node_is_refused_by_the_writer(path):
    shapes = np.ones((6, 2))
    shapes[4, 1] = np.nan
    labels = tuple(f"{node}{d}+" for node in (1, 2) for d in "XYZ")
    with pytest.raises(UffError, match="mode 2 has values in some directions of node 2 and NaN in others"):
        write_uff(path, modes=Modes(np.array([10.0, 20.0]), shapes, None, labels))


def test_nodes_in_another_order_in_another_mode(path):
    modes = quietly(path, shape(FIRST), shape(FIRST[::-1], 20.0, 2), reader=read_modes)[0]
    np.testing.assert_array_equal(modes.shapes[::3], [[1, 1], [2, 2], [3, 3]])


def test_a_shape_of_zeros_is_refused_with_mode_and_node(path):
    zero = [(node, 0.0, 0, 0) for node in (4, 5)]
    with pytest.raises(
        UffError, match=r"mode 2 at 20 Hz \(dataset 55 at line 18 .*is zero at all 2 nodes \(first: node 4\)"
    ):
        read(path, shape(FIRST), shape(zero, 20.0, 2))


def test_shapes_of_two_tests_are_told_apart(path):
    other = [(node, 1.0, 0, 0) for node in (11, 12, 13)]
    with pytest.raises(
        UffError, match=r"2 groups of mode shapes.*10 to 10 Hz with 9 rows, 1X\+ to 3Z\+; 1 modes at 20"
    ):
        quietly(path, shape(FIRST), shape(other, 20.0, 2), reader=read_modes)


def test_results_that_are_no_shapes_are_named(path):
    stress = shape([(1, *range(1, 7))]).replace(ints(1, 2, 3, 8, 2, 6), ints(1, 2, 4, 2, 2, 6))
    file = read(path, stress)
    assert not file.modes
    assert "result type 2 with data characteristic 4 is no mode shape" in file.skipped[0]


def test_a_node_twice_in_a_shape(path):
    assert read(path, shape([*FIRST, FIRST[0]])).modes[0].labels[-1] == "3Z+"
    with pytest.raises(UffError, match="node 1 has values in it 2 times, and they differ"):
        read(path, shape([*FIRST, (1, 7.0, 0, 0)]))
