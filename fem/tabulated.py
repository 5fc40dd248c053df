"""Element matrices of an effect as sums of functions of one number each, read from tables."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Contribution

Floats = NDArray[np.float64]

N_NODES = 28
"""Chebyshev nodes of a table. A stiffness 1/(a + b e^-s) has its poles π from the real axis of s: over ± 3.9
the error falls as 2.1^-n (Trefethen, *Approximation Theory*, 2013, theorem 8.2)."""
SEPARABLE = 1e-6
"""Relative error up to which matrices count as sums of functions of one number each."""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """A matrix (m, m) as a function of one number between two ends, by Chebyshev's polynomials."""

    middle: float
    half: float
    coefficients: Floats
    slopes: NDArray[np.floating]

    @classmethod
    def of(cls, low: float, high: float, values: Callable[[float], Floats]) -> "Table":
        """Tabulate a function."""
        middle, half = (low + high) / 2, (high - low) / 2
        angle = np.pi * (np.arange(N_NODES) + 0.5) / N_NODES
        there = np.stack([values(middle + half * x) for x in np.cos(angle)])
        T = np.cos(np.arange(N_NODES)[:, None] * angle) * (2 / N_NODES)
        T[0] /= 2
        c = np.tensordot(T, there, 1)
        return cls(middle, half, c, np.polynomial.chebyshev.chebder(c, axis=0) / half)

    def at(self, s: float) -> Floats:
        """Return the matrix."""
        return np.tensordot(self._polynomials(s), self.coefficients, 1)

    def slope(self, s: float) -> Floats:
        """Return its derivative."""
        out: Floats = np.tensordot(self._polynomials(s)[:-1], self.slopes, 1)
        return out

    def _polynomials(self, s: float) -> Floats:
        x = np.clip((s - self.middle) / self.half, -1.0, 1.0)
        return np.cos(np.arange(N_NODES) * np.arccos(x))


@dataclass(frozen=True, slots=True, eq=False)
class Tabulated:
    """K = A(u) + B(u + plane) and M = mass · M₁ of an effect with the parameter u and perhaps the others."""

    dofs: NDArray[np.int64]
    along: Table
    plane: Table | None
    M: Floats | None

    @classmethod
    def of(
        cls,
        stiffness: Callable[[float, float], Contribution],
        mass: Contribution | None,
        low: float,
        high: float,
        *,
        planar: bool,
    ) -> "Tabulated | None":
        """Tabulate an effect from ``low`` to ``high``; None where K is no such sum, or there are losses."""
        first = stiffness(0.0, 0.0)
        if first.D is not None:
            return None
        dofs = np.unique(np.concatenate([c.dofs.ravel() for c in (first, mass) if c is not None]))

        def whole(c: Contribution, X: Any) -> Floats:
            out, at = np.zeros((len(dofs), len(dofs))), np.searchsorted(dofs, c.dofs)
            np.add.at(out, (at[:, :, None], at[:, None, :]), X)
            return out

        def K(u: float, v: float) -> Floats:
            c = stiffness(u, v)
            return whole(c, c.K)

        M, none = None if mass is None else whole(mass, mass.M), K(0.0, 0.0)
        if not planar:
            return cls(dofs, Table.of(low, high, lambda s: K(s, 0.0)), None, M)
        plane = Table.of(low, high, lambda s: K(0.0, s) - none)
        out = cls(dofs, Table.of(low, high, lambda s: K(s, 0.0) - plane.at(s)), plane, M)
        u, v = 0.35 * high, -0.25 * high
        exact = K(u, v)
        found, _ = out.matrices({"u": u, "plane": v, "mass": 0.0})
        right = np.abs(found - exact).max() <= SEPARABLE * np.abs(exact).max()
        return out if right else None

    def matrices(self, values: Mapping[str, float]) -> tuple[Floats, Floats | None]:
        """Return K and M at values of the parameters."""
        K = self.along.at(values["u"])
        if self.plane is not None:
            K = K + self.plane.at(values["u"] + values["plane"])
        return K, None if self.M is None else values["mass"] * self.M

    def slopes(self, values: Mapping[str, float], parameter: str) -> tuple[Floats | None, Floats | None]:
        """Return the derivatives of K and M by a parameter."""
        if parameter == "mass":
            return None, self.M
        plane = None if self.plane is None else self.plane.slope(values["u"] + values["plane"])
        if parameter == "plane":
            return plane, None
        along = self.along.slope(values["u"])
        return along if plane is None else along + plane, None
