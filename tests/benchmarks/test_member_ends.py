"""Displacements of members at their released and sprung ends, against closed forms and divided members."""

import numpy as np
import pytest

from fem import (
    Frame,
    InitialStrain,
    LineLoad,
    LoadCase,
    MemberForce,
    MemberProperties,
    Mesh,
    Model,
    assemble,
    solve_static,
)
from fem.analysis.stations import largest_displacements
from tests.frames import FLAT, STEEL, beam, fix

L, Q, CURVATURE = 1.3, 40.0, 2e-3
EI = STEEL.E * FLAT.Iy
DOWN = LineLoad(member="beam", force1=(0, 0, -Q))
BENT = InitialStrain(member="beam", curvature_y=CURVATURE)


def solved(model, *loads):
    return solve_static(assemble(model), [LoadCase(name=str(k), members=(x,)) for k, x in enumerate(loads)])


@pytest.mark.parametrize("n", [1, 4])
def test_a_hinged_beam_turns_at_its_ends_though_its_supports_do_not(n):
    model = beam(n, L, effects=(fix(0), fix(1)), release1=("ry",), release2=("ry",))
    found = solved(model, DOWN, BENT).displacements_along("beam", [0, L / 2, L])
    turn = np.array([Q * L**3 / (24 * EI), -CURVATURE * L / 2])
    np.testing.assert_allclose(found[0, 4], turn, rtol=1e-10)
    np.testing.assert_allclose(found[2, 4], -turn, rtol=1e-10)
    middle = [-5 * Q * L**4 / (384 * EI), CURVATURE * L**2 / 8]
    np.testing.assert_allclose(found[1, 2], middle, rtol=1e-10)


@pytest.mark.parametrize("n", [1, 4])
def test_a_beam_on_rotational_springs(n):
    """Both ends turn by qL³/24EI over 1 + 2EI/kL, times 2EI/kL; the moment there is k times that."""
    k = 3 * EI / L
    model = beam(n, L, effects=(fix(0), fix(1)), spring1={"ry": k}, spring2={"ry": k})
    found = solved(model, DOWN, BENT).displacements_along("beam", [0, L])[:, 4]
    share = 1 / (1 + k * L / (2 * EI))
    turn = share * np.array([Q * L**3 / (24 * EI), -CURVATURE * L / 2])
    np.testing.assert_allclose(found, [turn, -turn], rtol=1e-10)


@pytest.mark.parametrize("n", [1, 4])
def test_members_that_meet_in_a_hinge_turn_each_by_itself(n):
    """Two cantilevers under a uniform load, joined at their tips by a hinge: each tip turns by qL³/6EI."""
    mesh = Mesh.from_lines([[0, 0, 0], [L, 0, 0], [2 * L, 0, 0]], [[0, 1], [1, 2]], {"l": [0], "r": [1]})
    plain = MemberProperties(STEEL, FLAT, theory="euler-bernoulli")
    hinged = MemberProperties(STEEL, FLAT, theory="euler-bernoulli", release2=("ry",))
    model = Model(mesh.split(n), (Frame(members={"l": hinged, "r": plain}), fix(0), fix(2)))
    case = LoadCase(members=tuple(LineLoad(member=m, force1=(0, 0, -Q)) for m in "lr"))
    found = solve_static(assemble(model), case)
    turn = Q * L**3 / (6 * EI)
    np.testing.assert_allclose(found.displacements_along("l", [L])[0, 4], turn, rtol=1e-10)
    np.testing.assert_allclose(found.displacements_along("r", [0])[0, 4], -turn, rtol=1e-10)


