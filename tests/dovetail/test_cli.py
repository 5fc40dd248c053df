"""The commands, as a user calls them."""

import argparse
import json
import re
import shutil
import subprocess
import sys
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pytest

from dovetail import load_study, main
from dovetail.cli import COMMANDS as ALL_COMMANDS
from dovetail.cli import GROUPS
from dovetail.commands.argument_types import count, natural, share
from dovetail.report.page import page
from fem import FRF, assemble, compute_frf
from fem.io import read_csv, read_npz, read_uff, write_npz
from tests.frames import CROSSED_BEAMS
from tests.studies import study_file
from updating import sensor_rows
from viz.offscreen import can_draw

COMMANDS = ("new", "check", "modes", "frf", "report", "identify-joint")


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("material = MAT1 # of the deck", 'texts stand in quotes: "MAT1"'),
        ("file = mesh/frame.msh", 'texts stand in quotes: "mesh/frame.msh"'),
        ("directions = [x, y]", 'texts stand in quotes: "x"'),
        ("coupled = True", "TOML writes true"),
        ("E = .5", "TOML writes 0.5"),
        ("E = -.5e9 # Pa", "TOML writes -0.5e9"),
        ('material = "steel', "a text needs its closing quote"),
        ("E = 210 GPa", "numbers stand without a unit"),
        ("E = 210e9 Pa # of the deck", "leave 'Pa' out"),
        ("file = C:\\mesh\\frame.msh", r"texts stand in quotes: 'C:\mesh\frame.msh'"),
        ('file = "C:\\mesh.msh"', "a backslash in double quotes begins an escape"),
        ('[mesh]\nfile = "a\\temp.msh"', "write / in place of it"),
    ],
)
def test_texts_without_quotes_are_suspected(tmp_path, capsys, line, hint):
    assert main(["check", str(study_file(tmp_path, f"{line}\n"))]) == 2
    assert hint in capsys.readouterr().err


@pytest.mark.parametrize(("text", "value"), [("1%", 0.01), ("1 %", 0.01), ("0.5 %", 0.005), ("0.01", 0.01)])
def test_a_share_is_a_number_below_one_or_in_per_cent(text, value):
    assert share(text) == pytest.approx(value)


@pytest.mark.parametrize("text", ["0", "1", "5", "-1%", "1%%", "much", "500%", "100%", "1,5%"])
def test_a_share_that_could_be_per_cent_is_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match=r"a share is needed, such as 1% or 0\.01"):
        share(text)


def test_the_desk_is_a_name_of_its_command(capsys):
    assert main(["desk", "--help"]) == 0
    assert "example:\n  dovetail open" in capsys.readouterr().out


def test_a_picture_goes_into_a_folder_under_the_commands_name(portal, tmp_path):
    lines = ["--start", "10", "--stop", "60", "--step", "5"]
    assert main(["base", str(portal), *lines, "--picture", str(tmp_path), "--quiet"]) == 0
    assert (tmp_path / "base.png").stat().st_size > 0


def test_the_base_moves_along_several_axes(portal, tmp_path):
    lines = ["--start", "10", "--stop", "60", "--step", "5", "--quiet"]
    every = [*("--motion", "x"), *("--motion", "y"), *("--motion", "z")]
    assert main(["base", str(portal), *lines, "--motion", "xyz", "--out", str(tmp_path / "run.csv")]) == 0
    assert main(["base", str(portal), *lines, *every, "--out", str(tmp_path / "each.csv")]) == 0
    assert (tmp_path / "run.csv").read_text() == (tmp_path / "each.csv").read_text()


def test_a_count_has_at_most_nineteen_digits_and_a_seed_more():
    assert count("9" * 19) == natural("9" * 19)
    assert natural("9" * 20) == int("9" * 20)
    with pytest.raises(argparse.ArgumentTypeError, match="a whole number of at least 1 is needed"):
        count("9" * 20)


