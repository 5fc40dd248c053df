"""A support that is flexible in a direction in which it is rigid in the model."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from fem.declarations import Entry, Marker, Relevant, Role, StiffnessAt
from fem.effects.joint import joint_unit
from fem.effects.places import OnSupports
from fem.effects.support import Support
from fem.model import DIRECTIONS, Contribution, Model, Parameter


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SupportFlexibility(OnSupports):
    """One spring stiffness to ground, in one direction, at one support or alike at several."""

    kind: ClassVar[str] = "support_flexibility"
    role: ClassVar[Role] = Role.STIFFNESS
    marker: ClassVar[Marker | None] = Marker("triangle_down", "support")
    statement: ClassVar[str] = "{thing} {are} flexible {direction}, but rigid in the model"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`stiffness` [N/m or N·m/rad]",
        meaning="a support that is flexible in a direction in which it is rigid in the model",
        places="each fixed direction of each support, and of all alike",
    )

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the stiffness."""
        unit = joint_unit(self.direction)
        return (Parameter("stiffness", unit, self.stiffness, np.inf, 1e-6, 1e18, log=True, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the springs."""
        return (Contribution(*self.springs(model)),)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Six decades around the stiffness of the structure at the supports."""
        k = float(np.median([scale(key) for key in self.released()]))
        return tuple({"stiffness": float(f * k)} for f in np.geomspace(1e-3, 1e3, 31))

    def relevant(self, sizes: Relevant, mass: float, scale: StiffnessAt) -> float | None:
        """Return the stiffness that leaves a relevant share of the flexibility to the supports."""
        return sizes.softness(float(np.median([scale(key) for key in self.released()])))

    @classmethod
    def propose(cls, model: Model) -> tuple[Self, ...]:
        """Each fixed direction of each support, and of all supports alike."""
        supports = {d: tuple(s.name for s in model.of_kind(Support) if d in s.fixed) for d in DIRECTIONS}
        out: list[Self] = []
        for d, names in supports.items():
            groups = [(n,) for n in names] + ([names] if len(names) > 1 else [])
            out += [
                cls(name=f"support_flexibility:{'+'.join(g)}.{d}", supports=g, direction=d, stiffness=1e6)
                for g in groups
            ]
        return tuple(out)
