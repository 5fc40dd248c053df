"""Abaqus and CalculiX input files (``.inp``): nodes, line elements and sets.

meshio 5.3.5 reads them too, but keeps the last of several ``*NODE`` blocks, mixes up element sets when
several ``*ELEMENT`` blocks share a name or some have none, takes B33 for a three-node element, refuses a file
for one element type that it does not know (MASS, for instance), and knows no parts and instances. So these
are read here.
"""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fem.io.rawmesh import RawMesh
from fem.mesh import Mesh, MeshError

_TWO_NODES = re.compile(r"B2[13]|B3[13]|T[23]D2|PIPE[23]1|FRAME[23]D|ELBOW31|B31OS|T3D2H|BEAM|TRUSS")
_THREE_NODES = re.compile(r"B[23]2|T[23]D3|PIPE[23]2|ELBOW32|B32OS")


@dataclass(slots=True)
class _Part:
    nodes: dict[int, list[float]] = field(default_factory=dict)
    elements: dict[int, tuple[int, ...]] = field(default_factory=dict)
    elsets: dict[str, list[int]] = field(default_factory=dict)
    nsets: dict[str, list[int]] = field(default_factory=dict)


@dataclass(slots=True)
class _Instance:
    name: str
    part: str
    rows: list[list[float]] = field(default_factory=list)


class _Reader:
    def __init__(self, file: str) -> None:
        self.file = file
        self.parts: dict[str, _Part] = {"": _Part()}
        self.part = self.parts[""]
        self.instances: list[_Instance] = []
        self.assembly: list[tuple[str, str, str, list[int]]] = []  # elset or nset, name, instance, numbers
        self.left_out = RawMesh().left_out

    def read(self, path: Path) -> None:
        """Read a file and those that it includes."""
        try:
            text = path.read_text(encoding="utf-8", errors="replace")
        except OSError as reason:
            msg = f"{self.file}: the file {path.name} that it includes cannot be read ({reason.strerror})"
            raise MeshError(msg) from reason
        for line, keyword, options, data in _blocks(text):
            try:
                self._block(keyword, options, data, path)
            except (ValueError, IndexError, KeyError) as reason:
                if isinstance(reason, MeshError):
                    raise
                msg = (
                    f"{path.name}: the block *{keyword} at line {line} has something else than numbers "
                    f"({reason})"
                )
                raise MeshError(msg) from reason

    def _block(self, keyword: str, options: dict[str, str], data: list[list[str]], path: Path) -> None:
        if keyword == "NODE":
            self._nodes(options, data)
        elif keyword == "ELEMENT":
            self._elements(options, data)
        elif keyword in ("ELSET", "NSET"):
            self._set(keyword, options, data)
        elif keyword == "PART":
            self.part = self.parts.setdefault(options["NAME"], _Part())
        elif keyword in ("END PART", "ASSEMBLY"):
            self.part = self.parts[""]
        elif keyword == "INSTANCE":
            rows = [[float(v) for v in row if v] for row in data]
            self.instances.append(_Instance(options["NAME"], options["PART"], rows))
        elif keyword == "INCLUDE":
            self.read(path.parent / options["INPUT"])

    def _nodes(self, options: dict[str, str], data: list[list[str]]) -> None:
        for row in data:
            xyz = [float(v) if v else 0.0 for v in row[1:4]]
            self.part.nodes[int(row[0])] = [*xyz, 0.0, 0.0, 0.0][:3]
            if "NSET" in options:
                self.part.nsets.setdefault(options["NSET"], []).append(int(row[0]))

    def _elements(self, options: dict[str, str], data: list[list[str]]) -> None:
        kind = options["TYPE"].upper()
        count = 3 if _THREE_NODES.match(kind) else 2 if _TWO_NODES.match(kind) else 0
        if not count:
            self.left_out[f"{kind} elements"] += len(data)
            return
        for row in data:
            numbers = [int(v) for v in row if v]
            if len(numbers) < count + 1:
                msg = f"element {row[0]} of type {kind} has {len(numbers) - 1} nodes of {count}"
                raise ValueError(msg)
            self.part.elements[numbers[0]] = tuple(
                numbers[1 : count + 1]
            )  # a further one gives the orientation
            if "ELSET" in options:
                self.part.elsets.setdefault(options["ELSET"], []).append(numbers[0])

    def _set(self, keyword: str, options: dict[str, str], data: list[list[str]]) -> None:
        if "INTERNAL" in options:
            return
        known = self.part.elsets if keyword == "ELSET" else self.part.nsets
        numbers: list[int] = []
        for row in data:
            cells = [v for v in row if v]
            if "GENERATE" in options:
                first, last, *step = (int(v) for v in cells)
                numbers += range(first, last + 1, *step[:1])
                continue
            for cell in cells:
                numbers += (
                    [int(cell)] if cell.lstrip("-").isdigit() else known.get(cell.strip('"').upper(), [])
                )
        name = options[keyword]
        if "INSTANCE" in options:
            self.assembly.append((keyword, name, options["INSTANCE"], numbers))
        else:
            known.setdefault(name, []).extend(numbers)

    def result(self) -> RawMesh:
        """Return all parts at their places."""
        raw = RawMesh(left_out=self.left_out)
        places: dict[tuple[str, str, int], int] = {}
        loose = _Instance("", "")
        alone = not self.instances
        for instance in self.instances or [_Instance("", name) for name in self.parts]:
            part = self.parts.get(instance.part)
            if part is None:
                msg = (
                    f"{self.file}: instance {instance.name} refers to part {instance.part}, which is not "
                    "there"
                )
                raise MeshError(msg)
            several = len(self.instances) > 1
            _place(raw, part, instance, f"{instance.name}." if several else "", places, self.file)
        if not alone:
            _place(raw, self.parts[""], loose, "", places, self.file)
        for keyword, name, instance, numbers in self.assembly:
            target = raw.sets if keyword == "ELSET" else raw.point_sets
            found = [places[key] for n in numbers if (key := (keyword, instance, n)) in places]
            target.setdefault(name, []).extend(found)
        return raw


