"""Parts of solid elements in studies against CalculiX, which solves the whole structure."""

import shutil

import numpy as np
import pytest

from benchmarks.parts_ccx import bolts, corner
from benchmarks.parts_ccx.__main__ import diagnose
from benchmarks.parts_ccx.calculix import Material, Spring, export_matrices, hexahedra, solve
from dovetail import load_study

needs_ccx = pytest.mark.skipif(
    shutil.which("ccx") is None, reason="needs CalculiX: `ccx` on the PATH (Debian: calculix-ccx)"
)


def test_hexahedra_fill_their_box():
    solid = hexahedra([[0, 1, 3], [0, 2], [0, 4, 5]], Material(1.0, 0.3, 1.0))
    assert len(solid.elements) == 4
    # corners and middles of edges of a grid of 3 x 2 x 3 points
    assert len(solid.nodes) == 18 + (2 * 2 * 3 + 3 * 1 * 3 + 3 * 2 * 2)
    corners = solid.nodes[solid.elements[:, :8] - 1]
    np.testing.assert_allclose(np.ptp(corners, axis=1).prod(axis=1).sum(), 3 * 2 * 5)
    assert solid.nodes[solid.at((3, 2, 4.5)) - 1].tolist() == [3, 2, 4.5]


def test_the_bolts_of_a_seed_differ_by_what_is_hidden():
    hidden, nothing = bolts.draw(4, True), bolts.draw(4, False)
    assert hidden.moduli == nothing.moduli
    changed = {
        (name, "xyz"[d]) if d < 3 else (name, d)
        for name, stiffness in hidden.bolts.items()
        for d in range(6)
        if stiffness[d] != nothing.bolts[name][d]
    }
    assert changed == {(hidden.soft, d) for d in bolts.HIDDEN_DIRECTIONS}
    for stiffness in nothing.bolts.values():
        assert (abs(np.array(stiffness) / bolts.BOLT - 1) <= bolts.SCATTER).all()


STUDY = """
[[superelements]]
file = "first.sti"
units = "mm-t-s"
attach = [{{ name = "a", nodes = {first} }}]

[[superelements]]
file = "second.sti"
units = "mm-t-s"
attach = [{{ name = "b", nodes = {second} }}]

[[joints]]
point1 = "a"
point2 = "b"
location = [0.062, 0.01, 0.006]
k = {{ kx = 4e7, ky = 3e7, kz = 5e7, krx = 4e3, kry = 2e3, krz = 3e3 }}

[frequency]
stop = 8000
"""


@needs_ccx
def test_two_bars_with_a_spring_have_the_frequencies_of_calculix(tmp_path):
    """The spring acts between rigid faces, 2 mm from either."""
    steel = Material(206e3, 0.29, 7.83e-9)
    across = [[0, 10, 20], [0, 12]]
    first = hexahedra([[0, 15, 30, 45, 60], *across], steel)
    second = hexahedra([[64, 80, 96, 112], *across], steel)
    faces = first.on_plane(0, 60.0), second.on_plane(0, 64.0)
    export_matrices(tmp_path, "first", first)
    export_matrices(tmp_path, "second", second)
    (tmp_path / "study.toml").write_text(STUDY.format(first=faces[0], second=faces[1]))
    shifted = tuple(n + len(first.nodes) for n in faces[1])
    stiffness = (4e4, 3e4, 5e4, 4e6, 2e6, 3e6)
    spring = Spring(tuple(faces[0]), shifted, (62.0, 10.0, 6.0), stiffness)
    expected = solve(tmp_path, "whole", (first, second), (spring,), 20, [1]).frequency
    expected = expected[(expected > 10.0) & (expected < 8000.0)]
    found = load_study(tmp_path / "study.toml").solve_modes(len(expected)).frequency[-len(expected) :]
    assert len(expected) >= 3
    np.testing.assert_allclose(found, expected, rtol=2e-5)


@needs_ccx
@pytest.mark.slow
def test_a_solid_corner_as_a_superelement_needs_no_fit(tmp_path):
    found = {a.model: a for a in corner.compare(tmp_path, ("zones", "rigid"))}
    assert found["rigid"].all_db <= 0.5
    assert found["zones"].all_db > 4 * found["rigid"].all_db


@needs_ccx
@pytest.mark.long
@pytest.mark.parametrize("hidden", [True, False])
def test_the_soft_bolt_is_found(tmp_path, hidden):
    answer = diagnose(tmp_path, 311, hidden)
    assert answer.right
    for true, value, std in answer.values:
        assert abs(value - true) <= 3 * std
