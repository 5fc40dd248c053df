"""Errors of parameters that were fitted to one state of a structure, as unknowns of fits to another state."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from fem.array_types import Bools, Floats, Ints
from fem.model import ParameterRef
from fem.reduction.deviations import Deviations
from updating.inference.form_scatter import FormScatter
from updating.inference.unknowns import ScaledUnknown


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CalibratedErrors(FormScatter):
    """Parameters as another state has left them: ln θ = ln θ₀ + L ξ, or θ = θ₀ + L ξ, with ξ ~ N(0, 1).

    L Lᵀ is the covariance of that state's fit. So both states have one and the same unknowns, and the first
    state's posterior is the second one's prior.

    Attributes
    ----------
    refs : tuple of ParameterRef
    values : ndarray (n,)
        θ₀.
    log : ndarray of bool (n,)
        Which vary by their logarithm.
    loads : ndarray (n, k)
        L [-, or unit of θ].
    bounds : ndarray (n, 2)
        Of θ; beyond them it stays at them.
    """

    refs: tuple[ParameterRef, ...]
    values: Floats
    log: Bools
    loads: Floats
    bounds: Floats

    @classmethod
    def of(cls, variables: Sequence[ScaledUnknown], values: Floats, covariance: Floats) -> Self:
        """Make them of unknowns, values of all parameters that these move, and their covariance (n, n).

        That of ln θ for unknowns on a logarithmic scale, and of θ for others.
        """
        size = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        by = np.where(size > 0, size, 1.0)
        share, Q = np.linalg.eigh(covariance / np.outer(by, by))
        L = size[:, None] * Q * np.sqrt(np.maximum(share, 0.0))
        row = np.repeat(np.arange(len(variables)), [len(v.refs) for v in variables])
        log = np.array([v.log for v in variables], dtype=bool)
        none = np.zeros((0, 0))
        return cls(
            deviations=Deviations(none, none),
            eigenvalue=0.0,
            losses=np.ones(L.shape[1]),
            refs=tuple(ref for v in variables for ref in v.refs),
            values=values,
            log=log[row],
            loads=L[row],
            bounds=np.array([[v.to_value(b) for b in v.bounds()] for v in variables]).reshape(-1, 2)[row],
        )

    def some(self, rows: Ints) -> Self:
        """Return the errors of some of the parameters."""
        parts = {key: getattr(self, key)[rows] for key in ("values", "log", "loads", "bounds")}
        return replace(self, refs=tuple(self.refs[k] for k in rows), **parts)

    def without(self, refs: Collection[ParameterRef]) -> Self:
        """Return the errors of all but some parameters."""
        return self.some(np.flatnonzero([ref not in refs for ref in self.refs])) if refs else self

    def at(self, xi: Floats) -> Floats:
        """Return the parameters' values, (n,)."""
        error = self.loads @ xi
        moved = np.where(self.log, self.values * np.exp(np.where(self.log, error, 0.0)), self.values + error)
        return np.clip(moved, *self.bounds.T)

    def slopes(self, xi: Floats) -> Floats:
        """Return their derivatives by ξ, (n, k)."""
        return np.where(self.log, self.at(xi), 1.0)[:, None] * self.loads

    def moved(self, values: Floats) -> Floats:
        """Return the errors of ln θ or θ at values, (n,)."""
        ratio = np.divide(values, self.values, out=np.ones(len(values)), where=self.log)
        return np.where(self.log, np.log(ratio), values - self.values)
