"""Corners of finite size: the common volume of two welded members is one body, and nearly rigid."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fem.array_types import Floats
from fem.declarations import Entry, Marker, Role, Site, StiffnessAt
from fem.effects.places import elements_of, frame_of, is_bar, reaches, section_extent, sheared_frame
from fem.elements.frame import Frame
from fem.elements.stretches import at_least, mass_of_stretches, stiffening
from fem.model import Contribution, Effect, Model, Parameter, ParameterRef

_FLEXIBILITY = 0.01
"""Part of its flexibility that a stretch inside of a corner keeps [-]."""
_LEAST_SINE = 0.35
"""Members that meet at a smaller angle lie along each other: such corners are left out."""
_COLLINEAR = 0.05
"""Sine of the angle up to which two ends are one member that goes through."""


class _Arm(NamedTuple):
    """A member on one side of a corner: it begins there at an arc length and goes up or down."""

    member: str
    start: float
    towards: int
    axis: Floats
    line: int


class _Zone(NamedTuple):
    """A stretch inside of a corner: member, where it begins, which way, half the depth around it.

    ``factor`` is the share of the rigid-zone factor that holds for it, ``overlap`` that of its mass which
    another member has, too, ``longest`` how long it may become.
    """

    member: str
    start: float
    towards: int
    depth: float
    factor: float
    overlap: float
    longest: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SolidCorner(Effect):
    """Welded corners whose members have a depth.

    Drawn by its centre lines, a member that ends on another has its last stretch inside of that one: as long
    as half the other's depth d, its mass is counted twice, and it bends less than a bar by itself. Of the
    length ``size`` d the mass is taken away; ``rigid_zone_factor`` of it is nearly rigid (as end offsets in
    programs for buildings: CSI Analysis Reference Manual, The Frame Element, where it is called rigid-end
    factor), and of a member that goes through half of that on both sides, by the depth of the others.
    Zones that the model has already count: only the part beyond them is added.

    Where nothing goes through, n members that end in one point fill n / 2 blocks of one: each stretch has
    1 - 2 / n of its mass too much, and two have none.

    Attributes
    ----------
    zones : tuple of _Zone
    n_corners : int
    size : float
        Size of the corners relative to that of centre lines and sections [-].
    rigid_zone_factor : float
        Part of it that is nearly rigid [-].
    """

    kind: ClassVar[str] = "solid_corner"
    is_form: ClassVar[bool] = True
    role: ClassVar[Role] = Role.GEOMETRY
    marker: ClassVar[Marker | None] = Marker("square", "purple")
    statement: ClassVar[str] = "the structure has solid corners, whose size a model of centre lines neglects"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`size` [-], `rigid_zone_factor` [-]",
        meaning=(
            "welded corners of finite size: as many times as large as the sections say, and which "
            "part of that is nearly rigid. A study states it; no search proposes it"
        ),
        places="all points where members with an outline are welded, together",
    )
    zones: tuple[_Zone, ...]
    n_corners: int
    size: Any = 0.0
    rigid_zone_factor: Any = 0.65

    @property
    def where(self) -> Site:
        """The number of corners."""
        return Site(f"{self.n_corners} welded corners" if self.n_corners > 1 else "the welded corner")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return size and rigid-zone factor."""
        factor = self.rigid_zone_factor
        return (
            Parameter("size", "-", self.size, 0.0, 0.0, 2.0),
            Parameter("rigid_zone_factor", "-", factor, factor, 0.2, 1.0),
        )

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the stiffness that the zones gain, and the mass that they lose."""
        frame, stiffer, lighter = sheared_frame(model), [], []
        density = {m: frame.mass_per_length(m) for m in {z.member for z in self.zones}}
        for z in self.zones:
            inside = _at_most(self.size * z.depth, z.longest)
            reach = at_least(inside, 1e-9 * z.longest)
            stiffer.append((z.member, z.start, z.factor * self.rigid_zone_factor * inside, z.towards))
            if z.overlap:
                ends = sorted((z.start, z.start + z.towards * reach), key=np.real)
                lighter.append((z.member, *ends, -z.overlap * density[z.member] * (inside / reach)))
        out = (stiffening(frame, model, stiffer, _FLEXIBILITY),)
        return (*out, mass_of_stretches(frame, model, lighter, (1, 1, 1, 0, 0, 0))) if lighter else out

    def alters(self, model: Model, member: str, line: int | None = None) -> bool:
        """Whether a zone may be on the line."""
        length = model.mesh.member_length(member)
        return any(
            z.member == member and reaches(model, member, line, z.start, z.towards * min(z.longest, length))
            for z in self.zones
        )

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the parameters on which the members' elements depend."""
        members = dict.fromkeys(z.member for z in self.zones)
        return tuple(dict.fromkeys(ref for m in members for ref in elements_of(model, m, "E", "rho")))

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From a tenth to one and a half of the size by the sections."""
        factor = float(np.real(self.rigid_zone_factor))
        return tuple({"size": s, "rigid_zone_factor": factor} for s in (0.1, 0.25, 0.5, 1.0, 1.5))

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """All corners alike, if the sections of their members have outlines and none have a size yet."""
        if not model.of_kind(Frame) or model.of_kind(cls):
            return ()
        corners = [zones for arms in _corners(model) if (zones := _zones(model, arms))]
        if not corners:
            return ()
        zones = _apart(model, [z for corner in corners for z in corner])
        return (cls(name="solid_corner:all", zones=zones, n_corners=len(corners)),)

    def locations(self, model: Model) -> Floats:
        """Return the corners."""
        places = {(z.member, z.start) for z in self.zones}
        points = [model.mesh.point_at(model.mesh.locate(m, s)) for m, s in sorted(places)]
        return np.unique(np.round(points, 9), axis=0)


def _at_most(length: Any, longest: float) -> Any:
    """Return a length that may be complex, cut to a longest."""
    return length if np.real(length) < longest else longest


def _corners(model: Model) -> Iterator[list[_Arm]]:
    """Yield the arms of each point of the mesh at which members meet.

    Not of bars, of members that taper, whose depth changes, or that are offset, which may end at the surface.
    """
    mesh, frame = model.mesh, frame_of(model)
    axes = frame.rotations(mesh)[:, 0]
    at: dict[int, list[_Arm]] = {}
    for member in mesh.members:
        p = frame.members[member]
        if is_bar(model, member) or p.section2 is not None or np.any(p.offset1) or np.any(p.offset2):
            continue
        points, s, lines = mesh.member_points(member), mesh.member_positions(member), mesh.members[member]
        loose = p.end_stiffness < np.inf
        for k, point in enumerate(points):
            if (k == 0 and loose[:6].any()) or (k == len(points) - 1 and loose[6:].any()):
                continue  # a hinge or spring lies between the end and the corner
            here = at.setdefault(int(point), [])
            if k < len(lines):
                here.append(_Arm(member, float(s[k]), 1, axes[lines[k]], int(lines[k])))
            if k > 0:
                here.append(_Arm(member, float(s[k]), -1, -axes[lines[k - 1]], int(lines[k - 1])))
    for arms in at.values():
        if any(_meet(a, b) for a in arms for b in arms):
            yield arms


def _meet(a: _Arm, b: _Arm) -> bool:
    """Whether two arms are of different members, at an angle: one that is curved has no corners."""
    return a.member != b.member and bool(np.linalg.norm(np.cross(a.axis, b.axis)) > _LEAST_SINE)


def _goes_on(a: _Arm, b: _Arm) -> bool:
    """Whether an arm goes on in another: the same member's, or one in line with it."""
    in_line = a.axis @ b.axis < -np.sqrt(1 - _COLLINEAR**2)
    return a is not b and (a.member == b.member or bool(in_line))