@pytest.fixture(scope="module")
def portal(tmp_path_factory):
    """Return the study that ``new`` writes."""
    folder = tmp_path_factory.mktemp("new") / "portal"
    assert main(["new", str(folder), "--quiet"]) == 0
    return folder / "study.toml"


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example(command, capsys):
    assert main([command, "--help"]) == 0
    out = capsys.readouterr().out
    assert f"example:\n  dovetail {command}" in out


def test_help_and_version(capsys):
    assert main(["--help"]) == 0
    out = capsys.readouterr().out
    assert all(command in out for command in COMMANDS)
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("dovetail ")


def test_help_lists_every_command_in_its_group(capsys):
    assert main(["--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    groups = [line for line in lines if line.rstrip(":") in GROUPS]
    assert groups == [f"{group}:" for group in GROUPS]
    listed = {line.split()[0] for line in lines if line.startswith("  ") and not line.startswith("   ")}
    assert {*ALL_COMMANDS} <= listed


@pytest.mark.parametrize("command", ["compare", "locate"])
def test_commands_that_draw_into_a_folder(portal, tmp_path, command):
    if command == "locate" and not can_draw():
        pytest.skip("no OpenGL")
    assert main([command, str(portal), "--quiet", "--picture", str(tmp_path)]) == 0
    assert (tmp_path / f"{command}.png").read_bytes().startswith(b"\x89PNG")


def test_places_of_modes_alone_are_refused_with_what_takes_them(root, capsys):
    assert main(["locate", str(root / "examples/four-storeys/study.toml")]) == 2
    assert "this needs FRFs; 'compare', 'diagnose' and 'run' take modes alone" in capsys.readouterr().err


def test_python_m_study(root, portal):
    done = subprocess.run(
        [sys.executable, "-m", "dovetail", "modes", portal, "--number", "2"],
        cwd=root,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    assert "Portal" in done.stdout


def test_new_is_whole_and_the_users_own(portal, tmp_path, capsys):
    assert sorted(p.name for p in portal.parent.iterdir()) == ["frf.npz", "study.toml"]
    study = load_study(portal)
    assert len(study.measurements) == 1
    assert "not measured" in study.text
    assert main(["new", str(portal.parent)]) == 2
    assert "study.toml exists and would be overwritten" in capsys.readouterr().err
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    assert main(["new", str(tmp_path)]) == 2
    assert "give --force to write into it" in capsys.readouterr().err


LOOSE = """
[study]
name = "two bars"

[members.post]
from = [0, 0, 0]
to = [0, 0, 0.5]
material = "steel"
section = { shape = "rectangle", b = 0.03, h = 0.012 }

[members.arm]
from = [0, 0, 0.5002]
to = [0.4, 0, 0.5002]
material = "steel"
section = { shape = "rectangle", b = 0.03, h = 0.012 }

[materials.steel]
E = 210e9
rho = 7850
nu = 0.3

[[supports]]
point = [0, 0, 0]
"""


def test_check_of_a_sound_model(portal, capsys):
    assert main(["check", str(portal)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "no faults found"


@pytest.mark.usefixtures("offscreen")
def test_check_names_and_draws_faults(tmp_path, capsys):
    study, picture = tmp_path / "study.toml", tmp_path / "faults.png"
    study.write_text(LOOSE, encoding="utf-8")
    assert main(["check", str(study), "--picture", str(picture), "--json", str(tmp_path / "f.json")]) == 0
    out = capsys.readouterr().out
    assert "loose part: " in out
    assert "of member 'arm'" in out
    assert "0.0002 m apart" in out
    assert out.splitlines()[-1] == "2 fault(s) found"
    found = json.loads((tmp_path / "f.json").read_text(encoding="utf-8"))
    assert [f["kind"] for f in found["faults"]] == ["loose part", "unconnected points"]
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert main(["check", str(study), "--picture", str(tmp_path / "faults.jpg")]) == 2
    assert "written as .png" in capsys.readouterr().err


def test_modes(portal, tmp_path, capsys):
    assert main(["modes", str(portal), "--number", "3", "--json", str(tmp_path / "m.json")]) == 0
    out = capsys.readouterr().out
    found = json.loads((tmp_path / "m.json").read_text(encoding="utf-8"))
    assert len(found["modes"]) == 3
    assert f"{found['modes'][0]['frequency_Hz']:.4f}" in out
    assert main(["modes", str(portal), "--max", "120", "--json", "-"]) == 0
    up_to = json.loads(capsys.readouterr().out)
    assert [m["frequency_Hz"] for m in up_to["modes"]] == pytest.approx(
        [m["frequency_Hz"] for m in found["modes"]]
    )
    assert main(["modes", str(portal), "--quiet"]) == 0
    assert capsys.readouterr().out == ""


def test_modes_of_an_unstable_structure(portal, tmp_path, capsys):
    """Members under compression beyond what they bear: some modes are below zero, and marked."""
    members = load_study(portal).model.mesh.members
    press = "".join(f'[[effects]]\ncandidate = "preload:{name}"\ntension = -2e4\n' for name in members)
    study = shutil.copytree(portal.parent, tmp_path / "pressed") / "study.toml"
    study.write_text(portal.read_text(encoding="utf-8") + "\n" + press, encoding="utf-8")
    assert main(["modes", str(study), "--json", str(tmp_path / "m.json")]) == 0
    modes = json.loads((tmp_path / "m.json").read_text(encoding="utf-8"))["modes"]
    below = sum(m["frequency_Hz"] < 0 for m in modes)
    assert 0 < below == capsys.readouterr().out.count("grows: the structure is unstable")


@pytest.mark.usefixtures("offscreen")
def test_pictures_of_modes(portal, tmp_path):
    assert main(["modes", str(portal), "--number", "1", "--picture", str(tmp_path / "p"), "--quiet"]) == 0
    assert (tmp_path / "p" / "mode-01.png").stat().st_size > 1000


def test_frf_in_every_format(portal, tmp_path, capsys):
    for suffix in ("npz", "csv", "uff"):
        assert (
            main(
                [
                    "frf",
                    str(portal),
                    "--out",
                    str(tmp_path / f"f.{suffix}"),
                    "--stop",
                    "100",
                    "--kind",
                    "mobility",
                ]
            )
            == 0
        )
    assert "6 responses to 2 excitation(s)" in capsys.readouterr().out
    a, b, c = read_npz(tmp_path / "f.npz"), read_csv(tmp_path / "f.csv"), read_uff(tmp_path / "f.uff").frf()
    assert a.kind == b.kind == c.kind == "mobility"
    assert a.frequency[-1] == 100
    assert (a.H == b.H).all()
    np.testing.assert_allclose(c.H, a.H)


def test_frf_takes_the_lines_of_the_measurement(portal, tmp_path):
    assert (
        main(
            [
                "frf",
                str(portal),
                "--out",
                str(tmp_path / "f.npz"),
                "--json",
                str(tmp_path / "f.json"),
                "--quiet",
            ]
        )
        == 0
    )
    assert (read_npz(tmp_path / "f.npz").frequency == load_study(portal).measurements[0].frf.frequency).all()
    assert json.loads((tmp_path / "f.json").read_text(encoding="utf-8"))["kind"] == "accelerance"


def test_what_cannot_be_written(portal, tmp_path, capsys):
    assert main(["frf", str(portal), "--out", str(tmp_path / "f.xls")]) == 2
    assert "not '.xls'" in capsys.readouterr().err
    assert main(["frf", str(portal), "--out", str(tmp_path / "none" / "f.npz")]) == 2
    assert "there is no folder" in capsys.readouterr().err


def test_faults_of_the_program_are_told_from_bad_input(portal, capsys, monkeypatch):
    def broken(*_):
        raise ValueError("from numpy")

    monkeypatch.setattr("dovetail.commands.modes.assemble", broken)
    assert main(["modes", str(portal)]) == 1
    assert "--debug" in capsys.readouterr().err
    assert main(["modes", str(portal), "--debug"]) == 1
    assert "Traceback" in capsys.readouterr().err


# identify-joint -----------------------------------------------------------------------------------------

CROSS = (
    CROSSED_BEAMS
    + """
[damping]
modal = 0.003
[frequency]
start = 10
stop = 800
step = 10
[[joints]]
name = "J"
member1 = "U"
position1 = 0.45
member2 = "D"
position2 = 0.25
{joint}
[[sensors]]
points = [
  [0.0, 0, 0.01], [0.3, 0, 0.01], [0.8, 0, 0.01],
  [0.45, -0.25, -0.01], [0.45, 0.2, -0.01], [0.45, 0.55, -0.01],
]
names = ["a", "b", "c", "d", "e", "f"]
directions = "xyz"
[[excitations]]
sensor = "az"
[[excitations]]
sensor = "cz"
[[excitations]]
sensor = "fz"
[[excitations]]
sensor = "by"
{measurements}
"""
)
ELASTIC = "k = {{ kx = 5e7, ky = 5e7, kz = 1e7, krx = {krx}, kry = 3000, krz = 5000 }}\neta = 0.1"


@pytest.mark.parametrize(
    "assumed",
    [
        ELASTIC.format(krx=3000),
        'rigid = "rx"\nk = { kx = 5e7, ky = 5e7, kz = 1e7, kry = 3000, krz = 5000 }\neta = 0.1',
    ],
)
def test_a_hidden_joint_stiffness_is_found_line_by_line(tmp_path, capsys, assumed):
    """Exact FRFs give the dynamic stiffness back as it was put in, whatever the study assumes there.

    Structural damping only, which acts on the joint too: modal ratios belong to the modes of each model, and
    these are others with another joint.
    """
    text = CROSS.replace("modal = 0.003", "loss_factor = 0.003")
    (tmp_path / "true.toml").write_text(
        text.format(joint=ELASTIC.format(krx=200), measurements=""), encoding="utf-8"
    )
    true = load_study(tmp_path / "true.toml")
    rows = (sensor_rows(true.model, s) for s in (true.sensors, true.excitations))
    H = compute_frf(assemble(true.model), true.frequency, *rows, "receptance", method="direct").H
    names = ([s.name for s in part] for part in (true.sensors, true.excitations))
    write_npz(tmp_path / "m.npz", FRF.from_arrays(true.frequency, H, "receptance", *names))
    study = tmp_path / "study.toml"
    study.write_text(
        text.format(joint=assumed, measurements='[[measurements]]\nfile = "m.npz"'), encoding="utf-8"
    )
    code = main(
        [
            "identify-joint",
            str(study),
            "--joint",
            "J",
            "--directions",
            "rx",
            "--out",
            str(tmp_path / "z.npz"),
            "--json",
            str(tmp_path / "z.json"),
            "--propose",
            str(tmp_path / "new.toml"),
        ]
    )
    assert code == 0
    assert "joint J" in capsys.readouterr().out
    with np.load(tmp_path / "z.npz") as z:
        keep = z["regular"]
        assert keep.mean() > 0.9
        np.testing.assert_allclose(z["Z"][keep, 0, 0], 200 * (1 + 0.103j), rtol=1e-8)
    found = json.loads((tmp_path / "z.json").read_text(encoding="utf-8"))
    lines = found["line_by_line"]["directions"][0]
    assert lines["k"] == pytest.approx(200)
    assert lines["eta"] == pytest.approx(0.103)
    # the fit moves what is uncertain too; exact data leave it to the basis, which is good to 1e-4 or so
    fitted = found["directions"][0]
    assert fitted["k"] == pytest.approx(200, rel=1e-3)
    assert fitted["eta"] == pytest.approx(0.103, rel=1e-2)
    assert abs(fitted["k"] - 200) < 2 * fitted["k_std"]
    # the proposed study is the truth, and runs
    model = load_study(tmp_path / "new.toml").model
    joint = model.effect("J")
    assert joint.K[3, 3] == pytest.approx(200, rel=1e-3)
    assert joint.K[4, 4] == 3000
    assert joint.D[3, 3] == pytest.approx(20, rel=1e-2)
    assert "rx" not in joint.rigid
    assert main(["modes", str(tmp_path / "new.toml"), "--quiet"]) == 0


def test_sensors_of_a_member_read_that_member(tmp_path):
    (tmp_path / "s.toml").write_text(CROSS.format(joint='rigid = "all"', measurements=""), encoding="utf-8")
    study = load_study(tmp_path / "s.toml")
    rows = sensor_rows(study.model, study.sensors)
    assert (np.count_nonzero(rows, axis=1) == 1).all()
    assert np.unique(np.argmax(rows, axis=1)).size == 18


@pytest.fixture
def with_springs(tmp_path):
    """The cross with springs about x at its joint, and the FRFs that it computes of itself."""
    path, known = tmp_path / "s.toml", ELASTIC.format(krx=200)
    path.write_text(CROSS.format(joint=known, measurements=""), encoding="utf-8")
    assert main(["frf", str(path), "--out", str(tmp_path / "m.npz"), "--quiet"]) == 0
    frf = read_npz(tmp_path / "m.npz")
    write_npz(tmp_path / "m.npz", FRF.from_arrays(frf.frequency, frf.H, frf.kind, frf.outputs, frf.inputs))
    measured = '[[measurements]]\nfile = "m.npz"'
    path.write_text(CROSS.format(joint=known, measurements=measured), encoding="utf-8")
    return path


@pytest.mark.slow
def test_line_by_line_needs_an_input_for_each_direction(with_springs, capsys):
    asked = ["identify-joint", str(with_springs), "--joint", "J", "--directions", "x,y,z,rx,ry"]
    assert main([*asked, "--accuracy", "0"]) == 0
    assert "line by line: 4 internal inputs cannot determine 5" in capsys.readouterr().out


def test_identification_refuses_terms_and_targets_that_make_no_sense(with_springs, capsys):
    asked = ["identify-joint", str(with_springs), "--joint", "J", "--directions", "rx"]
    assert main([*asked, "--terms", "K,E"]) == 2
    assert "there is no term 'E'" in capsys.readouterr().err
    assert main([*asked, "--terms", "D"]) == 2
    assert "D has no stiffness" in capsys.readouterr().err
    assert main([*asked, "--propose", str(with_springs)]) == 2
    assert "is the study itself" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("test.uff", "none.uff", "none.uff'"),
        ('file = "test.uff"', 'file = "test.uff"\ncoherence = "none.uff"', "none.uff'"),
        (
            "[[measurements]]",
            '[[sensors]]\nname = "s"\npoint = [0.5, 0.15, 1.0]\ndirection = "x"\n[[measurements]]',
            "sensors[1]",
        ),
        ("[[measurements]]", '[[excitations]]\nsensor = "hammer"\n[[measurements]]', "'hammer'"),
        ("[uncertain]", '[modes]\nfile = "none.uff"\n[uncertain]', "none.uff'"),
        ("[uncertain]", "[fit]\nband = [9000, 9001]\n[uncertain]", "band"),
    ],
)
def test_check_lists_what_a_run_refuses(tmp_path, capsys, old, new, words):
    study = first_frame(tmp_path, old, new)
    assert main(["run", str(study), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    refused = capsys.readouterr().err
    assert main(["check", str(study), "--json", str(tmp_path / "c.json")]) == 2
    said = capsys.readouterr()
    assert words in refused
    assert words in said.err
    assert said.out.splitlines()[-1] == "1 fault(s) found"
    (fault,) = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))["faults"]
    assert fault["kind"] == "refused"
    assert words in fault["message"]


def test_warnings_of_libraries_reach_no_user(portal, capsys, monkeypatch):
    def noisy(system, **options):
        np.log(np.zeros(1))
        warnings.warn("a remark of this program", stacklevel=1)
        return assemble(system, **options)

    monkeypatch.setattr("dovetail.commands.modes.assemble", noisy)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        assert main(["modes", str(portal), "--quiet"]) == 0
    assert capsys.readouterr().err == "dovetail: warning: a remark of this program\n"


def test_check_counts_warnings(tmp_path, capsys):
    study = first_frame(tmp_path, 'file = "test.uff"', 'file = "test.uff"\nscale = 1000.0')
    assert main(["check", str(study)]) == 0
    said = capsys.readouterr()
    assert said.err.count("dovetail: warning: ") == 1
    assert said.out.splitlines()[-1] == "no faults found, 1 warning"


def first_frame(folder, old, new):
    """Return the study of the tutorial in a folder, with a change."""
    source = Path(__file__).parents[2] / "examples/first-frame"
    for name in ("frame.msh", "test.uff"):
        shutil.copy(source / name, folder)
    text = (source / "study.toml").read_text(encoding="utf-8")
    assert old in text
    return study_file(folder, text.replace(old, new))


@pytest.mark.parametrize(
    ("old", "new"),
    [("rho = 7850.0", "rho = 7850,0"), ("d = 0.042", "d = 0,042"), ("modal = 0.01", "modal = 0,01")],
)
def test_decimal_commas_are_suspected(tmp_path, capsys, old, new):
    study = first_frame(tmp_path, old, new)
    assert main(["modes", str(study)]) == 2
    number = new.partition("= ")[2]
    assert f"is '{number}' a number with a decimal comma? TOML has points" in capsys.readouterr().err


def test_lists_of_an_error_follow_their_colon(tmp_path, capsys):
    study = first_frame(tmp_path, "E = 0.02", "E = 0.02")
    assert main(["match", str(study), str(tmp_path / "test.uff")]) == 2
    said = capsys.readouterr().err
    assert ":;" not in said
    assert ": 0: not turned" in said


def test_a_page_takes_nothing_from_the_network():
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page("t", "x"))[1]
    assert policy.startswith("default-src 'none'; script-src 'unsafe-inline'; ")
    assert "http" not in policy
    assert "*" not in policy


def test_a_mesh_in_mm_is_named_before_the_number_of_its_elements(tmp_path, capsys):
    study = first_frame(tmp_path, 'file = "frame.msh"', 'file = "frame.msh"\nscale = 1000.0')
    study.write_text(study.read_text(encoding="utf-8").replace("[1.0, 0.0", "[1000.0, 0.0"), encoding="utf-8")
    assert main(["modes", str(study)]) == 2
    said = capsys.readouterr().err
    assert said.index("are the coordinates in mm") < said.index("elements")


def test_a_misspelt_command_names_the_nearest(capsys):
    assert main(["diagnoze", "study.toml"]) == 2
    assert (
        "there is no command 'diagnoze'; did you mean 'diagnose'? allowed are new" in capsys.readouterr().err
    )


def test_new_study_states_each_tolerance_that_it_assumes(tmp_path):
    assert main(["new", str(tmp_path / "new")]) == 0
    path = tmp_path / "new" / "study.toml"
    head, rest = path.read_text(encoding="utf-8").split("[uncertain]")
    tolerances, _ = rest.split("# [candidates]")
    path.write_text(head, encoding="utf-8")
    assumed = load_study(path)
    stated_lines = tolerances.replace("\n# ", "\n")
    path.write_text(f"{head}[uncertain]{stated_lines}", encoding="utf-8")
    stated = load_study(path)
    table = tomllib.loads(stated.text)
    assert set(table["uncertain"]) == {"E", "rho", "joints", "parts", "shear", "damping"}
    assert set(table["form"]) == {"mass", "bending", "torsion", "shear"}
    assert not any("default standard deviations" in note for note in stated.assumptions)
    assert any("default standard deviations" in note for note in assumed.assumptions)
    assert stated.nuisances == assumed.nuisances
    assert stated.damping_std == assumed.damping_std
    assert stated.channel_errors.std == pytest.approx(assumed.channel_errors.std)
