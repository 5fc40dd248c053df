"""Changes that a model makes to the deck that it was made of, in the numbers of that deck.

:func:`source_changes` compares the deck of the model with the source, element by element and card by card.
The modules ``nastran_changes``, ``abaqus_changes`` and ``ansys_changes`` write the changes as cards.
"""

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from fem.array_types import Floats
from fem.io.deck_nodes import bar_axes, text_of, wrapped
from fem.io.faults import refuse
from fem.io.frame_deck import BarProperty, Bars, Body, Connection, FrameDeck
from fem.io.frame_model import model_of
from fem.io.frame_of_model import ModelDeck, deck_of
from fem.materials import Material
from fem.mesh import MeshError
from fem.model import DIRECTIONS
from fem.sections.section import Section

SAME_PLACE = 1e-7
"""Distance of points up to which they are one node, in parts of the structure's size [-]."""
SAME_VALUE = 1e-8
"""Difference up to which values are the same: a study file has all digits of the deck [-]."""
CONSTANTS = ("A", "Iy", "Iz", "J", "ky", "kz", "Ip")
ITEMS = ("bodies", "connections", "links", "equations", "matrices")


class SourceError(MeshError):
    """A source deck whose numbers cards cannot keep."""


@dataclass(frozen=True, slots=True)
class SourceCard:
    """A card of the source deck.

    Attributes
    ----------
    name : str
        ``"MAT1 1"``.
    file : str
    lines : tuple of int
        Its lines in the file, from 1.
    """

    name: str
    file: str
    lines: tuple[int, ...]

    def __str__(self) -> str:
        first, last = self.lines[0], self.lines[-1]
        if last - first + 1 != len(self.lines):
            at = f"lines {', '.join(map(str, self.lines))}"
        else:
            at = f"line {first}" if first == last else f"lines {first}-{last}"
        return f"{self.name} of {self.file}, {at}"


