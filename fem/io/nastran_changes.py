"""Cards of Nastran that change a deck: they keep its numbers, and name the cards that they replace."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from fem.array_types import Floats
from fem.io.deck_nodes import all_matrices, bar_axes, directions_in, solved_equations, with_nodes, wrapped
from fem.io.deck_units import DeckUnits
from fem.io.frame_deck import BarProperty, Bars
from fem.io.frame_of_model import ModelDeck
from fem.io.frame_sections import material_of
from fem.io.nastran_bars import DEFAULTS
from fem.io.nastran_cards import BulkData, runs_of
from fem.io.nastran_deck import Card, NastranDeck, open_deck
from fem.io.nastran_frame import read_nastran_frame
from fem.io.nastran_properties import OF_ELEMENT, elastic
from fem.io.nastran_rigid import selected
from fem.io.nastran_write import (
    MATRICES,
    PIN,
    bar_card,
    card,
    nodes_and_supports,
    number,
    others,
    property_card,
)
from fem.io.source_changes import (
    DeckEdit,
    Piece,
    SourceCard,
    SourceChanges,
    Variant,
    nodes_of,
    same_material,
    same_property,
    source_changes,
)
from fem.materials import Material
from fem.model import DIRECTIONS

BARS = ("CBAR", "CBEAM", "CROD", "CTUBE", "CONROD")
_ITEM = re.compile(r"([A-Z][A-Z0-9]*) (\d+)(?: \((\d+)\))?")
_NODE = re.compile(r"(?:node|skew support of) (\d+)")


def nastran_changes(model_deck: ModelDeck, path: Path, units: DeckUnits) -> DeckEdit:
    """Return the cards that make a deck of Nastran that of a model.

    Parameters
    ----------
    model_deck : ModelDeck
        Of :func:`fem.io.frame_of_model.deck_of`.
    path : Path
        The deck that the model was made of.
    units : Units
        Of that deck.

    Raises
    ------
    MeshError
        If the deck cannot be read.
    """
    deck = open_deck(path, units)
    changes = source_changes(model_deck, read_nastran_frame(path, units), _free_numbers(deck))
    return _NastranWriter(deck, BulkData.of(path), changes).edit()


def _free_numbers(deck: NastranDeck) -> dict[str, int]:
    """Return the numbers above those of a deck."""

    def above(names: Iterable[str], fields: Sequence[int] = (0,)) -> int:
        texts = (c.text(k) for name in names for c in deck.of(name) for k in fields)
        return 1 + max((int(t) for t in texts if t.isdecimal() and len(t) < 20), default=0)

    elements = [n for n in deck.cards if n[:1] in "CR" and not n.startswith("CORD")]
    properties = [n for n in deck.cards if n[:1] == "P" and n != "PARAM"]
    systems = [n for n in deck.cards if n.startswith("CORD")]
    return {
        "node": 1 + max(map(int, deck.grids.numbers), default=0),
        "element": above([*elements, "PLOTEL"]),
        "property": above(properties, (0, 4))
        if {"PELAS", "PMASS", "PDAMP"} & {*properties}
        else above(properties),
        "material": above([n for n in deck.cards if n.startswith("MAT")]),
        "system": above(systems, (0, 4)) if any(n.startswith("CORD1") for n in systems) else above(systems),
    }


class _NastranWriter:
    """The cards of changes."""

    def __init__(self, deck: NastranDeck, bulk: BulkData, changes: SourceChanges) -> None:
        self.deck, self.changes, self.u = deck, changes, deck.units
        self.out = DeckEdit("$")
        self.refs = _references(bulk)
        self.elements = deck.by_number(*BARS)
        self.materials = deck.by_number("MAT1")
        self.first = dict(changes.deck.first)
        self.free_property, self.free_material = count(self.first["property"]), count(self.first["material"])
        self.made: list[tuple[str, Material, int]] = []
        self.new_properties: dict[tuple[int, str], int] = {}
        self.in_place: set[str] = set()
        self.skew: set[int] = set()
        self.property_cards: dict[int, Card | None] = {}
        source = changes.source
        self.material_cards = {
            source.properties[k].material.name: self._material_card_of(k)
            for k in np.unique(source.bars.properties).tolist()
        }

    def edit(self) -> DeckEdit:
        """Return the cards."""
        c = self.changes
        self._sets()
        rows = [k for k in range(len(c.source.nodes)) if self.deck.grids.displacement[k] > 0]
        axes = {k: self.deck.axes(k) for k in rows}
        scaled = _scaled(replace(c.deck, axes=axes, first=self.first), 1 / self.deck.mass_factor)
        deck = with_nodes(scaled, arms=None)
        removed = self._removed(deck)
        deck = removed
        for name, material in c.materials.items():
            self._material_in_place(name, material)
        self._properties_in_place()
        elements = count(self.first["element"])
        for k, piece in enumerate(c.pieces):
            self._bar(deck, k, piece, elements)
        for s in c.lost:
            self._replace(self.elements[int(c.source.bars.numbers[s])])
        self._freed()
        first = {
            **self.first,
            "element": next(elements),
            "property": next(self.free_property),
            "material": next(self.free_material),
        }
        bare = replace(deck, bars=Bars.of([]), properties=(), first=first)
        self.out.lines += [*nodes_and_supports(bare, self.u), *others(bare, self.u)]
        sets = {"SPC": bool(deck.supports), "MPC": bool(solved_equations(bare))}
        self.out.control += [
            f"{key} = {self.first[key]}" for key, used in sets.items() if used and not self._is_selected(key)
        ]
        used = [key for key in "KMCD" if any(getattr(m, key).any() for m in all_matrices(bare))]
        self.out.control += [f"{MATRICES[key]} = {key}EFF" for key in used]
        self.out.unread += [MATRICES[key] for key in used]
        return self.out

    # Sets ---------------------------------------------------------------------------------------------------

    def _sets(self) -> None:
        """Choose the numbers of the sets of constraints: those of the deck, or new ones."""
        for key, names in (("SPC", ("SPC", "SPC1")), ("MPC", ("MPC",))):
            cards = selected(self.deck, key, names, f"{key}ADD")
            numbers = [c.integer(0) for c in self.deck.of(*names, f"{key}ADD")]
            self.first[key] = cards[0].integer(0) if cards else 1 + max(numbers, default=0)

    def _is_selected(self, key: str) -> bool:
        names = ("SPC", "SPC1") if key == "SPC" else ("MPC",)
        return bool(selected(self.deck, key, names, f"{key}ADD"))

    # Replaced cards -----------------------------------------------------------------------------------------

    def _replace(self, old: Card, *by: str) -> None:
        ref = self.refs.get(old.place)
        if ref is None or ref[1] != old.name:
            self.out.notes.append(f"take out of the deck what these cards replace: {old} at {old.place}")
            self.out.lines += by
            return
        file, _, lines = ref
        self.out.replace(SourceCard(str(old), file, lines), by=by)

    def _removed(self, deck: ModelDeck) -> ModelDeck:
        """Name the cards of items that are removed, and give their numbers to new items of the same nodes."""
        c = self.changes
        kept: list[Any] = []
        numbers: dict[str, int] = {}
        names: set[str] = set()
        free = [x for key in ("bodies", "connections", "links") for x in getattr(c.deck, key)]
        for item in c.removed:
            if at := _NODE.match(item.name):
                self.skew.add(int(at[1]))
                continue
            cards = self._cards_of(item)
            if not cards:
                self.out.notes.append(f"take out of the deck what these cards replace: {item.name}")
            for one in cards:
                self._replace(one)
                names.add(str(one))
            new = next((x for x in free if type(x) is type(item) and nodes_of(x) == nodes_of(item)), None)
            if new is not None and len(cards) == 1 and cards[0].name != "MPC":
                free.remove(new)
                numbers.setdefault(new.name, cards[0].integer(0))
                self._own_table(cards[0], new.name, numbers)
        more: dict[str, tuple[Any, ...]] = {}
        for key in ("bodies", "connections", "links", "equations"):
            kept = [
                x
                for x in getattr(c.before, key)
                if x not in c.removed
                and not x.name.startswith("MPC")
                and names & {str(one) for one in self._cards_of(x)}
            ]
            more[key] = (*getattr(deck, key), *kept)
        return replace(deck, numbers=numbers, **more)

    def _own_table(self, element: Card, name: str, numbers: dict[str, int]) -> None:
        """Replace the PBUSH of a CBUSH that no other one has."""
        users = [c for c in self.deck.of("CBUSH") if c.integer(1, c.integer(0)) == element.integer(1, 0)]
        table = next((c for c in self.deck.of("PBUSH") if c.integer(0) == element.integer(1, 0)), None)
        if element.name == "CBUSH" and len(users) == 1 and table is not None:
            self._replace(table)
            numbers[f"{name}: property"] = table.integer(0)

    def _cards_of(self, item: Any) -> list[Card]:
        """Return the cards that an item's name names."""
        match = _ITEM.match(item.name)
        if match is None:
            return []
        name, n, k = match[1], int(match[2]), match[3]
        if name == "MPC" and k is not None:
            return selected(self.deck, "MPC", ("MPC",), "MPCADD")[int(k) - 1 : int(k)]
        return [c for c in self.deck.of(name) if c.text(0) == str(n)]

    # Supports -----------------------------------------------------------------------------------------------

    def _supports_of(self, node: int) -> Iterator[tuple[Card, str]]:
        """Yield the cards that fix a node, with the components."""
        for c in selected(self.deck, "SPC", ("SPC", "SPC1"), "SPCADD"):
            for nodes, components in _fixed_by(c):
                if node in nodes:
                    yield c, components

    def _freed(self) -> None:
        """Replace the cards that fix directions which are free now."""
        free: dict[int, set[str]] = {}
        for n, directions in self.changes.freed.items():
            row = self.deck.rows[n]
            along = directions_in(self.deck.axes(row), directions)
            free[n] = {str(k + 1) for k in along or range(6)}
        free |= {n: set("123456") for n in self.skew}
        cards: dict[str, Card] = {}
        for n in free:
            cards |= {c.place: c for c, components in self._supports_of(n) if free[n] & set(components)}
        for c in cards.values():
            left: dict[str, list[int]] = {}
            for nodes, components in _fixed_by(c):
                for n in nodes:
                    rest = "".join(x for x in components if x not in free.get(n, ()))
                    if rest and n in self.deck.rows:
                        left.setdefault(rest, []).append(n)
            by = [line for rest, nodes in left.items() for line in card("SPC1", c.integer(0), rest, *nodes)]
            self._replace(c, *by)
        for c in self.deck.of("GRID"):
            n = int(c.text(0)) if c.text(0).isdigit() else -1
            if n in free and free[n] & set(c.text(6)):
                fields = _padded(c, 8)
                fields[6] = "".join(x for x in c.text(6) if x not in free[n])
                self._replace(c, *card("GRID", *fields))

    # Materials and properties -------------------------------------------------------------------------------

    def _material_in_place(self, name: str, new: Material) -> None:
        old = self.material_cards[name]
        self._replace(old, *self._material_card(old, old.integer(0), new, self.changes.material(name)))
        self.made.append((name, new, old.integer(0)))

    def _material_card(self, old: Card, n: int, new: Material, was: Material) -> list[str]:
        """Return a material with the values of another one in proportion."""
        fields = _padded(old, 8)
        fields[0] = str(n)
        stiffer, heavier = new.E / was.E, new.rho / was.rho
        shear = stiffer * (1 + was.nu) / (1 + new.nu)
        for k, factor in ((1, stiffer), (2, shear)):
            if fields[k]:
                fields[k] = number(old.real(k) * factor)
        if new.nu != was.nu and abs(new.nu - was.nu) > 1e-9:
            fields[3] = number(new.nu)
        # without a density the reader takes a negligible one
        if fields[4] and old.real(4):
            fields[4] = number(old.real(4) * heavier)
        elif abs(heavier - 1) > 1e-9:
            fields[4] = number(new.rho / self.u.density / self.deck.mass_factor)
        if abs(new.loss_factor - was.loss_factor) > 1e-12:
            fields[7] = number(float(new.loss_factor))
        return card("MAT1", *fields)

    def _material(self, source: int, new: Material) -> int:
        """Return the number of a material: that of the deck, or of a new card."""
        known = {p.material.name: p.material for p in self.changes.source.properties}
        name = self.changes.source.properties[source].material.name if source >= 0 else new.name
        for of, m, n in self.made:
            if of == name and same_material(m, new):
                return n
        if name in known and same_material(known[name], new):
            return self.material_cards[name].integer(0)
        n = next(self.free_material)
        self.made.append((name, new, n))
        if name in known:
            old = self.material_cards[name]
            self.out.lines += [*wrapped("$", new.name), *self._material_card(old, n, new, known[name])]
        else:
            u, rho = self.u, new.rho / self.deck.mass_factor
            values = [n, float(new.E / u.stress), None, float(new.nu), float(rho / u.density)]
            self.out.lines += [
                *wrapped("$", new.name),
                *card("MAT1", *values, None, None, float(new.loss_factor) or None),
            ]
        return n

    def _property_card_of(self, source: int) -> Card | None:
        """Return the card of one of the source's properties; None of rods with their own."""
        if source not in self.property_cards:
            self.property_cards[source] = self._found_property_card(source)
        return self.property_cards[source]

    def _material_card_of(self, source: int) -> Card:
        """Return the MAT1 of one of the source's properties, to which its card refers."""
        card = self._property_card_of(source)
        number = self._element_of(source).integer(3) if card is None else card.integer(1)
        return self.materials[number]

    def _element_of(self, source: int) -> Card:
        """Return the first element of one of the source's properties."""
        bars = self.changes.source.bars
        return self.elements[int(bars.numbers[np.flatnonzero(bars.properties == source)[0]])]

    def _found_property_card(self, source: int) -> Card | None:
        element = self._element_of(source)
        if element.name == "CONROD":
            return None
        found = self.deck.by_number(*OF_ELEMENT[element.name])
        default = DEFAULTS.get(element.name, "")
        text = element.text(1) or next((c.text(1) for c in self.deck.of(default)), "") or element.text(0)
        return found[int(text)]

    def _properties_in_place(self) -> None:
        """Replace cards of which all bars have changed alike.

        Bars of one card are of several properties of the source where comments name them.
        """
        c = self.changes
        complete = {v.source: v for v in c.variants if v.complete}
        of_card: dict[str, tuple[Card, list[int]]] = {}
        for source in np.unique(c.source.bars.properties).tolist():
            if (old := self._property_card_of(source)) is not None:
                of_card.setdefault(old.place, (old, []))[1].append(source)
        for old, sources in of_card.values():
            alike = [complete[s] for s in sources if s in complete]
            if len(alike) < len(sources) or any(not same_property(v.new, alike[0].new) for v in alike):
                continue
            if alike[0].section and c.shifted.intersection(sources):
                continue
            material = self._material(sources[0], alike[0].new.material)
            if not alike[0].section and material == old.integer(1):
                continue
            self._replace(old, *self._property_lines(alike[0], old, old.integer(0), material))
            self.in_place |= {self._key(v) for v in alike}

    def _key(self, v: Variant) -> str:
        return f"{v.source} {self.changes.variants.index(v)}"

    def _property_lines(self, v: Variant, old: Card, n: int, material: int) -> list[str]:
        if not v.section:
            fields = _padded(old, 8)
            fields[:2] = [str(n), str(material)]
            return card(old.name, *fields)
        p = self._as_written(v.new, v.source)
        if old.name in ("PBAR", "PBARL"):
            s, u = p.section, self.u
            I = [float(x / u.second_moment) for x in (s.Iy, s.Iz, s.J)]
            line = float(p.mass_per_length / u.mass_per_length / self.deck.mass_factor)
            k = [float(s.kz), float(s.ky)] if p.theory == "timoshenko" else []
            return card("PBAR", n, material, float(s.A / u.area), *I, line, None, *[None] * 8, *k)
        p = replace(p, mass_per_length=p.mass_per_length / self.deck.mass_factor)
        return list(property_card(p, n, material, self.u))

    def _as_written(self, p: BarProperty, source: int) -> BarProperty:
        """Return a property without the factor that a G of its own in MAT1 makes of J and the shear areas."""
        if source < 0:
            return p
        old = self.material_cards[self.changes.source.properties[source].material.name]
        E, G, nu = elastic(old)
        factor = material_of("", E * self.u.stress, G * self.u.stress, nu, 1.0, 0.0)[1]
        sections = [
            None if s is None else replace(s, J=s.J / factor, ky=s.ky / factor, kz=s.kz / factor)
            for s in (p.section, p.section2)
        ]
        assert sections[0] is not None
        return replace(p, section=sections[0], section2=sections[1])

    def _new_property(self, v: Variant, of: str) -> int:
        """Return the number of a new property for some elements."""
        key = (self.changes.variants.index(v), of)
        if key not in self.new_properties:
            n = self.new_properties[key] = next(self.free_property)
            material = self._material(v.source, v.new.material)
            old = self._property_card_of(v.source) if v.source >= 0 else None
            lines = wrapped("$", v.new.name)
            if of == "own" or old is None:
                p = self._as_written(v.new, v.source)
                p = replace(p, mass_per_length=p.mass_per_length / self.deck.mass_factor)
                lines += property_card(p, n, material, self.u)
            else:
                lines += self._property_lines(v, old, n, material)
            self.out.lines += lines
        return self.new_properties[key]

    # Elements -----------------------------------------------------------------------------------------------

    def _bar(self, deck: ModelDeck, k: int, piece: Piece, free: Iterator[int]) -> None:
        c = self.changes
        v = c.variants[piece.variant] if piece.variant >= 0 else None
        settled = v is None or self._key(v) in self.in_place or (not v.section and self._is_in_place(v))
        if settled and not piece.joined:
            return
        if piece.source < 0:
            assert v is not None
            self.out.lines += self._element(
                deck, k, next(free), self._new_property(v, "own"), bar_card(v.new)
            )
            return
        old = self.elements[int(c.source.bars.numbers[piece.source])]
        n = old.integer(0) if piece.first else next(free)
        kind = int(c.source.bars.properties[piece.source])
        shifted = kind in c.shifted
        if old.name == "CONROD" or (shifted and (piece.joined or (v is not None and v.section))):
            p = v or Variant(
                kind, c.before.properties[c.before.bars.properties[piece.source]], False, True, False
            )
            own = self._own(p)
            lines = self._element(deck, k, n, own, "CROD" if p.new.theory == "bar" else bar_card(p.new))
        else:
            given = self._property_card_of(kind)
            assert given is not None
            number_of = given.integer(0) if settled or v is None else self._new_property(v, "copy")
            lines = self._copied(deck, k, old, n, number_of, piece)
        if piece.first:
            self._replace(old, *lines)
        else:
            self.out.lines += lines

    def _is_in_place(self, v: Variant) -> bool:
        """Whether a variant is that of a material which is replaced."""
        name = self.changes.source.properties[v.source].material.name
        return name in self.changes.materials and same_material(self.changes.materials[name], v.new.material)

    def _own(self, p: Variant) -> int:
        found = next((i for i, v in enumerate(self.changes.variants) if v is p), None)
        if found is not None:
            return self._new_property(p, "own")
        self.changes = replace(self.changes, variants=(*self.changes.variants, p))
        return self._new_property(p, "own")

    def _copied(self, deck: ModelDeck, k: int, old: Card, n: int, prop: int, piece: Piece) -> list[str]:
        """Return an element's card with another property, and other nodes and pins where these differ."""
        fields = _padded(old, 16 if old.name in ("CBAR", "CBEAM") else 8)
        fields[:2] = [str(n), str(prop)]
        if not piece.joined:
            return card(old.name, *fields)
        ends = deck.bars.ends[k]
        if old.name not in ("CBAR", "CBEAM"):
            fields[2:4] = [str(x) for x in deck.nodes[ends]]
            return card(old.name, *fields)
        if ends[0] in deck.axes or int(self.changes.source.bars.ends[piece.source, 0]) in deck.axes:
            return self._element(deck, k, n, prop, old.name)
        fields[2:4] = [str(x) for x in deck.nodes[ends]]
        fields[8:10] = [_pins(row) for row in deck.bars.stiffness[k]]
        return card(old.name, *fields)

    def _element(self, deck: ModelDeck, k: int, n: int, prop: int, name: str) -> list[str]:
        """Return an element's card that is written whole."""
        b, u = deck.bars, self.u
        ends = b.ends[k]
        head = [n, prop, *deck.nodes[ends]]
        if name in ("CROD", "CTUBE"):
            return card(name, *head)
        axes = [deck.axes.get(int(e), np.eye(3)) for e in ends]
        arms: list[float | None] = [None] * 6
        if b.offsets[k].any():
            arms = [float(x) / u.length for R, arm in zip(axes, b.offsets[k], strict=True) for x in R @ arm]
        height = [float(x) for x in axes[0] @ bar_axes(deck)[k, 2]]
        return card(name, *head, *height, "GGG", *(_pins(row) for row in b.stiffness[k]), *arms)


