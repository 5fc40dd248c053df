"""What effects added to a fitted model do to its residuals: all that differs between kinds of data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.model import Effect
from fem.reduction.terms import ReducedTerm
from updating.inference.fit_result import FitResult


@dataclass(eq=False)
class ResidualChanges(ABC):
    """The residuals of a fitted model, m in all, and their changes by effects.

    Attributes
    ----------
    base : FitResult
    function : FitFunction
        The residuals, as a function of what varies in the fit.
    x : ndarray (n,)
        Unknowns of the fit.
    some : ndarray of int
        Residuals of ``function`` that are used.
    full_band : ndarray of bool (m,)
        Which are those, in their order; the others are of a low band.
    """

    base: FitResult
    function: Any
    x: Floats
    some: Ints
    full_band: Bools

    @cached_property
    @abstractmethod
    def now(self) -> Complexes:
        """The weighted residuals of the fit, (m,)."""

    @cached_property
    @abstractmethod
    def resolution(self) -> Floats:
        """Changes of the residuals below these are not seen, (m,)."""

    @abstractmethod
    def by_terms(self, released: Sequence[tuple[str, str]], terms: Sequence[ReducedTerm]) -> Complexes:
        """Return the changes by terms added to the matrices, (n, m); NaN where there is no structure.

        Parameters
        ----------
        released : sequence of (str, str)
            Constraints of the model that do not hold with the terms.
        terms : sequence of ReducedTerm
        """

    @abstractmethod
    def heavily_damped(self) -> ResidualChanges:
        """Return some residuals of the model in which resonances do not stand out."""

    @abstractmethod
    def has_slope(self, effect: Effect) -> bool:
        """Whether :meth:`slopes` are those of an effect: of some its matrices alone do not tell."""

    @property
    @abstractmethod
    def has_cheap_slopes(self) -> bool:
        """Whether slopes of one effect cost less than its changes on a grid."""

    @abstractmethod
    def slopes(self) -> Callable[[Sequence[Effect]], Complexes]:
        """Return a function that gives the changes by small effects to the first order, (n, m)."""
