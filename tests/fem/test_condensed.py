"""FRFs with runs of equal elements condensed, against solutions with the full matrices."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from fem import (
    Damping,
    Frame,
    FRFKind,
    MemberProperties,
    Mesh,
    Model,
    Section,
    assemble,
    compute_frf,
    solve_modes,
)
from fem.analysis.condensed import _Pattern, condense, frf_function
from fem.analysis.selection import dof_columns
from fem.effects import Rotor, SectionShear
from tests.frames import FLAT, STEEL, beam, braced, cross_beam, fix, mounted, portal, with_part

LINES = np.array([3.0, 47.0, 111.0, 390.0])


def _frame(mesh):
    return Frame(members=dict.fromkeys(mesh.members, MemberProperties(STEEL, FLAT)))


def ring():
    """Return a closed square, whose points nothing holds."""
    mesh = Mesh.from_lines(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1], [2, 1], [2, 3], [0, 3]], {"m": [0, 1, 2, 3]}
    )
    return Model(mesh.split(8), (_frame(mesh),))


def tapered():
    part = MemberProperties(STEEL, FLAT, section2=Section.rectangle(0.02, 0.01))
    mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0], [2, 0.5, 0]], [[0, 1], [1, 2]], {"a": [0], "b": [1]})
    frame = Frame(members={"a": part, "b": MemberProperties(STEEL, FLAT)})
    return Model(mesh.split(16), (frame, fix(0)))


def turning():
    """Return a beam with a spinning disc, whose C is not symmetric."""
    model = beam(32, effects=(fix(0),))
    return model.with_effect(Rotor(name="disc", point=1, axis=(1.0, 0.0, 0.0), momentum=2.0))


def cable():
    """Return a cable between two posts: its points' rotations have neither stiffness nor mass."""
    points = [[0, 0, 0], [0, 0, 1], [2, 0, 1], [2, 0, 0]]
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2], [3, 2]], {"post1": [0], "cable": [1], "post2": [2]})
    wire = MemberProperties(STEEL, Section.circle(0.005), theory="bar", pretension=500.0)
    post = MemberProperties(STEEL, FLAT)
    frame = Frame(members={"post1": post, "post2": post, "cable": wire})
    return Model(mesh.split(16), (frame, fix(0), fix(3)))


MODELS = {
    "cross-beam": lambda: cross_beam(0.01),
    "portal": lambda: portal(0.02),
    "superelement": with_part,
    "braced": lambda: braced(8),
    "mounted": lambda: mounted(0.02),
    "ring": ring,
    "tapered": tapered,
    "turning": turning,
    "cable": cable,
}


@pytest.mark.parametrize("name", MODELS)
def test_condensed_frfs_are_those_of_the_full_matrices(name):
    model = MODELS[name]().with_damping(Damping(alpha=2.0, beta=1e-6, loss_factor=0.01))
    system = assemble(model, reciprocal=False)
    at = [(1, "x"), (1, "y"), (2, "z")]
    full = compute_frf(system, LINES, at, at[:2], "receptance", method="direct").H
    columns = [dof_columns(model, each)[0] for each in (at, at[:2])]
    condensed = condense(system, *columns)
    H = condensed.receptance(LINES, *columns)
    peak = np.abs(full).max(axis=(1, 2), keepdims=True)
    assert (np.abs(H - full) / peak).max() < 1e-7
    share = len(condensed.kept) / system.n_free
    assert share == 1 if name == "braced" else share < {"tapered": 0.6, "superelement": 0.8}.get(name, 0.5)


def test_many_coordinates_are_solved_as_sparse_matrices():
    side = np.arange(4)
    points = np.array([[x, y, 0] for x in side for y in side], dtype=float)
    near = [(a, b) for a in range(16) for b in range(a) if abs(points[a] - points[b]).sum() == 1]
    mesh = Mesh.from_lines(points, near, {"m": list(range(len(near)))})
    grid = Model(mesh.split(8), (_frame(mesh), fix(0), fix(3), fix(15)))
    system = assemble(grid.with_damping(Damping.structural(0.02)))
    at = [(5, "z"), (10, "x")]
    columns, _ = dof_columns(grid, at)
    condensed = condense(system, columns)
    assert len(condensed.kept) >= 16 * 6 - 18
    assert len(condensed.kind) == 24
    assert len(condensed.count) <= 4  # along x and along y, passed in either sense
    full = compute_frf(system, LINES, at, at, "receptance", method="direct").H
    for dense in (True, False):
        solve = condensed._dense if dense else partial(condensed._sparse, _Pattern.of(condensed))
        b = condensed.Q.T @ columns
        H = solve(condensed._factors(LINES), b.toarray(), b.toarray())
        assert (np.abs(H - full) / np.abs(full).max(axis=(1, 2), keepdims=True)).max() < 1e-7