@dataclass(slots=True)
class DeckEdit:
    """Cards for a source deck, and the cards of it that they replace.

    Attributes
    ----------
    mark : str
        Of comments.
    lines : list of str
        The cards, each after comments that name those that it replaces.
    replaced : list of SourceCard
    redefined : list of str
        Cards of which a second definition takes the place of the first, so that they may stay.
    control : list of str
        Lines that the deck's case control needs besides.
    unread : list of str
        Cards of these that :func:`fem.io.read_model` leaves out, ``"K2GG"``.
    notes : list of str
    """

    mark: str
    lines: list[str] = field(default_factory=list)
    replaced: list[SourceCard] = field(default_factory=list)
    redefined: list[str] = field(default_factory=list)
    control: list[str] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def replace(self, *cards: SourceCard, by: Iterable[str] = ()) -> None:
        """Add cards that replace others; a card that is replaced already is not named again."""
        for card in cards:
            if card not in self.replaced:
                self.replaced.append(card)
                self.lines.append(f"{self.mark} replaces {card}")
        self.lines += by

    def text(self, heading: Sequence[str]) -> str:
        """Return the cards with comments: what they are, what case control needs, and notes."""
        ask = [f"{self.mark} case control: {line}" for line in self.control]
        return text_of(self.mark, heading, [*ask, *self.lines, *self._notes()])

    def _notes(self) -> list[str]:
        return [line for note in self.notes for line in wrapped(self.mark, f"NOTE: {note}")]

    def merged(self, text: str, file: str, heading: Sequence[str], before: str, control: str = "") -> str:
        """Return the text of the source with these cards in it.

        Parameters
        ----------
        text, file : str
            The source, and its name.
        heading : sequence of str
        before, control : str
            Patterns of the lines before which the cards, and the lines of case control, go.

        Raises
        ------
        MeshError
            If the cards replace some of a file that the source includes.
        """
        elsewhere = next((c for c in self.replaced if c.file != file), None)
        if elsewhere is not None:
            refuse(f"{elsewhere}: this file is included by {file}; merge the cards by hand", MeshError)
        gone = {line for c in self.replaced for line in c.lines}
        lines = [
            f"{self.mark} replaced: {line}" if k in gone else line
            for k, line in enumerate(text.rstrip("\n").split("\n"), 1)
        ]
        cards = text_of(self.mark, heading, [*self.lines, *self._notes()]).splitlines()
        for pattern, more in ((before, cards), (control, self.control)):
            at = next((k for k, line in enumerate(lines) if pattern and re.match(pattern, line, re.I)), None)
            if at is None and more is self.control:
                continue  # the file is the bulk data alone
            lines[len(lines) if at is None else at : len(lines) if at is None else at] = more
        return "".join(f"{line}\n" for line in lines)


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A bar of the changed model that is an element of the source, or a part of one.

    Attributes
    ----------
    source : int
        Row of the source's bars, -1 for a bar that the source does not have.
    first : bool
        Whether it is the first part of its element.
    joined : bool
        Whether its nodes, end stiffnesses, offsets or orientation have changed.
    variant : int
        Row of the changes' variants, -1 where its property is that of the source.
    """

    source: int
    first: bool
    joined: bool
    variant: int


@dataclass(frozen=True, slots=True, eq=False)
class Variant:
    """A changed property of bars.

    Attributes
    ----------
    source : int
        Row of the source's properties; -1 of bars that the source does not have.
    new : BarProperty
        As the model has it.
    material, section : bool
        Whether its material, and anything else, has changed.
    complete : bool
        Whether all bars of the source's property have it.
    """

    source: int
    new: BarProperty
    material: bool
    section: bool
    complete: bool


@dataclass(frozen=True, eq=False)
class SourceChanges:
    """The changes of a source deck.

    Attributes
    ----------
    source : FrameDeck
    before : ModelDeck
        The deck of the source's model; its bars are those of the source, row by row.
    deck : ModelDeck
        Bars that differ, with new items and supports, in the source's numbers.
    pieces : tuple of Piece
        Of the bars of ``deck``, row by row.
    variants : tuple of Variant
    materials : mapping of str to Material
        New values of the source's materials that no bar has as they were, by name in the source.
    removed : tuple
        Items of the source that the model does not have any longer.
    freed : mapping of int to tuple of str
        Global directions of nodes of the source, by number, that are no longer fixed.
    lost : tuple of int
        Rows of the source's bars that the model does not have.
    """

    source: FrameDeck
    before: ModelDeck
    deck: ModelDeck
    pieces: tuple[Piece, ...]
    variants: tuple[Variant, ...]
    materials: Mapping[str, Material]
    removed: tuple[Any, ...]
    freed: Mapping[int, tuple[str, ...]]
    lost: tuple[int, ...]

    @cached_property
    def shifted(self) -> frozenset[int]:
        """The source's properties whose axes are not those of their elements, or lie off their nodes."""
        off = self.before.bars.offsets.any(axis=(1, 2))
        turned = (
            k for k, p in enumerate(self.source.properties) if p.section.angle or p.section2 is not None
        )
        return frozenset([*self.source.bars.properties[off].tolist(), *turned])

    def material(self, name: str) -> Material:
        """Return a material of the source."""
        return next(p.material for p in self.source.properties if p.material.name == name)


def source_changes(model_deck: ModelDeck, source: FrameDeck, first: Mapping[str, int]) -> SourceChanges:
    """Return what the deck of a model changes of the deck that the model was made of.

    Parameters
    ----------
    model_deck : ModelDeck
    source : FrameDeck
    first : mapping of str to int
        First free numbers of the source, of ``"node"``, ``"element"`` and the like.
    """
    before = _in_source(deck_of(model_of(source), source.file), source)
    after = _in_source(model_deck, source)
    own, shared = ({*d.bars.ends.ravel().tolist()} & {*range(len(source.nodes))} for d in (before, after))
    if 2 * len(own & shared) < len(own):
        msg = (
            f"{source.file}: {len(own & shared)} of its {len(own)} nodes on bars are points of the study; "
            "is this the deck that the study was made of, and are these its units?"
        )
        raise MeshError(msg)
    old = _pieces_by_bar(before, source)
    before = replace(
        before, bars=taken(before.bars, [old[k][0] if old[k] else (0, False) for k in range(len(old))])
    )
    rows, pieces, variants, lost = _changed_bars(after, before, source)
    removed, new = _items(after, before)
    was, now = ({_key(d, n): f for n, f in d.supports.items()} for d in (before, after))
    supports = {
        n: more for n, f in after.supports.items() if (more := others_than(f, was.get(_key(after, n), ())))
    }
    freed = {
        int(before.nodes[n]): less
        for n, f in before.supports.items()
        if (less := others_than(f, now.get(_key(before, n), ())))
    }
    bars = _spanned(after.bars, rows)
    names = [source.bars.numbers[p.source] if p.source >= 0 else 0 for p in pieces]
    bars = replace(bars, numbers=np.array(names, dtype=np.int64))
    needed = {*bars.ends.ravel().tolist(), *supports, *_used(replace(after, supports=supports, **new))}
    bound = {(n, d) for n, f in after.supports.items() for d in f}
    bound |= {
        (n, d)
        for link in after.links
        if link not in new["links"]
        for n in link.dependents
        for d in link.directions
    }
    bound |= {(n, d) for e in after.equations if e not in new["equations"] for n, d, _ in e.terms}
    bound |= {
        (n, d)
        for c in after.connections
        if c.rigid and c not in new["connections"]
        for n in c.nodes
        if n is not None
        for d in DIRECTIONS
    }
    deck = replace(
        after,
        bars=bars,
        supports=supports,
        part=True,
        first=dict(first),
        bound=frozenset(bound),
        known=frozenset(n for n in range(len(after.nodes)) if n < len(source.nodes) or n not in needed),
        **new,
    )
    return SourceChanges(
        source,
        before,
        _numbered(deck, needed, len(source.nodes)),
        tuple(pieces),
        tuple(variants),
        _materials(source, variants, pieces),
        tuple(removed),
        freed,
        tuple(lost),
    )


