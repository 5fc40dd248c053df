"""Imported parts in pictures: their surfaces stand with the members and move with the model's modes."""

import json
from pathlib import Path

import meshio
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from dovetail import StudyError, load_study
from fem import Frame, Material, MemberProperties, Mesh, Model, Section, assemble, solve_modes
from fem.io import read_matrices
from fem.lengths import metres_afterwards, show_lengths
from viz import displacement_at, member_families, model_surface, render_model
from viz.interactive import model_figure, modes_figure
from viz.models import drawn_names, drawn_size
from viz.surfaces import Surface

DATA = Path(__file__).parents[1] / "data" / "bracket"
NODES = json.loads((DATA / "calculix.json").read_text())["nodes"]
FRAME = """
points = { A = [0, 0, 0], B = [0.6, 0, 0] }
members.first = { from = "A", to = "B" }
materials.steel = { E = 210e9, rho = 7850 }
sections.flat = { shape = "rectangle", b = 0.03, h = 0.01 }
frequency.stop = 200
"""
PART = f"""
[[superelements]]
file = "bracket.npz"
mesh = "bracket.vtu"
attach = [{{ point = "B", nodes = {NODES["END"]} }}, {{ name = "top", nodes = {NODES["TOP"]} }}]
"""
SENSOR = '[[sensors]]\nname = "s"\npoint = "top"\ndirection = "z"\n\n[[excitations]]\nsensor = "s"\n'


def study(folder, text):
    """Read a study whose part is drawn as the convex hull of its nodes."""
    (folder / "bracket.npz").write_bytes((DATA / "bracket.npz").read_bytes())
    points = read_matrices(DATA / "bracket.npz").points
    meshio.Mesh(points, [("triangle", ConvexHull(points).simplices)]).write(folder / "bracket.vtu")
    (folder / "study.toml").write_text(text)
    return load_study(folder / "study.toml")


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """A frame with a part."""
    return study(tmp_path_factory.mktemp("both"), FRAME + PART).model


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """A part without a frame."""
    text = PART.replace('point = "B"', 'name = "end"') + SENSOR + "[frequency]\nstop = 6000\n"
    return study(tmp_path_factory.mktemp("alone"), text)


def of_part(model, surface):
    """Return which vertices of a surface are the part's."""
    used = surface.triangles[surface.line == model.mesh.n_lines]
    return np.unique(used)


def test_rigid_motions_move_part_and_frame_as_one_body(both):
    modes = solve_modes(assemble(both), n=8)
    assert modes.n_rigid == 6
    for shape in modes.shapes[:, :6].T:
        surface = model_surface(both, shape)
        at, moved = surface.rest, surface.displacement
        levers = [np.cross(axis, at) for axis in np.eye(3)]
        body = np.stack([*(np.tile(axis, (len(at), 1)) for axis in np.eye(3)), *levers], axis=-1)
        fit, *_ = np.linalg.lstsq(body.reshape(-1, 6), moved.ravel())
        assert np.abs(body @ fit - moved).max() < 1e-6 * np.abs(moved).max()


def test_tied_nodes_move_with_their_point(both):
    """Nodes of a rigid attachment follow its point in elastic modes, too."""
    modes = solve_modes(assemble(both), n=10)
    part = both.effect("bracket")
    B = both.mesh.point_names["B"]
    tied = [part.part.place_of(node) for node in NODES["END"]]
    for shape in modes.shapes[:, 6:].T:
        surface = model_surface(both, shape)
        vertices = of_part(both, surface)
        u, turn = shape[6 * B : 6 * B + 3], shape[6 * B + 3 : 6 * B + 6]
        found = 0
        for place in tied:
            at = vertices[np.linalg.norm(surface.rest[vertices] - place, axis=1) < 1e-9]
            found += at.size
            expected = u + np.cross(turn, place - both.mesh.points[B])
            np.testing.assert_allclose(
                surface.displacement[at], np.tile(expected, (at.size, 1)), rtol=1e-6, atol=1e-9
            )
        assert found


