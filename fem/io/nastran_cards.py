"""Cards of a Nastran deck: lines of the bulk data with those of included files, split into fields."""

import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fem.array_types import Ints
from fem.io.deck import DeckBudget, DeckFile, Files, integer
from fem.io.deck import real as plain_real
from fem.io.faults import error_at
from fem.io.nastran_comments import Comments
from fem.mesh import MeshError

_CONTROL = re.compile(r"^[ \t]*(BEGIN|ENDDATA|INCLUDE)\b", re.MULTILINE | re.IGNORECASE)
_CEND = re.compile(r"^[ \t]*CEND\b", re.MULTILINE | re.IGNORECASE)
_NAME = re.compile(r"[A-Z][A-Z0-9]{0,9}")
_OTHER_MODEL = re.compile(r"SUPER|AUXMODEL|ARBMODEL|MODULE|MASSID|FLXSLI|UDS", re.IGNORECASE)
_EXPONENT = re.compile(r"(?<=[\d.])([+-]\d+)$")
_INCREMENT = re.compile(r"\*\(?([^()*]+)\)?")
_COMPONENTS = re.compile(r"[1-6]+( +[1-6]+)*")
_LABEL = re.compile(r"[+*](?![\d.]*[.]).*")
"""A label of a continuation line in free field: not a number with a sign and a point."""
_REPEAT = re.compile(r"=\(?(\d+)\)?")

LONGEST_NAME = 20
"""Lines that the name of an included file may go over."""


@dataclass(slots=True)
class BulkData:
    """Lines of the bulk data that are neither empty nor comments.

    Attributes
    ----------
    lines : texts, without tabs
    notes : sentences on the lines left out
    control : lines of the executive and case control, None of a file of bulk data alone
    comments : comment lines
    """

    lines: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    control: list[str] | None = None
    comments: Comments = field(default_factory=Comments)
    _runs: list[tuple[int, str, Sequence[int]]] = field(default_factory=list)
    _bulk_place: str = ""
    _ended: bool = False
    _parts: bool = False

    @classmethod
    def of(cls, path: Path, parts: bool = False) -> "BulkData":
        """Read a deck; with ``parts`` the one model in it may be a superelement (``BEGIN SUPER``).

        Raises
        ------
        MeshError
            For files that cannot be read or include themselves, and for more than one model in a file.
        """
        bulk = cls(_parts=parts)
        files = Files(path)
        bulk._file(files, files.first())
        return bulk

    def place(self, row: int) -> str:
        """Return file and line of a row."""
        run = bisect_right(self._runs, row, key=lambda run: run[0]) - 1
        start, file, numbers = self._runs[run]
        return f"{file}: line {numbers[row - start]}"

    def _file(self, files: Files, file: DeckFile) -> None:
        text = file.text
        lines = text.split("\n")
        done, at, offset = 0, 0, 0
        cend = _CEND.search(text)
        for match in _CONTROL.finditer(text):
            if self._ended or match.start() < offset:
                continue
            row = at + text.count("\n", offset, match.start())
            at, offset = row, match.start()
            if row < done:
                continue
            self._add(file, lines, done, row)
            done = row + 1
            rest = lines[row].strip()[len(match.group(1)) :]
            place = f"{file.name}: line {row + 1}"
            word = match.group(1).upper()
            if word == "BEGIN":
                self._begin(rest, place)
            elif word == "ENDDATA":
                self._end(file, lines, done)
            else:
                name, done = _file_name(rest, lines, row, place)
                if cend and match.start() < cend.start():
                    self.notes.append(
                        f"INCLUDE {name[:60]} ({place}) is left out: files before CEND hold no bulk "
                        "data, but statements of the executive control (DMAP)"
                    )
                else:
                    self._file(files, files.include(name, file, row + 1))
        if not self._ended:
            self._add(file, lines, done, len(lines))

    def _begin(self, rest: str, place: str) -> None:
        if (_OTHER_MODEL.search(rest) and not self._parts) or self._bulk_place:
            msg = (
                f"{place}: BEGIN{rest[:30]} begins another model after the main bulk data"
                f"{f' ({self._bulk_place})' if self._bulk_place else ''}; write a file for each"
            )
            raise MeshError(msg)
        self._bulk_place = place
        self.control = list(self.lines)
        self.comments.end()
        self.lines.clear()
        self._runs.clear()

    def _end(self, file: DeckFile, lines: list[str], done: int) -> None:
        self._ended = True
        self.comments.elsewhere += [text for line in lines[done:] if (text := line.strip())[:1] == "$"]
        n = sum(1 for line in lines[done:] if line.strip() and line.lstrip()[0] != "$")
        if n:
            self.notes.append(f"{n} lines after ENDDATA ({file.name}: line {done}) left out")

    def _add(self, file: DeckFile, lines: list[str], start: int, stop: int) -> None:
        texts = lines[start:stop]
        if "\t" in file.text:
            texts = [text.expandtabs(8) for text in texts]
        kept = [text for text in texts if _holds_data(text)]
        numbers: Sequence[int] = range(start + 1, stop + 1)
        if len(kept) < len(texts):
            numbers = [k for k, text in enumerate(texts, start=start + 1) if _holds_data(text)]
            self.comments.add(texts, numbers, start + 1, len(self.lines))
        if kept:
            self._runs.append((len(self.lines), file.name, numbers))
            self.lines += kept


