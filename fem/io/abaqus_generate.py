"""Abaqus' generators of nodes and elements, and its coordinate systems.

``*NGEN``, ``*NFILL``, ``*NCOPY``, ``*ELGEN``, ``*ELCOPY``, ``*SYSTEM`` and ``*NODE, SYSTEM=``, as the
keywords manual describes them (Abaqus 2017). Generators use the nodes and elements defined before them, as
in Abaqus.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats, Ints
from fem.io.abaqus_deck import AbaqusBlock, name_of
from fem.io.abaqus_parts import AbaqusPart, AbaqusSetEntry, Skipped
from fem.io.deck import DeckBudget, integer, real
from fem.io.faults import error_at, refuse
from fem.mesh import MeshError

_SAME_CIRCLE = 1e-3
"""Relative difference of the radii up to which two nodes are on one circle: coordinates are rounded."""


def rotation(axis: ArrayLike, angle: float) -> Floats:
    """Return the matrix that turns about an axis by an angle [rad] (Rodrigues' formula), shape (3, 3).

    Raises
    ------
    ValueError
        If the axis has no length.
    """
    axis = np.asarray(axis, dtype=float)
    length = float(np.linalg.norm(axis))
    if not length > 0:
        refuse("the two points of its axis coincide")
    x, y, z = axis / length
    S = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * S + (1 - np.cos(angle)) * S @ S


def from_polar(kind: str, xyz: Floats) -> Floats:
    """Return Cartesian coordinates of r, θ, z (C) or r, θ, φ (S, φ from the x-y plane), angles in degrees.

    Raises
    ------
    ValueError
        For another kind than R, RC, C or S.
    """
    word = kind.upper()
    if word in ("", "R", "RC") or "RECTANGULAR".startswith(word):
        return xyz
    r, theta = xyz[..., 0], np.deg2rad(xyz[..., 1])
    if "CYLINDRICAL".startswith(word):
        return np.stack([r * np.cos(theta), r * np.sin(theta), xyz[..., 2]], axis=-1)
    if "SPHERICAL".startswith(word):
        phi = np.deg2rad(xyz[..., 2])
        flat = r * np.cos(phi)
        return np.stack([flat * np.cos(theta), flat * np.sin(theta), r * np.sin(phi)], axis=-1)
    refuse(f"SYSTEM={kind} is not allowed; R, C and S are")


def system_of(block: AbaqusBlock) -> tuple[Floats, Floats] | None:
    """Return the axes, in rows, and the origin that ``*SYSTEM`` gives; None for the global system.

    With one point the axes are global. With two, z stays global and x is the direction between them, laid
    into the x-y plane; a third point is in the x-y plane of the system, on the side of positive y.
    """
    data = [(place, [real(c) for c in cells]) for place, cells in block.rows()]
    if not data:
        return None
    place, first = data[0]
    second = data[1][1] if len(data) > 1 else []
    if len(data) > 2 or len(first) > 6 or len(second) > 3:
        msg = (
            f"{place}: *SYSTEM has too many numbers; up to six are allowed on its first line (points a and "
            "b) and three on its second (point c)"
        )
        raise MeshError(msg)
    a = np.array([*first[:3], 0.0, 0.0, 0.0][:3])
    if len(first) <= 3 and not second:
        return np.eye(3), a
    x = np.array([*first[3:], 0.0, 0.0, 0.0][:3]) - a
    z = np.array([0.0, 0.0, 1.0])
    if second:
        z = np.cross(x, np.array([*second, 0.0, 0.0][:3]) - a)
    else:
        x = x * [1.0, 1.0, 0.0]
    lengths = np.linalg.norm(x), np.linalg.norm(z)
    if not min(lengths) > 1e-9 * max(*lengths, float(np.linalg.norm(x)) ** 2):
        raise error_at(place, "*SYSTEM defines no axes: its points lie on one line, or two of them coincide")
    x, z = x / lengths[0], z / lengths[1]
    return np.stack([x, np.cross(z, x), z]), a


def to_global(part: AbaqusPart, xyz: Floats) -> Floats:
    """Return global coordinates of those in the system that is in effect."""
    if part.system is None:
        return xyz
    axes, origin = part.system
    return xyz @ axes + origin


# Nodes ------------------------------------------------------------------------------------------------------


def ngen(block: AbaqusBlock, part: AbaqusPart, budget: DeckBudget) -> None:
    """Generate the nodes between two: on a line, on a parabola (``LINE=P``) or on an arc (``LINE=C``)."""
    line = block.options.get("LINE", "")
    if line not in ("", "P", "C"):
        raise error_at(block.place, f"*NGEN, LINE={line} is not read; P and C are")
    for place, cells in block.rows():
        cells = [*cells, *[""] * 10][: max(10, len(cells))]
        first, last = integer(cells[0]), integer(cells[1])
        step = integer(cells[2]) if cells[2] else 1
        n = _intervals(first, last, step, place)
        budget.take(n, place, "*NGEN")
        a, b = part.coordinates(first, place), part.coordinates(last, place)
        t = np.arange(1, n) / n
        if line:
            third = _extra_point(block, part, cells, place)
            normal = np.array([real(c) for c in cells[7:10]])
            xyz = _parabola(a, third, b, t) if line == "P" else _arc(a, third, b, normal, t, place)
        else:
            xyz = a + t[:, None] * (b - a)
        numbers = first + (last - first) // n * np.arange(n + 1)
        part.nodes.add(numbers[1:-1], xyz, *_at(place))
        _to_set(part, "NSET", block.options.get("NSET"), np.sort(numbers), place)


def _at(place: str) -> tuple[int, str]:
    """Return line and file of a place."""
    file, _, line = place.rpartition(": line ")
    return int(line), file


def _intervals(first: int, last: int, step: int, place: str) -> int:
    n, rest = divmod(abs(last - first), abs(step)) if step else (0, 1)
    if rest or n < 1:
        raise error_at(
            place,
            f"*NGEN runs from node {first} to {last} in steps of {step}; the step must divide the difference",
        )
    return n


def _extra_point(block: AbaqusBlock, part: AbaqusPart, cells: list[str], place: str) -> Floats:
    if cells[3] and integer(cells[3]):
        return part.coordinates(integer(cells[3]), place)
    if not any(cells[4:7]):
        raise error_at(place, f"*NGEN, LINE={block.options['LINE']} needs a third node or a point")
    local = np.array([real(c) for c in cells[4:7]])
    return to_global(part, from_polar(block.options.get("SYSTEM", ""), local))


def _parabola(a: Floats, middle: Floats, b: Floats, t: Floats) -> Floats:
    s = t[:, None]
    return a * (1 - s) * (1 - 2 * s) + middle * 4 * s * (1 - s) + b * s * (2 * s - 1)


def _arc(a: Floats, centre: Floats, b: Floats, normal: Floats, t: Floats, place: str) -> Floats:
    """Return points on the arc from a to b about a centre, the shorter one without a normal."""
    u, v = a - centre, b - centre
    r1, r2 = np.linalg.norm(u), np.linalg.norm(v)
    if not min(r1, r2) > 0 or abs(r1 - r2) > _SAME_CIRCLE * max(r1, r2):
        raise error_at(
            place,
            f"*NGEN, LINE=C has ends at distances of {r1:g} and {r2:g} from the centre; they must be equal",
        )
    if normal.any():
        n = normal / np.linalg.norm(normal)
        if max(abs(n @ u), abs(n @ v)) > _SAME_CIRCLE * r1:
            raise error_at(place, "*NGEN, LINE=C has a normal that is not square to the plane of its nodes")
        angle = np.arctan2(n @ np.cross(u, v), u @ v)
        angle = angle + 2 * np.pi if angle <= 1e-9 else angle
    else:
        n = np.cross(u, v)
        if np.linalg.norm(n) < 1e-6 * r1 * r2:
            raise error_at(place, "*NGEN, LINE=C spans 0° or 180°; the normal to its plane must be given")
        angle = np.arctan2(np.linalg.norm(n), u @ v)
    n = n / np.linalg.norm(n)
    turned = np.cos(angle * t)[:, None] * u + np.sin(angle * t)[:, None] * np.cross(n, u)
    return centre + turned * (1 + t * (r2 / r1 - 1))[:, None]


def nfill(block: AbaqusBlock, part: AbaqusPart, budget: DeckBudget, notes: list[str]) -> None:
    """Generate nodes on lines between the nodes of two sets.

    ``BIAS`` is the ratio of each distance along a line to the next one.
    """
    bias = real(block.options.get("BIAS", "1"))
    for place, cells in block.rows():
        if len(cells) < 3:
            refuse("two node sets and a number of intervals are expected")
        first = members_so_far(part, "NSET", cells[0], place, budget)
        second = members_so_far(part, "NSET", cells[1], place, budget)
        n, step = integer(cells[2]), integer(cells[3]) if len(cells) > 3 and cells[3] else 1
        if n < 1 or not bias > 0 or step == 0:
            raise error_at(place, f"*NFILL has {n} intervals, step {step} and bias {bias:g}; none may be 0")
        if len(first) != len(second):
            notes.append(
                f"*NFILL ({place}) joins {len(first)} and {len(second)} nodes; the last ones of the "
                "larger set are left out, as in Abaqus"
            )
        pairs = list(zip(first.tolist(), second.tolist(), strict=False))
        budget.take(len(pairs) * n, place, "*NFILL")
        lengths = np.exp(-np.log(bias) * (np.arange(n) - (n - 1 if bias < 1 else 0)))
        t = np.cumsum(lengths)[:-1] / lengths.sum()
        for low, high in pairs:
            a, b = part.coordinates(low, place), part.coordinates(high, place)
            numbers = low + step * np.arange(1, n)
            part.nodes.add(numbers, a + t[:, None] * (b - a), *_at(place))
            _to_set(part, "NSET", block.options.get("NSET"), np.array([low, *numbers, high]), place)


def ncopy(block: AbaqusBlock, part: AbaqusPart, budget: DeckBudget) -> None:
    """Copy nodes: shifted and turned (``SHIFT``), or reflected in a line, a plane or a point."""
    change = integer(block.option("CHANGENUMBER", "CHANGE NUMBER="))
    old = members_so_far(part, "NSET", block.option("OLDSET", "OLD SET="), block.place, budget)
    times = integer(block.options.get("MULTIPLE") or "1")
    if part.system is not None:
        raise error_at(
            block.place,
            "*NCOPY is not read while *SYSTEM is in effect; end that by an empty *SYSTEM before it",
        )
    data = [[real(c) for c in cells] for _, cells in block.rows()]
    reflect = block.options.get("REFLECT")
    if ("SHIFT" in block.options) == (reflect is not None) or times < 1 or (times > 1 and reflect):
        raise error_at(block.place, "*NCOPY needs either SHIFT, with MULTIPLE if need be, or REFLECT")
    turn, shift = _reflection(reflect, data) if reflect is not None else shift_and_turn(data)
    budget.take(len(old) * times, block.place, "*NCOPY")
    xyz = np.array([part.coordinates(n, block.place) for n in old.tolist()]).reshape(-1, 3)
    for k in range(1, times + 1):
        xyz = xyz @ turn.T + shift
        part.nodes.add(old + k * change, xyz, *_at(block.place))
        _to_set(part, "NSET", block.options.get("NEWSET"), old + k * change, block.place)


def shift_and_turn(data: list[list[float]]) -> tuple[Floats, Floats]:
    """Return matrix and shift of a translation (first line), then a turn about an axis (second line).

    Raises
    ------
    ValueError
        If the lines do not have three and seven numbers.
    """
    rows = [*data, [], []][:2]
    if len(data) > 2 or len(rows[0]) > 3 or len(rows[1]) not in (0, 7):
        refuse("a shift of three numbers, and an axis of two points with an angle in degrees, are expected")
    move = np.array([*rows[0], 0.0, 0.0, 0.0][:3])
    if not rows[1]:
        return np.eye(3), move
    a, b = np.array(rows[1][:3]), np.array(rows[1][3:6])
    turn = rotation(b - a, np.deg2rad(rows[1][6]))
    return turn, a + turn @ (move - a)


def _reflection(kind: str, data: list[list[float]]) -> tuple[Floats, Floats]:
    points = np.array([*(v for row in data for v in row)], dtype=float)
    needed = {"POINT": 1, "LINE": 2, "MIRROR": 3}.get(kind, 0)
    if not needed or points.size != 3 * needed:
        refuse(f"REFLECT={kind} with {points.size} numbers; POINT takes 3, LINE 6 and MIRROR 9")
    a, *others = points.reshape(-1, 3)
    turn = -np.eye(3)
    if kind == "LINE":
        turn = rotation(others[0] - a, np.pi)
    if kind == "MIRROR":
        n = np.cross(others[0] - a, others[1] - a)
        if not np.linalg.norm(n) > 0:
            refuse("the three points of the mirror are on one line")
        n = n / np.linalg.norm(n)
        turn = np.eye(3) - 2 * np.outer(n, n)
    return turn, a - turn @ a


# Elements ---------------------------------------------------------------------------------------------------


def elgen(block: AbaqusBlock, part: AbaqusPart, budget: DeckBudget) -> None:
    """Generate elements from one: a row, rows of rows, and layers of these."""
    for place, cells in block.rows():
        values = [integer(c) if c else None for c in cells]
        master, *levels = [*values, *[None] * 10][: max(10, len(values))]
        if master is None or len(values) > 10:
            refuse("an element and up to three times a count and two steps are expected")
        numbers, steps = np.array([master]), np.array([0])
        for count, of_nodes, of_elements in (levels[0:3], levels[3:6], levels[6:9]):
            n = 1 if count is None else count
            if n < 1:
                refuse(f"{n} elements in a row")
            budget.take(len(numbers) * (n - 1), place, "*ELGEN")
            k = np.arange(n)[:, None]
            numbers = (numbers + k * (1 if of_elements is None else of_elements)).ravel()
            steps = (steps + k * (1 if of_nodes is None else of_nodes)).ravel()
        _copy_elements(part, np.full(len(numbers) - 1, master), numbers[1:], steps[1:], place)
        _to_set(part, "ELSET", block.options.get("ELSET"), numbers, place)


def _copy_elements(part: AbaqusPart, old: Ints, new: Ints, steps: Ints, place: str) -> None:
    """Copy elements to new numbers, with steps of their nodes; all arrays have one shape."""
    found = [part.elements.find(number) for number in old.tolist()]
    is_line = np.array([row is not None for row in found], dtype=bool)
    rows = np.array([row for row in found if row is not None], dtype=np.int64)
    nodes = part.elements.values(rows)
    moved = nodes + steps[is_line, None]
    if ((moved < 1) & (nodes > 0)).any():
        msg = f"{place}: a copied element has node {moved[nodes > 0].min()}; node numbers begin with 1"
        raise MeshError(msg)
    part.elements.add(new[is_line], np.where(nodes < 0, -1, moved), *_at(place))
    kinds: dict[str, list[int]] = {}
    for number, copy in zip(old[~is_line].tolist(), new[~is_line].tolist(), strict=True):
        kind = part.kind_of_skipped(number)
        if kind is None:
            raise error_at(place, f"element {number} is to be copied, but is not defined before this line")
        kinds.setdefault(kind, []).append(copy)
    line, file = _at(place)
    for kind, numbers in kinds.items():
        part.skipped.append(Skipped(kind, np.array(numbers), file, np.full(len(numbers), line)))


def elcopy(block: AbaqusBlock, part: AbaqusPart, budget: DeckBudget) -> None:
    """Copy the elements of a set, with steps between the numbers of elements and of nodes."""
    of_elements = integer(block.option("ELEMENTSHIFT", "ELEMENT SHIFT="))
    of_nodes = integer(block.option("SHIFTNODES", "SHIFT NODES="))
    old = members_so_far(part, "ELSET", block.option("OLDSET", "OLD SET="), block.place, budget)
    budget.take(len(old), block.place, "*ELCOPY")
    _copy_elements(part, old, old + of_elements, np.full(len(old), of_nodes), block.place)
    _to_set(part, "ELSET", block.options.get("NEWSET"), old + of_elements, block.place)


# Sets -------------------------------------------------------------------------------------------------------


def _to_set(part: AbaqusPart, keyword: str, name: str | None, numbers: Ints, place: str) -> None:
    if name:
        part.sets[keyword].add(name, AbaqusSetEntry(place, numbers=numbers))


def members_so_far(part: AbaqusPart, keyword: str, cell: str, place: str, budget: DeckBudget) -> Ints:
    """Return the numbers of a set, ascending unless it is unsorted, or a single number."""
    if cell.isascii() and cell.isdigit():
        return np.array([integer(cell)])
    found = part.sets[keyword].get(name_of(cell))
    if found is None:
        msg = f"{place}: there is no {part.sets[keyword].word} set {name_of(cell)[:40]} before this line"
        raise MeshError(msg)
    numbers = _numbers_of(found.entries.values(), cell, place, budget)
    budget.take(len(numbers), place, f"the set {name_of(cell)[:40]}")
    values, first_at = np.unique(numbers, return_index=True)
    return numbers[np.sort(first_at)] if found.unsorted else values


def _numbers_of(entries: Iterable[AbaqusSetEntry], cell: str, place: str, budget: DeckBudget) -> Ints:
    """Return the numbers of a set's entries, those of a sorted set that was taken in ascending."""
    parts = [np.empty(0, dtype=np.int64)]
    for entry in entries:
        if entry.taken is not None:
            parts.append(np.unique(_numbers_of(entry.taken.entries.values(), cell, place, budget)))
        elif entry.numbers is not None and not entry.instance:
            parts.append(entry.numbers)
        elif entry.span is not None and not entry.instance:
            first, last, step = entry.span
            budget.take(max(0, (last - first) // step + 1), place, "a range of a set")
            parts.append(np.arange(first, last + 1, step))
        else:
            msg = (
                f"{place}: the set {name_of(cell)[:40]} includes {entry.name[:40] or 'an instance'} "
                f"({entry.place}), which is not known there"
            )
            raise MeshError(msg)
    return np.concatenate(parts)
