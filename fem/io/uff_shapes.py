"""Datasets 55 and 2414: mode shapes at nodes, real and complex, with and without rotations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.analysis.modes import Modes
from fem.array_types import Floats, Ints
from fem.io.faults import refuse
from fem.io.uff_format import UffBlock, UffError, label_of
from fem.io.uff_numbers import integer, number_of, real, text_at, tokens
from fem.io.uff_types import UffUnits

_VECTORS = (0, 2, 3)
"""Data characteristics that are motions: unknown, three components, six components."""


@dataclass(frozen=True, slots=True, eq=False)
class UffShape:
    """A mode shape as the file has it."""

    nodes: Ints
    values: NDArray[Any]  # (n_nodes, 3 or 6)
    frequency: float
    zeta: float
    modal_mass: float
    place: str
    modal_a: complex = 0.0
    number: int = 0

    @property
    def name(self) -> str:
        """Its number in the file, frequency and place, for messages."""
        return f"mode {self.number} at {self.frequency:.6g} Hz ({self.place})"


@dataclass(frozen=True, slots=True)
class _Header:
    """Common entries of the headers of datasets 55 and 2414."""

    analysis: int
    characteristic: int
    result: int
    data_type: int
    per_node: int
    frequency: float
    modal_mass: float
    viscous: float
    hysteretic: float
    eigenvalue: complex
    modal_a: complex
    number: int
    first: int  # line of the first node


def read_shape(block: UffBlock) -> UffShape | str:
    """Read a dataset 55 or 2414: a shape, or why it is none."""
    if len(block.lines) < 9:
        refuse(f"it has {len(block.lines)} lines, too few for its header")
    if block.kind == 2414 and (location := _integers(block, 3, 1)[0]) != 1:
        return f"its values are at location {location}, not at nodes (1)"
    head = _header_of_2414(block) if block.kind == 2414 else _header_of_55(block)
    if isinstance(head, str):
        return head
    if head.data_type not in (2, 4, 5, 6) or head.per_node not in (3, 6):
        return (
            f"data type {head.data_type} with {head.per_node} values at each node; 2 or 5 (real, complex) "
            "and 3 or 6 are read"
        )
    # Result types that are motions: unknown, general, displacement, velocity, acceleration
    if head.result not in (0, 1, 8, 11, 12) or head.characteristic not in _VECTORS:
        return (
            f"result type {head.result} with data characteristic {head.characteristic} is no mode shape; "
            "motions have 8, 11 or 12 and 2 or 3"
        )
    is_complex = head.data_type in (5, 6)
    nodes, values = _nodal_values(block, head.per_node * (2 if is_complex else 1), head.first)
    if is_complex:
        values = values[:, 0::2] + 1j * values[:, 1::2]
    if head.analysis == 2:
        frequency, zeta = head.frequency, head.viscous or head.hysteretic / 2
        return UffShape(nodes, values, frequency, zeta, head.modal_mass, block.name, 0j, head.number)
    size = abs(head.eigenvalue)
    zeta = -head.eigenvalue.real / size if size else 0.0
    return UffShape(nodes, values, size / (2 * np.pi), zeta, 0.0, block.name, head.modal_a, head.number)


def _integers(block: UffBlock, record: int, count: int) -> list[int]:
    line = text_at(block, record)
    return [integer(block, record, line[10 * k : 10 * k + 10]) for k in range(count)]


def _reals(block: UffBlock, record: int, count: int) -> list[float]:
    line = text_at(block, record)
    words = line.split()
    if all(number_of(word) is not None and len(word) <= 13 for word in words):
        return [*(real(block, record, word) for word in words), *[0.0] * count][:count]
    return [real(block, record, line[13 * k : 13 * k + 13]) for k in range(count)]


def _header_of_55(block: UffBlock) -> _Header | str:
    _, analysis, characteristic, result, data_type, per_node = _integers(block, 6, 6)
    if other := _without_shapes(analysis):
        return other
    kind = analysis, characteristic, result, data_type, per_node
    number = _integers(block, 7, 4)[3]
    f, mass, viscous, hysteretic, *_ = reals = _reals(block, 8, 6)
    pole = complex(*reals[:2]), complex(*reals[2:4])
    return _Header(*kind, f, mass, viscous, hysteretic, *pole, number, 9)


def _header_of_2414(block: UffBlock) -> _Header | str:
    _, analysis, characteristic, result, data_type, per_node = _integers(block, 9, 6)
    if other := _without_shapes(analysis):
        return other
    kind = analysis, characteristic, result, data_type, per_node
    number = _integers(block, 10, 6)[5]
    _, f, eigenvalue, mass, viscous, hysteretic = _reals(block, 12, 6)
    more = _reals(block, 13, 6)
    if not f and eigenvalue > 0:
        f = float(np.sqrt(eigenvalue)) / (2 * np.pi)
    pole = complex(*more[:2]), complex(*more[2:4])
    return _Header(*kind, f, mass, viscous, hysteretic, *pole, number, 14)


def _without_shapes(analysis: int) -> str:
    """Return why an analysis holds no mode shapes; nothing for one that does."""
    return "" if analysis in (2, 3, 7) else f"analysis type {analysis} holds no mode shapes (2, 3 and 7 do)"


def _nodal_values(block: UffBlock, count: int, first: int) -> tuple[Ints, Floats]:
    """Read node numbers and the values that follow each, six to a line."""
    found = tokens(block, first)
    if found is not None and found.count.size and found.values.size % (1 + count) == 0:
        heads = np.searchsorted(found.start, np.arange(0, found.values.size, 1 + count))
        heads = np.minimum(heads, found.start.size - 1)
        table = found.values.reshape(-1, 1 + count)
        label = table[:, 0]
        alone = (found.start[heads] == np.arange(len(label)) * (1 + count)) & (found.count[heads] == 1)
        if alone.all() and np.isfinite(table).all() and (label == np.floor(label)).all():
            nodes, values = label.astype(np.int64), table[:, 1:]
        else:
            nodes, values = _nodal_values_by_width(block, count, first)
    else:
        nodes, values = _nodal_values_by_width(block, count, first)
    labels, counts = np.unique(nodes, return_counts=True)
    if (counts > 1).any():
        node = int(labels[counts > 1][0])
        same = values[nodes == node]
        if not (same == same[0]).all():
            refuse(f"node {node} has values in it {len(same)} times, and they differ")
        _, kept = np.unique(nodes, return_index=True)
        kept.sort()
        nodes, values = nodes[kept], values[kept]
    return nodes, values


def _nodal_values_by_width(block: UffBlock, count: int, first: int) -> tuple[Ints, Floats]:
    nodes: list[int] = []
    rows: list[list[float]] = []
    record = first
    while record < len(block.lines):
        if not block.lines[record].strip():
            record += 1
            continue
        nodes.append(integer(block, record, block.lines[record][:10]))
        record += 1
        row: list[float] = []
        while len(row) < count and record < len(block.lines):
            found = -(-len(block.lines[record]) // 13)
            row += _reals(block, record, min(found, count - len(row)))
            record += 1
            if not found:
                break
        if len(row) < count:
            refuse(f"node {nodes[-1]} has {len(row)} value(s), and {count} are expected")
        rows.append(row)
    if not rows:
        refuse("it has no nodes")
    return np.array(nodes, dtype=np.int64), np.array(rows)


def shape_in_si(shape: UffShape, units: UffUnits) -> UffShape:
    """Scale a shape to unit modal mass in kg where the file gives it, rotations to radians per metre.

    With a modal A = φᵀ(2λM + C)φ it is scaled to A = 2iω_d: unit modal mass where damping is
    proportional.
    """
    values = shape.values.copy()
    values[:, 3:] *= units.length
    if shape.modal_mass > 0:
        values /= np.sqrt(shape.modal_mass * units.mass)
    damped = 2 * np.pi * shape.frequency * np.sqrt(max(0.0, 1 - min(abs(shape.zeta), 1.0) ** 2))
    if shape.modal_a and np.isfinite(shape.modal_a) and damped > 0 and np.iscomplexobj(values):
        values *= np.sqrt(2j * damped / (shape.modal_a * units.mass))
    return replace(shape, values=values)


def modes_of(shapes: Sequence[UffShape], file: str) -> tuple[tuple[Modes, ...], list[str]]:
    """Put shapes together by their nodes; return notes on them, too.

    A node that one of them lacks is a gap of that one: NaN. Shapes are of one test, and make one group, where
    each shares half of its nodes or more with another of them.
    """
    notes: list[str] = []
    groups: dict[int, list[UffShape]] = {}
    numbers = [shape.number for shape in shapes]
    if min(numbers, default=1) < 1 or len(set(numbers)) < len(numbers):  # then they stand for something else
        shapes = [replace(shape, number=k) for k, shape in enumerate(shapes, start=1)]
    for shape in shapes:
        _check(shape, file)
        groups.setdefault(shape.values.shape[1], []).append(shape)
    found: list[Modes] = []
    for group in groups.values():
        for part in _of_one_test(group):
            found.append(_modes(_on_all_nodes(_once(part, notes), notes)))
    return tuple(found), notes


def _check(shape: UffShape, file: str) -> None:
    if not (np.isfinite(shape.frequency) and shape.frequency >= 0):
        msg = (
            f"{file}: {shape.place}: natural frequency {shape.frequency} Hz; it must be a number not below 0"
        )
        raise UffError(msg)
    if not shape.values.any():
        n = len(shape.nodes)
        msg = (
            f"{file}: {shape.name} is zero at {'all ' if n > 1 else ''}{n} node{'s' if n > 1 else ''} "
            f"(first: node {shape.nodes[0]}); a mode shape needs at least one component that is not zero: "
            "delete this mode"
        )
        raise UffError(msg)


def _of_one_test(shapes: list[UffShape]) -> list[list[UffShape]]:
    """Return shapes in groups that are connected by sharing half of two shapes' nodes or more."""
    groups: list[tuple[list[frozenset[int]], list[UffShape]]] = []
    for shape in shapes:
        nodes = frozenset(shape.nodes.tolist())
        near = [g for g in groups if any(2 * len(nodes & other) >= len(nodes | other) for other in g[0])]
        sets = list(dict.fromkeys([*(one for g in near for one in g[0]), nodes]))
        joined = sets, [*(one for g in near for one in g[1]), shape]
        groups = [*(g for g in groups if g not in near), joined]
    return [group for _, group in groups]