def _holds_data(text: str) -> bool:
    """Return whether a line is neither empty nor a comment."""
    first = text[:1]
    return first.isalnum() or (not text.isspace() and text.lstrip()[:1] not in ("$", ""))


def _file_name(rest: str, lines: list[str], row: int, place: str) -> tuple[str, int]:
    """Return the name that ``INCLUDE`` gives, over several lines if it is quoted, and the line after it."""
    rest = rest.strip()
    if not rest and row + 1 < len(lines):
        row += 1
        rest = lines[row].strip()
    quote = rest[:1]
    if quote not in ("'", '"') or not quote:
        return rest.split("$")[0].strip(), row + 1
    name = rest[1:]
    last = min(len(lines) - 1, row + LONGEST_NAME)
    while quote not in name and row < last:
        row += 1
        name += lines[row].strip()
    if quote not in name:
        msg = f"{place}: INCLUDE has a file name whose quote {quote} does not end within {LONGEST_NAME} lines"
        raise MeshError(msg)
    return name.split(quote)[0].strip(), row + 1


@dataclass(frozen=True, slots=True)
class Run:
    """Cards of one form one after the other.

    Attributes
    ----------
    key : beginning of their first lines, see :func:`_key`
    name : of the card, in capitals; empty for other lines
    first, count : row of the first line, and number of cards
    length : lines of each card
    """

    key: str
    name: str
    first: int
    count: int
    length: int


def runs_of(bulk: BulkData) -> list[Run]:
    """Return the cards, those of one form that follow each other together."""
    codes, keys = _codes(bulk.lines)
    if not len(codes):
        return []
    continues = np.array([key in "+* " for key in keys], dtype=bool)[codes]
    starts = np.flatnonzero(~continues)
    _check_labels(bulk, np.flatnonzero(continues).tolist())
    if continues[0]:
        bulk.notes.append(f"{bulk.place(0)} continues no card and is left out")
    if not starts.size:
        return []
    lengths = np.diff(np.append(starts, len(codes)))
    change = (np.diff(codes[starts]) != 0) | (np.diff(lengths) != 0)
    begins = np.concatenate([[0], np.flatnonzero(change) + 1])
    counts = np.diff(np.append(begins, len(starts)))
    return [
        Run(keys[codes[starts[b]]], _name_of(keys[codes[starts[b]]]), int(starts[b]), int(n), int(lengths[b]))
        for b, n in zip(begins.tolist(), counts.tolist(), strict=True)
    ]


