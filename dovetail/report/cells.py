"""Numbers in the cells of a report's tables."""

import math
from collections.abc import Sequence

from dovetail.report import words
from dovetail.report.blocks import Line, ReportMark, TableBlock
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.findings import Ranked

RANKING = [
    "candidate",
    "value ± std",
    "level [dB]",
    "fitted lines [dB]",
    "held-out lines [dB]",
    "similarity [-]",
]
"""Headings of a table of candidates."""


def decimals(value: float, digits: int = 2) -> str:
    """Return a number with the given decimals, a dash where there is none."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "–"


def number(value: float, digits: int) -> str:
    """Return a number with the given significant digits, a dash where there is none."""
    return words.number(value, digits) if math.isfinite(value) else "–"


def percent(std: float, value: float) -> str:
    """Return a standard deviation in percent of its value."""
    if not value or not math.isfinite(std) or std <= 0:
        return "–"
    share = 100 * std / abs(value)
    return f"{share:.2g}" if share < 1000 else "> 1000"


def shift(before: float, after: float) -> str:
    """Return a change in percent, with its sign."""
    return (
        f"{100 * (after / before - 1):+.2f}".replace("-", "−")
        if math.isfinite(before) and min(before, after) > 0
        else "–"
    )


def ranking(known: Sequence[tuple[Ranked, str]], marked: Sequence[int]) -> TableBlock:
    """Return a table of candidates, each with a tag or an empty one."""
    values = [(r.level * DB_PER_NEPER, r.fit_db, r.held_out_db, r.similarity) for r, _ in known]
    digits = [words.digits_apart(first, column) for first, *column in zip(*values, strict=True)]
    rows: list[list[Line]] = []
    for (r, what), numbers in zip(known, values, strict=True):
        label = (words.ranked_label(r), " ", ReportMark(what) if what else "")
        cells = (decimals(x, n) for x, n in zip(numbers, digits, strict=True))
        rows.append([label, words.parameters_text(r.parameters), *cells])
    return TableBlock(RANKING, rows, numbers=(2, 3, 4, 5), marked=marked)
