"""Fits of a reduced model to measured FRFs.

What is fitted are nuisance parameters, the damping curve and candidate effects.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRF
from fem.analysis.harmonic_balance import Receptances, Steady, solve_steady
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.model import Effect, Model, ParameterRef, parameter_values
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import ReducedModel
from updating.correlation import DB_PER_NEPER, log_ratio
from updating.inference.loss import pseudo_huber
from updating.inference.parameters import DampingCurve, Nuisance
from updating.inference.solve import Prior, Residual, Solution, solve_robust
from updating.inference.unknowns import ScaledUnknown, effect_unknowns, nuisance_unknowns
from updating.measurement.measurement import Measurement, MeasurementError, Sensor, sensor_point
from updating.measurement.noise import relative_noise

INDEPENDENT_PER_MODE = 8.0
"""How many independent data one mode of the band stands for, against the priors."""

SYSTEMATIC_SHARE, SYSTEMATIC_FROM = 0.0625, 1.25
"""For which share of the independent data that stands, in covariances, which a fit leaves beyond a multiple
of the noise: an error of the model is much the same at neighbouring lines and sensors."""

NOISE_COUNTED = 4.0
"""For how many times the independent data noise stands there, where the model's form is said to be right: it
is another at every line and sensor."""

ITERATIONS = 14
"""At most so many iterations in each band of a fit."""

ROBUST = 0.5
"""Residual at which the loss turns from quadratic to linear [nepers]."""

NOISE_LIMIT = 0.2
"""Lines with more relative noise than this are not compared [-]."""

TRANSVERSE = 0.01
"""Share of the motion square to a sensor that its reading may hold, where the model's form is not said to be
right [-]: accelerometers hear one to three per cent of it, and nobody mounts them straighter."""

LEAST_HEARD = 0.2
"""FRFs that are more than noise at no more than this share of the lines are not compared at any [-]."""

MODEL_ERROR = 0.05
"""Relative accuracy that is asked of a model where the measurement is better than that [-]."""

EXPLAINED_LEVEL = 0.3
"""Residual level up to which a model of beams counts as right, unless the caller says otherwise [nepers]."""

BEAMS_LEAVE = 1 / 3
"""Share of that level which the form of beams may leave of any structure."""

LEVEL_FLOOR = 0.01
"""Residual level below which nothing is gained [nepers]."""


def sensor_vectors(model: Model, sensors: Sequence[Sensor]) -> NDArray[np.float64]:
    """Return sensors as combinations of DOFs, shape (n_dof, n).

    Raises
    ------
    MeasurementError
        If the mesh has no point where a sensor sits (see
        :func:`updating.measurement.measurement.place_sensors`).
    """
    out = np.zeros((model.n_dof, len(sensors)))
    for i, sensor in enumerate(sensors):
        point = sensor_point(model.mesh, sensor)
        out[6 * point : 6 * point + 3, i] = sensor.gain * np.asarray(sensor.direction)
    return out


@dataclass(frozen=True, slots=True, eq=False)
class FitData:
    """Measured receptances, prepared for fits.

    Attributes
    ----------
    measurement : Measurement
    frequency : ndarray (n_freq,)
        All lines that count [Hz].
    H : ndarray (n_freq, n_out, n_in)
        Receptances.
    mask : ndarray of bool (n_freq, n_out, n_in)
        Values that count: not those of FRFs that are zero by symmetry, nor those with noise above
        ``NOISE_LIMIT``, nor those that are exactly 0, which nothing was measured at, nor those of sensors
        that may have read as much of what moves square to them.
    weight : ndarray (n_freq, n_out, n_in)
        Weight of each residual, 1 where noise and that are small beside ``MODEL_ERROR``.
    noise : ndarray (n_freq, n_out, n_in)
        Relative noise of the amplitude [-].
    held_out : ndarray of bool (n_freq,)
        Lines that no fit sees.
    """

    measurement: Measurement
    frequency: NDArray[np.float64]
    H: NDArray[np.complex128]
    mask: NDArray[np.bool_]
    weight: NDArray[np.float64]
    noise: NDArray[np.float64]
    held_out: NDArray[np.bool_]

    @property
    def uncertain(self) -> NDArray[np.float64]:
        """Relative uncertainty of each reading: noise, and what moves square to the sensor [-]."""
        weight = np.where(self.mask & (self.weight > 0), self.weight, 1.0)
        return np.maximum(MODEL_ERROR * np.sqrt(np.maximum(weight**-2 - 1, 0.0)), self.noise)

    @property
    def noise_db(self) -> float:
        """Root mean square of the noise of the FRFs that count [dB]."""
        return float(np.sqrt((self.noise[self.mask] ** 2).mean()) * DB_PER_NEPER)

    @property
    def noise_level(self) -> float:
        """Residual level that noise alone leaves, amplitude and phase [nepers]."""
        return float(np.sqrt((2 * (self.weight * self.noise)[self.mask] ** 2).mean()))


def prepare(
    measurement: Measurement,
    computed: NDArray[np.complex128] | None = None,
    band: tuple[float, float] | None = None,
    n_blocks: int = 20,
    across: NDArray[np.float64] | None = None,
) -> FitData:
    """Prepare measured FRFs for fits.

    Every fourth of ``n_blocks`` blocks of lines is held out. An FRF is left out if its level, computed and
    measured, lies more than 60 dB (measured: 50 dB) under the median level of all, or if it is noise at most
    lines, or no more there than ``TRANSVERSE`` of the motion across its sensor. What the measurement says of
    the values that count goes before that.

    Parameters
    ----------
    measurement : Measurement
    computed : ndarray (n_freq, n_out, n_in), optional
        Receptances of the nominal model at the measurement's lines in the band.
    band : (float, float), optional
        Frequencies that count [Hz].
    n_blocks : int
    across : ndarray (n_freq, n_out, n_in), optional
        How far each sensor's place moves square to it, as receptances, where that may be in the readings.

    Raises
    ------
    MeasurementError
        If all FRFs are zero.
    """
    frf = measurement.frf.select(band=band) if band else measurement.frf
    if frf.frequency[0] == 0:
        frf = frf.select(lines=np.arange(1, frf.n_freq))
    H = frf.as_kind("receptance").H
    level = np.sqrt((np.abs(frf.H) ** 2).mean(axis=0))
    if not level.any():
        msg = f"all FRFs of '{measurement.name}' are zero"
        raise MeasurementError(msg)
    kept = measurement.with_frf(frf)
    noise = _noise_of(kept)
    uncertain = noise
    if across is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            uncertain = np.hypot(noise, np.nan_to_num(TRANSVERSE * across / np.abs(H), nan=0.0, posinf=10.0))
    mask = counted_values(frf, uncertain, computed)
    if kept.compared is not None:
        mask = np.where(np.isfinite(kept.compared), kept.compared > 0, mask) & (H != 0)
    weight = MODEL_ERROR / np.sqrt(MODEL_ERROR**2 + uncertain**2) * mask
    block = np.arange(frf.n_freq) * n_blocks // frf.n_freq
    return FitData(kept, frf.frequency, H, mask, weight, noise, block % 4 == 2)


def counted_values(
    frf: FRF, uncertain: NDArray[np.float64], computed: NDArray[np.complex128] | None = None
) -> NDArray[np.bool_]:
    """Return which values of measured FRFs count, (n_freq, n_out, n_in): in comparisons, fits and updates.

    Parameters
    ----------
    frf : FRF
        As measured.
    uncertain : ndarray (n_freq, n_out, n_in)
        Relative uncertainty of each reading [-].
    computed : ndarray (n_freq, n_out, n_in), optional
        Receptances of the nominal model, of which those that symmetry makes zero are told.
    """
    level = np.sqrt((np.abs(frf.H) ** 2).mean(axis=0))
    mask = level > 10 ** (-50 / 20) * np.median(level[level > 0])
    if computed is not None:
        acceleration = np.abs(computed) * (2 * np.pi * frf.frequency[:, None, None]) ** 2
        calculated = np.sqrt((acceleration**2).mean(axis=0))
        mask &= calculated > 10 ** (-60 / 20) * np.median(calculated)
    mask = mask & (uncertain < NOISE_LIMIT) & (frf.H != 0)
    return mask & (mask.mean(axis=0) > LEAST_HEARD)


def _noise_of(measurement: Measurement) -> NDArray[np.float64]:
    """Return the relative noise that is known from coherence or repeats, or else that of the data.

    What is known is kept between a millionth and 10, and what is infinite, as where H is 0, is 10, so that
    weights and ratios stay finite.
    """
    noise, known = relative_noise(measurement.frf.H), measurement.noise
    if known is not None:
        noise = np.where(np.isnan(known), noise, known)
    return np.clip(noise, 1e-6, 10.0) if known is not None else np.where(np.isfinite(noise), noise, 10.0)


@dataclass(frozen=True, slots=True, eq=False)
class FitResult:
    """A fitted model.

    Attributes
    ----------
    solution : Solution
    values : mapping of (effect, parameter) to float
        Values of all parameters that varied.
    std : mapping of (effect, parameter) to float
        Standard deviations: linearised, of parameters that are fitted in the logarithm half the width of the
        interval.
    zeta : ndarray (n_unknowns,)
        The damping curve's unknowns: first the ratios at its knots [-].
    effects : tuple of Effect
        The added effects at their fitted values.
    fit_db, held_out_db : float
        Root mean square of the amplitude's error on the lines fitted and held out [dB].
    level, held_out_level : float
        Robust residual level, amplitude and phase, on the lines fitted and held out [nepers].
    covariance : ndarray (n, n)
        Of the values, in their order, and the damping curve's unknowns: of ln θ for positive parameters and
        these unknowns, and of θ for others. Empty for what was not fitted.
    unseen : float
        Negative log likelihood of the lines held out, as that of the fitted ones is minimised [-]; NaN unless
        it was assessed.
    audible_db : float
        ``fit_db``, where what is computed to be less than the noise of the measured value counts as that
        noise [dB]; NaN unless it was assessed.
    """

    solution: Solution
    values: Mapping[ParameterRef, float]
    std: Mapping[ParameterRef, float]
    zeta: NDArray[np.float64]
    effects: tuple[Effect, ...]
    fit_db: float
    held_out_db: float
    level: float
    held_out_level: float = np.nan
    covariance: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    unseen: float = np.nan
    audible_db: float = np.nan


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

    @property
    def form_right(self) -> bool:
        """Whether nothing but noise and the mesh may be left."""
        return self.model_error == 0

    @property
    def beams_leave(self) -> float:
        """Residual level that the form of beams may leave of any structure, and 0 where it is right."""
        return BEAMS_LEAVE * self.model_error

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
        """
        *_, outputs, inputs = self._ends
        return ParametricFRF(self.reduced, outputs, inputs, frequency, refs, effects, release, projected=True)

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

        The cost has several minima, for instance of a joint between free and rigid.

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
        best = sets[int(np.argmin([r.solution.cost for r in quick]))]
        return self.fit(effects, best)

    def refit(self, result: FitResult, x_from: FitResult | None = None, *, assess: bool = True) -> FitResult:
        """Fit what a result holds once more, from where it is: on the whole band at once.

        A part of the band would not hold what only the rest shows, such as how wide a mass is spread.

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

    def fit_without(self, result: FitResult, name: str) -> FitResult:
        """Fit what a result holds but for one effect, from where it is and stage by stage.

        Parameters
        ----------
        result : FitResult
        name : str
            The effect's.
        """
        less = replace(result, effects=tuple(e for e in result.effects if e.name != name))
        staged = self.fit(less.effects, [parameter_values(e) for e in less.effects], x_from=result)
        return min(self.refit(less), staged, key=lambda r: r.solution.cost)

    def function(
        self, effects: Sequence[Effect], starts: Sequence[dict[str, float]], lines: NDArray[np.int64]
    ) -> "FitFunction":
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
        return FitFunction(self, tuple(effects), variables, start, lines)

    def surroundings(self, key: tuple[str, str], n_lines: int = 30) -> float:
        """Return the median impedance of the structure to motion along a released constraint.

        It is the magnitude of force over displacement, at lines over the whole band [N/m, N·m/rad].
        """
        basis, total = self.reduced.basis, self.reduced.base_sum
        lam, V = self.reduced.main_modes
        m = basis.n_main
        column = m + basis.keys.index(key)
        omega2 = (2 * np.pi * self.data.frequency[self.lines_up_to(np.inf, n_lines)]) ** 2
        # What is left of Z at the constraint once all other coordinates have followed.
        k, mass = (total[x][:, column] for x in "KM")
        coupling = (V.T @ k[:m]) * (1 + 0.02j) - omega2[:, None] * (V.T @ mass[:m])
        others = lam * (1 + 0.02j) - omega2[:, None]
        Z = k[column] * (1 + 0.02j) - omega2 * mass[column] - (coupling**2 / others).sum(axis=1)
        return float(1 / np.median(1 / np.abs(Z)))

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

    def assessed(self, result: FitResult, n_lines: int | None = None) -> FitResult:
        """Return a result with its errors on fitted and on held-out lines.

        On all of them, or on about ``n_lines``, each kind evenly spaced.
        """
        held = self.data.held_out
        lines = np.arange(len(held))
        if n_lines is not None:
            step = max(1, len(held) // n_lines)
            lines = np.sort(np.concatenate([np.flatnonzero(held)[::step], np.flatnonzero(~held)[::step]]))
        ratio, held = self.log_ratio(result, lines), held[lines]
        # The computed value may be as near 0 as it likes, and the measured one is not, because of its noise.
        with np.errstate(divide="ignore"):
            audible = np.maximum(ratio.real, np.log(self.data.noise[lines]))
        return replace(
            result,
            fit_db=_rms(ratio.real[~held]),
            held_out_db=_rms(ratio.real[held]),
            level=self.level(ratio[~held], lines[~held]) if np.isnan(result.level) else result.level,
            held_out_level=self.level(ratio[held], lines[held]),
            unseen=self._unseen(ratio[held], lines[held]),
            audible_db=_rms(audible[~held]),
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
        return np.where(self.data.mask[lines], ratio, complex("nan"))

    def frf(self, result: FitResult) -> FRF:
        """Return the fitted model's FRFs in the kind of the measurement."""
        return self._as_measured(self.receptance(result))

    @property
    def measured(self) -> FRF:
        """The measured FRFs as they were compared: in the band, wrong signs set right."""
        return self._as_measured(self.data.H)

    def _as_measured(self, H: NDArray[np.complex128]) -> FRF:
        m = self.data.measurement.frf
        return FRF.from_arrays(m.frequency, H, "receptance", m.outputs, m.inputs).as_kind(m.kind)


