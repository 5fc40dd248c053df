"""Commands of ANSYS that change an archive: they keep its numbers and redefine what is there.

A second definition takes the place of the first in ANSYS, so that nothing has to be deleted by hand.
"""

import re
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from fem.io.ansys_content import AnsysDeck, AnsysElement
from fem.io.ansys_deck import read_deck
from fem.io.ansys_frame import BY_SECTION, read_ansys_frame
from fem.io.ansys_systems import rotation
from fem.io.ansys_write import LABEL, Attributes, command, commands, section_commands
from fem.io.deck_nodes import directions_in, wrapped
from fem.io.deck_units import DeckUnits
from fem.io.frame_deck import Body, Connection
from fem.io.frame_of_model import ModelDeck
from fem.io.source_changes import (
    DeckEdit,
    Piece,
    SourceChanges,
    Variant,
    nodes_of,
    same_material,
    source_changes,
    with_bars,
    without_items,
)
from fem.materials import Material
from fem.model import DIRECTIONS

_ITEM = re.compile(r"(MASS21|COMBIN14|CE) (\d+)")


def ansys_changes(model_deck: ModelDeck, path: Path, units: DeckUnits) -> DeckEdit:
    """Return the commands that make an archive of ANSYS that of a model.

    Arguments are those of :func:`fem.io.nastran_changes.nastran_changes`.
    """
    archive = read_deck(path)
    changes = source_changes(model_deck, read_ansys_frame(path, units), _free_numbers(archive))
    return _AnsysWriter(archive, changes, units).edit()


def _free_numbers(archive: AnsysDeck) -> dict[str, int]:
    """Return the numbers above those of an archive; types, materials, sections and reals share one."""
    tables = (archive.types, archive.reals, archive.materials, archive.sections)
    return {
        "node": 1 + max(archive.nodes, default=0),
        "element": 1 + max(archive.elements, default=0),
        "table": 1 + max((n for table in tables for n in table), default=0),
        "equation": 1 + max(archive.equations, default=0),
    }


