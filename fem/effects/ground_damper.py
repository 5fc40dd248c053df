"""Dashpots from points of the structure to the ground that the model lacks: a damped suspension, a cable."""

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from fem.declarations import Entry, Role, StiffnessAt
from fem.effects.ground_spring import attachments
from fem.effects.places import OnPoint, typical_mass
from fem.elements.frame import Frame
from fem.model import DIRECTIONS, Contribution, Model, Parameter


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GroundDamper(OnPoint):
    """A dashpot to the ground in one global direction at one point: iωc.

    A spring and a dashpot in parallel are this and ``ground_spring``. Where the model holds the point,
    ``foundation_dashpot`` is the candidate.

    Attributes
    ----------
    direction : str
        One of x, y, z.
    damping : float
        c [N·s/m].
    reference : float
        A typical member's mass over a second, which sets the scale [N·s/m].
    """

    kind: ClassVar[str] = "ground_damper"
    role: ClassVar[Role] = Role.DISSIPATION
    entry: ClassVar[Entry | None] = Entry(
        quantities="`damping` [N·s/m]",
        meaning="a dashpot to the ground at a member's end or a joint",
        places="ends of members, and joints within them",
    )
    damping: Any
    reference: float

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the dashpot's constant."""
        top = 1e7 * self.reference
        return (Parameter("damping", "N·s/m", self.damping, 0.0, 0.0, top, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return c on the one DOF."""
        return (Contribution(self.dof, C=np.full((1, 1, 1), self.damping)),)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Dashpots that take a member's momentum in a second to ten microseconds."""
        return tuple({"damping": float(f * self.reference)} for f in np.geomspace(1.0, 1e5, 11))

    @classmethod
    def propose(cls, model: Model) -> tuple[Self, ...]:
        """Return the translations of :func:`fem.effects.ground_spring.attachments`, driven ones included."""
        m = typical_mass(model) if model.of_kind(Frame) else 0.0
        return tuple(
            cls(
                name=f"ground_damper:{label}.{d}",
                point=point,
                place=place,
                direction=d,
                damping=0.0,
                reference=m,
            )
            for point, place, label, d in attachments(model)
            if d in DIRECTIONS[:3]
        )
