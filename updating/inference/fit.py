"""Fits of a reduced model to measured FRFs: nuisance parameters, the damping curve and candidate effects."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRF
from fem.analysis.harmonic_balance import Receptances, Steady, solve_steady
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.model import Effect, ParameterRef, parameter_values
from fem.reduction.deviations import DeviatingFRF, Deviations
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import ReducedModel
from fem.summary import counted, span, summary
from updating.correlation import DB_PER_NEPER, log_ratio
from updating.inference.fit_data import FitData, sensor_vectors
from updating.inference.fit_function import LEVEL_FLOOR, ROBUST, FitFunction, propagated
from updating.inference.fit_result import FitResult
from updating.inference.mode_targets import ModeTargets
from updating.inference.parameters import DampingCurve, Nuisance
from updating.inference.solve import Solution
from updating.inference.unknowns import effect_unknowns, nuisance_unknowns
from updating.least_squares.loss import pseudo_huber

if TYPE_CHECKING:
    from updating.inference.scatter import Scatter

INDEPENDENT_PER_MODE = 8.0
"""How many independent data one mode of the band stands for, against the priors."""


NOISE_COUNTED = 4.0
"""For how many times the independent data noise stands there, where the model's form is said to be right: it
is another at every line and sensor."""


ITERATIONS = 14
"""At most so many iterations in each band of a fit."""


_FULL_FITS = 6
"""Starts of an effect that are fitted to all lines, besides its given values."""


EXPLAINED_LEVEL = 0.3
"""Residual level up to which a model of beams counts as right, unless the caller says otherwise [nepers]."""


@dataclass(frozen=True, slots=True, eq=False)
class FitProblem:
    """Everything that a fit needs but the candidates.

    Attributes
    ----------
    reduced : ReducedModel
    data : FitData
    nuisances : tuple of Nuisance
    damping : DampingCurve
    stages : ndarray
        Upper ends of the bands of the frequency continuation, rising; the last is the whole band [Hz].
    n_modes : int
        Elastic modes in the band.
    n_lines : int
        At most this many lines are fitted.
    fine_stages : ndarray
        More stages, for a fit that has ended in a minimum far from the data [Hz].
    model_error : float
        Residual level up to which a model counts as right, because beams are not the structure itself
        [nepers]; 0 if nothing but noise and the mesh may be left.
    scatter : Scatter, optional
        Small deviations that are uncertain in every fit.
    mesh_level : float
        Residual level that the elements leave of exact members [nepers].
    modes : ModeTargets or None
        Measured modes that the search by evidence fits beside the FRFs.
    decay : float
        σ of the complex frequencies ω - iσ at which the data are (:func:`updating.inference.damped.damped`)
        [rad/s].
    pieces : int
        Into how many each element of the model was cut for the data; 0 where that was not asked.
    """

    reduced: ReducedModel
    data: FitData
    nuisances: tuple[Nuisance, ...]
    damping: DampingCurve
    stages: NDArray[np.float64] = field(default_factory=lambda: np.array([np.inf]))
    n_modes: int = 10
    n_lines: int = 160
    fine_stages: NDArray[np.float64] = field(default_factory=lambda: np.array([np.inf]))
    model_error: float = EXPLAINED_LEVEL
    scatter: Scatter | None = None
    mesh_level: float = 0.0
    modes: ModeTargets | None = None
    decay: float = 0.0
    pieces: int = 0

    def __repr__(self) -> str:
        """Return the data, the unknowns and the size of the basis on one line."""
        data, vary = self.data.measurement, counted(len(self.nuisances), "uncertain parameter")
        band = span(self.data.frequency, "Hz")
        ends = f"{counted(len(data.sensors), 'sensor')}, {counted(len(data.excitations), 'excitation')}"
        size = f"{counted(self.n_modes, 'mode')} in {band}"
        return summary(self, f"{vary}, {size}, at most {counted(self.n_lines, 'line')} fitted; {ends}")

    @property
    def form_right(self) -> bool:
        """Whether nothing but noise and the mesh may be left."""
        return self.model_error == 0

    @property
    def noise_counted(self) -> float:
        """For how many times the independent data noise stands in covariances."""
        return NOISE_COUNTED if self.form_right else 1.0

    @property
    def vectors(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Sensors and excitations as combinations of DOFs."""
        outputs, inputs, *_ = self._ends
        return outputs, inputs

    @property
    def _ends(self) -> tuple[NDArray[np.float64], ...]:
        """Sensors and excitations as combinations of DOFs, and of the basis's columns (computed once)."""
        ends = (tuple(each) for each in (self.data.measurement.sensors, self.data.measurement.excitations))
        vectors = (
            self.reduced.projected(each, partial(sensor_vectors, self.reduced.model, each)) for each in ends
        )
        (outputs, on_outputs), (inputs, on_inputs) = vectors
        return outputs, inputs, on_outputs, on_inputs

    def engine(
        self,
        frequency: NDArray[np.float64],
        refs: Sequence[ParameterRef] = (),
        effects: Sequence[Effect] = (),
        release: Sequence[tuple[str, str]] = (),
        deviations: Deviations | None = None,
    ) -> ParametricFRF:
        """Return the sensors' receptances as a function of parameters.

        Parameters
        ----------
        frequency : ndarray (n_freq,)
            Frequencies [Hz].
        refs : sequence of (effect, parameter)
            The parameters that vary.
        effects : sequence of Effect
            Candidates that are added to the model.
        release : sequence of (str, str)
            Keys of constraints that are released besides those that the candidates release.
        deviations : Deviations, optional
            Their sizes stand behind the parameters.
        """
        *_, outputs, inputs = self._ends
        make = ParametricFRF if deviations is None else partial(DeviatingFRF, deviations)
        return make(
            self.reduced, outputs, inputs, frequency, refs, effects, release, projected=True, decay=self.decay
        )  # fmt: skip

    def lines_up_to(self, frequency: float, n_lines: int) -> NDArray[np.int64]:
        """Return at most ``n_lines`` evenly spaced lines, not held out, up to a frequency."""
        lines = np.flatnonzero((self.data.frequency <= frequency) & ~self.data.held_out)
        if len(lines) <= n_lines:
            return lines
        return lines[np.unique(np.linspace(0, len(lines) - 1, n_lines).round().astype(int))]

    def band_of(self, lines: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return which of up to four bands with equally many modes each line is in.

        Each has an error level of its own.
        """
        knots = self.damping.knots
        edges = np.quantile(knots, [0.25, 0.5, 0.75]) if len(knots) > 4 else np.zeros(0)
        return np.searchsorted(edges, self.data.frequency[lines])

    def n_independent(self, stage: float = np.inf) -> float:
        """Return how many independent data the lines up to a frequency stand for, against the priors."""
        return INDEPENDENT_PER_MODE * max(3.0, self.n_modes * min(1.0, stage / self.data.frequency[-1]))

    def fit(
        self,
        effects: Sequence[Effect] = (),
        starts: Sequence[dict[str, float]] = (),
        *,
        stages: Iterable[float] | None = None,
        n_lines: int | None = None,
        max_iterations: int = ITERATIONS,
        x_from: FitResult | None = None,
        assess: bool = True,
    ) -> FitResult:
        """Fit nuisance parameters, damping and the parameters of effects.

        Parameters
        ----------
        effects : sequence of Effect
            Candidates to add to the model.
        starts : sequence of dict
            For each of them the parameter values to start from.
        stages : iterable of float, optional
            Other stages of the continuation [Hz].
        n_lines : int, optional
        max_iterations : int
            In each stage.
        x_from : FitResult, optional
            Start nuisance parameters and damping there rather than at the nominal values.
        assess : bool
            Whether to compute the errors on all lines too.
        """
        x: NDArray[np.float64] | None = None
        result: FitResult | None = None
        for stage in stages if stages is not None else self.stages:
            function = self.function(effects, starts, self.lines_up_to(stage, n_lines or self.n_lines))
            if x is None:
                x = function.start if x_from is None else function.moved_to(x_from)
            solution = function.minimise(x, stage, max_iterations)
            x, result = solution.x, function.result(solution)
        assert result is not None
        return self.assessed(result) if assess else result

    def fit_anew(self, effects: Sequence[Effect] = (), starts: Sequence[dict[str, float]] = ()) -> FitResult:
        """Return the better of fits from nominal uncertain parameters in few stages and in fine ones.

        Its errors are not computed.

        Parameters
        ----------
        effects : sequence of Effect
            Candidates to add to the model.
        starts : sequence of dict
            For each of them the parameter values to start from.
        """
        fits = (self.fit(effects, starts, stages=s, assess=False) for s in (self.stages, self.fine_stages))
        return min(fits, key=lambda r: r.solution.cost)

    def fit_from_starts(self, effects: Sequence[Effect]) -> FitResult:
        """Return the best fit of given effects: from their values, and from each of their own starts.

        The cost has several minima, for instance of a joint between free and rigid. Fits to a few lines rank
        the starts. That ranking is rough: the given values and the first of the others are fitted to all
        lines.

        Parameters
        ----------
        effects : sequence of Effect
            With the values to start from first.
        """
        given = [parameter_values(e) for e in effects]
        sets = [given]
        for k, effect in enumerate(effects):
            sets += [[*given[:k], s, *given[k + 1 :]] for s in effect.starts(self.surroundings)]
        few, whole = self.n_lines // 4, self.stages[-1:]
        quick = [self.fit(effects, starts, stages=whole, n_lines=few, assess=False) for starts in sets]
        ranked = sorted(quick, key=lambda r: r.solution.cost)[:_FULL_FITS]
        fits = [self.fit(effects, given, assess=False), *(self.refit(r, assess=False) for r in ranked)]
        return self.assessed(min(fits, key=lambda r: r.solution.cost))

    def refit(self, result: FitResult, x_from: FitResult | None = None, *, assess: bool = True) -> FitResult:
        """Fit the effects of a result again, from its values: on the whole band at once.

        A part of the band would not determine all, such as the extent of a mass.

        Parameters
        ----------
        result : FitResult
            Its effects are fitted, from their values.
        x_from : FitResult, optional
            Start nuisance parameters and damping there rather than at the result's.
        assess : bool
            Whether to compute the errors on all lines too.
        """
        starts = [parameter_values(e) for e in result.effects]
        whole = [self.stages[-1]]
        return self.fit(result.effects, starts, stages=whole, x_from=x_from or result, assess=assess)

    def function(
        self, effects: Sequence[Effect], starts: Sequence[dict[str, float]], lines: NDArray[np.int64]
    ) -> FitFunction:
        """Return the residuals at some lines as a function of all that varies.

        Parameters
        ----------
        effects : sequence of Effect
            Candidates to add to the model.
        starts : sequence of dict
            For each of them the parameter values to start from.
        lines : ndarray of int
        """
        fixed = {ref for e in effects for ref in e.replaces()}
        varying = [n for n in self.nuisances if (n.effect, n.parameter) not in fixed]
        nuisance = nuisance_unknowns(self.reduced.model, varying)
        variables = (*nuisance, *effect_unknowns(effects, starts))
        start = np.concatenate([[v.start for v in variables], np.log(self.damping.start)])
        return FitFunction(self, tuple(effects), variables, start, lines).with_scatter(self.scatter)

    def surroundings(self, key: tuple[str, str], n_lines: int = 30) -> float:
        """Return the median impedance of the structure to motion along a released constraint.

        It is the magnitude of force over displacement, at lines over the whole band [N/m, N·m/rad].
        """
        omega2 = (2 * np.pi * self.data.frequency[self.lines_up_to(np.inf, n_lines)]) ** 2
        return self.reduced.impedance(key, omega2)

    def receptance(self, result: FitResult, lines: NDArray[np.int64] | None = None) -> NDArray[np.complex128]:
        """Return the fitted model's receptances as the sensors would read them, at some or all lines."""
        lines = np.arange(len(self.data.frequency)) if lines is None else lines
        if any(e.amplitude_dependent for e in result.effects):
            return self.steady(result, lines).H
        f = self.data.frequency[lines]
        refs = list(result.values)
        engine = self.engine(f, refs, result.effects)
        zeta = self.damping.ratio(f, result.zeta)
        H, _, _ = engine.evaluate(np.array([result.values[r] for r in refs]), zeta, gradient=False)
        return H

    def vectors_with(self, element: AmplitudeDependent) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return sensors and excitations, each with the motion that an element acts on as the last."""
        b = np.zeros((self.reduced.model.n_dof, 1))
        dofs, row = element.strain(self.reduced.model, element.direction)
        b[dofs, 0] = row
        outputs, inputs = self.vectors
        return np.hstack([outputs, b]), np.hstack([inputs, b])

    def steady(self, result: FitResult, lines: NDArray[np.int64]) -> Steady:
        """Return the steady vibration at the data's level of force with one effect that depends on amplitude.

        Without a level the effect keeps the amplitude that it has.
        """
        (element,) = (e for e in result.effects if isinstance(e, AmplitudeDependent))
        linear = [e for e in result.effects if e is not element]
        refs = [ref for ref in result.values if ref[0] != element.name]
        f = self.data.frequency[lines]
        engine = ParametricFRF(self.reduced, *self.vectors_with(element), f, refs, linear)
        zeta = self.damping.ratio(f, result.zeta)
        block, _, _ = engine.evaluate(np.array([result.values[r] for r in refs]), zeta, gradient=False)
        measured = np.where(self.data.mask[lines], self.data.H[lines], 0.0)
        force = self.data.measurement.force_level
        return solve_steady(element, force, Receptances.of(block), measured)

    def deviation(
        self, result: FitResult, lines: NDArray[np.int64] | None = None
    ) -> NDArray[np.float64] | None:
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
        function = replace(self, data=every).function(result.effects, starts, lines)
        x = function.moved_to(result)
        if len(result.covariance) != len(x):
            return None
        return propagated(function, x, function.units, result.covariance).reshape(function.keep.shape)

    def nominal(self) -> FitResult:
        """Return the model as it was given, unfitted."""
        n = len(self.nuisances)
        variables = nuisance_unknowns(self.reduced.model, self.nuisances)
        empty = Solution(np.zeros(n), np.nan, np.nan, np.zeros((n, n)), 0, True)
        values = {v.ref: v.to_value(v.mean) for v in variables}
        zero = dict.fromkeys(values, 0.0)
        return self.assessed(FitResult(empty, values, zero, self.damping.start, (), np.nan, np.nan, np.nan))

    def with_even_damping(self, result: FitResult) -> FitResult:
        """Return a result whose damping ratios are a power of frequency, by medians of slopes and of levels.

        A fit may leave a part of the band with ratios far from its neighbours', where they cost little: of
        eight knots two may be anything. Theil and Sen's line through ln ζ over ln f at the knots (Sen, *J.
        Am. Stat. Assoc.* 63, 1968, 1379).
        """
        n = len(self.damping.knots)
        f, zeta = np.log(self.damping.knots), np.log(result.zeta[:n])
        i, j = np.triu_indices(n, 1)
        slope = float(np.median((zeta[j] - zeta[i]) / (f[j] - f[i]))) if n > 1 else 0.0
        even = slope * f + np.median(zeta - slope * f)
        lo, hi = self.damping.limits[:n].T
        return replace(result, zeta=np.concatenate([np.exp(np.clip(even, lo, hi)), result.zeta[n:]]))

    def strains(self, result: FitResult) -> dict[ParameterRef, float]:
        """Return how far nuisance parameters lie from their nominal values, in prior standard deviations."""
        variables = nuisance_unknowns(self.reduced.model, self.nuisances)
        known = ((v, v.to_x(result.values[v.ref])) for v in variables if v.ref in result.values)
        return {v.ref: (x - v.mean) / v.std for v, x in known if v.has_prior}

    def at_nominal(self, result: FitResult) -> FitResult:
        """Return a result with the nuisance parameters of the model back at their nominal values.

        Damping stays.
        """
        own = {e.name for e in self.reduced.model.effects}
        nominal = self.reduced.model.values()
        return replace(result, values={r: nominal[r] if r[0] in own else v for r, v in result.values.items()})

    def assessed(self, result: FitResult) -> FitResult:
        """Return a result with its errors on fitted and on held-out lines."""
        held, ratio = self.data.held_out, self.log_ratio(result)
        lines = np.arange(len(held))
        return replace(
            result,
            fit_db=_rms(ratio.real[~held]),
            held_out_db=_rms(ratio.real[held]),
            level=self.level(ratio[~held], lines[~held]) if np.isnan(result.level) else result.level,
            held_out_level=self.level(ratio[held], lines[held]),
            unseen=self._unseen(ratio[held], lines[held]),
        )

    def _unseen(self, ratio: NDArray[np.complex128], lines: NDArray[np.int64]) -> float:
        """Return Σ n_b/2 ln(s² + level_b²) over bands b of lines, for a third of the data of a fit."""
        bands, mask = self.band_of(lines), self.data.mask[lines]
        size = np.bincount(bands, mask.sum(axis=(1, 2)))
        share = self.n_independent() / 3 * size / max(size.sum(), 1)
        levels = [self.level(ratio[bands == b], lines[bands == b]) for b in np.flatnonzero(size)]
        return 0.5 * float(share[size > 0] @ np.log(LEVEL_FLOOR**2 + np.square(levels)))

    def level(self, ratio: NDArray[np.complex128], lines: NDArray[np.int64] | NDArray[np.bool_]) -> float:
        """Return the robust residual level of log ratios at some lines, amplitude and phase [nepers].

        NaN if none of them counts.
        """
        r = np.abs(self.data.weight[lines] * ratio)
        if np.isnan(r).all():
            return float("nan")
        return float(np.sqrt(np.nanmean(pseudo_huber(r, ROBUST))))

    def log_ratio(self, result: FitResult, lines: NDArray[np.int64] | None = None) -> NDArray[np.complex128]:
        """Return ln(computed / measured) at some or all lines, NaN where masked."""
        lines = np.arange(len(self.data.frequency)) if lines is None else lines
        ratio = log_ratio(self.receptance(result, lines), self.data.H[lines])
        return np.where(self.data.mask[lines], self.data.seen(ratio), complex("nan"))

    def frf(self, result: FitResult) -> FRF:
        """Return the fitted model's FRFs in the kind of the measurement."""
        return self._as_measured(self.receptance(result))

    @property
    def measured(self) -> FRF:
        """The measured FRFs as they were compared: in the band, wrong signs set right."""
        return self._as_measured(self.data.H)

    def _as_measured(self, H: NDArray[np.complex128]) -> FRF:
        m = self.data.measurement.frf
        frf = FRF.from_arrays(m.frequency, H, "receptance", m.outputs, m.inputs, m.base).as_kind(m.kind)
        return frf if self.data.phase else replace(frf, H=np.abs(frf.H).astype(complex))


def _rms(error: NDArray[np.float64]) -> float:
    x = error[np.isfinite(error)]
    return float(np.sqrt((x**2).mean()) * DB_PER_NEPER) if x.size else float("nan")
