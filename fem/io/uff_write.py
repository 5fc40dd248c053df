"""Writing universal files.

All datasets are written here. pyuff 2.5 states half the bytes of complex values in 58b and knows no single
precision, writes no complex shapes with rotations in 55, reads the file again for each trace line in 82, and
has no orientation record for beams in 2412.
"""

import os
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.modes import Modes
from fem.array_types import Complexes, Floats
from fem.io.atomic import replacing
from fem.io.faults import refuse
from fem.io.uff_format import UffError, label_of, parse_label
from fem.mesh import Mesh

if TYPE_CHECKING:
    from fem.io.uff_types import Function, Header, Points, TraceLine

_MARK = f"{-1:6d}\n"
_LINES_AT_ONCE = 4096
"""Lines of numbers that are formatted together: a few hundred kilobytes of text."""
_NUMERATOR = {
    FRFKind.RECEPTANCE: (8, "Displacement", "m", "rad"),
    FRFKind.MOBILITY: (11, "Velocity", "m/s", "rad/s"),
    FRFKind.ACCELERANCE: (12, "Acceleration", "m/s^2", "rad/s^2"),
}


def write_uff(
    path: str | os.PathLike[str],
    frf: FRF | Sequence[FRF] = (),
    modes: Modes | None = None,
    mesh: Mesh | None = None,
    *,
    header: "Header | None" = None,
    binary: bool = True,
    double: bool = True,
    points: int = 2411,
    dofs: Mapping[str, str] | None = None,
    modal_a: ArrayLike | str | None = None,
    geometry: "Points | None" = None,
    trace_lines: "Sequence[TraceLine]" = (),
    functions: "Sequence[Function]" = (),
) -> None:
    """Write FRFs, other functions, mode shapes and a geometry to a universal file, in SI units.

    The file is replaced completely or not at all. Datasets: 151 header, 164 units, 15 or 2411 points, 2412
    elements, 82 trace lines (one a member), 2467 permanent groups (of a mesh's groups and named points),
    55 mode shapes, 58 or 58b FRFs. The format keeps FRF values exactly in binary double precision, to 6e-8 in
    binary single, 5e-13 in text double and 5e-6 in text single precision; frequencies to 1e-12 or exactly in
    binary double precision, else to 6e-8 (binary) and 5e-7 (text); mode shapes, their frequencies and
    damping, and points in dataset 15 to 5e-6, all relative.

    Parameters
    ----------
    path : path
    frf : FRF or sequence of FRF, optional
    modes : Modes, optional
        Shapes without labels are taken as all DOFs of a mesh, nodes counted from 1. A node with NaN in a mode
        is left out of that mode.
    mesh : Mesh, optional
        Points become nodes 1, 2, …
    header : Header, optional
        Names of the model and of the program.
    binary : bool
        Dataset 58b, else 58.
    double : bool
        Double precision, else single.
    points : {2411, 15}
        Dataset for the points.
    dofs : mapping of str to str, optional
        Labels such as ``"12Z+"`` for responses and forces that are named otherwise, such as ``"U1z"``.
    modal_a : array_like of complex (n_modes,) or "unit", optional
        Modal A = φᵀ(2λM + C)φ of complex modes [kg/s]; modal B = -λ·A goes with it. ``"unit"`` says 2iω_d,
        ω_d the imaginary part of λ, which is unit modal mass where damping is proportional. Zero, for
        unknown, unless given.
    geometry : Points, optional
        Points with node numbers, in place of those of a mesh.
    trace_lines : sequence of TraceLine, optional
        Lines through them, in place of a mesh's members.
    functions : sequence of Function, optional
        Time data, spectra, coherences, as they are: in the units that their labels say.

    Raises
    ------
    UffError
        For a mesh together with a geometry, trace lines through nodes that are not there, labels that are not
        degrees of freedom, values that single precision cannot hold, frequencies that the precision cannot
        tell apart, names that the format does not keep (longer than their field, with line ends), or nothing
        to write.
    """
    frfs = (frf,) if isinstance(frf, FRF) else tuple(frf)
    if not frfs and modes is None and mesh is None and geometry is None and not functions:
        refuse("nothing to write: give frf, modes, mesh, geometry or functions", UffError)
    leading = _leading_texts(header, mesh, points, geometry, bool(trace_lines))
    parts: list[bytes] = ["".join(leading).encode()]
    parts.append(_trace_texts(mesh, geometry, trace_lines).encode())
    if mesh is not None:
        parts.append(_element_text(mesh).encode())
        parts.append(_group_text(mesh).encode())
    if modes is not None:
        parts.extend(text.encode() for text in _shape_texts(modes, dofs or {}, modal_a))
    for one in frfs:
        parts.extend(_records(one, binary, double, dofs or {}))
    parts.extend(_function_record(one, binary, double) for one in functions)
    with replacing(path) as scratch:
        scratch.write_bytes(b"".join(parts))


