"""Normal stresses of sections from their normal force and bending moments."""

import numpy as np
from numpy.typing import NDArray

from fem.elements.properties import MemberProperties
from fem.sections.section import Section

Floats = NDArray[np.float64]

ROUND = ("circle", "tube", "ellipse", "hollow_ellipse")
"""Shapes whose outlines are drawn as polygons and are ellipses."""


def normal_stresses(
    properties: MemberProperties, fraction: Floats, forces: Floats
) -> tuple[Floats, Floats] | None:
    """Return the least and the largest normal stress of sections along a member.

    σ = N/A + My z/Iy - Mz y/Iz at the corners of the outline, of round sections all around. Shear, torsion
    and warping are not in it.

    Parameters
    ----------
    properties : MemberProperties
        Of the member.
    fraction : ndarray (n,)
        Places of the sections, as fractions of the member's length [-].
    forces : ndarray (n, 6, n_cases)
        N, Vy, Vz, T, My, Mz on the positive face, in the member's axes [N, N·m].

    Returns
    -------
    (ndarray (n, n_cases), ndarray (n, n_cases)) or None
        [Pa]. None for a section that is given by its constants, whose outline is not known.
    """
    first, last = properties.section, properties.section2
    sections = [first if last is None else Section.between(first, last, float(x)) for x in fraction]
    if not all(s.outlines for s in sections):
        return None
    found = np.array([_extremes(s, own) for s, own in zip(sections, forces, strict=True)])
    return found[:, 0], found[:, 1]


def _extremes(section: Section, forces: Floats) -> tuple[Floats, Floats]:
    """Return the least and the largest stress of a section, each (n_cases,)."""
    y, z = np.concatenate(section.outlines).T
    N, My, Mz = forces[0] / section.A, forces[4] / section.Iy, forces[5] / section.Iz
    if section.shape in ROUND:
        bending = np.hypot(My * np.abs(z).max(), Mz * np.abs(y).max())
        return N - bending, N + bending
    stress = N + np.multiply.outer(z, My) - np.multiply.outer(y, Mz)
    return stress.min(axis=0), stress.max(axis=0)
