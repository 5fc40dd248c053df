"""Connections of finite size: stiffer inside, and heavier or lighter, than members that meet in a point."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from fem.array_types import Floats
from fem.declarations import Entry, Role
from fem.effects.joint import PointPair
from fem.effects.on_stretches import OnStretches
from fem.effects.places import frame_of, is_bar, section_extent, sheared_frame
from fem.elements.frame import Frame
from fem.elements.stretches import mass_of_stretches
from fem.model import Contribution, Effect, Model, Parameter
from fem.recent import Recent
from fem.summary import listed
from fem.tabulated import TabulatedEffect

STIFFEST = 3.5
"""Logarithm of the factor by which a zone is stiffer, at most [-]: more is rigid."""
SOFTEST = -0.2
"""The same at least: connections of finite size are stiffer than centre lines."""
IN_PLANE = 2.0
"""Logarithm of the factor by which bending in the members' plane is stiffer or softer still, at most [-]."""
TWICE = float(np.log(2.0))
"""Logarithm of the factor of stiffness that is unusual around a joint [-]."""
_MESHES = 2
"""Number of frames and meshes whose masses an effect keeps."""
_ALONG = 0.94
"""Cosine of the angle up to which two members lie along each other."""
_FLAT, _SPANS = 0.2, 0.3
"""Members lie in a plane if the third singular value of their directions is less than the first of these, and
span it if the second one is more than the other [-]."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ZoneForm(OnStretches):
    """Stretches of members inside of a connection, stiffer by a factor e^u and heavier by a share.

    Where the members lie in a plane, bending in it is stiffer by e^(u + plane): a member that is welded to
    another holds it over its depth in this plane alone.

    Attributes
    ----------
    inside : tuple of (int, int)
        For each stretch the local force and moment of bending in the plane of the members, of 0 to 5; empty
        where they span space.
    u, plane : float
    mass : float
        Share of the stretches' mass that they have more [-].
    inertia : float
        Additional rotary inertia, since what connects members lies off their centre lines: a
        share of ∫ m s² ds along each stretch, s from the place of the connection [-].
    heavy : Recent
        Their mass and rotary inertia by frame and mesh; effects with other values share them.
    """

    kind: ClassVar[str] = "zone_form"
    is_form: ClassVar[bool] = True
    role: ClassVar[Role] = Role.GEOMETRY
    entry: ClassVar[Entry | None] = Entry(
        quantities="`u` [-], `mass` [-], `inertia` [-], `plane` [-]",
        meaning=(
            "stiffness e^u, in the members' plane e^(u + plane), mass and rotary inertia of the inside of a "
            "connection"
        ),
        places="each corner and each joint of members",
    )
    inside: tuple[tuple[int, int], ...] = ()
    u: Any = 0.0
    mass: Any = 0.0
    plane: Any = 0.0
    inertia: Any = 0.0
    heavy: Recent = field(default_factory=lambda: Recent(_MESHES), repr=False)

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the logarithm of the stiffness, the mass and, in a plane, that of bending in it."""
        usual = TWICE if self.around else np.inf
        out = (
            Parameter("u", "-", self.u, 0.0, SOFTEST, STIFFEST, usual_change=usual),
            Parameter("mass", "-", self.mass, 0.0, -1.0, 2.0, linear=True),
            Parameter("inertia", "-", self.inertia, 0.0, 0.0, 3.0, linear=True),
        )
        plane = Parameter("plane", "-", self.plane, 0.0, -IN_PLANE, IN_PLANE, usual_change=usual)
        return (*out, plane) if self.inside else out

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the stiffness and mass that the stretches gain."""
        return self.stiffer(model, self._kept(self.u, self.plane)), self._more(model)

    def tabulated(self, model: Model) -> TabulatedEffect | None:
        """Return tables of the stiffness and mass that the stretches gain."""
        low, high = SOFTEST - IN_PLANE, STIFFEST + IN_PLANE
        mass, inertia = self._heavy_on(model)
        masses = {"mass": mass, "inertia": inertia}
        return self.tabulated_on(model, self._kept, low, high, planar=bool(self.inside), masses=masses)

    def _kept(self, along: Any, plane: Any) -> Any:
        """Return the parts of their flexibility that the stretches keep."""
        u = np.full((len(self.zones), 6), along + 0 * plane)
        for k, bending in enumerate(self.inside):
            u[k, bending] += plane
        return np.exp(-u)

    def _more(self, model: Model) -> Contribution:
        """Return the mass and rotary inertia that the stretches gain."""
        m, J = self._heavy_on(model)
        return replace(m, M=self.mass * m.M + self.inertia * J.M)

    def _heavy_on(self, model: Model) -> tuple[Contribution, Contribution]:
        out: tuple[Contribution, Contribution] = self.heavy.get(
            (self.frame, model.mesh), partial(self._heavy, model)
        )
        return out

    def _heavy(self, model: Model) -> tuple[Contribution, Contribution]:
        """Return the mass of the stretches, and ∫ m s² ds as rotary inertia spread evenly over each."""
        mass, inertia = [], []
        for m, s, length, towards in self.zones:
            ends = m, min(s, s + towards * length), max(s, s + towards * length)
            mass.append((*ends, self.frame.mass_per_length(m)))
            inertia.append((*ends, self.frame.mass_per_length(m) * length**2 / 3))
        return (
            mass_of_stretches(self.frame, model, mass, (1, 1, 1, 0, 0, 0)),
            mass_of_stretches(self.frame, model, inertia, (0, 0, 0, 1, 1, 1)),
        )

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Return each corner and each joint."""
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
    members = {p: list(dict.fromkeys(m for m, *_ in here)) for p, here in at.items()}
    # Numbers of points count from 0, and are not those of a deck.
    groups = {p: ({p}, f"corner of {listed(names)}", "") for p, names in members.items() if len(names) > 1}
    for pair in model.of_kind(PointPair):
        ends = {pair.point1, pair.point2} - {None}
        known = next((g for g in groups.values() if g[0] & ends), None)
        if known:
            known[0].update(ends)
        else:
            groups[min(ends)] = (set(ends), f"joint {pair.name}", pair.name)
    taken: dict[str, list[tuple[float, float]]] = {}
    for number, (points, place, joint) in enumerate(groups.values()):
        arms = [arm for p in sorted(points) for arm in at.get(p, ())]
        zones = []
        for m, s, line in arms:
            along = axes[line][0]
            depths = [
                section_extent(model, other, axes[row], along)
                for other, _, row in arms
                if other != m and abs(axes[row][0] @ along) < _ALONG
            ]
            if depths:
                zones += _stretches(mesh.member_length(m), taken.setdefault(m, []), m, s, max(depths))
        if zones:
            normal = _normal(np.array([axes[line][0] for *_, line in arms]))
            of = {m: axes[line] for m, _, line in arms}
            inside = () if normal is None else tuple(_bending(of[m], normal) for m, *_ in zones)
            yield ZoneForm(
                name=f"zone_form:{number}",
                zones=tuple(zones),
                place=place,
                around=joint,
                frame=sheared_frame(model),
                inside=inside,
            )


def _normal(directions: Floats) -> Floats | None:
    """Return the normal of the plane that directions (n, 3) span; None if they span a line or space."""
    _, sizes, axes = np.linalg.svd(directions)
    across, out = (*sizes, 0.0, 0.0)[1:3]
    return axes[2] if across > _SPANS and out < _FLAT else None


def _bending(axes: Floats, normal: Floats) -> tuple[int, int]:
    """Return the local force and moment of a member's bending about the axis that is nearest to a normal."""
    return (2, 4) if abs(axes[1] @ normal) > abs(axes[2] @ normal) else (1, 5)


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