def _leading_texts(
    header: "Header | None", mesh: Mesh | None, points: int, geometry: "Points | None", traced: bool
) -> list[str]:
    """Datasets 151 and 164, and 15 or 2411 of the points of a mesh or a geometry."""
    if points not in (15, 2411):
        refuse(f"points are written as dataset 15 or 2411, not {points}", UffError)
    if mesh is not None and (geometry is not None or traced):
        refuse("a mesh and a geometry are given; the nodes of a file are those of one of them", UffError)
    now = f"{time.strftime('%d-%b-%y'):<10}{time.strftime('%H:%M:%S'):<10}"
    model, about, program = (
        ("", "", "Dovetail") if header is None else (header.model, header.description, header.program)
    )
    out = [
        f"{_begin(151)}{_line(model):<80}\n{_line(about):<80}\n{_line(program):<80}\n"
        f"{now}{0:10d}{0:10d}{0:10d}\n{now}\n{_line(program):<80}\n{now}\n{_MARK}",
        f"{_begin(164)}{1:10d}{'SI: m, N':>20}{1:10d}\n"
        + "".join(f"{v:25.16e}" for v in (1.0, 1.0, 1.0)).replace("e", "D")
        + f"\n{273.15:25.16e}\n{_MARK}".replace("e+", "D+"),
    ]
    if mesh is not None:
        out.append(_point_text(points, range(1, mesh.n_points + 1), mesh.points))
    if geometry is not None:
        out.append(_point_text(points, geometry.labels.tolist(), geometry.coordinates))
    return out


def _begin(kind: int) -> str:
    return f"{_MARK}{kind:6d}{'':74}\n"


def _point_text(kind: int, nodes: Sequence[int], coordinates: Floats) -> str:
    """Dataset 15 (a line for a point) or 2411 (two lines, in double precision)."""
    if kind == 15:
        line, begin = f"%10d{0:10d}{0:10d}{0:10d}%13.5E%13.5E%13.5E\n", f"{_MARK}{15:6d}\n"
    else:
        line, begin = f"%10d{0:10d}{0:10d}{0:10d}\n%25.16e%25.16e%25.16e\n", _begin(kind)
    body = "".join(line % (n, *xyz) for n, xyz in zip(nodes, coordinates.tolist(), strict=True))
    return f"{begin}{body}{_MARK}"


def _trace_texts(mesh: Mesh | None, geometry: "Points | None", trace_lines: "Sequence[TraceLine]") -> str:
    """Datasets 82: a member of a mesh each, or trace lines through nodes of a geometry."""
    out: list[str] = []
    for number, name in enumerate(() if mesh is None else mesh.members, start=1):
        assert mesh is not None
        nodes = (mesh.member_points(name) + 1).tolist()
        out.append(_trace_text(number, _field(name, 80, "the member"), nodes))
    known = set() if geometry is None else set(geometry.labels.tolist())
    for trace in trace_lines:
        lost = [node for stroke in trace.strokes for node in stroke if node not in known]
        if lost:
            msg = f"trace line '{trace.name}' goes through node {lost[0]}, which is not among the geometry's"
            raise UffError(msg)
        # a 0 lifts the pen between strokes
        nodes = [node for k, stroke in enumerate(trace.strokes) for node in ((0,) if k else ()) + stroke]
        if nodes:
            out.append(_trace_text(trace.number, _field(trace.name, 80, "the trace line"), nodes))
    return "".join(out)


