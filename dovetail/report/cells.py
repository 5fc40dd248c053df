"""Numbers in the cells of a report's tables."""

import math

from dovetail.report import words
from dovetail.report.page import Markup, join, tag
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


def db(value: float) -> str:
    """Return an error with two decimals, a dash where there is none."""
    return f"{value:.2f}" if math.isfinite(value) else "–"


def number(value: float, digits: int) -> str:
    """Return a number with so many significant digits, a dash where there is none."""
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


def tagged(r: Ranked, what: str) -> Markup:
    """Return a candidate in words, with a tag."""
    return join([words.ranked_label(r), " ", tag("span", what, class_="tag") if what else ""])


def errors(r: Ranked) -> list[str]:
    """Return a candidate's residual level and errors."""
    return [db(r.level * DB_PER_NEPER), db(r.fit_db), db(r.held_out_db)]
