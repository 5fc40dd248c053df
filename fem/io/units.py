"""Units of quantities: labels such as ``(cm/s^2)^2/Hz`` or ``milliseconds``, and headings that have one."""

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

G0 = 9.80665
"""Standard gravity [m/s²]."""

POUND_FORCE = 4.4482216152605
"""[N]."""

_LENGTHS = {
    "m": 1.0,
    "meter": 1.0,
    "metre": 1.0,
    "km": 1e3,
    "dm": 0.1,
    "cm": 1e-2,
    "mm": 1e-3,
    "um": 1e-6,
    "µm": 1e-6,
    "μm": 1e-6,
    "micron": 1e-6,
    "microns": 1e-6,
    "nm": 1e-9,
    "in": 0.0254,
    "inch": 0.0254,
    "inches": 0.0254,
    "ft": 0.3048,
    "foot": 0.3048,
    "feet": 0.3048,
    "mil": 2.54e-5,
    "mils": 2.54e-5,
}
_STRAINS = {
    "%": 0.01,
    "strain": 1.0,
    "ε": 1.0,
    **dict.fromkeys(
        ("ue", "µe", "μe", "uε", "µε", "με", "ustrain", "µstrain", "μstrain", "microstrain"), 1e-6
    ),
}
_FORCES = {
    "n": 1.0,
    "newton": 1.0,
    "kn": 1e3,
    "mn": 1e-3,
    "dan": 10.0,
    "lbf": POUND_FORCE,
    "lb": POUND_FORCE,
    "lbs": POUND_FORCE,
    "pound": POUND_FORCE,
    "kip": 1e3 * POUND_FORCE,
    "ozf": POUND_FORCE / 16,
    "kgf": G0,
    "kp": G0,
    "gf": 1e-3 * G0,
    "dyn": 1e-5,
}

CAPITALS = {"MHz": 1e6, "mHz": 1e-3, "GHz": 1e9}
"""Frequencies in which capitals matter [Hz]."""

_TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}

TIME_NAMES = (
    "time",
    "t",
    "zeit",
    "temps",
    "times",
    "timestamp",
    "elapsed",
    "elapsedtime",
    "timeelapsed",
    "timevector",
    "timeaxis",
    "relativetime",
    "timerelative",
    "datetime",
)
"""Names of times in small letters, without blanks and underscores."""

Dimension = tuple[int, int, int, int]
"""Powers of force, length, time and angle."""

Size = tuple[float, Dimension]
"""Of a unit, in SI (N, m, s, rad)."""

Factor = tuple[float, Dimension, int]
"""Size, dimension and power of a symbol."""

NUMBER, FORCE, LENGTH, MOMENT = (0, 0, 0, 0), (1, 0, 0, 0), (0, 1, 0, 0), (1, 1, 0, 0)

