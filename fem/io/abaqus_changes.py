"""Keywords of Abaqus and CalculiX that change a deck: they keep its names and numbers."""

import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from fem.io.abaqus_content import Content, lines_of, read_content
from fem.io.abaqus_deck import AbaqusBlock, Deck, cells_of, name_of
from fem.io.abaqus_frame import read_abaqus_frame
from fem.io.abaqus_supports import dofs_of_row
from fem.io.abaqus_systems import AbaqusSystems
from fem.io.abaqus_write import keywords, row, section_keywords, with_ends
from fem.io.deck import real, words
from fem.io.deck_nodes import bar_axes, directions_in, wrapped
from fem.io.deck_units import DeckUnits
from fem.io.frame_deck import Body, Connection
from fem.io.frame_of_model import ModelDeck
from fem.io.source_changes import (
    DeckEdit,
    SourceCard,
    SourceChanges,
    SourceError,
    Variant,
    nodes_of,
    same_material,
    source_changes,
    taken,
    with_bars,
    without_items,
)
from fem.materials import Material

SECTIONS = ("BEAMSECTION", "BEAMGENERALSECTION", "SOLIDSECTION")
OF_SECTION = ("TRANSVERSESHEARSTIFFNESS", "CENTROID", "SHEARCENTER", "BEAMSECTIONOFFSET")
OF_MATERIAL = words(
    """ELASTIC DENSITY DAMPING PLASTIC EXPANSION CONDUCTIVITY SPECIFICHEAT CREEP VISCOELASTIC HYPERELASTIC
    DEPVAR USERMATERIAL LATENTHEAT RATEDEPENDENT CYCLICHARDENING NOCOMPRESSION FAILSTRESS FAILSTRAIN"""
)
"""Keywords that belong to the *MATERIAL before them."""
_ITEM = re.compile(r"(MASS|ROTARYI|SPRING[12A]|DASHPOT[12A]) (\d+)")
_NODE = re.compile(r"(?:node|BOUNDARY at node) (\d+)")
OWN = -2
"""Instead of a variant: elements that are written with a section of their own."""


def abaqus_changes(model_deck: ModelDeck, path: Path, units: DeckUnits) -> DeckEdit:
    """Return the keywords that make a deck of Abaqus or CalculiX that of a model.

    Arguments are those of :func:`fem.io.nastran_changes.nastran_changes`.

    Raises
    ------
    SourceError
        If the deck has parts, whose elements have numbers of their own.
    """
    blocks = list(Deck(path).blocks())
    part = next((b for b in blocks if b.keyword in ("PART", "INSTANCE", "ASSEMBLY")), None)
    if part is not None:
        msg = f"{part.place}: the deck has parts and instances, whose numbers repeat"
        raise SourceError(msg)
    content = read_content(path, units)
    names = (b.options.get(key, "") for b in blocks for key in ("NAME", "ELSET", "NSET"))
    ends = [found[0] for name in names if (found := re.search(r"\d{1,8}$", name))]
    first = {
        "node": 1 + int(np.max(np.asarray(content.mesh.point_numbers), initial=0)),
        "element": 1 + int(np.max(np.asarray(content.mesh.line_numbers), initial=0)),
        "name": 1 + max(map(int, ends), default=0),
    }
    changes = source_changes(model_deck, read_abaqus_frame(path, units), first)
    return _AbaqusWriter(blocks, content, changes).edit()


