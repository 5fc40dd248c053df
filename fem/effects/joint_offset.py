"""A joint that does not sit where the model has it."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.declarations import Entry, Marker, Role, StiffnessAt
from fem.effects.joint import Joint
from fem.effects.places import InDirection, frame_of, parameters_of
from fem.effects.superelement import Superelement
from fem.elements.frame import Frame
from fem.model import (
    DIRECTIONS,
    Array,
    Contribution,
    Effect,
    Model,
    Parameter,
    ParameterRef,
    dofs_of,
    lever_matrix,
    skew,
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointOffset(InDirection):
    """A joint's place, moved along one of its axes.

    The relative motion at the new place is δ + (ψ × e) offset, ψ that of rotation: δ' = L δ, and with it
    ΔK = Bᵀ (Lᵀ K L - K) B, C and D alike. A joint's mass moves with it. Its twin is a ``joint_coupling`` of
    the translation and the rotation that the lever couples.

    Attributes
    ----------
    joint : str
        Name of a joint without rigid directions.
    direction : str
        x, y or z of the joint's axes.
    offset : float
        [m].
    reach : float
        Size of the members' sections, which sets the scale [m].
    """

    kind: ClassVar[str] = "joint_offset"
    role: ClassVar[Role] = Role.GEOMETRY
    marker: ClassVar[Marker | None] = Marker("diamond", "orange")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`offset` [m]",
        meaning="a joint that sits elsewhere along one of its axes",
        places="each axis of each joint",
    )
    offset: Any
    reach: float

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the offset."""
        return (Parameter("offset", "m", self.offset, 0.0, -10 * self.reach, 10 * self.reach),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the joint's matrices at the new place, less those at the model's."""
        joint = self.of(model)
        dofs, B = joint.relative(model)
        L = _lever(self.direction, self.offset)

        def moved(X: Array, at: Array) -> Array | None:
            return (at.T @ (L.T @ X @ L - X) @ at)[None] if np.any(X) else None

        D = joint.D + joint.eta * joint.K
        parts = [Contribution(dofs[None], moved(joint.K, B), None, moved(joint.C, B), moved(D, B))]
        if np.any(joint.M):
            sides = [p for p in (joint.point1, joint.point2) if p is not None]
            for point in sides:
                T = np.kron(np.eye(2), joint.axes) @ lever_matrix(joint.location - model.mesh.points[point])
                parts.append(Contribution(dofs_of(point)[None], M=moved(joint.M / len(sides), T)))
        return tuple(parts)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the joint's parameters."""
        return parameters_of(self.of(model))

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From 2 % of the section's size to three times as much, either way."""
        return tuple({"offset": f * self.reach} for f in (-3, -1, -0.4, -0.1, -0.02, 0.02, 0.1, 0.4, 1, 3))

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each axis along which a joint without rigid directions has a lever."""
        out: list[Effect] = []
        if not model.of_kind(Frame):
            return ()
        sides = [np.sqrt(p.section.A) for p in frame_of(model).members.values()]
        # a joint between parts is among the nodes of its attachments: bounds of twice their reach
        sides = sides or [part.reach / 5 for part in model.of_kind(Superelement) if part.reach > 0]
        reach = float(np.median(sides or [0.01 * model.mesh.size]))
        for j in model.of_kind(Joint):
            for d in DIRECTIONS[:3]:
                L = _lever(d, reach)
                change = L.T @ j.K @ L - j.K
                if not j.rigid and np.abs(change).max() > 1e-12 * np.abs(j.K).max():
                    name = f"joint_offset:{j.name}.{d}"
                    out.append(cls(name=name, joint=j.name, direction=d, offset=0.0, reach=reach))
        return tuple(out)


def _lever(direction: str, offset: Any) -> Array:
    """Return L with δ' = L δ for a place moved along an axis, shape (6, 6)."""
    L = np.zeros((6, 6), dtype=np.result_type(float, type(offset)))
    L += np.eye(6)
    L[:3, 3:] = -offset * skew(np.eye(3)[DIRECTIONS.index(direction)])
    return L
