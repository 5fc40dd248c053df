"""The paper's numerical case: two beams, 126 coordinates each, and one coupled 12x12 joint, without noise.

The beams come from textbook element matrices written here, so that the package under test does not make its
own truth. Table 1 of the paper is lost; the joint's numbers are chosen, in the order of a bolted joint's.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from joint import (
    CoordinateSet,
    Interface,
    JointIdentificationError,
    coordinates_of,
    couple,
    identify_joint,
    joint_impedance,
    partition_frf,
    stack_substructures,
)

EPS = np.finfo(float).eps
FREQUENCY = np.linspace(40, 3200, 80)
LENGTH, WIDTH, HEIGHT, N_ELEMENTS = 0.8, 0.03, 0.01, 20
E, NU, RHO, LOSS = 2.1e11, 0.3, 7850.0, 0.01
UPPER, LOWER = [f"U{node}" for node in range(1, 22)], [f"D{node}" for node in range(22, 43)]
JOINT_UPPER, JOINT_LOWER = coordinates_of(["U11"]), coordinates_of(["D22"])


def euler_bernoulli(length, width, height):
    """Return K and M (12, 12) of a beam along x, order x y z rx ry rz at each end; St Venant torsion."""
    G, A = E / (2 * (1 + NU)), width * height
    Iy, Iz = width * height**3 / 12, height * width**3 / 12
    J = width * height**3 * (1 / 3 - 0.21 * height / width * (1 - (height / width) ** 4 / 12))
    K, M = np.zeros((12, 12)), np.zeros((12, 12))
    stretch, mass = np.array([[1, -1], [-1, 1]]), np.array([[2, 1], [1, 2]]) / 6
    for dofs, k, m in (([0, 6], E * A / length, RHO * A), ([3, 9], G * J / length, RHO * (Iy + Iz))):
        K[np.ix_(dofs, dofs)], M[np.ix_(dofs, dofs)] = k * stretch, m * length * mass
    s = length
    k = np.array([[12, 6 * s, -12, 6 * s], [6 * s, 4 * s**2, -6 * s, 2 * s**2]])
    k = np.vstack([k, -k[0], [6 * s, 2 * s**2, -6 * s, 4 * s**2]]) / s**3
    m = [
        [156, 22 * s, 54, -13 * s],
        [22 * s, 4 * s**2, 13 * s, -3 * s**2],
        [54, 13 * s, 156, -22 * s],
        [-13 * s, -3 * s**2, -22 * s, 4 * s**2],
    ]
    m = RHO * A * s / 420 * np.array(m)
    for dofs, inertia, sign in (([1, 5, 7, 11], Iz, 1), ([2, 4, 8, 10], Iy, -1)):
        flip = np.outer([1, sign, 1, sign], [1, sign, 1, sign])
        K[np.ix_(dofs, dofs)], M[np.ix_(dofs, dofs)] = E * inertia * k * flip, m * flip
    return K, M


def free_beam(axes):
    """Return K and M (126, 126) of a free-free beam whose local axes are the rows of `axes`."""
    Ke, Me = euler_bernoulli(LENGTH / N_ELEMENTS, WIDTH, HEIGHT)
    T = np.kron(np.eye(4), axes)
    K, M = (np.zeros((6 * N_ELEMENTS + 6,) * 2) for _ in range(2))
    for element in range(N_ELEMENTS):
        dofs = slice(6 * element, 6 * element + 12)
        K[dofs, dofs] += T.T @ Ke @ T
        M[dofs, dofs] += T.T @ Me @ T
    return K, M


def coupled_joint_matrices():
    """Return full symmetric positive definite K, M, C, D (12, 12), rotations at an arm of 20 mm."""
    rng = np.random.default_rng(11)
    arm = np.diag([1, 1, 1, 0.02, 0.02, 0.02] * 2)

    def coupled(smallest, largest):
        Q = np.linalg.qr(rng.standard_normal((12, 12)))[0] * np.sqrt(np.geomspace(smallest, largest, 12))
        return arm @ Q @ Q.T @ arm

    return coupled(1e6, 1e8), coupled(0.05, 0.3), coupled(10, 200), coupled(1e4, 1e6)


X_AXES = np.eye(3)
Y_AXES = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
OMEGA = 2 * np.pi * FREQUENCY[:, None, None]


@pytest.fixture(scope="module")
def dynamic_stiffness():
    beams = [free_beam(axes) for axes in (X_AXES, Y_AXES)]
    return [K * (1 + 1j * LOSS) - OMEGA**2 * M for K, M in beams]


@pytest.fixture(scope="module")
def receptances(dynamic_stiffness):
    return [np.linalg.inv(stiffness) for stiffness in dynamic_stiffness]


@pytest.fixture(scope="module")
def Z_true():
    return joint_impedance(FREQUENCY, *coupled_joint_matrices())


def substructures(receptances, nodes, directions=("x", "y", "z", "rx", "ry", "rz"), inputs=None):
    """Return both beams side by side with internal responses (and inputs) at some nodes."""
    parts = []
    for H, beam, joint in zip(receptances, (UPPER, LOWER), (JOINT_UPPER, JOINT_LOWER), strict=True):
        every = coordinates_of(beam)
        outputs = coordinates_of([node for node in beam if node in nodes], directions)
        forces = outputs if inputs is None else CoordinateSet(tuple(x for x in inputs if x in every.labels))
        parts.append(partition_frf(FREQUENCY, H, every, every, Interface(joint, outputs, forces)))
    return stack_substructures(*parts)


ALL_NODES = [node for node in UPPER + LOWER if node not in ("U11", "D22")]
PAPER_NODES = ["U1", "U5", "U13", "U21", "D24", "D28", "D35", "D37", "D41"]
NEXT_NODES = ["U10", "D23"]


def scaled_error(Z, Z_true, length):
    """Return ‖ΔZ‖ / ‖Z‖ at each line with moments and rotations scaled by a length."""
    scale = np.array([1, 1, 1, 1 / length, 1 / length, 1 / length] * 2)
    weight = np.outer(scale, scale)
    return np.linalg.norm((Z - Z_true) * weight, axis=(1, 2)) / np.linalg.norm(Z_true * weight, axis=(1, 2))


def relative(H, H_true):
    return np.linalg.norm(H - H_true, axis=(1, 2)) / np.linalg.norm(H_true, axis=(1, 2))


def test_beam_has_the_published_free_free_frequencies():
    K, M = free_beam(X_AXES)
    omega = np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(M, K))))
    frequency = np.sort(omega)[6:8] / (2 * np.pi)
    roots = np.array([4.730040745, 7.853204624])
    weak = np.sqrt(E * HEIGHT**2 / 12 / RHO) / LENGTH**2 / (2 * np.pi)
    assert_allclose(frequency[:2], roots**2 * weak, rtol=1e-4)


@pytest.mark.parametrize(
    ("nodes", "n_internal", "n_regular"),
    [(ALL_NODES, 240, 80), (PAPER_NODES, 54, 80), (NEXT_NODES, 12, 70)],
)
def test_joint_returns_at_every_regular_line(receptances, Z_true, nodes, n_internal, n_regular):
    beams = substructures(receptances, nodes)
    assert len(beams.interface.outputs) == n_internal
    assembly = couple(beams, Z_true)

    found = identify_joint(beams, FREQUENCY, assembly.H_nn)

    error = scaled_error(found.Z, Z_true, found.length)
    assert found.regular.sum() >= n_regular
    assert error[found.regular].max() <= 1e-9
    assert (error <= 10 * EPS * found.amplification).all()
    assert found.residual[found.regular].max() <= 1e-9
    rebuilt = couple(beams, found.Z)
    assert relative(rebuilt.H_nn, assembly.H_nn)[found.regular].max() <= 1e-9
    assert relative(rebuilt.H_jj, assembly.H_jj)[found.regular].max() <= 1e-9


def test_coupling_equals_the_assembled_dynamic_stiffness(dynamic_stiffness, receptances, Z_true):
    beams = substructures(receptances, ALL_NODES)
    whole = np.zeros((FREQUENCY.size, 252, 252), dtype=complex)
    whole[:, :126, :126], whole[:, 126:, 126:] = dynamic_stiffness
    every = coordinates_of(UPPER + LOWER)
    j = every.positions(beams.interface.joint.labels)
    n = every.positions(beams.interface.outputs.labels)
    whole[np.ix_(np.arange(80), j, j)] += Z_true
    H = np.linalg.inv(whole)

    assembly = couple(beams, Z_true)

    apart = relative(assembly.H_nn, H[:, n][:, :, n])
    assert apart.max() <= 1e-9
    assert relative(assembly.H_nj, H[:, n][:, :, j]).max() <= 1e-9
    assert relative(assembly.H_jn, H[:, j][:, :, n]).max() <= 1e-9
    assert relative(assembly.H_jj, H[:, j][:, :, j]).max() <= 1e-9
    found = identify_joint(beams, FREQUENCY, H[:, n][:, :, n])
    error = scaled_error(found.Z, Z_true, found.length)
    assert (error <= np.maximum(apart, EPS) * found.amplification).all()
    assert error.max() <= 1e-8


def test_responses_and_inputs_may_be_at_different_coordinates(receptances, Z_true):
    inputs = coordinates_of(["U9", "U14", "D25", "D30"]).labels
    beams = substructures(receptances, [*NEXT_NODES, "U16", "D40"], inputs=inputs)
    assembly = couple(beams, Z_true)
    assert assembly.H_nn.shape == (80, 24, 24)

    found = identify_joint(beams, FREQUENCY, assembly.H_nn)

    assert found.regular.all()
    assert scaled_error(found.Z, Z_true, found.length)[found.regular].max() <= 1e-9


def test_translations_on_a_straight_centreline_are_refused_by_name(receptances, Z_true):
    beams = substructures(receptances, ALL_NODES, directions=("x", "y", "z"))
    assembly = couple(beams, Z_true)
    with pytest.raises(JointIdentificationError) as refusal:
        identify_joint(beams, FREQUENCY, assembly.H_nn)
    assert "rank 10 of 12" in str(refusal.value)
    assert "U11:rx" in str(refusal.value)
    assert "D22:ry" in str(refusal.value)


def test_one_beam_alone_does_not_show_the_other_side_of_the_joint(receptances, Z_true):
    beams = substructures(receptances, UPPER[:8])
    assembly = couple(beams, Z_true)
    with pytest.raises(JointIdentificationError, match=r"rank 6 of 12.*D22:"):
        identify_joint(beams, FREQUENCY, assembly.H_nn)


def test_far_nodes_lose_the_evanescent_field_and_are_refused(receptances, Z_true):
    beams = substructures(receptances, ["U1", "D42"])
    with pytest.raises(JointIdentificationError, match=r"no line is regular.*40 Hz"):
        identify_joint(beams, FREQUENCY, couple(beams, Z_true).H_nn)


def test_ill_conditioned_lines_are_told_from_regular_ones(receptances, Z_true):
    beams = substructures(receptances, ["U7", "D28"])
    found = identify_joint(beams, FREQUENCY, couple(beams, Z_true).H_nn)
    error = scaled_error(found.Z, Z_true, found.length)
    assert 0 < found.regular.sum() < 40
    assert error[found.regular].max() <= 1e-9
    assert error.max() > 1e-9
