"""Measured and computed modes side by side, against a cantilever in closed form."""

import numpy as np
import pytest

import fem
from tests.frames import beam, fix
from updating import compare_modes


def cantilever(n):
    """Return the mesh and the modes of a 1 m steel cantilever of a flat bar with n elements."""
    model = beam(n, effects=(fix(0),))
    return model.mesh, fem.solve_modes(fem.assemble(model), n=8)


def test_modes_are_paired_by_shape_whatever_their_order_and_scale():
    mesh, computed = cantilever(10)
    moves = np.abs(computed.shapes[2::6]).max(axis=0)
    bending = np.flatnonzero(moves > 0.5 * moves.max())
    z = np.eye(6 * mesh.n_points)[2::6][1:]
    first, second = (int(k) for k in bending[:2])
    shapes = (z @ computed.shapes)[:, [second, first]] * [-3.0, 0.2]
    roots = np.array([4.694091133, 1.875104069])
    closed = roots**2 / (2 * np.pi) * np.sqrt(210e9 * 0.03 * 0.01**3 / 12 / (7850 * 0.03 * 0.01))
    found = compare_modes(fem.Modes(closed, shapes), computed, z)
    assert dict(found.pairs) == {0: second, 1: first}
    assert found.mac[0, second] == pytest.approx(1.0)
    for (i, _), error in zip(found.pairs, found.frequency_error, strict=True):
        assert error == pytest.approx((roots[i] / 10) ** 4 / 1440, rel=0.1)


def test_shapes_that_do_not_fit_the_sensors_are_refused():
    mesh, computed = cantilever(4)
    with pytest.raises(ValueError, match="rows have shape"):
        compare_modes(fem.Modes(np.ones(1), np.ones((3, 1))), computed, np.eye(6 * mesh.n_points)[:2])