def test_a_modal_ratio_counts_as_a_loss_factor():
    """At a resonance both give 1/(2iζω²); other modes differ by ζ ω/ω_r of their small share."""
    model = beam(40, effects=(fix(0),)).with_damping(Damping.modal(0.005))
    system = assemble(model)
    lines = solve_modes(system, 8).frequency[:6]
    modal = compute_frf(system, lines, [(1, "y"), (1, "z")], [(1, "y"), (1, "z")]).H
    columns, _ = dof_columns(model, [(1, "y"), (1, "z")])
    H = condense(system, columns).receptance(lines, columns, columns)
    H = H * (2j * np.pi * lines[:, None, None]) ** 2
    peak = np.abs(modal).max(axis=(1, 2))
    assert (np.abs(H - modal).max(axis=(1, 2)) < 0.005 * peak).all()


def thin_portal(size):
    points = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]]) * size
    mesh = Mesh.from_lines(points, [[0, 1], [1, 2], [2, 3]], {"m": [0, 1, 2]})
    model = Model(mesh.split(60), (_frame(mesh), fix(0), fix(3)))
    return model.with_damping(Damping.structural(0.01))


def test_modes_are_about_those_between_held_ends_or_more():
    system = assemble(thin_portal(4.0))
    frequency = solve_modes(system, 60).frequency
    condensed = condense(system)
    for n in (10, 25, 50):
        least = condensed.least_modes(float(frequency[n - 1]) * (1 + 1e-9))
        # to hold two points in six directions takes 12 modes away at most; the chain has two corners
        assert n - 12 - 1 <= least <= n + 2


@pytest.mark.parametrize("size", [0.2, 4.0])
def test_modes_and_lines_give_the_same(size, monkeypatch):
    system, lines = assemble(thin_portal(size)), np.linspace(5.0, 300.0, 24)
    out, inn = [(1, "x"), (1, "y")], [(1, "x")]
    exact = compute_frf(system, lines, out, inn, "mobility", method="direct").H
    for seconds in (0.0, 1.0):
        monkeypatch.setattr("fem.analysis.condensed._SECONDS_PER_MODE", seconds)
        monkeypatch.setattr("fem.analysis.condensed.Condensed.least_modes", lambda self, f: 1000)
        H = frf_function(system, lines, out, inn, FRFKind.MOBILITY)(lines)
        assert (np.abs(H - exact).max(axis=0) < 1e-3 * np.abs(exact).max(axis=0).max()).all()


def test_members_with_uncertain_shear_are_condensed_as_others():
    mesh = Mesh.from_lines([[0, 0, 0], [0, 0, 1], [1, 0, 1]], [[0, 1], [1, 2]], {"a": [0], "b": [1]})
    wall = MemberProperties(STEEL, Section.tube(0.03, 0.003))
    plain = Model(mesh.split(8), (Frame(members={"a": wall, "b": wall}), fix(0)))
    shear = SectionShear.of(plain)
    model = plain.with_effect(shear.with_values(**{p.name: 0.7 * p.value for p in shear.parameters()}))
    system = assemble(model.with_damping(Damping.structural(0.02)))
    at = [(2, "x"), (2, "y")]
    columns, _ = dof_columns(model, at)
    condensed = condense(system, columns)
    assert len(condensed.kept) == 12
    full = compute_frf(system, LINES, at, at, "receptance", method="direct").H
    H = condensed.receptance(LINES, columns, columns)
    assert (np.abs(H - full) / np.abs(full).max(axis=(1, 2), keepdims=True)).max() < 1e-7


def test_a_run_ends_where_a_force_acts():
    model = thin_portal(1.0)
    system = assemble(model)
    columns, _ = dof_columns(model, [(20, "x")])
    free, held = condense(system), condense(system, columns)
    assert len(held.kept) == len(free.kept) + 6
    assert held.count[held.kind].sum() == free.count[free.kind].sum() == 180


def test_undamped_lines_at_a_resonance_are_infinite_or_large():
    system = assemble(replace(thin_portal(1.0), damping=Damping()))
    f = solve_modes(system, 3).frequency[:1]
    columns, _ = dof_columns(system.model, [(1, "x"), (1, "y")])
    condensed = condense(system, columns)
    at, away = (np.abs(condensed.receptance(x * f, columns, columns)).max() for x in (1.0, 1.1))
    assert at > 1e4 * away