def others_than(some: Sequence[str], others: Sequence[str]) -> tuple[str, ...]:
    """Return those that are not among others."""
    return tuple(d for d in some if d not in others)


# Nodes ------------------------------------------------------------------------------------------------------


def _in_source(deck: ModelDeck, source: FrameDeck) -> ModelDeck:
    """Return a deck whose first nodes are those of the source; others have the number 0."""
    size = max(float(np.ptp(source.points, axis=0).max()), 1e-300)
    row_of = {int(n): k for k, n in enumerate(source.nodes)}
    new = np.full(len(deck.nodes), -1, dtype=np.int64)
    for k, n in enumerate(deck.nodes.tolist()):
        at = row_of.get(n)
        if at is not None and np.abs(deck.points[k] - source.points[at]).max() <= SAME_PLACE * size:
            new[k] = at
    # nodes whose names have changed lie at their places
    taken = set(new.tolist())
    rest = np.array([k for k in range(len(source.nodes)) if k not in taken], dtype=np.int64)
    lone = np.flatnonzero(new < 0)
    if len(rest) and len(lone):
        gap, at = cKDTree(source.points[rest]).query(deck.points[lone])
        for k, g, j in zip(lone.tolist(), gap.tolist(), at.tolist(), strict=True):
            if g <= SAME_PLACE * size and int(rest[j]) not in taken:
                new[k] = rest[j]
                taken.add(int(rest[j]))
    n = len(source.nodes)
    more = np.flatnonzero(new < 0)
    new[more] = n + np.arange(len(more))
    renamed: dict[str, Any] = {key: tuple(_at(x, new) for x in getattr(deck, key)) for key in ITEMS}
    return replace(
        deck,
        nodes=np.concatenate([source.nodes, np.zeros(len(more), dtype=np.int64)]),
        points=np.concatenate([source.points, deck.points[more]]),
        bars=replace(deck.bars, ends=new[deck.bars.ends]),
        supports={int(new[k]): f for k, f in deck.supports.items()},
        **renamed,
    )


def _at(item: Any, new: np.ndarray) -> Any:
    """Return an item with other rows of its nodes."""
    changes: dict[str, Any] = {}
    for f in fields(item):
        value = getattr(item, f.name)
        if f.name == "node":
            changes[f.name] = int(new[value])
        elif f.name in ("nodes", "dependents"):
            changes[f.name] = tuple(None if n is None else int(new[n]) for n in value)
        elif f.name == "terms":
            changes[f.name] = tuple((int(new[n]), d, a) for n, d, a in value)
    return replace(item, **changes)


def nodes_of(item: Any) -> list[int]:
    """Return the rows of an item's nodes."""
    out: list[Any] = []
    for f in fields(item):
        value = getattr(item, f.name)
        if f.name == "node":
            out.append(value)
        elif f.name in ("nodes", "dependents"):
            out += value
        elif f.name == "terms":
            out += [n for n, _, _ in value]
    return [n for n in out if n is not None]


def _used(deck: ModelDeck) -> set[int]:
    """Return the rows of nodes on which something other than bars acts."""
    return {n for key in ITEMS for x in getattr(deck, key) for n in nodes_of(x)} | set(deck.supports)


