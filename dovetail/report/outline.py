"""The story of a report as plain blocks, read from its page, for files of other programs."""

import base64
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image

from dovetail.result import PICTURES, REPORT


class ReportError(ValueError):
    """A folder without a report, or a report that cannot be read."""


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph; ``style`` is its class in the page, such as ``sentence`` or ``value``, or nothing."""

    text: str
    style: str = ""


@dataclass(frozen=True, slots=True)
class Items:
    """A list."""

    items: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Table:
    """A table: headings, rows, numbers of the columns that hold numbers, and a caption."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numbers: frozenset[int] = frozenset()
    caption: str = ""


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture as PNG or GIF, a text for those who cannot see it, and its caption."""

    content: bytes
    alt: str
    caption: str = ""


Block = Text | Items | Table | Picture


@dataclass(frozen=True, slots=True)
class Part:
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
    parts: tuple[Part, ...]

    def blocks(self) -> Iterator[Block]:
        """Yield all blocks in their order."""
        yield from self.first
        for part in self.parts:
            yield from part.blocks

    def texts(self, style: str) -> tuple[str, ...]:
        """Return the paragraphs of the first blocks that have a style."""
        return tuple(b.text for b in self.first if isinstance(b, Text) and b.style == style)


def read_outline(folder: Path) -> Outline:
    """Return the story of the report in a folder that ``dovetail run`` has written.

    Folded parts of the page and figures drawn by a script are left out; pictures come from ``pictures/``
    where they are there, else from the page.

    Raises
    ------
    ReportError
        If there is no report.
    """
    file = folder / REPORT
    if not file.is_file():
        msg = f"{folder} has no {REPORT}; give a folder that 'dovetail run STUDY --out DIR' has written"
        raise ReportError(msg)
    reader = _Reader(folder / PICTURES)
    try:
        reader.feed(file.read_text(encoding="utf-8"))
    except UnicodeDecodeError as reason:
        msg = f"{file}: byte {reason.start} is not UTF-8; is it a report of 'dovetail run'?"
        raise ReportError(msg) from reason
    reader.close()
    if not reader.name:
        msg = f"{file} has no heading; is it a report of 'dovetail run'?"
        raise ReportError(msg)
    return reader.outline()


_SKIPPED = {"details", "script", "style", "nav", "select", "button", "output", "label", "head"}
"""Elements whose content is not told."""
_OWN_TEXT = {"h1", "h2", "h3", "p", "li", "th", "td", "caption", "figcaption", "dt", "dd"}
_VOID = {"img", "meta", "link", "br", "hr"}


@dataclass(slots=True)
class _Open:
    """A part that is being read."""

    heading: str
    level: int
    blocks: list[Block] = field(default_factory=list)


class _Reader(HTMLParser):
    """Collects blocks from a page of `dovetail.report.report`."""

    def __init__(self, pictures: Path) -> None:
        super().__init__(convert_charrefs=True)
        self.pictures, self.name = pictures, ""
        self.parts = [_Open("", 0)]
        self.stack: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.items: list[str] = []
        self.facts: list[str] = []
        self.rows: list[list[str]] = []
        self.numbers: set[int] = set()
        self.caption = ""

    def outline(self) -> Outline:
        """Return the parts read so far."""
        first, *parts = self.parts
        told = tuple(Part(p.heading, p.level, tuple(p.blocks)) for p in parts if p.blocks or p.level == 1)
        return Outline(self.name, tuple(first.blocks), told)

    @property
    def _hidden(self) -> bool:
        return any(
            tag in _SKIPPED or {"tools", "hint", "live", "skip"} & set((known.get("class") or "").split())
            for tag, known in self.stack
        )

    def _add(self, block: Block) -> None:
        self.parts[-1].blocks.append(block)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Open an element."""
        known = dict(attrs)
        if tag == "img" and not self._hidden:
            self._add(Picture(self._image(known), known.get("alt") or ""))
        if tag in _VOID:
            return
        self.stack.append((tag, known))
        if tag in _OWN_TEXT:
            self.words = []
        if tag == "ul":
            self.items = []
        elif tag == "table":
            self.rows, self.numbers, self.caption = [], set(), ""
        elif tag == "tr":
            self.rows.append([])
        elif tag == "dl":
            self.facts = []

    def handle_data(self, data: str) -> None:
        """Collect text."""
        if not self._hidden:
            self.words.append(data)

    def handle_endtag(self, tag: str) -> None:
        """Close an element and keep its content."""
        if not any(t == tag for t, _ in self.stack):
            return
        hidden, known = self._hidden, {}
        while self.stack:
            opened, known = self.stack.pop()
            if opened == tag:
                break
        if not hidden:
            self._keep(tag, known)

    def _keep(self, tag: str, known: dict[str, str | None]) -> None:
        text = " ".join("".join(self.words).split()) if tag in _OWN_TEXT else ""
        if tag == "h1":
            self.name = text
        elif tag in ("h2", "h3"):
            below = tag == "h3" and any(p.level == 1 for p in self.parts)
            self.parts.append(_Open(text, 2 if below else 1))
        elif tag == "p" and text:
            self._add(Text(text, (known.get("class") or "").split(" ")[0]))
        elif tag == "li":
            self.items.append(text)
        elif tag == "ul" and self.items:
            self._add(Items(tuple(self.items)))
        elif tag in ("th", "td"):
            if known.get("class") == "n":
                self.numbers.add(len(self.rows[-1]))
            self.rows[-1].append(text)
        elif tag == "caption":
            self.caption = text
        elif tag == "table" and self.rows:
            head, *rows = (tuple(row) for row in self.rows)
            self._add(Table(head, tuple(rows), frozenset(self.numbers), self.caption))
        elif tag in ("dt", "dd"):
            self.facts.append(text)
        elif tag == "dl":
            pairs = zip(self.facts[::2], self.facts[1::2], strict=False)
            self._add(Table(("", ""), tuple(pairs)))
        elif tag == "figcaption":
            self._caption(text)

    def _caption(self, text: str) -> None:
        blocks = self.parts[-1].blocks
        if blocks and isinstance(blocks[-1], Picture) and not blocks[-1].caption:
            blocks[-1] = Picture(blocks[-1].content, blocks[-1].alt, text)

    def _image(self, known: dict[str, Any]) -> bytes:
        """Return the bytes of a picture: of its file, or of the page, as PNG."""
        file = self.pictures / Path(known.get("data-file") or "/").name
        if known.get("data-file") and file.is_file():
            return file.read_bytes()
        data = re.sub(r"^data:[^,]*,", "", known.get("src") or "")
        with Image.open(BytesIO(base64.b64decode(data))) as drawn:
            buffer = BytesIO()
            drawn.convert("RGB").save(buffer, "png")
        return buffer.getvalue()
