"""What Python returns prints as the command prints it."""

import re
import shutil
from importlib import import_module
from pathlib import Path

import pytest

import dovetail
from dovetail.cli import COMMANDS

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_the_page_of_python_names_every_command():
    page = (EXAMPLES.parent / "docs" / "python.md").read_text(encoding="utf-8")
    rows = page.split("## Commands from Python")[1].split("\n\n")[1].splitlines()[2:]
    named = [word for row in rows for word in re.findall(r"`([a-z-]+)", row.split("|")[1])]
    assert {*named} == {*COMMANDS}


def test_the_page_names_what_exists():
    page = (EXAMPLES.parent / "docs" / "python.md").read_text(encoding="utf-8")
    rows = page.split("## Commands from Python")[1].split("\n\n")[1]
    assert all(hasattr(dovetail.Study, name) for name in re.findall(r"study\.(\w+)\(", rows))
    for names, package in re.findall(r"((?:`\w+`(?:, | and )?)+) of `([a-z.]+)`", rows):
        for name in re.findall(r"`(\w+)`", names):
            assert hasattr(import_module(package), name), (package, name)


def printed_by(capsys, *words):
    assert dovetail.main([*map(str, words)]) == 0
    return capsys.readouterr().out


@pytest.fixture(scope="module")
def study(bent_file):
    return dovetail.load_study(bent_file)


def test_places_of_the_misfit(study, bent_file, capsys, monkeypatch):
    monkeypatch.setattr("updating.diagnosis.localisation.LEAST_SHARE", 0.05)
    found = study.locate(n_bands=3)
    assert f"{found}\n" == printed_by(capsys, "locate", bent_file, "--bands", "3")
    assert "member arm" in repr(found)
    assert "<table>" in found._repr_html_()


def test_comparison(study, bent_file, capsys):
    assert f"{study.compare()}\n" in printed_by(capsys, "compare", bent_file)


def test_comparison_by_modes(capsys):
    path = EXAMPLES / "three-storeys" / "study.toml"
    assert f"{dovetail.load_study(path).compare()}\n" in printed_by(capsys, "compare", path)


def test_plan(study, bent_file, capsys):
    planned = study.plan(noise=0.01)
    assert f"{planned}\n" == printed_by(capsys, "plan", bent_file, "--noise", "1%")
    assert "<table>" in planned._repr_html_()


def test_identified_modes(study, bent_file, capsys):
    assert f"{study.identify_modes()}\n" in printed_by(capsys, "identify-modes", bent_file)


def test_faults(study, bent_file, capsys):
    found, printed = study.check(), printed_by(capsys, "check", bent_file)
    assert [found.size, found.count] == [printed.splitlines()[0], printed.splitlines()[-1]]
    assert len(found) == len(list(found))


def test_an_update_is_saved_as_the_command_saves_it(tmp_path, capsys):
    folder = Path(shutil.copytree(EXAMPLES / "three-storeys", tmp_path / "study"))
    updated = dovetail.load_study(folder / "study.toml").update()
    assert f"{updated}\n" in printed_by(capsys, "update", folder / "study.toml", "--out", tmp_path / "out")
    updated.save(folder / "updated.toml")
    assert (folder / "updated.toml").read_text() == (tmp_path / "out" / "study.toml").read_text()
    with pytest.raises(dovetail.OutputError):
        updated.save(folder / "study.toml")
