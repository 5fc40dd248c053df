"""Cross-sections: standard shapes with their formulas, and polygons.

Local axes of a member: x along it, z the direction of the section's height h, y that of its width b.
``Iy`` is the second moment for bending in the x-z plane (rotation about y), and ``Iz`` is the one for bending
in the x-y plane.

Shear coefficients are those of Cowper, *The shear coefficient in Timoshenko's beam theory*, J. Appl. Mech.
33 (1966) 335-340, where he has the shape, at Poisson's ratio ``nu``; those of rectangles are Hutchinson's,
which knows how flat they are. At nu = 0, unless given, they are the values of least energy as well. Other
shapes have the energy's value for thin walls, which does not depend on nu. Walls are counted along their
centre lines, and fillets not: this makes k too small, by 1 to 3 % for walls of a twentieth of the height, by
5 to 8 % for a tenth, by up to 17 % in rolled profiles with large fillets.

Torsion is St Venant's: open sections are stiffer near ends that cannot warp than their J says.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.materials import PropertyError
from fem.sections.outlines import Fillet, Floats, Integrals, closed_polygon, integrate, with_arcs
from fem.sections.walls import wall_constants
from fem.sections.warping import warping_constants

LARGEST_SHEAR_COEFFICIENT = 10.0
"""Flat bars have large shear coefficients; above this, shear deformation no longer matters [-]."""

SHAPES: dict[str, tuple[str, ...]] = {
    "rectangle": ("b", "h"),
    "hollow_rectangle": ("b", "h", "t"),
    "circle": ("d",),
    "tube": ("d", "t"),
    "ellipse": ("b", "h"),
    "hollow_ellipse": ("b", "h", "t"),
    "hollow_polygon": ("n", "d", "t"),
    "i_section": ("b", "h", "tf", "tw"),
    "unequal_i_section": ("b1", "b2", "h", "tf1", "tf2", "tw"),
    "t_section": ("b", "h", "tf", "tw"),
    "channel": ("b", "h", "tf", "tw"),
    "angle_section": ("b", "h", "t"),
    "cruciform": ("b", "h", "t"),
}
"""Shapes of sections and their dimensions [m], n a number: methods of `Section` and their arguments."""

OPTIONS: dict[str, tuple[str, ...]] = {
    "rectangle": ("nu",),
    "hollow_rectangle": ("r", "nu"),
    "circle": ("nu",),
    "tube": ("nu",),
    "ellipse": ("nu",),
    "i_section": ("r", "nu"),
    "unequal_i_section": ("r",),
    "t_section": ("r",),
    "channel": ("r",),
    "angle_section": ("r",),
}
"""What some shapes may have beside: a radius r [m], and Poisson's ratio nu of the shear coefficient [-]."""

MOST_SIDES = 360
"""Sides of a hollow polygon; with more it is a tube."""

SOLID = ("rectangle", "circle", "ellipse")
"""Those without walls."""

