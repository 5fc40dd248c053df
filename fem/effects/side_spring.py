"""A spring to the ground somewhere along a member: a stop, a hanger, a guide, an elastic support."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from fem.declarations import Entry, Role, Site, StiffnessAt, Yardstick
from fem.effects.on_member import AtPosition, position_between
from fem.effects.places import bending_members, frame_of, odd_stiffness, typical_stiffness
from fem.model import Contribution, Model, Parameter


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SideSpring(AtPosition):
    """A spring to the ground across a member at a position that may be estimated.

    K = k nᵀn, n the motion along the section's axis there. At a member's end ``ground_spring`` is its twin;
    a spring along the member is that of its end while the member is stiff along itself.

    Attributes
    ----------
    member : str
    direction : str
        y or z, local.
    position : float
        Arc length from the member's first end [m].
    stiffness : float
        k [N/m].
    length : float
        Length of the member [m].
    reference : float
        Bending stiffness of a typical member, which sets the scale [N/m].
    """

    kind: ClassVar[str] = "side_spring"
    role: ClassVar[Role] = Role.STIFFNESS
    entry: ClassVar[Entry | None] = Entry(
        quantities="`stiffness` [N/m], `position` [m]",
        meaning="a spring to the ground across a member, anywhere along it",
        places="along each member, across it along both axes",
    )
    connection: ClassVar[bool] = True
    direction: str
    stiffness: Any
    length: float
    reference: float

    @property
    def where(self) -> Site:
        """Member, position and direction."""
        return Site(f"member {self.member}", self.position, f"along local {self.direction}")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return stiffness and position, which keeps off the ends."""
        edge = 0.03 * self.length
        return (
            Parameter("stiffness", "N/m", self.stiffness, 0.0, 0.0, 1e8 * self.reference, linear=True),
            position_between(self.position, edge, self.length - edge),
        )

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return k nᵀn with the beam's shape functions."""
        mesh = model.mesh
        dofs, N = frame_of(model).shapes_at(mesh, self.member, self.position)
        line = mesh.locate(self.member, float(np.real(self.position))).line
        n = frame_of(model).rotations(mesh, [line])[0]["xyz".index(self.direction)] @ N[:3]
        return (Contribution(dofs[None], (self.stiffness * np.outer(n, n))[None]),)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From a soft suspension to a support, at nine places."""
        return tuple(
            {"stiffness": float(f * self.reference), "position": float(x * self.length)}
            for x in np.linspace(0.06, 0.94, 9)
            for f in (1e-2, 0.3, 10.0, 1e3)
        )

    @classmethod
    def propose(cls, model: Model) -> tuple[Self, ...]:
        """Return both axes of each member that bends."""
        members = bending_members(model)
        reference = typical_stiffness(model, "x") if members else 0.0
        return tuple(
            cls(
                name=f"side_spring:{m}.{d}",
                member=m,
                direction=d,
                position=length / 2,
                stiffness=0.0,
                length=length,
                reference=reference,
            )
            for m in members
            for length in [model.mesh.member_length(m)]
            for d in ("y", "z")
        )

    def doubts(self, structure: Yardstick) -> Iterator[tuple[str, str]]:
        """Yield an absurd stiffness."""
        yield from odd_stiffness(self, structure)