@pytest.mark.parametrize("n", [1, 4])
@pytest.mark.parametrize("k", [0.0, 5 * EI / L**3])
def test_a_guided_end_slides_under_the_loads_of_its_member(n, k):
    """The end of a clamped and guided beam sinks by qL⁴/24EI; a spring k takes kL³/12EI of that."""
    sprung = {"spring2": {"z": k}} if k else {"release2": ("z",)}
    model = beam(n, L, effects=(fix(0), fix(1)), **sprung)
    found = solved(model, DOWN).displacements_along("beam", [0, L, 1e-7 * L])[:, :, 0]
    sunk = -Q * L**4 / (24 * EI) / (1 + k * L**3 / (12 * EI))
    assert found[1, 2] == pytest.approx(sunk, rel=1e-10)
    assert abs(found[[0, 2], 2]).max() < 1e-6 * abs(sunk)
    assert abs(found[:2, 4]).max() < 1e-10 * abs(sunk) / L


def test_an_end_that_slides_along_its_axis():
    """A member fixed at one end and free to slide at the other stretches by pL²/2EA, or by εL."""
    model = beam(1, L, effects=(fix(0), fix(1)), release1=("x",))
    pulled, heated = LineLoad(member="beam", force1=(Q, 0, 0)), InitialStrain(member="beam", axial=1e-3)
    found = solved(model, pulled, heated).displacements_along("beam", [0, L])[:, 0]
    np.testing.assert_allclose(found[0], [Q * L**2 / (2 * STEEL.E * FLAT.A), -1e-3 * L], rtol=1e-10)
    assert abs(found[1]).max() < 1e-13


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("seed", range(6))
def test_displacements_do_not_depend_on_how_a_member_is_divided(seed, theory):
    rng = np.random.default_rng(seed)
    scale = dict.fromkeys("xyz", EI / L**3) | dict.fromkeys(("rx", "ry", "rz"), EI / L)
    ends = {
        f"spring{k}": {d: float(10 ** rng.uniform(-1, 2) * s) for d, s in scale.items() if rng.random() < 0.6}
        for k in (1, 2)
    }
    ends["spring2"].pop("ry", None)
    ends["release2"] = ("ry",)
    place = float(rng.uniform(0.2, 0.8) * L)
    loads = (
        LineLoad(member="beam", force1=rng.normal(size=3), force2=rng.normal(size=3), start=0.1, stop=place),
        MemberForce(member="beam", position=place, force=rng.normal(size=3)),
        MemberForce(member="beam", position=0.0, force=rng.normal(size=3)),
        InitialStrain(member="beam", axial=1e-4, curvature_y=1e-3, curvature_z=-2e-3),
    )
    places = np.append(np.linspace(0, L, 8), [1e-9 * L, (1 - 1e-8) * L])
    along = rng.normal(size=3)
    models = [beam(n, L, effects=(fix(0), fix(1)), theory=theory, along=along, **ends) for n in (1, 5)]
    found = [solved(model, *loads).displacements_along("beam", places) for model in models]
    size = abs(found[1]).max(axis=(0, 1)) + 1e-6  # the force on the fixed end moves nothing
    assert (abs(found[0] - found[1]).max(axis=(0, 1)) < 1e-9 * size).all()
    assert (abs(found[0][[0, 7]] - found[0][[8, 9]]).max(axis=(0, 1)) < 1e-6 * size).all()


@pytest.mark.parametrize("n", [1, 3, 12])
def test_the_largest_displacement_is_found_within_members(n):
    """A propped cantilever sinks by qL⁴x²(3 - 5x + 2x²)/48EI at xL from its fixed end."""
    model = beam(n, L, effects=(fix(0), fix(1)), release2=("ry",))
    (found,) = largest_displacements(solved(model, DOWN))
    x = (15 - np.sqrt(33)) / 16  # the maximum
    w = Q * L**4 / (48 * EI) * (3 * x**2 - 5 * x**3 + 2 * x**4)
    assert found.size == pytest.approx(w, rel=1e-6)
    assert (found.member, found.point) == ("beam", None)
    assert found.position == pytest.approx(x * L, rel=0.01)
    (tip,) = largest_displacements(solved(beam(n, L, effects=(fix(0),)), DOWN))
    assert (tip.member, tip.point) == (None, 1)
    assert tip.size == pytest.approx(Q * L**4 / (8 * EI), rel=1e-9)
