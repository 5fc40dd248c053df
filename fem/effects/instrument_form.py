"""What a test's instruments add to a structure by themselves: uncertain in every model, like its form."""

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from fem.array_types import Floats
from fem.declarations import Entry, Role, Site
from fem.effects.added_mass import AddedMass
from fem.effects.instruments import place_name
from fem.effects.places import typical_mass, typical_stiffness
from fem.elements.frame import Frame
from fem.model import Contribution, Effect, Model, Parameter, dofs_of

LIGHT = 0.5
"""Largest mass of an instrument, in parts of a typical member's [-]."""
SOFT = 10.0
"""Largest stiffness of a stinger across, in parts of a typical member's bending stiffness [-]."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SensorForm(Effect):
    """Mass of every sensor in addition to what the study states; the same at each place.

    Attributes
    ----------
    points : tuple of int
        Points of the mesh.
    mass : float
        At each [kg].
    reference : float
        Typical mass of a member, which sets the upper bound [kg].
    stated : float
        Least mass that the model has at these points: half of it may be missing [kg].
    """

    kind: ClassVar[str] = "sensor_form"
    is_form: ClassVar[bool] = True
    role: ClassVar[Role] = Role.MASS
    entry: ClassVar[Entry | None] = Entry(
        quantities="`mass` [kg]",
        meaning="mass of each sensor in addition to the stated one",
        places="all places of sensors, together",
    )
    points: tuple[int, ...]
    mass: Any
    reference: float
    stated: float = 0.0

    @property
    def where(self) -> Site:
        """All sensors: how many they are depends on which a fit uses."""
        return Site("all places of sensors")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the mass."""
        low, high = -0.5 * self.stated, LIGHT * self.reference
        return (Parameter("mass", "kg", self.mass, 0.0, low, high, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return m on the translations of each point."""
        dofs = dofs_of(self.points)[:, :3]
        return (Contribution(dofs, M=np.tile(self.mass * np.eye(3), (len(self.points), 1, 1))),)

    def locations(self, model: Model) -> Floats:
        """Return the points."""
        return model.mesh.points[list(self.points)]

    @classmethod
    def propose(cls, model: Model) -> tuple[Self, ...]:
        """One, for all places of sensors."""
        test = model.instruments
        if test is None or not test.sensors.size or not model.of_kind(Frame):
            return ()
        points = tuple(int(p) for p in np.unique(test.sensors))
        there = dict.fromkeys(points, 0.0)
        for e in model.of_kind(AddedMass):
            if e.point in there:
                there[e.point] += float(np.real(e.mass))
        least = min(there.values())
        return (
            cls(name="sensor_form", points=points, mass=0.0, reference=typical_mass(model), stated=least),
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DriverForm(Effect):
    """Mass that an exciter adds where it is attached, and the stiffness of its stinger across the force.

    They are there whatever is driven. What acts along the force acts through the force cell, and is measured.

    Attributes
    ----------
    place : str
        Name of the place.
    point : int
        Point of the mesh.
    axis : tuple of float
        Direction of the force, a unit vector.
    mass : float
        [kg].
    across : float
        Stiffness k in K = k (I - d dᵀ), of the force's direction d [N/m].
    references : (float, float)
        Mass and bending stiffness of a typical member, which set the upper bounds [kg, N/m].
    """

    kind: ClassVar[str] = "driver_form"
    is_form: ClassVar[bool] = True
    role: ClassVar[Role] = Role.MASS | Role.STIFFNESS
    entry: ClassVar[Entry | None] = Entry(
        quantities="`mass` [kg], `across` [N/m]",
        meaning="mass of an exciter's fittings, and stiffness of its stinger across the force",
        places="each place of an excitation",
    )
    place: str
    point: int
    axis: tuple[float, float, float]
    mass: Any
    across: Any
    references: tuple[float, float]

    @property
    def where(self) -> Site:
        """The excitation."""
        return Site(f"excitation at {self.place}")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return mass and stiffness."""
        m, k = self.references
        return (
            Parameter("mass", "kg", self.mass, 0.0, 0.0, LIGHT * m, linear=True),
            Parameter("across", "N/m", self.across, 0.0, 0.0, SOFT * k, linear=True),
        )

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return k (I - d dᵀ) and m on the translations of the point."""
        across = np.eye(3) - np.outer(self.axis, self.axis)
        dofs = dofs_of([self.point])[:, :3]
        return (Contribution(dofs, (self.across * across)[None], M=(self.mass * np.eye(3))[None]),)

    def locations(self, model: Model) -> Floats:
        """Return the point."""
        return model.mesh.points[[self.point]]

    @classmethod
    def propose(cls, model: Model) -> tuple[Self, ...]:
        """Return each place of an excitation, with the direction of the first one there."""
        test = model.instruments
        if test is None or not model.of_kind(Frame):
            return ()
        references = typical_mass(model), typical_stiffness(model, "x")
        first = {int(p): d for p, d in zip(test.drivers[::-1], test.driver_directions[::-1], strict=True)}
        out: list[Self] = []
        for p, d in sorted(first.items()):
            x, y, z = (float(v) for v in d / np.linalg.norm(d))
            out.append(
                cls(
                    name=f"driver_form:{p}",
                    place=place_name(model, p),
                    point=p,
                    axis=(x, y, z),
                    mass=0.0,
                    across=0.0,
                    references=references,
                )
            )
        return tuple(out)