WORDS = {
    "i_section": "I",
    "unequal_i_section": "I",
    "t_section": "T",
    "angle_section": "angle",
}


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
    angle : float
        From the axis y of the member's orientation to the section's principal axis y, towards z [rad].
        Constants, outlines and shear centre are in principal axes; the frame turns the local axes.
    estimated_k : bool
        Whether ky and kz are those of a shape with walls, in which books and programs differ much: for boxes
        from 0.26 to 0.44 in one direction.
    shear_centre : (float, float)
        y and z of the shear centre from the centroid [m]. Beam elements do not use it: they bend and twist
        about the centroid, and bending without twist needs it to be zero.
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
    angle: float = 0.0
    shear_centre: tuple[float, float] = (0.0, 0.0)
    estimated_k: bool = False

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

    @classmethod
    def of_shape(cls, shape: str, **dimensions: float) -> "Section":
        """Return a section of a shape that is named, with dimensions of `SHAPES` and `OPTIONS` [m]."""
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
            if a == b:  # and numbers of sides stay whole
                return a
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
            angle=linear(first.angle, second.angle),
            shear_centre=(
                linear(first.shear_centre[0], second.shear_centre[0]),
                linear(first.shear_centre[1], second.shear_centre[1]),
            ),
        )

    @classmethod
    def rectangle(cls, b: float, h: float, nu: float = 0.0) -> "Section":
        """Solid rectangle: width b along y, height h along z [m].

        J from the series of Timoshenko & Goodier, *Theory of Elasticity*, art. 109; k of each direction from
        :func:`shear_coefficient_of_rectangle`, 5/6 for ν = 0 whatever the sides.
        """
        _positive("rectangle", b=b, h=h)
        long, short = max(b, h), min(b, h)
        n = np.arange(1, 60, 2)
        series = float((np.tanh(n * np.pi * long / (2 * short)) / n**5).sum())
        J = long * short**3 / 3 * (1 - 192 * short / (np.pi**5 * long) * series)
        _ratio("rectangle", nu)
        return cls(
            b * h,
            b * h**3 / 12,
            h * b**3 / 12,
            J,
            shear_coefficient_of_rectangle(h, b, nu),
            shear_coefficient_of_rectangle(b, h, nu),
            (_box(b, h),),
            **_named("rectangle", b=b, h=h, nu=nu),
        )

    @classmethod
    def hollow_rectangle(cls, b: float, h: float, t: float, r: float = 0.0, nu: float = 0.0) -> "Section":
        """Hollow rectangle with wall t and outer corner radius r; the inner radius is r - t, or 0 [m].

        J = 4 Am² t / p + p t³ / 3, with the area Am within the wall's centre line and its length p
        (EN 10210-2, annex A); k after Cowper 1966 for thin walls along the centre line.
        """
        _positive("hollow rectangle", b=b, h=h, t=t)
        if 2 * t >= min(b, h):
            msg = (
                f"hollow rectangle: the wall t = {t:g} m fills the section {b:g} x {h:g} m; "
                "t must be below half of it"
            )
            raise PropertyError(msg)
        _radius("hollow rectangle", r, min(b, h) / 2)
        ri, middle = max(r - t, 0.0), max(r - t / 2, 0.0)
        bi, hi, bm, hm = b - 2 * t, h - 2 * t, b - t, h - t
        figure = integrate(
            [_box(b, h), _box(bi, hi)],
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
            shear * _cowper_box(hm, bm, _ratio("hollow rectangle", nu)),
            shear * _cowper_box(bm, hm, nu),
            (with_arcs(_box(b, h), [r] * 4), with_arcs(_box(bi, hi), [ri] * 4)),
            **_named("hollow_rectangle", b=b, h=h, t=t, r=r, nu=nu),
        )

    @classmethod
    def circle(cls, d: float, nu: float = 0.0) -> "Section":
        """Solid circle of diameter d [m]; k = 6 (1 + ν) / (7 + 6 ν) (Cowper 1966)."""
        _positive("circle", d=d)
        I, k = np.pi * d**4 / 64, _cowper_tube(0.0, _ratio("circle", nu))
        return cls(np.pi * d**2 / 4, I, I, 2 * I, k, k, (_ring(d, d),), **_named("circle", d=d, nu=nu))

    @classmethod
    def tube(cls, d: float, t: float, nu: float = 0.0) -> "Section":
        """Round tube of outer diameter d and wall t, thin or thick [m].

        k = 6 (1 + ν)(1 + m²)² / ((7 + 6 ν)(1 + m²)² + (20 + 12 ν) m²) with m = inner / outer diameter
        (Cowper 1966): 1/2 for a thin wall and ν = 0.
        """
        _positive("tube", d=d, t=t)
        if 2 * t >= d:
            msg = f"tube: the wall t = {t:g} m fills the diameter {d:g} m; t must be below half of it"
            raise PropertyError(msg)
        di = d - 2 * t
        I, k = np.pi * (d**4 - di**4) / 64, _cowper_tube(di / d, _ratio("tube", nu))
        outlines = (_ring(d, d), _ring(di, di))
        return cls(np.pi * (d - t) * t, I, I, 2 * I, k, k, outlines, **_named("tube", d=d, t=t, nu=nu))

    @classmethod
    def ellipse(cls, b: float, h: float, nu: float = 0.0) -> "Section":
        """Solid ellipse: width b along y, height h along z [m].

        With the half axes: J = π b³ h³ / (b² + h²) (Timoshenko & Goodier, art. 105), and for shear along h
        k = 12 (1 + ν) h² (3h² + b²) / ((40 + 37 ν) h⁴ + (16 + 10 ν) h² b² + ν b⁴) (Cowper 1966).
        """
        _positive("ellipse", b=b, h=h)
        _ratio("ellipse", nu)
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
            (_ring(b, h),),
            **_named("ellipse", b=b, h=h, nu=nu),
        )

    @classmethod
    def hollow_ellipse(cls, b: float, h: float, t: float) -> "Section":
        """Hollow ellipse b by h whose inner axes are b - 2t and h - 2t [m].

        J by Bredt along the middle ellipse (Roark, *Formulas for Stress and Strain*, table of torsion), plus
        p t³ / 3; k from the shear flow in the wall (`fem.sections.walls`): thin walls.
        """
        _positive("hollow ellipse", b=b, h=h, t=t)
        if 2 * t >= min(b, h):
            msg = (
                f"hollow ellipse: the wall t = {t:g} m fills the section {b:g} x {h:g} m; "
                "t must be below half of it"
            )
            raise PropertyError(msg)
        bi, hi = b - 2 * t, h - 2 * t
        middle = _ring(b - t, h - t, 96)
        inner, outer = _ring(bi, hi, 96), _ring(b, h, 96)
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
            (_ring(b, h), _ring(bi, hi)),
            **_named("hollow_ellipse", b=b, h=h, t=t),
        )

    @classmethod
    def hollow_polygon(cls, n: float, d: float, t: float) -> "Section":
        """Regular polygon with n sides, d across flats (twice the inner radius), wall t [m].

        One flat faces -z. J = 4 Am² t / p + p t³ / 3 along the wall's centre line (Bredt); k from the shear
        flow in the wall (`fem.sections.walls`).
        """
        _positive("hollow polygon", d=d, t=t)
        if not (3 <= n <= MOST_SIDES and float(n).is_integer()):
            msg = f"hollow polygon: n is {n}; it must be a whole number of sides, 3 to {MOST_SIDES}"
            raise PropertyError(msg)
        if 2 * t >= d:
            msg = f"hollow polygon: the wall t = {t:g} m fills the width {d:g} m; t must be below half of it"
            raise PropertyError(msg)
        sides = int(n)
        outer, inner, middle = (_regular(sides, w) for w in (d, d - 2 * t, d - t))
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
            **_named("hollow_polygon", n=sides, d=d, t=t),
        )

    @classmethod
    def i_section(
        cls, b: float, h: float, tf: float, tw: float, r: float = 0.0, nu: float = 0.0
    ) -> "Section":
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
            ky=_cowper_rectangle(_ratio("I section", nu)) * 2 * b * tf / section.A,
            kz=walls * 10 * (1 + nu) * (1 + 3 * m) ** 2 / below,
            shear_centre=(0.0, 0.0),
            **_named("i_section", b=b, h=h, tf=tf, tw=tw, r=r, nu=nu),
        )

    @classmethod
    def unequal_i_section(
        cls, b1: float, b2: float, h: float, tf1: float, tf2: float, tw: float, r: float = 0.0
    ) -> "Section":
        """I with unlike flanges: b1 by tf1 at the bottom (-z), b2 by tf2 at the top, height h, web tw [m].

        J after El Darwish & Johnston (`t_junction`); k and shear centre from the shear flow
        (`fem.sections.walls`). The root radius r is that of all four fillets. Warping torsion is left out.
        """
        _positive("I section", b1=b1, b2=b2, h=h, tf1=tf1, tf2=tf2, tw=tw)
        if tf1 + tf2 >= h or tw >= min(b1, b2):
            msg = (
                f"I section: flanges {tf1:g} and {tf2:g} m in height {h:g} m, web {tw:g} m in width "
                f"{min(b1, b2):g} m do not fit"
            )
            raise PropertyError(msg)
        _radius("I section", r, min(min(b1, b2) - tw, h - tf1 - tf2) / 2)
        w, low, top = tw / 2, tf1, h - tf2
        right = [(b1 / 2, 0.0), (b1 / 2, low), (w, low), (w, top), (b2 / 2, top), (b2 / 2, h)]
        outline = np.array([*right, *((-y, z) for y, z in reversed(right))])
        fillets = [(s * w, z, s, e, r) for s in (-1, 1) for z, e in ((low, 1), (top, -1))]
        z1, z2 = tf1 / 2, h - tf2 / 2
        points = [(0, z1), (-b1 / 2, z1), (b1 / 2, z1), (0, z2), (-b2 / 2, z2), (b2 / 2, z2)]
        J = t_junction(b1, tf1, tw, r) + t_junction(b2, tf2, tw, r) + (h - tf1 - tf2) * tw**3 / 3
        named = _named("unequal_i_section", b1=b1, b2=b2, h=h, tf1=tf1, tf2=tf2, tw=tw, r=r)
        walls = [(1, 0), (0, 2), (0, 3), (4, 3), (3, 5)]
        return cls._open(
            outline, fillets, [0, 0, r, r, 0, 0] * 2, points, walls, [tf1, tf1, tw, tf2, tf2], J, named
        )

    @classmethod
    def t_section(cls, b: float, h: float, tf: float, tw: float, r: float = 0.0) -> "Section":
        """T: flange b by tf at the top (+z), height h over all, stem tw, root radius r [m].

        J after El Darwish & Johnston (`t_junction`); k and shear centre from the shear flow
        (`fem.sections.walls`), in kz what Cowper 1966 has for ν = 0. Warping torsion is left out.
        """
        _positive("T section", b=b, h=h, tf=tf, tw=tw)
        if tf >= h or tw >= b:
            msg = f"T section: flange {tf:g} m in height {h:g} m, stem {tw:g} m in width {b:g} m do not fit"
            raise PropertyError(msg)
        _radius("T section", r, min((b - tw) / 2, h - tf))
        w, low = tw / 2, h - tf
        right = [(w, 0.0), (w, low), (b / 2, low), (b / 2, h)]
        outline = np.array([*right, *((-y, z) for y, z in reversed(right))])
        points = [(0, h - tf / 2), (-b / 2, h - tf / 2), (b / 2, h - tf / 2), (0, 0)]
        J = t_junction(b, tf, tw, r) + (h - tf) * tw**3 / 3 - END_LOSS * tw**4
        return cls._open(
            outline,
            [(s * w, low, s, -1, r) for s in (-1, 1)],
            [0, r, 0, 0, 0, 0, r, 0],
            points,
            [(1, 0), (0, 2), (0, 3)],
            [tf, tf, tw],
            J,
            _named("t_section", b=b, h=h, tf=tf, tw=tw, r=r),
        )

    @classmethod
    def channel(cls, b: float, h: float, tf: float, tw: float, r: float = 0.0) -> "Section":
        """Channel with parallel flanges towards +y: flange width b over all, height h, root radius r [m].

        J after El Darwish & Johnston (`corner`); k and shear centre from the shear flow
        (`fem.sections.walls`). Warping torsion is left out.
        """
        _positive("channel", b=b, h=h, tf=tf, tw=tw)
        if 2 * tf >= h or tw >= b:
            msg = f"channel: flanges 2 x {tf:g} m in height {h:g} m, web {tw:g} m in width {b:g} m do not fit"
            raise PropertyError(msg)
        _radius("channel", r, min(b - tw, h / 2 - tf))
        z = h / 2
        outline = np.array(
            [(0, -z), (b, -z), (b, tf - z), (tw, tf - z), (tw, z - tf), (b, z - tf), (b, z), (0, z)]
        )
        middle = z - tf / 2
        points = [(b, -middle), (tw / 2, -middle), (tw / 2, middle), (b, middle)]
        J = 2 * corner(b, tf, tw, r) - 2 * END_LOSS * tf**4 + (h - 2 * tf) * tw**3 / 3
        return cls._open(
            outline,
            [(tw, s * (z - tf), 1, -s, r) for s in (-1, 1)],
            [0, 0, 0, r, r, 0, 0, 0],
            points,
            [(0, 1), (1, 2), (2, 3)],
            [tf, tw, tf],
            J,
            _named("channel", b=b, h=h, tf=tf, tw=tw, r=r),
        )

    @classmethod
    def angle_section(cls, b: float, h: float, t: float, r: float = 0.0) -> "Section":
        """Angle: legs b along +y and h along +z over all, thickness t, root radius r [m].

        The member's orientation is that of the leg h; constants, outlines and shear centre are in principal
        axes, turned by ``angle``. J after El Darwish & Johnston (`corner`); k and shear centre from the
        shear flow (`fem.sections.walls`).
        """
        _positive("angle", b=b, h=h, t=t)
        if t >= min(b, h):
            msg = f"angle: the thickness {t:g} m does not fit into legs of {b:g} and {h:g} m"
            raise PropertyError(msg)
        _radius("angle", r, min(b, h) - t)
        outline = np.array([(0, 0), (b, 0), (b, t), (t, t), (t, h), (0, h)])
        J = corner(b, t, t, r) + (h - t) * t**3 / 3 - 2 * END_LOSS * t**4
        return cls._open(
            outline,
            [(t, t, 1, 1, r)],
            [0, 0, 0, r, 0, 0],
            [(b, t / 2), (t / 2, t / 2), (t / 2, h)],
            [(0, 1), (1, 2)],
            [t, t],
            J,
            _named("angle_section", b=b, h=h, t=t, r=r),
        )

    @classmethod
    def cruciform(cls, b: float, h: float, t: float) -> "Section":
        """Two plates of thickness t that cross in their middles: b along y, h along z [m].

        J = (b + h - t) t³ / 3 - 4 · 0.105 t⁴ + 0.68 t⁴: four free ends, and a crossing whose share is that of
        a finite element solution; k from the shear flow (`fem.sections.walls`): each plate bears its own
        shear.
        """
        _positive("cruciform", b=b, h=h, t=t)
        if t >= min(b, h):
            msg = f"cruciform: the thickness {t:g} m does not fit into plates of {b:g} and {h:g} m"
            raise PropertyError(msg)
        w, y, z = t / 2, b / 2, h / 2
        quarter = [(w, -z), (w, -w), (y, -w)]
        right = [*quarter, *((p, -q) for p, q in reversed(quarter))]
        outline = np.array([*right, *((-p, -q) for p, q in right)])
        return cls._open(
            outline,
            [],
            [0] * 12,
            [(0, 0), (-y, 0), (y, 0), (0, -z), (0, z)],
            [(1, 0), (0, 2), (3, 0), (0, 4)],
            [t, t, t, t],
            (b + h - t) * t**3 / 3 - 4 * END_LOSS * t**4 + CROSSING * t**4,
            _named("cruciform", b=b, h=h, t=t),
        )

    @classmethod
    def polygon(
        cls,
        outer: ArrayLike,
        holes: Sequence[ArrayLike] = (),
        *,
        J: float,
        ky: float = 0.0,
        kz: float = 0.0,
        label: str = "polygon",
    ) -> "Section":
        """Return a section from its outline: A, Iy and Iz exact, J and k as given.

        Constants and outlines are about the centroid in principal axes, turned by ``angle``. The shear centre
        is taken to be the centroid. `arbitrary` finds the rest by finite elements.

        Parameters
        ----------
        outer : array_like (n, 2)
            Corners y, z in order, in the axes of the member's orientation, from any origin [m].
        holes : sequence of array_like (n, 2)
            Inside it, apart from each other [m].
        J : float
            Torsion constant [m⁴].
        ky, kz : float
            Shear coefficients for shear along the principal axes y and z [-]; 0 leaves shear deformation out.
        label : str
            For reports.
        """
        outlines = [closed_polygon(o) for o in (outer, *holes)]
        figure, angle, turned = _principal(outlines)
        return cls(figure.A, figure.Iy, figure.Iz, J, ky, kz, turned, label, angle=angle)

    @classmethod
    def arbitrary(
        cls,
        outer: Any,
        holes: Sequence[ArrayLike] = (),
        *,
        nu: float = 0.0,
        n_triangles: int = 2000,
        label: str = "arbitrary section",
    ) -> "Section":
        """Return a section from its outline, with J, k and shear centre by finite elements.

        St Venant's torsion and shear by the library ``sectionproperties``, which solves for the warping on
        triangles with six nodes (Pilkey, *Analysis and Design of Elastic Beams*, 2002); to install it, ``pip
        install 'dovetail[sections]'``. Constants and outlines are about the centroid in principal axes,
        turned by ``angle``. Shear that couples the two axes is left out.

        Parameters
        ----------
        outer : array_like (n, 2), or shapely.Polygon
            Corners y, z in order, in the axes of the member's orientation, from any origin [m]; a polygon of
            shapely brings its holes.
        holes : sequence of array_like (n, 2)
        nu : float
            Poisson's ratio of shear [-].
        n_triangles : int
            About how many there are.
        label : str
            For reports.

        Raises
        ------
        PropertyError
            If the library is not installed, or the outline is not one.
        """
        if hasattr(outer, "exterior"):
            outer, holes = outer.exterior.coords, [ring.coords for ring in outer.interiors]
        outlines = [closed_polygon(o) for o in (np.array(outer), *map(np.array, holes))]
        figure, angle, turned = _principal(outlines)
        _ratio(label, nu)
        found = warping_constants(turned, nu, n_triangles)
        return cls(
            figure.A,
            figure.Iy,
            figure.Iz,
            found.J,
            found.area_y / figure.A,
            found.area_z / figure.A,
            turned,
            label,
            angle=angle,
            shear_centre=found.shear_centre,
        )

    @classmethod
    def _open(
        cls,
        outline: Floats,
        fillets: Sequence[Fillet],
        radii: Sequence[float],
        points: Sequence[tuple[float, float]],
        walls: list[tuple[int, int]],
        thickness: Sequence[float],
        J: float,
        named: dict[str, Any],
    ) -> "Section":
        figure = integrate([outline], fillets)
        angle, centre = figure.principal_angle, figure.centroid
        about = figure.centred().turned(angle)
        flow = wall_constants(_turned(points, centre, angle), walls, thickness)
        y, z = (float(v) if abs(v) > 1e-12 * np.sqrt(figure.A) else 0.0 for v in flow.shear_centre)
        return cls(
            figure.A,
            about.Iy,
            about.Iz,
            J,
            flow.area_y / figure.A,
            flow.area_z / figure.A,
            (_turned(with_arcs(outline, radii), centre, angle),),
            angle=angle,
            shear_centre=(y, z),
            **named,
        )


