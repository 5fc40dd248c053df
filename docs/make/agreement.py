"""Whether a generated text agrees with the committed one: the same words, and numbers within a tolerance."""

import re
from math import isclose

RTOL = 0.02
"""Largest relative difference of two numbers: rounding differs between processors, and fits end elsewhere."""

MASKED = re.compile(r"\bin \d+(?:\.\d+)? (?:CPU )?s\b|\b[Dd]ovetail \d+\.\S+")
"""Times of a run, and versions."""

NUMBER = re.compile(r"(?<![\w.])[-−+]?\d+(?:\.\d+)?(?:e[-+]?\d{1,3})?(?:\s?%)?(?!\w)")
"""Not within a name, such as columns.1 or 1X+."""

LAYOUT = re.compile(r"\s+|[-─]{3,}")
"""Spaces and rules, which follow the widths of the numbers beside them."""


def agrees(old: str, new: str) -> bool:
    """Return whether two texts have the same words, and numbers within `RTOL` or one unit of the last digit.

    A count, which has neither decimals nor a percent sign, has no such unit.
    """
    old, new = (LAYOUT.sub(" ", MASKED.sub("", text)) for text in (old, new))
    if NUMBER.split(old) != NUMBER.split(new):
        return False
    return all(map(_near, NUMBER.findall(old), NUMBER.findall(new)))


def _near(one: str, other: str) -> bool:
    a, b = (float(word.rstrip(" %").replace("−", "-")) for word in (one, other))
    return isclose(a, b, rel_tol=RTOL, abs_tol=1.001 * min(_last_digit(one), _last_digit(other)))


def _last_digit(word: str) -> float:
    """Return one unit of the last digit of a number; 0 for a count."""
    mantissa, _, exponent = word.rstrip(" %").partition("e")
    if not exponent and "." not in mantissa and "%" not in word:
        return 0.0
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
