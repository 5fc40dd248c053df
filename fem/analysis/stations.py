"""Section forces, stresses and displacements at stations along members."""

from dataclasses import dataclass

import numpy as np

from fem.analysis.section_forces import section_forces
from fem.analysis.statics import StaticSolution, beyond_rounding
from fem.array_types import Floats
from fem.elements.frame import Frame
from fem.elements.properties import MemberProperties
from fem.sections.section import Section
from fem.sections.stress_points import missing_formula, stress_points
from fem.summary import fields_summary

STRESSES = ("low", "high", "shear", "von_mises")
"""Least and largest normal stress, largest shear and largest von Mises stress of a section."""

_LEAST_PLACES = 8
"""Stretches of a member at least, between whose ends the largest displacement is searched for."""


@dataclass(frozen=True, slots=True, eq=False)
class Stations:
    """Section forces and displacements along a member.

    Attributes
    ----------
    positions : ndarray (n,)
        Arc lengths from the first end [m].
    forces : ndarray (n, 6, n_cases)
        N, Vy, Vz, T, My, Mz on the positive face, in the member's axes [N, N·m].
    displacements : ndarray (n, 6, n_cases)
        Of the member's line, global [m, rad].
    """

    positions: Floats
    forces: Floats
    displacements: Floats

    __repr__ = fields_summary


def stations(solution: StaticSolution, member: str, pieces: int = 20) -> Stations:
    """Return forces and displacements at the ends of equal pieces of a member."""
    positions = np.linspace(0.0, solution.model.mesh.member_length(member), pieces + 1)
    forces = solution.internal_forces(member, positions)
    return Stations(positions, forces, solution.displacements_along(member, positions))


@dataclass(frozen=True, slots=True, eq=False)
class LargestDisplacement:
    """The largest displacement of a load case, of a point or of a place within a member.

    Attributes
    ----------
    size : float
        [m].
    point : int or None
        None within a member.
    member : str or None
        None at a point.
    position : float
        Arc length from the member's first end, 0 at a point [m].
    """

    size: float
    point: int | None
    member: str | None = None
    position: float = 0.0

    __repr__ = fields_summary


def largest_displacements(solution: StaticSolution) -> tuple[LargestDisplacement, ...]:
    """Return the largest displacement of each load case, also within members.

    The nodes and places between them, `_LEAST_PLACES` on a member at least, bracket the largest one; a
    search within the bracket finds it. Of equal ones a point is preferred.
    """
    mesh = solution.model.mesh
    at_points = np.linalg.norm(
        solution.displacements[: 6 * mesh.n_points].reshape(-1, 6, solution.n_cases)[:, :3], axis=1
    )
    sampled = {}
    for member in mesh.members:
        nodes = mesh.member_positions(member)
        parts = max(2, -(-_LEAST_PLACES // (len(nodes) - 1)))
        places = np.interp(np.arange(parts * (len(nodes) - 1) + 1) / parts, np.arange(len(nodes)), nodes)
        sampled[member] = places, _sizes(solution, member, places)
    found = []
    for k in range(solution.n_cases):
        point = int(at_points[:, k].argmax())
        best = LargestDisplacement(float(at_points[point, k]), point)
        member = max(sampled, key=lambda m: sampled[m][1][:, k].max(), default=None)
        if member is not None:
            places, sizes = sampled[member]
            size, s = _refined(solution, member, places, sizes, k)
            if size > (1 + 1e-9) * best.size:
                best = LargestDisplacement(size, None, member, s)
        found.append(best)
    return tuple(found)


def _sizes(solution: StaticSolution, member: str, places: Floats) -> Floats:
    """Return the sizes of displacements at places along a member, (n, n_cases) [m]."""
    return np.linalg.norm(solution.displacements_along(member, places)[:, :3], axis=1)


def _refined(
    solution: StaticSolution, member: str, places: Floats, sizes: Floats, k: int
) -> tuple[float, float]:
    """Return the largest size of a load case and its place, from sizes at places of a member.

    Four rounds narrow the bracket 5⁴ times. Near a maximum the error of the size falls with its square.
    """
    s, values = places, sizes[:, k]
    for _ in range(4):
        i = int(values.argmax())
        s = np.linspace(s[max(i - 1, 0)], s[min(i + 1, len(s) - 1)], 11)
        values = _sizes(solution, member, s)[:, k]
    i = int(values.argmax())
    return float(values[i]), float(s[i])


def forces_on_lines(solution: StaticSolution, pieces: int) -> Floats:
    """Return the section forces at the ends of equal pieces of all lines, (n_lines, pieces + 1, 6, n_cases).

    Both sides of a node are there, as ends of two lines. A concentrated force on a member acts behind its
    place.
    """
    n = solution.model.mesh.n_lines
    lines = np.repeat(np.arange(n), pieces + 1)
    xi = np.tile(np.linspace(0, 1, pieces + 1), n)
    found = section_forces(solution.model, solution.equilibrium, solution.displacements, lines, xi)
    return found.reshape(n, pieces + 1, 6, -1)


def stresses_on_lines(solution: StaticSolution, pieces: int) -> dict[str, Floats]:
    """Return the extremes of stresses at the ends of equal pieces of all lines, by the names of `STRESSES`.

    Section forces that are rounding make none.

    Returns
    -------
    dict of str to ndarray (n_lines, pieces + 1, n_cases)
        [Pa]; NaN where a stress is not known.
    """
    mesh, along = solution.model.mesh, solution.model.mesh.arc_fractions()
    forces = beyond_rounding(forces_on_lines(solution, pieces), solution.rounding)
    out = {name: np.full((*forces.shape[:2], forces.shape[-1]), np.nan) for name in STRESSES}
    properties = {m: p for f in solution.model.of_kind(Frame) for m, p in f.members.items()}
    for member, rows in mesh.members.items():
        x = along[rows, :1] + np.linspace(0, 1, pieces + 1) * np.diff(along[rows], axis=1)
        of_member = forces[rows].reshape(-1, 6, forces.shape[-1])
        found = section_stresses(properties[member], np.clip(x.ravel(), 0, 1), of_member)
        for name, values in ({} if found is None else found.by_name).items():
            out[name][rows] = values.reshape(len(rows), pieces + 1, -1)
    return out


# Stresses of sections along members from their section forces -----------------------------------------------


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
