"""Cross-sections.

Local axes of a member: x along it, z the direction of the section's height h, y that of its width b.
``Iy`` is the second moment for bending in the x-z plane (rotation about y), and ``Iz`` is the one for bending
in the x-y plane.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fem.materials import PropertyError

SHAPES: dict[str, tuple[str, ...]] = {
    "rectangle": ("b", "h"),
    "hollow_rectangle": ("b", "h", "t"),
    "circle": ("d",),
    "tube": ("d", "t"),
    "i_section": ("b", "h", "tf", "tw"),
}
"""Shapes of sections and their dimensions [m]: methods of `Section` and their arguments."""


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
    shape : str
        Name of the shape, one of `SHAPES`; empty for a section given by its constants.
    dimensions : mapping of str to float
        The shape's dimensions by name [m].
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
    shape: str = ""
    dimensions: Mapping[str, float] = field(default_factory=dict)

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
    def of_shape(cls, shape: str, **dimensions: float) -> "Section":
        """Return a section of a shape that is named, with the dimensions of `SHAPES` [m]."""
        if shape not in SHAPES:
            msg = f"there is no shape '{shape}'; there are {', '.join(SHAPES)}"
            raise PropertyError(msg)
        return getattr(cls, shape)(**dimensions)

    @staticmethod
    def between(first: "Section", second: "Section", fraction: float) -> "Section":
        """Return the section of a tapered member between those of its ends.

        Two sections of the same shape: the dimensions are linear along the member, and the shape's formulas
        give the constants. Two sections given by their constants: √A and the fourth roots of Iy, Iz, J and
        Ip are linear, which is exact where one end is the other one scaled, and so are ky, kz and outlines
        of equally many corners. An I whose height alone tapers is not that: give its shape.

        Parameters
        ----------
        first, second : Section
            At fraction 0 and 1.
        fraction : float
            Where, in parts of the length between them [-].

        Raises
        ------
        PropertyError
            If the fraction is outside 0 … 1, or the two are of different shapes.
        """
        if not 0 <= fraction <= 1:
            msg = f"the fraction along a tapered member is {fraction}; it must lie between 0 and 1"
            raise PropertyError(msg)
        if fraction in (0, 1):
            return second if fraction else first

        def linear(a: float, b: float, power: int = 1) -> float:
            return ((1 - fraction) * a ** (1 / power) + fraction * b ** (1 / power)) ** power

        if first.shape != second.shape or set(first.dimensions) != set(second.dimensions):
            msg = (
                f"no section lies between {_words(first)} and {_words(second)}: both must have the same "
                "shape and dimensions of the same names, or both be given by A, Iy, Iz and J"
            )
            raise PropertyError(msg)
        if first.shape:
            sizes = {key: linear(value, second.dimensions[key]) for key, value in first.dimensions.items()}
            return Section.of_shape(first.shape, **sizes)
        alike = [len(o) for o in first.outlines] == [len(o) for o in second.outlines]
        return Section(
            linear(first.A, second.A, 2),
            *(linear(getattr(first, key), getattr(second, key), 4) for key in ("Iy", "Iz", "J")),
            ky=linear(first.ky, second.ky),
            kz=linear(first.kz, second.kz),
            outlines=tuple(
                (1 - fraction) * a + fraction * b
                for a, b in zip(first.outlines, second.outlines, strict=True)
            )
            if alike
            else (),
            label=f"between {first.label or 'constants'} and {second.label or 'constants'}, {fraction:g}",
            Ip=linear(first.Ip, second.Ip, 4),
        )

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
            b * h,
            b * h**3 / 12,
            h * b**3 / 12,
            J,
            5 / 6,
            5 / 6,
            (_box(b, h),),
            f"rectangle {b:g} x {h:g} m",
            shape="rectangle",
            dimensions={"b": b, "h": h},
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
            shape="hollow_rectangle",
            dimensions={"b": b, "h": h, "t": t},
        )

    @classmethod
    def circle(cls, d: float) -> "Section":
        """Solid circle of diameter d [m]; shear coefficient 9/10 (energy)."""
        _positive("circle", d=d)
        I = np.pi * d**4 / 64
        return cls(
            np.pi * d**2 / 4,
            I,
            I,
            2 * I,
            0.9,
            0.9,
            (_circle(d),),
            f"circle {d:g} m",
            shape="circle",
            dimensions={"d": d},
        )

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
            shape="tube",
            dimensions={"d": d, "t": t},
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
            A,
            Iy,
            Iz,
            J,
            5 / 3 * b * tf / A,
            hw * tw / A,
            (outline,),
            f"I {b:g} x {h:g} x {tf:g} x {tw:g} m",
            shape="i_section",
            dimensions={"b": b, "h": h, "tf": tf, "tw": tw},
        )


def _words(section: Section) -> str:
    return f"a section of shape '{section.shape}'" if section.shape else "a section given by its constants"


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
