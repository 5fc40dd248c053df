"""Polygons: sections from their outline, with given constants or those of finite elements."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats
from fem.materials import PropertyError
from fem.sections.constants import SectionConstants
from fem.sections.dimensions import checked_ratio
from fem.sections.outlines import Integrals, closed_polygon, integrate, turned
from fem.sections.warping import warping_constants


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
