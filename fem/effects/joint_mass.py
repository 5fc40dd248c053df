"""Mass and rotary inertia of a joint: bolts, plates, a cast corner."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.declarations import Entry, Marker, Relevant, Role, StiffnessAt
from fem.effects.joint import Joint
from fem.effects.places import OnJoint, typical_length, typical_mass
from fem.model import Array, Contribution, Effect, Model, Parameter, dofs_of, lever_matrix, refuse_negative


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _JointBody(OnJoint):
    reference: float

    def _shared(self, model: Model, body: Array) -> tuple[Contribution, ...]:
        """Return a 6×6 mass matrix at the joint's place, half of it on each side."""
        joint = self.of(model)
        sides = [p for p in (joint.point1, joint.point2) if p is not None]
        parts = []
        for point in sides:
            T = lever_matrix(joint.location - model.mesh.points[point])
            parts.append(Contribution(dofs_of(point)[None], M=(T.T @ body @ T)[None] / len(sides)))
        return tuple(parts)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointMass(_JointBody):
    """A mass at a joint's place, half of it on each side.

    Its twin is a ``point_mass`` on a member at the joint.

    Attributes
    ----------
    joint : str
    mass : float
        Mass beyond the model's [kg].
    reference : float
        Typical mass of a member, which sets the scale [kg].
    """

    kind: ClassVar[str] = "joint_mass"
    role: ClassVar[Role] = Role.MASS
    marker: ClassVar[Marker | None] = Marker("diamond", "green")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`mass` [kg]",
        meaning="a mass at a joint",
        places="each joint",
    )
    mass: Any

    def __post_init__(self) -> None:
        refuse_negative(self.name, mass=(self.mass, "kg"))

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the mass."""
        return (Parameter("mass", "kg", self.mass, 0.0, 0.0, 20 * self.reference, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return Tᵀ diag(m, m, m, 0, 0, 0) T of each side."""
        return self._shared(model, self.mass * np.diag([1.0, 1, 1, 0, 0, 0]))

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From 0.1 to 30 % of a member's mass."""
        return tuple({"mass": f * self.reference} for f in (0.001, 0.003, 0.01, 0.03, 0.1, 0.3))

    def relevant(self, sizes: Relevant, mass: float, scale: StiffnessAt) -> float | None:
        """Return a relevant mass."""
        return sizes.masses * mass

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each joint."""
        joints = model.of_kind(Joint)
        m = typical_mass(model) if joints else 0.0
        return tuple(cls(name=f"joint_mass:{j.name}", joint=j.name, mass=0.0, reference=m) for j in joints)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointInertia(_JointBody):
    """A rotary inertia at a joint's place, alike about all axes, half of it on each side.

    Attributes
    ----------
    joint : str
    inertia : float
        Inertia beyond the model's [kg·m²].
    reference : float
        m L² of a typical member, which sets the scale [kg·m²].
    """

    kind: ClassVar[str] = "joint_inertia"
    role: ClassVar[Role] = Role.MASS
    entry: ClassVar[Entry | None] = Entry(
        quantities="`inertia` [kg·m²]",
        meaning="a rotary inertia at a joint, alike about all axes",
        places="each joint",
    )
    inertia: Any

    def __post_init__(self) -> None:
        refuse_negative(self.name, inertia=(self.inertia, "kg·m²"))

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the inertia."""
        return (Parameter("inertia", "kg·m²", self.inertia, 0.0, 0.0, self.reference, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return diag(0, 0, 0, I, I, I) of each side."""
        return self._shared(model, self.inertia * np.diag([0.0, 0, 0, 1, 1, 1]))

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From 10⁻⁶ to 10⁻² of a member's m L²."""
        return tuple({"inertia": float(f * self.reference)} for f in np.geomspace(1e-6, 1e-2, 9))

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each joint."""
        joints = model.of_kind(Joint)
        I = typical_mass(model) * typical_length(model) ** 2 if joints else 0.0
        return tuple(
            cls(name=f"joint_inertia:{j.name}", joint=j.name, inertia=0.0, reference=I) for j in joints
        )
