"""Models of other programs' decks: the deck's elements, masses, supports, connections and constraints."""

import importlib
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count, islice
from pathlib import Path
from types import MappingProxyType

import numpy as np

from fem.array_types import Bools, Floats, Ints
from fem.chains import chains_of
from fem.effects.added_mass import AddedMass
from fem.effects.distributed_mass import DistributedMass
from fem.effects.joint import Joint
from fem.effects.rigid_link import MultiPointConstraint, RigidLink
from fem.effects.support import Support
from fem.elements.frame import Frame
from fem.elements.layout import axes_of, is_parallel
from fem.elements.properties import MemberProperties
from fem.io.deck_units import DeckUnits
from fem.io.faults import error_at
from fem.io.frame_deck import Connection, FrameDeck, terms_of
from fem.io.frame_nodes import Nodes
from fem.io.programs import ABAQUS, ALLOWED, ANSYS, NASTRAN, program_of
from fem.materials import PropertyError
from fem.mesh import FileNumbers, Mesh, MeshWarning, free_name
from fem.model import DIRECTIONS, Damping, Effect, Model, ModelError, lever_matrix

_READERS: Mapping[str, tuple[str, str]] = {
    NASTRAN: ("fem.io.nastran_frame", "read_nastran_frame"),
    ABAQUS: ("fem.io.abaqus_frame", "read_abaqus_frame"),
    ANSYS: ("fem.io.ansys_frame", "read_ansys_frame"),
}
"""Module and function that read a deck, by its program."""


def read_deck(path: str | os.PathLike[str], units: str | Sequence[float] | DeckUnits = "SI") -> FrameDeck:
    """Read the frame model of a Nastran, Abaqus, CalculiX or ANSYS deck; its text says the program.

    Parameters
    ----------
    path : path
        Where the text does not tell, ``.bdf .nas .dat .fem`` are Nastran, ``.inp`` Abaqus and CalculiX,
        ``.cdb .mac`` ANSYS.
    units : str or (length, mass, time)
        Of the deck: a name of :data:`fem.matrices.UNITS`, such as ``"mm-t-s"``, or the three in m, kg and s.

    Raises
    ------
    MeshError
        If the deck cannot be read, or has what no model here can have; the message names file, line and card.
    """
    file = Path(path)
    program = program_of(file)
    if program is None:
        raise error_at(file.name, f"models are read from {ALLOWED}, not '{file.suffix}'")
    if not file.is_file():
        raise error_at(file, "there is no such file")
    module, function = _READERS[program]
    reader: Callable[[Path, DeckUnits], FrameDeck] = getattr(importlib.import_module(module), function)
    return reader(file, DeckUnits.of(units))


def read_model(path: str | os.PathLike[str], units: str | Sequence[float] | DeckUnits = "SI") -> Model:
    """Read the model of a Nastran, Abaqus, CalculiX or ANSYS deck.

    The elements are the deck's; ``model.with_mesh(model.mesh.refined(size))`` has smaller ones. Members are
    named by property, points ``"node 12"``. One :class:`~fem.mesh.MeshWarning` lists what the model does not
    have of the deck; the mesh keeps its sentences as ``notes``.

    Parameters
    ----------
    path, units
        As of :func:`read_deck`.

    Raises
    ------
    MeshError
        As :func:`read_deck` and :func:`model_of`.
    """
    model = model_of(read_deck(path, units))
    if model.mesh.notes:
        warnings.warn("; ".join(model.mesh.notes), MeshWarning, stacklevel=2)
    return model


def model_of(deck: FrameDeck) -> Model:
    """Return the model of a deck, with the deck's elements.

    Bars of one property that follow one another are one member, as far as they share orientation and offsets
    and have no release or taper between them; several are ``name.1``, ``name.2``, … and the group ``name``.
    A node on no bar that moves rigidly with another one, or not at all, becomes a lever arm; others become
    points on no line.

    Raises
    ------
    MeshError
        For a deck without sections, or with bars or bodies that cannot exist; the message names file and
        element or card.
    """
    if not deck.properties or not len(deck.bars.numbers):
        found = "no bars; a model" if not len(deck.bars.numbers) else "bars without sections; a model"
        raise error_at(deck.file, f"it has {found} needs bars with sections and materials")
    _check_bars(deck)
    nodes = Nodes.of(deck)
    try:
        mesh, members = _members_of(deck, nodes)
        effects = (Frame(members=members), *_effects(deck, nodes, mesh, members))
        return Model(mesh, _with_distinct_names(effects), deck.damping or Damping())
    except (ModelError, PropertyError) as reason:
        raise error_at(deck.file, f"{reason}") from reason