def _place(
    raw: RawMesh,
    part: _Part,
    instance: _Instance,
    prefix: str,
    places: dict[tuple[str, str, int], int],
    file: str,
) -> None:
    """Add a part to the mesh, moved and turned to its place."""
    row_of: dict[int, int] = {}
    for number, xyz in zip(part.nodes, _moved(part, instance), strict=True):
        row_of[number] = places["NSET", instance.name, number] = len(raw.points)
        raw.points.append(xyz)
    line_of: dict[int, int] = {}
    for number, nodes in part.elements.items():
        missing = next((n for n in nodes if n not in row_of), None)
        if missing is not None:
            msg = f"{file}: element {number} refers to node {missing}, which the file does not have"
            raise MeshError(msg)
        line_of[number] = places["ELSET", instance.name, number] = len(raw.lines)
        raw.lines.append(tuple(row_of[n] for n in nodes))
    for name, numbers in part.elsets.items():
        found = [line_of[n] for n in numbers if n in line_of]
        raw.sets.setdefault(prefix + name, []).extend(found)
    for name, numbers in part.nsets.items():
        raw.point_sets.setdefault(prefix + name, []).extend(row_of[n] for n in numbers if n in row_of)


def _moved(part: _Part, instance: _Instance) -> list[list[float]]:
    """Shift by an instance's first line, then turn about the axis and by the angle [°] of its second."""
    points = np.array(list(part.nodes.values()), dtype=float).reshape(-1, 3)
    if instance.rows:
        points = points + np.array([*instance.rows[0], 0.0, 0.0, 0.0][:3])
    if len(instance.rows) > 1 and len(instance.rows[1]) == 7:
        a, b, angle = np.array(instance.rows[1][:3]), np.array(instance.rows[1][3:6]), instance.rows[1][6]
        points = a + (points - a) @ _rotation(b - a, np.deg2rad(angle)).T
    return points.tolist()


