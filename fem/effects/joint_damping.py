"""Damping of joints beyond that of the model: of one direction or of all."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.declarations import Entry, Marker, Role, StiffnessAt
from fem.effects.joint import Joint, joint_unit
from fem.effects.places import InDirection, OnJoint, parameters_of
from fem.model import Contribution, Effect, Model, Parameter, ParameterRef


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointViscousDamping(InDirection):
    """A dashpot in one direction of a joint: iωc.

    Attributes
    ----------
    joint, direction : str
        Name of a joint and one of its elastic directions.
    damping : float
        c [N·s/m or N·m·s/rad].
    reference : float
        The joint's stiffness in the direction, which sets the scale [N/m or N·m/rad].
    """

    kind: ClassVar[str] = "joint_viscous_damping"
    role: ClassVar[Role] = Role.DISSIPATION
    marker: ClassVar[Marker | None] = Marker("hexagon", "purple")
    statement: ClassVar[str] = "{thing} has a damper {direction} that the model lacks"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`damping` [N·s/m or N·m·s/rad]",
        meaning="a dashpot in one direction of a joint",
        places="each elastic direction of each joint",
    )
    connection: ClassVar[bool] = False
    damping: Any
    reference: float

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the dashpot's constant."""
        unit = joint_unit(self.direction, "c")
        return (Parameter("damping", unit, self.damping, 0.0, 0.0, self.reference, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return c b bᵀ."""
        dofs, b = self.strain(model, self.direction)
        return (Contribution(dofs[None], C=(self.damping * np.outer(b, b))[None]),)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Dashpots whose force equals the spring's at frequencies from 1 Hz to 100 kHz."""
        return tuple({"damping": float(f * self.reference)} for f in np.geomspace(1e-6, 1e-1, 16))

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each elastic direction of each joint."""
        return cls.of_elastic(model, damping=0.0)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointStructuralDamping(OnJoint):
    """A loss factor on all stiffnesses of a joint, beyond the model's: i η K.

    Attributes
    ----------
    joint : str
        Name of a joint with elastic directions.
    loss_factor : float
        Additional loss factor [-].
    """

    kind: ClassVar[str] = "joint_structural_damping"
    role: ClassVar[Role] = Role.DISSIPATION
    marker: ClassVar[Marker | None] = Marker("hexagon_flat", "purple")
    statement: ClassVar[str] = "{thing} dissipates more than in the model"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`loss_factor` [-]",
        meaning="a loss factor on all stiffnesses of a joint, beyond the model's",
        places="each joint with elastic directions",
    )
    connection: ClassVar[bool] = False
    loss_factor: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the loss factor."""
        return (Parameter("loss_factor", "-", self.loss_factor, 0.0, 0.0, 2.0, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return η Bᵀ K B."""
        joint = self.of(model)
        dofs, B = joint.relative(model)
        return (Contribution(dofs[None], D=(self.loss_factor * (B.T @ joint.K @ B))[None]),)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the joint's parameters."""
        return parameters_of(self.of(model))

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """One to a hundred per cent."""
        return tuple({"loss_factor": f} for f in (0.01, 0.03, 0.1, 0.3, 1.0))

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each joint with elastic directions."""
        return tuple(
            cls(name=f"joint_structural_damping:{j.name}", joint=j.name, loss_factor=0.0)
            for j in model.of_kind(Joint)
            if j.elastic
        )
