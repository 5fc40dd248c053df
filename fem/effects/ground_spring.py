"""Springs from points of the structure to the ground that the model lacks: suspensions, cables, stops."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from fem.declarations import Entry, Marker, Role, StiffnessAt, Yardstick
from fem.effects.joint import Joint, PointPair, joint_unit
from fem.effects.places import OnPoint, fastening_places, fixed_directions, odd_stiffness, typical_stiffness
from fem.effects.support import Support
from fem.elements.frame import Frame
from fem.model import DIRECTIONS, Contribution, Instruments, Model, Parameter

TOGETHER = 5e-3
"""Sides of a rigid joint no farther apart than this share of the structure's size count as one place."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GroundSpring(OnPoint):
    """A spring to the ground in one global direction at one point.

    Attributes
    ----------
    stiffness : float
        [N/m or N·m/rad].
    reference : float
        Bending stiffness of a typical member, which sets the scale [N/m or N·m/rad].
    """

    kind: ClassVar[str] = "ground_spring"
    role: ClassVar[Role] = Role.STIFFNESS
    marker: ClassVar[Marker | None] = Marker("triangle_down", "green")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`stiffness` [N/m or N·m/rad]",
        meaning="a spring to the ground at a member's end or a joint",
        places="ends of members, and joints within them",
    )
    connection: ClassVar[bool] = True
    stiffness: Any
    reference: float

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the stiffness."""
        unit = joint_unit(self.direction)
        return (Parameter("stiffness", unit, self.stiffness, 0.0, 0.0, 1e8 * self.reference, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return k on the one DOF."""
        return (Contribution(self.dof, np.full((1, 1, 1), self.stiffness)),)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From a soft suspension, 10⁻³ of a member's stiffness, to a support."""
        return tuple({"stiffness": float(f * self.reference)} for f in np.geomspace(1e-3, 1e5, 17))

    def doubts(self, structure: Yardstick) -> Iterator[tuple[str, str]]:
        """Yield an absurd stiffness."""
        yield from odd_stiffness(self, structure)

    @classmethod
    def propose(cls, model: Model) -> tuple[Self, ...]:
        """Return the places of :func:`attachments`, but at excitations, where a ``stinger`` is."""
        driven = _driven(model.instruments) if model.instruments is not None else set()
        reference = {d: typical_stiffness(model, d) for d in DIRECTIONS} if model.of_kind(Frame) else {}
        return tuple(
            cls(
                name=f"ground_spring:{label}.{d}",
                point=point,
                place=place,
                direction=d,
                stiffness=0.0,
                reference=reference[d],
            )
            for point, place, label, d in attachments(model)
            if (point, d) not in driven
        )


def attachments(model: Model) -> Iterator[tuple[int, str, str, str]]:
    """Yield points, their places and labels, and directions in which something may lead to the ground.

    Translations of members' ends and of inner joints, and directions that supports leave free. Not
    directions that are fixed, nor where a joint leads to the ground: its stiffness is a candidate there. Of
    the two sides of a rigid joint one is enough where they lie at the same place: elsewhere the one turns
    about the other.
    """
    if not model.of_kind(Frame):
        return
    fixed = fixed_directions(model)
    grounded = {p.point1 for p in model.of_kind(PointPair) if p.point2 is None}
    rigid = [j for j in model.of_kind(Joint) if len(j.rigid) == len(DIRECTIONS)]
    at, near = model.mesh.points, TOGETHER * model.mesh.size
    other_sides = {
        j.point2 for j in rigid if j.point2 is not None and np.linalg.norm(at[j.point1] - at[j.point2]) < near
    }
    supports = {s.point for s in model.of_kind(Support)}
    for point, place, label in fastening_places(model):
        if point in grounded or point in other_sides:
            continue
        for d in DIRECTIONS if point in supports else DIRECTIONS[:3]:
            if d not in fixed.get(point, ()):
                yield point, place, label, d


def _driven(test: Instruments) -> set[tuple[int, str]]:
    """Return the points and global directions of excitations along an axis."""
    return {
        (int(p), DIRECTIONS[int(np.argmax(np.abs(d)))])
        for p, d in zip(test.drivers, test.driver_directions, strict=True)
        if np.abs(d).max() > 1 - 1e-6
    }