def _key(deck: ModelDeck, row: int) -> object:
    """Return the row of a node of the source, else the place of another one."""
    return row if deck.nodes[row] else tuple(np.round(deck.points[row], 9).tolist())


def _numbered(deck: ModelDeck, needed: set[int], n: int) -> ModelDeck:
    """Return a deck whose new nodes have numbers above those of the source."""
    free = count(deck.first["node"])
    numbers = deck.nodes.copy()
    for k in range(n, len(numbers)):
        if k in needed:
            numbers[k] = next(free)
    return replace(deck, nodes=numbers, first={**deck.first, "node": next(free)})


# Bars -------------------------------------------------------------------------------------------------------

Oriented = tuple[int, bool]
"""Row of a bar, and whether it runs from its second end to its first."""


def taken(bars: Bars, rows: Sequence[Oriented]) -> Bars:
    """Return some bars, turned where that is asked for."""
    at = np.array([k for k, _ in rows], dtype=np.int64)
    turn = np.array([t for _, t in rows], dtype=bool)
    found: dict[str, Any] = {f.name: getattr(bars, f.name)[at].copy() for f in fields(bars)}
    for key in ("ends", "offsets", "stiffness"):
        found[key][turn] = found[key][turn][:, ::-1]
    return Bars(**found)


def with_bars(deck: ModelDeck, rows: Sequence[int]) -> ModelDeck:
    """Return a deck with some of its bars, and with the properties that these have."""
    bars = taken(deck.bars, [(k, False) for k in rows])
    used, which = np.unique(bars.properties, return_inverse=True)
    properties = tuple(deck.properties[i] for i in used)
    return replace(deck, bars=replace(bars, properties=which), properties=properties)


def without_items(deck: ModelDeck, items: Sequence[Body | Connection]) -> ModelDeck:
    """Return a deck without some of its bodies and connections."""
    kept = {key: tuple(x for x in getattr(deck, key) if x not in items) for key in ("bodies", "connections")}
    return replace(deck, **kept)


def _spanned(bars: Bars, pairs: Sequence[tuple[Oriented, Oriented]]) -> Bars:
    """Return bars from the first end of one bar to the second end of another."""
    one, other = (taken(bars, [pair[k] for pair in pairs]) for k in (0, 1))
    return replace(
        one,
        **{
            key: np.stack([getattr(one, key)[:, 0], getattr(other, key)[:, 1]], axis=1)
            for key in ("ends", "offsets", "stiffness")
        },
    )


def _runs(deck: ModelDeck) -> Iterator[list[Oriented]]:
    """Yield the bars between two nodes of the source, one after the other; other bars alone."""
    ends = deck.bars.ends
    known = deck.nodes > 0
    touching: dict[int, list[int]] = defaultdict(list)
    for k, (a, b) in enumerate(ends.tolist()):
        for n in (a, b):
            if not known[n]:
                touching[n].append(k)
    seen = np.zeros(len(ends), dtype=bool)
    for start in [*np.flatnonzero(known[ends].any(axis=1)).tolist(), *range(len(ends))]:
        if seen[start]:
            continue
        a, b = ends[start].tolist()
        run, at, k = [(start, not known[a] and bool(known[b]))], b if known[a] or not known[b] else a, start
        seen[start] = True
        while not known[at] and len(touching[at]) == 2 and known[ends[run[0][0], int(run[0][1])]]:
            k = next((j for j in touching[at] if j != k), k)
            if seen[k]:
                break
            seen[k] = True
            turned = int(ends[k, 0]) != at
            run.append((k, turned))
            at = int(ends[k, 0 if turned else 1])
        yield run


def _pieces_by_bar(deck: ModelDeck, source: FrameDeck) -> list[list[Oriented]]:
    """Return the bars of a deck that are each bar of the source, from its first end to its second."""
    found: dict[tuple[int, ...], list[list[Oriented]]] = defaultdict(list)
    for run in _runs(deck):
        a, b = _end(deck, run, 0), _end(deck, run, 1)
        if deck.nodes[a] and deck.nodes[b]:
            found[tuple(sorted((a, b)))].append(run)
    out: list[list[Oriented]] = []
    for k, (a, b) in enumerate(source.bars.ends.tolist()):
        runs = found[tuple(sorted((a, b)))]
        if not runs:
            out.append([])
            continue
        like = source.properties[source.bars.properties[k]]
        best = next(
            (r for r in runs if same_property(deck.properties[deck.bars.properties[r[0][0]]], like)), runs[0]
        )
        runs.remove(best)
        if _end(deck, best, 0) != a:
            best = [(j, not turned) for j, turned in reversed(best)]
        out.append(best)
    return out