class _AbaqusWriter:
    """The keywords of changes."""

    def __init__(self, blocks: list[AbaqusBlock], content: Content, changes: SourceChanges) -> None:
        self.blocks, self.content, self.changes, self.u = blocks, content, changes, content.units
        self.out = DeckEdit("**")
        self.texts: dict[str, list[str]] = {b.file: b.source.text.split("\n") for b in blocks}
        self.names = count(changes.deck.first["name"])
        self.made: list[tuple[str, Material, str]] = []
        self.row_of = {content.number(k): k for k in range(len(content.kinds))}
        self.sets: dict[tuple[int, int], str] = {}
        """Element set of a section and a variant."""

    def edit(self) -> DeckEdit:
        """Return the keywords."""
        c = self.changes
        systems = AbaqusSystems(self.content)
        deck = self._removed(replace(c.deck, axes=dict(systems.nodal)))
        for name, material in c.materials.items():
            self._material_in_place(name, material)
        sections = {id(p.block): p.block for p, _ in self.content.model_data(*SECTIONS)}
        section_of: dict[int, int] = {}
        for placed, instance in self.content.model_data(*SECTIONS):
            for k in self.content.elements(placed, instance.name):
                section_of[self.content.number(k)] = id(placed.block)
        kind_of = self._kinds({n: sections[k] for n, k in section_of.items()})
        members: dict[int, dict[int, list[int]]] = defaultdict(lambda: defaultdict(list))
        for number, section in section_of.items():
            members[section][kind_of.get(number, -1)].append(number)
        for section, groups in members.items():
            self._section(section, sections[section], groups)
        self._elements(deck, kind_of, {n: sections[k] for n, k in section_of.items()})
        self._freed()
        return self.out

    # Lines --------------------------------------------------------------------------------------------------

    def _lines(self, block: AbaqusBlock) -> tuple[int, ...]:
        """Return the lines of a block in its file, comments within it too."""
        data = [int(p.rsplit(" ", 1)[-1]) for p, _ in block.rows() if p.startswith(f"{block.file}: ")]
        last = block.line
        text = self.texts[block.file]
        while (
            text[last - 1].rstrip().endswith(",")
            and last < len(text)
            and last + 1 < (data[0] if data else last)
        ):
            last += 1
        return tuple(range(block.line, max([last, *data]) + 1))

    def _text(self, block: AbaqusBlock, **options: str) -> list[str]:
        """Return the lines of a block, with other values of some of its parameters."""
        head = ", ".join(
            [f"*{block.name}", *(f"{k}={v}" if v else k for k, v in ({**block.options, **options}).items())]
        )
        return [head, *(", ".join(cells) for _, cells in block.rows())]

    def _replace(self, block: AbaqusBlock, *by: str) -> None:
        label = next((f", {k}={block.options[k]}" for k in ("NAME", "ELSET") if k in block.options), "")
        self.out.replace(SourceCard(f"*{block.name}{label}", block.file, self._lines(block)), by=by)

    def _after(self, block: AbaqusBlock, kinds: Collection[str]) -> list[AbaqusBlock]:
        """Return the blocks that follow one and belong to it."""
        at = next(k for k, b in enumerate(self.blocks) if b.line == block.line and b.file == block.file)
        out = []
        for b in self.blocks[at + 1 :]:
            if b.keyword not in kinds:
                break
            out.append(b)
        return out

    # Materials ----------------------------------------------------------------------------------------------

    def _material_block(self, name: str) -> AbaqusBlock | None:
        return next(
            (
                b
                for b in self.blocks
                if b.keyword == "MATERIAL" and name_of(b.options.get("NAME", "")) == name
            ),
            None,
        )

    def _material_lines(self, name: str, new: Material, called: str) -> list[str]:
        """Return a material with the values of another one in proportion."""
        block = self._material_block(name)
        assert block is not None
        was = self.changes.material(name)
        lines = self._text(block, NAME=called)
        for b in self._after(block, OF_MATERIAL):
            text = self._text(b)
            factor = {"ELASTIC": new.E / was.E, "DENSITY": new.rho / was.rho}.get(b.keyword, 1.0)
            if factor != 1 or (b.keyword == "ELASTIC" and new.nu != was.nu):
                for k, (_, cells) in enumerate(b.rows(), 1):
                    values = [repr(real(cells[0]) * factor), *cells[1:]]
                    if b.keyword == "ELASTIC" and abs(new.nu - was.nu) > 1e-9:
                        values[1:2] = [repr(float(new.nu))]
                    text[k] = ", ".join(values)
            if b.keyword == "DAMPING" and new.loss_factor != was.loss_factor:
                text[0] = ", ".join(["*DAMPING", f"STRUCTURAL={new.loss_factor!r}"])
            lines += text
        return lines

    def _material_in_place(self, name: str, new: Material) -> None:
        block = self._material_block(name)
        if block is None:  # E and G of the section
            return
        for b in (block, *self._after(block, OF_MATERIAL)):
            self._replace(b)
        self.out.lines += self._material_lines(name, new, name)
        self.made.append((name, new, name))

    def _material(self, name: str, new: Material) -> str:
        """Return the name of a material: that of the deck, or of a new one."""
        for of, m, called in self.made:
            if of == name and same_material(m, new):
                return called
        if same_material(self.changes.material(name), new):
            return name
        called = f"{name}-{next(self.names)}"
        self.made.append((name, new, called))
        self.out.lines += self._material_lines(name, new, called)
        return called

    # Sections -----------------------------------------------------------------------------------------------

    def _kinds(self, section_of: dict[int, AbaqusBlock]) -> dict[int, int]:
        """Return the variant of each changed element, -1 where its section stays, or OWN."""
        c, out = self.changes, {}
        rows = defaultdict(list)
        for k, n in enumerate(c.source.bars.numbers.tolist()):
            rows[n].append(k)
        for piece in c.pieces:
            if piece.source < 0:
                continue
            n = int(c.source.bars.numbers[piece.source])
            v = c.variants[piece.variant] if piece.variant >= 0 else None
            shifted = (
                c.before.bars.offsets[rows[n]].any()
                or c.source.properties[c.source.bars.properties[piece.source]].section.angle
            )
            found = -1 if v is None or self._is_settled(v, section_of[n]) else piece.variant
            if len(rows[n]) > 1 and (piece.joined or found >= 0):
                found = OWN  # an element of three nodes becomes two of two
            if shifted and (piece.joined or (v is not None and v.section)):
                found = OWN
            if out.get(n, found) != found:
                found = OWN
            out[n] = found
        return out

    def _is_settled(self, v: Variant, section: AbaqusBlock) -> bool:
        """Whether a changed property is that of a material which is replaced.

        Shear stiffnesses and constants of a section do not follow its material.
        """
        name = self.changes.source.properties[v.source].material.name
        given = not section.options.get("MATERIAL") or OF_SECTION[0] in [
            b.keyword for b in self._after(section, OF_SECTION)
        ]
        return not (v.section or given) and any(
            of == name == called and same_material(m, v.new.material) for of, m, called in self.made
        )

    def _section(self, section: int, block: AbaqusBlock, groups: dict[int, list[int]]) -> None:
        """Replace a section by those of the groups of its elements."""
        if not set(groups) - {-1}:
            return
        more = self._after(block, OF_SECTION)
        for b in (block, *more):
            self._replace(b)
        for kind, numbers in groups.items():
            if kind == OWN:
                continue
            name = block.options["ELSET"]
            if len(groups) > 1:
                name = f"{name}-{next(self.names)}"
                self.out.lines += [f"*ELSET, ELSET={name}", *_listed(numbers)]
            self.sets[section, kind] = name
            if kind < 0:
                self.out.lines += [*self._text(block, ELSET=name), *(x for b in more for x in self._text(b))]
            else:
                self.out.lines += self._changed_section(
                    block, more, self.changes.variants[kind], name, numbers
                )

    def _changed_section(
        self, block: AbaqusBlock, more: list[AbaqusBlock], v: Variant, name: str, numbers: list[int]
    ) -> Iterator[str]:
        old = self.changes.source.properties[v.source]
        yield from wrapped("**", v.new.name)
        if not v.section and block.options.get("MATERIAL"):
            called = self._material(old.material.name, v.new.material)
            yield from self._text(block, ELSET=name, MATERIAL=called)
            for b in more:
                factor = v.new.material.G / old.material.G if b.keyword == OF_SECTION[0] else 1.0
                head, *rows = self._text(b)
                yield head
                yield from (", ".join(repr(real(x) * factor) for x in cells_of(text)) for text in rows)
            return
        added = v.new.mass_per_length - old.mass_per_length
        if added < 0:
            self.out.notes.append(f"{name}: lower its *NONSTRUCTURAL MASS by {-added:.6g} kg/m")
        p = replace(v.new, mass_per_length=max(added, 0.0))
        if p.theory == "bar":
            called = self._material(old.material.name, v.new.material)
            yield from self._text(block, ELSET=name, MATERIAL=called)[:1]
            yield row(float(p.section.A / self.u.area))
            return
        c = self.changes
        axes = bar_axes(c.before)
        bars = [k for k, n in enumerate(c.source.bars.numbers.tolist()) if n in set(numbers)]
        by_axis: dict[tuple[float, ...], list[int]] = defaultdict(list)
        for k in bars:
            by_axis[tuple(np.round(axes[k, 1], 7) + 0.0)].append(int(c.source.bars.numbers[k]))
        for y, some in by_axis.items():
            called = name
            if len(by_axis) > 1:
                called = f"{name}-{next(self.names)}"
                yield from (f"*ELSET, ELSET={called}", *_listed(some))
            yield from section_keywords(p, called, np.array(y), 0, self.u)

    # Elements -----------------------------------------------------------------------------------------------

    def _elements(self, deck: ModelDeck, kind_of: dict[int, int], section_of: dict[int, AbaqusBlock]) -> None:
        """Write elements with other nodes, and those with sections of their own, with all that is new."""
        c = self.changes
        own = [
            k
            for k, p in enumerate(c.pieces)
            if p.source < 0 or p.joined or kind_of.get(int(c.source.bars.numbers[p.source])) == OWN
        ]
        free = count(deck.first["element"])
        numbers = deck.bars.numbers.copy()
        given: set[int] = set()
        for k in own:
            if c.pieces[k].source < 0 or int(numbers[k]) in given:
                numbers[k] = next(free)
            given.add(int(numbers[k]))
        first = {**deck.first, "element": next(free), "name": next(self.names)}
        deck = replace(deck, bars=replace(deck.bars, numbers=numbers), first=first)
        deck = with_ends(with_bars(deck, own))
        for n in {int(c.source.bars.numbers[c.pieces[k].source]) for k in own if c.pieces[k].source >= 0}:
            self._take_out(n)
        for s in c.lost:
            self._take_out(int(c.source.bars.numbers[s]))
        kept: list[int] = []
        lines: list[str] = []
        for j, k in enumerate(own):
            p = c.pieces[k]
            n = int(c.source.bars.numbers[p.source]) if p.source >= 0 else 0
            if p.source < 0 or kind_of.get(n) == OWN:
                kept.append(j)
                continue
            kind = self.content.kinds[self.row_of[n]]
            name = self.sets.get((id(section_of[n]), kind_of.get(n, -1)), section_of[n].options["ELSET"])
            ends = [*deck.nodes[deck.bars.ends[j]], *([kind.extra] if kind.extra else [])]
            lines += [
                f"*ELEMENT, TYPE={kind.name}, ELSET={name}",
                row(int(deck.bars.numbers[j]), *map(int, ends)),
            ]
        new = sum(k not in deck.known for k in range(len(deck.nodes)))
        written, n = (
            keywords(replace(deck, bars=taken(deck.bars, [(j, False) for j in kept])), self.u),
            new + bool(new),
        )
        self.out.lines += [*written[:n], *lines, *written[n:]]

    def _take_out(self, number: int) -> None:
        """Replace the line of an element, and what releases its ends."""
        kind = self.content.kinds[self.row_of[number]]
        file, _, line = kind.place.rpartition(": line ")
        block = next(
            (b for b in self.blocks if b.keyword == "ELEMENT" and kind.place in [p for p, _ in b.rows()]),
            None,
        )
        if block is None:
            self.out.notes.append(f"take the element {number} out of the deck ({kind.place})")
            return
        if sum(1 for _ in block.rows()) == 1:
            self._replace(block)
        else:
            self.out.replace(SourceCard(f"element {number}", file, (int(line),)))
        for b in self.blocks:
            for place, cells in lines_of(b) if b.keyword == "RELEASE" else ():
                if cells[0] == str(number):
                    self.out.replace(
                        SourceCard(f"*RELEASE of {number}", b.file, (int(place.rsplit(" ", 1)[-1]),))
                    )

    # Items --------------------------------------------------------------------------------------------------

    def _removed(self, deck: ModelDeck) -> ModelDeck:
        """Take removed items out, or give their keywords the values of new ones."""
        gone: list[Any] = []
        for item in self.changes.removed:
            match = _ITEM.match(item.name)
            if _NODE.match(item.name):
                continue
            block = None if match is None else self._user(match[1], int(match[2]))
            if match is None or block is None:
                self.out.notes.append(f"take out of the deck what these keywords replace: {item.name}")
                continue
            number = int(match[2])
            every = (*deck.bodies, *deck.connections)
            found = ((x, self._value(item, x, match[1])) for x in every if x not in gone)
            new = next(((x, value) for x, value in found if value is not None), None)
            if new is not None and self._is_alone(block, number):
                gone.append(new[0])
                text = self._text(block)
                text[-1] = row(new[1])
                if match[1].endswith(("1", "2")):  # the empty line of the third field
                    text = [text[0], *(", ".join(x) for _, x in lines_of(block)[:1]), row(new[1])]
                self._replace(block, *wrapped("**", new[0].name), *text)
                continue
            if self._is_alone(block, number):
                self._replace(block)
            self._take_out(number)
        return without_items(deck, gone)

    def _user(self, kind: str, number: int) -> AbaqusBlock | None:
        """Return the block that gives an element of one or two nodes its value."""
        word = {"MASS": "MASS", "ROTARYI": "ROTARYINERTIA"}.get(kind, kind[:-1])
        for placed, instance in self.content.model_data(word):
            if self.row_of.get(number) in self.content.elements(placed, instance.name):
                return placed.block
        return None

    def _is_alone(self, block: AbaqusBlock, number: int) -> bool:
        for placed, instance in self.content.model_data(block.keyword):
            if placed.block is block:
                return self.content.elements(placed, instance.name) == [self.row_of[number]]
        return False

    def _value(self, old: Any, new: Any, kind: str) -> float | None:
        """Return the one value with which the keyword of an item is that of a new one, if there is one."""
        if type(new) is not type(old) or nodes_of(new) != nodes_of(old) or new.name != old.name:
            return None
        if isinstance(new, Body):
            plain = kind == "MASS" and not new.inertia.any() and not new.arm.any()
            return float(new.mass / self.u.mass) if plain else None
        assert isinstance(new, Connection)
        key, scale = ("K", self.u.stiffness) if kind.startswith("SPRING") else ("C", self.u.damping)
        k = int(np.argmax(np.abs(np.diag(getattr(old, key)))))
        rest = {x: getattr(new, x).copy() for x in "KCD"}
        value = float(rest[key][k, k] / scale[k])
        rest[key][k, k] = 0.0
        if any(X.any() for X in rest.values()) or new.rigid or not np.allclose(new.axes, old.axes):
            return None
        return value

    # Supports -----------------------------------------------------------------------------------------------

    def _freed(self) -> None:
        """Replace the lines of *BOUNDARY that fix directions which are free now."""
        numbers = np.asarray(self.content.mesh.point_numbers)
        rows = {int(n): k for k, n in enumerate(numbers)}
        axes = AbaqusSystems(self.content).nodal
        free: dict[int, set[int]] = {}
        for n, directions in self.changes.freed.items():
            along = directions_in(axes.get(rows[n], np.eye(3)), directions)
            free[rows[n]] = set(along or range(6))
        free |= {rows[int(m[1])]: set(range(6)) for x in self.changes.removed if (m := _NODE.match(x.name))}
        for placed in self.content.placed:
            block = placed.block
            for place, cells in lines_of(block) if placed.keyword == "BOUNDARY" else ():
                label, *rest = cells
                at = self.content.rows("NSET", name_of(label), "", place)
                dofs = dofs_of_row(self.content, block, place, rest)
                if not any(free.get(k, set()) & set(dofs) for k in at):
                    continue
                by = [
                    row(int(numbers[k]), d + 1, d + 1) for k in at for d in dofs if d not in free.get(k, ())
                ]
                lines = (int(place.rsplit(" ", 1)[-1]),)
                card = SourceCard(f"*BOUNDARY of {label}", block.file, lines)
                if len(lines_of(block)) == 1:
                    card = SourceCard("*BOUNDARY", block.file, self._lines(block))
                self.out.replace(card, by=["*BOUNDARY", *by] if by else [])


def _listed(numbers: Sequence[int]) -> Iterator[str]:
    for k in range(0, len(numbers), 12):
        yield ", ".join(map(str, numbers[k : k + 12])) + ","
