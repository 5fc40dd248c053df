"""Clamped ends: what holds them gives way, and they turn as if they were a little longer."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.declarations import Entry, Role
from fem.effects.on_stretches import OnStretches
from fem.effects.places import frame_of, is_bar, section_extent, sheared_frame
from fem.effects.support import Support
from fem.elements.frame import Frame
from fem.model import Contribution, Effect, Model, Parameter
from fem.tabulated import TabulatedEffect

LEAST_U, MOST_U = -1.5, 3.5
"""Least and largest logarithm of a stretch's stiffness [-]."""
REACH = 0.5
"""Length of the stretch, in parts of how far the section reaches from its axis [-].

A member that ends on an elastic half-space of the same material turns there as if it were longer by 0.34 of
its depth (a rigid square, Dobry and Gazetas), a logarithm of -0.9.
"""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ClampForm(OnStretches):
    """The first stretch of a member from where a support holds it, stiffer by a factor e^u.

    Attributes
    ----------
    shares : tuple of (float, ...)
        For each stretch the parts of the change that flexibilities to the six local forces and moments take:
        less in the plane in which the section reaches less far [-].
    u : float
    """

    kind: ClassVar[str] = "clamp_form"
    is_form: ClassVar[bool] = True
    role: ClassVar[Role] = Role.GEOMETRY
    entry: ClassVar[Entry | None] = Entry(
        quantities="`u` [-]",
        meaning="stiffness e^u of the first stretch of a clamped member",
        places="each support that holds a member in all directions and against turning",
    )
    shares: tuple[tuple[float, ...], ...] = ()
    u: Any = 0.0

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the logarithm of the stiffness."""
        return (Parameter("u", "-", self.u, 0.0, LEAST_U, MOST_U),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the stiffness that the stretches gain."""
        return (self.stiffer(model, self._kept(self.u)),)

    def tabulated(self, model: Model) -> TabulatedEffect | None:
        """Return tables of the stiffness that the stretches gain."""
        return self.tabulated_on(model, lambda u, _: self._kept(u), LEAST_U, MOST_U, planar=False)

    def _kept(self, u: Any) -> Any:
        """Return the parts of their flexibility that the stretches keep."""
        return 1 + np.array(self.shares) * (np.exp(-u) - 1)

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Return each support that holds one member against turning."""
        return tuple(_clamps(model)) if model.of_kind(Frame) else ()


def _clamps(model: Model) -> Iterator[ClampForm]:
    mesh = model.mesh
    axes, frame = frame_of(model).rotations(mesh), sheared_frame(model)
    for support in model.of_kind(Support):
        members = [m for m in mesh.members if support.point in mesh.member_points(m)]
        if len(members) != 1 or is_bar(model, members[0]) or not set("xyz") < set(support.fixed):
            continue
        (m,) = members
        at = list(mesh.member_points(m)).index(support.point)
        line_axes = axes[mesh.members[m][min(at, len(mesh.members[m]) - 1)]]
        along_y, along_z = (section_extent(model, m, line_axes, side) for side in line_axes[1:])
        largest = max(along_y, along_z)
        y, z = along_y / largest, along_z / largest
        s, length = float(mesh.member_positions(m)[at]), mesh.member_length(m)
        reach, p = min(REACH * largest, 0.45 * length), frame.members[m]
        first, last = s + p.rigid1 * (at == 0), s - p.rigid2 * (at == len(mesh.member_points(m)) - 1)
        zones = [
            (m, start, reach, way)
            for way, start, room in ((-1, last, s), (1, first, length - s))
            if room > reach
        ]
        yield ClampForm(
            name=f"clamp_form:{support.name}",
            zones=tuple(zones),
            shares=((1.0, y, z, 1.0, z, y),) * len(zones),
            place=support.where,
            around=support.name,
            frame=frame,
        )