def _trace_text(number: int, name: str, nodes: list[int]) -> str:
    head = f"{_begin(82)}{number:10d}{len(nodes):10d}{0:10d}\n{name:<80}\n"
    return f"{head}{_formatted(nodes, ['%10d'], 8)}{_MARK}"


def _formatted(numbers: Sequence[float], cells: list[str], per_line: int) -> str:
    """Return numbers in formats that repeat, so many to a line.

    One format for many lines: Python formats a number at a time in a third of the speed.
    """
    line = "".join(cells) * (per_line // len(cells)) + "\n"
    at_once = _LINES_AT_ONCE * per_line
    n_blocks = len(numbers) - len(numbers) % at_once
    out = [line * _LINES_AT_ONCE % tuple(numbers[k : k + at_once]) for k in range(0, n_blocks, at_once)]
    rest = tuple(numbers[n_blocks:])
    n_lines, n_cells = divmod(len(rest), per_line)
    last = "".join([*cells, *cells * (per_line // len(cells))][:n_cells]) + "\n" if n_cells else ""
    return "".join([*out, (line * n_lines + last) % rest])


def _line(text: str) -> str:
    """Return one line of text for a header, at most 80 characters; an empty one is NONE."""
    return " ".join(text.split())[:80] or "NONE"


def _title(text: str) -> str:
    """Return a line of the free text of a function, which may be longer than 80 characters."""
    if any(not c.isprintable() for c in text) or text.strip() == "-1":
        msg = (
            f"the title {text[:100]!r} of a function cannot be written: each of its five is one line of text"
        )
        raise UffError(msg)
    return text or "NONE"


def _field(text: str, width: int, what: str) -> str:
    """Return a name or label for a field of the format; an empty one is NONE."""
    reason = (
        f"longer than the {width} characters of the format"
        if len(text) > width
        else "with a line end or another control character"
        if any(not c.isprintable() for c in text)
        else "with blanks at an end, which the format does not keep"
        if text != text.strip()
        else "which stands for no name in the format"
        if text.upper() == "NONE"
        else ""
    )
    if reason:
        refuse(f"{what} {text[:100]!r} cannot be written: it is {reason}; give it another name", UffError)
    return text or "NONE"


def _element_text(mesh: Mesh) -> str:
    """Dataset 2412: two-node beams, the member's number as their property table."""
    number_of = {name: k for k, name in enumerate(mesh.members, start=1)}
    rows = [_MARK, f"{2412:6d}\n"]
    for k, (name, (a, b)) in enumerate(zip(mesh.member_of_line(), mesh.lines, strict=True), start=1):
        rows.append(f"{k:10d}{21:10d}{number_of[str(name)]:10d}{1:10d}{7:10d}{2:10d}\n")
        rows.append(f"{0:10d}{1:10d}{1:10d}\n{a + 1:10d}{b + 1:10d}\n")
    return "".join([*rows, _MARK])


def _group_text(mesh: Mesh) -> str:
    """Dataset 2467: groups of members by their elements, named points by their nodes; empty without any."""
    groups = [
        (name, 8, np.sort(np.concatenate([mesh.members[m] for m in members])) + 1)
        for name, members in mesh.groups.items()
    ]
    groups += [
        (name, 7, np.array([point + 1]))
        for name, point in mesh.point_names.items()
        if name != str(point + 1)  # which the node has by its number
    ]
    rows = [_MARK, f"{2467:6d}\n"]
    for number, (name, code, labels) in enumerate(groups, start=1):
        rows.append(f"{number:10d}" + f"{0:10d}" * 6 + f"{labels.size:10d}\n")
        rows.append(f"{_field(name, 40, 'the group or named point')}\n")
        cells = [f"{code:10d}{label:10d}{0:10d}{0:10d}" for label in labels.tolist()]
        rows += ["".join(cells[k : k + 2]) + "\n" for k in range(0, len(cells), 2)]
    return "".join([*rows, _MARK]) if groups else ""


# Functions: datasets 58 and 58b -----------------------------------------------------------------------------


def _records(frf: FRF, binary: bool, double: bool, dofs: Mapping[str, str]) -> list[bytes]:
    start, step = _even_spacing(frf.frequency)
    if not step:
        _check_distinct(frf.frequency, binary, double)
    if not double and frf.H.size and np.abs(frf.H).max() > np.finfo(np.float32).max:
        msg = f"an FRF value is as large as {np.abs(frf.H).max():.3g}; single precision ends at 3.4e38"
        raise UffError(msg)
    records: list[bytes] = []
    for j, reference in enumerate(frf.inputs):
        for i, response in enumerate(frf.outputs):
            ends = (_dof(response, dofs), _dof(reference, dofs))
            values = _columns(frf, i, j, bool(step))
            payload = _payload(values, binary, double, bool(step))
            strain = response in frf.strain
            head = _function_head(frf, ends, double, start, step, reference in frf.base, strain)
            records.append(_framed(head, payload, binary))
    return records


def _framed(head: str, payload: bytes, binary: bool) -> bytes:
    """Return a dataset 58 or 58b of its header and its values."""
    kind = f"{58:6d}"
    if binary:
        kind += f"b{1:6d}{2:6d}{11:12d}{len(payload):12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    return f"{_MARK}{kind}\n{head}".encode() + payload + _MARK.encode()


def _function_record(f: "Function", binary: bool, double: bool) -> bytes:
    """Return a dataset 58 or 58b of any kind of function."""
    is_complex = np.iscomplexobj(f.values)
    start, step = _even_spacing(f.x, least=0.0)
    if not step and (np.diff(f.x) <= 0).any():
        refuse(f"the abscissa of {f.type_name} {f.response} does not rise", UffError)
    if not step:
        _check_distinct(f.x, binary, double)
    columns = [np.real(f.values), np.imag(f.values)] if is_complex else [f.values]
    if not double and f.values.size and np.abs(f.values).max() > np.finfo(np.float32).max:
        msg = f"a value of {f.type_name} {f.response} is too large for single precision, which ends at 3.4e38"
        raise UffError(msg)
    values = np.column_stack(columns if step else [f.x, *columns])
    (node, direction), (reference, sense) = parse_label(f.response), parse_label(f.reference)
    data = (5 if is_complex else 2) + (0 if not double else 1 if is_complex else 2)
    head = "".join(
        [
            *(f"{_title(text):<80}\n" for text in (*f.title, *["NONE"] * 5)[:5]),
            f"{f.function_type:5d}{0:10d}{f.version:5d}{f.load_case:10d} "
            f"{_field(f.response_name, 10, 'the entity'):<10}{node:10d}{direction:4d} "
            f"{_field(f.reference_name, 10, 'the entity'):<10}{reference:10d}{sense:4d}\n",
            f"{data:10d}{f.values.size:10d}{1 if step else 0:10d}{start:13.6e}{step:13.6e}{0:13.5e}\n",
            _axis(f.x_type, "NONE", _field(f.x_unit, 20, "the unit label")),
            _axis(f.ordinate_type, "NONE", _field(f.unit, 20, "the unit label")),
            _axis(f.denominator_type, "NONE", _field(f.denominator_unit, 20, "the unit label")),
            _axis(0, "NONE", "NONE"),
        ]
    )
    return _framed(head, _payload(values, binary, double, bool(step)), binary)


def _dof(label: str, dofs: Mapping[str, str]) -> tuple[int, int]:
    try:
        return parse_label(dofs.get(label, label))
    except UffError as reason:
        msg = f"{reason}; name its degree of freedom in dofs, such as {{'{label}': '12Z+'}}"
        raise UffError(msg) from None


def _even_spacing(frequency: Floats, least: float = -np.inf) -> tuple[float, float]:
    """Return start and step if the header can hold them to 1e-12; else zeros, to write them out."""
    if frequency.size < 2:
        return 0.0, 0.0
    start, step = (
        float(f"{v:.6e}") for v in (frequency[0], (frequency[-1] - frequency[0]) / (frequency.size - 1))
    )
    even = start + np.arange(frequency.size) * step
    good = step > least and np.abs(even - frequency).max() <= 1e-12 * abs(frequency[-1])
    return (start, step) if good else (0.0, 0.0)


def _check_distinct(frequency: Floats, binary: bool, double: bool) -> None:
    if binary and double:
        return
    kept = frequency.astype(np.float32) if binary else np.array([float(f"{f:.6e}") for f in frequency])
    if (np.diff(kept) <= 0).any():
        k = int(np.argmax(np.diff(kept) <= 0))
        msg = (
            f"frequencies {frequency[k]!r} and {frequency[k + 1]!r} Hz cannot be distinguished in this form; "
            "write binary and double"
        )
        raise UffError(msg)


def _columns(frf: FRF, i: int, j: int, even: bool) -> Floats:
    h = frf.H[:, i, j]
    columns = [h.real, h.imag]
    return np.column_stack(columns if even else [frf.frequency, *columns])


def _payload(values: Floats, binary: bool, double: bool, even: bool) -> bytes:
    if binary:
        return values.astype("<f8" if double else "<f4").tobytes()
    if double and not even:  # E13.5, 2E20.12, or 2(E13.5, E20.12) of real values
        cells = ["%13.6e", *["%20.12e"] * (values.shape[1] - 1)]
        per_line = 3 if values.shape[1] == 3 else 4
    elif double:
        cells, per_line = ["%20.12e"], 4
    elif even:
        cells, per_line = ["%13.5e"], 6
    else:  # 6E13.5, the frequency with the digit for which a positive number has room
        cells, per_line = ["%13.6e", *["%13.5e"] * (values.shape[1] - 1)], 6
    return _formatted(values.ravel().tolist(), cells, per_line).encode()


def _function_head(
    frf: FRF,
    ends: tuple[tuple[int, int], tuple[int, int]],
    double: bool,
    start: float,
    step: float,
    driven: bool,
    strain: bool,
) -> str:
    (node, direction), (reference, sense) = ends
    kind, word, unit, turned = (3, "Strain", "m/m", "m/m") if strain else _NUMERATOR[frf.kind]
    moment = abs(sense) > 3
    below = (13, "Moment" if moment else "Force", "N*m" if moment else "N")
    if driven:
        number, name, *labels = _NUMERATOR[FRFKind.ACCELERANCE]
        below = (number, name, labels[moment])
    title = word if strain else frf.kind
    return "".join(
        [
            f"{_line(f'{title} {label_of(node, direction)}/{label_of(reference, sense)}'):<80}\n",
            *(f"{'NONE':<80}\n" for _ in range(4)),
            f"{5 if driven else 4:5d}{0:10d}{0:5d}{0:10d} {'NONE':<10}{node:10d}{direction:4d} "
            f"{'NONE':<10}{reference:10d}{sense:4d}\n",
            f"{6 if double else 5:10d}{frf.n_freq:10d}{1 if step else 0:10d}",
            f"{start:13.6e}{step:13.6e}{0:13.5e}\n",
            _axis(18, "Frequency", "Hz"),
            _axis(kind, word, turned if abs(direction) > 3 else unit),
            _axis(*below),
            _axis(0, "NONE", "NONE"),
        ]
    )


def _axis(kind: int, word: str, unit: str) -> str:
    return f"{kind:10d}{0:5d}{0:5d}{0:5d} {word:<20} {unit:<20}\n"


# Mode shapes: dataset 55 ------------------------------------------------------------------------------------


def _shape_texts(modes: Modes, dofs: Mapping[str, str], modal_a: ArrayLike | str | None) -> list[str]:
    nodes, table = _nodal_table(modes, dofs)
    zeta = np.zeros(modes.n_modes) if modes.zeta is None else modes.zeta
    poles = pole_of(modes.frequency, zeta)
    if modal_a is not None and not np.iscomplexobj(modes.shapes):
        refuse("modal A is given for real mode shapes, which have a modal mass instead: 1 kg", UffError)
    if isinstance(modal_a, str) and modal_a != "unit":
        refuse(f"modal_a is '{modal_a}'; allowed are 'unit' and one complex number for each mode", UffError)
    a = np.zeros(modes.n_modes, dtype=complex) if modal_a is None else 2j * poles.imag
    if modal_a is not None and not isinstance(modal_a, str):
        a = np.asarray(modal_a, dtype=complex)
        if a.shape != (modes.n_modes,) or not np.isfinite(a).all():
            refuse(f"modal_a has shape {a.shape}; ({modes.n_modes},) finite numbers are expected", UffError)
    return [
        _shape_text(nodes, table[:, :, k], k + 1, float(modes.frequency[k]), float(zeta[k]), complex(a[k]))
        for k in range(modes.n_modes)
    ]


def pole_of(frequency: ArrayLike, zeta: ArrayLike) -> Complexes:
    """Return λ = -ζω + iω √(1 - ζ²) [rad/s] from natural frequencies [Hz] and damping ratios."""
    omega, zeta = 2 * np.pi * np.asarray(frequency, dtype=float), np.asarray(zeta, dtype=float)
    return -zeta * omega + 1j * omega * np.sqrt(np.maximum(0.0, 1 - zeta**2))


def _nodal_table(modes: Modes, dofs: Mapping[str, str]) -> tuple[list[int], NDArray[Any]]:
    """Return node numbers and values (n_nodes, 3 or 6, n_modes); directions that are not there are zero.

    A node at which a mode was not measured has NaN in all of that mode's directions.
    """
    labels = modes.labels or tuple(
        label_of(p + 1, d) for p in range(modes.shapes.shape[0] // 6) for d in range(1, 7)
    )
    if len(labels) != modes.shapes.shape[0]:
        refuse(f"the shapes have {modes.shapes.shape[0]} rows and {len(labels)} labels", UffError)
    ends = [_dof(label, dofs) for label in labels]
    if any(direction == 0 for _, direction in ends):
        msg = (
            f"'{labels[[d for _, d in ends].index(0)]}' has no direction; mode shapes need X, Y, Z, RX, "
            "RY or RZ"
        )
        raise UffError(msg)
    nodes = list(dict.fromkeys(node for node, _ in ends))
    row_of = {node: k for k, node in enumerate(nodes)}
    width = 6 if any(abs(direction) > 3 for _, direction in ends) else 3
    table = np.zeros((len(nodes), width, modes.n_modes), dtype=modes.shapes.dtype)
    for row, (node, direction) in enumerate(ends):
        table[row_of[node], abs(direction) - 1] = np.sign(direction) * modes.shapes[row]
    gaps = np.isnan(modes.shapes)
    if gaps.any():
        rows = np.array([row_of[node] for node, _ in ends])
        lacking = np.zeros((len(nodes), modes.n_modes), dtype=np.int64)
        np.add.at(lacking, rows, gaps)
        partly = np.argwhere((lacking > 0) & (lacking < np.bincount(rows)[:, None]))
        if len(partly):
            row, k = partly[0]
            msg = (
                f"mode {k + 1} has values in some directions of node {nodes[row]} and NaN in others; the "
                "format keeps a node with all of its directions, or leaves it out"
            )
            raise UffError(msg)
        table.transpose(0, 2, 1)[lacking > 0] = np.nan
    return nodes, table


def _shape_text(
    nodes: list[int], values: NDArray[Any], number: int, frequency: float, zeta: float, modal_a: complex
) -> str:
    is_complex = np.iscomplexobj(values)
    width = values.shape[1]
    head = [_MARK, f"{55:6d}\n", f"{f'mode {number}':<80}\n", *(f"{'NONE':<80}\n" for _ in range(4))]
    data = (1, 3 if is_complex else 2, 2 if width == 3 else 3, 8, 5 if is_complex else 2, width)
    head.append("".join(f"{v:10d}" for v in data) + "\n")
    if is_complex:  # the eigenvalue lies on a circle of radius omega
        pole = complex(pole_of(frequency, zeta))
        record = [part for z in (pole, modal_a, -pole * modal_a) for part in (z.real, z.imag)]
        head.append(f"{2:10d}{6:10d}{0:10d}{number:10d}\n" + "".join(f"{v:13.5e}" for v in record) + "\n")
    else:
        record = (frequency, 1.0, zeta, 0.0)
        head.append(f"{2:10d}{4:10d}{0:10d}{number:10d}\n" + "".join(f"{v:13.5e}" for v in record) + "\n")
    body: list[str] = []
    for node, row in zip(nodes, values, strict=True):
        if np.isnan(row).any():
            continue
        numbers = np.column_stack([row.real, row.imag]).ravel() if is_complex else row
        cells = [f"{v:13.5e}" for v in numbers]
        body.append(
            f"{node:10d}\n" + "".join("".join(cells[k : k + 6]) + "\n" for k in range(0, len(cells), 6))
        )
    return "".join([*head, *body, _MARK])