END_LOSS = 0.105
"""What a free end of a wall takes off b t³/3, in t⁴: half of 0.630/3 (Timoshenko & Goodier, art. 109)."""

CROSSING = 0.68
"""What the crossing of two plates adds to J, in t⁴: from finite elements, see the tests."""


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


def shear_coefficient_of_rectangle(b: float, h: float, nu: float) -> float:
    """Return k of a rectangle for vibration with shear along its height h, and b across [-].

    That of Hutchinson, *J. Appl. Mech.* 68 (2001) 87-92, and of Stephen and Levinson, *J. Sound Vib.* 67
    (1979) 293-305, which are the same. Upright it is 5 (1 + ν) / (6 + 5 ν). The width of a flat bar bends
    crosswise, which stiffens it: 1.096 for b = 3h at ν = 0.3. Where 1/k falls below zero (b above 5.3 h at
    ν = 0.3, 7.1 h at 0.2) no Timoshenko beam has it, and 0 is returned, which leaves shear out.

    Cowper's 10 (1 + ν) / (12 + 11 ν), of a cantilever loaded at its tip, does not know the width. All are
    5/6 at ν = 0.
    """
    flexibility = shear_flexibility_of_rectangle(b, h, nu)
    return 1 / flexibility if flexibility > 1 / LARGEST_SHEAR_COEFFICIENT else 0.0


