"""Layout of a mesh's lines: the properties, end connections and axes of every line, without moduli.

Members share properties, so that each line has a row in a table of kinds. The properties keep the layouts
(`fem.elements.layout`): a fit changes moduli and densities, which are not part of them.
"""

from collections.abc import Callable, ItemsView, Iterator, Mapping, ValuesView
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Bools, Floats, Ints
from fem.elements import tapered
from fem.elements.properties import LUMPED, MemberProperties
from fem.materials import Material
from fem.mesh import Mesh
from fem.model import ModelError
from fem.recent import Recent
from fem.sections.section import Section

MANY_LINES = 100_000
"""Layouts hold the axes and lengths of all lines for meshes of at most this many lines."""
EQUAL = 1e-10
"""Relative difference of lengths and axes up to which elements count as equal: coordinates are rounded."""
CONSTANTS = ("A", "Iy", "Iz", "Ip", "J", "ky", "kz")
"""Constants of a section that elements use."""
AxesAndArms = tuple[Floats, Floats, Floats, Floats]
"""Local axes (b, 3, 3), arms (b, 2, 3), lengths of the axes and of the flexible parts (b,) [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """Properties of every line of a mesh: its row in a table of kinds, and where its axis begins and ends."""

    kind: Ints  # (n_lines,) row of the table
    table: dict[str, Floats]  # (n_kinds, ...)
    materials: tuple[Material, ...]  # of each kind
    offset: Floats  # (n_lines, 2, 3): from the nodes to the ends of the axis
    zone: Floats  # (n_lines, 2): lengths of the rigid zones
    soft: Ints  # (n_lines,): row of ends, -1 for rigid end connections
    ends: Floats  # (n_soft, 12): stiffness of the connections
    plain: Bools  # (n_lines,): prismatic, point to point, no rigid zones, rigid connections
    taper: Ints  # (n_lines,): row of knots, -1 for prismatic lines
    knots: Floats  # (n_tapers, N_KNOTS, 7): constants along members
    along: Floats  # (n_lines, 2): fractions of the member where lines with a taper begin and end
    axes: AxesAndArms | None = None  # of all lines; None for meshes with more than `MANY_LINES`


def layout_of(members: Mapping[str, MemberProperties], mesh: Mesh) -> Layout:
    """Return the layout of a mesh, which does not depend on moduli and densities."""
    return ByMember.of(members).on(mesh, _layout)


def _layout(members: Mapping[str, MemberProperties], mesh: Mesh) -> Layout:
    names = list(mesh.members)
    try:
        of_member = [members[name] for name in names]
    except KeyError:
        missing = next(name for name in names if name not in members)
        msg = f"member '{missing}' of the mesh has no material and section; given are {', '.join(members)}"
        raise ModelError(msg) from None
    different = list(dict.fromkeys(of_member))  # members share the objects of their properties
    number = {p: i for i, p in enumerate(different)}
    owner = np.array([number[p] for p in of_member])
    chains, member = mesh.chains()
    row = np.empty(mesh.n_lines, dtype=np.int64)  # of each line in `different`
    row[chains] = owner[member]
    uneven = [p.section2 is not None or not np.array_equal(p.offset1, p.offset2) for p in different]
    along = mesh.arc_fractions() if any(uneven) else np.zeros((mesh.n_lines, 2))
    kind, kinds = _kinds(different, row, along)
    offset = np.zeros((1, 2, 3))
    if any(p.offset1.any() or p.offset2.any() for p in different):
        first, second = (
            np.array([getattr(p, key) for p in different])[row] for key in ("offset1", "offset2")
        )
        offset = first[:, None] + along[:, :, None] * (second - first)[:, None]
    zone, soft, ends = _end_lines(different, owner, mesh)
    taper, knots = _tapers(different, row)
    plain = (soft < 0) & (taper < 0)
    for part in (offset, zone):
        plain &= ~part.any(axis=tuple(range(1, part.ndim)))
    layout = Layout(
        kind,
        _table(kinds),
        tuple(p.material for p, _ in kinds),
        np.broadcast_to(offset, (mesh.n_lines, 2, 3)),
        np.broadcast_to(zone, (mesh.n_lines, 2)),
        soft,
        ends,
        plain,
        taper,
        knots,
        along,
    )
    _check_layout(layout, mesh)
    if mesh.n_lines > MANY_LINES:
        return layout
    return replace(layout, axes=_axes_and_arms_of(layout, mesh, np.arange(mesh.n_lines)))


def _table(kinds: list[tuple[MemberProperties, Section]]) -> dict[str, Floats]:
    """Return the properties of each kind in columns."""
    table = {
        **{key: np.array([getattr(s, key) for _, s in kinds]) for key in (*CONSTANTS, "angle")},
        "nu": np.array([p.material.nu for p, _ in kinds]),
        "eta": np.array([p.material.loss_factor for p, _ in kinds]),
        "rotary": np.array([float(p.theory == "timoshenko") for p, _ in kinds]),
        "bar": np.array([float(p.theory == "bar") for p, _ in kinds]),
        "higher": np.array([float(p.mass == "higher-order") for p, _ in kinds]),
        "lumped": np.array([float(p.mass in LUMPED) for p, _ in kinds]),
        "turning": np.array([float(p.mass != "lumped-slender") for p, _ in kinds]),
        "tension": np.array([p.pretension for p, _ in kinds]),
        "up": np.array(
            [np.full(3, np.nan) if p.orientation is None else p.orientation for p, _ in kinds]
        ).reshape(-1, 3),
    }
    for d in ("y", "z"):
        # theories without shear have k = 0; section changes may ask for Timoshenko's value all the same
        table[f"k_full_{d}"] = table[f"k{d}"].copy()
        table[f"k{d}"][table["rotary"] == 0] = 0.0
    return table


def _kinds(
    different: list[MemberProperties], row: Ints, along: Floats
) -> tuple[Ints, list[tuple[MemberProperties, Section]]]:
    """Return the row of each line in a list of properties with sections, and the list."""
    kinds = [(p, p.section) for p in different]
    kind = row.copy()
    for i, p in enumerate(different):
        if p.section2 is None:
            continue
        rows = np.flatnonzero(row == i)
        # a tapered line has the constants of its middle; its matrices integrate those at the stations
        middle, which = np.unique(along[rows].mean(axis=1), return_inverse=True)
        kind[rows] = len(kinds) + which
        kinds += [(p, Section.between(p.section, p.section2, float(x))) for x in middle]
    return kind, kinds


def _tapers(different: list[MemberProperties], row: Ints) -> tuple[Ints, Floats]:
    """Return the row of each line in a table of tapers, -1 for none, and constants at the tapers' knots."""
    taper, knots = np.full(len(row), -1), []
    for i, p in enumerate(different):
        if p.section2 is not None:
            taper[row == i] = len(knots)
            sections = [Section.between(p.section, p.section2, float(x)) for x in tapered.KNOTS]
            knots.append([[getattr(s, key) for key in CONSTANTS] for s in sections])
    return taper, np.array(knots).reshape(-1, tapered.N_KNOTS, len(CONSTANTS))


