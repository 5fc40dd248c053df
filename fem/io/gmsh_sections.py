"""The sections of a Gmsh file, and the numbers in them, as text or in binary form.

The count in a header never sets a size in memory: it is compared first with the bytes or words that follow.
"""

import re
import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Floats, Ints
from fem.io.faults import error_at
from fem.mesh import MeshError

_SPACE = np.zeros(256, dtype=bool)
_SPACE[list(b" \t\n\v\f\r")] = True

_END = {"NOD": "ENDNOD", "ELM": "ENDELM"}
"""Ends of the sections of format 1; the others end with ``$End`` and their name."""

LARGEST_INTEGER = 2**53
"""Integers from here on are not exact among real numbers."""


@dataclass(frozen=True, slots=True)
class GmshSection:
    """Ends of a section's content in the file, and the line of its name."""

    name: str
    begin: int
    end: int
    line: int


@dataclass(slots=True)
class MshFile:
    """A Gmsh file and its sections, by name and in the order of the file.

    Attributes
    ----------
    name : str
    data : bytes
    sections : list of Section
    stray : list of int, lines with text outside any section
    version : str, ``"1"``, ``"2.2"``, ``"4.1"``, …
    binary : bool
    order : str, ``"<"`` for little endian, ``">"`` for big endian
    size : int, bytes of a size_t
    """

    name: str
    data: bytes
    sections: list[GmshSection]
    stray: list[int]
    version: str = "1"
    binary: bool = False
    order: str = "<"
    size: int = 8

    def line_at(self, position: int) -> int:
        """Return the number of the line at a byte."""
        return self.data.count(b"\n", 0, position) + 1

    def refuse(self, where: str, reason: str) -> NoReturn:
        """Raise an error that names the file and the place."""
        raise error_at(self.name, f"{where}: {reason}")

    def section(self, name: str) -> GmshSection | None:
        """Return the section of a name; more than one of it are refused, because each has a count."""
        found = [section for section in self.sections if section.name == name]
        if len(found) > 1:
            self.refuse(
                f"line {found[1].line}", f"a second section ${name}; the first is at line {found[0].line}"
            )
        return found[0] if found else None

    def text_lines(self, section: GmshSection) -> list[tuple[int, str]]:
        """Return the lines of a section that are not blank, with their numbers."""
        text = self.data[section.begin : section.end].decode("utf-8", errors="replace")
        rows = enumerate(text.split("\n"), start=self.line_at(section.begin))
        return [(number, row.strip()) for number, row in rows if row.strip()]


def sections_of(name: str, data: bytes) -> MshFile:
    """Find the sections of a file and read the format and the type of numbers from its header."""
    data = data.removeprefix(b"\xef\xbb\xbf")  # some editors begin a text with a byte order mark
    file = MshFile(name, data, [], [])
    at = 0
    while (begin := data.find(b"$", at)) >= 0:
        line_begin = data.rfind(b"\n", 0, begin) + 1
        head = re.compile(rb"\$(\w+)[^\n]*(\n|\Z)").match(data, begin)
        if head is None or data[max(line_begin, at) : begin].strip() or head.group(1).startswith(b"End"):
            file.stray.append(file.line_at(begin))
            at = begin + 1
            continue
        if data[at:begin].strip():
            file.stray.append(file.line_at(at + len(data[at:begin]) - len(data[at:begin].lstrip())))
        word = head.group(1).decode("ascii", errors="replace")
        end = data.find(b"$" + _END.get(word, f"End{word}").encode(), head.end())
        if end < 0:
            file.refuse(
                f"line {file.line_at(begin)}", f"the section ${word} has no end; the file may be cut off"
            )
        file.sections.append(GmshSection(word, head.end(), end, file.line_at(begin)))
        at = data.find(b"\n", end) + 1 or len(data)
    if data[at:].strip():
        file.stray.append(file.line_at(len(data.rstrip()) - 1))
    _read_header(file)
    return file