def test_parts_have_names_and_colours_of_their_own(both):
    surface = model_surface(both)
    names = drawn_names(both)
    assert {names[k] for k in surface.line} == {"first", "bracket"}
    assert member_families(both) == {"first": "first", "bracket": "part bracket"}
    traces = [t for t in model_figure(both).data if (t.meta or {}).get("role") in ("member", "part")]
    assert [(t.meta["role"], t.name, set(t.customdata)) for t in traces] == [
        ("member", "first", {"first"}),
        ("part", "part bracket", {"bracket"}),
    ]


def test_a_part_alone_is_drawn(alone, tmp_path):
    model = alone.model
    surface = model_surface(model)
    assert isinstance(surface, Surface)
    assert drawn_size(model) == pytest.approx(np.ptp(surface.rest, axis=0).max())
    path = render_model(model, tmp_path / "model.png", alone.sensors, alone.excitations)
    assert path.stat().st_size > 10_000
    modes = solve_modes(assemble(model), n=8)
    figure = modes_figure(model, modes, frames=False)
    moved = np.asarray(figure.layout.meta["modes"][0]["surface"]).reshape(-1, 3)
    assert len(moved) == len(surface.rest)
    assert np.linalg.norm(moved, axis=1).max() == pytest.approx(0.08 * drawn_size(model), rel=1e-6)


def test_a_sensor_on_a_part_moves_with_its_point(alone):
    top = alone.model.mesh.point_names["top"]
    motion = np.zeros(alone.model.n_dof)
    motion[6 * top : 6 * top + 3] = [1.0, 2.0, 3.0]
    np.testing.assert_array_equal(
        displacement_at(alone.model, motion, alone.sensors[0].point), [[1.0, 2.0, 3.0]]
    )


def test_a_part_without_a_mesh_is_not_drawn(tmp_path):
    model = study(tmp_path, FRAME + PART.replace('mesh = "bracket.vtu"', "")).model
    assert drawn_names(model) == ["first"] * model.mesh.n_lines
    assert set(model_surface(model).line) == set(range(model.mesh.n_lines))


def test_parts_alone_without_a_mesh_are_refused_in_words(tmp_path):
    text = PART.replace('point = "B"', 'name = "end"').replace('mesh = "bracket.vtu"', "") + SENSOR
    with pytest.raises(
        ValueError, match="nothing to draw: the model has no members, and its parts have no mesh"
    ):
        model_surface(study(tmp_path, text + "[frequency]\nstop = 6000\n").model)


def test_a_mesh_of_something_else_is_refused_with_its_key(tmp_path):
    with pytest.raises(StudyError, match=r"mesh: there is no file '.*none\.vtu'"):
        study(tmp_path, FRAME + PART.replace("bracket.vtu", "none.vtu"))
    meshio.Mesh(np.eye(3), [("triangle", [[0, 1, 2]])]).write(tmp_path / "other.vtu")
    with pytest.raises(StudyError, match=r"mesh: other\.vtu: .* surface nodes .* in their units"):
        study(tmp_path, FRAME + PART.replace("bracket.vtu", "other.vtu"))


def test_sections_in_a_legend_are_in_the_unit_of_texts():
    """Of more than eight members with different names, the sections are coloured."""
    names = "abcdefghi"
    points = [[0.1 * k, 0.0, 0.0] for k in range(len(names) + 1)]
    lines = [[k, k + 1] for k in range(len(names))]
    mesh = Mesh.from_lines(points, lines, {name: [k] for k, name in enumerate(names)})
    part = MemberProperties(Material("steel", E=210e9, rho=7850.0), Section.tube(0.0424, 0.0032))
    model = Model(mesh, (Frame(members=dict.fromkeys(names, part)),))
    assert set(member_families(model).values()) == {"tube 0.0424 x 0.0032 m"} == {part.section.label}
    with metres_afterwards():
        show_lengths(1e-3)
        assert set(member_families(model).values()) == {"tube 42.4 x 3.2 mm"}
