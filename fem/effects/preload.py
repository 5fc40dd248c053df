"""An axial force in a member that stiffens or softens its bending."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.declarations import Entry, Marker, Relevant, Role, StiffnessAt
from fem.effects.on_member import WithinMember
from fem.effects.places import stiffness_of_sprung
from fem.elements.frame import Frame
from fem.model import Contribution, Effect, Model, Parameter, ParameterRef


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Preload(WithinMember):
    """A constant tension in one member: ∫ N (v'² + w'² + (Iy + Iz)/A a'²) dx, a the twist.

    Attributes
    ----------
    member : str
    tension : float
        N, positive in tension [N].
    buckling : float
        Euler's load of the member pinned at both ends, which sets the scale [N].
    """

    kind: ClassVar[str] = "preload"
    role: ClassVar[Role] = Role.INITIAL_STRESS
    marker: ClassVar[Marker | None] = Marker("plus", "sky")
    statement: ClassVar[str] = "{where} is under {tension} that the model lacks"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`tension` [N]",
        meaning="an axial force in a member that stiffens or softens its bending",
        places="each member of several",
    )
    tension: Any
    buckling: float

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the tension."""
        return (
            Parameter(
                "tension", "N", self.tension, 0.0, -3.5 * self.buckling, 500 * self.buckling, linear=True
            ),
        )

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the geometric stiffness."""
        (frame,) = model.of_kind(Frame)
        return (frame.geometric_stiffness(model, self.member, self.tension),)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return Young's modulus of a member on springs."""
        return stiffness_of_sprung(model, self.member)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Compression up to the buckling load pinned, tension up to a hundred times that."""
        down = (-0.9, -0.3, -0.1, -0.03, -0.01, -0.003)
        up = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
        return tuple({"tension": f * self.buckling} for f in (*down, *up))

    def relevant(self, sizes: Relevant, mass: float, scale: StiffnessAt) -> float | None:
        """Return a relevant share of the load under which the member buckles, as tension."""
        return sizes.members * self.buckling

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Return each member of a structure that has several."""
        (frame,) = model.of_kind(Frame)
        members = list(model.mesh.members)
        if len(members) < 2:
            return ()
        out = []
        for member in members:
            p, length = frame.members[member], model.mesh.member_length(member)
            euler = np.pi**2 * p.material.E * min(p.section.Iy, p.section.Iz) / length**2
            out.append(cls(name=f"preload:{member}", member=member, tension=0.0, buckling=euler))
        return tuple(out)
