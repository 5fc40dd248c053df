"""Weighted residuals of a fit as a function of its unknowns, and their minimum."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect, ParameterRef
from fem.reduction.deviations import Deviations
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.set_ups import SetUpsFRF
from updating.correlation import DB_PER_NEPER, log_ratio
from updating.inference.belief import DISCREPANCY_MAX
from updating.inference.effect_priors import EffectPrior, prior_of
from updating.inference.fit_data import noise_squares
from updating.inference.fit_result import FitResult
from updating.inference.heartbeat import beat
from updating.inference.marginal import Quadratic
from updating.inference.solve import TOLERANCE, Prior, Report, Residual, Solution, solve_robust
from updating.inference.unknowns import ScaledUnknown, by_unknowns, values_at
from updating.least_squares.costs import Costs
from updating.least_squares.loss import pseudo_huber
from updating.measurement.channel_errors import N_ERRORS

if TYPE_CHECKING:
    from updating.inference.fit import FitProblem
    from updating.inference.scatter import FormScatter


ROBUST = 0.5
"""Residual at which the loss turns from quadratic to linear [nepers]."""


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


@dataclass(eq=False)
class FitFunction:
    """Residuals of a fit at some lines, as a function of all that varies.

    x holds the variables (nuisance parameters, then those of the effects), the logarithms of the damping
    curve's unknowns, and the scatter, in standard deviations.

    Attributes
    ----------
    problem : FitProblem
    effects : tuple of Effect
    variables : tuple of ScaledUnknown
    start : ndarray (n,)
    lines : ndarray of int
    scatter : FormScatter, optional
        Small deviations.
    """

    problem: FitProblem
    effects: tuple[Effect, ...]
    variables: tuple[ScaledUnknown, ...]
    start: NDArray[np.float64]
    lines: NDArray[np.int64]
    scatter: FormScatter | None = None
    # The end of a fit is asked for again.
    _end: tuple[bytes, NDArray[np.complex128], NDArray[np.complex128]] | None = field(
        default=None, init=False, repr=False
    )

    def with_scatter(self, scatter: FormScatter | None) -> FitFunction:
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
    def keep(self) -> NDArray[np.bool_]:
        """Which values count, (n_lines, n_out, n_in)."""
        return self.problem.data.mask[self.lines]

    @property
    def refs(self) -> list[ParameterRef]:
        """Parameters that the variables move, in their order."""
        return [ref for v in self.variables for ref in v.refs]

    # The engine is made at the first evaluation: many functions are made for their bounds and priors alone.

    @cached_property
    def _engine(self) -> ParametricFRF | SetUpsFRF:
        frequency, refs = self.problem.data.frequency[self.lines], self.refs
        none = np.zeros((self.problem.reduced.model.n_dof, 0))
        deviations = Deviations(none, none) if self.scatter is None else self.scatter.deviations
        if self.scatter is not None and self.scatter.channels is not None:
            n_out = len(self.problem.data.measurement.sensors)
            outputs, inputs = self.scatter.channels.changes(self.problem.misread, n_out)
            deviations = replace(deviations, outputs=outputs, inputs=inputs)
        engine = self.problem.engine(frequency, refs, self.effects, deviations=deviations)
        return self.problem.in_set_ups(engine)

    @cached_property
    def _damping(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Hat functions and offset of the damping curve at the lines."""
        curve, frequency = self.problem.damping, self.problem.data.frequency[self.lines]
        return curve.hats(frequency), curve.offset(frequency)

    @cached_property
    def _measured(self) -> NDArray[np.complex128]:
        """Measured receptances at the lines, 1 where they do not count, so that their logarithm exists."""
        measured = self.problem.data.H[self.lines]
        return np.where(self.keep & (measured != 0), measured, 1.0)

    def __call__(
        self, x: NDArray[np.float64], gradient: bool
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128] | None]:
        """Return the weighted ln(computed / measured), (m,), and its Jacobian, (n, m), if asked."""
        at = x.tobytes()
        if self._end is not None and self._end[0] == at:
            return self._end[1:]
        r, J = self._evaluated(x, gradient)
        if J is not None:
            self._end = at, r, J
        return r, J

    def _evaluated(
        self, x: NDArray[np.float64], gradient: bool
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128] | None]:
        beat()
        keep, weight = self.keep, self.problem.data.weight[self.lines]
        (parameters, damping, scatter), (hats, offset) = self._parts, self._damping
        values = values_at(self.variables, x[parameters])
        zeta, std = np.exp(hats @ x[damping] + offset), self._scatter_std
        H, dH, dH_dzeta = self._engine.evaluate(np.append(values, std * x[scatter]), zeta, gradient)
        r = np.nan_to_num(weight * log_ratio(H, self._measured), nan=0.0)[keep]
        r = self.problem.data.seen(r)
        if not gradient or dH is None or dH_dzeta is None:
            return r, None
        per = np.where(H != 0, weight / np.where(H != 0, H, 1.0), 0.0)[keep]
        n = len(values)
        J = np.empty((len(x), r.size), dtype=complex)
        J[parameters] = by_unknowns(self.variables, x[parameters], dH[:n][:, keep])
        J[damping] = by_damping(zeta, hats, dH_dzeta)[:, keep]
        J[scatter] = dH[n:][:, keep] * std[:, None]
        J *= per
        return r, self.problem.data.seen(J)

    def receptance(self, x: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the receptances at the lines as the sensors read them, (n_lines, n_out, n_in)."""
        (parameters, damping, scatter), (hats, offset) = self._parts, self._damping
        at = np.append(values_at(self.variables, x[parameters]), self._scatter_std * x[scatter])
        H, _, _ = self._engine.evaluate(at, np.exp(hats @ x[damping] + offset), gradient=False)
        return H

    def anchor(self, x: NDArray[np.float64]) -> None:
        """Prepare :meth:`receptance` for many x that differ from this one in few variables."""
        own, _, scatter = self._parts
        self._engine.anchor(np.append(values_at(self.variables, x[own]), self._scatter_std * x[scatter]))

    @property
    def _scatter_std(self) -> NDArray[np.float64]:
        return np.zeros(0) if self.scatter is None else self.scatter.std

    @property
    def units(self) -> NDArray[np.float64]:
        """Size of one unit of each x: 1 where it is a logarithm, or in that of the parameter."""
        others = len(self.start) - len(self.variables)
        return np.array([*(v.size for v in self.variables), *np.ones(others)])

    @property
    def relative(self) -> NDArray[np.bool_]:
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

    def prior_at(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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

    def moved_to(self, result: FitResult) -> NDArray[np.float64]:
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

    def point_of(self, result: FitResult) -> NDArray[np.float64]:
        """Return x of a result that has the same unknowns, whatever it was started from; no scatter."""
        parameters = [v.to_x(result.values[v.ref]) for v in self.variables]
        return np.concatenate([parameters, np.log(result.zeta), self.start[self._parts[2]]])

    def limits(self) -> NDArray[np.float64]:
        """Return the bounds of x, shape (n, 2)."""
        bounds = np.array([v.bounds() for v in self.variables]).reshape(-1, 2)
        n = len(self._scatter_std)
        return np.vstack([bounds, self.problem.damping.limits, np.tile([-np.inf, np.inf], (n, 1))])

    @property
    def groups(self) -> NDArray[np.int64]:
        """Band of each residual, each with its own level of error, (m,)."""
        return np.broadcast_to(self.problem.band_of(self.lines)[:, None, None], self.keep.shape)[self.keep]

    def mean_by_group(self, each: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the means of something over the residuals of each group, (n_groups,)."""
        member = np.unique(self.groups, return_inverse=True)[1]
        return np.bincount(member, each) / np.bincount(member)

    def misfit(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the robust mean squares of the residuals of each group, (n_groups,)."""
        return self.mean_by_group(pseudo_huber(self(x, False)[0], ROBUST))

    def quadratic(self, x: NDArray[np.float64], levels: Costs) -> Quadratic:
        """Return the mean squares of all groups near x as quadratic functions of the unknowns' changes."""
        r, J = self(x, True)
        assert J is not None
        n_apart = 0 if self.scatter is None else self.scatter.n_channels
        return Quadratic.of(r, J, np.unique(self.groups, return_inverse=True)[1], ROBUST, levels, n_apart)

    def noise(self) -> NDArray[np.float64]:
        """Return the mean squares of the residuals of each group that are put down to noise, (n_groups,)."""
        return self.mean_by_group(noise_squares(self.problem.data, self.lines))

    def allowed_squares(self) -> NDArray[np.float64]:
        """Return the mean squares that a right model may leave beyond noise, of each group."""
        problem = self.problem
        square = (DISCREPANCY_MAX * problem.model_error) ** 2 + problem.mesh_level**2
        return np.full(len(np.unique(self.groups)), square)

    def errors(self, x: NDArray[np.float64]) -> Errors:
        """Return how far computed FRFs are from the measured ones."""
        # A model has no such deviations, but channels have.
        n = len(x) - (0 if self.scatter is None else self.scatter.n_channels)
        rows = np.arange(len(x))
        x = np.where((rows < self._parts[2].start) | (rows >= n), x, 0.0)
        r, weight = self(x, False)[0], self.problem.data.weight[self.lines][self.keep]
        known = weight > 0
        return Errors(frf_db=float(np.sqrt(((r.real[known] / weight[known]) ** 2).mean()) * DB_PER_NEPER))

    def levels(self, stage: float = np.inf, counted_as: int = 0) -> Costs:
        """Return how probable error levels are: noise, and in addition the error of beams and of the mesh.

        Parameters
        ----------
        stage : float
            The lines reach up to this frequency [Hz].
        counted_as : int
            Number of lines of the full band that they represent, at most all; their own number unless given.
        """
        problem = self.problem
        sizes = np.unique(self.groups, return_counts=True)[1].astype(float)
        if counted_as:
            sizes *= len(problem.lines_up_to(stage, counted_as)) / len(self.lines)
        return problem.likelihood(problem.n_independent(stage) * sizes / sizes.sum(), sizes, self.noise())

    def minimise(
        self,
        x: NDArray[np.float64],
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
        n, channels, apart = len(x), np.zeros((0, N_ERRORS)), np.zeros((0, N_ERRORS))
        if self.scatter is not None and self.scatter.channels is not None:
            known, n = self.scatter.channels, n - self.scatter.n_channels
            n_ends = self.problem.misread.shape[1]
            channels = known.errors(x[n:], n_ends)
            apart = known.deviations(solution.covariance[n:, n:], n_ends)
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
            scatter=(x[scatter] * self._scatter_std)[: n - scatter.start],
            channels=channels,
            channels_std=apart,
        )


def propagated(
    residual: Residual,
    x: NDArray[np.float64],
    units: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return √(gᵀ C g), (m,), of the real parts of residuals, with g their derivatives by x in its units."""
    _, J = residual(x, True)
    assert J is not None
    J = J / units[:, None]
    variance = np.einsum("im,ij,jm->m", J.real, covariance, J.real, optimize=True)
    return np.sqrt(np.maximum(variance, 0.0))


def by_damping(
    zeta: NDArray[np.float64], hats: NDArray[np.float64], by_zeta: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Return derivatives by the logarithms of a damping curve's unknowns from those by ζ at each line.

    Parameters
    ----------
    zeta : ndarray (n_freq,) or (2, n_freq)
        As of :meth:`updating.inference.parameters.DampingCurve.ratio` [-].
    hats : ndarray (n_freq, n_unknowns) or (2, n_freq, n_unknowns)
    by_zeta : ndarray (n_freq, n_out, n_in) or (2, n_freq, n_out, n_in)

    Returns
    -------
    ndarray (n_unknowns, n_freq, n_out, n_in)
    """
    weight = np.moveaxis(zeta[..., None] * hats, -1, 0)[..., None, None]
    return weight * by_zeta if zeta.ndim == 1 else weight[:, 0] * by_zeta[0] + weight[:, 1] * by_zeta[1]
