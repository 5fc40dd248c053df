"""Solid shapes: rectangle, circle and ellipse."""

from typing import Self

import numpy as np

from fem.sections.constants import SectionConstants
from fem.sections.dimensions import check_positive, checked_ratio, shape_fields
from fem.sections.outlines import box, ring
from fem.sections.shear import cowper_tube, shear_coefficient_of_rectangle


class SolidShapes(SectionConstants):
    """Constructors of solid sections."""

    __slots__ = ()

    @classmethod
    def rectangle(cls, b: float, h: float, nu: float = 0.0) -> Self:
        """Solid rectangle: width b along y, height h along z [m].

        J from the series of Timoshenko & Goodier, *Theory of Elasticity*, art. 109; k of each direction from
        :func:`shear_coefficient_of_rectangle`, 5/6 for ν = 0 and any sides.
        """
        check_positive("rectangle", b=b, h=h)
        long, short = max(b, h), min(b, h)
        n = np.arange(1, 60, 2)
        series = float((np.tanh(n * np.pi * long / (2 * short)) / n**5).sum())
        J = long * short**3 / 3 * (1 - 192 * short / (np.pi**5 * long) * series)
        checked_ratio("rectangle", nu)
        return cls(
            b * h,
            b * h**3 / 12,
            h * b**3 / 12,
            J,
            shear_coefficient_of_rectangle(h, b, nu),
            shear_coefficient_of_rectangle(b, h, nu),
            (box(b, h),),
            **shape_fields("rectangle", b=b, h=h, nu=nu),
        )

    @classmethod
    def circle(cls, d: float, nu: float = 0.0) -> Self:
        """Solid circle of diameter d [m]; k = 6 (1 + ν) / (7 + 6 ν) (Cowper 1966)."""
        check_positive("circle", d=d)
        I, k = np.pi * d**4 / 64, cowper_tube(0.0, checked_ratio("circle", nu))
        return cls(np.pi * d**2 / 4, I, I, 2 * I, k, k, (ring(d, d),), **shape_fields("circle", d=d, nu=nu))

    @classmethod
    def ellipse(cls, b: float, h: float, nu: float = 0.0) -> Self:
        """Solid ellipse: width b along y, height h along z [m].

        With the half axes: J = π b³ h³ / (b² + h²) (Timoshenko & Goodier, art. 105), and for shear along h
        k = 12 (1 + ν) h² (3h² + b²) / ((40 + 37 ν) h⁴ + (16 + 10 ν) h² b² + ν b⁴) (Cowper 1966).
        """
        check_positive("ellipse", b=b, h=h)
        checked_ratio("ellipse", nu)
        y, z = b / 2, h / 2

        def k(a: float, c: float) -> float:
            below = (40 + 37 * nu) * a**4 + (16 + 10 * nu) * a**2 * c**2 + nu * c**4
            return 12 * (1 + nu) * a**2 * (3 * a**2 + c**2) / below

        return cls(
            np.pi * y * z,
            np.pi * y * z**3 / 4,
            np.pi * z * y**3 / 4,
            np.pi * y**3 * z**3 / (y**2 + z**2),
            k(y, z),
            k(z, y),
            (ring(b, h),),
            **shape_fields("ellipse", b=b, h=h, nu=nu),
        )