def _end(deck: ModelDeck, run: Sequence[Oriented], end: int) -> int:
    k, turned = run[-end]
    return int(deck.bars.ends[k, end ^ int(turned)])


def _changed_bars(
    after: ModelDeck, before: ModelDeck, source: FrameDeck
) -> tuple[list[tuple[Oriented, Oriented]], list[Piece], list[Variant], list[int]]:
    """Return the bars that differ, their pieces, the changed properties, and bars that are lost."""
    by_bar, used = _pieces_by_bar(after, source), _used(after)
    axes = bar_axes(after), bar_axes(before)
    kinds: list[tuple[int, BarProperty, set[int]]] = []
    rows: list[tuple[Oriented, Oriented]] = []
    pieces: list[Piece] = []
    lost: list[int] = []
    seen: set[int] = set()
    touching = Counter(after.bars.ends.ravel().tolist())
    for s, run in enumerate(by_bar):
        seen |= {k for k, _ in run}
        if not run:
            lost.append(s)
            continue
        parts = _joined(after, run, used, touching)
        old = before.properties[before.bars.properties[s]]
        which = []
        for part in parts:
            new = _property_of(after, part)
            same = same_property(new, old) and not (new.section2 is not None and part[0][1])
            which.append(-1 if same else _kind(kinds, int(source.bars.properties[s]), new, s))
        b = taken(after.bars, [parts[0][0], parts[-1][-1]])
        joined = len(parts) > 1 or not _same_ends(b, before.bars, s, axes, parts[0][0][0], old)
        if not joined and which == [-1]:
            continue
        for i, part in enumerate(parts):
            rows.append((part[0], part[-1]))
            pieces.append(Piece(s, i == 0, joined, which[i]))
    for k in range(len(after.bars.numbers)):
        if k not in seen:
            new = after.properties[after.bars.properties[k]]
            rows.append(((k, False), (k, False)))
            pieces.append(Piece(-1, True, True, _kind(kinds, -1, new, -1)))
    total = Counter(source.bars.properties.tolist())
    variants = []
    for kind, new, bars in kinds:
        old = (
            None
            if kind < 0
            else next(
                before.properties[before.bars.properties[s]]
                for s in range(len(by_bar))
                if source.bars.properties[s] == kind
            )
        )
        whole = (
            kind >= 0
            and len(bars) == total[kind]
            and all(p.variant >= 0 and kinds[p.variant][1] is new for p in pieces if p.source in bars)
        )
        variants.append(
            Variant(
                kind,
                new,
                old is None or not same_material(new.material, old.material),
                old is None or not same_property(replace(new, material=old.material), old),
                whole,
            )
        )
    return rows, pieces, variants, lost


def _property_of(deck: ModelDeck, part: Sequence[Oriented]) -> BarProperty:
    return deck.properties[deck.bars.properties[part[0][0]]]


def _joined(
    deck: ModelDeck, run: Sequence[Oriented], used: set[int], touching: Mapping[int, int]
) -> list[list[Oriented]]:
    """Return a run in parts: a part ends at a node on which something acts, or where properties change."""
    out = [[run[0]]]
    b = deck.bars
    for one in run[1:]:
        last = out[-1][-1]
        node = _end(deck, [one], 0)
        stiff = (
            np.isinf(b.stiffness[last[0], 1 - last[1]]).all()
            and np.isinf(b.stiffness[one[0], int(one[1])]).all()
        )
        alike = same_property(_property_of(deck, [one]), _property_of(deck, [last]))
        if node not in used and stiff and alike and touching[node] == 2:
            out[-1].append(one)
        else:
            out.append([one])
    return out


def _kind(kinds: list[tuple[int, BarProperty, set[int]]], source: int, new: BarProperty, bar: int) -> int:
    """Return the place of a changed property among those that are known, and count a bar of it."""
    for i, (kind, known, bars) in enumerate(kinds):
        if kind == source and same_property(new, known):
            bars.add(bar)
            return i
    kinds.append((source, new, {bar}))
    return len(kinds) - 1


