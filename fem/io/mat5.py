"""MATLAB files of versions 5 to 7: numbers, texts, cells of texts and structures.

The format is that of *MAT-File Format* (The MathWorks). It is read here and not by SciPy, which trusts the
sizes that a file states: a damaged one ends the process.
"""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from fem.io.arrays import TableError

MARK = b"MATLAB 5.0 MAT-file"
"""First bytes of such a file."""

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_TYPES = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
    16: "u1",
    17: "u2",
    18: "u4",
}
"""NumPy's types of the format's."""
_CELL, _STRUCTURE, _TEXT, _SPARSE = 1, 2, 4, 5
_NUMBERS = range(6, 16)
_COMPLEX = 0x0800


def read_mat5(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of a MATLAB file, members of structures as ``structure/member``.

    A sparse matrix is ``name/ir``, ``name/jc`` and ``name/data``: rows, beginnings of columns, values.

    Raises
    ------
    TableError
        If it is damaged, or of another version.
    """
    data = path.read_bytes()
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if not data.startswith(b"MATLAB") or order is None:
        msg = f"{path.name}: it cannot be read as a MATLAB file of versions 5 to 7; save it with -v7"
        raise TableError(msg)
    out: dict[str, NDArray[Any]] = {}
    for kind, content in _elements(_Bytes(path.name, order, data[_HEADER:]), padded=True):
        if kind == _COMPRESSED:
            for inner_kind, inner in _elements(content.inflated(), padded=True):
                if inner_kind == _MATRIX:
                    out |= dict(_arrays(inner, "", 0))
        elif kind == _MATRIX:
            out |= dict(_arrays(content, "", 0))
    return out


@dataclass(slots=True)
class _Bytes:
    """A part of a file that is read from its beginning on."""

    name: str
    order: str
    data: bytes
    at: int = 0

    def refuse(self, text: str) -> NoReturn:
        """Raise an error with the file's name."""
        msg = f"{self.name}: it cannot be read as a MATLAB file ({text}); it is damaged or cut short"
        raise TableError(msg)

    def inflated(self) -> "_Bytes":
        """Return the decompressed content."""
        try:
            tool = zlib.decompressobj()
            # an array from which a file is refused: a few bytes can claim to hold any number when compressed
            data = tool.decompress(self.data, 1 << 32)
        except zlib.error:
            self.refuse("a compressed array does not decompress")
        if not tool.eof:
            self.refuse("a compressed array ends too soon")
        return _Bytes(self.name, self.order, data)

    def take(self, n: int) -> bytes:
        """Return the next bytes."""
        if n < 0 or self.at + n > len(self.data):
            self.refuse(f"{n} bytes are announced and {len(self.data) - self.at} left")
        self.at += n
        return self.data[self.at - n : self.at]

    def element(self, padded: bool = True) -> tuple[int, "_Bytes"]:
        """Return type and content of the next element."""
        first, size = (int(v) for v in np.frombuffer(self.take(8), f"{self.order}u4"))
        if first >> 16:  # up to four bytes in the place of the size
            self.at -= 4
            content = self.take(4)[: first >> 16]
            return first & 0xFFFF, _Bytes(self.name, self.order, content)
        content = self.take(size)
        if padded and first != _COMPRESSED:
            self.at = min(len(self.data), self.at + -size % 8)
        return first, _Bytes(self.name, self.order, content)

    def numbers(self) -> NDArray[Any]:
        """Return the numbers of the next element."""
        kind, content = self.element()
        if kind not in _TYPES:
            self.refuse(f"numbers of type {kind}")
        dtype = np.dtype(self.order + _TYPES[kind])
        if len(content.data) % dtype.itemsize:
            self.refuse(f"{len(content.data)} bytes of numbers of {dtype.itemsize} bytes")
        return np.frombuffer(content.data, dtype)


def _elements(data: _Bytes, padded: bool) -> Iterator[tuple[int, _Bytes]]:
    while len(data.data) - data.at >= 8:
        yield data.element(padded)


def _arrays(data: _Bytes, prefix: str, depth: int) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the arrays in a matrix element by their names."""
    if not data.data or depth > 8:
        return
    flags, shape = data.numbers(), tuple(int(n) for n in data.numbers())
    name = prefix or bytes(data.numbers().astype("u1")).decode("latin-1")
    if prefix:
        data.numbers()  # members have no names of their own
    if flags.size < 1 or any(n < 0 for n in shape) or len(shape) < 2:
        data.refuse(f"the array '{name}' has the shape {shape}")
    kind, size = int(flags[0]) & 0xFF, prod(shape)
    if kind in _NUMBERS:
        parts = [data.numbers() for _ in range(2 if int(flags[0]) & _COMPLEX else 1)]
        if any(p.size != size for p in parts):
            data.refuse(f"the array '{name}' of shape {shape} has {parts[0].size} values")
        values = parts[0] + 1j * parts[1] if len(parts) == 2 else parts[0]
        yield name, values.reshape(shape, order="F")
    elif kind == _SPARSE:  # under the names that files of version 7.3 give them
        for part in ("ir", "jc", "data"):
            yield f"{name}/{part}", data.numbers()
    elif kind == _TEXT:
        yield name, np.array(_texts(data, name, shape), dtype=str)
    elif kind == _CELL:
        texts = [_cell_text(data) for _ in range(min(size, len(data.data)))]
        if texts and all(text is not None for text in texts):
            yield name, np.array(texts, dtype=str)
    elif kind == _STRUCTURE and size == 1:
        length = data.numbers()
        if length.size != 1 or int(length[0]) < 1:
            data.refuse(f"the members of '{name}' have names of {length.tolist()} characters")
        raw, width = bytes(data.numbers().astype("u1")), int(length[0])
        for k in range(0, len(raw), width):
            member = raw[k : k + width].split(b"\0")[0].decode("latin-1")
            _, content = data.element()
            yield from _arrays(content, f"{name}/{member}", depth + 1)


def _texts(data: _Bytes, name: str, shape: tuple[int, ...]) -> list[str]:
    """Return the rows of a text array; one row is one text."""
    if not prod(shape):
        return [""] * max(1, shape[0])  # MATLAB's '' has no rows, and is one text all the same
    codes = data.numbers()
    if codes.dtype.itemsize == 1 and codes.size != prod(shape):  # UTF-8
        return [bytes(codes).decode("utf-8", "replace").strip()]
    if codes.size != prod(shape):
        data.refuse(f"the text '{name}' of shape {shape} has {codes.size} characters")
    rows = codes.reshape(shape, order="F").reshape(shape[0], -1)
    return ["".join(chr(int(c)) for c in row if int(c) < 0xD800).strip() for row in rows]


def _cell_text(data: _Bytes) -> str | None:
    """Return the text in the next cell; None for any other content."""
    kind, content = data.element()
    if kind != _MATRIX or not content.data:
        return None
    found = dict(_arrays(content, "cell", 0)).get("cell")
    return str(found[0]) if found is not None and found.dtype.kind == "U" and found.size == 1 else None
