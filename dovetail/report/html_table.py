"""Tables in HTML for notebooks; names from files stay text."""

from collections.abc import Iterable, Sequence
from html import escape
from itertools import islice

_MOST_ROWS = 60
"""Rows that a notebook shows; the rest is counted."""


def table(head: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "") -> str:
    """Return a table with a caption; every cell is escaped, and rows beyond the first 60 are counted."""
    rows = list(rows)
    cells = ([f'<td style="text-align:left">{escape(str(text))}</td>' for text in row] for row in rows)
    shown = "".join(f"<tr>{''.join(row)}</tr>" for row in islice(cells, _MOST_ROWS))
    if len(rows) > _MOST_ROWS:
        shown += f'<tr><td colspan="{len(head)}">… and {len(rows) - _MOST_ROWS} more</td></tr>'
    columns = "".join(f'<th scope="col" style="text-align:left">{escape(word)}</th>' for word in head)
    above = f'<caption style="text-align:left">{escape(caption)}</caption>' if caption else ""
    return f"<table>{above}<thead><tr>{columns}</tr></thead><tbody>{shown}</tbody></table>"


def number(value: float, digits: int = 2) -> str:
    """Return a number with the given decimals, an en dash where there is none."""
    return f"{value:.{digits}f}" if value == value else "–"


def inner(shown: object) -> str:
    """Return the short text of an object without its class and the angle brackets."""
    return repr(shown).removeprefix("<").removesuffix(">").partition(" ")[2]
