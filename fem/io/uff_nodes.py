"""Datasets 15, 781 and 2411: nodes, their positions, and the directions of their displacements."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Bools, Floats, Ints
from fem.io.faults import refuse
from fem.io.uff_format import UffBlock, label_of, parse_label
from fem.io.uff_numbers import cells, integer, integer_columns, line_of, real, records, text_at
from fem.io.uff_types import Points

# Datasets 18 and 2420: coordinate systems of positions and of displacements ---------------------------------


CARTESIAN, CYLINDRICAL, SPHERICAL = range(3)

GLOBAL_NUMBERS = (0, 1)
"""Systems that are the global one unless the file defines them: 0 always, 1 by the habit of most programs."""


@dataclass(frozen=True, slots=True, eq=False)
class UffSystem:
    """A coordinate system.

    Attributes
    ----------
    kind : int, 0 Cartesian, 1 cylindrical (r, θ, z), 2 spherical (r, θ from z, φ about z); angles in degrees
    axes : ndarray (3, 3), its x, y and z axis in global coordinates, a row each
    origin : ndarray (3,), in the file's unit of length
    place : str, dataset and line
    """

    kind: int
    axes: Floats
    origin: Floats
    place: str = ""

    @property
    def is_global(self) -> bool:
        """Whether it is the global Cartesian system."""
        return self.kind == CARTESIAN and np.array_equal(self.axes, np.eye(3)) and not self.origin.any()

    def to_global(self, local: Floats) -> Floats:
        """Return positions (n, 3) in global coordinates."""
        xyz = local
        if self.kind == CYLINDRICAL:
            r, turn = local[:, 0], np.radians(local[:, 1])
            xyz = np.column_stack([r * np.cos(turn), r * np.sin(turn), local[:, 2]])
        elif self.kind == SPHERICAL:
            r, tilt, turn = local[:, 0], np.radians(local[:, 1]), np.radians(local[:, 2])
            flat = r * np.sin(tilt)
            xyz = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), r * np.cos(tilt)])
        return xyz @ self.axes + self.origin

    def directions_at(self, point: Floats) -> Floats:
        """Return the three directions at a global position (3,), a row each, in global coordinates.

        Raises
        ------
        ValueError
            On the axis of a cylindrical or spherical system, where they do not exist.
        """
        if self.kind == CARTESIAN:
            return self.axes
        x, y, z = self.axes @ (point - self.origin)
        flat, size = np.hypot(x, y), np.sqrt(x * x + y * y + z * z)
        if flat <= 1e-9 * max(size, float(np.abs(point).max()), np.finfo(float).tiny):
            refuse("which has no radial direction on its axis")
        c, s = x / flat, y / flat
        if self.kind == CYLINDRICAL:
            local = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        else:
            tilt = np.array([flat, z]) / size
            local = np.array(
                [[tilt[0] * c, tilt[0] * s, tilt[1]], [tilt[1] * c, tilt[1] * s, -tilt[0]], [-s, c, 0]]
            )
        return local @ self.axes


GLOBAL = UffSystem(CARTESIAN, np.eye(3), np.zeros(3))


@dataclass(frozen=True, slots=True, eq=False)
class _Definition:
    """A system as the file has it: axes and origin (4, 3), or three points (3, 3) in another system."""

    kind: int
    values: Floats
    reference: int | None
    method: int
    place: str

    def same_as(self, other: "_Definition") -> bool:
        """Tell whether another definition says the same."""
        return (
            (self.kind, self.reference, self.method) == (other.kind, other.reference, other.method)
            and self.values.shape == other.values.shape
            and np.allclose(self.values, other.values, rtol=0, atol=1e-5 * np.abs(self.values).max())
        )


@dataclass(slots=True, eq=False)
class UffSystems:
    """The coordinate systems of a file, by number; a faulty one raises only when it is used."""

    _found: dict[int, _Definition] = field(default_factory=dict)
    _other: dict[int, _Definition] = field(default_factory=dict)
    _made: dict[int, UffSystem] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._found)

    def add(self, block: UffBlock) -> None:
        """Take the systems of a dataset 18 or 2420 in."""
        for number, found in (_of_2420 if block.kind == 2420 else _of_18)(block):
            known = self._found.setdefault(number, found)
            if not known.same_as(found):
                self._other[number] = found

    def get(self, number: int, _users: tuple[int, ...] = ()) -> UffSystem:
        """Return a system.

        Raises
        ------
        ValueError
            If the file does not define it, or defines it in a way that is not read; the message continues
            "… coordinate system 7, ".
        """
        if number not in self._found and number in GLOBAL_NUMBERS:
            return GLOBAL
        if number not in self._made:
            self._made[number] = self._make(number, _users)
        return self._made[number]

    def _make(self, number: int, users: tuple[int, ...]) -> UffSystem:
        if number not in self._found:
            known = ", ".join(str(k) for k in sorted(self._found)[:10]) or "none"
            refuse(f"which the file does not define (datasets 18 and 2420); it defines {known}")
        d = self._found[number]
        if number in self._other:
            refuse(f"which {d.place} and {self._other[number].place} define differently")
        if d.kind not in (CARTESIAN, CYLINDRICAL, SPHERICAL):
            refuse(
                f"whose type is {d.kind} ({d.place}); 0, 1 and 2 are read (Cartesian, cylindrical, spherical)"
            )
        if d.reference is None:
            return UffSystem(d.kind, _rotation(d.values[:3], d.place), d.values[3], d.place)
        if d.method != 1:
            refuse(
                f"whose method of definition is {d.method} ({d.place}); 1 is read (origin, x axis, xz plane)"
            )
        if number in users:
            refuse(f"which refers to itself through others ({d.place})")
        base = self.get(d.reference, (*users, number))
        origin, on_x, on_xz = base.to_global(d.values)
        x = _unit(on_x - origin, d.place)
        z = _unit(on_xz - origin - ((on_xz - origin) @ x) * x, d.place)
        return UffSystem(d.kind, np.array([x, np.cross(z, x), z]), origin, d.place)


def _unit(vector: Floats, place: str) -> Floats:
    size = float(np.linalg.norm(vector))
    if not size > 0:
        refuse(f"whose three points lie on one line ({place})")
    return vector / size


def _rotation(axes: Floats, place: str) -> Floats:
    """Return the rotation nearest to axes that have few digits."""
    # Allowed deviation of products of axes from those of unit vectors: four digits are written at least
    if np.abs(axes @ axes.T - np.eye(3)).max() > 1e-3 or np.linalg.det(axes) < 0:
        refuse(f"whose axes are not three right-handed unit vectors at right angles ({place})")
    if np.array_equal(axes, np.eye(3)):
        return axes
    u, _, v = np.linalg.svd(axes)
    return u @ v


def _of_2420(block: UffBlock) -> Iterator[tuple[int, _Definition]]:
    record = 3  # after the type, the part's number and its name
    while record < block.n_lines:
        if not block.lines[record].strip():
            record += 1
            continue
        number, kind = (integer(block, record, text) for text in _leading(text_at(block, record), 10, 2))
        rows = []
        for k in range(record + 2, record + 6):
            text_at(block, k)
            rows.append([real(block, k, text) for text in cells(block, k, (25, 25, 25))])
        place = f"dataset {block.kind}, {block.at(record)}"
        yield number, _Definition(kind, np.array(rows), None, 0, place)
        record += 6


def _of_18(block: UffBlock) -> Iterator[tuple[int, _Definition]]:
    record = 1
    while record < block.n_lines:
        if not block.lines[record].strip():
            record += 1
            continue
        number, kind, reference, _, method = (
            integer(block, record, text) for text in _leading(text_at(block, record), 10, 5)
        )
        values: list[float] = []
        for k, n in ((record + 2, 6), (record + 3, 3)):
            text_at(block, k)
            values += [real(block, k, text) for text in cells(block, k, (13,) * n)]
        place = f"dataset {block.kind}, {block.at(record)}"
        yield number, _Definition(kind, np.array(values).reshape(3, 3), reference, method, place)
        record += 4


def _leading(line: str, width: int, count: int) -> list[str]:
    """Return the first columns of a line, by blanks or by width."""
    words = line.split()
    if len(words) >= count and all(len(word) < width for word in words):
        return words[:count]
    return [line[k * width : (k + 1) * width] for k in range(count)]


# ------------------------------------------------------------------------------------------------------------


PATTERNS: dict[int, tuple[tuple[int, ...], ...]] = {
    15: ((10, 10, 10, 10, 13, 13, 13),),
    781: ((10,) * 4, (25,) * 3),
    2411: ((10,) * 4, (25,) * 3),
}
"""Columns of the lines of a node: label, definition system, displacement system, colour, coordinates."""


@dataclass(slots=True, eq=False)
class UffNodes:
    """The nodes of a file as its datasets have them."""

    systems: UffSystems
    blocks: list[tuple[UffBlock, Ints, Floats]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    _turned: dict[int, int] = field(default_factory=dict)
    _at: dict[int, Floats] = field(default_factory=dict)
    _axes: dict[int, Floats] = field(default_factory=dict)

    def add(self, block: UffBlock) -> None:
        """Take the nodes of a dataset in."""
        pattern = PATTERNS[block.kind]
        values = records(block, pattern)
        if not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
            place = line_of(block, row, len(pattern))
            refuse(f"node {values[row, 0]:g} at {place} has a coordinate that is not a finite number")
        self.blocks.append((block, integer_columns(block, values, (0, 1, 2), len(pattern)), values[:, 4:]))

    def points(self, length: float) -> Points | None:
        """Return all nodes in global coordinates [m], each once; ``length`` is file units a metre.

        Raises
        ------
        ValueError
            If a number has two positions, or a system is not defined.
        """
        if not self.blocks:
            return None
        numbers = np.concatenate([integers for _, integers, _ in self.blocks])
        labels = numbers[:, 0]
        xyz = np.concatenate([xyz for _, _, xyz in self.blocks])
        self._place(numbers, xyz)
        order = np.argsort(labels, kind="stable")
        again = np.zeros(labels.size, dtype=bool)
        again[order[1:]] = labels[order[1:]] == labels[order[:-1]]
        if again.any():
            self._check_repeated(numbers, xyz, order, again)
        kept = ~again
        self._remember_turned(numbers[kept], xyz[kept])
        return Points(labels[kept], xyz[kept] / length)

    def _place(self, numbers: Ints, xyz: Floats) -> None:
        """Turn positions in local systems into global ones, in place."""
        for number in np.unique(numbers[:, 1]).tolist():
            rows = np.flatnonzero(numbers[:, 1] == number)
            try:
                system = self.systems.get(number)
            except ValueError as reason:
                node = f"node {numbers[rows[0], 0]} at {self._line(rows[0])}"
                msg = f"{node} refers to coordinate system {number}, {reason}"
                raise ValueError(msg) from None
            if not system.is_global:
                xyz[rows] = system.to_global(xyz[rows])
                angles = "; its angles are in degrees" if system.kind else ""
                self.notes.append(
                    f"the positions of {rows.size} node{'s' if rows.size > 1 else ''} in coordinate system "
                    f"{number} ({system.place}) are turned into global ones{angles}"
                )

    def _check_repeated(self, numbers: Ints, xyz: Floats, order: Ints, again: Bools) -> None:
        """Refuse a node number with two positions; the same node twice does no harm."""
        sized = max(1e-300, float(np.abs(xyz).max()))
        first = np.maximum.accumulate(np.where(again[order], 0, np.arange(order.size)))
        a, b = order[first], order
        other = (np.abs(xyz[a] - xyz[b]) > 1e-6 * sized).any(axis=1) | (numbers[a, 2] != numbers[b, 2])
        if other.any():
            rows = b[other]
            k = int(np.argmin(rows))
            one, two = int(a[other][k]), int(rows[k])
            what = "displacement systems" if np.allclose(xyz[one], xyz[two]) else "positions"
            more = f", and {int(other.sum()) - 1} more nodes likewise" if other.sum() > 1 else ""
            refuse(
                f"node {numbers[one, 0]} is defined at {self._line(one)} and at {self._line(two)} with two "
                f"{what}, {_triple(xyz[one])} and {_triple(xyz[two])}{more}; each node needs another number"
            )

    def _line(self, row: int) -> str:
        for block, integers, _ in self.blocks:
            if row < len(integers):
                return line_of(block, int(row), len(PATTERNS[block.kind]))
            row -= len(integers)
        return "an unknown line"

    def _remember_turned(self, numbers: Ints, xyz: Floats) -> None:
        turned = [k for k in np.unique(numbers[:, 2]).tolist() if k not in GLOBAL_NUMBERS or self._defines(k)]
        rows = np.flatnonzero(np.isin(numbers[:, 2], turned))
        self._turned = dict(zip(numbers[rows, 0].tolist(), numbers[rows, 2].tolist(), strict=True))
        self._at = dict(zip(numbers[rows, 0].tolist(), xyz[rows], strict=True))

    def _defines(self, number: int) -> bool:
        try:
            system = self.systems.get(number)
        except ValueError:
            return True
        return not (system.kind == CARTESIAN and np.array_equal(system.axes, np.eye(3)))

    def axes(self, node: int) -> Floats | None:
        """Return the directions of a node's displacements, a row each; None if they are the global ones.

        Raises
        ------
        ValueError
            If its system is not defined or has no directions there.
        """
        number = self._turned.get(node)
        if number is None:
            return None
        if node not in self._axes:
            try:
                self._axes[node] = self.systems.get(number).directions_at(self._at[node])
            except ValueError as reason:
                msg = f"the displacements of node {node} are in coordinate system {number}, {reason}"
                raise ValueError(msg) from None
        return self._axes[node]

    @property
    def any_turned(self) -> bool:
        """Whether displacements of a node are in a local system."""
        return bool(self._turned)

    def global_label(self, label: str) -> str | None:
        """Return the label of a degree of freedom in global axes; None if it is along none of them."""
        node, direction = parse_label(label)
        axes = self.axes(node) if direction else None
        if axes is None:
            return label
        vector = axes[(abs(direction) - 1) % 3]
        k = int(np.argmax(np.abs(vector)))
        # Components by which a direction may miss a global axis and count as along it: angles of 0.006
        # degrees
        if np.abs(np.delete(vector, k)).max() > 1e-4:
            return None
        turned = (k + 1 + (3 if abs(direction) > 3 else 0)) * int(np.sign(vector[k]))
        return label_of(node, turned * (1 if direction > 0 else -1))


def turn_shape(nodes: UffNodes, labels: Sequence[int], values: NDArray[Any]) -> int:
    """Turn displacements (n_nodes, 3 or 6) into global axes, in place; return of how many nodes."""
    count = 0
    for row, node in enumerate(labels):
        axes = nodes.axes(int(node))
        if axes is not None:
            count += 1
            for part in range(0, values.shape[1], 3):
                values[row, part : part + 3] = values[row, part : part + 3] @ axes
    return count


def _triple(xyz: Floats) -> str:
    return f"({', '.join(f'{x:.6g}' for x in xyz)})"
