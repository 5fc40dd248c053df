"""The commands that identify modes, match geometry and update, as a user calls them."""

import importlib.util
import json
import os
import pickle
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from dovetail import load_study, main
from dovetail.disk.output import null_keys
from dovetail.ensemble import bootstrap, run_bootstrap
from dovetail.pipeline import formed_fit_problem
from dovetail.units import FolderError, pool_of
from dovetail.update import update_study
from fem import FRF, Modes, assemble, compute_frf, solve_modes
from fem.io import read_npz_modes, read_uff, write_npz, write_uff
from tests.frames import on_fine_mesh
from updating import sensor_rows

pytestmark = pytest.mark.usefixtures("offscreen")

TEXT = """
[study]
name = "bracket"

[points]
root = [0.0, 0.0, 0.0]
corner = [0.0, 0.0, 0.6]
tip = [0.4, 0.0, 0.6]

[members.post]
from = "root"
to = "corner"

[members.arm]
from = "corner"
to = "tip"

[materials.steel] # as ordered
E = 200e9 # Pa
rho = 7850.0

[sections.flat]
shape = "rectangle"
b = 0.03
h = 0.012

[defaults]
orientation = "y"

[[supports]]
point = "root"

[[masses]]
point = "tip"
mass = 0.2

[damping]
modal = 0.008

[[sensors]]
point = "tip"
directions = "xyz"

[[sensors]]
points = [{ member = "post", position = 0.3 }]
names = ["middle"]
directions = "xy"

[[excitations]]
sensor = "tipz"

[[excitations]]
sensor = "tipy"

[uncertain]
E = 0.1
rho = 0
"""

MEASURED = '\n[[measurements]]\nfile = "frf.npz"\n'
TRUTH = {("frame", "E:steel"): 210e9}


@pytest.fixture(scope="module")
def bracket(tmp_path_factory):
    """Return a study whose modulus is 5 % too low, and the folder with its FRFs in noise of 1 %."""
    folder = tmp_path_factory.mktemp("bracket")
    path = folder / "study.toml"
    path.write_text(TEXT + "\n[frequency]\nstop = 400.0\n", encoding="utf-8")
    study = load_study(path)
    real = on_fine_mesh(study.model.with_values(TRUTH))
    lines = np.arange(2.0, 400.0, 0.5)
    rows = [sensor_rows(real, part) for part in (study.sensors, study.excitations)]
    H = compute_frf(assemble(real), lines, *rows, "accelerance").H
    noise = np.random.default_rng(2).standard_normal((2, *H.shape))
    H = H * (1 + 0.01 * (noise[0] + 1j * noise[1]) / np.sqrt(2))
    names = [[s.name for s in part] for part in (study.sensors, study.excitations)]
    write_npz(folder / "frf.npz", FRF.from_arrays(lines, H, "accelerance", *names))
    path.write_text(TEXT + MEASURED, encoding="utf-8")
    exact = solve_modes(assemble(real), max_frequency=390.0)
    rows = sensor_rows(real, study.sensors)
    write_npz(folder / "modes.npz", Modes(exact.frequency, rows @ exact.shapes, None, tuple(names[0])))
    return path, exact.frequency


@pytest.fixture
def undrawn(monkeypatch):
    """Let reports of updates have no pictures: one test looks at these."""
    for module, name in (
        ("correlation", "plot_mode_pairs"),
        ("curves", "plot_frf"),
        ("modal", "plot_stabilisation"),
        ("updating", "plot_convergence"),
        ("updating", "plot_correlation"),
        ("updating", "plot_parameters"),
        ("updating", "plot_bootstrap"),
    ):
        monkeypatch.setattr(f"viz.{module}.{name}", lambda *_: Figure(figsize=(1, 1)))