def _once(shapes: list[UffShape], notes: list[str]) -> list[UffShape]:
    """Leave out shapes that come again with the same frequency and values."""
    kept: list[UffShape] = []
    for shape in shapes:
        same = next(
            (
                s
                for s in kept
                if s.frequency == shape.frequency
                and np.array_equal(s.nodes, shape.nodes)
                and np.array_equal(s.values, shape.values)
            ),
            None,
        )
        if same is None:
            kept.append(shape)
        else:
            notes.append(f"{shape.name} comes again as it is in {same.place} and counts once")
    return kept


def _on_all_nodes(shapes: list[UffShape], notes: list[str]) -> list[UffShape]:
    """Give all shapes the nodes that any of them has, in the order of the first; NaN is a gap, and named."""
    order = list(dict.fromkeys(node for shape in shapes for node in shape.nodes.tolist()))
    row_of = {node: row for row, node in enumerate(order)}
    nodes = np.array(order, dtype=np.int64)
    out: list[UffShape] = []
    lacking: dict[tuple[int, ...], list[UffShape]] = {}
    for shape in shapes:
        values = np.full((len(order), shape.values.shape[1]), np.nan, dtype=shape.values.dtype)
        values[[row_of[node] for node in shape.nodes.tolist()]] = shape.values
        out.append(replace(shape, nodes=nodes, values=values))
        if gaps := sorted(row_of.keys() - set(shape.nodes.tolist())):
            lacking.setdefault(tuple(gaps), []).append(shape)
    for gaps, who in lacking.items():
        names = f"{', '.join(map(str, gaps[:5]))}{f' and {len(gaps) - 5} more' if len(gaps) > 5 else ''}"
        one, several = len(who) == 1, len(gaps) > 1
        others = f" and {'mode' if len(who) == 2 else 'modes'} {', '.join(str(s.number) for s in who[1:6])}"
        more = f" and {len(who) - 6} more" if len(who) > 6 else ""
        notes.append(
            f"{who[0].name}{'' if one else others}{more} {'has' if one else 'have'} no values at "
            f"node{'s' if several else ''} {names}, which {'are' if several else 'is'} left out of "
            f"{'this mode' if one else 'these modes'} alone"
        )
    return out


def _modes(shapes: list[UffShape]) -> Modes:
    shapes = sorted(shapes, key=lambda s: s.frequency)
    frequency = np.array([s.frequency for s in shapes])
    zeta = np.array([s.zeta for s in shapes])
    nodes, width = shapes[0].nodes, shapes[0].values.shape[1]
    labels = tuple(label_of(int(node), d) for node in nodes for d in range(1, width + 1))
    phi = np.column_stack([s.values.ravel() for s in shapes])
    return Modes(frequency, phi, zeta if zeta.any() else None, labels, int((frequency == 0).sum()))
