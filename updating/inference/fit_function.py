"""Weighted residuals of a fit as a function of its unknowns, and their minimum, of any kind of data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Generic, Self, TypeVar

import numpy as np

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.model import Effect, ParameterRef
from updating.inference.fit_inputs import FitInputs
from updating.inference.fit_result import FitResult
from updating.inference.form_scatter import FormScatter
from updating.inference.marginal import Quadratic
from updating.inference.solve import TOLERANCE, Prior, Report, Residual, Solution, solve_robust
from updating.inference.unknowns import EffectPrior, ScaledUnknown, prior_of, values_at
from updating.least_squares.costs import Costs, DenseJacobian, Jacobian, pseudo_huber

ROBUST = 0.5
"""Residual at which the loss turns from quadratic to linear [nepers]."""
P = TypeVar("P", bound=FitInputs[Any], covariant=True)


@dataclass(frozen=True, slots=True)
class Errors:
    """How far a computed model is from what was measured; NaN for what was not.

    Attributes
    ----------
    frequency : float
        Root mean square of the relative errors of natural frequencies [-].
    mac : float
        Mean of the paired modes' [-].
    frf_db : float
        Root mean square of the FRFs' error in amplitude [dB].
    lost : tuple of int
        Measured modes without a partner.
    """

    frequency: float = np.nan
    mac: float = np.nan
    frf_db: float = np.nan
    lost: tuple[int, ...] = ()

    @property
    def is_empty(self) -> bool:
        """Whether nothing that was measured has a counterpart in the model."""
        return bool(np.isnan([self.frequency, self.frf_db]).all())


@dataclass(eq=False)
class FitFunction(ABC, Generic[P]):
    """Residuals of a fit at some lines, as a function of all that varies.

    x holds the variables (nuisance parameters, then those of the effects), the logarithms of the damping
    curve's unknowns, and the scatter, in standard deviations.

    Attributes
    ----------
    problem : FitInputs
    effects : tuple of Effect
    variables : tuple of ScaledUnknown
    start : ndarray (n,)
    lines : ndarray of int
        Of FRFs, or modes.
    scatter : FormScatter, optional
        Small deviations.
    """

    problem: P
    effects: tuple[Effect, ...]
    variables: tuple[ScaledUnknown, ...]
    start: Floats
    lines: Ints
    scatter: FormScatter | None = None

    @abstractmethod
    def __call__(self, x: Floats, gradient: bool) -> tuple[Complexes, Complexes | None]:
        """Return the weighted residuals, (m,), and their Jacobian, (n, m), if asked."""

    def linearised(self, x: Floats) -> tuple[Complexes, Jacobian]:
        """Return the weighted residuals, (m,), and their Jacobian."""
        r, J = self(x, True)
        assert J is not None
        return r, DenseJacobian(J)

    @property
    @abstractmethod
    def groups(self) -> Ints:
        """Group of each residual, (m,); each has its own level of error."""

    @property
    @abstractmethod
    def of_modes(self) -> Bools:
        """Which groups are those of modes, (n_groups,)."""

    @abstractmethod
    def noise(self) -> Floats:
        """Return the mean squares of the residuals of each group that are put down to noise, (n_groups,)."""

    @abstractmethod
    def allowed_squares(self, *, usual: bool = False) -> Floats:
        """Return the mean squares that a right model may leave beyond noise, or usually does, by group."""

    @abstractmethod
    def errors(self, x: Floats) -> Errors:
        """Return how far the computed model is from what was measured."""

    @abstractmethod
    def levels(self, stage: float = np.inf, counted_as: int = 0) -> Costs:
        """Return how probable error levels are of the groups.

        Parameters
        ----------
        stage : float
            The lines reach up to this frequency [Hz].
        counted_as : int
            Number of lines of the full band that they represent, at most all; their own number unless given.
        """

    @abstractmethod
    def words_of(self, stage: float) -> str:
        """Return the name of a stage of the fit."""

    def changes_of_modes(self, x: Floats, steps: Floats) -> Floats:
        """Return the largest change of each mode by steps of single unknowns (n,), if modes alone are fitted.

        In standard deviations, (n_modes,); without entries for other data [-].
        """
        return np.zeros(0)

    def with_scatter(self, scatter: FormScatter | None) -> Self:
        """Return the function with small deviations among its unknowns."""
        if scatter is None:
            return self
        start = np.append(self.start, np.zeros(len(scatter.std)))
        return replace(self, start=start, scatter=scatter)

    @property
    def _parts(self) -> tuple[slice, slice, slice]:
        """Where variables, damping and scatter are in x."""
        n, m = len(self.variables), len(self.variables) + len(self.problem.damping.start)
        return slice(n), slice(n, m), slice(m, None)

    @property
    def refs(self) -> list[ParameterRef]:
        """Parameters that the variables move, in their order."""
        return [ref for v in self.variables for ref in v.refs]

    @property
    def _scatter_std(self) -> Floats:
        return np.zeros(0) if self.scatter is None else self.scatter.std

    @property
    def units(self) -> Floats:
        """Size of one unit of each x: 1 where it is a logarithm, or in that of the parameter."""
        others = len(self.start) - len(self.variables)
        return np.array([*(v.size for v in self.variables), *np.ones(others)])

    @property
    def relative(self) -> Bools:
        """Which x is in parts of a scale, (n,), rather than a logarithm."""
        others = len(self.start) - len(self.variables)
        return np.array([*(not v.log for v in self.variables), *[False] * others])

    def prior(self) -> Prior:
        """Return what is known beforehand of x."""
        damping = self.problem.damping
        start = np.log(damping.start)
        scatter = np.zeros(len(self._scatter_std))
        means = [[v.mean for v in self.variables], start, scatter]
        stds = [[v.std for v in self.variables], np.full(len(start), damping.std), scatter + 1.0]
        mean, std = np.concatenate(means), np.concatenate(stds)
        for k, effect_prior in self._of_effects.items():
            mean[k], std[k] = effect_prior.mean, effect_prior.std
        return Prior(mean, std)

    def prior_at(self, x: Floats) -> tuple[Floats, Floats]:
        """Return how far x is from the prior's mean, and the deviations of a normal prior there, (n,) each.

        Of a size that may be of any order of magnitude it has the density that the prior has at x.
        """
        prior, n = self.prior(), min(len(x), len(self.start))
        off, std = x[:n] - prior.mean[:n], prior.std[:n].copy()
        for k, effect_prior in self._of_effects.items():
            if effect_prior.range:
                off[k], std[k] = 0.0, effect_prior.width_at(float(x[k]))
        return off, std

    @cached_property
    def _of_effects(self) -> dict[int, EffectPrior]:
        """What is known beforehand of the effects' unknowns, by their rows."""
        by_name = {e.name: e for e in self.effects}
        return {
            k: prior_of(self.problem, by_name[v.ref[0]], v)
            for k, v in enumerate(self.variables)
            if v.ref[0] in by_name
        }

    def moved_to(self, result: FitResult) -> Floats:
        """Return the start with nuisance parameters, damping and as many small deviations of a result."""
        x, (_, damping, scatter) = self.start.copy(), self._parts
        added = {e.name for e in self.effects}
        for k, v in enumerate(self.variables):
            if v.ref[0] not in added and v.ref in result.values:
                x[k] = v.to_x(result.values[v.ref])
        x[damping] = np.log(result.zeta)
        if self.scatter is not None:
            n = len(x) - self.scatter.n_channels
            if len(result.scatter) == n - scatter.start:
                x[scatter.start : n] = result.scatter / self._scatter_std[: n - scatter.start]
            if self.scatter.channels is not None:
                x[n:] = self.scatter.channels.sizes(result.channels)
        return x

    def point_of(self, result: FitResult) -> Floats:
        """Return x of a result that has the same unknowns, whatever it was started from; no scatter."""
        parameters = [v.to_x(result.values[v.ref]) for v in self.variables]
        return np.concatenate([parameters, np.log(result.zeta), self.start[self._parts[2]]])

    def limits(self) -> Floats:
        """Return the bounds of x, shape (n, 2)."""
        bounds = np.array([v.bounds() for v in self.variables]).reshape(-1, 2)
        n = len(self._scatter_std)
        return np.vstack([bounds, self.problem.damping.limits, np.tile([-np.inf, np.inf], (n, 1))])

    def mean_by_group(self, each: Floats) -> Floats:
        """Return the means of something over the residuals of each group, (n_groups,)."""
        member = np.unique(self.groups, return_inverse=True)[1]
        return np.bincount(member, each) / np.bincount(member)

    def misfit(self, x: Floats) -> Floats:
        """Return the robust mean squares of the residuals of each group, (n_groups,)."""
        return self.mean_by_group(pseudo_huber(self(x, False)[0], ROBUST))

    def quadratic(self, x: Floats, levels: Costs) -> Quadratic:
        """Return the mean squares of all groups near x as quadratic functions of the unknowns' changes."""
        r, J = self.linearised(x)
        n_apart = 0 if self.scatter is None else self.scatter.n_channels
        return Quadratic.of(r, J, np.unique(self.groups, return_inverse=True)[1], ROBUST, levels, n_apart)

    def minimise(
        self,
        x: Floats,
        stage: float,
        max_iterations: int,
        *,
        counted_as: int = 0,
        tolerance: float = TOLERANCE,
        report: Report | None = None,
        prior: Prior | None = None,
    ) -> Solution:
        """Find the x of greatest posterior probability from a start.

        Parameters
        ----------
        x : ndarray (n,)
        stage : float
            Upper end of the band [Hz].
        max_iterations : int
        counted_as : int
            As of :meth:`levels`.
        tolerance : float
            The end is where a step gains less than this [nats].
        report : callable, optional
            Called after each step with the unknowns and the cost.
        prior : Prior, optional
            In place of its own.
        """
        limits = self.limits()
        assert len(limits) == len(x)
        return solve_robust(
            self,
            x,
            prior or self.prior(),
            (limits[:, 0], limits[:, 1]),
            levels=self.levels(stage, counted_as),
            groups=self.groups,
            linearised=self.linearised,
            robust=ROBUST,
            max_iterations=max_iterations,
            tolerance=tolerance,
            relative=self.relative,
            report=report,
        )

    def result(self, solution: Solution) -> FitResult:
        """Return a solution as values, with deviations if it has a covariance; errors are not assessed."""
        x, (parameters, damping, scatter) = solution.x, self._parts
        if not solution.covariance.size:
            solution = replace(solution, covariance=np.full((len(x), len(x)), np.nan))
        values = dict(zip(self.refs, values_at(self.variables, x[parameters]).tolist(), strict=True))
        sd = np.sqrt(np.maximum(np.diag(solution.covariance), 0.0))
        known = zip(self.variables, x[parameters], sd[parameters], strict=True)
        std = {ref: s for v, xi, deviation in known for ref, s in v.deviations(xi, deviation).items()}
        fitted = tuple(
            e.with_values(**{p.name: values[e.name, p.name] for p in e.parameters()}) for e in self.effects
        )
        zeta, level, known_x = np.exp(x[damping]), float(np.sqrt(solution.misfit)), slice(damping.stop)
        n_modal = len(x) - (0 if self.scatter is None else self.scatter.n_channels) - scatter.start
        covariance = (solution.covariance * np.outer(self.units, self.units))[known_x, known_x]
        return FitResult(
            solution=solution,
            values=values,
            std=std,
            zeta=zeta,
            effects=fitted,
            fit_db=np.nan,
            held_out_db=np.nan,
            level=level,
            covariance=covariance,
            scatter=(x[scatter] * self._scatter_std)[:n_modal],
        )


def propagated(residual: Residual, x: Floats, units: Floats, covariance: Floats) -> Floats:
    """Return √(gᵀ C g), (m,), of the real parts of residuals, with g their derivatives by x in its units."""
    _, J = residual(x, True)
    assert J is not None
    J = J / units[:, None]
    variance = np.einsum("im,ij,jm->m", J.real, covariance, J.real, optimize=True)
    return np.sqrt(np.maximum(variance, 0.0))