@dataclass(eq=False)
class FitFunction:
    """Residuals of a fit at some lines, as a function of all that varies.

    x holds the variables (nuisance parameters, then those of the effects) and the logarithms of the damping
    curve's unknowns.

    Attributes
    ----------
    problem : FitProblem
    effects : tuple of Effect
    variables : tuple of ScaledUnknown
    start : ndarray (n,)
    lines : ndarray of int
    """

    problem: FitProblem
    effects: tuple[Effect, ...]
    variables: tuple[ScaledUnknown, ...]
    start: NDArray[np.float64]
    lines: NDArray[np.int64]

    @property
    def keep(self) -> NDArray[np.bool_]:
        """Which values count, (n_lines, n_out, n_in)."""
        return self.problem.data.mask[self.lines]

    # The engine is made at the first evaluation: many functions are made for their bounds and priors alone.

    @cached_property
    def _engine(self) -> ParametricFRF:
        frequency = self.problem.data.frequency[self.lines]
        return self.problem.engine(frequency, [v.ref for v in self.variables], self.effects)

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
        keep, weight = self.keep, self.problem.data.weight[self.lines]
        n_par, (hats, offset) = len(self.variables), self._damping
        values = np.array([v.to_value(xi) for v, xi in zip(self.variables, x[:n_par], strict=True)])
        zeta = np.exp(hats @ x[n_par:] + offset)
        H, dH, dH_dzeta = self._engine.evaluate(values, zeta, gradient)
        r = np.nan_to_num(weight * log_ratio(H, self._measured), nan=0.0)[keep]
        if not gradient or dH is None or dH_dzeta is None:
            return r, None
        per = np.where(H != 0, weight / np.where(H != 0, H, 1.0), 0.0)
        J = np.empty((len(x), r.size), dtype=complex)
        for k, v in enumerate(self.variables):
            J[k] = v.slope(x[k]) * (dH[k] * per)[keep]
        base = dH_dzeta * per
        J[n_par:] = by_unknowns(zeta, hats, base)[:, keep]
        return r, J

    @property
    def units(self) -> NDArray[np.float64]:
        """Size of one unit of each x: 1 where it is a logarithm, or in that of the parameter."""
        return np.array([*(v.size for v in self.variables), *np.ones(len(self.problem.damping.start))])

    @property
    def relative(self) -> NDArray[np.bool_]:
        """Which x is in parts of a scale, (n,), rather than a logarithm."""
        damping = [False] * len(self.problem.damping.start)
        return np.array([*(not v.log for v in self.variables), *damping])

    def prior(self) -> Prior:
        """Return what is known of x beforehand."""
        damping = self.problem.damping
        start = np.log(damping.start)
        means = [[v.mean for v in self.variables], start]
        stds = [[v.std for v in self.variables], np.full(len(start), damping.std)]
        return Prior(np.concatenate(means), np.concatenate(stds))

    def moved_to(self, result: "FitResult") -> NDArray[np.float64]:
        """Return the start with nuisance parameters and damping of a result."""
        x, n_par = self.start.copy(), len(self.variables)
        for k, v in enumerate(self.variables):
            if v.has_prior and v.ref in result.values:
                x[k] = v.to_x(result.values[v.ref])
        x[n_par:] = np.log(result.zeta)
        return x

    def limits(self) -> NDArray[np.float64]:
        """Return the bounds of x, shape (n, 2)."""
        p = self.problem
        return np.vstack(
            [
                np.array([v.bounds() for v in self.variables]).reshape(-1, 2),
                p.damping.limits,
            ]
        )

    def minimise(self, x: NDArray[np.float64], stage: float, max_iterations: int) -> Solution:
        """Find the x of greatest posterior probability from a start."""
        p, limits = self.problem, self.limits()
        assert len(limits) == len(x)
        return solve_robust(
            self,
            x,
            self.prior(),
            (limits[:, 0], limits[:, 1]),
            n_independent=p.n_independent(stage),
            floor=LEVEL_FLOOR,
            noise=noise_squares(p.data, self.lines),
            systematic=SYSTEMATIC_SHARE,
            counted=p.noise_counted,
            groups=np.broadcast_to(p.band_of(self.lines)[:, None, None], self.keep.shape)[self.keep],
            robust=ROBUST,
            max_iterations=max_iterations,
            relative=self.relative,
        )

    def result(self, solution: Solution) -> FitResult:
        """Return a solution as values with standard deviations; its errors are not assessed."""
        x, n_par = solution.x, len(self.variables)
        values = {v.ref: v.to_value(xi) for v, xi in zip(self.variables, x[:n_par], strict=True)}
        sd = np.sqrt(np.maximum(np.diag(solution.covariance), 0.0))
        known = zip(self.variables, x[:n_par], sd[:n_par], strict=True)
        std = {v.ref: v.deviation(xi, deviation) for v, xi, deviation in known}
        fitted = tuple(
            e.with_values(**{p.name: values[e.name, p.name] for p in e.parameters()}) for e in self.effects
        )
        zeta, level = np.exp(x[n_par:]), float(np.sqrt(solution.misfit))
        covariance = solution.covariance * np.outer(self.units, self.units)
        return FitResult(solution, values, std, zeta, fitted, np.nan, np.nan, level, covariance=covariance)


def noise_squares(data: FitData, lines: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return how much of the squares of the weighted residuals at some lines is put down to noise, (m,)."""
    square = 2 * (SYSTEMATIC_FROM * data.weight[lines] * data.noise[lines]) ** 2
    return square[data.mask[lines]]


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


def by_unknowns(
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


def _rms(error: NDArray[np.float64]) -> float:
    x = error[np.isfinite(error)]
    return float(np.sqrt((x**2).mean()) * DB_PER_NEPER) if x.size else float("nan")
