"""A part that is mounted further along its member than the model has it."""

from dataclasses import dataclass
from typing import ClassVar

from fem.declarations import Entry, Marker, Role
from fem.effects.mounting import AlongMember


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PartShift(AlongMember):
    """A part that is mounted further along: the joint acts elsewhere on it, and its sensors move with it."""

    kind: ClassVar[str] = "part_shift"
    role: ClassVar[Role] = Role.GEOMETRY
    marker: ClassVar[Marker | None] = Marker("diamond", "orange")
    statement: ClassVar[str] = "{thing} is further along the member than in the model"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`amount` [m]",
        meaning=(
            "a part that is mounted further along: the joint acts elsewhere on it, its sensors move with it"
        ),
        places="each side of each elastic joint",
    )
    of_feet: ClassVar[bool] = False
