"""Section forces, stresses and displacements at stations along members."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.analysis.section_forces import section_forces
from fem.analysis.section_stress import section_stresses
from fem.analysis.static_rounding import beyond_rounding
from fem.analysis.statics import StaticSolution
from fem.elements.frame import Frame
from fem.model import ModelError
from fem.summary import fields_summary

STRESSES = ("low", "high", "shear", "von_mises")
"""Least and largest normal stress, largest shear and largest von Mises stress of a section."""


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
        Of the member's line, global [m, rad]; NaN where they are not computed (see
        :meth:`fem.analysis.statics.StaticSolution.displacements_along`).
    """

    positions: NDArray[np.float64]
    forces: NDArray[np.float64]
    displacements: NDArray[np.float64]

    __repr__ = fields_summary


def stations(solution: StaticSolution, member: str, pieces: int = 20) -> Stations:
    """Return forces and displacements at the ends of equal pieces of a member."""
    positions = np.linspace(0.0, solution.model.mesh.member_length(member), pieces + 1)
    forces = solution.internal_forces(member, positions)
    try:
        moved = solution.displacements_along(member, positions)
    except ModelError:  # loads move an end that is free to slide
        moved = np.full(forces.shape, np.nan)
    return Stations(positions, forces, moved)


def forces_on_lines(solution: StaticSolution, pieces: int) -> NDArray[np.float64]:
    """Return the section forces at the ends of equal pieces of all lines, (n_lines, pieces + 1, 6, n_cases).

    Both sides of a node are there, as ends of two lines. A concentrated force on a member acts behind its
    place.
    """
    n = solution.model.mesh.n_lines
    lines = np.repeat(np.arange(n), pieces + 1)
    xi = np.tile(np.linspace(0, 1, pieces + 1), n)
    found = section_forces(solution.model, solution.equilibrium, solution.displacements, lines, xi)
    return found.reshape(n, pieces + 1, 6, -1)


def stresses_on_lines(solution: StaticSolution, pieces: int) -> dict[str, NDArray[np.float64]]:
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
        own = forces[rows].reshape(-1, 6, forces.shape[-1])
        found = section_stresses(properties[member], np.clip(x.ravel(), 0, 1), own)
        for name, values in ({} if found is None else found.by_name).items():
            out[name][rows] = values.reshape(len(rows), pieces + 1, -1)
    return out
