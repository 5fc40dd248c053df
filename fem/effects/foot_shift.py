"""An elastic foot that stands at another place of its member."""

from dataclasses import dataclass
from typing import ClassVar

from fem.declarations import Entry, Marker, Role
from fem.effects.mounting import AlongMember


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FootShift(AlongMember):
    """An elastic foot that stands at another place of its member."""

    kind: ClassVar[str] = "foot_shift"
    role: ClassVar[Role] = Role.GEOMETRY
    marker: ClassVar[Marker | None] = Marker("square", "orange")
    statement: ClassVar[str] = "{thing} is further along the member than in the model"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`amount` [m]",
        meaning="an elastic foot that stands at another place of its member",
        places="each elastic foot, along each member that meets it",
    )
    of_feet: ClassVar[bool] = True