def _check_labels(bulk: BulkData, rows: list[int]) -> None:
    """Refuse continuation lines whose label says that they belong to a line elsewhere."""
    lines = bulk.lines
    labelled = [row for row in rows if not (lines[row][1:8].isspace() or lines[row][1:2] in (",", ""))]
    strays = {}
    for row in labelled:
        label = _head(lines[row]).strip("+* ")
        if label and label != _tail(lines[row - 1]):
            strays.setdefault(label, row)
    if not strays:
        return
    for row, line in enumerate(lines):
        stray = strays.get(_tail(line)) if len(line) > 72 or "," in line else None
        if stray is not None:
            msg = (
                f"{bulk.place(stray)}: the continuation line +{_tail(line)} belongs to {bulk.place(row)}; "
                "write it after that line"
            )
            raise MeshError(msg)


def _tail(line: str) -> str:
    """Return the label at the end of a line."""
    if "," not in line:
        return line[72:80].strip("+* ")
    cells = [cell.strip() for cell in line.split("$")[0].split(",")]
    return _free_fields(cells[1:], 4 if cells[0].endswith("*") or cells[0][:1] == "*" else 8)[1].strip("+* ")


def _head(line: str) -> str:
    """Return the first field of a line."""
    return line[:8].split(",")[0].strip()


def _codes(lines: list[str]) -> tuple[Ints, list[str]]:
    """Return the number of each line's key, and the keys by number."""
    table: dict[str, int] = {}
    known: dict[str, int] = {}
    codes = []
    for line in lines:
        head = line[:8]
        code = known.get(head)
        if code is None:
            comma = head.find(",") + 1
            head = head[:comma] if comma > 1 else head
            code = known.get(head)
            if code is None:
                key = _key(line)
                code = table.setdefault(key, len(table))
                if key == head or key in "+*":
                    known[head] = code
        codes.append(code)
    return np.array(codes, dtype=np.int64), list(table)


def _key(line: str) -> str:
    """Return the key of a line: its name and its form.

    ``+``, ``*`` and a blank for continuation lines in small, large and either field; else the name with a
    comma in free field, with a blank if blanks separate, or the first eight columns.
    """
    if line[0] in "+*":
        return line[0]
    head = line[:8]
    first, comma, _ = line.partition(",")
    if comma and (len(first) <= 10 or not head.strip()):
        return f"{first.strip()}," if first.strip() else " "
    if not head.strip():
        return " "
    words = line.split(None, 1)
    if head.split()[1:] == ["*"]:  # MSC Nastran pads the name of a card in large field: CORD2R *
        return head
    return (
        f"{words[0]} "
        if len(head.split()) > 1 or (len(line.rstrip()) > 8 and _between_blanks(line))
        else head
    )


def _between_blanks(line: str) -> bool:
    """Return whether a line has fields between blanks: a field of eight columns would have two.

    Components such as ``12 4 6`` after an empty field are one field.
    """
    width = 16 if line[0] == "*" or line[:8].rstrip().endswith("*") else 8
    cells = [line[k : k + width] for k in range(8, min(len(line.rstrip()), 72), width)]
    return any(
        len(cell.split()) > 1
        and not (_COMPONENTS.fullmatch(cell.strip()) and any(not c.strip() for c in cells[:k]))
        for k, cell in enumerate(cells)
    )


def _name_of(key: str) -> str:
    if key.startswith("="):
        return "="
    name = key.strip(" ,").rstrip("* ").upper()
    return name if _NAME.fullmatch(name) else ""


