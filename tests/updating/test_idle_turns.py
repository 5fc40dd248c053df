"""Where released ends alone meet, a point turns freely about an axis of any direction, and nothing else."""

import numpy as np
import pytest

from fem import (
    Frame,
    Joint,
    MemberProperties,
    Mesh,
    Model,
    ModelError,
    Support,
    assemble,
    reassemble,
    solve_modes,
    solve_static,
)
from tests.frames import FLAT, STEEL

ALONG = [(1.0, 0, 0), (0, 0, 1.0), (0.6, 0, 0.8), (2 / 3, -1 / 3, 2 / 3)]


def strut(along, *supports):
    """Return a strut of two lines, 2 m, whose second end is released where its support lets it turn."""
    x = np.array(along)
    mesh = Mesh.from_lines([0 * x, x, 2 * x], [[0, 1], [1, 2]], {"first": [0], "second": [1]})
    up = (-0.1, 0.9, 0.3)
    members = {
        "first": MemberProperties(STEEL, FLAT, orientation=up),
        "second": MemberProperties(STEEL, FLAT, orientation=up, release2=("ry", "rz")),
    }
    return Model(mesh, (Frame(members=members), *supports))


FOOT = Support(name="foot", point=0)
PIN = Support(name="pin", point=2, fixed=("x", "y", "z"))


@pytest.mark.parametrize("along", ALONG)
def test_frequencies_do_not_depend_on_the_direction(along):
    expected = solve_modes(assemble(strut(ALONG[0], FOOT, PIN)), 6).frequency
    np.testing.assert_allclose(
        solve_modes(assemble(strut(along, FOOT, PIN)), 6).frequency, expected, rtol=1e-9
    )


@pytest.mark.parametrize("along", ALONG)
def test_the_pin_takes_torsion_and_no_other_moment(along):
    system = assemble(strut(along, FOOT, PIN))
    load = np.zeros(18)
    load[15:] = along
    GJ = STEEL.G * FLAT.J
    turn = solve_static(system, load).displacements[15:, 0]
    np.testing.assert_allclose(turn, 2.0 / GJ * np.array(along), atol=1e-12 / GJ)
    load[15:] = np.cross(along, (0.3, -0.5, 0.4))
    with pytest.raises(ModelError, match="where nothing has stiffness"):
        solve_static(system, load)


@pytest.mark.parametrize("along", ALONG)
def test_free_it_has_six_rigid_motions(along):
    assert solve_modes(assemble(strut(along)), 8).n_rigid == 6


@pytest.mark.parametrize("along", ALONG)
def test_a_spring_on_the_free_turn_is_not_lost(along):
    bare = strut(along, FOOT, PIN)
    spring = Joint(name="spring", point1=2, location=bare.mesh.points[2], K=np.diag([0, 0, 0, 1e3, 1e3, 1e3]))
    again = reassemble(assemble(bare), bare.with_effect(spring))
    assert again.n_free == 6 + 3
