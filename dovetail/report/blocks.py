"""The blocks of a report; a page, a Word document and slides are three ways to show them.

A block without content is false and shown nowhere, and so are ``None`` and a section of nothing but such.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias


@dataclass(frozen=True, slots=True)
class ReportMark:
    """Text that stands out in a line; ``style`` is its class in a page, or ``code``."""

    text: str
    style: str = "tag"


@dataclass(frozen=True, slots=True)
class Pick:
    """A button in a line that shows the FRF of a response and a force, in a page only."""

    output: str
    input: str


Line: TypeAlias = "str | int | ReportMark | Pick | tuple[Line, ...]"
"""Words, some of them marked, or several of these one after the other."""


def plain(line: Line) -> str:
    """Return a line as text alone."""
    if isinstance(line, tuple):
        return " ".join("".join(map(plain, line)).split())
    text = line.text if isinstance(line, ReportMark) else "" if isinstance(line, Pick) else str(line)
    return " ".join(text.split()) if text.strip() else text


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading within a section."""

    text: str


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph; ``style`` is its class in a page, such as ``sentence`` or ``value``, or ``pre``."""

    text: Line
    style: str = ""

    def __bool__(self) -> bool:
        return bool(self.text)


@dataclass(frozen=True, slots=True)
class Items:
    """A list."""

    items: Sequence[Line]

    def __bool__(self) -> bool:
        return bool(self.items)


@dataclass(frozen=True, slots=True)
class TableBlock:
    """A table; rows beyond ``at_most`` are collapsed.

    Attributes
    ----------
    head : sequence of str
        Headings with units; empty ones for a list of names and values.
    rows : sequence of sequences of Line
    numbers : iterable of int
        Columns that hold numbers.
    marked : iterable of int
        Rows that stand out.
    caption : str
    at_most : int
    """

    head: Sequence[str]
    rows: Sequence[Sequence[Line]]
    numbers: Iterable[int] = ()
    marked: Iterable[int] = ()
    caption: str = ""
    at_most: int = 20

    @property
    def n_shown(self) -> int:
        """Return the number of rows that are not collapsed; a few beyond the limit are shown, too."""
        return self.at_most if len(self.rows) > self.at_most + 3 else len(self.rows)


@dataclass(frozen=True, slots=True)
class Facts:
    """Names and values."""

    pairs: Sequence[tuple[str, Line]]


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture: its file, a text for those who cannot see it, and its caption."""

    file: Path
    alt: str
    caption: str = ""
    style: str = ""


@dataclass(frozen=True, slots=True)
class Plot:
    """An interactive figure of a page with the still pictures that show the same elsewhere.

    Attributes
    ----------
    name, alt, caption : str
    stills : sequence of Picture
    packed, data : str
        The figure and further data for its script, see `dovetail.report.drawings.packed`; empty without one.
    tools : str
        HTML of the controls above it.
    hint : str
        How to use it.
    """

    name: str
    alt: str
    caption: str
    stills: Sequence[Picture] = ()
    packed: str = ""
    data: str = ""
    tools: str = ""
    hint: str = ""

    def __bool__(self) -> bool:
        return bool(self.packed or self.stills)


@dataclass(frozen=True, slots=True)
class Group:
    """Blocks that belong together; ``title`` is their class in a page."""

    title: str
    blocks: Sequence["Block | None"]

    def __bool__(self) -> bool:
        return any(self.blocks)


class ReportSection(Group):
    """A section with its heading."""

    __slots__ = ()


class Details(Group):
    """Blocks below a summary that a page shows on demand, and other documents leave out."""

    __slots__ = ()


Block = Heading | Text | Items | TableBlock | Facts | Picture | Plot | Group


@dataclass(frozen=True, slots=True)
class Report:
    """A report: name of the study, verdict, the first screen, and sections."""

    name: str
    verdict: str
    first: Sequence[Block | None]
    sections: Sequence[ReportSection]
