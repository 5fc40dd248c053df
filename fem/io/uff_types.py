"""Records of a universal file: one type for each of its datasets."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRFKind
from fem.array_types import Bools, Floats, Ints
from fem.io.faults import refuse
from fem.io.uff_format import UffError

MOTIONS = {8: FRFKind.RECEPTANCE, 11: FRFKind.MOBILITY, 12: FRFKind.ACCELERANCE}
"""Kinds of response by their data types: displacement, velocity and acceleration."""
STRAIN = 3
"""Data type of a strain."""
_FORCES = (9, 13)

FUNCTION_TYPES = (
    "general",
    "time response",
    "auto spectrum",
    "cross spectrum",
    "frequency response function",
    "transmissibility",
    "coherence",
    "auto correlation",
    "cross correlation",
    "power spectral density",
    "energy spectral density",
    "probability density function",
    "spectrum",
)
"""Names of the function types of dataset 58, by number; higher ones have a number only."""


@dataclass(frozen=True, slots=True)
class Header:
    """Dataset 151: where the file comes from."""

    model: str = "NONE"
    description: str = "NONE"
    program: str = "NONE"
    created: str = ""


@dataclass(frozen=True, slots=True)
class UffUnits:
    """Dataset 164: value in SI = value in the file / factor.

    Attributes
    ----------
    code : int
        1 for m and N, 5 for mm and mN, 9 for the user's own, 10 for mm and N, …
    description : str
        For documentation only.
    length, force : float
        Factors of lengths and forces [file unit per m, file unit per N].
    """

    code: int = 1
    description: str = "m, N"
    length: float = 1.0
    force: float = 1.0

    @property
    def is_si(self) -> bool:
        """Whether they are m and N."""
        return (self.length, self.force) == (1.0, 1.0)

    @property
    def mass(self) -> float:
        """One mass unit of the file [kg]."""
        return self.length / self.force


@dataclass(frozen=True, slots=True, eq=False)
class Function:
    """A dataset 58 or 58b, in the units of the file.

    Attributes
    ----------
    function_type : int
        Its number in the format: 1 time response, 4 frequency response function, 6 coherence, 9 power
        spectral density.
    response, reference : str
        Labels of the degrees of freedom, such as ``"12Z+"``; ``"0S"`` where the file gives none.
    response_name, reference_name : str
        Entity names; empty where there is none.
    x : ndarray (n,)
        Abscissa: time [s], frequency [Hz], whatever its label in the file; others as they are.
    values : ndarray (n,)
        Ordinate, real or complex.
    x_type, ordinate_type, denominator_type : int
        Specific data types: 3 strain, 8 displacement, 11 velocity, 12 acceleration, 13 force, 17 time,
        18 frequency, 0 unknown.
    x_unit, unit, denominator_unit : str
        Labels of the units; empty where there is none.
    title : tuple of str
        The five lines of text.
    load_case, version : int
        Numbers that tell runs apart.
    place : str
        Dataset and line in the file.
    x_label : str
        Unit label of the abscissa as the file has it, before ``x`` was converted.
    """

    function_type: int
    response: str
    reference: str
    response_name: str
    reference_name: str
    x: Floats
    values: NDArray[Any]
    x_type: int
    ordinate_type: int
    denominator_type: int
    x_unit: str
    unit: str
    denominator_unit: str
    title: tuple[str, ...]
    load_case: int
    version: int
    place: str
    x_label: str = ""

    @property
    def type_name(self) -> str:
        """The function type in words."""
        known = 0 <= self.function_type < len(FUNCTION_TYPES)
        return FUNCTION_TYPES[self.function_type] if known else f"function of type {self.function_type}"

    @property
    def kind(self) -> FRFKind | None:
        """Kind of the FRF by its data types; None where they do not say.

        Of a motion for a motion, a transmissibility, it is that for the acceleration of the reference.
        """
        if self.denominator_type in _FORCES:
            return MOTIONS.get(self.ordinate_type)
        if not self.of_motion or self.ordinate_type not in MOTIONS:
            return None
        order = MOTIONS[self.ordinate_type].derivatives - MOTIONS[self.denominator_type].derivatives + 2
        return tuple(FRFKind)[order] if 0 <= order <= 2 else None

    @property
    def is_strain(self) -> bool:
        """Whether it is a strain for a force, which is the same in every kind."""
        return self.ordinate_type == STRAIN and self.denominator_type in _FORCES

    @property
    def of_motion(self) -> bool:
        """Whether its reference is a motion, not a force."""
        return self.denominator_type in MOTIONS


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Points of datasets 15, 781 and 2411.

    Attributes
    ----------
    labels : ndarray of int (n,)
        Node numbers of the file.
    coordinates : ndarray (n, 3)
        Global coordinates [m].
    """

    labels: Ints
    coordinates: Floats

    def rows_of(self, nodes: Ints) -> tuple[Ints, Bools]:
        """Return the rows of nodes, and whether the file has them; the row of others has no meaning."""
        if not self.labels.size:
            return np.zeros(nodes.shape, dtype=np.int64), np.zeros(nodes.shape, dtype=bool)
        order = np.argsort(self.labels, kind="stable")
        labels = self.labels[order]
        at = np.minimum(np.searchsorted(labels, nodes), labels.size - 1)
        return order[at], labels[at] == nodes

    def at(self, node: int) -> Floats:
        """Return the coordinates of a node, shape (3,) [m].

        Raises
        ------
        UffError
            If the file has no such node.
        """
        found = np.flatnonzero(self.labels == node)
        if not found.size:
            refuse(f"there is no node {node}; the file has {self.labels.size} nodes", UffError)
        return self.coordinates[found[-1]]


@dataclass(frozen=True, slots=True)
class TraceLine:
    """Dataset 82: polylines through nodes; the pen is lifted between ``strokes``."""

    number: int
    name: str
    strokes: tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True)
class UffElement:
    """An element of dataset 780 or 2412; descriptors 11, 21 to 24, 31 and 32 are rods, beams and pipes."""

    number: int
    descriptor: int
    property: int
    material: int
    nodes: tuple[int, ...]
