"""Labels of FRFs in files that people and analysers write: units, and the names of a pair."""

import re
from dataclasses import dataclass

from fem.analysis.frf import FRFKind
from fem.io.uff_units import FREQUENCY, abscissa_factor, force_factor, motion_factor, powers_of

_PER_MASS = {
    (("kg", -1),): FRFKind.ACCELERANCE,
    (("kg", -1), ("s", 1)): FRFKind.MOBILITY,
    (("kg", -1), ("s", 2)): FRFKind.RECEPTANCE,
}
"""Units of FRFs that are written with the kilogram: m/(s² N) = 1/kg."""

_DECIBEL = re.compile(r"^\s*dB\b\s*(?:\(?\s*(?:re|rel|ref)\.?:?\s*)?(?P<rest>.*?)\)?\s*$", re.IGNORECASE)
_REFERENCE = re.compile(r"^(?P<size>[0-9.]+(?:[eE][+-]?\d+)?)?\s*\*?\s*(?P<unit>.*)$")

NAMES = {
    "accelerance": FRFKind.ACCELERANCE,
    "inertance": FRFKind.ACCELERANCE,
    "mobility": FRFKind.MOBILITY,
    "receptance": FRFKind.RECEPTANCE,
    "compliance": FRFKind.RECEPTANCE,
}
"""Kinds of FRFs by their names."""


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit of an FRF.

    Attributes
    ----------
    kind : FRFKind
    factor : float
        Its size [SI unit of the kind].
    """

    kind: FRFKind
    factor: float


def frf_unit(label: str) -> Unit | None:
    """Return kind and size of the unit of a translational FRF, such as ``g/N``; None for any other label."""
    powers = powers_of(label) or {}
    known = _PER_MASS.get(tuple(sorted(powers.items())))
    if known is not None:
        return Unit(known, 1.0)
    forces = [s for s, p in powers.items() if p == -1 and force_factor(s, moment=False) is not None]
    for kind in FRFKind:
        motion = motion_factor(label, kind, turned=False)
        if motion is not None and len(forces) == 1:
            return Unit(kind, motion / (force_factor(forces[0], moment=False) or 1.0))
    return None


def decibel_reference(label: str) -> tuple[float, str] | None:
    """Return number and unit that a level in dB refers to, ``dB re 1e-6 m/N``; None for another label.

    A level that states no reference has 1 and no unit.
    """
    found = _DECIBEL.match(label)
    if found is None:
        return None
    reference = _REFERENCE.match(found["rest"].strip(" ()[]"))
    if reference is None:
        return None
    try:
        size = float(reference["size"] or 1.0)
    except ValueError:
        return None
    return (size, reference["unit"].strip()) if size > 0 else None


def frequency_factor(label: str) -> float | None:
    """Return the size of a unit of frequency [Hz]; None for a label that is none."""
    factor, said, refused = abscissa_factor(FREQUENCY, label)
    return None if said or refused or not label.strip() else factor
