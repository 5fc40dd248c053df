"""Slopes of dynamic stiffness at the same DOFs, on the few motions that they resist, in single precision."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Floats, Ints
from fem.reduction.terms import ReducedTerm, motions_of

TINY = 1e-12
"""Smaller parts of the largest entry do not count in single precision: three of them are not subnormal."""
OUTSIDE = 1e-12
"""Share of the squares of a matrix that may be outside a range: rounding."""

SlopePart = tuple[int, Any, ReducedTerm | None, Floats]
"""Row, factor at each line or its key, the term of a matrix (m, m), None of one on the basis, and it."""
Ranges = dict[Any, "Range"]


@dataclass(frozen=True, slots=True, eq=False)
class Range:
    """The motions of some DOFs that matrices resist, as combinations of a basis's columns.

    With the basis L at the DOFs, Lᵀ X L = Zᵀ Y Z with Y = P X Pᵀ and P = Z Lᵀ. Strains are differences of
    motions, which single precision would lose: rows of Z are orthonormal, however small the strains are.

    Attributes
    ----------
    inverse : ndarray (k, m)
        S⁺ of the forces S (m, k) of these motions: X = S (S⁺ X S⁺ᵀ) Sᵀ.
    scale : ndarray (m,)
        Sizes of the rows of X in S⁺.
    S : ndarray (m, k)
    P : ndarray (k, m)
    Z : ndarray (k, r)
    """

    inverse: Floats
    scale: Floats
    S: Floats
    P: Floats
    Z: NDArray[np.float32]

    @classmethod
    def of(cls, L: Floats, matrices: Sequence[Floats]) -> "Range":
        """Return the range of some symmetric matrices together."""
        S, inverse, scale = motions_of(list(matrices))
        Z = np.linalg.svd(S.T @ L, full_matrices=False)[2]
        return cls(inverse, scale, S, Z @ L.T, Z.astype(np.float32))

    def holds(self, matrices: Floats) -> bool:
        """Whether matrices (n, m, m) resist no other motions."""
        within = self.inverse @ matrices @ self.inverse.T
        scaled = matrices / np.outer(self.scale, self.scale)
        every = np.einsum("nij,nij->n", scaled, scaled)
        return not (every - np.einsum("nij,nij->n", within, within) > OUTSIDE * every).any()


@dataclass(frozen=True, slots=True, eq=False)
class SlopesTogether:
    """Slopes X = Aᵀ x A of n parts with the motions A in common.

    Attributes
    ----------
    rows : ndarray of int (n,)
        What they are slopes by; the same for several parts.
    factors : list of (str or ndarray)
        Of each, at all lines, or its key.
    along : ndarray (k, r) or None
        A, as combinations of the basis's columns; None for these themselves.
    matrices : ndarray (n, k, k)
        x, in parts of their largest entries.
    sizes : ndarray (n,)
        The largest entries.
    """

    rows: Ints
    factors: list[Any]
    along: NDArray[np.float32] | None
    matrices: NDArray[np.float32]
    sizes: Floats


def together(parts: Sequence[SlopePart], ranges: Ranges) -> list[SlopesTogether]:
    """Return slopes of Z, those at the same DOFs together.

    Forces of stiffness and losses are apart from those of inertia, which resists more motions. ``ranges`` are
    those that are known; others are added.
    """
    groups: dict[Any, list[SlopePart]] = {}
    for part in parts:
        _, factor, term, _ = part
        groups.setdefault(_place(factor, term), []).append(part)
    out = []
    for key, group in groups.items():
        term, matrices, along = group[0][2], np.array([X for *_, X in group]), None
        if term is not None and term.L is not None:
            matrices, along = _on_range(key, term.L, matrices, ranges)
        size = np.abs(matrices).max(axis=(1, 2), initial=1e-300)
        single = (matrices / size[:, None, None]).astype(np.float32)
        single[np.abs(single) < TINY] = 0.0
        rows = np.array([i for i, *_ in group])
        out.append(SlopesTogether(rows, [f for _, f, *_ in group], along, single, size))
    return out


def _place(factor: Any, term: ReducedTerm | None) -> Any:
    """Return a key that slopes at the same DOFs have in common, None for those on the whole basis."""
    if term is None or term.L is None:
        return None
    at = term.L if term.dofs is None else term.dofs
    return at.tobytes(), isinstance(factor, str) and factor == "M"


def _on_range(key: Any, L: Floats, matrices: Floats, ranges: Ranges) -> tuple[Floats, NDArray[np.float32]]:
    """Return matrices (n, m, m) on the motions that they resist, (n, k, k), and these (k, r)."""
    known = ranges.get(key)
    if known is None or not known.holds(matrices):
        before = [] if known is None else [known.S @ known.S.T]
        known = ranges[key] = Range.of(L, [*before, *matrices])
    return known.P @ matrices @ known.P.T, known.Z
