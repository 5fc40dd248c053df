"""The unit in which texts give lengths and places: metres, or the one of the deck that a study was made of.

One for a process, as NumPy's print options are: the words of a place are made by its effect, which knows no
study. Commands and the desk have one study each; from Python lengths are in metres.
"""

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Units that texts may have [m]; lengths in others are given in metres."""


@dataclass(slots=True)
class _Shown:
    unit: str = "m"


_SHOWN = _Shown()


@contextmanager
def metres_afterwards() -> Iterator[None]:
    """Show lengths in metres again in the end, whatever unit was chosen meanwhile."""
    try:
        yield
    finally:
        show_lengths(1.0)


def show_lengths(unit: float) -> None:
    """Show lengths in a unit of so many metres."""
    near = [name for name, size in _UNITS.items() if math.isclose(size, unit, rel_tol=1e-6)]
    _SHOWN.unit = near[0] if near else "m"


def shown_length(value: float) -> tuple[float, str]:
    """Return a length [m] in the unit that texts have, and the name of that unit."""
    return value / _UNITS[_SHOWN.unit], _SHOWN.unit


def shown_unit() -> float:
    """Return the unit that texts have [m], for :func:`show_lengths` in another process."""
    return _UNITS[_SHOWN.unit]


def length_text(value: float) -> str:
    """Return a length to a millimetre [m], such as ``0.600 m`` or ``600 mm``."""
    number, unit = shown_length(value)
    decimals = max(0, 3 + math.floor(math.log10(_UNITS[unit])))
    return f"{number:.{decimals}f} {unit}"


def rough_length(value: float, digits: int = 2) -> str:
    """Return a length [m] to some significant digits, such as ``0.4 mm``."""
    number, unit = shown_length(value)
    return f"{number:.{digits}g} {unit}"


def coordinates_text(xyz: Iterable[float]) -> str:
    """Return coordinates [m] in words, such as ``(0.45, 0, 0.8) m``."""
    shown = [shown_length(round(float(x), 6)) for x in xyz]
    numbers = ", ".join(f"{x + 0.0:.4g}" for x, _ in shown).replace("-", "−")
    return f"({numbers}) {shown[0][1]}"
