"""Labels of units in dataset 58, and the factors of dataset 164.

The writing program has shown the label to its user; a known label takes precedence over dataset 164.
"""

import re
from collections.abc import Mapping

import numpy as np

from fem.analysis.frf import FRFKind
from fem.io.uff_format import Block, parse_label
from fem.io.uff_numbers import real, text_at, whole
from fem.io.uff_types import MOTIONS, Function, Units

G0 = 9.80665
"""Standard gravity [m/s²]."""

POUND_FORCE = 4.4482216152605
"""[N]."""

LENGTHS = {
    "m": 1.0, "meter": 1.0, "metre": 1.0, "km": 1e3, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6,
    "µm": 1e-6, "μm": 1e-6, "micron": 1e-6, "microns": 1e-6, "nm": 1e-9, "in": 0.0254, "inch": 0.0254,
    "inches": 0.0254, "ft": 0.3048, "foot": 0.3048, "feet": 0.3048, "mil": 2.54e-5, "mils": 2.54e-5,
}  # fmt: skip
GRAVITIES = {"g": G0, "gs": G0, "gn": G0, "mg": 1e-3 * G0}
ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180, "°": np.pi / 180}
FORCES = {
    "n": 1.0, "newton": 1.0, "kn": 1e3, "mn": 1e-3, "dan": 10.0, "lbf": POUND_FORCE, "lb": POUND_FORCE,
    "lbs": POUND_FORCE, "pound": POUND_FORCE, "kip": 1e3 * POUND_FORCE, "ozf": POUND_FORCE / 16, "kgf": G0,
    "kp": G0, "gf": 1e-3 * G0, "dyn": 1e-5,
}  # fmt: skip

_FREQUENCIES = {
    "hz": 1.0, "hertz": 1.0, "cps": 1.0, "cycles/s": 1.0, "khz": 1e3, "rad/s": 0.5 / np.pi,
    "rads": 0.5 / np.pi, "radians/s": 0.5 / np.pi, "krad/s": 500 / np.pi, "rpm": 1 / 60, "cpm": 1 / 60,
    "r/min": 1 / 60, "rev/min": 1 / 60, "cycles/min": 1 / 60, "1/min": 1 / 60, "krpm": 1e3 / 60,
    "rps": 1.0, "rev/s": 1.0, "r/s": 1.0, "deg/s": 1 / 360, "°/s": 1 / 360,
}  # fmt: skip
CAPITALS = {"MHz": 1e6, "mHz": 1e-3, "GHz": 1e9}
"""Labels in which capitals matter."""

TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "min": 60.0, "ns": 1e-9}

FREQUENCY, TIME = 18, 17
"""Specific data types of an abscissa."""


_TOKEN = re.compile(r"([()/*.·-])|(1)|([A-Za-zµμ°]+)(?:\^|\*\*)?(-?[1-9])?")
_LONGEST_LABEL = 60


def plain(label: str) -> str:
    """Return a label in small letters, without blanks and brackets, and with s for sec."""
    return re.sub(r"[\s()\[\]]", "", label.strip().lower()).replace("sec", "s")


def powers_of(label: str) -> dict[str, int] | None:
    """Return the units of a label with their powers: ``{"mm": 1, "s": -2}``; None where it is no product.

    Capitals are kept. Products and quotients are taken from the left, as in m/s/s.
    """
    text = label.replace("[", "(").replace("]", ")").replace("²", "^2").replace("−", "-").replace(" ", "")
    if len(text) > _LONGEST_LABEL:
        return None
    out: dict[str, int] = {}
    signs, sign, at = [1], 1, 0
    while at < len(text):
        found = _TOKEN.match(text, at)
        if found is None:
            return None
        at = found.end()
        mark, _, symbol, power = found.groups()
        if mark == "(":
            signs.append(signs[-1] * sign)
            sign = 1
        elif mark == ")":
            if len(signs) == 1:
                return None
            signs.pop()
            sign = 1
        elif mark:
            sign = -1 if mark == "/" else 1
        elif symbol:
            symbol = "s" if symbol.lower() in ("sec", "s") else symbol
            out[symbol] = out.get(symbol, 0) + signs[-1] * sign * int(power or 1)
    return {symbol: power for symbol, power in out.items() if power} if len(signs) == 1 else None


def abscissa_factor(x_type: int, label: str) -> tuple[float, str, str]:
    """Return the factor of an abscissa to Hz or s, a note on it, and the reason if it is neither.

    Parameters
    ----------
    x_type : int
        Its specific data type; 0 and 1 may be frequencies.
    label : str
        Of its unit; empty where there is none.
    """
    name = plain(label)
    if x_type == TIME:
        known = TIMES.get(name) if name else 1.0
        return (known, "", "") if known else (1.0, f"the time label '{label}' is not known; s is taken", "")
    if x_type not in (0, 1, FREQUENCY):
        return 1.0, "", f"its abscissa has data type {x_type}, not 18 (frequency)"
    known = CAPITALS.get(label.strip()) or _FREQUENCIES.get(name)
    if known:
        return known, "", ""
    if name in TIMES or name.startswith("order") or name in LENGTHS:
        return 1.0, "", f"its abscissa is in '{label}', which is no frequency"
    if name:
        return 1.0, f"the label '{label}' of the abscissa is not known; Hz is taken", ""
    return 1.0, "" if x_type == FREQUENCY else "the abscissa has no data type and no label; Hz is taken", ""


