"""Nastran's coordinate systems: CORD1R, CORD1C, CORD1S, CORD2R, CORD2C and CORD2S."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from fem.array_types import Floats
from fem.io.deck import integer
from fem.io.faults import error_at, refuse
from fem.io.nastran_cards import real
from fem.mesh import MeshError


@dataclass(frozen=True, slots=True)
class NastranSystem:
    """A coordinate system as its card gives it.

    Attributes
    ----------
    kind : R, C or S
    place : file and line
    reference : system of the points, of CORD2 cards
    points : origin, point on z and point in the x-z plane, (3, 3), of CORD2 cards
    grids : the same as grid points, of CORD1 cards
    """

    kind: str
    place: str
    reference: int = 0
    points: tuple[tuple[float, ...], ...] = ()
    grids: tuple[int, ...] = ()


@dataclass(slots=True)
class NastranSystems:
    """All systems of a deck.

    Attributes
    ----------
    grid : the system and the local coordinates of a grid point, None for one that is not there
    """

    grid: Callable[[int], tuple[int, Floats] | None]
    named: dict[int, NastranSystem] = field(default_factory=dict)
    _frames: dict[int, tuple[Floats, Floats]] = field(default_factory=dict)

    def add(self, name: str, fields: list[str], place: str) -> None:
        """Add the coordinate system that a card defines."""
        kind = name[-1]
        found: dict[int, NastranSystem] = {}
        try:
            if name[:5] == "CORD2":
                values = [real(f) for f in [*fields, *[""] * 11][2:11]]
                points = tuple(tuple(values[k : k + 3]) for k in (0, 3, 6))
                found[integer(fields[0])] = NastranSystem(kind, place, integer(fields[1] or "0"), points)
            else:
                for cells in (fields[0:4], fields[4:8]):
                    if any(cells):
                        number, *grids = (integer(c) for c in cells)
                        found[number] = NastranSystem(kind, place, grids=tuple(grids))
        except ValueError as reason:
            raise error_at(place, f"{name} {', '.join(fields)} cannot be read: {reason}") from reason
        for number, system in found.items():
            old = self.named.setdefault(number, system)
            same = (old.kind, old.reference, old.points, old.grids)
            if number < 1 or same != (kind, system.reference, system.points, system.grids):
                msg = (
                    f"{place}: coordinate system {number} is already defined, differently, at {old.place}; "
                    "give one of them another number"
                )
                if number < 1:
                    msg = f"{place}: coordinate system {number} is not allowed; numbers begin with 1"
                raise MeshError(msg)

    def to_basic(self, number: int, xyz: Floats, place: str) -> Floats:
        """Return basic coordinates of points (n, 3) that a system has, angles in degrees."""
        if number == 0:
            return xyz
        axes, origin = self._frame(number, place)
        return _cartesian(self.named[number].kind, xyz) @ axes + origin

    def axes_at(self, number: int, point: Floats, place: str) -> Floats:
        """Return the unit vectors along a system's coordinates at a basic point, as rows (3, 3)."""
        if number == 0:
            return np.eye(3)
        axes, origin = self._frame(number, place)
        kind = self.named[number].kind
        x, y, z = axes @ (point - origin)
        about_z = math.atan2(y, x) if math.hypot(x, y) > 1e-9 * max(abs(z), 1e-300) else 0.0
        c, s = math.cos(about_z), math.sin(about_z)
        radial, around, up = c * axes[0] + s * axes[1], c * axes[1] - s * axes[0], axes[2]
        if kind == "R":
            return axes
        if kind == "C":
            return np.stack([radial, around, up])
        theta = math.atan2(math.hypot(x, y), z)
        c, s = math.cos(theta), math.sin(theta)
        return np.stack([s * radial + c * up, c * radial - s * up, around])

    def _frame(self, number: int, place: str) -> tuple[Floats, Floats]:
        waiting: list[tuple[int, str]] = [(number, place)]
        under_way: dict[int, None] = {}
        while waiting:
            top, place = waiting[-1]
            if top in self._frames:
                under_way.pop(top, None)
                waiting.pop()
                continue
            if top not in self.named:
                refuse(f"{place} is in coordinate system {top}, which the file does not have", MeshError)
            system = self.named[top]
            needed = [n for n in self._needed(top, system) if n and n not in self._frames]
            if not needed:
                self._frames[top] = self._built(top, system)
                continue
            under_way[top] = None
            loop = next((n for n in needed if n in under_way), None)
            if loop is not None:
                chain = " → ".join(map(str, [*list(under_way)[list(under_way).index(loop) :][:10], loop]))
                raise error_at(system.place, f"coordinate systems refer to each other: {chain}")
            waiting += [(n, f"{system.place}: coordinate system {top}") for n in needed]
        return self._frames[number]

    def _needed(self, number: int, system: NastranSystem) -> list[int]:
        if not system.grids:
            return [system.reference]
        found = [self.grid(n) for n in system.grids]
        lost = next((n for n, one in zip(system.grids, found, strict=True) if one is None), None)
        if lost is not None:
            raise error_at(
                system.place,
                f"coordinate system {number} refers to grid point {lost}, which the file does not have",
            )
        return [one[0] for one in found if one is not None]

    def _built(self, number: int, system: NastranSystem) -> tuple[Floats, Floats]:
        if system.grids:
            found = [one for n in system.grids if (one := self.grid(n)) is not None]
            points = np.array([self.to_basic(cp, xyz[None], system.place)[0] for cp, xyz in found])
        else:
            points = self.to_basic(system.reference, np.array(system.points), system.place)
        a, b, c = points
        z = b - a
        y = np.cross(z, c - a)
        lengths = np.linalg.norm(z), np.linalg.norm(y)
        if not lengths[1] > 1e-9 * lengths[0] * max(float(np.linalg.norm(c - a)), 1e-300):
            msg = (
                f"{system.place}: coordinate system {number} has no axes: its points lie on one line, or "
                "two of them coincide"
            )
            raise MeshError(msg)
        z, y = z / lengths[0], y / lengths[1]
        return np.asarray(np.stack([np.cross(y, z), y, z]), dtype=float), a


def _cartesian(kind: str, xyz: Floats) -> Floats:
    """Return Cartesian coordinates of r, θ, z (C) or r, θ from z, φ about z (S)."""
    if kind == "R":
        return xyz
    r, second, third = xyz.T
    if kind == "C":
        theta = np.deg2rad(second)
        return np.column_stack([r * np.cos(theta), r * np.sin(theta), third])
    theta, phi = np.deg2rad(second), np.deg2rad(third)
    flat = r * np.sin(theta)
    return np.column_stack([flat * np.cos(phi), flat * np.sin(phi), r * np.cos(theta)])
