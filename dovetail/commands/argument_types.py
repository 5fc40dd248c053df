"""Readers of numbers on the command line."""

import argparse
import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from dovetail.file.settings import N_BANDS
from fem.model import DIRECTIONS

N = TypeVar("N", int, float)


def _read(text: str, convert: Callable[[str], N], is_allowed: Callable[[N], bool], needed: str) -> N:
    """Read a number; refuse what is none, or not allowed, with the words of what is needed."""
    with suppress(ValueError):
        value = convert(text)
        if is_allowed(value):
            return value
    msg = f"'{text}' is not allowed; {needed} is needed"
    raise argparse.ArgumentTypeError(msg)


def _whole(text: str, most_digits: int = 19) -> int:
    """Read a whole number in digits alone; Python's own reader would take ``1_000`` and ``+1``."""
    if not text.isdecimal() or len(text) > most_digits:
        raise ValueError(text)
    return int(text)


def integer_up_to(most: int, least: int = 1) -> Callable[[str], int]:
    """Return a reader of whole numbers up to a bound: more is a slip, and would take all memory."""
    needed = f"a whole number from {least} to {most}"
    return lambda text: _read(text, _whole, lambda n: least <= n <= most, needed)


def add_number(p: argparse.ArgumentParser, words: str, most: int, default: int | None = None) -> None:
    """Add how many are asked for, at most so many; the default follows the words."""
    shown = words if default is None else f"{words} (default {default})"
    p.add_argument("--number", type=integer_up_to(most), default=default, metavar="N", help=shown)


def add_report_folder(p: argparse.ArgumentParser, files: str) -> None:
    """Add the folder of a report with some files, and whether it may hold other ones."""
    words = f"folder for {files}"
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help=words)
    p.add_argument("--force", action="store_true", help="write into a folder that holds other files")


def add_processes(p: argparse.ArgumentParser) -> None:
    """Add the number of processes that fit side by side; all processors unless given."""
    p.add_argument(
        "--processes",
        type=integer_up_to(1000),
        metavar="P",
        help="processes that fit side by side (default: as many as there are processors)",
    )


def add_pool(p: argparse.ArgumentParser, units: str) -> None:
    """Add the choice of workers: processes of this machine, or those of a running Dask cluster."""
    p.add_argument(
        "--processes",
        type=integer_up_to(1000),
        metavar="P",
        help=f"{units} at a time on this machine (default 1)",
    )
    p.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help=f"compute {units} on a running Dask cluster: tcp://host:8786, or its scheduler file .json",
    )


def add_bands(p: argparse.ArgumentParser) -> None:
    """Add the number of frequency bands."""
    words = f"number of equal frequency bands (default {N_BANDS})"
    p.add_argument("--bands", type=integer_up_to(1000), default=N_BANDS, metavar="N", help=words)


def add_kind(p: argparse.ArgumentParser) -> None:
    """Add the kind of FRFs that are computed."""
    words = "kind of FRF (default: that of the measurement, or accelerance)"
    p.add_argument("--kind", choices=["receptance", "mobility", "accelerance"], help=words)


def add_placing(p: argparse.ArgumentParser, where: str) -> None:
    """Add the options of placing a test's geometry on a mesh or a model."""
    words = f"largest distance of a test's point from the {where} [m] (default 0.01)"
    p.add_argument("--tolerance", type=positive, default=0.01, metavar="M", help=words)
    p.add_argument(
        "--geometry-unit",
        dest="unit",
        choices=["m", "mm", "cm", "in", "ft"],
        help="of the test's points (default: found)",
    )
    p.add_argument(
        "--same-axes", action="store_true", help=f"the test's points are in the {where}'s axes and origin"
    )
    words = "where the points fit the structure in several ways, the one that the message numbers K"
    p.add_argument("--alternative", type=int, metavar="K", help=words)


def count(text: str) -> int:
    """Read a whole number of at least 1."""
    return _read(text, _whole, lambda n: n >= 1, "a whole number of at least 1")


