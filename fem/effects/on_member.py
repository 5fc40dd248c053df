"""Effects of one member: of its elements, or at a position along it."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.array_types import Floats
from fem.declarations import Site
from fem.model import Effect, Model, Parameter


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OnMember(Effect):
    """An effect of a member of the model.

    Attributes
    ----------
    member : str
        Name of the member.
    """

    member: str

    @property
    def where(self) -> Site:
        """The member."""
        return Site(f"member {self.member}")

    def locations(self, model: Model) -> Floats:
        """Return the middle of the member."""
        return place_on(model, self.member, model.mesh.member_length(self.member) / 2)

    def alters(self, model: Model, member: str, line: int | None = None) -> bool:
        """Whether it is of the member."""
        return member == self.member


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WithinMember(OnMember):
    """A change of the elements of a member, whose matrices are part of its stiffness or mass."""

    within_members: ClassVar[bool] = True


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AtPosition(OnMember):
    """An effect at a position along a member.

    Attributes
    ----------
    position : float
        Arc length from the member's first end [m].
    """

    position: Any

    @property
    def where(self) -> Site:
        """Member and position."""
        return Site(f"member {self.member}", self.position)

    def locations(self, model: Model) -> Floats:
        """Return the place on the member."""
        return place_on(model, self.member, self.position)


def place_on(model: Model, member: str, position: Any) -> Floats:
    """Return the point at an arc length of a member, (1, 3) [m]."""
    return model.mesh.point_at(model.mesh.locate(member, float(np.real(position))))[None]


def position_between(position: Any, low: float, high: float) -> Parameter:
    """Return the parameter of a position along a member, with its bounds [m]."""
    return Parameter("position", "m", position, position, low, high, position=True)
