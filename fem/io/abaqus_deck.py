"""Blocks of an Abaqus or CalculiX input file: keywords with their parameters and data lines."""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.io.abaqus_keywords import BLANK_LINES, READ
from fem.io.deck import DeckFile, Files, counted
from fem.io.faults import error_at
from fem.mesh import MeshError


@dataclass(frozen=True, slots=True)
class AbaqusRows:
    """Data lines of one file: their texts, and the number of each in the file."""

    file: str
    texts: list[str]
    lines: Sequence[int]

    def place(self, row: int) -> str:
        """Return file and line of a row."""
        return f"{self.file}: line {self.lines[row]}"


@dataclass(slots=True)
class AbaqusBlock:
    """A keyword with its parameters and data lines.

    Attributes
    ----------
    name : as the file has it, in capitals
    keyword : the same without blanks and hyphens
    options : parameters without blanks; names as the deck calls them
    file, line : where it is
    parts : data lines, of more than one file where they are included
    """

    name: str
    keyword: str
    options: dict[str, str]
    file: str
    line: int
    source: DeckFile
    parts: list[AbaqusRows] = field(default_factory=list)

    @property
    def place(self) -> str:
        """File and line."""
        return f"{self.file}: line {self.line}"

    def rows(self) -> Iterator[tuple[str, list[str]]]:
        """Give the place and the cells of each data line."""
        for part in self.parts:
            for row, text in enumerate(part.texts):
                yield part.place(row), cells_of(text)

    def option(self, key: str, what: str) -> str:
        """Return a parameter that must be there."""
        if not self.options.get(key):
            raise error_at(self.place, f"*{self.name} has no {key.lower()}; write {what}")
        return self.options[key]


def fault(block: AbaqusBlock, words: str, place: str = "") -> MeshError:
    """Return an error of a keyword, at its line or that of its data."""
    between = "" if words.startswith(":") else " "
    return MeshError(f"{place or block.place}: *{block.name}{between}{words}")


@dataclass(slots=True)
class Deck:
    """The blocks of a deck, with those of the files that it includes in their places.

    Attributes
    ----------
    path : path
    loose : how many lines come before the first keyword
    """

    path: Path
    loose: int = 0
    files: Files = field(init=False)
    _open: AbaqusBlock | None = None

    def __post_init__(self) -> None:
        self.files = Files(self.path)

    def blocks(self) -> Iterator[AbaqusBlock]:
        """Give the blocks."""
        yield from self._blocks(self.files.first())
        if self._open is not None:
            yield self._open
            self._open = None

    def _blocks(self, file: DeckFile) -> Iterator[AbaqusBlock]:
        lines = file.text.split("\n")
        stars = [k for k, line in enumerate(lines) if "*" in line and line.lstrip()[:1] == "*"]
        comments = [k for k in stars if lines[k].lstrip()[1:2] == "*"]
        heads = [k for k in stars if lines[k].lstrip()[1:2] != "*"] if comments else stars
        if file.text[:2_000_000].count("\x00") > 0 and not heads:
            raise error_at(file.name, "this is a binary file, no text with keywords")
        self._data(file, _rows(file.name, lines, 0, heads[0] if heads else len(lines), comments))
        for head, after in pairwise([*heads, len(lines)]):
            text, start = _joined_head(lines, head, after)
            name, options = split_keyword(text)
            block = AbaqusBlock(name, keyword_of(name), options, file.name, head + 1, file)
            if block.keyword == "INCLUDE":
                check_options(block)
                inner = self.files.include(options.get("INPUT", ""), file, head + 1)
                yield from self._blocks(inner)
            else:
                if self._open is not None:
                    yield self._open
                self._open = block
            blanks = self._open is not None and self._open.keyword in BLANK_LINES
            self._data(file, _rows(file.name, lines, start, after, comments, blanks))

    def _data(self, file: DeckFile, rows: AbaqusRows) -> None:
        if not rows.texts:
            return
        if self._open is None:
            self.loose += len(rows.texts)
        else:
            self._open.parts.append(rows)

    def data_file(self, block: AbaqusBlock) -> AbaqusRows:
        """Return the data lines of the file that a block's ``INPUT`` names."""
        file = self.files.include(block.options["INPUT"], block.source, block.line)
        lines = file.text.split("\n")
        comments = [k for k, line in enumerate(lines) if line.lstrip()[:2] == "**"]
        rows = _rows(file.name, lines, 0, len(lines), comments)
        key = next((k for k, text in enumerate(rows.texts) if text.lstrip()[:1] == "*"), None)
        if key is not None:
            msg = (
                f"{rows.place(key)}: {rows.texts[key].strip()[:40]} is in a file that {block.place} reads "
                "with INPUT=, where only data lines are allowed; use *INCLUDE for this file"
            )
            raise MeshError(msg)
        return rows


