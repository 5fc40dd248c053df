"""``dovetail export`` and Excel tables of ``dovetail compare``, as a user meets them."""

import json
import re
import warnings

import numpy as np
import pytest

from dovetail import load_study, main
from fem import assemble, first_modes
from fem.io import read_model, read_modes

STUDY = """
[study]
name = "mast"

[points]
foot = [0.0, 0.0, 0.0]
tip = [0.0, 0.0, 1.2]

[members.mast]
from = "foot"
to = "tip"

[materials.steel]
E = 200e9
rho = 7850.0

[sections.tube]
shape = "tube"
d = 0.060
t = 0.003

[mesh]
element_size = 0.1

[[supports]]
point = "foot"
name = "foot"
"""
EFFECTS = """
[[effects]]
candidate = "support_flexibility:foot.ry"
stiffness = 20000.0

[[effects]]
candidate = "point_mass:mast"
mass = 0.5
position = 0.66
"""
ESTIMATES = """
[estimates]
"support_flexibility:foot.ry.stiffness" = { std = 400.0 }
"frame.E:steel" = { before = 210e9, std = 1e9 }
"""


@pytest.fixture
def found(tmp_path):
    path = tmp_path / "found.toml"
    path.write_text(STUDY + EFFECTS + ESTIMATES)
    return path


def test_what_was_found_becomes_cards_with_their_deviations(found, tmp_path, capsys):
    files = {
        key: tmp_path / f"out.{end}" for key, end in (("nastran", "bdf"), ("abaqus", "inp"), ("ansys", "mac"))
    }
    options = [part for key, path in files.items() for part in (f"--{key}", str(path))]
    assert (
        main(
            [
                "export",
                str(found),
                *options,
                "--fitted",
                "--units",
                "mm-t-s",
                "--json",
                str(tmp_path / "out.json"),
            ]
        )
        == 0
    )
    printed = capsys.readouterr().out.replace("\u00a0", " ")
    assert "stiffness 20.00 ± 0.40 kN·m/rad instead of rigid" in printed
    assert "E of steel 200.0 ± 1.0 GPa instead of 210 GPa" in printed
    assert "note: take out of the supports of node 1: ry" in printed
    nastran, abaqus, ansys = (path.read_text() for path in files.values())
    for text in (nastran, abaqus, ansys):
        text = re.sub(r"\n(\$|\*\*|!) ", " ", text)  # long comments have several lines
        assert "20.00 +- 0.40 kN m/rad instead of rigid" in text
        assert "found by found.toml, study mast" in text
        assert "units mm-t-s" in text
    assert "PBUSH*" in nastran
    assert "2.+7" in nastran  # 20 kN·m/rad in N·mm/rad
    assert nastran.count("CONM2*") == 1
    assert "SOL" not in nastran
    assert "5\n20000000.0\n" in abaqus
    assert "*MASS, ELSET=MASS1\n0.0005\n" in abaqus
    assert "KEYOPT" in ansys
    assert ",20000000.0,0.0" in ansys
    assert json.loads((tmp_path / "out.json").read_text())["files"]["nastran"].endswith("out.bdf")


@pytest.mark.parametrize(
    ("option", "suffix"), [("--nastran", ".bdf"), ("--abaqus", ".inp"), ("--ansys", ".mac")]
)
def test_the_whole_model_comes_back(found, tmp_path, option, suffix):
    out, modes = tmp_path / f"deck{suffix}", tmp_path / "modes.uff"
    assert main(["export", str(found), option, str(out), "--whole", "--uff", str(modes), "--quiet"]) == 0
    model = load_study(found).model
    finer = model.with_mesh(model.mesh.with_point_on("mast", 0.66))
    expected = first_modes(assemble(finer), 6).frequency
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # notes of the reader
        again = read_model(out)
    assert np.abs(first_modes(assemble(again), 6).frequency / expected - 1).max() < 1e-6
    assert read_modes(modes).frequency[:3] == pytest.approx(
        first_modes(assemble(model), 3).frequency, rel=1e-5
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "no file is asked for; give --nastran FILE, --abaqus FILE, --ansys FILE or --uff FILE"),
        (
            ["--nastran", "out.bdf", "--fitted"],
            "it has no [[effects]], and no fitted values in [estimates]",
        ),
        (["--uff", "out.txt"], "--uff out.txt is written as .uff or .unv, not '.txt'"),
    ],
)
def test_errors_are_one_line(tmp_path, monkeypatch, capsys, options, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(STUDY)
    assert main(["export", "study.toml", *options]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert "\n" not in error


def test_damaged_estimates_are_named(found, tmp_path, capsys):
    found.write_text(found.read_text().replace("std = 1e9", "std = -1e9"))
    assert main(["export", str(found), "--nastran", str(tmp_path / "out.bdf")]) == 2
    assert "estimates.frame.E:steel.std: -1000000000.0 is not allowed" in capsys.readouterr().err


def test_measured_and_computed_modes_become_an_excel_table(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    study, out = tmp_path / "study.toml", tmp_path / "modes.xlsx"
    study.write_text(STUDY + "\n[modes]\nfrequency = [40.0, 250.0]\n")
    assert main(["compare", str(study), "--xlsx", str(out), "--quiet"]) == 0
    head, first, *_ = openpyxl.load_workbook(out)["modes"].iter_rows(values_only=True)
    row = dict(zip(head, first, strict=True))
    assert row["measured [Hz]"] == 40.0
    assert row["off by [%]"] == pytest.approx(100 * (row["computed [Hz]"] / 40.0 - 1))
    assert row["MAC"] is None
    assert main(["compare", str(study), "--xlsx", str(tmp_path / "modes.csv")]) == 2
