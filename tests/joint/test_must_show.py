"""The paper's numerical case at full size, several joints at once, and a joint with a closed form."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.joint_noise import ALL_NODES, NEXT_NODES, NODES, full_joint, parts, relative
from joint import (
    CoordinateSet,
    Interface,
    SubstructureFRF,
    couple,
    full_form,
    identify_average,
    identify_joint,
    joint_impedance,
    stack_joints,
    stack_substructures,
)

MANY_LINES = np.linspace(20.0, 3200.0, 1600)
CASES = [(ALL_NODES, 240), (NODES, 54), (NEXT_NODES, 12)]


def error_of_lines(Z, Z_true):
    """Return ‖ΔZ‖ / ‖Z‖ at each line with rotations at an arm of 20 mm."""
    arm = np.array([1, 1, 1, 50.0, 50.0, 50.0] * 2)
    weight = np.outer(arm, arm)
    return np.linalg.norm((Z - Z_true) * weight, axis=(1, 2)) / np.linalg.norm(Z_true * weight, axis=(1, 2))


@pytest.mark.slow
@pytest.mark.parametrize(("nodes", "n_internal"), CASES)
def test_direct_solution_of_1600_lines(nodes, n_internal):
    """Rounding grows by at most cond(A) cond(B), which regular lines keep below 1e-9 over it."""
    n_regular = 0
    for frequency in np.split(MANY_LINES, 8):  # each line by itself: blocks of 200 save memory
        beams = parts(frequency, None, nodes=nodes)
        assert len(beams.interface.outputs) == len(beams.interface.inputs) == n_internal
        Z = joint_impedance(frequency, *full_joint())
        assembly = couple(beams, Z)
        found = identify_joint(beams, frequency, assembly.H_nn)
        use = found.regular
        n_regular += int(use.sum())
        assert error_of_lines(found.Z, Z)[use].max() <= 1e-9
        rebuilt = couple(beams, found.Z).H_nn
        off = np.linalg.norm((rebuilt - assembly.H_nn)[use], axis=(1, 2))
        assert (off <= 1e-9 * np.linalg.norm(assembly.H_nn[use], axis=(1, 2))).all()
    assert n_regular >= (1600 if n_internal > 12 else 1400)


@pytest.mark.slow
@pytest.mark.parametrize(("nodes", "n_internal"), CASES)
def test_average_solution_of_1600_lines(nodes, n_internal):
    matrices = full_joint()
    beams = parts(MANY_LINES, None, nodes=nodes)
    assert len(beams.interface.outputs) == n_internal
    H = couple(beams, joint_impedance(MANY_LINES, *matrices)).H_nn
    found = identify_average(beams, MANY_LINES, H, full_form(beams.interface.joint))
    for X, Y in zip((found.K, found.M, found.C, found.D), matrices, strict=True):
        assert relative(X, Y) <= 1e-8
    assert found.misfit <= 1e-9


def chain(name, masses, springs, joint, frequency):
    """Return receptances of masses in a row with 1 % loss; some are joint coordinates, the rest internal."""
    n = len(masses)
    K = np.zeros((n, n))
    for i, k in enumerate(springs):
        K[i : i + 2, i : i + 2] += np.array([[k, -k], [-k, k]])
    omega = 2 * np.pi * frequency[:, None, None]
    H = np.linalg.inv(K * (1 + 0.01j) - omega**2 * np.diag(masses))
    b = list(joint)
    a = [i for i in range(n) if i not in joint]
    labels = [CoordinateSet(tuple(f"{name}{i}:x" for i in part)) for part in (b, a)]
    return SubstructureFRF(
        frequency,
        Interface(labels[0], labels[1], labels[1]),
        H[:, a][:, :, a],
        H[:, a][:, :, b],
        H[:, b][:, :, a],
        H[:, b][:, :, b],
    )


def test_three_substructures_and_two_joints_in_one_identification():
    """A holds both joints; Z_j of four coordinates is block-diagonal by joint and comes out so."""
    frequency = np.linspace(2.0, 40.0, 60)
    pieces = [
        chain("A", [1.0, 2.0, 0.5, 1.2, 0.7], [8e3, 5e3, 9e3, 6e3], [0, 4], frequency),
        chain("B", [0.8, 0.6, 1.0], [4e3, 7e3], [0], frequency),
        chain("C", [1.1, 0.9, 0.4], [6e3, 7e3], [2], frequency),
    ]
    whole = stack_substructures(*pieces)
    assert whole.interface.joint.labels == ("A0:x", "A4:x", "B0:x", "C2:x")
    first, second = CoordinateSet(("A4:x", "B0:x")), CoordinateSet(("C2:x", "A0:x"))
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
    blocks = [
        (first, joint_impedance(frequency, 3e3 * spring, C=2.0 * spring)),
        (second, joint_impedance(frequency, 9e3 * spring, 0.2 * np.eye(2), D=500.0 * spring)),
    ]
    Z = stack_joints(whole.interface.joint, blocks)
    found = identify_joint(whole, frequency, couple(whole, Z).H_nn)
    # a line's error is rounding times its own amplification
    error = np.linalg.norm(found.Z - Z, axis=(1, 2)) / np.linalg.norm(Z, axis=(1, 2))
    assert found.regular.mean() > 0.9
    assert (error <= 100 * np.finfo(float).eps * found.amplification).all()
    assert error[found.regular].max() <= 1e-9
    # between the two joints there is nothing
    apart = [(0, 1), (0, 2), (1, 3), (2, 3)]
    assert max(abs(found.Z[found.regular, i, j]).max() for i, j in apart) <= 1e-9 * abs(Z).max()


def test_a_spring_of_two_coordinates_in_a_chain_against_its_closed_form():
    """Mass 1 - k1 - mass 2 ~ joint ~ mass 3 - k3 - mass 4; the assembly's H as written out by hand.

    A pair m, M on a spring k has H of the inner mass, the cross and the outer one

        H_aa = (k - ω² M) / Δ,   H_ab = k / Δ,   H_bb = (k - ω² m) / Δ,   Δ = (k - ω² m)(k - ω² M) - k²

    and two such pairs joined by Z = z [1 -1; -1 1] have a drive point less H_ab² / (1/z + H_bb + H_bb').
    """
    frequency = np.linspace(3.0, 60.0, 80)
    w2 = (2 * np.pi * frequency) ** 2
    pairs = ((2e4 * (1 + 0.02j), 0.5, 1.5), (5e4 * (1 + 0.01j), 0.8, 0.6))
    pieces, H = [], []
    for name, (k, m, M) in zip("PQ", pairs, strict=True):
        delta = (k - w2 * m) * (k - w2 * M) - k**2
        aa, ab, bb = (k - w2 * M) / delta, k / delta, (k - w2 * m) / delta
        H.append((aa, ab, bb))
        joint, inner = CoordinateSet((f"{name}1:x",)), CoordinateSet((f"{name}0:x",))
        pieces.append(
            SubstructureFRF(
                frequency, Interface(joint, inner, inner), *(v[:, None, None] for v in (aa, ab, ab, bb))
            )
        )
    z = 7e3 + 1j * 2 * np.pi * frequency * 4.0 + 90j
    through = 1 / (1 / z + H[0][2] + H[1][2])
    H_nn = np.empty((frequency.size, 2, 2), dtype=complex)
    for i, (aa, ab, _) in enumerate(H):
        H_nn[:, i, i] = aa - ab**2 * through
    H_nn[:, 0, 1] = H_nn[:, 1, 0] = H[0][1] * H[1][1] * through
    found = identify_joint(stack_substructures(*pieces), frequency, H_nn)
    expected = z[:, None, None] * np.array([[1, -1], [-1, 1]])
    use = found.regular
    assert use.all()
    assert_allclose(found.Z, expected, rtol=1e-9)