class _AnsysWriter:
    """The commands of changes."""

    def __init__(self, archive: AnsysDeck, changes: SourceChanges, u: DeckUnits) -> None:
        self.archive, self.changes, self.u = archive, changes, u
        self.out = DeckEdit("!")
        self.elements = archive.elements
        self.first = dict(changes.deck.first)
        self.tables = count(self.first["table"])
        self.made: list[tuple[int, Material, int]] = []
        self.sections: dict[tuple[int, int], int] = {}
        bars = changes.source.bars
        self.element_of = {
            int(k): self.elements[int(bars.numbers[row])]
            for k, row in zip(*np.unique(bars.properties, return_index=True), strict=True)
        }

    def edit(self) -> DeckEdit:
        """Return the commands."""
        c = self.changes
        rows = {int(n): k for k, n in enumerate(c.source.nodes)}
        axes = {
            rows[n]: rotation(*values[3:])
            for n, values in self.archive.nodes.items()
            if n in rows and any(values[3:])
        }
        deck = replace(c.deck, axes=axes)
        deck = self._removed(deck)
        for name, material in c.materials.items():
            n = int(name.split()[-1])
            self._redefine(f"material {n}", *self._material_lines(n, n, material))
            self.made.append((n, material, n))
        for i, v in enumerate(c.variants):
            self._section_in_place(i, v)
        own: dict[int, Attributes | None] = {}
        for k, piece in enumerate(c.pieces):
            self._bar(k, piece, own)
        for s in c.lost:
            self._delete(int(c.source.bars.numbers[s]))
        for node, directions in c.freed.items():
            along = directions_in(axes.get(rows[node], np.eye(3)), directions) or range(6)
            self.out.lines += [command("DDELE", node, LABEL[DIRECTIONS[k]]) for k in along]
        numbers = deck.bars.numbers.copy()
        free = count(self.first["element"])
        for k in own:
            if not c.pieces[k].first or c.pieces[k].source < 0:
                numbers[k] = next(free)
            elif c.pieces[k].source >= 0:
                self._redefine(f"element {numbers[k]}")
        deck = with_bars(replace(deck, bars=replace(deck.bars, numbers=numbers)), [*own])
        deck = replace(deck, first={**self.first, "element": next(free), "table": next(self.tables)})
        attributes = {row: given for row, given in enumerate(own.values()) if given is not None}
        more = commands(deck, self.u, attributes=attributes)
        if self.out.lines or len(more) > 1:
            self.out.lines = [*more[:1], *self.out.lines, *more[1:]]
        return self.out

    def _redefine(self, what: str, *lines: str) -> None:
        self.out.redefined.append(f"{what} of {self.archive.file}")
        self.out.lines += [f"! redefines {what} of {self.archive.file}", *lines]

    def _delete(self, element: int) -> None:
        self.out.lines.append(command("EDELE", element))

    # Items --------------------------------------------------------------------------------------------------

    def _removed(self, deck: ModelDeck) -> ModelDeck:
        """Delete removed items, or give their elements the real constants of new ones."""
        gone: list[Any] = []
        for item in self.changes.removed:
            match = _ITEM.match(item.name)
            if match is None:
                self.out.notes.append(f"take out of the archive what these commands replace: {item.name}")
                continue
            n = int(match[2])
            if match[1] == "CE":
                self.out.lines.append(command("CEDELE", n))
                continue
            every = (*deck.bodies, *deck.connections)
            new = next((x for x in every if x not in gone and self._constants(item, x, n)), None)
            if new is None:
                self._delete(n)
                continue
            gone.append(new)
            real = self.elements[n].real
            self._redefine(
                f"real constants {real}",
                *wrapped("!", new.name),
                command("R", real, *self._constants(item, new, n)),
            )
        return without_items(deck, gone)

    def _constants(self, old: Any, new: Any, number: int) -> list[float]:
        """Return the real constants of an element that make it a new item; empty where none do."""
        e = self.elements[number]
        if type(new) is not type(old) or nodes_of(new) != nodes_of(old):
            return []
        if sum(other.real == e.real for other in self.archive.elements.values()) > 1 or new.name != old.name:
            return []
        if isinstance(new, Body):
            skew = (new.inertia - np.diag(np.diag(new.inertia))).any()
            if skew or new.arm.any() or self.archive.keyopt(e.type, 3) or self.archive.keyopt(e.type, 2):
                return []
            return [
                *[float(new.mass / self.u.mass)] * 3,
                *(float(x / self.u.inertia) for x in np.diag(new.inertia)),
            ]
        assert isinstance(new, Connection)
        k = int(np.argmax(np.diag(np.abs(old.K) + np.abs(old.C))))
        rest = [np.delete(np.delete(np.abs(X), k, 0), k, 1).any() for X in (new.K, new.C)]
        if any(rest) or new.D.any() or new.rigid or not np.allclose(new.axes, old.axes):
            return []
        return [float(new.K[k, k] / self.u.stiffness[k]), float(new.C[k, k] / self.u.damping[k])]

    # Materials and sections ---------------------------------------------------------------------------------

    def _old(self, source: int) -> tuple[AnsysElement, Material]:
        """Return an element with a property, and the material of it."""
        return self.element_of[source], self.changes.source.properties[source].material

    def _material_lines(self, old: int, n: int, new: Material) -> list[str]:
        """Return the commands of a material with the values of another one in proportion."""
        values = self.archive.materials[old]
        was = self.changes.material(f"material {old}")
        shear = new.E / was.E * (1 + was.nu) / (1 + new.nu)
        factors = {"EX": new.E / was.E, "GXY": shear, "DENS": new.rho / was.rho}
        out = {key: value * factors.get(key, 1.0) for key, value in values.items()}
        if new.nu != was.nu and abs(new.nu - was.nu) > 1e-9:
            out |= {"PRXY": float(new.nu)}
        if new.loss_factor != was.loss_factor:
            out |= {"DMPR": new.loss_factor / 2}
        if n == old:
            out = {key: value for key, value in out.items() if value != values.get(key)}
        return [command("MP", key, n, float(value)) for key, value in out.items()]

    def _material(self, source: int, new: Material) -> int:
        e, was = self._old(source)
        for old, m, n in self.made:
            if old == e.mat and same_material(m, new):
                return n
        if same_material(was, new):
            return e.mat
        n = next(self.tables)
        self.made.append((e.mat, new, n))
        self.out.lines += [*wrapped("!", new.name), *self._material_lines(e.mat, n, new)]
        return n

    def _needs_section(self, v: Variant) -> bool:
        """Whether a property needs another section; shear stiffnesses of SECCONTROL do not follow E."""
        e, _ = self._old(v.source)
        command = self.archive.sections.get(e.section)
        absolute = command is not None and any(command.control[k : k + 1] not in ([], [0.0]) for k in (0, 2))
        return v.section or (v.material and absolute)

    def _simple(self, source: int) -> bool:
        """Whether constants of a section along the axes of its elements stand for it."""
        return source not in self.changes.shifted and self.archive.kind(self.element_of[source]) == 188

    def _section_in_place(self, i: int, v: Variant) -> None:
        if v.source < 0 or not v.complete or not self._needs_section(v) or not self._simple(v.source):
            return
        e, _ = self._old(v.source)
        others = {
            x.number
            for x in self.archive.elements.values()
            if x.section == e.section and self.archive.kind(x) in BY_SECTION
        }
        bars = self.changes.source.bars
        if others == set(bars.numbers[bars.properties == v.source].tolist()):
            self._redefine(f"section {e.section}", *section_commands(v.new, e.section, self.u))
            self.sections[i, v.source] = e.section

    # Elements -----------------------------------------------------------------------------------------------

    def _bar(self, k: int, piece: Piece, own: dict[int, Attributes | None]) -> None:
        """Write an element with other tables; one with other nodes goes to those that are written later."""
        c = self.changes
        v = c.variants[piece.variant] if piece.variant >= 0 else None
        if piece.source < 0:
            own[k] = None
            return
        e = self.elements[int(c.source.bars.numbers[piece.source])]
        kind = int(c.source.bars.properties[piece.source])
        simple = self._simple(kind)
        if (piece.joined or (v is not None and self._needs_section(v))) and not simple:
            own[k] = None
            return
        material = e.mat if v is None else self._material(kind, v.new.material)
        section = e.section
        if v is not None and self._needs_section(v):
            key = piece.variant, kind
            if key not in self.sections:
                n = self.sections[key] = next(self.tables)
                self.out.lines += [*wrapped("!", v.new.name), *section_commands(v.new, n, self.u)]
            section = self.sections[key]
        tables = {"TYPE": e.type, "MAT": material, "REAL": e.real, "SECNUM": section}
        if piece.joined:
            own[k] = tables, e.nodes[2:]
        elif (material, section) != (e.mat, e.section):
            lines = [command(name, n) for name, n in tables.items()]
            self._redefine(f"element {e.number}", *lines, command("EN", e.number, *e.nodes))
