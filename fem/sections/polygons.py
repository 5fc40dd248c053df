"""Polygons: sections from their outline, with given constants or those of finite elements."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats
from fem.materials import PropertyError
from fem.sections.constants import SectionConstants
from fem.sections.dimensions import checked_ratio
from fem.sections.outlines import Integrals, closed_polygon, integrate, turned


class PolygonShapes(SectionConstants):
    """Constructors of sections from their outline."""

    __slots__ = ()

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
    ) -> Self:
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
        corners = [closed_polygon(o) for o in (outer, *holes)]
        figure, angle, outlines = _principal(corners)
        return cls(figure.A, figure.Iy, figure.Iz, J, ky, kz, outlines, label, angle=angle)

    @classmethod
    def arbitrary(
        cls,
        outer: Any,
        holes: Sequence[ArrayLike] = (),
        *,
        nu: float = 0.0,
        n_triangles: int = 2000,
        label: str = "arbitrary section",
    ) -> Self:
        """Return a section from its outline, with J, k and shear centre by finite elements.

        St Venant's torsion and shear by the library ``sectionproperties``, which solves for the warping on
        triangles with six nodes (Pilkey, *Analysis and Design of Elastic Beams*, 2002); it is an extra.
        Constants and outlines are about the centroid in principal axes, turned by ``angle``. Shear that
        couples the two axes is left out.

        Parameters
        ----------
        outer : array_like (n, 2), or shapely.Polygon
            Corners y, z in order, in the axes of the member's orientation, from any origin [m]; a polygon of
            shapely brings its holes.
        holes : sequence of array_like (n, 2)
        nu : float
            Poisson's ratio of shear [-].
        n_triangles : int
            About the number of triangles.
        label : str
            For reports.

        Raises
        ------
        PropertyError
            If the library is not installed, or the outline is not one.
        """
        if hasattr(outer, "exterior"):
            outer, holes = outer.exterior.coords, [ring.coords for ring in outer.interiors]
        corners = [closed_polygon(o) for o in (np.array(outer), *map(np.array, holes))]
        figure, angle, outlines = _principal(corners)
        checked_ratio(label, nu)
        found = warping_constants(outlines, nu, n_triangles)
        return cls(
            figure.A,
            figure.Iy,
            figure.Iz,
            found.J,
            found.area_y / figure.A,
            found.area_z / figure.A,
            outlines,
            label,
            angle=angle,
            shear_centre=found.shear_centre,
        )


def _principal(outlines: Sequence[Floats]) -> tuple[Integrals, float, tuple[Floats, ...]]:
    """Return integrals about principal axes, their angle [rad], and the outlines in them [m]."""
    outlines = [o - outlines[0][0] for o in outlines]  # a far origin would cost digits
    figure = integrate(outlines)
    if not figure.A > 0:
        msg = f"the outline encloses {figure.A:g} m² less its holes; it must be positive"
        raise PropertyError(msg)
    angle, centre = figure.principal_angle, figure.centroid
    return figure.centred().turned(angle), angle, tuple(turned(o, centre, angle) for o in outlines)


# Torsion and shear of arbitrary sections by the optional library sectionproperties --------------------------


class Warping(NamedTuple):
    """Constants of a section from its warping.

    Attributes
    ----------
    J : float
        St Venant's torsion constant [m⁴].
    area_y, area_z : float
        Shear areas ky A and kz A [m²].
    shear_centre : (float, float)
        y and z, as the outlines are given [m].
    """

    J: float
    area_y: float
    area_z: float
    shear_centre: tuple[float, float]


def warping_constants(outlines: Sequence[Floats], nu: float, n_triangles: int) -> Warping:
    """Return torsion constant, shear areas and shear centre of a polygon with holes.

    Parameters
    ----------
    outlines : sequence of ndarray (n, 2)
        Corners y, z, the outer first, then holes, in principal axes [m].
    nu : float
        Poisson's ratio [-].
    n_triangles : int
        About the number of triangles.

    Raises
    ------
    PropertyError
        If the library is not installed, or an outline crosses itself.
    """
    try:
        from sectionproperties.analysis.section import Section as Analysis  # pyright: ignore[reportMissingImports]
        from sectionproperties.pre.geometry import Geometry  # pyright: ignore[reportMissingImports]
        from sectionproperties.pre.pre import Material  # pyright: ignore[reportMissingImports]
        from shapely import Polygon
    except ModuleNotFoundError as error:
        msg = (
            f"an arbitrary section needs the library sectionproperties ({error}): python -m pip install "
            "sectionproperties, or give J, ky and kz yourself"
        )
        raise PropertyError(msg) from None
    size = float(np.ptp(outlines[0], axis=0).max())
    shape: Any = Polygon(outlines[0] / size, [o / size for o in outlines[1:]])
    if not shape.is_valid:
        msg = "the outline crosses itself, or a hole is not inside it and apart from the others"
        raise PropertyError(msg)
    geometry: Any = Geometry(shape, material=Material("", 1.0, nu, 1.0, 1.0, "grey"))
    geometry.create_mesh(mesh_sizes=[shape.area / n_triangles])
    analysis: Any = Analysis(geometry)
    analysis.calculate_geometric_properties()
    analysis.calculate_warping_properties()
    found = analysis.section_props  # E = 1: stiffnesses are constants of the figure
    return Warping(
        found.j * size**4,
        found.a_sx * size**2,
        found.a_sy * size**2,
        (found.x_se * size, found.y_se * size),
    )
