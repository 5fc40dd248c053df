"""Ends of members that are nearly rigid: corners of finite size, gussets, the inside of a joint."""

from dataclasses import dataclass
from typing import Any, ClassVar

from fem.array_types import Floats
from fem.declarations import Entry, Marker, Role, Site, StiffnessAt
from fem.effects.joint import PointPair
from fem.effects.places import (
    elements_of,
    frame_of,
    is_bar,
    member_ends,
    n_lines_at,
    reaches,
    sheared_frame,
)
from fem.elements.frame import Frame
from fem.elements.stretches import stiffening
from fem.model import Contribution, Effect, Model, Parameter, ParameterRef

_FLEXIBILITY = 0.01
"""Part of its flexibility that a zone keeps: its length is overestimated by that much."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RigidEndZone(Effect):
    """A stretch at members' ends that keeps a hundredth of its flexibility (:meth:`Frame.stiffened`).

    It begins where the model's rigid zone ends, if there is one, and has the member's mass. Its length is the
    same at all its ends. A zone at one end stiffens the member much like ``member_stiffness`` in the lowest
    modes.

    Attributes
    ----------
    ends : tuple of (str, int)
        Members and their ends, 1 or 2.
    length : float
        Of each zone [m].
    longest : float
        Bound of the length [m].
    """

    kind: ClassVar[str] = "rigid_end_zone"
    role: ClassVar[Role] = Role.GEOMETRY
    marker: ClassVar[Marker | None] = Marker("thin_diamond", "sky")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`length` [m]",
        meaning="nearly rigid stretches at joined ends of members",
        places="each joined end of a member, and all alike",
    )
    ends: tuple[tuple[str, int], ...]
    length: Any
    longest: float

    @property
    def where(self) -> Site:
        """The end, or how many."""
        if len(self.ends) == 1:
            ((member, end),) = self.ends
            return Site(f"end {end} of member {member}")
        return Site(f"{len(self.ends)} joined ends of members")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the length."""
        return (Parameter("length", "m", self.length, 0.0, 0.0, self.longest),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the stiffness that the zones gain."""
        frame, zones = sheared_frame(model), []
        for m, end in self.ends:
            p, member_length = frame.members[m], model.mesh.member_length(m)
            start, towards = (p.rigid1, 1) if end == 1 else (member_length - p.rigid2, -1)
            zones.append((m, start, self.length, towards))
        return (stiffening(frame, model, zones, _FLEXIBILITY),)

    def alters(self, model: Model, member: str, line: int | None = None) -> bool:
        """Whether a zone may be on the line."""
        return any(
            m == member and reaches(model, m, line, *self._room(model, m, end)) for m, end in self.ends
        )

    def _room(self, model: Model, member: str, end: int) -> tuple[float, float]:
        """Return where a zone begins, and how far it may go up the member [m]."""
        p, member_length = frame_of(model).members[member], model.mesh.member_length(member)
        return (p.rigid1, self.longest) if end == 1 else (member_length - p.rigid2, -self.longest)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the parameters on which the members' stiffness depends."""
        return tuple(dict.fromkeys(ref for m, _ in self.ends for ref in elements_of(model, m, "E")))

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From 2 to 80 % of the longest."""
        return tuple({"length": f * self.longest} for f in (0.02, 0.05, 0.1, 0.2, 0.4, 0.8))

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each end of a member, other than a bar, that is welded, jointed or fixed, and all of them alike."""
        if not model.of_kind(Frame):
            return ()
        count = n_lines_at(model)
        joined = {p for j in model.of_kind(PointPair) for p in (j.point1, j.point2) if p is not None}
        constrained = [c.dofs for c in model.constraints() if not c.everywhere]
        joined |= {int(dof) // 6 for dofs in constrained for dof in dofs}
        ends = [
            (m, end, 0.2 * model.mesh.member_length(m))
            for m, end, point in member_ends(model)
            if (count[point] > 1 or point in joined) and not is_bar(model, m)
        ]
        groups: list[tuple[tuple[str, int], ...]] = [((m, end),) for m, end, _ in ends]
        longest = [length for _, _, length in ends]
        names = [f"rigid_end_zone:{m}.{end}" for m, end, _ in ends]
        if len(ends) > 1:
            groups.append(tuple((m, end) for m, end, _ in ends))
            longest.append(min(longest))
            names.append("rigid_end_zone:all")
        return tuple(
            cls(name=name, ends=group, length=0.0, longest=most)
            for name, group, most in zip(names, groups, longest, strict=True)
        )

    def locations(self, model: Model) -> Floats:
        """Return the ends."""
        points = [model.mesh.member_points(m)[0 if end == 1 else -1] for m, end in self.ends]
        return model.mesh.points[points]
