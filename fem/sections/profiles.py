"""Open profiles: I, T, channel, angle and cruciform, of straight thin walls with fillets."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np

from fem.array_types import Floats
from fem.materials import PropertyError
from fem.sections.constants import SectionConstants
from fem.sections.dimensions import check_positive, check_radius, checked_ratio, shape_fields
from fem.sections.outlines import Fillet, integrate, turned, with_arcs
from fem.sections.shear import cowper_rectangle
from fem.sections.walls import Walls, wall_constants

Places = list[tuple[float, float]]


def cross_of_plates(b: float, h: float, tw: float, th: float) -> tuple[Places, Places, list[tuple[int, int]]]:
    """Return outline, places and walls of two plates that cross: th thick along y, b wide, and tw along z."""
    w, t, y, z = tw / 2, th / 2, b / 2, h / 2
    quarter = [(w, -z), (w, -t), (y, -t)]
    right = [*quarter, *((p, -q) for p, q in reversed(quarter))]
    outline = [*right, *((-p, -q) for p, q in right)]
    points = [(0.0, 0.0), (-y, 0.0), (y, 0.0), (0.0, -z), (0.0, z)]
    return outline, points, [(1, 0), (0, 2), (3, 0), (0, 4)]


class ProfileShapes(SectionConstants):
    """Constructors of open profiles."""

    __slots__ = ()

    @classmethod
    def i_section(cls, b: float, h: float, tf: float, tw: float, r: float = 0.0, nu: float = 0.0) -> Self:
        """Doubly symmetric I: flange width b, height h, flange tf, web tw, root radius r [m].

        J after El Darwish & Johnston (`t_junction`); kz after Cowper 1966 for thin walls, ky that of the
        flanges as two rectangles. Warping torsion is left out.
        """
        section = cls.unequal_i_section(b, b, h, tf, tf, tw, r)
        web = h - tf
        m, n = 2 * b * tf / (web * tw), b / web
        walls = (2 * b * tf + web * tw) / section.A
        below = 12 + 72 * m + 150 * m**2 + 90 * m**3 + 30 * n**2 * (m + m**2)
        below += nu * (11 + 66 * m + 135 * m**2 + 90 * m**3 + 5 * n**2 * (8 * m + 9 * m**2))
        return replace(
            section,
            ky=cowper_rectangle(checked_ratio("I section", nu)) * 2 * b * tf / section.A,
            kz=walls * 10 * (1 + nu) * (1 + 3 * m) ** 2 / below,
            shear_centre=(0.0, 0.0),
            **shape_fields("i_section", b=b, h=h, tf=tf, tw=tw, r=r, nu=nu),
        )

    @classmethod
    def unequal_i_section(
        cls, b1: float, b2: float, h: float, tf1: float, tf2: float, tw: float, r: float = 0.0
    ) -> Self:
        """I with unlike flanges: b1 by tf1 at the bottom (-z), b2 by tf2 at the top, height h, web tw [m].

        J after El Darwish & Johnston (`t_junction`); k and shear centre from the shear flow
        (`fem.sections.walls`). The root radius r is that of all four fillets. Warping torsion is left out.
        """
        check_positive("I section", b1=b1, b2=b2, h=h, tf1=tf1, tf2=tf2, tw=tw)
        if tf1 + tf2 >= h or tw >= min(b1, b2):
            msg = (
                f"I section: flanges {tf1:g} and {tf2:g} m in height {h:g} m, web {tw:g} m in width "
                f"{min(b1, b2):g} m do not fit"
            )
            raise PropertyError(msg)
        check_radius("I section", r, min(min(b1, b2) - tw, h - tf1 - tf2) / 2)
        w, low, top = tw / 2, tf1, h - tf2
        right = [(b1 / 2, 0.0), (b1 / 2, low), (w, low), (w, top), (b2 / 2, top), (b2 / 2, h)]
        outline = np.array([*right, *((-y, z) for y, z in reversed(right))])
        fillets = [(s * w, z, s, e, r) for s in (-1, 1) for z, e in ((low, 1), (top, -1))]
        z1, z2 = tf1 / 2, h - tf2 / 2
        points = [(0, z1), (-b1 / 2, z1), (b1 / 2, z1), (0, z2), (-b2 / 2, z2), (b2 / 2, z2)]
        J = t_junction(b1, tf1, tw, r) + t_junction(b2, tf2, tw, r) + (h - tf1 - tf2) * tw**3 / 3
        named = shape_fields("unequal_i_section", b1=b1, b2=b2, h=h, tf1=tf1, tf2=tf2, tw=tw, r=r)
        walls = [(1, 0), (0, 2), (0, 3), (4, 3), (3, 5)]
        return cls._of_walls(
            outline, fillets, [0, 0, r, r, 0, 0] * 2, points, walls, [tf1, tf1, tw, tf2, tf2], J, named
        )

    @classmethod
    def t_section(cls, b: float, h: float, tf: float, tw: float, r: float = 0.0) -> Self:
        """T: flange b by tf at the top (+z), height h over all, stem tw, root radius r [m].

        J after El Darwish & Johnston (`t_junction`); k and shear centre from the shear flow
        (`fem.sections.walls`), kz equal to Cowper's (1966) for ν = 0. Warping torsion is left out.
        """
        check_positive("T section", b=b, h=h, tf=tf, tw=tw)
        if tf >= h or tw >= b:
            msg = f"T section: flange {tf:g} m in height {h:g} m, stem {tw:g} m in width {b:g} m do not fit"
            raise PropertyError(msg)
        check_radius("T section", r, min((b - tw) / 2, h - tf))
        w, low = tw / 2, h - tf
        right = [(w, 0.0), (w, low), (b / 2, low), (b / 2, h)]
        outline = np.array([*right, *((-y, z) for y, z in reversed(right))])
        points = [(0, h - tf / 2), (-b / 2, h - tf / 2), (b / 2, h - tf / 2), (0, 0)]
        J = t_junction(b, tf, tw, r) + (h - tf) * tw**3 / 3 - END_LOSS * tw**4
        return cls._of_walls(
            outline,
            [(s * w, low, s, -1, r) for s in (-1, 1)],
            [0, r, 0, 0, 0, 0, r, 0],
            points,
            [(1, 0), (0, 2), (0, 3)],
            [tf, tf, tw],
            J,
            shape_fields("t_section", b=b, h=h, tf=tf, tw=tw, r=r),
        )

    @classmethod
    def channel(cls, b: float, h: float, tf: float, tw: float, r: float = 0.0) -> Self:
        """Channel with parallel flanges towards +y: flange width b over all, height h, root radius r [m].

        J after El Darwish & Johnston (`corner`); k and shear centre from the shear flow
        (`fem.sections.walls`). Warping torsion is left out.
        """
        check_positive("channel", b=b, h=h, tf=tf, tw=tw)
        if 2 * tf >= h or tw >= b:
            msg = f"channel: flanges 2 x {tf:g} m in height {h:g} m, web {tw:g} m in width {b:g} m do not fit"
            raise PropertyError(msg)
        check_radius("channel", r, min(b - tw, h / 2 - tf))
        z = h / 2
        outline = np.array(
            [(0, -z), (b, -z), (b, tf - z), (tw, tf - z), (tw, z - tf), (b, z - tf), (b, z), (0, z)]
        )
        middle = z - tf / 2
        points = [(b, -middle), (tw / 2, -middle), (tw / 2, middle), (b, middle)]
        J = 2 * corner(b, tf, tw, r) - 2 * END_LOSS * tf**4 + (h - 2 * tf) * tw**3 / 3
        return cls._of_walls(
            outline,
            [(tw, s * (z - tf), 1, -s, r) for s in (-1, 1)],
            [0, 0, 0, r, r, 0, 0, 0],
            points,
            [(0, 1), (1, 2), (2, 3)],
            [tf, tw, tf],
            J,
            shape_fields("channel", b=b, h=h, tf=tf, tw=tw, r=r),
        )

    @classmethod
    def angle_section(cls, b: float, h: float, t: float, r: float = 0.0) -> Self:
        """Angle: legs b along +y and h along +z over all, thickness t, root radius r [m].

        The member's orientation is that of the leg h; constants, outlines and shear centre are in principal
        axes, turned by ``angle``. J after El Darwish & Johnston (`corner`); k and shear centre from the
        shear flow (`fem.sections.walls`).
        """
        check_positive("angle", b=b, h=h, t=t)
        if t >= min(b, h):
            msg = f"angle: the thickness {t:g} m does not fit into legs of {b:g} and {h:g} m"
            raise PropertyError(msg)
        check_radius("angle", r, min(b, h) - t)
        outline = np.array([(0, 0), (b, 0), (b, t), (t, t), (t, h), (0, h)])
        J = corner(b, t, t, r) + (h - t) * t**3 / 3 - 2 * END_LOSS * t**4
        return cls._of_walls(
            outline,
            [(t, t, 1, 1, r)],
            [0, 0, 0, r, 0, 0],
            [(b, t / 2), (t / 2, t / 2), (t / 2, h)],
            [(0, 1), (1, 2)],
            [t, t],
            J,
            shape_fields("angle_section", b=b, h=h, t=t, r=r),
        )

    @classmethod
    def cruciform(cls, b: float, h: float, t: float) -> Self:
        """Two plates of thickness t that cross in their middles: b along y, h along z [m].

        J = (b + h - t) t³ / 3 - 4 · 0.105 t⁴ + 0.68 t⁴: four free ends, and a crossing whose share is that of
        a finite element solution; k from the shear flow (`fem.sections.walls`) of each plate.
        """
        check_positive("cruciform", b=b, h=h, t=t)
        if t >= min(b, h):
            msg = f"cruciform: the thickness {t:g} m does not fit into plates of {b:g} and {h:g} m"
            raise PropertyError(msg)
        outline, points, walls = cross_of_plates(b, h, t, t)
        return cls._of_walls(
            np.array(outline),
            [],
            [0] * 12,
            points,
            walls,
            [t, t, t, t],
            (b + h - t) * t**3 / 3 - 4 * END_LOSS * t**4 + CROSSING * t**4,
            shape_fields("cruciform", b=b, h=h, t=t),
        )

    @classmethod
    def _of_walls(
        cls,
        outline: Floats,
        fillets: Sequence[Fillet],
        radii: Sequence[float],
        points: Sequence[tuple[float, float]],
        walls: list[tuple[int, int]],
        thickness: Sequence[float],
        J: float,
        named: dict[str, Any],
    ) -> Self:
        """Return a profile in principal axes: an outline with fillets, and walls along their centre lines."""
        figure = integrate([outline], fillets)
        angle, centre = figure.principal_angle, figure.centroid
        about = figure.centred().turned(angle)
        walls_turned = Walls(turned(points, centre, angle), tuple(walls), np.array(thickness))
        flow = wall_constants(*walls_turned)
        y, z = (float(v) if abs(v) > 1e-12 * np.sqrt(figure.A) else 0.0 for v in flow.shear_centre)
        return cls(
            figure.A,
            about.Iy,
            about.Iz,
            J,
            flow.area_y / figure.A,
            flow.area_z / figure.A,
            (turned(with_arcs(outline, radii), centre, angle),),
            angle=angle,
            shear_centre=(y, z),
            walls=walls_turned,
            **named,
        )


# Torsion constants of the walls, junctions and corners of open sections -------------------------------------
# St Venant's torsion: open sections are stiffer near ends that cannot warp than by J alone.


END_LOSS = 0.105
"""Loss of a wall's free end on b t³/3, in t⁴: half of 0.630/3 (Timoshenko & Goodier, art. 109)."""