def columns_of(bulk: BulkData, run: Run, wanted: Sequence[int]) -> dict[int, list[str]] | None:
    """Return some fields of all cards of a run, counted from 0, an empty list for those that no line has.

    None for a run that needs reading card by card: blanks between fields, labels, replication.
    """
    free, wide = run.key.endswith(","), run.key.rstrip(" ,").endswith("*")
    if (run.key.endswith(" ") and len(run.key) < 8) or run.name == "=" or (free and wide):
        return None
    each = 4 if wide else 8
    columns: dict[int, list[str]] = {k: [] for k in wanted}
    stop = run.first + run.count * run.length
    for k in range(run.length):
        lines = bulk.lines[run.first + k : stop : run.length]
        here = [c for c in wanted if k * each <= c < (k + 1) * each]
        if free:
            commas = lines[0].count(",")
            if commas > 8 or any(line.count(",") != commas or "$" in line for line in lines):
                return None
            flat = ",".join(lines).split(",")
            columns |= {c: flat[c % 8 + 1 :: commas + 1] for c in here if c % 8 < commas}
            continue
        if not _plain(lines, k, wide):
            return None
        size = 16 if wide else 8
        for c in here:
            start = 8 + size * (c % each)
            columns[c] = [line[start : start + size] for line in lines]
    return columns


def _plain(lines: list[str], k: int, wide: bool) -> bool:
    """Return whether the k-th lines of cards in fixed field have no labels, and all the form of the first."""
    if any(label.strip("+* ") for label in {line[72:80] for line in lines}):
        return False
    if k == 0:
        return True
    heads = {line[:8] for line in lines}
    return all(head[:1] in ("*" if wide else "+ ") and not head.strip("+* ") for head in heads)


def fields_of(bulk: BulkData, first: int, length: int) -> tuple[str, list[str]]:
    """Return name and fields of one card."""
    name, fields, tail = "", [], ""
    for k in range(first, first + length):
        head, values, label = _split(bulk, k)
        if k == first:
            name = head.rstrip("* ").upper()
        else:
            mine = head.strip("+* ")
            if mine and tail and mine != tail:
                msg = (
                    f"{bulk.place(k)}: the continuation line {head} follows a line that is continued "
                    f"with {tail}; write the lines of a card one after the other"
                )
                raise MeshError(msg)
            if len(fields) % 8 and len(values) == 8:  # half a card in large field, then small field
                fields += [""] * (8 - len(fields) % 8)
        fields += values
        tail = label
    return name, fields


def _split(bulk: BulkData, row: int) -> tuple[str, list[str], str]:
    """Return name or label, fields, and the label of the next line."""
    line = bulk.lines[row].split("$")[0].rstrip()
    key = _key(line) if line.strip() else ""
    if "," in line:
        cells = [cell.strip() for cell in line.split(",")]
    elif (
        (line[:1] == "=" and len(line) > 1 and line[1] in "(0123456789")
        or (key.endswith(" ") and len(key.strip()) and key != line[:8])
        or (line[:1] in "+*" and _between_blanks(line))
    ):
        cells = line.split()
    else:
        head = line[:8].strip()
        width, count = (16, 4) if head.endswith("*") or head.startswith("*") else (8, 8)
        padded = line.ljust(8 + width * count)
        fields = [padded[8 + width * k : 8 + width * (k + 1)].strip() for k in range(count)]
        return head, fields, line[8 + width * count : 80].strip("+* ")
    head = cells[0]
    fields, label = _free_fields(cells[1:], 4 if head.endswith("*") or head.startswith("*") else 8)
    goes_on = row + 1 < len(bulk.lines) and _key(bulk.lines[row + 1]) in "+* "
    is_label = _LABEL.fullmatch(label)
    if label and not is_label and not goes_on:
        # MSC Nastran goes on by itself where a line in free field is too long
        return head, [*fields, label, *[""] * 7][: len(fields) + 8], ""
    # a number, also one with a sign, is a label only where the next line has it
    if label and _is_number(label) and not (goes_on and _head(bulk.lines[row + 1]).strip("+* ")):
        plain = label.strip("+*")
        msg = (
            f"{bulk.place(row)}: '{label}' may be a value or the label of the continuation line after "
            f"it; write +{plain} at both places if it is the label, or a line for each eight values"
        )
        raise MeshError(msg)
    return head, fields, label.strip("+* ")


