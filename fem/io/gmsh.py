"""Gmsh files in text form (``.msh``, format 2.2 and 4.1): points, lines, physical groups.

meshio 5.3.5 reads them too, but stops where only some of the elements are in physical groups, mixes up groups
of the same name in different dimensions, and loses a second group of an element in format 2.2. So these are
read here; binary files and format 4.0 go through meshio.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from fem.io.rawmesh import RawMesh
from fem.mesh import Mesh, MeshError

_NODES = {1: 2, 8: 3, 15: 1}
"""Nodes of lines, quadratic lines and points, by Gmsh's element type."""

_TYPES = {2: "triangles", 3: "quadrangles", 4: "tetrahedra", 5: "hexahedra", 6: "prisms", 7: "pyramids"}


class _Words:
    """The words of a section, one after the other."""

    def __init__(self, lines: list[str]) -> None:
        self.lines = lines
        self.words: Iterator[str] = (word for line in lines for word in line.split())

    def whole(self, n: int = 1) -> list[int]:
        return [int(next(self.words)) for _ in range(n)]

    def real(self, n: int) -> list[float]:
        return [float(next(self.words)) for _ in range(n)]


def is_gmsh_text(path: Path) -> bool:
    """Tell whether a file is a Gmsh file in text form of format 2.x or 4.1."""
    with path.open("rb") as file:
        start = file.read(4096)
    return re.search(rb"\$MeshFormat\s+(2(\.\d)?|4\.1)\s+0\s", start) is not None


def read_gmsh(path: Path) -> RawMesh:
    """Read the lines of a Gmsh file; named physical groups of curves are sets, of points point sets.

    Groups without a name are called ``physical 3``. Lines in no group are named by their curve, ``curve 5``.

    Raises
    ------
    MeshError
        If a section is missing, is cut off or holds something else than numbers.
    """
    sections = _sections(path.read_text(encoding="utf-8", errors="replace"), path.name)
    for needed in ("Nodes", "Elements"):
        if needed not in sections:
            msg = f"{path.name}: there is no section ${needed}; it has {', '.join(f'${s}' for s in sections)}"
            raise MeshError(msg)
    section = "PhysicalNames"
    try:
        names = _physical_names(sections.get(section, []))
        reader = (
            _Version2(names) if sections["MeshFormat"][0].split()[0].startswith("2") else _Version4(names)
        )
        for section, read in (
            ("Entities", reader.entities),
            ("Nodes", reader.nodes),
            ("Elements", reader.elements),
        ):
            if section in sections:
                read(_Words(sections[section]))
    except (ValueError, StopIteration, IndexError, KeyError, RuntimeError) as reason:
        if isinstance(reason, MeshError):
            raise
        what = (
            "is cut off"
            if isinstance(reason, (StopIteration, RuntimeError))
            else f"cannot be read ({reason})"
        )
        msg = f"{path.name}: the section ${section} {what}"
        raise MeshError(msg) from reason
    return reader.raw


def _sections(text: str, file: str) -> dict[str, list[str]]:
    sections: dict[str, list[str]] = {}
    name: str | None = None
    for line in text.splitlines():
        word = line.strip()
        if name is None and word.startswith("$") and not word.startswith("$End"):
            name = word[1:]
            sections.setdefault(name, [])
        elif name is not None and word == f"$End{name}":
            name = None
        elif name is not None:
            sections[name].append(line)
    if name is not None:
        msg = f"{file}: the section ${name} has no end; the file may be cut off"
        raise MeshError(msg)
    return sections


def _physical_names(lines: list[str]) -> dict[tuple[int, int], str]:
    names: dict[tuple[int, int], str] = {}
    for line in lines[1:]:
        found = re.match(r'\s*(\d+)\s+(\d+)\s+"(.*)"', line)
        if found:
            names[int(found.group(1)), int(found.group(2))] = found.group(3)
    return names


