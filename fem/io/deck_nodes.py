"""Decks for programs with fewer kinds of card: nodes for rigid arms and end springs, equations by DOF."""

import re
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.linalg import qr
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fem.array_types import Floats
from fem.elements.layout import axes_of
from fem.io.deck_units import DeckUnits
from fem.io.faults import refuse
from fem.io.frame_deck import BarProperty, Bars, Body, Connection, Equation, Found, FrameDeck, Link
from fem.io.frame_of_model import ModelDeck, NodeMatrices
from fem.mesh import MeshError
from fem.model import DIRECTIONS, lever_matrix
from fem.sections.section import Section

Term = tuple[int, str, float]
"""Row of a node, direction and coefficient."""
FIRST_OF_PART = 900_001
"""First number of cards for a model whose numbers are not known."""
COINCIDENT = 1e-9
"""Length of an arm below which there is none, in parts of the structure's size [-]."""
INDEPENDENT = 1e-9
"""Part of the largest pivot below which an equation follows from others [-]."""


@dataclass(slots=True)
class _More(Found):
    """Nodes, links and connections that are added to a deck."""

    points: list[Floats]
    springs: list[Connection] = field(default_factory=list)
    followers: dict[tuple[float, ...], int] = field(default_factory=dict)

    def node(self, place: Floats) -> int:
        """Add a node."""
        self.points.append(place)
        return len(self.points) - 1

    def follower(self, node: int, place: Floats, name: str) -> int:
        """Add a node that follows another one rigidly; return that one itself if it is at the place."""
        size = max(float(np.ptp(np.array(self.points), axis=0).max()), 1e-300)
        if np.abs(place - self.points[node]).max() <= COINCIDENT * size:
            return node
        key = (node, *np.round(place / size, 9).tolist())
        if key in self.followers:
            return self.followers[key]
        new = self.followers[key] = self.node(place)
        self.links.append(Link(name=f"arm of {name}", node=node, dependents=(new,), directions=DIRECTIONS))
        return new

    def split(self, m: NodeMatrices) -> None:
        """Add springs, dashpots and masses that stand for matrices."""
        if m.D.any():
            self.notes.append(f"{m.name}: not in this file: its loss factor")
        for key in "KCM":
            values, vectors = np.linalg.eigh(getattr(m, key))
            some = np.abs(values) > INDEPENDENT * np.abs(values).max(initial=0.0)
            if key == "M" and (values[some] < 0).any():
                self.notes.append(
                    f"{m.name}: not in this file: masses that it takes away, {values[some].min():.3g} kg"
                )
                some &= values > 0
            for value, vector in zip(values[some], vectors.T[some], strict=True):
                self._scalar(m, key, float(value), np.where(np.abs(vector) > INDEPENDENT, vector, 0.0))

    def _scalar(self, m: NodeMatrices, key: str, value: float, vector: Floats) -> None:
        node = self.node(self.points[m.nodes[0]])
        self.supports[node] = DIRECTIONS[1:]
        terms = ((node, "x", -1.0), *_terms(m.nodes, vector))
        self.equations.append(Equation(name=m.name, terms=terms))
        if key == "M":
            self.bodies.append(Body(name=m.name, node=node, mass=value))
        else:
            X: Any = {key: np.diag([value, 0.0, 0.0, 0.0, 0.0, 0.0])}
            self.springs.append(Connection(name=m.name, nodes=(node, None), **X))


def first_element(deck: ModelDeck) -> int:
    """Return the number of the first element that is no bar."""
    if "element" in deck.first:
        return deck.first["element"]
    return max(int(deck.bars.numbers.max(initial=0)) + 1, FIRST_OF_PART if deck.part else 1)


def first_number(deck: ModelDeck, of: str) -> int:
    """Return the first number of properties, materials, systems or sets of constraints."""
    return deck.first.get(of, FIRST_OF_PART if deck.part else 1)


