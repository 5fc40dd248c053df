"""Mass along a member: a cable, a coating, insulation, water."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.declarations import Contains, Entry, Environment, Marker, Role, Site, StiffnessAt
from fem.effects.on_member import AtPosition, OnMember, position_between
from fem.effects.places import frame_of, framed_members, member_mass, stiffness_of_sprung
from fem.elements.properties import MemberProperties
from fem.elements.stretches import mass_of_stretch
from fem.mesh import Mesh
from fem.model import Contribution, Effect, Model, Parameter, ParameterRef, refuse_negative


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DistributedMass(AtPosition):
    """A mass per length on a stretch of a member, at its axis.

    M = mass ∫ NᵀN dx over the stretch, N the translations. Short, it is a ``point_mass``; over all of the
    member it is ``member_density``, which is also proposed.

    Attributes
    ----------
    member : str
    mass : float
        Mass per length [kg/m].
    position : float
        Middle of the stretch, arc length from the member's first end [m].
    width : float
        Length of the stretch, which is cut to the member [m].
    length : float
        Length of the member [m].
    reference : float
        The member's mass per length, which sets the scale [kg/m].
    """

    kind: ClassVar[str] = "distributed_mass"
    role: ClassVar[Role] = Role.MASS
    contains: ClassVar[Contains] = {
        "point_mass": lambda e: {
            "mass": float(np.real(e.mass * e.width)),
            "position": float(np.real(e.position)),
        }
    }
    marker: ClassVar[Marker | None] = Marker("octagon", "green")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`mass` [kg/m], `position` [m], `width` [m]",
        meaning="a mass per length on a stretch of a member around the position",
        places="along each member",
    )
    mass: Any
    width: Any
    length: float
    reference: float

    def __post_init__(self) -> None:
        refuse_negative(self.name, mass=(self.mass, "kg/m"))

    @classmethod
    def over(cls, mesh: Mesh, member: str, properties: MemberProperties, mass: float) -> "DistributedMass":
        """Return a mass per length on all of a member [kg/m]: cladding, insulation, contents."""
        length = mesh.member_length(member)
        return cls(
            name=f"mass along {member}",
            member=member,
            mass=mass,
            position=length / 2,
            width=length,
            length=length,
            reference=properties.material.rho * properties.section.A,
        )

    def parameters(self) -> tuple[Parameter, ...]:
        """Return mass per length, position and width."""
        short = 0.1 * self.length
        return (
            Parameter("mass", "kg/m", self.mass, 0.0, 0.0, 20 * self.reference, linear=True),
            position_between(self.position, short / 2, self.length - short / 2),
            Parameter("width", "m", self.width, self.width, short, 0.8 * self.length),
        )

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the stretch's mass matrices."""
        unit = mass_of_stretch(
            frame_of(model),
            model,
            self.member,
            self.position - self.width / 2,
            self.position + self.width / 2,
            (1, 1, 1, 0, 0, 0),
        )
        assert unit.M is not None
        return (Contribution(unit.dofs, M=self.mass * unit.M),)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return Young's modulus of a member on springs."""
        return stiffness_of_sprung(model, self.member)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Give the member 3, 10 and 40 % of its mass, on a quarter and on half of its length."""
        return tuple(
            {"mass": f * self.reference, "position": x * self.length, "width": w * self.length}
            for w, places in ((0.25, (0.125, 0.375, 0.625, 0.875)), (0.5, (0.25, 0.75)))
            for x in places
            for f in (0.03, 0.1, 0.4)
        )

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each member."""
        out: list[Effect] = []
        for m in framed_members(model):
            length = model.mesh.member_length(m)
            out.append(
                cls(
                    name=f"distributed_mass:{m}",
                    member=m,
                    mass=0.0,
                    position=length / 2,
                    width=length / 4,
                    length=length,
                    reference=member_mass(model, m) / length,
                )
            )
        return tuple(out)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FluidAddedMass(OnMember):
    """A mass per length of a member that only motion along one of its section's axes feels.

    Water around a flat section: π ρ b²/4 per length across the width b, next to nothing along it (Blevins,
    Formulas for Natural Frequency and Mode Shape, ch. 14). Seen from one side alone, ``member_density`` is
    its twin.

    Attributes
    ----------
    member : str
    direction : str
        y or z, local.
    mass : float
        Mass per length [kg/m].
    reference : float
        The member's mass per length, which sets the scale [kg/m].
    """

    kind: ClassVar[str] = "fluid_added_mass"
    role: ClassVar[Role] = Role.MASS
    environment: ClassVar[Environment | None] = Environment.FLUID
    marker: ClassVar[Marker | None] = Marker("octagon", "sky")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`mass` [kg/m]",
        meaning="a mass per length that only motion along one of a member's local axes feels",
        places="both axes of each member",
    )
    direction: str
    mass: Any
    reference: float

    def __post_init__(self) -> None:
        refuse_negative(self.name, mass=(self.mass, "kg/m"))

    @property
    def where(self) -> Site:
        """Member and direction."""
        return Site(f"member {self.member}", detail=f"along local {self.direction}")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the mass per length."""
        return (Parameter("mass", "kg/m", self.mass, 0.0, 0.0, 50 * self.reference, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return M = mass ∫ NᵀN dx with the motion in the one direction."""
        weights = [float(d == self.direction) for d in ("x", "y", "z", "rx", "ry", "rz")]
        length = model.mesh.member_length(self.member)
        unit = mass_of_stretch(frame_of(model), model, self.member, 0.0, length, weights)
        assert unit.M is not None
        return (Contribution(unit.dofs, M=self.mass * unit.M),)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return Young's modulus of a member on springs."""
        return stiffness_of_sprung(model, self.member)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From 0.7 % to three times the member's mass."""
        return tuple({"mass": f * self.reference} for f in (0.007, 0.02, 0.07, 0.2, 0.5, 1.0, 3.0))

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Both axes of each member."""
        return tuple(
            cls(
                name=f"fluid_added_mass:{m}.{d}",
                member=m,
                direction=d,
                mass=0.0,
                reference=member_mass(model, m) / model.mesh.member_length(m),
            )
            for m in framed_members(model)
            for d in ("y", "z")
        )