class _Version:
    """What both formats share: points and groups."""

    def __init__(self, names: dict[tuple[int, int], str]) -> None:
        self.names = names
        self.raw = RawMesh()
        self.row_of: dict[int, int] = {}

    def entities(self, words: _Words) -> None:
        """Read the section of the geometry, which only format 4 has."""

    def _point(self, tag: int, xyz: list[float]) -> None:
        self.row_of[tag] = len(self.raw.points)
        self.raw.points.append(xyz)

    def _element(self, kind: int, nodes: list[int], groups: list[int], entity: int) -> None:
        if kind not in _NODES:
            self.raw.left_out[_TYPES.get(kind, f"elements of type {kind}")] += 1
            return
        missing = next((n for n in nodes if n not in self.row_of), None)
        if missing is not None:
            msg = f"an element refers to node {missing}, which is not there"
            raise ValueError(msg)
        rows = [self.row_of[n] for n in nodes]
        if kind == 15:
            for group in groups:
                self.raw.point_sets.setdefault(self._name(0, group), []).append(rows[0])
            return
        for name in [self._name(1, group) for group in groups] or [f"curve {entity}"]:
            self.raw.add_to_set(name, len(self.raw.lines))
        self.raw.lines.append(tuple(rows))

    def _name(self, dimension: int, group: int) -> str:
        return self.names.get((dimension, group), f"physical {group}")


class _Version2(_Version):
    def nodes(self, words: _Words) -> None:
        for _ in range(words.whole()[0]):
            self._point(words.whole()[0], words.real(3))

    def elements(self, words: _Words) -> None:
        """Read one element a line; an element in two groups is there twice."""
        seen: dict[tuple[int, ...], int] = {}
        count = int(words.lines[0])
        rows = [[int(w) for w in line.split()] for line in words.lines[1:] if line.strip()]
        if len(rows) < count:
            msg = f"{count} elements announced, {len(rows)} there"
            raise ValueError(msg)
        for _, kind, n_tags, *rest in rows[:count]:
            tags, nodes = rest[:n_tags], rest[n_tags:]
            groups = [tags[0]] if tags and tags[0] else []
            if kind in _NODES and len(nodes) != _NODES[kind]:
                msg = f"an element of type {kind} has {len(nodes)} nodes"
                raise ValueError(msg)
            again = seen.get((kind, *nodes)) if kind in (1, 8) else None
            if again is not None and groups:
                self.raw.add_to_set(self._name(1, groups[0]), again)
                continue
            if kind in (1, 8):
                seen[kind, *nodes] = len(self.raw.lines)
            self._element(kind, nodes, groups, tags[1] if len(tags) > 1 else 0)


class _Version4(_Version):
    def __init__(self, names: dict[tuple[int, int], str]) -> None:
        super().__init__(names)
        self.groups: dict[tuple[int, int], list[int]] = {}

    def entities(self, words: _Words) -> None:
        counts = words.whole(4)
        for dimension, count in enumerate(counts):
            for _ in range(count):
                tag = words.whole()[0]
                words.real(3 if dimension == 0 else 6)
                self.groups[dimension, tag] = [abs(g) for g in words.whole(words.whole()[0])]
                if dimension:
                    words.whole(words.whole()[0])

    def nodes(self, words: _Words) -> None:
        blocks, *_ = words.whole(4)
        for _ in range(blocks):
            dimension, _entity, parametric, count = words.whole(4)
            for_each = words.whole(count)
            for tag in for_each:
                self._point(tag, words.real(3))
                if parametric:
                    words.real(dimension)

    def elements(self, words: _Words) -> None:
        lines = iter(line for line in words.lines if line.strip())
        blocks = int(next(lines).split()[0])
        for _ in range(blocks):
            dimension, entity, kind, count = (int(w) for w in next(lines).split())
            for _ in range(count):
                nodes = [int(w) for w in next(lines).split()[1:]]
                self._element(kind, nodes, self.groups.get((dimension, entity), []), entity)


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