def _check_bars(deck: FrameDeck) -> None:
    """Refuse bars without length, and with an orientation along their axis, by their numbers."""
    axis = _axes(deck)
    ends = deck.points[deck.bars.ends]
    size = float(np.ptp(ends.reshape(-1, 3), axis=0).max())
    length = np.minimum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), np.linalg.norm(axis, axis=1))
    for bad, why in (
        (length <= 1e-9 * size, "has no length"),
        (is_parallel(axis, deck.bars.height), "has an orientation vector along its axis"),
    ):
        if bad.any():
            row = int(np.argmax(bad))
            a, b = deck.nodes[deck.bars.ends[row]]
            raise error_at(deck.file, f"element {deck.bars.numbers[row]}, from node {a} to node {b}, {why}")


def _axes(deck: FrameDeck) -> Floats:
    """Return the vectors along the bars' axes, between their offsets, (n, 3) [m]."""
    ends = deck.points[deck.bars.ends] + deck.bars.offsets
    return ends[:, 1] - ends[:, 0]


# Members ----------------------------------------------------------------------------------------------------


def _members_of(deck: FrameDeck, nodes: Nodes) -> tuple[Mesh, dict[str, MemberProperties]]:
    """Return the mesh and the properties of its members."""
    bars = deck.bars
    axes = axes_of(_axes(deck), bars.height)
    of_kind: dict[int, list[Ints]] = {}
    for piece in _pieces(deck, axes[:, 2]):
        of_kind.setdefault(int(bars.properties[piece[0]]), []).append(piece)
    names: dict[str, int] = {}
    for k in sorted(of_kind):
        names[free_name(deck.properties[k].name, deck.properties[k].name, names)] = k
    sets: dict[str, Ints] = {}
    groups: dict[str, tuple[str, ...]] = {}
    for name, k in names.items():
        free = (part for i in count(1) if (part := f"{name}.{i}") not in names)
        rows = of_kind[k]
        parts = (name,) if len(rows) == 1 else tuple(islice(free, len(rows)))
        sets |= zip(parts, rows, strict=True)
        if len(parts) > 1:
            groups[name] = parts
    kept = nodes.points
    points = {f"node {deck.nodes[row]}": i for i, row in enumerate(kept)}
    notes = [f"{deck.file}: {note}" for note in (*deck.notes, *nodes.notes)]
    mesh = Mesh.from_lines(deck.points[kept], nodes.point[bars.ends], sets, points, notes)
    numbers = FileNumbers(deck.nodes, deck.points, bars.numbers, bars.ends)
    properties = _Properties(deck, axes[:, 2])
    members = {name: properties.of(rows, mesh.lines[rows], nodes) for name, rows in mesh.members.items()}
    return replace(mesh, groups=MappingProxyType(groups), numbers=numbers), members


def _pieces(deck: FrameDeck, z: Floats) -> Iterator[Ints]:
    """Yield the bars of each member, one after the other.

    A closed piece is cut into two: its first point would depend on the order of its lines.
    """
    bars = deck.bars
    order, length, turned = chains_of(deck.points, bars.ends, bars.properties)
    ends = bars.ends.copy()
    ends[turned] = ends[turned][:, ::-1]
    for chain in np.split(order, np.cumsum(length)[:-1]):
        for piece in _cut(deck, z, turned, chain):
            if ends[piece[0], 0] == ends[piece[-1], 1]:
                yield from np.array_split(piece, 2)
            else:
                yield piece