def _read_header(file: MshFile) -> None:
    section = file.section("MeshFormat")
    if section is None:
        if any(s.name == "NOD" for s in file.sections):
            return
        found = ", ".join(f"${s.name}" for s in file.sections[:8]) or "no section at all"
        msg = f"{file.name}: this is not a Gmsh file; one begins with $MeshFormat, and this one has {found}"
        raise MeshError(msg)
    end = file.data.find(b"\n", section.begin, section.end) + 1 or section.end
    words = file.data[section.begin : end].decode("ascii", errors="replace").split()
    where = f"line {section.line + 1}, in $MeshFormat"
    if len(words) != 3 or words[1] not in ("0", "1") or words[2] not in ("4", "8"):
        file.refuse(
            where,
            f"'{' '.join(words)[:60]}' is found where a version, 0 or 1 (text or binary) and a size of 4 "
            "or 8 are expected",
        )
    version, binary = words[0], words[1] == "1"
    if version not in ("2", "2.0", "2.1", "2.2", "4", "4.0", "4.1") or (binary and version in ("4", "4.0")):
        form = " binary" if binary else ""
        reason = (
            f"format {version}{form} is not read; save it from Gmsh with Mesh.MshFileVersion = 4.1 or 2.2"
        )
        file.refuse(where, reason)
    file.version, file.binary, file.size = version, binary, int(words[2])
    if not binary:
        return
    if file.size not in ((4, 8) if version == "4.1" else (8,)):
        file.refuse(where, f"numbers of {file.size} bytes are not read; save it from Gmsh as text")
    one = file.data[end : end + 4]
    if one not in (b"\x01\0\0\0", b"\0\0\0\x01"):
        file.refuse(where, f"the bytes {one.hex(' ')} are not the integer 1 in either byte order")
    file.order = "<" if one[0] == 1 else ">"


# Numbers ----------------------------------------------------------------------------------------------------


class Words:
    """The numbers of a section in text form, taken one after the other."""

    def __init__(self, file: MshFile, section: GmshSection, dtype: Any = float) -> None:
        self.file, self.section = file, section
        self.data = np.frombuffer(file.data, np.uint8, section.end - section.begin, section.begin)
        self.at = 0
        space = _SPACE[self.data]
        self.begin = np.flatnonzero(~space & np.r_[True, space[:-1]])
        self.values: NDArray[Any] = self._numbers(dtype)

    def _numbers(self, dtype: Any) -> NDArray[Any]:
        text = self.file.data[self.section.begin : self.section.end]
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                values = np.fromstring(text, dtype=dtype, sep=" ") if self.begin.size else np.zeros(0, dtype)
        except (DeprecationWarning, ValueError):
            values = np.zeros(0, dtype)
        if len(values) == len(self.begin):
            large = (values >= LARGEST_INTEGER) | (values <= -LARGEST_INTEGER)
            if dtype is not float and large.any():
                k = int(np.argmax(large))
                self.refuse(f"the number {text.split()[k].decode()[:40]} is too large", k)
            return values
        form = (
            r"[+-]?\d+" if dtype is not float else r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(inf|nan)\w*"
        )
        for k, word in enumerate(text.split()):
            if not re.fullmatch(form, word.decode("ascii", errors="replace"), re.IGNORECASE):
                kind = "a number" if dtype is float else "an integer"
                shown = word[:40].decode("utf-8", errors="replace")
                self.refuse(f"'{shown}' is not {kind}", k)
        self.refuse("it cannot be read as numbers", 0)

    @cached_property
    def line(self) -> Ints:
        """Line of each number, counted from the first of the section."""
        return np.searchsorted(np.flatnonzero(self.data == 10), self.begin)

    def place(self, word: int) -> str:
        """Return the line of a number."""
        if not self.begin.size:
            return f"line {self.section.line}"
        position = int(self.begin[min(word, len(self.begin) - 1)])
        return f"line {self.file.line_at(self.section.begin + position)}"

    def refuse(self, reason: str, word: int | None = None) -> NoReturn:
        """Raise an error that names file, line and section."""
        where = self.place(self.at if word is None else word)
        self.file.refuse(f"{where}, in ${self.section.name}", reason)

    def _take(self, n: int) -> NDArray[Any]:
        if not 0 <= n <= len(self.values) - self.at:
            self.refuse(_cut_off(n, len(self.values) - self.at, "numbers"))
        self.at += n
        return self.values[self.at - n : self.at]

    def reals(self, n: int) -> Floats:
        """Return the next real numbers."""
        return self._take(n)

    def integers(self, at: Ints) -> Ints:
        """Return the integers at given places."""
        values = self.values[at]
        if values.dtype == np.int64:
            return values
        wrong = ~(np.abs(values) < LARGEST_INTEGER) | (values != np.rint(values))
        if wrong.any():
            word = int(at[np.argmax(wrong)])
            self.refuse(f"{self.values[word]:g} is found where an integer is expected", word)
        return values.astype(np.int64)

    def ints(self, n: int) -> Ints:
        """Return the next integers."""
        begin = self.at
        self._take(n)
        return self.integers(np.arange(begin, self.at))

    sizes = ints

    def rows(self, n: int, n_integers: int, real: int = 0) -> tuple[Ints, Floats]:
        """Return n rows of integers and real numbers; each is a line."""
        width, begin = n_integers + real, self.at
        if not 0 <= n * width <= len(self.values) - begin:
            self.refuse(_cut_off(n * width, len(self.values) - begin, "numbers"))
        line = self.line[begin : begin + n * width].reshape(n, width)
        after = self.line[begin + n * width] if begin + n * width < len(self.line) else -1
        wrong = line[:, 0] != line[:, -1]
        wrong[:-1] |= line[1:, 0] == line[:-1, -1]
        if n and (wrong.any() or after == line[-1, -1]):
            row = int(np.argmax(wrong)) if wrong.any() else n - 1
            count = int((self.line == line[row, 0]).sum())
            self.refuse(f"{count} numbers, where {width} are expected", begin + row * width)
        values = self._take(n * width).reshape(n, width)
        at = begin + width * np.arange(n)
        numbers = [self.integers(at + k) for k in range(n_integers)]
        return np.array(numbers, dtype=np.int64).reshape(n_integers, n).T, values[:, n_integers:]

    def finish(self) -> None:
        """Refuse numbers that are left over."""
        if self.at < len(self.values):
            self.refuse(f"{len(self.values) - self.at} numbers more than the section announces")