def _rotation(axis: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Rodrigues' formula."""
    x, y, z = axis / np.linalg.norm(axis)
    S = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * S + (1 - np.cos(angle)) * S @ S


def _blocks(text: str) -> Iterator[tuple[int, str, dict[str, str], list[list[str]]]]:
    """Give each keyword with its line, options and data; lines that end in a comma go on in the next."""
    start, keyword, options, data, open_row = 0, "", {}, [], False
    head = ""
    for number, raw_line in enumerate(text.splitlines(), start=1):
        line = raw_line.strip()
        if not line or line.startswith("**"):
            continue
        if head.endswith(",") and not line.startswith("*"):
            head += line
            keyword, options = _keyword(head)
            continue
        if line.startswith("*"):
            if keyword:
                yield start, keyword, options, data
            head, start, data, open_row = line, number, [], False
            keyword, options = _keyword(line)
            continue
        head = ""
        cells = [cell.strip() for cell in line.split(",")]
        if open_row:
            data[-1] += cells
        else:
            data.append(cells)
        open_row = line.endswith(",") and keyword == "ELEMENT"
    if keyword:
        yield start, keyword, options, data


def _keyword(line: str) -> tuple[str, dict[str, str]]:
    """Split a keyword line; names of sets are not sensitive to case unless quoted."""
    word, *rest = line[1:].split(",")
    options: dict[str, str] = {}
    for item in rest:
        key, _, value = item.partition("=")
        key, value = key.strip().upper(), value.strip()
        quoted = value.startswith('"')
        options[key] = value if key == "INPUT" else value.strip('"') if quoted else value.upper()
    return " ".join(word.upper().split()), options


def read_abaqus(path: Path) -> RawMesh:
    """Read the lines of an Abaqus or CalculiX input file.

    Set names come out in capitals, as Abaqus does not tell case apart. Sets of instances are named
    ``INSTANCE.SET`` where there are several instances.

    Raises
    ------
    MeshError
        For a block that is not numbers, or elements that refer to nodes which are not there.
    """
    reader = _Reader(path.name)
    reader.read(path)
    return reader.result()


def abaqus_text(mesh: Mesh) -> str:
    """Return a mesh as an input file: B31 elements, a set for each member, group and named point."""
    rows = ["*NODE"]
    rows += [f"{k}, {x!r}, {y!r}, {z!r}" for k, (x, y, z) in enumerate(mesh.points.tolist(), start=1)]
    rows.append("*ELEMENT, TYPE=B31")
    rows += [f"{k}, {a + 1}, {b + 1}" for k, (a, b) in enumerate(mesh.lines.tolist(), start=1)]
    for name, members in (*((m, (m,)) for m in mesh.members), *mesh.groups.items()):
        numbers = [int(row) + 1 for member in members for row in mesh.members[member]]
        rows.append(f'*ELSET, ELSET="{name}"')
        rows += [", ".join(str(n) for n in numbers[k : k + 16]) for k in range(0, len(numbers), 16)]
    for name, point in mesh.point_names.items():
        rows += [f'*NSET, NSET="{name}"', str(point + 1)]
    return "\n".join([*rows, ""])


def read_abaqus_nodes(path: Path) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the numbers (n,) and coordinates (n, 3) of a deck's nodes outside parts, in the deck's unit."""
    nodes = _deck(path).nodes
    return np.array(list(nodes), dtype=np.int64), np.array(list(nodes.values()), dtype=float).reshape(-1, 3)


def read_node_sets(path: str | os.PathLike[str]) -> dict[str, tuple[int, ...]]:
    """Return the node sets of an Abaqus or CalculiX deck outside parts, by their names in capitals."""
    return {name: tuple(dict.fromkeys(numbers)) for name, numbers in _deck(Path(path)).nsets.items()}


def _deck(path: Path) -> _Part:
    reader = _Reader(path.name)
    reader.read(path)
    return reader.parts[""]
