"""ANSYS' coordinate systems: LOCAL, CLOCAL, CS and the global ones of CSYS."""

from dataclasses import dataclass, field

import numpy as np

from fem.array_types import Floats


def rotation(thxy: float, thyz: float, thzx: float) -> Floats:
    """Return axes as rows: turned by THXY about z, then THYZ about x, then THZX about y [deg]."""
    a, b, c = np.deg2rad([thxy, thyz, thzx])
    Z = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    X = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    Y = np.array([[np.cos(c), 0, np.sin(c)], [0, 1, 0], [-np.sin(c), 0, np.cos(c)]])
    axes = (Z @ X @ Y).T
    return np.where(np.abs(axes) < 1e-12, 0.0, axes)


def angles_of(axes: Floats) -> list[float]:
    """Return THXY, THYZ and THZX of axes as rows [deg]: the inverse of :func:`rotation`."""
    x, y, z = axes
    if abs(y[2]) > 1 - 1e-12:  # THXY and THZX turn about one line; the second is 0
        found = [np.arctan2(x[1], x[0]), np.arcsin(np.clip(y[2], -1, 1)), 0.0]
    else:
        found = [np.arctan2(-y[0], y[1]), np.arcsin(y[2]), np.arctan2(-x[2], z[2])]
    return np.rad2deg(found).tolist()


@dataclass(frozen=True, slots=True, eq=False)
class AnsysSystem:
    """A coordinate system.

    Attributes
    ----------
    kind : int, 0 Cartesian, 1 cylindrical (R, θ, Z), 2 spherical (R, θ about z, Φ from the x-y plane)
    axes : ndarray (3, 3), x, y and z in global coordinates, a row each
    origin : ndarray (3,), in the deck's unit of length
    """

    kind: int = 0
    axes: Floats = field(default_factory=lambda: np.eye(3))
    origin: Floats = field(default_factory=lambda: np.zeros(3))

    def to_global(self, local: Floats) -> Floats:
        """Return positions (n, 3) in global coordinates; angles are in degrees."""
        xyz = local
        if self.kind:
            r, turn = local[:, 0], np.deg2rad(local[:, 1])
            tilt = np.deg2rad(local[:, 2]) if self.kind == 2 else np.zeros(len(local))
            flat, height = r * np.cos(tilt), r * np.sin(tilt) if self.kind == 2 else local[:, 2]
            xyz = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), height])
        return xyz @ self.axes + self.origin

    def of_global(self, points: Floats) -> Floats:
        """Return global positions (n, 3) in this system."""
        x, y, z = ((points - self.origin) @ self.axes.T).T
        if not self.kind:
            return np.column_stack([x, y, z])
        flat, turn = np.hypot(x, y), np.rad2deg(np.arctan2(y, x))
        if self.kind == 1:
            return np.column_stack([flat, turn, z])
        return np.column_stack([np.hypot(flat, z), turn, np.rad2deg(np.arctan2(z, flat))])

    def axes_at(self, point: Floats) -> Floats:
        """Return the directions of R, θ, Z or Φ at a global position (3,), a row each; on the axis θ is 0."""
        if not self.kind:
            return self.axes
        _, turn, tilt = self.of_global(point[None])[0]
        # R, θ, Φ are x, y, z turned by θ about z and then lifted by Φ, a negative turn about y
        return rotation(turn, 0.0, -tilt if self.kind == 2 else 0.0) @ self.axes


GLOBAL = {
    0: AnsysSystem(),
    1: AnsysSystem(1),
    2: AnsysSystem(2),
    5: AnsysSystem(1, rotation(0.0, -90.0, 0.0)),
}
"""Cartesian, cylindrical about Z, spherical, cylindrical about Y."""
