"""Connections of finite size: stiffness and mass inside differ from those of members that end in points."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fem.declarations import Entry, Role
from fem.effects.joint import PointPair
from fem.effects.places import frame_of, is_bar, section_extent, sheared_frame
from fem.effects.support import Support
from fem.elements.frame import Frame
from fem.elements.stretches import mass_of_stretches, stiffening
from fem.model import Contribution, Effect, Model, Parameter, ParameterRef

STIFFEST = 3.5
"""Logarithm of the factor by which a zone is stiffer, at most [-]: more is rigid."""
SOFTEST = -0.2
"""The same at least: connections of finite size are stiffer than centre lines."""
SOFTEST_HELD = -1.5
"""The same where a support holds members: what holds them gives way. A member that ends on an elastic
half-space of its own material turns there as if it were longer by 0.3 of its depth, a logarithm of -0.5."""
_ALONG = 0.94
"""Cosine of the angle up to which two members lie along each other."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ZoneForm(Effect):
    """Stretches of members inside of a connection, stiffer by a factor e^u and heavier by a share.

    Attributes
    ----------
    zones : tuple of (str, float, float, int)
        Member, arc length at which a stretch begins, its length [m], and 1 or -1 for up or down the member.
    place : str
    frame : Frame
        Of the model that it was proposed for: moduli that are a little otherwise hardly matter here.
    held : bool
        Whether a support holds the connection: its mass does not move.
    u : float
    mass : float
        Share of the stretches' mass that they have more [-].
    """

    kind: ClassVar[str] = "zone_form"
    is_form: ClassVar[bool] = True
    role: ClassVar[Role] = Role.GEOMETRY
    entry: ClassVar[Entry | None] = Entry(
        quantities="`u` [-], `mass` [-]",
        meaning="stiffness e^u and mass of the inside of a connection of finite size",
        places="each corner and each joint of members, and each support that holds against turning",
    )
    zones: tuple[tuple[str, float, float, int], ...]
    place: str
    frame: Frame
    held: bool = False
    u: Any = 0.0
    mass: Any = 0.0

    @property
    def where(self) -> str:
        """The connection."""
        return self.place

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the logarithm of the stiffness and, where it can move, the mass."""
        u = Parameter("u", "-", self.u, 0.0, SOFTEST_HELD if self.held else SOFTEST, STIFFEST)
        mass = Parameter("mass", "-", self.mass, 0.0, -1.0, 2.0, linear=True)
        return (u,) if self.held else (u, mass)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the stiffness and mass that the stretches gain."""
        frame = self.frame
        stiff = stiffening(frame, model, self.zones, np.exp(-self.u))
        ends = [
            (m, min(s, s + towards * length), max(s, s + towards * length), frame.mass_per_length(m))
            for m, s, length, towards in self.zones
        ]
        heavy = mass_of_stretches(frame, model, ends, (1, 1, 1, 0, 0, 0))
        return stiff, Contribution(heavy.dofs, M=self.mass * heavy.M)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return nothing: the moduli are those of the frame that it holds."""
        return ()

    def locations(self, model: Model) -> NDArray[np.float64]:
        """Return where the stretches begin, (n, 3) [m]."""
        mesh = model.mesh
        return np.array([mesh.point_at(mesh.locate(m, s)) for m, s, _, _ in self.zones])

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Return each corner and each joint, and each support that holds against turning."""
        return tuple(_zones(model)) if model.of_kind(Frame) else ()


def _zones(model: Model) -> Iterator[ZoneForm]:
    mesh, frame = model.mesh, frame_of(model)
    axes = frame.rotations(mesh)
    at: dict[int, list[tuple[str, float, int]]] = {}
    for m in mesh.members:
        if is_bar(model, m):
            continue
        for k, (p, s) in enumerate(zip(mesh.member_points(m), mesh.member_positions(m), strict=True)):
            at.setdefault(int(p), []).append(
                (m, float(s), int(mesh.members[m][min(k, len(mesh.members[m]) - 1)]))
            )
    groups = {p: ({p}, f"corner at point {p}") for p, here in at.items() if len({m for m, *_ in here}) > 1}
    for pair in model.of_kind(PointPair):
        ends = {pair.point1, pair.point2} - {None}
        known = next((g for g in groups.values() if g[0] & ends), None)
        if known:
            known[0].update(ends)
        else:
            groups[min(ends)] = (set(ends), f"joint {pair.name}")
    holding = {s.point: s for s in model.of_kind(Support) if set("xyz") < set(s.fixed)}
    for p, support in holding.items():
        if p in at and not any(p in points for points, _ in groups.values()):
            groups[p] = ({p}, support.where)
    taken: dict[str, list[tuple[float, float]]] = {}
    for number, (points, place) in enumerate(groups.values()):
        arms = [arm for p in sorted(points) for arm in at.get(p, ())]
        zones = []
        for m, s, line in arms:
            along = axes[line][0]
            depths = [
                section_extent(model, other, axes[row], along)
                for other, _, row in arms
                if other != m and abs(axes[row][0] @ along) < _ALONG
            ]
            if points & set(holding):
                depths += [section_extent(model, m, axes[line], side) for side in axes[line][1:]]
            if depths:
                zones += _stretches(mesh.member_length(m), taken.setdefault(m, []), m, s, max(depths))
        if zones:
            yield ZoneForm(
                name=f"zone_form:{number}",
                zones=tuple(zones),
                place=place,
                frame=sheared_frame(model),
                held=bool(points & set(holding)),
            )


def _stretches(
    length: float, taken: list[tuple[float, float]], m: str, s: float, depth: float
) -> Sequence[tuple[str, float, float, int]]:
    """Return the stretches of a member on both sides of a place that no other connection has."""
    out = []
    for towards in (-1, 1):
        room = length - s if towards > 0 else s
        for a, b in taken:
            beyond = (a - s) if towards > 0 else (s - b)
            if beyond > -1e-9:
                room = min(room, beyond)
        reach = min(depth, 0.45 * room)
        if reach > 1e-3 * length:
            out.append((m, s, reach, towards))
    taken.append((s - depth if s > depth else 0.0, min(s + depth, length)))
    return out
