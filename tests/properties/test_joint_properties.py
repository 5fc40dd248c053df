"""What holds for every set of substructures and joints."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from joint import (
    CoordinateSet,
    Interface,
    coordinates_of,
    couple,
    decouple,
    identify_joint,
    joint_impedance,
    partition_frf,
    stack_joints,
    stack_substructures,
)

FREQUENCY = np.array([5.0, 40.0, 90.0])
seeds = st.integers(0, 2**32 - 1)
sizes = st.integers(1, 4)


def symmetric(rng, n, smallest, largest):
    """Return a random symmetric positive definite matrix with eigenvalues between two values."""
    Q = np.linalg.qr(rng.standard_normal((n, n)))[0]
    K = (Q * rng.uniform(smallest, largest, n)) @ Q.T
    return (K + K.T) / 2


def substructure(rng, name, n_joint, n_internal):
    """Return a damped structure of random K, M, C whose lines are away from singular ones."""
    n = n_joint + n_internal
    stiffness = joint_impedance(
        FREQUENCY,
        symmetric(rng, n, 1e5, 2e5),
        symmetric(rng, n, 0.5, 1.0),
        symmetric(rng, n, 50, 100),
    )
    every = coordinates_of([f"{name}{i}" for i in range(n)], ["z"])
    internal = CoordinateSet(every.labels[n_joint:])
    interface = Interface(CoordinateSet(every.labels[:n_joint]), internal, internal)
    return partition_frf(FREQUENCY, np.linalg.inv(stiffness), every, every, interface)


def pair_of(seed, n_joint):
    rng = np.random.default_rng(seed)
    pair = stack_substructures(*(substructure(rng, name, n_joint, n_joint + 2) for name in "AB"))
    n = 2 * n_joint
    matrices = symmetric(rng, n, 1e4, 1e5), symmetric(rng, n, 0.1, 0.3), symmetric(rng, n, 5, 20)
    return pair, joint_impedance(FREQUENCY, *matrices)


def close(actual, expected, rtol=1e-9):
    assert_allclose(actual, expected, rtol=0, atol=rtol * np.abs(expected).max())


@settings(deadline=None)
@given(seeds, sizes)
def test_reciprocal_parts_and_joint_give_a_reciprocal_assembly(seed, n_joint):
    pair, Z = pair_of(seed, n_joint)
    assembly = couple(pair, Z)
    close(assembly.H_nn, assembly.H_nn.mT, 1e-12)
    close(assembly.H_jj, assembly.H_jj.mT, 1e-12)
    close(assembly.H_nj, assembly.H_jn.mT, 1e-12)


@settings(deadline=None)
@given(seeds, sizes)
def test_couple_then_identify_is_the_identity(seed, n_joint):
    pair, Z = pair_of(seed, n_joint)
    found = identify_joint(pair, FREQUENCY, couple(pair, Z).H_nn)
    error = np.linalg.norm(found.Z - Z, axis=(1, 2)) / np.linalg.norm(Z, axis=(1, 2))
    scale = np.linalg.norm(pair.H_aa, axis=(1, 2)) / np.linalg.norm(
        pair.H_aa - couple(pair, Z).H_nn, axis=(1, 2)
    )
    allowed = 1e-14 * found.amplification * np.maximum(scale, 1)
    assert (error <= allowed).all()


@settings(deadline=None)
@given(seeds, sizes)
def test_couple_then_decouple_is_the_identity(seed, n_joint):
    pair, Z = pair_of(seed, n_joint)
    free = decouple(couple(pair, Z), Z)
    for name in ("H_aa", "H_ab", "H_ba", "H_bb"):
        close(getattr(free, name), getattr(pair, name))


@settings(deadline=None)
@given(seeds, sizes)
def test_a_joint_of_zero_leaves_the_parts_as_they_are(seed, n_joint):
    pair, Z = pair_of(seed, n_joint)
    assembly = couple(pair, 0 * Z)
    close(assembly.H_nn, pair.H_aa, 1e-15)
    close(assembly.H_nj, pair.H_ab, 1e-15)
    close(assembly.H_jn, pair.H_ba, 1e-15)
    close(assembly.H_jj, pair.H_bb, 1e-15)


@settings(deadline=None)
@given(seeds, st.permutations(range(3)))
def test_the_order_of_substructures_and_joints_does_not_matter(seed, order):
    rng = np.random.default_rng(seed)
    parts = [substructure(rng, "A", 2, 3), substructure(rng, "B", 1, 2), substructure(rng, "C", 1, 2)]
    joints = [
        (CoordinateSet(labels), joint_impedance(FREQUENCY, symmetric(rng, 2, 1e4, 1e5)))
        for labels in (("A0:z", "B0:z"), ("C0:z", "A1:z"))
    ]
    one = stack_substructures(*parts)
    other = stack_substructures(*(parts[i] for i in order))
    first = couple(one, stack_joints(one.interface.joint, joints))
    second = couple(other, stack_joints(other.interface.joint, joints[::-1]))
    at = second.interface.outputs.positions(first.interface.outputs.labels)
    close(second.H_nn[:, at][:, :, at], first.H_nn, 1e-12)
