"""The story of a report without what only a page can do: written into the page, read for other programs."""

import base64
import json
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image

from dovetail.report import blocks as made
from dovetail.report.blocks import Items, TableBlock, Text, plain
from dovetail.result import PICTURES, REPORT


class ReportError(ValueError):
    """A folder without a report, or a report that cannot be read."""


@dataclass(frozen=True, slots=True)
class OutlinePicture:
    """A picture as PNG or GIF, a text for those who cannot see it, and its caption."""

    content: bytes
    alt: str
    caption: str = ""


Block = Text | Items | TableBlock | OutlinePicture


@dataclass(frozen=True, slots=True)
class ReportPart:
    """A part of the story: heading, level (1 for a section, 2 below it), and its content."""

    heading: str
    level: int
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Outline:
    """A report as blocks.

    Attributes
    ----------
    name : str
        The study's.
    first : tuple of Block
        Verdict, values and the first pictures.
    parts : tuple of Part
    """

    name: str
    first: tuple[Block, ...]
    parts: tuple[ReportPart, ...]

    def blocks(self) -> Iterator[Block]:
        """Yield all blocks in their order."""
        yield from self.first
        for part in self.parts:
            yield from part.blocks

    def texts(self, style: str) -> tuple[str, ...]:
        """Return the paragraphs of the first blocks that have a style."""
        return tuple(plain(b.text) for b in self.first if isinstance(b, Text) and b.style == style)


ID = "outline"
"""Of the element of a page that holds the outline."""

_EMBEDDED = r'src="data:[^,]*,([^"]*)"[^>]*data-file="([^"]*)"'
_WRITERS = "'dovetail run' or 'dovetail update'"


def packed_outline(report: made.Report) -> str:
    """Return the story of a report as deflated JSON in base64, with pictures by the names of their files."""
    parts: list[tuple[str, int, list[Any]]] = [("", 0, [])]
    for block in _shown(report.first):
        parts[0][2].append(_values(block))
    for section in filter(None, report.sections):
        parts.append((section.title, 1, []))
        for block in _shown(section.blocks):
            if isinstance(block, made.Heading):
                parts.append((block.text, 2, []))
            else:
                parts[-1][2].append(_values(block))
    kept = [part for part in parts if part[2] or part[1] < 2]
    text = json.dumps([report.name, kept], separators=(",", ":"))
    return base64.b64encode(zlib.compress(text.encode(), 9)).decode("ascii")


def _shown(blocks: Sequence[made.Block | None]) -> Iterator[made.Block]:
    """Yield blocks that other programs can show: of interactive figures the pictures, of details none."""
    for block in filter(None, blocks):
        if isinstance(block, made.Plot):
            yield from block.stills
        elif not isinstance(block, made.Group):
            yield block
        elif not isinstance(block, made.Details):
            yield from _shown(block.blocks)


def _values(block: made.Block) -> list[Any]:
    """Return kind and fields of a block as JSON holds them."""
    if isinstance(block, Text):
        return ["Text", plain(block.text), block.style.partition(" ")[0]]
    if isinstance(block, Items):
        return ["Items", [plain(item) for item in block.items]]
    if isinstance(block, made.Picture):
        return ["Picture", block.file.name, block.alt, block.caption]
    if isinstance(block, made.Facts):
        block = TableBlock(("", ""), block.pairs)
    assert isinstance(block, TableBlock)
    rows = [[plain(cell) for cell in row] for row in block.rows[: block.n_shown]]
    return [
        "Table",
        [plain(head) for head in block.head],
        rows,
        sorted(block.numbers),
        (),
        block.caption,
    ]


def read_outline(folder: Path) -> Outline:
    """Return the story of the report in a folder of ``dovetail run`` or ``dovetail update``.

    Folded parts of the page and figures drawn by a script are left out; pictures come from ``pictures/``
    where they are there, else from the page.

    Raises
    ------
    ReportError
        If there is no report.
    """
    file = folder / REPORT
    if not file.is_file():
        msg = f"{folder} has no {REPORT}; give a folder that {_WRITERS} has written"
        raise ReportError(msg)
    try:
        page = file.read_text(encoding="utf-8")
        found = re.search(f' id="{ID}">([^<]*)<', page)
        name, parts = json.loads(zlib.decompress(base64.b64decode(found[1] if found else "")))
        (_, _, first), *rest = parts
        embedded = {k: data for data, k in re.findall(_EMBEDDED, page)}

        def block(kind: str, *values: Any) -> Block:
            if kind == "Picture":
                return OutlinePicture(
                    _content(folder / PICTURES / Path(values[0]).name, embedded), *values[1:]
                )
            return {"Text": Text, "Items": Items, "Table": TableBlock}[kind](*values)

        parts = (
            ReportPart(heading, level, tuple(block(*b) for b in blocks)) for heading, level, blocks in rest
        )
        return Outline(name, tuple(block(*b) for b in first), tuple(parts))
    except UnicodeDecodeError as reason:
        msg = f"{file}: byte {reason.start} is not UTF-8; is it a report of {_WRITERS}?"
        raise ReportError(msg) from reason
    except (zlib.error, ValueError, LookupError, TypeError) as reason:
        msg = f"{file} has no outline for other programs; write it again with this version by {_WRITERS}"
        raise ReportError(msg) from reason


def _content(file: Path, embedded: dict[str, str]) -> bytes:
    """Return the bytes of a picture: of its file, or of the page, as PNG."""
    if file.is_file():
        return file.read_bytes()
    with Image.open(BytesIO(base64.b64decode(embedded[file.name]))) as drawn:
        buffer = BytesIO()
        drawn.convert("RGB").save(buffer, "png")
    return buffer.getvalue()