def shear_flexibility_of_rectangle(b: float, h: float, nu: float) -> float:
    """Return 1/k of a rectangle with shear along h: exact to the first order in (section / wave length)².

    Hutchinson, *J. Appl. Mech.* 68 (2001) 87-92, (46) and (47). Much wider than high it becomes
    -(ν/(1 + ν))² (b/h)², a strip of a thin plate.
    """
    a, c = h / 2, b / 2
    n = np.pi * np.arange(1, 2000)
    bent = float(((n * a - c * np.tanh(n * a / c)) / n**5).sum())
    C4 = (
        4 / 45 * a**3 * c * (-12 * a**2 - 15 * nu * a**2 + 5 * nu * c**2)
        + 16 * nu**2 * c**5 / (1 + nu) * bent
    )
    return -(9 / (4 * a**5 * c) * C4 + nu * (1 - (c / a) ** 2)) / (2 * (1 + nu))


def _cowper_rectangle(nu: float) -> float:
    return 10 * (1 + nu) / (12 + 11 * nu)


def _cowper_tube(m: float, nu: float) -> float:
    s = (1 + m**2) ** 2
    return 6 * (1 + nu) * s / ((7 + 6 * nu) * s + (20 + 12 * nu) * m**2)


def _cowper_box(b: float, h: float, nu: float) -> float:
    m, n = b / h, b / h  # the walls are equally thick
    below = 12 + 72 * m + 150 * m**2 + 90 * m**3 + nu * (11 + 66 * m + 135 * m**2 + 90 * m**3)
    return 10 * (1 + nu) * (1 + 3 * m) ** 2 / (below + 10 * n**2 * ((3 + nu) * m + 3 * m**2))


