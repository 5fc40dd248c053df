"""A frame model as the deck of another program has it, in SI units and global axes.

Readers of Nastran, Abaqus and ANSYS decks return a :class:`FrameDeck`. :mod:`fem.io.frame_model` makes a
model of it, and ``dovetail new --from`` a study.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fem.array_types import Floats, Ints
from fem.materials import Material
from fem.model import Damping
from fem.sections.section import Section


def _nothing(*shape: int) -> Floats:
    return np.zeros(shape)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BarProperty:
    """Values that bars of one property share.

    Attributes
    ----------
    name : str
        Name of their member: ``"property 3"``, or that of an element set.
    material : Material
    section, section2 : Section, Section or None
        At the first end, and at the second end of a tapered bar.
    theory, mass : str
        As of :class:`fem.elements.properties.MemberProperties`.
    mass_per_length : float
        Non-structural mass [kg/m].
    """

    name: str
    material: Material
    section: Section
    section2: Section | None = None
    theory: str = "timoshenko"
    mass: str = "consistent"
    mass_per_length: float = 0.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Bars:
    """The bars of a deck, in its order.

    Attributes
    ----------
    numbers : ndarray of int (n,)
        As the deck calls them.
    ends : ndarray of int (n, 2)
        Rows of the deck's nodes.
    properties : ndarray of int (n,)
        Which of the deck's properties each has.
    height : ndarray (n, 3)
        Vector that spans, with the bar's axis, the plane of the section's height (local z); NaN takes the
        default.
    offsets : ndarray (n, 2, 3)
        From the nodes to the axis at both ends, global [m].
    stiffness : ndarray (n, 2, 6)
        Of the connections of both ends in local directions x y z rx ry rz: infinite where rigid, 0 where
        released [N/m, N·m/rad].
    """

    numbers: Ints
    ends: Ints
    properties: Ints
    height: Floats
    offsets: Floats
    stiffness: Floats

    @classmethod
    def of(cls, rows: Sequence[tuple]) -> "Bars":
        """Return the bars of rows with the attributes of one bar each."""
        columns = [list(column) for column in zip(*rows, strict=True)] or [[]] * 6
        numbers, ends, properties = (np.array(column, dtype=np.int64) for column in columns[:3])
        height, offsets, stiffness = (np.array(column, dtype=float) for column in columns[3:])
        return cls(
            numbers=numbers,
            ends=ends.reshape(-1, 2),
            properties=properties,
            height=height.reshape(-1, 3),
            offsets=offsets.reshape(-1, 2, 3),
            stiffness=stiffness.reshape(-1, 2, 6),
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Body:
    """A rigid body at a node.

    Attributes
    ----------
    name : str
        Card and number: ``"CONM2 7"``.
    node : int
        Row of the deck's nodes.
    mass : float
        [kg].
    inertia : ndarray (3, 3)
        About its centre, global axes [kg·m²].
    arm : ndarray (3,)
        From the node to its centre [m].
    """

    name: str
    node: int
    mass: float
    inertia: Floats = field(default_factory=lambda: _nothing(3, 3))
    arm: Floats = field(default_factory=lambda: _nothing(3))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Connection:
    """Springs and dashpots between two nodes, or between a node and the ground.

    Attributes
    ----------
    name : str
        Card and number: ``"CBUSH 7"``.
    nodes : (int, int or None)
        Rows of the deck's nodes; None is the ground.
    K, C, D : ndarray (6, 6)
        Stiffness, viscous and structural damping of the motion of the first relative to the second, along
        ``axes``.
    rigid : tuple of str
        Directions of ``axes`` without relative motion: a skew support.
    axes : ndarray (3, 3)
        Unit vectors x, y, z as rows.
    place : ndarray (3,) or None
        Where the connection acts, with rigid arms to the nodes [m]; midway between the nodes unless given.
    """

    name: str
    nodes: tuple[int, int | None]
    K: Floats = field(default_factory=lambda: _nothing(6, 6))
    C: Floats = field(default_factory=lambda: _nothing(6, 6))
    D: Floats = field(default_factory=lambda: _nothing(6, 6))
    rigid: tuple[str, ...] = ()
    axes: Floats = field(default_factory=lambda: np.eye(3))
    place: Floats | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Link:
    """Nodes that follow another one as one rigid body, in some global directions.

    Attributes
    ----------
    name : str
    node : int
        Row of the node that leads.
    dependents : tuple of int
    directions : tuple of str
    """

    name: str
    node: int
    dependents: tuple[int, ...]
    directions: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Equation:
    """Σ coefficient · u(node, direction) = 0.

    Attributes
    ----------
    name : str
    terms : tuple of (int, str, float)
        Row of a node, global direction and coefficient.
    """

    name: str
    terms: tuple[tuple[int, str, float], ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FrameDeck:
    """A frame model of another program.

    Attributes
    ----------
    file : str
        Name of its file.
    nodes : ndarray of int (n,)
        Numbers as the deck has them.
    points : ndarray (n, 3)
        [m].
    bars : Bars
    properties : tuple of BarProperty
    supports : mapping of int to tuple of str
        Fixed global directions of nodes, by rows of the nodes.
    bodies, connections, links, equations : tuple
    damping : Damping or None
        None if the deck has none.
    notes : tuple of str
        Cards that were left out or taken in part, and what that means for the result.
    """

    file: str
    nodes: Ints
    points: Floats
    bars: Bars
    properties: tuple[BarProperty, ...]
    supports: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    bodies: tuple[Body, ...] = ()
    connections: tuple[Connection, ...] = ()
    links: tuple[Link, ...] = ()
    equations: tuple[Equation, ...] = ()
    damping: Damping | None = None
    notes: tuple[str, ...] = ()
