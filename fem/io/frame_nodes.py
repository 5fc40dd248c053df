"""Nodes of a deck that are no points of the mesh: which node carries one that is on no bar.

A node on no bar may be part of a rigid body (a rigid link to a mass off the frame), rest on the ground (the
far end of a spring), or move by itself (a mass on a spring, the reference node of an RBE3).
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fem.array_types import Bools, Floats, Ints
from fem.io.frame_deck import Connection, FrameDeck, Link
from fem.model import DIRECTIONS, lever_matrix

_ALL = frozenset(DIRECTIONS)
NEGLIGIBLE_ARM_SQUARED = 1e-16
"""Square of a lever arm up to which it is none [m²]."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes of a deck: rigid bodies of them, and those that become points of the mesh.

    Attributes
    ----------
    deck : FrameDeck
    body : ndarray of int (n,)
        Number of the rigid body that each node is part of; that of the ground is ``ground``.
    ground : int
    on_bars : ndarray of bool (n,)
    acting : mapping of int to frozenset of str
        Directions in which something acts on a node that is on no bar.
    """

    deck: FrameDeck
    body: Ints
    ground: int
    on_bars: Bools
    acting: dict[int, frozenset[str]] = field(repr=False)

    @classmethod
    def of(cls, deck: FrameDeck) -> "Nodes":
        """Return the nodes of a deck."""
        n = len(deck.nodes)
        on_bars = np.zeros(n, dtype=bool)
        on_bars[deck.bars.ends] = True
        acting = _acting(deck, on_bars)
        pairs = np.array([*_rigid_pairs(deck, on_bars, acting)], dtype=np.int64).reshape(-1, 2)
        graph = sp.coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n + 1, n + 1))
        body = connected_components(graph, directed=False)[1].astype(np.int64)
        return cls(deck, body[:n], int(body[n]), on_bars, acting)

    @cached_property
    def leaders(self) -> dict[int, int]:
        """Node whose point stands for each rigid body: on a bar if one of it is, and leading if one is."""
        leading = [link.node for link in self.deck.links]
        rows = [*leading, *range(len(self.body))]
        out: dict[int, int] = {}
        for row in (*(r for r in rows if self.on_bars[r]), *rows):
            out.setdefault(int(self.body[row]), row)
        out.pop(self.ground, None)
        return out

    @cached_property
    def points(self) -> Ints:
        """Nodes that are points of the mesh: those on bars, and one of each body that moves by itself."""
        free = {int(self.body[row]) for row, acts in self.acting.items() if acts} - {self.ground}
        alone = [row for body, row in self.leaders.items() if body in free and not self.on_bars[row]]
        return np.union1d(np.flatnonzero(self.on_bars), np.array(alone, dtype=np.int64))

    @cached_property
    def point(self) -> Ints:
        """Point of the mesh of each node, -1 for those that are none."""
        out = np.full(len(self.body), -1)
        out[self.points] = np.arange(len(self.points))
        return out

    def index(self, row: int) -> int:
        """Return the point of a node that is one."""
        return int(self.point[row])

    def carrier(self, row: int) -> int | None:
        """Return the node at whose point a node acts, by a lever arm; None for the ground."""
        if self.point[row] >= 0:
            return row
        lead = self.leaders.get(int(self.body[row]))
        return None if lead is None or self.point[lead] < 0 else lead

    @cached_property
    def grounded(self) -> tuple[int, ...]:
        """Nodes on bars that are part of the ground."""
        return tuple(np.flatnonzero(self.on_bars & (self.body == self.ground)).tolist())

    @property
    def bodies(self) -> Iterator[tuple[str, int, tuple[int, ...]]]:
        """Name, leading node and other nodes of rigid bodies with several points of the mesh."""
        seen = {self.ground}
        for link in self.deck.links:
            body = int(self.body[link.node])
            if body in seen or frozenset(link.directions) != _ALL:
                continue
            seen.add(body)
            lead = self.leaders[body]
            rows = np.flatnonzero((self.body == body) & (self.point >= 0))
            if len(rows) > 1:
                yield link.name, lead, tuple(int(row) for row in rows if row != lead)

    @cached_property
    def void(self) -> dict[int, tuple[str, ...]]:
        """Directions in which nothing resists the motion of points on no bar, and no support holds them."""
        out = {}
        resist = _resisting(self.deck, self.on_bars)
        for lead in self.points[~self.on_bars[self.points]].tolist():
            S = np.zeros((6, 6))
            for row in np.flatnonzero(self.body == self.body[lead]).tolist():
                T = lever_matrix(self.deck.points[row] - self.deck.points[lead])
                S += T.T @ (resist.get(row, np.zeros((6, 6))) + _fixed(self.deck, row)) @ T
            free = tuple(
                d for d, s in zip(DIRECTIONS, np.diag(S), strict=True) if s <= NEGLIGIBLE_ARM_SQUARED
            )
            if free:
                out[lead] = free
        return out

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence on the directions that are fixed because nothing resists."""
        if not self.void:
            return ()
        each = ", ".join(f"node {self.deck.nodes[row]} in {' '.join(d)}" for row, d in self.void.items())
        return (f"nothing resists the motion of {each}: fixed there",)

    def place_of(self, c: Connection) -> Floats:
        """Return where a connection acts, (3,) [m]."""
        return _place(self.deck, c)


