"""Slopes of dynamic stiffness that are evaluated on the few motions that they resist."""

import numpy as np
import pytest

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


@pytest.mark.parametrize("rows", [[0, 1, 2], [0, 0, 1], [4, 2, 4, 2, 4]])
def test_parts_of_one_slope_are_added_one_after_the_other(rows):
    L = RNG.standard_normal((6, 9))
    (group,) = together([part(row, L, RNG.standard_normal(6)) for row in rows], {})
    assert sorted(np.concatenate(group.passes)) == list(range(len(rows)))
    assert all(len(set(group.rows[which])) == len(which) for which in group.passes)


def test_inertia_and_stiffness_at_the_same_places_are_apart():
    L, force = RNG.standard_normal((6, 9)), RNG.standard_normal(6)
    groups = together([part(0, L, force), part(0, L, force, "M")], {})
    assert [g.factors for g in groups] == [["K"], ["M"]]