def test_modes_are_identified_drawn_and_written(bracket, tmp_path, capsys):
    path, exact = bracket
    out, uff = tmp_path / "modes.npz", tmp_path / "modes.uff"
    words = ["identify-modes", str(path), "--out", str(out), "--picture", str(tmp_path / "s.png")]
    assert main([*words, "--json", str(tmp_path / "m.json")]) == 0
    text = capsys.readouterr().out
    assert "damping ratio [%]" in text
    found = read_npz_modes(out)
    assert found.labels[:3] == ("tipx", "tipy", "tipz")
    assert found.frequency == pytest.approx(exact, rel=1e-3)
    data = json.loads((tmp_path / "m.json").read_text(encoding="utf-8"))
    score = [
        (m["frequency_Hz"] - f) / m["frequency_std_Hz"] for m, f in zip(data["modes"], exact, strict=True)
    ]
    assert np.abs(score).max() < 4.5
    assert (tmp_path / "s.png").read_bytes()[:4] == b"\x89PNG"
    assert main(["identify-modes", str(path), "--quiet", "--out", str(uff)]) == 0
    shapes = read_uff(uff).modes[0]
    assert shapes.frequency == pytest.approx(found.frequency, rel=1e-5)


@pytest.mark.parametrize(
    ("key", "option"), [("least_mpc = 1.0", []), ("", ["--least-mpc", "1"]), ("largest_mpd = 0.0", [])]
)
def test_how_complex_shapes_may_be_is_set(bracket, tmp_path, capsys, key, option):
    """Noise makes every shape a little complex: nothing passes the strictest limits, and peaks are named."""
    path, exact = bracket
    study = path.with_name(f"{tmp_path.name}.toml")
    text = path.read_text(encoding="utf-8")
    study.write_text(f"{text}\n[identification]\n{key}\n", encoding="utf-8")
    assert main(["identify-modes", str(study), *option, "--json", str(tmp_path / "m.json")]) == 0
    shown = capsys.readouterr().out
    data = json.loads((tmp_path / "m.json").read_text(encoding="utf-8"))
    assert not data["modes"]
    named = [p["frequency_Hz"] for p in data["unexplained_peaks"]]
    assert len(named) == len(exact)
    np.testing.assert_allclose(sorted(named), exact, rtol=0.02)
    assert "Hz has no mode: the pole at " in shown
    assert ("(least_mpc)" if "mpd" not in key else "(largest_mpd)") in data["unexplained_peaks"][0]["reason"]
    # the option counts before the study
    if key:
        assert main(["identify-modes", str(study), "--least-mpc", "0", "--largest-mpd", "90"]) == 0
        assert "Hz has no mode" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("key", "message"),
    [("least_mpc = 1.5", "it is 1.5; 0 to 1 is"), ("largest_mpd = 91", "it is 91; 0 to 90 is")],
)
def test_limits_of_complexity_that_cannot_be_are_refused(bracket, tmp_path, capsys, key, message):
    path, _ = bracket
    study = path.with_name(f"{tmp_path.name}.toml")
    study.write_text(f"{path.read_text(encoding='utf-8')}\n[identification]\n{key}\n", encoding="utf-8")
    assert main(["identify-modes", str(study)]) == 2
    assert message in capsys.readouterr().err
    assert main(["identify-modes", str(path), "--least-mpc", "2"]) == 2
    assert "a number from 0 to 1 is needed" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "to"),
    [
        ("", "frf"),
        ('\n[modes]\nfile = "modes.npz"\nfrequency_std = 1e-4\n', "modes"),
        ('\n[update]\nto = ["frequencies"]\n[fit]\nform = false\n', "frequencies"),
        ('\n[update]\nto = ["frf", "modes"]\n', "frf and modes"),
    ],
)
@pytest.mark.usefixtures("all_digits")
def test_a_modulus_comes_back_and_is_written(bracket, tmp_path, capsys, more, to, request):
    if to != "frf and modes":  # which has all pictures
        request.getfixturevalue("undrawn")
    path, _ = bracket
    study = path.with_name(f"{tmp_path.name}.toml")
    study.write_text(path.read_text(encoding="utf-8") + more, encoding="utf-8")
    out = tmp_path / "updated"
    assert main(["update", str(study), "--out", str(out)]) == 0
    assert f"updated to {to}; converged" in capsys.readouterr().out
    data = json.loads((out / "update.json").read_text(encoding="utf-8"))
    assert set(null_keys(data)) == data["missing"].keys()
    (E, *_) = data["parameters"]
    low, high = E["interval_95"]
    assert low < 210e9 < high
    assert E["std"] < (0.004 if "form = false" in more else 0.02) * 210e9
    text = (out / "study.toml").read_text(encoding="utf-8")
    assert "[materials.steel] # as ordered" in text
    new = load_study(out / "study.toml")
    assert new.model.values()["frame", "E:steel"] == pytest.approx(E["value"], rel=1e-9)
    assert len(new.measurements) == 1  # its files are found from there
    if "frf" in to:
        ratios = {float(p["name"].split()[2]): p["value"] for p in data["parameters"][1:]}
        assert new.model.damping.ratio_at(list(ratios)) == pytest.approx(list(ratios.values()), rel=1e-3)
    html = (out / "report.html").read_text(encoding="utf-8")
    assert main(["report", str(out), "--docx", str(tmp_path / "updated.docx")]) == 0
    assert all(word in html for word in ("frame E:steel", "95 % interval", "most correlated with"))
    assert {p.name for p in (out / "pictures").iterdir()} >= {"convergence.png", "parameters.png"}


