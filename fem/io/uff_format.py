"""Framing of universal files: where each dataset begins and ends, and the labels of its degrees of freedom.

A file is cut up by the number of values that each binary record announces, since the bytes of a value may
look like a mark.
"""

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.io.faults import refuse

MARK = b"    -1"
"""Mark, alone on its line, before and after each dataset."""

MOST_STRAY = 3
"""Lines outside any dataset that are named one by one; of more there is the number."""


HEADER_LINES = 12
"""Lines of dataset 58 before its data: the type and eleven records."""

_DIRECTIONS = ("X", "Y", "Z", "RX", "RY", "RZ")
_LABEL = re.compile(r"(-?\d+)(?:(S)|(R?[XYZ])([+-]))")


class UffError(ValueError):
    """A universal file that cannot be read or written; the message names file, dataset and place."""


def label_of(node: int, direction: int) -> str:
    """Return the label of a degree of freedom: ``label_of(12, 3)`` is ``"12Z+"``.

    Parameters
    ----------
    node : int
        Node number.
    direction : int
        1 to 6 for X, Y, Z, RX, RY, RZ; negative for the opposite sense; 0 for a scalar (``"12S"``).

    Raises
    ------
    UffError
        For another direction.
    """
    if not -6 <= direction <= 6:
        msg = f"direction {direction} at node {node} does not exist; directions are -6 to 6 (0 for a scalar)"
        raise UffError(msg)
    if direction == 0:
        return f"{node}S"
    return f"{node}{_DIRECTIONS[abs(direction) - 1]}{'+' if direction > 0 else '-'}"


def parse_label(label: str) -> tuple[int, int]:
    """Return the node and the signed direction of a label: ``parse_label("12Z-")`` is ``(12, -3)``.

    Raises
    ------
    UffError
        If the label is not a node number followed by X, Y, Z, RX, RY or RZ and a sign, or by S.
    """
    found = _LABEL.fullmatch(label)
    if found is None:
        msg = f"'{label}' is not the label of a degree of freedom; they look like 12Z+, 3RX- or 7S (scalar)"
        raise UffError(msg)
    node, scalar, axis, sign = found.groups()
    if scalar:
        return int(node), 0
    return int(node), (_DIRECTIONS.index(axis) + 1) * (1 if sign == "+" else -1)


@dataclass(frozen=True, eq=False)
class UffBlock:
    """One dataset of a file.

    Attributes
    ----------
    kind : int, number of the dataset, such as 58
    line, offset : int, place of its opening mark: line from 1, byte from 0
    head : str, the line with its type
    body : bytes, bytes after that line, without the closing mark; of a binary dataset the header only
    values : ndarray or None
        Values of a binary dataset, a structured array with ``y`` (n, 1 or 2) and ``x`` (n,) where it is
        stored.
    refusal : str, why it cannot be read; empty if it can
    """

    kind: int
    line: int
    offset: int
    head: str
    body: bytes = b""
    values: NDArray[Any] | None = None
    refusal: str = ""

    @cached_property
    def lines(self) -> tuple[str, ...]:
        """Its text, the line with the type first."""
        return (self.head, *(_decode(line) for line in self.body.removesuffix(b"\n").split(b"\n")))

    @property
    def n_lines(self) -> int:
        """Number of lines, the one with the type among them."""
        return len(self.lines)

    @property
    def name(self) -> str:
        """Its type and place, for messages."""
        binary = "b" if self.values is not None else ""
        return f"dataset {self.kind}{binary} at line {self.line} (byte {self.offset})"

    def at(self, record: int) -> str:
        """Return the place of one of its lines in the file; line 0 is the one with the type."""
        return f"line {self.line + 1 + record}"


@dataclass(slots=True)
class _Cursor:
    """A position in the bytes of a file, and the number of its line."""

    data: bytes
    file: str
    at: int = 0
    line: int = 1

    def peek(self) -> bytes:
        end = self.data.find(b"\n", self.at)
        return self.data[self.at : end if end >= 0 else len(self.data)]

    def skip(self, count: int) -> None:
        self.line += self.data.count(b"\n", self.at, self.at + count)
        self.at += count

    def take(self) -> bytes:
        text = self.peek()
        self.skip(len(text) + 1)
        return text.rstrip()

    @property
    def done(self) -> bool:
        return self.at >= len(self.data)