def _zones(model: Model, arms: list[_Arm]) -> list[_Zone]:
    """Return the parts of a corner's arms inside of others; nothing where a section has no outline."""
    through = [any(_goes_on(a, b) for b in arms) for a in arms]
    areas = [frame_of(model).members[a.member].section.A for a in arms]
    first = max((k for k, yes in enumerate(through) if yes), key=lambda k: areas[k], default=None)
    out = []
    for k, arm in enumerate(arms):
        depth = max((_half_depth(model, b, arm.axis) for b in arms if _meet(arm, b)), default=0.0)
        overlap = 1 - 2 / len(arms) if first is None else float(k != first and not _goes_on(arm, arms[first]))
        if depth > 0:
            # Share of the rigid-zone factor that holds for a member that goes through: the others hold it on
            # one side only [-]
            factor = 0.5 if through[k] else 1.0
            out.append(_Zone(arm.member, arm.start, arm.towards, depth, factor, overlap, np.inf))
    return out


def _half_depth(model: Model, arm: _Arm, along: Floats) -> float:
    """Return how far one goes from an arm's axis along another to its surface; 0 without an outline [m]."""
    frame = frame_of(model)
    if not frame.members[arm.member].section.outlines:
        return 0.0
    axes = frame.rotations(model.mesh, [arm.line])[0]
    return section_extent(model, arm.member, axes, along) / float(np.linalg.norm(axes[1:] @ along))


def _apart(model: Model, zones: list[_Zone]) -> tuple[_Zone, ...]:
    """Return zones that cannot reach those of the next corner of their member."""
    places: dict[str, set[float]] = {}
    for z in zones:
        places.setdefault(z.member, set()).add(z.start)
    out = []
    for z in zones:
        beyond = [abs(s - z.start) for s in places[z.member] if (s - z.start) * z.towards > 0]
        length = model.mesh.member_length(z.member)
        room = min([length - z.start if z.towards > 0 else z.start, *(0.5 * b for b in beyond)])
        out.append(z._replace(longest=0.9 * room))
    return tuple(out)
