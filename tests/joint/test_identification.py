"""What the direct solution gives back, and what it refuses."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from joint import (
    CoordinateSet,
    Interface,
    JointIdentificationError,
    SubstructureFRF,
    characteristic_length,
    coordinates_of,
    couple,
    identify_joint,
    joint_impedance,
    relative_joint,
)
from tests.noise import complex_normal

FREQUENCY = np.array([10.0, 20.0, 30.0])


def structure(n_out, n_in, joint, seed=0):
    """Return random well-conditioned receptances, about 1e-6 m/N, with `joint` labels at the interface."""
    rng = np.random.default_rng(seed)

    def receptance(rows, columns):
        return 1e-6 * complex_normal(rng, (3, rows, columns))

    n = len(joint)
    interface = Interface(
        CoordinateSet(tuple(joint)),
        coordinates_of(range(n_out), ["z"]),
        coordinates_of(range(n_in), ["z"]),
    )
    blocks = receptance(n_out, n_in), receptance(n_out, n), receptance(n, n_in), receptance(n, n)
    return SubstructureFRF(FREQUENCY, interface, *blocks)


def with_blocks(frf, **blocks):
    every = {name: blocks.get(name, getattr(frf, name)) for name in ("H_aa", "H_ab", "H_ba", "H_bb")}
    return SubstructureFRF(frf.frequency, frf.interface, **every)


TWO = ("A:z", "B:z")
K2 = 1e6 * np.array([[3.0, -1.0], [-1.0, 2.0]])


def test_scalar_joint_follows_the_written_out_formula():
    frf = structure(1, 1, ["A:z"])
    H_nn = structure(1, 1, ["A:z"], seed=1).H_aa
    H_aa, H_ab, H_ba, H_bb = (getattr(frf, name)[:, 0, 0] for name in ("H_aa", "H_ab", "H_ba", "H_bb"))
    C = H_aa - H_nn[:, 0, 0]
    found = identify_joint(frf, FREQUENCY, H_nn)
    assert_allclose(found.Z[:, 0, 0], C / (H_ab * H_ba - H_bb * C), rtol=1e-13)


def test_rectangular_receptances_and_a_nonsymmetric_joint():
    frf = structure(5, 3, TWO)
    Z = joint_impedance(FREQUENCY, K2 + np.array([[0, 4e5], [0, 0]]), np.eye(2), [[0, 30.0], [-30.0, 0]])
    found = identify_joint(frf, FREQUENCY, couple(frf, Z).H_nn)
    assert_allclose(found.Z, Z, rtol=1e-11)
    assert found.regular.all()
    assert found.residual.max() < 1e-13


def test_no_joint_is_found_where_nothing_was_joined():
    frf = structure(4, 4, TWO)
    found = identify_joint(frf, FREQUENCY, frf.H_aa)
    assert not found.Z.any()
    assert not found.residual.any()


def test_residual_shows_what_no_joint_explains():
    frf = structure(6, 6, TWO)
    H_nn = couple(frf, joint_impedance(FREQUENCY, K2)).H_nn.copy()
    H_nn[1] += structure(6, 6, TWO, seed=3).H_aa[1]
    residual = identify_joint(frf, FREQUENCY, H_nn).residual
    assert residual[1] > 0.1
    assert residual[[0, 2]].max() < 1e-13


def test_a_massless_joint_needs_only_as_many_coordinates_as_relative_ones():
    levers = {"lever_1": [0.0, 0.0, 0.01], "lever_2": [0.02, 0.0, -0.01]}
    root = np.random.default_rng(4).standard_normal((6, 6))
    arm = np.diag([1, 1, 1, 0.02, 0.02, 0.02])
    joint = relative_joint(1e6 * arm @ root @ root.T @ arm, D=1e4 * arm @ arm, **levers)
    frf = structure(6, 7, coordinates_of(["A", "B"]).labels)
    Z = joint_impedance(FREQUENCY, joint.K, D=joint.D)
    found = identify_joint(frf, FREQUENCY, couple(frf, Z).H_nn, basis=joint.B.T)
    assert found.z.shape == (3, 6, 6)
    weight = np.sqrt(np.abs(np.einsum("fii->fi", Z)))
    assert (np.abs(found.Z - Z) <= 1e-9 * weight[:, :, None] * weight[:, None, :]).all()
    assert_allclose(found.Z, joint.B.T @ found.z @ joint.B, rtol=1e-9, atol=1e-6)


def test_too_few_internal_coordinates_are_refused():
    for n_out, n_in, word in ((1, 4, "outputs"), (4, 1, "inputs")):
        frf = structure(n_out, n_in, TWO)
        with pytest.raises(JointIdentificationError, match=f"1 internal {word} cannot determine 2 joint"):
            identify_joint(frf, FREQUENCY, frf.H_aa)


def test_unseen_combination_of_joint_coordinates_is_named():
    frf = structure(6, 6, ("A:z", "B:z", "C:z"))
    H_ab = frf.H_ab.copy()
    H_ab[:, :, 2] = 0.5 * H_ab[:, :, 0]
    unseen = r"H_ab has rank 2 of 3 at best over 3 lines: .* joint forces \+1.00 C:z -0.50 A:z"
    with pytest.raises(JointIdentificationError, match=unseen):
        identify_joint(with_blocks(frf, H_ab=H_ab), FREQUENCY, frf.H_aa)
    H_ba = frf.H_ba.copy()
    H_ba[:, 1] = 0
    with pytest.raises(JointIdentificationError, match=r"H_ba has rank 2 of 3 .* the joint coordinates B:z;"):
        identify_joint(with_blocks(frf, H_ba=H_ba), FREQUENCY, frf.H_aa)


def test_lines_without_full_rank_are_nan_and_not_regular():
    frf = structure(6, 6, TWO)
    H_ab = frf.H_ab.copy()
    H_ab[1, :, 1] = 0
    frf = with_blocks(frf, H_ab=H_ab)
    Z = joint_impedance(FREQUENCY, K2)
    found = identify_joint(frf, FREQUENCY, couple(frf, Z).H_nn)
    assert found.rank_A.tolist() == [2, 1, 2]
    assert found.regular.tolist() == [True, False, True]
    assert np.isnan(found.Z[1]).all()
    assert_allclose(found.Z[[0, 2]], Z[[0, 2]], rtol=1e-11)


def test_no_regular_line_is_refused():
    frf = structure(6, 6, TWO)
    H_nn = couple(frf, joint_impedance(FREQUENCY, K2)).H_nn
    with pytest.raises(JointIdentificationError, match=r"no line is regular: .* 1.0e\+00 is allowed; least"):
        identify_joint(frf, FREQUENCY, H_nn, amplification_limit=1.0)


def test_data_that_does_not_fit_is_refused():
    frf = structure(4, 3, TWO)
    with pytest.raises(ValueError, match=r"H_nn has shape \(3, 3, 4\); \(3, 4, 3\) is needed"):
        identify_joint(frf, FREQUENCY, np.ones((3, 3, 4)))
    with pytest.raises(ValueError, match="H_nn has 2 frequency lines, against 3 of the substructures"):
        identify_joint(frf, FREQUENCY[:2], frf.H_aa[:2])
    bad = frf.H_aa.copy()
    bad[2, 3, 1] = np.nan
    with pytest.raises(ValueError, match=r"H_nn holds 1 .* line 2 \(30 Hz\), row 3:z, column 1:z"):
        identify_joint(frf, FREQUENCY, bad)
    with pytest.raises(ValueError, match=r"basis has shape \(3, 1\); \(2, p\)"):
        identify_joint(frf, FREQUENCY, frf.H_aa, basis=np.ones((3, 1)))
    with pytest.raises(ValueError, match="dependent"):
        identify_joint(frf, FREQUENCY, frf.H_aa, basis=np.ones((2, 2)))
    with pytest.raises(ValueError, match=r"length is 0\.0 m"):
        identify_joint(frf, FREQUENCY, frf.H_aa, length=0.0)


def test_characteristic_length_balances_rotations():
    coordinates = CoordinateSet(("A:z", "A:rx"))
    H = np.zeros((1, 2, 2), dtype=complex)
    H[0] = np.diag([4e-6, 1e-2])
    assert characteristic_length(H, coordinates) == pytest.approx(0.02)
    assert characteristic_length(H, CoordinateSet(("A:z", "A:y"))) == 1.0


def test_joint_does_not_depend_on_the_characteristic_length():
    frf = structure(15, 15, coordinates_of(["A", "B"]).labels)
    arm = np.diag([1, 1, 1, 0.02, 0.02, 0.02] * 2)
    Z = joint_impedance(FREQUENCY, 1e6 * arm @ arm)
    H_nn = couple(frf, Z).H_nn
    for length in (0.1, 1.0):
        found = identify_joint(frf, FREQUENCY, H_nn, length=length)
        assert found.length == length
        assert_allclose(found.Z, Z, rtol=1e-8, atol=1e-5)


def test_deviations_are_what_noise_scatters_to():
    """Relative noise of 1e-6 is small enough for first order; a deviation from 400 draws strays by 3.5 %."""
    frf = structure(6, 5, TWO)
    Z = joint_impedance(FREQUENCY, K2, C=30 * K2 / 1e6)
    H = couple(frf, Z).H_nn
    basis = np.array([[1.0, 2.0], [-3.0, 1.0]])
    stated = identify_joint(frf, FREQUENCY, H, noise=1e-6, basis=basis)
    rng = np.random.default_rng(0)
    draws = []
    for _ in range(400):
        noise = complex_normal(rng, H.shape) / np.sqrt(2)
        draws.append(identify_joint(frf, FREQUENCY, H * (1 + 1e-6 * noise), basis=basis))
    for name, std in (("Z", stated.Z_std), ("z", stated.z_std)):
        found = np.array([getattr(draw, name) for draw in draws])
        assert_allclose(found.real.std(axis=0), std.real, rtol=0.15)
        assert_allclose(found.imag.std(axis=0), std.imag, rtol=0.15)
    absolute = identify_joint(frf, FREQUENCY, H, noise=1e-6 * np.abs(H))
    assert_allclose(absolute.Z_std, stated.Z_std, rtol=1e-9)
    assert draws[0].Z_std is None


@pytest.mark.parametrize(
    ("noise", "message"),
    [(-0.1, "positive and finite"), (np.ones(7), "a number or an array that broadcasts")],
)
def test_noise_that_cannot_be_is_refused(noise, message):
    frf = structure(6, 5, TWO)
    H = couple(frf, joint_impedance(FREQUENCY, K2)).H_nn
    with pytest.raises(ValueError, match=message):
        identify_joint(frf, FREQUENCY, H, noise=noise)


def test_the_result_says_what_was_reduced():
    frf = structure(6, 5, TWO)
    found = identify_joint(frf, FREQUENCY, couple(frf, joint_impedance(FREQUENCY, K2)).H_nn)
    assert found.reduced == dict.fromkeys("AB", ("x", "y", "rx", "ry", "rz"))
    assert not coordinates_of([1, 2]).lacking
