"""Materials and cross-sections.

Local axes of a member: x along it, z the direction of the section's height h, y that of its width b.
``Iy`` is the second moment for bending in the x-z plane (rotation about y), and ``Iz`` is the one for bending
in the x-y plane.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """A cross-section.

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
        How it was made, for reports.
    Ip : float
        Polar second moment for rotary inertia about x [m⁴]; ``Iy + Iz`` unless given.
    """

    A: float
    Iy: float
    Iz: float
    J: float
    ky: float = 0.0
    kz: float = 0.0
    outlines: tuple[NDArray[np.float64], ...] = ()
    label: str = ""
    Ip: float = 0.0

    def __post_init__(self) -> None:
        for key in ("A", "Iy", "Iz", "J"):
            value = getattr(self, key)
            if not (np.isfinite(value) and value > 0):
                msg = (
                    f"section {self.label or 'given by its constants'}: {key} is {value}; it must be positive"
                )
                raise PropertyError(msg)
        for key in ("ky", "kz"):
            value = getattr(self, key)
            if not 0 <= value <= 1.2:
                msg = f"section {self.label}: {key} is {value}; a shear coefficient lies between 0 and 1.2"
                raise PropertyError(msg)
        if self.Ip == 0.0:
            object.__setattr__(self, "Ip", self.Iy + self.Iz)

    @classmethod
    def rectangle(cls, b: float, h: float) -> "Section":
        """Solid rectangle: width b along y, height h along z [m].

        J is from the series of Timoshenko & Goodier, Theory of Elasticity, art. 109; the shear coefficients
        are 5/6 (Reissner).
        """
        _positive("rectangle", b=b, h=h)
        long, short = max(b, h), min(b, h)
        n = np.arange(1, 60, 2)
        series = float((np.tanh(n * np.pi * long / (2 * short)) / n**5).sum())
        J = long * short**3 / 3 * (1 - 192 * short / (np.pi**5 * long) * series)
        return cls(
            b * h, b * h**3 / 12, h * b**3 / 12, J, 5 / 6, 5 / 6, (_box(b, h),), f"rectangle {b:g} x {h:g} m"
        )

    @classmethod
    def hollow_rectangle(cls, b: float, h: float, t: float) -> "Section":
        """Hollow rectangle with wall t [m].

        J by Bredt's formula on the wall's centre line; shear area: the walls parallel to the shear force
        (Cowper 1966 for thin walls gives about the same).
        """
        _positive("hollow rectangle", b=b, h=h, t=t)
        if 2 * t >= min(b, h):
            msg = (
                f"hollow rectangle: the wall t = {t:g} m fills the section {b:g} x {h:g} m; "
                "t must be below half of it"
            )
            raise PropertyError(msg)
        bi, hi = b - 2 * t, h - 2 * t
        A = b * h - bi * hi
        J = 2 * t * ((b - t) * (h - t)) ** 2 / (b + h - 2 * t)
        return cls(
            A,
            (b * h**3 - bi * hi**3) / 12,
            (h * b**3 - hi * bi**3) / 12,
            J,
            2 * t * (b - t) / A,
            2 * t * (h - t) / A,
            (_box(b, h), _box(bi, hi)),
            f"hollow rectangle {b:g} x {h:g} x {t:g} m",
        )

    @classmethod
    def circle(cls, d: float) -> "Section":
        """Solid circle of diameter d [m]; shear coefficient 9/10 (energy)."""
        _positive("circle", d=d)
        I = np.pi * d**4 / 64
        return cls(np.pi * d**2 / 4, I, I, 2 * I, 0.9, 0.9, (_circle(d),), f"circle {d:g} m")

    @classmethod
    def tube(cls, d: float, t: float) -> "Section":
        """Round tube of outer diameter d and wall t [m]; shear coefficient 1/2 (thin wall)."""
        _positive("tube", d=d, t=t)
        if 2 * t >= d:
            msg = f"tube: the wall t = {t:g} m fills the diameter {d:g} m; t must be below half of it"
            raise PropertyError(msg)
        di = d - 2 * t
        I = np.pi * (d**4 - di**4) / 64
        return cls(
            np.pi * (d**2 - di**2) / 4,
            I,
            I,
            2 * I,
            0.5,
            0.5,
            (_circle(d), _circle(di)),
            f"tube {d:g} x {t:g} m",
        )

    @classmethod
    def i_section(cls, b: float, h: float, tf: float, tw: float) -> "Section":
        """Doubly symmetric I: flange width b, height h, flange tf, web tw [m].

        J = Σ b t³ / 3; shear area: the web along z, 5/6 of the flanges along y.
        """
        _positive("I section", b=b, h=h, tf=tf, tw=tw)
        if 2 * tf >= h or tw >= b:
            msg = (
                f"I section: flanges 2 x {tf:g} m in height {h:g} m, web {tw:g} m in width {b:g} m do not fit"
            )
            raise PropertyError(msg)
        hw = h - 2 * tf
        A = 2 * b * tf + hw * tw
        Iy = (b * h**3 - (b - tw) * hw**3) / 12
        Iz = (2 * tf * b**3 + hw * tw**3) / 12
        J = (2 * b * tf**3 + (h - tf) * tw**3) / 3
        y, z = b / 2, h / 2
        half = [(-y, -z), (y, -z), (y, -z + tf), (tw / 2, -z + tf)]
        upper = [(tw / 2, z - tf), (y, z - tf), (y, z), (-y, z), (-y, z - tf), (-tw / 2, z - tf)]
        outline = np.array([*half, *upper, (-tw / 2, -z + tf), (-y, -z + tf)])
        return cls(
            A, Iy, Iz, J, 5 / 3 * b * tf / A, hw * tw / A, (outline,), f"I {b:g} x {h:g} x {tf:g} x {tw:g} m"
        )


def _positive(shape: str, **sizes: float) -> None:
    for key, value in sizes.items():
        if not (np.isfinite(value) and value > 0):
            msg = f"{shape}: {key} is {value}; it must be positive [m]"
            raise PropertyError(msg)


def _box(b: float, h: float) -> NDArray[np.float64]:
    return np.array([(-b / 2, -h / 2), (b / 2, -h / 2), (b / 2, h / 2), (-b / 2, h / 2)])


def _circle(d: float) -> NDArray[np.float64]:
    phi = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    return d / 2 * np.column_stack([np.cos(phi), np.sin(phi)])