def _rows(
    file: str, lines: list[str], start: int, stop: int, comments: list[int], blanks: bool = False
) -> AbaqusRows:
    """Return the lines from start to stop that are neither comments nor, unless ``blanks``, empty."""
    texts = lines[start:stop]
    if blanks:
        numbers = [k for k, text in enumerate(texts, start=start + 1) if text.lstrip()[:2] != "**"]
        return AbaqusRows(file, [lines[k - 1] for k in numbers], numbers)
    kept = [text for text in texts if text and not text.isspace()]
    first = bisect_left(comments, start)
    skip = first < len(comments) and comments[first] < stop
    if len(kept) == len(texts) and not skip:
        return AbaqusRows(file, texts, range(start + 1, stop + 1))
    if not skip and texts[: len(kept)] == kept:  # empty lines at the end
        return AbaqusRows(file, kept, range(start + 1, start + 1 + len(kept)))
    numbers = [
        k
        for k, text in enumerate(texts, start=start + 1)
        if text and not text.isspace() and text.lstrip()[:2] != "**"
    ]
    return AbaqusRows(file, [lines[k - 1] for k in numbers], numbers)


def _joined_head(lines: list[str], head: int, after: int) -> tuple[str, int]:
    """Return a keyword line with those that it goes on in, and where its data begin.

    No parameter begins with a digit: a line that does holds data, whatever the line before it ends with.
    """
    text, start = lines[head].strip(), head + 1
    while text.endswith(",") and start < after:
        more = lines[start].strip()
        if more and not (more[0].isalpha() or more.startswith("**")):
            break
        text += "" if more.startswith("**") else more
        start += 1
        if not more:
            break
    return text, start


def cells_of(text: str) -> list[str]:
    """Split a data line at its commas, those in quotes excepted; the cell after a last comma is left out."""
    if '"' not in text:
        cells = [cell.strip() for cell in text.split(",")]
    else:
        parts: list[list[str]] = [[]]
        for k, piece in enumerate(text.split('"')):
            quoted = k % 2 == 1
            head, *rest = [piece] if quoted else piece.split(",")
            parts[-1].append(f'"{head}"' if quoted else head)
            parts += [[cell] for cell in rest]
        cells = ["".join(part).strip() for part in parts]
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def name_of(cell: str) -> str:
    """Return a label as the deck knows it: in capitals, unless it is quoted."""
    cell = cell.strip()
    return cell.strip('"') if cell.startswith('"') else cell.upper()


def keyword_of(name: str) -> str:
    """Return a keyword's name as the tables of keywords have it: without blanks and hyphens."""
    return "".join(name.split()).replace("-", "")


def split_keyword(line: str) -> tuple[str, dict[str, str]]:
    """Split a keyword line into its name in capitals, and its parameters without blanks."""
    word, *rest = cells_of(line.lstrip().removeprefix("*"))
    options: dict[str, str] = {}
    for item in rest:
        key, _, value = item.partition("=")
        key, value = "".join(key.split()).upper(), value.strip()
        if key:
            options[key] = value.strip("\"'") if key == "INPUT" else name_of(value)
    return " ".join(word.upper().split()), options


def check_options(block: AbaqusBlock) -> None:
    """Write the parameters of a keyword that is read in full, and refuse those that are not."""
    allowed = READ[block.keyword]
    options: dict[str, str] = {}
    for key, value in block.options.items():
        found = [key] if key in allowed else [name for name in sorted(allowed) if name.startswith(key)]
        if len(found) != 1:
            why = f"may be {' or '.join(found)}" if found else "is not supported"
            msg = (
                f"{block.place}: *{block.name} has the parameter {key[:40]}, which {why}; "
                f"supported are {', '.join(sorted(allowed)) or 'none'}"
            )
            raise MeshError(msg)
        options[found[0]] = value
    block.options = options


def table_of(texts: list[str], dtype: type, least: int, most: int) -> NDArray[Any] | None:
    """Return data lines of equally many numbers as an array, None if they are anything else.

    This is the fast way for plain blocks; a caller that gets None reads line by line and names the fault.
    """
    if len(texts) < 8:
        return None
    if texts[0].rstrip().endswith(","):
        texts = [text.rstrip().removesuffix(",") for text in texts]
    if not least <= texts[0].count(",") + 1 <= most:
        return None
    try:
        found = np.loadtxt(texts, dtype=dtype, delimiter=",", comments=None, ndmin=2)
    except (ValueError, OverflowError, DeprecationWarning):
        return None
    if found.shape[0] != len(texts) or not np.isfinite(found).all():
        return None
    return found


def left_out_sentence(words: str, found: dict[str, list[str]]) -> list[str]:
    """Return one sentence that counts names, each with the first of its places."""
    return [f"{words}: {counted(found)}"] if found else []
