"""Dataset 58: functions, and the FRF matrices that they make up."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRF, WITHOUT_PHASE, FRFError, FRFKind
from fem.array_types import Floats
from fem.io.faults import error_at, refuse
from fem.io.frf_labels import matrix_of
from fem.io.uff_format import UffBlock, UffError, label_of, parse_label
from fem.io.uff_nodes import UffNodes
from fem.io.uff_numbers import integer, integer_of, number_of, real, text_at, tokens
from fem.io.uff_types import MOTIONS, Function
from fem.io.uff_units import FREQUENCY, TIME, abscissa_factor

FRF_TYPES = 4, 5
"""Function types of a frequency response function, and of a transmissibility."""

_ENDS = ((0, 5), (5, 15), (15, 20), (20, 30)), ((31, 41), (41, 51), (51, 55)), ((56, 66), (66, 76), (76, 80))
"""Columns of record 6: type, number, version, load case; name, node, direction of response and of force."""


def text_of(value: str) -> str:
    """Return a text field; empty for NONE."""
    text = value.strip()
    return "" if text.upper() == "NONE" else text


@dataclass(frozen=True, slots=True)
class _End:
    """A degree of freedom of record 6."""

    name: str
    node: int
    direction: int


def function_of(block: UffBlock) -> tuple[Function, list[str]]:
    """Return the record of a dataset 58, abscissa in Hz or s, and notes on it.

    Raises
    ------
    ValueError
        With the line of the file, where the header or a value is damaged.
    """
    notes: list[str] = []
    numbers, ends = _degrees_of_freedom(block, notes)
    labels = []
    for end in ends:
        try:
            labels.append(label_of(end.node, end.direction))
        except UffError as reason:
            msg = f"{block.at(6)}: {reason}"
            raise ValueError(msg) from None
    axes = [_axis(block, record) for record in (8, 9, 10)]
    x, values = _ordinates(block, notes)
    factor, note, _ = abscissa_factor(axes[0][0], axes[0][1])
    notes += [note] if note and numbers[0] in FRF_TYPES else []
    x_unit = axes[0][1]
    if factor != 1.0:
        x_unit = "s" if axes[0][0] == TIME else "Hz"
        notes.append(f"an abscissa in '{axes[0][1]}' is converted to {x_unit}")
    function = Function(
        numbers[0],
        labels[0],
        labels[1],
        text_of(ends[0].name),
        text_of(ends[1].name),
        factor * x,
        values,
        axes[0][0],
        axes[1][0],
        axes[2][0],
        x_unit,
        axes[1][1],
        axes[2][1],
        tuple(text_at(block, k) for k in range(1, 6)),
        numbers[3],
        numbers[2],
        block.name,
        axes[0][1],
    )
    return function, notes


def _degrees_of_freedom(block: UffBlock, notes: list[str]) -> tuple[list[int], tuple[_End, _End]]:
    """Read record 6, by its columns, or by its blanks where a long name has shifted them.

    Columns are trusted where each integer ends with its column and nothing is between them.
    """
    line = text_at(block, 6)
    parts = [[line[a:b].ljust(b - a) for a, b in part] for part in _ENDS]
    columns = [*parts[0], *(text for part in parts[1:] if "".join(part).strip() for text in part[1:])]
    blank = not line[80:].strip() and all(not line[k : k + 1].strip() for k in (30, 55))
    if blank and all(text[-1:].strip() and integer_of(text) is not None for text in columns):
        found = [_End(name.strip(), *(integer(block, 6, t) for t in texts)) for name, *texts in parts[1:]]
        return [integer(block, 6, text) for text in parts[0]], (found[0], found[1])
    words = line.split()
    integers = [integer_of(words[k]) if k < len(words) else None for k in (0, 1, 2, 3, 5, 6, 8, 9)]
    if len(words) != 10 or None in integers:
        refuse(
            f"{block.at(6)} does not have response and reference in the columns of the format: a name of "
            "more than 10 characters shifts node and direction; shorten it, or leave out its blanks"
        )
    numbers = [k for k in integers if k is not None]
    notes.append(
        "names of more than 10 characters shift the columns of response and reference, which are "
        "therefore split at blanks"
    )
    return numbers[:4], (_End(words[4], *numbers[4:6]), _End(words[7], *numbers[6:8]))


def _axis(block: UffBlock, record: int) -> tuple[int, str]:
    """Return the specific data type of an axis and the label of its unit."""
    line = text_at(block, record)
    kind = integer(block, record, line[:10])
    if line[46:47].strip():  # a long label of the axis shifts that of the unit
        parts = re.split(r" {2,}", line[26:].strip())
        return kind, text_of(parts[-1]) if len(parts) > 1 else ""
    return kind, text_of(line[47:])


def _ordinates(block: UffBlock, notes: list[str]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return abscissa and ordinate, as many as the header announces."""
    line = text_at(block, 7)
    kind, n, even = (integer(block, 7, line[k : k + 10]) for k in (0, 10, 20))
    start, step = (real(block, 7, line[k : k + 13]) for k in (30, 43))
    if kind not in (2, 4, 5, 6) or n < 0 or even not in (0, 1):
        refuse(
            f"{block.at(7)}: ordinate type {kind}, {n} values, spacing {even}; 2, 4, 5 or 6, none or more, "
            "and 0 or 1 are allowed"
        )
    text_at(block, 11)
    parts = 2 if kind in (5, 6) else 1
    if block.values is not None:
        y = block.values["y"].astype(float)
        stored = None if even else block.values["x"].astype(float)
    else:
        table = _values(block, n, parts + (not even), kind in (4, 6), bool(even), notes)
        y = table[:, -parts:]
        stored = None if even else table[:, 0]
    values = y[:, 0] + 1j * y[:, 1] if parts == 2 else y[:, 0]
    return start + np.arange(n) * step if stored is None else stored, values


