"""Changes of the structure by the test: masses of sensors and drivers, stiffness of stingers."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.array_types import Floats
from fem.declarations import Entry, Marker, Role, Site, StiffnessAt
from fem.effects.places import AtPoint, typical_mass, typical_stiffness
from fem.elements.frame import Frame
from fem.lengths import length_text
from fem.model import Contribution, Effect, Model, Parameter, dofs_of, refuse_negative


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _InstrumentMass(Effect):
    """The same mass at some points.

    Attributes
    ----------
    points : tuple of int
        Points of the mesh.
    mass : float
        Mass at each [kg].
    reference : float
        Typical mass of a member, which sets the scale [kg].
    """

    points: tuple[int, ...]
    mass: Any
    reference: float

    def __post_init__(self) -> None:
        refuse_negative(self.name, mass=(self.mass, "kg"))

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the mass."""
        return (Parameter("mass", "kg", self.mass, 0.0, 0.0, 20 * self.reference, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return m on the translations of each point."""
        dofs = dofs_of(self.points)[:, :3]
        return (Contribution(dofs, M=np.tile(self.mass * np.eye(3), (len(self.points), 1, 1))),)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From 0.1 to 30 % of a member's mass."""
        return tuple({"mass": f * self.reference} for f in (0.001, 0.003, 0.01, 0.03, 0.1, 0.3))

    def locations(self, model: Model) -> Floats:
        """Return the points."""
        return model.mesh.points[list(self.points)]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SensorMass(_InstrumentMass):
    """The same mass at every place where there are sensors.

    A sensor with several channels at one place is one body. Accelerometers that are moved from place to place
    during a test are not this. With a free density it loses most of its signature.
    """

    kind: ClassVar[str] = "sensor_mass"
    role: ClassVar[Role] = Role.MASS
    marker: ClassVar[Marker | None] = Marker("dot", "green")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`mass` [kg]",
        meaning="the same mass at every place of sensors",
        places="all places of sensors, together",
    )

    @property
    def where(self) -> Site:
        """The number of places."""
        return Site(f"the {len(self.points)} places of sensors")

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """One, for all places of sensors, if there are at least two."""
        test = model.instruments
        if test is None or not model.of_kind(Frame):
            return ()
        points = tuple(int(p) for p in np.unique(test.sensors))
        if len(points) < 2:
            return ()
        return (cls(name="sensor_mass", points=points, mass=0.0, reference=typical_mass(model)),)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DriverMass(_InstrumentMass):
    """The mass that a shaker's armature, force cell and fittings add where they are attached.

    It is there whatever is driven. A ``point_mass`` on the member at the same place is its twin.
    """

    kind: ClassVar[str] = "driver_mass"
    role: ClassVar[Role] = Role.MASS
    marker: ClassVar[Marker | None] = Marker("star", "green")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`mass` [kg]",
        meaning="a mass where an excitation is, whatever is driven",
        places="each place of an excitation, and all alike",
    )
    names: tuple[str, ...]

    @property
    def where(self) -> Site:
        """The excitations."""
        return Site(f"excitation{'s' if len(self.points) > 1 else ''} at {', '.join(self.names)}")

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Return each place of an excitation, and all alike."""
        test = model.instruments
        if test is None or not model.of_kind(Frame):
            return ()
        points = tuple(int(p) for p in np.unique(test.drivers))
        m = typical_mass(model)
        groups = [(p,) for p in points] + ([points] if len(points) > 1 else [])
        return tuple(
            cls(
                name=f"driver_mass:{'+'.join(map(str, g))}",
                points=g,
                names=tuple(place_name(model, p) for p in g),
                mass=0.0,
                reference=m,
            )
            for g in groups
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Stinger(AtPoint):
    """The stiffness that a stinger adds where it is attached, along it or alike across it.

    K = k d dᵀ along the excitation's direction d, k (I - d dᵀ) across. Across acts whatever the force cell
    measures; along, only parts between cell and structure or parallel to the cell act. It is there whatever
    is driven. At a member's end along an axis, ``ground_spring`` is the same and is not proposed as well; a
    suspension nearby is a twin.

    Attributes
    ----------
    place : str
        Name of the place.
    axis : tuple of float
        Direction of the excitation, a unit vector.
    across : bool
        Whether it acts across rather than along.
    stiffness : float
        k [N/m].
    reference : float
        Bending stiffness of a typical member, which sets the scale [N/m].
    """

    kind: ClassVar[str] = "stinger"
    role: ClassVar[Role] = Role.STIFFNESS
    marker: ClassVar[Marker | None] = Marker("star", "purple")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`stiffness` [N/m]",
        meaning="a stiffness along or across an excitation where it acts, whatever is driven",
        places="each excitation, along and across it",
    )
    place: str
    axis: tuple[float, float, float]
    across: bool
    stiffness: Any
    reference: float

    @property
    def where(self) -> Site:
        """The excitation."""
        return Site(f"excitation at {self.place}", detail=f"{'across' if self.across else 'along'} it")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the stiffness."""
        top = 1e8 * self.reference
        return (Parameter("stiffness", "N/m", self.stiffness, 0.0, 0.0, top, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return k d dᵀ or k (I - d dᵀ) on the translations of the point."""
        along = np.outer(self.axis, self.axis)
        K = self.stiffness * (np.eye(3) - along if self.across else along)
        return (Contribution(dofs_of([self.point])[:, :3], K[None]),)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From 10⁻³ to 10⁴ of a member's bending stiffness."""
        return tuple({"stiffness": float(f * self.reference)} for f in np.geomspace(1e-3, 1e4, 15))

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Return each excitation, along and across."""
        test = model.instruments
        if test is None or not model.of_kind(Frame):
            return ()
        k = typical_stiffness(model, "x")
        out: list[Effect] = []
        for i, (p, d) in enumerate(zip(test.drivers, test.driver_directions, strict=True)):
            x, y, z = (float(v) for v in d / np.linalg.norm(d))
            for across in (False, True):
                name = f"stinger:{i + 1}.{'across' if across else 'along'}"
                out.append(
                    cls(
                        name=name,
                        point=int(p),
                        place=place_name(model, int(p)),
                        axis=(x, y, z),
                        across=across,
                        stiffness=0.0,
                        reference=k,
                    )
                )
        return tuple(out)


def place_name(model: Model, point: int) -> str:
    """Return a point's name, or where it is on which member."""
    names = [name for name, p in model.mesh.point_names.items() if p == point]
    if names:
        return names[0]
    for member in model.mesh.members:
        at = np.flatnonzero(model.mesh.member_points(member) == point)
        if at.size:
            return f"member {member} at {length_text(float(model.mesh.member_positions(member)[at[0]]))}"
    return f"point {point}"
