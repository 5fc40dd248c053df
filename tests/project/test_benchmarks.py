"""Benchmarks run rarely; each name that they import from the packages must exist."""

import ast

PACKAGES = ("fem", "updating", "joint", "viz", "dovetail")


def imported(folder):
    """Yield the file, module and name of each import from the packages."""
    for path in sorted(folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in PACKAGES:
                yield from ((path.name, node.module, alias.name) for alias in node.names)


def bound(path):
    """Return the names that a module binds outside its functions and classes, imports among them."""
    names, nodes = set(), list(ast.parse(path.read_text(encoding="utf-8")).body)
    for node in nodes:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            names |= {
                n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
            }
        elif isinstance(node, ast.If | ast.Try):
            nodes += node.body
    return names


def names_of(root, module):
    """Return the names that can be imported from a module or package, none if there is no such module."""
    path = root.joinpath(*module.split("."))
    if path.is_dir():
        return bound(path / "__init__.py") | {p.stem for p in path.iterdir()}
    return bound(path.with_suffix(".py")) if path.with_suffix(".py").exists() else set()


def test_names_that_benchmarks_import_exist(root):
    names = list(imported(root / "benchmarks"))
    assert len(names) > 100
    known = {module: names_of(root, module) for _, module, _ in names}
    assert [(file, module, name) for file, module, name in names if name not in known[module]] == []
