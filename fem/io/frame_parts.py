"""What cards of any program give a frame deck: axes, springs, supports, links, averages and equations.

A component is 0 to 5, along or about the axes of a node's motions. Axes are unit vectors as rows.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from fem.array_types import Bools, Floats
from fem.io.frame_deck import Body, Connection, Equation, Link
from fem.model import DIRECTIONS, lever_matrix

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
