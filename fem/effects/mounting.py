"""The common base of effects that move one side of a connection along or across its member."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.array_types import Floats
from fem.declarations import Site, StiffnessAt
from fem.effects.giving_way import cut_parameters, place_at
from fem.effects.joint import Joint
from fem.effects.places import elements_of, parameters_of
from fem.elements.frame import Frame
from fem.elements.inner_place import InnerPlace, energy
from fem.model import (
    Array,
    Contribution,
    Effect,
    Model,
    Parameter,
    ParameterRef,
    dofs_of,
    lever_matrix,
)

REACH = 0.15
"""Connections are shifted by at most this share of the member's length [-]."""
SHARES = (0.02, 0.07, 0.25, 0.7)
"""Shifts from which searches start, in parts of the furthest: a millimetre is as plausible as an inch [-]."""


def shifts(lower: float, upper: float) -> tuple[dict[str, float], ...]:
    """Return shifts to start from, either way as far as the bounds allow."""
    far = max(upper, -lower)
    amounts = (sign * share * far for share in SHARES for sign in (-1, 1))
    return tuple({"amount": a} for a in amounts if lower < a < upper)


def members_at(model: Model) -> dict[int, list[tuple[str, float]]]:
    """Return members and arc lengths [m] at each point of the mesh."""
    mesh = model.mesh
    on: dict[int, list[tuple[str, float]]] = {}
    for m in mesh.members:
        for p, s in zip(mesh.member_points(m), mesh.member_positions(m), strict=True):
            on.setdefault(int(p), []).append((m, float(s)))
    return on


def sides_of(model: Model) -> Iterator[tuple[Joint, int, list[tuple[str, float]]]]:
    """Yield joint, side, and members with arc lengths [m], of each side of an elastic joint on members."""
    if not model.of_kind(Frame):
        return
    on = members_at(model)
    for joint in model.of_kind(Joint):
        if joint.rigid or np.any(joint.M):
            continue
        for side, point in ((1, joint.point1), (2, joint.point2)):
            if point is not None and point in on:
                yield joint, side, on[point]


def is_foot(joint: Joint) -> bool:
    """Whether a joint holds a member to the ground."""
    return joint.point1 is None or joint.point2 is None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OnSide(Effect):
    """A joint without rigid directions whose one side acts elsewhere on its member.

    Attributes
    ----------
    joint : str
    side : int
        1 or 2.
    member : str
    at : float
        Where the side is in the model, arc length [m].
    amount : float
        The shift [m].
    lower, upper : float
        Bounds [m].
    """

    connection: ClassVar[bool] = True
    joint: str
    side: int
    member: str
    at: float
    amount: Any
    lower: float
    upper: float

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the shift."""
        return (Parameter("amount", "m", self.amount, 0.0, self.lower, self.upper),)

    def place(self, model: Model) -> InnerPlace:
        """Return the place on the member at which the side acts."""
        raise NotImplementedError

    def arm(self, model: Model, joint: Joint) -> Array:
        """Return the motion (6, 6) of the side at the joint's location from that of its place, global."""
        point = joint.point1 if self.side == 1 else joint.point2
        assert point is not None
        return lever_matrix(joint.location - model.mesh.points[point])

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the joint's matrices with the side where it is, less those of the model."""
        joint = model.effect(self.joint)
        assert isinstance(joint, Joint)
        turned = np.kron(np.eye(2), joint.axes) * (1.0 if self.side == 1 else -1.0)
        other = joint.point2 if self.side == 1 else joint.point1
        rows = np.zeros((6, 0))
        if other is not None:
            rows = -turned @ lever_matrix(joint.location - model.mesh.points[other])
        others = np.zeros(0, dtype=np.int64) if other is None else dofs_of(other)
        D = joint.D + joint.eta * joint.K
        moved = self.place(model).connect(turned @ self.arm(model, joint), others, rows, joint.K, joint.C, D)
        dofs, B = joint.relative(model)
        K, C, D = (-energy(X, B)[None] if np.any(X) else None for X in (joint.K, joint.C, D))
        return moved, Contribution(dofs[None], K, None, C, D)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the joint's parameters."""
        return parameters_of(model.effect(self.joint))

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Return shifts either way, as far as the bounds allow."""
        return shifts(self.lower, self.upper)

    def locations(self, model: Model) -> Floats:
        """Return the joint's place."""
        return model.effect(self.joint).locations(model)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AlongMember(OnSide):
    """A side that acts further along its member, or less far."""

    gives_way: ClassVar[bool] = True
    of_feet: ClassVar[bool]

    @property
    def where(self) -> Site:
        """Joint and member."""
        return Site(f"joint {self.joint}", detail=f"member {self.member}")

    def place(self, model: Model) -> InnerPlace:
        """Return the place further along."""
        return place_at(model, self.member, self.at + self.amount)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the parameters of the joint and of the member's elements."""
        refs = (*super(AlongMember, self).refers_to(model), *elements_of(model, self.member, "E", "rho"))
        return (*refs, *cut_parameters(model, self.member))

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Return each elastic foot along its members, or each side of each elastic joint of two parts."""
        out = []
        for joint, side, here in sides_of(model):
            if is_foot(joint) != cls.of_feet or (len(here) > 1 and not cls.of_feet):
                continue
            for member, at in here:
                length = model.mesh.member_length(member)
                reach = REACH * length
                out.append(
                    cls(
                        name=f"{cls.kind}:{joint.name}.{member}",
                        joint=joint.name,
                        side=side,
                        member=member,
                        at=at,
                        amount=0.0,
                        lower=-min(at, reach),
                        upper=min(length - at, reach),
                    )
                )
        return tuple(out)
