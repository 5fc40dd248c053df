"""The names of other files in a study's text, when it moves to another folder."""

import json
import os
import tomllib
from pathlib import Path
from typing import Any

from study.lines import key_lines

FILES = ("file", "node_sets")
"""Keys that name other files."""


def with_paths(text: str, old: Path, new: Path) -> str:
    """Return a study's text as a file in another folder: names of other files lead from there."""
    if old.resolve() == new.resolve():
        return text
    lines = text.split("\n")
    for path, line in key_lines(text).items():
        if path[-1] not in FILES:
            continue
        value: Any = tomllib.loads(text)
        for key in path:
            value = value[key]
        if not isinstance(value, str) or os.path.isabs(value):
            continue
        target = Path(os.path.relpath(old / value, new)).as_posix()
        for quoted in (json.dumps(value, ensure_ascii=False), f"'{value}'"):
            lines[line - 1] = lines[line - 1].replace(quoted, json.dumps(target, ensure_ascii=False))
    return "\n".join(lines)
