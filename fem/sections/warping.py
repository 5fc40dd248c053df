"""Torsion and shear of arbitrary sections by the optional library sectionproperties."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fem.array_types import Floats
from fem.materials import PropertyError


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
