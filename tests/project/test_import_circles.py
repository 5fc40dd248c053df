"""No module imports itself in a circle, not even inside a function or for types alone."""

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

PACKAGES = ("fem", "updating", "joint", "viz", "dovetail")


def modules_in(root: Path) -> dict[str, Path]:
    """Return the files of all modules by their names."""
    files = (file for package in PACKAGES for file in (root / package).rglob("*.py"))
    return {".".join(f.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): f for f in files}


def imported_by(file: Path, modules: dict[str, Path]) -> Iterator[str]:
    """Yield the modules that a file imports anywhere in its text: no import of ours is relative."""
    nodes: list[ast.AST] = [ast.parse(file.read_text(encoding="utf-8"))]
    while nodes:
        node = nodes.pop()
        for key in ("body", "orelse", "finalbody", "handlers", "cases"):  # expressions hold no imports
            nodes += getattr(node, key, [])
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{file}:{node.lineno} is relative"
            names = (f"{node.module}.{alias.name}" for alias in node.names)
            yield from (name if name in modules else str(node.module) for name in names)


def circle_in(root: Path) -> list[str]:
    """Return the modules of one circle of imports, the first one again at its end; none without a circle."""
    modules = modules_in(root)
    graph = {name: modules.keys() & set(imported_by(file, modules)) for name, file in modules.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_no_module_imports_itself_in_a_circle(root):
    assert circle_in(root) == []


def test_a_circle_for_types_alone_is_found(tmp_path):
    for package in PACKAGES:
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text("")
    low = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from fem.high import High\n"
    (tmp_path / "fem" / "low.py").write_text(low)
    (tmp_path / "fem" / "high.py").write_text("def make():\n    from fem import low\n")
    assert set(circle_in(tmp_path)) == {"fem.low", "fem.high"}
