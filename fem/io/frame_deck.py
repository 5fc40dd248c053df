"""A frame model as the deck of another program has it, in SI units and global axes.

Readers of Nastran, Abaqus and ANSYS decks return a :class:`FrameDeck`. :mod:`fem.io.frame_model` makes a
model of it, and ``dovetail new --from`` a study.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fem.array_types import Bools, Floats, Ints
from fem.materials import Material
from fem.model import DIRECTIONS, Damping, lever_matrix
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


# What cards of any program give a frame deck: axes, springs, supports, links, averages and equations --------
# A component is 0 to 5, along or about the axes of a node's motions. Axes are unit vectors as rows.


Motion = tuple[int, Floats]
"""Row of a node, and factors (6,) of its global motions."""


def axes_along(x: Floats, toward: Floats | None = None) -> Floats:
    """Return axes with x along vectors (…, 3), and y in the plane of others, as rows (…, 3, 3)."""
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    y: Floats = np.cross(np.eye(3)[np.argmin(np.abs(x), axis=-1)], x) if toward is None else toward
    y = y - np.einsum("...i,...i", y, x)[..., None] * x
    y = y / np.linalg.norm(y, axis=-1, keepdims=True)
    return np.stack((x, y, np.cross(x, y)), axis=-2)


def parallel(a: Floats, b: Floats, sine: float = 1e-9) -> Bools:
    """Return whether two vectors (…, 3) have one line, or one of them no length."""
    lengths = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
    return np.logical_not(np.linalg.norm(np.cross(a, b), axis=-1) > sine * lengths)


def along(component: int, axes: Floats) -> Floats:
    """Return a component of a node's motion as factors of its six global ones."""
    out, turn = np.zeros(6), 3 * (component // 3)
    out[turn : turn + 3] = axes[component % 3]
    return out


def entry(component: int, value: float) -> Floats:
    """Return a matrix (6, 6) of one spring."""
    out = np.zeros((6, 6))
    out[component, component] = value
    return out


def supports_of(
    fixed: Mapping[int, Iterable[int]], axes: Callable[[int], Floats], name: Callable[[int], str]
) -> tuple[dict[int, tuple[str, ...]], tuple[Connection, ...]]:
    """Return the fixed global directions of nodes, and rigid connections to the ground along other axes."""
    supports: dict[int, tuple[str, ...]] = {}
    skew: list[Connection] = []
    for row, components in fixed.items():
        found: list[int] = []
        rigid: list[int] = []
        for start in (0, 3):
            local = sorted(c for c in components if start <= c < start + 3)
            # fixed axes that span as many global directions fix these
            spanned = np.flatnonzero((axes(row)[[c - start for c in local]] ** 2).sum(axis=0) > 1 - 1e-9)
            if len(spanned) == len(local):
                found += (start + spanned).tolist()
            else:
                rigid += local
        if found:
            supports[row] = tuple(DIRECTIONS[c] for c in found)
        if rigid:
            words = tuple(DIRECTIONS[c] for c in rigid)
            skew.append(Connection(name=name(row), nodes=(row, None), rigid=words, axes=axes(row)))
    return supports, tuple(skew)


def terms_of(motions: Iterable[Motion]) -> tuple[tuple[int, str, float], ...]:
    """Return the terms of Σ factors · motions; those of one node are added up, those of rounding left out."""
    total: dict[int, Floats] = {}
    for row, factors in motions:
        total[row] = total.get(row, 0.0) + factors
    largest = max((float(np.abs(v).max()) for v in total.values()), default=0.0)
    return tuple(
        (row, DIRECTIONS[k], float(v[k]))
        for row, v in total.items()
        # Coefficient, relative to the largest of an equation, that counts as zero
        for k in np.flatnonzero(np.abs(v) > 1e-12 * largest).tolist()
    )


@dataclass(slots=True, kw_only=True)
class Found:
    """Parts of a deck that have been found so far, as of :class:`fem.io.frame_deck.FrameDeck`."""

    bodies: list[Body] = field(default_factory=list)
    connections: list[Connection] = field(default_factory=list)
    links: list[Link] = field(default_factory=list)
    equations: list[Equation] = field(default_factory=list)
    supports: dict[int, tuple[str, ...]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


@dataclass(slots=True)
class Constraints(Found):
    """Links and equations as they are read, between nodes at points [m] with axes of their motions."""

    points: Floats
    axes: Callable[[int], Floats]

    def motion(self, row: int, component: int, axes: Floats | None = None) -> Floats:
        """Return a component of a node's motion along its axes as factors of its global ones."""
        return along(component, self.axes(row) if axes is None else axes)

    def equate(self, name: str, motions: Iterable[Motion]) -> None:
        """Add Σ factors · motions = 0."""
        if terms := terms_of(motions):
            self.equations.append(Equation(name=name, terms=terms))

    def keep_distance(self, name: str, a: int, b: int) -> None:
        """Add the equation of a rigid bar that is hinged at both ends."""
        axis = np.append(axes_along(self.points[b] - self.points[a])[0], np.zeros(3))
        self.equate(name, [(b, axis), (a, -axis)])

    def follow(
        self,
        name: str,
        node: int,
        dependents: Iterable[int],
        components: Iterable[int],
        axes: Floats | None = None,
    ) -> None:
        """Let components of nodes follow another node as a rigid body, along these axes or those of each."""
        components, plain = sorted(components), []
        complete = all(len([c for c in components if t <= c < t + 3]) in (0, 3) for t in (0, 3))
        for row in dependents:
            node_axes = self.axes(row) if axes is None else axes
            if complete or np.allclose(node_axes, np.eye(3), rtol=0, atol=1e-9):
                plain.append(row)
                continue
            lever = lever_matrix(self.points[row] - self.points[node])
            for c in components:
                axis = along(c, node_axes)
                self.equate(name, [(row, axis), (node, -axis @ lever)])
        if plain and components:
            directions = tuple(DIRECTIONS[c] for c in components)
            self.links.append(Link(name=name, node=node, dependents=tuple(plain), directions=directions))

    def average(
        self,
        name: str,
        node: int,
        components: Iterable[int],
        members: list[tuple[int, int, float]],
        axes: Floats | None = None,
    ) -> int | None:
        """Let a node follow the rigid motion that fits components of others best, in weighted least squares.

        Rotations weigh by the square of the mean distance of the others from it. Members are rows, components
        and weights. Returns a component that they do not determine, None if there is no such.
        """
        others = list(dict.fromkeys(row for row, _, _ in members))
        length = float(np.linalg.norm(self.points[others] - self.points[node], axis=1).mean()) or 1.0
        motions = [(row, self.motion(row, c)) for row, c, _ in members]
        S = np.array([v @ lever_matrix(self.points[row] - self.points[node]) for row, v in motions])
        W = np.array([w * (length**2 if c >= 3 else 1.0) for _, c, w in members])
        scale = np.repeat([1.0, 1 / length], 3)  # so that translations and rotations compare
        weighted = (S * scale).T * W
        fit = scale[:, None] * np.linalg.pinv(weighted @ (S * scale), rcond=1e-10) @ weighted
        for c in components:
            axis = self.motion(node, c, axes)
            error = np.linalg.norm(axis @ fit @ S - axis)
            if error > 1e-6 * np.abs(axis).max() * max(1.0, length, 1 / length):
                return c
            terms = [(row, -float(f) * v) for (row, v), f in zip(motions, axis @ fit, strict=True)]
            self.equate(f"{name}, {c + 1}", [(node, axis), *terms])
        return None
