"""Dataset 58: functions, and the FRF matrices that they make up."""

import re
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.frf import FRF, FRFError, FRFKind
from fem.io.uff_format import Block, UffError, label_of, parse_label
from fem.io.uff_types import Function, Units

FRF_TYPE = 4
"""Function type of a frequency response function."""

_SI_LABEL = re.compile(
    r"\(?(m|g|rad)([/.*]?s(\^|\*\*)?[-]?[12²]?)?\)?([/.*]\(?(n|nm|n\.?m|n\*m)\)?)?|n|n[.*]?m"
)


def text_of(value: object) -> str:
    """Return a text field; empty for NONE."""
    text = str(value).strip()
    return "" if text.upper() == "NONE" else text


def function_of(block: Block, fields: dict[Any, Any]) -> Function:
    """Return the record of a dataset 58."""
    x, values = _ordinates(block, fields)
    return Function(
        int(fields["func_type"]),
        label_of(int(fields["rsp_node"]), int(fields["rsp_dir"])),
        label_of(int(fields["ref_node"]), int(fields["ref_dir"])),
        text_of(fields["rsp_ent_name"]),
        text_of(fields["ref_ent_name"]),
        x,
        values,
        int(fields["abscissa_spec_data_type"]),
        int(fields["ordinate_spec_data_type"]),
        int(fields["orddenom_spec_data_type"]),
        text_of(fields["abscissa_axis_units_lab"]),
        text_of(fields["ordinate_axis_units_lab"]),
        text_of(fields["orddenom_axis_units_lab"]),
        tuple(str(fields[f"id{k}"]) for k in range(1, 6)),
        int(fields["load_case_id"]),
        int(fields["ver_num"]),
        block.name,
    )


def _ordinates(block: Block, fields: dict[Any, Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return abscissa and ordinate, as many as the header announces."""
    n, even = int(fields["num_pts"]), int(fields["abscissa_spacing"]) == 1
    if block.values is not None:
        y = block.values["y"].astype(float)
        values = y[:, 0] + 1j * y[:, 1] if y.shape[1] == 2 else y[:, 0]
        stored = None if even else block.values["x"].astype(float)
    else:
        values = np.asarray(fields["data"])
        stored = None if even else np.asarray(fields["x"], dtype=float)
    if values.size < n:
        msg = f"it announces {n} values and has {values.size}"
        raise ValueError(msg)
    x = (
        float(fields["abscissa_min"]) + np.arange(n) * float(fields["abscissa_inc"])
        if stored is None
        else stored[:n]
    )
    return x, values[:n]


def frf_refusal(function: Function, kind: FRFKind | None) -> str:
    """Say why a record cannot be used as an FRF; empty if it can."""
    if not np.iscomplexobj(function.values):
        return "its values are real; amplitudes without phase are not used"
    if not function.x.size:
        return "it has no values"
    if function.x_type not in (0, 1, 18):
        return f"its abscissa has data type {function.x_type}, not 18 (frequency)"
    if kind is None:
        return (
            f"its data types {function.ordinate_type} and {function.denominator_type} do not say "
            "whether it is a "
            "receptance, mobility or accelerance; give kind=…"
        )
    return ""


class _Group:
    """Records of one matrix: the same kind, frequencies, load case and unit labels, each cell once."""

    def __init__(self, kind: FRFKind, first: Function) -> None:
        self.kind, self.first = kind, first
        self.cells: dict[tuple[str, str], Function] = {}
        self.labels: dict[tuple[str, bool], str] = {}

    def takes(self, function: Function, kind: FRFKind) -> bool:
        """Tell whether a record belongs here; translations and rotations have unit labels of their own."""
        return (
            kind == self.kind
            and function.load_case == self.first.load_case
            and (function.response, function.reference) not in self.cells
            and np.array_equal(function.x, self.first.x)
            and all(self.labels.get(key, label) == label for key, label in _unit_labels(function).items())
        )

    def add(self, function: Function) -> None:
        self.cells[function.response, function.reference] = function
        self.labels |= _unit_labels(function)


def _unit_labels(function: Function) -> dict[tuple[str, bool], str]:
    turned, moment = (abs(parse_label(end)[1]) > 3 for end in (function.response, function.reference))
    return {("response", turned): function.unit.lower(), ("force", moment): function.denominator_unit.lower()}


def frf_groups(records: Sequence[tuple[Function, FRFKind]], file: str) -> list[tuple[FRF, tuple[str, str]]]:
    """Put records together to matrices."""
    groups: list[_Group] = []
    for function, kind in records:
        group = next((g for g in groups if g.takes(function, kind)), None)
        if group is None:
            group = _Group(kind, function)
            groups.append(group)
        group.add(function)
    found: list[tuple[FRF, tuple[str, str]]] = []
    for group in groups:
        cells = group.cells
        parts = _complete_parts(cells)
        if len(parts) > 1:
            _warn_of_holes(cells, len(parts), file)
        for outputs, inputs in parts:
            first = cells[outputs[0], inputs[0]]
            H = np.stack([np.stack([cells[o, i].values for i in inputs], -1) for o in outputs], 1)
            try:
                frf = FRF.from_arrays(first.x, H, group.kind, outputs, inputs)
            except FRFError as reason:
                msg = f"{file}: FRFs from {first.place} on: {reason}"
                raise UffError(msg) from reason
            found.append((frf, (first.unit, first.denominator_unit)))
    return found


def _complete_parts(cells: dict[tuple[str, str], Function]) -> list[tuple[list[str], list[str]]]:
    """Group the columns of a matrix that have the same rows."""
    rows: dict[str, list[str]] = {}
    for output, reference in cells:
        rows.setdefault(reference, []).append(output)
    parts: dict[frozenset[str], tuple[list[str], list[str]]] = {}
    for reference, outputs in rows.items():
        parts.setdefault(frozenset(outputs), (outputs, []))[1].append(reference)
    return list(parts.values())


def _warn_of_holes(cells: dict[tuple[str, str], Function], n_parts: int, file: str) -> None:
    outputs, inputs = (list(dict.fromkeys(pair[k] for pair in cells)) for k in (0, 1))
    holes = [f"{o}/{i}" for i in inputs for o in outputs if (o, i) not in cells]
    more = f" and {len(holes) - 5} more" if len(holes) > 5 else ""
    warnings.warn(
        f"{file}: the FRF matrix of {len(outputs)} responses and {len(inputs)} forces lacks "
        f"{', '.join(holes[:5])}{more}; "
        f"it is given as {n_parts} complete matrices",
        stacklevel=5,
    )


def si_factor(function: Function, units: Units) -> float | None:
    """Return what an FRF is multiplied by to be in SI; None if its unit label names an SI unit or g.

    A label goes before the units of the file, since that is what the writer has shown its user.
    """
    if (units.length, units.force) == (1.0, 1.0):
        return 1.0
    label = function.unit.lower().replace(" ", "")
    if label and _SI_LABEL.fullmatch(label):
        return None
    turned = abs(parse_label(function.response)[1]) > 3
    moment = abs(parse_label(function.reference)[1]) > 3
    return units.force * (units.length if moment else 1.0) / (1.0 if turned else units.length)
