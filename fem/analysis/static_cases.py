"""Static responses to several load cases, of first order or each of second order."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fem.analysis.one_sided import OneSided
from fem.analysis.second_order import SecondOrder
from fem.analysis.statics import StaticSolution, beyond_rounding
from fem.analysis.stations import (
    LargestDisplacement,
    SectionStresses,
    Stations,
    forces_on_lines,
    largest_displacements,
    section_stresses,
    stations,
    stresses_on_lines,
)
from fem.array_types import Floats
from fem.effects.places import frame_of
from fem.model import DIRECTIONS
from fem.summary import fields_summary


@dataclass(frozen=True, slots=True, eq=False)
class StaticCases:
    """The responses to load cases, one column each.

    Attributes
    ----------
    solutions : tuple of StaticSolution
        One for all cases, or one for each case if their stiffnesses differ.
    factors : mapping of str to float
        Load factors of buckling by load case, of second-order responses.
    slack : mapping of str to tuple of str
        Slack bars by load case, where bars carry tension or compression alone.
    """

    solutions: tuple[StaticSolution, ...]
    factors: Mapping[str, float] = field(default_factory=dict)
    slack: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    __repr__ = fields_summary

    @classmethod
    def of_one_sided(cls, found: tuple[OneSided, ...]) -> "StaticCases":
        """Return the cases of structures with bars that go slack."""
        return cls(
            tuple(each.solution for each in found),
            slack={each.solution.cases[0]: each.slack for each in found},
        )

    @classmethod
    def of_second_order(cls, found: tuple[SecondOrder, ...]) -> "StaticCases":
        """Return the cases of second-order responses."""
        return cls(
            tuple(each.solution for each in found),
            {each.solution.cases[0]: each.factor for each in found},
        )

    @property
    def cases(self) -> tuple[str, ...]:
        """Names of the load cases."""
        return tuple(name for s in self.solutions for name in s.cases)

    @property
    def displacements(self) -> Floats:
        """Displacements of all DOFs, (n_dof, n_cases) [m, rad]."""
        return np.hstack([s.displacements for s in self.solutions])

    @property
    def residual(self) -> Floats:
        """Forces out of balance, relative, (n_cases,) [-]."""
        return np.concatenate([s.residual for s in self.solutions])

    @property
    def support_forces(self) -> dict[tuple[str, str], Floats]:
        """Forces of supports, rigid joints and springs to the ground, each (n_cases,) [N, N·m]."""
        each = [{**s.reactions, **s.springs} for s in self.solutions]
        keys = dict.fromkeys(key for forces in each for key in forces)
        return {
            key: np.concatenate(
                [forces.get(key, np.zeros(s.n_cases)) for forces, s in zip(each, self.solutions, strict=True)]
            )
            for key in keys
        }

    @property
    def rounding(self) -> Floats:
        """Forces and moments up to which section forces and reactions are rounding, (2, n_cases) [N, N·m]."""
        return np.hstack([s.rounding for s in self.solutions])

    def forces_beyond_rounding(self) -> dict[tuple[str, str], Floats]:
        """Return the forces of :attr:`support_forces`, 0 where they are rounding."""
        limits, forces = self.rounding, self.support_forces
        return {key: np.where(abs(v) > limits[int(_is_moment(key))], v, 0.0) for key, v in forces.items()}

    def beyond_rounding(self, forces: Floats) -> Floats:
        """Return section forces (..., 6, n_cases), 0 where they are rounding."""
        return beyond_rounding(forces, self.rounding)

    def case(self, name: str) -> int:
        """Return the column of a load case."""
        return self.cases.index(name)

    def largest_displacements(self) -> tuple[LargestDisplacement, ...]:
        """Return the largest displacement of each load case, of points and within members."""
        return tuple(x for s in self.solutions for x in largest_displacements(s))

    def column(self, k: int) -> tuple[StaticSolution, int]:
        """Return the solution that has a column, and its column there."""
        for solution in self.solutions:
            if k < solution.n_cases:
                return solution, k
            k -= solution.n_cases
        raise IndexError(k)

    def stations(self, member: str, pieces: int) -> Stations:
        """Return forces and displacements at the ends of equal pieces of a member."""
        each = [stations(s, member, pieces) for s in self.solutions]
        forces, moved = (
            np.concatenate(parts, axis=2)
            for parts in ([s.forces for s in each], [s.displacements for s in each])
        )
        return Stations(each[0].positions, forces, moved)

    def stresses(self, member: str, pieces: int) -> SectionStresses | None:
        """Return the extremes of stresses at the ends of equal pieces of a member.

        See :mod:`fem.sections.stress_points` for the formulas.

        Parameters
        ----------
        member : str
        pieces : int

        Returns
        -------
        SectionStresses or None
            Each (pieces + 1, n_cases) [Pa]; None for a section without an outline. Section forces that are
            rounding make none.
        """
        found, properties = self.stations(member, pieces), frame_of(self.solutions[0].model).members[member]
        forces = self.beyond_rounding(found.forces)
        return section_stresses(properties, found.positions / found.positions[-1], forces)

    def stresses_on_lines(self, pieces: int) -> dict[str, Floats]:
        """Return the extremes of stresses of each line, each (n_lines, n_cases) [Pa]; NaN where unknown."""
        each = [stresses_on_lines(s, pieces) for s in self.solutions]
        found = {name: np.concatenate([extremes[name] for extremes in each], axis=2) for name in each[0]}
        return {name: v.min(axis=1) if name == "low" else v.max(axis=1) for name, v in found.items()}

    def forces_on_lines(self, pieces: int) -> Floats:
        """Return section forces along all lines, (n_lines, pieces + 1, 6, n_cases) [N, N·m]."""
        return np.concatenate([forces_on_lines(s, pieces) for s in self.solutions], axis=3)


def _is_moment(key: tuple[str, str]) -> bool:
    """Whether a reaction is a moment: its direction is ``"rx"``, or ``"4 rx"`` of one of several points."""
    return key[1].split()[-1] in DIRECTIONS[3:]