@pytest.mark.usefixtures("undrawn")
def test_identified_ratios_are_the_damping_of_a_study(bracket, tmp_path):
    """The truth has 0.8 % in all modes; the study's own 0.8 % is replaced by what was identified."""
    path, _ = bracket
    modes = path.with_name("identified.uff")
    assert main(["identify-modes", str(path), "--quiet", "--out", str(modes)]) == 0
    study = path.with_name("damped.toml")
    text = path.read_text(encoding="utf-8").replace("modal = 0.008", f'file = "{modes.name}"')
    study.write_text(text, encoding="utf-8")
    damping, found = load_study(study).model.damping, read_uff(modes).modes[0]
    np.testing.assert_allclose(damping.frequency, found.frequency)
    np.testing.assert_allclose(damping.ratio, found.zeta)
    np.testing.assert_allclose(damping.ratio, 0.008, rtol=0.05)
    # an update writes the ratios in its place, or leaves the file, which is then named from elsewhere
    for more, keys in (("", {"modal"}), ("\n[update]\ndamping = false\n", {"file"})):
        study.write_text(text + more, encoding="utf-8")
        assert main(["update", str(study), "--quiet", "--force", "--out", str(tmp_path / "u")]) == 0
        written = (tmp_path / "u" / "study.toml").read_text(encoding="utf-8")
        assert set(tomllib.loads(written)["damping"]) == keys
        load_study(tmp_path / "u" / "study.toml")