def _values(block: UffBlock, n: int, columns: int, double: bool, even: bool, notes: list[str]) -> Floats:
    """Return the values of a dataset in text form, shape (n, columns)."""
    found = tokens(block, 12)
    values = None if found is None else found.values
    if values is None:  # numbers touch, or columns are empty
        widths = (20,) if double else (13,)
        if double and not even:
            widths = (13,) + (20,) * (columns - 1)
        values = np.array([x for k in range(12, block.n_lines) for x in _columns(block, k, widths)])
    if values.size < n * columns:
        refuse(f"it announces {n} values and has {values.size // columns}")
    if values.size >= (n + 1) * columns:
        notes.append(f"it announces {n} values and has {values.size // columns}; those beyond are left out")
    return values[: n * columns].reshape(n, columns)


def _columns(block: UffBlock, record: int, widths: Sequence[int]) -> Iterator[float]:
    """Yield the numbers of a line: between blanks where all are numbers, else by their widths in turn."""
    line = block.lines[record]
    words = line.split()
    if all(number_of(word) is not None for word in words):
        yield from (real(block, record, word) for word in words)
        return
    at = k = 0
    while at < len(line):
        width = widths[k % len(widths)]
        yield real(block, record, line[at : at + width])
        at, k = at + width, k + 1


def frf_refusal(function: Function, kind: FRFKind | None) -> str:
    """Say why a record cannot be used as an FRF; empty if it can."""
    if not np.iscomplexobj(function.values):
        return f"its values are real: {WITHOUT_PHASE}"
    if not function.x.size:
        return "it has no values"
    if function.x_type not in (0, 1, FREQUENCY):
        return f"its abscissa has data type {function.x_type}, not {FREQUENCY} (frequency)"
    if fault := abscissa_factor(function.x_type, function.x_unit)[2]:
        return fault
    if function.of_motion and function.ordinate_type not in MOTIONS:
        return (
            f"its data types are {function.ordinate_type} over {function.denominator_type}, a motion; the "
            "numerator must be a motion, too, of type 8, 11 or 12"
        )
    if kind is None:
        return (
            f"its data types {function.ordinate_type} and {function.denominator_type} do not say "
            "whether it is a receptance, mobility or accelerance; give kind=…"
        )
    return ""


# Directions -------------------------------------------------------------------------------------------------

Record = tuple[Function, FRFKind]


def turned_records(records: Sequence[Record], nodes: UffNodes) -> tuple[list[Record], list[str], int]:
    """Return FRFs along the global axes, a line for each that cannot be turned, and the number turned.

    Directions of a node are those of its displacement system. Along a global axis a record has another label;
    records along all slanted axes of a node, two or three, make as many along the global ones. Others have no
    label.
    """
    lost: list[str] = []
    n_turned = 0
    out = list(records)
    for end in ("response", "reference"):
        kept: list[Record] = []
        slanted: dict[tuple[Any, ...], dict[int, Record]] = {}
        for function, kind in out:
            label = getattr(function, end)
            if end == "response" and function.is_strain:  # the strain along an axis is no component
                kept.append((function, kind))
                continue
            new = nodes.global_label(label)
            if new is not None:
                n_turned += new != label
                kept.append((replace(function, **{end: new}), kind))
                continue
            node, direction = parse_label(label)
            other = function.reference if end == "response" else function.response
            part = (abs(direction) - 1) // 3
            key = (node, part, other, kind, function.load_case, function.version, function.x.tobytes())
            triple = slanted.setdefault(key, {})
            if (abs(direction) - 1) % 3 in triple:
                lost.append(f"{function.place}: FRF {function.response}/{function.reference}: it comes twice")
                continue
            triple[(abs(direction) - 1) % 3] = function, kind
        for found in slanted.values():
            combined = _combined(found, end, nodes)
            n_turned += len(combined)
            kept += combined
            lost += [
                f"{f.place}: FRF {f.response}/{f.reference}: the displacement system of node "
                f"{parse_label(getattr(f, end))[0]} has this direction along no global axis, and there are "
                "no FRFs in all of its directions"
                for f, _ in found.values()
                if not combined
            ]
        out = kept
    return out, lost, n_turned


