"""Slopes of dynamic stiffness that are evaluated on the few motions that they resist."""

import numpy as np
import pytest

from fem.reduction.deviations import _at_places, _by_cost, _complex, _forces, _products
from fem.reduction.slopes_together import together
from fem.reduction.terms import ReducedTerm

RNG = np.random.default_rng(7)
DOFS = np.arange(6)


def part(row, L, force, factor="K"):
    """Return the slope s sᵀ by a quantity, at the DOFs of L."""
    X = np.outer(force, force)
    return row, factor, ReducedTerm(L, X, None, None, None, dofs=DOFS), X


def on_basis(group, k):
    """Return a slope on the basis, (r, r)."""
    A = group.along.astype(float)
    return A.T @ (group.sizes[k] * group.matrices[k].astype(float)) @ A


def test_motions_that_only_later_slopes_resist_are_added():
    L, ranges = RNG.standard_normal((6, 9)), {}
    first, later = RNG.standard_normal((2, 6))
    for force in (first, later, first + later):
        (group,) = together([part(0, L, force)], ranges)
        expected = L.T @ np.outer(force, force) @ L
        np.testing.assert_allclose(on_basis(group, 0), expected, atol=1e-5 * np.abs(expected).max())


def test_a_stiff_spring_keeps_its_small_motion_beside_soft_ones():
    """It moves 1e-5 of what the others do, on the same range: single precision would lose all but 1 %."""
    forces, L = RNG.standard_normal((3, 6)), RNG.standard_normal((6, 9))
    stiff = forces[0]
    L -= (1 - 1e-5) * np.outer(stiff, stiff @ L) / (stiff @ stiff)
    (group,) = together([part(k, L, force) for k, force in enumerate(forces)], {})
    for k, force in enumerate(forces):
        expected = np.outer(force @ L, force @ L)
        np.testing.assert_allclose(on_basis(group, k), expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize(("n_few", "n_many", "n_slopes"), [(1, 30, 1), (2, 30, 12), (3, 4, 5)])
@pytest.mark.parametrize("forward", [True, False])
def test_products_at_places_and_on_the_basis_agree_with_double_precision(n_few, n_many, n_slopes, forward):
    L, (few, many) = RNG.standard_normal((6, 9)), (RNG.standard_normal((4, n, 2, 9)) for n in (n_few, n_many))
    forces = RNG.standard_normal((n_slopes, 2, 6, 6))
    (group,) = together([(k, "K", part(0, L, a[0])[2], a @ b.T) for k, (a, b) in enumerate(forces)], {})
    a, b = (u[:, :, 0] + 1j * u[:, :, 1] for u in (few, many))
    slopes = [L.T @ (x @ y.T) @ L for x, y in forces]
    slopes = np.array([X if forward else X.T for X in slopes])
    expected = np.einsum("lir,mqr,ljq->limj", a, slopes, b, optimize=True)
    few, many = few.astype(np.float32), many.astype(np.float32)
    for on_basis in (False, True):
        (motions,) = [_complex(many)] if on_basis else _at_places(many, [group])
        (products,) = _products([_forces(few, group, forward=forward, on_basis=on_basis)], motions)
        found = products * group.sizes[:, None]
        np.testing.assert_allclose(found, expected, atol=3e-6 * np.abs(expected).max())


def test_the_loss_of_a_whole_member_is_evaluated_on_the_basis_and_many_springs_at_their_place():
    """Motions of 60 ends at a place cost 60 k n products, forces of its slopes on the basis few."""
    L = RNG.standard_normal((6, 40))
    full = [(k, "K", part(0, L, RNG.standard_normal(6))[2], np.eye(6)) for k in range(20)]
    (loss,), (springs,) = (together(parts, {}) for parts in (full[:1], full))
    everywhere, places = _by_cost([loss, springs], 2, 60, 40)
    assert everywhere == [loss]
    assert places == [springs]


def test_inertia_and_stiffness_at_the_same_places_are_apart():
    L, force = RNG.standard_normal((6, 9)), RNG.standard_normal(6)
    groups = together([part(0, L, force), part(0, L, force, "M")], {})
    assert [g.factors for g in groups] == [["K"], ["M"]]
