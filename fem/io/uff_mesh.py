"""Datasets 15, 2411, 2412 and 82: points and lines as a mesh."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from fem.io.uff_format import UffError
from fem.io.uff_types import Element, Points, TraceLine
from fem.mesh import Mesh, MeshError

_LINE_ELEMENTS = (11, 21, 22, 23, 24)


def mesh_from(
    file: str, points: Points | None, elements: Sequence[Element], trace_lines: Sequence[TraceLine]
) -> Mesh:
    """Return beam and rod elements, or else trace lines, as a mesh; see :meth:`fem.io.uff.UffFile.mesh`."""
    if points is None:
        msg = f"{file}: no points (dataset 15 or 2411)"
        raise UffError(msg)
    beams = [e for e in elements if e.descriptor in _LINE_ELEMENTS]
    owner: dict[frozenset[int], str] = {}
    traced: list[tuple[int, int]] = []
    for name, trace in _named_apart(trace_lines):
        for pair in (pair for stroke in trace.strokes for pair in pairwise(stroke)):
            if frozenset(pair) not in owner:
                owner[frozenset(pair)] = name
                traced.append(pair)
    lines = [pair for e in beams for pair in pairwise(e.nodes)] or traced
    if not lines:
        msg = f"{file}: no lines; none of its {len(elements)} elements is a beam and there are no trace lines"
        raise UffError(msg)
    properties = [f"property {e.property}" for e in beams for _ in e.nodes[1:]]
    sets: dict[str, list[int]] = {name: [] for name in owner.values()}
    for row, pair in enumerate(lines):
        sets.setdefault(owner.get(frozenset(pair)) or properties[row], []).append(row)
    return _checked_mesh(file, points, lines, {name: rows for name, rows in sets.items() if rows})


def _named_apart(traces: Sequence[TraceLine]) -> list[tuple[str, TraceLine]]:
    """Tell trace lines of the same name apart by their numbers."""
    names = [t.name for t in traces]
    return [(t.name if names.count(t.name) == 1 else f"{t.name} {t.number}", t) for t in traces]


def _checked_mesh(
    file: str, points: Points, lines: Sequence[tuple[int, int]], sets: dict[str, list[int]]
) -> Mesh:
    row_of = {int(label): row for row, label in enumerate(points.labels)}
    missing = next((node for pair in lines for node in pair if node not in row_of), None)
    if missing is not None:
        msg = (
            f"{file}: a line refers to node {missing}, which is not among the {len(row_of)} points of the "
            "file"
        )
        raise UffError(msg)
    index = np.array([[row_of[a], row_of[b]] for a, b in lines])
    used, compact = np.unique(index, return_inverse=True)
    names = {str(int(points.labels[row])): k for k, row in enumerate(used)}
    try:
        return Mesh.from_lines(points.coordinates[used], compact.reshape(index.shape), sets, names)
    except MeshError as reason:
        msg = f"{file}: {reason}"
        raise MeshError(msg) from reason