@pytest.mark.usefixtures("undrawn")
def test_bounds_and_groups_and_values_without_a_place(bracket, tmp_path, capsys):
    path, _ = bracket
    more = """
[update]
to = ["frequencies"]

[[update.parameters]]
effect = "frame"
parameter = "E:steel"
upper = 205e9

[[update.parameters]]
name = "body"
effect = "mass at tip"
parameter = "mass"
std = 0.02
"""
    study = path.with_name("bounds.toml")
    study.write_text(path.read_text(encoding="utf-8") + more, encoding="utf-8")
    out = tmp_path / "u"
    assert main(["update", str(study), "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "at a bound: frame E:steel" in text
    values = tomllib.loads((out / "study.toml").read_text(encoding="utf-8"))
    assert values["materials"]["steel"]["E"] == pytest.approx(205e9, rel=1e-12)
    assert values["masses"][0]["mass"] == pytest.approx(0.2 / 210 * 205, rel=0.05)  # it has to be lighter


@pytest.mark.usefixtures("undrawn", "all_digits")
def test_members_and_groups_get_parameters_of_their_own(bracket, tmp_path, capsys):
    """The true 210 GPa are 5 % more than the study has: so are both members, however they are asked for."""
    path, _ = bracket
    more = """
[uncertain]
E = 0
rho = 0

[fit]
form = false

[update]
to = ["frequencies"]

[[update.parameters]]
effect = "member_stiffness:*"
each = true
std = 0.2
"""
    study = path.with_name("each.toml")
    text = path.read_text(encoding="utf-8").replace("[uncertain]\nE = 0.1\nrho = 0\n", "")
    study.write_text(text + more, encoding="utf-8")
    out = tmp_path / "u"
    assert main(["update", str(study), "--out", str(out)]) == 0
    assert "member_stiffness:arm change" in capsys.readouterr().out
    every = json.loads((out / "update.json").read_text(encoding="utf-8"))["parameters"]
    parameters = [p for p in every if p["name"].startswith("member")]
    for p in parameters:
        low, high = p["interval_95"]
        assert low < 0.05 < high
        assert p["std"] < 0.02
    new = load_study(out / "study.toml")
    written = [new.model.values()[f"known member_stiffness:{m}", "change"] for m in ("post", "arm")]
    assert written == pytest.approx([p["value"] for p in parameters], rel=1e-9)

    # again from what was written: the effects are there, and get their new values in place
    again = (out / "study.toml").read_text(encoding="utf-8").replace("each = true\nstd = 0.2", 'name = "all"')
    (out / "again.toml").write_text(again.replace("change = ", "# change = ", 1), encoding="utf-8")
    capsys.readouterr()
    assert main(["update", str(out / "again.toml"), "--out", str(tmp_path / "v")]) == 0
    last = tomllib.loads((tmp_path / "v" / "study.toml").read_text(encoding="utf-8"))["effects"]
    assert [e["candidate"] for e in last] == ["member_stiffness:post", "member_stiffness:arm"]
    # the post had lost its value, so that one amount lifts it to about 5 % and the arm to about twice that
    assert last[1]["change"] - last[0]["change"] == pytest.approx(parameters[1]["value"], rel=1e-6)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("[modes]\nfrequency = [10.0, -3.0]", "modes.frequency: [10.0, -3.0] is not allowed"),
        ("[modes]\nfrequency_std = 0.1", "give either file"),
        ('[modes]\nfile = "none.npz"', "there is no file"),
        ("[modes]\nfrequency = [10.0]\nshape_std = 0.1", "there are frequencies but no shapes"),
        ('[update]\nto = "shapes"', "'shapes' is not allowed"),
        ('[update]\nto = ["modes", "frequencies"]', "leave 'frequencies' out"),
        ('[[update.parameters]]\neffect = "frme"\nparameter = "E:steel"', "did you mean 'frame'?"),
        ('[[update.parameters]]\neffect = "frame"\nparameter = "E"', "'frame' has no parameter 'E'"),
        ('[[update.parameters]]\neffect = "frame"\nparameter = "E:steel"\nlower = 3e11', "must lie between"),
        (
            '[[update.parameters]]\neffect = "frame"\nparameter = "E:steel"\n' * 2,
            "is updated by parameter 1 already",
        ),
        ("[update]\nstart = 2", "unknown key; did you mean 'starts'?"),
        ('[[update.parameters]]\neffect = "member_stifness:post"', "did you mean 'member_stiffness'?"),
        ('[[update.parameters]]\neffect = "member_stiffness:pst"', "the nearest are member_stiffness:post"),
        ('[[update.parameters]]\neffect = ["member_stiffness:post", "frame"]', "has no parameter 'change'"),
        ('[[update.parameters]]\neffect = "crack:post.ry"', "has compliance, position"),
        ("[[update.parameters]]\neffect = 3", "the name of an effect, or a list"),
        (
            '[[update.parameters]]\neffect = ["member_stiffness:*", "member_stiffness:arm"]',
            "'known member_stiffness:arm' is named twice",
        ),
        (
            '[[update.parameters]]\neffect = "member_stiffness:*"\neach = true\nname = "all"',
            "leave name out",
        ),
        (
            '[[update.parameters]]\neffect = "member_stiffness:arm"\n' * 2,
            "'change' of 'known member_stiffness:arm' is updated by parameter 1 already",
        ),
    ],
)
def test_what_cannot_be_meant_is_refused(bracket, capsys, more, words):
    path, _ = bracket
    study = path.with_name("wrong.toml")
    study.write_text(path.read_text(encoding="utf-8") + "\n" + more, encoding="utf-8")
    assert main(["compare", str(study)]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("damping", "words"),
    [
        ('file = "none.uff"', "damping.file: there is no file"),
        ('modal = 0.01\nfile = "modes.npz"', "give either modal"),
        ('file = "modes.npz"', "modes.npz has no damping ratios"),
        ('file = "frf.npz"', "damping.file: "),
        ("file = 3", "damping.file: 3 is not allowed"),
    ],
)
def test_files_without_damping_are_refused(bracket, capsys, damping, words):
    path, _ = bracket
    study = path.with_name("damping.toml")
    study.write_text(path.read_text(encoding="utf-8").replace("modal = 0.008", damping), encoding="utf-8")
    assert main(["compare", str(study)]) == 2
    assert words in capsys.readouterr().err


