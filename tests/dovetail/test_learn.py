"""Frames that lack nothing teach the form of others: the command, its file, and the study that reads it."""

import json
import subprocess
import sys
import tomllib

import pytest

from dovetail import StudyError, load_study
from dovetail.cli import main
from updating.inference import FORM_CORNER, FORM_SECTION
from updating.inference.form import form_of

FRAME = """
[points]
A = [0.0, 0.0, 0.0]
B = [0.5, 0.0, 0.0]
C = [0.5, 0.4, 0.0]
[materials.steel]
E = 210e9
nu = 0.3
rho = 7850.0
[sections.bar]
shape = "rectangle"
b = 0.03
h = 0.01
[members]
one = { from = "A", to = "B", section = "bar", material = "steel" }
two = { from = "B", to = "C", section = "bar", material = "steel" }
[[supports]]
point = "A"
"""


def usual_of(study):
    """Return mean and standard deviation of the form's parameters by kind of effect and name."""
    added, nuisances = form_of(study.model)
    kinds = {e.name: e.kind for e in added}
    return {(kinds[n.effect], n.parameter): (n.mean, n.std) for n in nuisances}


def test_a_study_reads_what_was_learned_of_the_form(tmp_path):
    (tmp_path / "ours.toml").write_text(
        "[corner]\nu = [0.3, 0.05]\n[section]\nA = [0.004, 0.002]\nIy = [0.0, 0.01]\n"
    )
    path = tmp_path / "study.toml"
    path.write_text(FRAME + '[form]\nfile = "ours.toml"\nbending = 0.03\n')
    usual = usual_of(load_study(path))
    assert usual["zone_form", "u"] == (0.3, 0.05)
    assert usual["zone_form", "mass"] == FORM_CORNER["mass"]
    assert usual["section_form", "A"] == (0.004, 0.002)
    assert usual["section_form", "Iy"] == (0.0, 0.03)  # what a study states of its sections counts first
    assert usual["section_form", "J"] == (0.0, FORM_SECTION["J"])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[corner]\nv = [0.1, 0.2]\n", "ours.toml, line 2, corner.v: unknown key"),
        ("[edge]\nu = [0.1, 0.2]\n", "ours.toml, line 1, edge: unknown key"),
        ("[corner]\nu = [0.1, 0.0]\n", "line 2, corner.u: 0 is not allowed as a standard deviation"),
        ("[corner]\nu = [0.1]\n", "line 2, corner.u"),
        ("[corner\n", "form.file: ours.toml: "),
        ("[corner]\nu = [0.1, ", "form.file: ours.toml: "),
    ],
)
def test_a_wrong_file_of_the_form_is_refused_with_its_place(tmp_path, text, said):
    (tmp_path / "ours.toml").write_text(text)
    path = tmp_path / "study.toml"
    path.write_text(FRAME + '[form]\nfile = "ours.toml"\n')
    with pytest.raises(StudyError) as error:
        load_study(path)
    assert said in str(error.value)


def test_a_missing_file_of_the_form_is_named(tmp_path, capsys):
    path = tmp_path / "study.toml"
    path.write_text(FRAME + '[form]\nfile = "ours.toml"\n')
    assert main(["modes", str(path)]) == 2
    assert "ours.toml: No such file" in capsys.readouterr().err


def test_the_command_learns_from_a_frame_of_another_code(shared, tmp_path, capsys):
    case = shared / "data/independent-cases/cross-beam-nothing-missing"
    path = tmp_path / "case" / "study.toml"
    path.parent.mkdir()
    convert = [sys.executable, "-m", "benchmarks.independent.convert", str(case / "nominal.json"), str(path)]
    subprocess.run(convert, check=True)
    out, values = tmp_path / "form.toml", tmp_path / "form.json"
    assert main(["learn", str(path), "--out", str(out), "--json", str(values), "--quiet"]) == 0
    capsys.readouterr()
    learned = tomllib.loads(out.read_text())
    usual = usual_of(load_study(path))
    for key, (mean, std) in learned["section"].items():
        before = usual["section_form", key][1]
        assert abs(mean) < before
        assert 0.3 * before < std < 1.2 * before  # one frame of two members says little
    assert json.loads(values.read_text())["form"]["section A"] == pytest.approx(
        learned["section"]["A"], rel=1e-3
    )
