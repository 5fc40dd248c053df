"""Every example runs to its closing assertion, is short, and ends in a number."""

import ast
import re
import runpy
from pathlib import Path

import pytest

EXAMPLES = sorted(Path(__file__).parents[2].glob("examples/*.py"))
RENDERED = re.compile(r"render_|--picture")
"""Marks an example that draws a structure, which needs PyVista."""

LONG = {"95_many_units", "40_find_hidden_effect"}
"""The pages of the documentation are made by running them, so that CI runs them there."""


def test_there_are_examples():
    assert len(EXAMPLES) >= 5


@pytest.mark.filterwarnings("ignore:member 'beam' .* resists warping")  # the portal that buckles
@pytest.mark.parametrize(
    "path",
    [pytest.param(p, marks=pytest.mark.slow) if p.stem in LONG else p for p in EXAMPLES],
    ids=lambda path: path.stem,
)
def test_example_runs(path, request, monkeypatch, tmp_path):
    if RENDERED.search(path.read_text(encoding="utf-8")):
        request.getfixturevalue("offscreen")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    runpy.run_path(str(path), run_name="__main__")
    assert list(tmp_path.rglob("*.png"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_is_short_and_ends_in_an_assertion_on_a_number(path):
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 60
    last = ast.parse(text).body[-3:]
    assert isinstance(last[-1], ast.Assert)
    constants = [n.value for part in last for n in ast.walk(part) if isinstance(n, ast.Constant)]
    assert any(isinstance(value, float) for value in constants)


@pytest.mark.parametrize(
    "command",
    [
        *("static", "buckling", "complex", "base", "transient", "spectrum", "psd", "campbell", "unbalance"),
        *("ensemble", "fleet"),
    ],
)
def test_a_script_of_the_gallery_runs_each_command(command):
    assert any(f'run("{command}"' in path.read_text(encoding="utf-8") for path in EXAMPLES)