def _combined(found: dict[int, Record], end: str, nodes: UffNodes) -> list[Record]:
    """Return records along the global axes from those along all slanted axes of a node; none of fewer."""
    node, direction = parse_label(getattr(next(iter(found.values()))[0], end))
    first = 4 if abs(direction) > 3 else 1
    axes = nodes.axes(node)
    straight = [nodes.global_label(label_of(node, first + k)) for k in range(3)]
    slanted = [k for k in range(3) if straight[k] is None]
    if axes is None or sorted(found) != slanted:
        return []
    taken = {abs(parse_label(label)[1]) - first for label in straight if label is not None}
    signs = [np.sign(parse_label(getattr(found[k][0], end))[1]) for k in slanted]
    local = np.stack([s * found[k][0].values for s, k in zip(signs, slanted, strict=True)])
    return [
        (
            replace(found[k][0], values=axes[slanted, g] @ local, **{end: label_of(node, first + g)}),
            found[k][1],
        )
        for k, g in zip(slanted, (g for g in range(3) if g not in taken), strict=True)
    ]


# Matrices ---------------------------------------------------------------------------------------------------


class _Group:
    """Records of one matrix: the same kind, frequencies, load case and unit labels, each cell once."""

    def __init__(self, kind: FRFKind, first: Function, again: bool) -> None:
        self.kind, self.first, self.again = kind, first, again
        self.cells: dict[tuple[str, str], Function] = {}
        self.labels: dict[tuple[str, bool], str] = {}

    def alike(self, function: Function, kind: FRFKind) -> bool:
        """Tell whether a record is of this matrix; rotations have another unit label."""
        return (
            kind == self.kind
            and function.load_case == self.first.load_case
            and np.array_equal(function.x, self.first.x)
            and all(self.labels.get(key, label) == label for key, label in _unit_labels(function).items())
        )

    def add(self, function: Function) -> None:
        self.cells[function.response, function.reference] = function
        self.labels |= _unit_labels(function)


def _unit_labels(function: Function) -> dict[tuple[str, bool], str]:
    """Return the unit labels that records of one matrix share; strains join motions whatever theirs is."""
    moment = abs(parse_label(function.reference)[1]) > 3
    force = {("force", moment): function.denominator_unit.lower()}
    if function.is_strain:
        return force
    return force | {("response", abs(parse_label(function.response)[1]) > 3): function.unit.lower()}


@dataclass(frozen=True, slots=True, eq=False)
class FRFGroups:
    """FRF matrices of a file.

    Attributes
    ----------
    frfs : list of FRF
    units : list of (str, str), unit labels of response and force
    axes : list of tuple of str, unit labels of the abscissa
    runs : list of str
        Label that tells a matrix from others, such as ``"load case 2"``; empty where nothing does.
    notes : list of str, records that came twice with other values, holes, and load cases
    left_out : list of str, records that came twice with the same values
    names : (dict, dict), entity names of response and force by their labels, where all records agree
    """

    frfs: list[FRF] = field(default_factory=list)
    units: list[tuple[str, str]] = field(default_factory=list)
    axes: list[tuple[str, ...]] = field(default_factory=list)
    runs: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    names: tuple[dict[str, str], dict[str, str]] = ({}, {})


def frf_groups(records: Sequence[Record], file: str) -> FRFGroups:
    """Put records together to matrices."""
    groups: list[_Group] = []
    twice = _Twice()
    records = _strains_apart(records)
    out = FRFGroups(names=_entity_names(records))
    for function, kind in records:
        alike = [g for g in groups if g.alike(function, kind)]
        cell = function.response, function.reference
        known = [g.cells[cell] for g in alike if cell in g.cells]
        if any(np.array_equal(function.values, one.values) for one in known):
            twice.equal.append(function)
            continue
        group = next((g for g in alike if cell not in g.cells), None)
        if known:
            twice.other.append((known[0], function))
        if group is None:
            group = _Group(kind, function, bool(known))
            groups.append(group)
        group.add(function)
    out.notes.extend(twice.with_other_values())
    out.left_out.extend(twice.with_the_same())
    cases = list(dict.fromkeys(g.first.load_case for g in groups))
    if len(cases) > 1:
        out.notes.append(
            f"FRFs of {len(cases)} load cases ({', '.join(map(str, cases))}) are separate matrices, "
            f"load case {cases[0]} from {groups[0].first.place} on"
        )
    for group in groups:
        _add_parts(out, group, f"load case {group.first.load_case}" if len(cases) > 1 else "", file)
    return out


