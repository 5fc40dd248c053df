"""For the reference pages: what a package imports as itself is public, as type checkers have it (PEP 484)."""

import ast
from typing import Any

from griffe import Alias, Extension


class PublicNames(Extension):
    """Mark each ``from room.module import Name as Name``."""

    def on_alias_instance(self, *, node: Any, alias: Alias, **_: Any) -> None:
        """Mark an imported name."""
        if isinstance(node, ast.ImportFrom):
            alias.public = any(a.name == a.asname == alias.name for a in node.names) or None
