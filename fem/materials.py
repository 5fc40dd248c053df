"""Materials."""

import sys
from dataclasses import dataclass

import numpy as np

MASSLESS_SPEED = 1e12
"""√(E/ρ) of a material without density in its deck: so fast in no units of a deck [m/s]."""


class PropertyError(ValueError):
    """A material or section that cannot exist."""


@dataclass(frozen=True, slots=True)
class Material:
    """A linear elastic isotropic material.

    Attributes
    ----------
    name : str
        Its name in messages and reports.
    E : float
        Young's modulus [Pa].
    rho : float
        Density [kg/m³].
    nu : float
        Poisson's ratio [-]; the shear modulus is ``G = E / (2 (1 + nu))``.
    loss_factor : float
        Structural loss factor of the material [-]; K becomes K (1 + i loss_factor).
    """

    name: str
    E: float
    rho: float
    nu: float = 0.3
    loss_factor: float = 0.0

    def __post_init__(self) -> None:
        for key, value, ok, allowed in (
            ("E", self.E, self.E > 0, "a positive number [Pa]"),
            ("rho", self.rho, self.rho > 0, "a positive number [kg/m³]"),
            ("nu", self.nu, -1 < self.nu <= 0.5, "above -1 and at most 0.5"),
            ("loss_factor", self.loss_factor, 0 <= self.loss_factor < 2, "at least 0 and below 2"),
        ):
            if not (np.isfinite(value) and ok):
                msg = f"material '{self.name}': {key} is {value}; it must be {allowed}"
                raise PropertyError(msg)

    @property
    def G(self) -> float:
        """Shear modulus [Pa]."""
        return self.E / (2 * (1 + self.nu))

    @property
    def is_massless(self) -> bool:
        """Whether the density is a negligible one, as readers give it to a material without density."""
        # a tenth: a modulus may be changed after that
        return self.E / self.rho > (MASSLESS_SPEED / 10) ** 2


def negligible_density(E: float) -> float:
    """Return the density of a material without one, in kg/m³ of E in Pa; a model needs some."""
    return max(E / MASSLESS_SPEED**2, sys.float_info.min)