def units_of(block: Block) -> Units:
    """Return the units of a dataset 164.

    Raises
    ------
    ValueError
        If its factors of length and force are not positive numbers.
    """
    head = text_at(block, 1)
    words = text_at(block, 2).replace("D", "E").replace("d", "e").split()
    line = block.lines[2]
    texts = words[:2] if len(words) >= 2 and len(words[0]) < 26 else [line[:25], line[25:50]]
    length, force = (real(block, 2, text) for text in texts)
    if not (length > 0 and force > 0):
        msg = f"unit factors {length} and {force}; they must be positive"
        raise ValueError(msg)
    return Units(whole(block, 1, head[:10]), head[10:30].strip(), length, force)


def motion_factor(label: str, kind: FRFKind, turned: bool) -> float | None:
    """Return the SI value of one unit of a response; None where the label is not known for such a motion.

    A force that the label divides by, as in (m/s^2)/N, does not count.
    """
    powers = powers_of(label)
    if not powers:
        return None
    found = [
        (factor, powers.get("s", 0), symbol)
        for symbol, power in powers.items()
        if power == 1 and (factor := _known(symbol, ANGLES if turned else LENGTHS)) is not None
    ]
    if not turned and kind == FRFKind.ACCELERANCE and "s" not in powers:
        found += [
            (factor, -2, symbol)
            for symbol, power in powers.items()
            if power == 1 and (factor := _known(symbol, GRAVITIES)) is not None
        ]
    if len(found) != 1 or found[0][1] != -kind.derivatives:
        return None
    factor, _, unit = found[0]
    return factor if all(p == -1 for s, p in powers.items() if s not in ("s", unit)) else None


def force_factor(label: str, moment: bool) -> float | None:
    """Return the SI value of one unit of a force or moment; None where the label is not known."""
    return _force_of(powers_of(label), moment)


def _force_of(powers: dict[str, int] | None, moment: bool) -> float | None:
    if not powers or any(power != 1 for power in powers.values()):
        return None
    symbols = list(powers)
    forces = [f for s in symbols if (f := _force(s)) is not None]
    lengths = [f for s in symbols if (f := _known(s, LENGTHS)) is not None]
    if not moment:
        return forces[0] if len(symbols) == len(forces) == 1 else None
    if len(symbols) == 2 and len(forces) == len(lengths) == 1:
        return forces[0] * lengths[0]
    if len(symbols) == 1:  # Nm, lbfin, inlb
        for k in range(1, len(symbols[0])):
            for force, length in ((symbols[0][:k], symbols[0][k:]), (symbols[0][k:], symbols[0][:k])):
                f, arm = _force(force), _known(length, LENGTHS)
                if f is not None and arm is not None:
                    return f * arm
    return None


def _known(symbol: str, table: Mapping[str, float]) -> float | None:
    return table.get(symbol.lower())


def _force(symbol: str) -> float | None:
    return 1e6 if symbol == "MN" else _known(symbol, FORCES)


def _force_in(label: str, moment: bool) -> float | None:
    """Return the SI value of the force that a quotient such as (m/s^2)/N divides by; None without one."""
    powers = powers_of(label) or {}
    return _force_of({s: 1 for s, p in powers.items() if p == -1 and s != "s"}, moment)


def response_and_force(f: Function, kind: FRFKind, units: Units, labels: bool) -> tuple[float, float, str]:
    """Return the factor of an FRF to SI by its labels and by dataset 164, and its unknown labels.

    Parameters
    ----------
    f : Function
    kind : FRFKind
    units : Units
        Of the file.
    labels : bool
        Whether labels of units other than SI count; where the user gives the factor they do not.

    Returns
    -------
    factor : float
        By the labels where they are known, else by dataset 164, each end for itself.
    by_file : float
        By dataset 164 alone.
    words : str
        Labels that are not known; empty where all are.
    """
    if f.of_motion:
        return _between_motions(f, units, labels)
    turned, moment = (abs(parse_label(end)[1]) > 3 for end in (f.response, f.reference))
    motion = motion_factor(f.unit, kind, turned) if f.unit else None
    force = force_factor(f.denominator_unit, moment) if f.denominator_unit else _force_in(f.unit, moment)
    unknown = [
        f"'{label}'"
        for label, factor in ((f.unit, motion), (f.denominator_unit, force))
        if label and not factor
    ]
    if not labels:
        motion = 1.0 if motion in (1.0, G0) else None
        force = 1.0 if force == 1.0 or motion is not None else None
    response = 1.0 if turned else units.length
    reference = units.force * (units.length if moment else 1.0)
    factor = (motion or 1 / response) / (force or 1 / reference)
    words = f"the unit label {' and '.join(unknown)} is not known for FRFs of kind {kind} and is ignored"
    return factor, reference / response, words if unknown and labels else ""


def _between_motions(f: Function, units: Units, labels: bool) -> tuple[float, float, str]:
    """Return the same for a motion for a motion: each has its own label or the file's unit of length."""
    factors, by_file, unknown = [], [], []
    response = f.response, f.ordinate_type, f.unit
    reference = f.reference, f.denominator_type, f.denominator_unit
    for end, kind, label in (response, reference):
        turned = abs(parse_label(end)[1]) > 3
        own = 1.0 if turned else 1 / units.length
        known = motion_factor(label, MOTIONS[kind], turned) if label else None
        if label and known is None:
            unknown.append(f"'{label}'")
        factors.append(known if known and labels else own)
        by_file.append(own)
    words = f"the unit label {' and '.join(unknown)} is not known for transmissibilities and is ignored"
    return factors[0] / factors[1], by_file[0] / by_file[1], words if unknown and labels else ""
