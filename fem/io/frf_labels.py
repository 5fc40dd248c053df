"""Labels of FRFs in files that people and analysers write: units, and the names of a pair."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from fem.analysis.frf import FRFKind
from fem.io.uff_units import FREQUENCY, abscissa_factor
from fem.io.units import FORCE, MOMENT, quotient_of, size_of, strain_of

_DECIBEL = re.compile(r"^\s*dB\b\s*(?:\(?\s*(?:re|rel|ref)\.?:?\s*)?(?P<rest>.*?)\)?\s*$", re.IGNORECASE)
_VALUE = re.compile(r"\s*[+-]?[\d.,]+(?:[eE][+-]?\d+)?\s+\S")
"""A number with a unit behind it."""
_REFERENCE = re.compile(r"^(?P<size>[0-9.]+(?:[eE][+-]?\d+)?)?\s*\*?\s*(?P<unit>.*)$")

NAMES = {
    "accelerance": FRFKind.ACCELERANCE,
    "inertance": FRFKind.ACCELERANCE,
    "mobility": FRFKind.MOBILITY,
    "receptance": FRFKind.RECEPTANCE,
    "compliance": FRFKind.RECEPTANCE,
}
"""Kinds of FRFs by their names."""


def matrix_of(pairs: Iterable[tuple[str, str]]) -> tuple[list[str], list[str], list[str]]:
    """Return outputs and inputs of pairs, and the pairs that a complete matrix needs besides."""
    there = dict.fromkeys(pairs)
    outputs, inputs = (list(dict.fromkeys(pair[k] for pair in there)) for k in (0, 1))
    return outputs, inputs, [f"{o}/{i}" for i in inputs for o in outputs if (o, i) not in there]


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit of an FRF.

    Attributes
    ----------
    kind : FRFKind or None
        None of a strain, which is the same in every kind.
    factor : float
        Its size [SI unit of the kind, 1/N of a strain].
    """

    kind: FRFKind | None
    factor: float


def frf_unit(label: str) -> Unit | None:
    """Return kind and size of the unit of a translation for a force or moment, such as ``g/N``, or None.

    A number for a force, such as ``µε/N``, is the unit of a strain.
    """
    size, powers = size_of(label) or (0.0, None)
    _, (_, under) = quotient_of(label)
    kinds = (kind for kind in FRFKind if powers == (-1, under != MOMENT, -kind.derivatives, 0))
    strain = strain_of(label)
    if strain is not None and strain[1][1] == FORCE:
        return Unit(None, strain[0] / strain[1][0])
    return next((Unit(kind, size) for kind in kinds), None)


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
    """Return the size of a unit of frequency [Hz]; None for a label that is none, as a value, ``1 Hz``."""
    if _VALUE.match(label):
        return None
    factor, note, refused = abscissa_factor(FREQUENCY, label)
    return None if note or refused or not label.strip() else factor