def _free_fields(values: list[str], count: int) -> tuple[list[str], str]:
    """Return the values of a line in free field, and what comes after the last ``count`` of them.

    Values beyond the first ``count`` are those of a continuation line, but a label in between, as ``+`` or
    ``+ABC``. One that comes last, after ``count`` others, may be a label or a value.
    """
    stop = max((k + 1 for k, value in enumerate(values) if value), default=0)
    fields, k = [], 0
    while stop - k > count:
        fields += values[k : k + count]
        k += count
        if stop - k == 1:
            return fields, values[k]
        k += bool(_LABEL.fullmatch(values[k]))
    return [*fields, *values[k:stop], *[""] * (count - (stop - k))], ""


def _is_number(text: str) -> bool:
    try:
        real(text)
    except ValueError:
        return False
    return True


def each_card(bulk: BulkData) -> Iterator[tuple[str, list[str], int]]:
    """Yield name, fields and first row of each card, repeated ones written out."""
    replicator = Replicator(DeckBudget())
    for run in runs_of(bulk):
        for first in range(run.first, run.first + run.count * run.length, run.length):
            name, fields = fields_of(bulk, first, run.length)
            for one, values in replicator.cards(name, fields, run.length, lambda row=first: bulk.place(row)):
                yield one, values, first


def real(text: str) -> float:
    """Return a finite number, also one such as ``1.5-3`` for 1.5e-3; nothing is zero.

    Raises
    ------
    ValueError
        If the text is something else, or too large.
    """
    plain = text.strip().upper().replace("D", "E")
    return plain_real(_EXPONENT.sub(r"E\1", plain) if "E" not in plain and _EXPONENT.search(plain) else text)


@dataclass(slots=True)
class Replicator:
    """Write out cards that repeat the one before them: ``=``, ``==``, ``*(step)`` and ``=(count)``.

    Attributes
    ----------
    before : name and fields of the card before, None if it cannot be repeated
    """

    budget: DeckBudget
    before: tuple[str, list[str]] | None = None
    _pattern: list[str] | None = None

    def cards(
        self, name: str, fields: list[str], length: int, place: Callable[[], str]
    ) -> list[tuple[str, list[str]]]:
        """Return the cards that a line stands for; most are just themselves."""
        if not name.startswith("=") and not any(f[:1] in "=*" for f in fields if f):
            self.before = (name, fields) if length == 1 else None
            self._pattern = None
            return [(name, fields)]
        if self.before is None or length > 1:
            msg = f"{place()}: {name} repeats a card that is not there or has several lines; write it out"
            raise MeshError(msg)
        repeat = _REPEAT.fullmatch(name)
        if repeat and not any(fields):
            if self._pattern is None:
                msg = f"{place()}: {name} repeats no line with steps; write one such as =,*(1),== before it"
                raise MeshError(msg)
            count = integer(repeat.group(1))
        elif name == "=" or name == self.before[0]:
            self._pattern, count = fields, 1
        else:
            raise error_at(place(), f"{name[:20]} takes fields of a {self.before[0]} card, which is another")
        self.budget.take(count, place(), name)
        found = []
        for _ in range(count):
            self.before = (self.before[0], _repeated(self.before[1], self._pattern, place()))
            found.append(self.before)
        return found


def _repeated(before: list[str], pattern: list[str], place: str) -> list[str]:
    fields: list[str] = []
    for k, cell in enumerate(pattern):
        old = before[k] if k < len(before) else ""
        if cell == "==":
            return [*fields, *before[k:]]
        step = _INCREMENT.fullmatch(cell)
        if cell == "=":
            fields.append(old)
        elif step:
            fields.append(_stepped(old, step.group(1).strip(), place))
        else:
            fields.append(cell)
    return fields


def _stepped(old: str, step: str, place: str) -> str:
    try:
        try:
            return str(integer(old) + integer(step))
        except ValueError:
            if not old:
                raise
            return repr(real(old) + real(step))
    except ValueError as reason:
        msg = f"{place}: the field '{old[:20]}' cannot be continued in steps of '{step[:20]}'"
        raise MeshError(msg) from reason