def _end_lines(different: list[MemberProperties], owner: Ints, mesh: Mesh) -> tuple[Floats, Ints, Floats]:
    """Return the rigid zones (n_lines, 2), and rows and stiffness of the connections of members' ends."""
    n = mesh.n_lines
    chains, member = mesh.chains()
    at = np.searchsorted(member, np.arange(len(owner) + 1))
    edge = chains[at[:-1]], chains[at[1:] - 1]  # first and last line of each member
    zone, soft = np.zeros((1, 2)), np.full(n, -1)
    zones = np.array([[p.rigid1, p.rigid2] for p in different])
    if zones.any():
        zone = np.zeros((n, 2))
        for k in range(2):
            zone[edge[k], k] = zones[owner, k]
    springs = np.array([p.end_stiffness for p in different])
    ends = np.zeros((0, 12))
    if np.isfinite(springs).any():
        lines = np.unique(
            np.concatenate(
                [edge[k][np.isfinite(springs[owner, 6 * k : 6 * k + 6]).any(axis=1)] for k in range(2)]
            )
        )
        soft[lines] = np.arange(len(lines))
        ends = np.full((len(lines), 12), np.inf)
        for k in range(2):
            mine = soft[edge[k]] >= 0
            part = slice(6 * k, 6 * k + 6)
            ends[soft[edge[k][mine]], part] = springs[owner[mine], part]
    return zone, soft, ends


