"""CONTRIBUTING leads a newcomer through functions and rooms that exist."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
WALK = TEXT.split("in thirteen stops\n")[1].split("\n## ")[0]
STOPS = re.findall(r"`([\w/]+\.py):([\w.]+)`", WALK)
PACKAGES = ("fem", "updating", "joint", "viz", "dovetail")


def names_of(body, prefix=""):
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield prefix + node.name
        if isinstance(node, ast.ClassDef):
            yield from names_of(node.body, f"{node.name}.")


def test_the_walk_has_thirteen_stops():
    assert re.findall(r"^(\d+)\. `", WALK, re.MULTILINE) == [str(n) for n in range(1, 14)]
    assert STOPS[0] == ("dovetail/cli.py", "main")


@pytest.mark.parametrize(("file", "function"), STOPS)
def test_each_stop_exists(file, function):
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    assert function in set(names_of(tree.body))


def test_a_name_that_is_gone_would_be_noticed():
    tree = ast.parse("class A:\n    def b(self): ...\ndef c(): ...\n")
    assert set(names_of(tree.body)) == {"A", "A.b", "c"}


def test_the_map_has_every_room_and_no_other():
    rows = re.findall(r"^\| `([\w/]+)` \|", TEXT, re.MULTILINE)
    listed = [row for row in rows if row.split("/")[0] in PACKAGES]
    rooms = [p for name in PACKAGES for p in [ROOT / name, *(ROOT / name).iterdir()]]
    there = {str(p.relative_to(ROOT)) for p in rooms if p.is_dir() and list(p.glob("*.py"))}
    assert sorted(listed) == sorted(there)
