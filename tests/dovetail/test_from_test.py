"""``dovetail new --from``: a study of a test and a mesh, with sensors on the members."""

import numpy as np
import pytest

from dovetail import load_study, main
from fem.io import Points, read_mesh, read_uff, write_uff
from fem.io.abaqus import abaqus_text


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
    assert study.name == "frame"  # of the structure, not of the file of its test
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
    assert new(tmp_path, file, cross[1], "--geometry-unit", "mm") == 0
    study = load_study(tmp_path / "s" / "study.toml", ("sensors",))
    points = read_uff(cross[0]).points
    assert len(study.sensors) == len(study.measurements[0].frf.outputs) > 10
    for sensor in study.sensors:
        node, letter = int(sensor.name[:-2]), "XYZ".index(sensor.name[-2])
        np.testing.assert_allclose(sensor.point, points.at(node), atol=2e-3)
        np.testing.assert_allclose(sensor.direction, turn[:, letter], atol=0.02)


@pytest.mark.parametrize("units", ["mm", "mm-t-s"])
def test_a_mesh_in_millimetres(tmp_path, portal, units):
    mesh = read_mesh(portal[1])
    (tmp_path / "mm.inp").write_text(abaqus_text(read_mesh(portal[1], 1e3)))
    assert new(tmp_path, portal[0], tmp_path / "mm.inp", "--units", units) == 0
    study = load_study(tmp_path / "s" / "study.toml", ("sensors",))
    np.testing.assert_allclose(
        np.ptp(study.model.mesh.points, axis=0), np.ptp(mesh.points, axis=0), rtol=1e-9
    )


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
            "the channel 'out1' does not name a point of the geometry (1, 2, 3",
            tmp_path / "n.npz",
            portal[1],
            ["--geometry", str(portal[0])],
        ),
        ("the geometry has no node", tmp_path / "few.uff", portal[1], []),
        ("no such file", tmp_path / "none.uff", portal[1], []),
        ("none.msh: there is no such file", portal[0], tmp_path / "none.msh", []),
    ):
        assert new(tmp_path, frfs, mesh, *more) == 2
        assert words in capsys.readouterr().err
        assert not (tmp_path / "s").exists()
    assert main(["new"]) == 2
    assert "give the folder to make" in capsys.readouterr().err
    assert new(tmp_path, bare, portal[1], "--geometry", str(portal[0])) == 0


def spelt(label, form):
    """Return a label such as 3Z+ as 3:+Z, 3Z, Z3, P3_z or frame:P3:+Z."""
    name, axis, sign = label[:-2], label[-2], label[-1]
    point = f"P{name}"
    forms = (
        f"{name}:{sign}{axis}",
        f"{axis}{name}",
        f"{point}_{axis.lower()}",
        f"frame:{point}:{sign}{axis}",
    )
    return {f: words for f, words in zip(["colon", "before", "lower", "part"], forms, strict=True)}[form]


@pytest.mark.parametrize(
    ("form", "pair", "heading"),
    [
        ("colon", "{}/{}", "name,x [mm],y [mm],z [mm]"),
        ("before", "H({},{})", "z [mm],Point,y [mm],x [mm]"),
        ("lower", "{}/{}", "name,x [mm],y [mm],z [mm]"),
        ("part", "FRF({}; {})", "name,x [mm],y [mm],z [mm]"),
    ],
)
def test_frfs_of_a_table_with_points_of_a_table(tmp_path, portal, form, pair, heading):
    read = read_uff(portal[0])
    frf = read.frf()
    prefix = "P" if form in ("lower", "part") else ""
    rows = [heading]
    for node, (x, y, z) in zip(read.points.labels, 1e3 * read.points.coordinates, strict=True):
        values = {
            "name": f"{prefix}{node}",
            "Point": f"{prefix}{node}",
            "x": f"{x}",
            "y": f"{y}",
            "z": f"{z}",
        }
        rows.append(",".join(values[word.removesuffix(" [mm]")] for word in heading.split(",")))
    (tmp_path / "points.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    curves = [(o, i) for o in range(len(frf.outputs)) for i in range(len(frf.inputs))]
    names = [pair.format(spelt(frf.outputs[o], form), spelt(frf.inputs[i], form)) for o, i in curves]
    parts = [f"{name} {part} [(m/s²)/N]" for name in names for part in ("Re", "Im")]
    lines = ["Frequency [Hz]\t" + "\t".join(parts)]
    for f, H in zip(frf.frequency, frf.as_kind("accelerance").H, strict=True):
        numbers = [repr(float(part)) for o, i in curves for part in (H[o, i].real, H[o, i].imag)]
        lines.append("\t".join([repr(float(f)), *numbers]))
    (tmp_path / "frf.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert new(tmp_path, tmp_path / "frf.csv", portal[1], "--geometry", str(tmp_path / "points.csv")) == 0
    study = load_study(tmp_path / "s" / "study.toml")
    own = load_study(portal[0].parent / "study.toml")
    assert [s.name for s in study.sensors] == [spelt(label, form) for label in frf.outputs]
    np.testing.assert_allclose(study.measurements[0].frf.H, own.measurements[0].frf.H, rtol=1e-9)
    for a, b in zip(study.sensors, own.sensors, strict=True):
        np.testing.assert_allclose(a.point, b.point, atol=1e-6)
        sense = 1 if form in ("colon", "part") else np.sign(b.direction.sum())
        np.testing.assert_allclose(a.direction, sense * b.direction, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "more", "words"),
    [
        ("name,x [mm],y [m],z [m]\n1,0,0,0\n", [], "its coordinates have the units m, mm"),
        ("name,x [mm],y [mm],z [mm]\n1,0,0,0\n", ["--geometry-unit", "m"], "leave --geometry-unit out"),
        ("name,x,y,z\n1,0,0,0\n1,1,0,0\n", [], "two points have the name '1'"),
        ("name,x,y,z\n1,0,0\n", [], "row 2 is 1, 0, 0"),
    ],
)
def test_tables_of_points_that_are_refused(tmp_path, portal, text, more, words, capsys):
    (tmp_path / "points.csv").write_text(text, encoding="utf-8")
    assert new(tmp_path, *portal, "--geometry", str(tmp_path / "points.csv"), *more) == 2
    assert words in capsys.readouterr().err


def test_nothing_is_written_over(tmp_path, portal, capsys):
    assert new(tmp_path, *portal) == 0
    for options in ((), ("--force",)):  # to advise --force, which is refused, helps nobody
        assert new(tmp_path, *portal, *options) == 2
        err = capsys.readouterr().err
        assert "exists and would be overwritten" in err
        assert "--force" not in err
