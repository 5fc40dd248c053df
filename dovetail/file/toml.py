"""TOML texts with other values in them: comments, order and spelling of all else stay."""

import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dovetail.file.lines import Path, places_of
from dovetail.file.table import LEAST

_BARE = re.compile(r"[A-Za-z0-9_-]+")
FITTED_DIGITS = 7
"""Of fitted values in a study: a relative error of 5e-7 moves a resonance by less than any test resolves."""
ROUNDING = 1e-12
"""Of a quantity's usual size: rounding leaves less of a zero [-]."""
CONVERTED_DIGITS = 12
"""Of values in other units: conversions err by a few units of the sixteenth digit."""


def toml_value(value: Any) -> str:
    """Return a value as TOML writes it: texts escaped, numbers such that the same are read again."""
    if isinstance(value, str):
        # JSON leaves DEL as it is, which TOML does not allow
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, int | np.integer):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return _number(float(value))
    if isinstance(value, Mapping):
        inner = ", ".join(f"{toml_key(str(k))} = {toml_value(v)}" for k, v in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, Sequence):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    return str(value)  # dates and times


def _number(value: float) -> str:
    """Return a number such that the same is read again, a large one as 206.8e9 where that is shorter."""
    text = repr(value)
    exponent = 3 * int(np.log10(abs(value)) // 3) if 1e6 <= abs(value) < np.inf else 0
    prefixed = f"{value / 10.0**exponent:.12g}e{exponent}" if exponent else text
    return prefixed if float(prefixed) == value and len(prefixed) <= len(text) else text


def rounded(value: Any, digits: int | None = None) -> Any:
    """Return a value whose numbers have some significant digits, those of fits, also in tables and lists."""
    digits = FITTED_DIGITS if digits is None else digits
    if isinstance(value, Mapping):
        return {key: rounded(v, digits) for key, v in value.items()}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [rounded(v, digits) for v in value]
    return float(f"{value:.{digits}g}") if isinstance(value, float | np.floating) else value


def rounded_or_zero(value: float, size: float = 0.0) -> float:
    """Return a fitted value as :func:`rounded` does, 0 for what rounding leaves of it beside a usual size.

    Without a size, 0 is what no quantity is.
    """
    return 0.0 if abs(value) < max(LEAST, ROUNDING * size) else rounded(value)


def toml_key(key: str) -> str:
    """Return a key as TOML writes it, in quotes where it needs them."""
    return key if _BARE.fullmatch(key) else toml_value(key)


def toml_comment(text: str) -> str:
    """Return a text as a comment, whatever characters are in it."""
    clean = "".join(c if c == "\t" or c.isprintable() else " " for c in text)
    return f"# {clean}"


def toml_table(header: str, values: Mapping[str, Any]) -> str:
    """Return a table with its header, such as ``[[effects]]``, a key on each line."""
    return "\n".join([header, *(f"{toml_key(k)} = {toml_value(v)}" for k, v in values.items())]) + "\n"


def with_values(text: str, changes: Mapping[Path, Any]) -> str:
    """Return a TOML text with other values at some places.

    Present values are replaced; a missing key is put first into its table, which is made if need be. Where
    the text writes the table in a way that has no room for a key (dotted keys), a ValueError says so.

    Parameters
    ----------
    text : str
        Valid TOML.
    changes : mapping of Path to value

    Raises
    ------
    ValueError
        If a place cannot be written to.
    """
    places = places_of(text)
    splices: list[tuple[int, int, str]] = []
    more: dict[Path, dict[str, Any]] = {}
    for path, value in changes.items():
        if path in places.values:
            splices.append((*places.values[path], toml_value(value)))
        else:
            more.setdefault(path[:-1], {})[str(path[-1])] = value
    end = ""
    for table, values in more.items():
        if table in places.headers:
            at = places.headers[table][1]
            lines = "".join(f"\n{toml_key(k)} = {toml_value(v)}" for k, v in values.items())
            line_end = text.find("\n", at)
            at = len(text) if line_end < 0 else line_end - (text[line_end - 1] == "\r")
            splices.append((at, at, lines))
        elif table in places.values and text[places.values[table][0]] == "{":
            first, last = places.values[table]
            inner = ", ".join(f"{toml_key(k)} = {toml_value(v)}" for k, v in values.items())
            empty = not text[first + 1 : last - 1].strip()
            splices.append((first + 1, first + 1, f" {inner} " if empty else f" {inner},"))
        elif len(table) == 1 and table[0] not in tomllib.loads(text):
            end += "\n" + toml_table(f"[{toml_key(str(table[0]))}]", values)
        else:
            msg = f"{'.'.join(map(str, table))} takes no new key in this form; write it as a [table]"
            raise ValueError(msg)
    for first, last, new in sorted(splices, key=lambda s: s[:2], reverse=True):
        text = text[:first] + new + text[last:]
    return text.rstrip("\n") + "\n" + end if end else text


def with_comments(text: str, comments: Mapping[Path, str]) -> str:
    """Return a TOML text with comments behind pairs that end their line and have none."""
    places = places_of(text)
    ends = {places.pairs[path][1]: comment for path, comment in comments.items() if path in places.pairs}
    for at, comment in sorted(ends.items(), reverse=True):
        line_end = text.find("\n", at) if "\n" in text[at:] else len(text)
        if not text[at:line_end].strip():
            text = f"{text[:at]}  {toml_comment(comment)}{text[at:]}"
    return text


def without(text: str, *paths: Path) -> str:
    """Return a TOML text in which some keys, and tables of their own, have become comments.

    Keys within an inline table are taken out of it instead.
    """
    for path in paths:
        places = places_of(text)
        if path in places.pairs:
            first, last = places.pairs[path]
            start, stop = _full_lines(text, first, last)
            if start is None:
                text = _cut(text, first, last)
                continue
        elif path in places.headers:
            first = places.headers[path][0]
            later = [a for p, (a, _) in places.headers.items() if a > first and p[: len(path)] != path]
            start, stop = first, min(later, default=len(text))
            stop = start + len(text[start:stop].rstrip())
        else:
            continue
        block = text[start:stop].splitlines()
        text = text[:start] + "\n".join(f"# {line}" for line in block) + text[stop:]
    return text


def _full_lines(text: str, first: int, last: int) -> tuple[int | None, int]:
    """Return the lines that a pair alone is on; None for a pair inside an inline table."""
    start = text.rfind("\n", 0, first) + 1
    stop = text.find("\n", last)
    stop = len(text) if stop < 0 else stop
    rest = text[last:stop].strip()
    alone = not text[start:first].strip() and (not rest or rest.startswith("#"))
    return (start if alone else None), stop


def _cut(text: str, first: int, last: int) -> str:
    """Return a text without a pair of an inline table, and without the comma that it had."""
    before, after = text[:first], text[last:]
    if after.lstrip().startswith(","):
        return before + after.lstrip()[1:].lstrip()
    stripped = before.rstrip()
    return (stripped[:-1].rstrip() if stripped.endswith(",") else before) + after