def directions_in(axes: Floats, directions: Sequence[str]) -> tuple[int, ...] | None:
    """Return the components 0 to 5 along a node's axes of global directions; None if the axes are skew."""
    out = []
    for d in directions:
        k = DIRECTIONS.index(d)
        along = np.abs(axes[:, k % 3])
        if along.max() < 1 - INDEPENDENT:
            return None
        out.append(int(np.argmax(along)) + 3 * (k // 3))
    return tuple(sorted(out))


def fixed_components(deck: ModelDeck, axes: str) -> Iterator[tuple[int, tuple[int, ...]]]:
    """Yield each supported node's row, and its components 0 to 5 along its axes, which messages call so."""
    for row, fixed in deck.supports.items():
        along = directions_in(deck.axes.get(row, np.eye(3)), fixed)
        if along is None:
            msg = f"node {deck.nodes[row]}: {' '.join(fixed)} are fixed, which are not along {axes}"
            refuse(msg, MeshError)
        yield row, along


def bar_axes(deck: FrameDeck) -> Floats:
    """Return the local axes of the bars as rows, (n, 3, 3)."""
    ends = deck.points[deck.bars.ends] + deck.bars.offsets
    return axes_of(ends[:, 1] - ends[:, 0], deck.bars.height)


def with_nodes(
    deck: ModelDeck,
    *,
    offsets: bool = False,
    releases: bool = False,
    arms: bool | None = False,
    bodies: bool = False,
    springs: Callable[[Connection], bool] | None = None,
) -> ModelDeck:
    """Return a deck of the same structure with nodes in place of what a program has no card for.

    Springs at the ends of bars always become connections.

    Parameters
    ----------
    deck : ModelDeck
    offsets, releases : bool
        Whether those of bars become nodes too.
    arms : bool or None
        Whether the arms of connections become nodes; None: those of
        uncoupled ones that do not act midway between two nodes.
    bodies : bool
        Whether the arms of bodies become nodes.
    springs : callable, optional
        Which connections the program has springs for. The others, and matrices, become springs, dashpots and
        masses of nodes that move along x by a combination of the motions of others: X = Σ λ v vᵀ.
    """
    more = _More(list(deck.points))
    bars = _with_ends(deck, more, offsets, releases)
    connections = [*deck.connections, *more.connections]
    if arms is not False:
        connections = [
            _at_place(c, more) if arms or (plain(c) and not _midway(more.points, c)) else c
            for c in connections
        ]
    matrices = deck.matrices
    if springs is not None:
        coupled = [c for c in connections if not springs(c)]
        at = replace(deck, points=np.array(more.points))
        for m in (*matrices, *(connection_matrices(at, c) for c in coupled)):
            more.split(m)
        # rigid directions stay
        zero = np.zeros((6, 6))
        connections = [replace(c, K=zero, C=zero, D=zero) if c in coupled else c for c in connections]
        connections, matrices = [*connections, *more.springs], ()
    masses = [_at_centre(b, more) for b in deck.bodies] if bodies else deck.bodies
    first = max(int(deck.nodes.max(initial=0)) + 1, first_number(deck, "node"))
    numbers = np.concatenate([deck.nodes, np.arange(first, first + len(more.points) - len(deck.nodes))])
    return replace(
        deck,
        nodes=numbers,
        points=np.array(more.points),
        bars=bars,
        connections=tuple(connections),
        bodies=(*masses, *more.bodies),
        links=(*deck.links, *more.links),
        matrices=tuple(matrices),
        equations=(*deck.equations, *more.equations),
        supports={**deck.supports, **more.supports},
        notes=(*deck.notes, *more.notes),
    )


def _with_ends(deck: FrameDeck, more: _More, offsets: bool, releases: bool) -> Bars:
    """Return the bars with the ends that nodes and connections stand for."""
    b, axes = deck.bars, bar_axes(deck)
    ends, arms, stiffness = b.ends.copy(), b.offsets.copy(), b.stiffness.copy()
    for i, e in np.ndindex(ends.shape):
        k, name = stiffness[i, e], f"end {e + 1} of bar {b.numbers[i]}"
        sprung = (np.isfinite(k) & (releases | (k > 0))).any()
        rod = deck.properties[b.properties[i]].theory == "bar"
        if not (sprung or ((offsets or rod) and arms[i, e].any())):
            continue
        node, place = int(ends[i, e]), more.points[ends[i, e]] + arms[i, e]
        if sprung:
            ends[i, e] = more.node(place)
            rigid = tuple(d for d, value in zip(DIRECTIONS, k, strict=True) if np.isinf(value))
            K = np.diag(np.where(np.isinf(k), 0.0, k))
            more.connections.append(
                Connection(
                    name=name, nodes=(int(ends[i, e]), node), K=K, rigid=rigid, axes=axes[i], place=place
                )
            )
            stiffness[i, e] = np.inf
        else:
            ends[i, e] = more.follower(node, place, name)
        arms[i, e] = 0.0
    return replace(b, ends=ends, offsets=arms, stiffness=stiffness, height=axes[:, 2])


def place_of(c: Connection, points: Any) -> Floats:
    """Return where a connection acts [m]."""
    if c.place is not None:
        return c.place
    one, two = c.nodes
    return np.asarray(points[one] if two is None else (points[one] + points[two]) / 2)


def _midway(points: list[Floats], c: Connection) -> bool:
    one, two = c.nodes
    if two is None or c.place is None:
        return two is not None
    size = float(np.ptp(np.array(points), axis=0).max())
    return bool(np.abs((points[one] + points[two]) / 2 - c.place).max() <= COINCIDENT * size)


def _at_place(c: Connection, more: _More) -> Connection:
    place, (one, two) = place_of(c, more.points), c.nodes
    first = more.follower(one, place, c.name)
    second = None if two is None else more.follower(two, place, c.name)
    return replace(c, nodes=(first, second), place=place)


def _at_centre(b: Body, more: _More) -> Body:
    node = more.follower(b.node, more.points[b.node] + b.arm, b.name)
    return replace(b, node=node, arm=np.zeros(3))


def relative_motion(deck: FrameDeck, c: Connection) -> tuple[tuple[int, ...], Floats]:
    """Return the nodes of a connection and B (6, 6 n): its motion along its axes is B u."""
    place, R = place_of(c, deck.points), np.kron(np.eye(2), c.axes)
    one, two = c.nodes
    B = R @ lever_matrix(place - deck.points[one])
    if two is None:
        return (one,), B
    return (one, two), np.hstack([B, -R @ lever_matrix(place - deck.points[two])])


def solved_equations(deck: ModelDeck, *, links: bool = False) -> list[tuple[str, tuple[Term, ...]]]:
    """Return the equations and rigid directions of a deck, each solved for its first term, with its names.

    A DOF is the first term of one equation at most, is in no other one, is not supported, and follows in no
    link: programs eliminate it. Equations that follow from others are left out. Directions are those of the
    nodes' axes.

    Parameters
    ----------
    deck : ModelDeck
    links : bool
        Whether links are among the equations.

    Raises
    ------
    MeshError
        For an equation between DOFs that links lead.
    """
    equations = [*_rows(deck), *(_link_rows(deck) if links else ())]
    fixed = {(n, d) for n, ds in deck.supports.items() for d in ds}
    led = {(n, d) for k in deck.links for n in k.dependents for d in k.directions} if not links else set()
    if deck.part:  # supports may be cards of the other model: their DOFs stay in the equations
        led, fixed = led | fixed | deck.bound, set()
    led = {key for n, d in led for key in _along_axes(deck, n, d)}
    terms = [_terms_along_axes(deck, [t for t in e.terms if t[:2] not in fixed and t[2]]) for e in equations]
    columns = {key: i for i, key in enumerate(dict.fromkeys(key for row in terms for key in row))}
    at = [(i, columns[key], a) for i, row in enumerate(terms) for key, a in row.items()]
    if not at:
        return []
    i, j, a = (np.array(v) for v in zip(*at, strict=True))
    A = coo_array((a, (i, j)), shape=(len(terms), len(columns))).tocsr()
    group = connected_components(abs(A) @ abs(A).T, directed=False)[1]
    out = []
    for k in range(group.max() + 1):
        rows = np.flatnonzero(group == k)
        here = np.unique(A[rows].indices)
        keys = [list(columns)[c] for c in here]
        names = ", ".join(dict.fromkeys(equations[r].name for r in rows))
        out += [(names, row) for row in _solved(A[rows][:, here].toarray(), keys, led, names)]
    return out


def _along_axes(deck: ModelDeck, node: int, direction: str) -> list[tuple[int, str]]:
    """Return the directions of a node's axes that a global direction has a part in."""
    if node not in deck.axes:
        return [(node, direction)]
    k = DIRECTIONS.index(direction)
    parts = np.flatnonzero(np.abs(deck.axes[node][:, k % 3]) > INDEPENDENT)
    return [(node, DIRECTIONS[int(i) + 3 * (k // 3)]) for i in parts]


def _terms_along_axes(deck: ModelDeck, terms: Sequence[Term]) -> dict[tuple[int, str], float]:
    """Return the terms of an equation along the nodes' axes."""
    out: dict[tuple[int, str], float] = {}
    for node, direction, a in terms:
        for key in _along_axes(deck, node, direction):
            k, i = DIRECTIONS.index(direction), DIRECTIONS.index(key[1])
            factor = float(deck.axes[node][i % 3, k % 3]) if node in deck.axes else 1.0
            out[key] = out.get(key, 0.0) + factor * a
    return {key: a for key, a in out.items() if a}


def _solved(
    A: Floats, keys: list[tuple[int, str]], led: set[tuple[int, str]], names: str
) -> Iterator[tuple[Term, ...]]:
    """Yield the equations A u = 0, each solved for one DOF that is not led."""
    free = np.array([key not in led for key in keys])
    if not A.any():
        return
    Q, R, order = qr(A[:, free], pivoting=True)
    size = np.abs(np.diag(R))
    rank = int((size > INDEPENDENT * size.max(initial=0.0)).sum()) if size.size else 0
    turned = Q.T @ A
    if np.abs(turned[rank:]).max(initial=0.0) > INDEPENDENT * np.abs(A).max():
        msg = f"{names}: the equation is between nodes that follow others in rigid links; no card can hold it"
        raise MeshError(msg)
    pivots = np.flatnonzero(free)[order[:rank]]
    rows = np.linalg.solve(R[:rank, :rank], turned[:rank])
    # Of the coefficients of equations, without rounding of the solution
    rows = np.round(rows, 12)
    for p, row in zip(pivots, rows, strict=True):
        others = [j for j in np.flatnonzero(row) if j != p]
        yield ((*keys[p], 1.0), *((*keys[j], float(row[j])) for j in others))


def _rows(deck: FrameDeck) -> Iterator[Equation]:
    """Yield the equations of a deck, and those of directions without relative motion."""
    yield from deck.equations
    for c in deck.connections:
        nodes, B = relative_motion(deck, c)
        for d in c.rigid:
            row = B[DIRECTIONS.index(d)]
            yield Equation(name=c.name, terms=_terms(nodes, row))


def _link_rows(deck: FrameDeck) -> Iterator[Equation]:
    for link in deck.links:
        for node in link.dependents:
            B = np.hstack([np.eye(6), -lever_matrix(deck.points[node] - deck.points[link.node])])
            for d in link.directions:
                yield Equation(name=link.name, terms=_terms((node, link.node), B[DIRECTIONS.index(d)]))


def _terms(nodes: tuple[int, ...], row: Floats) -> tuple[Term, ...]:
    return tuple((nodes[j // 6], DIRECTIONS[j % 6], float(row[j])) for j in np.flatnonzero(row))


def plain(c: Connection) -> bool:
    """Whether springs along the axes of a connection represent it, with a loss factor each."""
    coupled = any((X - np.diag(np.diag(X))).any() for X in (c.K, c.C, c.D))
    return not coupled and not ((np.diag(c.D) != 0) & (np.diag(c.K) == 0)).any()


def all_matrices(deck: ModelDeck) -> list[NodeMatrices]:
    """Return the matrices of a deck with those of connections that no springs stand for."""
    return [*deck.matrices, *(connection_matrices(deck, c) for c in deck.connections if not plain(c))]


def connection_matrices(deck: FrameDeck, c: Connection) -> NodeMatrices:
    """Return the matrices of a connection on its nodes."""
    nodes, B = relative_motion(deck, c)
    K, C, D = (B.T @ X @ B for X in (c.K, c.C, c.D))
    return NodeMatrices(name=c.name, nodes=nodes, K=K, M=np.zeros_like(K), C=C, D=D)


def matrix_entries(
    deck: ModelDeck, quantity: str, units: DeckUnits, matrices: Sequence[NodeMatrices]
) -> dict[tuple[int, int], dict[tuple[int, int], float]]:
    """Return the columns of the sum of matrices K, M, C or D, lower triangle, in a deck's units.

    A column and a row are a number of a node and a direction 1 to 6.
    """
    out: dict[tuple[int, int], dict[tuple[int, int], float]] = {}
    for m in matrices:
        X = getattr(m, quantity) / matrix_scale(len(m.nodes), quantity, units)
        at = [(int(deck.nodes[n]), d) for n in m.nodes for d in range(1, 7)]
        for i, j in np.argwhere(X):
            if at[i] >= at[j]:
                column = out.setdefault(at[j], {})
                column[at[i]] = column.get(at[i], 0.0) + float(X[i, j])
    return {j: dict(sorted(out[j].items())) for j in sorted(out)}


def scale_of(direction: str, units: DeckUnits) -> float:
    """Return one unit of a motion in a direction [m, rad]."""
    return 1.0 if direction[0] == "r" else units.length


def matrix_scale(n: int, quantity: str, units: DeckUnits) -> Floats:
    """Return one unit of each entry of a matrix K, M, C or D of n nodes, (6 n, 6 n) [SI]."""
    per_time = {"K": units.time**2, "D": units.time**2, "C": units.time, "M": 1.0}[quantity]
    arm = np.tile(units.of_motions, n)
    return units.mass / per_time * np.outer(arm, arm)


_ASCII = str.maketrans({"±": "+-", "·": " ", "−": "-", "\u00a0": " ", "²": "^2", "³": "^3", "⁴": "^4"})
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_POWER = re.compile("·10([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)")


def wrapped(mark: str, text: str, width: int = 78) -> list[str]:
    """Return a text as lines of comment in ASCII."""
    plain = _POWER.sub(lambda found: f"e{found[1].translate(_RAISED)}", text).translate(_ASCII)
    lines = textwrap.wrap(plain.encode("ascii", "replace").decode(), width, break_on_hyphens=False)
    return [f"{mark} {line}" for line in lines]


def notes_of(mark: str, deck: ModelDeck) -> list[str]:
    """Return the notes of a deck as lines of comment."""
    return [line for text in deck.notes for line in wrapped(mark, f"NOTE: {text}")]


def text_of(mark: str, heading: Sequence[str], lines: Sequence[str]) -> str:
    """Return a text with a first comment."""
    head = [line for text in heading for line in wrapped(mark, text)]
    return "".join(f"{line}\n" for line in (*head, *lines))


def mean_section(p: BarProperty, mark: str) -> tuple[Section, list[str]]:
    """Return the section of a bar, the mean one of a taper with a comment on that."""
    if p.section2 is None:
        return p.section, []
    words = f"{p.name} is tapered: each element has the mean of its ends' constants"
    return Section.between(p.section, p.section2, 0.5), wrapped(mark, words)


def equation_cells(
    deck: ModelDeck,
    equations: Sequence[tuple[str, tuple[Term, ...]]],
    label: Mapping[str, Any],
    units: DeckUnits,
    mark: str,
) -> Iterator[tuple[list[str], list[tuple[Any, ...]]]]:
    """Yield the name of each equation as a comment, where it is new, and its terms in the deck's units."""
    before = ""
    for name, terms in equations:
        one = scale_of(terms[0][1], units)
        cells = [(deck.nodes[n], label[d], a * scale_of(d, units) / one) for n, d, a in terms]
        yield wrapped(mark, name) if name != before else [], cells
        before = name
