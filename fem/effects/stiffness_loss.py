"""A loss of stiffness over part of a member, at a position that may be estimated."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.declarations import Entry, Marker, Relevant, Role, StiffnessAt
from fem.effects.on_member import AtPosition, WithinMember, position_between
from fem.effects.places import elements_of, is_sprung, sheared_frame
from fem.elements.stretches import loss_of_stretch
from fem.model import Contribution, Effect, Model, Parameter, ParameterRef


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StiffnessLoss(AtPosition, WithinMember):
    """A fraction of the stiffness that is lost over a stretch of a member.

    ΔK = -loss ∫ BᵀEB dx, and the material's damping with it.

    Attributes
    ----------
    member : str
    position : float
        Middle of the stretch, arc length from the member's first end [m].
    loss : float
        Lost fraction of all stiffnesses of the stretch [-].
    width : float
        Length of the stretch [m].
    length : float
        Length of the member [m].
    affine : bool
        Whether K is affine in the loss: not where the member's ends are on springs.
    """

    kind: ClassVar[str] = "stiffness_loss"
    role: ClassVar[Role] = Role.STIFFNESS
    marker: ClassVar[Marker | None] = Marker("cross", "vermilion")
    statement: ClassVar[str] = "{member} has lost stiffness at {at}"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`loss` [-], `position` [m]",
        meaning=(
            "lost fraction of the stiffness of a stretch, a tenth of the member long, around the position"
        ),
        places="along each member",
    )
    loss: Any
    width: float
    length: float
    affine: bool = True

    def parameters(self) -> tuple[Parameter, ...]:
        """Loss and position."""
        return (
            Parameter("loss", "-", self.loss, 0.0, 0.0, 0.98, linear=self.affine),
            position_between(self.position, self.width / 2, self.length - self.width / 2),
        )

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the lost strain energy of the stretch."""
        ends = self.position - self.width / 2, self.position + self.width / 2
        return (loss_of_stretch(sheared_frame(model), model, self.member, *ends, self.loss),)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the parameters on which the member's stiffness depends."""
        return elements_of(model, self.member, "E")

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Losses of 3 to 90 % at ten places along the member."""
        return tuple(
            {"loss": f, "position": float(x * self.length)}
            for x in np.linspace(0.06, 0.94, 10)
            for f in (0.03, 0.1, 0.3, 0.6, 0.9)
        )

    def relevant(self, sizes: Relevant, mass: float, scale: StiffnessAt) -> float | None:
        """Return the loss of stiffness at a crack of a relevant depth."""
        return 1 - (1 - sizes.cracks) ** 3

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each member, over a tenth of its length."""
        out = []
        for member in model.mesh.members:
            length = model.mesh.member_length(member)
            out.append(
                cls(
                    name=f"stiffness_loss:{member}",
                    member=member,
                    position=length / 2,
                    loss=0.0,
                    width=0.1 * length,
                    length=length,
                    affine=not is_sprung(model, member),
                )
            )
        return tuple(out)
