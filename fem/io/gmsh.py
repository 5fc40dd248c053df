"""Gmsh files (``.msh``, formats 1, 2, 4.0 and 4.1, text and binary): points, lines, physical groups.

meshio 5.3.5 reads them too, but stops where only some of the elements are in physical groups, loses the
groups of partitioned files, mixes up groups of the same name in different dimensions, and loses a second
group of an element in format 2.2.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fem.array_types import Ints
from fem.io.faults import error_at
from fem.io.gmsh_elements import (
    Entity,
    GmshLines,
    GmshNodes,
    read_elements_1_and_2,
    read_elements_4,
    read_entities,
    read_nodes_1_and_2,
    read_nodes_4,
    row_codes,
)
from fem.io.gmsh_sections import MshFile, sections_of
from fem.io.rawmesh import LineSets, RawMesh, listed
from fem.mesh import Mesh, MeshError

_APPLIED = (
    "MeshFormat",
    "PhysicalNames",
    "Entities",
    "PartitionedEntities",
    "Nodes",
    "ParametricNodes",
    "Elements",
    "NOD",
    "ELM",
)
_HARMLESS = ("Comments", "Parametrizations", "InterpolationScheme")
"""Sections without points, lines and groups: texts, surfaces' parameters, and how data are drawn."""


def read_gmsh(path: Path) -> RawMesh:
    """Read the lines of a Gmsh file; named physical groups of curves are sets, of points point sets.

    Groups without a name are called ``physical 3``. Lines in no group are named by their curve, ``curve 5``.
    Lines of a partition belong to the curve that was divided and to its groups.

    Raises
    ------
    MeshError
        If a section is missing, is cut off, or holds something else than it announces.
    """
    file = sections_of(path.name, path.read_bytes())
    version_4 = file.version.startswith("4")
    _check_sections(file)
    raw = RawMesh()
    names = _Names(file, raw.notes)
    if version_4:
        entities = read_entities(file)
        nodes, lines = read_nodes_4(file), read_elements_4(file, raw.left_out)
        pairs, point_pairs = _groups_4(lines, nodes, entities, raw.notes)
    else:
        nodes, lines = read_nodes_1_and_2(file), read_elements_1_and_2(file, raw.left_out)
        pairs, point_pairs = _groups_2(lines, raw.notes)
    nodes = _distinct_nodes(file, nodes, raw.notes)
    _note_numbers(lines, raw.notes)
    rows = _rows_of(file, nodes, lines)
    _fill(raw, nodes, lines, rows, _sets(pairs, names, lines), raw.notes)
    raw.point_sets = _point_sets(point_pairs, names, nodes)
    names.note_unused(raw)
    raw.notes += _section_notes(file)
    return raw


def _check_sections(file: MshFile) -> None:
    pair = ("NOD", "ELM") if file.version == "1" else ("Nodes", "Elements")
    there = [section.name for section in file.sections]
    if "ParametricNodes" in there and "Nodes" not in there:
        pair = ("ParametricNodes", "Elements")
    for needed in pair:
        if needed not in there:
            found = ", ".join(f"${name}" for name in dict.fromkeys(there))
            raise error_at(file.name, f"there is no section ${needed}; it has {found}")


def _section_notes(file: MshFile) -> Iterator[str]:
    """Name the sections that were not read, and text outside sections."""
    rest: dict[str, list[int]] = {}
    for section in file.sections:
        if section.name not in (*_APPLIED, *_HARMLESS):
            rest.setdefault(section.name, []).append(section.line)
    if rest:
        words = ", ".join(f"${name} (line {', '.join(map(str, lines[:3]))})" for name, lines in rest.items())
        yield f"sections left out: {words}"
    if file.stray:
        yield f"text outside any section left out, first at line {file.stray[0]}"


