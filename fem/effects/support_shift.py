"""A clamp that supports its member at another place."""

from dataclasses import dataclass
from typing import Any, ClassVar

from fem.array_types import Floats
from fem.declarations import Entry, Marker, Role, Site, StiffnessAt
from fem.effects.giving_way import cut_parameters, place_at
from fem.effects.mounting import REACH, members_at, shifts
from fem.effects.places import elements_of, frame_of
from fem.effects.support import Support
from fem.elements.frame import Frame
from fem.model import (
    DIRECTIONS,
    Contribution,
    Effect,
    Model,
    Parameter,
    ParameterRef,
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SupportShift(Effect):
    """A clamp that supports its member at another place, in the same directions.

    It adds strain of the member alone, so that it is damped as the member is.

    Attributes
    ----------
    support : str
    member : str
    at : float
        Where it is in the model, arc length [m].
    amount : float
        The shift [m].
    lower, upper : float
        [m].
    """

    kind: ClassVar[str] = "support_shift"
    role: ClassVar[Role] = Role.GEOMETRY
    marker: ClassVar[Marker | None] = Marker("square", "orange")
    statement: ClassVar[str] = "{thing} supports its member at another place than in the model"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`amount` [m]",
        meaning="a clamp that supports its member at another place",
        places="each support that holds all directions",
    )
    gives_way: ClassVar[bool] = True
    support: str
    member: str
    at: float
    amount: Any
    lower: float
    upper: float

    @property
    def where(self) -> Site:
        """Support and member."""
        return Site(f"support {self.support}", detail=f"member {self.member}")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the shift."""
        return (Parameter("amount", "m", self.amount, 0.0, self.lower, self.upper),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the elements' change that holds the new place."""
        place = place_at(model, self.member, self.at + self.amount)
        return (place.clamp(),)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the parameters of the member's elements."""
        return (*elements_of(model, self.member, "E", "rho"), *cut_parameters(model, self.member))

    def released(self) -> tuple[tuple[str, str], ...]:
        """Return the support's constraints."""
        return tuple((self.support, d) for d in DIRECTIONS)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Return shifts either way, as far as the bounds allow."""
        return shifts(self.lower, self.upper)

    def locations(self, model: Model) -> Floats:
        """Return the support."""
        return model.effect(self.support).locations(model)

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Return each support that holds all directions of a point on one member."""
        if not model.of_kind(Frame):
            return ()
        on, out = members_at(model), []
        for support in model.of_kind(Support):
            here = on.get(support.point, ())
            if len(here) == 1 and set(support.fixed) == set(DIRECTIONS):
                ((member, at),) = here
                p = frame_of(model).members[member]
                if p.release1 or p.release2 or p.spring1 or p.spring2:
                    continue  # a hinge would leave the point of the mesh without stiffness
                length = model.mesh.member_length(member)
                reach = REACH * length
                out.append(
                    cls(
                        name=f"support_shift:{support.name}",
                        support=support.name,
                        member=member,
                        at=at,
                        amount=0.0,
                        lower=-min(at, reach),
                        upper=min(length - at, reach),
                    )
                )
        return tuple(out)
