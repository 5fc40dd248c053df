"""`Section`: a cross-section by its constants, by a named shape, by an outline, or between two others."""

from fem.materials import PropertyError
from fem.sections.hollow import HollowShapes
from fem.sections.polygons import PolygonShapes
from fem.sections.profiles import ProfileShapes
from fem.sections.solid import SolidShapes
from fem.summary import fields_summary

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
"""Options of some shapes: a radius r [m], and Poisson's ratio nu of the shear coefficient [-]."""


class Section(SolidShapes, HollowShapes, ProfileShapes, PolygonShapes):
    """A cross-section: the constants of `SectionConstants`, with constructors for each kind of shape.

    A new shape is a method of the class for its kind, and a row of `SHAPES`.
    """

    __slots__ = ()

    __repr__ = fields_summary

    @classmethod
    def of_shape(cls, shape: str, **dimensions: float) -> "Section":
        """Return a section of a named shape, with dimensions of `SHAPES` and `OPTIONS` [m]."""
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
        of equally many corners. That does not hold for an I whose height alone tapers: give its shape.

        Parameters
        ----------
        first, second : Section
            At fraction 0 and 1.
        fraction : float
            Place between them, as a fraction of the length [-].

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
            if a == b:  # and numbers of sides stay integers
                return a
            return ((1 - fraction) * a ** (1 / power) + fraction * b ** (1 / power)) ** power

        if first.shape != second.shape or set(first.dimensions) != set(second.dimensions):
            msg = (
                f"no section lies between {_description(first)} and {_description(second)}: both must have "
                "the same shape and dimensions of the same names, or both be given by A, Iy, Iz and J"
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


def _description(section: Section) -> str:
    return f"a section of shape '{section.shape}'" if section.shape else "a section given by its constants"