_DIMENSIONS: tuple[tuple[dict[str, float], Dimension], ...] = (
    (_FORCES, FORCE),
    (_LENGTHS, LENGTH),
    ({"g": G0, "gs": G0, "gn": G0, "mg": 1e-3 * G0, "gal": 1e-2}, (0, 1, -2, 0)),
    (_TIMES, (0, 0, 1, 0)),
    ({"hz": 1.0, "khz": 1e3}, (0, 0, -1, 0)),
    ({"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180, "°": np.pi / 180}, (0, 0, 0, 1)),
    ({"kg": 1.0}, (1, -1, 2, 0)),
    (_STRAINS, NUMBER),
)
_CASES: dict[str, Size] = {
    "MN": (1e6, FORCE),
    "Nm": (1.0, MOMENT),  # in small letters nanometres
    **{label: (hertz, (0, 0, -1, 0)) for label, hertz in CAPITALS.items()},
}
"""Symbols in which capitals matter."""

_PREFIXES = {"": "", "nano": "n", "micro": "u", "milli": "m", "centi": "c", "deci": "d", "kilo": "k"}
_WORDS = {
    "second": "s",
    "sec": "s",
    "metre": "m",
    "meter": "m",
    "newton": "N",
    "hertz": "Hz",
    "radian": "rad",
}
_WORD = re.compile(
    rf"(?<![a-z])({'|'.join(_PREFIXES)[1:]})?\s*({'|'.join(_WORDS)})s?(?![a-z])", re.IGNORECASE
)
_SHORT_SECONDS = re.compile(r"(?<![a-z])([muµμn]?)secs?(?![a-z])", re.IGNORECASE)
_OTHER_WORDS = (
    (r"\bmillis\b", "ms"),
    (r"\bmicros\b", "us"),
    (r"\bdegrees?\b", "deg"),
    (r"\bminutes?\b", "min"),
    (r"\bhours?\b", "h"),
    (r"\bmps2\b", "m/s^2"),
    (r"\bmps\b", "m/s"),
    (r"\s+per\s+", "/"),
    (r"\s+squared\b", "^2"),
    (r"\bsince\b.*$", ""),
)
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_TOKEN = re.compile(r"\s*(?:([()/*·×.-])|(1)(?![\d.])|([A-Za-zµμε°%]+))")
_POWER = re.compile(r"\s*(?:\^|\*\*)?\s*(?:\((-?[1-9])\)|(-?[1-9]))")
_LONGEST = 60
"""Characters of a label."""

_LENGTH_RATIO = re.compile(r"\(?\s*([nuµμm]?m\s*/\s*m?m|in\s*/\s*in)\s*\)?\s*(?:/(.+)|$)")
_BRACKETS = re.compile(r"(?:\[([^\[\]]*)\]|\(((?:[^()]|\([^()]*\))*)\))\s*$")
LONGEST_HEADING = 200
"""Characters of a heading that is looked into; a longer one is no name with a unit."""
_BETWEEN = re.compile(r"[\s_,/]+")
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")


def size_of(label: str) -> Size | None:
    """Return the size of a unit in SI (N, m, s, rad) and its dimension; None for a label that is no unit.

    Symbols are multiplied and divided from the left, as in m/s/s; a bracket may have a power. ``g`` is
    standard gravity, ``-`` and ``1`` are the unit of numbers.
    """
    factors = _factors(label)
    return None if factors is None else _product(factors)


def quotient_of(label: str) -> tuple[Size, Size]:
    """Return a unit without the force or moment that it divides by, and that one: m/s² and N of m/(s² N).

    Each is a number where there is none, both for a label that is no unit.
    """
    factors = _factors(label) or []
    under = [f for f in factors if min(f[2] * f[1][0], f[2] * f[1][1]) < 0]
    over = [f for f in factors if f not in under]
    if under == [(1e-9, LENGTH, -1)]:  # no motion is divided by nanometres: N m in small letters
        under = [(1.0, MOMENT, -1)]
    return _product(over), _product([(size, powers, -n) for size, powers, n in under])


def strain_of(label: str) -> tuple[float, Size] | None:
    """Return the size of a unit of strain, and what it is divided by: 1e-6 and N of µε/N; None for others.

    A length over a length at the front is a strain, as in (m/m)/N; the unit m/(N m) is a motion for a moment.
    """
    ratio = _LENGTH_RATIO.match(label.strip())
    one, rest = (size_of(ratio[1]), ratio[2]) if ratio else (None, "")
    under = size_of(rest) if rest else (1.0, NUMBER)
    if one is not None and under is not None:
        return one[0], under
    (size, powers), under = quotient_of(label)
    return (size, under) if powers == NUMBER and size_of(label) is not None else None


def moment_of(symbol: str) -> float | None:
    """Return the size of a moment [N m] in one word, such as ``Nm``, ``lbfin``, ``inlb``; None for others."""
    for k in range(1, len(symbol)):
        (one, its), (other, of_other) = _simple(symbol[:k]), _simple(symbol[k:])
        if {its, of_other} == {FORCE, LENGTH}:
            return one * other
    return None


def conversion(label: str, unit: str) -> float | None:
    """Return the factor from a unit to another one of the same dimension; None for another label.

    Parameters
    ----------
    label : str
        Such as ``"g^2/Hz"``.
    unit : str
        The unit to convert to, such as ``"(m/s^2)^2/Hz"``.
    """
    one, other = size_of(label), size_of(unit)
    if one is None or other is None or one[1] != other[1]:
        return None
    return one[0] / other[0]


def density_conversion(label: str, unit: str) -> float | None:
    """Return the factor from a density to one per Hz of the square of a unit; None for another label.

    A density over rad/s is 1/2π of the one over Hz.
    """
    per_hertz = conversion(label, f"({unit})^2/Hz")
    per_radian = conversion(label, f"({unit})^2/(rad/s)")
    return per_hertz if per_radian is None else 2 * np.pi * per_radian


@dataclass(frozen=True, slots=True)
class UnitHeading:
    """The text above a column: its name, and the label of its unit, empty where there is none."""

    name: str
    unit: str = ""


def split_heading(text: str) -> UnitHeading:
    """Return name and unit of a heading whose unit is in square or round brackets at its end."""
    found = _BRACKETS.search(text) if len(text) <= LONGEST_HEADING else None
    if found is None:
        return UnitHeading(text.strip())
    inside = found[1] if found[1] is not None else found[2]
    return UnitHeading(text[: found.start()].strip(), inside.strip())


def heading_of(text: str, names: Collection[str], *, digits: bool = True) -> UnitHeading | None:
    """Return the heading of a column that has one of some names; None for one that has none of them.

    The unit may be in brackets, or follow the name after an underscore, a blank, a comma or a slash:
    ``time_ms``, ``Time (ms)``, ``timestamp in us``, ``t/ms``.

    Parameters
    ----------
    text : str
    names : sequence of str
        In small letters, without blanks and underscores.
    digits : bool
        Whether a number at the end of the name does not count, as in ``time2``.
    """
    if len(text) > LONGEST_HEADING:
        return None
    plain = split_heading(text)
    for words in (_BETWEEN.split(plain.name), _CAMEL.split(plain.name)):
        found = _named(UnitHeading("", plain.unit), [word for word in words if word], names, digits)
        if found is not None:
            return found
    return None


def _named(
    plain: UnitHeading, words: Sequence[str], names: Collection[str], digits: bool
) -> UnitHeading | None:
    """Return the heading whose first words are one of some names, with the unit of the words behind."""
    for k in range(len(words), 0, -1):
        name = "".join(words[:k]).lower().strip(".:-")
        if digits and len(name.rstrip("0123456789")) > 1:
            name = name.rstrip("0123456789")
        if name not in names:
            continue
        behind = [word for word in words[k:] if word.lower() != "in"]
        if plain.unit or not behind or behind[-1].isdigit() or size_of(behind[-1]) is None:
            return UnitHeading(name, plain.unit)
        unit = "/".join(behind)
        return UnitHeading(name, behind[-1] if size_of(unit) is None else unit)
    return None


def named_unit(text: str, names: Collection[str]) -> UnitHeading:
    """Return name and unit of a column that should have one of some names, perhaps in capitals.

    The unit may be in brackets, or follow one of the names after an underscore or a blank.
    """
    if text.strip() in names:
        return UnitHeading(text.strip())
    plain = split_heading(text)
    if plain.unit or len(text) > LONGEST_HEADING:
        return plain
    for found in re.finditer(r"[_\s]+", plain.name):
        name, unit = plain.name[: found.start()], plain.name[found.end() :]
        if (name in names or name.lower() in names) and size_of(unit) is not None:
            return UnitHeading(name, unit)
    return plain


def _in_symbols(label: str) -> str:
    """Return a label with symbols in place of words and raised numbers."""
    text = label.strip().replace("−", "-").replace("[", "(").replace("]", ")").translate(_RAISED)
    for word, symbol in _OTHER_WORDS:
        text = re.sub(word, symbol, text, flags=re.IGNORECASE)
    text = _SHORT_SECONDS.sub(lambda m: m[1] + "s", text)
    text = _WORD.sub(lambda m: _PREFIXES[(m[1] or "").lower()] + _WORDS[m[2].lower()], text)
    return text.strip()


def _factors(label: str) -> list[Factor] | None:
    """Return the symbols of a label; None where one is unknown."""
    text = _in_symbols(label) if len(label) <= LONGEST_HEADING else ""
    if not text or len(text) > _LONGEST:
        return None
    if text in ("-", "1"):
        return []
    found = _symbols(text, 0, nested=False)
    return None if found is None else found[0]


def _symbols(text: str, at: int, nested: bool) -> tuple[list[Factor], int] | None:
    """Return the symbols of a product from a place on, and the place behind it."""
    out: list[Factor] = []
    sign, empty = 1, True
    while at < len(text):
        found = _TOKEN.match(text, at)
        if found is None:
            return None
        mark, one, symbol = found.groups()
        at = found.end()
        if mark == ")":
            return (out, at) if nested and not empty else None
        if mark and mark != "(":
            sign = -1 if mark == "/" else 1
            continue
        inner: list[Factor] = []
        if mark == "(":
            bracket = _symbols(text, at, nested=True)
            if bracket is None:
                return None
            inner, at = bracket
        elif not one:
            known = _symbol(symbol)
            if known is None:
                return None
            inner = [(*known, 1)]
        raised = None if one else _POWER.match(text, at)
        n = sign
        if raised is not None:
            n *= int(raised[1] or raised[2])
            at = raised.end()
        out += [(size, powers, n * m) for size, powers, m in inner]
        empty = False
    return None if nested or empty else (out, at)


def _product(factors: Sequence[Factor]) -> Size:
    size = math.prod(factor**n for factor, _, n in factors)
    force, length, time, angle = (sum(n * powers[i] for _, powers, n in factors) for i in range(4))
    return size, (force, length, time, angle)


def _symbol(symbol: str) -> Size | None:
    size, powers = _simple(symbol)
    if powers is None:
        moment = moment_of(symbol)
        return None if moment is None else (moment, MOMENT)
    return size, powers


def _simple(symbol: str) -> Size | tuple[float, None]:
    if symbol in _CASES:
        return _CASES[symbol]
    return next(((t[symbol.lower()], d) for t, d in _DIMENSIONS if symbol.lower() in t), (0.0, None))