def _check_layout(layout: Layout, mesh: Mesh) -> None:
    """Refuse orientations along a member, bars that can turn freely, and rigid zones that do not fit."""
    _check_orientations(layout, mesh)
    _check_bars(layout, mesh)
    _check_rigid_zones(layout, mesh)


def _check_orientations(layout: Layout, mesh: Mesh) -> None:
    """Refuse orientations parallel to the axis."""
    rows = np.flatnonzero(np.isfinite(layout.table["up"][layout.kind, 0]))
    if rows.size:
        t = axis_vectors(layout, mesh, rows)
        up = layout.table["up"][layout.kind[rows]]
        parallel = is_parallel(t, up)
        if parallel.any():
            i = int(np.flatnonzero(parallel)[0])
            raise ModelError(parallel_message(_member(mesh, rows[i]), up[i]))


def _check_bars(layout: Layout, mesh: Mesh) -> None:
    """Refuse bars of several elements with an offset: their inner points have no rotational stiffness."""
    bars = np.flatnonzero((layout.table["bar"][layout.kind] != 0) & layout.offset.any(axis=(1, 2)))
    if bars.size:
        chains, member = mesh.chains()
        of, count = np.empty(mesh.n_lines, dtype=np.int64), np.bincount(member)
        of[chains] = member
        loose = bars[count[of[bars]] > 1]
        if loose.size:
            msg = (
                f"bar '{_member(mesh, loose[0])}' has an offset and {count[of[loose[0]]]} elements; nothing "
                "keeps the points between them from turning about its axis: give it one element, or no offset"
            )
            raise ModelError(msg)


def _check_rigid_zones(layout: Layout, mesh: Mesh) -> None:
    """Refuse rigid zones that leave less than a thousandth of their element to bend."""
    rows = np.flatnonzero(layout.zone.any(axis=1))
    if not rows.size:
        return
    zone, span = layout.zone[rows], np.linalg.norm(axis_vectors(layout, mesh, rows), axis=1)
    for k, room in ((0, span - zone[:, 0]), (1, span - zone.sum(axis=1))):
        bad = np.flatnonzero((zone[:, k] > 0) & (room <= 0.001 * span))
        if bad.size:
            i = int(bad[0])
            msg = (
                f"member '{_member(mesh, rows[i])}': the rigid end zone of {zone[i, k]:g} m does not fit "
                f"into the element at that end ({span[i]:g} m); use larger elements"
            )
            raise ModelError(msg)


def _member(mesh: Mesh, line: int) -> str:
    """Return the name of the member that a line belongs to."""
    return str(mesh.member_of_line()[int(line)])


def axis_vectors(layout: Layout, mesh: Mesh, rows: Ints) -> Floats:
    """Return the vectors along the axes of lines, shape (b, 3) [m]; offsets that change turn them."""
    line = mesh.lines[rows]
    return mesh.points[line[:, 1]] - mesh.points[line[:, 0]] + layout.offset[rows, 1] - layout.offset[rows, 0]


def axes_and_arms(layout: Layout, mesh: Mesh, rows: Ints) -> AxesAndArms:
    """Return local axes, arms to the flexible part's ends, length of the axis and of the flexible part."""
    if layout.axes is None:
        return _axes_and_arms_of(layout, mesh, rows)
    axes, arms, span, L = layout.axes
    return axes[rows], arms[rows], span[rows], L[rows]


def _axes_and_arms_of(layout: Layout, mesh: Mesh, rows: Ints) -> AxesAndArms:
    t = axis_vectors(layout, mesh, rows)
    kind = layout.kind[rows]
    R = turned(axes_of(t, layout.table["up"][kind]), layout.table["angle"][kind])
    span = np.linalg.norm(t, axis=1)
    zone = layout.zone[rows]
    end = layout.offset[rows] + (zone * [1.0, -1.0])[:, :, None] * R[:, None, 0]
    return R, end, span, span - zone.sum(axis=1)


def constants_at(layout: Layout, rows: Ints, x: Floats) -> Floats:
    """Return the constants of tapered lines at fractions x (b, q) of them, shape (b, q, 7)."""
    first, last = layout.along[rows].T[:, :, None]
    return tapered.between_knots(first + x * (last - first)) @ layout.knots[layout.taper[rows]]


