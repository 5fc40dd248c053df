"""What the fits and the search ask of any kind of data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.model import Effect
from fem.reduction.reduced_model import ReducedModel
from fem.reduction.terms import ReducedTerm
from updating.inference.damped import DampedFrfs
from updating.inference.defaults import BASIS_LINES, FULL_LINES
from updating.inference.fit_function import FitFunction
from updating.inference.fit_inputs import D, FitInputs
from updating.inference.fit_result import FitResult
from updating.inference.form_scatter import FormScatter
from updating.inference.mode_targets import ComputedModes, ModeTargets
from updating.measurement.measurement import Measurement

# What effects added to a fitted model do to its residuals: all that differs between kinds of data -----------


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


# ------------------------------------------------------------------------------------------------------------


class Problem(FitInputs[D]):
    """A fit to one kind of data."""

    __slots__ = ()

    # what each kind of data has -----------------------------------------------------------------------------

    @property
    @abstractmethod
    def measured_words(self) -> str:
        """The kind of data, in the singular."""

    @property
    @abstractmethod
    def stages(self) -> Floats:
        """Stages of a fit from far away, (n,); the last is the whole of the data."""

    @abstractmethod
    def lines_up_to(self, frequency: float, n_lines: int) -> Ints:
        """Return at most ``n_lines`` lines up to a frequency [Hz], or all modes; none is held out."""

    @abstractmethod
    def function(
        self, effects: Sequence[Effect], starts: Sequence[dict[str, float]], lines: Ints
    ) -> FitFunction[Any]:
        """Return the residuals at some lines, or of some modes, as a function of all that varies.

        Parameters
        ----------
        effects : sequence of Effect
            Candidates to add to the model.
        starts : sequence of dict
            For each of them the parameter values to start from.
        lines : ndarray of int
        """

    @abstractmethod
    def residuals(
        self,
        effects: Sequence[Effect] = (),
        starts: Sequence[dict[str, float]] = (),
        stage: float | None = None,
        n_lines: int | None = None,
    ) -> FitFunction[Any]:
        """Return all residuals of a stage of a fit as a function of all that varies.

        Parameters
        ----------
        effects, starts
            As of :meth:`function`.
        stage : float, optional
            One of ``stages``; the whole of the data unless given.
        n_lines : int, optional
            Largest number of lines; that of the problem unless given.
        """

    @abstractmethod
    def changes_at(self, base: FitResult, n_full: int | None, n_low: int, most: int) -> ResidualChanges:
        """Return what effects added to a fitted model do to its residuals.

        Parameters
        ----------
        base : FitResult
        n_full, n_low : int
            At most this many lines of the full band and of the low one; None for as many as the responses of
            all DOFs are kept at. Of modes all are used.
        most : int
            Largest number of values in each of the two bands.
        """

    @abstractmethod
    def better_basis(
        self, result: FitResult, n_lines: int = BASIS_LINES[0]
    ) -> tuple[float, ReducedModel] | None:
        """Return the error of the reduced basis at a fitted model, and a better basis.

        None where the error is small against the level that the data leave.
        """

    def with_good_basis(
        self, result: FitResult, tell: Callable[[int, float], None] = lambda n_lines, error: None
    ) -> Self:
        """Return the problem on a basis that is good enough for a fitted model; itself where its own is.

        ``tell`` is called with the number of lines whose responses are added, and the error without them.
        """
        out = self
        for n_lines in BASIS_LINES:
            better = out.better_basis(result, n_lines)
            if better is None:
                break
            tell(n_lines, better[0])
            out = replace(out, reduced=better[1])
        return out

    @abstractmethod
    def error_words(self, result: FitResult) -> str:
        """Return the error of a fit in words, in the unit of the report."""

    def allowed_squares(self) -> Floats:
        """Return the mean squares that a right model may leave beyond noise, of each group, (n_groups,)."""
        return self.residuals(n_lines=FULL_LINES).allowed_squares()

    @abstractmethod
    def resampled(self, result: FitResult, misfit: Mapping[str, float], rng: np.random.Generator) -> Self:
        """Return the problem with data that a fitted model would have been measured to have.

        Parameters
        ----------
        result : FitResult
        misfit : mapping of str to float
            Mean square residuals in units of the stated noise, of ``"modes"`` and ``"frf"``: above 1 they
            scale the noise that is drawn [-].
        rng : numpy.random.Generator
        """

    # what only some data have -------------------------------------------------------------------------------

    @property
    def has_broad_resonances(self) -> bool:
        """Whether the data are so damped that uncertain parameters are not bent far from nominal."""
        return False

    @property
    def measured_modes(self) -> ModeTargets | None:
        """Measured modes that are fitted, alone or beside other data."""
        return None

    def computed_modes(self, result: FitResult) -> ComputedModes | None:
        """Return the partners of the measured modes in a fitted model."""
        return None

    def small_deviations(
        self, result: FitResult, size: float | None = None, share: float = 1.0
    ) -> FormScatter | None:
        """Return the small deviations that the form has besides its parameters, at a fitted model.

        Parameters
        ----------
        result : FitResult
        size : float, optional
            Standard deviation of the shifts of eigenvalues; the middle of what it may be unless given [-].
        share : float
            Part of the deviations that the data still have [-].
        """
        return None

    def damped_frfs(self) -> DampedFrfs[Any] | None:
        """Return the data at complex frequencies, where fits converge from far away."""
        return None

    def with_other_damping(self) -> Self | None:
        """Return the problem with the other form of damping between resonances."""
        return None

    def with_seen_noise(self, result: FitResult) -> Self:
        """Return the problem with no more noise than the residuals of a fit show."""
        return self

    def test_of(self, result: FitResult) -> Measurement | None:
        """Return the test with the form of damping and the errors of channels that a fit has found."""
        return None

    def strain(self, result: FitResult) -> float:
        """Return the largest distance of uncertain parameters from nominal, in prior deviations [-].

        A fit bends uncertain parameters to stand in for what the model lacks.
        """
        return 0.0

    def strain_of_one(self, result: FitResult) -> float:
        """Return the deviation of one value alone that is as improbable as the largest of all [-]."""
        return self.strain(result)

    def far_start(self, result: FitResult) -> FitResult | None:
        """Return where fits of further effects begin if a fit is far from the data; None for where it is."""
        return None

    def at_places_of(self, result: FitResult) -> Self | None:
        """Return the problem on a basis for the places of a fit's effects; None if its own is as good."""
        return None
