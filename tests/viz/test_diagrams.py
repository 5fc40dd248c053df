"""Diagrams of section forces: which are drawn, on which side, and where their extremes are named."""

import numpy as np
import pytest

from fem import LineLoad, LoadCase, Section, assemble, solve_static
from tests.frames import beam, fix
from viz import diagrams


@pytest.fixture(scope="module")
def held_beam():
    """Clamped at both ends, 2 m, with a load of 1 kN/m downwards: qL²/12 at the ends, -qL²/24 in between."""
    model = beam(4, 2.0, effects=(fix(0), fix(1)))
    return solve_static(assemble(model), LoadCase(members=(LineLoad(member="beam", force1=[0, 0, -1000.0]),)))


def test_only_forces_that_act_are_drawn(held_beam):
    assert diagrams.drawn_quantities(held_beam, 0) == ("Vz", "My")


def test_moments_are_drawn_on_the_side_in_tension(held_beam, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(diagrams.Scene, "save", lambda self, path: drawn.append(self) or path)
    diagrams.render_diagram(held_beam, "My", tmp_path / "My.png")
    (scene,) = drawn
    named = {label.text: label.point for label in scene.labels}
    assert sorted(named) == ["-167", "333"]
    # tension at the top over the supports, at the bottom in the middle
    assert named["333"][2] > 0 > named["-167"][2]
    assert named["333"][2] == pytest.approx(-2 * named["-167"][2])
    assert named["-167"][0] == pytest.approx(1.0)


def test_ribbons_are_cut_where_the_sign_changes(held_beam, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(diagrams.Scene, "save", lambda self, path: drawn.append(self) or path)
    diagrams.render_diagram(held_beam, "Vz", tmp_path / "Vz.png")
    ribbon = next(mesh for mesh, look in drawn[0].actors if "opacity" in look)
    corners = np.asarray(ribbon.points)[ribbon.faces.reshape(-1, 4)[:, 1:]]
    side = corners[:, :, 2]
    assert (np.sign(side.max(axis=1)) * np.sign(side.min(axis=1)) >= 0).all()
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert area.sum() == pytest.approx(0.13 * 2 * 1 / 2 * 2)  # two triangles 1 m long, 0.13 × 2 m high


def test_a_constant_force_is_named_once(tmp_path, monkeypatch):
    """The shear force of a beam under a force at its end is constant, but for rounding."""
    drawn = []
    monkeypatch.setattr(diagrams.Scene, "save", lambda self, path: drawn.append(self) or path)
    model = beam(7, 0.7, effects=(fix(0),))
    pushed = solve_static(assemble(model), LoadCase(points={(1, "z"): -321.0}))
    diagrams.render_diagram(pushed, "Vz", tmp_path / "Vz.png")
    assert np.ptp(pushed.internal_forces("beam", np.linspace(0.01, 0.69, 50))[:, 2, 0]) > 0
    assert [label.text for label in drawn[0].labels] == ["-321"]


def test_an_unknown_quantity_is_refused(held_beam, tmp_path):
    with pytest.raises(ValueError, match="'Mx' is no section force; allowed are N, Vy"):
        diagrams.render_diagram(held_beam, "Mx", tmp_path / "Mx.png")


@pytest.mark.parametrize(("value", "text"), [(0.123, "0.123"), (-12345.0, "-12.3k"), (2.5e6, "2.5M")])
def test_values_are_short(value, text):
    assert diagrams.readable(value) == text


@pytest.fixture
def drawn(monkeypatch):
    """Scenes that are drawn from now on; nothing is written."""
    scenes = []
    monkeypatch.setattr(diagrams.Scene, "save", lambda self, path: scenes.append(self) or path)
    return scenes


def test_stresses_are_drawn_to_one_scale_with_a_colour_bar_in_mpa(held_beam, drawn, tmp_path):
    """A section of 30 × 10 mm: M/W with W = 30 · 10²/6 mm³ is 667 MPa at the ends."""
    assert diagrams.drawn_stresses(held_beam, 0) == ("normal", "von_mises")
    for quantity in ("normal", "von_mises"):
        diagrams.render_stress(held_beam, quantity, tmp_path / "stress.png")
    normal, von_mises = drawn
    most = 1000 * 2**2 / 12 / (0.03 * 0.01**2 / 6) / 1e6
    (bar,) = normal.bars
    assert (bar.label, bar.norm.vmin) == ("normal stress [MPa]", pytest.approx(-most))
    assert [label.text for label in normal.labels] == ["667", "-667"]
    assert normal.labels[0].point[2] == pytest.approx(0.13 * 2)  # tension above the axis
    assert normal.labels[1].point[2] == pytest.approx(-0.13 * 2)
    heights = [mesh.point_data["stress"] for mesh, look in normal.actors if "cmap" in look]
    assert [h.max() for h in heights] == [0.0, pytest.approx(most)]  # the curves of the least and the largest
    assert [h.min() for h in heights] == [pytest.approx(-most), 0.0]
    (bar,) = von_mises.bars
    assert (bar.label, bar.norm.vmin) == ("von Mises stress [MPa]", 0.0)
    shear = 1000 / 3e-4 / 1e6
    assert most < bar.norm.vmax < np.hypot(most, np.sqrt(3) * 2 * shear)  # shear is small where M is largest
    assert [label.text for label in von_mises.labels] == ["667"]


def test_small_stresses_are_in_pascals(drawn, tmp_path):
    model = beam(2, effects=(fix(0),))
    pulled = solve_static(assemble(model), LoadCase(points={(1, "x"): 1.5}))
    diagrams.render_stress(pulled, "von_mises", tmp_path / "stress.png")
    assert drawn[0].bars[0].label == "von Mises stress [Pa]"
    assert [label.text for label in drawn[0].labels] == ["5k"]  # 1.5 N on 300 mm²


def test_stresses_of_sections_without_a_shape_are_not_drawn(tmp_path):
    model = beam(2, effects=(fix(0),), section=Section(3e-4, 1e-9, 1e-9, 1e-9))
    pulled = solve_static(assemble(model), LoadCase(points={(1, "x"): 1.5}))
    assert diagrams.drawn_stresses(pulled, 0) == ()
    with pytest.raises(ValueError, match="known of no member; sections need a shape"):
        diagrams.render_stress(pulled, "normal", tmp_path / "stress.png")
    with pytest.raises(ValueError, match="'shear' is no stress that is drawn; allowed are normal, von_mises"):
        diagrams.render_stress(pulled, "shear", tmp_path / "stress.png")