def _same_ends(b: Bars, old: Bars, s: int, axes: tuple[Floats, Floats], row: int, p: BarProperty) -> bool:
    """Whether both ends of a bar are as in the source."""
    for end, k in ((0, 0), (1, -1)):
        now, then = b.stiffness[k, end], old.stiffness[s, end]
        if not (now == then).all() and not np.allclose(now, then, rtol=SAME_VALUE, atol=0):
            return False
        if np.abs(b.offsets[k, end] - old.offsets[s, end]).max() > 1e-9:
            return False
    round_section = math.isclose(p.section.Iy, p.section.Iz, rel_tol=SAME_VALUE) and not old.offsets[s].any()
    return round_section or abs(float(axes[0][row, 2] @ axes[1][s, 2])) > 1 - SAME_VALUE


def _close(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=SAME_VALUE, abs_tol=1e-300)


def same_material(a: Material, b: Material) -> bool:
    """Whether two materials have the same values, whatever their names."""
    return all(_close(getattr(a, k), getattr(b, k)) for k in ("E", "rho", "nu", "loss_factor"))


def _same_section(a: Section | None, b: Section | None) -> bool:
    if a is None or b is None:
        return a is b
    return all(_close(getattr(a, k), getattr(b, k)) for k in CONSTANTS)


def same_property(a: BarProperty, b: BarProperty) -> bool:
    """Whether two properties have the same values."""
    return (
        a.theory == b.theory
        and same_material(a.material, b.material)
        and _close(a.mass_per_length, b.mass_per_length)
        and _same_section(a.section, b.section)
        and _same_section(a.section2, b.section2)
    )


def _materials(
    source: FrameDeck, variants: Sequence[Variant], pieces: Sequence[Piece]
) -> dict[str, Material]:
    """Return the values that most bars of a material have, where no bar has the source's any longer."""
    of_bar: dict[int, list[Material | None]] = defaultdict(list)
    for p in pieces:
        if p.source >= 0:
            of_bar[p.source].append(variants[p.variant].new.material if p.variant >= 0 else None)
    found: dict[str, list[Material | None]] = defaultdict(list)
    for s, k in enumerate(source.bars.properties.tolist()):
        found[source.properties[k].material.name] += of_bar.get(s, [None])
    old = {p.material.name: p.material for p in source.properties}
    out: dict[str, Material] = {}
    for name, each in found.items():
        if any(m is None or same_material(m, old[name]) or not _close(m.nu, old[name].nu) for m in each):
            continue
        kinds: list[list[Material]] = []
        for m in each:
            assert m is not None
            like = next((kind for kind in kinds if same_material(kind[0], m)), None)
            if like is None:
                kinds.append([m])
            else:
                like.append(m)
        out[name] = max(kinds, key=len)[0]
    return out


# Items ------------------------------------------------------------------------------------------------------


def _items(after: ModelDeck, before: ModelDeck) -> tuple[list[Any], dict[str, tuple[Any, ...]]]:
    """Return the items that the model does not have any longer, and its new ones."""
    removed: list[Any] = []
    new: dict[str, tuple[Any, ...]] = {}
    for key in ITEMS:
        old: dict[tuple[Any, ...], list[Any]] = defaultdict(list)
        for x in getattr(before, key):
            old[tuple(nodes_of(x))].append(x)
        more = []
        for x in getattr(after, key):
            candidates = old[tuple(nodes_of(x))]
            same = next((y for y in candidates if _same_item(x, y)), None)
            if same is None:
                more.append(x)
            else:
                candidates.remove(same)
        new[key] = tuple(more)
        removed += [x for rest in old.values() for x in rest]
    return removed, new


def _same_item(a: Any, b: Any) -> bool:
    """Whether two items of the same nodes have the same values, whatever their names."""
    for f in fields(a):
        x, y = getattr(a, f.name), getattr(b, f.name)
        if f.name in ("name", "node", "nodes", "dependents", "place"):
            continue
        if f.name == "terms":
            if len(x) != len(y) or [t[1] for t in x] != [t[1] for t in y]:
                return False
            x, y = (np.array([t[2] for t in terms]) for terms in (x, y))
        if isinstance(x, (np.ndarray, float)):
            size = max(float(np.abs(x).max(initial=0.0)), float(np.abs(y).max(initial=0.0)))
            if np.abs(np.asarray(x) - y).max(initial=0.0) > SAME_VALUE * size:
                return False
        elif x != y:
            return False
    return True
