"""A rotary inertia on a member at a position that may be estimated: a wheel, a flange, a box on a bracket."""

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from fem.declarations import Entry, Role, StiffnessAt
from fem.effects.on_member import AtPosition, position_between
from fem.effects.places import frame_of, framed_members, member_mass
from fem.model import Contribution, Model, Parameter, refuse_negative


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PointInertia(AtPosition):
    """A rotary inertia on the line of a member, alike about all axes: M = I NᵀN, N the rotations there.

    The mass of the same body is ``point_mass``. At a joint, ``joint_inertia`` is its twin.

    Attributes
    ----------
    member : str
    position : float
        Arc length from the member's first end [m].
    inertia : float
        I [kg·m²].
    length : float
        Length of the member [m].
    reference : float
        m L²/12 of the member, which sets the scale [kg·m²].
    """

    kind: ClassVar[str] = "point_inertia"
    role: ClassVar[Role] = Role.MASS
    entry: ClassVar[Entry | None] = Entry(
        quantities="`inertia` [kg·m²], `position` [m]",
        meaning="a rotary inertia anywhere along a member",
        places="along each member",
    )
    inertia: Any
    length: float
    reference: float

    def __post_init__(self) -> None:
        refuse_negative(self.name, inertia=(self.inertia, "kg·m²"))

    def parameters(self) -> tuple[Parameter, ...]:
        """Return inertia and position."""
        return (
            Parameter("inertia", "kg·m²", self.inertia, 0.0, 0.0, 20 * self.reference, linear=True),
            position_between(self.position, 0.0, self.length),
        )

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return I NᵀN with the beam's shape functions N for rotations."""
        dofs, N = frame_of(model).shapes_at(model.mesh, self.member, self.position)
        return (Contribution(dofs[None], M=(self.inertia * (N[3:].T @ N[3:]))[None]),)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Inertias of 0.003 to 30 % of the member's at 17 places along it; torsion feels the small ones."""
        return tuple(
            {"inertia": f * self.reference, "position": float(x * self.length)}
            for x in np.linspace(0.01, 0.99, 17)
            for f in (3e-5, 3e-4, 3e-3, 0.01, 0.03, 0.1, 0.3)
        )

    @classmethod
    def propose(cls, model: Model) -> tuple[Self, ...]:
        """Return one for each member."""
        out: list[Self] = []
        for m in framed_members(model):
            length = model.mesh.member_length(m)
            out.append(
                cls(
                    name=f"point_inertia:{m}",
                    member=m,
                    position=length / 2,
                    inertia=0.0,
                    length=length,
                    reference=member_mass(model, m) * length**2 / 12,
                )
            )
        return tuple(out)
