"""Joints between two points, or between a point and the ground.

A joint has 6×6 K, C, D and M at a place, from which lever arms lead to the points.
"""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Floats, Ints
from fem.declarations import Marker, Role, Site, Yardstick
from fem.effects.added_mass import too_heavy
from fem.model import (
    DIRECTIONS,
    Constraint,
    Contribution,
    Effect,
    Model,
    ModelError,
    Parameter,
    dofs_of,
    lever_matrix,
)

TRANSLATIONS = DIRECTIONS[:3]


def joint_unit(direction: str, what: str = "k") -> str:
    """Return the SI unit of a joint's stiffness, damping or loss factor in a direction.

    ``what`` is ``"k"`` for the stiffness, ``"c"`` for the viscous damping, ``"eta"`` for the loss factor.
    """
    if what == "eta":
        return "-"
    base = "N/m" if direction in TRANSLATIONS else "N·m/rad"
    return base if what == "k" else base.replace("N/m", "N·s/m").replace("N·m/rad", "N·m·s/rad")


def relative_rows(model: Model, point1: int, point2: int | None, location: Floats) -> tuple[Ints, Floats]:
    """Return the DOFs of two points, and B with δ = B u.

    δ is the motion of the first relative to the second at a place, to which both are carried rigidly.

    Parameters
    ----------
    model : Model
    point1 : int
        Point of the mesh.
    point2 : int or None
        Another point, or None for the ground.
    location : ndarray (3,)
        Where the joint acts [m].

    Returns
    -------
    dofs : ndarray of int (12,) or (6,)
    B : ndarray (6, 12) or (6, 6)
    """
    points = model.mesh.points
    B1 = lever_matrix(location - points[point1])
    if point2 is None:
        return dofs_of(point1), B1
    return np.concatenate([dofs_of(point1), dofs_of(point2)]), np.hstack(
        [B1, -lever_matrix(location - points[point2])]
    )


