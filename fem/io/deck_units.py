"""Units of a deck: sizes in SI of what its cards give, from its units of length, mass and time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem.array_types import Floats
from fem.materials import Material
from fem.matrices import UNITS, MatricesError, consistent_units
from fem.mesh import MeshError
from fem.plausibility import DENSITY, FARTHEST_SOUND, LEAST_USUAL, MODULUS, USUAL_SOUND


@dataclass(frozen=True, slots=True)
class DeckUnits:
    """A consistent system of units; a deck's value times one of these is the value in SI.

    Angles are in radians.

    Attributes
    ----------
    length, mass, time : float
        One unit of each [m, kg, s].
    """

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    @classmethod
    def of(cls, units: "str | Sequence[float] | DeckUnits") -> "DeckUnits":
        """Return the units of a name, such as ``"mm-t-s"``, or of length, mass and time [m, kg, s]."""
        if isinstance(units, DeckUnits):
            return units
        try:
            return cls(*consistent_units(units))
        except MatricesError as reason:
            raise MeshError(str(reason)) from reason

    @property
    def area(self) -> float:
        """One unit of an area [m²]."""
        return self.length**2

    @property
    def second_moment(self) -> float:
        """One unit of a section's second moment of area [m⁴]."""
        return self.length**4

    @property
    def acceleration(self) -> float:
        """[m/s²]."""
        return self.length / self.time**2

    @property
    def force(self) -> float:
        """[N]."""
        return self.mass * self.acceleration

    @property
    def stress(self) -> float:
        """One unit of a stress or a modulus [Pa]."""
        return self.force / self.area

    @property
    def density(self) -> float:
        """[kg/m³]."""
        return self.mass / self.length**3

    @property
    def mass_per_length(self) -> float:
        """[kg/m]."""
        return self.mass / self.length

    @property
    def inertia(self) -> float:
        """One unit of a body's moment of inertia [kg·m²]."""
        return self.mass * self.length**2

    @property
    def stiffness(self) -> Floats:
        """One unit of springs along and about x, y and z, (6,) [N/m, N·m/rad]."""
        return self.mass / self.time**2 * self.of_motions**2

    @property
    def damping(self) -> Floats:
        """One unit of dashpots along and about x, y and z, (6,) [N·s/m, N·m·s/rad]."""
        return self.stiffness * self.time

    @property
    def of_motions(self) -> Floats:
        """Factors (6,) of forces, and of an equation's coefficients: those of rotations have a length."""
        return np.repeat([1.0, self.length], 3)


def likely_units(materials: Sequence[Material], units: DeckUnits) -> str:
    """Return the units that make usual solids of a deck's materials; empty if these are usual, or none do.

    Parameters
    ----------
    materials : sequence of Material
        As read in ``units``; those without a density that any units could give are judged by E alone.
    units : Units
    """
    odd = [m for m in materials if not (MODULUS[0] <= m.E <= MODULUS[1] and _fits(m.rho, DENSITY, m))]
    best = ("", FARTHEST_SOUND)
    for name, sizes in UNITS.items() if odd else ():
        other = DeckUnits(*sizes)
        off = 0.0
        for m in odd:
            E, rho = m.E * other.stress / units.stress, m.rho * other.density / units.density
            usual = LEAST_USUAL[0] <= E <= MODULUS[1] and _fits(rho, (LEAST_USUAL[1], DENSITY[1]), m)
            # E of steel, aluminium, copper and titanium, within a factor of two [Pa]
            speed = E / 1e11 if m.is_massless else E / rho / USUAL_SOUND**2
            off = max(off, abs(np.log(speed)) / 2 if usual else np.inf)
        if off < best[1]:
            best = (name, off)
    return best[0]


def _fits(rho: float, allowed: tuple[float, float], m: Material) -> bool:
    return m.is_massless or allowed[0] <= rho <= allowed[1]
