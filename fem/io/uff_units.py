"""Labels of units in dataset 58, and the factors of dataset 164.

The writing program has shown the label to its user; a known label takes precedence over dataset 164.
"""

import re

import numpy as np

from fem.analysis.frf import FRFKind
from fem.io.faults import refuse
from fem.io.uff_format import UffBlock, parse_label
from fem.io.uff_numbers import integer, real, text_at
from fem.io.uff_types import MOTIONS, Function, UffUnits
from fem.io.units import CAPITALS, FORCE, G0, MOMENT, NUMBER, conversion, moment_of, quotient_of, strain_of

_FREQUENCIES = {
    "hz": 1.0,
    "hertz": 1.0,
    "cps": 1.0,
    "cycles/s": 1.0,
    "khz": 1e3,
    "rads": 0.5 / np.pi,
    "rpm": 1 / 60,
    "cpm": 1 / 60,
    "r/min": 1 / 60,
    "rev/min": 1 / 60,
    "cycles/min": 1 / 60,
    "1/min": 1 / 60,
    "krpm": 1e3 / 60,
    "rps": 1.0,
    "rev/s": 1.0,
    "r/s": 1.0,
}
"""Labels [Hz], without blanks and brackets; others are in rad/s. 1/s is none: it may be either."""

FREQUENCY, TIME = 18, 17
"""Specific data types of an abscissa."""


def abscissa_factor(x_type: int, label: str) -> tuple[float, str, str]:
    """Return the factor of an abscissa to Hz or s, a note on it, and the reason if it is neither.

    Parameters
    ----------
    x_type : int
        Its specific data type; 0 and 1 may be frequencies.
    label : str
        Of its unit; empty where there is none.
    """
    name = re.sub(r"[\s()\[\]]", "", label.lower()).replace("sec", "s")
    if x_type == TIME:
        known = conversion(label, "s") if name else 1.0
        return (known, "", "") if known else (1.0, f"the time label '{label}' is not known; s is taken", "")
    if x_type not in (0, 1, FREQUENCY):
        return 1.0, "", f"its abscissa has data type {x_type}, not 18 (frequency)"
    known = CAPITALS.get(label.strip()) or _FREQUENCIES.get(name)
    known = known or (conversion(label, "rad/s") or 0.0) / (2 * np.pi)
    if known:
        return known, "", ""
    if name.startswith("order") or conversion(label, "s") or conversion(label, "m"):
        return 1.0, "", f"its abscissa is in '{label}', which is no frequency"
    if name:
        return 1.0, f"the label '{label}' of the abscissa is not known; Hz is taken", ""
    return 1.0, "" if x_type == FREQUENCY else "the abscissa has no data type and no label; Hz is taken", ""


def units_of(block: UffBlock) -> UffUnits:
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
        refuse(f"unit factors {length} and {force}; they must be positive")
    return UffUnits(integer(block, 1, head[:10]), head[10:30].strip(), length, force)


def motion_factor(label: str, kind: FRFKind, turned: bool) -> float | None:
    """Return the SI value of one unit of a response; None where the label is not known for such a motion.

    A force or moment that the label divides by, as in (m/s^2)/N, does not count.
    """
    (size, powers), (_, under) = quotient_of(label)
    found = powers == (0, not turned, -kind.derivatives, turned) and under in (NUMBER, FORCE, MOMENT)
    return size if found else None


def force_factor(label: str, moment: bool) -> float | None:
    """Return the SI value of one unit of a force or moment; None where the label is not known."""
    return conversion(label, "N m" if moment else "N") or (moment_of(label.strip()) if moment else None)


def _force_in(label: str, moment: bool) -> float | None:
    """Return the SI value of the force that a quotient such as (m/s^2)/N divides by; None without one."""
    _, (size, powers) = quotient_of(label)
    return size if powers == (MOMENT if moment else FORCE) else None


def response_and_force(f: Function, kind: FRFKind, units: UffUnits, labels: bool) -> tuple[float, float, str]:
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
    if f.is_strain:
        strain = strain_of(f.unit) if f.unit else None
        motion = None if strain is None else strain[0]
    else:
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
    response = 1.0 if turned or f.is_strain else units.length
    reference = units.force * (units.length if moment else 1.0)
    factor = (motion or 1 / response) / (force or 1 / reference)
    what = "strains" if f.is_strain else f"FRFs of kind {kind}"
    words = f"the unit label {' and '.join(unknown)} is not known for {what} and is ignored"
    return factor, reference / response, words if unknown and labels else ""


def _between_motions(f: Function, units: UffUnits, labels: bool) -> tuple[float, float, str]:
    """Return the same for a motion for a motion: each has a label or the file's unit of length."""
    factors, by_file, unknown = [], [], []
    response = f.response, f.ordinate_type, f.unit
    reference = f.reference, f.denominator_type, f.denominator_unit
    for end, kind, label in (response, reference):
        turned = abs(parse_label(end)[1]) > 3
        of_file = 1.0 if turned else 1 / units.length
        known = motion_factor(label, MOTIONS[kind], turned) if label else None
        if label and known is None:
            unknown.append(f"'{label}'")
        factors.append(known if known and labels else of_file)
        by_file.append(of_file)
    words = f"the unit label {' and '.join(unknown)} is not known for transmissibilities and is ignored"
    return factors[0] / factors[1], by_file[0] / by_file[1], words if unknown and labels else ""