def _pins(stiffness: Floats) -> str:
    return "".join(sorted(PIN[d] for d, value in zip(DIRECTIONS, stiffness, strict=True) if value == 0))


def _padded(c: Card, least: int) -> list[str]:
    fields = [_short(c.fields[k].strip()) for k in range(len(c.fields))]
    return fields + [""] * (least - len(fields))


def _short(text: str) -> str:
    """Return a field in at most 16 columns."""
    return text if len(text) <= 16 else number(float(text.upper().replace("D", "E")))


def _fixed_by(c: Card) -> Iterator[tuple[list[int], str]]:
    """Yield the nodes that a card fixes, and their components."""
    if c.name == "SPC":
        for k in (1, 4):
            if c.text(k):
                yield [c.integer(k)], c.text(k + 1)
        return
    nodes: list[int] = []
    k = 2
    while k < len(c.fields):
        if c.text(k + 1) == "THRU":
            nodes += range(c.integer(k), c.integer(k + 2) + 1)
            k += 3
            continue
        nodes += [c.integer(k)] if c.text(k) else []
        k += 1
    yield nodes, c.text(1)


def _scaled(deck: ModelDeck, factor: float) -> ModelDeck:
    """Return a deck whose masses the deck's PARAM WTMASS multiplies."""
    if factor == 1:
        return deck
    return replace(
        deck,
        bodies=tuple(replace(b, mass=b.mass * factor, inertia=b.inertia * factor) for b in deck.bodies),
        matrices=tuple(replace(m, M=m.M * factor) for m in deck.matrices),
    )


def _references(bulk: BulkData) -> dict[str, tuple[str, str, tuple[int, ...]]]:
    """Return file, name and lines of each card, by its place."""
    out = {}
    for run in runs_of(bulk):
        for first in range(run.first, run.first + run.count * run.length, run.length):
            places = [bulk.place(first + k).rsplit(": line ", 1) for k in range(run.length)]
            out[bulk.place(first)] = (places[0][0], run.name, tuple(int(line) for _, line in places))
    return out
