"""Matrices of an effect on all DOFs as sums of fixed ones, each times a function of one parameter."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Floats
from fem.model import Contribution, Effect, Model
from fem.system import sum_contributions
from fem.tabulated import ChebyshevTable

NEGLIGIBLE = 1e-9
"""Singular values that are left out [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Sums:
    """Matrices of an effect on all DOFs as sums of fixed ones, each times a function of one parameter.

    Attributes
    ----------
    tables : tuple of (str, ChebyshevTable)
        A parameter, and factors of the next matrices as functions of its logarithm. Those of one parameter
        follow each other.
    keys : ndarray of str (n,)
        Which of K, M and D each matrix belongs to.
    full : tuple of sparse arrays (n_dof, n_dof)
    """

    tables: tuple[tuple[str, ChebyshevTable], ...]
    keys: NDArray[np.str_]
    full: tuple[Any, ...]

    @classmethod
    def of(cls, effect: Effect, model: Model) -> "Sums":
        """Tabulate an effect whose matrices are the sum over its parameters, 0 at their nominal values.

        Of the values at the nodes the few singular vectors that are not negligible are the fixed matrices.
        """
        nominal = {p.name: p.absent for p in effect.parameters()}
        tables: list[tuple[str, ChebyshevTable]] = []
        keys: list[str] = []
        full: list[Any] = []
        for p in effect.parameters():

            def parts(s: float, name: str = p.name) -> tuple[Contribution, ...]:
                return model.parts_of(effect.with_values(**nominal | {name: float(np.exp(s))}))

            like = parts(np.log(p.upper))
            for key in "KMD":
                if any(getattr(c, key) is not None for c in like):

                    def flat(s: float, of: Any = parts, key: str = key) -> Floats:
                        return np.concatenate([getattr(c, key).ravel() for c in of(s)])

                    # Nodes of tables over ± ln 5, where the error falls as 4.2^-n
                    table = ChebyshevTable.of(np.log(p.lower), np.log(p.upper), flat, 14, NEGLIGIBLE)
                    tables.append((p.name, table))
                    for row in table.parts:
                        of_row = _contributions(like, key, row)
                        full.append(sum_contributions(of_row, model.n_dof)["KMCD".index(key)])
                        keys.append(key)
        bare = [(name, replace(t, parts=t.parts[:, :0])) for name, t in tables]
        return cls(tuple(bare), np.array(keys), tuple(full))

    def factors(self, values: Mapping[str, float]) -> Floats:
        """Return the factors of the matrices at values of the parameters."""
        at = {name: float(np.log(x)) for name, x in values.items()}
        return np.concatenate([table.factors_at(at[name]) for name, table in self.tables])

    def slopes(self, parameter: str, value: float) -> tuple[Floats, slice]:
        """Return the derivatives of some factors by a parameter, and which; others do not depend on it."""
        s, sizes = float(np.log(value)), [t.factors.shape[1] for _, t in self.tables]
        which = [k for k, (name, _) in enumerate(self.tables) if name == parameter]
        first, last = sum(sizes[: which[0]]), sum(sizes[: which[-1] + 1])
        slopes = np.concatenate([self.tables[k][1].slopes_at(s) for k in which])
        return slopes / value, slice(first, last)


def _contributions(like: tuple[Contribution, ...], key: str, values: Floats) -> tuple[Contribution, ...]:
    """Return contributions to one matrix, of the elements of others, from its entries in their order."""
    shapes = [getattr(c, key).shape for c in like]
    ends = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]
    blocks = (block.reshape(shape) for block, shape in zip(np.split(values, ends), shapes, strict=True))
    bare = (Contribution(c.dofs) for c in like)
    return tuple(replace(c, **{key: X}) for c, X in zip(bare, blocks, strict=True))  # type: ignore[arg-type]