def test_without_data_or_unknowns(bracket, tmp_path, capsys):
    path, _ = bracket
    bare = tmp_path / "bare.toml"
    bare.write_text(path.read_text(encoding="utf-8").replace(MEASURED, ""), encoding="utf-8")
    assert main(["update", str(bare), "--out", str(tmp_path / "o")]) == 2
    assert "an update needs measured FRFs or modes" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()
    sure = path.with_name("sure.toml")
    sure.write_text(path.read_text(encoding="utf-8").replace("E = 0.1", "E = 0"), encoding="utf-8")
    assert main(["update", str(sure), "--out", str(tmp_path / "o")]) == 2
    assert "no parameter is uncertain" in capsys.readouterr().err


def test_geometry_in_other_axes_is_matched_and_drawn(bracket, tmp_path, capsys):
    path, _ = bracket
    turn = np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]])
    places = np.array([[0, 0, 0.1], [0, 0, 0.33], [0, 0, 0.6], [0.15, 0, 0.6], [0.4, 0, 0.6]])
    table, picture = tmp_path / "test.csv", tmp_path / "match.png"
    rows = "".join(f"A{k},{x!r},{y!r},{z!r}\n" for k, (x, y, z) in enumerate((places @ turn + 2.0).tolist()))
    table.write_text("name,x,y,z\n" + rows, encoding="utf-8")
    words = ["match", str(path), str(table), "--tolerance", "0.005"]
    assert main([*words, "--picture", str(picture), "--json", str(tmp_path / "m.json")]) == 0
    assert "5 of 5 points matched" in capsys.readouterr().out
    data = json.loads((tmp_path / "m.json").read_text(encoding="utf-8"))
    found = np.array([p["point_m"] for p in data["points"]])
    np.testing.assert_allclose(found, places, atol=1e-5)
    assert data["points"][1]["member"] == "post"
    assert picture.read_bytes()[:4] == b"\x89PNG"
    for bad, said in (
        (b"A,1,2\n", "row 1 is A, 1, 2; a table of names and three coordinates"),
        (b"A,0,0,0\nB,0,0,nan\nC,0,1,0\n", "row 2 is B, 0, 0, nan"),
        (b"$MeshFormat\n4.1 0 8\n", "or a universal file (.uff, .unv"),
        (b"PK\x03\x04\xff\xfe", "row 1 is PK"),
    ):
        table.write_bytes(bad)
        assert main(words) == 2
        assert said in capsys.readouterr().err


def test_modes_of_a_universal_file_belong_to_nodes(bracket, tmp_path):
    """Shapes by node and direction; a sensor that reads the other way has its rows turned round."""
    path, exact = bracket
    study = load_study(path)
    mesh = study.model.mesh
    labels = ("1X+", "1Y+", "1Z-")
    shapes = np.arange(1.0, 1 + 3 * len(exact)).reshape(3, -1)
    tip = path.with_name("tip.toml")
    text = path.read_text(encoding="utf-8").replace(MEASURED, "")
    tip.write_text(
        text.replace('point = "tip"\ndirections = "xyz"', 'point = "tip"\nnode = 1\ndirections = "xyz"')
        + '\n[modes]\nfile = "m.unv"\n',
        encoding="utf-8",
    )
    write_uff(path.with_name("m.unv"), modes=Modes(exact, shapes, None, labels), mesh=mesh)
    found = load_study(tip).modes
    assert found is not None
    assert found.modes.labels == ("tipx", "tipy", "tipz")
    np.testing.assert_allclose(found.modes.shapes, shapes * [[1], [1], [-1]], rtol=1e-5)


