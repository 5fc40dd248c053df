"""What the documentation says of the program is so: constants, links, and the README's code."""

import argparse
import math
import re
import tomllib
from pathlib import Path

import pytest

from dovetail.cli import build_parser
from updating.inference import belief

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
CONSTANT = re.compile(r"^\| `([A-Z_]+)` \| ([^|]+) \|", re.MULTILINE)
NUMBER = re.compile(r"(?:(\w+) )?(−?\d[\d.]*)(?: ± (\d[\d.]*))?")
BELIEF = {name: value for name, value in vars(belief).items() if name.isupper()}


def documented():
    return dict(CONSTANT.findall((ROOT / "docs" / "mathematics.md").read_text(encoding="utf-8")))


def test_the_constants_of_belief_are_documented_and_no_others():
    assert documented().keys() == BELIEF.keys()


@pytest.mark.parametrize("name", BELIEF)
def test_constants_have_the_values_that_are_documented(name):
    """Such as `0.1`, `ln 10`, `0.0005, 0.008`, and `u 1, plane 0.4` or `u −0.3 ± 0.5` of a dictionary."""
    found = [(word, float(x.replace("−", "-")), std) for word, x, std in NUMBER.findall(documented()[name])]
    value = BELIEF[name]
    if isinstance(value, dict):
        assert {word: (x, float(std)) if std else x for word, x, std in found} == value
        return
    numbers = [math.log(x) if word == "ln" else x for word, x, _ in found]
    assert numbers == pytest.approx(list(value) if isinstance(value, tuple) else [value])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", text):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), target


def test_every_page_is_in_the_index():
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    pages = {p.name for p in ROOT.glob("docs/*.md")} - {"index.md"}
    assert {name for name in pages if name not in index} == set()


def blocks(language, page="README.md"):
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def test_the_study_in_the_readme_is_part_of_the_example():
    (text,) = blocks("toml")
    whole = tomllib.loads((ROOT / "examples" / "cross-beam" / "study.toml").read_text(encoding="utf-8"))

    def check(part, of):
        for key, value in part.items():
            if isinstance(value, dict):
                check(value, of[key])
            else:
                assert of[key] == value, key

    check(tomllib.loads(text), whole)


@pytest.mark.slow
def test_the_python_in_the_readme_finds_the_effect(monkeypatch):
    (code,) = blocks("python")
    assert len(code.splitlines()) == 10
    monkeypatch.chdir(ROOT)
    names = {}
    exec(code, names)
    (finding,) = names["found"].findings
    (stiffness,) = finding.parameters
    assert finding.effect.where == "joint J, rx"
    said = f"{stiffness.value:.0f} ± {stiffness.std:.0f} N·m/rad"
    assert said in (ROOT / "README.md").read_text(encoding="utf-8")
    assert names["better"].compare().total_db < 0.25 * names["study"].compare().total_db


@pytest.mark.slow
def test_a_study_from_python_is_saved_with_the_effect(monkeypatch, tmp_path):
    """The first block of docs/python.md, with the candidates of the last, which take seconds."""
    whole, _, chosen = blocks("python", "docs/python.md")
    monkeypatch.chdir(ROOT)
    names = {}
    exec(chosen, names)
    (finding,) = names["found"].findings
    assert finding.effect.where == "joint J, rx"
    assert finding.parameters[0].value == pytest.approx(200.0, rel=0.05)
    assert names["updated"].effect(finding.effect.name) is finding.effect
    after = whole[whole.index("better = ") :].replace("better.toml", str(tmp_path / "better.toml"))
    before = names["study"].compare()
    exec(after, names | {"before": before})
    better = names["dovetail"].load_study(tmp_path / "better.toml")
    assert better.compare().total_db < 0.5 * before.total_db


@pytest.mark.slow
def test_an_effect_is_added_by_hand_from_python(monkeypatch, tmp_path, capsys):
    """The second block of docs/python.md."""
    _, code, _ = blocks("python", "docs/python.md")
    monkeypatch.chdir(ROOT)
    names = {}
    exec(code.replace("better.toml", str(tmp_path / "better.toml")), names)
    nominal, fitted, added, better = map(float, capsys.readouterr().out.splitlines()[-1].split(" → "))
    assert nominal > 1.5 * fitted > 2 * added > 4 * better
    assert better < 1.0  # dB
    again = names["dovetail"].load_study(tmp_path / "better.toml")
    assert again.error().fit_db == pytest.approx(better, rel=1e-3)


def test_the_page_on_commands_lists_every_command():
    """A row may name several: `dovetail static study.toml`, `buckling`."""
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    cells = re.findall(r"^\| (`dovetail [^|]*)\|", text, re.MULTILINE)
    listed = [name for cell in cells for name in re.findall(r"`(?:dovetail )?([\w-]+)", cell)]
    (parsers,) = (a for a in build_parser()._actions if isinstance(a, argparse._SubParsersAction))
    assert sorted(listed) == sorted(parsers.choices)


def test_the_readme_is_short():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) < 120


def test_one_version_is_stated_everywhere():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    newest = re.search(r"^## \[(\d.*?)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert newest[1] == version


def test_the_picture_is_small():
    assert (ROOT / "docs" / "images" / "demo.png").stat().st_size < 200_000
