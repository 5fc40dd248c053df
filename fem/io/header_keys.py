"""Headers of keys and values above columns of FRFs, as LMS Testlab writes them, in any order of their rows.

A row has a key in its first cell and a value above the first column of each function, as ``DOF id`` and
``Point:3:-Z``.
Functions stand side by side over one column of frequencies, or each in a block with keys and frequencies of
its own.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fem.analysis.frf import FRFKind
from fem.io.arrays import TableError
from fem.io.columns import Columns
from fem.io.faults import error_at
from fem.io.uff_format import label_of

_KEYS: Mapping[str, str] = {
    "x axis unit": "x unit",
    "x unit": "x unit",
    "y axis unit": "y unit",
    "y unit": "y unit",
    "x axis quantity": "x quantity",
    "y axis quantity": "y quantity",
    "value type": "values",
    "format": "values",
    "function class": "class",
    "function type": "class",
    "dof id": "response",
    "response dof id": "response",
    "point id": "response point",
    "point direction": "response direction",
    "reference dof id": "force",
    "reference point id": "force point",
    "reference point direction": "force direction",
    "number of averages": "averages",
}
"""Meaning of the keys that are read."""


_QUANTITIES = {
    ("acceleration", "force"): FRFKind.ACCELERANCE,
    ("velocity", "force"): FRFKind.MOBILITY,
    ("displacement", "force"): FRFKind.RECEPTANCE,
}
_DOF = re.compile(
    r"(?:(?P<part>.*?):)?(?P<point>[^:]+):(?P<sign>[+-]?)(?P<turn>R?)(?P<axis>[XYZ])(?P<after>[+-]?)"
)
_LEAST_DEGREES, _MOST_DEGREES = 20.0, 360.5
"""Range of the largest of some numbers that may be phases in degrees."""
_PART_WORDS = {"amplitude", "magnitude", "modulus", "phase"}


@dataclass(frozen=True, slots=True)
class Described:
    """A column as keys describe it.

    Attributes
    ----------
    part : str
        ``"frequency"``, ``"real"``, ``"imag"``, ``"magnitude"``, ``"phase"``, ``"coherence"``, ``"complex"``,
        or ``"other"`` of a function that is no FRF.
    unit : str
    pair : tuple of str or None
        Response and force.
    names : tuple of str
        What the file calls its function and its values.
    assumption : str
        Of the part, where no heading tells it.
    """

    part: str
    unit: str = ""
    pair: tuple[str, str] | None = None
    names: tuple[str, ...] = ()
    assumption: str = ""


@dataclass(frozen=True, slots=True)
class KeyedHeader:
    """Columns as the keys of a header describe them.

    Attributes
    ----------
    columns : tuple of Described
    kind : FRFKind or None
        By the quantities.
    averages : int or None
    notes : tuple of str
    """

    columns: tuple[Described, ...]
    kind: FRFKind | None = None
    averages: int | None = None
    notes: tuple[str, ...] = ()


@dataclass(slots=True)
class _Function:
    """Keys of a function, and the columns of its values."""

    values: dict[str, str] = field(default_factory=dict)
    columns: list[int] = field(default_factory=list)


def keyed_header(table: Columns) -> KeyedHeader | None:
    """Return what the keys of a header say of each column; None for another header.

    Raises
    ------
    TableError
        For functions without a frequency, keys that contradict each other, and a count of columns that does
        not fit the values.
    """
    rows = [row for row in table.rows if _key(row[0])]
    # Keys from which a header is one of keys; headings of columns may hold a single one
    if len({_key(row[0]) for row in rows}) < 3:
        return None
    frequencies = sorted({0, *(at for row in rows for at, cell in enumerate(row) if _key(cell))})
    functions = _functions(rows, frequencies, table.width)
    columns = [Described("frequency")] * table.width
    parts = [_described(table, function) for function in functions]
    for function, found in zip(functions, parts, strict=True):
        for at, one in zip(function.columns, found, strict=True):
            columns[at] = one
    for at in frequencies:
        unit = next((f.values["x unit"] for f in functions if f.values.get("x unit")), "")
        columns[at] = Described("frequency", unit)
    kinds = {k for f in functions if (k := _kind(f.values.get("y quantity", ""))) is not None}
    if len(kinds) > 1:
        listed = ", ".join(sorted(kinds))
        msg = f"its functions are {listed} by their quantities; FRFs of one kind are needed"
        raise error_at(table.name, msg, TableError)
    counts = {n for f in functions if (n := f.values.get("averages", "")).isdecimal() and len(n) < 10}
    others = [f for f, found in zip(functions, parts, strict=True) if found[0].part == "other"]
    notes = [f"the function {_name(f)} is no FRF ({f.values.get('class', '')}) and left out" for f in others]
    if len(others) == len(functions):
        msg = f"it has no FRF: its functions are {', '.join(f.values['class'] for f in others[:4])}"
        raise error_at(table.name, msg, TableError)
    averages = int(counts.pop()) if len(counts) == 1 else None
    return KeyedHeader(tuple(columns), next(iter(kinds), None), averages, tuple(notes))


def _key(cell: str) -> str:
    """Return the meaning of a key; nothing for another cell."""
    return _KEYS.get(" ".join(cell.replace("-", " ").replace("_", " ").rstrip(" :").lower().split()), "")


def _functions(rows: Sequence[Sequence[str]], frequencies: Sequence[int], width: int) -> list[_Function]:
    """Return the functions of a header: a value belongs to the columns up to the next one of its row."""
    values = [at for at in range(width) if at not in frequencies]
    described: dict[int, dict[str, str]] = {at: {} for at in values}
    for block, start in enumerate(frequencies):
        end = frequencies[block + 1] if block + 1 < len(frequencies) else width
        for row in rows:
            cell, key = "", _key(row[start]) or _key(row[0])
            for at in range(start + 1, end):
                cell = row[at] or cell
                described[at][key] = described[at].get(key) or cell
    starts = {at for row in rows for at in values if row[at]}
    every = starts.issuperset(values)  # then the columns of one function are those with the same keys
    out: list[_Function] = []
    for at in values:
        new = not out or at - 1 != out[-1].columns[-1] or len(out[-1].columns) == 2
        if new or (at in starts and not every) or not _same(described[at], out[-1].values):
            out.append(_Function(described[at], [at]))
        else:
            out[-1].columns.append(at)
    return out


def _same(one: Mapping[str, str], other: Mapping[str, str]) -> bool:
    keys = ("response", "response point", "force", "force point", "class")
    return all(one.get(key) == other.get(key) for key in keys)


def _described(table: Columns, function: _Function) -> list[Described]:
    """Return the columns of a function.

    Its two columns are real and imaginary part, of which the first has both signs across a resonance, except
    that of a driving point's mobility. Amplitudes are never negative, and phases in degrees reach far.
    """
    values, at = function.values, function.columns
    of_class, kind = values.get("class", ""), values.get("values", "")
    unit, names = values.get("y unit", ""), (_name(function), kind)
    pair = _pair(values)
    word = of_class.lower()
    if "coherence" in word:
        return [Described("coherence", "", pair, names), *(Described("other") for _ in at[1:])]
    if word and not any(known in word for known in ("frf", "frequency resp", "transfer")):
        return [Described("other", unit, pair, names) for _ in at]
    numbers = table.values[:, at]
    words = set(re.findall(r"[a-z]+", kind.lower()))
    if len(at) == 1:
        if "complex" in words and not numbers.imag.any():
            msg = (
                f"column {at[0] + 1} is the only one of {_name(function)}, which is complex; export its real "
                "and imaginary part, or amplitude and phase"
            )
            raise error_at(table.name, msg, TableError)
        return [Described("complex" if numbers.imag.any() else "magnitude", unit, pair, names)]
    largest = float(np.abs(numbers[:, 1]).max())
    signed = bool((numbers[:, 0].real < 0).any())
    polar = bool(words & _PART_WORDS) or (not signed and _LEAST_DEGREES < largest <= _MOST_DEGREES)
    assumption = ""
    if not (signed or words & _PART_WORDS):
        parts = "amplitude and phase [deg]" if polar else "real and imaginary part"
        other = "re-im" if polar else "magnitude-radians"
        assumption = (
            f"the columns of {_name(function)} are taken for {parts}, which the file does not say; form = "
            f'"{other}" takes them otherwise'
        )
    first, second = ("magnitude", "phase") if polar else ("real", "imag")
    return [
        Described(first, unit, pair, names),
        Described(second, "" if polar else unit, pair, names, assumption),
    ]


def _name(function: _Function) -> str:
    values = function.values
    pair = "/".join(filter(None, (values.get("response", ""), values.get("force", ""))))
    return pair or f"column {function.columns[0] + 1}"


def _pair(values: Mapping[str, str]) -> tuple[str, str] | None:
    ends = [_dof(values, end) for end in ("response", "force")]
    return (ends[0], ends[1]) if all(ends) else None


def _dof(values: Mapping[str, str], end: str) -> str:
    """Return the label of a degree of freedom: ``3Z-`` of Point:3:-Z, other names as they are."""
    point, direction = values.get(f"{end} point", ""), values.get(f"{end} direction", "")
    text = values.get(end, "") or (f"{point}:{direction}" if point and direction else point)
    found = _DOF.fullmatch(text.strip())
    if found is None or (found["sign"] and found["after"]):
        return text
    direction = "XYZ".index(found["axis"]) + 1 + (3 if found["turn"] else 0)
    sense = -1 if "-" in (found["sign"], found["after"]) else 1
    if found["point"].isdecimal() and (found["part"] or "point").lower() == "point":
        return label_of(int(found["point"]), sense * direction)
    return text


def _kind(quantity: str) -> FRFKind | None:
    over, _, under = re.sub(r"[^a-z/]", "", quantity.lower().replace("over", "/")).partition("/")
    return _QUANTITIES.get((over, under))
