"""A point mass, at a point of the mesh or at any position along a member."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from fem.array_types import Floats
from fem.declarations import Entry, Marker, Relevant, Role, Site, StiffnessAt, Yardstick
from fem.effects.on_member import AtPosition, WithinMember, position_between
from fem.elements.frame import Frame
from fem.model import (
    Contribution,
    Effect,
    Model,
    ModelError,
    Parameter,
    dofs_of,
    lever_matrix,
    refuse_negative,
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AddedMass(Effect):
    """A rigid body at a point of the mesh.

    Attributes
    ----------
    point : int
        Point of the mesh.
    mass : float
        Mass [kg].
    inertia : ndarray (3, 3)
        Inertia tensor about its centre of mass, global axes [kg·m²].
    arm : ndarray (3,)
        From the point to its centre of mass [m].
    spins : bool
        Whether it turns with a member that does (`fem.effects.spin`).
    """

    kind: ClassVar[str] = "added_mass"
    role: ClassVar[Role] = Role.MASS
    marker: ClassVar[Marker | None] = Marker("circle", "green")
    point: int
    mass: Any
    inertia: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    arm: Floats = field(default_factory=lambda: np.zeros(3))
    spins: bool = True

    def __post_init__(self) -> None:
        refuse_negative(self.name, mass=(self.mass, "kg"))
        inertia = np.asarray(self.inertia, dtype=float)
        if inertia.shape != (3, 3) or not np.isfinite(inertia).all():
            msg = (
                f"'{self.name}': its inertia is {inertia.tolist()}; (3, 3) finite numbers are needed [kg·m²]"
            )
            raise ModelError(msg)
        least = float(np.linalg.eigvalsh((inertia + inertia.T) / 2)[0])
        if least < -1e-9 * np.abs(inertia).max():
            refuse_negative(self.name, inertia=(least, "kg·m²"))

    @property
    def where(self) -> Site:
        """The point."""
        return Site(f"point {self.point}")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the mass."""
        return (Parameter("mass", "kg", self.mass, 0.0, 0.0, np.inf, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return M = Tᵀ diag(m I, inertia) T at the point."""
        G = np.zeros((6, 6), dtype=np.result_type(float, type(self.mass)))
        G[:3, :3] = self.mass * np.eye(3)
        G[3:, 3:] = self.inertia
        T = lever_matrix(self.arm)
        return (Contribution(dofs_of(self.point)[None], M=(T.T @ G @ T)[None]),)

    def doubts(self, structure: Yardstick) -> Iterator[tuple[str, str]]:
        """Yield a mass that no member carries, and an arm or an inertia larger than the structure."""
        yield from too_heavy(self.name, self.mass, structure)
        arm = float(np.linalg.norm(self.arm))
        if arm > structure.size:
            yield (
                "arm",
                f"'{self.name}' has an arm of {arm:.4g} m on a structure of {structure.size:.4g} m; is it in "
                "mm?",
            )
        mass = float(np.real(self.mass))
        radius = np.sqrt(max(float(np.abs(self.inertia).max()), 0.0) / mass) if mass > 0 else 0.0
        if radius > structure.size:
            yield (
                "inertia",
                f"'{self.name}' has a radius of gyration of {radius:.4g} m on a structure of "
                f"{structure.size:.4g} m; is its inertia in kg·m²?",
            )

    def locations(self, model: Model) -> Floats:
        """Its centre of mass."""
        return (model.mesh.points[self.point] + self.arm)[None]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PointMass(AtPosition, WithinMember):
    """A mass on the line of a member at a position that may be estimated.

    Attributes
    ----------
    member : str
    position : float
        Arc length from the member's first end [m].
    mass : float
        Mass [kg].
    """

    kind: ClassVar[str] = "point_mass"
    role: ClassVar[Role] = Role.MASS
    marker: ClassVar[Marker | None] = Marker("circle", "green")
    statement: ClassVar[str] = "{member} carries a mass at {at} that the model lacks"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`mass` [kg], `position` [m]",
        meaning="a mass anywhere along a member",
        places="along each member",
    )
    mass: Any
    span: tuple[float, float] = (0.0, np.inf)
    scale: float = 1.0

    def __post_init__(self) -> None:
        refuse_negative(self.name, mass=(self.mass, "kg"))

    def parameters(self) -> tuple[Parameter, ...]:
        """Mass and position."""
        return (
            Parameter("mass", "kg", self.mass, 0.0, 0.0, 20 * self.scale, linear=True),
            position_between(self.position, *self.span),
        )

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return M = m Nᵀ N with the beam's shape functions N for translations."""
        (frame,) = model.of_kind(Frame)
        dofs, N = frame.shapes_at(model.mesh, self.member, self.position)
        N, at = N[:3], model.mesh.locate(self.member, float(np.real(self.position)))
        M, line, xi = self.mass * (N.T @ N), np.array([at.line]), np.array([at.xi])
        return (Contribution(dofs[None], M=M[None], lines=line, xi=xi),)

    def doubts(self, structure: Yardstick) -> Iterator[tuple[str, str]]:
        """Yield a mass that no member carries."""
        yield from too_heavy(self.name, self.mass, structure)

    @classmethod
    def propose(cls, model: Model) -> tuple["Effect", ...]:
        """One for each member, at its middle, with 2 % of the member's mass to start from."""
        (frame,) = model.of_kind(Frame)
        out = []
        for member in model.mesh.members:
            p, length = frame.members[member], model.mesh.member_length(member)
            m = p.material.rho * p.section.A * length
            out.append(
                cls(
                    name=f"point_mass:{member}",
                    member=member,
                    position=length / 2,
                    mass=0.02 * m,
                    span=(0.0, length),
                    scale=m,
                )
            )
        return tuple(out)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Masses of 0.5 to 20 % of the member's at 13 places along it."""
        lo, hi = self.span
        places = np.linspace(0.01, 0.99, 13)
        return tuple(
            {"mass": f * self.scale, "position": float(lo + x * (hi - lo))}
            for x in places
            for f in (0.005, 0.02, 0.06, 0.2)
        )

    def relevant(self, sizes: Relevant, mass: float, scale: StiffnessAt) -> float | None:
        """Return a relevant mass."""
        return sizes.masses * mass


def too_heavy(name: str, mass: Any, structure: Yardstick) -> Iterator[tuple[str, str]]:
    """Yield a mass whose weight no member carries."""
    mass, most = float(np.real(mass)), structure.most_mass
    if mass > most:
        hint = f"; is it in grams ({mass / 1000:.4g} kg)?" if mass / 1000 < most else ""
        yield (
            "mass",
            f"'{name}' has {mass:.4g} kg, and {most:.4g} kg would bend the stiffest member, held at both "
            f"ends, by its length{hint}",
        )
