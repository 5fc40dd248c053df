"""Matrices of effects on reduced coordinates: the terms of which a reduced model's matrices are sums."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Floats, Ints
from fem.model import Contribution

STEP = 1e-200
"""Complex step; derivatives are exact to rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class ReducedTerm:
    """Matrices on the reduced coordinates, X = Lᵀ x L for X in K, M, C, D.

    Attributes
    ----------
    L : ndarray (m, r) or None
        The basis at the few DOFs that an effect touches: the term is then of low rank. None stands for the
        identity: the matrices are on the reduced coordinates themselves.
    K, M, C, D : ndarray (m, m) or None
        K is the stiffness at ω = 0.
    laws : tuple of (callable, ndarray (m, m))
        Frequency-dependent elements: a factor as a function of ω, and the matrix that it multiplies. Their
        sum is added to the static stiffness.
    dofs : ndarray (m,) or None
        Global DOF numbers of the rows of L.
    connection : bool
        Whether K is damped as connections are, not as members.
    stiffer : float
        Ratio of the stiffness of the member there to its nominal one [-].
    """

    L: Floats | None
    K: NDArray[Any] | None
    M: NDArray[Any] | None
    C: NDArray[Any] | None
    D: NDArray[Any] | None
    laws: tuple[tuple[Callable[[Floats], NDArray[Any]], NDArray[Any]], ...] = ()
    dofs: Ints | None = None
    connection: bool = False
    stiffer: float = 1.0

    @property
    def place(self) -> tuple[bytes, float]:
        """A key that terms in factored form at the same DOFs have in common."""
        return (b"" if self.L is None else self.L.tobytes()), self.stiffer

    def times(self, factor: float) -> "ReducedTerm":
        """Return all matrices multiplied by a factor."""
        K, M, C, D = (None if X is None else factor * X for X in (self.K, self.M, self.C, self.D))
        return replace(self, K=K, M=M, C=C, D=D, laws=tuple((f, factor * X) for f, X in self.laws))

    def scaled(self, factors: Mapping[str, float]) -> "ReducedTerm":
        """Return K, M, C and D each multiplied by a factor, laws as they are."""
        parts = {key: None if (X := getattr(self, key)) is None else f * X for key, f in factors.items()}
        return replace(self, **parts)

    def plus(self, other: "ReducedTerm", factor: float) -> "ReducedTerm":
        """Return the sum with a multiple of a term on the same coordinates, both without laws."""

        def total(key: str) -> NDArray[Any] | None:
            X, Y = getattr(self, key), getattr(other, key)
            return X if Y is None else factor * Y if X is None else X + factor * Y

        return replace(self, **{key: total(key) for key in "KMCD"})

    def damps(self, connections: bool) -> bool:
        """Whether it adds local damping, or to connections where these are damped otherwise than members."""
        damped = self.C is not None or self.D is not None or bool(self.laws)
        return damped or (connections and self.connection)

    def dense(self, key: str) -> Any:
        """Return one of K, M, C and D on the reduced coordinates, 0 if there is none."""
        X = getattr(self, key)
        return 0.0 if X is None else self.spread(X)

    def spread(self, X: NDArray[Any]) -> NDArray[Any]:
        """Return a matrix of the term on the reduced coordinates."""
        return X if self.L is None else self.L.T @ X @ self.L

    def parts(
        self, factors: dict[str, NDArray[Any]], omega: NDArray[Any]
    ) -> list[tuple[NDArray[Any], NDArray[Any]]]:
        """Return all that is not zero as pairs of a factor at each line and a matrix."""
        stiffness = factors["connections" if self.connection else "K"]
        known = ((stiffness, self.K), *((factors[key], getattr(self, key)) for key in "MCD"))
        present = [(factor, X) for factor, X in known if X is not None and X.any()]
        return present + [(f(np.real(omega)), X) for f, X in self.laws if X.any()]


def combined(terms: Sequence[ReducedTerm], factors: Floats) -> ReducedTerm:
    """Return the sum of terms on the same coordinates, each multiplied by a factor."""
    first, *others = terms
    out = first.times(float(factors[0]))
    for term, factor in zip(others, factors[1:], strict=True):
        out = out.plus(term, float(factor))
    return out


def real_or_slope(X: NDArray[Any] | None, imaginary: bool) -> NDArray[Any] | None:
    """Return the value of a matrix that carries a complex step, or its derivative if ``imaginary``."""
    if X is None:
        return None
    return np.imag(X) / STEP if imaginary else np.real(X)


def static_part(c: Contribution, imaginary: bool) -> Contribution:
    """Return a contribution's static stiffness, M, C and D, or their derivatives by a complex step."""
    return Contribution(c.dofs, *(real_or_slope(X, imaginary) for X in (c.static, c.M, c.C, c.D)))


def acting(c: Contribution) -> Contribution:
    """Return a contribution without the elements whose matrices do not change with a complex step."""
    matrices = [X for X in (c.K, c.M, c.C, c.D) if X is not None]
    if c.law is not None or not matrices:
        return c
    acts = np.any([np.imag(X).any(axis=(1, 2)) for X in matrices], axis=0)
    if acts.all() or not acts.any():
        return c
    return Contribution(c.dofs[acts], *(None if X is None else X[acts] for X in (c.K, c.M, c.C, c.D)))


def law_parts(
    c: Contribution, imaginary: bool
) -> list[tuple[Callable[[Floats], NDArray[Any]], NDArray[Any]]]:
    """Return the terms that a law adds to the static stiffness, or their derivatives by the product rule."""
    law, K = c.law, c.K
    assert law is not None
    assert K is not None

    def change(omega: Floats, step: bool) -> NDArray[Any]:
        storage, loss = law(omega)
        storage = storage - law(np.zeros(1))[0][0]
        real, imag = real_or_slope(storage, step), real_or_slope(loss, step)
        return real + 1j * imag  # type: ignore[operator]

    out = [(partial(change, step=imaginary), np.real(K))]
    if imaginary and np.iscomplexobj(K):
        out.append((partial(change, step=False), np.imag(K) / STEP))
    return out


def motions_of(matrices: list[Floats]) -> tuple[Floats, Floats, Floats]:
    """Return S (m, k) and S⁺ (k, m) for symmetric matrices: a basis of all their ranges, and its inverse.

    Rows are scaled by the diagonals, so that soft directions count as much as stiff ones, and rotations as
    displacements; the scales (m,) are the third result.
    """
    diagonals = [np.abs(X.diagonal()) for X in matrices]
    diagonal = sum((d / d.max() for d in diagonals if d.any()), np.zeros(len(matrices[0])))
    # Smaller diagonals are rounding: dividing by them would raise rows of rounding to the size of the others.
    scale = np.sqrt(np.where(diagonal > 1e-26, diagonal, 1.0))
    scaled = [X / np.outer(scale, scale) for X in matrices]
    U, s, _ = np.linalg.svd(np.hstack([X / np.abs(X).max() for X in scaled]), full_matrices=False)
    U = U[:, s > 1e-12 * s[0]]
    U = np.where(np.abs(U) > 1e-13, U, 0.0)
    return scale[:, None] * U, U.T / scale, scale