class Spread(Effect):
    """An effect that lets elements between two points act on stretches of members rather than on points."""

    __slots__ = ()

    @abstractmethod
    def mean(self, model: Model, point: int, other: int | None) -> tuple[Ints, Floats] | None:
        """Return DOFs (n,) and rows (6, n) of the motion in place of a point's; None where it is the point's.

        Parameters
        ----------
        model : Model
        point, other : int
            The point, and that on the other side of the element; None is the ground.
        """

    @abstractmethod
    def fitted_in(self, model: Model) -> Self:
        """Return it with the values that a model's elements have by now."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PointPair(Effect):
    """An element between two points, or between a point and the ground, with a place and axes.

    Attributes
    ----------
    point1 : int
        Point of the mesh on the first side.
    point2 : int or None
        Point on the second side, None for the ground.
    location : ndarray (3,)
        Where the element acts; lever arms to the points are rigid [m].
    axes : ndarray (3, 3)
        The element's x, y and z as rows, in global components; all its directions and matrices are in these.
    """

    connection: ClassVar[bool] = True
    point1: int
    point2: int | None = None
    location: Floats
    axes: Floats = field(default_factory=lambda: np.eye(3))

    def check(self) -> None:
        """Raise a ModelError unless the axes are unit vectors, square to each other and right-handed."""
        axes = np.asarray(self.axes, dtype=float)
        square = axes.shape == (3, 3) and np.abs(axes @ axes.T - np.eye(3)).max() < 1e-6
        if not square or np.linalg.det(axes) < 0:
            msg = (
                f"{self.where}: its axes are {axes.tolist()}; allowed are three unit vectors as rows, "
                "square to each other and right-handed"
            )
            raise ModelError(msg)

    def relative(self, model: Model) -> tuple[Ints, Floats]:
        """Return the DOFs, (n,), and B (6, n) with the relative motion δ = B u in the element's axes.

        The DOFs are those of its points, unless the model has an effect that spreads it over its members.
        """
        dofs, B = self._spread(model) or relative_rows(model, self.point1, self.point2, self.location)
        return dofs, np.kron(np.eye(2), self.axes) @ B

    def _spread(self, model: Model) -> tuple[Ints, Floats] | None:
        if self.point2 is None:
            return None
        one, two = self.point1, self.point2
        for effect in model.of_kind(Spread):
            first, second = effect.mean(model, one, two), effect.mean(model, two, one)
            if first is not None and second is not None:
                B1 = lever_matrix(self.location - model.mesh.points[one]) @ first[1]
                B2 = lever_matrix(self.location - model.mesh.points[two]) @ second[1]
                return np.concatenate([first[0], second[0]]), np.hstack([B1, -B2])
        return None

    @property
    def rigid_directions(self) -> tuple[str, ...]:
        """Directions of its axes in which it has no relative motion."""
        return ()

    def locations(self, model: Model) -> Floats:
        """Return its place, (1, 3) [m]."""
        return self.location[None]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Joint(PointPair):
    """A massless or massive joint, in global or other axes.

    The relative motion δ of its two sides at ``location`` is resisted by K(1 + iη) δ + iωC δ; a direction in
    ``rigid`` has none. M is a 6×6 mass matrix at the location, shared equally by the two sides.

    Attributes
    ----------
    K, C, D : ndarray (6, 6)
        Stiffness [N/m, N·m/rad], viscous damping, and structural damping in addition to ``eta`` [N/m,
        N·m/rad].
    M : ndarray (6, 6)
        Mass and inertia at the location [kg, kg·m²].
    eta : float
        Loss factor of K [-].
    rigid : tuple of str
        Directions without relative motion.
    """

    kind: ClassVar[str] = "joint"
    role: ClassVar[Role] = Role.STIFFNESS | Role.MASS | Role.DISSIPATION
    marker: ClassVar[Marker | None] = Marker("diamond", "joint")
    K: NDArray[Any] = field(default_factory=lambda: np.zeros((6, 6)))
    C: NDArray[Any] = field(default_factory=lambda: np.zeros((6, 6)))
    D: NDArray[Any] = field(default_factory=lambda: np.zeros((6, 6)))
    M: NDArray[Any] = field(default_factory=lambda: np.zeros((6, 6)))
    eta: Any = 0.0
    rigid: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self.check()
        for key in "KCDM":
            matrix = getattr(self, key)
            if np.shape(matrix) != (6, 6):
                msg = f"joint '{self.name}': {key} has shape {np.shape(matrix)}; (6, 6) is expected"
                raise ModelError(msg)
            scale = np.sqrt(np.abs(np.outer(np.diag(matrix), np.diag(matrix)))) + np.abs(matrix).max() * 1e-9
            if (np.abs(matrix - matrix.T) > 1e-6 * scale).any():
                msg = f"joint '{self.name}': {key} is not symmetric"
                raise ModelError(msg)
        if np.any(self.M):
            mass = np.linalg.eigvalsh(np.real(self.M))
            if mass[0] < -1e-9 * np.abs(mass).max():
                msg = f"joint '{self.name}': M has the eigenvalue {mass[0]:g}; masses cannot be negative"
                raise ModelError(msg)

    @property
    def where(self) -> Site:
        """The joint's name."""
        return Site(f"joint {self.name}")

    @property
    def rigid_directions(self) -> tuple[str, ...]:
        """Return ``rigid``."""
        return self.rigid

    @property
    def elastic(self) -> tuple[str, ...]:
        """Directions with a stiffness."""
        diagonal = np.real(np.diag(self.K))
        return tuple(d for d, k in zip(DIRECTIONS, diagonal, strict=True) if k > 0 and d not in self.rigid)

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the diagonal stiffnesses ``kx … krz`` of its elastic directions, and the loss factor."""
        k = np.diag(self.K)
        out = [
            Parameter(
                f"k{d}", joint_unit(d), k[i], 0.0, 1e-6 * abs(k[i]), 1e6 * abs(k[i]), log=True, linear=True
            )
            for i, d in enumerate(DIRECTIONS)
            if d in self.elastic
        ]
        if self.elastic:
            out.append(Parameter("eta", "-", self.eta, 0.0, 0.0, 2.0))
        return tuple(out)

    def with_values(self, **values: Any) -> Self:
        """Return a joint with other diagonal stiffnesses or loss factor."""
        K = np.array(self.K, dtype=np.result_type(float, self.K, *map(type, values.values())))
        for name, value in values.items():
            if name != "eta":
                i = DIRECTIONS.index(name[1:])
                K[i, i] = value
        return replace(self, K=K, eta=values.get("eta", self.eta))

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return BᵀKB, BᵀCB, Bᵀ(D + ηK)B on the two points' DOFs, and the masses."""
        dofs, B = self.relative(model)
        free = np.array([float(d not in self.rigid) for d in DIRECTIONS])
        Bf = free[:, None] * B
        parts = [
            Contribution(
                dofs[None],
                *(
                    (Bf.T @ X @ Bf)[None] if np.any(X) else None
                    for X in (self.K, 0 * self.M, self.C, self.D + self.eta * self.K)
                ),
            )
        ]
        if np.any(self.M):
            sides = [p for p in (self.point1, self.point2) if p is not None]
            for point in sides:
                T = np.kron(np.eye(2), self.axes) @ lever_matrix(self.location - model.mesh.points[point])
                parts.append(Contribution(dofs_of(point)[None], M=(T.T @ self.M @ T)[None] / len(sides)))
        return tuple(parts)

    def doubts(self, structure: Yardstick) -> Iterator[tuple[str, str]]:
        """Yield absurd stiffnesses, a loss factor above 1, and a mass that no member carries."""
        for d in self.elastic:
            k = float(np.real(self.K[DIRECTIONS.index(d), DIRECTIONS.index(d)]))
            if k > 0 and (text := structure.odd_stiffness(d, k)):
                yield f"k{d}", f"joint '{self.name}': k{d} is {text}"
        eta = float(np.real(self.eta))
        if eta > 1:
            yield (
                "eta",
                f"joint '{self.name}': its loss factor eta = {eta:g} is implausible; joints have up to 1; in "
                f"per cent it would be {eta / 100:g}",
            )
        mass = float(np.real(np.diag(self.M)[:3]).max())
        for _, text in too_heavy(self.name, mass, structure):
            yield "M", f"joint {text}"

    def constraints(self, model: Model) -> tuple[Constraint, ...]:
        """No relative motion in the rigid directions."""
        if not self.rigid:
            return ()
        dofs, B = self.relative(model)
        place = self.location if len(dofs) in (6, 12) else None  # not where it acts on stretches of members
        return tuple(
            Constraint((self.name, d), dofs, B[DIRECTIONS.index(d)], location=place) for d in self.rigid
        )
