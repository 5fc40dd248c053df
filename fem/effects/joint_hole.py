"""A hole of a joint that is not on the centre line of one of its parts."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fem.array_types import Floats
from fem.declarations import Entry, Marker, Role, Site
from fem.effects.joint import Joint
from fem.effects.mounting import OnSide, is_foot, sides_of
from fem.effects.places import frame_of
from fem.elements.inner_place import InnerPlace, node_place
from fem.model import Array, Effect, Model, lever_matrix


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointHole(OnSide):
    """A hole off the centre line of one part: the lever on its side alone is longer.

    Attributes
    ----------
    direction : str
        y or z of the member.
    across : ndarray (3,)
        That, global.
    """

    kind: ClassVar[str] = "joint_hole"
    role: ClassVar[Role] = Role.GEOMETRY
    marker: ClassVar[Marker | None] = Marker("diamond", "orange")
    statement: ClassVar[str] = "{thing} has its hole off the centre line"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`amount` [m]",
        meaning="a joint whose hole lies off the centre line of one part; the other part stays",
        places="each side of each elastic joint, both directions across the member",
    )
    direction: str
    across: Floats

    @property
    def where(self) -> Site:
        """Joint, member and direction."""
        return Site(f"joint {self.joint}, member {self.member}", detail=f"along local {self.direction}")

    def place(self, model: Model) -> InnerPlace:
        """Return the point of the side, which stays."""
        joint = model.effect(self.joint)
        assert isinstance(joint, Joint)
        point = joint.point1 if self.side == 1 else joint.point2
        assert point is not None
        return node_place(point)

    def arm(self, model: Model, joint: Joint) -> Array:
        """Return the motion of the side at the hole."""
        # affine in the arm, so that the amount may be complex for derivatives
        step = lever_matrix(self.across) - lever_matrix(np.zeros(3))
        return super(JointHole, self).arm(model, joint) + self.amount * step

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Return both directions across the member for each side of each joint of two parts."""
        out = []
        for joint, side, here in sides_of(model):
            if is_foot(joint) or len(here) > 1:
                continue
            ((member, at),) = here
            size = float(np.sqrt(frame_of(model).members[member].section.A))
            axes = frame_of(model).rotations(model.mesh, [int(model.mesh.members[member][0])])[0]
            for d, across in zip("yz", axes[1:], strict=True):
                out.append(
                    cls(
                        name=f"joint_hole:{joint.name}.{member}.{d}",
                        joint=joint.name,
                        side=side,
                        member=member,
                        at=at,
                        amount=0.0,
                        lower=-2 * size,
                        upper=2 * size,
                        direction=d,
                        across=across,
                    )
                )
        return tuple(out)