def _principal(outlines: Sequence[Floats]) -> tuple[Integrals, float, tuple[Floats, ...]]:
    """Return integrals about principal axes, their angle [rad], and the outlines in them [m]."""
    outlines = [o - outlines[0][0] for o in outlines]  # a far origin would cost digits
    figure = integrate(outlines)
    if not figure.A > 0:
        msg = f"the outline encloses {figure.A:g} m² less its holes; it must be positive"
        raise PropertyError(msg)
    angle, centre = figure.principal_angle, figure.centroid
    return figure.centred().turned(angle), angle, tuple(_turned(o, centre, angle) for o in outlines)


def _turned(points: ArrayLike, centre: Floats, angle: float) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return (np.asarray(points, dtype=float) - centre) @ np.array([[c, -s], [s, c]])


def _named(shape: str, **dimensions: float) -> dict[str, Any]:
    sizes = [f"{value:g}" for key, value in dimensions.items() if key not in ("r", "nu", "n")]
    label = f"{WORDS.get(shape, shape.replace('_', ' '))} {' x '.join(sizes)} m"
    if "n" in dimensions:
        label = f"{label}, {dimensions['n']} sides"
    if dimensions.get("r"):
        label = f"{label}, r {dimensions['r']:g} m"
    return {
        "label": label, "shape": shape, "dimensions": dimensions, "estimated_k": shape not in SOLID,
    }  # fmt: skip


