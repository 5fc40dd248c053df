"""A member that dissipates more than the others."""

from dataclasses import dataclass
from typing import Any, ClassVar

from fem.declarations import Entry, Role, StiffnessAt
from fem.effects.on_member import OnMember
from fem.effects.places import frame_of, framed_members, material_of
from fem.elements.frame import member_contribution
from fem.model import Contribution, Effect, Model, Parameter, ParameterRef


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MemberDamping(OnMember):
    """A loss factor of one member, beyond that of its material: D = η K.

    Where all members are alike it is the damping of the structure, which every fit has.

    Attributes
    ----------
    member : str
    loss_factor : float
        η [-].
    """

    kind: ClassVar[str] = "member_damping"
    role: ClassVar[Role] = Role.DISSIPATION
    entry: ClassVar[Entry | None] = Entry(
        quantities="`loss_factor` [-]",
        meaning="a loss factor of one member, beyond its material's",
        places="each member of several",
    )
    loss_factor: Any = 0.0

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the loss factor."""
        return (Parameter("loss_factor", "-", self.loss_factor, 0.0, 0.0, 2.0, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return η K of the member."""
        parts = member_contribution(frame_of(model), model, self.member)
        return tuple(Contribution(c.dofs, D=self.loss_factor * c.K) for c in parts if c.K is not None)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return Young's modulus of the member."""
        return material_of(model, self.member, "E")

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From 0.3 to 30 %."""
        return tuple({"loss_factor": f} for f in (0.003, 0.01, 0.03, 0.1, 0.3))

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each member of a structure that has several."""
        members = framed_members(model)
        return tuple(cls(name=f"member_damping:{m}", member=m) for m in members) if len(members) > 1 else ()
