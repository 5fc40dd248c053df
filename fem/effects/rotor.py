"""A spinning rotor, whose gyroscopic moment couples rotations about two axes."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fem.model import Contribution, Effect, Model, Parameter, dofs_of, skew


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Rotor(Effect):
    """The angular momentum of a rotor at a point: C = -h S(axis) on the point's rotations.

    A rotor of angular momentum h about the axis n resists the rate of turn dθ/dt with dθ/dt × h n (Euler's
    equation of a symmetric rotor; Genta, Dynamics of Rotating Systems, ch. 1): C is skew, does no work, and
    H_ij differs from H_ji. The solvers of this package rely on symmetry and refuse it, so that it is not
    proposed either; its matrices serve those who bring a solver. Mass and inertia of the rotor are another
    effect (``added_mass``).

    Attributes
    ----------
    point : int
        Point of the mesh.
    axis : tuple of float
        Axis of rotation, a unit vector, global.
    momentum : float
        Polar inertia times speed, positive for right-handed rotation about the axis [kg·m²/s].
    """

    kind: ClassVar[str] = "rotor"
    reciprocal: ClassVar[bool] = False
    point: int
    axis: tuple[float, float, float]
    momentum: Any

    @property
    def where(self) -> str:
        """The point."""
        return f"point {self.point}"

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the angular momentum."""
        return (Parameter("momentum", "kg·m²/s", self.momentum, 0.0, -1e9, 1e9, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return C, skew, on the three rotations."""
        axis = np.asarray(self.axis, dtype=float)
        C = -self.momentum * skew(axis / np.linalg.norm(axis))
        return (Contribution(dofs_of([self.point])[:, 3:], C=C[None]),)

    def starts(self, scale: Callable[[tuple[str, str]], float]) -> tuple[dict[str, float], ...]:
        """Either way, over four decades."""
        return tuple({"momentum": s * 10.0**e} for e in range(-3, 2) for s in (-1, 1))

    def locations(self, model: Model) -> NDArray[np.float64]:
        """Return the point."""
        return model.mesh.points[[self.point]]