@pytest.mark.usefixtures("undrawn")
def test_a_node_missing_in_one_mode_is_a_gap_of_that_mode(bracket, tmp_path, capsys):
    """The other modes keep their values there, and the update uses all that is there."""
    path, _ = bracket
    places = [("post", 0.2), ("post", 0.4), ("post", 0.6), ("arm", 0.25)]
    text = path.read_text(encoding="utf-8").replace(MEASURED, "") + "".join(
        f'[[sensors]]\nnode = {node}\nmember = "{member}"\nposition = {position}\ndirections = "xyz"\n'
        for node, (member, position) in enumerate(places, start=1)
    )
    gappy = path.with_name("gappy.toml")
    gappy.write_text(text, encoding="utf-8")
    study = load_study(gappy)
    stiffer = study.model.with_values({("frame", "E:steel"): 1.05 * 200e9})
    computed = solve_modes(assemble(on_fine_mesh(stiffer)), n=3)
    rows = sensor_rows(on_fine_mesh(study.model), study.sensors[-12:])
    shapes = rows @ computed.shapes
    shapes[3:6, 1] = np.nan
    labels = tuple(f"{node}{d}+" for node in (1, 2, 3, 4) for d in "XYZ")
    write_uff(path.with_name("m.unv"), modes=Modes(computed.frequency, shapes, None, labels))
    gappy.write_text(f'{text}[modes]\nfile = "m.unv"\n', encoding="utf-8")
    with_modes = load_study(gappy)
    assert with_modes.modes is not None
    np.testing.assert_allclose(with_modes.modes.modes.shapes, shapes, rtol=1e-5, atol=1e-9)
    out = tmp_path / "gappy"
    assert main(["update", str(gappy), "--out", str(out)]) == 0
    found = json.loads((out / "update.json").read_text(encoding="utf-8"))
    (modulus,) = (p for p in found["parameters"] if p["name"] == "frame E:steel")
    assert abs(modulus["value"] - 1.05 * 200e9) < modulus["std"]
    assert found["path"][-1]["mac"] == pytest.approx(1, abs=1e-5)


@pytest.fixture(scope="module")
def by_frequencies(bracket):
    """Return the study of the bracket with its natural frequencies in place of FRFs."""
    path, exact = bracket
    own = path.parent / "frequencies.toml"
    listed = ", ".join(f"{f:.6f}" for f in exact[:4])
    own.write_text(f"{TEXT}\n[modes]\nfrequency = [{listed}]\n", encoding="utf-8")
    return own


def refits_of(updated, n, folder, processes=None, seed=0):
    with pool_of(processes) as pool:
        return run_bootstrap(updated, n, seed, folder, pool)


def test_refits_do_not_depend_on_workers_and_continue(by_frequencies, tmp_path):
    updated = update_study(load_study(by_frequencies)).updated
    one = refits_of(updated, 12, tmp_path / "one")
    two = refits_of(updated, 12, tmp_path / "two", processes=2)
    np.testing.assert_array_equal(one.values, two.values)
    refits_of(updated, 10, tmp_path / "more")
    more = refits_of(updated, 12, tmp_path / "more")
    np.testing.assert_array_equal(one.values, more.values)
    with pytest.raises(FolderError, match="seed differs"):
        refits_of(updated, 12, tmp_path / "one", seed=1)


def test_failed_refits_are_listed_and_tried_again(by_frequencies, tmp_path, monkeypatch):
    updated = update_study(load_study(by_frequencies)).updated
    right = bootstrap.refit

    def wrong(model, unit):
        if unit == 3:
            msg = "the fit ended stuck"
            raise ValueError(msg)
        return right(model, unit)

    monkeypatch.setattr(bootstrap, "refit", wrong)
    found = refits_of(updated, 12, tmp_path / "refits")
    assert (found.n, found.asked) == (11, 12)
    assert [(o.unit, o.failure) for o in found.failures] == [(3, "the fit ended stuck")]
    assert "  3: the fit ended stuck" in bootstrap.lines_of(found)
    assert bootstrap.as_dict(found)["failures"] == [{"refit": 3, "reason": "the fit ended stuck"}]
    monkeypatch.setattr(bootstrap, "refit", right)
    again = refits_of(updated, 12, tmp_path / "refits")
    assert (again.n, again.failures) == (12, ())


