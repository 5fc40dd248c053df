"""Modes are paired by shape and frequency, close ones as subspaces, and what has no partner is said."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fem
from updating import compare_modes, mac, pair_modes, track_modes

modest = settings(max_examples=30, derandomize=True, deadline=None)


def measured(frequency, shapes):
    return fem.Modes(frequency, np.real(shapes))


def square_bar():
    """Return a cantilever whose bending modes come in pairs, its modes, and rows of y and z sensors."""
    mesh = fem.Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]], {"bar": [0]}).refined(counts={"bar": 8})
    bar = fem.MemberProperties(fem.Material("steel", 210e9, 7850.0), fem.Section.rectangle(0.02, 0.02))
    model = fem.Model(mesh, (fem.Frame(members={"bar": bar}), fem.Support(name="root", point=0)))
    points = np.argsort(mesh.points[:, 0])[[2, 4, 6, 8]]
    rows = np.eye(6 * mesh.n_points)[[6 * p + d for p in points for d in (1, 2)]]
    return fem.solve_modes(fem.assemble(model), n=6), rows


def test_repeated_modes_are_paired_as_a_subspace_whatever_their_basis():
    computed, rows = square_bar()
    assert computed.frequency[:6:2] == pytest.approx(computed.frequency[1:6:2], rel=1e-6)
    seen = rows @ computed.shapes
    turn = np.deg2rad(40)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    mixed = np.hstack([seen[:, 2:4] @ R, seen[:, :2] @ R])
    found = compare_modes(measured(np.array([310.0, 311, 52, 53]), mixed), computed, rows)
    assert np.diag(found.mac[2:, :2]).max() < 0.7  # one by one these are different shapes
    assert [g.measured for g in found.groups] == [(2, 3), (0, 1)]
    assert [g.subspace for g in found.groups] == [(0, 1), (2, 3)]
    for g in found.groups:
        assert g.mac == pytest.approx(1, abs=1e-12)
        np.testing.assert_allclose(g.angles, 0, atol=1e-7)
    assert set(found.pairs) == {(0, 2), (1, 3), (2, 0), (3, 1)}
    assert sorted(found.unpaired_computed) == [4, 5]
    assert not found.unpaired_measured
    assert "close modes" in found.table()
    alone = compare_modes(measured(np.array([52.0]), mixed[:, 2:3]), computed, rows)
    assert alone.groups[0].subspace == (0, 1)
    assert len(alone.groups[0].computed) == 1
    assert alone.groups[0].mac == pytest.approx(1, abs=1e-12)


def test_repeated_modes_with_gaps_of_their_own_are_paired():
    computed, rows = square_bar()
    seen = rows @ computed.shapes
    turn = np.deg2rad(40)
    mixed = seen[:, :2] @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    for gaps in ([0, 1], [5, 0]), ([0, 1, 2, 3], [4, 5, 6, 7]):  # the last have no DOF in common
        x = mixed.copy()
        for k, lacking in enumerate(gaps):
            x[lacking, k] = np.nan
        found = compare_modes(measured(np.array([17.0, 17.2]), x), computed, rows)
        (group,) = found.groups
        assert group.measured == group.computed == (0, 1)
        assert group.mac == pytest.approx(1, abs=1e-12)
        assert group.angles.shape == (2,)


def test_one_mode_identified_twice_takes_one_place_of_a_set():
    computed, rows = square_bar()
    seen = rows @ computed.shapes
    rng = np.random.default_rng(1)
    twice = seen[:, [0, 0]] * [1.0, -2.0] + 1e-3 * rng.standard_normal((8, 2))
    found = compare_modes(measured(np.array([50.0, 50.3]), twice), computed, rows)
    assert len(found.pairs) == 1
    (reason,) = found.unpaired_measured.values()
    assert "repeats measured mode" in reason


def test_the_assignment_is_optimal_where_the_best_first_is_not():
    def at(*angles):
        t = np.deg2rad(angles)
        return np.array([np.cos(t), np.sin(t)])

    x, a = at(0, 35), at(15, -30)
    # MAC: cos²15 = 0.933, cos²30 = 0.75; cos²20 = 0.883, cos²65 = 0.179
    np.testing.assert_allclose(mac(x, a), np.cos(np.deg2rad([[15, 30], [20, 65]])) ** 2, rtol=1e-12)
    found = pair_modes([1, 1.1], x, [1, 1.1], a, frequency_spread=None, close=-1)
    assert set(found.pairs) == {(0, 1), (1, 0)}  # best first takes 0.933 and leaves the second without one
    assert found.pairs[0] == (1, 0)


def test_frequency_decides_between_shapes_that_sensors_cannot_tell_apart():
    shape = np.array([[1.0], [2.0], [1.0]])
    x, a = np.hstack([shape, shape]), np.hstack([shape, shape])
    found = pair_modes([10, 80], x, [11, 76], a)
    assert set(found.pairs) == {(0, 0), (1, 1)}
    far = pair_modes([10], shape, [30, 90], a)
    assert far.pairs == ((0, 0),)
    assert far.unpaired_computed.keys() == {1}
    assert "better partner" in far.unpaired_computed[1]


def test_modes_without_a_partner_are_said_and_why():
    computed, rows = square_bar()
    z = rows[1::2]
    seen = z @ computed.shapes
    sees_z = np.abs(seen).max(axis=0) > 1e-6
    noise = np.random.default_rng(3).standard_normal(4)
    noise -= seen[:, sees_z] @ np.linalg.lstsq(seen[:, sees_z], noise, rcond=1e-6)[0]
    shapes = np.column_stack([seen[:, np.flatnonzero(sees_z)[0]], noise])
    found = compare_modes(measured(np.array([50.0, 140.0]), shapes), computed, z)
    assert len(found.pairs) == 1
    assert found.unpaired_measured[1].startswith("no MAC above 0.")
    if not sees_z.all():  # the solver may turn repeated modes out of the planes
        unseen = np.flatnonzero(~sees_z)
        assert {found.unpaired_computed[int(k)] for k in unseen} == {"the sensors do not see it"}
    text = found.table().splitlines()
    assert len(text) == 1 + 1 + len(found.unpaired_measured) + len(found.unpaired_computed)


def test_a_free_bar_keeps_its_rigid_motions_out():
    rng = np.random.default_rng(5)
    a = rng.standard_normal((6, 4))
    found = pair_modes([5.0], a[:, [0]], [0, 0, 5, 9], a, n_rigid=2)
    assert not any(j < 2 for _, j in found.pairs)
    assert found.unpaired_computed.keys() <= {2, 3}
    with pytest.raises(ValueError, match="frequencies must be positive"):
        pair_modes([5.0], a[:, [0]], [0, 0, 5, 9], a)
    with pytest.raises(ValueError, match="2 measured frequencies are given for 1 shapes"):
        pair_modes([5.0, 6], a[:, [0]], [0, 0, 5, 9], a)


@modest
@given(st.integers(0, 2**31), st.integers(1, 4), st.integers(1, 4))
def test_no_other_assignment_has_a_larger_sum(seed, n, m):
    rng = np.random.default_rng(seed)
    x, a = rng.standard_normal((5, n)), rng.standard_normal((5, m))
    fx, fa = np.sort(rng.uniform(10, 30, n)), np.sort(rng.uniform(10, 30, m))
    found = pair_modes(fx, x, fa, a, least_mac=0.2, frequency_spread=0.5, close=-1)
    score = np.where(mac(x, a) >= 0.2, mac(x, a), 0) * np.exp(-0.5 * (np.log(fa / fx[:, None]) / 0.5) ** 2)
    padded = np.zeros((max(n, m),) * 2)
    padded[:n, :m] = score
    best = max(sum(padded[i, p] for i, p in enumerate(order)) for order in permutations(range(len(padded))))
    assert sum(score[i, j] for i, j in found.pairs) == pytest.approx(best, rel=1e-9)
    assert len({i for i, _ in found.pairs}) == len({j for _, j in found.pairs}) == len(found.pairs)
    assert len(found.unpaired_measured) + len(found.pairs) == n
    assert len(found.unpaired_computed) + len(found.pairs) == m


@modest
@given(st.integers(0, 2**31))
def test_pairs_do_not_depend_on_scale_phase_or_order(seed):
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((12, 5))
    fa = np.sort(rng.uniform(10, 100, 5))
    order = rng.permutation(5)
    x = a[:, order] * rng.uniform(0.1, 9, 5) * np.exp(1j * rng.uniform(0, 6, 5))
    found = pair_modes(fa[order] * 1.05, x, fa, a)
    single = {g.measured[0]: g.computed[0] for g in found.groups if len(g.subspace) == 1}
    for i, j in single.items():
        assert order[i] == j
    assert len(found.pairs) == 5
    np.testing.assert_allclose(found.frequency_error, 1 / 1.05 - 1, atol=0.02)


def test_modes_keep_their_places_where_frequencies_cross():
    """A cantilever's frequencies go with h across it one way and with b the other: they cross at h = b.

    f_y/f_z = b/h of slender beams, so that the order of every pair turns round between h = 0.9 b and 1.1 b.
    """
    mesh = fem.Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]], {"beam": [0]}).split(8)
    steel = fem.Material("steel", 210e9, 7850.0)
    sets, masses = [], []
    for h in (0.009, 0.0095, 0.0105, 0.011):
        part = fem.MemberProperties(steel, fem.Section.rectangle(0.01, h))
        model = fem.Model(mesh, (fem.Frame(members={"beam": part}), fem.Support(name="root", point=0)))
        system = fem.assemble(model)
        sets.append(fem.solve_modes(system, n=4))
        masses.append(system.Q @ system.M @ system.Q.T)
    for mass in (None, masses[0]):
        followed = track_modes(sets, mass)
        np.testing.assert_array_equal(followed[:2], [[0, 1, 2, 3]] * 2)
        np.testing.assert_array_equal(followed[2:], [[1, 0, 3, 2]] * 2)
    along = np.array([m.frequency[row] for m, row in zip(sets, followed, strict=True)])
    assert np.all(np.diff(along[:, [0, 2]], axis=0) > 0)  # across z: with h
    assert np.abs(along[:, [1, 3]] / along[0, [1, 3]] - 1).max() < 1e-3  # across y: with b, which stays


def test_a_mode_that_is_gone_is_lost_and_stays_lost():
    rows = np.eye(3)
    sets = [
        fem.Modes(np.array([1.0, 2.0]), rows[:, :2]),
        fem.Modes(np.array([2.0, 3.0]), rows[:, 1:]),
        fem.Modes(np.array([1.0, 2.0]), rows[:, :2]),
    ]
    np.testing.assert_array_equal(track_modes(sets), [[0, 1], [-1, 0], [-1, 1]])
    with pytest.raises(ValueError, match="rows of shapes"):
        track_modes([sets[0], fem.Modes(np.array([1.0]), np.ones((4, 1)))])
    with pytest.raises(ValueError, match="one set or more"):
        track_modes([])
