"""Labels, partition and stacking of joint and internal coordinates."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from joint import (
    CoordinateSet,
    Interface,
    SubstructureFRF,
    coordinates_of,
    partition_frf,
    stack_joints,
    stack_substructures,
)

FREQUENCY = np.array([10.0, 20.0])


def numbered(n_out, n_in, start=0.0):
    return start + np.arange(2.0 * n_out * n_in).reshape(2, n_out, n_in)


def single(name, frequency=FREQUENCY, value=1.0):
    """Return a substructure with one joint and one internal coordinate, all receptances one value."""
    internal = CoordinateSet((f"{name}1:x",))
    interface = Interface(CoordinateSet((f"{name}2:x",)), internal, internal)
    block = np.full((len(frequency), 1, 1), value)
    return SubstructureFRF(frequency, interface, block, block, block, block)


def test_coordinates_of_nodes_are_ordered_node_by_node():
    both = coordinates_of([7, "U8"], ["z", "rx"])
    assert both.labels == ("7:z", "7:rx", "U8:z", "U8:rx")
    assert_array_equal(both.rotational, [False, True, False, True])
    assert_array_equal(both.positions(["U8:z", "7:z"]), [2, 0])


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        (("U1:x", "U2w"), "coordinate 1 is labelled 'U2w'; allowed is node:direction"),
        (("U1:x", "U1:theta"), "coordinate 1 is labelled 'U1:theta'"),
        ((":x",), "coordinate 0 is labelled ':x'"),
        (("U1:x", "U1:y", "U1:x"), "U1:x occurs more than once"),
    ],
)
def test_bad_labels_are_refused(labels, message):
    with pytest.raises(ValueError, match=message):
        CoordinateSet(labels)


def test_a_label_that_is_not_there_is_named():
    with pytest.raises(ValueError, match="U9:x not among the 2 coordinates U1:x, U1:y"):
        CoordinateSet(("U1:x", "U1:y")).positions(["U9:x"])


def test_a_coordinate_is_either_joint_or_internal():
    both = CoordinateSet(("U1:x",))
    with pytest.raises(ValueError, match="U1:x stands among the joint coordinates and the internal inputs"):
        Interface(both, CoordinateSet(()), both)
    with pytest.raises(ValueError, match="no joint coordinate"):
        Interface(CoordinateSet(()), both, both)


def test_partition_picks_blocks_by_label():
    outputs, inputs = CoordinateSet(("A:x", "B:x", "C:x")), CoordinateSet(("B:x", "A:x"))
    H = numbered(3, 2)
    interface = Interface(CoordinateSet(("B:x",)), CoordinateSet(("C:x", "A:x")), CoordinateSet(("A:x",)))
    parts = partition_frf(FREQUENCY, H, outputs, inputs, interface)
    assert_array_equal(parts.H_aa, H[:, [2, 0]][:, :, [1]])
    assert_array_equal(parts.H_ab, H[:, [2, 0]][:, :, [0]])
    assert_array_equal(parts.H_ba, H[:, [1]][:, :, [1]])
    assert_array_equal(parts.H_bb, H[:, [1]][:, :, [0]])


def test_receptances_are_frozen_copies():
    block = np.ones((2, 1, 1))
    frf = single("U")
    with pytest.raises(FrozenInstanceError):
        frf.H_aa = block  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        frf.H_aa[0, 0, 0] = 2.0


def test_shape_and_finiteness_are_checked_with_the_place_named():
    interface = single("U").interface
    good = np.ones((2, 1, 1), dtype=complex)
    with pytest.raises(ValueError, match=r"H_ab has shape \(2, 1, 2\); \(2, 1, 1\) is needed"):
        SubstructureFRF(FREQUENCY, interface, good, np.ones((2, 1, 2)), good, good)
    bad = good.copy()
    bad[1, 0, 0] = np.nan
    place = r"H_bb holds 1 values .* first at line 1 \(20 Hz\), row U2:x, column U2:x"
    with pytest.raises(ValueError, match=place):
        SubstructureFRF(FREQUENCY, interface, good, good, good, bad)


@pytest.mark.parametrize(
    ("frequency", "message"),
    [
        ([10.0, 10.0], "line 1 is 10 Hz after 10 Hz"),
        ([-1.0, 10.0], "negative"),
        ([1.0, np.inf], "non-finite"),
        ([], "non-empty"),
    ],
)
def test_bad_frequencies_are_refused(frequency, message):
    with pytest.raises(ValueError, match=message):
        single("U", np.array(frequency))


def test_substructures_side_by_side_do_not_touch():
    whole = stack_substructures(single("A", value=1.0), single("B", value=2.0), single("C", value=3.0))
    assert whole.interface.joint.labels == ("A2:x", "B2:x", "C2:x")
    assert whole.interface.outputs.labels == ("A1:x", "B1:x", "C1:x")
    for block in (whole.H_aa, whole.H_ab, whole.H_ba, whole.H_bb):
        assert_array_equal(block[1], np.diag([1.0, 2.0, 3.0]))


def test_substructures_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="A2:x occurs more than once"):
        stack_substructures(single("A"), single("A"))
    with pytest.raises(ValueError, match="substructure 1 has 1 frequency lines, against 2 of substructure 0"):
        stack_substructures(single("A"), single("B", FREQUENCY[:1]))
    with pytest.raises(ValueError, match="line 1 of substructure 1 is at 21 Hz, but"):
        stack_substructures(single("A"), single("B", np.array([10.0, 21.0])))
    with pytest.raises(ValueError, match="no substructure"):
        stack_substructures()


def test_joints_find_their_coordinates_by_label():
    order = CoordinateSet(("A:x", "B:x", "C:x"))
    pair, alone = CoordinateSet(("C:x", "A:x")), CoordinateSet(("B:x",))
    Z = stack_joints(order, [(pair, numbered(2, 2, 1.0)), (alone, numbered(1, 1, 50.0))])
    assert_array_equal(Z[0], [[4, 0, 3], [0, 50, 0], [2, 0, 1]])


def test_joints_that_do_not_fit_are_refused():
    order = CoordinateSet(("A:x", "B:x"))
    a, b = CoordinateSet(("A:x",)), CoordinateSet(("B:x",))
    with pytest.raises(ValueError, match="B:x belongs to no joint"):
        stack_joints(order, [(a, numbered(1, 1))])
    with pytest.raises(ValueError, match="A:x belongs to two joints"):
        stack_joints(order, [(a, numbered(1, 1)), (a, numbered(1, 1)), (b, numbered(1, 1))])
    with pytest.raises(ValueError, match=r"joint 1 has an array of shape \(2, 2, 1\)"):
        stack_joints(order, [(a, numbered(1, 1)), (b, numbered(2, 1))])
    with pytest.raises(ValueError, match="C:x not among"):
        stack_joints(order, [(order, numbered(2, 2)), (CoordinateSet(("C:x",)), numbered(1, 1))])
