"""Blocks of ANSYS archives: rows of numbers after NBLOCK, EBLOCK, RLBLOCK, ETBLOCK and CMBLOCK."""

import re
from collections.abc import Callable, Iterator, Sequence

from fem.io.ansys_script import Command
from fem.io.ansys_state import AnsysState
from fem.io.deck import integer, real

_DIGITS = tuple("+-.0123456789")


def _widths(text: str) -> tuple[list[int], int]:
    """Return the columns' widths of a Fortran format such as (3i9,6e21.13e3), and how many are integers."""
    widths, n_integers = [], 0
    for count, kind, width in re.findall(r"(\d*)\s*([aeigdf])\s*(\d+)(?:\.\d+)?(?:e\d+)?", text.lower()):
        n = min(int(count or 1), 1000)
        widths += [int(width)] * n
        n_integers += n if kind in "ia" else 0
    return widths, n_integers


def _format(state: AnsysState, c: Command) -> tuple[list[int], int]:
    line = (state.script.peek() or "").strip()
    widths, n_integers = _widths(line) if line.startswith("(") else ([], 0)
    if not widths:
        text = f"{c.name.upper()} needs a format such as (19i9), found {line[:30]!r}"
        raise state.deck.error(state.script.line, text)
    state.script.at += 1
    return widths, n_integers


def _cut(line: str, widths: list[int]) -> list[str]:
    out, start = [], 0
    for width in widths:
        out.append(line[start : start + width].strip())
        start += width
    return out


def _rows(
    state: AnsysState, c: Command, widths: list[int], count: int | None = None, stated: int = 0
) -> Iterator[list[str]]:
    """Yield the rows of a block, cut as its format says, to -1 or for ``count`` rows.

    Without -1 a block may end with the file, if it has as many rows as it states.
    """
    name, script, taken = c.name.upper(), state.script, 0
    while count is None or taken < count:
        line = script.peek()
        if line is None:
            if stated and taken == stated:
                return
            raise state.deck.error(c.line, f"{name} has no end: the file ends after {taken} of its rows")
        first = line.strip()[:1]
        if first and first not in _DIGITS:
            if count is None and c.key == "NBLO":  # closed by N,R5.3,LOC,-1
                return
            of = f" of {count}" if count else ""
            text = f"{name} ends after {taken} rows{of} at {line.strip()[:30]!r}"
            raise state.deck.error(script.line, text)
        number = script.line
        script.at += 1
        if line.strip() == "-1":
            if count is not None:
                raise state.deck.error(number, f"{name} ends after {taken} rows of {count}")
            return
        cells = _cut(line, widths)
        taken += 1
        while cells and not cells[-1]:  # trailing zeros may be blank
            cells.pop()
        if cells:
            yield cells


def _numbers(
    state: AnsysState, c: Command, cells: Sequence[str], convert: Callable[[str], float]
) -> list[float]:
    out = []
    for k, text in enumerate(cells, start=1):
        try:
            out.append(convert(text or "0"))
        except ValueError as reason:
            line = state.script.rows[state.script.at - 1][0]
            raise state.deck.error(line, f"{c.name.upper()}, column {k}: {reason}") from reason
    return out


def _integers(state: AnsysState, c: Command, cells: Sequence[str]) -> list[int]:
    return [int(v) for v in _numbers(state, c, cells, integer)]


def _check_count(state: AnsysState, c: Command, found: int, k: int) -> None:
    stated = c.integer(k)
    if stated and stated != found:
        raise state.deck.error(c.line, f"{c.name.upper()} states {stated} rows, and has {found}")


def nblock(state: AnsysState, c: Command) -> None:
    """Read nodes: number, two more numbers with SOLID, x, y, z and angles."""
    widths, n_integers = _format(state, c)
    found = 0
    for row in _rows(state, c, widths):
        values = _numbers(state, c, row[n_integers:], real)
        state.add_node(_integers(state, c, row[:1])[0], [*values, *[0.0] * (6 - len(values))])
        found += 1
    _check_count(state, c, found, 3)


def eblock(state: AnsysState, c: Command) -> None:
    """Read elements: rows with attributes and nodes, those of SOLID continued."""
    widths, _ = _format(state, c)
    found, rest, row = 0, 0, list[int]()
    solid = c.text(1) == "SOLID"
    for cells in _rows(state, c, widths, stated=c.integer(3)):
        values = _integers(state, c, cells)
        row = [*row, *values] if rest else values
        n = row[8] if solid and len(row) > 10 else len(row) - 5
        rest = 11 + n - len(row) if solid else 0
        if rest > 0:
            continue
        found += 1
        rest = 0
        line = state.script.rows[state.script.at - 1][0]
        row += [0] * (5 - len(row))
        if solid:
            state.add_element(row[10], (row[1], row[0], row[2], row[3]), row[11 : 11 + n], line)
        else:
            attributes = (state.attributes["TYPE"], row[3], row[2], row[1])
            state.add_element(row[0], attributes, row[5:], line)
    if rest > 0:
        text = f"EBLOCK ends within an element: {rest} of its nodes are missing"
        raise state.deck.error(state.script.line, text)
    _check_count(state, c, found, 3)


def rlblock(state: AnsysState, c: Command) -> None:
    """Read sets of real constants: number and count, then their values over several rows."""
    first, more = _format(state, c)[0], _format(state, c)[0]

    def cells(widths: list[int]) -> list[str]:
        line = state.script.peek() or "end of file"
        if line.strip()[:1] not in _DIGITS:
            text = f"{c.name.upper()} is cut: found {line.strip()[:30]!r} within a set"
            raise state.deck.error(state.script.line, text)
        state.script.at += 1
        return _cut(line, widths)

    for _ in range(c.integer(0)):
        row = [*cells(first), "", ""]
        number, count = _integers(state, c, row[:2])
        values = row[2:-2]
        while len(values) < count:
            values += cells(more)
        reals = _numbers(state, c, values[: max(count, 0)], real)
        state.deck.reals[number] = dict(enumerate(reals, start=1))


def etblock(state: AnsysState, c: Command) -> None:
    """Read element types: number, the number in the name, options."""
    widths, _ = _format(state, c)
    for row in _rows(state, c, widths):
        number, kind, *options = [*_integers(state, c, row), 0][: max(len(row), 2)]
        state.add_type(number, kind, options, c.line)


def cmblock(state: AnsysState, c: Command) -> None:
    """Read a component: numbers, where a negative one ends a range."""
    widths, _ = _format(state, c)
    rows = -(-c.integer(2) // max(len(widths), 1))
    items: list[int] = []
    for row in _rows(state, c, widths, max(rows, 0)):
        for value in _integers(state, c, row):
            if value < 0:
                place = f"{state.deck.file}: line {state.script.rows[state.script.at - 1][0]}"
                state.budget.take(
                    max(0, -value - (items[-1] if items else 0)), place, "the range of a component"
                )
            items += [value] if value >= 0 else range(items[-1] + 1 if items else 1, -value + 1)
    state.add_component(c.raw(0), c.text(1)[:4], items)
