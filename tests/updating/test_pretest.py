"""Sensors and exciters on structures whose best places are known, and against every other set."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fem
from updating import auto_mac
from updating.measurement import pretest as pt

modest = settings(max_examples=25, derandomize=True, deadline=None)
seeds = st.integers(0, 2**31)


def off_diagonal(phi):
    m = auto_mac(phi)
    return (m - np.diag(np.diag(m))).max()


@modest
@given(seeds, st.integers(1, 4))
def test_effective_independence_is_the_loss_of_information(seed, n_modes):
    """det(Φ'ᵀΦ') of the rows without DOF i is (1 - E_i) det(ΦᵀΦ); the sum of E is the number of modes."""
    rng = np.random.default_rng(seed)
    phi = rng.standard_normal((9, n_modes))
    E = pt.effective_independence(phi)
    assert E.sum() == pytest.approx(n_modes, rel=1e-10)
    assert ((E >= 0) & (E <= 1 + 1e-12)).all()
    whole = np.linalg.det(phi.T @ phi)
    for i in range(9):
        rest = np.delete(phi, i, axis=0)
        assert np.linalg.det(rest.T @ rest) == pytest.approx((1 - E[i]) * whole, rel=1e-8, abs=1e-12 * whole)
    np.testing.assert_allclose(pt.effective_independence(phi * rng.uniform(0.01, 9, n_modes)), E, rtol=1e-8)


@modest
@given(seeds)
def test_updated_values_leave_out_the_dofs_that_fresh_ones_would(seed):
    rng = np.random.default_rng(seed)
    phi = rng.standard_normal((90, 4))
    left = np.arange(90)
    while left.size > 6:
        E = pt.effective_independence(phi[left])
        left = np.delete(left, np.argmin(np.where(left == 3, np.inf, E)))
    np.testing.assert_array_equal(pt.place_by_effective_independence(phi, 6, keep=[3]), left)


@modest
@given(seeds)
def test_no_single_exchange_lowers_the_largest_mac(seed):
    rng = np.random.default_rng(seed)
    phi = rng.standard_normal((14, 3))
    chosen = pt.place_by_auto_mac(phi, 5, keep=[0])
    assert 0 in chosen
    assert len(set(chosen.tolist())) == 5
    best = off_diagonal(phi[chosen])
    for out in set(chosen.tolist()) - {0}:
        for into in set(range(14)) - set(chosen.tolist()):
            other = [into if k == out else k for k in chosen.tolist()]
            assert off_diagonal(phi[other]) > best - 2e-9


def test_placements_against_all_sets():
    """Both are heuristics: they must be among the best 2 % of all 1001 sets."""
    x = np.arange(1, 15) / 15
    phi = np.sin(np.pi * np.outer(x, [1, 2, 3]))
    sets = [list(c) for c in combinations(range(14), 4)]
    det = [np.linalg.det(phi[c].T @ phi[c]) for c in sets]
    chosen = pt.place_by_effective_independence(phi, 4)
    rank = np.mean(np.array(det) > np.linalg.det(phi[chosen].T @ phi[chosen]) * (1 + 1e-9))
    assert rank < 0.02
    least = [off_diagonal(phi[c]) for c in sets]
    rank = np.mean(np.array(least) < off_diagonal(phi[pt.place_by_auto_mac(phi, 4)]) - 1e-9)
    assert rank < 0.02


def test_sensors_at_equal_spaces_confuse_the_modes_that_sampling_says():
    """sin(nπx) at x = k/6 for k = 1 … 5: modes n and 12 - n are the same but for sign, mode 6 is not seen."""
    x = np.arange(1, 60) / 60
    phi = np.sin(np.pi * np.outer(x, [1, 2, 6, 10, 11]))
    seen = pt.assess_sensors(phi, [9, 19, 29, 39, 49])
    assert [(i, j) for i, j, _ in seen.confused] in ([(0, 4), (1, 3)], [(1, 3), (0, 4)])
    np.testing.assert_allclose([v for *_, v in seen.confused], 1, rtol=1e-10)
    assert seen.poorly_seen == (2,)
    assert seen.rank == 2
    assert seen.condition == np.inf
    good = pt.assess_sensors(phi, pt.place_by_auto_mac(phi, 7))
    assert good.rank == 5
    assert good.largest_off_diagonal < 0.1
    assert not good.confused


def test_exciters_avoid_nodes():
    """sin²(πx) and sin²(2πx) of two modes: the lesser is largest where both are equal, at 1/3."""
    x = np.arange(1, 30) / 30
    phi = np.sin(np.pi * np.outer(x, [1, 2]))
    (place,) = pt.place_exciters(phi, [10.0, 40.0], 1)
    assert x[place] in (pytest.approx(1 / 3), pytest.approx(2 / 3))
    np.testing.assert_allclose(
        pt.driving_point_residues(phi, [10.0, 40.0])[place], 0.75 / (4 * np.pi * np.array([10.0, 40.0]))
    )
    rng = np.random.default_rng(3)
    many, f = rng.standard_normal((9, 4)), np.arange(1.0, 5)
    relative = many**2 / (many**2).max(axis=0)

    def worst(pair):
        return np.minimum(relative[list(pair)].sum(axis=0), 1).min()

    a, b = (int(k) for k in pt.place_exciters(many, f, 2))
    for other in [(a, k) for k in range(9) if k != a] + [(b, k) for k in range(9) if k != b]:
        assert worst(other) <= worst((a, b)) + 1e-8
    single = pt.place_exciters(np.eye(3), [1.0, 2, 3], 3)
    assert sorted(single.tolist()) == [0, 1, 2]  # one for each mode


def frame():
    mesh = fem.Mesh.from_lines(
        [[0, 0, 0], [0, 0, 1], [0.8, 0, 1]], [[0, 1], [1, 2]], {"post": [0], "arm": [1]}
    )
    mesh = mesh.refined(counts={"post": 8, "arm": 8})
    bar = fem.MemberProperties(fem.Material("steel", 210e9, 7850.0), fem.Section.rectangle(0.03, 0.02))
    foot = int(mesh.member_points("post")[0])
    return fem.Model(
        mesh, (fem.Frame(members={"post": bar, "arm": bar}), fem.Support(name="foot", point=foot))
    )


@pytest.mark.parametrize("method", ["effective independence", "auto mac"])
def test_a_plan_tells_its_modes_apart(method):
    model = frame()
    modes = fem.solve_modes(fem.assemble(model), n=6)
    plan = pt.plan_pretest(model, modes, 9, 2, method=method)
    assert plan.observability.rank == 6
    assert not plan.observability.confused
    assert len({s.name for s in plan.sensors}) == 9
    assert (plan.driven > 0.3).all()
    for sensor, row in zip(plan.sensors, plan.sensor_rows, strict=True):
        p, d = plan.candidates[int(row)]
        assert sensor.name == f"{p}{d.upper()}+"
        np.testing.assert_array_equal(sensor.point, model.mesh.points[p])
    flat = pt.plan_pretest(model, modes, 6, candidates=plan.candidates)
    assert "6 sensors" in flat.summary()
    with pytest.raises(ValueError, match=r"candidate \(99, 'z'\) is not in the mesh"):
        pt.plan_pretest(model, modes, 6, candidates=[(99, "z")])
    sideways = [(p, "y") for p in range(model.mesh.n_points)]
    with pytest.raises(ValueError, match=r"moves none of|cannot distinguish the modes"):
        pt.plan_pretest(model, modes, 6, candidates=sideways)


def test_what_cannot_be_asked_is_refused():
    phi = np.random.default_rng(1).standard_normal((5, 3))
    with pytest.raises(ValueError, match="2 sensors cannot distinguish 3 modes"):
        pt.place_by_effective_independence(phi, 2)
    with pytest.raises(ValueError, match="6 DOFs are asked for"):
        pt.place_by_auto_mac(phi, 6)
    with pytest.raises(ValueError, match="must differ"):
        pt.place_by_auto_mac(phi, 4, keep=[1, 1])
    with pytest.raises(ValueError, match="cannot distinguish the modes 0, 1"):
        pt.effective_independence(phi[:, [0, 0]])
    with pytest.raises(ValueError, match="complex"):
        pt.effective_independence(1j * phi)
    with pytest.raises(ValueError, match="3 positive ones"):
        pt.driving_point_residues(phi, [0, 1, 2])
