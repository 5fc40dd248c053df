"""Clamped ends: what holds them gives way, and they turn as if they were a little longer."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fem.declarations import Entry, Role
from fem.effects.places import frame_of, is_bar, section_extent, sheared_frame
from fem.effects.rebasing import as_before
from fem.effects.support import Support
from fem.elements.frame import Frame
from fem.elements.stretches import stiffening
from fem.model import Contribution, Effect, Model, Parameter, ParameterRef

LEAST_U, MOST_U = -1.5, 3.5
"""Least and largest logarithm of a stretch's stiffness [-]."""
REACH = 0.5
"""Length of the stretch, in parts of how far the section reaches from its axis [-].

A member that ends on an elastic half-space of its own material turns there as if it were longer by 0.34 of
its depth (a rigid square, Dobry and Gazetas), a logarithm of -0.9.
"""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ClampForm(Effect):
    """The first stretch of a member from where a support holds it, stiffer by a factor e^u.

    Attributes
    ----------
    zones : tuple of (str, float, float, int)
        Member, arc length of the support, length of the stretch [m], and 1 or -1 for up or down the member.
    shares : tuple of (float, ...)
        For each of them the parts of the change that flexibilities to the six local forces and moments take:
        less in the plane in which the section reaches less far [-].
    place : str
    frame : Frame
        Of the model that it was proposed for: moduli that are a little otherwise hardly matter here.
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
    zones: tuple[tuple[str, float, float, int], ...]
    shares: tuple[tuple[float, ...], ...]
    place: str
    frame: Frame
    u: Any = 0.0

    @property
    def where(self) -> str:
        """The support."""
        return self.place

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the logarithm of the stiffness."""
        return (Parameter("u", "-", self.u, 0.0, LEAST_U, MOST_U),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the stiffness that the stretches gain."""
        kept = 1 + np.array(self.shares) * (np.exp(-self.u) - 1)
        return (stiffening(self.frame, model, self.zones, kept),)

    def rebased(self, model: Model) -> "ClampForm":
        """Return the effect that adds the same stiffness, on a frame with the model's present moduli."""
        new = replace(self, frame=sheared_frame(model))
        return as_before(self, new, model)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return nothing: the moduli are those of the frame that it holds."""
        return ()

    def locations(self, model: Model) -> NDArray[np.float64]:
        """Return where the stretches begin, (n, 3) [m]."""
        mesh = model.mesh
        return np.array([mesh.point_at(mesh.locate(m, s)) for m, s, _, _ in self.zones])

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
        own = axes[mesh.members[m][min(at, len(mesh.members[m]) - 1)]]
        along_y, along_z = (section_extent(model, m, own, side) for side in own[1:])
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
            frame=frame,
        )
