"""Dataset 55: mode shapes at nodes, real and complex, with and without rotations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.io.uff_format import Block, UffError, label_of
from fem.io.uff_types import Units
from fem.modes import Modes


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """A mode shape as the file has it."""

    nodes: NDArray[np.int64]
    values: NDArray[Any]  # (n_nodes, 3 or 6)
    frequency: float
    zeta: float
    modal_mass: float
    place: str
    modal_a: complex = 0.0


def read_shape(block: Block) -> Shape | str:
    """Read a dataset 55: a shape, or why it is none."""
    if len(block.lines) < 9:
        msg = f"it has {len(block.lines)} lines, too few for its header"
        raise ValueError(msg)
    head = [_whole(block, 6, k) for k in range(6)]
    analysis, data_type, per_node = head[1], head[4], head[5]
    if analysis not in (2, 3, 7):
        return f"analysis type {analysis} holds no mode shapes (2, 3 and 7 do)"
    if data_type not in (2, 5) or per_node not in (3, 6):
        return (
            f"data type {data_type} with {per_node} values at each node; 2 or 5 (real, complex) and 3 or "
            "6 are read"
        )
    reals = [_number(block, 8, k, 13) for k in range(6 if analysis in (3, 7) else 4)]
    modal_a = 0j
    if analysis == 2:
        frequency, modal_mass, zeta = reals[0], reals[1], reals[2] or reals[3] / 2
    else:
        size = float(np.hypot(reals[0], reals[1]))
        frequency, modal_mass, zeta = size / (2 * np.pi), 0.0, -reals[0] / size if size else 0.0
        modal_a = complex(reals[2], reals[3])
    nodes, values = _nodal_values(block, per_node * (2 if data_type == 5 else 1))
    if data_type == 5:
        values = values[:, 0::2] + 1j * values[:, 1::2]
    return Shape(nodes, values, frequency, zeta, modal_mass, block.name, modal_a)


def _whole(block: Block, record: int, position: int) -> int:
    text = block.lines[record][10 * position : 10 * position + 10]
    try:
        return int(text)
    except ValueError:
        msg = f"line {block.line + 1 + record} has {text.strip()!r} where a whole number is expected"
        raise ValueError(msg) from None


def _number(block: Block, record: int, position: int, width: int) -> float:
    text = block.lines[record][width * position : width * (position + 1)].replace("D", "E").replace("d", "e")
    if not text.strip():
        return 0.0
    try:
        return float(text)
    except ValueError:
        msg = f"line {block.line + 1 + record} has {text.strip()!r} where a number is expected"
        raise ValueError(msg) from None


def _nodal_values(block: Block, count: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Read node numbers and the values that follow each, six to a line."""
    nodes: list[int] = []
    rows: list[list[float]] = []
    record = 9
    while record < len(block.lines):
        if not block.lines[record].strip():
            record += 1
            continue
        nodes.append(_whole(block, record, 0))
        record += 1
        row: list[float] = []
        while len(row) < count and record < len(block.lines):
            found = -(-len(block.lines[record]) // 13)
            row += [_number(block, record, k, 13) for k in range(min(found, count - len(row)))]
            record += 1
            if not found:
                break
        if len(row) < count:
            msg = f"node {nodes[-1]} has {len(row)} values of {count}"
            raise ValueError(msg)
        rows.append(row)
    if not rows:
        msg = "it has no nodes"
        raise ValueError(msg)
    values = np.array(rows)
    if not np.isfinite(values).all():
        msg = (
            f"node {nodes[int(np.argwhere(~np.isfinite(values))[0, 0])]} has a value that is not a finite "
            "number"
        )
        raise ValueError(msg)
    return np.array(nodes, dtype=np.int64), values


def shape_in_si(shape: Shape, units: Units) -> Shape:
    """Scale a shape to unit modal mass in kg where the file gives it, rotations to radians per metre.

    With a modal A = φᵀ(2λM + C)φ it is scaled to A = 2iω_d: unit modal mass where damping is
    proportional.
    """
    values = shape.values.copy()
    values[:, 3:] *= units.length
    if shape.modal_mass > 0:
        values /= np.sqrt(shape.modal_mass * units.mass)
    damped = 2 * np.pi * shape.frequency * np.sqrt(max(0.0, 1 - shape.zeta**2))
    if shape.modal_a and np.isfinite(shape.modal_a) and damped > 0 and np.iscomplexobj(values):
        values *= np.sqrt(2j * damped / (shape.modal_a * units.mass))
    return replace(shape, values=values)


def modes_of(shapes: Sequence[Shape], file: str) -> tuple[Modes, ...]:
    """Put shapes on the same nodes together."""
    groups: dict[tuple[Any, ...], list[Shape]] = {}
    for shape in shapes:
        groups.setdefault((shape.nodes.tobytes(), shape.values.shape[1]), []).append(shape)
    found: list[Modes] = []
    for group in groups.values():
        for shape in group:
            if not (np.isfinite(shape.frequency) and shape.frequency >= 0):
                msg = (
                    f"{file}: {shape.place}: natural frequency {shape.frequency} Hz; it must be a number "
                    "not below 0"
                )
                raise UffError(msg)
        group.sort(key=lambda s: s.frequency)
        frequency = np.array([s.frequency for s in group])
        zeta = np.array([s.zeta for s in group])
        nodes, width = group[0].nodes, group[0].values.shape[1]
        labels = tuple(label_of(int(node), d) for node in nodes for d in range(1, width + 1))
        phi = np.column_stack([s.values.ravel() for s in group])
        found.append(Modes(frequency, phi, zeta if zeta.any() else None, labels, int((frequency == 0).sum())))
    return tuple(found)
