"""Numbers in the cells of a report's tables."""

import math

from dovetail.report import words


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
    """Return a change in percent, with its sign; a dash where one of the two is not known."""
    if not (before > 0 and after > 0 and math.isfinite(before + after)):
        return "–"
    return f"{round(100 * (after / before - 1), 2) + 0.0:+.2f}".replace("-", "−")
