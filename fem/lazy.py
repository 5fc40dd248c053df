"""Public names of a package, each imported when it is first used."""

import ast
import inspect
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any


def names_on_use(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a package (PEP 562), so that importing it imports little.

    The names are those that the package imports under ``if TYPE_CHECKING:``. Type checkers and the import
    contracts read the same lines, and ``__all__`` is these names with the package's functions. Type checkers
    of other projects and the reference pages read which names are imported as themselves. Submodules are
    attributes too, as they are where a package imports all of them.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    """
    module = sys.modules[package]

    @cache
    def modules() -> dict[str, str | None]:
        """Return the module of each name; most runs import submodules alone and never ask."""
        blocks = (
            node.body
            for node in ast.parse(inspect.getsource(module)).body
            if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        )
        lines = (line for block in blocks for line in block if isinstance(line, ast.ImportFrom))
        return {name.name: line.module for line in lines for name in line.names}

    def getattribute(name: str) -> Any:
        if name == "__all__":
            functions = inspect.getmembers(module, inspect.isfunction)
            return [*modules(), *(n for n, f in functions if f.__module__ == package and n[0] != "_")]
        if not name.startswith("__"):
            if source := modules().get(name):
                value = getattr(import_module(source), name)
                setattr(module, name, value)  # the next use is a plain attribute
                return value
            if find_spec(f"{package}.{name}"):
                return import_module(f"{package}.{name}")
        msg = f"module {package!r} has no attribute {name!r}"
        raise AttributeError(msg, name=name, obj=module)

    def directory() -> list[str]:
        return sorted({*vars(module), *modules()})

    return getattribute, directory
