"""The documentation of the study file, and the examples, hold what the program takes."""

import re

import pytest

from dovetail import StudyError, load_study
from fem import assemble, solve_modes
from fem.effects import candidate_kinds
from tests.studies import study_from

TABLES = """
    study mesh defaults materials.steel sections.tube members.mast rotation damping uncertain candidates
    fit frequency modes baseline ambient identification update [states] [supports] [joints] [masses]
    [loads] [combinations] [envelopes] [initial] [effects] [update.parameters] [sensors] [excitations]
    [measurements]
"""


def test_the_example_in_the_documentation_is_a_study(root, tmp_path):
    text = (root / "docs" / "study-file.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    study = study_from(tmp_path, block)
    assert [s.name for s in study.sensors] == ["tip-x"]


def test_every_kind_of_effect_is_listed(root):
    text = (root / "docs" / "study-file.md").read_text(encoding="utf-8")
    listed = re.findall(r"`(\w+)`", text[text.index("Kinds of effect:") :].partition("\n\n")[0])
    assert tuple(sorted(listed)) == tuple(sorted(candidate_kinds()))


@pytest.mark.parametrize("table", TABLES.split())
def test_every_key_that_is_taken_is_documented(root, tmp_path, table):
    """An unknown key names those that are allowed; each of them stands in the documentation."""
    text = (root / "docs" / "study-file.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    fill = {
        "ambient": 'file = "wind.npz"',
        "[supports]": 'point = "tip"',
        "[joints]": 'point1 = "tip"\nrigid = "x"',
        "[masses]": 'point = "tip"\nmass = 1',
        "[loads]": "gravity = [0, 0, -9.81]",
        "[combinations]": 'name = "a"\nfactors = { load = 1.0 }\n[[loads]]\ngravity = [0, 0, -9.81]',
        "[envelopes]": 'of = "load"\n[[loads]]\ngravity = [0, 0, -9.81]',
        "[initial]": 'velocity = { x = 1.0 }\nmember = "mast"',
        "[effects]": 'candidate = "crack:mast.ry"',
        "[sensors]": 'name = "a"\npoint = "tip"\ndirection = "x"',
        "[excitations]": 'name = "a"\npoint = "tip"\ndirection = "x"',
        "[update.parameters]": 'effect = "frame"\nparameter = "E:steel"',
        "[measurements]": f'file = "{(root / "examples" / "cross-beam" / "frf.uff").as_posix()}"',
    }.get(table, "")
    header = f"[{table}]"
    if f"{header}\n" in block:
        block = block.replace(f"{header}\n", f"{header}\nno_such_key = 1\n")
    else:
        block += f"\n{header}\n{fill}\nno_such_key = 1\n"
    (tmp_path / "study.toml").write_text(block, encoding="utf-8")
    with pytest.raises(StudyError, match="unknown key") as caught:
        load_study(tmp_path / "study.toml")
    keys = str(caught.value).split("allowed are ")[1].split(", ")
    assert keys
    assert [key for key in keys if not re.search(rf"[`. ]{key}[`. ]", text)] == []


@pytest.mark.parametrize(
    ("name", "first"),
    [
        # massless clamped legs give 7.1, 19.9 and 28.8 Hz; these have mass
        ("southampton-frame", [7.03, 19.7, 28.5]),
        ("cross-beam", [43.9, 61.6, 81.5]),
    ],
)
def test_examples_load(root, name, first):
    study = load_study(root / "examples" / name / "study.toml")
    modes = solve_modes(assemble(study.model), n=10)
    assert modes.frequency[modes.n_rigid :][:3] == pytest.approx(first, rel=5e-3)
    assert len(study.measurements) == 1


def test_the_elements_of_the_example_are_small_enough(root):
    """Twice as many change no frequency by more than 32 elements to a torsional wave foresee, 1.6e-3."""
    study = load_study(root / "examples" / "cross-beam" / "study.toml")
    coarse, fine = (solve_modes(assemble(s.model), n=30).frequency[6:] for s in (study, study.refined(2)))
    assert abs(coarse / fine - 1).max() < 1.6e-3
