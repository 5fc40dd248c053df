"""Benchmarks run rarely; each name that they import from the packages must exist."""

import ast
import importlib
from importlib.util import find_spec

PACKAGES = ("fem", "updating", "joint", "viz", "dovetail")


def imported(folder):
    """Yield the file, module and name of each import from the packages."""
    for path in sorted(folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in PACKAGES:
                yield from ((path.name, node.module, alias.name) for alias in node.names)


def exists(module, name):
    """Tell whether a module has a name or a submodule of that name."""
    try:
        return hasattr(importlib.import_module(module), name) or find_spec(f"{module}.{name}") is not None
    except ModuleNotFoundError:
        return False


def test_names_that_benchmarks_import_exist(root):
    names = list(imported(root / "benchmarks"))
    assert len(names) > 100
    assert [name for name in names if not exists(*name[1:])] == []
