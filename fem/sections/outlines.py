"""Areas and moments of plane figures: polygons with fillets, exact.

Points are (y, z) [m]. Green's theorem turns the integrals over a polygon into sums over its edges. A fillet
of radius r in a square corner is a square r by r less a quarter of a circle; integrated from the corner:

    A = (1 - π/4) r²,  S = (5/6 - π/4) r³,  ∫z² dA = (1 - 5π/16) r⁴,  ∫yz dA = (19/24 - π/4) r⁴
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats
from fem.materials import PropertyError

Fillet = tuple[float, float, float, float, float]
"""Corner y and z [m], the signs of the directions to the fillet, its radius [m]; below 0, it is cut off."""


class Integrals(NamedTuple):
    """Integrals over a plane figure.

    Attributes
    ----------
    A : float
        Area [m²].
    Sy, Sz : float
        ∫z dA and ∫y dA [m³].
    Iy, Iz, Iyz : float
        ∫z² dA, ∫y² dA and ∫yz dA [m⁴].
    """

    A: float
    Sy: float
    Sz: float
    Iy: float
    Iz: float
    Iyz: float

    @property
    def centroid(self) -> Floats:
        """Centre of area (y, z) [m]."""
        return np.array([self.Sz, self.Sy]) / self.A

    def centred(self) -> "Integrals":
        """Return the integrals about the parallel axes through the centroid."""
        y, z = self.centroid
        A = self.A
        return Integrals(A, 0.0, 0.0, self.Iy - A * z**2, self.Iz - A * y**2, self.Iyz - A * y * z)

    def turned(self, angle: float) -> "Integrals":
        """Return the integrals about axes turned from y towards z by an angle [rad]."""
        c, s = np.cos(angle), np.sin(angle)
        return Integrals(
            self.A,
            c * self.Sy - s * self.Sz,
            c * self.Sz + s * self.Sy,
            c**2 * self.Iy - 2 * s * c * self.Iyz + s**2 * self.Iz,
            c**2 * self.Iz + 2 * s * c * self.Iyz + s**2 * self.Iy,
            (c**2 - s**2) * self.Iyz - s * c * (self.Iz - self.Iy),
        )

    @property
    def principal_angle(self) -> float:
        """Angle from y, towards z, to the principal axis nearest to y [rad].

        tan 2θ = 2 Iyz / (Iz - Iy) about the centroid; within ±π/4, and 0 where Iyz is of rounding size.
        """
        c = self.centred()
        if abs(c.Iyz) <= 1e-12 * (c.Iy + c.Iz):
            return 0.0
        difference = c.Iz - c.Iy
        if abs(difference) <= 1e-12 * (c.Iy + c.Iz):
            return float(np.copysign(np.pi / 4, c.Iyz))
        return float(np.arctan(2 * c.Iyz / difference) / 2)


def integrate(outlines: Sequence[ArrayLike], fillets: Sequence[Fillet] = ()) -> Integrals:
    """Return the integrals over polygons, the outer first, then holes, with fillets.

    Parameters
    ----------
    outlines : sequence of array_like (n, 2)
        Corners (y, z) in order, either way round [m].
    fillets : sequence of Fillet
    """
    total = np.zeros(6)
    for k, outline in enumerate(outlines):
        y, z = closed_polygon(outline).T
        y2, z2 = np.roll(y, -1), np.roll(z, -1)
        cross = y * z2 - y2 * z
        part = [
            cross.sum() / 2,
            cross @ (z + z2) / 6,
            cross @ (y + y2) / 6,
            cross @ (z**2 + z * z2 + z2**2) / 12,
            cross @ (y**2 + y * y2 + y2**2) / 12,
            cross @ (2 * y * z + y * z2 + y2 * z + 2 * y2 * z2) / 24,
        ]
        total += np.array(part) * np.sign(part[0]) * (-1 if k else 1)
    for y, z, ey, ez, radius in fillets:
        r, sign = abs(radius), np.sign(radius)
        A, S = (1 - np.pi / 4) * r**2, (5 / 6 - np.pi / 4) * r**3
        second, product = (1 - 5 * np.pi / 16) * r**4, (19 / 24 - np.pi / 4) * r**4
        total += sign * np.array(
            [
                A,
                A * z + ez * S,
                A * y + ey * S,
                A * z**2 + 2 * z * ez * S + second,
                A * y**2 + 2 * y * ey * S + second,
                A * y * z + (y * ez + z * ey) * S + ey * ez * product,
            ]
        )
    return Integrals(*(float(v) for v in total))


def closed_polygon(outline: ArrayLike) -> Floats:
    """Return a polygon's corners (n, 2), without the first one repeated at the end.

    Raises
    ------
    PropertyError
        If it is not a list of at least three points.
    """
    points = np.array(outline, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        msg = (
            f"an outline has the shape {points.shape}; it must be (n, 2): y and z of each corner, finite [m]"
        )
        raise PropertyError(msg)
    if len(points) > 1 and np.array_equal(points[0], points[-1]):
        points = points[:-1]
    if len(points) < 3:
        msg = f"an outline has {len(points)} corners; it must have at least 3"
        raise PropertyError(msg)
    return points


def with_arcs(outline: ArrayLike, radii: Sequence[float]) -> Floats:
    """Return a polygon with arcs instead of its corners, for drawing.

    Parameters
    ----------
    outline : array_like (n, 2)
    radii : sequence of float
        For each corner [m]; 0 leaves it.
    """
    points = np.asarray(outline, dtype=float)
    out: list[Floats] = []
    for k, radius in enumerate(radii):
        p, before, after = points[k], points[k - 1] - points[k], points[(k + 1) % len(points)] - points[k]
        if radius == 0:
            out.append(p)
            continue
        a, b = before / np.linalg.norm(before), after / np.linalg.norm(after)
        centre = p + radius * (a + b)  # square corners
        for phi in np.linspace(0, np.pi / 2, 5):
            out.append(centre - radius * (b * np.cos(phi) + a * np.sin(phi)))
    return np.array(out)


def turned(points: ArrayLike, centre: Floats, angle: float) -> Floats:
    """Return points (n, 2) from a centre, in axes turned from y towards z by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return (np.asarray(points, dtype=float) - centre) @ np.array([[c, -s], [s, c]])


def box(b: float, h: float) -> Floats:
    """Return the corners of a rectangle about its centre."""
    return np.array([(-b / 2, -h / 2), (b / 2, -h / 2), (b / 2, h / 2), (-b / 2, h / 2)])


def ring(b: float, h: float, n: int = 24) -> Floats:
    """Return n corners on an ellipse of widths b and h about its centre."""
    phi = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return np.column_stack([b / 2 * np.cos(phi), h / 2 * np.sin(phi)])


def regular_polygon(n: int, across: float) -> Floats:
    """Return the corners of a regular polygon of n sides about its centre, one flat towards -z."""
    phi = -np.pi / 2 + (2 * np.arange(n) - 1) * np.pi / n
    return across / (2 * np.cos(np.pi / n)) * np.column_stack([np.cos(phi), np.sin(phi)])