class _Names:
    """Names of the physical groups, by dimension and tag."""

    def __init__(self, file: MshFile, notes: list[str]) -> None:
        self.known: dict[tuple[int, int], str] = {}
        self.used: set[tuple[int, int]] = set()
        self.dimensions = False  # format 2.0 gives none
        section = file.section("PhysicalNames")
        rows = file.text_lines(section) if section else []
        count = rows[0][1] if rows else "0"
        for line, row in rows[1:]:
            found = re.fullmatch(r'(?:([0-3])\s+)?(-?\d{1,15})\s+"(.*)"', row)
            self.dimensions |= found is not None and found.group(1) is not None
            if found is None:
                notes.append(
                    f"line {line}, in $PhysicalNames, is left out: '{row[:60]}' is found where a dimension, "
                    "a tag and a quoted name are expected"
                )
                continue
            tag, name = abs(int(found.group(2))), found.group(3).strip() or f"physical {found.group(2)}"
            for dimension in [int(found.group(1))] if found.group(1) else range(4):
                if self.known.get((dimension, tag), name) != name:
                    notes.append(
                        f"line {line}, in $PhysicalNames, gives group {tag} of dimension {dimension} the "
                        f"name '{name}'; its name '{self.known[dimension, tag]}' is kept"
                    )
                self.known.setdefault((dimension, tag), name)
        if rows and count != str(len(rows) - 1):
            notes.append(f"$PhysicalNames announces {count[:20]} names and has {len(rows) - 1}")
        for dimension, what in enumerate(("points", "curves")):
            tags: dict[str, list[int]] = {}
            for (d, tag), name in self.known.items():
                if d == dimension:
                    tags.setdefault(name, []).append(tag)
            for name, several in tags.items():
                if len(several) > 1:
                    numbers = ", ".join(map(str, several))
                    notes.append(f"physical {what} {numbers} are all called '{name}' and become one set")

    def of(self, dimension: int, tag: int) -> str:
        """Return the name of a group that has elements."""
        self.used.add((dimension, tag))
        return self.known.get((dimension, tag), f"physical {tag}")

    def of_curve(self, tag: int) -> str:
        """Return a name for lines in no group."""
        name = f"curve {tag}"
        taken = any(d == 1 and name == known for (d, _), known in self.known.items())
        return f"ungrouped {name}" if taken else name

    def note_unused(self, raw: RawMesh) -> None:
        """Note named groups without lines or points, and those of surfaces and volumes."""
        found = {self.known[key] for key in self.used & self.known.keys()}
        for dimension, what in enumerate(("points", "curves", "surfaces", "volumes")):
            lost = dict.fromkeys(name for (d, _), name in self.known.items() if d == dimension)
            lost = [name for name in lost if name not in found]
            if lost and self.dimensions:
                kind = "without elements" if dimension < 2 else "left out"
                raw.notes.append(f"physical {what} {kind}: {listed(lost)}")


# Groups -----------------------------------------------------------------------------------------------------

_Pairs = list[tuple[int, bool, Ints]]
"""Tag, whether it is a physical group's (else a curve's), and the lines, or node numbers, in it."""


def _groups_4(
    lines: GmshLines, nodes: GmshNodes, entities: dict[tuple[int, int], Entity], notes: list[str]
) -> tuple[_Pairs, _Pairs]:
    """Return the groups of the lines and of the points by the entities that they belong to."""
    pairs: _Pairs = []
    unknown: list[int] = []
    order = np.argsort(lines.entity, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(lines.entity[order])) + 1) if order.size else []:
        tag = int(lines.entity[rows[0]])
        entity = entities.get((1, tag))
        if entity is None:
            entity = Entity(tag, ())
            unknown.append(tag)
        if entity.groups and all(group < 0 for group in entity.groups):
            lines.reverse(rows)  # as Gmsh itself does where it writes format 2
        pairs += [(abs(group), True, rows) for group in dict.fromkeys(entity.groups)]
        if not entity.groups:
            pairs.append((entity.curve, False, rows))
    if unknown and entities:
        notes.append(
            "the groups of these curves are not known, because $Entities does not list them: "
            f"{', '.join(map(str, unknown[:8]))}"
        )
    point_pairs: _Pairs = []
    for tag, numbers in (*nodes.on_points, *lines.points):
        entity = entities.get((0, int(tag)))
        point_pairs += [(abs(group), True, numbers) for group in (entity.groups if entity else ())]
    return pairs, point_pairs


