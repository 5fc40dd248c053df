"""Bars that carry tension or compression alone: a braced panel against the panel with one diagonal."""

import numpy as np
import pytest

from fem import (
    Frame,
    InitialStrain,
    LoadCase,
    MemberProperties,
    Mesh,
    Model,
    ModelError,
    Section,
    assemble,
    solve_one_sided,
    solve_static,
)
from fem.analysis.one_sided import SLACK
from tests.frames import STEEL, fix, planar

ROD = Section.circle(0.02)


def panel(only="tension", without=()):
    """Return a hinged panel of 3 by 2 m with two diagonals."""
    points = [[0, 0, 0], [3, 0, 0], [3, 0, 2], [0, 0, 2]]
    lines = {"left": [0, 3], "right": [1, 2], "top": [3, 2], "rising": [0, 2], "falling": [3, 1]}
    lines = {name: ends for name, ends in lines.items() if name not in without}
    mesh = Mesh.from_lines(points, list(lines.values()), {name: [k] for k, name in enumerate(lines)})
    members = {
        name: MemberProperties(STEEL, ROD, theory="bar", only=only if name in ("rising", "falling") else "")
        for name in lines
    }
    model = Model(mesh, (Frame(members=members), fix(0, name="a"), fix(1, name="b")))
    return planar(model, ("x", "z"))


@pytest.mark.parametrize(("push", "slack"), [(1e4, "falling"), (-1e4, "rising")])
def test_the_diagonal_that_would_be_pushed_goes_slack(push, slack):
    load = {(3, "x"): push}
    found = solve_one_sided(panel(), LoadCase(points=load))
    assert found.slack == (slack,)
    alone = solve_static(assemble(panel(without=(slack,))), load)
    np.testing.assert_allclose(found.solution.displacements, alone.displacements, rtol=1e-7, atol=1e-12)
    force = found.solution.line_forces[found.solution.model.mesh.members[slack], 0, 0, 0]
    assert abs(force[0]) < 10 * SLACK * abs(push)


def test_compression_alone_is_the_other_diagonal():
    found = solve_one_sided(panel("compression"), LoadCase(points={(3, "x"): 1e4}))
    assert found.slack == ("rising",)


def test_what_stays_tight_is_linear():
    load = LoadCase(points={(3, "z"): 1e4, (2, "z"): 1e4})
    found = solve_one_sided(panel(), load)
    assert (found.slack, found.n_rounds) == ((), 1)
    linear = solve_static(assemble(panel(only="")), load)
    np.testing.assert_allclose(found.solution.displacements, linear.displacements, atol=1e-15)


def test_a_load_that_nothing_holds_is_refused():
    with pytest.raises(ModelError, match=r"bar 'falling' goes slack, and nothing else holds the structure"):
        solve_one_sided(panel(without=("rising",)), LoadCase(name="wind", points={(3, "x"): 1e4}))


@pytest.mark.parametrize(
    ("load", "moved", "slack"),
    [
        ({"members": (InitialStrain(member="beam", axial=-1e-3),)}, [-2e-3, 0, 0], ("tie",)),
        ({"displacements": {("foot", "z"): -0.004}}, [0, 0, -0.004], ()),
    ],
    ids=["shrinkage", "settlement"],
)
def test_loads_that_leave_no_force_are_no_mechanism(load, moved, slack):
    """A post and a beam, clamped at the foot, with a tie that shrinkage of the beam slackens."""
    points, lines = [[0, 0, 0], [0, 0, 3], [2, 0, 3]], {"post": [0, 1], "beam": [1, 2], "tie": [0, 2]}
    mesh = Mesh.from_lines(points, list(lines.values()), {name: [k] for k, name in enumerate(lines)})
    members = {name: MemberProperties(STEEL, Section.rectangle(0.1, 0.1)) for name in ("post", "beam")}
    members["tie"] = MemberProperties(STEEL, ROD, theory="bar", only="tension")
    model = Model(mesh, (Frame(members=members), fix(0, name="foot")))
    found = solve_one_sided(model, LoadCase(**load))
    assert set(slack) <= set(found.slack)
    assert found.solution.displacements[12:15, 0] == pytest.approx(moved, abs=1e-10)


def test_many_bars_settle():
    """A tower of panels under shear: one diagonal of each goes slack, the same as solved without them."""
    n = 8
    points = [[x, 0, 1.0 * k] for k in range(n + 1) for x in (0, 1)]
    lines, names = [], {}
    for k in range(n):
        a, b, c, d = 2 * k, 2 * k + 1, 2 * k + 2, 2 * k + 3
        for name, ends in (("l", (a, c)), ("r", (b, d)), ("t", (c, d)), ("up", (a, d)), ("down", (c, b))):
            names[f"{name}{k}"] = [len(lines)]
            lines.append(ends)
    members = {
        name: MemberProperties(STEEL, ROD, theory="bar", only="tension" if name[0] in "ud" else "")
        for name in names
    }
    mesh = Mesh.from_lines(points, lines, names)
    model = planar(Model(mesh, (Frame(members=members), fix(0), fix(1))), ("x", "z"))
    found = solve_one_sided(model, LoadCase(points={(2 * n, "x"): 1e3, (2 * n + 1, "z"): -500.0}))
    assert found.slack == tuple(f"down{k}" for k in range(n))


@pytest.mark.parametrize(
    ("more", "message"),
    [({"only": "tension"}, "take 'bar'"), ({"only": "bending", "theory": "bar"}, "allowed are tension and")],
)
def test_what_cannot_be(more, message):
    with pytest.raises(ModelError, match=message):
        MemberProperties(STEEL, ROD, **more)
