"""One name is the name of one class: a reader who searches for it finds one definition."""

import ast
from collections import Counter

PACKAGES = ("fem", "updating", "joint", "viz", "dovetail")


def test_no_class_name_is_defined_twice(root):
    files = (file for package in PACKAGES for file in (root / package).rglob("*.py"))
    trees = (ast.parse(file.read_text(encoding="utf-8")) for file in files)
    classes = (node.name for tree in trees for node in tree.body if isinstance(node, ast.ClassDef))
    names = Counter(name for name in classes if not name.startswith("_"))
    assert {name for name, count in names.items() if count > 1} == set()