def _words(section: Section) -> str:
    return f"a section of shape '{section.shape}'" if section.shape else "a section given by its constants"


def _positive(shape: str, **sizes: float) -> None:
    for key, value in sizes.items():
        if not (np.isfinite(value) and value > 0):
            msg = f"{shape}: {key} is {value}; it must be positive [m]"
            raise PropertyError(msg)


def _radius(shape: str, r: float, most: float) -> None:
    if not 0 <= r <= most:
        msg = f"{shape}: the radius r is {r}; it must lie between 0 and {most:g} m"
        raise PropertyError(msg)


def _ratio(shape: str, nu: float) -> float:
    if not -1 < nu <= 0.5:
        msg = f"{shape}: nu is {nu}; Poisson's ratio is above -1 and at most 0.5"
        raise PropertyError(msg)
    return nu


def _box(b: float, h: float) -> Floats:
    return np.array([(-b / 2, -h / 2), (b / 2, -h / 2), (b / 2, h / 2), (-b / 2, h / 2)])


def _ring(b: float, h: float, n: int = 24) -> Floats:
    phi = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return np.column_stack([b / 2 * np.cos(phi), h / 2 * np.sin(phi)])


def _regular(n: int, across: float) -> Floats:
    phi = -np.pi / 2 + (2 * np.arange(n) - 1) * np.pi / n
    return across / (2 * np.cos(np.pi / n)) * np.column_stack([np.cos(phi), np.sin(phi)])