class Bytes:
    """The numbers of a section in binary form, taken one after the other."""

    def __init__(self, file: MshFile, section: GmshSection) -> None:
        self.file, self.section, self.at = file, section, section.begin

    def place(self, at: int) -> str:
        """Return the position of a number in the file."""
        return f"byte {at}"

    def refuse(self, reason: str, at: int | None = None) -> NoReturn:
        """Raise an error that names file, byte and section."""
        self.file.refuse(f"byte {self.at if at is None else at}, in ${self.section.name}", reason)

    def text_count(self) -> int:
        """Return the number in the text line that begins a section of format 2."""
        end = self.file.data.find(b"\n", self.at, self.section.end)
        word = self.file.data[self.at : max(end, self.at)].strip()
        if not re.fullmatch(rb"\d{1,18}", word):
            self.refuse(f"the number of entries is expected, not {word[:20]!r}")
        self.at = end + 1
        return int(word)

    def take(self, form: Any, n: int) -> NDArray[Any]:
        """Return the next n values of a type."""
        dtype = np.dtype(form)
        available = self.section.end - self.at
        if not 0 <= n * dtype.itemsize <= available:
            self.refuse(_cut_off(n, available // dtype.itemsize, "values"))
        values = np.frombuffer(self.file.data, dtype, n, self.at)
        self.at += n * dtype.itemsize
        return values

    def ints(self, n: int) -> Ints:
        """Return the next integers of four bytes."""
        return self.take(f"{self.file.order}i4", n).astype(np.int64)

    def sizes(self, n: int) -> Ints:
        """Return the next numbers of type size_t."""
        begin, values = self.at, self.take(f"{self.file.order}u{self.file.size}", n)
        wrong = values >= LARGEST_INTEGER
        if wrong.any():
            at = begin + int(np.argmax(wrong)) * self.file.size
            self.refuse(f"the number {int(values[np.argmax(wrong)])} is too large", at)
        return values.astype(np.int64)

    def reals(self, n: int) -> Floats:
        """Return the next real numbers."""
        return self.take(f"{self.file.order}f8", n).astype(float)

    def rows(self, n: int, n_integers: int, real: int = 0) -> tuple[Ints, Floats]:
        """Return n rows of either sizes or real numbers."""
        if real:
            return np.zeros((n, 0), dtype=np.int64), self.reals(n * real).reshape(n, real)
        return self.sizes(n * n_integers).reshape(n, n_integers), np.zeros((n, 0))

    def finish(self) -> None:
        """Refuse bytes that are left over."""
        rest = self.file.data[self.at : self.section.end]
        if rest.strip(b"\r\n"):
            self.refuse(f"{len(rest)} bytes more than the section announces")


def _cut_off(wanted: int, available: int, what: str) -> str:
    return f"it is cut off: {wanted} {what} are announced, and {available} are left"
