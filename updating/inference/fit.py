"""Fits of a reduced model to measured FRFs: nuisance parameters, the damping curve and candidate effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from scipy.special import ndtr, ndtri

from fem.analysis.frf import FRF
from fem.array_types import Bools, Complexes, Floats, Ints
from fem.model import Effect, ParameterRef, parameter_values
from fem.reduction.reduced_model import ReducedModel
from updating.correlation import DB_PER_NEPER, log_ratio
from updating.inference.bases import with_responses
from updating.inference.damped import DampedFrfs, continuation_of
from updating.inference.defaults import BASIS_LINES
from updating.inference.fit_data import FitData
from updating.inference.fit_function import ROBUST, FitFunction, propagated
from updating.inference.fit_result import FitResult
from updating.inference.form_scatter import FormScatter
from updating.inference.frf_changes import FrfChanges
from updating.inference.frf_function import FrfFunction
from updating.inference.frf_inputs import FrfInputs
from updating.inference.joint_fit import mode_problem_of, with_modes
from updating.inference.mode_fit import ComputedModes
from updating.inference.mode_targets import ModeTargets
from updating.inference.problem import Problem
from updating.inference.scatter import form_scatter
from updating.least_squares.costs import pseudo_huber
from updating.measurement.measurement import Measurement


@dataclass(frozen=True, slots=True, eq=False, kw_only=True, repr=False)
class FitProblem(FrfInputs, Problem[FitData]):
    """A fit to FRFs of all that may vary and of candidates: its residuals, the fitted FRFs and their errors.

    Attributes
    ----------
    make_function : callable
        Makes the residuals, of the arguments of :class:`updating.inference.frf_function.FrfFunction`.
    """

    make_function: Callable[..., FrfFunction] = FrfFunction

    @property
    def stages(self) -> Floats:
        """Upper ends of the bands [Hz]."""
        return self.bands

    def function(
        self, effects: Sequence[Effect], starts: Sequence[dict[str, float]], lines: Ints
    ) -> FrfFunction:
        """Return the residuals at some lines as a function of all that varies."""
        function = self.make_function(self, tuple(effects), *self.unknowns(effects, starts), lines)
        return function.with_scatter(self.scatter)

    def residuals(
        self,
        effects: Sequence[Effect] = (),
        starts: Sequence[dict[str, float]] = (),
        stage: float | None = None,
        n_lines: int | None = None,
    ) -> FitFunction[Any]:
        """Return the residuals of lines, and of measured modes, up to a frequency [Hz]."""
        top = np.inf if stage is None else stage
        function = self.function(effects, starts, self.lines_up_to(top, n_lines or self.n_lines))
        return with_modes(self, function, top)

    def changes_at(self, base: FitResult, n_full: int | None, n_low: int, most: int) -> FrfChanges:
        """Return what effects added to a fitted model do to its FRFs."""
        return FrfChanges.of(self, base, n_full, n_low, most)

    @property
    def has_broad_resonances(self) -> bool:
        """Whether the FRFs are those at complex frequencies."""
        return self.decay > 0

    def deviation(self, result: FitResult, lines: Ints | None = None) -> Floats | None:
        """Return the standard deviation of the ln|H| that a fit predicts, (n_lines, n_out, n_in) [-].

        √(gᵀ C g) with C the covariance of all that was fitted and g the derivatives of ln|H| (first order;
        Seber & Wild, Nonlinear Regression, 1989, section 5.1). None for a result that was not fitted, such as
        the nominal model, and for one with an effect that depends on amplitude.
        """
        if any(e.amplitude_dependent for e in result.effects):
            return None
        lines = np.arange(len(self.data.frequency)) if lines is None else lines
        every = replace(self.data, mask=np.ones_like(self.data.mask), weight=np.ones_like(self.data.weight))
        starts = [parameter_values(e) for e in result.effects]
        there = replace(self.with_forces_of(result), data=every, scatter=None)
        function = there.function(result.effects, starts, lines)
        x = function.moved_to(result)
        if len(result.covariance) != len(x):
            return None
        return propagated(function, x, function.units, result.covariance).reshape(function.keep.shape)

    def nominal(self) -> FitResult:
        """Return the model as it was given, unfitted, with its errors."""
        bare = FrfInputs.nominal(self)
        return self.assessed(replace(bare, channels=self.data.measurement.channel_errors))

    @property
    def measured_words(self) -> str:
        """The kind of data, in the singular."""
        return "measured FRF" if self.modes is None else "measured mode or measured FRF"

    @property
    def measured_modes(self) -> ModeTargets | None:
        """Measured modes that are fitted beside the FRFs."""
        return self.modes

    def computed_modes(self, result: FitResult) -> ComputedModes | None:
        """Return the partners of the measured modes in a fitted model."""
        mode_problem = mode_problem_of(self)
        return None if mode_problem is None else mode_problem.computed(result)

    def small_deviations(
        self, result: FitResult, size: float | None = None, share: float = 1.0
    ) -> FormScatter | None:
        """Return the small deviations that the form has besides its parameters, at a fitted model."""
        return form_scatter(self, result, size, share)

    def damped_frfs(self) -> DampedFrfs[Self] | None:
        """Return the FRFs at complex frequencies, where fits converge from far away."""
        continuation = continuation_of(self)
        return None if continuation is None else DampedFrfs(self, continuation)

    def with_other_damping(self) -> Self:
        """Return the problem with the other form of damping between resonances."""
        return replace(self, viscous=not self.viscous)

    def better_basis(
        self, result: FitResult, n_lines: int = BASIS_LINES[0]
    ) -> tuple[float, ReducedModel] | None:
        """Return the error of the basis [nepers], and one with responses of a fitted model at some lines."""
        return with_responses(self, result, n_lines)

    def with_seen_noise(self, result: FitResult) -> Self:
        """Return the problem with its noise reduced to what residuals of neighbouring lines differ by.

        A model's residuals are smooth over frequency but near resonances, so that their second differences
        hold the noise, and no less.
        """
        data = self.data
        ratio = data.seen(log_ratio(self.receptance(result), np.where(data.mask, data.H, 1.0)))
        r = data.weight * np.nan_to_num(ratio)
        there = data.mask[:-2] & data.mask[1:-1] & data.mask[2:]
        if not there.any():
            return self
        seen = pseudo_huber((r[:-2] - 2 * r[1:-1] + r[2:])[there] / np.sqrt(6), ROBUST).mean()
        square = (data.weight * data.noise) ** 2
        stated = data.n_parts * ((square[:-2] + 4 * square[1:-1] + square[2:])[there] / 6).mean()
        scale = min(1.0, float(seen / stated))
        return replace(self, data=replace(data, noise=data.noise * np.sqrt(scale)))

    def resampled(self, result: FitResult, misfit: Mapping[str, float], rng: np.random.Generator) -> Self:
        """Return the problem with FRFs of a fitted model with noise and other small deviations."""
        mode_problem = mode_problem_of(self)
        modes = None if mode_problem is None else mode_problem.resampled(result, misfit, rng).data
        data, scale = self.data, np.sqrt(max(misfit.get("frf", 1.0), 1.0))
        function = self.function((), (), np.arange(len(data.frequency)))
        x = function.moved_to(result)
        if self.scatter is not None:
            x[-len(self.scatter.std) :] = rng.standard_normal(len(self.scatter.std))
        H, kept = data.H.copy(), data.mask & (data.weight > 0)
        ratio = function(x, False)[0] / data.weight[data.mask]
        ratio = ratio[data.weight[data.mask] > 0]
        real, imaginary = rng.standard_normal((2, int(kept.sum())))
        noise = scale * data.noise[kept] * (real + 1j * imaginary)
        if not data.phase:  # amplitudes alone: noise of the logarithm
            H[kept] = H[kept] * np.exp(ratio + noise.real)
        else:
            H[kept] = H[kept] * np.exp(ratio) + abs(H[kept]) * noise
        return replace(self, data=replace(data, H=H), modes=modes)

    def test_of(self, result: FitResult) -> Measurement:
        """Return the test with the form of damping and the errors of channels that a fit has found."""
        described = replace(self.data.measurement, viscous=self.viscous)
        return described.with_channel_errors(result.channels)

    def strain(self, result: FitResult) -> float:
        """Return the largest distance of an uncertain parameter or channel from nominal.

        In prior standard deviations [-].
        """
        return float(self._strains(result).max(initial=0.0))

    def strain_of_one(self, result: FitResult) -> float:
        """Return the deviation of one value alone that is as improbable as the largest of all [-]."""
        z = self._strains(result)
        return as_of_one(float(z.max(initial=0.0)), int(np.count_nonzero(z)))

    def _strains(self, result: FitResult) -> Floats:
        std = self.data.measurement.errors.std
        z = result.channels / np.where(std > 0, std, 1.0)
        return np.abs([*self.strains(result).values(), *z.ravel()])

    def far_start(self, result: FitResult) -> FitResult:
        """Return a result with all that is uncertain but damping at its nominal value."""
        return replace(self.at_nominal(result), scatter=np.zeros(0)).as_described()

    def strains(self, result: FitResult) -> dict[ParameterRef, float]:
        """Return how far nuisance parameters lie from their nominal values, in prior standard deviations."""
        known = ((v, v.to_x(result.values[v.ref])) for v in self.nuisance_unknowns if v.ref in result.values)
        return {v.ref: (x - v.mean) / v.std for v, x in known if v.has_prior}

    def error_words(self, result: FitResult) -> str:
        """Return the error of a fit in words, in the unit of the report."""
        return f"error {self.assessed(result).fit_db:.2f} dB"

    def assessed(self, result: FitResult, H: Complexes | None = None) -> FitResult:
        """Return a result with its errors on fitted and on held-out lines.

        ``H`` are its receptances, where they are known, (n_freq, n_out, n_in).
        """
        held_out, lines = self.data.held_out, np.arange(len(self.data.held_out))
        ratio = self._log_ratio(self.receptance(result) if H is None else H, lines)
        return replace(
            result,
            fit_db=_rms(ratio.real[~held_out]),
            held_out_db=_rms(ratio.real[held_out]),
            level=self.level(ratio[~held_out], lines[~held_out]) if np.isnan(result.level) else result.level,
            unseen=self._unseen(ratio[held_out], lines[held_out]),
        )

    def _unseen(self, ratio: Complexes, lines: Ints) -> float:
        """Return the negative log likelihood of lines that no fit has seen, as that of the others is."""
        r = (self.data.weight[lines] * ratio)[self.data.mask[lines]]
        if not r.size:
            return 0.0
        function = self.function((), (), lines)
        return function.levels().cost(function.mean_by_group(pseudo_huber(r, ROBUST)))

    def level(self, ratio: Complexes, lines: Ints | Bools) -> float:
        """Return the robust residual level of log ratios at some lines, amplitude and phase [nepers].

        NaN if none of them counts.
        """
        r = np.abs(self.data.weight[lines] * ratio)
        if np.isnan(r).all():
            return float("nan")
        return float(np.sqrt(np.nanmean(pseudo_huber(r, ROBUST))))

    def log_ratio(self, result: FitResult, lines: Ints | None = None) -> Complexes:
        """Return ln(computed / measured) at some or all lines, NaN where masked."""
        lines = np.arange(len(self.data.frequency)) if lines is None else lines
        return self._log_ratio(self.receptance(result, lines), lines)

    def _log_ratio(self, H: Complexes, lines: Ints) -> Complexes:
        ratio = log_ratio(H, self.data.H[lines])
        return np.where(self.data.mask[lines], self.data.seen(ratio), complex("nan"))

    def frf(self, result: FitResult) -> FRF:
        """Return the fitted model's FRFs in the kind of the measurement."""
        return self.as_measured(self.receptance(result))

    @property
    def measured(self) -> FRF:
        """The measured FRFs as they were compared: in the band, wrong signs set right."""
        return self.as_measured(self.data.H)

    def as_measured(self, H: Complexes) -> FRF:
        """Return receptances as FRFs in the kind of the measurement."""
        m = self.data.measurement.frf
        frf = m.with_receptances(H)
        return frf if self.data.phase else replace(frf, H=np.abs(frf.H).astype(complex))


def _rms(error: Floats) -> float:
    x = error[np.isfinite(error)]
    return float(np.sqrt((x**2).mean()) * DB_PER_NEPER) if x.size else float("nan")


def as_of_one(largest: float, n: int) -> float:
    """Return the deviation of one normal value that is as improbable as the largest of n [-].

    One of a hundred is beyond 2.5 standard deviations in 7 of 10 cases.
    """
    chance = -np.expm1(n * np.log1p(-2 * ndtr(-largest))) if largest > 0 else 1.0
    return float(-ndtri(chance / 2))