def _place(deck: FrameDeck, c: Connection) -> Floats:
    if c.place is not None:
        return np.asarray(c.place, dtype=float)
    return deck.points[[row for row in c.nodes if row is not None]].mean(axis=0)


def _fixed(deck: FrameDeck, row: int) -> Floats:
    return np.diag([float(d in deck.supports.get(row, ())) for d in DIRECTIONS])


def _resisting(deck: FrameDeck, on_bars: Bools) -> dict[int, Floats]:
    """Return, for nodes on no bar, a matrix (6, 6) of the motions that springs or constraints resist."""
    out: dict[int, Floats] = {}

    def add(row: int, T: Floats) -> None:
        if not on_bars[row]:
            out[row] = out.get(row, np.zeros((6, 6))) + T.T @ T

    for c in deck.connections:
        acts = np.abs(c.K) + np.abs(c.C) + np.abs(c.D)
        some = acts.any(axis=1) | np.array([d in c.rigid for d in DIRECTIONS])
        for row in c.nodes:
            if row is not None:
                T = np.kron(np.eye(2), c.axes) @ lever_matrix(_place(deck, c) - deck.points[row])
                add(row, T[some])
    for equation in deck.equations:
        for row, direction, _ in equation.terms:
            add(row, np.eye(6)[[DIRECTIONS.index(direction)]])
    for link in deck.links:
        some = np.array([d in link.directions for d in DIRECTIONS])
        for row in link.dependents:
            add(link.node, lever_matrix(deck.points[row] - deck.points[link.node])[some])
            add(row, np.eye(6)[some])
    return out


def _acting(deck: FrameDeck, on_bars: Bools) -> dict[int, frozenset[str]]:
    """Return the directions in which something acts on nodes on no bar, but for links that they follow."""
    leading = {link.node for link in deck.links}
    S = _resisting(replace(deck, links=()), on_bars)
    for body in deck.bodies:
        if not on_bars[body.node]:
            G = np.diag([float(body.mass > 0)] * 3 + [0.0] * 3)
            G[3:, 3:] = np.diag(np.abs(body.inertia).sum(axis=1) > 0)
            T = lever_matrix(body.arm)
            S[body.node] = S.get(body.node, np.zeros((6, 6))) + T.T @ G @ T
    out = {
        row: frozenset(d for d, s in zip(DIRECTIONS, np.diag(X), strict=True) if s > NEGLIGIBLE_ARM_SQUARED)
        for row, X in S.items()
    }
    follows = Counter(row for link in deck.links for row in link.dependents)
    for link in deck.links:
        for row in link.dependents:
            if follows[row] > 1 and not on_bars[row]:  # what follows two nodes ties them to each other
                out[row] = out.get(row, frozenset()) | frozenset(link.directions)
    return out | {row: _ALL for row in leading if not on_bars[row]}


def _rigid_pairs(
    deck: FrameDeck, on_bars: Bools, acting: dict[int, frozenset[str]]
) -> Iterator[tuple[int, int]]:
    """Yield pairs of nodes of one rigid body; the ground is the number behind the last node."""
    follows: dict[int, list[Link]] = {}
    for link in deck.links:
        for row in link.dependents:
            follows.setdefault(row, []).append(link)
    for row, links in follows.items():
        for link in links:
            # a node that follows one link alone needs no other directions than those in which it is used
            needed = acting.get(row, frozenset()) | frozenset(deck.supports.get(row, ()))
            bare = not on_bars[row] and len(links) == 1 and needed <= frozenset(link.directions)
            if bare or frozenset(link.directions) == _ALL:
                yield row, link.node
    for row, fixed in deck.supports.items():
        needed = acting.get(row, frozenset()).union(*(link.directions for link in follows.get(row, ())))
        if not on_bars[row] and needed <= frozenset(fixed):
            yield row, len(deck.nodes)
