"""Hollow shapes, whose walls close a cell: rectangle, tube, ellipse and regular polygon."""

from typing import Self

import numpy as np

from fem.array_types import Floats
from fem.materials import PropertyError
from fem.sections.constants import SectionConstants
from fem.sections.dimensions import check_positive, check_radius, checked_ratio, shape_fields
from fem.sections.outlines import box, integrate, regular_polygon, ring, with_arcs
from fem.sections.shear import cowper_box, cowper_tube
from fem.sections.walls import Walls, wall_constants

MOST_SIDES = 360
"""Sides of a hollow polygon; with more it is a tube."""


class HollowShapes(SectionConstants):
    """Constructors of hollow sections."""

    __slots__ = ()

    @classmethod
    def hollow_rectangle(cls, b: float, h: float, t: float, r: float = 0.0, nu: float = 0.0) -> Self:
        """Hollow rectangle with wall t and outer corner radius r; the inner radius is r - t, or 0 [m].

        J = 4 Am² t / p + p t³ / 3, with the area Am within the wall's centre line and its length p
        (EN 10210-2, annex A); k after Cowper 1966 for thin walls along the centre line.
        """
        _check_wall("hollow rectangle", b, h, t)
        check_radius("hollow rectangle", r, min(b, h) / 2)
        ri, middle = max(r - t, 0.0), max(r - t / 2, 0.0)
        bi, hi, bm, hm = b - 2 * t, h - 2 * t, b - t, h - t
        figure = integrate(
            [box(b, h), box(bi, hi)],
            [
                (sy * B / 2, sz * H / 2, -sy, -sz, radius)
                for B, H, radius in ((b, h, -r), (bi, hi, ri))
                for sy in (-1, 1)
                for sz in (-1, 1)
            ],
        )
        Am, p = bm * hm - (4 - np.pi) * middle**2, 2 * (bm + hm) - 2 * (4 - np.pi) * middle
        shear = 2 * t * (bm + hm) / figure.A
        return cls(
            figure.A,
            figure.Iy,
            figure.Iz,
            4 * Am**2 * t / p + p * t**3 / 3,
            shear * cowper_box(hm, bm, checked_ratio("hollow rectangle", nu)),
            shear * cowper_box(bm, hm, nu),
            (with_arcs(box(b, h), [r] * 4), with_arcs(box(bi, hi), [ri] * 4)),
            walls=_ring_of_walls(with_arcs(box(bm, hm), [middle] * 4), t),
            **shape_fields("hollow_rectangle", b=b, h=h, t=t, r=r, nu=nu),
        )

    @classmethod
    def tube(cls, d: float, t: float, nu: float = 0.0) -> Self:
        """Round tube of outer diameter d and wall t, thin or thick [m].

        k = 6 (1 + ν)(1 + m²)² / ((7 + 6 ν)(1 + m²)² + (20 + 12 ν) m²) with m = inner / outer diameter
        (Cowper 1966): 1/2 for a thin wall and ν = 0.
        """
        check_positive("tube", d=d, t=t)
        if 2 * t >= d:
            msg = f"tube: the wall t = {t:g} m fills the diameter {d:g} m; t must be below half of it"
            raise PropertyError(msg)
        di = d - 2 * t
        I, k = np.pi * (d**4 - di**4) / 64, cowper_tube(di / d, checked_ratio("tube", nu))
        outlines = (ring(d, d), ring(di, di))
        return cls(np.pi * (d - t) * t, I, I, 2 * I, k, k, outlines, **shape_fields("tube", d=d, t=t, nu=nu))

    @classmethod
    def hollow_ellipse(cls, b: float, h: float, t: float) -> Self:
        """Hollow ellipse b by h whose inner axes are b - 2t and h - 2t [m].

        J by Bredt along the middle ellipse (Roark, *Formulas for Stress and Strain*, table of torsion), plus
        p t³ / 3; k from the shear flow in the wall (`fem.sections.walls`): thin walls.
        """
        _check_wall("hollow ellipse", b, h, t)
        bi, hi = b - 2 * t, h - 2 * t
        middle = ring(b - t, h - t, 96)
        inner, outer = ring(bi, hi, 96), ring(b, h, 96)
        # across its centre line the wall is thinner than t where its normal is oblique
        strips = np.stack([inner, outer, np.roll(outer, -1, axis=0), np.roll(inner, -1, axis=0)], axis=1)
        area = np.array([integrate([strip]).A for strip in strips])
        length = np.linalg.norm(np.roll(middle, -1, axis=0) - middle, axis=1)
        pairs = [(k, (k + 1) % 96) for k in range(96)]
        walls = wall_constants(middle, pairs, area / length)
        p = float(length.sum())
        A = np.pi * (b * h - bi * hi) / 4
        return cls(
            A,
            np.pi * (b * h**3 - bi * hi**3) / 64,
            np.pi * (h * b**3 - hi * bi**3) / 64,
            walls.J_cells + p * t**3 / 3,
            walls.area_y / A,
            walls.area_z / A,
            (ring(b, h), ring(bi, hi)),
            walls=_ring_of_walls(middle, area / length),
            **shape_fields("hollow_ellipse", b=b, h=h, t=t),
        )

    @classmethod
    def hollow_polygon(cls, n: float, d: float, t: float) -> Self:
        """Regular polygon with n sides, d across flats (twice the inner radius), wall t [m].

        One flat faces -z. J = 4 Am² t / p + p t³ / 3 along the wall's centre line (Bredt); k from the shear
        flow in the wall (`fem.sections.walls`).
        """
        check_positive("hollow polygon", d=d, t=t)
        if not (3 <= n <= MOST_SIDES and float(n).is_integer()):
            msg = f"hollow polygon: n is {n}; it must be an integer number of sides, 3 to {MOST_SIDES}"
            raise PropertyError(msg)
        if 2 * t >= d:
            msg = f"hollow polygon: the wall t = {t:g} m fills the width {d:g} m; t must be below half of it"
            raise PropertyError(msg)
        sides = int(n)
        outer, inner, middle = (regular_polygon(sides, w) for w in (d, d - 2 * t, d - t))
        figure = integrate([outer, inner])
        walls = wall_constants(middle, [(k, (k + 1) % sides) for k in range(sides)], np.full(sides, t))
        p = float(sides * np.linalg.norm(middle[1] - middle[0]))
        k = walls.area_z / figure.A  # equal in all directions, as I is
        return cls(
            figure.A,
            figure.Iy,
            figure.Iy,
            walls.J_cells + p * t**3 / 3,
            k,
            k,
            (outer, inner),
            walls=_ring_of_walls(middle, t),
            **shape_fields("hollow_polygon", n=sides, d=d, t=t),
        )


def _check_wall(shape: str, b: float, h: float, t: float) -> None:
    check_positive(shape, b=b, h=h, t=t)
    if 2 * t >= min(b, h):
        msg = f"{shape}: the wall t = {t:g} m fills the section {b:g} x {h:g} m; t must be below half of it"
        raise PropertyError(msg)


def _ring_of_walls(corners: Floats, thickness: Floats | float) -> Walls:
    """Return the walls of one closed cell along its centre line."""
    n = len(corners)
    return Walls(corners, tuple((k, (k + 1) % n) for k in range(n)), np.broadcast_to(thickness, (n,)))
