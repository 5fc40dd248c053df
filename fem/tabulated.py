"""Element matrices of an effect as sums of functions of one number each, read from tables."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Floats, Ints
from fem.model import Contribution, ParameterRef

N_NODES = 28
"""Chebyshev nodes of a table. A stiffness 1/(a + b e^-s) has its poles π from the real axis of s: over ± 3.9
the error falls as 2.1^-n (Trefethen, *Approximation Theory*, 2013, theorem 8.2)."""
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
    """K = A(u) + B(u + plane) and M = Σ p · M_p of an effect with u, perhaps plane, and masses p.

    The stiffnesses of its elements (b) change with parameters q of other effects, Σ q ∂K/∂q.

    Attributes
    ----------
    dofs : ndarray of int (m,)
    entries : ndarray of int (b, 12)
        DOFs of the elements among these.
    loss : ndarray (b,)
        Loss factors of the elements [-].
    along, plane : ChebyshevTable
        A and B, and their derivatives by changes of the elements, (1 + n_changes, b, 12, 12).
    M : mapping of str to ndarray (m, m)
    follows : tuple of (reference, ndarray of int, int)
        Parameters of other effects, elements that change with them, and number of the change.
    """

    dofs: Ints
    entries: Ints
    loss: Floats
    along: ChebyshevTable
    plane: ChebyshevTable | None
    M: Mapping[str, Floats]
    follows: tuple[tuple[ParameterRef, Ints, int], ...] = ()

    @classmethod
    def of(
        cls,
        dofs_of: Ints,
        loss: Floats,
        stiffness: Callable[[float, float], Floats],
        masses: Mapping[str, Contribution],
        low: float,
        high: float,
        *,
        planar: bool,
    ) -> "TabulatedEffect | None":
        """Tabulate an effect on elements with DOFs ``dofs_of`` (b, 12); None where K is no such sum.

        ``stiffness`` gives A + B and its derivatives at u and plane, from ``low`` to ``high``.
        """
        dofs = np.unique(np.concatenate([dofs_of.ravel(), *(c.dofs.ravel() for c in masses.values())]))

        def assembled(c: Contribution) -> Floats:
            return _assembled(len(dofs), np.searchsorted(dofs, c.dofs), c.M)

        M, none = {name: assembled(c) for name, c in masses.items()}, stiffness(0.0, 0.0)
        entries = np.searchsorted(dofs, dofs_of)
        if not planar:
            along = ChebyshevTable.of(low, high, lambda s: stiffness(s, 0.0))
            return cls(dofs, entries, loss, along, None, M)
        plane = ChebyshevTable.of(low, high, lambda s: stiffness(0.0, s) - none)
        along = ChebyshevTable.of(low, high, lambda s: stiffness(s, 0.0) - plane.at(s))
        u, v = 0.35 * high, -0.25 * high
        exact, found = stiffness(u, v), along.at(u) + plane.at(u + v)
        # Relative error up to which matrices count as sums of functions of one number each
        right = np.abs(found - exact).max() <= 1e-6 * np.abs(exact).max()
        return cls(dofs, entries, loss, along, plane, M) if right else None

    def matrices(
        self, values: Mapping[str, float], others: Mapping[ParameterRef, float]
    ) -> tuple[Floats, Floats | None, Floats | None]:
        """Return K, M and D at values of the parameters and of those of other effects."""
        M = np.add.reduce([values[name] * X for name, X in self.M.items()]) if self.M else None
        K, D = self._sums(self._changed(self._at(values), others))
        return K, M, D

    def slopes(
        self, values: Mapping[str, float], others: Mapping[ParameterRef, float], parameter: str
    ) -> tuple[Floats | None, Floats | None, Floats | None]:
        """Return the derivatives of K, M and D by a parameter."""
        if parameter in self.M:
            return None, self.M[parameter], None
        parts = [] if parameter == "plane" else [self.along.slope(values["u"])]
        parts += [] if self.plane is None else [self.plane.slope(values["u"] + values["plane"])]
        K, D = self._sums(self._changed(np.add.reduce(parts), others))
        return K, None, D

    def slopes_by_others(
        self, values: Mapping[str, float], refs: Sequence[ParameterRef]
    ) -> list[tuple[Floats, Floats | None]]:
        """Return the derivatives of K and D by parameters of other effects."""
        each, out = self._at(values), []
        for ref in refs:
            of_lines = np.zeros_like(each[0])
            for _, lines, k in (f for f in self.follows if f[0] == ref):
                of_lines[lines] = each[1 + k][lines]
            out.append(self._sums(of_lines))
        return out

    def _at(self, values: Mapping[str, float]) -> Floats:
        each = self.along.at(values["u"])
        return each if self.plane is None else each + self.plane.at(values["u"] + values["plane"])

    def _changed(self, each: Floats, others: Mapping[ParameterRef, float]) -> Floats:
        """Return the matrices of the elements, (b, 12, 12), as other effects change them."""
        out = each[0].copy()
        for ref, lines, k in self.follows:
            if value := others[ref]:
                out[lines] += value * each[1 + k][lines]
        return out

    def _sums(self, each: Floats) -> tuple[Floats, Floats | None]:
        n = len(self.dofs)
        D = self.loss[:, None, None] * each if self.loss.any() else None
        return _assembled(n, self.entries, each), None if D is None else _assembled(n, self.entries, D)


def _assembled(n: int, entries: Ints, matrices: Any) -> Floats:
    out = np.zeros((n, n))
    np.add.at(out, (entries[:, :, None], entries[:, None, :]), matrices)
    return out