def natural(text: str) -> int:
    """Read a whole number of at least 0."""
    return _read(text, partial(_whole, most_digits=1000), lambda n: True, "a whole number of at least 0")


def not_negative(text: str) -> float:
    """Read a number of at least 0."""
    return 0.0 if text.strip() in ("0", "0.0") else positive(text)


def number_up_to(most: float) -> Callable[[str], float]:
    """Return a reader of numbers from 0 to the given one."""
    return lambda text: _read(text, float, lambda x: 0 <= x <= most, f"a number from 0 to {most:g}")


def positive(text: str) -> float:
    """Read a positive number."""
    return _read(text, float, lambda x: 0 < x < math.inf, "a positive number")


def share(text: str) -> float:
    """Read a share: below 1, or in per cent with the sign for it."""
    number, sign, rest = text.strip().partition("%")
    value = math.nan
    with suppress(argparse.ArgumentTypeError):
        value = positive(number.strip()) / (100 if sign else 1)
    if rest or not value < 1:
        hint = f"; if {value:g} per cent is meant, write {value:g}%" if value >= 1 and not sign else ""
        msg = f"'{text}' is not allowed; a share is needed, such as 1% or 0.01{hint}"
        raise argparse.ArgumentTypeError(msg)
    return value


def finite(text: str) -> float:
    """Read a finite number of either sign."""
    return _read(text, float, math.isfinite, "a number")


def speed_range(text: str) -> tuple[float, float, int]:
    """Read ``FIRST:LAST:NUMBER``: a range of speeds from 0 on, and how many there are."""
    parts = text.split(":")
    try:
        first, last, number = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        first, last, number = 0.0, 0.0, 0
    if len(parts) != 3 or not 0 <= first < last < float("inf") or not 2 <= number <= 2000:
        msg = (
            f"'{text}' is not allowed; FIRST:LAST:NUMBER is needed, such as 0:30000:51, speeds that rise "
            "from 0 or more, 2 to 2000 of them"
        )
        raise argparse.ArgumentTypeError(msg)
    return first, last, number


def motion_at(text: str) -> tuple[str, str, float]:
    """Read ``PLACE:DIRECTION=VALUE``: a motion of a place in a direction."""
    where, equals, number = text.rpartition("=")
    place, _, direction = where.rpartition(":")
    if not (equals and place and direction in DIRECTIONS):
        msg = (
            f"'{text}' is not allowed; PLACE:DIRECTION=VALUE is needed, such as B:x=0.01, and directions are "
            + ", ".join(DIRECTIONS)
        )
        raise argparse.ArgumentTypeError(msg)
    return place, direction, finite(number)


def values_by_name(text: str) -> dict[str, float]:
    """Read values of parameters, ``mass=0.45,position=0.12``."""
    values: dict[str, float] = {}
    for part in text.split(","):
        name, equals, number = (word.strip() for word in part.partition("="))
        if not equals or not name:
            msg = f"'{part.strip()}' is not allowed; NAME=NUMBER is needed, several separated by commas"
            raise argparse.ArgumentTypeError(msg)
        if name in values:
            msg = f"'{name}' is given twice"
            raise argparse.ArgumentTypeError(msg)
        try:
            values[name] = float(number)
        except ValueError:
            msg = f"{name} is '{number}'; a number is needed"
            raise argparse.ArgumentTypeError(msg) from None
    return values


class AddEffect(argparse.Action):
    """Begins another effect, with no values yet: the list of (name, values) in ``added``."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: str | None = None) -> None:
        """Append the name of a candidate."""
        namespace.added = [*namespace.added, (values, {})]


class SetValues(argparse.Action):
    """Gives values to the effect before it."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: str | None = None) -> None:
        """Add values to the last effect; they stand behind the effect whose they are."""
        if not namespace.added:
            parser.error(f"argument {option_string}: it stands behind the --add whose values it gives")
        *before, (name, known) = namespace.added
        twice = sorted(set(known) & set(values))
        if twice:
            parser.error(f"argument {option_string}: '{twice[0]}' of '{name}' is given twice")
        namespace.added = [*before, (name, known | values)]
