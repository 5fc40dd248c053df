"""Sprung masses: bodies on springs and dashpots at the structure, such as tuned absorbers."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np

from fem.array_types import Floats
from fem.declarations import Internal, Marker, Role, Site, Yardstick
from fem.effects.added_mass import too_heavy
from fem.effects.joint import joint_unit
from fem.model import (
    DIRECTIONS,
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
class SprungMass(Effect):
    """A rigid body that a point carries on springs in some directions, and rigidly in the others.

    Its coordinates s are the motions of the body relative to the point, at the body's centre: the body
    moves by R T u + E s with the lever T from the point, the axes R and the sprung directions E. So a motion
    of the structure as one leaves s = 0, and gravity and a moving base act on all of the mass.

    Attributes
    ----------
    point : int
        Point of the mesh.
    mass : float
        [kg].
    k : mapping of str to float
        Stiffness in sprung directions x … rz of ``axes`` [N/m, N·m/rad].
    c : mapping of str to float
        Viscous damping in these [N·s/m, N·m·s/rad].
    eta : float
        Loss factor of the springs [-].
    inertia : ndarray (3, 3)
        Inertia tensor about its centre, in ``axes`` [kg·m²].
    arm : ndarray (3,)
        From the point to its centre, global [m].
    axes : ndarray (3, 3)
        Rows are the axes of the springs.
    """

    kind: ClassVar[str] = "sprung_mass"
    role: ClassVar[Role] = Role.STIFFNESS | Role.MASS | Role.DISSIPATION
    marker: ClassVar[Marker | None] = Marker("circle", "green")
    point: int
    mass: Any
    k: Mapping[str, Any]
    c: Mapping[str, Any] = field(default_factory=dict)
    eta: Any = 0.0
    inertia: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    arm: Floats = field(default_factory=lambda: np.zeros(3))
    axes: Floats = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        refuse_negative(self.name, mass=(self.mass, "kg"), eta=(self.eta, "-"))
        refuse_negative(self.name, **{f"c{d}": (v, _damping_unit(d)) for d, v in self.c.items()})
        for d in (*self.k, *self.c):
            if d not in DIRECTIONS:
                msg = f"'{self.name}' is sprung in '{d}'; allowed are {', '.join(DIRECTIONS)}"
                raise ModelError(msg)
        loose = [d for d in self.c if d not in self.k]
        if loose or not self.k:
            where = f"a dashpot in {loose[0]} but no spring there" if loose else "no spring"
            msg = f"'{self.name}' has {where}; give its stiffness in each sprung direction"
            raise ModelError(msg)
        for d, value in self.k.items():
            if not np.real(value) > 0:
                msg = f"'{self.name}': its stiffness in {d} is {np.real(value):g}; it must be positive"
                raise ModelError(msg)
            if d[0] == "r" and not self.inertia[DIRECTIONS.index(d) - 3, DIRECTIONS.index(d) - 3] > 0:
                msg = f"'{self.name}' is sprung in {d} without inertia about that axis; give its inertia"
                raise ModelError(msg)

    @property
    def where(self) -> Site:
        """The point."""
        return Site(f"point {self.point}")

    @property
    def internal(self) -> Internal:
        """One coordinate for each sprung direction, and the motion of the body's centre."""
        along = [DIRECTIONS.index(d) for d in self.k]
        motion = np.hstack([lever_matrix(self.arm)[:3], self.axes.T @ np.eye(6)[:3, along]])
        return Internal(len(self.k), body=(self.point, motion))

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the mass, and stiffness and damping in each sprung direction."""
        out = [Parameter("mass", "kg", self.mass, 0.0, 0.0, np.inf, linear=True)]
        for d, value in self.k.items():
            size = abs(np.real(value))
            unit = joint_unit(d)
            out.append(Parameter(f"k{d}", unit, value, 0.0, 1e-6 * size, 1e6 * size, log=True, linear=True))
        out += [
            Parameter(f"c{d}", _damping_unit(d), value, 0.0, 0.0, np.inf, linear=True)
            for d, value in self.c.items()
        ]
        return tuple(out)

    def with_values(self, **values: Any) -> Self:
        """Return a copy with another mass, stiffnesses or dampings."""
        k, c = dict(self.k), dict(self.c)
        for name, value in values.items():
            if name != "mass":
                (k if name[0] == "k" else c)[name[1:]] = value
        return replace(self, mass=values.get("mass", self.mass), k=k, c=c)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return M = BᵀGB with B = [R T, E], and K, C and D of the relative motions."""
        n = len(self.k)
        at = [DIRECTIONS.index(d) for d in self.k]
        kind = np.result_type(
            float, *(type(v) for v in (self.mass, self.eta, *self.k.values(), *self.c.values()))
        )
        G = np.zeros((6, 6), dtype=kind)
        G[:3, :3] = self.mass * np.eye(3)
        G[3:, 3:] = self.inertia
        R = np.kron(np.eye(2), self.axes)
        B = np.hstack([R @ lever_matrix(self.arm), np.eye(6)[:, at]])
        K, C = np.zeros((6 + n, 6 + n), dtype=kind), np.zeros((6 + n, 6 + n), dtype=kind)
        sprung = np.arange(6, 6 + n)
        K[sprung, sprung] = list(self.k.values())
        C[sprung, sprung] = [self.c.get(d, 0.0) for d in self.k]
        dofs = np.append(dofs_of(self.point), model.internal_dofs(self.name))[None]
        return (Contribution(dofs, K=K[None], M=(B.T @ G @ B)[None], C=C[None], D=(self.eta * K)[None]),)

    def doubts(self, structure: Yardstick) -> Iterator[tuple[str, str]]:
        """Yield a mass that no member carries."""
        yield from too_heavy(self.name, self.mass, structure)

    def locations(self, model: Model) -> Floats:
        """Its centre of mass."""
        return (model.mesh.points[self.point] + self.arm)[None]

    @classmethod
    def tuned(
        cls,
        name: str,
        point: int,
        mass: float,
        frequency: float,
        zeta: float = 0.0,
        directions: tuple[str, ...] = ("z",),
        **more: Any,
    ) -> Self:
        """Return a mass with the natural frequency and the damping ratio that it has on a fixed point.

        Parameters
        ----------
        name : str
        point : int
        mass : float
            [kg].
        frequency : float
            √(k/m)/2π [Hz].
        zeta : float
            c/2√(km) [-].
        directions : tuple of str
            Sprung translations.
        **more
            Other attributes.
        """
        omega = 2 * np.pi * frequency
        turning = [d for d in directions if d not in DIRECTIONS[:3]]
        if turning:
            msg = f"'{name}' is tuned in {turning[0]}; give k and c of rotations"
            raise ModelError(msg)
        c = dict.fromkeys(directions, 2 * zeta * mass * omega) if zeta else {}
        return cls(
            name=name, point=point, mass=mass, k=dict.fromkeys(directions, mass * omega**2), c=c, **more
        )


def _damping_unit(direction: str) -> str:
    return "N·m·s/rad" if direction[0] == "r" else "N·s/m"