def test_the_command_writes_a_bootstrap(by_frequencies, tmp_path, capsys):
    out = tmp_path / "updated"
    assert main(["update", str(by_frequencies), "--out", str(out), "--bootstrap", "12", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)["bootstrap"]
    values = np.loadtxt(out / "bootstrap.csv", delimiter=",", skiprows=1, ndmin=2)
    assert values.shape == (found["refits"], 1)
    (E,) = found["parameters"]
    assert E["std"] == pytest.approx(values[:, 0].std(ddof=1), rel=1e-6)
    assert E["bias"] == pytest.approx(values[:, 0].mean() - E["value"], rel=1e-4)
    assert E["quantiles"] == pytest.approx(np.quantile(values[:, 0], found["probabilities"]), rel=1e-6)
    assert E["std"] == pytest.approx(E["linearised_std"], rel=0.7)  # of twelve
    assert (tmp_path / "updated-bootstrap" / "bootstrap.jsonl").is_file()
    assert (out / "pictures" / "bootstrap.png").stat().st_size > 1000
    assert "Bootstrap" in (out / "report.html").read_text(encoding="utf-8")
    words = ["update", str(by_frequencies), "--out", str(out), "--bootstrap", "12", "--force"]
    assert main(words) == 0  # all are there
    assert "bootstrap: 12 refits of 12 resamples" in capsys.readouterr().out
    assert main([*words[:-2], "5"]) == 2
    assert "at least 10 resamples are needed" in capsys.readouterr().err


ON_DASK = """
import sys
from distributed import LocalCluster
from dovetail.cli import main

if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50) as two:
        sys.exit(main([*sys.argv[1:], "--scheduler", two.scheduler_address]))
"""


@pytest.mark.slow
@pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None, reason="the extra 'cluster' (distributed) is missing"
)
def test_a_bootstrap_on_dask_has_the_numbers_of_one_process(by_frequencies, tmp_path):
    program = tmp_path / "program.py"
    program.write_text(ON_DASK)
    path = os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
    found = {}
    for name, start in (("one", ["-m", "dovetail"]), ("dask", [str(program)])):
        words = ["update", str(by_frequencies), "--bootstrap", "12", "--quiet", "--out", str(tmp_path / name)]
        more = ["--processes", "1"] if name == "one" else []
        done = subprocess.run(
            [sys.executable, "-W", "ignore", *start, *words, *more],
            env=os.environ | {"PYTHONPATH": path},
            capture_output=True, text=True, timeout=240, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        data = json.loads((tmp_path / name / "update.json").read_text(encoding="utf-8"))
        values = np.loadtxt(tmp_path / name / "bootstrap.csv", delimiter=",", skiprows=1, ndmin=2)
        found[name] = data["bootstrap"], values
    assert found["one"][1].shape == (12, 1)
    assert np.unique(found["one"][1]).size == 12
    np.testing.assert_array_equal(found["one"][1], found["dask"][1])
    assert found["one"][0] == found["dask"][0]


@pytest.mark.usefixtures("undrawn")
def test_a_study_that_was_updated_is_updated_to_the_same(bracket, tmp_path, capsys):
    """The form that the first update wrote keeps its priors, and its places are known."""
    path, _ = bracket
    found = []
    for name, study in (("first", path), ("second", tmp_path / "first" / "study.toml")):
        assert main(["update", str(study), "--out", str(tmp_path / name)]) == 0
        assert "has no place in the study file" not in capsys.readouterr().out
        data = json.loads((tmp_path / name / "update.json").read_text(encoding="utf-8"))
        found.append(next(p for p in data["parameters"] if p["name"] == "frame E:steel"))
    assert found[1]["value"] == pytest.approx(found[0]["value"], abs=0.5 * found[0]["std"])
    assert found[1]["std"] == pytest.approx(found[0]["std"], rel=0.1)


def test_a_study_with_a_baseline_is_updated_to_its_second_state(bracket):
    path, exact = bracket
    both = path.with_name("both.toml")
    listed = ", ".join(f"{f:.6f}" for f in exact[:4])
    first = ", ".join(f"{f:.6f}" for f in exact[:4] * np.sqrt(200 / 210))
    text = f"{TEXT}\n[modes]\nfrequency = [{listed}]\n\n[baseline]\nfrequency = [{first}]\n"
    both.write_text(text + "\n[fit]\nform = false\n", encoding="utf-8")
    E = update_study(load_study(both)).updated["frame E:steel"]
    assert E.value == pytest.approx(210e9, rel=1e-3)
    assert 0 < E.std < 0.01 * E.value


def test_damping_over_frequency_reaches_other_processes(bracket):
    path, _ = bracket
    own = path.with_name("over.toml")
    text = path.read_text(encoding="utf-8")
    own.write_text(
        text.replace("modal = 0.008", "modal = { frequency = [5.0, 200.0], ratio = [0.006, 0.009] }")
    )
    problem = formed_fit_problem(load_study(own))
    again = pickle.loads(pickle.dumps(problem.damping))
    np.testing.assert_array_equal(
        again.ratio([20.0, 90.0], again.start), problem.damping.ratio([20.0, 90.0], again.start)
    )