def split_blocks(data: bytes, file: str) -> tuple[list[UffBlock], list[str]]:
    """Cut the bytes of a universal file into its datasets.

    Returns
    -------
    blocks : list of Block
        The datasets in their order.
    notes : list of str
        One line for each thing that was passed over.
    """
    if b"\n" not in data:  # line ends of old Macintosh programs
        data = data.replace(b"\r", b"\n")
    cursor, blocks = _Cursor(data, file), []
    notes: list[str] = []
    n_stray = 0
    while not cursor.done:
        line, offset = cursor.line, cursor.at
        text = cursor.take()
        if not text.strip(b" \t\r\0\x1a"):
            continue
        if text == MARK and not (cursor.done or cursor.peek().rstrip() == MARK):
            blocks.append(_take_block(cursor, line, offset))
            continue
        if re.fullmatch(rb" *(?:15|18|55|58|58b|82|164|780|781|24[0-9][0-9]) *", text[:80]) and blocks:
            msg = (
                f"{file}: line {line} has {_decode(text)[:20].strip()!r}, the number of a dataset, outside "
                "any dataset; a line with '    -1' is missing before it, or there is one too many"
            )
            raise UffError(msg)
        n_stray += 1
        if n_stray <= MOST_STRAY:
            what = "a mark with no dataset after it" if text == MARK else "text outside any dataset"
            notes.append(f"line {line}: {what}" + ("" if text == MARK else f": {_decode(text[:400])[:40]!r}"))
    if n_stray > MOST_STRAY:
        notes[-1] += f", and {n_stray - MOST_STRAY} more lines outside any dataset"
    if not blocks:
        msg = (
            f"{file}: no dataset found; a universal file has lines with '    -1' before and after each "
            "dataset"
        )
        raise UffError(msg)
    return blocks, notes


def _take_block(cursor: _Cursor, line: int, offset: int) -> UffBlock:
    head = cursor.take()
    if not head[:6].strip().isdigit():
        _take_text(cursor, f"dataset at line {line}", offset)
        return UffBlock(0, line, offset, "", refusal=f"its type {_decode(head)[:20]!r} is not a number")
    kind = int(head[:6])
    if kind == 58 and head[6:7].lower() == b"b":
        return _take_binary(cursor, _decode(head), line, offset)
    body = _take_text(cursor, f"dataset {kind} at line {line}", offset)
    return UffBlock(kind, line, offset, _decode(head), body)


def _take_text(cursor: _Cursor, what: str, offset: int) -> bytes:
    """Take the bytes up to and with the closing mark."""
    start = cursor.at
    if start <= len(cursor.data):
        found = cursor.data.find(b"\n" + MARK, start - 1)
        while found >= 0:
            if _is_mark(cursor.data, found + 1):
                cursor.skip(found + 1 - start)
                cursor.take()
                return cursor.data[start : found + 1]
            found = cursor.data.find(b"\n" + MARK, found + 1)
    n_lines = cursor.data.count(b"\n") + (not cursor.data.endswith(b"\n"))
    msg = (
        f"{cursor.file}: {what} (byte {offset}) has no end; the file stops after line "
        f"{n_lines} (byte {len(cursor.data)}) and may be cut off"
    )
    raise UffError(msg)


def _take_binary(cursor: _Cursor, head: str, line: int, offset: int) -> UffBlock:
    what = f"dataset 58b at line {line} (byte {offset})"
    start, raw = cursor.at, []
    while len(raw) < HEADER_LINES - 1 and not cursor.done:
        raw.append(cursor.take())
    header = (head, *(_decode(text) for text in raw))
    body = cursor.data[start : cursor.at]
    try:
        layouts = _layouts(header)
    except ValueError as reason:
        return _refused(cursor, UffBlock(58, line, offset, head, body, refusal=f"{reason}"))
    n = int(header[7][10:20])
    for layout in layouts:
        end = _end_of_values(cursor.data, cursor.at + n * layout.itemsize)
        if end is not None:
            values = np.frombuffer(cursor.data, layout, n, cursor.at)
            cursor.skip(end - cursor.at)
            cursor.take()
            return UffBlock(58, line, offset, head, body, values)
    need, there = n * layouts[0].itemsize, _distance_to_mark(cursor.data, cursor.at)
    if there is None or there < need:
        msg = (
            f"{cursor.file}: {what} announces {n} values in {need} bytes, but "
            f"{len(cursor.data) - cursor.at if there is None else there} follow its header at byte "
            f"{cursor.at}; the file may be cut off or damaged"
        )
        raise UffError(msg)
    values = np.frombuffer(cursor.data, layouts[0], n, cursor.at)
    cursor.skip(there)
    cursor.take()
    return UffBlock(58, line, offset, head, body, values)


