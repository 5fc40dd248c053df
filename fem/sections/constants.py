"""The constants of a cross-section, about the axes of a member.

Local axes of a member: x along it, z the direction of the section's height h, y that of its width b.
``Iy`` is the second moment for bending in the x-z plane (rotation about y), and ``Iz`` is the one for bending
in the x-y plane.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fem.array_types import Floats
from fem.materials import PropertyError
from fem.sections.walls import Walls

LARGEST_SHEAR_COEFFICIENT = 10.0
"""Flat bars have large shear coefficients; above this, shear deformation no longer matters [-]."""

NO_INERTIA_OF_TORSION = 1e-12
"""Ip over Iy + Iz of a member whose mass has no inertia of torsion; 0 stands for Iy + Iz [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class SectionConstants:
    """Constants of a cross-section; `fem.sections.section.Section` makes them from shapes.

    Attributes
    ----------
    A : float
        Area [m²].
    Iy, Iz : float
        Second moments of area about local y (bending along z) and local z (bending along y) [m⁴].
    J : float
        Torsion constant [m⁴].
    ky, kz : float
        Shear coefficients for shear along y and z [-]: shear area is k A. 0 leaves shear deformation out.
    outlines : tuple of ndarray (n, 2)
        Closed polygons in the (y, z) plane for drawing, the outer first, then holes [m].
    label : str
        Name for reports, such as its shape and dimensions.
    Ip : float
        Polar second moment for rotary inertia about x [m⁴]; ``Iy + Iz`` unless given.
    shape : str
        Name of the shape, one of `fem.sections.section.SHAPES`; empty for a section given by its constants.
    dimensions : mapping of str to float
        The shape's dimensions by name [m].
    angle : float
        From the axis y of the member's orientation to the section's principal axis y, towards z [rad].
        Constants, outlines and shear centre are in principal axes; the frame turns the local axes.
    estimated_k : bool
        Whether ky and kz are those of a shape with walls, on which books and programs differ: for boxes from
        0.26 to 0.44 in one direction.
    shear_centre : (float, float)
        y and z of the shear centre from the centroid [m]. Beam elements do not use it: they bend and twist
        about the centroid, and bending without twist needs it to be zero.
    walls : Walls or None
        Straight walls of a section that has some, for shear stresses.
    """

    A: float
    Iy: float
    Iz: float
    J: float
    ky: float = 0.0
    kz: float = 0.0
    outlines: tuple[Floats, ...] = ()
    label: str = ""
    Ip: float = 0.0
    shape: str = ""
    dimensions: Mapping[str, float] = field(default_factory=dict)
    angle: float = 0.0
    shear_centre: tuple[float, float] = (0.0, 0.0)
    estimated_k: bool = False
    walls: Walls | None = None

    def __post_init__(self) -> None:
        for key in ("A", "Iy", "Iz", "J"):
            value = getattr(self, key)
            if not (np.isfinite(value) and value > 0):
                msg = (
                    f"section {self.label or 'given by its constants'}: {key} is {value}; it must be positive"
                )
                raise PropertyError(msg)
            object.__setattr__(self, key, float(value))
        for key in ("ky", "kz"):
            value = getattr(self, key)
            if not 0 <= value <= LARGEST_SHEAR_COEFFICIENT:
                msg = (
                    f"section {self.label}: {key} is {value}; a shear coefficient lies between 0 and "
                    f"{LARGEST_SHEAR_COEFFICIENT:g}, and is 1 or less but for flat bars"
                )
                raise PropertyError(msg)
            object.__setattr__(self, key, float(value))
        if not 0 <= self.Ip < np.inf:
            msg = f"section {self.label or 'given by its constants'}: Ip is {self.Ip}; it cannot be negative"
            raise PropertyError(msg)
        if self.Ip == 0.0:
            object.__setattr__(self, "Ip", self.Iy + self.Iz)
