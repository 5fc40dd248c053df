"""``dovetail new --from``: a study of a test and a mesh, with sensors on the members."""

import numpy as np
import pytest

from dovetail import load_study
from dovetail.cli import main
from fem.io import read_uff, write_uff
from fem.io.uff_types import Points


@pytest.fixture(scope="module")
def cross(root):
    return root / "examples" / "cross-beam" / "frf.uff", root / "examples" / "cross-beam" / "frame.msh"


@pytest.fixture(scope="module")
def portal(root):
    return root / "examples" / "first-frame" / "test.uff", root / "examples" / "first-frame" / "frame.msh"


def moved(file, path, turn, shift, scale, keep=None):
    """Write FRFs with a geometry in other axes and units: x_test = turnᵀ (x - shift) / scale."""
    read = read_uff(file)
    xyz = (read.points.coordinates - shift) @ turn / scale
    keep = np.ones(len(xyz), dtype=bool) if keep is None else keep
    write_uff(path, read.frfs, geometry=Points(read.points.labels[keep], xyz[keep]))
    return path


def new(folder, frfs, mesh, *more):
    return main(["new", str(folder / "s"), "--from", str(frfs), str(mesh), *more])


def test_a_test_in_the_axes_of_the_mesh(tmp_path, portal, capsys):
    assert new(tmp_path, *portal) == 0
    assert "7 sensors and 2 excitations: not turned" in capsys.readouterr().out
    study = load_study(tmp_path / "s" / "study.toml")
    own = load_study(portal[0].parent / "study.toml")
    assert [s.name for s in study.sensors] == list(own.measurements[0].frf.outputs)
    np.testing.assert_array_equal(study.measurements[0].frf.H, own.measurements[0].frf.H)
    for a, b in zip(study.sensors, own.sensors, strict=True):
        np.testing.assert_allclose(a.point, b.point, atol=1e-6)
        np.testing.assert_allclose(a.direction, b.direction, atol=1e-9)


@pytest.mark.parametrize("lying", [False, True], ids=["on its side", "at an angle"])
def test_a_test_in_other_axes_and_millimetres(tmp_path, cross, lying, capsys):
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]])
    turn = turn @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) if lying else turn
    file = moved(cross[0], tmp_path / "t.uff", turn, np.array([0.2, -0.1, 0.5]), 1e-3)
    assert new(tmp_path, file, cross[1], "--unit", "mm") == 0
    study = load_study(tmp_path / "s" / "study.toml", ("sensors",))
    points = read_uff(cross[0]).points
    assert len(study.sensors) == len(study.measurements[0].frf.outputs) > 10
    for sensor in study.sensors:
        node, letter = int(sensor.name[:-2]), "XYZ".index(sensor.name[-2])
        np.testing.assert_allclose(sensor.point, points.at(node), atol=2e-3)
        np.testing.assert_allclose(sensor.direction, turn[:, letter], atol=0.02)


@pytest.mark.slow  # the placements of a portal are searched twice
def test_of_several_placements_the_most_upright_is_taken(tmp_path, portal, capsys):
    """A portal looks the same from behind; on its head or lying it would be no better."""
    half = np.diag([-1.0, -1.0, 1.0])
    file = moved(portal[0], tmp_path / "t.uff", half, np.array([0.3, 0.2, 0.0]), 1.0)
    assert new(tmp_path, file, portal[1]) == 0
    out = capsys.readouterr().out
    assert "fits the mesh in 2 ways, of which the most upright one is taken" in out
    assert "not turned" in out
    assert main(["new", str(tmp_path / "b"), "--from", str(file), str(portal[1]), "--alternative", "1"]) == 0
    assert "turned 180.0° about (0.00, 0.00" in capsys.readouterr().out


def test_points_beside_the_members_are_left_out_and_said(tmp_path, portal, capsys):
    read = read_uff(portal[0])
    xyz = read.points.coordinates.copy()
    xyz[list(read.points.labels).index(3)] += [0.0, 0.3, 0.0]
    write_uff(tmp_path / "t.uff", read.frfs, geometry=Points(read.points.labels, xyz))
    assert new(tmp_path, tmp_path / "t.uff", portal[1], "--same-axes") == 0
    assert (
        "the nodes 3 lie on no member within 0.01 m; their channels are left out" in capsys.readouterr().out
    )
    assert "3Z+" not in [s.name for s in load_study(tmp_path / "s" / "study.toml").sensors]


def test_bad_requests_are_one_line(tmp_path, portal, capsys):
    read = read_uff(portal[0])
    write_uff(tmp_path / "bare.uff", read.frfs)
    bare = tmp_path / "bare.uff"
    np.savez(tmp_path / "n.npz", frequency=[1.0, 2.0], H=[1j, 2j], kind="mobility")
    write_uff(
        tmp_path / "few.uff", read.frfs, geometry=Points(read.points.labels[:2], read.points.coordinates[:2])
    )
    for words, frfs, mesh, more in (
        ("it has no coordinates of nodes (dataset 15 or 2411); give --geometry", bare, portal[1], []),
        ("it has no coordinates", tmp_path / "n.npz", portal[1], []),
        ("has no points", bare, portal[1], ["--geometry", str(bare)]),
        (
            "the channel 'out1' does not say node and direction",
            tmp_path / "n.npz",
            portal[1],
            ["--geometry", str(portal[0])],
        ),
        ("the geometry has no node", tmp_path / "few.uff", portal[1], []),
        ("No such file", tmp_path / "none.uff", portal[1], []),
        ("none.msh: there is no such file", portal[0], tmp_path / "none.msh", []),
    ):
        assert new(tmp_path, frfs, mesh, *more) == 2
        assert words in capsys.readouterr().err
        assert not (tmp_path / "s").exists()
    assert main(["new"]) == 2
    assert "give the folder to make" in capsys.readouterr().err
    assert new(tmp_path, bare, portal[1], "--geometry", str(portal[0])) == 0


def test_nothing_is_written_over(tmp_path, portal, capsys):
    assert new(tmp_path, *portal) == 0
    assert new(tmp_path, *portal) == 2
    assert new(tmp_path, *portal, "--force") == 2
    assert "exists and would be overwritten" in capsys.readouterr().err
