"""Joints whose stiffness has a loss factor in one direction only: rubber, a loose bolt."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.declarations import Contains, Entry, Marker, Relevant, Role, StiffnessAt
from fem.effects.joint import Joint, joint_unit
from fem.effects.joint_stiffness import JointStiffness
from fem.model import DIRECTIONS, Effect, Model, Parameter


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointComplexStiffness(JointStiffness):
    """The stiffness of a joint in one direction with its loss factor, in place of the model's.

    Attributes
    ----------
    loss_factor : float
        In this direction [-].
    assumed_loss : float
        The model's [-].
    """

    kind: ClassVar[str] = "joint_complex_stiffness"
    role: ClassVar[Role] = Role.STIFFNESS | Role.DISSIPATION
    contains: ClassVar[Contains] = {"joint_stiffness": lambda e: {"stiffness": e.stiffness}}
    marker: ClassVar[Marker | None] = Marker("diamond", "purple")
    statement: ClassVar[str] = "{thing} {are} {stiffer} {direction} and dissipates more"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`stiffness` [N/m or N·m/rad], `loss_factor` [-]",
        meaning="a joint's stiffness and loss factor in one direction, in place of the model's",
        places="each elastic direction of each joint",
    )
    loss_factor: Any = 0.0
    assumed_loss: float = 0.0

    def parameters(self) -> tuple[Parameter, ...]:
        """Return stiffness and loss factor."""
        unit, k = joint_unit(self.direction), (self.stiffness, self.assumed, *self.bounds)
        return (
            Parameter("stiffness", unit, *k, log=True, in_words=self._share),
            Parameter("loss_factor", "-", self.loss_factor, self.assumed_loss, 0.0, 3.0),
        )

    def _changes(self, joint: Joint) -> tuple[Any, Any]:
        """Return k - k_assumed and ηk - η_assumed k_assumed."""
        d = self.loss_factor * self.stiffness - joint.eta * self.assumed
        return self.stiffness - self.assumed, d

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Return values from two decades softer to one stiffer, with little and with much loss."""
        return tuple(
            {"stiffness": float(f * self.assumed), "loss_factor": loss}
            for f in (0.01, 0.03, 0.1, 0.3, 0.8, 3.0, 10.0)
            for loss in (0.05, 0.3, 1.0)
        )

    def relevant(self, sizes: Relevant, mass: float, scale: StiffnessAt) -> float | None:
        """Return None: a loss factor of a stiffness has no size that is relevant."""
        return None

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Return each elastic direction of each joint."""
        return tuple(
            cls(
                name=f"joint_complex_stiffness:{j.name}.{d}",
                joints=(j.name,),
                direction=d,
                stiffness=k,
                assumed=k,
                bounds=(1e-4 * k, 1e4 * k),
                loss_factor=eta,
                assumed_loss=eta,
            )
            for j in model.of_kind(Joint)
            for d in j.elastic
            for i, eta in [(DIRECTIONS.index(d), float(np.real(j.eta)))]
            for k in [float(np.real(j.K[i, i]))]
        )
