"""Stresses of sections along members from their section forces."""

from dataclasses import dataclass

import numpy as np

from fem.array_types import Floats
from fem.elements.properties import MemberProperties
from fem.sections.section import Section
from fem.sections.stress_points import missing_formula, stress_points

ROUND = ("circle", "tube", "ellipse", "hollow_ellipse")
"""Shapes whose outlines are drawn as polygons and are ellipses."""


@dataclass(frozen=True, slots=True, eq=False)
class SectionStresses:
    """Extremes of the stresses over each section along a member, all (n, n_cases).

    Attributes
    ----------
    low, high : ndarray
        Least and largest normal stress [Pa].
    shear, von_mises : ndarray or None
        Largest shear stress, torsion included, and largest equivalent stress √(σ² + 3τ²) at points of the
        section [Pa]; None where they are not known.
    missing : str
        Why they are not known; empty where they are.
    """

    low: Floats
    high: Floats
    shear: Floats | None
    von_mises: Floats | None
    missing: str = ""

    @property
    def by_name(self) -> dict[str, Floats]:
        """The stresses that are known, by their names in results."""
        each = {"low": self.low, "high": self.high, "shear": self.shear, "von_mises": self.von_mises}
        return {name: values for name, values in each.items() if values is not None}


def section_stresses(
    properties: MemberProperties, fraction: Floats, forces: Floats
) -> SectionStresses | None:
    """Return the normal, shear and equivalent stresses of sections along a member.

    See :mod:`fem.sections.stress_points` for the formulas. Arguments as of :func:`normal_stresses`, which
    gives the normal stresses; None where these are not known.
    """
    normal = normal_stresses(properties, fraction, forces)
    if normal is None:
        return None
    low, high = normal
    sections = _sections(properties, fraction)
    missing = missing_formula(sections[0])
    shear, equivalent = np.zeros_like(low), np.zeros_like(low)
    known: dict[int, Floats] = {}
    for k, section in enumerate(sections):
        if missing:
            return SectionStresses(low, high, None, None, missing)
        if id(section) not in known:
            found = stress_points(section, properties.material.nu)
            assert found is not None
            known[id(section)] = found.per_force
        stress = known[id(section)] @ forces[k]  # (n_points, 3, n_cases)
        square = stress[:, 1] ** 2 + stress[:, 2] ** 2
        shear[k] = np.sqrt(square.max(axis=0))
        equivalent[k] = np.sqrt((stress[:, 0] ** 2 + 3 * square).max(axis=0))
    # round sections have their extreme normal stress between two of the points
    return SectionStresses(low, high, shear, np.maximum(equivalent, np.maximum(abs(low), abs(high))))


def _sections(properties: MemberProperties, fraction: Floats) -> list[Section]:
    first, last = properties.section, properties.section2
    return [first if last is None else Section.between(first, last, float(x)) for x in fraction]


def normal_stresses(
    properties: MemberProperties, fraction: Floats, forces: Floats
) -> tuple[Floats, Floats] | None:
    """Return the least and the largest normal stress of sections along a member.

    σ = N/A + My z/Iy - Mz y/Iz at the corners of the outline, of round sections all around.

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
    sections = _sections(properties, fraction)
    if not all(s.outlines for s in sections):
        return None
    found = np.array([_extremes(s, force) for s, force in zip(sections, forces, strict=True)])
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
