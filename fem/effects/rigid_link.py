"""Rigid links and linear equations between degrees of freedom."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fem.array_types import Floats
from fem.declarations import Role, Site
from fem.effects.joint import relative_rows
from fem.model import DIRECTIONS, Constraint, Effect, Model, ModelError, Parameter


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RigidLink(Effect):
    """Points that follow another one as parts of one rigid body: u' = u + θ × r, θ' = θ.

    Attributes
    ----------
    point : int
        The point that leads.
    dependents : tuple of int
        Points that follow it.
    directions : tuple of str
        Global directions in which they do.
    """

    kind: ClassVar[str] = "rigid_link"
    role: ClassVar[Role] = Role.CONSTRAINT
    point: int
    dependents: tuple[int, ...]
    directions: tuple[str, ...] = DIRECTIONS

    def __post_init__(self) -> None:
        if not self.dependents or self.point in self.dependents or not self.directions:
            msg = (
                f"rigid link '{self.name}': point {self.point} leads {list(self.dependents)} in "
                f"{list(self.directions)}; at least one other point and one direction are needed"
            )
            raise ModelError(msg)

    @property
    def where(self) -> Site:
        """The points."""
        return Site(f"points {', '.join(map(str, (self.point, *self.dependents)))}")

    def parameters(self) -> tuple[Parameter, ...]:
        """None."""
        return ()

    def constraints(self, model: Model) -> tuple[Constraint, ...]:
        """One for each dependent point and direction."""
        out = []
        for point in self.dependents:
            place = model.mesh.points[point]
            dofs, B = relative_rows(model, point, self.point, place)
            for d in self.directions:
                row = B[DIRECTIONS.index(d)]
                used = row != 0
                key = (self.name, f"{point} {d}")
                out.append(Constraint(key, dofs[used], row[used], releasable=False, location=place))
        return tuple(out)

    def locations(self, model: Model) -> Floats:
        """Return the points."""
        return model.mesh.points[[self.point, *self.dependents]]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MultiPointConstraint(Effect):
    """One linear equation between degrees of freedom: Σ coefficient · u(point, direction) = 0.

    Attributes
    ----------
    terms : tuple of (int, str, float)
        Point, global direction (x y z rx ry rz) and coefficient [-, or m for rotations].
    """

    kind: ClassVar[str] = "multi_point_constraint"
    role: ClassVar[Role] = Role.CONSTRAINT
    terms: tuple[tuple[int, str, float], ...]

    def __post_init__(self) -> None:
        for point, direction, coefficient in self.terms:
            if direction not in DIRECTIONS or not np.isfinite(coefficient) or coefficient == 0:
                msg = (
                    f"constraint '{self.name}': the term {(point, direction, coefficient)} needs a direction "
                    f"of {', '.join(DIRECTIONS)} and a finite coefficient that is not zero"
                )
                raise ModelError(msg)
        if len({(p, d) for p, d, _ in self.terms}) != len(self.terms) or not self.terms:
            msg = f"constraint '{self.name}' needs terms, each of another point and direction"
            raise ModelError(msg)

    @property
    def where(self) -> Site:
        """The points."""
        return Site(f"points {', '.join(map(str, dict.fromkeys(p for p, _, _ in self.terms)))}")

    def parameters(self) -> tuple[Parameter, ...]:
        """None."""
        return ()

    def constraints(self, model: Model) -> tuple[Constraint, ...]:
        """Return the equation."""
        outside = [p for p, _, _ in self.terms if not 0 <= p < model.mesh.n_points]
        if outside:
            msg = (
                f"constraint '{self.name}' refers to point {outside[0]}, but the mesh has "
                f"{model.mesh.n_points} points, counted from 0"
            )
            raise ModelError(msg)
        dofs = np.array([6 * p + DIRECTIONS.index(d) for p, d, _ in self.terms])
        coefficients = np.array([c for _, _, c in self.terms], dtype=float)
        return (Constraint((self.name, "equation"), dofs, coefficients, releasable=False),)

    def locations(self, model: Model) -> Floats:
        """Return the points."""
        return model.mesh.points[list(dict.fromkeys(p for p, _, _ in self.terms))]