def _refused(cursor: _Cursor, block: UffBlock) -> UffBlock:
    """Pass over a binary dataset whose length is not known."""
    there = _distance_to_mark(cursor.data, cursor.at)
    if there is None:
        msg = (
            f"{cursor.file}: dataset 58b at line {block.line} (byte {block.offset}) has no end; "
            f"{block.refusal}"
        )
        raise UffError(msg)
    cursor.skip(there)
    cursor.take()
    return block


def _layouts(header: tuple[str, ...]) -> list[np.dtype[Any]]:
    """Return the possible layouts of one value: that of the header first, then those of other programs.

    Where the abscissa is stored, some programs write it in single precision with ordinates in double
    precision; some write double precision under a header that says single, or the reverse.
    """
    if len(header) < HEADER_LINES:
        refuse(f"its header has {len(header) - 1} records of 11; the file may be cut off")
    order, floating = _integer(header[0][7:13], 1), _integer(header[0][13:19], 2)
    if order not in (1, 2) or floating not in (0, 2):
        refuse(
            f"byte order {order} and number format {floating}; 1 or 2 (little or big endian) and 2 (IEEE) "
            "are read"
        )
    kind, n, even = _integer(header[7][:10]), _integer(header[7][10:20]), _integer(header[7][20:30])
    if kind not in (2, 4, 5, 6) or n < 0 or even not in (0, 1):
        refuse(
            f"ordinate type {kind}, {n} values, spacing {even}; 2, 4, 5 or 6, none or more, and 0 or 1 are "
            "allowed"
        )
    ends, parts = "<" if order == 1 else ">", 2 if kind in (5, 6) else 1
    width = 8 if kind in (4, 6) else 4
    widths = [(width, width), (12 - width, 12 - width)]
    if not even:
        widths.insert(1, (4, 8))
    abscissa = [] if even else ["x"]
    return [
        np.dtype([*((name, f"{ends}f{a}") for name in abscissa), ("y", f"{ends}f{b}", (parts,))])
        for a, b in widths
    ]


def _integer(text: str, default: int | None = None) -> int:
    if default is not None and not text.strip():
        return default
    try:
        return int(text)
    except ValueError:
        msg = f"its header has {text.strip()!r} where a whole number is expected"
        raise ValueError(msg) from None


def _end_of_values(data: bytes, at: int) -> int | None:
    """Return where the closing mark begins if values can end at a byte; a line end may lie between."""
    for gap in (b"", b"\r\n", b"\n"):
        if data[at : at + len(gap)] == gap and _is_mark(data, at + len(gap)):
            return at + len(gap)
    return None


def _is_mark(data: bytes, at: int) -> bool:
    if data[at : at + len(MARK)] != MARK:
        return False
    # Characters of a line after its mark, all blank, up to which it is one
    rest = data[at + len(MARK) : at + len(MARK) + 256]
    end = rest.find(b"\n")
    return not (rest[:end] if end >= 0 else rest).strip(b" \t\r\0\x1a") and (
        end >= 0 or at + len(MARK) + len(rest) == len(data)
    )


def _distance_to_mark(data: bytes, start: int) -> int | None:
    at = data.find(MARK, start)
    while at >= 0:
        if _is_mark(data, at):
            return at - start
        at = data.find(MARK, at + 1)
    return None


def _decode(text: bytes) -> str:
    """Decode a line as UTF-8, else as Latin-1; characters that Python takes for line ends become blanks."""
    try:
        line = text.decode()
    except UnicodeDecodeError:
        line = text.decode("latin-1")
    return re.sub(r"[\x00-\x08\x0a-\x1f\x7f\x85\u2028\u2029]", " ", line).rstrip()