def alike(members: Mapping[str, MemberProperties], mesh: Mesh, member: str) -> bool:
    """Return whether all elements of a member have the same matrices.

    They have where they are equally long, in one line, and without offsets, rigid zones and end connections.
    """
    layout, rows = layout_of(members, mesh), mesh.members[member]
    R, _, _, L = axes_and_arms(layout, mesh, rows)
    same = layout.plain[rows].all() and (layout.kind[rows] == layout.kind[rows[0]]).all()
    return bool(same and np.ptp(L) <= EQUAL * L[0] and np.abs(R - R[0]).max() <= EQUAL)


# Values by member's name, with the arrays that are made of them on a mesh -----------------------------------


T = TypeVar("T")

_MESHES = 8
"""Number of meshes for which arrays are kept."""


class ByMember(Mapping[str, T], Generic[T]):
    """Values by member's name that never change.

    Frames with other moduli share one such object. It owns the arrays that depend on its values and on a mesh
    alone, so that a fit forms them once.

    Parameters
    ----------
    values : mapping of str to T
        Copied, so that later changes of it do no harm.
    """

    __slots__ = ("_on_meshes", "_values")

    def __init__(self, values: Mapping[str, T]) -> None:
        self._values = dict(values)
        self._on_meshes = Recent(_MESHES)

    @classmethod
    def of(cls, values: Mapping[str, T]) -> "ByMember[T]":
        """Return values as such an object: themselves if they are one."""
        return values if isinstance(values, ByMember) else cls(values)

    def on(self, mesh: Mesh, make: Callable[["ByMember[T]", Mesh], Any]) -> Any:
        """Return ``make(self, mesh)``, kept for the last few meshes."""
        return self._on_meshes.get((make, mesh), lambda: make(self, mesh))

    def __getitem__(self, name: str) -> T:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    # the views of the dictionary itself: those of Mapping look every name up, and a frame has thousands

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def values(self) -> ValuesView[T]:
        """Return the values."""
        return self._values.values()

    def items(self) -> ItemsView[str, T]:
        """Return pairs of name and value."""
        return self._values.items()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._values!r})"


# Local axes of members: x along the axis, z towards the orientation, y completing them ----------------------


def local_axes(t: Floats, orientation: ArrayLike | None, member: str) -> Floats:
    """Return local axes as rows for line directions ``t`` (b, 3), shape (b, 3, 3).

    Raises
    ------
    ModelError
        If the orientation is parallel to the member.
    """
    up = np.full(3, np.nan) if orientation is None else np.asarray(orientation, dtype=float)
    if is_parallel(t, up).any():
        raise ModelError(parallel_message(member, up))
    return axes_of(t, np.broadcast_to(up, t.shape))


def is_parallel(t: Floats, up: Floats) -> Bools:
    """Return which directions t (…, 3) are parallel to orientations (…, 3); nan, the default, is not."""
    sizes = np.linalg.norm(t, axis=-1) * np.linalg.norm(up, axis=-1)
    return np.linalg.norm(np.cross(t, up), axis=-1) < 1e-6 * sizes


def parallel_message(member: str, orientation: Floats) -> str:
    """Return the message on an orientation along a member."""
    return f"member '{member}': its orientation {orientation.tolist()} is parallel to its axis"


def axes_of(t: Floats, up: Floats) -> Floats:
    """Return local axes as rows, (b, 3, 3), for directions t and orientations (b, 3), nan for the default."""
    x = t / np.linalg.norm(t, axis=1, keepdims=True)
    # within 1° of vertical, global Z gives no plane: X does
    usual = np.where(np.abs(x[:, 2:]) > np.cos(np.deg2rad(1.0)), [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
    up = np.where(np.isnan(up), usual, up)
    z = up - np.einsum("bi,bi->b", up, x)[:, None] * x
    z = z / np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=1)


def turned(R: Floats, angle: Floats) -> Floats:
    """Return local axes (b, 3, 3) turned about x by angles (b,) [rad], to the sections' principal axes."""
    if not angle.any():
        return R
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return np.stack([R[:, 0], c * R[:, 1] + s * R[:, 2], c * R[:, 2] - s * R[:, 1]], axis=1)