def _cut(deck: FrameDeck, z: Floats, turned: Bools, chain: Ints) -> Iterator[Ints]:
    """Yield the parts of a chain that can be members."""
    bars = deck.bars
    p = deck.properties[bars.properties[chain[0]]]
    if p.section2 is not None or (p.theory == "bar" and bars.offsets[chain].any()):
        yield from chain[:, None]
        return
    mirrored = p.section.angle or p.section.shear_centre[0]  # seen from its other end
    hinged = np.asarray(np.isfinite(bars.stiffness[chain]).any(axis=2))
    offset, reverse = bars.offsets[chain], turned[chain].astype(np.int64)
    k = np.arange(len(chain))
    apart = hinged[k, 1 - reverse][:-1] | hinged[k, reverse][1:]
    for ends in (offset[:-1], offset[1:]):
        apart |= (np.abs(ends - offset[:-1, :1]) > 1e-9).any(axis=(1, 2))
    if mirrored:
        apart |= np.diff(reverse) != 0
    for piece in np.split(chain, np.flatnonzero(apart) + 1):
        rest = piece
        while len(rest):
            alike = [np.logical_and.accumulate(_like_first(v[rest])) for v in (bars.height, z)]
            n = int(np.count_nonzero(alike[0] | alike[1]))
            yield rest[:n]
            rest = rest[n:]


def _like_first(vectors: Floats) -> Bools:
    """Return which vectors have the direction of the first; NaN, the default, is like NaN alone."""
    absent = np.isnan(vectors[:, 0])
    unit = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    # Distance of unit vectors up to which bars have the same orientation: decks give about eight digits
    near = (np.abs(unit - unit[0]) <= 1e-7).all(axis=1)
    return np.where(absent | absent[0], absent & absent[0], near)


class _Properties:
    """Properties of members; those that are alike share one object, which elements treat together."""

    def __init__(self, deck: FrameDeck, z: Floats) -> None:
        self.deck, self.z = deck, z
        self.known: dict[tuple[object, ...], MemberProperties] = {}

    def of(self, rows: Ints, lines: Ints, nodes: Nodes) -> MemberProperties:
        """Return the properties of a member by its bars and their lines in the mesh."""
        bars = self.deck.bars
        turned = nodes.point[bars.ends[rows, 0]] != lines[:, 0]
        first, last = int(turned[0]), 1 - int(turned[-1])  # the bars' ends at those of the member
        height = bars.height[rows]
        up = height[0] if _like_first(height).all() else self.z[rows[0]]
        up = None if np.isnan(up).any() else up
        offsets = bars.offsets[rows[0], first], bars.offsets[rows[-1], last]
        ends = bars.stiffness[rows[0], first], bars.stiffness[rows[-1], last]
        kind = int(bars.properties[rows[0]])
        arrays = (*offsets, *ends, *(() if up is None else (up,)))
        key = (kind, bool(turned[0]), *(a.tobytes() for a in arrays))
        if key not in self.known:
            self.known[key] = self._new(kind, bool(turned[0]), up, offsets, ends, int(rows[0]))
        return self.known[key]

    def _new(
        self,
        kind: int,
        turned: bool,
        up: Floats | None,
        offsets: Sequence[Floats],
        ends: Sequence[Floats],
        row: int,
    ) -> MemberProperties:
        p = self.deck.properties[kind]
        section, section2 = p.section, p.section2
        if section2 is not None and turned:
            section, section2 = section2, section
        free = [tuple(d for d, k in zip(DIRECTIONS, end, strict=True) if k == 0) for end in ends]
        springs = [
            {d: float(k) for d, k in zip(DIRECTIONS, end, strict=True) if 0 < k < np.inf} for end in ends
        ]
        try:
            return MemberProperties(
                p.material,
                section,
                up,
                offsets[0],
                offsets[1],
                theory=p.theory,
                section2=section2,
                mass=p.mass,
                release1=free[0],
                release2=free[1],
                spring1=springs[0],
                spring2=springs[1],
            )
        except (ModelError, PropertyError) as reason:
            msg = f"element {self.deck.bars.numbers[row]}: {reason}"
            raise ModelError(msg) from reason


# Effects ----------------------------------------------------------------------------------------------------