def _groups_2(lines: GmshLines, notes: list[str]) -> tuple[_Pairs, _Pairs]:
    """Return the groups that the elements themselves name; an element of two groups is there twice.

    Elements with the same nodes are one line where they belong to one curve or have one number; two curves
    between the same nodes are two lines.
    """
    if (lines.group < 0).any():
        tag = int(lines.group[lines.group < 0][0])
        notes.append(f"the sign of physical tags is not applied: {tag} is read as {-tag}")
    group = np.abs(lines.group)
    first = lines.first_of_each()
    again = np.flatnonzero(first != np.arange(len(first)))
    if again.size:
        _, at = np.unique(row_codes(np.column_stack([first, group])), return_index=True)
        repeated = np.setdiff1d(again, at)
        if repeated.size:
            a, b = int(first[repeated[0]]), int(repeated[0])
            notes.append(
                f"{repeated.size} elements repeat another of the same group and are read once, first that at "
                f"{lines.place(b)}, which repeats that at {lines.place(a)}"
            )
        kept = lines.keep(np.flatnonzero(first == np.arange(len(first))))
        first = kept[first]
    ungrouped = np.ones(len(lines.number), dtype=bool)
    ungrouped[first[group > 0]] = False
    pairs: _Pairs = [(tag, True, np.unique(first[rows])) for tag, rows in _by_value(group) if tag > 0]
    alone = np.flatnonzero(ungrouped)
    pairs += [(tag, False, alone[rows]) for tag, rows in _by_value(lines.entity[alone])]
    return pairs, [(int(tag), True, numbers) for tag, numbers in lines.points if tag]


def _by_value(values: Ints) -> Iterator[tuple[int, Ints]]:
    """Give each value with the rows that have it, in the order of their first rows."""
    order = np.argsort(values, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(values[order])) + 1) if order.size else []
    for rows in sorted(parts, key=lambda rows: rows[0]):
        yield int(values[rows[0]]), rows


def _sets(pairs: _Pairs, names: _Names, lines: GmshLines) -> LineSets:
    pairs = sorted(pairs, key=lambda pair: int(pair[2][0]))
    called = [names.of(1, tag) if group else names.of_curve(tag) for tag, group, _ in pairs]
    number_of = {name: k for k, name in enumerate(dict.fromkeys(called))}
    number = np.repeat(
        np.array([number_of[name] for name in called], dtype=np.int64), [len(rows) for _, _, rows in pairs]
    )
    rows = np.concatenate([rows for _, _, rows in pairs]) if pairs else np.zeros(0, dtype=np.int64)
    return LineSets(list(number_of), number, rows)


def _point_sets(pairs: _Pairs, names: _Names, nodes: GmshNodes) -> dict[str, Ints]:
    found: dict[str, list[Ints]] = {}
    for tag, _, numbers in pairs:
        rows = nodes.rows(numbers)
        found.setdefault(names.of(0, tag), []).append(rows[rows >= 0])
    return {name: np.concatenate(parts) for name, parts in found.items()}


# Nodes and lines --------------------------------------------------------------------------------------------


def _distinct_nodes(file: MshFile, nodes: GmshNodes, notes: list[str]) -> GmshNodes:
    """Return the nodes, each number once; refuse a number that stands for two places."""
    order = np.argsort(nodes.number, kind="stable")
    again = np.flatnonzero(np.diff(nodes.number[order]) == 0) + 1
    if not again.size:
        return nodes
    same = (nodes.xyz[order[again]] == nodes.xyz[order[again - 1]]).all(axis=1)
    k = int(again[0] if same.all() else again[np.argmin(same)])
    first, second = int(order[k - 1]), int(order[k])
    text = f"node {nodes.number[first]} is defined at {nodes.place(first)} and again at {nodes.place(second)}"
    if not same.all():
        raise error_at(file.name, f"{text}, with other coordinates; give one of them another number")
    notes.append(f"{text}, with the same coordinates{_more(again.size)}")
    keep = np.ones(len(nodes.number), dtype=bool)
    keep[order[again]] = False
    return nodes.keep(np.flatnonzero(keep))


def _more(n: int) -> str:
    return f" ({n - 1} more so)" if n > 1 else ""


