"""Positions of the keys and values of a TOML text.

``tomllib`` gives values without places. This scan of a text that ``tomllib`` has accepted gives the places.
"""

import re
import tomllib
from bisect import bisect_left
from dataclasses import dataclass, field

Path = tuple[str | int, ...]
"""Keys and list indices from the top of the file: ``("joints", 0, "k", "kx")``."""

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_QUOTES = ('"""', "'''", '"', "'")


@dataclass(frozen=True, slots=True)
class Places:
    """Places in a text, as indices of its characters.

    Attributes
    ----------
    values : dict of Path to (int, int)
        Of each value behind a key, and of each list item.
    pairs : dict of Path to (int, int)
        Of each key with its value.
    headers : dict of Path to (int, int)
        Of each ``[table]`` and ``[[table]]`` line, up to its closing bracket.
    """

    values: dict[Path, tuple[int, int]] = field(default_factory=dict)
    pairs: dict[Path, tuple[int, int]] = field(default_factory=dict)
    headers: dict[Path, tuple[int, int]] = field(default_factory=dict)


def key_lines(text: str) -> dict[Path, int]:
    """Return the line, from 1, on which each key, table and list item of a valid TOML text begins."""
    return _Scan(text).run()


def places_of(text: str) -> Places:
    """Return the places of values, pairs and headers in a valid TOML text."""
    scan = _Scan(text)
    scan.run()
    return scan.places


class _Scan:
    def __init__(self, text: str) -> None:
        self.text, self.at = text, 0
        self.ends = [m.start() for m in re.finditer("\n", text)]
        self.lines: dict[Path, int] = {}
        self.places = Places()
        self.n_tables: dict[Path, int] = {}  # lengths of arrays of tables

    def run(self) -> dict[Path, int]:
        here: Path = ()
        while self._skip(_BLANK) < len(self.text):
            if self.text.startswith("[", self.at):
                here = self._header()
            else:
                self._pair(here)
        return self.lines

    def _skip(self, pattern: re.Pattern[str]) -> int:
        match = pattern.match(self.text, self.at)
        self.at = match.end() if match else self.at
        return self.at

    def _mark(self, path: Path, start: int) -> None:
        self.lines.setdefault(path, bisect_left(self.ends, start) + 1)

    def _header(self) -> Path:
        start = self.at
        double = self.text.startswith("[[", start)
        self.at += 2 if double else 1
        path: Path = ()
        keys = self._key()
        for depth, key in enumerate(keys):
            path = (*path, key)
            last = depth == len(keys) - 1
            self._mark(path, start)
            if double and last:
                self.n_tables[path] = self.n_tables.get(path, 0) + 1
            if path in self.n_tables:
                path = (*path, self.n_tables[path] - 1)
                self._mark(path, start)
        self.at += 2 if double else 1
        self.places.headers.setdefault(path, (start, self.at))
        return path

    def _key(self) -> list[str]:
        """Take a dotted key and the space around it."""
        parts = []
        while True:
            self._skip(_SPACE)
            if self.text[self.at] in "\"'":
                parts.append(tomllib.loads(f"key = {self._string()}")["key"])  # escapes and all
            else:
                start = self.at
                parts.append(self.text[start : self._skip(_BARE)])
            self._skip(_SPACE)
            if not self.text.startswith(".", self.at):
                return parts
            self.at += 1

    def _pair(self, here: Path) -> None:
        start = self.at
        for key in self._key():
            here = (*here, key)
            self._mark(here, start)
        self.at += 1  # =
        self._skip(_SPACE)
        self._value(here)
        self.places.pairs[here] = start, self.at

    def _value(self, path: Path) -> None:
        begin = self.at
        self._pass_value(path)
        end = begin + len(self.text[begin : self.at].rstrip())
        self.places.values[path] = begin, end

    def _pass_value(self, path: Path) -> None:
        opening = self.text[self.at]
        if opening in "\"'":
            self._string()
        elif opening in "[{":
            self.at += 1
            index = 0
            while self.text[self._skip(_BLANK)] not in "]}":
                if opening == "{":
                    self._pair(path)
                else:
                    self._mark((*path, index), self.at)
                    self._value((*path, index))
                    index += 1
                if self.text[self._skip(_BLANK)] == ",":
                    self.at += 1
            self.at += 1
        else:
            while self.at < len(self.text) and self.text[self.at] not in ",]}\r\n#":
                self.at += 1

    def _string(self) -> str:
        start = self.at
        quote = next(q for q in _QUOTES if self.text.startswith(q, start))
        self.at += len(quote)
        while not self.text.startswith(quote, self.at):
            self.at += 2 if quote[0] == '"' and self.text[self.at] == "\\" else 1
        self.at += len(quote)
        while len(quote) == 3 and self.text.startswith(
            quote[0], self.at
        ):  # up to two quotes before the closing three
            self.at += 1
        return self.text[start : self.at]
