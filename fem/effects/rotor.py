"""A spinning rotor, whose gyroscopic moment couples rotations about two axes."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from fem.array_types import Floats
from fem.declarations import Entry, Environment, Role, Site, StiffnessAt
from fem.effects.added_mass import AddedMass
from fem.effects.joint import Joint
from fem.effects.places import (
    AtPoint,
    fastening_places,
    fixed_directions,
    frame_of,
    typical_length,
    typical_mass,
)
from fem.elements.frame import Frame
from fem.model import DIRECTIONS, Contribution, Model, Parameter, dofs_of, skew


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Rotor(AtPoint):
    """The angular momentum of a rotor at a point: C = -h S(axis) on the point's rotations.

    A rotor of angular momentum h about the axis n resists the rate of turn dθ/dt with dθ/dt × h n (Euler's
    equation of a symmetric rotor; Genta, Dynamics of Rotating Systems, ch. 1): C is skew, does no work, and
    H_ij differs from H_ji. :func:`fem.system.assemble` takes it where it is asked to, and FRFs are computed
    line by line. Mass and inertia of the rotor are other effects (``added_mass``, ``point_inertia``).

    Attributes
    ----------
    axis : tuple of float
        Axis of rotation, a unit vector, global.
    momentum : float
        Polar inertia times speed, positive for right-handed rotation about the axis [kg·m²/s].
    place : str
        Name of the point and the axis.
    reference : float
        A typical member's m L² over a second, which sets the scale [kg·m²/s].
    """

    kind: ClassVar[str] = "rotor"
    role: ClassVar[Role] = Role.GYROSCOPIC
    environment: ClassVar[Environment | None] = Environment.ROTATION
    entry: ClassVar[Entry | None] = Entry(
        quantities="`momentum` [kg·m²/s]",
        meaning="the angular momentum of a rotor at a member's end, a joint or a body",
        places="the local axes at ends, joints and bodies",
    )
    reciprocal: ClassVar[bool] = False
    axis: tuple[float, float, float]
    momentum: Any
    place: str = ""
    reference: float = 1e-2

    @property
    def where(self) -> Site:
        """Place and axis."""
        return Site(self.place or f"point {self.point}")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the angular momentum."""
        return (Parameter("momentum", "kg·m²/s", self.momentum, 0.0, -1e9, 1e9, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return C, skew, on the three rotations."""
        axis = np.asarray(self.axis, dtype=float)
        C = -self.momentum * skew(axis / np.linalg.norm(axis))
        return (Contribution(dofs_of([self.point])[:, 3:], C=C[None]),)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Either way, over five decades and a half."""
        return tuple(
            {"momentum": float(s * f * self.reference)}
            for f in np.geomspace(0.001, 300.0, 12)
            for s in (-1, 1)
        )

    @classmethod
    def propose(cls, model: Model) -> tuple[Self, ...]:
        """Return the axes of a member at its ends and at joints within it, and all axes of added bodies.

        Not where supports hold both turns that the rotor couples.
        """
        if not model.of_kind(Frame):
            return ()
        size = typical_mass(model) * typical_length(model) ** 2
        fixed, out = fixed_directions(model), []
        rigid = {j.point2 for j in model.of_kind(Joint) if len(j.rigid) == len(DIRECTIONS)}
        for point, place, label in _places(model):
            if point in rigid or {"rx", "ry", "rz"} <= fixed.get(point, set()):
                continue
            for name, (x, y, z) in zip("xyz", _axes(model, point), strict=True):
                out.append(
                    cls(
                        name=f"rotor:{label}.{name}",
                        point=point,
                        axis=(float(x), float(y), float(z)),
                        momentum=0.0,
                        place=f"{place}, about local {name}",
                        reference=size,
                    )
                )
        return tuple(out)


def _places(model: Model) -> Iterator[tuple[int, str, str]]:
    """Yield point, words and label of where things are fastened, and of bodies within members."""
    seen: set[int] = set()
    for point, place, label in fastening_places(model):
        seen.add(point)
        yield point, place, label
    for body in model.of_kind(AddedMass):
        if body.point not in seen:
            seen.add(body.point)
            yield body.point, f"mass {body.name}", body.name


def _axes(model: Model, point: int) -> Floats:
    """Return the local axes, as rows, of a line at a point; global ones away from all lines."""
    at = np.flatnonzero((model.mesh.lines == point).any(axis=1))
    return frame_of(model).rotations(model.mesh, at[:1])[0] if at.size else np.eye(3)
