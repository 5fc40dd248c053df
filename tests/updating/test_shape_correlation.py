"""Criteria of shapes against closed forms, hand-worked numbers and their own symmetries."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fem
from fem.reduction import reduce_guyan, reduce_serep
from tests.frames import beam, fix
from tests.noise import complex_normal
from updating.correlation import shape_correlation as sc

modest = settings(max_examples=30, derandomize=True, deadline=None)
seeds = st.integers(0, 2**31)


def phases(rng, n):
    return rng.uniform(0.1, 10, n) * np.exp(1j * rng.uniform(0, 2 * np.pi, n))


# ----------------------------------------------------------------------------------------------- closed forms


def test_one_sensor_with_a_wrong_gain_has_the_predicted_mac_and_is_found_by_elimination():
    """x = a but for x_k = g a_k: MAC = (S + (g - 1) p)² / (S (S + (g² - 1) p)) with S = Σa², p = a_k²."""
    rng = np.random.default_rng(1)
    a, k, g = rng.standard_normal((9, 3)), 4, -2.5
    x = a.copy()
    x[k] *= g
    S, p = (a**2).sum(axis=0), a[k] ** 2
    predicted = (S + (g - 1) * p) ** 2 / (S * (S + (g**2 - 1) * p))
    np.testing.assert_allclose(np.diag(sc.mac(x, a)), predicted, rtol=1e-13)
    np.testing.assert_allclose(sc.mac_without(x, a)[k], 1, rtol=1e-12)
    found = sc.eliminate_coordinates(x, a)
    assert found.order[0] == k
    np.testing.assert_allclose(found.mac[0], predicted, rtol=1e-13)
    np.testing.assert_allclose(found.mac[1:], 1, rtol=1e-12)
    assert found.gain[0] == pytest.approx(1 - predicted.mean())


def test_comac_of_a_sensor_that_reads_differently_in_each_mode():
    """Scaled by the factor s_r, its row has (Σ g s p)² / (Σ (g s)² p · Σ p) with p = a_k²."""
    rng = np.random.default_rng(2)
    a, k, g = rng.standard_normal((6, 4)), 2, np.array([1.0, 0.2, 3.0, -1.5])
    x = a.copy()
    x[k] = g * a[k]
    S, p = (a**2).sum(axis=0), a[k] ** 2
    s = (S + (g - 1) * p) / (S + (g**2 - 1) * p)
    np.testing.assert_allclose(sc.modal_scale_factor(x, a), s, rtol=1e-13)
    w = np.abs(g * s)
    assert sc.comac(x, a)[k] == pytest.approx((w * p).sum() ** 2 / ((w**2 * p).sum() * p.sum()), rel=1e-12)
    others = np.delete(np.arange(6), k)
    q = a[others] ** 2
    expected = (np.abs(s) * q).sum(axis=1) ** 2 / ((s**2 * q).sum(axis=1) * q.sum(axis=1))
    np.testing.assert_allclose(sc.comac(x, a)[others], expected, rtol=1e-12)


def test_a_reversed_sensor_is_hidden_from_comac_and_seen_by_ecomac():
    a = np.array([[1.0, 0.5], [0.4, -1.0], [0.2, 0.3]])
    x = a * [-3.0, 0.01]
    x[2] *= -1
    # two modes with their scale factors 1 - 2 p/S and so, whose ratio is all that CoMAC sees
    assert sc.comac(x, a)[2] > 0.99
    np.testing.assert_allclose(sc.ecomac(x, a), [0, 0, (0.2 + 0.3) / 2], atol=1e-15)
    gain = a * 1.0
    gain[1, 0] *= 0.25
    np.testing.assert_allclose(sc.ecomac(gain, a), [0, 0.3 / 4, 0], atol=1e-15)


def test_comac_is_blind_to_uniform_factors_and_phases_of_modes():
    rng = np.random.default_rng(3)
    a = complex_normal(rng, (7, 3))
    np.testing.assert_allclose(sc.comac(a * phases(rng, 3), a), 1, rtol=1e-12)
    np.testing.assert_allclose(sc.ecomac(a * phases(rng, 3), a), 0, atol=1e-14)
    assert sc.comac(a[:, :1], complex_normal(rng, (7, 1))) == pytest.approx(np.ones(7))


def test_criteria_of_a_table_worked_by_hand():
    """Three DOFs and two modes in whole numbers; every sum is written out."""
    a = np.array([[1, 2], [2, -1], [2, 2]])
    x = np.array([[1, 1], [2, -1], [1, 2]])
    # mode 1: x·a = 1 + 4 + 2 = 7, x·x = 6, a·a = 9; mode 2: 2 + 1 + 4 = 7, x·x = 6, a·a = 9
    np.testing.assert_allclose(np.diag(sc.mac(x, a)), float(Fraction(49, 54)), rtol=1e-15)
    # off the diagonal: x1·a2 = 2 - 2 + 2 = 2, x2·a1 = 1 - 2 + 4 = 3
    assert sc.mac(x, a)[0, 1] == pytest.approx(float(Fraction(4, 54)), rel=1e-15)
    assert sc.mac(x, a)[1, 0] == pytest.approx(float(Fraction(9, 54)), rel=1e-15)
    np.testing.assert_allclose(sc.modal_scale_factor(x, a), float(Fraction(7, 6)), rtol=1e-15)
    # both factors are equal and cancel: rows (1·1 + 1·2)²/(2·5), (4 + 1)²/(5·5), (1·2 + 2·2)²/(5·8)
    np.testing.assert_allclose(sc.comac(x, a), [9 / 10, 1, 36 / 40], rtol=1e-14)
    # largest one: a = (½ 1; 1 -½; 1 1), x = (½ ½; 1 -½; ½ 1)
    np.testing.assert_allclose(sc.ecomac(x, a), [0.5 / 4, 0, 0.5 / 4], atol=1e-15)
    # without DOF 0 mode 1 has (4 + 2)²/(5·8), mode 2 (1 + 4)²/(5·5)
    np.testing.assert_allclose(sc.mac_without(x, a)[0], [36 / 40, 1], rtol=1e-13)
    M = np.diag([4.0, 1.0, 1.0])
    # x1ᵀMa1 = 4 + 4 + 2 = 10, x1ᵀMx1 = 4 + 4 + 1 = 9, a1ᵀMa1 = 4 + 4 + 4 = 12
    assert sc.cross_orthogonality(x, a, M)[0, 0] == pytest.approx(10 / np.sqrt(108), rel=1e-14)


def test_principal_angles_of_planes_that_share_a_line():
    t = 1e-9
    first = np.array([[1.0, 0], [0, 1], [0, 0]])
    second = np.array([[1.0, 0], [0, np.cos(t)], [0, np.sin(t)]]) @ [[2.0, 1], [-1, 3]]
    np.testing.assert_allclose(sc.principal_angles(first, second), [0, t], rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(sc.principal_angles(first, [[0], [0], [5.0]]), [np.pi / 2])
    np.testing.assert_allclose(sc.subspace_mac([[1.0], [1], [1]], first), 2 / 3)


def test_random_shapes_have_the_expected_part_in_a_subspace():
    """‖Px‖²/‖x‖² of Gaussian x is beta-distributed: mean m/n, variance 2 m (n - m) / (n² (n + 2))."""
    rng = np.random.default_rng(4)
    n, m, many = 12, 3, 20_000
    part = sc.subspace_mac(rng.standard_normal((n, many)), rng.standard_normal((n, m)))
    sigma = np.sqrt(2 * m * (n - m) / (n**2 * (n + 2)) / many)
    assert abs(part.mean() - m / n) < 4 * sigma


# ----------------------------------------------------------------------------------------------------- masses


@pytest.fixture(scope="module")
def cantilever():
    system = fem.assemble(beam(12, effects=(fix(0),)))
    modes = fem.solve_modes(system, n=12)
    z = np.abs(modes.shapes[2::6]).max(axis=0)
    bending = np.flatnonzero(z > 0.5 * z.max())[:4]
    return system, modes.shapes[:, bending], modes.frequency[bending]


def test_reduced_masses_make_computed_modes_as_orthogonal_as_predicted(cantilever):
    """Guyan's shape errs by e = K_oo⁻¹ω²(Mφ)_o.

    And ‖e‖_M ≤ (ω/Ω)² with Ω the lowest frequency of the structure held at the kept DOFs, since
    (Mφ)_oᵀM_oo⁻¹(Mφ)_o ≤ φᵀMφ = 1. So products err by at most ε_r + ε_s + ε_rε_s. SEREP's modes
    are its own, hence orthogonal exactly."""
    system, phi, frequency = cantilever
    points = np.argsort(system.model.mesh.points[:, 0])[[3, 6, 9, 12]]
    keep = [(int(p), d) for p in points for d in ("x", "y", "z", "rx")]
    rows = [6 * p + {"x": 0, "y": 1, "z": 2, "rx": 3}[d] for p, d in keep]
    held = system.model.with_effect(
        *(fem.Support(name=f"held {p}", point=int(p), fixed=("x", "y", "z", "rx")) for p in points)
    )
    lowest = fem.solve_modes(fem.assemble(held), n=1).frequency[0]
    e = (frequency / lowest) ** 2
    assert e[1] < 0.05
    guyan = reduce_guyan(system, keep)
    products = phi[rows].T @ guyan.M @ phi[rows]
    assert (np.abs(products - np.eye(4)) <= e[:, None] + e + np.outer(e, e) + 1e-9).all()
    size = np.sqrt(np.diag(products))
    np.testing.assert_allclose(
        sc.orthogonality(phi[rows], guyan.M), products / np.outer(size, size), atol=1e-12
    )
    free = system.Q.T @ phi
    np.testing.assert_allclose(sc.orthogonality(free, system.M.toarray()), np.eye(4), atol=1e-8)
    serep = reduce_serep(system, keep, n_modes=8)
    own = serep.modes(8).shapes[rows]
    np.testing.assert_allclose(sc.cross_orthogonality(own, own * -2, serep.M), -np.eye(8), atol=1e-6)


def test_masses_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"shape \(2, 2\); 3 DOFs need \(3, 3\)"):
        sc.orthogonality(np.eye(3), np.eye(2))
    with pytest.raises(ValueError, match="mode 2 of phi_x has the modal mass 0"):
        sc.orthogonality(np.eye(3), np.diag([1.0, 1, 0]))
    with pytest.raises(ValueError, match="2 and 3 shapes"):
        sc.comac(np.ones((4, 2)), np.ones((4, 3)))


# ------------------------------------------------------------------------------------------------- properties


@modest
@given(seeds, st.integers(3, 8), st.integers(1, 3))
def test_ranges_and_invariances(seed, n_dof, n_modes):
    rng = np.random.default_rng(seed)
    x, a = complex_normal(rng, (n_dof, n_modes)), complex_normal(rng, (n_dof, n_modes))
    for criterion in (sc.comac, sc.ecomac, sc.mac_without):
        value = criterion(x, a)
        assert ((value >= 0) & (value <= 1)).all()
        assert len(value) == n_dof
        np.testing.assert_allclose(criterion(x * phases(rng, n_modes), a), value, atol=1e-9)
        order = rng.permutation(n_modes)
        again = criterion(x[:, order], a[:, order])
        np.testing.assert_allclose(again, value[:, order] if value.ndim == 2 else value, atol=1e-12)
    one = sc.auto_mac(x)
    np.testing.assert_allclose(one, one.T, atol=1e-12)
    np.testing.assert_allclose(np.diag(one), 1, rtol=1e-12)
    np.testing.assert_allclose(
        np.abs(sc.cross_orthogonality(x, a, 3 * np.eye(n_dof))) ** 2, sc.mac(x, a), atol=1e-12
    )


@modest
@given(seeds, st.integers(3, 8), st.integers(1, 3))
def test_leaving_a_dof_out_is_deleting_its_row(seed, n_dof, n_pairs):
    rng = np.random.default_rng(seed)
    x, a = complex_normal(rng, (n_dof, n_pairs)), complex_normal(rng, (n_dof, n_pairs))
    deleted = [np.diag(sc.mac(np.delete(x, i, 0), np.delete(a, i, 0))) for i in range(n_dof)]
    np.testing.assert_allclose(sc.mac_without(x, a), deleted, rtol=1e-9, atol=1e-12)
    found = sc.eliminate_coordinates(x, a)
    rest = np.delete(np.arange(n_dof), found.order)
    assert rest.size == 2
    np.testing.assert_allclose(np.diag(sc.mac(x[rest], a[rest])), found.mac[-1], atol=1e-12)


@modest
@given(seeds, st.integers(1, 3), st.integers(1, 3))
def test_subspaces_do_not_depend_on_their_basis(seed, m, k):
    rng = np.random.default_rng(seed)
    x, a = complex_normal(rng, (8, m)), complex_normal(rng, (8, k))
    angles = sc.principal_angles(x, a)
    np.testing.assert_allclose(sc.principal_angles(x @ complex_normal(rng, (m, m)), a), angles, atol=1e-8)
    np.testing.assert_allclose(sc.principal_angles(a, x), angles, atol=1e-10)
    part = sc.subspace_mac(x, a)
    assert (part >= sc.mac(x, a).max(axis=1) - 1e-12).all()
    np.testing.assert_allclose(sc.subspace_mac(a @ complex_normal(rng, (k, 2)), a), 1, rtol=1e-10)
    if m == 1:
        np.testing.assert_allclose(np.cos(angles) ** 2, part, atol=1e-10)


# ----------------------------------------------------------------------------------------------------- gaps


@modest
@given(seeds)
def test_a_gap_is_left_out_of_its_own_shape_alone(seed):
    """Every criterion is that of the DOFs which the shapes have, each pair or DOF taken by itself."""
    rng = np.random.default_rng(seed)
    x, a = complex_normal(rng, (9, 4)), complex_normal(rng, (9, 4))
    x[3:, :3][rng.random((6, 3)) < 0.4] = np.nan  # one shape and a few DOFs have no gaps
    known = ~np.isnan(x)
    mac = sc.mac(x, a)
    for i in range(4):
        rows = known[:, i]
        np.testing.assert_allclose(mac[i], sc.mac(x[rows, i], a[rows])[0], rtol=1e-12)
        np.testing.assert_allclose(
            sc.subspace_mac(x, a[:, :2])[i], sc.subspace_mac(x[rows, i], a[rows, :2])[0], rtol=1e-11
        )
        factor = sc.modal_scale_factor(x[rows, i], a[rows, i])[0]
        np.testing.assert_allclose(sc.modal_scale_factor(x, a)[i], factor, rtol=1e-12)
        for k in np.flatnonzero(rows):
            left = rows & (np.arange(9) != k)
            np.testing.assert_allclose(
                sc.mac_without(x, a)[k, i], sc.mac(x[left, i], a[left, i])[0, 0], rtol=1e-11
            )
        for k in np.flatnonzero(~rows):
            np.testing.assert_allclose(sc.mac_without(x, a)[k, i], mac[i, i], rtol=1e-12)
    scaled = x * sc.modal_scale_factor(x, a)
    for k in range(9):
        one, other = np.abs(scaled[k, known[k]]), np.abs(a[k, known[k]])
        expected = (one @ other) ** 2 / ((one @ one) * (other @ other))
        np.testing.assert_allclose(sc.comac(x, a)[k], expected, rtol=1e-11)


def test_gaps_of_both_shapes_leave_the_dofs_that_both_have():
    x = np.array([[1.0], [2.0], [np.nan], [3.0]])
    a = np.array([[2.0, 1.0], [np.nan, 1.0], [5.0, 1.0], [6.0, 1.0]])
    # over DOFs 0 and 3 the shapes are (1, 3) and (2, 6); over 0, 1 and 3 (1, 2, 3) and (1, 1, 1)
    np.testing.assert_allclose(sc.mac(x, a), [[1.0, 36 / (14 * 3)]], rtol=1e-14)
    np.testing.assert_allclose(sc.auto_mac(x), [[1.0]], rtol=1e-14)
    np.testing.assert_allclose(sc.mac(1e-200 * x, a), sc.mac(x, a), rtol=1e-14)


def test_a_dof_that_no_shape_has_is_not_rated():
    rng = np.random.default_rng(8)
    x, a = rng.standard_normal((5, 3)), rng.standard_normal((5, 3))
    x[2] = np.nan
    for criterion in (sc.comac, sc.ecomac):
        value = criterion(x, a)
        np.testing.assert_array_equal(np.isnan(value), np.arange(5) == 2)
        np.testing.assert_allclose(
            np.delete(value, 2), criterion(np.delete(x, 2, 0), np.delete(a, 2, 0)), rtol=1e-13
        )


def test_orthogonality_needs_every_dof():
    x = np.ones((3, 2))
    x[1, 1] = np.nan
    with pytest.raises(ValueError, match=r"phi_x are not finite numbers, the first at DOF 1, mode 1"):
        sc.orthogonality(x, np.eye(3))
