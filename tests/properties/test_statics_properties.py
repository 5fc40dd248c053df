"""What holds for every static solution: equilibrium, reciprocity, and no dependence on the mesh."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem import DIRECTIONS, InitialStrain, LineLoad, LoadCase, MemberForce, assemble, solve_static
from tests.frames import beam, fix, portal

forces = st.tuples(*[st.floats(-1e3, 1e3)] * 3)
unit = st.floats(0.02, 0.98)
ODD = {
    "theory": "timoshenko",
    "rigid1": 0.04,
    "rigid2": 0.02,
    "offset1": np.array([0.0, 0.01, 0.03]),
    "offset2": np.array([0.02, 0.0, -0.02]),
}


def resultant(model, solution, case):
    """Return forces and moments about the origin of loads at points and reactions."""
    total = np.zeros(6)
    for (name, key), value in solution.reactions.items():
        effect = model.effect(name)
        if hasattr(effect, "point"):
            place, d = model.mesh.points[effect.point], DIRECTIONS.index(key)
            e = np.eye(6)[d] * value[0]
            total += np.concatenate([e[:3], e[3:] + np.cross(place, e[:3])])
    for (p, d), value in case.points.items():
        e = np.eye(6)[DIRECTIONS.index(d)] * value
        total += np.concatenate([e[:3], e[3:] + np.cross(model.mesh.points[p], e[:3])])
    return total


@settings(max_examples=15)
@given(q1=forces, q2=forces, F=forces, places=st.tuples(unit, unit, unit), local=st.booleans())
def test_loads_and_reactions_are_in_equilibrium(q1, q2, F, places, local):
    model = portal(0.25)
    a, b, c = sorted(places)
    if b - a < 1e-3:
        return
    h = 0.5
    case = LoadCase(
        points={(4, "y"): 30.0, (5, "rx"): 7.0},
        members=(
            LineLoad(
                member="left",
                force1=q1,
                force2=q2,
                start=a * h,
                stop=b * h,
                axes="local" if local else "global",
            ),
            MemberForce(member="right", position=c * h, force=F),
        ),
    )
    solution = solve_static(assemble(model), case)
    R = model.effects[0].rotations(model.mesh)[0]
    q1, q2 = (R.T @ q if local else np.array(q) for q in (q1, q2))
    total = resultant(model, solution, case)
    x, w = np.polynomial.legendre.leggauss(3)
    for t, weight in zip((x + 1) / 2, w / 2, strict=True):
        at, q = np.array([0, 0, h * (a + t * (b - a))]), (q1 + t * (q2 - q1)) * weight * (b - a) * h
        total += np.concatenate([q, np.cross(at, q)])
    total += np.concatenate([F, np.cross([0.6, 0, c * h], F)])
    size = 30.0 + max(np.abs([q1, q2]).max(), np.abs(F).max())
    assert abs(total).max() < 1e-9 * size
    assert solution.residual[0] < 1e-9


ENDS = [{}, {"release2": ("ry",)}, {"release1": ("ry", "rz"), "spring2": {"rz": 4e3}}]


@settings(max_examples=10)
@given(q1=forces, q2=forces, F=forces, place=unit, n=st.integers(2, 6))
@pytest.mark.parametrize(("clamped", "ends"), [(False, ENDS[0]), *((True, e) for e in ENDS)])
def test_results_do_not_depend_on_the_mesh(clamped, ends, q1, q2, F, place, n):
    length = 0.9
    case = LoadCase(
        points={(1, "y"): 10.0} if not clamped else {},
        members=(
            LineLoad(member="beam", force1=q1, force2=q2, start=0.1, stop=0.77, axes="local"),
            MemberForce(member="beam", position=place * length, force=F),
            InitialStrain(member="beam", axial=1e-5, curvature_y=1e-3, curvature_z=-2e-3),
        ),
        gravity=(1.0, 2.0, -9.81),
    )
    held = (fix(0), fix(1, ("x", "y", "z", "rx"))) if clamped else (fix(0),)
    # the axes of unequal offsets are those of the whole member on every mesh
    s = np.array([0.0, 0.03, 0.2, 0.45, 0.6, 0.89, 0.9])
    s = s[abs(s - place * length) > 1e-6]
    found = []
    for pieces in (1, n):
        model = beam(pieces, length, effects=held, along=(1, 2, -0.5), **ODD, **ends)
        solution = solve_static(assemble(model), case)
        found.append((solution.internal_forces("beam", s), solution.displacements_along("beam", s)))
    for one, many in zip(*found, strict=True):
        for part in (slice(0, 3), slice(3, 6)):
            scale = max(abs(many[:, part]).max(), 1e-3 * abs(many).max())
            np.testing.assert_allclose(one[:, part], many[:, part], atol=1e-8 * scale)


@settings(max_examples=10)
@given(F=forces, place=unit)
def test_forces_and_displacements_are_reciprocal(F, place):
    # Maxwell and Betti: the work of one load on the displacements of another
    model = beam(3, 0.9, effects=(fix(0), fix(1, ("y", "z"))), along=(1, 2, -0.5), **ODD)
    system = assemble(model)
    first = LoadCase(name="a", members=(MemberForce(member="beam", position=place * 0.9, force=F),))
    second = LoadCase(name="b", points={(2, "z"): 3.0, (3, "ry"): -2.0})
    solution = solve_static(system, [first, second])
    # a force acts on the axis: its work is that of the axis' motion
    u = solution.displacements_along("beam", [place * 0.9])[0, :, 1]
    offset = ODD["offset1"] + place * (ODD["offset2"] - ODD["offset1"])
    work = np.array(F) @ (u[:3] + np.cross(u[3:], offset))
    other = 3.0 * solution.displacements[14, 0] - 2.0 * solution.displacements[22, 0]
    assert work == pytest.approx(other, abs=1e-9 * (np.linalg.norm(F) * abs(u[:3]).max() + 1e-12))
