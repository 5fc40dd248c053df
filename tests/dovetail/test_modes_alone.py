"""Studies with measured modes alone, and with two states: files, commands, results."""

import json
import shutil

import pytest

from dovetail import StudyError, load_study
from dovetail.cli import main
from dovetail.modes_pipeline import targets_of

LINES = """
[points]
foot = [0.0, 0.0, 0.0]
tip = [0.0, 0.0, 1.0]

[members.mast]
from = "foot"
to = "tip"

[materials.steel]
E = 210e9
rho = 7850.0

[sections.bar]
shape = "rectangle"
b = 0.03
h = 0.01

[[supports]]
point = "foot"

[candidates]
kinds = ["point_mass"]

[fit]
model_error = 0.0
"""
NOMINAL = [8.36, 25.05, 52.35, 146.4, 156.0]


def written(folder, text):
    (folder / "study.toml").write_text(LINES + text, encoding="utf-8")
    return folder / "study.toml"


def test_keys_of_modes_are_read(tmp_path):
    text = "[modes]\nfrequency = [30.0, 10.0, 20.0]\nfrequency_std = [3e-3, 1e-3, 2e-3]\n"
    text += "zeta = [0.03, 0.01, 0.02]\n"
    text += 'numbers = [3, 1, 2]\nplane = "xz"\nheld_out = [2]\n'
    targets = targets_of(load_study(written(tmp_path, text)).modes)
    assert targets.frequency.tolist() == [10.0, 20.0, 30.0]
    assert targets.zeta.tolist() == [0.01, 0.02, 0.03]
    assert targets.held_out.tolist() == [False, True, False]
    assert targets.plane == "xz"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('plane = "up"', "axes such as"),
        ("held_out = [4]", "from 1 to 3"),
        ("held_out = [1, 2, 3]", "leave at least one"),
        ("numbers = [1, 2]", "one each is needed"),
        ("zeta = [0.01]", "one each"),
        ("frequency_std = [0.1, 0.2]", "one each"),
    ],
)
def test_wrong_keys_of_modes_are_refused(tmp_path, line, words):
    with pytest.raises(StudyError, match=words):
        load_study(written(tmp_path, f"[modes]\nfrequency = [10.0, 20.0, 30.0]\n{line}\n"))


def test_a_study_of_frequencies_alone_is_run(tmp_path, capsys):
    study = written(tmp_path, f"[modes]\nfrequency = {NOMINAL}\nfrequency_std = 0.01\nheld_out = [5]\n")
    assert main(["run", str(study), "--out", str(tmp_path / "out")]) == 0
    assert "predicted, not fitted" in capsys.readouterr().out
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert result["verdict"] == "nothing missing"
    assert sum(p["probability"] for p in result["posterior"]) == pytest.approx(1.0)
    assert [m["held_out"] for m in result["modes"]] == [False] * 4 + [True]
    assert 0 < result["frequency_error"]["found"]["held_out"] < 0.03
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Verdict: nothing missing" in page


def test_the_change_between_two_states_is_found(root, tmp_path):
    """60 g at 0.30 m of the arm, and a modulus that both states have 2 % lower than the study says."""
    folder = shutil.copytree(root / "examples" / "before-and-after", tmp_path / "study")
    text = (folder / "study.toml").read_text(encoding="utf-8")
    few = text.replace(', "support_flexibility", "crack", "member_stiffness"]', "]")
    (folder / "study.toml").write_text(few, encoding="utf-8")
    found = load_study(folder / "study.toml").diagnose()
    (effect,) = found.found
    values = {p.name: p.value for p in effect.parameters()}
    assert values["mass"] == pytest.approx(0.06, rel=0.05)
    assert values["position"] == pytest.approx(0.30, abs=0.01)
    assert found.modes.errors(found.modes.fitted, False) > 0.005
    assert "0.06" in found._repr_html_()