def _effects(
    deck: FrameDeck, nodes: Nodes, mesh: Mesh, members: Mapping[str, MemberProperties]
) -> Iterator[Effect]:
    """Yield the effects other than the frame."""
    yield from _supports(deck, nodes)
    yield from _links(deck, nodes)
    for equation in deck.equations:
        if terms := _carried_terms(equation.terms, nodes):
            yield MultiPointConstraint(name=equation.name, terms=terms)
    for c in deck.connections:
        yield from _joint(deck, nodes, c)
    for body in deck.bodies:
        row = nodes.carrier(body.node)
        if row is not None:
            arm = body.arm + deck.points[body.node] - deck.points[row]
            yield AddedMass(
                name=body.name, point=nodes.index(row), mass=body.mass, inertia=body.inertia, arm=arm
            )
    for name, rows in mesh.members.items():
        if layer := deck.properties[deck.bars.properties[rows[0]]].mass_per_length:
            yield DistributedMass.over(mesh, name, members[name], layer)


def _supports(deck: FrameDeck, nodes: Nodes) -> Iterator[Effect]:
    for row in nodes.grounded:
        yield Support(name=f"node {deck.nodes[row]}", point=nodes.index(row))
    for row, fixed in deck.supports.items():
        carrier = nodes.carrier(row)
        if carrier is None or carrier in nodes.grounded or not fixed:
            continue
        name = f"node {deck.nodes[row]}"
        if carrier == row:
            yield Support(name=name, point=nodes.index(row), fixed=tuple(fixed))
        else:
            yield Joint(name=name, point1=nodes.index(carrier), location=deck.points[row], rigid=tuple(fixed))
    for row, free in nodes.void.items():
        yield Support(name=f"node {deck.nodes[row]}, no stiffness", point=nodes.index(row), fixed=free)


def _links(deck: FrameDeck, nodes: Nodes) -> Iterator[Effect]:
    """Yield links of rigid bodies, and those in some directions: rigid joints where the dependent node is."""
    for name, leader, others in nodes.bodies:
        yield RigidLink(
            name=name, point=nodes.index(leader), dependents=tuple(nodes.index(row) for row in others)
        )
    for link in deck.links:
        lead, points = nodes.carrier(link.node), []
        for row in link.dependents:
            follow = nodes.carrier(row)
            if nodes.body[row] == nodes.body[link.node]:
                continue
            if lead is not None and follow == row:
                points.append(nodes.index(row))
                continue
            first, second = (follow, lead) if follow is not None else (lead, None)
            assert first is not None  # two grounded nodes are one body
            yield Joint(
                name=link.name,
                point1=nodes.index(first),
                point2=_index(nodes, second),
                location=deck.points[row],
                rigid=link.directions,
            )
        if points and lead is not None:
            yield RigidLink(
                name=link.name, point=nodes.index(lead), dependents=tuple(points), directions=link.directions
            )


def _index(nodes: Nodes, row: int | None) -> int | None:
    return None if row is None else nodes.index(row)


def _carried_terms(
    terms: Sequence[tuple[int, str, float]], nodes: Nodes
) -> tuple[tuple[int, str, float], ...]:
    """Return the terms of an equation at points of the mesh."""
    motions = []
    for row, direction, coefficient in terms:
        carrier = nodes.carrier(row)
        if carrier is not None:
            lever = lever_matrix(nodes.deck.points[row] - nodes.deck.points[carrier])
            motions.append((nodes.index(carrier), coefficient * lever[DIRECTIONS.index(direction)]))
    return terms_of(motions)


def _joint(deck: FrameDeck, nodes: Nodes, c: Connection) -> Iterator[Joint]:
    """Yield the joint of a connection; none between places without relative motion."""
    first, second = (None if row is None else nodes.carrier(row) for row in c.nodes)
    if first is None:
        first, second = second, None
    acts = c.rigid or any(X.any() for X in (c.K, c.C, c.D))
    if acts and first is not None and first != second:
        yield Joint(
            name=c.name,
            point1=nodes.index(first),
            point2=_index(nodes, second),
            location=nodes.place_of(c),
            axes=c.axes,
            K=c.K,
            C=c.C,
            D=c.D,
            rigid=c.rigid,
        )


def _with_distinct_names(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return effects of which later ones have other names than earlier ones: ``name.2`` …."""
    out: dict[str, Effect] = {}
    for e in effects:
        name = free_name(e.name, e.name, out)
        out[name] = e if name == e.name else replace(e, name=name)
    return tuple(out.values())
