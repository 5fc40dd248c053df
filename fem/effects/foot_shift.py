"""An elastic foot that stands at another place of its member."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fem.declarations import Entry, Marker, Role
from fem.effects.joint import Joint
from fem.effects.mounting import REACH, OnSide, is_foot, sides_of
from fem.effects.places import frame_of
from fem.model import (
    Array,
    Effect,
    Model,
    lever_matrix,
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FootShift(OnSide):
    """An elastic foot that stands at another place of its member."""

    kind: ClassVar[str] = "foot_shift"
    evidence_only: ClassVar[bool] = True
    role: ClassVar[Role] = Role.GEOMETRY
    marker: ClassVar[Marker | None] = Marker("square", "orange")
    statement: ClassVar[str] = "{thing} stands further along the member"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`amount` [m]",
        meaning="an elastic foot that stands at another place of its member",
        places="each elastic foot",
    )

    @property
    def where(self) -> str:
        """Joint and member."""
        return f"joint {self.joint}, member {self.member}"

    def moved_rows(self, model: Model, joint: Joint) -> tuple[NDArray[np.int64], Array]:
        """Return DOFs and rows of the motion of the side that is moved."""
        point = joint.point1 if self.side == 1 else joint.point2
        assert point is not None
        dofs, N = frame_of(model).shapes_at(model.mesh, self.member, self.at + self.amount)
        return dofs, lever_matrix(joint.location - model.mesh.points[point]) @ N

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Return each elastic foot."""
        out = []
        for joint, side, member, at in sides_of(model):
            if is_foot(joint) is True:
                length = model.mesh.member_length(member)
                reach = REACH * length
                out.append(
                    cls(
                        name=f"{cls.kind}:{joint.name}.{member}", joint=joint.name, side=side, member=member,
                        at=at, amount=0.0, lower=-min(at, reach), upper=min(length - at, reach),
                        scale=0.35 * reach,
                    )
                )  # fmt: skip
        return tuple(out)
