"""Datasets 15, 781 and 2411: nodes, their positions, and the directions of their displacements."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Bools, Floats, Ints
from fem.io.faults import refuse
from fem.io.uff_format import UffBlock, label_of, parse_label
from fem.io.uff_numbers import integer_columns, line_of, records
from fem.io.uff_systems import CARTESIAN, GLOBAL_NUMBERS, UffSystems
from fem.io.uff_types import Points

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
