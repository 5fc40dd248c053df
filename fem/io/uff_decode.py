"""Decoding the text of datasets with pyuff."""

import re
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from fem.io.uff_format import Block, UffError

_BY_PYUFF = (15, 58, 82, 151, 164, 2411, 2412)


def decoded(blocks: Sequence[Block], file: str) -> list[dict[Any, Any]]:
    """Return the fields of each dataset, empty for those that pyuff does not read."""
    import pyuff

    chosen = [k for k, b in enumerate(blocks) if b.kind in _BY_PYUFF and not b.refusal]
    fields: list[dict[Any, Any]] = [{} for _ in blocks]
    if not chosen:
        return fields
    with tempfile.TemporaryDirectory() as folder:
        clean = Path(folder) / "clean.uff"
        clean.write_text("".join(_clean_text(blocks[k]) for k in chosen), encoding="utf-8", newline="\n")
        reader: Any = pyuff.UFF(str(clean))
        for position, k in enumerate(chosen):
            try:
                fields[k] = reader.read_sets(position, header_only=blocks[k].values is not None)
            except Exception as reason:
                if blocks[k].kind == 151:  # nothing depends on it
                    continue
                msg = f"{file}: {blocks[k].name} is damaged: {why(blocks[k])}"
                raise UffError(msg) from reason
    return fields


def _clean_text(block: Block) -> str:
    """Write a dataset such that pyuff reads it: one blank between columns, E exponents, Unix line ends."""
    lines = list(block.lines)
    if block.kind == 58:
        lines[1:6] = [line[:80] for line in lines[1:6]]
        body = [line.replace("D", "E").replace("d", "e") for line in lines[12:]]
        lines[12:] = [_padded(line, lines[7]) for line in body if line.strip()]
    elif block.kind == 15:
        lines[1:] = [_apart(line, (10, 20, 30, 40, 53, 66, 79)) for line in lines[1:]]
    elif block.kind == 164:
        lines[2:] = [_apart(line, (25, 50, 75)) for line in lines[2:]]
    mark = "    -1\n"
    return mark + "".join(f"{line}\n" for line in lines) + mark


def _padded(line: str, form: str) -> str:
    """Fill a line of numbers up to whole columns, since pyuff leaves a last column that is cut short out."""
    if form[:10].strip() in ("2", "5"):
        return line.ljust(-(-len(line) // 13) * 13)
    return line.ljust(-(-len(line) // 20) * 20) if form[20:30].strip() == "1" else line


def _apart(line: str, columns: tuple[int, ...]) -> str:
    """Put a blank between the columns of a line, where numbers may touch; D exponents become E."""
    line = line.replace("D", "E").replace("d", "e")
    edges = (0, *columns)
    if len(line.split()) == len(columns):
        return line + " "
    return " ".join(line[a:b] for a, b in pairwise(edges)) + " "


def why(block: Block) -> str:
    """Find the line of a damaged dataset, as far as the numbers show it."""
    skip = {58: 12, 82: 3, 164: 2}.get(block.kind, 1)
    if len(block.lines) <= skip:
        return f"it has {len(block.lines)} lines, too few for its header"
    for k, line in enumerate(block.lines[skip:], start=skip):
        for word in line.split():
            if not re.fullmatch(r"[-+]?[\d.]+([EeDd]?[-+]?\d+)?([-+][\d.]+[EeDd][-+]?\d+)*", word):
                return f"line {block.line + 1 + k} has {word[:20]!r} where a number is expected"
    return "the number or the columns of its values are not what its header says"
