"""Readers of numbers on the command line."""

import argparse
from collections.abc import Callable


def whole_up_to(most: int, least: int = 1) -> Callable[[str], int]:
    """Return a reader of whole numbers up to a bound: more is a slip, and would take all memory."""

    def read(text: str) -> int:
        value = int(text) if text.isdecimal() and len(text) < 20 else -1
        if not least <= value <= most:
            msg = f"'{text}' is not allowed; a whole number from {least} to {most} is needed"
            raise argparse.ArgumentTypeError(msg)
        return value

    return read


def count(text: str) -> int:
    """Read a whole number of at least 1."""
    value = int(text) if text.isdecimal() and len(text) < 20 else 0
    if value < 1:
        msg = f"'{text}' is not allowed; a whole number of at least 1 is needed"
        raise argparse.ArgumentTypeError(msg)
    return value


def whole(text: str) -> int:
    """Read a whole number of at least 0."""
    if not text.isdecimal() or len(text) > 1000:
        msg = f"'{text}' is not allowed; a whole number of at least 0 is needed"
        raise argparse.ArgumentTypeError(msg)
    return int(text)


def not_negative(text: str) -> float:
    """Read a number of at least 0."""
    return 0.0 if text.strip() in ("0", "0.0") else positive(text)


def number_up_to(most: float) -> Callable[[str], float]:
    """Return a reader of numbers from 0 to the given one."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = -1.0
        if not 0 <= value <= most:
            msg = f"'{text}' is not allowed; a number from 0 to {most:g} is needed"
            raise argparse.ArgumentTypeError(msg)
        return value

    return read


def positive(text: str) -> float:
    """Read a positive number."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        msg = f"'{text}' is not allowed; a positive number is needed"
        raise argparse.ArgumentTypeError(msg)
    return value