def _note_numbers(lines: GmshLines, notes: list[str]) -> None:
    """Note an element number that is used twice; both elements are read."""
    order = np.argsort(lines.number, kind="stable")
    again = np.flatnonzero(np.diff(lines.number[order]) == 0) + 1
    if again.size:
        first, second = int(order[again[0] - 1]), int(order[again[0]])
        notes.append(
            f"element {lines.number[first]} is defined at {lines.place(first)} and again at "
            f"{lines.place(second)}; both are read{_more(again.size)}"
        )


def _rows_of(file: MshFile, nodes: GmshNodes, lines: GmshLines) -> Ints:
    """Return the points of each line, -1 beyond its last; refuse nodes that are not there or not finite."""
    rows = nodes.rows(lines.nodes)
    missing = (rows < 0) & (lines.nodes >= 0) | (lines.nodes < -1)
    if missing.any():
        k = int(np.flatnonzero(missing.any(axis=1))[0])
        msg = (
            f"{file.name}: {lines.place(k)}, in $Elements: element {lines.number[k]} refers to node "
            f"{lines.nodes[k][missing[k]][0]}, which is not among the {len(nodes.number)} nodes of the file"
        )
        raise MeshError(msg)
    bad = np.flatnonzero(~np.isfinite(nodes.xyz).all(axis=1))
    bad = bad[np.isin(bad, rows)]
    if bad.size:
        k = int(bad[0])
        msg = (
            f"{file.name}: {nodes.place(k)}: node {nodes.number[k]} has the coordinates "
            f"{', '.join(f'{x:g}' for x in nodes.xyz[k])}; they must be finite numbers"
        )
        raise MeshError(msg)
    return rows


def _fill(
    raw: RawMesh, nodes: GmshNodes, lines: GmshLines, rows: Ints, sets: LineSets, notes: list[str]
) -> None:
    """Hand over points, lines and sets; lines of order 3 and more become several of two nodes."""
    raw.points, raw.point_numbers, raw.line_numbers = nodes.xyz, nodes.number, lines.number
    raw.lines = rows[:, :3]
    count = np.ones(len(rows), dtype=np.int64)
    if rows.shape[1] > 3:
        n = (rows >= 0).sum(axis=1)
        count = np.where(n > 3, n - 1, 1)
        origin = np.repeat(np.arange(len(rows)), count)
        step = np.arange(len(origin)) - np.repeat(np.cumsum(count) - count, count)
        pairs = np.column_stack([rows[origin, step], rows[origin, step + 1], np.full(len(origin), -1)])
        raw.lines = np.where((count[origin] > 1)[:, None], pairs, rows[origin][:, :3])
        raw.line_numbers = lines.number[origin]
        notes.append(f"{int((count > 1).sum())} lines of order 3 or more became several lines each")
    raw.sets = sets.over(np.cumsum(count) - count, count).mapping()


def gmsh_text(mesh: Mesh) -> str:
    """Return a mesh in format 2.2: members are physical curves, named points physical points."""
    rows = [
        "$MeshFormat",
        "2.2 0 8",
        "$EndMeshFormat",
        "$PhysicalNames",
        f"{len(mesh.members) + len(mesh.point_names)}",
    ]
    rows += [f'0 {k} "{name}"' for k, name in enumerate(mesh.point_names, start=1)]
    rows += [f'1 {k} "{name}"' for k, name in enumerate(mesh.members, start=1)]
    rows += ["$EndPhysicalNames", "$Nodes", str(mesh.n_points)]
    rows += [f"{k} {x!r} {y!r} {z!r}" for k, (x, y, z) in enumerate(mesh.points.tolist(), start=1)]
    rows += ["$EndNodes", "$Elements", str(mesh.n_lines + len(mesh.point_names))]
    number_of = {name: k for k, name in enumerate(mesh.members, start=1)}
    group = [number_of[str(name)] for name in mesh.member_of_line()]
    lines = enumerate(zip(mesh.lines.tolist(), group, strict=True), start=1)
    rows += [f"{k} 1 2 {g} {g} {a + 1} {b + 1}" for k, ((a, b), g) in lines]
    points = enumerate(mesh.point_names.values(), start=1)
    rows += [f"{mesh.n_lines + k} 15 2 {k} {k} {point + 1}" for k, point in points]
    return "\n".join([*rows, "$EndElements", ""])