CROSSING = 0.68
"""Gain of J by the crossing of two plates, in t⁴: from finite elements, see the tests."""


def t_junction(b: float, tf: float, tw: float, r: float = 0.0) -> float:
    """Return the torsion constant of a flange and its junction with a web [m⁴].

    b tf³/3 - 0.21 tf⁴ + α D⁴ with the inscribed circle D = ((tf + r)² + (r + tw/4) tw) / (2r + tf) and

        α = -0.042 + 0.2204 tw/tf + 0.1355 r/tf - 0.0865 r tw/tf² - 0.0725 (tw/tf)²

    El Darwish & Johnston, *Torsion of structural shapes*, J. Struct. Div. ASCE 91 ST1 (1965) 203-227, as
    steel tables have it. Within 0.6 % of finite elements for a T with tw/tf from 0.3 to 1.4 and b/tf = 10.
    Webs more than twice as thick as the flange are taken as walls that run through it.
    """
    if tw > 2 * tf:
        return (b - tw) * tf**3 / 3 + tf * tw**3 / 3 - 2 * END_LOSS * tf**4 - END_LOSS * tw**4
    q, p = tw / tf, r / tf
    D = ((tf + r) ** 2 + (r + tw / 4) * tw) / (2 * r + tf)
    alpha = -0.042 + 0.2204 * q + 0.1355 * p - 0.0865 * p * q - 0.0725 * q**2
    return b * tf**3 / 3 - 2 * END_LOSS * tf**4 + alpha * D**4


def corner(b: float, tf: float, tw: float, r: float = 0.0) -> float:
    """Return the torsion constant of a flange up to its corner with a web, less the corner's share [m⁴].

    b tf³/3 - 0.105 tf⁴ + α D⁴ for a flange not thinner than the web, with the inscribed circle
    D = 2 (3r + tw + tf - √(2 (2r + tw)(2r + tf))) and, q = tw/tf,

        α = -0.0908 + 0.2621 q + 0.1231 r/tf - 0.0752 q r/tf - 0.0945 q²

    (El Darwish & Johnston 1965); the other way round, the web runs through. Free ends are left to the caller.
    """
    thick, thin = max(tf, tw), min(tf, tw)
    q, p = thin / thick, r / thick
    D = 2 * (3 * r + tw + tf - np.sqrt(2 * (2 * r + tw) * (2 * r + tf)))
    alpha = -0.0908 + 0.2621 * q + 0.1231 * p - 0.0752 * p * q - 0.0945 * q**2
    walls = b * tf**3 / 3 if tf >= tw else (b - tw) * tf**3 / 3 + tf * tw**3 / 3
    return float(walls - END_LOSS * thick**4 + alpha * D**4)
