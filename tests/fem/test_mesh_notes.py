"""Notes of a mesh's reader: they stay with the mesh and reach check, run's results and the report."""

import json
import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dovetail import main
from dovetail.report import Figures, Shown, html
from dovetail.report.sections import notes
from fem import Mesh, MeshError, MeshWarning
from fem.io import read_mesh
from fem.io.rawmesh import MOST_PAIRS, RawMesh, mesh_of

MSH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
3
1 0 0 0
2 0 0 1
3 0 0 9
$EndNodes
$Elements
2
1 1 2 7 1 1 2
2 2 2 8 1 1 2 3
$EndElements
$Periodic
0
$EndPeriodic
"""
NOTES = (
    "a.msh: sections left out: $Periodic (line 15)",
    "a.msh: 1 triangles left out (only lines are read)",
    "a.msh: 1 point on no line is left out, and the others are renumbered in their order",
)
STUDY = """[mesh]
file = "a.msh"
[materials.steel]
E = 210e9
rho = 7850.0
[defaults]
section = { shape = "circle", d = 0.02 }
[frequency]
stop = 50.0
"""


@pytest.fixture
def file(tmp_path):
    (tmp_path / "a.msh").write_text(MSH)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path / "a.msh"


def test_one_warning_says_all_notes(file):
    with pytest.warns(MeshWarning) as said:
        mesh = read_mesh(file)
    assert len(said) == 1
    assert mesh.notes == NOTES
    assert str(said[0].message) == "a.msh: " + "; ".join(n.removeprefix("a.msh: ") for n in NOTES)


def test_changed_copies_keep_the_notes(file):
    with pytest.warns(MeshWarning):
        mesh = read_mesh(file)
    changed = [
        mesh.refined(0.1),
        mesh.split(3),
        mesh.with_point_on("physical 7", 0.4),
        mesh.with_point_on("physical 7", 0.0, "base"),
        replace(mesh, points=mesh.points + 1.0),
    ]
    assert [m.notes for m in changed] == [NOTES] * 5
    assert Mesh.from_lines(mesh.points, mesh.lines).notes == ()


def test_check_prints_the_notes_and_writes_them_as_json(file, capsys):
    out = file.with_name("out.json")
    assert main(["check", str(file.with_name("study.toml")), "--json", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "notes on the mesh file:\n" + "".join(f"  - {note}\n" for note in NOTES) in printed
    assert json.loads(out.read_text())["mesh_notes"] == list(NOTES)


def test_modes_says_the_notes(file, capsys):
    assert main(["modes", str(file.with_name("study.toml")), "--number", "3"]) == 0
    read, assumed = capsys.readouterr().out.split("assumed:")
    assert all(f"  - {note}\n" in read and note not in assumed for note in NOTES)


def test_the_report_has_the_notes(file):
    with pytest.warns(MeshWarning):
        mesh = read_mesh(file)
    study = SimpleNamespace(model=SimpleNamespace(mesh=mesh), measured_notes=("of m.uff",))
    shown = Shown(SimpleNamespace(failures=()), Figures())
    text = html(notes.page(SimpleNamespace(study=study, notes=("of the run",)), shown))
    assert all(f"<li>{note}</li>" in text for note in (*NOTES, "of m.uff", "of the run"))


# Sets and names that meet -------------------------------------------------------------------------------

LINE = np.column_stack([np.arange(5.0), np.zeros(5), np.zeros(5)])


def members(mesh):
    return {name: rows.tolist() for name, rows in mesh.members.items()}


def raw(sets, lines=((0, 1), (1, 2), (2, 3), (3, 4)), points=LINE, **more):
    return RawMesh(points, np.array(lines), sets, **more)


def made(given, n_notes=0, merge=None):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mesh = mesh_of(given, "a.inp", 1.0, merge)
    assert len(mesh.notes) == n_notes
    assert len(caught) == bool(n_notes)
    return mesh


def test_lines_in_no_set_beside_a_set_called_frame():
    assert members(made(raw({"frame": [0, 1]}))) == {"frame": [0, 1], "frame.rest": [2, 3]}


def test_chains_of_a_set_pass_over_the_name_of_another_set():
    mesh = made(raw({"a": [0, 3], "a.1": [1, 2]}))
    assert members(mesh) == {"a.2": [0], "a.3": [3], "a.1": [1, 2]}
    assert mesh.groups["a"] == ("a.2", "a.3")


def test_the_rest_of_a_set_passes_over_the_name_of_another_set():
    mesh = made(raw({"all": [0, 1, 2], "beam": [0], "all.rest": [3]}))
    assert members(mesh) == {"beam": [0], "all.rest": [3], "all.rest.2": [1, 2]}
    assert mesh.groups["all"] == ("beam", "all.rest.2")


def test_sets_that_cross_or_are_empty_are_named():
    mesh = made(raw({"a": [0, 1], "b": [1, 2], "none": []}), 2)
    assert mesh.notes == (
        "a.inp: sets without lines: 'none'",
        "a.inp: sets overlap; lines that several share are separate members: 'a & b'",
    )
    assert mesh.groups["a"] == ("a.rest", "a & b")


def test_point_sets_that_name_nothing_are_named():
    points = np.column_stack([np.arange(61.0), np.zeros(61), np.zeros(61)])
    lines = np.column_stack([np.arange(60), np.arange(1, 61)])
    given = raw({}, lines, points, point_sets={"many": np.arange(51), "none": [], "a": [0, 1], "a.1": [5]})
    mesh = made(given, 3)
    assert dict(mesh.point_names) == {"a.1": 5, "a.2": 1}
    assert mesh.notes == (
        "a.inp: point sets of more than 50 points give no names: 'many'",
        "a.inp: point sets without points: 'none'",
        "a.inp: two point sets give these names, which the first keeps: 'a.1'",
    )


def test_arrays_and_lists_are_the_same_mesh():
    lines = [(0, 1), (2, 4, 3), (1, 2)]
    padded = np.array([[0, 1, -1], [2, 4, 3], [1, 2, -1]])
    sets = {"a": [1], "b": np.array([0, 2])}
    one, other = (
        made(RawMesh(points, given, sets), 1) for points, given in ((LINE.tolist(), lines), (LINE, padded))
    )
    np.testing.assert_array_equal(one.lines, [[0, 1], [2, 3], [3, 4], [1, 2]])
    np.testing.assert_array_equal(other.lines, one.lines)
    assert members(one) == members(other) == {"a": [1, 2], "b": [0, 3]}


# Bounds -------------------------------------------------------------------------------------------------


def test_lines_without_length_are_named_as_in_the_file():
    given = raw({}, [(0, 1), (2, 2)], line_numbers=[11, 12], point_numbers=[1, 2, 3, 4, 5])
    with pytest.raises(
        MeshError, match=r"a\.inp: element 12, from node 3 to node 3, has no length; delete it"
    ):
        mesh_of(given, "a.inp", 1.0, None)
    assert made(given, 2, merge=0.1).n_lines == 1


def test_many_points_at_one_place_are_not_paired_one_by_one():
    n = int(np.sqrt(2 * MOST_PAIRS)) + 100
    points = np.zeros((2 * n, 3))
    points[n:, 0] = 1 + np.arange(n)
    lines = np.column_stack([np.arange(n), n + np.arange(n)])
    mesh = made(RawMesh(points, lines), 1)
    assert "more than 20 million pairs of points lie within" in mesh.notes[0]
    with pytest.raises(MeshError, match=r"merge tolerance of 0\.1 m would join more than 20 million pairs"):
        mesh_of(RawMesh(points, lines), "a.inp", 1.0, 0.1)


def test_chains_hold_every_line_once_and_end_to_end():
    chance = np.random.default_rng(3)
    for _ in range(200):
        n = int(chance.integers(3, 12))
        angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
        points = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
        lines = np.column_stack([np.arange(n), (np.arange(n) + 1) % n])[chance.permutation(n)]
        turned = chance.random(n) < 0.4
        lines[turned] = lines[turned][:, ::-1]
        owner = chance.integers(0, 3, n)
        mesh = Mesh.from_lines(points, lines, {f"s{k}": np.flatnonzero(owner == k) for k in range(3)})
        assert sorted(np.concatenate(list(mesh.members.values())).tolist()) == list(range(n))
        for name, rows in mesh.members.items():
            np.testing.assert_array_equal(mesh.lines[rows[:-1], 1], mesh.lines[rows[1:], 0])
            assert len({int(k) for k in owner[rows]}) == 1
            assert name.startswith(f"s{owner[rows[0]]}")
            assert 2 * (mesh.lines[rows] != lines[rows]).any(axis=1).sum() <= len(rows)