def _entity_names(records: Sequence[Record]) -> tuple[dict[str, str], dict[str, str]]:
    """Return the entity names of response and force by their labels, but those that differ."""
    found: tuple[dict[str, set[str]], dict[str, set[str]]] = ({}, {})
    for f, _ in records:
        found[0].setdefault(f.response, set()).add(f.response_name)
        found[1].setdefault(f.reference, set()).add(f.reference_name)
    outputs, inputs = (
        {label: next(iter(names)) for label, names in part.items() if len(names) == 1 and names != {""}}
        for part in found
    )
    return outputs, inputs


def _strains_apart(records: Sequence[Record]) -> list[Record]:
    """Return records with another label of strains whose degree of freedom has a motion as well."""
    motions = {f.response for f, _ in records if not f.is_strain}
    return [
        (replace(f, response=f"{f.response} strain") if f.is_strain and f.response in motions else f, kind)
        for f, kind in records
    ]


@dataclass(slots=True, eq=False)
class _Twice:
    """Records that are repeated: with the same values, and with other ones than the first of them."""

    equal: list[Function] = field(default_factory=list)
    other: list[tuple[Function, Function]] = field(default_factory=list)

    def with_the_same(self) -> Iterator[str]:
        """Yield a note on records that come again with the same values."""
        if self.equal:
            f = self.equal[0]
            more = f", and {len(self.equal) - 1} more" if len(self.equal) > 1 else ""
            yield (
                f"{f.place}: FRF {f.response}/{f.reference}{more}: it comes again with the same values and "
                "counts once"
            )

    def with_other_values(self) -> Iterator[str]:
        """Yield notes on records that come again with other values."""
        if not self.other:
            return
        was, now = self.other[0]
        name = f", whose entity is '{now.response_name}'" if now.response_name != was.response_name else ""
        n = len(self.other)
        yield (
            f"FRF {now.response}/{now.reference} of {was.place} comes again with other values in "
            f"{now.place}{name}"
            + (f", and {n - 1} more FRFs likewise" if n > 1 else "")
            + f"; {'they are' if n > 1 else 'it is'} kept as a separate matrix, like that of a second "
            "run: delete one of the records if there was no second run"
        )


def _add_parts(out: FRFGroups, group: _Group, run: str, file: str) -> None:
    cells = group.cells
    parts = _complete_parts(cells)
    if len(parts) > 1:
        out.notes.append(_holes(cells, len(parts)))
    for outputs, inputs in parts:
        first = cells[outputs[0], inputs[0]]
        H = np.stack([np.stack([cells[o, i].values for i in inputs], -1) for o in outputs], 1)
        try:
            base = [i for i in inputs if any(cells[o, i].of_motion for o in outputs)]
            strain = [o for o in outputs if any(cells[o, i].is_strain for i in inputs)]
            frf = FRF.from_arrays(first.x, H, group.kind, outputs, inputs, base, strain)
        except FRFError as reason:
            raise error_at(file, f"FRFs from {first.place} on: {reason}", UffError) from reason
        out.frfs.append(frf)
        out.units.append((first.unit, first.denominator_unit))
        labels = (cells[o, i].x_label for i in inputs for o in outputs)
        out.axes.append(tuple(label for label in dict.fromkeys(labels) if label))
        out.runs.append(", ".join(word for word in (run, "repeated records" if group.again else "") if word))


def _complete_parts(cells: dict[tuple[str, str], Function]) -> list[tuple[list[str], list[str]]]:
    """Group the columns of a matrix that have the same rows."""
    rows: dict[str, list[str]] = {}
    for output, reference in cells:
        rows.setdefault(reference, []).append(output)
    parts: dict[frozenset[str], tuple[list[str], list[str]]] = {}
    for reference, outputs in rows.items():
        parts.setdefault(frozenset(outputs), (outputs, []))[1].append(reference)
    return list(parts.values())


def _holes(cells: dict[tuple[str, str], Function], n_parts: int) -> str:
    outputs, inputs, holes = matrix_of(cells)
    more = f" and {len(holes) - 5} more" if len(holes) > 5 else ""
    return (
        f"the FRF matrix of {len(outputs)} responses and {len(inputs)} forces lacks "
        f"{', '.join(holes[:5])}{more}; it is given as {n_parts} complete matrices"
    )
