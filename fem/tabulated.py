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
NEGLIGIBLE = 1e-13
"""Singular values of tables that are left out [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class ChebyshevTable:
    """An array as a function of one number between two ends: Σ f_k A_k, with Chebyshev's polynomials for f.

    Attributes
    ----------
    middle, half : float
        Of the range.
    factors, slopes : ndarray (n, r), (n - 1, r)
        Coefficients of f and of their derivatives.
    parts : ndarray (r, …)
        A_k.
    """

    middle: float
    half: float
    factors: Floats
    slopes: NDArray[np.floating]
    parts: Floats

    @classmethod
    def of(
        cls,
        low: float,
        high: float,
        values: Callable[[float], Floats],
        n: int = N_NODES,
        negligible: float = NEGLIGIBLE,
    ) -> "ChebyshevTable":
        """Tabulate a function at n nodes. Of its values there few singular vectors are not negligible."""
        middle, half = (low + high) / 2, (high - low) / 2
        angle = np.pi * (np.arange(n) + 0.5) / n
        there = np.stack([values(middle + half * x) for x in np.cos(angle)])
        T = np.cos(np.arange(n)[:, None] * angle) * (2 / n)
        T[0] /= 2
        U, size, rows = np.linalg.svd(T @ there.reshape(n, -1), full_matrices=False)
        kept = size > negligible * max(size[0], 1e-300)
        c = U[:, kept] * size[kept]
        slopes = np.polynomial.chebyshev.chebder(c, axis=0) / half
        return cls(middle, half, c, slopes, rows[kept].reshape(-1, *there.shape[1:]))

    def at(self, s: float) -> Floats:
        """Return the array."""
        out: Floats = np.tensordot(self.factors_at(s), self.parts, 1)
        return out

    def slope(self, s: float) -> Floats:
        """Return its derivative."""
        out: Floats = np.tensordot(self.slopes_at(s), self.parts, 1)
        return out

    def factors_at(self, s: float) -> Floats:
        """Return f (r,)."""
        return self._polynomials(s) @ self.factors

    def slopes_at(self, s: float) -> Floats:
        """Return the derivatives of f (r,)."""
        out: Floats = self._polynomials(s)[:-1] @ self.slopes
        return out

    def _polynomials(self, s: float) -> Floats:
        x = min(max((s - self.middle) / self.half, -1.0), 1.0)
        return np.cos(np.arange(len(self.factors)) * np.arccos(x))


@dataclass(frozen=True, slots=True, eq=False)
class TabulatedEffect:
    """K = A(u) + B(u + plane) and M = Σ p · M_p of an effect with u, perhaps plane, and masses p."""

    dofs: NDArray[np.int64]
    along: ChebyshevTable
    plane: ChebyshevTable | None
    M: Mapping[str, Floats]

    @classmethod
    def of(
        cls,
        stiffness: Callable[[float, float], Contribution],
        masses: Mapping[str, Contribution],
        low: float,
        high: float,
        *,
        planar: bool,
    ) -> "TabulatedEffect | None":
        """Tabulate an effect from ``low`` to ``high``; None where K is no such sum, or there are losses."""
        first = stiffness(0.0, 0.0)
        if first.D is not None:
            return None
        dofs = np.unique(np.concatenate([c.dofs.ravel() for c in (first, *masses.values())]))

        def assembled(c: Contribution, X: Any) -> Floats:
            out, at = np.zeros((len(dofs), len(dofs))), np.searchsorted(dofs, c.dofs)
            np.add.at(out, (at[:, :, None], at[:, None, :]), X)
            return out

        def K(u: float, v: float) -> Floats:
            c = stiffness(u, v)
            return assembled(c, c.K)

        M, none = {name: assembled(c, c.M) for name, c in masses.items()}, K(0.0, 0.0)
        if not planar:
            return cls(dofs, ChebyshevTable.of(low, high, lambda s: K(s, 0.0)), None, M)
        plane = ChebyshevTable.of(low, high, lambda s: K(0.0, s) - none)
        out = cls(dofs, ChebyshevTable.of(low, high, lambda s: K(s, 0.0) - plane.at(s)), plane, M)
        u, v = 0.35 * high, -0.25 * high
        exact = K(u, v)
        found, _ = out.matrices({"u": u, "plane": v} | dict.fromkeys(masses, 0.0))
        right = np.abs(found - exact).max() <= SEPARABLE * np.abs(exact).max()
        return out if right else None

    def matrices(self, values: Mapping[str, float]) -> tuple[Floats, Floats | None]:
        """Return K and M at values of the parameters."""
        K = self.along.at(values["u"])
        if self.plane is not None:
            K = K + self.plane.at(values["u"] + values["plane"])
        return K, np.add.reduce([values[name] * M for name, M in self.M.items()]) if self.M else None

    def slopes(self, values: Mapping[str, float], parameter: str) -> tuple[Floats | None, Floats | None]:
        """Return the derivatives of K and M by a parameter."""
        if parameter in self.M:
            return None, self.M[parameter]
        plane = None if self.plane is None else self.plane.slope(values["u"] + values["plane"])
        if parameter == "plane":
            return plane, None
        along = self.along.slope(values["u"])
        return along if plane is None else along + plane, None
