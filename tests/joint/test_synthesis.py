"""Coupling against closed forms and against directly assembled dynamic stiffness."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from joint import (
    CoordinateSet,
    Interface,
    SubstructureFRF,
    coordinates_of,
    couple,
    decouple,
    joint_impedance,
    partition_frf,
    relative_coordinates,
    relative_joint,
    stack_joints,
    stack_substructures,
)

FREQUENCY = np.array([3.0, 17.0, 55.0])
OMEGA = 2 * np.pi * FREQUENCY
NONE = CoordinateSet(())


def mass_on_spring(name, m, k):
    """Return a mass on a spring to ground; its only coordinate is a joint one."""
    H = 1 / (k * (1 + 0.02j) - OMEGA**2 * m)
    empty = np.zeros((3, 0, 0))
    interface = Interface(CoordinateSet((f"{name}:x",)), NONE, NONE)
    blocks = [empty, np.zeros((3, 0, 1)), np.zeros((3, 1, 0)), H[:, None, None]]
    return SubstructureFRF(FREQUENCY, interface, *blocks)


def chain(name, masses, springs, joint):
    """Return dynamic stiffness, coordinates and partition of masses in a row, each also tied to ground."""
    n = len(masses)
    K = np.diag(np.full(n, 2e4))
    for i, k in enumerate(springs):
        K[i : i + 2, i : i + 2] += k * np.array([[1, -1], [-1, 1]])
    stiffness = K * (1 + 0.02j) - OMEGA[:, None, None] ** 2 * np.diag(masses)
    every = coordinates_of([f"{name}{i}" for i in range(n)], ["x"])
    at_joint = CoordinateSet(tuple(f"{name}{i}:x" for i in joint))
    internal = CoordinateSet(tuple(label for label in every.labels if label not in at_joint.labels))
    interface = Interface(at_joint, internal, internal)
    return stiffness, every, partition_frf(FREQUENCY, np.linalg.inv(stiffness), every, every, interface)


def test_impedance_at_one_line_is_written_out():
    Z = joint_impedance([10.0], [[5e4]], [[2.0]], [[30.0]], [[400.0]])
    omega = 20 * np.pi
    assert_allclose(Z, [[[5e4 - 2.0 * omega**2 + 1j * (30.0 * omega + 400.0)]]], rtol=1e-15)


def test_impedance_refuses_matrices_of_different_size():
    with pytest.raises(ValueError, match=r"M has shape \(1, 1\); \(2, 2\) is needed"):
        joint_impedance([1.0], np.eye(2), np.eye(1))
    with pytest.raises(ValueError, match="C holds values that are not finite"):
        joint_impedance([1.0], np.eye(1), C=[[np.nan]])


def test_two_masses_joined_by_a_spring_follow_the_closed_form():
    (m1, k1), (m2, k2), kj = (1.5, 2e4), (0.7, 9e3), 6e3
    pair = stack_substructures(mass_on_spring("A", m1, k1), mass_on_spring("B", m2, k2))
    Z = joint_impedance(FREQUENCY, kj * np.array([[1, -1], [-1, 1]]))

    H = couple(pair, Z).H_jj

    d1, d2 = (k * (1 + 0.02j) - OMEGA**2 * m + kj for m, k in ((m1, k1), (m2, k2)))
    adjugate = np.array([[d2, np.full(3, kj)], [np.full(3, kj), d1]])
    assert_allclose(H, np.moveaxis(adjugate / (d1 * d2 - kj**2), 2, 0), rtol=1e-13)


def test_three_substructures_and_two_joints_equal_the_assembled_stiffness():
    parts = [
        chain("A", [1.0, 2.0, 0.5, 1.2], [8e3, 5e3, 9e3], joint=[1, 3]),
        chain("B", [0.8, 0.6], [4e3], joint=[0]),
        chain("C", [1.1, 0.9, 0.4], [6e3, 7e3], joint=[2]),
    ]
    whole = stack_substructures(*(frf for _, _, frf in parts))
    first = CoordinateSet(("A3:x", "B0:x"))
    second = CoordinateSet(("C2:x", "A1:x"))
    rng = np.random.default_rng(2)
    K = [rng.standard_normal((2, 2)) * 1e4 for _ in range(2)]
    K = [matrix @ matrix.T / 1e4 for matrix in K]
    blocks = [(first, joint_impedance(FREQUENCY, K[0])), (second, joint_impedance(FREQUENCY, K[1]))]

    Z = stack_joints(whole.interface.joint, blocks)
    assembly = couple(whole, Z)

    labels = CoordinateSet(tuple(label for _, every, _ in parts for label in every.labels))
    stiffness = np.zeros((3, 9, 9), dtype=complex)
    start = 0
    for local, every, _ in parts:
        stop = start + len(every)
        stiffness[:, start:stop, start:stop] = local
        start = stop
    for coordinates, block in blocks:
        at = labels.positions(coordinates.labels)
        stiffness[np.ix_(range(3), at, at)] += block
    H = np.linalg.inv(stiffness)
    n = labels.positions(whole.interface.outputs.labels)
    j = labels.positions(whole.interface.joint.labels)
    for found, rows, columns in (
        (assembly.H_nn, n, n),
        (assembly.H_nj, n, j),
        (assembly.H_jn, j, n),
        (assembly.H_jj, j, j),
    ):
        assert_allclose(found, H[:, rows][:, :, columns], rtol=1e-11, atol=1e-16)


def test_decoupling_gives_the_substructures_back():
    _, _, frf = chain("A", [1.0, 2.0, 0.5], [8e3, 5e3], joint=[0, 2])
    Z = joint_impedance(FREQUENCY, 1e4 * np.array([[2, -1], [-1, 1]]), C=5 * np.eye(2))
    free = decouple(couple(frf, Z), Z)
    for name in ("H_aa", "H_ab", "H_ba", "H_bb"):
        assert_allclose(getattr(free, name), getattr(frf, name), rtol=1e-11)


def test_a_joint_of_the_wrong_size_is_refused():
    _, _, frf = chain("A", [1.0, 2.0, 0.5], [8e3, 5e3], joint=[0, 2])
    with pytest.raises(ValueError, match=r"Z_j has shape \(3, 1, 1\); \(3, 2, 2\) is needed"):
        couple(frf, np.ones((3, 1, 1)))


LEVER_1, LEVER_2 = np.array([0.01, -0.02, 0.005]), np.array([0.0, 0.03, -0.005])


def coupled_6x6(seed, size):
    root = np.random.default_rng(seed).standard_normal((6, 6))
    return size * root @ root.T


@pytest.mark.parametrize("turned", [False, True])
def test_relative_joint_transmits_one_wrench_from_node_to_node(turned):
    K = coupled_6x6(5, 1e6)
    angle = 0.7
    axes = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    axes = axes if turned else np.eye(3)
    joint = relative_joint(K, lever_1=LEVER_1, lever_2=LEVER_2, axes=axes)
    x = np.random.default_rng(6).standard_normal(12)
    u1, t1, u2, t2 = x.reshape(4, 3)

    stretch = u2 + np.cross(t2, LEVER_2) - u1 - np.cross(t1, LEVER_1)
    wrench = K @ np.concatenate([axes @ stretch, axes @ (t2 - t1)])
    force, moment = axes.T @ wrench[:3], axes.T @ wrench[3:]
    on_1 = np.concatenate([-force, -moment - np.cross(LEVER_1, force)])
    on_2 = np.concatenate([force, moment + np.cross(LEVER_2, force)])
    assert_allclose(joint.K @ x, np.concatenate([on_1, on_2]), rtol=1e-12, atol=1e-6)


def test_rigid_motion_costs_a_relative_joint_nothing():
    B = relative_coordinates(LEVER_1, LEVER_2)
    shift, turn = np.array([1.0, -2.0, 0.5]), np.array([0.3, 0.1, -0.2])
    points = [-LEVER_1, -LEVER_2]  # both arms end at the origin
    rigid = np.concatenate([np.concatenate([shift + np.cross(turn, point), turn]) for point in points])
    assert_allclose(B @ rigid, np.zeros(6), atol=1e-15)


def test_relative_joint_carries_damping_and_has_rank_six():
    joint = relative_joint(coupled_6x6(1, 1e6), coupled_6x6(2, 10.0), lever_1=LEVER_1)
    assert np.linalg.matrix_rank(joint.K) == 6
    assert_allclose(joint.C, joint.B.T @ coupled_6x6(2, 10.0) @ joint.B)
    assert not joint.D.any()


def test_bad_arms_and_axes_are_refused():
    with pytest.raises(ValueError, match=r"lever_2 is .* three finite components"):
        relative_coordinates(lever_2=[0.0, np.nan, 0.0])
    with pytest.raises(ValueError, match="not orthonormal"):
        relative_coordinates(axes=2 * np.eye(3))
    with pytest.raises(ValueError, match=r"K has shape \(3, 3\); \(6, 6\) is needed"):
        relative_joint(np.eye(3))
